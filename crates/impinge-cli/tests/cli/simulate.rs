//! `impinge simulate`.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use impinge_io::{Elements, ReadOptions, Sequence, read};

use crate::harness::{Folder, Run};

/// Rows of `steps.csv` without the columns that hold times.
fn steps(folder: &Folder, name: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(folder.path(name)).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            assert_eq!(fields.len(), header.len(), "{line}");
            fields
                .iter()
                .zip(&header)
                .filter(|(_, name)| !name.ends_with("_ms"))
                .map(|(field, _)| (*field).to_owned())
                .collect()
        })
        .collect()
}

fn assert_same_run(folder: &Folder, a: &str, b: &str) {
    for file in ["blocks.pc2", "blocks.ply", "colliding.csv", "state.bin"] {
        let bytes = |run: &str| fs::read(folder.path(run).join(file)).unwrap();
        assert!(bytes(a) == bytes(b), "{file} differs");
    }
    let rows = |run: &str| steps(folder, &format!("{run}/steps.csv"));
    assert_eq!(rows(a), rows(b));
}

#[test]
fn a_cache_and_what_collides_in_it() {
    let folder = Folder::new();
    let text = folder
        .run(["simulate", "blocks", "--out", "run", "--steps", "40"])
        .printed();
    for words in [
        "block, 1296 tetrahedra, twice: 40 steps of 5 ms",
        "colliding tetrahedra, upper body",
        "finite elements: median",
        "wrote run/blocks.ply",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let sequence = Sequence::open(&folder.path("run/blocks.pc2")).unwrap();
    assert_eq!(sequence.n_frames(), 41);
    let rows = steps(&folder, "run/steps.csv");
    assert_eq!(rows.len(), 41);
    // The mesh fits the cache, and `impinge sequence` reads both: there, the two bodies are one.
    let mesh = read(&folder.path("run/blocks.ply"), &ReadOptions::as_they_are()).unwrap();
    assert!(matches!(&mesh.elements, Elements::Tetrahedra(tets) if tets.len() == 2 * 1296));
    assert_eq!(mesh.positions, sequence.frame(0).unwrap());
    let found = folder
        .run([
            "sequence",
            "run/blocks.ply",
            "run/blocks.pc2",
            "--self",
            "--frames",
            "40..",
            "--json",
        ])
        .json();
    assert_eq!(found["pairs"].to_string(), rows[40][1], "{found}");
    // Bodies meet, and the table of colliding primitives agrees with the table of steps.
    assert!(rows[40][1].parse::<u32>().unwrap() > 100);
    let colliding = fs::read_to_string(folder.path("run/colliding.csv")).unwrap();
    let lower = colliding
        .lines()
        .filter(|line| line.starts_with("40,0,"))
        .count();
    assert_eq!(lower.to_string(), rows[40][3]);
}

#[test]
fn numbered_meshes_mark_what_collides() {
    let folder = Folder::new();
    for format in ["vtu", "ply"] {
        let run = ["simulate", "blocks", "--out", format, "--format", format];
        folder
            .run(run.into_iter().chain(["--steps", "12"]))
            .printed();
        for step in [0, 12] {
            let path = folder.path(&format!("{format}/blocks_{step:05}.{format}"));
            let mesh = read(&path, &ReadOptions::as_they_are()).unwrap();
            assert_eq!(mesh.n_primitives(), 2 * 1296);
        }
        assert_eq!(steps(&folder, &format!("{format}/steps.csv")).len(), 13);
    }
    let vtu = fs::read(folder.path("vtu/blocks_00012.vtu")).unwrap();
    assert!(vtu.windows(16).any(|bytes| bytes == b"Name=\"colliding\""));
    // A run continues in numbered files, even if the last ones were lost.
    fs::remove_file(folder.path("vtu/blocks_00012.vtu")).unwrap();
    let more = [
        "simulate", "blocks", "--out", "vtu", "--format", "vtu", "--resume",
    ];
    folder
        .run(more.into_iter().chain(["--steps", "14"]))
        .printed();
    assert!(fs::read(folder.path("vtu/blocks_00012.vtu")).unwrap() == vtu);
    assert!(folder.path("vtu/blocks_00014.vtu").is_file());
    // In another format there is nothing to continue.
    let other = [
        "simulate", "blocks", "--out", "vtu", "--format", "ply", "--resume",
    ];
    let said = folder
        .run(other.into_iter().chain(["--steps", "15"]))
        .misuse();
    assert!(said.contains("blocks_00013.ply does not exist"), "{said}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_saves_and_resume_goes_on_as_if_nothing_had_been() {
    let folder = Folder::new();
    let mut child = folder
        .command([
            "simulate", "blocks", "--out", "stopped", "--steps", "1000000",
        ])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The first saved state shows that the run has started.
    let state = folder.path("stopped/state.bin");
    let started = Instant::now();
    while !state.is_file() {
        assert!(
            started.elapsed() < Duration::from_secs(120),
            "no state is saved"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    child.wait().unwrap();
    let stopped: Run = child.wait_with_output().unwrap().into();
    assert_eq!(stopped.code, Some(130));
    let said = stopped.stderr.trim_end().strip_prefix("impinge: ").unwrap();
    let step: u32 = said
        .strip_prefix("stopped after step ")
        .and_then(|rest| rest.split(' ').next())
        .and_then(|step| step.parse().ok())
        .unwrap_or_else(|| panic!("{said}"));
    assert!(
        step >= 25 && said.ends_with("--resume continues in stopped"),
        "{said}"
    );
    // Rows after the last saved state, which a killed run leaves, are cut off.
    let table = folder.path("stopped/steps.csv");
    let mut text = fs::read_to_string(&table).unwrap();
    text += &format!("{step},1,2,3\n{},half a r", step + 1);
    fs::write(&table, text).unwrap();

    let n_steps = (step + 7).to_string();
    let rest = [
        "simulate", "blocks", "--out", "stopped", "--resume", "--steps", &n_steps,
    ];
    let text = folder.run(rest).printed();
    assert!(
        text.contains(&format!("continuing after step {step}")),
        "{text}"
    );
    folder
        .run([
            "simulate",
            "blocks",
            "--out",
            "whole",
            "--threads",
            "1",
            "--steps",
            &n_steps,
        ])
        .printed();
    assert_same_run(&folder, "stopped", "whole");
}

#[test]
fn runs_are_not_overwritten_and_damage_is_seen() {
    let folder = Folder::new();
    let args = ["simulate", "blocks", "--out", "run", "--steps", "3"];
    // Without a saved state, --resume starts a new run.
    folder.run(args.into_iter().chain(["--resume"])).printed();
    let said = folder.run(args).misuse();
    assert!(
        said.contains("run/state.bin exists: continue from it with --resume"),
        "{said}"
    );
    let fewer = [
        "simulate", "blocks", "--out", "run", "--steps", "2", "--resume",
    ];
    let said = folder.run(fewer).misuse();
    assert!(said.contains("run holds 3 steps already"), "{said}");
    let state = fs::read(folder.path("run/state.bin")).unwrap();
    fs::write(folder.path("run/state.bin"), &state[..state.len() - 3]).unwrap();
    let said = folder.run(args.into_iter().chain(["--resume"])).error();
    assert!(said.starts_with("run/state.bin: saved state: "), "{said}");
    fs::write(folder.path("run/state.bin"), &state).unwrap();
    fs::write(folder.path("run/blocks.pc2"), b"POINTCACHE2").unwrap();
    let said = folder.run(args.into_iter().chain(["--resume"])).error();
    assert!(said.starts_with("run/blocks.pc2: cannot read"), "{said}");
}
