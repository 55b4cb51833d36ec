//! A user's first impression: the answer in the first line, and the answer that the user means.

use std::io::Write;
use std::process::Stdio;

use impinge::{Query, SharedVertex};
use impinge_scenes::Model;
use impinge_scenes::surfaces::{ball, cube};
use serde_json::json;

use crate::harness::{Folder, Run, csv_rows, oracle};

/// An ascii STL file.
fn stl(model: &Model) -> String {
    let impinge::Elements::Triangles(faces) = &model.elements else {
        panic!("STL is for triangles");
    };
    let mut text = "solid s\n".to_owned();
    for face in faces {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in face.map(|ix| model.positions[ix as usize].map(f64::from)) {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid s\n"
}

#[test]
fn a_clean_mesh_is_clean_in_every_format() {
    let folder = Folder::new();
    let sphere = ball(1_280);
    folder.ply("sphere.ply", &sphere);
    folder.text("sphere.stl", &stl(&sphere));
    let run = folder.run(["self", "sphere.stl"]);
    let n_welded = 3 * 1_280 - sphere.n_vertices();
    assert_eq!(run.stderr, "");
    assert_eq!(
        run.printed().replace(',', ""),
        format!(
            "sphere.stl: no pairs of 1280 triangles\nwithin 1 mesh {n_welded} vertices welded neighbours resolved\n"
        )
    );
    // Triangles of an STL file share only positions, so they are always welded.
    for options in [&["--no-weld"][..], &[]] {
        let args = ["self", "sphere.stl", "--json"];
        let object = folder.run(args.iter().chain(options)).json();
        assert_eq!(object["pairs"], json!(0));
        assert_eq!(object["bodies"][0]["welded"], json!(n_welded));
        assert_eq!(object["bodies"][0]["coincident"], json!(0));
        assert_eq!(object["bodies"][0]["vertices"], json!(sphere.n_vertices()));
    }
    let text = folder.run(["self", "sphere.ply"]);
    assert_eq!(text.stderr, "");
    assert_eq!(
        text.printed(),
        "sphere.ply: no pairs of 1,280 triangles\nwithin 1 mesh, 0 vertices welded, neighbours resolved\n"
    );
}

#[test]
fn what_is_not_welded_is_counted() {
    let folder = Folder::new();
    // Two triangles over one edge whose vertices the file repeats.
    folder.text(
        "split.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\nf 1 2 3\nf 4 6 5\n",
    );
    let run = folder.run(["self", "split.obj"]);
    assert_eq!(run.stderr, "");
    assert_eq!(
        run.printed(),
        "split.obj: no pairs of 2 triangles\nwithin 1 mesh, 2 vertices welded, neighbours resolved\n"
    );
    let run = folder.run(["self", "split.obj", "--no-weld"]);
    assert_eq!(
        run.stderr,
        "note: split.obj: vertices at the position of another, not welded to it: 2\n"
    );
    let text = run.printed();
    assert!(
        text.starts_with("split.obj: 1 pair of 2 triangles in 1 place, near ")
            && text.ends_with(
                "\nwithin 1 mesh, coinciding vertices: 2 not welded (--no-weld), neighbours resolved\n"
            ),
        "{text}"
    );
    for (option, vertices, welded, coincident) in [("--no-weld", 6, 0, 2), ("--weld", 4, 2, 0)] {
        let object = folder.run(["self", "split.obj", option, "--json"]).json();
        let body = &object["bodies"][0];
        assert_eq!(
            [&body["vertices"], &body["welded"], &body["coincident"]],
            [&json!(vertices), &json!(welded), &json!(coincident)]
        );
    }
    folder.text("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let text = folder.run(["self", "one.obj"]).printed();
    assert!(
        text.starts_with("one.obj: no pairs of 1 triangle\n"),
        "{text}"
    );
    // Between bodies it does not change the answer, so nothing is counted unless vertices are
    // welded.
    let pairs = ["pairs", "split.obj", "split.obj", "--json"];
    for (more, counts) in [(&[][..], json!([2, 0])), (&["--no-weld"], json!([0, null]))] {
        let object = folder.run(pairs.iter().chain(more)).json();
        let body = &object["bodies"][0];
        assert_eq!(json!([body["welded"], body["coincident"]]), counts);
        let asked = json!({ "between": true, "self": false, "shared_vertex": "resolve" });
        assert_eq!(object["asked"], asked);
    }
}

/// Two cubes that cut through each other at two corners each, far apart, as one mesh.
fn clashing() -> Model {
    let mut positions = Vec::new();
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for (at, size) in [
        ([0.0; 3], 1.0),
        ([0.9, 0.9, 0.9], 1.0),
        ([50.0; 3], 1.0),
        ([50.9; 3], 1.0),
    ] {
        let one = cube(at, size);
        let impinge::Elements::Triangles(own) = &one.elements else {
            panic!("a cube is made of triangles");
        };
        let first = positions.len() as u32;
        faces.extend(own.iter().map(|face| face.map(|ix| ix + first)));
        positions.extend(one.positions);
    }
    Model {
        positions,
        elements: faces.into(),
    }
}

#[test]
fn the_first_line_is_the_answer_and_the_next_ones_say_where() {
    let folder = Folder::new();
    let model = clashing();
    folder.ply("boxes.ply", &model);
    let (rows, hash) = oracle(&[&model], |_| {
        Query::self_all().shared_vertex(SharedVertex::Resolve)
    });
    let text = folder.run(["self", "boxes.ply"]).printed();
    let lines: Vec<&str> = text.lines().collect();
    let start = format!(
        "boxes.ply: {} pairs of 48 triangles in 2 places, near (",
        rows.len()
    );
    assert!(lines[0].starts_with(&start), "{text}");
    assert_eq!(lines.len(), 4, "{text}");
    assert!(
        lines[1].starts_with("  near (") && lines[1].contains("such as "),
        "{text}"
    );
    assert!(!text.contains("hash") && !text.contains("stage"));
    let text = folder.run(["self", "boxes.ply", "-v"]).printed();
    assert!(
        text.contains(&format!("{} pairs, hash {hash}", rows.len())),
        "{text}"
    );
    assert!(text.contains("stage"));

    let object = folder.run(["self", "boxes.ply", "--json"]).json();
    assert_eq!(object["n_regions"], json!(2));
    let regions = object["regions"].as_array().unwrap();
    let total: u64 = regions
        .iter()
        .map(|region| region["pairs"].as_u64().unwrap())
        .sum();
    assert_eq!(total, rows.len() as u64);
    let mut xs: Vec<f64> = regions
        .iter()
        .map(|region| region["center"][0].as_f64().unwrap())
        .collect();
    xs.sort_by(f64::total_cmp);
    // Each place lies near one of the two corners where the cubes overlap.
    assert!(xs[0].abs() < 2.0 && (xs[1] - 50.5).abs() < 2.0, "{xs:?}");
    for region in regions {
        assert!(region["size"].as_f64().unwrap() < 2.5);
        let first = [
            0,
            region["first"][0].as_u64().unwrap(),
            0,
            region["first"][1].as_u64().unwrap(),
        ];
        assert!(rows.iter().any(|row| row.map(u64::from) == first));
    }

    folder.ply("far.ply", &ball(20).translated([-90.0, 0.0, 0.0]));
    let args = ["pairs", "boxes.ply", "far.ply", "--self"];
    let text = folder.run(args).printed();
    let start = format!(
        "boxes.ply and far.ply: {} pairs of 68 triangles",
        rows.len()
    );
    assert!(text.starts_with(&start), "{text}");
    let args = ["pairs", "boxes.ply", "far.ply"];
    let text = folder.run(args).printed();
    assert_eq!(
        text,
        "boxes.ply and far.ply: no pairs of 68 triangles\n\
         between 2 meshes, 0 vertices welded, neighbours resolved; not asked: self-collision (--self)\n"
    );
}

#[test]
fn a_check_fails_with_a_code_of_its_own() {
    let folder = Folder::new();
    folder.ply("boxes.ply", &clashing());
    folder.ply("ball.ply", &ball(80));
    for (args, code) in [
        (&["self", "boxes.ply", "--fail-on-hit"][..], 3),
        (&["self", "boxes.ply", "--fail-on-hit", "--json"], 3),
        (&["self", "boxes.ply"], 0),
        (&["self", "ball.ply", "--fail-on-hit"], 0),
        (&["pairs", "ball.ply", "boxes.ply", "--fail-on-hit"], 3),
        (&["self", "missing.ply", "--fail-on-hit"], 1),
        (&["self", "--fail-on-hit"], 2),
    ] {
        let run = folder.run(args);
        assert_eq!(run.code, Some(code), "{args:?}");
        if code == 3 {
            assert_eq!(run.stderr, "", "{args:?}");
            assert!(!run.stdout.is_empty());
        }
    }
}

#[test]
fn pairs_and_meshes_go_through_pipes() {
    let folder = Folder::new();
    let model = clashing();
    folder.ply("boxes.ply", &model);
    folder
        .run(["self", "boxes.ply", "--rows", "rows.csv"])
        .printed();
    let rows = csv_rows(&folder.path("rows.csv"));
    let run = folder.run(["self", "boxes.ply", "--rows", "-"]);
    assert!(run.stderr.starts_with("boxes.ply: "), "{}", run.stderr);
    assert_eq!(
        run.printed(),
        std::fs::read_to_string(folder.path("rows.csv")).unwrap()
    );
    let args = ["self", "boxes.ply", "--rows", "-", "--rows-format", "jsonl"];
    let text = folder.run(args).printed();
    let read: Vec<[u32; 4]> = text
        .lines()
        .map(|line| {
            let row: serde_json::Value = serde_json::from_str(line).unwrap();
            ["body_a", "element_a", "body_b", "element_b"]
                .map(|key| row[key].as_u64().unwrap() as u32)
        })
        .collect();
    assert_eq!(read, rows);
    folder
        .run(["self", "boxes.ply", "--rows", "-", "--json"])
        .misuse();

    let given = |args: &[&str], bytes: &[u8]| -> Run {
        let mut child = folder
            .command(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // A run that ends with an error does not read its input.
        let _ = child.stdin.take().unwrap().write_all(bytes);
        child.wait_with_output().unwrap().into()
    };
    let boxes = std::fs::read(folder.path("boxes.ply")).unwrap();
    let piped = |args: &[&str]| given(args, &boxes);
    let text = piped(&["self", "-", "--format", "ply", "--rows", "in.csv"]).printed();
    assert!(text.starts_with("standard input: "), "{text}");
    assert_eq!(csv_rows(&folder.path("in.csv")), rows);
    assert!(piped(&["self", "-"]).misuse().contains("--format"));
    assert!(
        piped(&["pairs", "-", "-", "--format", "ply"])
            .misuse()
            .contains("only one")
    );
    assert!(
        piped(&["self", "-", "--format", "txt"])
            .misuse()
            .contains("extension")
    );
    let line = piped(&["self", "-", "--format", "off"]).error();
    assert!(line.starts_with("standard input"), "{line}");

    let text = piped(&["distance", "-", "boxes.ply", "--format", "ply"]).printed();
    assert!(text.starts_with("distance 0\n"), "{text}");
    let misuse = piped(&["step", "-", "boxes.ply"]).misuse();
    assert!(misuse.contains("`step` reads files"), "{misuse}");
    // Points and rays are rows of numbers, as text or as an array.
    let probe = ["probe", "boxes.ply", "--points", "-", "--rows", "-"];
    let run = given(&probe, b"x,y,z\n9,9,9\n");
    assert_eq!(run.stdout.lines().count(), 2, "{}", run.stderr);
    let mut array = b"\x93NUMPY\x01\x00\x46\x00".to_vec();
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3), }";
    array.extend(format!("{header:<69}\n").bytes());
    array.extend([9.0f32; 3].map(f32::to_le_bytes).as_flattened());
    let same = given(&probe, &array);
    assert_eq!(same.stdout, run.stdout, "{}", same.stderr);
    let cast = ["cast", "boxes.ply", "--rays", "-", "--json"];
    assert_eq!(given(&cast, b"9 9 9 1 0 0\n").json()["rays"], 1);
    let line = given(&cast, b"9 9 9\n").error();
    let expected = "standard input:1: expected 6 numbers in a row, found 3";
    assert!(line.starts_with(expected), "{line}");
    let both = ["cast", "-", "--format", "ply", "--rays", "-"];
    assert!(piped(&both).misuse().contains("standard input already"));
}

#[test]
fn words() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(20));
    for option in ["--repeat", "--threads"] {
        for value in ["0", "-1", "x"] {
            let value = format!("{option}={value}");
            let said = folder.run(["self", "a.ply", &value]).misuse();
            assert!(
                said.contains("at least 1") && !said.contains("non-zero"),
                "{said}"
            );
        }
    }
    for command in [
        &["self", "a.ply"][..],
        &["tiles", "run", "tiles"],
        &["tiles", "scatter", "tiles"],
    ] {
        let said = folder.run([command, &["--threads=1025"]].concat()).misuse();
        assert!(said.contains("at most 1024"), "{said}");
    }
    folder.run(["self", "a.ply", "--threads=1024"]).printed();
    folder.text("far.off", "OFF\n3 1 0\n0 0 0\n1e400 0 0\n0 1 0\n3 0 1 2\n");
    let line = folder.run(["self", "far.off"]).error();
    assert!(line.len() < 160, "{line}");
    // Names in a mesh are those of files, without the folders of this machine.
    let path = folder.path("a.ply").display().to_string();
    folder.run(["self", &path, "--out", "seen.glb"]).printed();
    let bytes = std::fs::read(folder.path("seen.glb")).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains("\"name\":\"a.ply\"") && !text.contains(&path));
}

#[test]
fn a_device_that_is_named_is_wanted() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(20));
    let run = folder.run(["self", "a.ply", "--device", "no such device"]);
    assert!(run.code == Some(1) || run.code == Some(2), "{run:?}");
    assert!(
        run.stdout.is_empty() && run.stderr.lines().count() == 1,
        "{run:?}"
    );
    // Without a request for a GPU, no driver prints a message.
    let run = folder.run(["self", "a.ply"]);
    assert_eq!(run.stderr, "");
}
