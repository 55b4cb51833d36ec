//! Candidates that may come within a distance while no vertex moves far, for a
//! [`VerletList`](super::super::verlet::VerletList).
//!
//! In: candidates within the distance and a margin. Dropped: vertices and faces, and edges, that
//! the filter of `near` tells farther apart than both together; an edge and a face, which are only
//! ever asked whether they meet, where the margin alone parts their boxes.

use crate::cpu::lane_pairs::WorkItem;
use crate::query::pair_kind::PairKind;
use crate::search::found::StepAnswer;
use crate::simd::{Isa, Simd, with_isa};
use impinge_exact::internal::filter::{BATCH, are_within_in_tables};

use super::super::group::StepGroup;
use super::super::world::StepWorld;
use super::batch::{Batch, Narrow, NarrowCounts};

/// What one worker has listed: the candidates of work items, as lanes of their groups.
#[derive(Debug, Default)]
pub(crate) struct Listing {
    /// Each with the number of its candidates.
    pub items: Vec<(WorkItem, u32)>,
    /// Of all items, one after the other.
    pub lanes: Vec<[u8; 2]>,
    /// Whether there was no memory for all.
    pub is_cut: bool,
}

impl Listing {
    /// Prepares for a step.
    pub fn begin(&mut self) {
        self.items.clear();
        self.lanes.clear();
        self.is_cut = false;
    }

    pub fn bytes(&self) -> usize {
        size_of::<(WorkItem, u32)>() * self.items.capacity()
            + size_of::<[u8; 2]>() * self.lanes.capacity()
    }
}

impl Narrow for Listing {
    fn take(&mut self, isa: Isa, world: StepWorld<'_>, batch: Batch<'_>) {
        with_isa!(isa, take, (
            listing: &mut Listing = self,
            world: StepWorld<'_> = world,
            batch: Batch<'_> = batch,
        ));
    }

    fn end(&mut self, _: StepAnswer<'_>) {}

    fn counts(&self) -> NarrowCounts {
        NarrowCounts::default()
    }
}

#[inline(always)]
fn take<S: Simd>(simd: S, listing: &mut Listing, world: StepWorld<'_>, batch: Batch<'_>) {
    let StepAnswer::Listed { margin } = world.answer else {
        return;
    };
    let (plan, between, groups) = (world.plan, batch.between, batch.groups);
    let reach = plan.reach(between.a, between.b);
    let in_tables = batch.near_in_tables(&reach);
    let lane_pairs = batch.lane_pairs;
    if between.kind == PairKind::EdgeFace {
        let inflation = plan.inflation(between.a) + plan.inflation(between.b);
        lane_pairs.retain(|lanes| may_meet(groups, lanes, inflation, margin));
    } else if let Some((pair, reach)) = in_tables {
        let tables = groups.map(|group| &group.points);
        let mut n_kept = 0;
        for first in (0..lane_pairs.len()).step_by(BATCH) {
            let lanes = lane_pairs.batch(first);
            let verdict = are_within_in_tables::<S::F32>(pair, tables, lanes, reach);
            n_kept = lane_pairs.keep_batch(simd, first, !verdict.no, n_kept);
        }
        lane_pairs.truncate(n_kept);
    }
    let n = lane_pairs.len();
    let Listing {
        items,
        lanes,
        is_cut,
    } = listing;
    if n == 0 {
        return;
    }
    if items.try_reserve(1).is_err() || lanes.try_reserve(n).is_err() {
        *is_cut = true;
        return;
    }
    items.push((*batch.item, n as u32));
    lanes.extend((0..n).map(|ix| lane_pairs.lanes(ix)));
}

/// Whether the boxes of two elements come within a margin of each other, if those in the groups are
/// inflated by so much together, or by more.
#[inline(always)]
fn may_meet(
    [a, b]: [&StepGroup; 2],
    [lane_a, lane_b]: [u8; 2],
    inflation: f64,
    margin: f64,
) -> bool {
    let (lane_a, lane_b) = (usize::from(lane_a), usize::from(lane_b));
    (0..3).all(|axis| {
        let at_most = |low: f32, high: f32| {
            let (low, high) = (f64::from(low), f64::from(high));
            // Much more than what is lost by rounding.
            let slack = (low.abs() + high.abs() + inflation + margin) * 2f64.powi(-40);
            low - high + inflation <= margin + slack
        };
        at_most(a.start.min[axis][lane_a], b.start.max[axis][lane_b])
            && at_most(b.start.min[axis][lane_b], a.start.max[axis][lane_a])
    })
}
