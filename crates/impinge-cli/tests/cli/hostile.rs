//! Nothing is lost and nothing hangs with full disks, outputs that are also inputs, inputs that
//! never end, and meshes that name files elsewhere.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;
use std::time::{Duration, Instant};

use impinge_scenes::surfaces::ball;

use crate::harness::{Folder, Run};

fn two_balls() -> Folder {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(2_000));
    folder.ply("b.ply", &ball(2_000).translated([0.1, 0.0, 0.0]));
    folder
}

/// Names of all files in the folder.
fn names(folder: &Folder) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder.path(""))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_full_disk_leaves_older_files_as_they_were() {
    let folder = two_balls();
    for file in ["rows.csv", "rows.npy", "seen.ply", "seen.glb", "seen.vtu"] {
        folder.text(file, "precious");
        let option = if file.starts_with("rows") {
            "--rows"
        } else {
            "--out"
        };
        // A file may have 4 kB at most: writing more fails, as it does on a full disk.
        let script = r#"trap '' XFSZ; ulimit -f 8; exec "$0" "$@""#;
        let output = Command::new("sh")
            .args(["-c", script, env!("CARGO_BIN_EXE_impinge")])
            .args(["pairs", "a.ply", "b.ply", option, file])
            .current_dir(folder.path(""))
            .output()
            .unwrap();
        let line = Run::from(output).error();
        assert!(
            line.contains(file) && line.contains("cannot write"),
            "{line}"
        );
        assert_eq!(
            fs::read_to_string(folder.path(file)).unwrap(),
            "precious",
            "{file}"
        );
        fs::remove_file(folder.path(file)).unwrap();
        assert_eq!(names(&folder), ["a.ply", "b.ply"]);
        // Without the limit the file is written, and is longer than that.
        folder
            .run(["pairs", "a.ply", "b.ply", option, file])
            .printed();
        assert!(fs::metadata(folder.path(file)).unwrap().len() > 4_096);
        fs::remove_file(folder.path(file)).unwrap();
    }
}

#[test]
fn an_output_keeps_who_may_read_it_and_the_link_to_it() {
    use std::os::unix::fs::PermissionsExt;
    let folder = two_balls();
    folder.text("secret.csv", "old");
    let path = folder.path("secret.csv");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
    symlink("secret.csv", folder.path("link.csv")).unwrap();
    folder
        .run(["pairs", "a.ply", "b.ply", "--rows", "link.csv"])
        .printed();
    assert!(fs::read_to_string(&path).unwrap().starts_with("body_a,"));
    let mode = fs::metadata(&path).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    assert!(folder.path("link.csv").is_symlink());
}

#[test]
fn no_output_replaces_an_input() {
    let folder = two_balls();
    let bytes = fs::read(folder.path("a.ply")).unwrap();
    fs::create_dir(folder.path("sub")).unwrap();
    symlink("a.ply", folder.path("link.ply")).unwrap();
    symlink("link.ply", folder.path("twice.ply")).unwrap();
    symlink("../a.ply", folder.path("sub/link.ply")).unwrap();
    fs::hard_link(folder.path("a.ply"), folder.path("hard.ply")).unwrap();
    symlink("a.ply", folder.path("rows.csv")).unwrap();
    let absolute = folder.path("a.ply").display().to_string();
    for (option, file) in [
        ("--out", "a.ply"),
        ("--out", "./a.ply"),
        ("--out", "sub/../a.ply"),
        ("--out", "link.ply"),
        ("--out", "twice.ply"),
        ("--out", "sub/link.ply"),
        ("--out", "hard.ply"),
        ("--out", &absolute),
        ("--rows", "rows.csv"),
    ] {
        let said = folder
            .run(["pairs", "b.ply", "a.ply", option, file])
            .misuse();
        assert!(
            said.contains(option) && said.contains("is the input a.ply"),
            "{said}"
        );
        let said = folder.run(["self", "link.ply", option, file]).misuse();
        assert!(said.contains("is the input link.ply"), "{said}");
        assert_eq!(fs::read(folder.path("a.ply")).unwrap(), bytes);
    }
    assert!(folder.path("link.ply").is_symlink());
}

#[test]
fn inputs_that_never_end_are_refused_at_once() {
    let folder = two_balls();
    let fifo = folder.path("pipe.ply");
    assert!(
        Command::new("mkfifo")
            .arg(&fifo)
            .status()
            .unwrap()
            .success()
    );
    symlink("/dev/zero", folder.path("zero.obj")).unwrap();
    symlink("/dev/urandom", folder.path("random.stl")).unwrap();
    fs::create_dir(folder.path("folder.off")).unwrap();
    for (file, what) in [
        ("pipe.ply", "a pipe"),
        ("zero.obj", "a device"),
        ("random.stl", "a device"),
        ("folder.off", "a folder"),
    ] {
        let started = Instant::now();
        let line = folder.run(["pairs", "a.ply", file]).error();
        let said = format!("{file}: is {what}, not a regular file");
        assert!(line.starts_with(&said), "{line}");
        assert!(started.elapsed() < Duration::from_secs(10));
    }
}

#[test]
fn a_mesh_of_the_current_folder_names_files_beside_it() {
    let folder = Folder::new();
    fs::create_dir(folder.path("inner")).unwrap();
    // Three vertices of a triangle.
    let buffer: Vec<u8> = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    fs::write(folder.path("inner/own.bin"), &buffer).unwrap();
    fs::write(folder.path("secret.bin"), &buffer).unwrap();
    let gltf = |uri: &str| {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{uri}"}}]}}"#
        );
        folder.text("inner/m.gltf", &text);
        let mut command = folder.command(["self", "m.gltf", "--out", "seen.ply"]);
        command.current_dir(folder.path("inner"));
        Run::from(command.output().unwrap())
    };
    gltf("own.bin").printed();
    fs::remove_file(folder.path("inner/seen.ply")).unwrap();
    for uri in ["../secret.bin", "%2e%2e/secret.bin"] {
        let line = gltf(uri).error();
        assert!(
            line.contains("only files in the folder of the mesh or below it are read"),
            "{line}"
        );
        assert!(!folder.path("inner/seen.ply").exists());
    }
}

/// What a terminal would obey is printed as text: file names may hold line breaks and escape
/// sequences.
#[test]
fn names_of_files_are_escaped() {
    let folder = Folder::new();
    let name = |end: &str| format!("a\n\u{1b}[31mred\u{7}{end}");
    let (mesh, moved, broken) = (name(".ply"), name("1.ply"), name(".obj"));
    folder.ply(&mesh, &ball(200));
    folder.ply(&moved, &ball(200).translated([0.3, 0.0, 0.0]));
    folder.text(&broken, "v 0 0 0\nf 1 2 3\n");
    let missing = name("no.ply");
    for args in [
        &["pairs", &mesh, &moved][..],
        &["pairs", &mesh, &moved, &mesh, "-v"],
        &["self", &mesh],
        &["self", &mesh, &broken],
        &["self", &broken],
        &["self", &missing],
        &["near", &mesh, &moved, "--distance", "0.1"],
        &["distance", &mesh, &moved],
        &["probe", &mesh, "--points", &moved],
        &["probe", &broken, "--points", &missing, "--signed"],
        &["cast", &mesh, "--rays", &missing],
        &["step", &mesh, &moved],
        &["step", &mesh, &moved, &mesh, &mesh],
        &["step", &mesh],
        &["check", &mesh, &broken, &missing],
        &["sequence", &mesh, &missing],
        &[
            "render",
            &mesh,
            &moved,
            "--png",
            &name(".png"),
            "--size",
            "20x20",
        ],
        &["tiles", "plan", "folder", &mesh, &broken],
        &["pairs", &mesh, &moved, "--out", &mesh],
    ] {
        let run = folder.run(args);
        let text = run.stdout + &run.stderr;
        let obeyed = text.chars().find(|c| c.is_control() && *c != '\n');
        assert_eq!(obeyed, None, "{args:?}: {text:?}");
        assert!(!text.contains("a\n"), "{args:?}: {text:?}");
    }
}
