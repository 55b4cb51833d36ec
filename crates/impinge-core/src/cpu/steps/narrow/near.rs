//! Whether elements are within a distance at the start of a step.
//!
//! In: candidates, whose boxes overlap when each reaches half as far. Sixteen pairs at a time are
//! decided in `f32` from the tables (`impinge_exact::filter::nearness`), with the nearest features
//! of most; other pairs in `f64` with bounds (`impinge_exact::distance`), the rest in exact
//! arithmetic. Features that are not known here are named when the pairs are sorted. Edges and
//! faces are tested for a common point alone.

use crate::answers::near::Labels;
use crate::query::pair_kind::PairKind;
use crate::scene::elements::Elements;
use crate::scene::index::pair_key;
use crate::scene::positions::Positions;
use crate::search::found::StepAnswer;
use crate::search::narrow::Corners;
use crate::search::shares::SharesBetween;
use crate::simd::{Isa, Lanes, Simd, with_isa};
use impinge_exact::internal::filter::{self, BATCH, LARGEST_F32};
use impinge_exact::internal::{Reach, are_within_certainly, elements_meet, unsure_are_within};

use super::super::world::StepWorld;
use super::batch::{Batch, Between, FoundKeys, Narrow, NarrowCounts, Slots, numbers_in};

/// The test of one worker.
#[derive(Debug, Default)]
pub(super) struct NearElements {
    keys: FoundKeys,
    n_unsure: u64,
}

impl NearElements {
    /// Prepares for a step.
    pub fn begin(&mut self) {
        self.n_unsure = 0;
        self.keys.begin();
    }

    pub fn bytes(&self) -> usize {
        self.keys.bytes()
    }
}

impl Narrow for NearElements {
    fn take(&mut self, isa: Isa, world: StepWorld<'_>, batch: Batch<'_>) {
        with_isa!(isa, take, (
            near: &mut NearElements = self,
            world: StepWorld<'_> = world,
            batch: Batch<'_> = batch,
        ));
    }

    fn end(&mut self, answer: StepAnswer<'_>) {
        self.keys.end(answer);
    }

    fn counts(&self) -> NarrowCounts {
        NarrowCounts {
            n_unsure: self.n_unsure,
            n_full: 0,
        }
    }
}

#[inline(always)]
fn take<S: Simd>(_: S, near: &mut NearElements, world: StepWorld<'_>, batch: Batch<'_>) {
    let between = batch.between;
    if between.kind == PairKind::EdgeFace {
        take_edges_and_faces::<S>(near, world, &batch);
        return;
    }
    let pairs = PartPair::new(world, between);
    let in_tables = batch.near_in_tables(&pairs.reach);
    let is_exact = batch.rounded() == 0.0;
    let shares = match world.answer {
        // It is known later only whether a pair belongs to a cell.
        StepAnswer::Lowering(_, shares) if !world.plan.has_cell() => {
            Some(shares.between(world.plan, [between.a, between.b]))
        }
        _ => None,
    };
    let tables = batch.groups.map(|group| &group.points);
    for first in (0..batch.lane_pairs.len()).step_by(BATCH) {
        let lanes = batch.lane_pairs.batch(first);
        let n = (batch.lane_pairs.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if let (Some((pair, reach)), Some(shares)) = (in_tables, &shares) {
            let found = filter::bounded_in_tables::<S::F32>(pair, tables, lanes, reach);
            let yes = found.verdict.yes & open;
            open &= !(found.verdict.yes | found.verdict.no);
            for lane in Lanes(u64::from(yes)) {
                let bounds = [found.low[lane], found.high[lane]];
                if may_lower(shares, &batch, first + lane, bounds) {
                    near.put(world, &batch, first + lane, Labels::UNKNOWN);
                }
            }
        } else if let Some((pair, reach)) = in_tables {
            let found = filter::nearest_in_tables::<S::F32>(pair, tables, lanes, reach);
            let yes = found.verdict.yes & open;
            open &= !(found.verdict.yes | found.verdict.no);
            for lane in Lanes(u64::from(yes)) {
                let part = if is_exact {
                    found.part(lane)
                } else {
                    Labels::UNKNOWN
                };
                near.put(world, &batch, first + lane, part);
            }
        }
        for lane in Lanes(u64::from(open)) {
            if near.decide_open(&pairs, batch.slots(first + lane)) {
                near.put(world, &batch, first + lane, Labels::UNKNOWN);
            }
        }
    }
    near.keys.hand_over(world, between.kind);
}

/// Whether a pair that is near may lower the shares of its vertices, by bounds of the distance in
/// the tables.
#[inline(always)]
fn may_lower(
    shares: &SharesBetween<'_>,
    batch: &Batch<'_>,
    ix: usize,
    [low, high]: [f32; 2],
) -> bool {
    let [slot_a, slot_b] = batch.lane_pairs.lanes(ix);
    let [a, b] = batch.groups;
    let corners = [
        (&a.corners[..a.n_corners], slot_a),
        (&b.corners[..b.n_corners], slot_b),
    ];
    // As in `near_in_tables`.
    let off = 4.0 * batch.rounded();
    shares.lower_by(corners, [f64::from(low) - off, f64::from(high) + off])
}

/// An edge and a face are in the answer if they meet, whatever the distance.
#[inline(always)]
fn take_edges_and_faces<S: Simd>(near: &mut NearElements, world: StepWorld<'_>, batch: &Batch<'_>) {
    let pairs = PartPair::new(world, batch.between);
    let largest = f64::max(batch.groups[0].largest, batch.groups[1].largest);
    let in_tables = batch.rounded() == 0.0 && largest <= f64::from(LARGEST_F32);
    let tables = batch.groups.map(|group| &group.points[0]);
    for first in (0..batch.lane_pairs.len()).step_by(BATCH) {
        let lanes = batch.lane_pairs.batch(first);
        let n = (batch.lane_pairs.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if in_tables {
            let verdict = filter::meet_in_tables::<S::F32>(tables, lanes);
            let yes = verdict.yes & open;
            open &= !(verdict.yes | verdict.no);
            for lane in Lanes(u64::from(yes)) {
                near.put(world, batch, first + lane, Labels::UNKNOWN);
            }
        }
        for lane in Lanes(u64::from(open)) {
            if near.decide_meeting(&pairs, batch.slots(first + lane)) {
                near.put(world, batch, first + lane, Labels::UNKNOWN);
            }
        }
    }
    near.keys.hand_over(world, batch.between.kind);
}

impl NearElements {
    /// Adds a candidate to the answer, with the part that is nearest.
    #[inline(always)]
    fn put(&mut self, world: StepWorld<'_>, batch: &Batch<'_>, ix: usize, part: u8) {
        let numbers = numbers_in(batch.groups, batch.lane_pairs.lanes(ix));
        // Only edges meet others of the same part, where the second may have the lower number.
        let is_swapped = numbers[0] > numbers[1];
        let part = match is_swapped {
            true => filter::SWAPPED_PARTS[usize::from(part) % filter::SWAPPED_PARTS.len()],
            false => part,
        };
        let key = pair_key(numbers[0], numbers[1]);
        if world.plan.is_owned(world.scene, key) {
            let labels = Labels::new(world.plan.n_primitives());
            self.keys.push(batch.between.kind, labels.put(key, part));
        }
    }

    /// Whether an edge and a face at two slots meet, exactly.
    #[inline(never)]
    fn decide_meeting(&mut self, pairs: &PartPair<'_>, slots: Slots) -> bool {
        let [edge, face] = pairs.corners(slots);
        self.n_unsure += 1;
        elements_meet(edge.points(), face.points())
    }

    /// Whether the elements at two slots are near, in `f64` or exactly.
    #[inline(never)]
    fn decide_open(&mut self, pairs: &PartPair<'_>, slots: Slots) -> bool {
        let [a, b] = pairs.corners(slots);
        are_within_certainly(a.points(), b.points(), &pairs.reach).unwrap_or_else(|| {
            self.n_unsure += 1;
            unsure_are_within(a.points(), b.points(), &pairs.reach)
        })
    }
}

/// Two parts, and within which distance their elements are near.
struct PartPair<'a> {
    sides: [(&'a Elements, &'a Positions); 2],
    reach: Reach,
}

impl<'a> PartPair<'a> {
    fn new(world: StepWorld<'a>, between: Between) -> Self {
        let sides = [between.a, between.b].map(|part| {
            let body = world.plan.body(world.scene, part);
            (&world.cache(part).clustering.corners, body.positions())
        });
        let reach = world.plan.reach(between.a, between.b);
        PartPair { sides, reach }
    }

    #[inline(always)]
    fn corners(&self, slots: Slots) -> [Corners; 2] {
        [0, 1].map(|side| {
            let (elements, positions) = self.sides[side];
            Corners::new(positions, elements.corners(slots[side].index()))
        })
    }
}
