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
    let start = 10 + usize::from(u16::from_le_bytes([npy[8], npy[9]]));
    assert_eq!((npy.len() - start) % (2 * n_vertices), 0);
    assert_eq!((npy.len() - start) / (2 * n_vertices), 68);
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
    let misuse = folder.run(["distance", "a.ply", "b.ply", "--below", "-1"]);
    assert!(misuse.misuse().contains("not below 0"));
}
