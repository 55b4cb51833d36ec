//! Ctrl-C, and readers that close the pipe, in the middle of a long run.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

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

fn send(child: &Child, signal: &str) {
    let sent = Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
}

/// Waits until the child has ended, and returns how long that took.
fn ended(child: &mut Child) -> (Option<i32>, Duration) {
    let started = Instant::now();
    let code = child.wait().unwrap().code();
    (code, started.elapsed())
}

/// The second that a user waits at most, plus a margin for a loaded machine.
const SOON: Duration = Duration::from_secs(4);

#[test]
fn ctrl_c_stops_cleanly() {
    for (signal, expected) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129)] {
        let folder = Folder::new();
        let (mut child, mut stdout) = started(&folder);
        send(&child, signal);
        let mut rest = String::new();
        stdout.read_to_string(&mut rest).unwrap();
        let (code, took) = ended(&mut child);
        assert_eq!(code, Some(expected), "{signal}");
        assert!(took < SOON);
        assert_eq!(said(&mut child), "impinge: cancelled\n");
        // Whole lines, and not all of them.
        assert!(rest.is_empty() || rest.ends_with("}\n"));
        assert!(rest.lines().count() < 1_999);
    }
}

/// Waits until the child has opened a file, where the system says so.
fn wait_for_opening(child: &Child, path: &Path) {
    let folder = format!("/proc/{}/fd", child.id());
    if !Path::new("/proc/self/fd").exists() {
        return std::thread::sleep(Duration::from_millis(200));
    }
    let started = Instant::now();
    let is_open = || {
        let files = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        files
            .filter_map(|file| std::fs::read_link(file.path()).ok())
            .any(|open| open == path)
    };
    while !is_open() {
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "{} is not opened",
            path.display()
        );
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Starts a run, waits until it is at work, and stops it.
fn stopped(
    folder: &Folder,
    args: &[&str],
    wait: impl Fn(&Child),
    signal: &str,
) -> (Option<i32>, Duration, String) {
    let mut child = folder
        .command(args)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait(&child);
    send(&child, signal);
    let (code, took) = ended(&mut child);
    (code, took, said(&mut child))
}

#[test]
fn reading_and_writing_are_stopped_too() {
    let folder = Folder::new();
    // Reading takes some hundred milliseconds at least.
    let mut file = std::fs::File::create(folder.path("long.obj")).unwrap();
    let lines = "v 0.1234567890123456789 0.9876543210987654321 0.5555555555555555\n".repeat(20_000);
    for _ in 0..200 {
        file.write_all(lines.as_bytes()).unwrap();
    }
    drop(file);
    let path = folder.path("long.obj").canonicalize().unwrap();
    let wait = |child: &Child| wait_for_opening(child, &path);
    let (code, took, said) = stopped(&folder, &["self", "long.obj"], wait, "-INT");
    assert_eq!((code, said.as_str()), (Some(130), "impinge: cancelled\n"));
    assert!(took < SOON, "{took:?}");
    std::fs::remove_file(folder.path("long.obj")).unwrap();

    // A pipe that nobody reads.
    folder.ply("a.ply", &ball(2_000));
    folder.ply("b.ply", &ball(2_000).translated([0.1, 0.0, 0.0]));
    let made = Command::new("mkfifo").arg(folder.path("rows.csv")).status();
    assert!(made.unwrap().success());
    let args = ["pairs", "a.ply", "b.ply", "--rows", "rows.csv"];
    let wait = |_: &Child| std::thread::sleep(Duration::from_millis(500));
    let (code, took, said) = stopped(&folder, &args, wait, "-TERM");
    assert_eq!((code, said.as_str()), (Some(143), "impinge: cancelled\n"));
    assert!(took < SOON, "{took:?}");
}

/// Like a program started by `nohup`: ignored signals stay ignored.
#[test]
fn an_ignored_signal_stays_ignored() {
    let folder = Folder::new();
    folder.ply("ball.ply", &ball(6_000));
    let script = r#"trap '' HUP; exec "$0" "$@""#;
    let mut child = Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_impinge")])
        .args([
            "self", "ball.ply", "--method", "naive", "--json", "--repeat", "40",
        ])
        .current_dir(folder.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(500));
    send(&child, "-HUP");
    let mut printed = String::new();
    let mut stdout = child.stdout.take().unwrap();
    stdout.read_to_string(&mut printed).unwrap();
    let (code, _) = ended(&mut child);
    assert_eq!((code, said(&mut child).as_str()), (Some(0), ""));
    assert!(printed.starts_with('{'), "{printed}");
}

#[test]
fn a_reader_that_has_enough_is_no_error() {
    let folder = Folder::new();
    let (mut child, stdout) = started(&folder);
    drop(stdout);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(said(&mut child), "");
}
