//! What the tests of stage `narrow` share: the candidates of a work item, keys, and the points of a
//! pair.

use crate::bvh::bounds::{round_down, round_up};
use crate::cpu::lane_pairs::{LanePairs, WorkItem};
use crate::plan::{TestId, pair_key};
use crate::query::pair_kind::PairKind;
use crate::scene::index::{ElementIx, Number, PartIx, Slot};
use crate::scene::positions::Positions;
use crate::search::found::{KeysByKind, StepAnswer};
use crate::search::narrow::exact_kind;
use crate::search::sink::BLOCK;
use crate::simd::Isa;
use impinge_exact::internal::Reach;
use impinge_exact::{ElementPair, Point};

use super::super::group::StepGroup;
use super::super::world::StepWorld;

/// One test of the candidates.
pub(crate) trait Narrow {
    /// Takes the candidates of a work item; some may wait for more.
    fn take(&mut self, isa: Isa, world: StepWorld<'_>, batch: Batch<'_>);

    /// Decides the candidates that wait.
    fn decide(&mut self, _: Isa, _: StepWorld<'_>) {}

    /// Ends a step: hands over what is left of the answer.
    fn end(&mut self, answer: StepAnswer<'_>);

    fn counts(&self) -> NarrowCounts;
}

/// The counts of one test in a step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct NarrowCounts {
    /// Pairs left to exact arithmetic.
    pub n_unsure: u64,
    /// Times that there were enough pairs to look at them.
    pub n_full: u64,
}

/// The candidates of a work item.
pub(crate) struct Batch<'a> {
    pub item: &'a WorkItem,
    pub between: Between,
    pub groups: [&'a StepGroup; 2],
    pub lane_pairs: &'a mut LanePairs,
}

impl Batch<'_> {
    /// The slots of a candidate.
    #[inline(always)]
    pub fn slots(&self, ix: usize) -> Slots {
        let [lane_a, lane_b] = self.lane_pairs.lanes(ix).map(u32::from);
        let WorkItem {
            cluster_a,
            cluster_b,
            ..
        } = self.item;
        [cluster_a.slot(lane_a), cluster_b.slot(lane_b)]
    }

    /// By how much coordinates in the tables of either group are rounded at most; infinite if one
    /// has no tables.
    #[inline(always)]
    pub fn rounded(&self) -> f64 {
        f64::max(self.groups[0].rounded, self.groups[1].rounded)
    }

    /// The kind of the pairs, and two numbers between which a distance is, if a filter decides from
    /// tables whether such pairs are within the distance.
    #[inline(always)]
    pub fn near_in_tables(&self, reach: &Reach) -> Option<(ElementPair, [f32; 2])> {
        let pair = self.pair_in_tables()?;
        Some((pair, reach_in_tables(reach, self.off_in_tables())))
    }

    /// The kind of the pairs, if a filter decides from tables whether such pairs are within a
    /// distance.
    #[inline(always)]
    pub fn pair_in_tables(&self) -> Option<ElementPair> {
        let pair = match self.between.kind {
            PairKind::VertexFace => ElementPair::VertexFace,
            PairKind::EdgeEdge => ElementPair::EdgeEdge,
            _ => return None,
        };
        self.rounded().is_finite().then_some(pair)
    }

    /// By how much the distance of points in tables is off at most. Two points are each off by what
    /// coordinates are rounded by, along three axes: their distance by at most 2 sqrt(3) times as
    /// much.
    #[inline(always)]
    pub fn off_in_tables(&self) -> f64 {
        4.0 * self.rounded()
    }
}

/// Two numbers between which a distance is. Where points in tables are off by so much, the numbers
/// allow for that; where that is more than the distance, the tables only tell that elements are
/// farther apart.
#[inline(always)]
pub(super) fn reach_in_tables(reach: &Reach, off: f64) -> [f32; 2] {
    let [low, high] = reach.enclosing_f32();
    if off == 0.0 {
        return [low, high];
    }
    let [low, high] = [f64::from(low) - off, f64::from(high) + off];
    [round_down(low.max(0.0)), round_up(high)]
}

/// Two parts, and the kind of their pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Between {
    pub a: PartIx,
    pub b: PartIx,
    pub kind: PairKind,
}

impl Between {
    /// Some element of either part, where all are alike.
    pub fn any(self) -> [(PartIx, ElementIx); 2] {
        [self.a, self.b].map(|part| (part, ElementIx::new(0)))
    }
}

/// Slots of two elements in their clusters' orders.
pub(crate) type Slots = [Slot; 2];

/// Keys of pairs without a value, handed over in blocks.
#[derive(Debug, Default)]
pub(super) struct FoundKeys(KeysByKind);

impl FoundKeys {
    pub fn begin(&mut self) {
        self.0.iter_mut().for_each(Vec::clear);
    }

    #[inline(always)]
    pub fn push(&mut self, kind: PairKind, key: u64) {
        self.0[kind as usize].push(key);
    }

    /// Hands over the keys of a kind once they make a block.
    #[inline(always)]
    pub fn hand_over(&mut self, world: StepWorld<'_>, kind: PairKind) {
        let keys = &mut self.0[kind as usize];
        if keys.len() >= BLOCK {
            world.answer.take_keys(kind, keys);
        }
    }

    pub fn end(&mut self, answer: StepAnswer<'_>) {
        for (kind, keys) in PairKind::ALL.into_iter().zip(&mut self.0) {
            answer.take_keys(kind, keys);
        }
    }

    pub fn bytes(&self) -> usize {
        size_of::<u64>() * self.0.iter().map(Vec::capacity).sum::<usize>()
    }
}

/// The pair as the exact predicate names it.
pub(super) fn exact_pair(kind: PairKind) -> Option<ElementPair> {
    exact_kind(TestId::Elements(kind))
}

/// The key of a pair.
#[inline(always)]
pub(super) fn key(world: StepWorld<'_>, between: Between, slots: Slots) -> u64 {
    let [a, b] =
        located(world, between, slots).map(|(part, element)| world.plan.part(part).number(element));
    pair_key(a, b)
}

/// The elements of a pair.
#[inline(always)]
pub(super) fn located(
    world: StepWorld<'_>,
    between: Between,
    slots: Slots,
) -> [(PartIx, ElementIx); 2] {
    let [a, b] = slots;
    [(between.a, a), (between.b, b)]
        .map(|(part, slot)| (part, world.cache(part).clustering.element(slot)))
}

/// The numbers of a pair's elements, by its lanes in two groups.
#[inline(always)]
pub(super) fn numbers_in([a, b]: [&StepGroup; 2], [lane_a, lane_b]: [u8; 2]) -> [Number; 2] {
    [
        Number::new(a.numbers.0[usize::from(lane_a)]),
        Number::new(b.numbers.0[usize::from(lane_b)]),
    ]
}

/// The key of a pair, by its lanes in two groups.
#[inline(always)]
pub fn key_in(groups: [&StepGroup; 2], lanes: [u8; 2]) -> u64 {
    let [a, b] = numbers_in(groups, lanes);
    pair_key(a, b)
}

/// Whether a pair counts: it belongs to the cell whose pairs are wanted, if only those of one are,
/// and the filter lets it pass.
#[inline(always)]
pub(super) fn counts(world: StepWorld<'_>, between: Between, slots: Slots) -> bool {
    let plan = world.plan;
    !(plan.has_cell() || plan.has_filter()) || plan.counts(world.scene, key(world, between, slots))
}

/// The points of a pair at the start and at the end, in the order of the exact test.
pub(super) fn points(
    world: StepWorld<'_>,
    between: Between,
    pair: ElementPair,
    slots: Slots,
) -> [[Point; 4]; 2] {
    let mut sides = [(between.a, slots[0]), (between.b, slots[1])];
    if pair == ElementPair::VertexEdge {
        // Such pairs are named edge first, but tested vertex first.
        sides.reverse();
    }
    let mut points: [[Point; 4]; 2] = Default::default();
    let mut n = 0;
    for (part, slot) in sides {
        let (corners, [start, end]) = element(world, part, slot);
        for &corner in corners {
            points[0][n] = start.point(corner as usize);
            points[1][n] = end.point(corner as usize);
            n += 1;
        }
    }
    points
}

/// The corners of an element, and its body's positions at both ends.
pub(super) fn element<'a>(
    world: StepWorld<'a>,
    part: PartIx,
    slot: Slot,
) -> (&'a [u32], [&'a Positions; 2]) {
    let body = world.plan.body(world.scene, part);
    let corners = world.cache(part).clustering.corners.corners(slot.index());
    let start = body.positions();
    (corners, [start, body.end_positions().unwrap_or(start)])
}
