//! Cases that others published. The data is not part of the repository; without it the tests say
//! that they were skipped.

use impinge::exact::triangles_intersect;
use std::path::PathBuf;

/// A file of the shared data, or a plain word that the test is skipped.
fn data(name: &str) -> Option<Vec<u8>> {
    let folder = std::env::var_os("IMPINGE_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    let file = folder.join(name);
    match std::fs::read(&file) {
        Ok(bytes) => Some(bytes),
        Err(error) => {
            println!("skipped: {} cannot be read: {error}", file.display());
            None
        }
    }
}

/// The rows of a NumPy array file of shape (n, 6, 3), little-endian `f64`, in C order.
fn triangle_pairs(bytes: &[u8]) -> Vec<[[[f64; 3]; 3]; 2]> {
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00", "NumPy format 1.0");
    let header_end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..header_end]).expect("header in ASCII");
    assert!(header.contains("'descr': '<f8'") && header.contains("'fortran_order': False"));
    assert!(header.contains(", 6, 3)"), "{header}");
    let (numbers, rest) = bytes[header_end..].as_chunks::<8>();
    assert!(rest.is_empty() && numbers.len() % 18 == 0);
    let numbers: Vec<f64> = numbers
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
        .collect();
    numbers
        .chunks_exact(18)
        .map(|row| {
            std::array::from_fn(|side| {
                std::array::from_fn(|vertex| {
                    std::array::from_fn(|axis| row[side * 9 + vertex * 3 + axis])
                })
            })
        })
        .collect()
}

#[test]
fn random_pairs_of_shen_heng_and_tang() {
    for (name, expected) in [
        ("cases/tri_tri_random_intersected.npy", true),
        ("cases/tri_tri_random_separated.npy", false),
    ] {
        let Some(bytes) = data(name) else { return };
        let pairs = triangle_pairs(&bytes);
        assert_eq!(pairs.len(), 2500);
        for (pair_ix, [a, b]) in pairs.iter().enumerate() {
            assert_eq!(
                triangles_intersect(a, b),
                expected,
                "{name}, pair {pair_ix}"
            );
            assert_eq!(
                triangles_intersect(b, a),
                expected,
                "{name}, pair {pair_ix}, swapped"
            );
        }
    }
}

#[test]
fn special_pairs_of_other_projects() {
    let Some(bytes) = data("cases/tri_tri_special.jsonl") else {
        return;
    };
    let text = String::from_utf8(bytes).expect("JSON in UTF-8");
    let mut n_cases = 0;
    for line in text.lines() {
        let case: serde_json::Value = serde_json::from_str(line).expect("a JSON object a line");
        let triangle = |side: &str| -> [[f64; 3]; 3] {
            std::array::from_fn(|vertex| {
                std::array::from_fn(|axis| case[side][vertex][axis].as_f64().expect("a coordinate"))
            })
        };
        let (a, b) = (triangle("a"), triangle("b"));
        let expected = case["intersects"].as_bool().expect("an answer");
        assert_eq!(triangles_intersect(&a, &b), expected, "{}", case["name"]);
        assert_eq!(
            triangles_intersect(&b, &a),
            expected,
            "{} swapped",
            case["name"]
        );
        assert_eq!(
            crate::oracle::intersect(&a, &b),
            expected,
            "oracle: {}",
            case["name"]
        );
        n_cases += 1;
    }
    assert_eq!(n_cases, 201);
}
