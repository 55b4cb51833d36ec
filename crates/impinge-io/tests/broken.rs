//! Broken files: cut off at every byte, changed at every byte, and with wrong headers. Nothing
//! panics, every returned mesh is valid, and memory is bounded by the length of a file, whatever
//! its header says.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{Sample, assert_valid, samples};
use impinge_io::Format;

/// Counts allocated bytes, to see what a reader reserves.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST_HELD: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed on to the system's allocator unchanged; counting touches no memory
// of the caller.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST_HELD.fetch_max(held, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Reads `bytes` and returns the result with the peak of allocated bytes.
fn measured(sample: &Sample, bytes: &[u8]) -> (Result<impinge_io::Mesh, impinge_io::Error>, usize) {
    let before = HELD.load(Ordering::Relaxed);
    MOST_HELD.store(before, Ordering::Relaxed);
    let result = sample.read(bytes);
    (result, MOST_HELD.load(Ordering::Relaxed) - before)
}

/// The most bytes that reading a few hundred bytes may allocate. (A hash table and an inflater
/// alone take tens of thousands.)
const MOST_BYTES: usize = 1 << 19;

/// Reads a broken file: no panic, no invalid mesh, a message of one line, little memory.
fn check(sample: &Sample, bytes: &[u8], what: &str) -> Option<impinge_io::Mesh> {
    let (result, held) = measured(sample, bytes);
    assert!(
        held < MOST_BYTES,
        "{} {what}: {held} bytes held",
        sample.name
    );
    match result {
        Ok(mesh) => {
            assert_valid(&mesh);
            Some(mesh)
        }
        Err(error) => {
            let message = error.to_string();
            assert!(
                message.contains(sample.name) && !message.contains('\n'),
                "{} {what}: {message}",
                sample.name
            );
            None
        }
    }
}

// One test on one thread, because the counted memory is that of the whole process.
#[test]
fn broken_files() {
    cut_off_at_every_byte();
    changed_at_every_byte();
    lying_headers();
}

fn cut_off_at_every_byte() {
    for sample in samples() {
        for length in 0..sample.bytes.len() {
            let read = check(
                &sample,
                &sample.bytes[..length],
                &format!("cut off at {length}"),
            );
            // OBJ announces no counts, and many Medit files have no end mark, so their beginnings
            // are valid files. Other formats may lose an end mark or a line's end.
            if !matches!(sample.format, Format::Obj | Format::Medit) {
                let Some(mesh) = read else { continue };
                assert_eq!(mesh, sample.mesh, "{} cut off at {length}", sample.name);
            }
        }
    }
}

fn changed_at_every_byte() {
    for sample in samples() {
        let mut bytes = sample.bytes.clone();
        for at in 0..bytes.len() {
            let right = bytes[at];
            for wrong in [
                0,
                0xff,
                0x7f,
                0x80,
                b'9',
                b'-',
                b' ',
                b'\n',
                right ^ 1,
                right.wrapping_add(1),
            ] {
                bytes[at] = wrong;
                check(&sample, &bytes, &format!("byte {at} is {wrong}"));
            }
            bytes[at] = right;
        }
    }
}

fn lying_headers() {
    // Each count in a text, made huge.
    let lies: [(&str, &[(&str, &str)]); 13] = [
        (
            "off",
            &[
                ("5 3 0", "4000000000 3 0"),
                ("5 3 0", "5 18446744073709551615 0"),
                ("3 0 2 1", "999999999999 0 2 1"),
            ],
        ),
        (
            "ply ascii",
            &[
                ("vertex 5", "vertex 4000000000"),
                ("face 3", "face 18446744073709551615"),
                ("\n3 0", "\n99999999999 0"),
            ],
        ),
        (
            "ply little",
            &[
                ("vertex 5", "vertex 4000000000"),
                ("face 3", "face 18446744073709551615"),
            ],
        ),
        (
            "msh 2.2 ascii",
            &[
                ("$Nodes\n5", "$Nodes\n4000000000"),
                ("$Elements\n4", "$Elements\n9999999999999"),
            ],
        ),
        (
            "msh 2.2 little",
            &[
                ("$Nodes\n5", "$Nodes\n4000000000"),
                ("$Elements\n3", "$Elements\n9999999999999"),
            ],
        ),
        (
            "msh 4.1 ascii",
            &[
                ("1 5 1 5\n3 1 0 5", "1 4000000000 1 5\n3 1 0 4000000000"),
                ("2 3 1 3", "9999999999999 3 1 3"),
                ("3 1 4 2", "3 1 4 9999999999999"),
            ],
        ),
        (
            "vtk grid ascii",
            &[
                ("POINTS 5", "POINTS 4000000000"),
                ("CELLS 3 13", "CELLS 9999999999 13"),
                ("CELLS 3 13", "CELLS 3 9999999999"),
                ("CELL_TYPES 3", "CELL_TYPES 99999999999"),
            ],
        ),
        (
            "vtk grid binary",
            &[
                ("POINTS 5", "POINTS 4000000000"),
                ("CELLS 2 10", "CELLS 9999999999 10"),
                ("CELLS 2 10", "CELLS 2 9999999999"),
            ],
        ),
        (
            "vtk 5.1 binary",
            &[
                ("TIME 1 1", "TIME 9999999999 9999999999"),
                ("CELLS 3 8", "CELLS 9999999999 8"),
                ("CELLS 3 8", "CELLS 3 18446744073709551615"),
            ],
        ),
        (
            "vtu raw",
            &[
                ("NumberOfPoints=\"5\"", "NumberOfPoints=\"4000000000\""),
                (
                    "NumberOfCells=\"2\"",
                    "NumberOfCells=\"18446744073709551615\"",
                ),
                ("offset=\"0\"", "offset=\"18446744073709551615\""),
            ],
        ),
        (
            "medit",
            &[
                ("Vertices\n5", "Vertices\n4000000000"),
                ("Tetrahedra 2", "Tetrahedra 18446744073709551615"),
            ],
        ),
        (
            "tetgen from 0",
            &[
                ("5 3 1 0", "4000000000 3 1 0"),
                ("2 4 0", "18446744073709551615 4 0"),
            ],
        ),
        (
            "glb",
            &[
                ("\"count\":5", "\"count\":999999999999999"),
                ("\"count\":9", "\"count\":9999999999999999999"),
                (
                    "\"bufferView\":0,\"componentType\":5126,\"count\":5",
                    "\"componentType\":5126,\"count\":999999999999",
                ),
            ],
        ),
    ];
    let samples = samples();
    for (name, replacements) in lies {
        let sample = samples
            .iter()
            .find(|sample| sample.name == name)
            .unwrap_or_else(|| panic!("{name}"));
        for (from, to) in replacements {
            let start = sample
                .bytes
                .windows(from.len())
                .position(|w| w == from.as_bytes())
                .unwrap_or_else(|| panic!("{name}: {from}"));
            let lying = [
                &sample.bytes[..start],
                to.as_bytes(),
                &sample.bytes[start + from.len()..],
            ]
            .concat();
            assert!(check(sample, &lying, to).is_none(), "{name}: {to}");
        }
    }
    // Counts of binary headers.
    for (name, at) in [("stl binary", 80), ("glb", 8), ("glb", 12)] {
        let sample = samples
            .iter()
            .find(|sample| sample.name == name)
            .unwrap_or_else(|| panic!("{name}"));
        let mut lying = sample.bytes.clone();
        lying[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(
            check(sample, &lying, "a count of 2^32 - 1").is_none(),
            "{name}"
        );
    }
}
