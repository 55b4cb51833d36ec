//! Real meshes and published answers.

use std::path::PathBuf;

use impinge_io::{Positions, ReadOptions, read};
use impinge_scenes::Model;
use impinge_testing::data::test_file;
use impinge_testing::published::rows_of_two_bodies;
use serde_json::{Value, json};

use crate::harness::{Folder, npy_rows};

fn file(path: &str) -> Option<PathBuf> {
    test_file(path)
}

fn answers(path: &str) -> Option<Value> {
    let text = std::fs::read_to_string(file(path)?).unwrap();
    Some(serde_json::from_str(&text).unwrap())
}

#[test]
fn self_intersections_of_welded_meshes() {
    let Some(answers) = answers("expected/self_intersections.json") else {
        return;
    };
    let folder = Folder::new();
    for name in ["meshes/cow.off", "meshes/camelhead.off"] {
        let Some(path) = file(name) else { return };
        let answer = &answers[name];
        let hits = |kind: &str| answer[kind].as_u64().unwrap();
        for (rule, n) in [
            ("skip", hits("hits_noshared")),
            (
                "resolve",
                hits("hits_noshared") + hits("hits_shared1") + hits("hits_shared2"),
            ),
        ] {
            let path = path.to_str().unwrap();
            let object = folder
                .run([
                    "self",
                    path,
                    "--weld",
                    "--shared-vertex",
                    rule,
                    "--json",
                    "--rows",
                    "rows.npy",
                ])
                .json();
            assert_eq!(object["pairs"], json!(n), "{name} {rule}");
            if rule == "skip" {
                let expected: Vec<[u32; 4]> = answer["pairs_noshared"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|pair| {
                        let triangle = |k: usize| pair[k].as_u64().unwrap().try_into().unwrap();
                        [0, triangle(0), 0, triangle(1)]
                    })
                    .collect();
                let rows = npy_rows(&folder.path("rows.npy"));
                assert_eq!(rows, expected, "{name}");
            }
        }
    }
}

#[test]
fn bunny_against_its_moved_copy() {
    let (Some(answers), Some(path)) = (answers("expected/two_body.json"), file("meshes/bunny.ply"))
    else {
        return;
    };
    let answer = &answers["bunny"];
    let offset: [f32; 3] =
        std::array::from_fn(|k| answer["offset_f32"][k].as_f64().unwrap() as f32);
    let mut mesh = read(&path, &ReadOptions::as_they_are()).unwrap();
    assert!(mesh.positions.narrow_if_exact());
    let (Positions::F32(positions), impinge_io::Elements::Triangles(faces)) =
        (mesh.positions, mesh.elements)
    else {
        panic!("the bunny is a surface in f32");
    };
    let moved = Model {
        positions,
        elements: faces.into(),
    }
    .translated(offset);
    let folder = Folder::new();
    folder.ply("moved.ply", &moved);
    let object = folder
        .run([
            "pairs",
            path.to_str().unwrap(),
            "moved.ply",
            "--json",
            "--rows",
            "rows.npy",
        ])
        .json();
    for (found, expected) in [
        (&object["pairs"], "pairs"),
        (&object["bodies"][0]["colliding"], "colliding_triangles_a"),
        (&object["bodies"][1]["colliding"], "colliding_triangles_b"),
    ] {
        assert_eq!(found, &answer[expected]);
    }
    if let Some(list) = file(answer["file"].as_str().unwrap()) {
        assert_eq!(
            npy_rows(&folder.path("rows.npy")),
            rows_of_two_bodies(&list)
        );
    }
}

#[test]
fn rumba_against_the_oracle() {
    let (Some(mesh), Some(frames)) = (file("sequences/rumba.ply"), file("sequences/rumba.pc2"))
    else {
        return;
    };
    let folder = Folder::new();
    let (mesh, frames) = (mesh.to_str().unwrap(), frames.to_str().unwrap());
    let found = |method: &str| -> Vec<(u64, Value, Value)> {
        let text = folder
            .run([
                "sequence", mesh, frames, "--weld", "--frames", "60..62", "--json", "--method",
                method,
            ])
            .printed();
        text.lines()
            .map(|line| serde_json::from_str::<Value>(line).unwrap())
            .map(|line| {
                (
                    line["frame"].as_u64().unwrap(),
                    line["pairs"].clone(),
                    line["hash"].clone(),
                )
            })
            .collect()
    };
    let expected = found("naive");
    assert_eq!(expected.len(), 2);
    assert!(expected[0].1.as_u64().unwrap() > 0);
    assert_eq!(found("clusters"), expected);
}
