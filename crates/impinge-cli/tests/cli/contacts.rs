//! `--contacts` and `--curves` of `pairs` and `self`, and `impinge distance`.

use impinge_scenes::surfaces::{ball, cube};
use serde_json::{Value, json};

use crate::harness::Folder;

#[test]
fn contacts_and_curves_are_written() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(320));
    folder.ply("b.ply", &ball(500).translated([0.3, 0.01, 0.02]));
    for curves in ["curves.obj", "curves.ply", "curves.vtu"] {
        let object = folder
            .run([
                "pairs",
                "a.ply",
                "b.ply",
                "--json",
                "--backend",
                "cpu",
                "--contacts",
                "contacts.csv",
                "--curves",
                curves,
            ])
            .json();
        let found = &object["contacts"];
        // Closed bodies in general position: one loop, as many points as segments.
        assert_eq!((&found["curves"], &found["closed"]), (&json!(1), &json!(1)));
        assert_eq!(found["shapes"]["segment"], object["pairs"]);
        assert_eq!(found["points"], object["pairs"]);
    }
    let text = std::fs::read_to_string(folder.path("curves.obj")).unwrap();
    let n_vertices = text.lines().filter(|line| line.starts_with("v ")).count();
    let line = text.lines().find(|line| line.starts_with("l ")).unwrap();
    let numbers: Vec<usize> = line[2..].split(' ').map(|n| n.parse().unwrap()).collect();
    assert_eq!(numbers.len(), n_vertices + 1);
    assert_eq!(numbers[0], numbers[n_vertices]);
    let text = std::fs::read_to_string(folder.path("contacts.csv")).unwrap();
    assert_eq!(text.lines().count(), 2 * n_vertices + 1);
    assert!(text.lines().nth(1).unwrap().starts_with("0,0,"));
    let ply = std::fs::read(folder.path("curves.ply")).unwrap();
    let header = format!("element vertex {n_vertices}\n");
    assert!(String::from_utf8_lossy(&ply[..200]).contains(&header));
    let end = ply
        .windows(11)
        .position(|at| at == b"end_header\n")
        .unwrap()
        + 11;
    assert_eq!(ply.len() - end, n_vertices * (24 + 12));
    // The text has the counts as well, and the array has one row per corner.
    let printed = folder
        .run([
            "pairs",
            "a.ply",
            "b.ply",
            "--backend",
            "cpu",
            "--contacts",
            "contacts.npy",
        ])
        .printed();
    assert!(printed.contains("1 curve, 1 closed, length "), "{printed}");
    let npy = std::fs::read(folder.path("contacts.npy")).unwrap();
    let (_, data) = impinge_testing::npy::split(&npy);
    assert_eq!(data.len(), 68 * 2 * n_vertices);
}

#[test]
fn distances_are_told() {
    let folder = Folder::new();
    folder.ply("a.ply", &cube([0.0; 3], 1.0));
    folder.ply("b.ply", &cube([3.0, 0.1, 0.2], 1.0));
    folder.ply("c.ply", &cube([1.0, 0.25, 0.0], 1.0));
    let object = folder.run(["distance", "a.ply", "b.ply", "--json"]).json();
    assert_eq!(object["distance"], json!(2.0));
    let mut alone = folder
        .run(["distance", "a.ply", "b.ply", "--json", "--threads", "1"])
        .json();
    alone["ms"] = object["ms"].clone();
    assert_eq!(alone, object);
    assert_eq!(object["points"][0][0], json!(0.5));
    assert_eq!(object["points"][1][0], json!(2.5));
    // They touch: exactly 0, and where.
    let object = folder.run(["distance", "a.ply", "c.ply", "--json"]).json();
    assert_eq!(object["distance"], json!(0.0));
    assert_eq!(object["points"][0], object["points"][1]);
    assert_eq!(object["points"][0][0], json!(0.5));
    // A tetrahedron in another one: a corner of the inner one.
    let medit = |scale: u32| {
        format!(
            "MeshVersionFormatted 2\nDimension 3\nVertices 4\n1 1 1 0\n{0} 1 1 0\n1 {0} 1 0\n1 1 {0} 0\nTetrahedra 1\n1 2 3 4 0\n",
            1 + scale
        )
    };
    folder.text("outer.mesh", &medit(8).replace("1 1 1 0\n", "-1 -1 -1 0\n"));
    folder.text("inner.mesh", &medit(1));
    for [a, b] in [["outer.mesh", "inner.mesh"], ["inner.mesh", "outer.mesh"]] {
        let object = folder.run(["distance", a, b, "--json"]).json();
        assert_eq!(object["distance"], json!(0.0));
        assert_eq!(object["points"], json!([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]));
        let printed = folder.run(["distance", a, b]).printed();
        assert_eq!(
            printed,
            format!("distance 0\nelement 0 of {a} at 1 1 1\nelement 0 of {b} at 1 1 1\n")
        );
    }
    let printed = folder.run(["distance", "a.ply", "b.ply"]).printed();
    assert!(printed.starts_with("distance 2\nelement "), "{printed}");
    // Less than a limit, which the true distance decides: 2 is not less than 2.
    for (limit, code, said) in [
        ("2", 0, "distance 2, not less than 2\n"),
        (
            "2.0000000000000004",
            3,
            "distance 2, less than 2.0000000000000004\n",
        ),
        ("0", 0, "distance 2, not less than 0\n"),
    ] {
        let run = folder.run(["distance", "a.ply", "b.ply", "--below", limit]);
        assert_eq!(run.code, Some(code), "{}", run.stderr);
        assert!(run.stdout.starts_with(said), "{}", run.stdout);
    }
    let run = folder.run(["distance", "a.ply", "c.ply", "--below", "1e-9", "--json"]);
    let object: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((run.code, &object["below"]), (Some(3), &json!(true)));
    // Of several, the nearest two; of one file, its nodes. a and c touch, b is 2 from c.
    let all = ["distance", "a.ply", "b.ply", "c.ply", "--json"];
    let told = |args: &[&str]| {
        let object = folder.run(args).json();
        (
            object["distance"].clone(),
            object["bodies"].clone(),
            object["names"].clone(),
        )
    };
    assert_eq!(
        told(&all),
        (json!(0.0), json!([0, 2]), json!(["a.ply", "c.ply"]))
    );
    let others = [&all[..], &["--exclude", "2,0"]].concat();
    assert_eq!(
        told(&others),
        (json!(1.0), json!([1, 2]), json!(["b.ply", "c.ply"]))
    );
    let none = folder.run(["distance", "a.ply", "b.ply", "--exclude", "0,1"]);
    assert!(none.misuse().contains("not excluded"));
    let none = folder.run(["distance", "a.ply", "b.ply", "--exclude", "0,2"]);
    assert!(none.misuse().contains("--exclude"));
    folder.text(
        "two.obj",
        "o one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no two\nv 0 0 3\nv 1 0 3\nv 0 1 3\nf 4 5 6\n",
    );
    assert_eq!(
        told(&["distance", "two.obj", "--json"]),
        (json!(3.0), json!([0, 1]), json!(["one", "two"]))
    );
    let printed = folder.run(["distance", "two.obj"]).printed();
    assert!(printed.contains("element 0 of two at 0 0 3"), "{printed}");
    let alone = folder.run(["distance", "a.ply"]);
    assert!(alone.misuse().contains("a.ply: one body"));
    let misuse = folder.run(["distance", "a.ply", "b.ply", "--below", "-1"]);
    assert!(misuse.misuse().contains("not below 0"));
}

#[test]
fn regions_say_how_deep_and_how_much() {
    let folder = Folder::new();
    folder.ply("a.ply", &cube([0.0; 3], 1.0));
    folder.ply("b.ply", &cube([0.75, 0.25, 0.125], 1.0));
    // A sheet with a border, all through a: it has no inside.
    folder.text(
        "sheet.obj",
        "v -2 -2 0.25\nv 4 -2 0.25\nv -2 4 0.25\nf 1 2 3\n",
    );
    let csv = |args: &[&str]| -> Vec<Vec<String>> {
        let mut all = vec!["pairs"];
        all.extend(args);
        folder
            .run(all.into_iter().chain(["--regions", "regions.csv"]))
            .printed();
        let text = std::fs::read_to_string(folder.path("regions.csv")).unwrap();
        let fields = |line: &str| line.split(',').map(str::to_owned).collect();
        text.lines().map(fields).collect()
    };
    let rows = csv(&["a.ply", "b.ply"]);
    let column = |name: &str| rows[0].iter().position(|own| own == name).unwrap();
    assert_eq!(rows.len(), 2);
    let number = |name: &str| rows[1][column(name)].parse::<f64>().unwrap();
    assert_eq!([number("body_a"), number("body_b")], [0.0, 1.0]);
    assert!(
        (number("volume") - 0.25 * 0.75 * 0.875).abs() < 1e-12,
        "{rows:?}"
    );
    assert_eq!([number("inside_a"), number("inside_b")], [1.0, 1.0]);
    assert_eq!([number("low_x"), number("high_x")], [0.25, 0.5]);
    // a is to go where b is not, and then nothing overlaps.
    assert!(number("nx") < -0.8, "{rows:?}");
    let depth = number("depth");
    assert!(depth > 0.25 && depth < 0.75, "{depth}");
    let moved: [f64; 3] = ["nx", "ny", "nz"].map(|axis| number(axis) * depth * 1.000_001);
    let apart = cube(moved.map(|x| x as f32), 1.0);
    folder.ply("apart.ply", &apart);
    let printed = folder.run(["pairs", "apart.ply", "b.ply"]).printed();
    assert!(printed.contains(": no pairs"), "{printed}");

    let rows = csv(&["a.ply", "sheet.obj"]);
    assert_eq!(rows.len(), 2);
    for name in ["depth", "volume"] {
        assert_eq!(rows[1][column(name)], "", "{rows:?}");
    }
    assert_eq!(rows[1][column("length")], "4.0");
    let args = ["pairs", "a.ply", "sheet.obj", "--regions"];
    let run = |file: &str| {
        folder
            .run(args.into_iter().chain([file, "--json"]))
            .printed()
    };
    run("regions.jsonl");
    let text = std::fs::read_to_string(folder.path("regions.jsonl")).unwrap();
    let object: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(object["volume"], Value::Null);
    assert_eq!(object["position"].as_array().unwrap().len(), 3);
    // In arrays what is not known is not a number.
    run("regions.npy");
    let npy = std::fs::read(folder.path("regions.npy")).unwrap();
    let nan = f64::NAN.to_le_bytes();
    assert_eq!(npy[npy.len() - 16..npy.len() - 8], nan, "the volume");
    let said = folder.run(args.into_iter().chain(["-"])).misuse();
    assert!(said.contains("--regions: regions are written to files"));
}
