//! Sequences from point caches and numbered files.

mod common;

use std::path::Path;

use common::Order;
use impinge_io::{Error, Positions, Sequence, SequenceFormat};

fn pc2(n_points: i32, n_frames: i32, values: &[f32]) -> Vec<u8> {
    let order = Order::Little;
    [
        b"POINTCACHE2\0".to_vec(),
        order.i32s([1, n_points]),
        order.f32s([0.0, 1.0]),
        order.i32s([n_frames]),
        order.f32s(values.iter().copied()),
    ]
    .concat()
}

fn mdd(n_points: i32, n_frames: i32, values: &[f32]) -> Vec<u8> {
    let order = Order::Big;
    let times = (0..n_frames.clamp(0, 99)).map(|frame| frame as f32 / 24.0);
    [
        order.i32s([n_frames, n_points]),
        order.f32s(times),
        order.f32s(values.iter().copied()),
    ]
    .concat()
}

const VALUES: [f32; 12] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 0.1];

#[test]
fn caches() {
    for (format, bytes) in [
        (SequenceFormat::Pc2, pc2(2, 2, &VALUES)),
        (SequenceFormat::Mdd, mdd(2, 2, &VALUES)),
    ] {
        let sequence = Sequence::from_bytes(bytes, format, "cache").unwrap();
        assert_eq!((sequence.n_frames(), sequence.n_points()), (2, 2));
        assert_eq!(
            sequence.frame(1).unwrap(),
            Positions::F32(vec![[6.0, 7.0, 8.0], [9.0, 10.0, 0.1]])
        );
        assert_eq!(
            sequence.frame(0).unwrap(),
            Positions::F32(vec![[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
        );
        assert_eq!(
            sequence.frame(2).unwrap_err().to_string(),
            "cache: frame index beyond the frames: expected 2, found 2"
        );
    }
}

#[test]
fn mdd_file_is_read_frame_by_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.MDD");
    std::fs::write(&path, mdd(1, 4, &VALUES)).unwrap();
    let sequence = Sequence::open(&path).unwrap();
    assert_eq!((sequence.n_frames(), sequence.n_points()), (4, 1));
    assert_eq!(
        sequence.frame(3).unwrap(),
        Positions::F32(vec![[9.0, 10.0, 0.1]])
    );
    // A file that shrinks after it was opened is an error, not an old frame.
    std::fs::write(&path, mdd(1, 4, &VALUES[..6])).unwrap();
    assert!(matches!(
        sequence.frame(3),
        Err(Error::Io { action: "read", .. })
    ));
}

#[test]
fn cache_errors() {
    use SequenceFormat::{Mdd, Pc2};
    let truncated = |mut bytes: Vec<u8>| {
        bytes.pop();
        bytes
    };
    for (format, bytes, expected) in [
        (
            Pc2,
            b"POINTCACHE1\0".to_vec(),
            "c: byte 0: expected 'POINTCACHE2', found 'POINTCACHE1?'",
        ),
        (
            Pc2,
            truncated(pc2(2, 2, &VALUES)),
            "c: a sequence of 2 frames of 2 points: 80 bytes are needed, but 79 are left",
        ),
        (
            Mdd,
            truncated(mdd(2, 2, &VALUES)),
            "c: a sequence of 2 frames of 2 points: 64 bytes are needed, but 63 are left",
        ),
        (
            Pc2,
            pc2(-1, 2, &VALUES),
            "c: byte 16: expected the number of points, at least 0, found -1",
        ),
        (
            Mdd,
            mdd(2, -7, &VALUES),
            "c: byte 0: expected the number of frames, at least 0, found -7",
        ),
        (
            Pc2,
            pc2(i32::MAX, i32::MAX, &VALUES),
            "c: a sequence of 2147483647 frames of 2147483647 points: 18446744073709551615 bytes are needed, but 80 are left",
        ),
    ] {
        assert_eq!(
            Sequence::from_bytes(bytes, format, "c")
                .unwrap_err()
                .to_string(),
            expected
        );
    }
    let nan =
        Sequence::from_bytes(pc2(2, 1, &[0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0]), Pc2, "c").unwrap();
    assert_eq!(
        nan.frame(0).unwrap_err().to_string(),
        "c: byte 44: vertex 1 has the coordinate NaN, which is not a finite number"
    );
    for (format, bytes) in [(Pc2, pc2(2, 2, &VALUES)), (Mdd, mdd(2, 2, &VALUES))] {
        for length in 0..bytes.len() {
            assert!(
                Sequence::from_bytes(bytes[..length].to_vec(), format, "c").is_err(),
                "{length}"
            );
        }
    }
}

fn write_frames(folder: &Path) {
    for (name, x) in [
        ("run_08.obj", 8.0),
        ("run_09.obj", 9.0),
        ("run_10.obj", 10.0),
        ("run_100.obj", 100.0),
        ("other_11.obj", 0.0),
        ("run_011.obj", 0.0),
    ] {
        std::fs::write(folder.join(name), format!("v {x} 0 0\nv 1 0 0\n")).unwrap();
    }
}

fn first_coordinates(sequence: &Sequence) -> Vec<f64> {
    (0..sequence.n_frames())
        .map(|frame_ix| sequence.frame(frame_ix).unwrap().get(0).unwrap()[0])
        .collect()
}

/// A shell gives `run_100` before `run_8`.
#[test]
fn files_that_differ_in_numbers_are_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    write_frames(folder.path());
    let of_files = |names: &[&str]| {
        let files = names.iter().map(|name| folder.path().join(name));
        Sequence::of_files(files.collect()).unwrap()
    };
    let sequence = of_files(&["run_10.obj", "run_100.obj", "run_08.obj", "run_09.obj"]);
    assert_eq!(first_coordinates(&sequence), [8.0, 9.0, 10.0, 100.0]);
    let names = |file: &Path| file.file_name().unwrap().to_str().unwrap().to_owned();
    let gaps: Vec<_> = sequence.gaps().iter().map(|two| two.map(names)).collect();
    assert_eq!(gaps, [["run_10.obj", "run_100.obj"]]);
    // Others are in the order that was given.
    std::fs::copy(
        folder.path().join("run_09.obj"),
        folder.path().join("b.obj"),
    )
    .unwrap();
    let sequence = of_files(&["run_10.obj", "b.obj", "run_08.obj"]);
    assert_eq!(first_coordinates(&sequence), [10.0, 9.0, 8.0]);
    assert!(sequence.gaps().is_empty());
}

#[test]
fn numbered_files_from_the_first_one_on() {
    let folder = tempfile::tempdir().unwrap();
    write_frames(folder.path());
    let open = |name: &str| Sequence::open(&folder.path().join(name));
    assert_eq!(
        first_coordinates(&open("run_08.obj").unwrap()),
        [8.0, 9.0, 10.0, 100.0]
    );
    assert_eq!(
        first_coordinates(&open("run_10.obj").unwrap()),
        [10.0, 100.0]
    );
    assert_eq!(
        first_coordinates(&open("run_%02d.obj").unwrap()),
        [8.0, 9.0, 10.0, 100.0]
    );
    assert_eq!(
        first_coordinates(&open("run_%d.obj").unwrap()),
        [10.0, 100.0]
    );
    assert_eq!(
        first_coordinates(&open("r?n_*0.obj").unwrap()),
        [10.0, 100.0]
    );
    assert_eq!(open("run_08.obj").unwrap().n_points(), 2);
    for name in ["walk_%d.obj", "walk_*.obj", "walk_1.obj", "walk.obj"] {
        let message = open(name).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}

#[test]
fn frames_of_another_size_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_frames(folder.path());
    std::fs::write(folder.path().join("run_09.obj"), "v 0 0 0\n").unwrap();
    let sequence = Sequence::open(&folder.path().join("run_08.obj")).unwrap();
    assert!(sequence.frame(0).is_ok());
    let message = sequence.frame(1).unwrap_err().to_string();
    assert!(
        message.ends_with(
            "run_09.obj: vertices of a frame (a mesh whose faces change is no sequence: ask about it \
             file by file): expected 2, found 1"
        ),
        "{message}"
    );
}

/// A folder of files with a vertex at 0, 1, 2, … each.
fn folder_of(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (x, name) in names.iter().enumerate() {
        std::fs::write(folder.path().join(name), format!("v {x} 0 0\n")).unwrap();
    }
    folder
}

#[test]
fn percent_signs_that_are_no_pattern() {
    let folder = folder_of(&[
        "50%_0001.obj",
        "50%_0002.obj",
        "a%b_7_1.obj",
        "a%b_7_2.obj",
        "a%d.obj",
    ]);
    let read = |name: &str| {
        let sequence = Sequence::open(&folder.path().join(name));
        sequence.map(|sequence| first_coordinates(&sequence))
    };
    for (name, expected) in [
        ("50%_0001.obj", &[0.0, 1.0][..]),
        ("50%_%04d.obj", &[0.0, 1.0]),
        ("50%_*.obj", &[0.0, 1.0]),
        ("a%b_%d_1.obj", &[2.0]),
    ] {
        assert_eq!(read(name).unwrap(), expected, "{name}");
    }
    // It has no number.
    assert!(read("a%d.obj").is_err());
}

#[test]
fn patterns_of_other_programs_are_answered_with_ours() {
    let folder = folder_of(&["run_0001.obj"]);
    for name in ["run_####.obj", "run_$F4.obj"] {
        let said = Sequence::open(&folder.path().join(name)).unwrap_err();
        assert!(said.to_string().contains("'%04d'"), "{said}");
    }
}

#[test]
fn what_a_name_may_have_meant_otherwise_is_said() {
    let notes = |names: &[&str], name: &str| {
        let folder = folder_of(names);
        let sequence = Sequence::open(&folder.path().join(name)).unwrap();
        let shown = format!("{}/", folder.path().display());
        let notes = sequence.notes().iter();
        notes
            .map(|note| note.replace(&shown, ""))
            .collect::<Vec<_>>()
    };
    let runs = ["run_0001_v2.obj", "run_0002_v2.obj"];
    assert_eq!(
        notes(&runs, "run_0001_v2.obj"),
        ["the only frame: no file has a greater number in place of 2, the last number of the name"]
    );
    assert!(notes(&runs, "run_%04d_v2.obj").is_empty());
    assert!(notes(&["run_1.obj"], "run_%d.obj").is_empty());
    for (names, first, more) in [
        (
            &["f_1.obj", "f_1b.obj", "f_2.obj"][..],
            Some(["f_1.obj", "f_1b.obj"]),
            1,
        ),
        (
            &["f_1_v1.obj", "f_1_v2.obj", "f_2_v1.obj"],
            Some(["f_1_v2.obj", "f_2_v1.obj"]),
            0,
        ),
        (&["f.obj", "f_1.obj"], Some(["f.obj", "f_1.obj"]), 0),
        (&["f1.obj", "f1.off"], Some(["f1.obj", "f1.off"]), 0),
        (&["f_01.obj", "f_1.obj"], Some(["f_01.obj", "f_1.obj"]), 0),
        (
            &["f_-2.obj", "f_-1.obj", "f_0.obj", "f_9.obj", "f_10.obj"],
            None,
            0,
        ),
        (&["f_2.obj", "f_12.obj", "f_112.obj"], None, 0),
        // Fractions of frames.
        (
            &["f.1.obj", "f.1.25.obj", "f.1.50.obj", "f.2.obj", "f.10.obj"],
            None,
            0,
        ),
    ] {
        let more = match more {
            0 => String::new(),
            n => format!(", as do {n} more files from the next"),
        };
        let expected = first.map(|[a, b]| {
            format!("{a} and {b} are frames in a row, and differ in more than the value of one number{more}")
        });
        assert_eq!(notes(names, "f*"), Vec::from_iter(expected), "{names:?}");
    }
}

/// Linux lets a name have any bytes; a file must not be left out because of them.
#[cfg(target_os = "linux")]
#[test]
fn names_that_are_not_utf_8() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = folder_of(&["run_1.obj", "run_3.obj", "run_4.obj"]);
    let name = OsStr::from_bytes(b"run_\xff_2.obj");
    std::fs::write(folder.path().join(name), "v 9 0 0\n").unwrap();
    let sequence = Sequence::open(&folder.path().join("run_*.obj")).unwrap();
    assert_eq!(sequence.n_frames(), 4);
    assert!(first_coordinates(&sequence).contains(&9.0));
    assert_eq!(sequence.notes().len(), 1);
    let said = Sequence::open(&folder.path().join(name)).unwrap_err();
    assert!(said.to_string().contains("not UTF-8"), "{said}");
}

#[test]
fn a_cache_with_more_than_its_header_says_is_refused() {
    for (format, bytes, expected) in [
        (
            SequenceFormat::Pc2,
            pc2(2, 1, &VALUES),
            "cache: expected 56 bytes, as the header says (1 frames of 2 points), found 80",
        ),
        (
            SequenceFormat::Mdd,
            mdd(2, 1, &VALUES),
            "cache: expected 36 bytes, as the header says (1 frames of 2 points), found 60",
        ),
    ] {
        let error = Sequence::from_bytes(bytes, format, "cache").unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
}

/// Frames without points take no bytes: a small file could have 2^31 of them.
#[test]
fn frames_without_points_are_refused() {
    use SequenceFormat::{Mdd, Pc2};
    for (format, bytes, expected) in [
        (
            Pc2,
            pc2(0, i32::MAX, &[]),
            "cache: byte 16: expected points in 2147483647 frames, at least 1, found 0",
        ),
        (
            Mdd,
            mdd(0, 3, &[]),
            "cache: byte 4: expected points in 3 frames, at least 1, found 0",
        ),
    ] {
        let error = Sequence::from_bytes(bytes, format, "cache").unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
    for (format, bytes) in [(Pc2, pc2(0, 0, &[])), (Mdd, mdd(0, 0, &[]))] {
        let sequence = Sequence::from_bytes(bytes, format, "cache").unwrap();
        assert_eq!((sequence.n_frames(), sequence.n_points()), (0, 0));
    }
}
