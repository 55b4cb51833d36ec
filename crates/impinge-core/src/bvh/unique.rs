//! The vertices of each cluster, each once, and the corners of its elements as numbers of those.
//!
//! A sparse set finds what is new: of 192 corners of 64 triangles about 45 are. These are put in
//! ascending order by counting for each how many are lower, which needs no branch and is a few
//! comparisons of whole registers. On the dragon this takes half the time of sorting, and of
//! finding the corners by binary search.
//!
//! Cost: `O(n)` once per topology; while it runs, one byte per vertex of the body and job of the
//! pool.

use std::hint::select_unpredictable;

use super::{CHUNK, GROUP, parallel};

/// Clusters that one of several threads takes at a time.
const BLOCK: usize = 64;

/// The corners of a cluster's elements as numbers of its vertices: `[corner][slot]`. Slots past
/// its size hold 0.
pub(crate) type LocalCorners<const N: usize> = [[u8; GROUP]; N];

/// With four corners per element, the numbers fit a byte.
const _: () = assert!(4 * GROUP <= 256);

/// The vertices of clusters.
#[derive(Debug)]
pub(crate) struct Unique<const N: usize> {
    /// Cluster after cluster. Each run ascends and repeats its last vertex up to a multiple of
    /// [`CHUNK`].
    pub vertices: Vec<u32>,
    /// Where each cluster's run starts, and one past the last.
    pub starts: Vec<u32>,
    /// The corners as numbers of these vertices, if they were asked for.
    pub corners: Vec<LocalCorners<N>>,
}

impl<const N: usize> Unique<N> {
    /// From the corners in the order of the clusters, which are all below `n_vertices`;
    /// `with_corners`, if these are to be numbered too.
    pub fn new(corners: &[[u32; N]], n_vertices: usize, with_corners: bool) -> Self {
        // One block needs no copy.
        let block = match parallel::n_threads() {
            1 => corners.len().max(1),
            _ => BLOCK * GROUP,
        };
        let set = || VertexSet::new(n_vertices);
        let of_block = |set: &mut VertexSet, ix: usize| {
            let corners = &corners[ix * block..];
            of_block(&corners[..corners.len().min(block)], set, with_corners)
        };
        let n_blocks = corners.len().div_ceil(block);
        let mut blocks: Vec<Self> = parallel::made(n_blocks, 1, set, of_block);
        if let [all] = &mut blocks[..] {
            all.vertices.shrink_to_fit();
            return blocks.swap_remove(0);
        }
        let n_clusters = corners.len().div_ceil(GROUP);
        let n_unique = blocks.iter().map(|block| block.vertices.len()).sum();
        let mut all = Self::with_capacity(n_clusters, n_unique, with_corners);
        for block in blocks {
            let first = all.vertices.len() as u32;
            all.vertices.extend_from_slice(&block.vertices);
            all.starts
                .extend(block.starts[1..].iter().map(|end| first + end));
            all.corners.extend_from_slice(&block.corners);
        }
        all
    }

    fn with_capacity(n_clusters: usize, n_vertices: usize, with_corners: bool) -> Self {
        let mut starts = Vec::with_capacity(n_clusters + 1);
        starts.push(0);
        Unique {
            vertices: Vec::with_capacity(n_vertices),
            starts,
            corners: Vec::with_capacity(if with_corners { n_clusters } else { 0 }),
        }
    }

    fn push(&mut self, group: &[[u32; N]], set: &mut VertexSet, with_corners: bool) {
        let mut local = [[0; GROUP]; N];
        set.number(group, &mut local);
        let start = self.vertices.len();
        let ranks = set.sort_into(&mut self.vertices);
        if with_corners {
            for of_corner in &mut local {
                for number in &mut of_corner[..group.len()] {
                    *number = ranks[usize::from(*number)];
                }
            }
            self.corners.push(local);
        }
        debug_assert!(self.vertices[start..].is_sorted());
        self.starts.push(self.vertices.len() as u32);
    }
}

fn of_block<const N: usize>(
    corners: &[[u32; N]],
    set: &mut VertexSet,
    with_corners: bool,
) -> Unique<N> {
    let n_clusters = corners.len().div_ceil(GROUP);
    let mut unique = Unique::with_capacity(n_clusters, n_clusters * GROUP, with_corners);
    for group in corners.chunks(GROUP) {
        unique.push(group, set, with_corners);
    }
    unique
}

/// The vertices of a cluster seen so far, numbered as they come: a sparse set (Briggs, Torczon, An
/// efficient representation for sparse sets, 1993). It never has to be cleared: a vertex is in the
/// set if the number in its slot leads back to it.
struct VertexSet {
    /// For each vertex of the body its number, or what an earlier cluster left.
    numbers: Vec<u8>,
    /// The vertices by number, else [`NONE`](VertexSet::NONE). The highest bit is inverted:
    /// registers compare signed numbers.
    found: [i32; 4 * GROUP],
    n: usize,
}

impl VertexSet {
    /// No vertex: bodies have fewer.
    const NONE: i32 = i32::MAX;

    fn new(n_vertices: usize) -> Self {
        VertexSet {
            numbers: vec![0; n_vertices],
            found: [VertexSet::NONE; 4 * GROUP],
            n: 0,
        }
    }

    /// Numbers the vertices of a cluster as they come, and writes the number of each corner.
    ///
    /// Whether a vertex is new cannot be predicted, so nothing branches on it. The counter stays in
    /// a register: in memory, each corner would wait for the one before it.
    #[inline(always)]
    fn number<const N: usize>(&mut self, group: &[[u32; N]], local: &mut LocalCorners<N>) {
        self.found.fill(VertexSet::NONE);
        let mut n = 0;
        for (slot, element) in group.iter().enumerate() {
            for (of_corner, &vertex) in local.iter_mut().zip(element) {
                let entry = &mut self.numbers[vertex as usize];
                let signed = vertex as i32 ^ i32::MIN;
                let is_new = self.found[usize::from(*entry)] != signed;
                let number = select_unpredictable(is_new, n as u8, *entry);
                *entry = number;
                self.found[n % (4 * GROUP)] = signed;
                n += usize::from(is_new);
                of_corner[slot] = number;
            }
        }
        self.n = n;
    }

    /// Appends the vertices in ascending order, padded to whole chunks. Returns the slot of each
    /// number.
    fn sort_into(&mut self, vertices: &mut Vec<u32>) -> [u8; 4 * GROUP] {
        let n = self.n;
        let padded = n.next_multiple_of(CHUNK);
        self.found[n..padded].fill(i32::MAX);
        let start = vertices.len();
        vertices.resize(start + padded, 0);
        let run = &mut vertices[start..];
        let mut ranks = [0; 4 * GROUP];
        let chunks = self.found[..padded].as_chunks::<CHUNK>().0;
        for (chunk, of_chunk) in chunks.iter().zip(ranks.as_chunks_mut::<CHUNK>().0) {
            let mut lower = [0; CHUNK];
            for &vertex in &self.found[..n] {
                for lane in 0..CHUNK {
                    lower[lane] += i32::from(vertex < chunk[lane]);
                }
            }
            *of_chunk = lower.map(|rank| rank as u8);
        }
        for (&vertex, &rank) in self.found[..n].iter().zip(&ranks) {
            run[usize::from(rank)] = (vertex ^ i32::MIN) as u32;
        }
        let last = run[n - 1];
        run[n..].fill(last);
        ranks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look random, by Weyl's sequence.
    fn scattered(n: usize, below: u32) -> Vec<[u32; 3]> {
        let number = |k: usize| {
            let mixed = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            (((mixed >> 32) * u64::from(below)) >> 32) as u32
        };
        (0..n)
            .map(|k| [number(3 * k), number(3 * k + 1), number(3 * k + 2)])
            .collect()
    }

    /// Bodies with this many vertices need too much memory for a test.
    #[test]
    fn the_highest_numbers_are_sorted_too() {
        let vertices = [u32::MAX - 1, 0, u32::MAX - 2, 1 << 31, (1 << 31) - 1, 7];
        let mut set = VertexSet::new(0);
        for (found, vertex) in set.found.iter_mut().zip(vertices) {
            *found = vertex as i32 ^ i32::MIN;
        }
        set.n = vertices.len();
        let mut sorted = Vec::new();
        let ranks = set.sort_into(&mut sorted);
        assert!(sorted.is_sorted() && sorted.len() == CHUNK);
        for (vertex, rank) in vertices.into_iter().zip(ranks) {
            assert_eq!(sorted[usize::from(rank)], vertex);
        }
    }

    /// All different, all equal, and clusters and blocks that are not full; with one thread and
    /// with two.
    #[test]
    fn vertices_ascend_once_each_and_corners_name_them() {
        let highest = vec![[1 << 20, 0, (1 << 20) - 1], [1, 1 << 19, 7]];
        let different: Vec<[u32; 3]> = (0..64).map(|k| [3 * k + 2, 3 * k, 3 * k + 1]).collect();
        let cases = [
            Vec::new(),
            highest,
            different,
            vec![[5; 3]; 130],
            scattered(BLOCK * GROUP + 100, 60),
            scattered(2 * BLOCK * GROUP + 1, 1 << 20),
        ];
        for faces in cases {
            let [unique, alone] = [(1, true), (2, false)].map(|(n_threads, with_corners)| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads);
                let make = || Unique::new(&faces, 1 + (1 << 20), with_corners);
                pool.build().expect("threads").install(make)
            });
            assert_eq!(alone.vertices, unique.vertices);
            assert!(alone.starts == unique.starts && alone.corners.is_empty());
            assert_eq!(unique.starts.len(), faces.len().div_ceil(GROUP) + 1);
            for (cluster, group) in faces.chunks(GROUP).enumerate() {
                let run = unique.starts[cluster] as usize..unique.starts[cluster + 1] as usize;
                let mut expected = group.as_flattened().to_vec();
                expected.sort_unstable();
                expected.dedup();
                let last = expected[expected.len() - 1];
                expected.resize(expected.len().next_multiple_of(CHUNK), last);
                assert_eq!(unique.vertices[run], expected);
                for (slot, face) in group.iter().enumerate() {
                    let numbers = unique.corners[cluster].map(|of_corner| of_corner[slot]);
                    assert_eq!(numbers.map(|number| expected[usize::from(number)]), *face);
                }
            }
        }
    }
}
