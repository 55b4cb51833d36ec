//! Files as a page reads them have the answers of every other door.

#![cfg(feature = "io")]

use std::fs;
use std::path::Path;

use impinge::{Backend, BodyKind};
use impinge_io::Positions;
use impinge_web::{Asker, FileMesh, Put, Question, World, read, read_bodies};

fn add(world: &mut World, mesh: &FileMesh) -> u32 {
    let (index, kind) = (&mesh.index, BodyKind::ALL[mesh.corners as usize - 1]);
    match &mesh.positions {
        Positions::F32(p) => world.put(Put::Add, 0, kind, index, p.as_flattened()),
        Positions::F64(p) => world.put(Put::Add, 0, kind, index, p.as_flattened()),
    }
    .unwrap()
}

#[test]
fn files_have_the_answers_of_the_program() {
    let folder = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../impinge-cli/tests/doors"
    ));
    let answers = fs::read_to_string(folder.join("answers.json")).unwrap();
    let mut n_files = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if name == "answers.json" {
            continue;
        }
        n_files += 1;
        let bytes = fs::read(&path).unwrap();
        let mut world = World::new();
        let body = add(&mut world, &read(name, &bytes, true).unwrap());
        let mut asker = Asker::new(Backend::Cpu.into()).unwrap();
        let words = [4, body, 0, 0, 0, 0, 0, 0, 1];
        let found = asker.ask(Question::Detect, &world, &words, &[0.0; 10]);
        let found = found.unwrap();
        let (n_pairs, hash) = (found.rows.len() / 4, found.hash);
        // The file of answers is JSON of one form: no reader is needed for it.
        let start = answers.find(&format!("\"{name}\": {{")).unwrap();
        let answer = &answers[start..];
        let answer = &answer[..answer.find("\n  }").unwrap()];
        for part in [
            format!("\n    \"hash\": \"{hash:016x}\""),
            format!("\n    \"pairs\": {n_pairs}"),
        ] {
            assert!(answer.contains(&part), "{name}: {part} is not in {answer}");
        }
        let bodies = read_bodies(name, &bytes, true).unwrap();
        assert_eq!(bodies.len() > 1, answer.contains("\"bodies\""), "{name}");
        for body in bodies.iter().filter(|_| answer.contains("\"bodies\"")) {
            assert!(
                answer.contains(&format!("\"{}\"", body.name)),
                "{}",
                body.name
            );
        }
    }
    assert_eq!(n_files, 8);
}

/// TetGen's two files are not offered for the bytes of one.
#[test]
fn an_unknown_extension_is_refused_with_those_that_bytes_may_have() {
    let said = |name| {
        [
            read(name, &[], true).unwrap_err().to_string(),
            read_bodies(name, &[], true).unwrap_err().to_string(),
        ]
    };
    for text in said("a.txt") {
        assert!(text.starts_with("a.txt: no mesh format has the extension 'txt' (known: obj, "));
        assert!(text.ends_with(", mesh, 3mf)"), "{text}");
    }
    for text in said("a.node") {
        assert!(text.contains("two files, .node and .ele"), "{text}");
    }
}
