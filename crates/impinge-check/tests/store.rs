//! Rows on disk: existing rows are kept, missing ones are listed, rows of another run are refused.

use std::path::{Path, PathBuf};

use impinge_check::{Counts, ErrorKind, Row, RowStore, StoreError};

fn meshes(n: usize) -> Vec<PathBuf> {
    (0..n).map(|ix| format!("mesh {ix}.ply").into()).collect()
}

fn row(path: &Path) -> Row {
    Row {
        path: path.display().to_string(),
        is_welded: true,
        result: Ok(Counts::default()),
        places: Vec::new(),
        marks: None,
        notes: Vec::new(),
    }
}

#[test]
fn ranks_share_a_list_and_every_mesh_is_one_processs() {
    let folder = tempfile::tempdir().unwrap();
    let list = meshes(23);
    let mut seen = Vec::new();
    for rank in 0..3 {
        let store = RowStore::open(folder.path(), &list, true, 4, (rank, 3), false).unwrap();
        seen.extend(store.missing());
    }
    seen.sort_unstable();
    assert_eq!(seen, (0..23).collect::<Vec<_>>());
}

#[test]
fn a_run_goes_on_where_it_stopped_and_ends_with_the_same_bytes() {
    let (once, twice) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let list = meshes(10);
    let mut store = RowStore::open(once.path(), &list, true, 4, (0, 1), false).unwrap();
    for ix in store.missing() {
        store.put(ix, row(&list[ix])).unwrap();
    }
    // Without a flush: complete batches are written at once.
    let mut store = RowStore::open(twice.path(), &list, true, 4, (0, 1), false).unwrap();
    for ix in [9, 2, 0, 6] {
        store.put(ix, row(&list[ix])).unwrap();
    }
    store.flush().unwrap();
    let mut store = RowStore::open(twice.path(), &list, true, 4, (0, 1), false).unwrap();
    assert_eq!(store.missing(), [1, 3, 4, 5, 7, 8]);
    assert_eq!(
        store.rows().map(|(ix, _)| ix).collect::<Vec<_>>(),
        [0, 2, 6, 9]
    );
    for ix in store.missing() {
        store.put(ix, row(&list[ix])).unwrap();
    }
    for batch in 0..3 {
        let name = format!("rows-{batch:08}.jsonl");
        let read = |folder: &Path| std::fs::read(folder.join(&name)).unwrap();
        assert_eq!(read(once.path()), read(twice.path()));
    }
    assert_eq!(std::fs::read_dir(twice.path()).unwrap().count(), 3);
}

#[test]
fn a_mesh_named_twice_has_two_rows() {
    let folder = tempfile::tempdir().unwrap();
    let list = vec![PathBuf::from("a"), PathBuf::from("a"), PathBuf::from("b")];
    let mut store = RowStore::open(folder.path(), &list, true, 8, (0, 1), false).unwrap();
    for (ix, path) in list.iter().enumerate() {
        store.put(ix, row(path)).unwrap();
    }
    let store = RowStore::open(folder.path(), &list, true, 8, (0, 1), false).unwrap();
    assert!(store.missing().is_empty());
}

#[test]
fn limits_may_be_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let list = meshes(2);
    let mut store = RowStore::open(folder.path(), &list, true, 8, (0, 1), false).unwrap();
    store
        .put(
            0,
            Row::failed("mesh 0.ply", true, ErrorKind::Timeout, "slow"),
        )
        .unwrap();
    store
        .put(
            1,
            Row::failed("mesh 1.ply", true, ErrorKind::File, "no file"),
        )
        .unwrap();
    let missing = |retry| {
        RowStore::open(folder.path(), &list, true, 8, (0, 1), retry)
            .unwrap()
            .missing()
    };
    assert_eq!(missing(false), [0usize; 0]);
    assert_eq!(missing(true), [0]);
}

#[test]
fn rows_of_another_run_and_damaged_ones_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let list = meshes(3);
    let mut store = RowStore::open(folder.path(), &list, true, 8, (0, 1), false).unwrap();
    for (ix, path) in list.iter().enumerate() {
        store.put(ix, row(path)).unwrap();
    }
    let open = |list: &[PathBuf], weld| {
        RowStore::open(folder.path(), list, weld, 8, (0, 1), false).unwrap_err()
    };
    assert!(matches!(
        open(&list[..2], true),
        StoreError::OtherRun { line: 3, .. }
    ));
    assert!(matches!(
        open(&list, false),
        StoreError::OtherRun { line: 1, .. }
    ));
    let file = folder.path().join("rows-00000000.jsonl");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, &text[..text.len() - 9]).unwrap();
    let error = open(&list, true);
    assert!(
        matches!(error, StoreError::Damaged { line: 3, .. }),
        "{error}"
    );
}

#[test]
fn no_temporary_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let list = meshes(3);
    // Left by killed processes: of this rank, and of another one that may be at work.
    for name in [
        ".rows-00000000.jsonl.77-0.part",
        ".rows-00000002.77.part",
        ".rows-00000001.jsonl.78-0.part",
    ] {
        std::fs::write(folder.path().join(name), "{").unwrap();
    }
    let mut store = RowStore::open(folder.path(), &list, true, 1, (0, 2), false).unwrap();
    // A file that can't be replaced.
    std::fs::create_dir(folder.path().join("rows-00000002.jsonl")).unwrap();
    store.put(0, row(&list[0])).unwrap();
    store.put(2, row(&list[2])).unwrap_err();
    let mut names: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            ".rows-00000001.jsonl.78-0.part",
            "rows-00000000.jsonl",
            "rows-00000002.jsonl"
        ]
    );
}
