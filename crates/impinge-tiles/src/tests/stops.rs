//! A run that is stopped at any write ends with the same bytes when run again.

use std::collections::BTreeMap;
use std::path::Path;

use impinge_io::Mesh;

use super::made::{Random, answer, lattice, moved, oracle, step_oracle, write};
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
    let hash = oracle(&meshes, Ask::default()).1;
    // A plan, parts, two files per tile, rows and answer: several steps each.
    stop_everywhere(folder.path(), &meshes, PlanOptions::default(), hash, 40);
}

#[test]
fn a_step_stopped_at_each_write_and_run_again_has_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(7);
    let start = lattice(&mut random, 24, false, false);
    let meshes = [moved(&mut random, &start), start];
    let options = PlanOptions {
        step: true,
        weld: true,
        separation: 0.25,
        ..PlanOptions::default()
    };
    let hash = step_oracle(std::slice::from_ref(&meshes), &options, Ask::default()).hash();
    stop_everywhere(folder.path(), &meshes, options, hash, 30);
}

#[test]
fn what_killed_processes_have_left_goes_with_the_merge() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(8);
    let meshes = [30, 20].map(|n| lattice(&mut random, n, false, false));
    let files = [
        write(folder.path(), "a", &meshes[0]),
        write(folder.path(), "b", &meshes[1]),
    ];
    let whole = folder.path().join("whole");
    let options = PlanOptions::default();
    let merged = answer(&whole, &files, &options, Ask::default()).unwrap();
    let named = |sub: &str| {
        let mut entries = std::fs::read_dir(whole.join(sub)).unwrap();
        let name = entries.find_map(|entry| {
            let name = entry.unwrap().file_name().into_string().unwrap();
            whole.join(sub).join(&name).is_file().then_some(name)
        });
        name.unwrap()
    };
    let leftovers = ["", "parts", "results"]
        .map(|sub| whole.join(sub).join(format!(".{}.4711-3.part", named(sub))));
    // Of a file that is not whole yet, and what is not ours.
    let others = [
        ".absent.4711-3.part",
        ".rows.npy.old.part",
        "answer.json.1-2.part",
    ];
    for path in leftovers
        .iter()
        .cloned()
        .chain(others.map(|name| whole.join(name)))
    {
        std::fs::write(path, "half of it").unwrap();
    }
    let again = answer(&whole, &files, &options, Ask::default()).unwrap();
    assert_eq!(again.hash, merged.hash);
    assert_eq!(leftovers.map(|path| path.exists()), [false; 3]);
    assert_eq!(others.map(|name| whole.join(name).exists()), [true; 3]);
}

/// Stops all steps at each of their writes, at least `n_least` of them.
fn stop_everywhere(
    folder: &Path,
    meshes: &[Mesh; 2],
    options: PlanOptions,
    hash: u64,
    n_least: u32,
) {
    let files = [
        write(folder, "a", &meshes[0]),
        write(folder, "b", &meshes[1]),
    ];
    let options = PlanOptions {
        cap: 15,
        chunk: 20,
        ..options
    };
    let attempt = |name: &str| answer(&folder.join(name), &files, &options, Ask::default());
    let merged = attempt("whole").unwrap();
    assert_eq!(merged.hash, hash);
    let expected = contents(&folder.join("whole"));
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
        let found = contents(&folder.join(&name));
        assert_eq!(
            found.keys().collect::<Vec<_>>(),
            expected.keys().collect::<Vec<_>>()
        );
        assert!(found == expected, "stopped at step {n_stops}");
        std::fs::remove_dir_all(folder.join(&name)).unwrap();
        n_stops += 1;
    }
    assert!(n_stops > n_least, "{n_stops}");
}
