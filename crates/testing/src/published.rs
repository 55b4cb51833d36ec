//! Published triangle pairs, from the shared data. `None` if the data is absent and
//! `IMPINGE_NO_DATA=1` allows that.

use std::path::Path;

use crate::data::test_file;
use crate::npy;

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

/// The rows `[0, a, 1, b]` of a NumPy array file of pairs: a triangle of each of two bodies.
pub fn rows_of_two_bodies(file: &Path) -> Vec<[u32; 4]> {
    let pairs = npy::rows(&std::fs::read(file).unwrap(), "<u4", u32::from_le_bytes);
    pairs.into_iter().map(|[a, b]| [0, a, 1, b]).collect()
}

/// The rows of a NumPy array file of shape (n, 6, 3), little-endian `f64`, in C order.
fn triangle_pairs(bytes: &[u8]) -> Vec<[Triangle; 2]> {
    let rows = npy::rows::<_, 18, 8>(bytes, "<f8", f64::from_le_bytes);
    let (header, _) = npy::split(bytes);
    assert!(header.contains(", 6, 3)"), "{header}");
    rows.iter()
        .map(|row| {
            std::array::from_fn(|side| {
                std::array::from_fn(|vertex| {
                    std::array::from_fn(|axis| row[side * 9 + vertex * 3 + axis])
                })
            })
        })
        .collect()
}
