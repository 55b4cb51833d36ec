//! A mesh as plain arrays, and the welding of its vertices.

use std::collections::HashMap;
use std::hash::{BuildHasher, Hasher, RandomState};

/// Vertex positions in the precision of their file: binary `float` stays f32; text is read as f64, so that no coordinate is
/// silently rounded to f32.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// One `[x, y, z]` per vertex, in the file's unit of length.
    F32(Vec<[f32; 3]>),
    /// One `[x, y, z]` per vertex, in the file's unit of length.
    F64(Vec<[f64; 3]>),
}

impl Positions {
    /// How many vertices there are.
    pub fn len(&self) -> usize {
        match self {
            Positions::F32(p) => p.len(),
            Positions::F64(p) => p.len(),
        }
    }

    /// Whether there are no vertices.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The position of vertex `ix` in f64, which holds every f32 exactly; `None` if there is no such vertex.
    pub fn get(&self, ix: usize) -> Option<[f64; 3]> {
        match self {
            Positions::F32(p) => p.get(ix).map(|v| v.map(f64::from)),
            Positions::F64(p) => p.get(ix).copied(),
        }
    }

    /// All positions in f64, without loss.
    pub fn to_f64(&self) -> Vec<[f64; 3]> {
        match self {
            Positions::F32(p) => p.iter().map(|v| v.map(f64::from)).collect(),
            Positions::F64(p) => p.clone(),
        }
    }

    /// All positions in f32, each coordinate rounded to the nearest. Lossless for `F32`, and for `F64` if and only if
    /// [`narrow_if_exact`](Self::narrow_if_exact) would narrow.
    pub fn to_f32_rounded(&self) -> Vec<[f32; 3]> {
        match self {
            Positions::F32(p) => p.clone(),
            Positions::F64(p) => p.iter().map(|v| v.map(nearest_f32)).collect(),
        }
    }

    /// Converts `F64` to `F32` if every coordinate is exactly representable in f32. Returns whether the positions are f32 now.
    ///
    /// No coordinate changes its value, so no answer about the mesh changes; this halves the memory.
    pub fn narrow_if_exact(&mut self) -> bool {
        let Positions::F64(wide) = self else {
            return true;
        };
        let exact = |v: &[f64; 3]| v.iter().all(|&c| f64::from(nearest_f32(c)) == c);
        if !wide.iter().all(exact) {
            return false;
        }
        *self = Positions::F32(self.to_f32_rounded());
        true
    }
}

/// The f32 nearest to `value`. This is the only place where this crate rounds a coordinate.
fn nearest_f32(value: f64) -> f32 {
    value as f32
}

/// The primitives of a mesh: vertex indices counted from 0, in the order of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Elements {
    /// Three vertices per triangle.
    Triangles(Vec<[u32; 3]>),
    /// Four vertices per tetrahedron.
    Tetrahedra(Vec<[u32; 4]>),
}

impl Elements {
    /// How many primitives there are.
    pub fn len(&self) -> usize {
        match self {
            Elements::Triangles(t) => t.len(),
            Elements::Tetrahedra(t) => t.len(),
        }
    }

    /// Whether there are no primitives.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All vertex indices, primitive by primitive.
    pub fn indices(&self) -> &[u32] {
        match self {
            Elements::Triangles(t) => t.as_flattened(),
            Elements::Tetrahedra(t) => t.as_flattened(),
        }
    }

    pub(crate) fn indices_mut(&mut self) -> &mut [u32] {
        match self {
            Elements::Triangles(t) => t.as_flattened_mut(),
            Elements::Tetrahedra(t) => t.as_flattened_mut(),
        }
    }
}

/// One body: vertices and primitives. Readers guarantee that every index is in range and every coordinate is finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// The positions of the vertices.
    pub positions: Positions,
    /// The vertices of each primitive.
    pub elements: Elements,
}

impl Mesh {
    /// How many vertices there are.
    pub fn n_vertices(&self) -> usize {
        self.positions.len()
    }

    /// How many primitives there are.
    pub fn n_primitives(&self) -> usize {
        self.elements.len()
    }
}

/// A map from vertices to welded vertices: vertices at the same position become one.
///
/// Keep it for reading a sequence: the frames have the vertices of the file, and [`Weld::positions`] converts them to those of
/// the welded mesh.
///
/// ```
/// use impinge_io::{Positions, Weld};
/// let positions = Positions::F32(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-0.0, 0.0, 0.0]]);
/// let weld = Weld::by_position(&positions);
/// assert_eq!(weld.n_welded(), 1);
/// assert_eq!(weld.map(), [0, 1, 0]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Weld {
    /// The welded vertex of each vertex.
    map: Vec<u32>,
    /// For each welded vertex the first vertex that it came from; ascending.
    firsts: Vec<u32>,
}

impl Weld {
    /// Welds vertices whose coordinates are all equal as numbers (-0.0 equals 0.0). Of equal vertices the first one stays, and
    /// the order of vertices is kept. NaN equals nothing, so a vertex with NaN is never welded.
    pub fn by_position(positions: &Positions) -> Self {
        match positions {
            Positions::F32(p) => Self::by_key(
                p.iter()
                    .map(|v| v.map(|c| (!c.is_nan()).then_some((c + 0.0).to_bits()))),
            ),
            Positions::F64(p) => Self::by_key(
                p.iter()
                    .map(|v| v.map(|c| (!c.is_nan()).then_some((c + 0.0).to_bits()))),
            ),
        }
    }

    /// The keys are the bits of `c + 0.0`, which turns -0.0 into 0.0 and nothing else; `None` equals nothing.
    fn by_key<T: Copy + Eq + std::hash::Hash>(
        keys: impl ExactSizeIterator<Item = [Option<T>; 3]>,
    ) -> Self {
        let mut seen: HashMap<[T; 3], u32, Seed> =
            HashMap::with_capacity_and_hasher(keys.len(), Seed::random());
        let mut map = Vec::with_capacity(keys.len());
        let mut firsts: Vec<u32> = Vec::new();
        for (ix, key) in (0u32..).zip(keys) {
            let fresh = firsts.len() as u32;
            let welded = match key {
                [Some(x), Some(y), Some(z)] => *seen.entry([x, y, z]).or_insert(fresh),
                _ => fresh,
            };
            if welded == fresh {
                firsts.push(ix);
            }
            map.push(welded);
        }
        Weld { map, firsts }
    }

    /// Welds only vertices that both weldings weld: given two poses of the same vertices, those that coincide in both.
    ///
    /// # Panics
    /// If the two weldings have different numbers of vertices.
    pub fn and(&self, other: &Weld) -> Self {
        assert_eq!(self.map.len(), other.map.len(), "of the same vertices");
        let both = self.map.iter().zip(&other.map);
        Self::by_key(both.map(|(&a, &b)| [Some(a), Some(b), Some(0)]))
    }

    /// How many vertices the welding removed.
    pub fn n_welded(&self) -> usize {
        self.map.len() - self.firsts.len()
    }

    /// For each vertex before the welding, its index after it.
    pub fn map(&self) -> &[u32] {
        &self.map
    }

    /// Welds the mesh that this welding was computed from: its vertices, and the indices of its primitives.
    pub fn apply(&self, mesh: &mut Mesh) {
        if self.n_welded() == 0 {
            return;
        }
        if let Some(positions) = self.positions(&mesh.positions) {
            mesh.positions = positions;
            for ix in mesh.elements.indices_mut() {
                // An index out of range stays out of range, because welding only removes vertices.
                if let Some(&welded) = self.map.get(*ix as usize) {
                    *ix = welded;
                }
            }
        }
    }

    /// Two welded vertices that have different positions in `positions`; `None` if there are none.
    ///
    /// In a frame of a sequence this means that the mesh comes apart at a welded vertex.
    pub fn torn(&self, positions: &Positions) -> Option<[u32; 2]> {
        (0u32..).zip(&self.map).find_map(|(ix, &welded)| {
            let first = *self.firsts.get(welded as usize)?;
            let (a, b) = (positions.get(first as usize)?, positions.get(ix as usize)?);
            (a != b).then_some([first, ix])
        })
    }

    /// The positions of the welded vertices, taken from those of all vertices (of any frame); `None` if their number differs.
    pub fn positions(&self, positions: &Positions) -> Option<Positions> {
        if positions.len() != self.map.len() {
            return None;
        }
        Some(match positions {
            Positions::F32(p) => {
                Positions::F32(self.firsts.iter().map(|&ix| p[ix as usize]).collect())
            }
            Positions::F64(p) => {
                Positions::F64(self.firsts.iter().map(|&ix| p[ix as usize]).collect())
            }
        })
    }
}

/// Welds the vertices of `mesh` that are at the same position (compared as numbers, exactly) and returns how many it removed.
///
/// Primitives keep their number and order, so their ids do not change; primitives whose corners are welded become
/// degenerate and stay. To weld the frames of a sequence in the same way, see [`Weld`].
pub fn weld(mesh: &mut Mesh) -> usize {
    let weld = Weld::by_position(&mesh.positions);
    weld.apply(mesh);
    weld.n_welded()
}

/// The seed of a [`Mix`], random for each weld, so that nobody can prepare a file whose vertices collide in the hash table. The
/// result does not depend on it.
struct Seed(u64);

impl Seed {
    fn random() -> Self {
        Seed(RandomState::new().hash_one(0u64))
    }
}

impl BuildHasher for Seed {
    type Hasher = Mix;

    fn build_hasher(&self) -> Mix {
        Mix(self.0)
    }
}

/// A short multiplicative hash of the bits of coordinates. The standard library's hash took most of the time of a weld.
struct Mix(u64);

impl Hasher for Mix {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u32(&mut self, word: u32) {
        self.write_u64(u64::from(word));
    }

    fn write_u64(&mut self, word: u64) {
        // A folded 128-bit product: every bit of the input affects the high and the low bits, which the hash table uses.
        let product = u128::from(self.0 ^ word ^ 0x9E37_79B9_7F4A_7C15)
            * u128::from(0xD6E8_FEB8_6659_FD93_u64);
        self.0 = (product as u64) ^ ((product >> 64) as u64);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weld_keeps_first_occurrences_and_primitive_order() {
        let mut mesh = Mesh {
            positions: Positions::F64(vec![
                [1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0],
                [1.0, -0.0, 0.0],
                [0.0, 2.0, 0.0],
                [0.0, 0.0, -0.0],
            ]),
            elements: Elements::Triangles(vec![[0, 1, 3], [2, 4, 3], [1, 4, 0]]),
        };
        assert_eq!(weld(&mut mesh), 2);
        assert_eq!(
            mesh.positions,
            Positions::F64(vec![[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
        );
        assert_eq!(
            mesh.elements,
            Elements::Triangles(vec![[0, 1, 2], [0, 1, 2], [1, 1, 0]])
        );
        assert_eq!(weld(&mut mesh), 0);
    }

    #[test]
    fn weld_separates_what_differs_in_the_last_bit() {
        let near = f64::from_bits(1.0f64.to_bits() + 1);
        let weld = Weld::by_position(&Positions::F64(vec![
            [1.0; 3],
            [near, 1.0, 1.0],
            [f64::NAN; 3],
            [f64::NAN; 3],
            [1.0; 3],
        ]));
        assert_eq!(weld.map(), [0, 1, 2, 3, 0]);
    }

    #[test]
    fn weld_applies_to_other_frames() {
        let weld = Weld::by_position(&Positions::F32(vec![[0.0; 3], [0.0; 3], [1.0; 3]]));
        let frame = Positions::F64(vec![[5.0; 3], [6.0; 3], [7.0; 3]]);
        assert_eq!(
            weld.positions(&frame),
            Some(Positions::F64(vec![[5.0; 3], [7.0; 3]]))
        );
        assert_eq!(weld.positions(&Positions::F32(vec![])), None);
    }

    #[test]
    fn narrowing_is_lossless_or_does_not_happen() {
        let mut exact = Positions::F64(vec![[0.5, -0.25, 1e30f32 as f64]]);
        assert!(exact.narrow_if_exact());
        assert_eq!(exact, Positions::F32(vec![[0.5, -0.25, 1e30]]));
        let mut inexact = Positions::F64(vec![[0.5, 0.1, 0.0]]);
        assert!(!inexact.narrow_if_exact());
        assert_eq!(inexact, Positions::F64(vec![[0.5, 0.1, 0.0]]));
        let mut huge = Positions::F64(vec![[1e300, 0.0, 0.0]]);
        assert!(!huge.narrow_if_exact());
        let mut tiny = Positions::F64(vec![[1e-60, 0.0, 0.0]]);
        assert!(!tiny.narrow_if_exact());
    }
}
