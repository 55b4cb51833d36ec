//! Ctrl-C, and readers that go away, in the middle of a long run.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};

use impinge_io::Pc2Writer;
use impinge_scenes::surfaces::ball;

use crate::harness::Folder;

/// A run that takes far longer than the test, after its first line.
fn started(folder: &Folder) -> (Child, BufReader<std::process::ChildStdout>) {
    let model = ball(2_000);
    folder.ply("ball.ply", &model);
    let n_points = model.n_vertices();
    let mut cache = Pc2Writer::create(&folder.path("run.pc2"), n_points, 0.0, 1.0).unwrap();
    for _ in 0..2_000 {
        cache.append(&model.positions).unwrap();
    }
    cache.finish().unwrap();
    let mut child = folder
        .command([
            "sequence", "ball.ply", "run.pc2", "--json", "--method", "naive",
        ])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    stdout.read_line(&mut line).unwrap();
    assert!(line.starts_with("{\"frame\":0,"), "{line}");
    (child, stdout)
}

fn said(child: &mut Child) -> String {
    let mut text = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut text)
        .unwrap();
    text
}

#[test]
fn ctrl_c_stops_cleanly() {
    let folder = Folder::new();
    let (mut child, mut stdout) = started(&folder);
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    let mut rest = String::new();
    stdout.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert_eq!(said(&mut child), "impinge: cancelled\n");
    // Whole lines, and not all of them.
    assert!(rest.is_empty() || rest.ends_with("}\n"));
    assert!(rest.lines().count() < 1_999);
}

#[test]
fn a_reader_that_has_enough_is_no_error() {
    let folder = Folder::new();
    let (mut child, stdout) = started(&folder);
    drop(stdout);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(said(&mut child), "");
}
