//! The program: a quick report, and assertions on its data.

use serde_json::Value;

use std::path::PathBuf;
use std::process::{Command, Output};

use impinge::Elements;
use impinge_io::{ColoredMesh, Positions, write_ply};
use impinge_scenes::Model;
use tempfile::TempDir;

/// A folder for a test, in which the program runs.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command<'a>(&self, arguments: impl IntoIterator<Item = &'a str>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_impinge-paper"));
        command.current_dir(self.0.path()).args(arguments);
        command
    }

    fn run<'a>(&self, arguments: impl IntoIterator<Item = &'a str>) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn ply(&self, name: &str, model: &Model) {
        let Elements::Triangles(faces) = &model.elements else {
            panic!("PLY is for triangles");
        };
        let mesh = ColoredMesh {
            positions: &Positions::F32(model.positions.clone()),
            elements: &impinge_io::Elements::Triangles(faces.clone()),
            element_colors: None,
            colliding: None,
            name,
        };
        write_ply(&self.path(name), &[mesh]).unwrap();
    }
}

/// The text on standard error, after checking the exit code.
#[track_caller]
fn said(output: &Output, code: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    said
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// One number of each object of a list; 0 if it is null.
fn numbers(list: &Value, name: &str) -> Vec<f64> {
    let list = list.as_array().unwrap();
    list.iter()
        .map(|one| one[name].as_f64().unwrap_or(0.0))
        .collect()
}

fn report(folder: &Folder, out: &str) -> Value {
    let text = std::fs::read_to_string(folder.path(out).join("report.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap()
}

/// Frames of a run, and how many of them differ from the first contestant's.
fn differing(run: &Value) -> (u64, u64) {
    let count = |value: &Value| value.as_u64().unwrap();
    (count(&run["ms"]["n"]), count(&run["n_frames_differing"]))
}

/// What the quick report must contain, whatever meshes and adapters there are.
#[test]
fn the_quick_report_agrees_with_itself() {
    let folder = Folder::new();
    let mut command = folder.command(["--quick", "--out", "report"]);
    // Without a desktop session, drivers complain each time that a GPU is searched for.
    let run = command.env_remove("XDG_RUNTIME_DIR").output().unwrap();
    let complaints = said(&run, 0);
    assert!(!complaints.contains("XDG_RUNTIME_DIR"), "{complaints}");
    let printed = String::from_utf8(run.stdout).unwrap();
    assert!(
        printed.starts_with("4 surface benchmarks and 4 volume benchmarks"),
        "{printed}"
    );
    let report = report(&folder, "report");
    assert_eq!(report["is_quick"], true);
    let has_adapter = !report["adapter"].is_null();

    let (surfaces, volumes) = (list(&report["surfaces"]), list(&report["volumes"]));
    assert_eq!((surfaces.len(), volumes.len()), (4, 4));
    for scene in surfaces.iter().chain(volumes) {
        let runs = list(&scene["runs"]);
        let methods = |is_gpu: bool| -> Vec<&str> {
            let here = runs.iter().filter(|run| run["is_gpu"] == is_gpu);
            let mut methods: Vec<&str> = here.map(|run| run["method"].as_str().unwrap()).collect();
            methods.dedup();
            methods
        };
        assert_eq!(
            methods(false),
            ["clusters", "cells", "fwzs11"],
            "{}",
            scene["name"]
        );
        assert_eq!(methods(true).len(), if has_adapter { 3 } else { 0 });
        assert!(number(&scene["n_pairs"]["max"]) > 0.0, "{}", scene["name"]);
        for run in runs {
            let (n_frames, n_differing) = differing(run);
            assert!(
                n_frames > 0 && n_differing == 0,
                "{}: {run:#}",
                scene["name"]
            );
            // A contestant that ran all frames found the same pairs in all of them.
            if n_frames == scene["n_frames"].as_u64().unwrap() {
                assert_eq!(run["hash"], scene["hash"], "{}", scene["name"]);
            }
        }
        // Two densities of the grid, unless the paper's was the fastest.
        let lambdas: Vec<&Value> = runs
            .iter()
            .filter(|run| run["method"] == "cells" && run["is_gpu"] == false)
            .map(|run| &run["lambda"])
            .collect();
        assert_eq!(number(lambdas[0]), 1.0);
        let sweep = &list(&scene["sweep"])[0];
        assert!(list(&sweep["points"]).len() > 3);
    }
    let ball = &surfaces[0];
    assert_eq!(ball["n_elements"], serde_json::json!([15_000, 15_000]));
    assert_eq!(ball["n_frames_of_oracle"], 1);

    let rows = list(&report["duplicates"]);
    assert_eq!(rows.len(), 8);
    for row in rows {
        assert_eq!(
            (&row["is_subset"], &row["is_equal_without"]),
            (&Value::Bool(true), &Value::Bool(true))
        );
        let [without, with, owner] =
            ["without", "with", "owner"].map(|whose| number(&row[format!("n_colliding_{whose}")]));
        assert_eq!(without, owner, "{}", row["scene"]);
        assert!(
            with <= without && number(&row["times_checked"]) > 1.0,
            "{row:#}"
        );
    }
    // A table as large as the paper's loses pairs in some scene; a larger one loses fewer.
    assert!(rows.iter().any(|row| number(&row["missing_rate"]) > 0.0));
    let lost = numbers(&report["table_sizes"]["points"], "missing_rate");
    assert!(lost[0] > lost[lost.len() - 1] && lost[0] > 0.01, "{lost:?}");

    check_documents(&folder, has_adapter);
}

/// Every figure that a document names exists, and every table has the paper's rows.
fn check_documents(folder: &Folder, has_adapter: bool) {
    let read = |name: &str| std::fs::read_to_string(folder.path("report").join(name)).unwrap();
    let markdown = read("report.md");
    let links = markdown.split("](").skip(1);
    let links: Vec<&str> = links.filter_map(|part| part.split(')').next()).collect();
    // Figure 7, λ twice, steps and figure 5 at least once; eight pictures if there is an adapter.
    assert!(links.len() >= if has_adapter { 14 } else { 5 }, "{links:?}");
    for name in links {
        let bytes = std::fs::read(folder.path("report").join(name)).unwrap();
        let is_whole = match name.ends_with(".svg") {
            true => bytes.ends_with(b"</svg>\n") || bytes.ends_with(b"</svg>"),
            false => bytes.starts_with(b"\x89PNG"),
        };
        assert!(is_whole, "{name}");
    }
    for number in ["40,068", "2.77", "0.043", "4,645", "9.67"] {
        assert!(markdown.contains(&format!("*{number}*")), "{number}");
    }
    assert!(markdown.contains("## What differs from the paper"));
}

#[test]
fn a_stand_in_says_so_and_a_mesh_given_is_taken() {
    let folder = Folder::new();
    let scene = |more: &[&str], out: &str| {
        let all = [
            "--scene",
            "bunny",
            "--frames",
            "2",
            "--quick",
            "--backend",
            "cpu",
        ];
        let mut command = folder.command(all);
        command
            .args(more)
            .args(["--out", out])
            .env("IMPINGE_DATA", folder.path("nowhere"));
        let output = command.output().unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        report(&folder, out)["surfaces"][0].clone()
    };
    let stand_in = scene(&[], "stand-in");
    assert_eq!(stand_in["is_stand_in"], true);
    assert_eq!(stand_in["n_elements"][0], 69_450);
    let text = std::fs::read_to_string(folder.path("stand-in/report.md")).unwrap();
    assert!(text.contains("**a generated stand-in**") && text.contains("**Stand-ins.**"));
    assert!(text.contains("only the CPU was requested"));

    folder.ply("mine.ply", &impinge_scenes::surfaces::ball(3_000));
    for given in ["mine.ply", "bunny=mine.ply"] {
        let mine = scene(&["--mesh", given, "--lambda", "3"], "mine");
        assert_eq!(
            (&mine["is_stand_in"], &mine["n_elements"][0]),
            (&Value::Bool(false), &Value::from(3_000))
        );
        let lambdas = numbers(&mine["runs"], "lambda");
        assert_eq!(lambdas[1..3], [1.0, 3.0]);
    }
}

#[test]
fn misuse_is_refused() {
    let folder = Folder::new();
    folder.ply("ball.ply", &impinge_scenes::surfaces::ball(100));
    let refused = |more: &[&str]| {
        let mut arguments = Vec::new();
        arguments.extend(more);
        said(&folder.run(arguments), 2)
    };
    assert!(refused(&["--scene", "cow"]).contains("buddha"));
    assert!(refused(&["--mesh", "ball.ply"]).contains("for which benchmark?"));
    assert!(
        refused(&["--scene", "ball", "--mesh", "bunny=ball.ply"]).contains("not among the scenes")
    );
    assert!(refused(&["--wave-length", "0"]).contains("wave length"));
    assert!(refused(&["--frames", "0"]).contains("--frames"));
    let run = folder.run(["--scene", "bunny-7k", "--mesh", "ball.ply"]);
    let error = said(&run, 1);
    assert!(error.contains("tetrahedra"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_report_that_is_stopped_leaves_no_files() {
    let folder = Folder::new();
    let child = folder
        .command(["--frames", "100000", "--out", "report"])
        .args(["--scene", "ball", "--backend", "cpu"])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Long enough for the run to start; otherwise the signal ends it in another way.
    std::thread::sleep(std::time::Duration::from_secs(2));
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    assert!(said(&output, 130).contains("cancelled"));
    assert!(!folder.path("report").exists());
}
