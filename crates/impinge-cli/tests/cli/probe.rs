//! `impinge probe` and `impinge cast`.

use impinge::exact::Feature;
use impinge::{Backend, BodyId, Detector, Hit, Query, Scene};
use impinge_io::npy_header;
use impinge_scenes::Model;
use impinge_scenes::solids::solid_ball;
use impinge_scenes::surfaces::ball;
use serde_json::{Value, json};

use crate::harness::Folder;
use crate::schema::{schema, wrong};

/// A lattice around the ball: points inside and outside.
fn points() -> Vec<[f64; 3]> {
    let steps = || (-3..=3).map(|step| f64::from(step) * 0.4);
    steps()
        .flat_map(|x| steps().flat_map(move |y| steps().map(move |z| [x, y, z])))
        .collect()
}

/// Rays through the lattice: half of them miss.
fn rays() -> Vec<[f64; 6]> {
    let from = points().into_iter();
    from.enumerate()
        .map(|(ix, [x, y, z])| match ix % 2 {
            0 => [x, y, z, 0.1 - x, 0.2 - y, 0.3 - z],
            _ => [x, y, z + 2.0, 0.0, 0.3, 1.0],
        })
        .collect()
}

fn csv<const N: usize>(rows: &[[f64; N]]) -> String {
    let line = |row: &[f64; N]| row.map(|x| format!("{x:?}")).join(",") + "\n";
    rows.iter().map(line).collect()
}

fn scene(model: &Model) -> (Scene, BodyId, Detector) {
    let mut scene = Scene::new();
    let id = model.add_to(&mut scene).unwrap();
    (scene, id, Detector::new(Backend::Cpu).unwrap())
}

fn name(feature: Feature) -> String {
    match feature {
        Feature::Vertex(ix) => format!("v{ix}"),
        Feature::Edge(ix) => format!("e{ix}"),
        Feature::Face => "f".to_owned(),
    }
}

fn numbers(fields: &[&str]) -> Vec<f64> {
    fields.iter().map(|x| x.parse().unwrap()).collect()
}

#[test]
fn points_are_answered_as_by_the_library() {
    let folder = Folder::new();
    let schema = schema("probe");
    let (surface, solid) = (ball(320), solid_ball(100));
    folder.ply("surface.ply", &surface);
    folder.medit("solid.mesh", &solid);
    let mut points = points();
    points.push(surface.positions[5].map(f64::from));
    points.extend(solid.positions.iter().map(|at| at.map(f64::from)));
    folder.text("points.csv", &format!("x,y,z\n{}", csv(&points)));
    for (file, model) in [("surface.ply", &surface), ("solid.mesh", &solid)] {
        let (scene, id, mut detector) = scene(model);
        let places = detector.contains(&scene, id, &points).unwrap();
        let count = |which| places.iter().filter(|&&place| place == which).count();
        assert!(count(1) > 10 && count(0) > 0 && count(-1) > 10);
        for most in [f64::INFINITY, 0.25] {
            let closest = detector.closest(&scene, &points, most, &Query::all());
            let closest = closest.unwrap();
            let found: Vec<_> = (0..points.len())
                .filter_map(|point| Some((point, closest.get(point)?)))
                .collect();
            assert_eq!(found.len() == points.len(), most.is_infinite());
            assert!(found.len() > 10);
            let most = format!("--most={most}");
            let mut args = vec!["probe", file, "--points", "points.csv", "--signed"];
            if most != "--most=inf" {
                args.push(&most);
            }

            let answer = folder
                .run(args.iter().chain(&["--json", "--threads", "2"]))
                .json();
            assert_eq!(wrong(&schema, &answer, "$"), [""; 0]);
            assert_eq!(answer["hash"], format!("{:016x}", closest.hash()));
            assert_eq!(answer["points"], points.len());
            assert_eq!(answer["near"], found.len());
            let counts = json!({ "inside": count(1), "on": count(0), "outside": count(-1) });
            assert_eq!(answer["places"], counts);
            let distances = || found.iter().map(|(_, found)| found.distance);
            let least = distances().fold(f64::INFINITY, f64::min);
            assert_eq!(answer["nearest"]["distance"], least);
            assert_eq!(
                answer["farthest"]["distance"],
                distances().fold(0.0, f64::max)
            );
            assert_eq!(answer["stats"]["n_threads"], 2);

            let text = folder
                .run(args.iter().chain(&["--rows", "-", "--threads", "1"]))
                .printed();
            let mut lines = text.lines();
            let header = lines.next();
            assert_eq!(header, Some("point,element,feature,distance,x,y,z,place"));
            assert_eq!(lines.clone().count(), found.len());
            for (line, (point, found)) in lines.zip(&found) {
                let fields: Vec<&str> = line.split(',').collect();
                let word = ["outside", "on", "inside"][(places[*point] + 1) as usize];
                assert_eq!(fields[0], point.to_string());
                assert_eq!(fields[1], found.element.element.to_string());
                assert_eq!((fields[2], fields[7]), (&name(found.feature)[..], word));
                let sign = if word == "outside" { -1.0 } else { 1.0 };
                assert_eq!(numbers(&fields[3..4]), [sign * found.distance]);
                assert_eq!(numbers(&fields[4..7]), found.point);
            }
        }
    }

    // Without --signed nothing is said of places, and distances have no sign.
    let probe = ["probe", "surface.ply", "--points", "points.csv"];
    let answer = folder.run(probe.iter().chain(&["--json"])).json();
    assert_eq!(answer["places"], Value::Null);
    folder
        .run(probe.iter().chain(&["--rows", "p.jsonl"]))
        .printed();
    let text = std::fs::read_to_string(folder.path("p.jsonl")).unwrap();
    assert_eq!(text.lines().count(), points.len());
    for line in text.lines() {
        let row: Value = serde_json::from_str(line).unwrap();
        assert!(row["distance"].as_f64().unwrap() >= 0.0, "{row}");
        assert!(row.get("place").is_none() && row["nearest"][2].is_number());
    }
    let text = folder.run(probe).printed();
    let last = "points of points.csv and 1 mesh, 0 vertices welded; not asked: inside or outside (--signed)\n";
    assert!(text.ends_with(last), "{text}");
}

#[test]
fn the_nearest_few_and_the_tetrahedra_of_points_are_those_of_the_library() {
    let folder = Folder::new();
    let schema = schema("probe");
    let solid = solid_ball(100);
    folder.medit("solid.mesh", &solid);
    let mut points = points();
    points.extend(solid.positions.iter().map(|at| at.map(f64::from)));
    folder.text("points.csv", &csv(&points));
    let (scene, id, mut detector) = scene(&solid);
    let held = detector.locate(&scene, id, &points).unwrap();
    let n_held = held.iter().flatten().count();
    assert!(n_held > 20 && n_held < points.len() - 20);
    let places = detector.contains(&scene, id, &points).unwrap();
    let probe = ["probe", "solid.mesh", "--points", "points.csv", "--locate"];
    for (n_nearest, most) in [(1, f64::INFINITY), (5, f64::INFINITY), (5, 0.3)] {
        let query = Query::all().n_nearest(n_nearest);
        let closest = detector.closest(&scene, &points, most, &query).unwrap();
        let found: Vec<_> = (0..points.len())
            .flat_map(|point| closest.of(point).map(move |of| (point, of)))
            .collect();
        let n = n_nearest.to_string();
        let mut args = probe.to_vec();
        if n_nearest > 1 {
            args.extend(["--nearest", &n, "--signed"]);
        }
        if most.is_finite() {
            args.extend(["--most", "0.3"]);
            assert!(found.len() < 5 * points.len() && found.len() > 100);
        }
        let answer = folder.run(args.iter().chain(&["--json"])).json();
        assert_eq!(wrong(&schema, &answer, "$"), [""; 0]);
        assert_eq!(answer["hash"], format!("{:016x}", closest.hash()));
        assert_eq!(
            (&answer["found"], &answer["located"]),
            (&json!(found.len()), &json!(n_held))
        );
        let near = (0..points.len()).filter_map(|point| closest.get(point));
        assert_eq!(answer["near"], near.clone().count());
        let farthest = near.map(|of| of.distance).fold(0.0, f64::max);
        assert_eq!(answer["farthest"]["distance"], farthest);
        assert_eq!(answer["asked"]["nearest"], n_nearest);

        let text = folder.run(args.iter().chain(&["--rows", "-"])).printed();
        let mut lines = text.lines();
        let place = if n_nearest > 1 { ",place" } else { "" };
        let header = format!("point,element,feature,distance,x,y,z{place},tetrahedron");
        assert_eq!(lines.next(), Some(&header[..]));
        assert_eq!(lines.clone().count(), found.len());
        for (line, (point, of)) in lines.zip(found) {
            let fields: Vec<&str> = line.split(',').collect();
            assert_eq!(fields[0], point.to_string());
            assert_eq!(fields[1], of.element.element.to_string());
            let is_negative = n_nearest > 1 && places[point] < 0;
            let sign = if is_negative { -1.0 } else { 1.0 };
            assert_eq!(numbers(&fields[3..4]), [sign * of.distance]);
            let tetrahedron = held[point].map_or("-1".to_owned(), |of| of.to_string());
            assert_eq!(*fields.last().unwrap(), tetrahedron);
        }
    }
    let text = folder.run(probe).printed();
    let said = format!(
        "\n{n_held} in a tetrahedron, {} in none\n",
        points.len() - n_held
    );
    assert!(text.contains(&said), "{text}");

    folder.ply("surface.ply", &ball(320));
    let args = ["probe", "surface.ply", "--points", "points.csv"];
    let error = folder.run(args.iter().chain(&["--locate"])).error();
    let said = "surface.ply: body 0 is made of triangles, where tetrahedra are needed";
    assert!(error.starts_with(said), "{error}");
    for wrong in ["0", "-1", "1.5"] {
        let misuse = folder
            .run(args.iter().chain(&["--nearest", wrong]))
            .misuse();
        assert!(misuse.contains("a whole number of at least 1"), "{misuse}");
    }
    let misuse = folder
        .run(args.iter().chain(&["--nearest", "4294967296"]))
        .misuse();
    assert!(misuse.contains("and at most 4294967295"), "{misuse}");
    // More elements than there are: all of them, and no memory for more.
    for more in ["400", "4294967295"] {
        let all = folder.run(args.iter().chain(&["--nearest", more, "--json"]));
        assert_eq!(all.json()["found"], points.len() * 320);
    }
    let args = ["probe", "solid.mesh", "--points", "points.csv", "--json"];
    let all = |more| folder.run(args.iter().chain(&["--nearest", more])).json();
    assert!(all("400")["found"].as_u64() > Some(points.len() as u64));
    assert_eq!(all("400")["found"], all("4294967295")["found"]);
}

#[test]
fn points_may_be_vertices_of_a_mesh_or_an_array() {
    let folder = Folder::new();
    let model = ball(320);
    folder.ply("a.ply", &model);
    let probe = ["probe", "a.ply", "--signed", "--json", "--points"];
    let of_vertices = folder.run(probe.iter().chain(&["a.ply"])).json();
    let n = model.n_vertices();
    assert_eq!(of_vertices["points"], n);
    assert_eq!(of_vertices["places"]["on"], n);
    assert_eq!(of_vertices["farthest"]["distance"], 0.0);

    let mut bytes = npy_header("'<f4'", &format!("({n}, 3)"));
    bytes.extend(
        model
            .positions
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes()),
    );
    std::fs::write(folder.path("p.npy"), bytes).unwrap();
    // A file of vertices alone.
    let text: String = model
        .positions
        .iter()
        .map(|[x, y, z]| format!("v {} {} {}\n", f64::from(*x), f64::from(*y), f64::from(*z)))
        .collect();
    folder.text("p.obj", &text);
    for file in ["p.npy", "p.obj"] {
        let answer = folder.run(probe.iter().chain(&[file])).json();
        assert_eq!(answer["hash"], of_vertices["hash"]);
        assert_eq!(answer["places"], of_vertices["places"]);
    }

    std::fs::write(folder.path("none.npy"), npy_header("'<f4'", "(0, 3)")).unwrap();
    let none = folder.run(probe.iter().chain(&["none.npy"])).json();
    assert_eq!(
        (&none["points"], &none["nearest"]),
        (&0.into(), &Value::Null)
    );
}

#[test]
fn an_open_surface_is_refused_by_an_edge_of_the_file() {
    let folder = Folder::new();
    // Vertices 0 and 1 are at one position.
    let corners = "v 0 0 0\nv 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\n";
    let open = "f 1 4 3\nf 2 3 5\nf 3 4 5\n";
    folder.text("open.obj", &format!("{corners}{open}"));
    folder.text("closed.obj", &format!("{corners}{open}f 4 1 5\n"));
    folder.text("points.txt", "1 1 1 # inside\n-1 0 0\n");
    let probe = |file: &str, more: &[&str]| {
        let args = ["probe", file, "--points", "points.txt"];
        folder.run(args.iter().chain(more))
    };
    let error = probe("open.obj", &["--signed"]).error();
    let said = "open.obj: body 0: the surface is not closed: the edge of vertices 0 and 3 has ";
    assert!(error.starts_with(said), "{error}");
    let advice = "; weld vertices, close holes or turn faces round first";
    assert!(error.trim_end().ends_with(advice), "{error}");
    // How far it is needs no inside.
    let text = probe("open.obj", &[]).printed();
    assert!(text.starts_with("open.obj: 2 points, hash "), "{text}");

    let text = probe("closed.obj", &["--signed"]).printed();
    assert!(
        text.contains("\n1 inside, 0 on the surface, 1 outside\n"),
        "{text}"
    );
    assert!(text.ends_with(" 1 vertex welded\n"), "{text}");
    let error = probe("closed.obj", &["--signed", "--no-weld", "--json"]).error();
    assert!(error.contains("is not closed"), "{error}");
}

#[test]
fn rays_are_answered_as_by_the_library() {
    let folder = Folder::new();
    let schema = schema("cast");
    let model = ball(320);
    folder.ply("a.ply", &model);
    let rays = rays();
    folder.text("rays.csv", &csv(&rays));
    let mut bytes = npy_header("'<f8'", &format!("({}, 6)", rays.len()));
    bytes.extend(rays.iter().flatten().flat_map(|x| x.to_le_bytes()));
    std::fs::write(folder.path("rays.npy"), bytes).unwrap();
    let origins: Vec<[f64; 3]> = rays.iter().map(|ray| [ray[0], ray[1], ray[2]]).collect();
    let directions: Vec<[f64; 3]> = rays.iter().map(|ray| [ray[3], ray[4], ray[5]]).collect();
    let (scene, _, mut detector) = scene(&model);
    for (word, which) in [("first", Hit::First), ("any", Hit::Any), ("all", Hit::All)] {
        for (most, file) in [(f64::INFINITY, "rays.csv"), (0.5, "rays.npy")] {
            let query = Query::all().hits(which);
            let hits = detector.cast(&scene, &origins, &directions, most, &query);
            let hits = hits.unwrap();
            let n_hit = hits.is_hit().iter().filter(|&&is_hit| is_hit).count();
            assert!(n_hit > 10 && n_hit < rays.len() - 10);
            let mut args = vec!["cast", "a.ply", "--rays", file, "--hits", word];
            if most.is_finite() {
                args.extend(["--most", "0.5"]);
            }
            let answer = folder.run(args.iter().chain(&["--json"])).json();
            assert_eq!(wrong(&schema, &answer, "$"), [""; 0]);
            assert_eq!(answer["hash"], format!("{:016x}", hits.hash()));
            assert_eq!(answer["rays"], rays.len());
            assert_eq!(answer["hit"], n_hit);
            let least = hits.iter().map(|hit| hit.t).reduce(f64::min);
            assert_eq!(answer["nearest"]["t"].as_f64(), least);

            let more = ["--rows", "-", "--threads", "1"];
            let text = folder.run(args.iter().chain(&more)).printed();
            let mut lines = text.lines();
            let header = lines.next();
            if which == Hit::Any {
                assert_eq!(answer["hits"], Value::Null);
                assert_eq!(header, Some("ray,hit"));
                let rows = hits.is_hit().iter().enumerate();
                let rows = rows.map(|(ray, &is_hit)| format!("{ray},{}", u8::from(is_hit)));
                assert!(lines.eq(rows));
                continue;
            }
            assert_eq!(answer["hits"], hits.iter().len());
            assert_eq!(header, Some("ray,element,feature,t,t_end,b0,b1,b2"));
            let expected: Vec<_> = (0..rays.len())
                .flat_map(|ray| hits.of(ray).iter().map(move |hit| (ray, hit)))
                .collect();
            assert_eq!(lines.clone().count(), expected.len());
            for (line, (ray, hit)) in lines.zip(expected) {
                let fields: Vec<&str> = line.split(',').collect();
                assert_eq!(fields[0], ray.to_string());
                assert_eq!(fields[1], hit.element.element.to_string());
                assert_eq!(fields[2], name(hit.feature));
                assert_eq!(numbers(&fields[3..5]), [hit.t, hit.t_end]);
                assert_eq!(numbers(&fields[5..]), hit.barycentrics);
            }
        }
    }

    let cast = ["cast", "a.ply", "--rays", "rays.csv", "--fail-on-hit"];
    let run = folder.run(cast);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let text = folder.run(cast.iter().chain(&["--most", "0"])).printed();
    assert!(text.starts_with("a.ply: 0 of 343 rays hit it, "), "{text}");
    let last = "343 rays of rays.csv and 1 mesh, 0 vertices welded; not asked: what rays hit after that (--hits all)\n";
    assert!(text.ends_with(last), "{text}");
}

#[test]
fn bad_files_are_named_with_their_line() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(320));
    folder.text("short.csv", "x,y,z\n1,2,3\n1,2\n");
    folder.text("word.txt", "1 2 3\n1 two 3\n");
    folder.text("long.csv", "0,0,0,0,0,1\n0,0,0,0,0,1,7\n");
    folder.text("nan.csv", "0,0,0,0,0,nan\n");
    folder.text("semicolons.csv", "1;1;5;0;0;-1\n0,0,5,0,0,-1\n");
    folder.text("none.csv", "x,y,z\n");
    let mut two = npy_header("'<f4'", "(0, 3)");
    two.extend([0; 12]);
    std::fs::write(folder.path("long.npy"), two).unwrap();
    std::fs::write(folder.path("pairs.npy"), npy_header("'<u4'", "(0, 4)")).unwrap();
    let points = |file| folder.run(["probe", "a.ply", "--points", file]);
    let rays = |file| folder.run(["cast", "a.ply", "--rays", file]);
    for (run, said) in [
        (
            points("short.csv"),
            "short.csv:3: expected 3 numbers in a row, found 2",
        ),
        (
            points("word.txt"),
            "word.txt:2: expected a finite number, found 'two'",
        ),
        (
            points("pairs.npy"),
            "pairs.npy: byte 0: expected an array of '<f4' or '<f8' of shape (n, 3), found type '<u4'",
        ),
        (
            points("none.csv"),
            "none.csv:2: expected a row of 3 numbers, found the end of the file",
        ),
        (
            points("long.npy"),
            "long.npy: byte 128: expected 0 bytes of rows, found 12",
        ),
        (
            rays("semicolons.csv"),
            "semicolons.csv:1: expected 6 numbers, or a name for each of 6 columns, found '1;1;5;0;0;-1'",
        ),
        (
            rays("long.csv"),
            "long.csv:2: expected 6 numbers in a row, found 7",
        ),
        (
            rays("nan.csv"),
            "nan.csv:1: expected a finite number, found 'nan'",
        ),
        (
            rays("a.ply"),
            "a.ply: no rows of numbers have the extension 'ply' (known: csv, txt, xyz, npy)",
        ),
    ] {
        assert_eq!(run.error(), said);
    }
    assert!(
        points("missing.csv")
            .error()
            .starts_with("missing.csv: cannot ")
    );

    folder.text("p.csv", "1,2,3\n");
    for (more, said) in [
        (&["--rows", "p.csv"][..], "is the input p.csv"),
        (&["--json", "--rows", "-"], "give one of them a file"),
        (&["--most", "-1"], "not below 0"),
        (&["--threads", "0"], "at least 1"),
    ] {
        let args = ["probe", "a.ply", "--points", "p.csv"];
        let misuse = folder.run(args.iter().chain(more)).misuse();
        assert!(misuse.contains(said), "{misuse}");
    }
    assert!(folder.run(["cast", "a.ply"]).misuse().contains("--rays"));
}
