//! The data passed from stage to stage: two clusters that may meet, and the lanes of their elements
//! whose boxes do.

use crate::bvh::GROUP;
use crate::scene::index::{ClusterIx, PartIx};
use impinge_exact::internal::filter::BATCH;

use crate::simd::{Lanes32, Simd};

/// Two clusters that may meet: parts and their clusters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WorkItem {
    pub a: PartIx,
    pub b: PartIx,
    pub cluster_a: ClusterIx,
    pub cluster_b: ClusterIx,
}

/// The candidates of one work item: lanes of its two groups.
#[derive(Debug, Default)]
pub(crate) struct LanePairs {
    lanes: Box<LaneLists>,
    n: usize,
}

#[derive(Debug)]
struct LaneLists {
    a: [u8; MOST_PAIRS],
    b: [u8; MOST_PAIRS],
}

/// All pairs of two groups, and room for lanes that are written or read past the last pair.
const MOST_PAIRS: usize = GROUP * GROUP + GROUP;

impl Default for LaneLists {
    fn default() -> Self {
        LaneLists {
            a: [0; MOST_PAIRS],
            b: [0; MOST_PAIRS],
        }
    }
}

/// The group whose lanes are the rows.
#[derive(Debug, Clone, Copy)]
pub(crate) enum RowSide {
    A,
    B,
}

impl LanePairs {
    /// Takes these candidates, of which there are no more than two groups have.
    #[inline(always)]
    pub fn set(&mut self, lanes: &[[u8; 2]]) {
        let LaneLists { a, b } = &mut *self.lanes;
        for ((&[of_a, of_b], a), b) in lanes.iter().zip(a).zip(b) {
            (*a, *b) = (of_a, of_b);
        }
        self.n = lanes.len().min(MOST_PAIRS - GROUP);
    }

    /// Appends a lane of one group with some lanes of the other.
    #[inline(always)]
    pub fn push_row<S: Simd>(&mut self, simd: S, side: RowSide, row: usize, mask: u64) {
        let LaneLists { a, b } = &mut *self.lanes;
        let (own, other) = match side {
            RowSide::A => (a, b),
            RowSide::B => (b, a),
        };
        own[self.n..][..GROUP].fill(row as u8);
        let list = other[self.n..].first_chunk_mut().expect("padded");
        self.n += simd.list_lanes(mask, list);
    }

    /// As `push_row`, but bit k of the mask stands for lane `map[k]`.
    #[inline(always)]
    pub fn push_mapped_row<S: Simd>(
        &mut self,
        simd: S,
        (side, row): (RowSide, usize),
        mask: u64,
        map: &[u8; GROUP],
    ) {
        let LaneLists { a, b } = &mut *self.lanes;
        let (own, other) = match side {
            RowSide::A => (a, b),
            RowSide::B => (b, a),
        };
        own[self.n..][..GROUP].fill(row as u8);
        let list = other[self.n..].first_chunk_mut().expect("padded");
        self.n += simd.list_mapped(mask, map, list);
    }

    /// Drops candidates that share a vertex, given the vertices of each corner of both groups.
    #[inline(always)]
    pub fn drop_sharing<S: Simd>(&mut self, simd: S, corners: [&[Lanes32]; 2]) {
        let mut n_kept = 0;
        for first in (0..self.n).step_by(BATCH) {
            let dropped = simd.share_16(corners, self.batch(first));
            n_kept = self.keep_batch(simd, first, !dropped, n_kept);
        }
        self.n = n_kept;
    }

    /// Moves some candidates of the batch from `first` on to the slot after the `n_kept` that were
    /// kept before. Returns how many are kept now; [`truncate`](Self::truncate) ends a round of
    /// this.
    #[inline(always)]
    pub fn keep_batch<S: Simd>(
        &mut self,
        simd: S,
        first: usize,
        mask: u16,
        n_kept: usize,
    ) -> usize {
        let [a, b] = self.batch(first);
        let (a, b) = (*a, *b);
        let n = (self.n - first).min(BATCH);
        let kept = mask & u16::MAX >> (BATCH - n);
        // What is written past those that are kept was read before.
        let LaneLists {
            a: into_a,
            b: into_b,
        } = &mut *self.lanes;
        let padded = "padded";
        simd.keep_16(kept, &a, into_a[n_kept..].first_chunk_mut().expect(padded));
        simd.keep_16(kept, &b, into_b[n_kept..].first_chunk_mut().expect(padded));
        n_kept + kept.count_ones() as usize
    }

    /// Drops the candidates that a function refuses.
    pub fn retain(&mut self, keep: impl Fn([u8; 2]) -> bool) {
        let mut n_kept = 0;
        for ix in 0..self.n {
            let lanes = self.lanes(ix);
            (self.lanes.a[n_kept], self.lanes.b[n_kept]) = (lanes[0], lanes[1]);
            n_kept += usize::from(keep(lanes));
        }
        self.n = n_kept;
    }

    /// Forgets all candidates but the first ones.
    #[inline(always)]
    pub fn truncate(&mut self, n: usize) {
        self.n = n;
    }

    /// Bytes held.
    pub const BYTES: usize = size_of::<LaneLists>();

    pub fn clear(&mut self) {
        self.n = 0;
    }

    pub fn len(&self) -> usize {
        self.n
    }

    /// The lanes of a candidate.
    #[inline(always)]
    pub fn lanes(&self, ix: usize) -> [u8; 2] {
        [self.lanes.a[ix], self.lanes.b[ix]]
    }

    /// The lanes of candidates from `first` on; past the last candidate they are arbitrary.
    #[inline(always)]
    pub fn batch(&self, first: usize) -> [&[u8; BATCH]; 2] {
        let LaneLists { a, b } = &*self.lanes;
        [a, b].map(|lanes| lanes[first..].first_chunk().expect("padded"))
    }
}
