//! `impinge safe` and `impinge step --truncate`.

use impinge::{Backend, Detector, Query, Scene};
use impinge_scenes::surfaces::ball;

use crate::harness::Folder;
use crate::schema::{schema, wrong};

/// Two balls that are 0.25 apart.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(320));
    folder.ply("b.ply", &ball(500).translated([1.25, 0.0, 0.0]));
    folder
}

/// The bounds by the library: the number of the body, the vertex and the bound.
fn expected(folder: &Folder, most: f64, is_fixed: bool) -> Vec<(u32, u32, f64)> {
    let mut scene = Scene::new();
    let ids = ["a.ply", "b.ply"].map(|name| {
        let options = impinge_io::ReadOptions::as_they_are();
        let mesh = impinge_io::read(&folder.path(name), &options).unwrap();
        let impinge_io::Elements::Triangles(faces) = mesh.elements else {
            panic!("a surface");
        };
        match mesh.positions {
            impinge_io::Positions::F32(at) => scene.add((faces, at)).unwrap(),
            impinge_io::Positions::F64(at) => scene.add((faces, at)).unwrap(),
        }
    });
    let fixed = is_fixed.then_some(ids[1]);
    let query = Query::between_all().fixed(fixed);
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let safe = detector.safe_distances(&scene, most, &query).unwrap();
    let all = (0u32..).zip(ids).flat_map(|(number, id)| {
        let bounds = safe.of(id).unwrap();
        (0..bounds.len()).map(move |vertex| (number, vertex as u32, bounds.get(vertex)))
    });
    all.collect()
}

#[test]
fn the_bounds_are_those_of_the_library() {
    let folder = folder();
    for (most, is_fixed) in [(0.5, false), (0.5, true), (0.05, false)] {
        let expected = expected(&folder, most, is_fixed);
        let most_text = most.to_string();
        let mut args = vec!["safe", "a.ply", "b.ply", "--no-self", "--most", &most_text];
        if is_fixed {
            args.extend(["--fixed", "1"]);
        }
        let rows = folder.run(args.iter().chain(&["--rows", "-"]));
        assert_eq!(rows.code, Some(0), "{}", rows.stderr);
        let mut lines = rows.stdout.lines();
        assert_eq!(lines.next(), Some("body,vertex,safe"));
        let read: Vec<(u32, u32, f64)> = lines
            .map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                let number = |ix: usize| cells[ix].parse().unwrap();
                (number(0), number(1), cells[2].parse().unwrap())
            })
            .collect();
        assert_eq!(read, expected);
        let answer = folder.run(args.iter().chain(&["--json"])).json();
        assert_eq!(wrong(&schema("safe"), &answer, "$"), [""; 0]);
        let moving: Vec<_> = expected
            .iter()
            .filter(|(body, ..)| !(is_fixed && *body == 1))
            .collect();
        let least = moving.iter().map(|row| row.2).fold(f64::INFINITY, f64::min);
        // Bounds of single precision are rounded down from 0.05.
        let n_bounded = moving.iter().filter(|row| row.2 < most - 1e-8).count();
        assert_eq!(answer["vertices"], moving.len());
        assert_eq!(answer["bounded"], n_bounded);
        assert_eq!(answer["smallest"]["safe"], least);
        let (low, high) = match (most, is_fixed) {
            (0.5, false) => (0.12, 0.13),
            (0.5, true) => (0.24, 0.26),
            _ => (0.05 - 1e-8, 0.05),
        };
        assert!((low..=high).contains(&least), "{least}");
        let text = folder.run(&args).printed();
        assert_eq!(text.contains("all "), n_bounded == 0, "{text}");
        assert!(text.contains("\nnothing touches\n"), "{text}");
    }
}

#[test]
fn neighbours_in_the_surface_are_left_out() {
    let folder = folder();
    // Edges of the ball are shorter than 0.3, and its other side is far.
    let ask = |command: &str, more: &[&str]| {
        let args = [command, "a.ply", "--json"]
            .into_iter()
            .chain(more.iter().copied());
        folder.run(args).json()
    };
    let bounded = |more: &[&str]| {
        let answer = ask("safe", &[&["--most", "0.15"], more].concat());
        answer["bounded"].as_u64().unwrap()
    };
    assert!(bounded(&[]) > 100);
    assert_eq!(bounded(&["--exclude-rings", "3"]), 0);
    let near = |rings: &str| {
        let answer = ask(
            "near",
            &["--distance", "0.3", "--self", "--exclude-rings", rings],
        );
        answer["pairs"].as_u64().unwrap()
    };
    let [all, some, none] = ["0", "1", "3"].map(near);
    assert!(
        all > some && some > none && none == 0,
        "{all} {some} {none}"
    );
    let text = folder.run(["safe", "a.ply", "--most", "0.15", "--exclude-rings", "1"]);
    let said = "not asked: what is at most 1 edge away in the surface";
    assert!(text.printed().contains(said));
    folder
        .run(["safe", "a.ply", "--most", "0.15", "--exclude-rings", "17"])
        .misuse();
}

#[test]
fn what_touches_or_intersects_is_told_and_colours_show_the_bounds() {
    let folder = folder();
    folder.ply("through.ply", &ball(320).translated([0.5, 0.1, 0.2]));
    let meets = ["safe", "a.ply", "through.ply", "--most", "0.1"];
    let answer = folder.run(meets.iter().chain(&["--json"])).json();
    assert_eq!(answer["intersects"], true);
    assert_eq!(folder.run(meets).code, Some(0));
    assert_eq!(
        folder.run(meets.iter().chain(&["--fail-on-hit"])).code,
        Some(3)
    );
    let files = [
        "safe", "a.ply", "b.ply", "--most", "0.5", "--out", "out.ply", "--png", "out.png",
        "--size", "64x64",
    ];
    folder.run(files).printed();
    let written = std::fs::read(folder.path("out.ply")).unwrap();
    let header = String::from_utf8_lossy(&written[..400]).into_owned();
    assert!(header.contains("red"), "{header}");
    assert!(
        std::fs::read(folder.path("out.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    for (more, said) in [
        (&["--fixed", "7"][..], "--fixed names body 7"),
        (&["--most", "-1"], "not below 0"),
        (&["--out", "a.ply"], "is the input a.ply"),
    ] {
        let misuse = folder.run(
            ["safe", "a.ply", "b.ply", "--most", "1"][..if more[0] == "--most" { 3 } else { 5 }]
                .iter()
                .chain(more),
        );
        let misuse = misuse.misuse();
        assert!(misuse.contains(said), "{misuse}");
    }
}

/// Each vertex stops for itself: the way to what is written is free, and the next step begins
/// there.
#[test]
fn a_step_is_truncated_vertex_by_vertex() {
    let folder = Folder::new();
    let floor = "v 0 0 0\nv 4 0 0\nv 0 4 0\nf 1 2 3\n";
    folder.text("floor.obj", floor);
    // Above the floor, and beside it.
    let sheet = |z: f64| {
        format!(
            "v 1 1 {z}\nv 1.5 1 {z}\nv 1 1.5 {z}\nv 9 9 {z}\nv 8 9 {z}\nv 9 8 {z}\nf 1 2 3\nf 4 5 6\n"
        )
    };
    folder.text("start.obj", &sheet(1.0));
    folder.text("end.obj", &sheet(-3.0));
    let step = ["step", "floor.obj", "floor.obj", "start.obj", "end.obj"];
    let to = ["--truncate", "floor.ply", "reached.obj"];
    let text = folder.run(step.iter().chain(&to)).printed();
    assert!(text.starts_with("not free: "), "{text}");
    assert!(
        text.contains("\n3 of 9 vertices stop before their ends\n"),
        "{text}"
    );
    let answer = folder.run(step.iter().chain(&to).chain(&["--json"])).json();
    assert_eq!(wrong(&schema("step"), &answer, "$"), [""; 0]);
    assert_eq!(
        (&answer["cut"], &answer["touching"], &answer["free"]),
        (&3.into(), &0.into(), &false.into())
    );
    let options = impinge_io::ReadOptions::as_they_are();
    let reached = impinge_io::read(&folder.path("reached.obj"), &options).unwrap();
    let heights: Vec<f64> = match &reached.positions {
        impinge_io::Positions::F32(at) => at.iter().map(|p| f64::from(p[2])).collect(),
        impinge_io::Positions::F64(at) => at.iter().map(|p| p[2]).collect(),
    };
    assert!(
        heights[..3].iter().all(|&z| z > 0.0 && z < 0.01),
        "{heights:?}"
    );
    assert_eq!(heights[3..], [-3.0; 3]);
    let way = ["step", "floor.obj", "floor.ply", "start.obj", "reached.obj"];
    let free = folder.run(way).printed();
    assert!(free.starts_with("free: "), "{free}");
    for (more, said) in [
        (
            &["--truncate", "a.ply"][..],
            "--truncate writes a file per body: 1 are named for 2 bodies",
        ),
        (
            &[
                "--truncate",
                "a.ply",
                "b.ply",
                "--advance",
                "c.ply",
                "d.ply",
            ],
            "cannot be used with",
        ),
        (
            &["--truncate", "a.ply", "start.obj"],
            "is the input start.obj",
        ),
    ] {
        let misuse = folder.run(step.iter().chain(more)).misuse();
        assert!(misuse.contains(said), "{misuse}");
    }
}
