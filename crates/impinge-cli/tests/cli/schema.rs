//! `docs/*.schema.json` describe what every `--json` prints. Most are made from the types, by the
//! tests of the program.

use impinge_io::Pc2Writer;
use impinge_scenes::solids::solid_ball;
use impinge_scenes::surfaces::ball;
use serde_json::{Value, json};

use crate::harness::Folder;

pub use impinge_testing::schema::read as schema;

/// Keys in `value` that are not described, and keys that it lacks.
pub fn wrong(schema: &Value, value: &Value, at: &str) -> Vec<String> {
    let mut found = Vec::new();
    if let (Some(known), Some(object)) = (schema["properties"].as_object(), value.as_object()) {
        for (key, part) in object {
            match known.get(key) {
                Some(of) => found.extend(wrong(of, part, &format!("{at}.{key}"))),
                None => found.push(format!("{at}: {key} is not described")),
            }
        }
        let required = schema["required"].as_array().into_iter().flatten();
        let missing = required.filter(|key| !object.contains_key(key.as_str().unwrap()));
        found.extend(missing.map(|key| format!("{at}: {key} is missing")));
    }
    for (ix, part) in value.as_array().into_iter().flatten().enumerate() {
        found.extend(wrong(&schema["items"], part, &format!("{at}[{ix}]")));
    }
    found
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
    for name in impinge_testing::schema::names() {
        let is_known = cases.iter().any(|(known, _)| *known == name);
        assert!(is_known || name == "devices", "{name}");
    }
}
