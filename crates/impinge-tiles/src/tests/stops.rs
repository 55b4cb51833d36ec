//! A run that is stopped at any write ends with the same bytes when run again.

use std::collections::BTreeMap;
use std::path::Path;

use super::made::{Random, answer, lattice, oracle, write};
use crate::disk::STEPS_LEFT;
use crate::{Ask, PlanOptions};

/// All files of a folder except unfinished ones.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for sub in ["", "parts", "results"] {
        for entry in std::fs::read_dir(folder.join(sub)).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            if entry.file_type().unwrap().is_file() && !name.starts_with('.') {
                files.insert(
                    format!("{sub}/{name}"),
                    std::fs::read(entry.path()).unwrap(),
                );
            }
        }
    }
    files
}

#[test]
fn stopped_at_each_write_and_run_again_the_bytes_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(6);
    let meshes = [
        lattice(&mut random, 30, false, false),
        lattice(&mut random, 20, false, true),
    ];
    let files = [
        write(folder.path(), "a", &meshes[0]),
        write(folder.path(), "b", &meshes[1]),
    ];
    let options = PlanOptions {
        cap: 15,
        chunk: 20,
        ..PlanOptions::default()
    };
    let attempt = |name: &str| answer(&folder.path().join(name), &files, &options, Ask::default());
    let merged = attempt("whole").unwrap();
    assert_eq!(merged.hash, oracle(&meshes, Ask::default()).1);
    let expected = contents(&folder.path().join("whole"));
    let mut n_stops = 0;
    loop {
        let name = format!("stopped-{n_stops}");
        STEPS_LEFT.set(Some(n_stops));
        let stopped = attempt(&name);
        STEPS_LEFT.set(None);
        if stopped.is_ok() {
            break;
        }
        let error = stopped.unwrap_err().to_string();
        assert!(error.contains("stopped by a test"), "{error}");
        // Stop a second time, at a later step: leftover files do no harm.
        STEPS_LEFT.set(Some(n_stops / 2 + 3));
        let _ = attempt(&name);
        STEPS_LEFT.set(None);
        attempt(&name).unwrap();
        let found = contents(&folder.path().join(&name));
        assert_eq!(
            found.keys().collect::<Vec<_>>(),
            expected.keys().collect::<Vec<_>>()
        );
        assert!(found == expected, "stopped at step {n_stops}");
        std::fs::remove_dir_all(folder.path().join(&name)).unwrap();
        n_stops += 1;
    }
    // A plan, parts, two files per tile, rows and answer: several steps each.
    assert!(n_stops > 40, "{n_stops}");
}
