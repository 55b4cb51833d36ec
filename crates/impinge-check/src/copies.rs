//! Elements with the same vertices, and what pairs of a few of them say about all of them.
//!
//! Whether a pair of elements counts depends on their vertices alone, not on the order in which
//! they name them. So of elements with the same vertices only two are tested: their pair speaks
//! for every pair of them, and the first one's pairs with other elements for those of all. A
//! million equal triangles are 5 · 10^11 pairs, which no memory holds.

use std::ops::Range;

use crate::by_vertex::ByVertex;

/// More pairs than this are counted without their hash, which takes a nanosecond or two per pair.
const MOST_HASHED: u64 = 1 << 32;

/// The sets of elements with the same vertices, in any order.
#[derive(Debug, Default)]
pub struct Copies {
    /// The elements of each set of several, ascending, set after set.
    members: Vec<u32>,
    sets: Vec<Range<usize>>,
}

impl Copies {
    /// Finds them. Indices must be in range.
    pub fn new<const K: usize>(elements: &[[u32; K]], n_vertices: usize) -> Self {
        let sorted = |corners: &[u32; K]| {
            let mut key = *corners;
            key.sort_unstable();
            key
        };
        let named = (0u32..).zip(elements);
        let by_first = ByVertex::new(
            n_vertices,
            named.map(|(element, corners)| (sorted(corners)[0], element)),
        );
        let mut copies = Copies::default();
        let mut run = Vec::new();
        for members in by_first.iter() {
            run.clear();
            run.extend(members.iter().map(|&e| (sorted(&elements[e as usize]), e)));
            run.sort_unstable();
            for same in run
                .chunk_by(|a, b| a.0 == b.0)
                .filter(|same| same.len() > 1)
            {
                let start = copies.members.len();
                copies
                    .members
                    .extend(same.iter().map(|&(_, element)| element));
                copies.sets.push(start..copies.members.len());
            }
        }
        copies
    }

    /// The sets of at least two elements, which are ascending in each.
    pub fn sets(&self) -> impl Iterator<Item = &[u32]> {
        self.sets.iter().map(|set| &self.members[set.clone()])
    }

    /// The tests of a mesh of `n` elements; `None` if no test can be left out.
    pub fn few(&self, n: usize) -> Option<Few<'_>> {
        let large = || (0u32..).zip(self.sets()).filter(|(_, set)| set.len() > 2);
        large().next()?;
        let mut set_of = vec![ALONE; n];
        let mut is_kept = vec![true; n];
        for (ix, set) in large() {
            for &member in set {
                set_of[member as usize] = ix;
            }
            for &member in &set[2..] {
                is_kept[member as usize] = false;
            }
        }
        let kept = (0u32..).zip(is_kept).filter(|(_, kept)| *kept);
        Some(Few {
            copies: self,
            kept: kept.map(|(element, _)| element).collect(),
            set_of,
        })
    }
}

/// The set of an element that speaks for itself.
const ALONE: u32 = u32::MAX;

/// A mesh without the third and later elements of each set.
pub struct Few<'a> {
    copies: &'a Copies,
    /// The numbers of the elements that are left, ascending.
    pub kept: Vec<u32>,
    set_of: Vec<u32>,
}

/// The pairs for which one pair speaks.
pub enum Pairs<'a> {
    /// Every two elements of a set.
    Within(&'a [u32]),
    /// Every element of the one with every element of the other.
    Between(&'a [u32], &'a [u32]),
}

impl Few<'_> {
    /// The pairs for which a pair of [`kept`](Few::kept) places speaks.
    pub fn pairs(&self, pair: [u32; 2]) -> Pairs<'_> {
        let [a, b] = pair.map(|place| &self.kept[place as usize]);
        let [set_a, set_b] = [a, b].map(|element| self.set_of[*element as usize]);
        let set = |ix: u32| &self.copies.members[self.copies.sets[ix as usize].clone()];
        if set_a == set_b && set_a != ALONE {
            return Pairs::Within(set(set_a));
        }
        let side = |element, ix: u32| match ix {
            ALONE => std::slice::from_ref(element),
            _ if set(ix)[0] == *element => set(ix),
            // The first one speaks for all.
            _ => &[],
        };
        Pairs::Between(side(a, set_a), side(b, set_b))
    }

    /// How many pairs these pairs speak for, and the hash of those pairs unless they are too many.
    pub fn count(&self, pairs: impl Iterator<Item = [u32; 2]> + Clone) -> (u64, Option<u64>) {
        let n = pairs.clone().map(|pair| self.pairs(pair).len()).sum();
        let hash = |pair| self.pairs(pair).hash();
        let hashes = (n <= MOST_HASHED).then(|| pairs.map(hash).fold(0, u64::wrapping_add));
        (n, hashes)
    }
}

impl<'a> Pairs<'a> {
    fn len(&self) -> u64 {
        match self {
            Pairs::Within(set) => set.len() as u64 * (set.len() as u64 - 1) / 2,
            Pairs::Between(a, b) => a.len() as u64 * b.len() as u64,
        }
    }

    fn hash(&self) -> u64 {
        let row = |a: u32, b: u32| [0, a.min(b), 0, a.max(b)];
        match self {
            Pairs::Within(set) => impinge::hash_rows(
                (1..set.len()).flat_map(|ix| set[..ix].iter().map(move |&a| row(a, set[ix]))),
            ),
            Pairs::Between(a, b) => {
                impinge::hash_rows(a.iter().flat_map(|&a| b.iter().map(move |&b| row(a, b))))
            }
        }
    }

    /// The two sides whose elements are in a pair: each wholly, or none.
    pub fn sides(&self) -> [&'a [u32]; 2] {
        match *self {
            Pairs::Within(set) => [set, &[]],
            Pairs::Between(a, b) if a.is_empty() || b.is_empty() => [&[], &[]],
            Pairs::Between(a, b) => [a, b],
        }
    }
}
