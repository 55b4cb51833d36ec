//! `impinge step --advance`.

use crate::harness::Folder;
use crate::schema::{schema, wrong};

/// The bodies are written as far as the step is free, with the vertices of their files: the next
/// step begins with these files.
#[test]
fn a_step_is_taken_as_far_as_it_is_free() {
    let folder = Folder::new();
    // Two triangles that share an edge, whose vertices are there twice; coordinates that no f32
    // has.
    let sheet = |z: &str| {
        let corners = [
            "0.1 0.1", "1.1 0.1", "0.1 1.1", "1.1 0.1", "1.1 1.1", "0.1 1.1",
        ];
        let vertices = corners.map(|corner| format!("v {corner} {z}\n"));
        vertices.concat() + "f 1 2 3\nf 4 5 6\n"
    };
    folder.text("floor.obj", &sheet("0"));
    folder.text("start.obj", &sheet("1.3"));
    folder.text("end.obj", &sheet("-0.7"));
    let step = ["step", "floor.obj", "floor.obj", "start.obj", "end.obj"];
    for (more, least, most) in [
        (&[][..], 0.6499, 0.65),
        (&["--clearance", "0.01"], 0.644, 0.6451),
    ] {
        let options = [more, &["--advance", "floor.ply", "reached.obj"]].concat();
        let text = folder.run(step.iter().chain(&options)).printed();
        assert!(text.starts_with("not free: "), "{text}");
        let answer = folder
            .run(step.iter().chain(&options).chain(&["--json"]))
            .json();
        assert_eq!(wrong(&schema("step"), &answer, "$"), [""; 0]);
        let fraction = answer["fraction"].as_f64().unwrap();
        assert!(least < fraction && fraction <= most, "{fraction}");
        assert!(
            text.contains(&format!("\n{fraction:?} of the step can be taken\n")),
            "{text}"
        );
        let read = |name: &str| {
            let options = impinge_io::ReadOptions::as_they_are();
            impinge_io::read(&folder.path(name), &options).unwrap()
        };
        let (start, reached) = (read("start.obj"), read("reached.obj"));
        assert_eq!(
            (start.n_vertices(), &start.elements),
            (6, &reached.elements)
        );
        assert_eq!(read("floor.ply"), read("floor.obj"));
        let way = ["step", "floor.obj", "floor.ply", "start.obj", "reached.obj"];
        let free = folder.run(way).printed();
        assert!(free.starts_with("free: "), "{free}");
        let next = ["step", "floor.ply", "floor.ply", "reached.obj", "end.obj"];
        assert_eq!(folder.run(next).code, Some(0));
    }
    let free = [
        "step",
        "floor.obj",
        "floor.obj",
        "start.obj",
        "start.obj",
        "--advance",
        "a.ply",
        "b.ply",
    ];
    let text = folder.run(free).printed();
    assert!(text.contains("\n1.0 of the step can be taken\n"), "{text}");
    for (more, said) in [
        (&["--advance", "a.ply"][..], "1 are named for 2 bodies"),
        (
            &["--advance", "a.ply", "start.obj"],
            "is the input start.obj",
        ),
        (&["--advance", "a.ply", "b.glb"], ".ply or .obj"),
        (
            &["--advance", "a.ply", "b.ply", "--earliest"],
            "cannot be used with",
        ),
    ] {
        let misuse = folder.run(step.iter().chain(more)).misuse();
        assert!(misuse.contains(said), "{misuse}");
    }
}

#[test]
fn a_mesh_with_seams_is_named_by_its_file() {
    let folder = Folder::new();
    let corners = "v 0 0 Z\nv 1 0 Z\nv 0 1 Z\nv 0 1 Z\nv 1 0 Z\nv 1 1 Z\nf 1 2 3\nf 4 5 6\n";
    folder.text("start.obj", &corners.replace('Z', "0"));
    folder.text("end.obj", &corners.replace('Z', "1"));
    let step = ["step", "start.obj", "end.obj", "--advance", "out.obj"];
    folder.run(step).printed();
    let apart = [&step[..], &["--no-weld"]].concat();
    let run = folder.run(&apart);
    assert_eq!(run.code, Some(1));
    let line = "\nimpinge: start.obj: vertices 1 and 4 are at one position but not shared";
    let said = run.stderr;
    assert!(
        said.contains(line) && said.contains("leave out --no-weld"),
        "{said}"
    );
    let run = folder.run(apart.iter().chain(&["--start", "skip"]));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
}
