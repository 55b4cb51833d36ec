//! `impinge step` and `impinge sequence --ccd`.

use std::path::Path;

use impinge::{Backend, Detector, Impact, PairKind, Precision, Query, Scene};
use impinge_scenes::Model;
use impinge_scenes::surfaces::{ball, cube};
use impinge_testing::npy::split;
use serde_json::Value;

use crate::harness::{Folder, keys, rod_and_plate};
use crate::schema::{schema, wrong};

/// Two bodies, each at the start and at the end of a step in which one runs into the other.
fn crash() -> [(&'static str, Model); 4] {
    let (a, b) = (ball(80), cube([2.0, 0.125, 0.0], 1.0));
    [
        ("a0.ply", a.clone()),
        ("a1.ply", a.translated([0.5, 0.0, 0.0]).scaled(1.125)),
        ("b0.ply", b.clone()),
        ("b1.ply", b.translated([-1.0, 0.0, 0.25])),
    ]
}

const FILES: [&str; 4] = ["a0.ply", "a1.ply", "b0.ply", "b1.ply"];

fn folder() -> Folder {
    let folder = Folder::new();
    for (name, model) in crash() {
        folder.ply(name, &model);
    }
    folder
}

/// All impacts, by the library.
fn expected(precision: Precision) -> (Vec<Impact>, u64) {
    let [a0, a1, b0, b1] = crash().map(|(_, model)| model);
    let mut scene = Scene::new();
    for (start, end) in [(a0, a1), (b0, b1)] {
        let id = start.add_to(&mut scene).unwrap();
        scene.set_end_positions(id, &end.positions).unwrap();
    }
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let query = Query::all().precision(precision);
    let impacts = detector.impacts(&scene, &query).unwrap();
    (impacts.iter().copied().collect(), impacts.hash())
}

type Row = (String, [u32; 4], f64);

fn row(impact: &Impact) -> Row {
    (impact.kind.name().to_owned(), impact.row(), impact.toi)
}

fn csv(path: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header = "kind,body_a,element_a,body_b,element_b,toi";
    assert_eq!(lines.next(), Some(header));
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let numbers = std::array::from_fn(|k| fields[k + 1].parse().unwrap());
        (fields[0].to_owned(), numbers, fields[5].parse().unwrap())
    };
    lines.map(row).collect()
}

/// A row of a structured array: `kind` of two characters, four numbers, and more bytes.
type Structured<const MORE: usize> = (String, [u32; 4], [u8; MORE]);

/// The header and the rows of a structured array.
fn npy<const MORE: usize>(bytes: &[u8]) -> (&str, Vec<Structured<MORE>>) {
    let (header, data) = split(bytes);
    assert_eq!((10 + header.len()) % 64, 0);
    let word = |at: &[u8]| u32::from_le_bytes(at[..4].try_into().unwrap());
    let row = |row: &[u8]| {
        let kind = [word(row), word(&row[4..])].map(|c| char::from_u32(c).unwrap());
        let numbers = std::array::from_fn(|k| word(&row[8 + 4 * k..]));
        (
            kind.iter().collect(),
            numbers,
            row[24..].try_into().unwrap(),
        )
    };
    let rows: Vec<_> = data.chunks_exact(24 + MORE).map(row).collect();
    let shape = format!("'shape': ({},)", rows.len());
    assert!(
        header.contains(&shape) && header.ends_with('\n'),
        "{header}"
    );
    (header, rows)
}

/// Rows whose bytes after the numbers are a time.
fn npy_impacts<const N: usize>(path: &Path, time: impl Fn([u8; N]) -> f64) -> Vec<Row> {
    let bytes = std::fs::read(path).unwrap();
    let (header, rows) = npy(&bytes);
    assert!(header.contains(&format!("('toi', '<f{N}')")), "{header}");
    let rows = rows.into_iter();
    rows.map(|(kind, row, toi)| (kind, row, time(toi)))
        .collect()
}

#[test]
fn the_json_holds_what_the_library_says() {
    let folder = folder();
    let run = folder.run(["step"].iter().chain(&FILES).chain(&["--json"]));
    let answer = run.json();
    let names = [
        "free",
        "earliest",
        "impacts",
        "kinds",
        "touching_at_start",
        "start_intersects",
        "hash",
        "backend",
        "method",
        "bodies",
        "ms",
        "stats",
        "separation",
        "clearance",
        "asked",
    ];
    assert_eq!(keys(&answer), names);
    let (impacts, hash) = expected(Precision::F32);
    assert!(impacts.len() > 10);
    assert_eq!(answer["free"], false);
    assert_eq!(answer["impacts"], impacts.len());
    assert_eq!(answer["hash"], format!("{hash:016x}"));
    assert_eq!(answer["touching_at_start"], 0);
    let total: u64 = ["vf", "ee", "ev", "vv"]
        .map(|kind| answer["kinds"][kind].as_u64().unwrap())
        .iter()
        .sum();
    assert_eq!(total, impacts.len() as u64);
    let first = impacts
        .iter()
        .min_by(|a, b| a.toi.total_cmp(&b.toi))
        .unwrap();
    assert_eq!(answer["earliest"]["toi"], first.toi);
    assert_eq!(answer["earliest"]["kind"], first.kind.name());
    assert_eq!(answer["bodies"][1]["name"], "b0.ply");
    assert_eq!(answer["bodies"][1]["end"], "b1.ply");

    // `--earliest` gives the same first impact.
    let alone = folder.run(
        ["step"]
            .iter()
            .chain(&FILES)
            .chain(&["--json", "--earliest"]),
    );
    let alone = alone.json();
    assert_eq!(alone["earliest"], answer["earliest"]);
    assert_eq!(
        (&alone["free"], &alone["impacts"]),
        (&Value::Bool(false), &Value::Null)
    );

    let schema = schema("step");
    let free = folder.run(["step", "a0.ply", "a1.ply", "--json"]).json();
    for object in [&answer, &alone, &free] {
        assert_eq!(wrong(&schema, object, "$"), [""; 0]);
    }

    // The same as text.
    let printed = folder.run(["step"].iter().chain(&FILES)).printed();
    assert!(printed.starts_with("not free: "), "{printed}");
    assert!(
        printed.contains(&format!("at time {:?}", first.toi)),
        "{printed}"
    );
}

#[test]
fn impacts_read_back_to_the_same_bits() {
    let folder = folder();
    for (name, toi) in [("f32", Precision::F32), ("f64", Precision::F64)] {
        let rows: Vec<Row> = expected(toi).0.iter().map(row).collect();
        for file in ["impacts.csv", "impacts.npy"] {
            let options = ["--precision", name, "--rows", file];
            let run = folder.run(["step"].iter().chain(&FILES).chain(&options));
            run.printed();
        }
        assert_eq!(csv(&folder.path("impacts.csv")), rows);
        let read = match toi {
            Precision::F32 => npy_impacts(&folder.path("impacts.npy"), |bytes| {
                f32::from_le_bytes(bytes).into()
            }),
            Precision::F64 => npy_impacts(&folder.path("impacts.npy"), f64::from_le_bytes),
        };
        assert_eq!(read, rows);
    }
}

/// Rows on standard output leave the summary to standard error.
#[test]
fn rows_are_printed_alone() {
    let folder = folder();
    let ask = |to| folder.run(["step"].iter().chain(&FILES).chain(&["--rows", to]));
    let run = ask("-");
    assert!(run.stderr.starts_with("not free: "), "{}", run.stderr);
    assert!(run.stderr.contains(" impacts ("), "{}", run.stderr);
    ask("impacts.csv").printed();
    let file = std::fs::read_to_string(folder.path("impacts.csv")).unwrap();
    assert_eq!(run.printed(), file);
}

#[test]
fn a_check_fails_where_a_step_is_not_free() {
    let folder = folder();
    let ask = |args: &[&str]| folder.run(["step"].iter().chain(args).chain(&["--fail-on-hit"]));
    for more in [&[][..], &["--earliest"], &["--json"], &["--rows", "-"]] {
        let run = ask(&[&FILES[..], more].concat());
        assert_eq!(run.code, Some(3), "{}", run.stderr);
        assert!(!run.stdout.is_empty());
        let run = ask(&[&["b0.ply", "b1.ply"][..], more].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
    }
}

/// All candidates of some kinds, by the library.
fn expected_candidates(kinds: &[PairKind], distance: f64) -> (Vec<(String, [u32; 4])>, u64) {
    let [a0, a1, b0, b1] = crash().map(|(_, model)| model);
    let mut scene = Scene::new();
    for (start, end) in [(a0, a1), (b0, b1)] {
        let id = start.add_to(&mut scene).unwrap();
        scene.set_end_positions(id, &end.positions).unwrap();
    }
    let query = Query::all().kinds(kinds.iter().copied());
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let candidates = detector.candidates(&scene, distance, &query).unwrap();
    let rows = kinds.iter().flat_map(|&kind| {
        candidates
            .rows_of(kind)
            .map(move |row| (kind.name().to_owned(), row))
    });
    (rows.collect(), candidates.hash())
}

#[test]
fn candidates_are_written_in_every_format() {
    let folder = folder();
    let defaults = [PairKind::VertexFace, PairKind::EdgeEdge];
    let all = PairKind::ALL.map(PairKind::name).join(",");
    let wide = ["--kinds", &all, "--inflation", "0.5", "--threads", "1"];
    // The least budget that is enough, and holds only runs of the candidates.
    let budgets = (512..4096).step_by(64).map(|kib| format!("{kib}k"));
    let is_enough = |budget: &String| {
        let more = ["--candidates", "boxes.csv", "--memory-budget", budget];
        let arguments = ["step"].iter().chain(&FILES).chain(&wide).chain(&more);
        folder.run(arguments).code == Some(0)
    };
    let budget = budgets.into_iter().find(is_enough).unwrap();
    let in_runs = [&wide[..], &["--memory-budget", &budget]].concat();
    for (kinds, distance, more) in [
        (&defaults[..], 0.0, &[][..]),
        (&PairKind::ALL, 0.5, &wide),
        (&PairKind::ALL, 0.5, &in_runs),
    ] {
        let (rows, hash) = expected_candidates(kinds, distance);
        assert!(rows.len() > 100);
        let mut texts = Vec::new();
        for name in ["boxes.csv", "boxes.npy", "boxes.jsonl", "-"] {
            let to = ["--candidates", name];
            let arguments = ["step"].iter().chain(&FILES).chain(&to);
            let run = folder.run(arguments.clone().chain(more));
            if name == "-" {
                texts.push(run.stdout);
                continue;
            }
            let printed = run.printed();
            assert!(printed.contains(&format!("hash {hash:016x}")), "{printed}");
            let answer = folder.run(arguments.chain(more).chain(&["--json"])).json();
            assert_eq!(answer["candidates"], rows.len());
            assert_eq!(answer["hash"], format!("{hash:016x}"));
            assert_eq!(answer["inflation"], distance);
            assert_eq!(
                answer["runs"].as_u64() > Some(1),
                more.len() == in_runs.len()
            );
            let of_kind = rows.iter().filter(|row| row.0 == "ee").count();
            assert_eq!(answer["kinds"]["ee"], of_kind);
            let bytes = std::fs::read(folder.path(name)).unwrap();
            if name == "boxes.npy" {
                assert_eq!(npy_candidates(&bytes), rows);
            } else {
                texts.push(String::from_utf8(bytes).unwrap());
            }
        }
        let mut csv = "kind,body_a,element_a,body_b,element_b\n".to_owned();
        let mut jsonl = String::new();
        for (kind, [body_a, a, body_b, b]) in &rows {
            csv += &format!("{kind},{body_a},{a},{body_b},{b}\n");
            jsonl += &format!(
                "{{\"kind\":\"{kind}\",\"body_a\":{body_a},\"element_a\":{a},\"body_b\":{body_b},\"element_b\":{b}}}\n"
            );
        }
        assert!(texts == [csv.clone(), jsonl, csv]);
    }
    let ask = |more: &[&str]| {
        folder
            .run(["step"].iter().chain(&FILES).chain(more))
            .misuse()
    };
    let misuse = ask(&["--candidates", "-", "--json"]);
    assert!(misuse.contains("both write to standard output"), "{misuse}");
    let misuse = ask(&["--candidates", "a0.ply"]);
    assert!(misuse.contains("--candidates"), "{misuse}");
    for with in [&["--rows", "-"][..], &["--earliest"], &["--repeat", "2"]] {
        let misuse = ask(&[&["--candidates", "boxes.csv"], with].concat());
        assert!(misuse.contains("cannot be used with"), "{misuse}");
    }
    assert!(ask(&["--inflation", "1"]).contains("--candidates"));
}

fn npy_candidates(bytes: &[u8]) -> Vec<(String, [u32; 4])> {
    let (header, rows) = npy::<0>(bytes);
    assert!(!header.contains("toi") && header.contains("'element_b', '<u4')]"));
    rows.into_iter().map(|(kind, row, _)| (kind, row)).collect()
}

#[test]
fn a_question_asked_again_has_the_same_answer_and_median_times() {
    let folder = folder();
    for more in [&[][..], &["--earliest"]] {
        let ask = |repeat: &[&str]| {
            let arguments = ["step"].iter().chain(&FILES).chain(more).chain(repeat);
            let answer = folder.run(arguments.clone().chain(&["--json"])).json();
            (answer, folder.run(arguments).printed())
        };
        let ((once, of_one), (often, of_many)) = (ask(&[]), ask(&["--repeat", "4"]));
        for key in ["earliest", "impacts", "hash", "bodies"] {
            assert_eq!(once[key], often[key]);
        }
        assert!(often["ms"]["total"].as_f64() > Some(0.0));
        assert!(often["ms"]["stages"]["bounds"].as_f64() > Some(0.0));
        assert!(of_many.contains(" ms, median of 4\n"), "{of_many}");
        assert!(!of_one.contains("median"), "{of_one}");
    }
    let misuse = folder
        .run(["step", "a0.ply", "a1.ply", "--repeat", "0"])
        .misuse();
    assert!(misuse.contains("--repeat"), "{misuse}");
}

#[test]
fn a_free_step_says_so() {
    let folder = folder();
    let run = folder.run([
        "step",
        "a0.ply",
        "a0.ply",
        "b0.ply",
        "b0.ply",
        "--no-self",
        "--json",
    ]);
    let answer = run.json();
    assert_eq!(
        (&answer["free"], &answer["earliest"]),
        (&Value::Bool(true), &Value::Null)
    );
    assert_eq!(answer["impacts"], 0);
    let run = folder.run(["step", "a0.ply", "a0.ply", "b0.ply", "b0.ply"]);
    assert!(run.printed().starts_with("free: "));
}

#[test]
fn meshes_are_coloured_by_time() {
    let folder = folder();
    for (file, elements) in [("seen.ply", 80 + 12), ("seen.vtu", 80 + 12)] {
        let run = folder.run(["step"].iter().chain(&FILES).chain(&["--out", file]));
        run.printed();
        let mesh = impinge_io::read(&folder.path(file), &impinge_io::ReadOptions::as_they_are());
        assert_eq!(mesh.unwrap().n_elements(), elements);
    }
    let bytes = std::fs::read(folder.path("seen.vtu")).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("colliding"));
}

#[test]
fn ends_of_another_body_are_refused() {
    let folder = folder();
    let error = folder.run(["step", "a0.ply", "b1.ply"]).error();
    assert!(
        error.contains("b1.ply") && error.contains("a0.ply"),
        "{error}"
    );
    assert!(error.contains("8 vertices at the end"), "{error}");
    folder.text("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.text("turned.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 2\n");
    let error = folder.run(["step", "one.obj", "turned.obj"]).error();
    assert!(
        error.contains("element 0 has the vertices [0, 2, 1]"),
        "{error}"
    );
    folder.text("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert!(
        folder
            .run(["step", "one.obj", "nan.obj"])
            .error()
            .contains("nan.obj")
    );
    let misuse = folder.run(["step", "a0.ply", "a1.ply", "b0.ply"]).misuse();
    assert!(misuse.contains("b0.ply has no end (3 files"), "{misuse}");
    let misuse = folder
        .run(["step", "a0.ply", "a1.ply", "--no-self"])
        .misuse();
    assert!(misuse.contains("nothing to test"), "{misuse}");
}

/// Two triangles, each with a vertex at the same position at the start; at the end these vertices
/// have separated.
#[test]
fn welding_keeps_what_parts() {
    let folder = Folder::new();
    let faces = "f 1 2 3\nf 4 5 6\n";
    let start = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv -1 0 0\nv 0 -1 0\n";
    let parted = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv -1 0 1\nv 0 -1 1\n";
    folder.text("start.obj", &format!("{start}{faces}"));
    folder.text("parted.obj", &format!("{parted}{faces}"));
    let at_start = |end: &str, more: &[&str]| {
        let run = folder.run(["step", "start.obj", end, "--json"].iter().chain(more));
        let answer: Value = serde_json::from_str(&run.stdout).unwrap();
        let intersects = answer["start_intersects"] == true;
        assert_eq!(run.code, Some(if intersects { 4 } else { 0 }));
        assert_eq!(intersects, answer["touching_at_start"] != 0);
        (
            answer["touching_at_start"].as_u64(),
            answer["bodies"][0]["vertices"].as_u64(),
        )
    };
    let (touching, vertices) = at_start("start.obj", &["--no-weld"]);
    assert!(touching > Some(0) && vertices == Some(6));
    for more in [&[][..], &["--weld"], &["--no-weld", "--weld"]] {
        assert_eq!(at_start("start.obj", more), (Some(0), Some(5)), "{more:?}");
    }
    assert_eq!(
        at_start("parted.obj", &["--no-weld"]),
        at_start("parted.obj", &[])
    );
    let skip = at_start("start.obj", &["--no-weld", "--start", "skip"]);
    assert_eq!(skip.0, Some(0));
    // Whoever wonders about contact at the start is told of these vertices.
    let noted = |more: &[&str]| {
        let run = folder.run(["step", "start.obj", "start.obj"].iter().chain(more));
        (run.stderr, run.stdout)
    };
    let earliest = ["step", "start.obj", "start.obj", "--no-weld", "--earliest"];
    let run = folder.run(earliest);
    let first = "not free: vertex 0 and face 1 of start.obj touch first, at the start\n";
    assert!(run.stdout.starts_with(first), "{}", run.stdout);
    let told = "note: start.obj: vertices at the position of another, not welded to it: 1\n";
    assert_eq!(noted(&["--no-weld"]).0, told);
    let (noted, printed) = noted(&[]);
    assert_eq!(noted, "");
    assert!(
        printed.contains("\nwithin 1 mesh, 1 vertex welded, "),
        "{printed}"
    );
}

/// The triangles of an STL file share nothing except positions.
#[test]
fn neighbours_in_an_stl_file_do_not_touch() {
    let folder = Folder::new();
    let facet = |[a, b, c]: [&str; 3]| {
        format!(
            "facet normal 0 0 1\nouter loop\nvertex {a}\nvertex {b}\nvertex {c}\nendloop\nendfacet\n"
        )
    };
    let faces = [["0 0 0", "1 0 0", "0 1 0"], ["1 0 0", "1 1 0", "0 1 0"]];
    let text = format!("solid s\n{}endsolid s\n", faces.map(facet).concat());
    folder.text("start.stl", &text);
    folder.text("end.stl", &text.replace(" 0\n", " 2\n"));
    let run = folder.run(["step", "start.stl", "end.stl"]);
    assert_eq!(run.stderr, "");
    let printed = run.printed();
    assert!(printed.starts_with("free: "), "{printed}");
    assert!(
        printed.contains("\nwithin 1 mesh, 2 vertices welded, "),
        "{printed}"
    );
}

#[test]
fn a_sequence_is_followed_step_by_step() {
    let folder = Folder::new();
    let still = cube([0.0; 3], 1.0);
    folder.ply("still.ply", &still);
    for (frame, x) in [3.0, 2.0, 1.0, 1.5].into_iter().enumerate() {
        folder.ply(&format!("f{frame}.ply"), &cube([x, 0.125, 0.25], 1.0));
    }
    let arguments = [
        "sequence",
        "f0.ply",
        "f%d.ply",
        "--other",
        "still.ply",
        "--ccd",
        "--json",
    ];
    let run = folder.run(arguments);
    assert_eq!(run.stderr, "");
    let lines: Vec<Value> = run
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 3);
    assert_eq!(lines[0]["free"], true);
    // The gap of 1 is closed at the very end of the second step.
    assert_eq!(lines[1]["earliest"]["toi"], 1.0);
    assert_eq!(lines[1]["touching_at_start"], 0);
    assert!(lines[2]["touching_at_start"].as_u64() > Some(0));
    assert_eq!(lines[2]["start_intersects"], true);
    // Thick bodies meet halfway: a gap of 2 becomes 1, and 1.5 are kept.
    let thick = ["--thickness", "0,1", "--thickness", "1,0.5"];
    let run = folder.run(arguments.iter().chain(&thick).chain(&["--frames", "0..2"]));
    let line: Value = serde_json::from_str(&run.printed()).unwrap();
    assert_eq!(line["earliest"]["toi"], 0.5);
    // The last step starts in contact.
    let text = &arguments[..6];
    let run = folder.run(text);
    assert_eq!(run.code, Some(4));
    assert!(
        run.stdout.contains(
            "\n3 steps, 1 free of contact, 1 intersecting at the start\nbetween 2 meshes, "
        ),
        "{}",
        run.stdout
    );
    let report = folder.run(text.iter().chain(&["--start", "report"]));
    let said = "3 steps, 1 free of contact if their starts are, which was not asked\n";
    assert!(report.printed().contains(said));
    for (more, code) in [
        (&[][..], 4),
        (&["--frames", "0..3"], 3),
        (&["--frames", "0..2"], 0),
        (&["--start", "report"], 3),
    ] {
        let run = folder.run(text.iter().chain(&["--fail-on-hit"]).chain(more));
        assert_eq!(run.code, Some(code), "{}", run.stderr);
    }
    let one = folder.run(text.iter().chain(&["--frames", "0..2"]));
    assert!(one.printed().contains("\n1 step, 1 free of contact\n"));
    // What a question does not answer is refused.
    for more in [["--png", "seen_%d.png"], ["--out", "seen_%d.ply"]] {
        let misuse = folder.run(text.iter().chain(&more)).misuse();
        assert!(misuse.contains("cannot be used with"), "{misuse}");
    }
    for more in [
        ["--precision", "f64"],
        ["--start", "skip"],
        ["--separation", "1"],
        ["--clearance", "1"],
    ] {
        let misuse = folder.run(text[..5].iter().chain(&more)).misuse();
        assert!(misuse.contains("--ccd"), "{misuse}");
    }
}

/// With a clearance, every pair keeps some of its distance, and the answer is that of the library.
#[test]
fn a_clearance_is_kept() {
    let said = " come as near as a clearance of 0.0625 lets them first, ";
    let [_, with] = keeps("clearance", Query::all().clearance(0.0625), said);
    assert!(with["earliest"]["toi"].as_f64() > Some(0.0));
    assert_eq!(with["touching_at_start"], 0);
}

/// With a distance to keep, what comes near is reported, and earlier.
#[test]
fn a_separation_is_kept() {
    let said = " come within 0.0625 first, ";
    let [without, with] = keeps("separation", Query::all().separation(0.0625), said);
    assert!(with["impacts"].as_u64() > without["impacts"].as_u64());
}

/// Thick bodies keep their thickness: as with a separation of the sum.
#[test]
fn a_thickness_is_kept() {
    let folder = folder();
    let step = |more: &[&str]| folder.run(["step"].iter().chain(&FILES).chain(more));
    let kept = step(&["--no-self", "--json", "--separation", "0.0625"]).json();
    let thick = ["--no-self", "--json", "--thickness", "0,0.03125"];
    for more in [["--separation", "0.03125"], ["--thickness", "1,0.03125"]] {
        let more = [&thick[..], &more].concat();
        let answer = step(&more).json();
        for key in ["hash", "earliest", "impacts", "start_intersects"] {
            assert_eq!(answer[key], kept[key], "{more:?}");
        }
        assert_eq!(answer["bodies"][0]["thickness"], 0.03125);
    }
    assert_eq!(kept["bodies"][0]["thickness"], 0.0);
    let printed = |more: &[&str]| step(more).printed().to_owned();
    let said = printed(&["--thickness", "0,0.0625"]);
    assert!(
        said.contains(" come within the thickness first, "),
        "{said}"
    );
    let said = printed(&["--thickness", "0,0.0625", "--separation", "0.5"]);
    assert!(
        said.contains(" come within 0.5 and the thickness "),
        "{said}"
    );
    assert!(said.contains(", thickness 0.0625 of body 0, "), "{said}");
    let boxes = |more: &[&str]| {
        let args = ["--no-self", "--json", "--candidates", "boxes.csv"];
        step(&[&args[..], more].concat()).json()["hash"].clone()
    };
    let inflated = boxes(&["--inflation", "0.25"]);
    let both = ["--thickness", "0,0.25", "--thickness", "1,0.25"];
    assert_eq!(boxes(&both), inflated);
    assert_ne!(boxes(&["--thickness", "0,0.25"]), inflated);
    assert!(
        step(&["--thickness", "7,1"])
            .misuse()
            .contains("names body 7")
    );
}

/// Asks about a crash without and with an option that makes elements keep 0.0625, compares it with
/// the library, and returns both answers.
fn keeps(option: &str, asked: Query, said: &str) -> [Value; 2] {
    let folder = folder();
    let step = |more: &[&str]| folder.run(["step"].iter().chain(&FILES).chain(more));
    let flag = &format!("--{option}")[..];
    let without = step(&["--json"]).json();
    let with = step(&["--json", flag, "0.0625"]).json();
    assert_eq!(
        (&without[option], &with[option]),
        (&0.0.into(), &0.0625.into())
    );
    let first = |answer: &Value| answer["earliest"]["toi"].as_f64().unwrap();
    assert!(first(&with) < first(&without));
    let [a0, a1, b0, b1] = crash().map(|(_, model)| model);
    let mut scene = Scene::new();
    for (start, end) in [(a0, a1), (b0, b1)] {
        let id = start.add_to(&mut scene).unwrap();
        scene.set_end_positions(id, &end.positions).unwrap();
    }
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let hash = detector.impacts(&scene, &asked).unwrap().hash();
    assert_eq!(with["hash"], format!("{hash:016x}"));
    let text = step(&[flag, "0.0625"]);
    let printed = text.printed();
    assert!(printed.contains(said), "{printed}");
    let misuse = step(&[flag, "-1"]).misuse();
    assert!(misuse.contains("not below 0"));
    [without, with]
}

/// Edges of a rod pass through the inside of a plate: nothing touches, and nothing is free.
#[test]
fn a_start_that_intersects_is_never_free() {
    let folder = rod_and_plate();
    let schema = schema("step");
    let files = ["plate.obj", "plate.obj", "rod.obj", "moved.obj"];
    for more in [
        &[][..],
        &["--fail-on-hit"],
        &["--earliest"],
        &["--method", "naive"],
    ] {
        let run = folder.run(["step"].iter().chain(&files).chain(more));
        assert_eq!(run.code, Some(4), "{more:?}: {}", run.stderr);
        let first = "not free: elements intersect at the start\n";
        assert!(run.stdout.starts_with(first), "{}", run.stdout);
        assert!(!run.stdout.contains("nothing touches"));
        let run = folder.run(["step"].iter().chain(&files).chain(&["--json"]).chain(more));
        assert_eq!(run.code, Some(4), "{more:?}: {}", run.stderr);
        let answer: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(wrong(&schema, &answer, "$"), [""; 0]);
        assert_eq!(
            (&answer["free"], &answer["start_intersects"]),
            (&false.into(), &true.into())
        );
        assert_eq!(answer["earliest"], Value::Null);
    }
    // Who does not ask is told so.
    for start in ["report", "skip"] {
        let run =
            folder.run(
                ["step"]
                    .iter()
                    .chain(&files)
                    .chain(&["--start", start, "--fail-on-hit"]),
            );
        let text = "free if the start is, which was not asked: nothing touches from start to end\n";
        assert!(run.printed().starts_with(text));
        let run = folder.run(
            ["step"]
                .iter()
                .chain(&files)
                .chain(&["--start", start, "--json"]),
        );
        assert_eq!(run.json()["start_intersects"], Value::Null);
    }
    // A face through its neighbour.
    let faces = "f 1 2 3\nf 1 4 5\n";
    let vertices = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 1 1 -1\nv 1 1 1\n";
    folder.text("fold.obj", &format!("{vertices}{faces}"));
    let run = folder.run(["step", "fold.obj", "fold.obj", "--fail-on-hit"]);
    assert_eq!(run.code, Some(4), "{}", run.stdout);
    // Who takes two files for two meshes sees that they are the ends of one.
    assert!(run.stdout.contains("\nfold.obj stays\n"), "{}", run.stdout);
    let moved = vertices.replace("-1", "0.5");
    folder.text("unfold.obj", &format!("{moved}{faces}"));
    let both = ["step", "fold.obj", "fold.obj", "fold.obj", "unfold.obj"];
    let run = folder.run(both);
    let ways = "\nfold.obj stays, fold.obj moves to unfold.obj\n";
    assert!(run.stdout.contains(ways), "{}", run.stdout);
}

/// Two sheets that lie close to each other at first, and a third one that comes from afar.
#[test]
fn what_is_near_at_rest_is_left_out() {
    let folder = Folder::new();
    let sheet = |low: f64, high: f64| {
        let corners = [
            [0.0, 0.0, low],
            [2.0, 0.0, high],
            [0.0, 2.0, low],
            [2.0, 2.0, high],
        ];
        let vertices = corners.map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        vertices.concat() + "f 1 2 3\nf 2 4 3\n"
    };
    folder.text("floor.obj", &sheet(0.0, 0.0));
    folder.text("rest.obj", &sheet(0.125, 0.125));
    folder.text("far.obj", &sheet(3.0, 3.0));
    // Half of it below the floor.
    folder.text("f0.obj", &sheet(0.125, 0.25));
    folder.text("f1.obj", &sheet(0.25, -0.125));
    let step = [
        "step",
        "floor.obj",
        "floor.obj",
        "rest.obj",
        "f1.obj",
        "far.obj",
        "f1.obj",
        "--no-self",
    ];
    let impacts = |more: &[&str]| {
        let text = folder.run(step.iter().chain(more).chain(&["--rows", "-"]));
        let bodies = |row: &str| {
            let row: Vec<&str> = row.split(',').collect();
            (row[1].to_owned(), row[3].to_owned())
        };
        let pairs: std::collections::BTreeSet<_> =
            text.printed().lines().skip(1).map(bodies).collect();
        pairs.into_iter().map(|(a, b)| a + &b).collect::<Vec<_>>()
    };
    let all = impacts(&[]);
    assert!(
        all.contains(&"10".to_owned()) || all.contains(&"01".to_owned()),
        "{all:?}"
    );
    assert_eq!(impacts(&["--exclude-rest", "0.0625"]), all);
    let few = impacts(&["--exclude-rest", "0.125"]);
    assert!(few.iter().all(|pair| pair.contains('2')), "{few:?}");
    assert!(!few.is_empty() && few.len() < all.len());
    let moved = [
        "step",
        "floor.obj",
        "floor.obj",
        "rest.obj",
        "f1.obj",
        "--no-self",
    ];
    let check = |more: &[&str]| folder.run(moved.iter().chain(&["--fail-on-hit"]).chain(more));
    assert_eq!(check(&[]).code, Some(3));
    let text = check(&["--exclude-rest", "0.125"]).printed();
    let said = "not asked: self-collision, what is at most 0.125 apart at rest";
    assert!(text.starts_with("free: ") && text.contains(said), "{text}");
    // The start is asked about without them, too, and thickness adds to the distance.
    let crossing = [
        "step",
        "floor.obj",
        "floor.obj",
        "f1.obj",
        "far.obj",
        "--no-self",
    ];
    let start = |more: &[&str]| folder.run(crossing.iter().chain(more)).code;
    assert_eq!(
        [start(&[]), start(&["--exclude-rest", "0"])],
        [Some(4), Some(0)]
    );
    let thick = ["--exclude-rest", "0.0625", "--thickness", "1,0.0625"];
    let text = check(&thick).printed();
    let said = "what is at most 0.0625, plus its thickness, apart at rest";
    assert!(text.starts_with("free: ") && text.contains(said), "{text}");
    // Of the kinds that are asked about.
    for kinds in ["vf", "vv"] {
        let args = [
            "--kinds",
            kinds,
            "--separation",
            "0.125",
            "--exclude-rest",
            "0.125",
            "--json",
        ];
        let impacts = |args: &[&str]| {
            let answer = folder.run(moved.iter().chain(args)).json();
            answer["impacts"].as_u64()
        };
        assert_eq!(impacts(&args), Some(0), "{kinds}");
        // Without them, with the same separation.
        let all = [&args[..4], &args[6..]].concat();
        assert!(impacts(&all) > Some(0), "{kinds}");
    }
    // In a sequence, at rest is the mesh, whatever its first frame is.
    let sequence = ["sequence", "rest.obj", "f%d.obj", "--other", "floor.obj"];
    let pairs = |more: &[&str]| {
        let run = folder.run(sequence.iter().chain(&["--json"]).chain(more));
        let lines = run.printed();
        let pairs = lines.lines().map(|line| {
            let line: Value = serde_json::from_str(line).unwrap();
            line["pairs"].as_u64().unwrap()
        });
        pairs.collect::<Vec<_>>()
    };
    let all = pairs(&[]);
    assert!(all[0] == 0 && all[1] > 0, "{all:?}");
    assert_eq!(pairs(&["--exclude-rest", "0.0625"]), all);
    assert_eq!(pairs(&["--exclude-rest", "0.125"]), [0, 0]);
    let text = folder.run(sequence.iter().chain(&["--ccd", "--exclude-rest", "0.125"]));
    let text = text.printed();
    assert!(text.contains("1 step, 1 free of contact\n") && text.contains("apart at rest"));
    folder
        .run(moved.iter().chain(&["--exclude-rest", "-1"]))
        .misuse();
}
