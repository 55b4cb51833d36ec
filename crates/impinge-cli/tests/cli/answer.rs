//! `impinge pairs` and `impinge self`.

use impinge::{Query, SharedVertex};
use impinge_io::{ReadOptions, read};
use impinge_scenes::solids::solid_ball;
use impinge_scenes::soup::{lattice_triangles, lattice_web};
use impinge_scenes::surfaces::{ball, cube};
use serde_json::{Value, json};

use crate::harness::{Folder, csv_rows, keys, npy_rows, oracle};

#[test]
fn json_has_the_shape_that_is_promised() {
    let folder = Folder::new();
    let (a, b) = (ball(320), ball(500).translated([0.7, 0.1, 0.0]));
    folder.ply("a.ply", &a);
    folder.ply("b.ply", &b);
    let (rows, hash) = oracle(&[&a, &b], |ids| Query::between(ids[0], ids[1]));
    assert!(!rows.is_empty());

    let object = folder
        .run(["pairs", "a.ply", "b.ply", "--json", "--backend", "cpu"])
        .json();
    assert_eq!(
        keys(&object),
        [
            "pairs",
            "hash",
            "backend",
            "method",
            "ms",
            "stats",
            "asked",
            "bodies",
            "n_regions",
            "regions"
        ]
    );
    assert_eq!(object["pairs"], json!(rows.len()));
    assert_eq!(object["hash"], json!(hash));
    assert_eq!(object["backend"], json!("cpu"));
    assert_eq!(object["method"], json!("clusters"));
    let colliding = |body: u32| {
        let mut found: Vec<u32> = rows
            .iter()
            .flat_map(|&[body_a, a, body_b, b]| [(body_a, a), (body_b, b)])
            .filter(|&(of, _)| of == body)
            .map(|(_, element)| element)
            .collect();
        found.sort_unstable();
        found.dedup();
        found.len()
    };
    let described = |name: &str, elements: usize, vertices: usize, colliding: usize| {
        json!({
            "name": name, "kind": "triangles", "elements": elements, "vertices": vertices, "colliding": colliding,
            "welded": 0, "coincident": 0,
        })
    };
    assert_eq!(
        object["bodies"],
        json!([
            described("a.ply", 320, a.n_vertices(), colliding(0)),
            described("b.ply", 500, b.n_vertices(), colliding(1)),
        ])
    );
    assert_eq!(keys(&object["ms"]), ["total", "stages"]);
    let total = object["ms"]["total"].as_f64().unwrap();
    let stages: Vec<f64> = object["ms"]["stages"]
        .as_object()
        .unwrap()
        .values()
        .map(|ms| ms.as_f64().unwrap())
        .collect();
    assert!(total > 0.0 && !stages.is_empty() && stages.iter().all(|ms| *ms >= 0.0));
    assert!(stages.iter().sum::<f64>() <= total * 1.01 + 0.01);
    assert!(object["stats"]["n_candidates"].as_u64().unwrap() >= rows.len() as u64);
    assert!(object["stats"]["n_threads"].as_u64().unwrap() >= 1);
}

#[test]
fn written_rows_are_the_library_s() {
    let folder = Folder::new();
    let models = [
        lattice_triangles(150, 6, 1),
        lattice_triangles(100, 6, 2),
        lattice_web(80, 6, 3),
    ];
    let models: Vec<_> = models.iter().collect();
    let names = ["a.ply", "b.ply", "c.ply"];
    for (name, model) in names.iter().zip(&models) {
        folder.ply(name, model);
    }
    type Ask = fn(&[impinge::BodyId]) -> Query;
    let cases: [(&[&str], Ask); 7] = [
        (&["pairs"], |_| Query::between_all()),
        (&["pairs", "--self"], |_| Query::all()),
        (&["pairs", "--exclude", "0,1"], |ids| {
            Query::between_all().exclude((ids[0], ids[1]))
        }),
        (&["pairs", "--exclude", "2,0", "--exclude", "1,2"], |ids| {
            Query::between_all()
                .exclude((ids[0], ids[2]))
                .exclude((ids[1], ids[2]))
        }),
        (&["pairs", "--self", "--exclude", "1,1"], |ids| {
            Query::all().exclude((ids[1], ids[1]))
        }),
        (&["self"], |_| Query::self_all()),
        (&["self", "--exclude", "0,0"], |ids| {
            Query::self_all().exclude((ids[0], ids[0]))
        }),
    ];
    let mut seen = Vec::new();
    for (args, ask) in cases {
        for rule in ["skip", "resolve"] {
            let (rows, hash) = oracle(&models, |ids| match rule {
                "skip" => ask(ids).shared_vertex(SharedVertex::Skip),
                _ => ask(ids),
            });
            assert!(!rows.is_empty(), "{args:?}");
            for file in ["rows.npy", "rows.csv"] {
                let options = [
                    "--no-weld",
                    "--shared-vertex",
                    rule,
                    "--rows",
                    file,
                    "--json",
                ];
                let object = folder.run(args.iter().chain(&names).chain(&options)).json();
                assert_eq!(object["hash"], json!(hash), "{args:?}");
                assert_eq!(object["pairs"], json!(rows.len()), "{args:?}");
            }
            assert!(rows.is_sorted());
            assert_eq!(npy_rows(&folder.path("rows.npy")), rows, "{args:?} {rule}");
            assert_eq!(csv_rows(&folder.path("rows.csv")), rows, "{args:?} {rule}");
            seen.push(rows);
        }
    }
    // Each option must change something; otherwise this test could not fail.
    seen.sort();
    let n_cases = seen.len();
    seen.dedup();
    assert!(seen.len() > n_cases / 2 + 1);
}

#[test]
fn no_option_of_the_search_changes_the_answer() {
    let folder = Folder::new();
    let (a, b) = (ball(500), solid_ball(200).translated([0.4, 0.0, 0.1]));
    folder.ply("a.ply", &a);
    folder.medit("b.mesh", &b);
    let (rows, hash) = oracle(&[&a, &b], |_| Query::all());
    for options in [
        &["--method", "naive"][..],
        &["--method", "clusters", "--threads", "1", "--backend", "cpu"],
        &[
            "--method",
            "clusters",
            "--threads",
            "2",
            "--repeat",
            "3",
            "--backend",
            "cpu",
        ],
        &["--method", "cells", "--lambda", "0.3"],
        &[
            "--method",
            "cells",
            "--lambda",
            "7",
            "--group-size",
            "5",
            "--threads",
            "2",
        ],
        &[
            "--backend",
            "auto",
            "--memory-budget",
            "1G",
            "--no-progress",
        ],
    ] {
        let args = [
            "pairs",
            "a.ply",
            "b.mesh",
            "--self",
            "--json",
            "--rows",
            "rows.npy",
            "--shared-vertex",
            "skip",
        ];
        let object = folder.run(args.iter().chain(options)).json();
        assert_eq!(object["hash"], json!(hash), "{options:?}");
        assert_eq!(npy_rows(&folder.path("rows.npy")), rows, "{options:?}");
        assert_eq!(object["bodies"][1]["kind"], json!("tetrahedra"));
        if options[0] == "--method" {
            assert_eq!(object["method"], json!(options[1]));
        }
        if let Some(ix) = options.iter().position(|option| *option == "--threads")
            && options[1] == "clusters"
        {
            assert_eq!(object["stats"]["n_threads"].to_string(), options[ix + 1]);
        }
    }
}

#[test]
fn text_for_people_holds_the_numbers() {
    let folder = Folder::new();
    let (a, b) = (ball(1_280), ball(1_280).translated([0.8, 0.0, 0.0]));
    folder.ply("a.ply", &a);
    folder.ply("b.ply", &b);
    let (rows, hash) = oracle(&[&a, &b], |_| Query::between_all());
    let text = folder
        .run(["pairs", "a.ply", "b.ply", "--backend", "cpu", "-v"])
        .printed();
    for word in [
        "a.ply",
        "b.ply",
        "triangles",
        "1,280",
        "stage",
        "total",
        "clusters on cpu",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert!(
        text.contains(&format!("{} pairs, hash {hash}", rows.len())),
        "{text}"
    );
    let text = folder
        .run(["pairs", "a.ply", "b.ply", "--repeat", "5", "--verbose"])
        .printed();
    assert!(text.contains("median of 5"), "{text}");
}

#[test]
fn coloured_meshes_hold_every_body() {
    let folder = Folder::new();
    let (a, b) = (cube([0.0; 3], 1.0), cube([0.9, 0.9, 0.9], 1.0));
    folder.ply("a.ply", &a);
    folder.ply("b.ply", &b);
    for (out, is_red) in [("seen.ply", true), ("seen.glb", false), ("seen.vtu", false)] {
        folder
            .run(["pairs", "a.ply", "b.ply", "--out", out])
            .printed();
        let mesh = read(&folder.path(out), &ReadOptions::as_they_are()).unwrap();
        assert_eq!(mesh.n_elements(), 24, "{out}");
        let bytes = std::fs::read(folder.path(out)).unwrap();
        if is_red {
            let has = |color: [u8; 3]| bytes.windows(3).any(|window| window == color);
            assert!(has([214, 39, 40]) && has([27, 95, 217]) && has([200, 200, 200]));
        }
    }
    let bytes = std::fs::read(folder.path("seen.vtu")).unwrap();
    assert!(bytes.windows(9).any(|window| window == b"colliding"));
    // Tetrahedra are written to formats that support them.
    folder.medit("t.mesh", &solid_ball(40));
    folder
        .run(["pairs", "a.ply", "t.mesh", "--out", "mixed.vtu"])
        .printed();
    assert!(folder.path("mixed.vtu").is_file());
}

#[test]
fn polygons_are_fanned_with_a_note() {
    let folder = Folder::new();
    folder.text(
        "quad.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    );
    let run = folder.run(["self", "quad.obj"]);
    let expected =
        "note: quad.obj: polygons split into triangles (element numbers count the triangles): 1\n";
    assert_eq!(run.stderr, expected);
    let run = folder.run(["self", "quad.obj", "--json"]);
    assert_eq!(run.stderr, expected);
    let object: Value = serde_json::from_str(&run.printed()).unwrap();
    assert_eq!(object["bodies"][0]["elements"], json!(2));
    assert_eq!(object["stats"]["grid"], Value::Null);
}

#[test]
fn what_was_left_out_is_told_by_all_commands() {
    let folder = Folder::new();
    folder.text(
        "t2.vtk",
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n\
         0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 9\n4 0 1 2 3\n3 0 1 2\nCELL_TYPES 2\n10\n5\n",
    );
    let note = "note: t2.vtk: triangles skipped, because the file has tetrahedra: 1\n";
    for args in [
        &["self", "t2.vtk"][..],
        &["self", "t2.vtk", "--json"],
        &["step", "t2.vtk", "t2.vtk", "--json"],
        &["check", "t2.vtk"],
        &["check", "t2.vtk", "--json"],
    ] {
        assert_eq!(folder.run(args).stderr, note, "{args:?}");
    }
    // Nothing is left out of quads, and no element is named.
    folder.text(
        "quad.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    );
    let run = folder.run(["check", "quad.obj", "--places", "0"]);
    assert_eq!(run.stderr, "");
}

#[test]
fn notes_on_a_file_of_parts_name_the_file() {
    let folder = Folder::new();
    let bytes = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let text = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0,1]},{"nodes":[2]}],
        "nodes":[{"mesh":0,"name":"A"},{"mesh":0,"name":"B","skin":0},{"mesh":0,"name":"C"}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,BYTES"}]}"#;
    folder.text("abc.gltf", &text.replace("BYTES", bytes));
    let notes = "note: abc.gltf: meshes with a skin or morph targets, which are not applied: they are read at rest: 1\n\
                 note: abc.gltf: nodes with a mesh left out, because they are not in the default scene: 1\n";
    for args in [
        &["pairs", "abc.gltf"][..],
        &["pairs", "abc.gltf", "--json"],
        &["check", "--assembly", "abc.gltf"],
    ] {
        assert_eq!(folder.run(args).stderr, notes, "{args:?}");
    }
}

#[test]
fn objects_of_one_name_meet() {
    let folder = Folder::new();
    let one = "o x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n";
    let other = "o x\nv 0.2 0.2 -1\nv 0.2 0.2 1\nv 5 5 1\nf -3 -2 -1\n";
    folder.text(
        "f.obj",
        &format!(
            "{one}{other}{}",
            one.replace("o x", "o y").replace(" 0\n", " 9\n")
        ),
    );
    let object = folder.run(["pairs", "f.obj", "--json"]).json();
    assert_eq!(object["bodies"][1]["name"], "x (2)", "{object}");
    assert_eq!(object["pairs"], 1, "{object}");
}

/// Writes `n` triangles turned around one axis that passes through all of them: each meets each.
fn write_pile(folder: &Folder, name: &str, n: usize) {
    let mut text = String::new();
    for k in 0..n {
        let (sin, cos) = (k as f64 / n as f64 * 3.0).sin_cos();
        let (x, y) = (0.1 * cos, 0.1 * sin);
        text += &format!("v {} {} -1\nv {cos} {sin} -1\nv {x} {y} 1\n", -cos, -sin);
    }
    for first in (1..3 * n).step_by(3) {
        text += &format!("f {first} {} {}\n", first + 1, first + 2);
    }
    folder.text(name, &text);
}

#[test]
fn pairs_are_limited_counted_and_asked_for() {
    let folder = Folder::new();
    write_pile(&folder, "pile.obj", 60);
    let n = 60 * 59 / 2;
    let most = |limit: usize| {
        let limit = limit.to_string();
        folder.run(["self", "pile.obj", "--json", "--max-pairs", &limit])
    };
    assert_eq!(most(n).json()["pairs"], json!(n));
    let line = most(n - 1).error();
    assert!(
        line.contains(&format!("{n} pairs and more"))
            && line.contains(&format!("at most {} are allowed", n - 1)),
        "{line}"
    );

    let counted = folder.run(["self", "pile.obj", "--count"]).printed();
    let asked = "within 1 mesh, 0 vertices welded, neighbours resolved\n";
    assert_eq!(
        counted,
        format!("pile.obj: 1,770 pairs of 60 triangles\n{asked}")
    );
    let stages = folder.run(["self", "pile.obj", "--count", "-v"]).printed();
    assert!(stages.starts_with(counted.lines().next().expect("a line")));
    assert!(
        stages.contains("\nstage ") && stages.contains(" on cpu, "),
        "{stages}"
    );
    let object = folder.run(["self", "pile.obj", "--count", "--json"]).json();
    assert_eq!(
        keys(&object),
        ["pairs", "asked", "backend", "method", "ms", "stats"]
    );
    assert_eq!(object["pairs"], json!(n));
    let any = folder.run(["self", "pile.obj", "--any"]).printed();
    assert_eq!(
        any,
        format!("pile.obj: at least one pair of 60 triangles\n{asked}")
    );
    let object = folder.run(["self", "pile.obj", "--any", "--json"]).json();
    assert_eq!(object["any"], json!(true));
    for option in ["--any", "--count"] {
        let run = folder.run(["self", "pile.obj", option, "--fail-on-hit"]);
        assert_eq!((run.code, run.stderr.as_str()), (Some(3), ""));
        for others in [
            &["--rows", "p.csv"][..],
            &["--out", "p.ply"],
            &["--repeat", "2"],
        ] {
            let arguments = ["self", "pile.obj", option];
            let said = folder.run(arguments.iter().chain(others)).misuse();
            assert!(said.contains(option) && said.contains(others[0]), "{said}");
        }
    }
    folder
        .run(["self", "pile.obj", "--any", "--count"])
        .misuse();

    folder.ply("a.ply", &ball(300));
    folder.ply("b.ply", &ball(300).translated([5.0, 0.0, 0.0]));
    for option in ["--any", "--count"] {
        let run = folder.run(["pairs", "a.ply", "b.ply", option, "--fail-on-hit"]);
        let n = 2 * ball(300).elements.len();
        let expected = format!("a.ply and b.ply: no pairs of {n} triangles\n");
        assert!(run.printed().starts_with(&expected));
    }
}

/// 72 million pairs take 576 MB, of 600 that the process may have.
#[cfg(target_os = "linux")]
#[test]
fn an_answer_without_memory_is_an_error() {
    let folder = Folder::new();
    write_pile(&folder, "pile.obj", 12_000);
    let run = |more: &[&str]| {
        let script = r#"ulimit -v 600000; exec "$0" "$@""#;
        let output = std::process::Command::new("sh")
            .args(["-c", script, env!("CARGO_BIN_EXE_impinge")])
            .args(["self", "pile.obj", "--backend", "cpu", "--threads", "2"])
            .args(more)
            .current_dir(folder.path(""))
            .output()
            .unwrap();
        crate::harness::Run::from(output)
    };
    let line = run(&[]).error();
    assert!(line.starts_with("out of memory: "), "{line}");
    let counted = run(&["--count"]).printed();
    assert!(counted.contains("71,994,000 pairs"), "{counted}");
    let line = run(&["--max-pairs", "1000"]).error();
    assert!(line.contains("at most 1000 are allowed"), "{line}");
    let line = run(&["--memory-budget", "100M"]).error();
    assert!(
        line.starts_with("the memory budget is 104857600 bytes, but "),
        "{line}"
    );
}
