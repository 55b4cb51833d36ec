//! Welding: vertices at the same position become one.
//!
//! The crates `impinge` and `impinge-io` re-export [`Weld`]; it stands in a crate of its own so
//! that neither needs the other.

#![warn(missing_debug_implementations)]

use std::collections::HashMap;
use std::hash::{BuildHasher, Hash, Hasher, RandomState};

/// A map from vertices to welded vertices: vertices at the same position become one.
///
/// Many files, and the meshes of renderers, repeat a vertex along each seam. Such vertices are
/// different ones, so the faces on both sides of a seam touch but are no neighbours. Welding makes
/// neighbours of them. Elements keep their number and order, so their ids do not change; elements
/// whose corners are welded become degenerate and stay.
///
/// Keep the map for later frames: [`positions`](Weld::positions) converts the positions of any
/// frame to those of the welded mesh.
///
/// ```
/// use impinge::Weld;
/// # fn main() -> Result<(), impinge::WrongNumber> {
/// let positions = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, -0.0], [1.0, 1.0, 0.0]];
/// let faces = [[0, 1, 2], [3, 5, 4]];
/// let weld = Weld::by_position(&positions);
/// assert_eq!((weld.n_welded(), weld.map()), (2, &[0, 1, 2, 1, 2, 3][..]));
/// assert_eq!(weld.apply(&faces), [[0, 1, 2], [1, 3, 2]]);
/// assert_eq!(weld.positions(&positions)?.len(), 4);
/// # Ok(()) }
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Weld {
    /// The welded vertex of each vertex.
    map: Vec<u32>,
    /// For each welded vertex the first vertex that it came from; ascending.
    firsts: Vec<u32>,
}

/// As many positions are needed as were welded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{given} positions given for a weld of {expected} vertices")]
#[non_exhaustive]
pub struct WrongNumber {
    /// How many positions were given.
    pub given: usize,
    /// How many vertices the welding was computed from.
    pub expected: usize,
}

impl Weld {
    /// Welds vertices whose coordinates are all equal as numbers (-0.0 equals 0.0), without a
    /// tolerance. Of equal vertices the first one stays, and the order of vertices is kept. NaN
    /// equals nothing, so a vertex with NaN is never welded.
    pub fn by_position<R: Coordinate>(positions: &[[R; 3]]) -> Self {
        Self::by_key(positions.iter().map(|position| position.map(R::key)))
    }

    /// The keys of equal vertices are equal; a key with a `None` equals no other.
    fn by_key<T: Copy + Eq + Hash>(keys: impl ExactSizeIterator<Item = [Option<T>; 3]>) -> Self {
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

    /// Welds only vertices that both weldings weld: given two poses of the same vertices, those
    /// that coincide in both.
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

    /// For each vertex after the welding, the first vertex before it that is at its position;
    /// ascending.
    pub fn firsts(&self) -> &[u32] {
        &self.firsts
    }

    /// The welded vertex of a vertex. An index that is out of range stays so, because welding only
    /// removes vertices.
    #[inline]
    pub fn index(&self, vertex: u32) -> u32 {
        self.map.get(vertex as usize).copied().unwrap_or(vertex)
    }

    /// Elements (edges, faces, tetrahedra) with the indices of the welded vertices, in the same
    /// order.
    pub fn apply<const N: usize>(&self, elements: &[[u32; N]]) -> Vec<[u32; N]> {
        let welded = |corners: &[u32; N]| corners.map(|vertex| self.index(vertex));
        elements.iter().map(welded).collect()
    }

    /// The positions of the welded vertices, taken from those of all vertices, of any frame.
    ///
    /// # Errors
    /// Not as many positions as were welded.
    pub fn positions<P: Copy>(&self, positions: &[P]) -> Result<Vec<P>, WrongNumber> {
        if positions.len() != self.map.len() {
            return Err(WrongNumber {
                given: positions.len(),
                expected: self.map.len(),
            });
        }
        Ok(self
            .firsts
            .iter()
            .map(|&ix| positions[ix as usize])
            .collect())
    }

    /// Two welded vertices that have different positions in `positions`; `None` if there are none,
    /// or if these are the positions of another number of vertices.
    ///
    /// In a later frame this means that the mesh comes apart at a welded vertex.
    pub fn torn<P: PartialEq>(&self, positions: &[P]) -> Option<[u32; 2]> {
        if positions.len() != self.map.len() {
            return None;
        }
        (0u32..).zip(&self.map).find_map(|(ix, &welded)| {
            let first = *self.firsts.get(welded as usize)?;
            let (a, b) = (positions.get(first as usize)?, positions.get(ix as usize)?);
            (a != b).then_some([first, ix])
        })
    }
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32` or `f64`.
pub trait Coordinate: sealed::Sealed + Copy {
    #[doc(hidden)]
    type Key: Copy + Eq + Hash;
    /// Equal for equal numbers; `None` for NaN.
    #[doc(hidden)]
    fn key(self) -> Option<Self::Key>;
}

impl Coordinate for f32 {
    type Key = u32;

    #[inline]
    fn key(self) -> Option<u32> {
        // Adding 0.0 turns -0.0 into 0.0 and changes nothing else.
        (!self.is_nan()).then_some((self + 0.0).to_bits())
    }
}

impl Coordinate for f64 {
    type Key = u64;

    #[inline]
    fn key(self) -> Option<u64> {
        (!self.is_nan()).then_some((self + 0.0).to_bits())
    }
}

/// The seed of a [`Mix`], random for each weld, so that nobody can prepare a file whose vertices
/// collide in the hash table. The result does not depend on it.
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

/// A short multiplicative hash of the bits of coordinates. The standard library's hash took most of
/// the time of a weld.
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
        // A folded 128-bit product: every bit of the input affects the high and the low bits, which
        // the hash table uses.
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
    fn what_differs_in_the_last_bit_stays_apart() {
        let near = 1.0f64.next_up();
        let weld = Weld::by_position(&[
            [1.0; 3],
            [near, 1.0, 1.0],
            [f64::NAN; 3],
            [f64::NAN; 3],
            [1.0; 3],
        ]);
        assert_eq!(weld.map(), [0, 1, 2, 3, 0]);
        assert_eq!(weld.firsts(), [0, 1, 2, 3]);
    }

    #[test]
    fn elements_keep_their_order_and_bad_indices_stay_bad() {
        let weld = Weld::by_position(&[[0.0f32; 3], [1.0; 3], [0.0; 3]]);
        assert_eq!(
            weld.apply(&[[2, 1], [1, 2], [3, 7]]),
            [[0, 1], [1, 0], [3, 7]]
        );
    }

    #[test]
    fn other_frames_are_welded_alike() {
        let weld = Weld::by_position(&[[0.0f32; 3], [0.0; 3], [1.0; 3]]);
        let frame = [[5.0f64; 3], [6.0; 3], [7.0; 3]];
        assert_eq!(weld.positions(&frame), Ok(vec![[5.0; 3], [7.0; 3]]));
        assert_eq!(weld.torn(&frame), Some([0, 1]));
        // Positions of another number of vertices say nothing of these.
        let other = [&frame[..], &frame[..1]].concat();
        assert_eq!(weld.torn(&other), None);
        let error = weld.positions(&frame[..2]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "2 positions given for a weld of 3 vertices"
        );
    }

    #[test]
    fn two_poses_weld_what_coincides_in_both() {
        let start = Weld::by_position(&[[0.0f32; 3], [0.0; 3], [0.0; 3]]);
        let end = Weld::by_position(&[[1.0f32; 3], [0.0; 3], [1.0; 3]]);
        assert_eq!(start.and(&end).map(), [0, 1, 0]);
    }
}
