//! `docs/*.schema.json` describe what `--json` prints, and nothing else.

use impinge_io::Pc2Writer;
use impinge_scenes::solids::solid_ball;
use impinge_scenes::surfaces::ball;
use serde_json::{Value, json};

use crate::harness::Folder;

/// `docs/NAME.schema.json`.
pub fn schema(name: &str) -> Value {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs");
    let path = format!("{folder}/{name}.schema.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The errors in `value`, by the part of JSON Schema that the file uses; an unknown keyword is an
/// error too.
pub fn wrong(schema: &Value, value: &Value, at: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut say = |is_right: bool, what: String| {
        if !is_right {
            found.push(format!("{at}: {what}"));
        }
    };
    let mut below = Vec::new();
    for (keyword, told) in schema.as_object().unwrap() {
        match keyword.as_str() {
            "$schema" | "$id" | "title" | "description" => {}
            "type" => {
                let is = |name: &Value| match name.as_str().unwrap() {
                    "null" => value.is_null(),
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "boolean" => value.is_boolean(),
                    "number" => value.is_number(),
                    "integer" => value.is_u64() || value.is_i64(),
                    other => panic!("type {other}"),
                };
                let fits = match told {
                    Value::Array(names) => names.iter().any(is),
                    name => is(name),
                };
                say(fits, format!("{value} is no {told}"));
            }
            "enum" => say(
                told.as_array().unwrap().contains(value),
                format!("{value} is none of {told}"),
            ),
            "minimum" => {
                if let Some(number) = value.as_f64() {
                    say(
                        number >= told.as_f64().unwrap(),
                        format!("{number} is below {told}"),
                    );
                }
            }
            "required" => {
                for key in told.as_array().unwrap() {
                    let has = value.get(key.as_str().unwrap()).is_some();
                    say(has || !value.is_object(), format!("{key} is missing"));
                }
            }
            "properties" => {
                for (key, of) in told.as_object().unwrap() {
                    if let Some(part) = value.get(key) {
                        below.extend(wrong(of, part, &format!("{at}.{key}")));
                    }
                }
            }
            "additionalProperties" => {
                let known = schema.get("properties").and_then(Value::as_object);
                for (key, part) in value.as_object().into_iter().flatten() {
                    if known.is_some_and(|known| known.contains_key(key)) {
                        continue;
                    }
                    match told {
                        Value::Bool(true) => panic!("{at}: anything goes"),
                        Value::Bool(false) => say(false, format!("{key} is not described")),
                        of => below.extend(wrong(of, part, &format!("{at}.{key}"))),
                    }
                }
            }
            "items" => {
                for (ix, part) in value.as_array().into_iter().flatten().enumerate() {
                    below.extend(wrong(told, part, &format!("{at}[{ix}]")));
                }
            }
            "minItems" | "maxItems" => {
                if let Some(list) = value.as_array() {
                    let n = told.as_u64().unwrap() as usize;
                    let fits = if keyword == "minItems" {
                        list.len() >= n
                    } else {
                        list.len() <= n
                    };
                    say(fits, format!("{} items, {keyword} {n}", list.len()));
                }
            }
            other => panic!("{at}: keyword {other}"),
        }
    }
    found.extend(below);
    found
}

#[test]
fn every_answer_is_as_described() {
    let schema = schema("answer");
    let folder = Folder::new();
    let (a, b) = (ball(320), ball(500).translated([0.7, 0.1, 0.0]));
    folder.ply("a.ply", &a);
    folder.ply("b.ply", &b);
    folder.medit("c.mesh", &solid_ball(100));
    let mut cache = Pc2Writer::create(&folder.path("run.pc2"), a.n_vertices(), 0.0, 1.0).unwrap();
    cache.append(&a.positions).unwrap();
    cache.finish().unwrap();
    for args in [
        &["pairs", "a.ply", "b.ply"][..],
        &[
            "pairs", "a.ply", "b.ply", "c.mesh", "--self", "--repeat", "3",
        ],
        &["pairs", "a.ply", "b.ply", "--contacts", "rows.csv"],
        &["self", "a.ply"],
        &[
            "self",
            "a.ply",
            "--no-weld",
            "--method",
            "cells",
            "--backend",
            "cpu",
        ],
        &["self", "a.ply", "--method", "naive"],
        &["sequence", "a.ply", "run.pc2"],
        &["sequence", "a.ply", "run.pc2", "--other", "b.ply"],
    ] {
        let object = folder.run(args.iter().chain(&["--json"])).json();
        assert_eq!(wrong(&schema, &object, "$"), [""; 0], "{args:?}");
    }
}

#[test]
fn the_description_refuses_what_is_not_an_answer() {
    let schema = schema("answer");
    let folder = Folder::new();
    folder.ply("a.ply", &ball(320));
    let right = folder.run(["self", "a.ply", "--json"]).json();
    for (key, value) in [
        ("pairs", json!(-1)),
        ("pairs", json!("12")),
        ("method", json!("magic")),
        ("bodies", json!([{}])),
        ("regions", json!([{"pairs": 1}])),
        ("new", json!(1)),
        ("ms", json!({"total": "1", "stages": {}})),
    ] {
        let mut object = right.clone();
        object[key] = value;
        assert!(!wrong(&schema, &object, "$").is_empty(), "{key}");
    }
    for key in ["pairs", "hash", "stats", "n_regions"] {
        let mut object = right.clone();
        object.as_object_mut().unwrap().remove(key);
        assert!(!wrong(&schema, &object, "$").is_empty(), "{key}");
    }
}

/// All commands in a help text.
fn commands(help: &str) -> Vec<&str> {
    let (_, list) = help.split_once("Commands:\n").unwrap_or(("", ""));
    list.lines()
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect()
}

#[test]
fn every_command_that_prints_json_has_a_schema() {
    let folder = Folder::new();
    let (a, b) = (ball(320), ball(500).translated([0.7, 0.1, 0.0]));
    folder.ply("a.ply", &a);
    folder.ply("a1.ply", &a.translated([0.2, 0.0, 0.0]));
    folder.ply("b.ply", &b);
    folder.ply("far.ply", &a.translated([5.0, 0.0, 0.0]));
    folder.medit("c.mesh", &solid_ball(100));
    folder.text(
        "soup.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nf 1 2 3\nf 4 3 2\n",
    );
    folder.text("rays.csv", "0,0,9,0,0,-1\n9,9,9,1,0,0\n");
    folder.text("broken.obj", "v 0 0 0\nf 1 2 3\n");
    let mut cache = Pc2Writer::create(&folder.path("run.pc2"), a.n_vertices(), 0.0, 1.0).unwrap();
    cache.append(&a.positions).unwrap();
    cache
        .append(&a.translated([0.1, 0.0, 0.0]).positions)
        .unwrap();
    cache.finish().unwrap();
    let exploded = folder.path("exploded.pc2");
    let mut cache = Pc2Writer::create(&exploded, a.n_vertices(), 0.0, 1.0).unwrap();
    cache.append(&vec![[f32::NAN; 3]; a.n_vertices()]).unwrap();
    cache.finish().unwrap();
    let cases: &[(&str, &str)] = &[
        ("answer", "pairs a.ply b.ply"),
        ("answer", "pairs a.ply far.ply"),
        (
            "answer",
            "pairs a.ply b.ply c.mesh --self --contacts rows.csv",
        ),
        ("answer", "self a.ply broken.obj b.ply"),
        ("answer", "self soup.obj --no-weld"),
        ("answer", "render a.ply b.ply --png out.png --size 64x64"),
        ("answer", "sequence a.ply run.pc2 --other b.ply"),
        (
            "sequence-step",
            "sequence a.ply run.pc2 --other b.ply --ccd",
        ),
        ("sequence-step", "sequence a.ply run.pc2 --ccd"),
        ("sequence-error", "sequence a.ply exploded.pc2"),
        ("count", "pairs a.ply b.ply --count"),
        ("count", "pairs a.ply b.ply --any"),
        ("count", "self a.ply broken.obj --count"),
        ("distance", "distance a.ply far.ply"),
        ("distance", "distance a.ply b.ply"),
        ("distance", "distance a.ply c.mesh"),
        ("near", "near a.ply b.ply --distance 0.01"),
        ("near", "near a.ply far.ply --distance 0"),
        ("near", "near soup.obj --distance 0.1 --no-weld"),
        ("safe", "safe a.ply b.ply --most 0.01"),
        ("safe", "safe a.ply far.ply --most 9 --fixed 1 --no-self"),
        ("probe", "probe a.ply --points b.ply --signed"),
        ("probe", "probe a.ply --points far.ply --most 0.1"),
        ("cast", "cast a.ply --rays rays.csv"),
        ("cast", "cast a.ply --rays rays.csv --hits any --most 1"),
        ("cast", "cast a.ply --rays rays.csv --hits all"),
        ("step", "step a.ply a1.ply b.ply b.ply"),
        ("step", "step a.ply a1.ply far.ply far.ply --no-self"),
        ("step", "step a.ply a1.ply b.ply b.ply --earliest"),
        ("step", "step soup.obj soup.obj --weld"),
        ("step", "step a.ply a1.ply --truncate a2.ply"),
        (
            "step",
            "step a.ply a1.ply b.ply b.ply --truncate a2.ply b2.ply",
        ),
        (
            "candidates",
            "step a.ply a1.ply b.ply b.ply --candidates boxes.csv",
        ),
        (
            "candidates",
            "step a.ply a1.ply --candidates boxes.csv --kinds ff",
        ),
        (
            "check",
            "check a.ply c.mesh broken.obj missing.ply soup.obj",
        ),
        ("assembly", "check a.ply b.ply --assembly"),
        ("fix", "fix soup.obj --out mended.ply --close-holes 3"),
        ("tiles-plan", "tiles plan still a.ply b.ply --cap 200"),
        ("tiles-scatter", "tiles scatter still"),
        ("tiles-run", "tiles run still"),
        ("tiles-merge", "tiles merge still"),
        (
            "tiles-plan",
            "tiles plan moving a.ply a1.ply b.ply b.ply --step --cap 200",
        ),
        ("tiles-scatter", "tiles scatter moving"),
        ("tiles-run", "tiles run moving"),
        ("tiles-merge", "tiles merge moving"),
        #[cfg(feature = "gpu")]
        ("devices", "devices"),
    ];
    for (name, words) in cases {
        let schema = schema(name);
        let args: Vec<&str> = words.split(' ').chain(["--json"]).collect();
        let run = folder.run(&args);
        assert!(!run.stdout.is_empty(), "{words}: {}", run.stderr);
        for line in run.stdout.lines() {
            let value = serde_json::from_str(line).unwrap();
            assert_eq!(wrong(&schema, &value, "$"), [""; 0], "{words}");
            // Keys that are not described are refused, so the schema is not empty.
            let mut other = if let Value::Array(list) = &value {
                list[0].clone()
            } else {
                value
            };
            other["unknown"] = json!(0);
            let schema = schema.get("items").unwrap_or(&schema);
            assert_eq!(wrong(schema, &other, "$").len(), 1, "{words}");
        }
    }
    // No command is forgotten, and no description.
    let top = folder.run(["--help"]).printed();
    for command in commands(&top) {
        let help = folder.run([command, "--help"]).stdout;
        let below = commands(&help);
        let all = match below.is_empty() {
            true => vec![(command.to_owned(), help.clone())],
            false => below
                .iter()
                .map(|sub| {
                    let help = folder.run([command, sub, "--help"]).stdout;
                    (format!("{command} {sub}"), help)
                })
                .collect(),
        };
        for (command, help) in all {
            let is_here = cases
                .iter()
                .any(|(_, words)| words.starts_with(&format!("{command} ")) || *words == command);
            assert_eq!(help.contains("--json"), is_here, "{command}");
        }
    }
    let docs = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs")).unwrap();
    for entry in docs {
        let file = entry.unwrap().file_name().into_string().unwrap();
        if let Some(name) = file.strip_suffix(".schema.json") {
            let is_known = cases.iter().any(|(known, _)| *known == name);
            assert!(is_known || name == "devices", "{file}");
        }
    }
}
