//! All pairs of a cell: every element of one body against every element of the other.
//!
//! In: runs of the sorted entries. Out: candidates, which the exact test decides in runs of about a
//! thousand, while they are in the cache. A small cell is two loops of box tests. In a larger one
//! the boxes of 64 elements of `b` are laid out in lanes, and an element of `a` is tested
//! against 8 or 16 of them at a time. Cost: `n_a n_b` box tests per cell. The method culls nothing
//! before them.

use std::sync::Arc;

use impinge_core::bvh::GROUP;
use impinge_core::bvh::bounds::Aabb;
use impinge_core::bvh::grid::Grid;
use impinge_core::cpu::cull_map::InRegion;
use impinge_core::cpu::narrow::{Candidate, Decider};
use impinge_core::cpu::world::World;
use impinge_core::search::sink::Answer;
use impinge_core::simd::{Isa, LaneBounds, masks};

/// Up to this many box tests, laying out lanes does not pay.
const FEW: usize = 24;

/// The entries of one cell with elements of both bodies, with at most one group of `a`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    pub cell: u32,
    /// Entries `first_a .. end_a` belong to body `a`; at most a group of them.
    pub first_a: u32,
    pub end_a: u32,
    /// Entries `first_b .. end_b` belong to body `b`.
    pub first_b: u32,
    pub end_b: u32,
}

/// The data from which the pairs of a cell are read.
#[derive(Clone, Copy)]
pub(crate) struct Lists<'a> {
    pub world: World<'a>,
    pub grid: &'a Grid,
    pub kept: &'a [InRegion],
    /// `cell << 32 | slot in kept`, sorted.
    pub entries: &'a [u64],
    /// Whether a pair is tested in only one of its cells.
    pub owner_rule: bool,
}

/// Scratch memory of one worker.
#[derive(Debug)]
pub(crate) struct Scratch {
    pub decider: Decider,
    pub n_box_tests: u64,
    lanes: LaneBounds,
    boxes: Vec<Aabb>,
    masks: [u64; GROUP],
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch {
            decider: Decider::default(),
            n_box_tests: 0,
            lanes: LaneBounds::EMPTY,
            boxes: Vec::with_capacity(GROUP),
            masks: [0; GROUP],
        }
    }
}

impl Scratch {
    pub fn begin(&mut self, answer: &Arc<Answer>) {
        self.decider.begin(answer, &impinge_core::Tuning::default());
        self.n_box_tests = 0;
    }

    pub fn bytes(&self) -> usize {
        size_of::<Scratch>() + self.decider.bytes() + size_of::<Aabb>() * self.boxes.capacity()
    }

    /// Tests the boxes of all pairs of these cells, and decides the candidates.
    pub fn pair(&mut self, isa: Isa, lists: Lists<'_>, runs: &[Run]) {
        for run in runs {
            let a = &lists.entries[run.first_a as usize..run.end_a as usize];
            let b = &lists.entries[run.first_b as usize..run.end_b as usize];
            self.n_box_tests += a.len() as u64 * b.len() as u64;
            if a.len() * b.len() <= FEW {
                self.pair_few(lists, run.cell, a, b);
            } else {
                self.pair_many(isa, lists, run.cell, a, b);
            }
            self.decider.decide_when_full(isa, lists.world);
        }
        self.decider.decide(isa, lists.world);
    }

    fn pair_few(&mut self, lists: Lists<'_>, cell: u32, a: &[u64], b: &[u64]) {
        for &entry_a in a {
            let kept_a = lists.kept(entry_a);
            for &entry_b in b {
                let kept_b = lists.kept(entry_b);
                if kept_a.bounds.overlaps(&kept_b.bounds) {
                    self.put(lists, cell, kept_a, kept_b);
                }
            }
        }
    }

    fn pair_many(&mut self, isa: Isa, lists: Lists<'_>, cell: u32, a: &[u64], b: &[u64]) {
        self.boxes.clear();
        self.boxes
            .extend(a.iter().map(|&entry| lists.kept(entry).bounds));
        for b in b.chunks(GROUP) {
            for (lane, &entry) in b.iter().enumerate() {
                self.lanes.put(lane, &lists.kept(entry).bounds);
            }
            // Lanes after the last one hold old data and are masked out.
            let among = u64::MAX >> (GROUP - b.len());
            masks(isa, &self.lanes, among, &self.boxes, &mut self.masks);
            for (row, &entry_a) in a.iter().enumerate() {
                let mut rest = self.masks[row];
                while rest != 0 {
                    let entry_b = b[rest.trailing_zeros() as usize];
                    rest &= rest - 1;
                    self.put(lists, cell, lists.kept(entry_a), lists.kept(entry_b));
                }
            }
            self.decider.decide_when_full(isa, lists.world);
        }
    }

    #[inline(always)]
    fn put(&mut self, lists: Lists<'_>, cell: u32, a: &InRegion, b: &InRegion) {
        if lists.owner_rule && lists.owner(a, b) != cell as usize {
            return;
        }
        self.decider.push(Candidate {
            a: a.part,
            b: b.part,
            slot_a: a.slot(),
            slot_b: b.slot(),
        });
    }
}

impl<'a> Lists<'a> {
    #[inline(always)]
    fn kept(&self, entry: u64) -> &'a InRegion {
        &self.kept[entry as u32 as usize]
    }

    /// The common cell to which a pair belongs, as in impinge's owner rule.
    #[inline(always)]
    fn owner(&self, a: &InRegion, b: &InRegion) -> usize {
        self.grid.index(std::array::from_fn(|axis| {
            u32::from(a.range.lo[axis].max(b.range.lo[axis]) >> 2)
        }))
    }
}
