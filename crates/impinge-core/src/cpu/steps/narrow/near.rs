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
use crate::scene::index::{ElementIx, PartIx, pair_key};
use crate::scene::positions::Positions;
use crate::search::found::StepAnswer;
use crate::search::narrow::Corners;
use crate::search::shares::SharesBetween;
use crate::simd::{Isa, Lanes, Simd, with_isa};
use impinge_exact::internal::filter::{self, BATCH, LARGEST_F32};
use impinge_exact::internal::{Reach, are_within_certainly, elements_meet, unsure_are_within};

use super::super::world::StepWorld;
use super::batch::{
    Batch, Between, FoundKeys, Narrow, NarrowCounts, Slots, numbers_in, reach_in_tables,
};

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
    let has_own = |part| world.plan.thickness_of_each(part).is_some();
    let of_all = (!has_own(between.a) && !has_own(between.b)).then(|| {
        let reach = world.plan.reach(between.a, between.b);
        (reach, world.plan.thickness(between.any()))
    });
    let pairs = PartPair {
        world,
        between,
        sides: sides(world, between),
        of_all,
    };
    take_pairs::<S>(near, &batch, &pairs);
}

#[inline(always)]
fn take_pairs<S: Simd>(near: &mut NearElements, batch: &Batch<'_>, pairs: &PartPair<'_>) {
    let PartPair { world, between, .. } = *pairs;
    let in_tables = batch.pair_in_tables();
    let off = batch.off_in_tables();
    let is_exact = batch.rounded() == 0.0;
    let shares = match world.answer {
        // It is known later only whether a pair belongs to a cell.
        StepAnswer::Lowering(_, shares) if !world.plan.has_cell() => {
            Some(shares.between([between.a, between.b]))
        }
        _ => None,
    };
    let tables = batch.groups.map(|group| &group.points);
    let mut reach = [[0.0; BATCH]; 2];
    if let Some((of_all, _)) = &pairs.of_all {
        reach = reach_in_tables(of_all, off).map(|of_all| [of_all; BATCH]);
    }
    for first in (0..batch.lane_pairs.len()).step_by(BATCH) {
        let lanes = batch.lane_pairs.batch(first);
        let n = (batch.lane_pairs.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if in_tables.is_some() && pairs.of_all.is_none() {
            for (lane, ix) in (first..first + n).enumerate() {
                let of_pair = reach_in_tables(&pairs.reach(batch, ix), off);
                [reach[0][lane], reach[1][lane]] = of_pair;
            }
        }
        if let (Some(pair), Some(shares)) = (in_tables, &shares) {
            let found = filter::bounded_in_tables::<S::F32>(pair, tables, lanes, &reach);
            let yes = found.verdict.yes & open;
            open &= !(found.verdict.yes | found.verdict.no);
            for lane in Lanes(u64::from(yes)) {
                let bounds = [found.low[lane], found.high[lane]];
                let thickness = pairs.thickness(batch, first + lane);
                if may_lower(shares, batch, first + lane, bounds, thickness) {
                    near.put(world, batch, first + lane, Labels::UNKNOWN);
                }
            }
        } else if let Some(pair) = in_tables {
            let found = filter::nearest_in_tables::<S::F32>(pair, tables, lanes, &reach);
            let yes = found.verdict.yes & open;
            open &= !(found.verdict.yes | found.verdict.no);
            for lane in Lanes(u64::from(yes)) {
                let part = if is_exact {
                    found.part(lane)
                } else {
                    Labels::UNKNOWN
                };
                near.put(world, batch, first + lane, part);
            }
        }
        for lane in Lanes(u64::from(open)) {
            let reach = pairs.reach(batch, first + lane);
            if near.decide_open(&pairs.sides, batch.slots(first + lane), &reach) {
                near.put(world, batch, first + lane, Labels::UNKNOWN);
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
    thickness: f64,
) -> bool {
    let [slot_a, slot_b] = batch.lane_pairs.lanes(ix);
    let [a, b] = batch.groups;
    let corners = [
        (&a.corners[..a.n_corners], slot_a),
        (&b.corners[..b.n_corners], slot_b),
    ];
    let off = batch.off_in_tables();
    let bounds = [f64::from(low) - off, f64::from(high) + off];
    shares.lower_by(corners, bounds, thickness)
}

/// An edge and a face are in the answer if they meet, whatever the distance.
#[inline(always)]
fn take_edges_and_faces<S: Simd>(near: &mut NearElements, world: StepWorld<'_>, batch: &Batch<'_>) {
    let sides = sides(world, batch.between);
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
            if near.decide_meeting(&sides, batch.slots(first + lane)) {
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
            let labels = Labels::new(world.plan.n_elements());
            self.keys.push(batch.between.kind, labels.put(key, part));
        }
    }

    /// Whether an edge and a face at two slots meet, exactly.
    #[inline(never)]
    fn decide_meeting(&mut self, sides: &Sides<'_>, slots: Slots) -> bool {
        let [edge, face] = corners(sides, slots);
        self.n_unsure += 1;
        elements_meet(edge.points(), face.points())
    }

    /// Whether the elements at two slots are near, in `f64` or exactly.
    #[inline(never)]
    fn decide_open(&mut self, sides: &Sides<'_>, slots: Slots, reach: &Reach) -> bool {
        let [a, b] = corners(sides, slots);
        are_within_certainly(a.points(), b.points(), reach).unwrap_or_else(|| {
            self.n_unsure += 1;
            unsure_are_within(a.points(), b.points(), reach)
        })
    }
}

/// Two parts, and within which distance their elements are near.
struct PartPair<'a> {
    world: StepWorld<'a>,
    between: Between,
    sides: Sides<'a>,
    /// The distance, and how thick both elements of a pair are together, rounded up; `None` where
    /// elements are not equally thick.
    of_all: Option<(Reach, f64)>,
}

impl PartPair<'_> {
    /// The elements of a candidate, by the numbers that its groups hold: with `batch::located`,
    /// which looks them up by slot, such questions take 5 % longer.
    #[inline(always)]
    fn located(&self, batch: &Batch<'_>, ix: usize) -> [(PartIx, ElementIx); 2] {
        let [a, b] = numbers_in(batch.groups, batch.lane_pairs.lanes(ix));
        let located = |part, number| (part, self.world.plan.part(part).element(number));
        [located(self.between.a, a), located(self.between.b, b)]
    }

    /// Within which distance the elements of a candidate are near, exactly.
    #[inline(always)]
    fn reach(&self, batch: &Batch<'_>, ix: usize) -> Reach {
        match self.of_all {
            Some((reach, _)) => reach,
            None => self.world.plan.reach_of(self.located(batch, ix)),
        }
    }

    /// How thick both elements of a candidate are together, rounded up.
    #[inline(always)]
    fn thickness(&self, batch: &Batch<'_>, ix: usize) -> f64 {
        match self.of_all {
            Some((_, thickness)) => thickness,
            None => self.world.plan.thickness(self.located(batch, ix)),
        }
    }
}

/// Of two parts, the elements in the order of their clusters, and the positions of their bodies.
type Sides<'a> = [(&'a Elements, &'a Positions); 2];

fn sides(world: StepWorld<'_>, between: Between) -> Sides<'_> {
    [between.a, between.b].map(|part| {
        let body = world.plan.body(world.scene, part);
        (&world.cache(part).clustering.corners, body.positions())
    })
}

#[inline(always)]
fn corners(sides: &Sides<'_>, slots: Slots) -> [Corners; 2] {
    [0, 1].map(|side| {
        let (elements, positions) = sides[side];
        Corners::new(positions, elements.corners(slots[side].index()))
    })
}
