//! `impinge check`: rows, tables, exit codes, and children that fail.

use serde_json::Value;

use crate::harness::{Folder, Run, csv_rows, keys};
use crate::schema::{schema, wrong};

/// A closed tetrahedron as OBJ, to which tests append.
const CLOSED: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

fn meshes() -> Folder {
    let folder = Folder::new();
    folder.text("closed.obj", CLOSED);
    let pierced = "v 0.2 0.2 -1\nv 0.3 0.2 -1\nv 0.2 0.2 1\nf 5 6 7\n";
    folder.text("pierced.obj", &format!("{CLOSED}{pierced}"));
    folder.text("open.obj", &CLOSED.replace("f 1 4 3\n", ""));
    folder.text("nan.obj", &CLOSED.replace("v 0 0 1", "v 0 0 nan"));
    folder.text("broken.obj", "v 0 0 0\nf 1 2 3\n");
    folder
}

/// The rows of a run in which every mesh could be checked.
fn rows(run: Run) -> Vec<Value> {
    assert_eq!(run.stderr, "");
    parsed(&run.printed())
}

fn parsed(text: &str) -> Vec<Value> {
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

/// What was printed by a run in which `n_unchecked` meshes could not be checked.
#[track_caller]
fn failed(run: Run, n_unchecked: usize, n: usize) -> String {
    let said = format!("impinge: {n_unchecked} of {n} meshes could not be checked\n");
    assert_eq!((run.code, run.stderr.as_str()), (Some(1), said.as_str()));
    run.stdout
}

#[test]
fn a_line_per_mesh_in_their_order() {
    let folder = meshes();
    let names = [
        "closed.obj",
        "missing.ply",
        "pierced.obj",
        "open.obj",
        "nan.obj",
        "broken.obj",
    ];
    let run = folder.run([&["check", "--json"], &names[..]].concat());
    let rows = parsed(&failed(run, 3, 6));
    assert_eq!(
        rows.iter()
            .map(|row| row["path"].as_str().unwrap())
            .collect::<Vec<_>>(),
        names
    );
    for key in [
        "path",
        "vertices",
        "triangles",
        "self_intersections",
        "degenerate",
        "duplicate_faces",
        "non_manifold_edges",
        "boundary_edges",
        "components",
        "error",
    ] {
        assert!(keys(&rows[0]).contains(&key), "{key}");
    }
    assert!(rows.iter().all(|row| keys(row) == keys(&rows[0])));
    assert_eq!(
        (&rows[0]["boundary_edges"], &rows[0]["error"]),
        (&0.into(), &Value::Null)
    );
    assert_eq!(rows[1]["error_kind"], "file");
    assert_eq!(rows[1]["triangles"], Value::Null);
    // Through the bottom, and through the slanted face.
    assert_eq!(
        (&rows[2]["self_intersections"], &rows[2]["components"]),
        (&2.into(), &2.into())
    );
    assert_eq!(
        (&rows[3]["boundary_edges"], &rows[3]["boundaries"]),
        (&3.into(), &1.into())
    );
    assert_eq!(rows[4]["error_kind"], "not_finite");
    assert_eq!(rows[5]["error_kind"], "file");
}

#[test]
fn a_table_and_what_it_sums_up_to() {
    let folder = meshes();
    let run = folder.run(["check", "closed.obj", "pierced.obj", "nan.obj"]);
    let text = failed(run, 1, 3);
    assert!(
        text.contains("pierced.obj") && text.contains("self-int."),
        "{text}"
    );
    let last = text.lines().rev().nth(1).unwrap();
    assert_eq!(
        last,
        "3 meshes: 1 without any finding, 1 with self-intersections, 1 with an open border, \
         1 with an error (1 not finite)"
    );
    for (names, last) in [
        (&["closed.obj"][..], "1 mesh: clean"),
        (&["closed.obj", "closed.obj"], "2 meshes: all clean"),
    ] {
        let text = folder.run([&["check"], names].concat()).printed();
        assert_eq!(text.lines().last(), Some(last));
    }
}

#[test]
fn exit_codes_are_chosen() {
    let folder = meshes();
    let code = |args: &[&str]| folder.run([&["check"], args].concat()).code;
    assert_eq!(code(&["pierced.obj"]), Some(0));
    assert_eq!(code(&["pierced.obj", "missing.ply"]), Some(1));
    assert_eq!(code(&["closed.obj", "missing.ply", "broken.obj"]), Some(1));
    assert_eq!(code(&["closed.obj", "--fail-on", "any"]), Some(0));
    assert_eq!(
        code(&["open.obj", "--fail-on", "self-intersections,degenerate"]),
        Some(0)
    );
    assert_eq!(
        code(&["open.obj", "--fail-on", "degenerate,boundary"]),
        Some(3)
    );
    assert_eq!(code(&["nan.obj", "--fail-on", "nan"]), Some(3));
    assert_eq!(code(&["missing.ply", "--fail-on", "nan"]), Some(1));
    assert_eq!(code(&["missing.ply", "--fail-on", "error"]), Some(3));
    assert_eq!(
        code(&["closed.obj", "--rank", "2", "--world-size", "2"]),
        Some(2)
    );
    assert_eq!(code(&[]), Some(2));
    let run = folder.run(["check", "pierced.obj", "--fail-on", "any"]);
    let said = "impinge: 1 of 1 meshes failed: 1 with self-intersections, 1 with an open border\n";
    assert_eq!(run.stderr, said);
    let args = [
        "check",
        "pierced.obj",
        "missing.ply",
        "closed.obj",
        "--fail-on",
        "boundary",
    ];
    let run = folder.run(args);
    let said = "impinge: 2 of 3 meshes failed: 1 with an open border, 1 could not be checked\n";
    assert_eq!((run.code, run.stderr.as_str()), (Some(3), said));
}

#[test]
fn a_list_may_have_comments() {
    let folder = meshes();
    let list =
        "# parts of the machine\n\nclosed.obj\r\n  # not this one: missing.ply\n \t\nopen.obj\n";
    folder.text("list.txt", list);
    let rows = rows(folder.run(["check", "--json", "--list", "list.txt"]));
    let paths: Vec<&str> = rows
        .iter()
        .map(|row| row["path"].as_str().unwrap())
        .collect();
    assert_eq!(paths, ["closed.obj", "open.obj"]);
    // A byte order mark is no part of the first name.
    folder.text("list.txt", "\u{feff}closed.obj\n");
    let marked = self::rows(folder.run(["check", "--json", "--list", "list.txt"]));
    assert_eq!(marked[0], rows[0]);
}

#[test]
fn vertices_stay_apart_where_asked() {
    let folder = meshes();
    let soup = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\nf 5 4 6\n";
    folder.text("soup.obj", soup);
    let welded = &rows(folder.run(["check", "--json", "soup.obj"]))[0];
    assert_eq!(
        (&welded["welded"], &welded["vertices_welded"]),
        (&true.into(), &2.into())
    );
    assert_eq!(welded["self_intersections"], 0);
    let apart = &rows(folder.run(["check", "--json", "--no-weld", "soup.obj"]))[0];
    assert_eq!(
        (&apart["welded"], &apart["vertices_welded"]),
        (&false.into(), &0.into())
    );
    assert_eq!(apart["self_intersections"], 1);
}

fn read(folder: &Folder, name: &str) -> String {
    std::fs::read_to_string(folder.path(name)).unwrap()
}

#[test]
fn ranks_make_the_rows_of_one_process_and_a_run_goes_on() {
    let folder = meshes();
    let names = [
        "closed.obj",
        "missing.ply",
        "pierced.obj",
        "open.obj",
        "nan.obj",
    ];
    folder.text("list.txt", &(names.join("\n") + "\n"));
    // Two of the five meshes can't be checked.
    let args = ["check", "--json", "--list", "list.txt", "--out", "one"];
    let one = failed(folder.run(args), 2, 5);
    assert_eq!(read(&folder, "one/rows-00000000.jsonl"), one);
    let mut all = String::new();
    // The two that can't be checked are of rank 0.
    for (rank, code) in [("0", 1), ("1", 0)] {
        let args = [
            "check", "--json", "--list", "list.txt", "--out", "two", "--batch", "2",
        ];
        let of_rank = ["--rank", rank, "--world-size", "2"];
        let run = folder.run(args.into_iter().chain(of_rank));
        assert_eq!(run.code, Some(code), "{}", run.stderr);
    }
    for batch in 0..3 {
        all += &read(&folder, &format!("two/rows-{batch:08}.jsonl"));
    }
    assert_eq!(all, one);
    // Existing rows are not made again: this mesh would have another row now.
    folder.old_text("open.obj", CLOSED);
    assert_eq!(failed(folder.run(args), 2, 5), one);
    let first_two: String = one
        .lines()
        .take(2)
        .map(|line| format!("{line}\n"))
        .collect();
    folder.text("one/rows-00000000.jsonl", &first_two);
    assert_ne!(failed(folder.run(args), 2, 5), one);
    // Rows of another list are refused.
    let error = folder.run(["check", "pierced.obj", "--out", "one"]).error();
    assert!(
        error.contains("rows-00000000.jsonl:1") && error.contains("not of this run"),
        "{error}"
    );
}

#[test]
fn what_is_wrong_is_shown_in_colours() {
    let folder = meshes();
    let text = folder
        .run(["check", "pierced.obj", "--out", "wrong.glb"])
        .printed();
    assert!(text.contains("red self-intersection"), "{text}");
    assert!(
        std::fs::read(folder.path("wrong.glb"))
            .unwrap()
            .starts_with(b"glTF")
    );
    folder
        .run(["check", "pierced.obj", "--out", "wrong.ply", "--json"])
        .printed();
    let ply = std::fs::read(folder.path("wrong.ply")).unwrap();
    assert!(
        ply.windows(3).any(|color| color == [214, 39, 40]),
        "some face is red"
    );
}

#[test]
fn a_mesh_that_takes_too_long_is_a_row() {
    let folder = meshes();
    // No child answers in a microsecond.
    let run = folder.run([
        "check",
        "--json",
        "closed.obj",
        "open.obj",
        "--timeout",
        "0.000001",
    ]);
    let rows = parsed(&failed(run, 2, 2));
    assert_eq!(rows[0]["error_kind"], "timeout");
    assert_eq!(rows[1]["error"], "took longer than 0.000001 s");
}

#[cfg(target_os = "linux")]
#[test]
fn a_mesh_that_is_too_large_is_a_row() {
    let folder = meshes();
    // A sparse file of three gigabytes takes no room on the disk.
    let sparse = std::fs::File::create(folder.path("large.stl")).unwrap();
    sparse.set_len(3 << 30).unwrap();
    let args = [
        "check",
        "--json",
        "large.stl",
        "closed.obj",
        "--memory",
        "2G",
        "--jobs",
        "1",
    ];
    let rows = parsed(&failed(folder.run(args), 1, 2));
    assert_eq!(rows[0]["error_kind"], "memory", "{}", rows[0]);
    assert_eq!(
        rows[0]["error"],
        "it needs more memory than --memory allows, 2,147,483,648 bytes: give more, or leave the limit out"
    );
    assert_eq!(rows[1]["error"], Value::Null);
    let none = folder
        .run(["check", "closed.obj", "--memory", "0"])
        .misuse();
    assert!(none.contains("above 0, such as 4G"), "{none}");
}

#[cfg(target_os = "linux")]
#[test]
fn names_of_files_need_not_be_utf8() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = meshes();
    let name = |end: &str| [&b"part\xff"[..], end.as_bytes()].concat();
    let path = |end| folder.path("").join(OsStr::from_bytes(&name(end)));
    std::fs::copy(folder.path("closed.obj"), path(".obj")).unwrap();
    let list = [&name(".obj")[..], b"\nclosed.obj\n"].concat();
    std::fs::write(folder.path("list.txt"), list).unwrap();
    let rows = rows(folder.run(["check", "--json", "--list", "list.txt"]));
    assert_eq!(rows[0]["path"], "part\u{fffd}.obj");
    assert_eq!(rows[0]["hash"], rows[1]["hash"]);
    for (command, option, end) in [
        ("check", "--html", ".html"),
        ("check", "--rows", ".csv"),
        ("fix", "--out", ".ply"),
        ("self", "--out", ".glb"),
        ("self", "--png", ".png"),
    ] {
        let (mesh, out) = (name(".obj"), name(end));
        let args = [command.as_bytes(), &mesh, option.as_bytes(), &out];
        folder.run(args.map(OsStr::from_bytes)).printed();
        assert!(path(end).exists(), "{command} {option}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_child_answers_until_its_input_ends() {
    use std::io::{BufRead, BufReader, Write};
    use std::process::Stdio;
    let folder = meshes();
    let mut command = folder.command(["check-worker"]);
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut answers = BufReader::new(child.stdout.take().unwrap()).lines();
    writeln!(input, "\"closed.obj\"").unwrap();
    let row: Value = serde_json::from_str(&answers.next().unwrap().unwrap()).unwrap();
    assert_eq!(row["triangles"], 4);
    writeln!(input, "\"missing.ply\"").unwrap();
    let row: Value = serde_json::from_str(&answers.next().unwrap().unwrap()).unwrap();
    assert_eq!(row["error_kind"], "file");
    drop(input);
    assert!(child.wait().unwrap().success());
}

#[test]
fn one_bad_file_of_many_does_not_keep_the_others_from_an_answer() {
    let folder = meshes();
    let names = ["closed.obj", "broken.obj", "pierced.obj"];
    let run = folder.run([&["self", "--fail-on-hit"], &names[..]].concat());
    assert_eq!(run.code, Some(3));
    assert!(
        run.stdout
            .starts_with("closed.obj and pierced.obj: 2 pairs of 9 triangles"),
        "{}",
        run.stdout
    );
    assert!(
        run.stdout.contains("pierced.obj with itself"),
        "{}",
        run.stdout
    );
    assert!(
        run.stderr.contains("not read: broken.obj"),
        "{}",
        run.stderr
    );
    let last = "impinge: pairs were found; 1 of 3 meshes could not be read";
    assert_eq!(run.stderr.lines().last(), Some(last));

    // Bodies keep their numbers.
    let run = folder.run([&["self", "--json", "--rows", "rows.csv"], &names[..]].concat());
    assert_eq!(run.code, Some(1));
    let object: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(wrong(&schema("answer"), &object, "$"), [""; 0]);
    assert_eq!(object["unread"][0]["body"], 1);
    assert_eq!(object["regions"][0]["bodies"], serde_json::json!([2, 2]));
    let rows = csv_rows(&folder.path("rows.csv"));
    assert!(rows.len() == 2 && rows.iter().all(|row| row[0] == 2 && row[2] == 2));

    for how in ["--count", "--any"] {
        let run = folder.run([&["self", how, "--json"], &names[..]].concat());
        assert_eq!(run.code, Some(1));
        let object: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(object["unread"][0]["name"], "broken.obj");
    }
    // The pairs between meshes are an answer about all of them.
    assert!(
        folder
            .run(["pairs", "closed.obj", "broken.obj", "pierced.obj"])
            .error()
            .contains("broken.obj")
    );
    let run = folder.run(["self", "broken.obj", "missing.ply", "--json"]);
    assert!(run.error().contains("none of 2 meshes could be read"));
    assert!(
        folder
            .run(["self", "missing.ply"])
            .error()
            .contains("missing.ply")
    );
}

/// The files of a report with a mesh of each sort, under names that have to be escaped.
fn reported(args: &[&str]) -> Run {
    let folder = meshes();
    let crossing = std::fs::read_to_string(folder.path("pierced.obj")).unwrap();
    folder.text("a b,<&>%:1.obj", &crossing);
    let names = ["closed.obj", "a b,<&>%:1.obj", "nan.obj", "missing.ply"];
    folder.run([&["check"], args, &names[..]].concat())
}

#[test]
fn sarif_has_what_the_standard_requires() {
    let run = reported(&["--format", "sarif", "--fail-on", "self-intersections"]);
    assert_eq!(run.code, Some(3));
    let log: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(log["version"], "2.1.0");
    assert!(log["$schema"].as_str().unwrap().contains("sarif-2.1.0"));
    let [one] = &log["runs"].as_array().unwrap()[..] else {
        panic!("one run")
    };
    let driver = &one["tool"]["driver"];
    assert_eq!(driver["name"], "impinge check");
    let rules = driver["rules"].as_array().unwrap();
    let results = one["results"].as_array().unwrap();
    let mut found = Vec::new();
    for result in results {
        // Section 3.27 of the standard: a message, a level of four, a rule that is there, a
        // location with a URI.
        assert!(!result["message"]["text"].as_str().unwrap().is_empty());
        let rule = &rules[result["ruleIndex"].as_u64().unwrap() as usize];
        assert_eq!(rule["id"], result["ruleId"]);
        assert!(rule["shortDescription"]["text"].is_string());
        let at = &result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"];
        let uri = at.as_str().unwrap();

        let level = result["level"].as_str().unwrap();
        assert!(["none", "note", "warning", "error"].contains(&level));
        found.push((uri, result["ruleId"].as_str().unwrap(), level));
    }
    let name = "a%20b%2C%3C%26%3E%25%3A1.obj";
    let expected = [
        (name, "self-intersections", "error"),
        (name, "boundary", "warning"),
        ("nan.obj", "nan", "error"),
        ("missing.ply", "error", "error"),
    ];
    assert_eq!(found, expected);
    let place = &results[0]["properties"]["places"][0];
    assert_eq!(place["problem"], "self-intersections");
}

#[test]
fn junit_is_xml_with_the_numbers_that_it_announces() {
    use quick_xml::events::Event;
    for (fail_on, n_cases, n_failures) in [(&[][..], 16, 2), (&["--fail-on", "boundary"], 4, 1)] {
        let run = reported(&[&["--format", "junit"], fail_on].concat());
        let mut reader = quick_xml::Reader::from_str(&run.stdout);
        let mut counts = std::collections::BTreeMap::<String, u64>::new();
        let mut announced = Vec::new();
        let mut names = std::collections::BTreeSet::new();
        loop {
            match reader.read_event().unwrap() {
                Event::Eof => break,
                Event::Start(tag) | Event::Empty(tag) => {
                    let name = tag.name().as_ref().to_owned();
                    for attribute in tag.attributes() {
                        let attribute = attribute.unwrap();
                        let value = attribute.value.to_string();
                        if name == "testsuite" && attribute.key.as_ref() != "name" {
                            announced.push(value.parse::<u64>().unwrap());
                        } else if attribute.key.as_ref() == "classname" {
                            names.insert(value);
                        }
                    }
                    *counts.entry(name).or_default() += 1;
                }
                _ => {}
            }
        }
        assert_eq!(announced, [n_cases, n_failures, 2]);
        let counted = ["testcase", "failure", "error"].map(|name| counts[name]);
        assert_eq!(counted, [n_cases, n_failures, 2]);
        assert!(names.contains("a b,&lt;&amp;&gt;%:1.obj"), "{names:?}");
    }
}

#[test]
fn rows_are_a_table_with_a_row_per_mesh() {
    let folder = meshes();
    folder.text("a, \"b\".obj", CLOSED);
    let names = ["closed.obj", "a, \"b\".obj", "pierced.obj", "nan.obj"];
    let run = |rows: &str| folder.run([&["check"], &names[..], &["--rows", rows]].concat());
    failed(run("rows.csv"), 1, 4);
    let csv = std::fs::read_to_string(folder.path("rows.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 5, "{csv}");
    assert!(lines[0].starts_with("path,welded,vertices,vertices_welded,triangles,"));
    assert!(lines[0].ends_with(",min_thickness,thin_faces,thinnest,error,error_kind"));
    assert!(lines[1].starts_with("closed.obj,1,4,0,4,0,0,0,0000000000000000,0,"));
    assert!(lines[2].starts_with("\"a, \"\"b\"\".obj\",1,4,0,4,0,0,"));
    assert!(lines[4].starts_with("nan.obj,1,,,,,,,,") && lines[4].ends_with(",not_finite"));
    // The same objects as those of --json, without places.
    failed(run("rows.jsonl"), 1, 4);
    let table = parsed(&std::fs::read_to_string(folder.path("rows.jsonl")).unwrap());
    let json = parsed(&failed(
        folder.run([&["check", "--json"], &names[..]].concat()),
        1,
        4,
    ));
    for (row, object) in table.iter().zip(&json) {
        for (key, value) in object.as_object().unwrap() {
            assert!(
                key == "places" || row[key] == *value,
                "{key}: {row} {object}"
            );
        }
    }
    #[cfg(feature = "parquet")]
    {
        failed(run("rows.parquet"), 1, 4);
        let rows = crate::rows::csv_of_parquet(&folder.path("rows.parquet"));
        assert_eq!(rows[0].join(","), lines[0]);
        assert_eq!(rows[1].join(","), lines[1]);
        assert_eq!(rows[2][0], names[1]);
        assert_eq!(rows[4].last().unwrap(), "not_finite");
    }
    assert!(run("rows.npy").misuse().contains("arrays do not"));
    assert!(run("-").misuse().contains("name a file, or use --json"));
    folder.text("list.csv", "closed.obj\n");
    let lost = folder.run(["check", "--list", "list.csv", "--rows", "list.csv"]);
    assert!(lost.misuse().contains("would be lost"));
}

#[test]
fn a_summary_is_appended_in_markdown() {
    let folder = meshes();
    let args = [
        "check",
        "closed.obj",
        "pierced.obj",
        "nan.obj",
        "--summary",
        "s.md",
    ];
    failed(folder.run(args), 1, 3);
    let text = std::fs::read_to_string(folder.path("s.md")).unwrap();
    assert!(text.starts_with(
        "### impinge check\n\n1 of 3 meshes could not be checked\n\n| mesh | elements |"
    ));
    assert!(
        text.contains("\n| pierced.obj | 5 | 2 | 0 | 0 | 0 | 0 | 3 | 2 |\n\n- nan.obj:4: "),
        "{text}"
    );
    folder
        .run(["check", "closed.obj", "--summary", "s.md"])
        .printed();
    let longer = std::fs::read_to_string(folder.path("s.md")).unwrap();
    assert_eq!(longer, text + "### impinge check\n\n1 mesh: clean\n\n\n");
}

#[test]
fn github_gets_one_annotation_per_finding() {
    let run = reported(&["--format", "github", "--fail-on", "boundary"]);
    let lines: Vec<&str> = run.stdout.lines().collect();
    let n_annotations = lines.iter().filter(|line| line.starts_with("::")).count();
    assert_eq!(n_annotations, 4, "{}", run.stdout);
    // The text follows.
    assert!(lines[4].starts_with("mesh  "), "{}", lines[4]);
    assert!(
        lines.last().unwrap().starts_with("4 meshes: "),
        "{}",
        run.stdout
    );
    let start = "::warning file=a b%2C<&>%25%3A1.obj,title=self-intersections::2 pairs of elements intersect, near (";
    assert!(lines[0].starts_with(start), "{}", lines[0]);
    assert!(lines[1].starts_with("::error file=a b%2C"), "{}", lines[1]);
    assert!(lines[3].starts_with("::error file=missing.ply,title=an error::missing.ply: "));
    reported(&["--format", "github", "--json"]).misuse();
}

#[test]
fn the_last_line_names_the_command_that_helps() {
    let folder = meshes();
    folder.text(
        "crossing only.obj",
        &std::fs::read_to_string(folder.path("pierced.obj")).unwrap(),
    );
    folder.text("twice.obj", &format!("{CLOSED}f 1 2 4\n"));
    folder.text(
        "inward.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n",
    );
    let last = |name: &str| -> String {
        let text = folder.run(["check", name]).printed();
        text.lines().last().unwrap().to_owned()
    };
    assert_eq!(last("closed.obj"), "1 mesh: clean");
    assert_eq!(
        last("crossing only.obj"),
        "next: impinge render 'crossing only.obj' --png where.png"
    );
    assert_eq!(
        last("twice.obj"),
        "next: impinge fix twice.obj --out twice-mended.ply"
    );
    assert_eq!(
        last("inward.obj"),
        "next: impinge fix inward.obj --out inward-mended.ply"
    );
    // It does help.
    for name in ["twice", "inward"] {
        let (from, to) = (format!("{name}.obj"), format!("{name}-mended.ply"));
        folder.run(["fix", &from, "--out", &to]).printed();
        assert_eq!(last(&to), "1 mesh: clean");
    }
    let run = folder
        .run(["check", "open.obj", "--json", "--faces", "--places", "1"])
        .json();
    assert_eq!(run["places"][0]["elements"], serde_json::json!([0, 1, 2]));
    assert_eq!(
        (&run["watertight"], &run["euler"]),
        (&serde_json::json!(false), &serde_json::json!(1))
    );
}

#[test]
fn the_page_stands_alone_and_its_pictures_are_pictures() {
    let folder = meshes();
    let crossing = std::fs::read_to_string(folder.path("pierced.obj")).unwrap();
    folder.text("a <b> & 'c'.obj", &crossing);
    let args = [
        "check",
        "closed.obj",
        "a <b> & 'c'.obj",
        "nan.obj",
        "--html",
        "report.html",
    ];
    let text = failed(folder.run(args), 1, 3);
    assert!(text.ends_with("\nwrote report.html\n"), "{text}");
    let page = std::fs::read_to_string(folder.path("report.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    // Nothing is loaded from elsewhere.
    for outside in ["http://", "https://", "src=\"/", "href="] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(page.contains("a &lt;b&gt; &amp; &#39;c&#39;.obj") && !page.contains("a <b>"));
    let body = &page[page.find("<tbody>").unwrap()..];
    let rows: Vec<&str> = body.split("<tr>").skip(1).collect();
    let n_pictures: Vec<usize> = rows
        .iter()
        .map(|row| row.matches("<img ").count())
        .collect();
    // The crossing triangles are in two places, and the needle has a border.
    assert_eq!(n_pictures, [1, 4, 0]);
    assert!(rows[2].contains("class=\"error\">") && rows[2].contains("nan.obj"));
    let cells: Vec<usize> = rows.iter().map(|row| row.matches("<td").count()).collect();
    assert_eq!(cells, [11; 3]);
    assert!(rows[1].contains("data-label=\"self-int.\" data-v=\"2\" class=\"bad\">2</td>"));
    // Every picture is a PNG of the announced size; that of the sound mesh has no red in it, that
    // of the pierced one has.
    let mut reds = Vec::new();
    for part in page.split("data:image/png;base64,").skip(1) {
        let text = &part[..part.find('"').unwrap()];
        let png = decoded(text);
        let mut reader = png::Decoder::new(std::io::Cursor::new(png))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (240, 180));
        let is_red = |p: &[u8]| i32::from(p[0]) > i32::from(p[1]) + 60;
        reds.push(pixels.chunks(3).filter(|p| is_red(p)).count() > 50);
    }
    assert_eq!(reds[..2], [false, true]);
    // The view has every face of both meshes; faces with a finding come last.
    let meshes: Vec<&str> = page
        .split("<script type=\"application/octet-stream\" ")
        .skip(1)
        .collect();
    let number = |text: &str, name: &str| -> usize {
        let from = text.find(&format!("{name}=\"")).unwrap() + name.len() + 2;
        text[from..].split('"').next().unwrap().parse().unwrap()
    };
    let counts = meshes.iter().map(|text| {
        let [points, fine, found, all] =
            ["data-points", "data-fine", "data-found", "data-all"].map(|name| number(text, name));
        let (from, to) = (text.find('>').unwrap() + 1, text.find('<').unwrap());
        assert_eq!(decoded(&text[from..to]).len(), 12 * points + 13 * all);
        assert_eq!(fine + found, all);
        [points, fine, found]
    });
    assert_eq!(counts.collect::<Vec<_>>(), [[4, 4, 0], [7, 2, 3]]);
    folder
        .run(["check", "closed.obj", "--html", "report.txt"])
        .misuse();
}

#[test]
fn pictures_need_no_other_check_and_keep_its_limits() {
    let folder = meshes();
    let names = ["closed.obj", "pierced.obj", "nan.obj"];
    let html = |page: &str, more: &[&str]| {
        let args = [&["check", "--html", page][..], more, &names].concat();
        failed(folder.run(args), 1, 3);
        read(&folder, page)
    };
    // A run that goes on with kept rows draws what it would have drawn at once.
    let fresh = html("fresh.html", &[]);
    assert_eq!(fresh.matches("<img ").count(), 1 + 4);
    failed(
        folder.run([&["check", "--out", "rows"][..], &names].concat()),
        1,
        3,
    );
    assert_eq!(html("kept.html", &["--out", "rows"]), fresh);
    // Now each of 20,000 triangles crosses all others: no check of them ends soon.
    let mut soup = String::new();
    for ix in 0..20_000 {
        let angle = f64::from(ix) * 1e-4;
        let (x, y) = (angle.cos(), angle.sin());
        soup += &format!("v {x} {y} -1\nv {} {} -1\nv 0 0 1\n", -x, -y);
        soup += &format!("f {} {} {}\n", 3 * ix + 1, 3 * ix + 2, 3 * ix + 3);
    }
    folder.old_text("pierced.obj", &soup);
    let args = ["--out", "rows", "--timeout", "1", "--html", "late.html"];
    let mut child = folder
        .command([&["check"][..], &args, &names].concat())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let started = std::time::Instant::now();
    while child.try_wait().unwrap().is_none() {
        if started.elapsed().as_secs() > 60 {
            child.kill().unwrap();
            panic!("the pictures know no limit");
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let late = read(&folder, "late.html");
    assert_eq!(late.matches("<img ").count(), 1);
    assert_eq!(late.matches("no picture: ").count(), 1);
    // What a file shows is what its row says, or nothing.
    folder.old_text("pierced.obj", CLOSED);
    let changed = html("changed.html", &["--out", "rows"]);
    assert_eq!(changed, late);
}

#[test]
fn a_mesh_that_was_written_after_its_row_is_checked_again() {
    let folder = meshes();
    let kept = ["check", "--out", "rows", "--json", "a.obj", "closed.obj"];
    let n_self = |text: String| -> Vec<Value> {
        let rows = text.lines().map(|line| serde_json::from_str(line).unwrap());
        rows.map(|row: Value| row["self_intersections"].clone())
            .collect()
    };
    folder.text("a.obj", CLOSED);
    assert_eq!(n_self(folder.run(kept).printed()), [0, 0]);
    std::fs::copy(folder.path("pierced.obj"), folder.path("a.obj")).unwrap();
    let found = n_self(folder.run(kept).printed());
    assert_eq!(
        found,
        n_self(
            folder
                .run(["check", "--json", "pierced.obj", "closed.obj"])
                .printed()
        )
    );
    assert_ne!(found[0], 0);
}

#[test]
fn no_output_of_check_is_an_input_or_another_output() {
    let folder = meshes();
    let text = read(&folder, "closed.obj");
    folder.text("list.txt", "closed.obj\n");
    for (args, said) in [
        (
            &["closed.obj", "--summary", "closed.obj"][..],
            "is the input closed.obj",
        ),
        (
            &["--list", "list.txt", "--summary", "list.txt"],
            "is the input list.txt",
        ),
        (
            &["closed.obj", "--rows", "q.csv", "--summary", "./q.csv"],
            "is also the file of --rows",
        ),
    ] {
        let said_here = folder.run([&["check"][..], args].concat()).misuse();
        assert!(said_here.contains(said), "{said_here}");
    }
    assert_eq!(read(&folder, "closed.obj"), text);
    assert_eq!(read(&folder, "list.txt"), "closed.obj\n");
    assert!(!folder.path("q.csv").exists());
}

/// The bytes of a base64 text.
fn decoded(text: &str) -> Vec<u8> {
    const DIGITS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits: Vec<u32> = text
        .chars()
        .filter_map(|c| DIGITS.find(c).map(|ix| ix as u32))
        .collect();
    let bytes = digits.chunks(4).flat_map(|four| {
        let bits = four.iter().fold(0, |bits, digit| bits << 6 | digit) << (6 * (4 - four.len()));
        (0..four.len() - 1).map(move |ix| (bits >> (16 - 8 * ix)) as u8)
    });
    bytes.collect()
}

#[test]
fn thin_walls_are_found_where_asked() {
    let folder = meshes();
    let mut plate = String::new();
    for ix in 0..8 {
        let at = [4, 2, 1].map(|bit| u8::from(ix & bit != 0));
        plate += &format!("v {} {} {}\n", at[0], at[1], 0.125 * f64::from(at[2]));
    }
    for [a, b, c] in [
        [1, 2, 4],
        [1, 4, 3],
        [5, 7, 8],
        [5, 8, 6],
        [1, 5, 6],
        [1, 6, 2],
        [3, 4, 8],
        [3, 8, 7],
        [1, 3, 7],
        [1, 7, 5],
        [2, 6, 8],
        [2, 8, 4],
    ] {
        plate += &format!("f {a} {b} {c}\n");
    }
    folder.text("plate.obj", &plate);
    let schema = schema("check");
    for (most, thin, thinnest) in [("0.2", 4, Some(0.125)), ("0.1", 0, None)] {
        let args = ["check", "plate.obj", "--json", "--min-thickness", most];
        let row = &rows(folder.run(args))[0];
        assert_eq!(wrong(&schema, row, "row"), Vec::<String>::new());
        assert_eq!(row["thin_faces"], thin);
        assert_eq!(row["thinnest"].as_f64(), thinnest);
    }
    let args = [
        "check",
        "plate.obj",
        "--min-thickness",
        "0.2",
        "--fail-on",
        "thin",
    ];
    let run = folder.run(args);
    assert_eq!(run.code, Some(3));
    assert_eq!(
        run.stderr,
        "impinge: 1 of 1 meshes failed: 1 with thin walls\n"
    );
    assert!(
        run.stdout
            .contains("plate.obj: the thinnest wall is 0.125\n")
    );
    let run = folder.run(["check", "open.obj", "--min-thickness", "0.2"]);
    assert!(
        run.stdout.lines().nth(1).unwrap().ends_with('-'),
        "{}",
        run.stdout
    );
    assert_eq!(
        folder.run(["check", "plate.obj", "--fail-on", "thin"]).code,
        Some(2)
    );
    assert_eq!(
        folder
            .run(["check", "plate.obj", "--min-thickness", "-1"])
            .code,
        Some(2)
    );
}

/// A cube of a size, as a group.
fn cube(name: &str, low: [f64; 3], size: f64, first: usize) -> String {
    let mut text = format!("g {name}\n");
    for ix in 0..8 {
        let at = [4, 2, 1].map(|bit| if ix & bit == 0 { 0.0 } else { size });
        text += &format!(
            "v {} {} {}\n",
            low[0] + at[0],
            low[1] + at[1],
            low[2] + at[2]
        );
    }
    for [a, b, c] in [
        [1, 2, 4],
        [1, 4, 3],
        [5, 8, 6],
        [5, 7, 8],
        [1, 5, 6],
        [1, 6, 2],
        [3, 4, 8],
        [3, 8, 7],
        [1, 3, 7],
        [1, 7, 5],
        [2, 6, 8],
        [2, 8, 4],
    ] {
        text += &format!("f {} {} {}\n", a + first, b + first, c + first);
    }
    text
}

#[test]
fn parts_of_an_assembly_are_compared() {
    let folder = meshes();
    let parts = [
        cube("block", [0.0; 3], 4.0, 0),
        cube("beside", [4.0, 0.0, 0.0], 4.0, 8),
        cube("within", [1.0; 3], 2.0, 16),
        cube("through", [7.0, 1.0, 1.0], 2.0, 24),
        cube("near", [9.25, 1.0, 1.0], 2.0, 32),
    ];
    folder.text("machine.obj", &parts.concat());
    let schema = schema("assembly");
    let ask = |more: &[&str]| {
        let run = folder.run([&["check", "--assembly", "--json", "machine.obj"], more].concat());
        let answer: Value = serde_json::from_str(&run.printed()).unwrap();
        assert_eq!(wrong(&schema, &answer, "answer"), Vec::<String>::new());
        answer
    };
    let answer = ask(&[]);
    assert_eq!(
        answer["matrix"],
        serde_json::json!(["-tO..", "t-.X.", "I.-..", ".X.-.", "....-"])
    );
    assert_eq!(answer["parts"][2]["name"], "within");
    let answer = ask(&["--clearance", "0.25", "--touching", "ignore"]);
    assert_eq!(
        answer["matrix"],
        serde_json::json!(["-.O..", ".-.X.", "I.-..", ".X.-n", "...n-"])
    );
    assert_eq!(answer["pairs"][2]["distance"], 0.25);
    assert_eq!(ask(&["--clearance", "0.24"])["matrix"][4], "....-");
    let text = folder
        .run([
            "check",
            "--assembly",
            "machine.obj",
            "--html",
            "report.html",
        ])
        .printed();
    let last = "5 parts: 2 pairs share space, 1 only touches";
    assert_eq!(text.lines().last(), Some(last), "{text}");
    assert!(text.starts_with("wrote report.html\n"), "{text}");
    assert!(
        text.contains("within is inside block, 1 from the surface"),
        "{text}"
    );
    let page = read(&folder, "report.html");
    assert!(page.contains("through") && page.contains(last), "{page}");
    // All parts are in the view, and each place names its two.
    assert!(page.contains(" data-parts=\"12,24,36,48,60\" "), "{page}");
    for pair in &ask(&[])["pairs"].as_array().unwrap()[..] {
        let place = format!(
            "<button class=\"see place\" data-parts=\"{},{}\" ",
            pair["parts"][0], pair["parts"][1]
        );
        assert_eq!(page.matches(&place).count(), 1, "{place}");
    }
    // Of two boxes of a part one is inside another part.
    let two = [
        cube("two", [1.0; 3], 1.0, 0),
        cube("", [9.0; 3], 1.0, 8).replace("g \n", ""),
        cube("block", [0.0; 3], 4.0, 16),
    ];
    folder.text("two.obj", &two.concat());
    let arguments = ["check", "--assembly", "two.obj"];
    let text = folder.run(arguments).printed();
    assert!(
        text.contains("two is partly inside block, 1 from the surface"),
        "{text}"
    );
    let run = folder.run([&arguments[..], &["--json"]].concat());
    let answer: Value = serde_json::from_str(&run.printed()).unwrap();
    assert_eq!(wrong(&schema, &answer, "answer"), Vec::<String>::new());
    assert_eq!(answer["pairs"][0]["relation"], "partly-inside");
    assert_eq!(answer["matrix"], serde_json::json!(["-i", "o-"]));
    let failing = folder.run([&arguments[..], &["--fail-on", "interpenetrating"]].concat());
    assert_eq!(failing.code, Some(3));
    // Several files are parts, too; --clearance alone says so.
    folder.text("left.obj", &cube("one", [0.0; 3], 1.0, 0));
    folder.text("right.obj", &cube("one", [1.0, 0.0, 0.0], 1.0, 0));
    let both = ["check", "left.obj", "right.obj", "--clearance", "0.5"];
    let run = folder.run(both);
    assert!(run.printed().contains("left.obj and right.obj touch: "));
    let code = |args: &[&str]| folder.run([&both, args].concat()).code;
    assert_eq!(code(&["--fail-on", "interpenetrating,near"]), Some(0));
    assert_eq!(code(&["--fail-on", "any"]), Some(3));
    assert_eq!(code(&["--touching", "ignore", "--fail-on", "any"]), Some(0));
    assert_eq!(code(&["--fail-on", "boundary"]), Some(2));
    let code = |args: &[&str]| folder.run([&["check"], args].concat()).code;
    assert_eq!(code(&["left.obj", "--touching", "ignore"]), Some(2));
    assert_eq!(code(&["left.obj", "--fail-on", "near"]), Some(2));
    assert_eq!(code(&["left.obj", "--assembly"]), Some(2));
    assert_eq!(code(&["left.obj", "missing.ply", "--assembly"]), Some(1));
}

#[test]
fn a_closed_mesh_that_is_inside_out_is_not_clean() {
    let folder = Folder::new();
    let inward = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n";
    let outward = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    folder.text("inward.obj", inward);
    folder.text("outward.obj", outward);
    let printed = folder.run(["check", "outward.obj"]).printed();
    assert!(printed.contains("1 mesh: clean"), "{printed}");
    let printed = folder.run(["check", "inward.obj"]).printed();
    let said = "1 mesh: 0 without any finding, 1 with faces inside out";
    assert!(printed.contains(said), "{printed}");
    for (file, code) in [("outward.obj", 0), ("inward.obj", 3)] {
        let run = folder.run(["check", file, "--fail-on", "inside-out"]);
        assert_eq!(run.code, Some(code), "{}", run.stderr);
    }
    // `fix` turns it, and then nothing is left.
    let fix = [
        "fix",
        "inward.obj",
        "--out",
        "mended.ply",
        "--fail-on",
        "inside-out",
    ];
    folder.run(fix).printed();
    let check = ["check", "mended.ply", "--fail-on", "any"];
    assert_eq!(folder.run(check).code, Some(0));
}

/// One closed piece that points outward, and apart from it a smaller one that points inward.
const MIXED: &str = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nv 20 0 0\nv 21 0 0\nv 20 1 0\nv 20 0 1\n\
    f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nf 5 6 7\nf 5 8 6\nf 5 7 8\nf 6 8 7\n";

#[test]
fn one_of_several_closed_pieces_that_is_inside_out_is_found() {
    let folder = Folder::new();
    folder.text("mixed.obj", MIXED);
    for named in ["inside-out", "any"] {
        let run = folder.run(["check", "mixed.obj", "--fail-on", named]);
        assert_eq!(run.code, Some(3), "{}", run.stderr);
        assert!(run.stderr.contains("1 with faces inside out"));
        let table: Vec<&str> = run.stdout.lines().collect();
        assert!(table[0].ends_with("pieces  inside out"), "{}", run.stdout);
        assert!(table[1].ends_with("     2           1"), "{}", run.stdout);
        let next = "next: impinge fix mixed.obj --out mixed-mended.ply";
        assert_eq!(table.last(), Some(&next));
    }
    let rows = rows(folder.run(["check", "mixed.obj", "--json"]));
    assert_eq!(
        wrong(&schema("check"), &rows[0], "row"),
        Vec::<String>::new()
    );
    assert_eq!(rows[0]["inside_out_pieces"], 1);
    let places = rows[0]["places"].as_array().unwrap();
    assert_eq!(places.len(), 1);
    assert_eq!(places[0]["problem"], "inside-out");
    assert_eq!(places[0]["elements"], serde_json::json!([4, 5, 6, 7]));
    let junit = folder.run(["check", "mixed.obj", "--format", "junit"]);
    let failure = "<failure type=\"inside-out\" message=\"1 closed surface inside out, near (20.";
    assert!(junit.printed().contains(failure));
    let kept = ["--skip", "outward", "--fail-on", "inside-out"];
    let kept = [&["fix", "mixed.obj", "--out", "kept.ply"], &kept[..]].concat();
    let run = folder.run(kept);
    assert_eq!(run.code, Some(3));
    let left = "\nleft: 1 closed surface inside out\n";
    assert!(run.stdout.contains(left), "{}", run.stdout);
    folder
        .run(["fix", "mixed.obj", "--out", "mended.ply"])
        .printed();
    let check = ["check", "mended.ply", "--fail-on", "any"];
    assert_eq!(folder.run(check).code, Some(0));
}

#[test]
fn polygons_that_are_split_are_noted() {
    let folder = Folder::new();
    let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    folder.text("quad.obj", quad);
    for more in [&[][..], &["--json"]] {
        let run = folder.run([&["check", "quad.obj"], more].concat());
        let note = "note: quad.obj: polygons split into triangles (element numbers count the triangles): 1\n";
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), note));
    }
}

#[test]
fn a_list_that_names_no_mesh_is_an_error() {
    let folder = Folder::new();
    folder.text("none.txt", "# nothing\n\n");
    folder.text("closed.obj", CLOSED);
    let message = folder.run(["check", "--list", "none.txt"]).misuse();
    assert_eq!(message, "impinge: --list none.txt: it names no mesh\n");
    let both = ["check", "closed.obj", "--list", "none.txt"];
    assert_eq!(folder.run(both).code, Some(0));
}

#[test]
fn what_fix_has_split_is_checked_with_seams_next() {
    let folder = Folder::new();
    // Two tetrahedra with a common vertex.
    let second = "v -1 0 0\nv 0 -1 0\nv 0 0 -1\nf 1 5 6\nf 1 7 5\nf 5 7 6\nf 1 6 7\n";
    folder.text("share1.obj", &format!("{CLOSED}{second}"));
    let last = |args: &[&str]| -> String {
        let text = folder.run(args).printed();
        text.lines().last().unwrap().to_owned()
    };
    let mends = "next: impinge fix share1.obj --out share1-mended.ply";
    assert_eq!(last(&["check", "share1.obj"]), mends);
    let seams = "next: impinge check share1-f.obj --keep-seams";
    assert_eq!(last(&["fix", "share1.obj", "--out", "share1-f.obj"]), seams);
    assert_eq!(last(&["check", "share1-f.obj"]), seams);
    let check = ["check", "share1-f.obj", "--keep-seams"];
    assert_eq!(last(&check), "1 mesh: clean");
    // Its vertices belong to one face each.
    folder
        .run(["fix", "share1.obj", "--out", "soup.stl"])
        .printed();
    let mends = "next: impinge fix soup.stl --out soup-mended.ply";
    assert_eq!(last(&["check", "soup.stl"]), mends);
}

#[test]
fn the_next_command_takes_any_name() {
    let folder = Folder::new();
    let last = |args: &[&str]| -> String {
        let text = folder.run(args).printed();
        text.lines().last().unwrap().to_owned()
    };
    folder.text("-d.obj", MIXED);
    let mends = "next: impinge fix ./-d.obj --out ./-d-mended.ply";
    assert_eq!(last(&["check", "./-d.obj"]), mends);
    assert_eq!(last(&["check", "--", "-d.obj"]), mends);
    let checks = "next: impinge check 'd 2.obj'";
    assert_eq!(last(&["fix", "./-d.obj", "--out", "d 2.obj"]), checks);
}

#[test]
fn meshes_on_standard_input_are_refused_by_that_name() {
    let folder = Folder::new();
    let only_files = "check reads meshes from files only, not from standard input";
    let message = folder.run(["check", "-"]).misuse();
    assert_eq!(message, format!("impinge: -: {only_files}\n"));
    let message = folder.run(["check", "-", "--format", "obj"]).misuse();
    assert!(message.contains("text, sarif, junit or github") && message.contains(only_files));
    let message = folder.run(["check", "-", "--format", "pdf"]).misuse();
    assert!(message.contains("[possible values: text, sarif, junit, github]"));
}
