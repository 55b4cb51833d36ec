//! Answers name the vertices of files, whatever was welded or left out.

use impinge::{Elements, PairKind, hash_impact_rows};
use impinge_scenes::surfaces::{ball, cube};
use serde_json::json;

use crate::harness::Folder;

/// A ball twice: `clean.obj` with its vertices in the order of first use, and `soup.obj`, in which an
/// unused vertex comes first and each triangle has corners of its own. Returns the first vertex of
/// the soup for each vertex of the clean file.
fn soup(folder: &Folder) -> Vec<u32> {
    let model = ball(80);
    let Elements::Triangles(faces) = &model.elements else {
        panic!("a surface");
    };
    let mut numbers = vec![None; model.positions.len()];
    let (mut clean, mut firsts) = (String::new(), Vec::new());
    let mut soup = "v 9 9 9\n".to_owned();
    let (mut clean_faces, mut soup_faces) = (String::new(), String::new());
    for (ix, &corner) in (1u32..).zip(faces.as_flattened()) {
        let [x, y, z] = model.positions[corner as usize];
        let line = format!("v {x} {y} {z}\n");
        soup += &line;
        let number = *numbers[corner as usize].get_or_insert_with(|| {
            firsts.push(ix);
            clean += &line;
            firsts.len()
        });
        let start = if ix % 3 == 1 { "\nf" } else { "" };
        clean_faces += &format!("{start} {number}");
        soup_faces += &format!("{start} {}", ix + 1);
    }
    folder.text("clean.obj", &(clean + &clean_faces + "\n"));
    folder.text("soup.obj", &(soup + &soup_faces + "\n"));
    folder.ply("cube.ply", &cube([1.75, 0.125, 0.0], 1.0));
    firsts
}

/// Rows `kind, body_a, a, body_b, b` and the rest of each line. The vertices of body 0 become
/// those that `named` has for them.
fn rows(text: &str, named: impl Fn(u32) -> u32) -> Vec<String> {
    let rows = text.lines().skip(1).map(|line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        for (ix, kind) in cells[0].clone().chars().enumerate() {
            let [body, element] = [1 + 2 * ix, 2 + 2 * ix];
            if kind == 'v' && cells[body] == "0" {
                cells[element] = named(cells[element].parse().unwrap()).to_string();
            }
        }
        cells.join(",")
    });
    rows.collect()
}

/// A line of an OBJ file, its vertex 1.5 farther along x.
fn moved(line: &str) -> String {
    let vertex = line.strip_prefix("v ").and_then(|at| at.split_once(' '));
    match vertex {
        Some((x, rest)) => format!("v {} {rest}\n", x.parse::<f64>().unwrap() + 1.5),
        None => format!("{line}\n"),
    }
}

#[test]
fn rows_name_the_vertices_of_the_file() {
    let folder = Folder::new();
    let firsts = soup(&folder);
    let named = |vertex: u32| firsts[vertex as usize];
    let kinds = "vf,ee,ev,vv,ef,ff";
    for asked in [
        &["near", "MESH", "cube.ply", "--distance", "0.5", "--self"][..],
        &["near", "MESH", "--distance", "1", "--kinds", kinds],
        &[
            "near",
            "MESH",
            "cube.ply",
            "--distance",
            "1",
            "--kinds",
            kinds,
        ],
        &["step", "MESH", "moved.obj", "cube.ply", "cube.ply"],
        &[
            "step",
            "MESH",
            "moved.obj",
            "cube.ply",
            "cube.ply",
            "--start",
            "report",
        ],
    ] {
        let found = |mesh: &str| {
            let text = std::fs::read_to_string(folder.path(mesh)).unwrap();
            folder.text("moved.obj", &text.lines().map(moved).collect::<String>());
            let args = asked
                .iter()
                .map(|&arg| if arg == "MESH" { mesh } else { arg });
            let run = folder.run(args.chain(["--rows", "-"]));
            assert!(run.stdout.lines().count() > 10, "{asked:?}: {}", run.stderr);
            run.stdout
        };
        let expected = rows(&found("clean.obj"), named);
        assert_eq!(rows(&found("soup.obj"), |v| v), expected, "{asked:?}");
    }
}

#[test]
fn bounds_are_of_all_vertices_of_the_file() {
    let folder = Folder::new();
    let firsts = soup(&folder);
    let found = |mesh: &str| -> Vec<(u32, String)> {
        let args = ["safe", mesh, "cube.ply", "--most", "0.5", "--rows", "-"];
        let text = folder.run(args).printed();
        let own = text.lines().filter_map(|line| line.strip_prefix("0,"));
        own.map(|row| row.split_once(',').unwrap())
            .map(|(vertex, bound)| (vertex.parse().unwrap(), bound.to_owned()))
            .collect()
    };
    let (clean, soup) = (found("clean.obj"), found("soup.obj"));
    // The first vertex is of no face, and may move as far as was asked.
    let file = std::fs::read_to_string(folder.path("soup.obj")).unwrap();
    let n_vertices = file.lines().filter(|line| line.starts_with("v ")).count();
    assert_eq!((soup.len(), &*soup[0].1), (n_vertices, "0.5"));
    assert!(soup.iter().map(|row| row.0).eq(0..soup.len() as u32));
    for ((_, bound), &first) in clean.iter().zip(&firsts) {
        assert_eq!(&soup[first as usize].1, bound);
    }
    let mut bounds = [&clean[..], &soup[1..]].map(|rows| {
        let bounds = rows.iter().map(|row| row.1.clone());
        bounds.collect::<Vec<_>>()
    });
    for all in &mut bounds {
        all.sort();
        all.dedup();
    }
    assert_eq!(bounds[0], bounds[1]);
    // The summary counts and names them alike.
    let answer = folder
        .run(["safe", "soup.obj", "cube.ply", "--most", "0.5", "--json"])
        .json();
    assert_eq!(answer["vertices"], json!(soup.len() + 8));
    let args = [
        "safe", "soup.obj", "cube.ply", "--most", "0.5", "--rows", "-",
    ];
    let text = folder.run(args).printed();
    let rows = text
        .lines()
        .skip(1)
        .map(|row| row.rsplit_once(',').unwrap());
    let bound = |row: &(&str, &str)| row.1.parse::<f64>().unwrap();
    let least = rows.min_by(|a, b| bound(a).total_cmp(&bound(b))).unwrap();
    let (body, vertex) = (&answer["smallest"]["body"], &answer["smallest"]["vertex"]);
    assert_eq!(format!("{body},{vertex}"), least.0);
}

/// A vertex that is there twice comes before the one that touches.
fn twice() -> Folder {
    let folder = Folder::new();
    let start = "v -3 -3 9\nv -3 -3 9\nv 1 0 2\nv 0 1 5\nf 1 3 4\nf 2 4 3\n";
    folder.text("w0.obj", start);
    folder.text("w1.obj", &start.replace("1 0 2", "1 0 -2"));
    folder.text("ground.obj", "v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n");
    folder
}

#[test]
fn what_touches_first_is_named_as_in_the_file() {
    let folder = twice();
    let step = [
        "step",
        "w0.obj",
        "w1.obj",
        "ground.obj",
        "ground.obj",
        "--no-self",
    ];
    let first = "not free: vertex 2 of w0.obj and face 0 of ground.obj touch first, at time 0.5\n";
    for more in [&[][..], &["--no-weld"], &["--earliest"]] {
        let text = folder.run(step.iter().chain(more)).printed();
        assert!(text.starts_with(first), "{more:?}: {text}");
    }
    let reached = ["--advance", "a.obj", "b.obj"];
    let text = folder.run(step.iter().chain(&reached)).printed();
    assert!(text.starts_with(first), "{text}");
    let answer = folder.run(step.iter().chain(&["--json"])).json();
    let earliest = &answer["earliest"];
    assert_eq!(earliest["element_a"], 2, "{earliest}");
    // The hash is that of the rows.
    let rows = folder.run(step.iter().chain(&["--rows", "-", "--kinds", "vf"]));
    assert_eq!(rows.stdout.lines().nth(1), Some("vf,0,2,1,0,0.5"));
    let hash = hash_impact_rows([(PairKind::VertexFace, [0, 2, 1, 0], 0.5)]);
    let answer = folder
        .run(step.iter().chain(&["--json", "--kinds", "vf"]))
        .json();
    assert_eq!(answer["hash"], format!("{hash:016x}"));
    // So are the candidates, and the steps of a sequence.
    let candidates = step.iter().chain(&["--candidates", "-", "--kinds", "vf"]);
    let text = folder.run(candidates).printed();
    assert!(text.contains("\nvf,0,2,1,0\n"), "{text}");
    let sequence = [
        "sequence",
        "w0.obj",
        "w%d.obj",
        "--self",
        "--other",
        "ground.obj",
        "--ccd",
        "--kinds",
        "vf",
    ];
    let text = folder.run(sequence.iter().chain(&["--rows", "-"])).stdout;
    assert!(text.contains("\n0,vf,0,2,1,0,0.5\n"), "{text}");
}

#[test]
fn contacts_name_the_vertices_of_the_file() {
    let folder = twice();
    folder.text(
        "cut.obj",
        "v 7 7 7\nv 7 7 7\nv 0 0 -1\nv 0 0 1\nv 1 0 1\nv 8 8 8\nf 3 4 5\nf 1 2 6\n",
    );
    let pairs = ["pairs", "cut.obj", "ground.obj", "--contacts", "c.csv"];
    folder.run(pairs).printed();
    let text = std::fs::read_to_string(folder.path("c.csv")).unwrap();
    let mut features: Vec<&str> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(8).unwrap())
        .collect();
    features.sort_unstable();
    assert_eq!(features, ["e2-3", "e2-4"], "{text}");
}

/// The body and the vertex of each row of `safe`.
fn bounded(folder: &Folder, mesh: &str, bodies: &str) -> Vec<String> {
    let args = [
        "safe", mesh, "--bodies", bodies, "--most", "1", "--rows", "-",
    ];
    let text = folder.run(args).printed();
    let rows = text.lines().skip(1);
    rows.map(|row| row.rsplit_once(',').unwrap().0.to_owned())
        .collect()
}

#[test]
fn parts_of_a_file_have_its_vertices() {
    let folder = Folder::new();
    let groups = "v 5 5 5\nv 0 0 0\nv 0 0 0\nv 9 0 0\nv 0 9 0\nv 1 1 1\nv 2 1 4\nv 1 2 4\ng low\nf 2 4 5\nf 3 5 4\ng high\nf 6 7 8\n";
    folder.text("g.obj", groups);
    let near = [
        "near",
        "g.obj",
        "--bodies",
        "groups",
        "--distance",
        "1",
        "--kinds",
        "vf",
        "--rows",
        "-",
    ];
    let text = folder.run(near).printed();
    let all: Vec<&str> = text.lines().skip(1).collect();
    assert!(all.iter().all(|row| row.starts_with("vf,1,5,0,")), "{text}");
    assert_eq!(all.len(), 2);
    let all = bounded(&folder, "g.obj", "groups");
    assert_eq!(all, ["0,1", "0,2", "0,3", "0,4", "1,5", "1,6", "1,7"]);
}

#[test]
fn nodes_count_vertices_in_their_accessors() {
    let folder = Folder::new();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doors/nodes.gltf");
    std::fs::copy(file, folder.path("nodes.gltf")).unwrap();
    let all = bounded(&folder, "nodes.gltf", "nodes");
    let expected: Vec<String> = (0..3)
        .flat_map(|node| (0..24).map(move |vertex| format!("{node},{vertex}")))
        .collect();
    assert_eq!(all, expected);
}

#[test]
fn a_vertex_of_several_fans_has_the_number_of_the_file() {
    let folder = Folder::new();
    folder.text(
        "tie.obj",
        "v 9 9 9\nv 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv -1 0 0\nv 0 -1 0\nv 0 0 0\nf 3 4 5\nf 8 6 7\n",
    );
    let row = folder.run(["check", "tie.obj", "--json"]).json();
    let places = row["places"].as_array().unwrap();
    let mut vertices = places.iter().filter(|place| !place["vertex"].is_null());
    assert_eq!(vertices.next().unwrap()["vertex"], 2, "{row}");
}
