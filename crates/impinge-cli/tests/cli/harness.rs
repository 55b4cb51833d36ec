//! Runs the binary, and makes files for it.

use std::ffi::OsStr;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::UNIX_EPOCH;

use impinge::{Detector, Elements, Method, Query, Scene, Settings};
use impinge_io::{ColoredMesh, Positions, write_ply};
use impinge_scenes::Model;
use impinge_testing::npy;
use serde_json::Value;
use tempfile::TempDir;

/// The program, ready for arguments.
pub fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_impinge"));
    command.stdin(Stdio::null());
    command
}

/// The result of a run.
#[derive(Debug)]
pub struct Run {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl From<Output> for Run {
    fn from(output: Output) -> Self {
        Run {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

impl Run {
    /// Asserts exit code 0 and returns what was printed.
    #[track_caller]
    pub fn printed(self) -> String {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        self.stdout
    }

    /// Asserts exit code 0, nothing but notes on standard error and one JSON object on one line.
    #[track_caller]
    pub fn json(self) -> Value {
        let is_note = |line: &str| line.starts_with("note: ");
        assert!(self.stderr.lines().all(is_note), "{}", self.stderr);
        let text = self.printed();
        assert!(
            text.ends_with('\n') && text.trim_end().lines().count() == 1,
            "{text}"
        );
        serde_json::from_str(&text).unwrap()
    }

    /// Asserts exit code 1, nothing printed, and one line on standard error, which it returns.
    #[track_caller]
    pub fn error(self) -> String {
        assert_eq!(
            (self.code, self.stdout.as_str()),
            (Some(1), ""),
            "{}",
            self.stderr
        );
        assert_eq!(self.stderr.lines().count(), 1, "{}", self.stderr);
        let line = self.stderr.trim_end();
        line.strip_prefix("impinge: ").expect(line).to_owned()
    }

    /// Asserts exit code 2 and nothing printed, and returns the message.
    #[track_caller]
    pub fn misuse(self) -> String {
        assert_eq!(
            (self.code, self.stdout.as_str()),
            (Some(2), ""),
            "{}",
            self.stderr
        );
        self.stderr
    }
}

/// A folder for a test, in which the program runs.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs the program to its end in this folder.
    pub fn run<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Run {
        self.command(args).output().unwrap().into()
    }

    /// The program, ready to be run in this folder.
    pub fn command<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Command {
        let mut command = program();
        command.args(args).current_dir(self.0.path());
        command
    }

    pub fn text(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// Writes a text with a time that does not tell that it was written now.
    pub fn old_text(&self, name: &str, text: &str) {
        self.text(name, text);
        let mut options = File::options();
        let file = options.append(true).open(self.path(name));
        file.unwrap().set_modified(UNIX_EPOCH).unwrap();
    }

    /// Writes triangles as a binary PLY file with exactly these f32 coordinates.
    pub fn ply(&self, name: &str, model: &Model) {
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

    /// Writes tetrahedra as a Medit file; f64 digits of an f32 coordinate are exact.
    pub fn medit(&self, name: &str, model: &Model) {
        let Elements::Tetrahedra(tets) = &model.elements else {
            panic!("this writes tetrahedra");
        };
        let mut text = format!(
            "MeshVersionFormatted 2\nDimension 3\nVertices {}\n",
            model.positions.len()
        );
        for [x, y, z] in model.positions.iter().map(|p| p.map(f64::from)) {
            text += &format!("{x} {y} {z} 0\n");
        }
        text += &format!("Tetrahedra {}\n", tets.len());
        for [a, b, c, d] in tets.iter().map(|corners| corners.map(|ix| ix + 1)) {
            text += &format!("{a} {b} {c} {d} 0\n");
        }
        self.text(name, &(text + "End\n"));
    }
}

/// The rows and their hash by the library's oracle.
pub fn oracle(
    models: &[&Model],
    ask: impl Fn(&[impinge::BodyId]) -> Query,
) -> (Vec<[u32; 4]>, String) {
    let mut scene = Scene::new();
    let ids: Vec<_> = models
        .iter()
        .map(|model| model.add_to(&mut scene).unwrap())
        .collect();
    let mut detector = Detector::new(Settings::new().method(Method::Naive)).unwrap();
    let pairs = detector.detect(&scene, &ask(&ids)).unwrap();
    (pairs.rows().collect(), format!("{:016x}", pairs.hash()))
}

/// Rows of a `.csv` file.
pub fn csv_rows(path: &Path) -> Vec<[u32; 4]> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("body_a,element_a,body_b,element_b"));
    lines
        .map(|line| {
            let row: Vec<u32> = line.split(',').map(|x| x.parse().unwrap()).collect();
            row.try_into().unwrap()
        })
        .collect()
}

/// Rows of a `.npy` file of little-endian u32 with shape `(n, 4)`.
pub fn npy_rows(path: &Path) -> Vec<[u32; 4]> {
    let file = std::fs::read(path).unwrap();
    let rows = npy::rows(&file, "<u4", u32::from_le_bytes);
    let (header, _) = npy::split(&file);
    assert!(
        header.contains(&format!("'shape': ({}, 4)", rows.len())),
        "{header}"
    );
    rows
}

/// The keys of an object in their order.
pub fn keys(value: &Value) -> Vec<&str> {
    value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

/// A plate of two triangles, a thin rod through the inside of one of them, and the rod after a step
/// along itself.
pub fn rod_and_plate() -> Folder {
    let folder = Folder::new();
    folder.text(
        "plate.obj",
        "v -100 -100 0\nv 100 -100 0\nv 100 100 0\nv -100 100 0\nf 1 2 3\nf 1 3 4\n",
    );
    let rod = |low: i32, high: i32| {
        let ring = |z| format!("v 20 -20 {z}\nv 22 -20 {z}\nv 22 -22 {z}\nv 20 -22 {z}\n");
        let sides = (0..4).map(|i| {
            let [a, b, c, d] = [1 + i, 1 + (i + 1) % 4, 5 + (i + 1) % 4, 5 + i];
            format!("f {a} {b} {c}\nf {a} {c} {d}\n")
        });
        ring(low) + &ring(high) + &sides.collect::<String>()
    };
    folder.text("rod.obj", &rod(-50, 50));
    folder.text("moved.obj", &rod(-49, 51));
    folder
}
