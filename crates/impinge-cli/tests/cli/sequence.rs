//! `impinge sequence`.

use impinge::{Query, SharedVertex};
use impinge_io::Pc2Writer;
use impinge_scenes::Model;
use impinge_scenes::surfaces::{ball, torus};
use serde_json::{Value, json};

use crate::harness::{Folder, keys, oracle};
use crate::schema::{schema, wrong};

/// A ball that falls through a ring, and folds in two on its way.
fn falling(n_frames: usize) -> (Model, Vec<Model>) {
    let rest = ball(300);
    let frames = (0..n_frames)
        .map(|frame| {
            let t = frame as f32 / n_frames as f32;
            rest.mapped(|[x, y, z]| [x.abs() * t + x * (1.0 - t), y, z + 1.0 - 2.0 * t])
        })
        .collect();
    (rest, frames)
}

fn write(folder: &Folder, n_frames: usize) -> Vec<Model> {
    let (rest, frames) = falling(n_frames);
    folder.ply("ball.ply", &rest);
    folder.ply("ring.ply", &ring());
    let mut cache =
        Pc2Writer::create(&folder.path("run.pc2"), rest.n_vertices(), 0.0, 1.0).unwrap();
    for (frame_ix, frame) in frames.iter().enumerate() {
        cache.append(&frame.positions).unwrap();
        folder.ply(&format!("run_{frame_ix:03}.ply"), frame);
    }
    cache.finish().unwrap();
    frames
}

fn ring() -> Model {
    torus(24, 8, 0.45, 0.1)
}

fn lines(text: &str) -> Vec<Value> {
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[test]
fn every_frame_is_the_oracle_s() {
    let folder = Folder::new();
    let frames = write(&folder, 8);
    let ring = ring();
    type Case<'a> = (&'a [&'a str], Query);
    let cases: [Case; 4] = [
        (&[], Query::self_all()),
        (&["--self"], Query::self_all()),
        (&["--other", "ring.ply"], Query::between_all()),
        (&["--other", "ring.ply", "--self"], Query::all()),
    ];
    for (options, query) in cases {
        let expected: Vec<(Value, Value)> = frames
            .iter()
            .map(|frame| {
                let models = if options.contains(&"--other") {
                    vec![frame, &ring]
                } else {
                    vec![frame]
                };
                let rule = SharedVertex::Resolve;
                let (rows, hash) = oracle(&models, |_| query.clone().shared_vertex(rule));
                (json!(rows.len()), json!(hash))
            })
            .collect();
        assert!(
            expected.iter().any(|(n, _)| n != &expected[0].0),
            "{options:?}"
        );
        for sequence in ["run.pc2", "run_000.ply", "run_%03d.ply"] {
            let args = ["sequence", "ball.ply", sequence, "--json"];
            let text = folder.run(args.iter().chain(options)).printed();
            let lines = lines(&text);
            assert_eq!(lines.len(), frames.len());
            for (frame_ix, (line, (n, hash))) in lines.iter().zip(&expected).enumerate() {
                let file = (sequence != "run.pc2").then_some("file");
                let rest = [
                    "pairs",
                    "hash",
                    "backend",
                    "method",
                    "ms",
                    "stats",
                    "asked",
                    "bodies",
                    "n_regions",
                    "regions",
                ];
                let expected: Vec<&str> = ["frame"].into_iter().chain(file).chain(rest).collect();
                assert_eq!(keys(line), expected);
                assert_eq!(line["frame"], json!(frame_ix));
                assert_eq!(
                    (&line["pairs"], &line["hash"]),
                    (n, hash),
                    "{options:?} {sequence}"
                );
            }
        }
    }
}

/// What a shell makes of `run_*.ply`, also where the mesh is one of them, and a folder.
#[test]
fn frames_may_be_files_each() {
    let folder = Folder::new();
    write(&folder, 8);
    let told = |args: &[&str]| -> Vec<(Value, Value)> {
        let args = ["sequence"].iter().chain(args).chain(&["--json"]);
        let text = folder.run(args).printed();
        let told = lines(&text).into_iter();
        told.map(|line| (line["file"].clone(), line["hash"].clone()))
            .collect()
    };
    let whole = told(&["ball.ply", "run_%03d.ply"]);
    let files: Vec<String> = (0..8).map(|ix| format!("run_{ix:03}.ply")).collect();
    let mut files: Vec<&str> = files.iter().map(String::as_str).collect();
    // Frame 0 is the ball as it is.
    assert_eq!(told(&files), whole);
    // `run_000.ply run_*.ply`: the mesh is there twice, and one frame.
    for mesh in ["run_000.ply", "run_003.ply"] {
        let quoted = told(&[mesh, "run_*.ply"]);
        assert_eq!(told(&[&[mesh][..], &files].concat()), quoted);
    }
    files.swap(2, 5);
    files.insert(0, "ball.ply");
    assert_eq!(told(&files), whole);
    assert_eq!(
        told(&["ball.ply", "run_003.ply", "run_006.ply"]),
        [whole[3].clone(), whole[6].clone()]
    );
    let text = folder
        .run(["sequence", "ball.ply", "run_000.ply"])
        .printed();
    let line = text.lines().nth(6).unwrap();
    assert!(line.ends_with("  run_005.ply"), "{line}");

    let said = folder.run(["sequence", "ball.ply", "."]).error();
    assert!(
        said.contains(".: expected frames, as in './*.obj', found a folder"),
        "{said}"
    );
    let said = folder
        .run(["sequence", "ball.ply", "run.pc2", "ring.ply"])
        .misuse();
    assert!(
        said.contains("run.pc2: a mesh and one file with frames, or a file for each frame"),
        "{said}"
    );
}

#[test]
fn ranges_of_frames() {
    let folder = Folder::new();
    write(&folder, 6);
    let numbers = |range: &str| -> Vec<u64> {
        let text = folder
            .run([
                "sequence", "ball.ply", "run.pc2", "--json", "--frames", range,
            ])
            .printed();
        lines(&text)
            .iter()
            .map(|line| line["frame"].as_u64().unwrap())
            .collect()
    };
    assert_eq!(numbers("2..4"), [2, 3]);
    assert_eq!(numbers("4.."), [4, 5]);
    assert_eq!(numbers("..1"), [0]);
    for range in ["3..7", "7.."] {
        let said = folder
            .run([
                "sequence", "ball.ply", "run.pc2", "--json", "--frames", range,
            ])
            .misuse();
        assert!(said.contains("6 frames of run.pc2"), "{said}");
    }
}

/// Two meshes that both move are answered as each pair of poses is, and on the way.
#[test]
fn two_meshes_that_move() {
    let folder = Folder::new();
    let frames = write(&folder, 6);
    let rest = ball(200);
    let others = Vec::from_iter((0..6).map(|frame| {
        let up = frame as f32 / 3.0 - 1.0;
        rest.mapped(|[x, y, z]| [x + 0.4, y, z + up])
    }));
    folder.ply("other.ply", &rest);
    for (name, n) in [("other.pc2", 6), ("short.pc2", 5)] {
        let path = folder.path(name);
        let mut cache = Pc2Writer::create(&path, rest.n_vertices(), 0.0, 1.0).unwrap();
        for other in &others[..n] {
            cache.append(&other.positions).unwrap();
        }
        cache.finish().unwrap();
    }
    let base = ["sequence", "ball.ply", "run.pc2", "--moving", "other.ply"];
    let both = Vec::from_iter(base.into_iter().chain(["other.pc2"]));
    let found = lines(&folder.run(both.iter().chain(&["--json"])).printed());
    assert_eq!(found.len(), 6);
    let mut n_pairs = 0;
    for (line, models) in found.iter().zip(frames.iter().zip(&others)) {
        let (rows, hash) = oracle(&[models.0, models.1], |_| Query::between_all());
        assert_eq!(
            (&line["pairs"], &line["hash"]),
            (&json!(rows.len()), &json!(hash))
        );
        n_pairs += rows.len();
    }
    assert!(n_pairs > 100, "{n_pairs}");
    // As `impinge step` with the ends of both.
    for (ix, end) in others.iter().enumerate() {
        folder.ply(&format!("other_{ix:03}.ply"), end);
    }
    let steps = lines(&folder.run(both.iter().chain(&["--ccd", "--json"])).stdout);
    assert_eq!(steps.len(), 5);
    let mut n_impacts = 0;
    for (ix, step) in steps.iter().enumerate() {
        let ends = |name: &str| [0, 1].map(|k| format!("{name}_{:03}.ply", ix + k));
        let files = [ends("run"), ends("other")].concat();
        let more = ["--no-self", "--no-weld", "--json"].map(str::to_owned);
        let all = ["step".to_owned()].into_iter().chain(files).chain(more);
        let own: Value = serde_json::from_str(&folder.run(all).stdout).unwrap();
        for key in ["impacts", "hash", "earliest", "start_intersects"] {
            assert_eq!(step[key], own[key], "{ix} {key}");
        }
        n_impacts += own["impacts"].as_u64().unwrap();
    }
    assert!(n_impacts > 100, "{n_impacts}");
    // A frame that cannot be asked about is passed over, whichever mesh it is of.
    let mut cache = std::fs::read(folder.path("other.pc2")).unwrap();
    let third = 32 + 2 * 12 * rest.n_vertices();
    cache[third..third + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(folder.path("holed.pc2"), cache).unwrap();
    let holed = Vec::from_iter(base.into_iter().chain(["holed.pc2"]));
    for (more, n, code) in [(&[][..], 5, 1), (&["--ccd"], 3, 4)] {
        let run = folder.run(holed.iter().chain(more).chain(&["--json"]));
        let asked = lines(&run.stdout);
        let asked = asked.iter().filter(|line| line.get("error").is_none());
        assert_eq!((asked.count(), run.code), (n, Some(code)), "{}", run.stderr);
        assert!(
            run.stdout.contains("\"frame\":2,\"error\":\"holed.pc2: "),
            "{}",
            run.stdout
        );
    }
    let said = folder.run(base.iter().chain(&["short.pc2"])).misuse();
    let text = "--moving: short.pc2: 5 frames given, 6 needed: ";
    assert!(said.contains(text), "{said}");
}

#[test]
fn text_for_people() {
    let folder = Folder::new();
    write(&folder, 5);
    let text = folder.run(["sequence", "ball.ply", "run.pc2"]).printed();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 8, "{text}");
    assert!(lines[0].contains("frame") && lines[0].contains("hash"));
    assert!(lines[6].starts_with("5 frames, 0 to "), "{text}");
    assert_eq!(
        lines[7],
        "within 1 mesh, 0 vertices welded, neighbours resolved"
    );
    // With rows on standard output, what is said of all frames goes to standard error.
    for (more, total) in [(&[][..], "5 frames, 0 to "), (&["--ccd"], "4 steps, ")] {
        let asked = ["sequence", "ball.ply", "run.pc2", "--rows", "-"];
        let run = folder.run(asked.iter().chain(more));
        assert!(run.stdout.starts_with("frame,"), "{}", run.stdout);
        let said: Vec<&str> = run.stderr.lines().collect();
        assert!(said[0].starts_with(total), "{}", run.stderr);
        assert!(said[1].starts_with("within 1 mesh, "), "{}", run.stderr);
        // And with -v the median time of each stage, before the last line.
        let run = folder.run(asked[..3].iter().chain(&["-v"]).chain(more));
        let said: Vec<&str> = run.stdout.lines().collect();
        let stages = said.iter().position(|line| line.starts_with("stage "));
        let stages = &said[stages.expect("a table")..];
        assert!(stages[0].contains("ms, median of "), "{}", run.stdout);
        assert!(stages.iter().any(|line| line.starts_with("total ")));
        assert!(stages[stages.len() - 1].starts_with("within 1 mesh, "));
    }
    // Beside another mesh, self-collision is no longer asked for unless it is said, and the answer
    // says so.
    let args = ["sequence", "ball.ply", "run.pc2", "--other", "ring.ply"];
    for (more, last) in [
        (
            &[][..],
            "between 2 meshes, vertices as in the files, neighbours resolved; not asked: self-collision (--self)",
        ),
        (
            &["--self"],
            "between 2 meshes and within each, 0 vertices welded, neighbours resolved",
        ),
        (
            &["--ccd"],
            "between 2 meshes, vertices as in the files, neighbours resolved at the start, else left out; not asked: self-collision (--self)",
        ),
    ] {
        let run = folder.run(args.iter().chain(more));
        // Some steps start with an intersection.
        let code = if more == ["--ccd"] { 4 } else { 0 };
        assert_eq!(run.code, Some(code), "{}", run.stderr);
        assert_eq!(run.stdout.lines().last(), Some(last), "{}", run.stdout);
    }
}

#[test]
fn frames_are_welded_as_the_mesh_is() {
    let folder = Folder::new();
    let (rest, frames) = falling(4);
    // Every triangle has vertices of its own, as in a file that repeats them.
    let soup = |model: &Model| -> Model {
        let impinge::Elements::Triangles(faces) = &model.elements else {
            unreachable!("a ball is made of triangles");
        };
        Model {
            positions: faces
                .as_flattened()
                .iter()
                .map(|&ix| model.positions[ix as usize])
                .collect(),
            elements: (0..faces.len() as u32)
                .map(|face| [3 * face, 3 * face + 1, 3 * face + 2])
                .collect::<Vec<_>>()
                .into(),
        }
    };
    folder.ply("soup.ply", &soup(&rest));
    for (frame_ix, frame) in frames.iter().enumerate() {
        folder.ply(&format!("soup_{frame_ix}.ply"), &soup(frame));
    }
    let text = folder
        .run(["sequence", "soup.ply", "soup_0.ply", "--weld", "--json"])
        .printed();
    for (line, frame) in lines(&text).iter().zip(&frames) {
        let rule = SharedVertex::Resolve;
        let (rows, hash) = oracle(&[frame], |_| Query::self_all().shared_vertex(rule));
        assert_eq!(
            (&line["pairs"], &line["hash"]),
            (&json!(rows.len()), &json!(hash))
        );
        assert_eq!(line["bodies"][0]["vertices"], json!(rest.n_vertices()));
    }
}

#[test]
fn frames_that_do_not_fit_are_named() {
    let folder = Folder::new();
    write(&folder, 2);
    folder.ply("other.ply", &ball(80));
    let n = ball(300).n_vertices();
    for weld in [
        &["--json"][..],
        &["--json", "--weld"],
        &["--json", "--no-weld"],
    ] {
        let args = ["sequence", "other.ply", "run.pc2"];
        let line = folder.run(args.iter().chain(weld)).error();
        assert!(
            line.contains("run.pc2") && line.contains(&n.to_string()),
            "{line}"
        );
    }
    let line = folder.run(["sequence", "ball.ply", "missing.pc2"]).error();
    assert!(line.contains("missing.pc2"), "{line}");
}

#[test]
fn pairs_and_meshes_of_every_frame_are_written() {
    let folder = Folder::new();
    let frames = write(&folder, 4);
    let rule = SharedVertex::Resolve;
    let mut expected = vec!["frame,body_a,element_a,body_b,element_b".to_owned()];
    for (frame_ix, frame) in frames.iter().enumerate() {
        let (rows, _) = oracle(&[frame], |_| Query::self_all().shared_vertex(rule));
        expected.extend(
            rows.iter()
                .map(|[body_a, a, body_b, b]| format!("{frame_ix},{body_a},{a},{body_b},{b}")),
        );
    }
    assert!(expected.len() > 20);
    let base = ["sequence", "ball.ply", "run.pc2"];
    let run = |options: &[&str]| folder.run(base.iter().chain(options)).printed();
    run(&["--rows", "rows.csv", "--out", "seen_%02d.ply"]);
    let text = std::fs::read_to_string(folder.path("rows.csv")).unwrap();
    assert_eq!(text.lines().collect::<Vec<_>>(), expected);
    for (frame_ix, frame) in frames.iter().enumerate() {
        let path = folder.path(&format!("seen_{frame_ix:02}.ply"));
        let mesh = impinge_io::read(&path, &Default::default()).unwrap();
        assert_eq!(
            mesh.positions,
            impinge_io::Positions::F32(frame.positions.clone())
        );
    }
    let printed = run(&["--rows", "-"]);
    assert_eq!(printed.lines().collect::<Vec<_>>(), expected);
    run(&["--rows", "rows.jsonl"]);
    let text = std::fs::read_to_string(folder.path("rows.jsonl")).unwrap();
    assert_eq!(text.lines().count(), expected.len() - 1);
    let first: Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    assert_eq!(
        keys(&first),
        ["frame", "body_a", "element_a", "body_b", "element_b"]
    );
    // Input frames are not overwritten, and one file cannot hold all frames.
    for out in ["run_%03d.ply", "seen.ply"] {
        let args = ["sequence", "ball.ply", "run_000.ply", "--out", out];
        folder.run(args).code.filter(|code| *code == 2).expect(out);
    }
    let frame = impinge_io::read(&folder.path("run_000.ply"), &Default::default()).unwrap();
    assert_eq!(
        frame.positions,
        impinge_io::Positions::F32(frames[0].positions.clone())
    );
}

#[test]
fn a_missing_frame_is_named() {
    let folder = Folder::new();
    write(&folder, 6);
    for frame in [3, 4] {
        std::fs::remove_file(folder.path(&format!("run_00{frame}.ply"))).unwrap();
    }
    let run = folder.run(["sequence", "ball.ply", "run_%03d.ply"]);
    assert_eq!(
        run.stderr,
        "note: no frame between run_002.ply and run_005.ply\n"
    );
    assert!(run.printed().contains("4 frames"));
    // Nobody knows how the mesh moved in between, so there is no step.
    let run = folder.run(["sequence", "ball.ply", "run_%03d.ply", "--ccd", "--json"]);
    assert_eq!(run.code, Some(1));
    assert!(
        run.stderr
            .contains("1 frame of run_%03d.ply not asked about"),
        "{}",
        run.stderr
    );
    let steps: Vec<Value> = lines(&run.stdout)
        .iter()
        .map(|line| line["file"].clone())
        .collect();
    assert_eq!(steps, ["run_000.ply", "run_001.ply"]);
}

#[test]
fn one_frame_is_no_step() {
    let folder = Folder::new();
    write(&folder, 6);
    let args = [
        "sequence", "ball.ply", "run.pc2", "--ccd", "--frames", "3..4",
    ];
    assert!(folder.run(args).misuse().contains("there is one frame"));
}

/// Positions of another mesh, or of the same with other numbers, are no frame of this one.
#[test]
fn frames_have_the_faces_of_the_mesh() {
    let folder = Folder::new();
    let corners = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 1 1 -1\nv 1 1 1\nv 9 9 9\nv 9 8 9\nv 8 9 9\n";
    let (apart, crossing) = ("f 1 2 3\nf 6 7 8\n", "f 1 2 3\nf 4 5 6\n");
    folder.text("x_0.obj", &format!("{corners}{apart}"));
    folder.text("x_1.obj", &format!("{corners}{crossing}"));
    folder.text("x_2.obj", &format!("{corners}{apart}"));
    let run = folder.run(["sequence", "x_0.obj", "x_0.obj", "--rows", "-"]);
    assert_eq!(run.code, Some(1));
    let said = "frame 1 is passed over: x_1.obj: a vertex of face 1, which the mesh has (a mesh whose \
         faces change is no sequence: ask about it file by file): expected 5, found 3";
    assert!(run.stderr.contains(said), "{}", run.stderr);
    // The mesh and the frames.
    folder.text("y_0.obj", &format!("{corners}{crossing}"));
    let error = folder.run(["sequence", "x_0.obj", "y_0.obj"]).error();
    assert!(
        error.contains("y_0.obj") && error.contains("face 1"),
        "{error}"
    );
    // Files of positions alone are frames of any mesh.
    folder.text("z_0.obj", corners);
    assert_eq!(
        folder
            .run(["sequence", "x_0.obj", "z_0.obj", "--fail-on-hit"])
            .code,
        Some(0)
    );
}

#[test]
fn a_mesh_that_comes_apart_where_it_was_welded_is_refused() {
    let folder = Folder::new();
    let face = |z: f32| {
        format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {z}\nv 1 1 {z}\nv 2 0 {z}\nf 1 2 3\nf 4 5 6\n")
    };
    folder.text("a.obj", &face(0.0));
    folder.text("f_1.obj", &face(0.0));
    folder.text("f_2.obj", &face(1.0));
    let args = ["sequence", "a.obj", "f_1.obj", "--rows", "-"];
    let run = folder.run(args);
    assert_eq!(run.code, Some(2));
    assert!(
        run.stderr.contains("frame 1: vertices 0 and 3 are apart"),
        "{}",
        run.stderr
    );
    let text = folder.run(args.iter().chain(&["--no-weld"])).printed();
    assert_eq!(text.lines().collect::<Vec<_>>()[1..], ["0,0,0,0,1"]);
}

#[test]
fn a_cache_without_frames_is_no_check() {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(320));
    let n = ball(320).n_vertices();
    let cache = Pc2Writer::create(&folder.path("none.pc2"), n, 0.0, 1.0).unwrap();
    cache.finish().unwrap();
    let run = folder.run(["sequence", "a.ply", "none.pc2", "--fail-on-hit"]);
    assert!(run.misuse().contains("none.pc2: there are no frames"));
}

/// A simulation that has exploded in one frame, or a file that was cut: the others are asked about.
#[test]
fn frames_that_cannot_be_read_are_passed_over() {
    let folder = Folder::new();
    let frames = write(&folder, 6);
    folder.text("run_002.ply", "ply\nformat ascii 1.0\nelement vert");
    let mut exploded =
        Pc2Writer::create(&folder.path("run.pc2"), frames[0].n_vertices(), 0.0, 1.0).unwrap();
    for (ix, frame) in frames.iter().enumerate() {
        let mut positions = frame.positions.clone();
        if ix == 2 {
            positions[7] = [f32::NAN, 0.0, 0.0];
        }
        exploded.append(&positions).unwrap();
    }
    exploded.finish().unwrap();
    for sequence in ["run.pc2", "run_%03d.ply"] {
        let ask = |more: &[&str]| {
            let args = ["sequence", "ball.ply", sequence, "--rows", "rows.csv"];
            folder.run(args.iter().chain(more))
        };
        let run = ask(&[]);
        assert_eq!(run.code, Some(1));
        assert!(
            run.stderr.contains("frame 2 is passed over: run"),
            "{}",
            run.stderr
        );
        let last = format!("1 frame of {sequence} not asked about");
        assert!(run.stderr.contains(&last), "{}", run.stderr);
        assert!(run.stdout.contains("\n5 frames, "), "{}", run.stdout);
        let found = ask(&["--fail-on-hit"]);
        assert_eq!(found.code, Some(3));
        assert!(
            found.stderr.contains(&format!("note: {last}")),
            "{}",
            found.stderr
        );
        let rows = std::fs::read_to_string(folder.path("rows.csv")).unwrap();
        let run = ask(&["--json"]);
        assert_eq!(run.code, Some(1));
        let lines = run
            .stdout
            .lines()
            .map(|line| serde_json::from_str(line).unwrap());
        let lines: Vec<Value> = lines.collect();
        assert_eq!(lines.len(), 6);
        let (mut n, mut of_frames) = (0, rows.lines().skip(1));
        for (ix, line) in lines.iter().enumerate() {
            assert_eq!(line["frame"], json!(ix));
            let form = ["answer", "sequence-error"][usize::from(ix == 2)];
            assert_eq!(wrong(&schema(form), line, form), [""; 0]);
            let n_pairs = line["pairs"].as_u64().unwrap_or(0);
            n += n_pairs;
            let own = of_frames.by_ref().take(n_pairs as usize);
            assert!(
                own.into_iter()
                    .all(|row| row.starts_with(&format!("{ix},")))
            );
        }
        assert!(n > 0 && of_frames.next().is_none());
        // Of a step, both of its frames are needed.
        let run = ask(&["--ccd", "--start", "report"]);
        assert_eq!(run.code, Some(1));
        assert!(run.stdout.contains("\n3 steps, "), "{}", run.stdout);
        let lines = run.stdout.lines().filter(|line| line.contains(" to "));
        let steps: Vec<&str> = lines.filter_map(|line| line.trim().get(..6)).collect();
        assert_eq!(steps, ["0 to 1", "3 to 4", "4 to 5"]);
        let run = ask(&["--ccd", "--json"]);
        assert_eq!((run.code, run.stdout.lines().count()), (Some(4), 4));
    }
}

#[test]
fn one_numbered_file_is_named_too() {
    let folder = Folder::new();
    folder.ply("f_1_v2.ply", &ball(320));
    folder.ply("f_2_v2.ply", &ball(320));
    let run = folder.run(["sequence", "f_1_v2.ply", "f_1_v2.ply"]);
    let said = "note: f_1_v2.ply: the only frame: no file has a greater number in place of 2, the last number of the name\n";
    assert_eq!(run.stderr, said);
    let text = run.printed();
    assert!(
        text.lines().nth(1).unwrap().ends_with("  f_1_v2.ply"),
        "{text}"
    );
    let args = ["sequence", "f_1_v2.ply", "f_1_v2.ply", "--json"];
    let run = folder.run(args);
    assert_eq!(lines(&run.stdout)[0]["file"], json!("f_1_v2.ply"));
}

#[test]
fn frames_of_numbered_files_name_their_files() {
    let folder = Folder::new();
    for number in [1001, 1002, 1003] {
        folder.ply(&format!("f_{number}.ply"), &ball(320));
    }
    for more in [&[][..], &["--ccd"]] {
        let sequence = ["sequence", "f_1001.ply", "f_*.ply", "--json"];
        let printed = folder.run(sequence.iter().chain(more)).printed();
        let lines = printed
            .lines()
            .map(|line| serde_json::from_str(line).unwrap());
        let named: Vec<Value> = lines
            .map(|line: Value| json!([line["frame"], line["file"]]))
            .collect();
        let files = ["f_1001.ply", "f_1002.ply", "f_1003.ply"];
        let expected = (0..named.len()).map(|ix| json!([ix, files[ix]]));
        assert!(
            named.len() >= 2 && named.iter().cloned().eq(expected),
            "{named:?}"
        );
    }
}
