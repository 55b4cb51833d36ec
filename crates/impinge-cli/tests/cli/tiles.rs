//! `impinge tiles`: gives the answer of the whole scene, in steps that may be killed.

use impinge::Elements;
use impinge_scenes::{Model, soup, surfaces};
use serde_json::Value;

use crate::harness::Folder;

/// Two bodies that run into themselves and each other.
fn bodies() -> Folder {
    let folder = Folder::new();
    let model: Model = soup::triangles(3_000, 0.08, 7);
    folder.ply("a.ply", &model);
    folder.ply("b.ply", &model.translated([0.01, 0.02, 0.03]));
    folder
}

fn whole(folder: &Folder) -> Value {
    let args = [
        "pairs",
        "a.ply",
        "b.ply",
        "--self",
        "--json",
        "--backend",
        "cpu",
        "--rows",
        "whole.npy",
    ];
    folder.run(args).json()
}

fn plan(folder: &Folder) {
    let args = [
        "tiles", "plan", "big", "a.ply", "b.ply", "--cap", "700", "--chunk", "1k", "--json",
    ];
    let plan = folder.run(args).json();
    assert!(
        plan["tiles"].as_u64().unwrap() > 5 && plan["units"] == 6,
        "{plan}"
    );
}

#[test]
fn steps_give_the_answer_of_the_whole() {
    let folder = bodies();
    let expected = whole(&folder);
    plan(&folder);
    for rank in ["0", "1"] {
        folder
            .run([
                "tiles",
                "scatter",
                "big",
                "--rank",
                rank,
                "--world-size",
                "2",
            ])
            .printed();
    }
    folder.run(["tiles", "run", "big", "--tile", "3"]).printed();
    let printed = folder.run(["tiles", "run", "big", "--json"]).printed();
    let rows: Vec<Value> = printed
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(
        (&rows[3]["kept"], &rows[2]["kept"]),
        (&true.into(), &false.into())
    );
    let merged = folder.run(["tiles", "merge", "big", "--json"]).json();
    assert!(merged["pairs"].as_u64().unwrap() > 1000);
    assert_eq!(
        (&merged["pairs"], &merged["hash"]),
        (&expected["pairs"], &expected["hash"])
    );
    let read = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert_eq!(read("big/rows.npy"), read("whole.npy"));
}

#[test]
fn a_step_gives_the_impacts_of_the_whole() {
    let folder = Folder::new();
    let models: [Model; 2] = [
        soup::triangles(1_500, 0.08, 7),
        soup::triangles(900, 0.1, 8),
    ];
    let mut files = Vec::new();
    for (ix, model) in models.iter().enumerate() {
        // Each vertex moves a little towards a vertex of another soup.
        let other = soup::triangles(model.n_elements(), 0.08, 20 + ix as u64);
        let mut end = model.clone();
        for (at, to) in end.positions.iter_mut().zip(&other.positions) {
            *at = std::array::from_fn(|axis| at[axis] + (to[axis] - at[axis]) / 16.0);
        }
        for (pose, model) in [model, &end].into_iter().enumerate() {
            files.push(format!("body{ix}-{pose}.ply"));
            folder.ply(&files[files.len() - 1], model);
        }
    }
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let expected = folder
        .run(
            [
                &["step", "--start", "report"],
                &files[..],
                &["--json", "--rows", "whole.npy"],
            ]
            .concat(),
        )
        .json();
    let plan = [
        &["tiles", "plan", "big", "--step", "--cap", "300", "--json"],
        &files[..],
    ]
    .concat();
    let plan = folder.run(plan).json();
    assert!(
        plan["tiles"].as_u64().unwrap() > 5 && plan["step"] == true,
        "{plan}"
    );
    for step in ["scatter", "run"] {
        folder.run(["tiles", step, "big"]).printed();
    }
    let text = folder.run(["tiles", "merge", "big"]).printed();
    let n = |kind: &str| expected["kinds"][kind].as_u64().unwrap();
    assert!(n("vf") > 100 && n("ee") > 300, "{expected}");
    assert!(
        text.contains(" vf, ") && text.contains("touching at the start"),
        "{text}"
    );
    assert!(
        text.contains("whether the start intersects was not asked"),
        "{text}"
    );
    let merged = folder.run(["tiles", "merge", "big", "--json"]).json();
    assert_eq!(
        (&merged["pairs"], &merged["hash"]),
        (&expected["impacts"], &expected["hash"])
    );
    let named = merged["files"].as_array().unwrap();
    assert_eq!(named.len(), files.len());
    for (path, file) in named.iter().zip(&files) {
        assert!(path.as_str().unwrap().ends_with(file), "{path}, {file}");
    }
    assert_eq!(merged["step"]["start_intersects"], Value::Null);
    for key in ["free", "earliest", "touching_at_start"] {
        assert_eq!(merged["step"][key], expected[key], "{key}");
    }
    let kinds = merged["step"]["kinds"].as_object().unwrap();
    assert!(kinds.iter().all(|(kind, n)| expected["kinds"][kind] == *n));
    let read = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert_eq!(read("big/rows.npy"), read("whole.npy"));
    // Options that a plan without a step does not have are refused, and so is a body without an
    // end.
    let alone = folder.run(["tiles", "plan", "odd", "--step", files[0]]);
    assert!(alone.misuse().contains("body0-0.ply without an end"));
    // Neighbours never count in a step: either rule is the same question.
    for rule in ["resolve", "skip"] {
        let printed = folder
            .run(["tiles", "run", "big", "--shared-vertex", rule])
            .printed();
        let (first, _) = printed.split_once(" tiles, ").unwrap();
        assert!(printed.contains(&format!("{first} kept")), "{printed}");
    }
}

#[test]
fn a_step_with_a_separation_and_welded_vertices_gives_the_impacts_of_the_whole() {
    let folder = Folder::new();
    // Balls whose triangles have corners of their own: without welding each is near its neighbours.
    let ball = surfaces::ball(1_000);
    let Elements::Triangles(faces) = &ball.elements else {
        panic!("a ball of triangles")
    };
    let corners = |offset: f32| Model {
        positions: (faces.as_flattened().iter())
            .map(|&v| ball.positions[v as usize].map(|x| x + offset))
            .collect(),
        elements: Elements::Triangles(
            (0..faces.len() as u32)
                .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
                .collect(),
        ),
    };
    let files = ["a0.ply", "a1.ply", "b0.ply", "b1.ply"];
    for (file, offset) in files.iter().zip([0.0, 0.1, 2.0, 1.22]) {
        folder.ply(file, &corners(offset));
    }
    let asked = ["--separation", "0.02", "--weld"];
    let whole = [
        &["step"],
        &files[..],
        &asked,
        &["--json", "--rows", "whole.npy"],
    ]
    .concat();
    let expected = folder.run(whole).json();
    assert!(expected["impacts"].as_u64().unwrap() > 10, "{expected}");
    let plan = [
        &["tiles", "plan", "big", "--step", "--cap", "100", "--json"],
        &files[..],
        &asked,
    ];
    let plan = folder.run(plan.concat()).json();
    assert!(plan["tiles"].as_u64().unwrap() > 10, "{plan}");
    for step in ["scatter", "run"] {
        folder.run(["tiles", step, "big"]).printed();
    }
    let merged = folder.run(["tiles", "merge", "big", "--json"]).json();
    assert_eq!(
        (
            &merged["pairs"],
            &merged["hash"],
            &merged["step"]["separation"]
        ),
        (
            &expected["impacts"],
            &expected["hash"],
            &expected["separation"]
        )
    );
    let read = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert_eq!(read("big/rows.npy"), read("whole.npy"));
    let still = ["tiles", "plan", "odd", "a0.ply", "--separation", "0.02"];
    assert!(folder.run(still).misuse().contains("--step"));
}

#[test]
fn questions_are_chosen() {
    let folder = bodies();
    plan(&folder);
    folder.run(["tiles", "scatter", "big"]).printed();
    for (option, args) in [
        ("--self", &["self", "a.ply", "b.ply"][..]),
        ("--between", &["pairs", "a.ply", "b.ply"][..]),
    ] {
        let expected = folder
            .run([args, &["--json", "--backend", "cpu"]].concat())
            .json();
        folder.run(["tiles", "run", "big", option]).printed();
        let merged = folder.run(["tiles", "merge", "big", "--json"]).json();
        assert_eq!(merged["hash"], expected["hash"], "{option}");
    }
}

#[test]
fn what_is_missing_is_said() {
    let folder = bodies();
    let error = folder.run(["tiles", "scatter", "big"]).error();
    assert!(
        error.contains("plan.json: missing; run `plan` first"),
        "{error}"
    );
    plan(&folder);
    let error = folder.run(["tiles", "merge", "big"]).error();
    assert!(
        error.contains("tile-00000000.json: missing; run `tiles run` first"),
        "{error}"
    );
    folder
        .run(["tiles", "run", "big", "--self", "--between"])
        .misuse();
    folder
        .run(["tiles", "scatter", "big", "--rank", "1"])
        .misuse();
    let again = ["tiles", "plan", "big", "a.ply", "--cap", "700"];
    assert!(folder.run(again).error().contains("another plan"));
    folder.run(again.into_iter().chain(["--replace"])).printed();
}

/// The kernel ends a process that exceeds its file size limit, in the middle of whatever file it
/// writes.
#[cfg(target_os = "linux")]
#[test]
fn killed_while_writing_and_run_again_the_answer_is_the_same() {
    let folder = bodies();
    let expected = whole(&folder);
    plan(&folder);
    let program = env!("CARGO_BIN_EXE_impinge");
    let mut n_killed = 0;
    for step in ["scatter", "run", "merge"] {
        // In units of 512 bytes.
        for limit in [0, 1, 4, 20] {
            let script = format!("ulimit -f {limit}; exec {program} tiles {step} big --threads 1");
            let script = if step == "merge" {
                script.replace(" --threads 1", "")
            } else {
                script
            };
            let mut shell = std::process::Command::new("sh");
            let output = shell
                .args(["-c", &script])
                .current_dir(folder.path("."))
                .output()
                .unwrap();
            n_killed += usize::from(!output.status.success());
        }
        folder.run(["tiles", step, "big"]).printed();
    }
    assert!(n_killed > 6, "{n_killed}");
    let answer: Value =
        serde_json::from_slice(&std::fs::read(folder.path("big/answer.json")).unwrap()).unwrap();
    assert_eq!(answer["hash"], expected["hash"]);
}

/// What is always refused is not among the words that help lists, and the error says why.
#[test]
fn a_start_that_no_tile_can_verify_is_not_listed() {
    let folder = bodies();
    let help = folder.run(["help", "tiles", "run"]).printed();
    assert!(
        help.contains("- report:") && help.contains("- skip:"),
        "{help}"
    );
    assert!(!help.contains("verify"), "{help}");
    plan(&folder);
    let run = folder.run(["tiles", "run", "big", "--start", "verify"]);
    let said = run.misuse();
    assert!(said.contains("no tile sees all of the start"), "{said}");
}
