//! Published triangle pairs, from the shared data. `None` if the data is absent and
//! `IMPINGE_NO_DATA=1` allows that.

use crate::data::test_file;

/// A triangle as three corners.
pub type Triangle = [[f64; 3]; 3];

/// Two triangles, whether they intersect, and the source of the answer.
pub struct Published {
    /// Corners of both.
    pub triangles: [Triangle; 2],
    /// Whether they share a point.
    pub intersect: bool,
    /// Where the case is from.
    pub name: String,
}

fn bytes(path: &str) -> Option<Vec<u8>> {
    test_file(path).map(|file| std::fs::read(file).unwrap())
}

/// The 2,500 + 2,500 random pairs of Shen, Heng and Tang (2003).
pub fn random_pairs() -> Option<Vec<Published>> {
    let mut pairs = Vec::new();
    for (path, intersect) in [
        ("cases/tri_tri_random_intersected.npy", true),
        ("cases/tri_tri_random_separated.npy", false),
    ] {
        let found = triangle_pairs(&bytes(path)?).into_iter().enumerate();
        pairs.extend(found.map(|(ix, triangles)| Published {
            triangles,
            intersect,
            name: format!("{path}, pair {ix}"),
        }));
    }
    assert_eq!(pairs.len(), 5000);
    Some(pairs)
}

/// 201 coplanar, touching, sharing and degenerate pairs from the tests of other projects.
pub fn special_pairs() -> Option<Vec<Published>> {
    let text = String::from_utf8(bytes("cases/tri_tri_special.jsonl")?).expect("JSON in UTF-8");
    let pairs: Vec<Published> = text
        .lines()
        .map(|line| {
            let case: serde_json::Value = serde_json::from_str(line).expect("a JSON object a line");
            Published {
                triangles: ["a", "b"]
                    .map(|side| serde_json::from_value(case[side].clone()).expect("three corners")),
                intersect: case["intersects"].as_bool().expect("an answer"),
                name: case["name"].to_string(),
            }
        })
        .collect();
    assert_eq!(pairs.len(), 201);
    Some(pairs)
}

/// The rows of a NumPy array file of shape (n, 6, 3), little-endian `f64`, in C order.
fn triangle_pairs(bytes: &[u8]) -> Vec<[Triangle; 2]> {
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
