//! `--rows` of every answer, in every format, and the last line, which says what was asked.

use impinge_scenes::surfaces::{ball, cube};
use impinge_testing::npy;
use serde_json::Value;

use crate::harness::Folder;

fn folder() -> Folder {
    let folder = Folder::new();
    let (a, b) = (ball(80), cube([0.5, 0.125, 0.0], 1.0));
    folder.ply("a.ply", &a);
    folder.ply("b.ply", &b);
    folder.ply("c.ply", &cube([9.0, 0.0, 0.0], 1.0));
    // A ball that folds onto itself, and its way into the cube.
    let mut folded = a.clone();
    folded.positions[7] = folded.positions[7].map(|x| -1.5 * x);
    folder.ply("f_000.ply", &folded);
    folder.ply("f_001.ply", &a.translated([0.25, 0.0, 0.0]));
    folder.ply("f_002.ply", &a.translated([1.5, 0.0, 0.0]));
    folder
}

/// The questions, each with the columns of its rows.
const ANSWERS: [(&[&str], &str); 6] = [
    (
        &["pairs", "a.ply", "b.ply"],
        "body_a,element_a,body_b,element_b",
    ),
    (&["self", "f_000.ply"], "body_a,element_a,body_b,element_b"),
    (
        &["near", "a.ply", "b.ply", "--distance", "0.125"],
        "kind,body_a,element_a,body_b,element_b,type,feature_a,feature_b,parallel,distance,ax,ay,az,bx,by,bz",
    ),
    (
        &[
            "step",
            "a.ply",
            "f_002.ply",
            "b.ply",
            "b.ply",
            "--start",
            "report",
        ],
        "kind,body_a,element_a,body_b,element_b,toi",
    ),
    (
        &["sequence", "a.ply", "f_000.ply", "--other", "b.ply"],
        "frame,body_a,element_a,body_b,element_b",
    ),
    (
        &[
            "sequence",
            "a.ply",
            "f_000.ply",
            "--other",
            "b.ply",
            "--ccd",
            "--start",
            "report",
        ],
        "frame,kind,body_a,element_a,body_b,element_b,toi",
    ),
];

/// The rows of a NumPy array, by its shape.
fn n_of_npy(bytes: &[u8]) -> usize {
    let (header, data) = npy::split(bytes);
    let shape = header.split("'shape': (").nth(1).unwrap();
    let n = shape.split(',').next().unwrap().parse().unwrap();
    assert!(n == 0 || data.len().is_multiple_of(n), "{header}");
    n
}

#[test]
fn every_answer_writes_rows_in_every_format() {
    let folder = folder();
    for (question, columns) in ANSWERS {
        let run = |more: &[&str]| {
            let run = folder.run(question.iter().chain(more));
            assert_eq!(run.code, Some(0), "{question:?} {more:?}: {}", run.stderr);
            run
        };
        let csv = run(&["--rows", "-"]).stdout;
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some(columns), "{question:?}");
        let n = lines.clone().count();
        assert!(n > 0, "{question:?}");

        run(&["--rows", "rows.csv"]);
        assert_eq!(
            std::fs::read_to_string(folder.path("rows.csv")).unwrap(),
            csv
        );
        run(&["--rows", "rows.npy"]);
        assert_eq!(
            n_of_npy(&std::fs::read(folder.path("rows.npy")).unwrap()),
            n
        );
        run(&["--rows", "rows.dat", "--rows-format", "npy"]);
        assert_eq!(
            std::fs::read(folder.path("rows.dat")).unwrap(),
            std::fs::read(folder.path("rows.npy")).unwrap()
        );
        let jsonl = run(&["--rows", "-", "--rows-format", "jsonl"]).stdout;
        assert_eq!(jsonl.lines().count(), n);
        for (line, row) in jsonl.lines().zip(lines) {
            let object: Value = serde_json::from_str(line).unwrap();
            for (column, field) in columns.split(',').zip(row.split(',')) {
                match &object[column] {
                    // Points have one name there.
                    Value::Null => assert!(column.len() == 2, "{line}"),
                    Value::String(text) => assert_eq!(text, field),
                    Value::Bool(is_so) => assert_eq!(u8::from(*is_so).to_string(), field),
                    number => assert_eq!(number.as_f64(), field.parse().ok(), "{line}"),
                }
            }
        }
        // The old names of one release.
        for old in ["--pairs", "--impacts"] {
            assert_eq!(run(&[old, "-"]).stdout, csv);
            let help = folder.run([question[0], "--help"]).printed();
            assert!(!help.contains(old), "{help}");
        }
        let both = folder.run(question.iter().chain(&["--rows", "-", "--json"]));
        assert!(
            both.misuse()
                .contains("--rows - both write to standard output")
        );
        let unknown = folder.run(question.iter().chain(&["--rows", "rows.txt"]));
        assert!(unknown.misuse().contains(".csv, .jsonl, .npy or .parquet"));
        let alone = folder.run(question.iter().chain(&["--rows-format", "csv"]));
        assert_eq!(alone.code, Some(2));
        let lost = ["--rows", question[1], "--rows-format", "csv"];
        let lost = folder.run(question.iter().chain(&lost)).misuse();
        assert!(lost.contains(&format!("--rows {} is the input", question[1])));
    }
    // The header of such a file comes first, and has the number of rows.
    let stream = ["--rows", "-", "--rows-format", "npy"];
    assert_eq!(
        folder.run(ANSWERS[0].0.iter().chain(&stream[..2])).code,
        Some(0)
    );
    let refused = folder.run(ANSWERS[4].0.iter().chain(&stream));
    assert!(refused.misuse().contains("name a file"));
}

/// The rows of a Parquet file as those of a CSV file, its header first.
#[cfg(feature = "parquet")]
pub fn csv_of_parquet(path: &std::path::Path) -> Vec<Vec<String>> {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    let schema = reader.metadata().file_metadata().schema_descr();
    let mut lines = vec![
        (0..schema.num_columns())
            .map(|ix| schema.column(ix).name().to_owned())
            .collect(),
    ];
    for row in reader.get_row_iter(None).unwrap() {
        let fields = row.unwrap().into_columns().into_iter();
        let text = |field| match field {
            Field::Null => String::new(),
            Field::Bool(is_so) => u8::from(is_so).to_string(),
            Field::UInt(n) => n.to_string(),
            Field::Long(n) => n.to_string(),
            // The text of such a number is that of the double.
            Field::Float(x) => format!("{:?}", f64::from(x)),
            Field::Double(x) => format!("{x:?}"),
            Field::Str(text) => text,
            other => panic!("{other:?}"),
        };
        lines.push(fields.map(|(_, field)| text(field)).collect());
    }
    lines
}

#[test]
#[cfg(feature = "parquet")]
fn every_answer_writes_parquet() {
    let folder = folder();
    for (question, _) in ANSWERS {
        let run = |rows: &str| {
            let run = folder.run(question.iter().chain(&["--rows", rows]));
            assert_eq!(run.code, Some(0), "{question:?}: {}", run.stderr);
            run.stdout
        };
        run("rows.parquet");
        let rows = csv_of_parquet(&folder.path("rows.parquet"));
        let csv: Vec<Vec<_>> = run("-")
            .lines()
            .map(|line| line.split(',').map(str::to_owned).collect())
            .collect();
        assert!(csv.len() > 1);
        assert_eq!(rows, csv, "{question:?}");
    }
    let stream = ["--rows", "-", "--rows-format", "parquet"];
    let refused = folder.run(ANSWERS[0].0.iter().chain(&stream));
    assert!(refused.misuse().contains("name a file"));
    // More rows than a group of the file has.
    let soup = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    folder.text(
        "soup.obj",
        &[&soup[..24], &"f 1 2 3\n".repeat(400)].concat(),
    );
    let many = ["self", "soup.obj", "--rows", "rows.parquet"];
    assert!(folder.run(many).code == Some(0));
    let rows = csv_of_parquet(&folder.path("rows.parquet"));
    assert_eq!(rows.len(), 1 + 400 * 399 / 2);
    assert_eq!(rows[79_800], ["0", "398", "0", "399"]);
}

#[test]
#[cfg(not(feature = "parquet"))]
fn parquet_is_a_feature() {
    let folder = folder();
    let run = folder.run(ANSWERS[0].0.iter().chain(&["--rows", "rows.parquet"]));
    assert!(run.misuse().contains("built without the feature parquet"));
}

#[test]
fn old_names_of_options_mean_the_same() {
    let folder = folder();
    for [new, old] in [["--exclude", "--ignore"], ["--precision", "--toi"]] {
        let value = if new == "--exclude" { "1,1" } else { "f64" };
        let ask = |option: &str| {
            let args = [
                "step",
                "a.ply",
                "f_002.ply",
                "b.ply",
                "b.ply",
                "--start",
                "report",
                "--rows",
                "-",
                option,
                value,
            ];
            folder.run(args).printed()
        };
        assert_eq!(ask(new), ask(old));
        for command in ["step", "pairs", "sequence"] {
            assert!(!folder.run([command, "--help"]).printed().contains(old));
        }
    }
}

#[test]
fn two_bodies_of_many() {
    let folder = folder();
    let ask = |more: &[&str]| {
        let args = ["pairs", "a.ply", "b.ply", "c.ply", "a.ply"];
        folder.run(args.iter().chain(more))
    };
    let all = ask(&["--rows", "-"]).printed();
    let two = ask(&["--rows", "-", "--between", "3,1"]).printed();
    let expected: Vec<&str> = all
        .lines()
        .filter(|row| row.starts_with("body") || (row.starts_with("1,") && row.contains(",3,")))
        .collect();
    assert!(expected.len() > 5);
    assert_eq!(two.lines().collect::<Vec<_>>(), expected);
    let last = "between meshes 3 and 1 of 4, 0 vertices welded, neighbours resolved; not asked: self-collision (--self), pairs of other \
                meshes\n";
    let text = ask(&["--between", "3,1"]).printed();
    assert!(text.ends_with(last), "{text}");
    for (more, said) in [
        (
            &["--between", "0,4"][..],
            "--between names body 4, but 4 bodies",
        ),
        (&["--between", "1,1"], "impinge self"),
        (&["--between", "0,1", "--self"], "cannot be used with"),
    ] {
        let misuse = ask(more).misuse();
        assert!(misuse.contains(said), "{misuse}");
    }
    let near = [
        "near",
        "a.ply",
        "b.ply",
        "c.ply",
        "--distance",
        "20",
        "--between",
        "0,2",
        "--rows",
        "-",
    ];
    let rows = folder.run(near).printed();
    assert!(rows.lines().count() > 1);
    assert!(rows.lines().skip(1).all(|row| {
        let fields: Vec<&str> = row.split(',').collect();
        let mut bodies = [fields[1], fields[3]];
        bodies.sort_unstable();
        bodies == ["0", "2"]
    }));
}

/// A thick body is near from farther away: its thickness adds to the distance, exactly.
#[test]
fn thickness_adds_to_the_distance() {
    let folder = Folder::new();
    let (low, high) = (cube([0.0; 3], 1.0), cube([0.0, 0.0, 2.0], 1.0));
    folder.ply("low.ply", &low);
    folder.ply("high.ply", &high);
    let n = |more: &[&str]| {
        let args = ["near", "low.ply", "high.ply", "--json", "--distance"];
        let answer = folder.run(args.iter().chain(more)).json();
        (answer["pairs"].clone(), answer["hash"].clone())
    };
    let reached = n(&["1"]);
    assert!(reached.0.as_u64() > Some(0));
    assert_eq!(n(&["0.5"]).0, 0);
    assert_eq!(n(&["0.5", "--thickness", "0,0.5"]), reached);
    assert_eq!(
        n(&["0", "--thickness", "0,0.75", "--thickness", "1,0.25"]),
        reached
    );
    assert_eq!(n(&["0.5", "--thickness", "1,0.4999"]).0, 0);
    let misuse = |value: &str| {
        let args = [
            "near",
            "low.ply",
            "high.ply",
            "--distance",
            "1",
            "--thickness",
            value,
        ];
        folder.run(args).misuse()
    };
    // The answer says how thick the bodies are.
    let args = ["near", "low.ply", "high.ply", "--thickness", "1,0.5"];
    let near = |more: &[&str]| folder.run(args.iter().chain(more));
    let answer = near(&["--distance", "0.5", "--json"]).json();
    assert_eq!(answer["bodies"][0]["thickness"], 0.0);
    assert_eq!(answer["bodies"][1]["thickness"], 0.5);
    let text = near(&["--distance", "0.5"]).printed();
    assert!(text.contains(" within 0.5 and the thickness ("), "{text}");
    let last = "\nbetween 2 meshes, thickness 0.5 of body 1, 0 vertices welded, ";
    assert!(text.contains(last), "{text}");
    let text = near(&["--distance", "0"]).printed();
    assert!(
        text.contains(": no pairs of elements within the thickness\n"),
        "{text}"
    );
    let twice = near(&["--distance", "1", "--thickness", "1,0"]).misuse();
    assert!(twice.contains("--thickness names body 1 twice"), "{twice}");
    let safe = [
        "safe",
        "low.ply",
        "high.ply",
        "--most",
        "1",
        "--thickness",
        "1,0.5",
    ];
    let answer = folder.run(safe.iter().chain(&["--json"])).json();
    assert_eq!(answer["bodies"][1]["thickness"], 0.5);
    let text = folder.run(safe).printed();
    assert!(text.contains(", thickness 0.5 of body 1, "), "{text}");
    assert!(misuse("2,1").contains("--thickness names body 2"));
    assert!(misuse("0,-1").contains("not below 0"));
    assert!(misuse("1").contains("a body's number and a length"));
}

/// Kinds of a step: the impacts of the others are left out, and the last line says so.
#[test]
fn kinds_of_a_step() {
    let folder = folder();
    let ask = |more: &[&str]| {
        let args = [
            "step",
            "a.ply",
            "f_002.ply",
            "b.ply",
            "b.ply",
            "--start",
            "report",
        ];
        folder.run(args.iter().chain(more))
    };
    let all = ask(&["--rows", "-"]).printed();
    let kept = ask(&["--rows", "-", "--kinds", "ee"]).printed();
    let of_kind: Vec<&str> = all.lines().filter(|row| !row.starts_with("vf,")).collect();
    assert!(of_kind.len() > 1 && of_kind.len() < all.lines().count());
    assert_eq!(kept.lines().collect::<Vec<_>>(), of_kind);
    let last = "between 2 meshes and within each, 0 vertices welded, neighbours left out; not asked: other kinds of pairs (--kinds), \
                whether the start intersects (--start verify)\n";
    let text = ask(&["--kinds", "ee"]).printed();
    assert!(text.ends_with(last), "{text}");
    assert!(
        ask(&["--kinds", "ef"])
            .misuse()
            .contains("only vf, ee, ev and vv")
    );
}

/// An answer that resolves neighbours in one line does not leave them out in another.
#[test]
fn the_last_line_says_what_was_asked() {
    let folder = folder();
    for (args, last) in [
        (
            &["near", "a.ply", "b.ply", "--distance", "1"][..],
            "between 2 meshes, 0 vertices welded, neighbours resolved where they intersect, else never near; not asked: \
             self-collision (--self)\n",
        ),
        (
            &["step", "a.ply", "a.ply", "c.ply", "c.ply"],
            "between 2 meshes and within each, 0 vertices welded, neighbours resolved at the start, else left out\n",
        ),
        (
            &[
                "step",
                "a.ply",
                "a.ply",
                "c.ply",
                "c.ply",
                "--no-self",
                "--earliest",
            ],
            "between 2 meshes, 0 vertices welded, neighbours resolved at the start, else left out; not asked: self-collision\n",
        ),
        (
            &["step", "a.ply", "a.ply", "--candidates", "boxes.csv"],
            "within 1 mesh, 0 vertices welded, neighbours left out\n",
        ),
    ] {
        let text = folder.run(args).printed();
        assert!(text.ends_with(last), "{args:?}: {text}");
        assert_eq!(text.matches("neighbours").count(), 1, "{text}");
    }
    let answer = folder
        .run(["near", "a.ply", "b.ply", "--distance", "1", "--json"])
        .json();
    assert_eq!(
        answer["asked"],
        serde_json::json!({ "between": true, "self": false, "shared_vertex": "resolve" })
    );
}
