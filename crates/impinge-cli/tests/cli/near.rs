//! `impinge near`.

use impinge::{Backend, Detector, NearPair, PairKind, Query, Scene};
use impinge_scenes::Model;
use impinge_scenes::surfaces::{ball, cube};
use impinge_testing::npy;

use crate::harness::{Folder, rod_and_plate};
use crate::schema::{schema, wrong};

const DISTANCE: f64 = 1.25;

fn models() -> [Model; 2] {
    [ball(80), cube([2.0, 0.125, 0.0], 1.0)]
}

fn folder() -> Folder {
    let folder = Folder::new();
    let [a, b] = models();
    folder.ply("a.ply", &a);
    folder.ply("b.ply", &b);
    folder
}

/// All pairs, by the library.
fn expected(query: Query, kinds: &[PairKind]) -> (Vec<NearPair>, u64) {
    let mut scene = Scene::new();
    for model in models() {
        model.add_to(&mut scene).unwrap();
    }
    let mut query = query.closest_points();
    if !kinds.is_empty() {
        query = query.kinds(kinds.iter().copied());
    }
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let near = detector.near(&scene, DISTANCE, &query).unwrap();
    (near.iter().collect(), near.hash())
}

#[test]
fn the_json_holds_what_the_library_says() {
    let folder = folder();
    let schema = schema("near");
    let near = ["near", "a.ply", "b.ply", "--distance", "1.25", "--json"];
    for (more, query, kinds) in [
        (&[][..], Query::between_all(), &[][..]),
        (&["--self"], Query::all(), &[]),
        (&["--method", "naive"], Query::between_all(), &[]),
        (
            &["--kinds", "vv,ef,ff"],
            Query::between_all(),
            &[
                PairKind::VertexVertex,
                PairKind::EdgeFace,
                PairKind::FaceFace,
            ],
        ),
    ] {
        let answer = folder.run(near.iter().chain(more)).json();
        assert_eq!(wrong(&schema, &answer, "$"), [""; 0], "{more:?}");
        let (pairs, hash) = expected(query, kinds);
        assert!(pairs.len() > 10);
        assert_eq!(answer["pairs"], pairs.len());
        assert_eq!(answer["intersects"], false);
        assert_eq!(answer["hash"], format!("{hash:016x}"));
        for kind in PairKind::ALL {
            let n = pairs.iter().filter(|pair| pair.kind == kind).count();
            assert_eq!(answer["kinds"][kind.name()], n);
        }
    }
}

#[test]
fn rows_read_back_to_the_same_bits() {
    let folder = folder();
    let (pairs, _) = expected(Query::between_all(), &[]);
    let near = ["near", "a.ply", "b.ply", "--distance", "1.25", "--rows"];
    let run = folder.run(near.iter().chain(&["-"]));
    assert!(
        run.stderr.contains("pairs of elements within 1.25"),
        "{}",
        run.stderr
    );
    let text = run.printed();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some(
            "kind,body_a,element_a,body_b,element_b,type,feature_a,feature_b,parallel,distance,ax,ay,az,bx,by,bz"
        )
    );
    let mut n = 0;
    for (line, pair) in lines.zip(&pairs) {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields[0], pair.kind.name());
        let row: [u32; 4] = std::array::from_fn(|k| fields[1 + k].parse().unwrap());
        assert_eq!((row, fields[5]), (pair.row(), pair.name()));
        let numbers: Vec<f64> = fields[9..].iter().map(|x| x.parse().unwrap()).collect();
        let closest = pair.closest.unwrap();
        assert_eq!(numbers[0], closest.distance);
        assert_eq!(numbers[1..], *closest.points.as_flattened());
        n += 1;
    }
    assert_eq!(n, pairs.len());

    folder.run(near.iter().chain(&["near.jsonl"])).printed();
    let text = std::fs::read_to_string(folder.path("near.jsonl")).unwrap();
    assert_eq!(text.lines().count(), pairs.len());
    for (line, pair) in text.lines().zip(&pairs) {
        let object: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(object["type"], pair.name());
        assert_eq!(object["element_b"], pair.b.element);
        assert_eq!(object["distance"], pair.closest.unwrap().distance);
    }

    folder.run(near.iter().chain(&["near.npy"])).printed();
    let bytes = std::fs::read(folder.path("near.npy")).unwrap();
    let (header, data) = npy::split(&bytes);
    let shape = format!("'shape': ({},)", pairs.len());
    assert!(header.contains(&shape), "{header}");
    // BodyKind, four numbers, type, two features, a byte, distance and points.
    let size = 8 + 16 + 28 + 16 + 1 + 8 + 48;
    let rows: Vec<&[u8]> = data.chunks_exact(size).collect();
    assert_eq!(rows.len() * size, data.len());
    assert_eq!(rows.len(), pairs.len());
    for (row, pair) in rows.iter().zip(&pairs) {
        let distance = f64::from_le_bytes(row[69..77].try_into().unwrap());
        assert_eq!(distance, pair.closest.unwrap().distance);
        assert_eq!(row[68], u8::from(pair.is_parallel));
    }
}

#[test]
fn a_check_of_clearance_fails_on_a_hit() {
    let folder = folder();
    let check = |distance: &str| {
        let args = ["near", "a.ply", "b.ply", "--fail-on-hit", "--distance"];
        folder.run(args.iter().chain(&[distance]))
    };
    let hit = check("1.25");
    assert_eq!(hit.code, Some(3));
    assert!(
        hit.stdout.starts_with("a.ply and b.ply: "),
        "{}",
        hit.stdout
    );
    let clear = check("0.001").printed();
    assert!(
        clear.contains("no pairs of elements within 0.001"),
        "{clear}"
    );
    // One mesh alone is compared with itself, without neighbours.
    let alone = folder
        .run(["near", "a.ply", "--distance", "0.001"])
        .printed();
    assert!(alone.starts_with("a.ply: no pairs"), "{alone}");
    let alone = folder.run(["near", "a.ply", "--distance", "1"]).printed();
    assert!(alone.contains(" vf, "), "{alone}");
}

#[test]
fn misuse_is_named() {
    let folder = folder();
    for (args, said) in [
        (&["near", "a.ply", "b.ply"][..], "--distance"),
        (
            &["near", "a.ply", "b.ply", "--distance", "-1"],
            "not below 0",
        ),
        (
            &["near", "a.ply", "b.ply", "--distance", "nan"],
            "not below 0",
        ),
        (
            &[
                "near",
                "a.ply",
                "b.ply",
                "--distance",
                "1",
                "--json",
                "--rows",
                "-",
            ],
            "give one of them a file",
        ),
        (
            &[
                "near",
                "a.ply",
                "b.ply",
                "--distance",
                "1",
                "--exclude",
                "0,7",
            ],
            "names body 7, but 2 bodies",
        ),
        (
            &["near", "a.ply", "b.ply", "--distance", "1", "--kinds", "xy"],
            "xy",
        ),
    ] {
        let misuse = folder.run(args).misuse();
        assert!(misuse.contains(said), "{misuse}");
    }
    let error = folder
        .run([
            "near",
            "a.ply",
            "b.ply",
            "--distance",
            "1",
            "--rows",
            "a.ply.csv/x.csv",
        ])
        .error();
    assert!(error.contains("a.ply.csv/x.csv"), "{error}");
}

/// A check of clearance sees what passes through, and faces that share all their vertices.
#[test]
fn what_intersects_is_never_clear() {
    let folder = rod_and_plate();
    let schema = schema("near");
    let near = ["near", "plate.obj", "rod.obj", "--distance", "2"];
    let run = folder.run(near.iter().chain(&["--fail-on-hit"]));
    assert_eq!(run.code, Some(3), "{}", run.stdout);
    let first = "plate.obj and rod.obj: 8 pairs of elements within 2 (8 ef), hash ";
    assert!(run.stdout.starts_with(first), "{}", run.stdout);
    assert!(run.stdout.contains("\nthey intersect"), "{}", run.stdout);
    let answer = folder.run(near.iter().chain(&["--json"])).json();
    assert_eq!(wrong(&schema, &answer, "$"), [""; 0]);
    assert_eq!(
        (&answer["kinds"]["ef"], &answer["intersects"]),
        (&8.into(), &true.into())
    );
    let rows = folder.run(near.iter().chain(&["--rows", "-"])).printed();
    for row in rows.lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        assert_eq!(
            [fields[0], fields[5], fields[9]],
            ["ef", "E_T", "0.0"],
            "{row}"
        );
    }
    // Even if only other kinds are listed.
    let run = folder.run(near.iter().chain(&["--kinds", "vf,ee", "--fail-on-hit"]));
    assert_eq!(run.code, Some(3), "{}", run.stdout);
    assert!(
        run.stdout
            .contains("no pairs of elements within 2\nthey intersect"),
        "{}",
        run.stdout
    );

    // A face through its neighbour, and two equal faces.
    let corners = "v 0 0 0\nv 4 0 0\nv 0 4 0\n";
    folder.text(
        "fold.obj",
        &format!("{corners}v 1 1 -1\nv 1 1 1\nf 1 2 3\nf 1 4 5\n"),
    );
    folder.text("equal.obj", &format!("{corners}f 1 2 3\nf 2 1 3\n"));
    for (file, said) in [
        ("fold.obj", "1 pair of elements"),
        ("equal.obj", "no pairs of elements"),
    ] {
        let run = folder.run(["near", file, "--distance", "0.01", "--fail-on-hit"]);
        assert_eq!(run.code, Some(3), "{}", run.stdout);
        assert!(
            run.stdout.starts_with(&format!("{file}: {said}")),
            "{}",
            run.stdout
        );
        assert!(run.stdout.contains("\nthey intersect"), "{}", run.stdout);
    }
    folder.text(
        "open.obj",
        "v 0 0 0\nv 1 0 0\nv .5 1 0\nv .5 -.75 0\nf 1 2 3\nf 2 1 4\n",
    );
    let run = folder.run(["near", "open.obj", "--distance", "0.01", "--fail-on-hit"]);
    assert_eq!(run.code, Some(0), "{}", run.stdout);
    assert!(run.stdout.contains("nothing intersects"), "{}", run.stdout);
}

#[test]
fn what_is_near_is_coloured_by_how_near_it_is() {
    let folder = Folder::new();
    folder.ply("a.ply", &cube([0.0; 3], 1.0));
    folder.ply("b.ply", &cube([1.5, 0.0, 0.0], 1.0));
    let near = ["near", "a.ply", "b.ply", "--out", "near.vtu", "--distance"];
    // Red where they touch, yellow at the distance, half way at half of it; and grey, if nothing
    // is near.
    let colors = |distance: &str| {
        folder.run(near.iter().chain(&[distance])).printed();
        std::fs::read(folder.path("near.vtu")).unwrap()
    };
    let half = colors("1");
    let edge = colors("0.5");
    let none = colors("0.25");
    let has = |bytes: &[u8], color: [u8; 3]| bytes.windows(3).any(|at| at == color);
    assert!(has(&half, [235, 130, 64]), "half way");
    assert!(has(&edge, [255, 221, 87]) && !has(&edge, [235, 130, 64]));
    assert!(!has(&none, [255, 221, 87]));
    // With rows, and as a picture.
    let more = ["0.5", "--rows", "near.csv", "--png", "near.png"];
    folder.run(near.iter().chain(&more)).printed();
    let png = std::fs::read(folder.path("near.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
    // No input is lost.
    let said = folder
        .run([
            "near",
            "a.ply",
            "b.ply",
            "--distance",
            "1",
            "--out",
            "a.ply",
        ])
        .misuse();
    assert!(said.contains("--out a.ply is the input"), "{said}");
}
