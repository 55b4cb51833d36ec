//! Help, exit codes and error lines.

#[cfg(all(feature = "view", target_os = "linux"))]
use crate::harness::Run;
use crate::harness::{Folder, program};
use impinge_scenes::surfaces::ball;

#[test]
fn help_shows_every_command_with_examples() {
    let folder = Folder::new();
    let help = folder.run(["--help"]).printed();
    for word in [
        "demo",
        "pairs",
        "self",
        "sequence",
        "Exit codes",
        "Examples:",
    ] {
        assert!(help.contains(word), "{word}");
    }
    for (command, words) in [
        (
            "demo",
            &["--frames", "--triangles", "--out", "impinge demo --"][..],
        ),
        (
            "pairs",
            &[
                "--self",
                "--method",
                "--backend",
                "--threads",
                "--shared-vertex",
                "--weld",
                "--no-weld",
                "--fail-on-hit",
                "--format",
                "--lambda",
                "--repeat",
                "--rows",
                "--out",
                "--json",
                "--exclude",
                "--memory-budget",
                "--group-size",
                "impinge pairs a.obj b.obj",
            ],
        ),
        (
            "self",
            &["--shared-vertex", "--weld", "impinge self cow.off"],
        ),
        (
            "sequence",
            &[
                "--self",
                "--other",
                "--frames",
                "impinge sequence body.ply run.pc2",
            ],
        ),
    ] {
        let help = folder.run([command, "--help"]).printed();
        for word in words.iter().chain(&["Examples:"]) {
            assert!(help.contains(word), "{command}: {word}");
        }
    }
    for (command, words) in [
        (
            "render",
            &[
                "--png",
                "--size",
                "--azimuth",
                "--elevation",
                "--up",
                "--self",
                "--device",
            ][..],
        ),
        ("pairs", &["--png", "--size"]),
        ("self", &["--png", "--size"]),
    ] {
        let help = folder.run([command, "--help"]).printed();
        for word in words {
            assert!(help.contains(word), "{command}: {word}");
        }
    }
    let version = folder.run(["--version"]).printed();
    assert_eq!(version, format!("impinge {}\n", env!("CARGO_PKG_VERSION")));
}

/// A command's help is short: its own options first, one line per topic for those that many
/// commands share.
#[test]
fn shared_options_are_explained_once() {
    let folder = Folder::new();
    let topics = [
        ("detection", "--memory-budget <BYTES>", "--threads"),
        ("picture", "--azimuth <D>", "--see-through"),
        ("rows", "--candidates of `step`", ""),
    ];
    for (topic, text, _) in topics {
        let help = folder.run(["help", topic]).printed();
        assert!(help.contains(text), "{topic}: {help}");
        assert!(folder.run([topic]).printed().contains(text), "{topic}");
    }
    for command in [
        "pairs", "self", "near", "safe", "probe", "cast", "sequence", "step", "check", "render",
    ] {
        for help in [folder.run([command, "--help"]), folder.run([command, "-h"])] {
            let help = help.printed();
            assert!(help.lines().count() < 70, "{command}: {help}");
            for (topic, text, option) in topics {
                assert!(!help.contains(text), "{command}: {topic}");
                let line = help
                    .lines()
                    .find(|line| line.starts_with(&format!("  impinge help {topic} ")));
                if let Some(line) = line {
                    assert!(line.contains(option), "{line}");
                }
            }
        }
        // The values of its own options are explained.
        let long = folder.run(["help", command]).printed();
        assert!(long.contains("Usage: impinge "), "{long}");
    }
    let help = folder.run(["step", "--help"]).printed();
    assert!(help.contains("impinge help detection") && help.contains("impinge help rows"));
    let own = help.find("--earliest").unwrap();
    assert!(own < help.find("--method").unwrap() && own < help.find("--size").unwrap());
    assert!(folder.run(["help", "step"]).printed().contains("- skip:"));
}

/// The library's word for the question of `pairs`.
#[test]
fn detect_is_pairs() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(200));
    folder.ply("b.ply", &ball(200).translated([0.3, 0.1, 0.0]));
    let ask = |command| {
        folder
            .run([command, "a.ply", "b.ply", "--rows", "-"])
            .printed()
    };
    assert!(ask("pairs").lines().count() > 10);
    assert_eq!(ask("detect"), ask("pairs"));
    assert_eq!(
        folder.run(["help", "detect"]).printed(),
        folder.run(["help", "pairs"]).printed()
    );
    let help = folder.run(["--help"]).printed();
    assert!(!help.contains("  detect "), "{help}");
}

#[cfg(not(feature = "view"))]
#[test]
fn a_part_that_was_not_built_says_how_to_get_it() {
    let folder = Folder::new();
    for args in [
        &["view"][..],
        &["view", "a.obj", "--frame", "3"],
        &["view", "--help"],
    ] {
        let line = folder.run(args).error();
        assert!(
            line.contains("without the window")
                && line
                    .contains("`cargo install --locked --path crates/impinge-cli --features view`"),
            "{line}"
        );
    }
    if cfg!(not(feature = "gpu")) {
        let line = folder.run(["devices", "--json"]).error();
        let command = "`cargo install --locked --path crates/impinge-cli --features gpu`";
        assert!(line.contains(command), "{line}");
    }
}

/// The libraries of the window say where in their sources an error came up.
#[cfg(all(feature = "view", target_os = "linux"))]
#[test]
fn without_a_display_the_error_names_no_source() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(20));
    let mut command = folder.command(["view", "a.ply"]);
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(name);
    }
    let line = Run::from(command.output().unwrap()).error();
    assert!(
        line.contains("no window: ") && line.contains("DISPLAY") && !line.contains(".rs"),
        "{line}"
    );
}

#[test]
fn bad_usage_is_code_2() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(20));
    for args in [
        &[][..],
        &["frobnicate"],
        &["pairs"],
        &["pairs", "a.ply"],
        &["self"],
        &["sequence", "a.ply"],
        &["pairs", "a.ply", "a.ply", "--method", "magic"],
        &["pairs", "a.ply", "a.ply", "--threads", "0"],
        &["pairs", "a.ply", "a.ply", "--threads", "100000"],
        &["pairs", "a.ply", "a.ply", "--repeat", "0"],
        &["pairs", "a.ply", "a.ply", "--lambda", "0"],
        &["pairs", "a.ply", "a.ply", "--group-size", "65"],
        &["pairs", "a.ply", "a.ply", "--memory-budget", "lots"],
        &["pairs", "a.ply", "a.ply", "--rows", "rows.txt"],
        &["pairs", "a.ply", "a.ply", "--out", "seen.obj"],
        &["pairs", "a.ply", "a.ply", "--exclude", "0"],
        &["demo", "--frames", "0"],
        &["demo", "--out", "demo"],
    ] {
        let said = folder.run(args).misuse();
        assert!(!said.is_empty(), "{args:?}");
    }
    let said = folder
        .run(["pairs", "a.ply", "a.ply", "--exclude", "0,2"])
        .misuse();
    assert_eq!(
        said.trim_end(),
        "impinge: --exclude names body 2, but 2 bodies are given, numbered from 0"
    );
}

#[test]
fn other_errors_are_code_1_and_one_line() {
    let folder = Folder::new();
    folder.ply("good.ply", &ball(20));
    folder.text("broken.obj", "v 0 0 0\nv 1 0 0\nv 0 1 zero\nf 1 2 3\n");
    folder.text("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    folder.text("far.off", "OFF\n3 1 0\n0 0 0\n1e400 0 0\n0 1 0\n3 0 1 2\n");
    folder.text("mesh.txt", "");
    for (file, words) in [
        ("missing.ply", &["missing.ply"][..]),
        ("broken.obj", &["broken.obj:3", "zero"]),
        ("range.obj", &["range.obj:4", "4", "vertices: 3"]),
        ("far.off", &["far.off", "vertex 1", "not a finite number"]),
        ("mesh.txt", &["mesh.txt", "txt"]),
    ] {
        for args in [
            ["pairs", "good.ply", file, "--json"],
            ["self", file, "--shared-vertex", "skip"],
        ] {
            let line = folder.run(args).error();
            for word in words {
                assert!(line.contains(word), "{line}");
            }
        }
    }
}

#[test]
fn unwritable_files_are_named() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(20));
    for (option, file) in [("--rows", "no/rows.csv"), ("--out", "no/seen.ply")] {
        let line = folder
            .run(["pairs", "a.ply", "a.ply", option, file])
            .error();
        assert!(line.contains(file), "{line}");
    }
}

#[test]
fn a_budget_that_is_too_small_is_refused() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(2_000));
    let line = folder
        .run(["pairs", "a.ply", "a.ply", "--memory-budget", "1"])
        .error();
    assert!(line.contains("memory budget is 1 bytes"), "{line}");
}

#[test]
fn two_outputs_are_two_files() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(200));
    for args in [
        &[
            "pairs",
            "a.ply",
            "a.ply",
            "--rows",
            "x.csv",
            "--regions",
            "x.csv",
        ][..],
        &[
            "pairs", "a.ply", "a.ply", "--curves", "c.ply", "--out", "./c.ply",
        ],
        &[
            "step",
            "a.ply",
            "a.ply",
            "a.ply",
            "a.ply",
            "--advance",
            "z.ply",
            "z.ply",
        ],
    ] {
        let said = folder.run(args).misuse();
        assert!(said.contains("is also the file of --"), "{said}");
    }
}

#[test]
fn closed_pipes_are_no_panic() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(200));
    let unread = |args: &[&str]| {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        folder.command(args).stdout(writer).output().unwrap()
    };
    for args in [
        &["pairs", "a.ply", "a.ply", "--json"][..],
        &["self", "a.ply"],
        &["--help"],
    ] {
        let output = unread(args);
        assert_eq!(String::from_utf8(output.stderr).unwrap(), "", "{args:?}");
        assert_eq!(output.status.code(), Some(0), "{args:?}");
    }
    // Nobody reads the text, but the file and the exit code are those of the whole answer.
    folder.ply("b.ply", &ball(200));
    for args in [
        &[
            "pairs",
            "a.ply",
            "b.ply",
            "--fail-on-hit",
            "--rows",
            "o.csv",
        ][..],
        &[
            "near",
            "a.ply",
            "b.ply",
            "--distance",
            "1",
            "--fail-on-hit",
            "--rows",
            "o.csv",
        ],
        &[
            "sequence",
            "a.ply",
            "n_1.ply",
            "--other",
            "b.ply",
            "--fail-on-hit",
            "--rows",
            "o.csv",
        ],
    ] {
        folder.ply("n_1.ply", &ball(200));
        assert_eq!(unread(args).status.code(), Some(3), "{args:?}");
        std::fs::remove_file(folder.path("o.csv")).expect("rows");
    }
    // Standard error may be closed as well: the exit code is still right.
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let status = program()
        .args(["self", "missing.ply"])
        .stderr(writer)
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(1));
}
