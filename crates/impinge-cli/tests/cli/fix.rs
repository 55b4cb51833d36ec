//! `impinge fix`: what it writes, `impinge check` confirms.

use serde_json::json;

use crate::harness::{Folder, csv_rows, keys};
use crate::schema::{schema, wrong};

/// A closed tetrahedron as OBJ, to which tests append.
const CLOSED: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

/// Every defect that can be mended, in separate pieces, and a needle through the first one.
fn bad() -> String {
    let again = "f 3 2 1\n";
    let repeated_vertex = "v 0 0 1\nf 1 5 5\n";
    let turned = "v 10 0 0\nv 11 0 0\nv 10 1 0\nv 10 0 1\nf 6 8 7\nf 6 7 9\nf 7 8 9\nf 6 8 9\n";
    let inside_out =
        "v 20 0 0\nv 21 0 0\nv 20 1 0\nv 20 0 1\nf 10 11 12\nf 10 13 11\nf 11 13 12\nf 10 12 13\n";
    // A tetrahedron that shares a vertex with the first one.
    let touching = "v -1 0 0\nv 0 -1 0\nv 0 0 -1\nf 1 14 15\nf 1 16 14\nf 1 15 16\nf 14 16 15\n";
    let needle = "v 0.2 0.2 -1\nv 0.3 0.2 -1\nv 0.2 0.2 1\nf 17 18 19\n";
    let unused = "v 7 7 7\n";
    format!("{CLOSED}{again}{repeated_vertex}{turned}{inside_out}{touching}{needle}{unused}")
}

#[test]
fn what_fix_writes_check_confirms() {
    let folder = Folder::new();
    folder.text("bad.obj", &bad());
    for out in ["mended.ply", "mended.obj"] {
        let args = [
            "fix", "bad.obj", "--out", out, "--rows", "left.csv", "--json",
        ];
        let object = folder.run(args).json();
        assert_eq!(wrong(&schema("fix"), &object, "$"), [""; 0]);
        for part in ["before", "after"] {
            assert_eq!(wrong(&schema("check"), &object[part], part), [""; 0]);
        }
        let done = &object["repairs"];
        assert_eq!(done["weld"]["vertices_removed"], 1);
        assert_eq!(done["duplicates"]["faces_removed"], 1);
        assert_eq!(done["degenerate"]["faces_removed"], 1);
        assert_eq!(done["orient"]["faces_turned"], 1);
        assert_eq!(done["split-vertices"]["vertices_split"], 1);
        assert_eq!(done["outward"]["shells"], 4);
        assert_eq!(done["outward"]["shells_turned"], 1);
        assert_eq!(done["unused"]["vertices_removed"], 1);
        assert_eq!(done["close-holes"]["asked"], false);
        assert_eq!(object["seams"], true);
        let after = folder.run(["check", out, "--keep-seams", "--json"]).json();
        assert_eq!(after, object["after"]);
        for (key, n) in [
            ("self_intersections", 2),
            ("degenerate", 0),
            ("duplicate_faces", 0),
            ("non_manifold_edges", 0),
            ("non_manifold_vertices", 0),
            ("inconsistent_edges", 0),
            ("boundary_edges", 3),
            ("unused_vertices", 0),
            ("components", 5),
        ] {
            assert_eq!(after[key], n, "{key}");
        }
        // The pairs that are left are those of `self`, by the faces of the result.
        let rows = csv_rows(&folder.path("left.csv"));
        folder.run(["self", out, "--rows", "self.csv"]).printed();
        let found = csv_rows(&folder.path("self.csv"));
        assert_eq!((rows.len(), rows), (2, found));
        std::fs::remove_file(folder.path(out)).unwrap();
    }
}

#[test]
fn the_text_says_what_was_done_and_what_is_left() {
    let folder = Folder::new();
    folder.text("bad.obj", &bad());
    let text = folder.run(["fix", "bad.obj", "--out", "m.ply"]).printed();
    for line in [
        "bad.obj: 19 faces, 20 vertices",
        "  weld            1 vertex removed",
        "  duplicates      1 face removed",
        "  degenerate      1 face removed",
        "  orient          1 face turned",
        "  split-vertices  1 vertex split, 1 vertex added",
        "  outward         1 of 4 shells turned",
        "  unused          1 vertex removed",
        "m.ply: 17 faces, 19 vertices",
        "left: 2 pairs of faces that intersect, 3 border edges",
        "next: impinge check m.ply --keep-seams",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    folder.text("good.obj", CLOSED);
    let text = folder.run(["fix", "good.obj", "--out", "g.ply"]).printed();
    assert!(
        text.contains("\n  nothing to mend\n") && text.contains("\nleft: nothing\n"),
        "{text}"
    );
}

#[test]
fn files_are_safe_and_repairs_are_chosen_by_name() {
    let folder = Folder::new();
    folder.text("bad.obj", &bad());
    folder.text("old.ply", "precious");
    let said = folder.run(["fix", "bad.obj", "--out", "old.ply"]).misuse();
    assert!(
        said.contains("old.ply: the file exists; --force replaces it"),
        "{said}"
    );
    assert_eq!(std::fs::read(folder.path("old.ply")).unwrap(), b"precious");
    for force in [&[][..], &["--force"]] {
        let args = [&["fix", "bad.obj", "--out", "bad.obj"], force].concat();
        assert!(folder.run(args).misuse().contains("would be lost"));
    }
    let only = [
        "fix",
        "bad.obj",
        "--out",
        "old.ply",
        "--force",
        "--only",
        "weld,outward",
        "--json",
    ];
    let object = folder.run(only).json();
    let asked = |object: &serde_json::Value| -> Vec<String> {
        let all = keys(&object["repairs"]);
        let asked = all
            .into_iter()
            .filter(|name| object["repairs"][*name]["asked"] == true);
        asked.map(str::to_owned).collect()
    };
    assert_eq!(asked(&object), ["weld", "outward"]);
    assert_eq!(
        (&object["after"]["duplicate_faces"], &object["seams"]),
        (&json!(1), &json!(false))
    );
    let skip = [
        "fix",
        "bad.obj",
        "--out",
        "s.ply",
        "--skip",
        "weld,split-vertices,unused",
        "--close-holes",
        "3",
        "--json",
    ];
    let expected = [
        "duplicates",
        "degenerate",
        "orient",
        "split-edges",
        "close-holes",
        "outward",
    ];
    assert_eq!(asked(&folder.run(skip).json()), expected);
    folder
        .run([
            "fix", "bad.obj", "--out", "x.ply", "--only", "weld", "--skip", "weld",
        ])
        .misuse();
    folder
        .run(["fix", "bad.obj", "--out", "x.ply", "--close-holes", "2"])
        .misuse();
    folder
        .run(["fix", "bad.obj", "--out", "x.ply", "--only", "close-holes"])
        .misuse();
    folder.run(["fix", "bad.obj", "--out", "x.off"]).misuse();
    assert!(
        folder
            .run(["fix", "none.obj", "--out", "x.ply"])
            .error()
            .contains("none.obj")
    );
    assert!(!folder.path("x.ply").exists());
}

#[test]
fn what_is_left_can_fail_a_run() {
    let folder = Folder::new();
    folder.text("bad.obj", &bad());
    let run = folder.run([
        "fix",
        "bad.obj",
        "--out",
        "m.ply",
        "--fail-on",
        "self-intersections",
    ]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let passes = [
        "fix",
        "bad.obj",
        "--out",
        "n.ply",
        "--fail-on",
        "duplicates,orientation,non-manifold,degenerate",
    ];
    folder.run(passes).printed();
}

#[test]
fn seams_stay_only_where_check_is_told_to_keep_them() {
    let folder = Folder::new();
    folder.text("bad.obj", &bad());
    folder.run(["fix", "bad.obj", "--out", "m.ply"]).printed();
    let welded = folder.run(["check", "m.ply", "--json"]).json();
    assert_eq!(
        (&welded["non_manifold_vertices"], &welded["welded"]),
        (&json!(1), &json!(true))
    );
    let apart = folder.run(["check", "m.ply", "--json", "--no-weld"]).json();
    // Without welding, what touches intersects.
    assert!(apart["self_intersections"].as_u64() > Some(2));
    folder
        .run(["check", "m.ply", "--keep-seams", "--no-weld"])
        .misuse();
    folder
        .run(["check", "m.ply", "--keep-seams", "--out", "rows"])
        .misuse();
}

#[test]
fn stl_keeps_the_bits_and_says_that_it_joins_what_was_split() {
    let folder = Folder::new();
    // Two tetrahedra with a common edge, a corner of which is no f32.
    let far = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0.1 -1 0\nv 0.1 0 -1\n";
    let faces = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\nf 1 2 5\nf 1 6 2\nf 2 6 5\nf 1 5 6\n";
    folder.text("far.obj", &format!("{far}{faces}"));
    let text = folder.run(["fix", "far.obj", "--out", "far.stl"]).printed();
    assert!(
        text.contains("edges split") || text.contains("edge split"),
        "{text}"
    );
    assert!(text.contains("note: STL has positions alone"), "{text}");
    assert!(text.ends_with("next: impinge check far.stl\n"), "{text}");
    let written = std::fs::read_to_string(folder.path("far.stl")).unwrap();
    assert!(
        written.starts_with("solid") && written.contains("vertex 0.1 -1 0\n"),
        "{written}"
    );
    folder.text("near.obj", &format!("{far}{faces}").replace("0.1", "0.125"));
    folder
        .run(["fix", "near.obj", "--out", "near.stl"])
        .printed();
    assert_eq!(
        std::fs::read(folder.path("near.stl")).unwrap().len(),
        84 + 8 * 50
    );
    for name in ["far", "near"] {
        let count = |name: &str| {
            let row = folder.run(["check", "--json", name]).json();
            (
                row["triangles"].clone(),
                row["self_intersections"].clone(),
                row["volume"].clone(),
            )
        };
        assert_eq!(count(&format!("{name}.stl")), count(&format!("{name}.obj")));
    }
}

#[test]
fn what_stays_inside_out_and_what_is_not_kept_is_said() {
    let folder = Folder::new();
    let turned = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no t\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n";
    folder.text("inv.obj", turned);
    let args = ["fix", "inv.obj", "--out", "o.obj", "--skip", "outward"];
    let text = folder.run(args).printed();
    assert!(
        text.contains("\nleft: 1 closed surface inside out\n"),
        "{text}"
    );
    assert!(text.contains("\nnot kept: 1 name of a part\n"), "{text}");
    let text = folder.run(["fix", "inv.obj", "--out", "p.obj"]).printed();
    assert!(text.contains("\nleft: nothing\n"), "{text}");

    let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    folder.text("quad.obj", quad);
    let text = folder.run(["fix", "quad.obj", "--out", "q.obj"]).printed();
    assert!(
        text.contains("\nnot kept: 1 polygon, now triangles\n"),
        "{text}"
    );
}

#[test]
fn nothing_is_written_where_no_face_is_left() {
    let folder = Folder::new();
    folder.text("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    folder.text("out.ply", "as it was");
    for more in [&["--json"][..], &[]] {
        let args = ["fix", "flat.obj", "--out", "out.ply", "--force"];
        let run = folder.run(args.iter().chain(more).copied());
        assert_eq!(
            run.error(),
            "flat.obj: no face is left, so nothing is written: 1 face of zero area"
        );
    }
    assert_eq!(
        std::fs::read_to_string(folder.path("out.ply")).unwrap(),
        "as it was"
    );
}

#[test]
fn a_mended_ply_has_positions_and_triangles_alone() {
    let folder = Folder::new();
    folder.text("good.obj", CLOSED);
    folder
        .run(["fix", "good.obj", "--out", "good.ply"])
        .printed();
    let bytes = std::fs::read(folder.path("good.ply")).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    let header = text.split("end_header").next().unwrap();
    assert_eq!(
        header,
        "ply\nformat binary_little_endian 1.0\ncomment written by impinge\nelement vertex 4\nproperty double x\n\
         property double y\nproperty double z\nelement face 4\nproperty list uchar int vertex_indices\n"
    );
}

#[test]
fn an_output_that_can_be_no_file_is_refused_before_the_work() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("folder.obj")).unwrap();
    for (out, said) in [
        ("no/x.obj", "no/x.obj: cannot write: there is no folder no"),
        (
            "new.obj/",
            "new.obj/: cannot write: this is the name of a folder, not of a file",
        ),
        (
            "folder.obj",
            "folder.obj: cannot write: this is the name of a folder, not of a file",
        ),
    ] {
        // The mesh is not even looked for.
        let args = ["fix", "missing.obj", "--out", out, "--force"];
        assert_eq!(folder.run(args).error(), said);
        let args = ["fix", "missing.obj", "--out", "x.obj", "--rows", out];
        let args = args.into_iter().chain(["--rows-format", "csv"]);
        assert_eq!(folder.run(args).error(), said);
    }
}
