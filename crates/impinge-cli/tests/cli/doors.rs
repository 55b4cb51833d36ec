//! One question has one answer at every door. The files of `tests/doors` repeat vertices along
//! seams, share none, fold back onto themselves, have groups or nodes, or are made of tetrahedra;
//! `answers.json` there has the answers, which the doors of Python (`test_doors.py`) and JavaScript
//! are compared with too.

use std::path::{Path, PathBuf};

use impinge::{Detector, Method, Query, Scene, Settings};
use impinge_io::{Elements, Mesh, Positions, ReadOptions, read, read_bodies};
use serde_json::{Value, json};

use crate::harness::Folder;

const FILES: [&str; 8] = [
    "box.glb",
    "groups.obj",
    "lattice.off",
    "nodes.gltf",
    "octahedra.stl",
    "sphere.obj",
    "strip.obj",
    "tetrahedra.mesh",
];

fn file(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doors")).join(name)
}

fn answers() -> Value {
    let text = std::fs::read_to_string(file("answers.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn add(scene: &mut Scene, mesh: Mesh) {
    let elements: impinge::Elements = match mesh.elements {
        Elements::Triangles(faces) => faces.into(),
        Elements::Tetrahedra(tets) => tets.into(),
    };
    let positions: impinge::Positions = match mesh.positions {
        Positions::F32(positions) => positions.into(),
        Positions::F64(positions) => positions.into(),
    };
    scene.add((elements, positions)).unwrap();
}

/// Every box against every box.
fn oracle(meshes: Vec<Mesh>, query: &Query) -> Value {
    let mut scene = Scene::new();
    for mesh in meshes {
        add(&mut scene, mesh);
    }
    let mut detector = Detector::new(Settings::new().method(Method::Naive)).unwrap();
    let pairs = detector.detect(&scene, query).unwrap();
    json!({ "pairs": pairs.len(), "hash": format!("{:016x}", pairs.hash()) })
}

fn found(object: &Value) -> Value {
    json!({ "pairs": object["pairs"], "hash": object["hash"] })
}

/// What `impinge tiles` merges.
fn of_tiles(folder: &Folder, meshes: &[&str], cap: &str) -> Value {
    let plan = ["tiles", "plan", "tiles", "--replace", "--cap", cap];
    folder.run(plan.iter().chain(meshes)).printed();
    folder.run(["tiles", "scatter", "tiles"]).printed();
    folder.run(["tiles", "run", "tiles", "--self"]).printed();
    found(&folder.run(["tiles", "merge", "tiles", "--json"]).json())
}

#[test]
fn the_answers_are_those_of_the_oracle() {
    let mut expected = serde_json::Map::new();
    for name in FILES {
        let mesh = read(&file(name), &ReadOptions::default()).unwrap();
        let mut answer = oracle(vec![mesh], &Query::self_all());
        let (bodies, _) = read_bodies(&file(name), &ReadOptions::default()).unwrap();
        if bodies.len() > 1 {
            answer["bodies"] = bodies.iter().map(|body| json!(body.name)).collect();
            let meshes = bodies.into_iter().map(|body| body.mesh).collect();
            answer["between"] = oracle(meshes, &Query::between_all());
        }
        expected.insert(name.to_owned(), answer);
    }
    assert_eq!(
        answers(),
        Value::Object(expected.clone()),
        "{}",
        serde_json::to_string_pretty(&expected).unwrap()
    );
    // A box and a sphere are clean once they are welded; what folds or crosses is not.
    let n = |name: &str| expected[name]["pairs"].as_u64().unwrap();
    assert_eq!((n("box.glb"), n("sphere.obj")), (0, 0));
    assert!(
        FILES
            .iter()
            .all(|name| ["box.glb", "sphere.obj"].contains(name) || n(name) > 0)
    );
}

#[test]
fn the_doors_of_the_program_answer_alike() {
    let answers = answers();
    for name in FILES {
        let folder = Folder::new();
        std::fs::copy(file(name), folder.path(name)).unwrap();
        let answer = &answers[name];
        let expected = found(answer);
        let asked = |args: &[&str]| found(&folder.run(args).json());
        assert_eq!(asked(&["self", name, "--json"]), expected, "{name}");
        assert_eq!(
            asked(&["self", name, "--json", "--method", "cells"]),
            expected,
            "{name}"
        );
        assert_eq!(of_tiles(&folder, &[name], "10"), expected, "{name}");
        let row = folder.run(["check", name, "--json"]).json();
        let checked = json!({ "pairs": row["self_intersections"], "hash": row["hash"] });
        assert_eq!(checked, expected, "{name}");
        // The first frame of a sequence is the mesh itself.
        let extension = name.rsplit('.').next().unwrap();
        let frame = format!("f_0.{extension}");
        std::fs::copy(file(name), folder.path(&frame)).unwrap();
        assert_eq!(
            asked(&["sequence", name, &frame, "--json"]),
            expected,
            "{name}"
        );
        if answer["bodies"].is_array() {
            let object = folder.run(["pairs", name, "--json"]).json();
            assert_eq!(found(&object), found(&answer["between"]), "{name}");
            let bodies = object["bodies"].as_array().unwrap();
            let names: Value = bodies.iter().map(|body| body["name"].clone()).collect();
            assert_eq!(names, answer["bodies"]);
        }
    }
}

/// The picture of one mesh shows where it meets itself.
#[cfg(feature = "gpu")]
#[test]
fn a_picture_comes_with_the_same_answer() {
    let folder = Folder::new();
    let answers = answers();
    for name in ["box.glb", "strip.obj", "nodes.gltf"] {
        std::fs::copy(file(name), folder.path(name)).unwrap();
        let args = [
            "render", name, "--png", "a.png", "--size", "32x32", "--json",
        ];
        let object = folder.run(args).json();
        assert_eq!(found(&object), found(&answers[name]), "{name}");
    }
}

/// Without a window, `view` prints what its picture shows.
#[cfg(feature = "view")]
#[test]
fn the_picture_of_the_window_says_what_was_asked() {
    let folder = Folder::new();
    for name in FILES {
        std::fs::copy(file(name), folder.path(name)).unwrap();
    }
    let small = ["--png", "a.png", "--size", "32x32"];
    for meshes in [&["nodes.gltf"][..], &["strip.obj", "groups.obj"]] {
        let lines = |command| {
            let words = [&[command][..], meshes, &small].concat();
            let text = folder.run(words).printed();
            let last = text.lines().last().unwrap().to_owned();
            (text.lines().next().unwrap().to_owned(), last)
        };
        let (first, last) = lines("view");
        let (whole, same) = lines("render");
        assert!(whole.starts_with(&first), "{first}: {whole}");
        assert_eq!(last, same);
    }
}

#[test]
fn parts_of_files_are_bodies_where_they_are_asked_for() {
    let folder = Folder::new();
    for name in FILES {
        std::fs::copy(file(name), folder.path(name)).unwrap();
    }
    let text = folder.run(["pairs", "nodes.gltf"]).printed();
    assert!(text.starts_with("nodes.gltf: "), "{text}");
    let last = "between 3 nodes of nodes.gltf, 48 vertices welded, neighbours resolved; not asked: self-collision (--self)";
    assert_eq!(text.lines().last(), Some(last));
    let text = folder.run(["pairs", "groups.obj", "--self"]).printed();
    assert!(
        text.contains("\nbetween 3 groups of groups.obj and within each, "),
        "{text}"
    );
    let near = ["near", "nodes.gltf", "--distance", "0.1"];
    let text = folder
        .run(near.iter().chain(&["--bodies", "nodes"]))
        .printed();
    assert!(
        text.contains(
            "\nbetween 3 nodes of nodes.gltf, 48 vertices welded, neighbours resolved where they intersect, else never near; not asked: "
        ),
        "{text}"
    );
    let text = folder.run(near).printed();
    assert!(
        text.contains("\nwithin 1 mesh, 48 vertices welded, "),
        "{text}"
    );
    // As one body, the file has the pairs of all its parts.
    let whole = folder.run(["self", "nodes.gltf", "--json"]).json();
    let parts = folder.run(["pairs", "nodes.gltf", "--self", "--json"]);
    assert_eq!(whole["pairs"], parts.json()["pairs"]);
    // Of several files, parts are bodies if that is said; the others stay whole.
    let names = |args: &[&str]| {
        let object = folder.run(args.iter().chain(&["--json"])).json();
        let bodies = object["bodies"].as_array().unwrap();
        let names = bodies
            .iter()
            .map(|body| body["name"].as_str().unwrap().to_owned());
        names.collect::<Vec<_>>()
    };
    let two = ["pairs", "nodes.gltf", "strip.obj"];
    assert_eq!(names(&two), ["nodes.gltf", "strip.obj"]);
    assert_eq!(
        names(&[&two[..], &["--bodies", "nodes"]].concat()),
        [
            "nodes.gltf#crate",
            "nodes.gltf#lid",
            "nodes.gltf#far",
            "strip.obj"
        ]
    );
    assert_eq!(
        names(&["self", "groups.obj", "--bodies", "groups"]),
        ["floor", "wall", "roof"]
    );
    assert_eq!(
        names(&["self", "groups.obj", "--bodies", "file"]),
        ["groups.obj"]
    );
    for (args, said) in [
        (&["pairs", "box.glb"][..], "one body meets no other"),
        (
            &["pairs", "nodes.gltf", "--bodies", "file"],
            "one body meets no other",
        ),
        (
            &["self", "groups.obj", "--bodies", "nodes"],
            "only glTF and 3MF files have nodes",
        ),
        (
            &["self", "nodes.gltf", "--bodies", "groups"],
            "only OBJ files have groups",
        ),
        (
            &["sequence", "groups.obj", "groups.obj", "--bodies", "groups"],
            "one body",
        ),
    ] {
        let misuse = folder.run(args).misuse();
        assert!(misuse.contains(said), "{args:?}: {misuse}");
    }
    // One body that is asked for its self-collision too has an answer.
    let text = folder.run(["pairs", "box.glb", "--self"]).printed();
    assert!(
        text.contains("\nwithin 1 mesh, 16 vertices welded"),
        "{text}"
    );
}

/// The numbers of real meshes: the program's are published ones, and tiles have the same.
#[test]
fn real_meshes_have_one_answer() {
    let folder = Folder::new();
    for (name, n_pairs) in [
        ("meshes/cow.off", 83),
        ("meshes/camelhead.off", 5),
        ("meshes/dragon.ply", 463),
    ] {
        let Some(path) = impinge_testing::data::test_file(name) else {
            return;
        };
        let path = path.to_str().unwrap();
        let expected = found(&folder.run(["self", path, "--json"]).json());
        assert_eq!(expected["pairs"], n_pairs, "{name}");
        assert_eq!(of_tiles(&folder, &[path], "100k"), expected, "{name}");
        let row = folder.run(["check", path, "--json"]).json();
        assert_eq!(row["hash"], expected["hash"], "{name}");
    }
}
