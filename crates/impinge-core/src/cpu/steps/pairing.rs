//! Stages `pairing` and `narrow` of steps: finds the elements of two clusters that are not beside
//! each other at both ends, and decides them.
//!
//! 1. Elements of either cluster that do not meet the other cluster's box drop out.
//! 2. The boxes of the larger side's survivors are put side by side, and each survivor of the
//!    smaller side is tested against them, 16 (or 8) lanes at a time; where boxes are single, 16
//!    lanes against all of them.
//! 3. Within one body, pairs that are [`excluded`](super::excluded) are taken away, as bits. Where
//!    they are not known, candidates that share a vertex are dropped, again 16 at a time: the
//!    vertices of their corners are looked up in the tables of both groups.

use std::time::Duration;

use crate::boxes::Sweep;
use crate::bvh::GROUP;
use crate::bvh::bounds::{Aabb, round_down};
use crate::cpu::batches::{BatchStages, Counts};
use crate::cpu::directions::Directions;
use crate::cpu::group_cache::GroupCache;
use crate::cpu::lane_pairs::{LanePairs, RowSide, WorkItem};
use crate::cpu::pairing::full;
use crate::plan::{Plan, Question, TestId};
use crate::query::pair_kind::PairKind;
use crate::query::settings::Settings;
use crate::scene::index::{ClusterIx, Number, PartIx};
use crate::search::found::StepAnswer;
use crate::simd::{Isa, LaneBounds, Lanes, Masks, Simd};
use crate::workers::clock::Instant;
use impinge_exact::internal::Reach;

use super::group::StepGroup;
use super::narrow::{Batch, Between, Listing, NarrowCounts, StepDecider, key_in};
use super::world::StepWorld;

/// The narrow stage is timed for one work item in this many.
const SAMPLED: u32 = 16;

/// The state of one worker. Two of them share no cache line, nor a pair of lines that is fetched
/// together.
#[derive(Debug)]
#[repr(align(128))]
pub(crate) struct StepWorker {
    groups: GroupCache<StepGroup>,
    directions: Directions,
    /// Whether only the start is asked about, so that directions at the start tell.
    is_still: bool,
    /// The part of the step that the cached boxes in `groups` cover.
    sweep: Sweep,
    shorter_from: f64,
    n_shortened: u64,
    lane_pairs: LanePairs,
    /// The boxes of one side's survivors at the start and at the end.
    survivors: Box<[LaneBounds; 2]>,
    /// Which lanes each row meets, where boxes are single.
    masks: Masks,
    decider: StepDecider,
    busy: Duration,
    n_decided: u32,
}

impl Default for StepWorker {
    fn default() -> Self {
        StepWorker {
            groups: GroupCache::default(),
            directions: Directions::default(),
            is_still: false,
            sweep: Sweep::WHOLE,
            shorter_from: 0.0,
            n_shortened: 0,
            lane_pairs: LanePairs::default(),
            survivors: Box::new([LaneBounds::EMPTY, LaneBounds::EMPTY]),
            masks: Masks::default(),
            decider: StepDecider::default(),
            busy: Duration::ZERO,
            n_decided: 0,
        }
    }
}

impl StepWorker {
    /// Prepares for a step of `n_clusters` clusters.
    pub fn begin(&mut self, n_clusters: u64, plan: &Plan, settings: &Settings) {
        self.groups.begin::<StepWorld<'_>>(n_clusters, settings);
        self.directions.begin::<StepWorld<'_>>(n_clusters, settings);
        self.is_still = plan.question == Question::Nearness;
        self.sweep = plan.sweep();
        self.shorter_from = settings.tuning.step_shorter_from;
        self.n_shortened = 0;
        self.decider.begin(n_clusters, plan, &settings.tuning);
        self.n_decided = 0;
        self.busy = Duration::ZERO;
    }

    /// The contacts that the worker has found.
    pub fn contacts(&mut self) -> &mut super::narrow::FirstContacts {
        self.decider.contacts()
    }

    /// What the worker has listed.
    pub fn listing(&mut self) -> &mut Listing {
        &mut self.decider.listing
    }

    /// Ends a step: hands over the remaining contacts.
    pub fn end(&mut self, answer: StepAnswer<'_>) {
        self.decider.end(answer);
    }

    /// Examines less of the step from now on, if a contact is known that is early enough.
    fn shorten(&mut self, world: StepWorld<'_>) {
        let until = self.decider.until(world);
        if until < (self.shorter_from * self.sweep.until).min(self.sweep.until) {
            self.sweep = Sweep::up_to(until);
            self.groups.clear();
            self.n_shortened += 1;
        }
    }

    pub fn counts(&self) -> Counts {
        let NarrowCounts { n_unsure, n_full } = self.decider.counts();
        Counts {
            busy: self.busy,
            n_candidates: self.decider.n_candidates,
            n_unsure,
            n_evicted: self.groups.n_evicted,
            n_full,
            n_shortened: self.n_shortened,
            n_parted: self.directions.n_parted,
        }
    }

    pub fn bytes(&self) -> usize {
        let survivors = size_of::<[LaneBounds; 2]>();
        self.groups.bytes()
            + self.directions.bytes()
            + self.decider.bytes()
            + LanePairs::BYTES
            + survivors
    }
}

/// Pairs the elements of some work items and decides the candidates.
#[inline(always)]
pub(super) fn run<S: Simd>(
    simd: S,
    isa: Isa,
    world: StepWorld<'_>,
    items: &[WorkItem],
    worker: &mut StepWorker,
) {
    worker.shorten(world);
    let world = StepWorld {
        sweep: worker.sweep,
        ..world
    };
    for item in items {
        if world.is_over() || world.known.is_cancelled() {
            break;
        }
        let test = world.plan.test(item.a, item.b);
        let Some(TestId::Elements(kind)) = test else {
            continue;
        };
        let lower = match world.answer.ranges() {
            None => None,
            Some(ranges) => match ranges.lower_numbers(kind) {
                None => continue,
                lower => lower,
            },
        };
        let between = Between {
            a: item.a,
            b: item.b,
            kind,
        };
        let Some(slots) = pair(simd, world, (item, between), lower, worker) else {
            continue;
        };
        worker.n_decided += 1;
        let is_sample = worker.n_decided.is_multiple_of(SAMPLED);
        let start = is_sample.then(Instant::now);
        let StepWorker {
            decider,
            lane_pairs,
            groups,
            ..
        } = worker;
        let groups = slots.map(|slot| groups.at(slot));
        let batch = Batch {
            item,
            between,
            groups,
            lane_pairs,
        };
        decider.take(isa, world, batch);
        if let Some(start) = start {
            worker.busy += start.elapsed() * SAMPLED;
        }
    }
    let start = Instant::now();
    worker.decider.decide(isa, world);
    worker.busy += start.elapsed();
}

/// Decides candidates of a work item that were listed before.
#[inline(always)]
pub(super) fn decide_listed<S: Simd>(
    simd: S,
    world: StepWorld<'_>,
    item: &WorkItem,
    lanes: &[[u8; 2]],
    worker: &mut StepWorker,
) {
    let Some(TestId::Elements(kind)) = world.plan.test(item.a, item.b) else {
        return;
    };
    let StepWorker {
        groups,
        lane_pairs,
        decider,
        ..
    } = worker;
    let slot_a = groups.slot(simd, world, (item.a, item.cluster_a), usize::MAX);
    let slot_b = groups.slot(simd, world, (item.b, item.cluster_b), slot_a);
    lane_pairs.set(lanes);
    let batch = Batch {
        item,
        between: Between {
            a: item.a,
            b: item.b,
            kind,
        },
        groups: [groups.at(slot_a), groups.at(slot_b)],
        lane_pairs,
    };
    decider.take(world.isa, world, batch);
}

/// Lists the candidates of a work item. Returns the slots of its groups; `None` if there are no
/// candidates. Where only keys with some lower numbers are wanted, most others are left out.
#[inline(always)]
fn pair<S: Simd>(
    simd: S,
    world: StepWorld<'_>,
    (item, between): (&WorkItem, Between),
    lower: Option<[Number; 2]>,
    worker: &mut StepWorker,
) -> Option<[usize; 2]> {
    let StepWorker {
        groups,
        directions,
        is_still,
        lane_pairs,
        survivors,
        masks,
        decider,
        ..
    } = worker;
    lane_pairs.clear();
    let farther = farther_than_meeting(world, item, between);
    let (slots, [lanes_a, lanes_b]) = cull(simd, world, (item, farther), lower, groups)?;
    let [a, b] = slots.map(|slot| groups.at(slot));
    let is_of_body = world.plan.part(item.a).id == world.plan.part(item.b).id;
    let known = match is_of_body {
        true => (world.cache(item.a)).excluded_with(world.plan.part(item.b).part),
        false => None,
    };
    let excluded = known.and_then(|known| known.of(item.cluster_a, item.cluster_b));
    // The lanes of the side with fewer are the rows; excluded pairs are known by lanes of A.
    let is_by_a = excluded.is_some() || lanes_a.count_ones() <= lanes_b.count_ones();
    let (side, rows, lanes, groups) = match is_by_a {
        true => (RowSide::A, lanes_a, lanes_b, [a, b]),
        false => (RowSide::B, lanes_b, lanes_a, [b, a]),
    };
    let is_single = world.sweep.is_single();
    let may_part = *is_still && is_single && directions.may_pay([rows, lanes]);
    // Excluded pairs are known, and directions are tested, lane by lane.
    let is_whole = lanes == u64::MAX || may_part || excluded.is_some();
    let mut map = [0; GROUP];
    let n = simd.list_lanes(lanes, &mut map);
    let is_own = (item.a, item.cluster_a) == (item.b, item.cluster_b);
    let kinds = (is_single, is_own);
    let listed = if is_whole { None } else { Some(n) };
    let sides = (groups, rows, lanes);
    overlap(simd, kinds, sides, (listed, farther), survivors, masks);
    if let Some(excluded) = excluded {
        excluded.take_from(masks);
    }
    if may_part {
        let reach = match between.kind {
            PairKind::EdgeFace => Reach::from(margin(world)),
            _ => world.plan.reach(item.a, item.b),
        };
        let reach = reach.enclosing_f32();
        decider.n_candidates += directions.thin(
            simd,
            world.isa,
            world,
            item,
            (side, rows),
            reach[1],
            &[0; GROUP],
            masks,
        );
    }
    for row in Lanes(simd.rows_with_lanes(masks)) {
        match is_whole {
            true => lane_pairs.push_row(simd, side, row, masks.0[row]),
            false => lane_pairs.push_mapped_row(simd, (side, row), masks.0[row], &map),
        }
    }
    if is_of_body && known.is_none() {
        let corners = [&a.corners[..a.n_corners], &b.corners[..b.n_corners]];
        lane_pairs.drop_sharing(simd, corners);
    }
    drop_unasked(world, item, [a, b], known.is_some(), lane_pairs);
    (lane_pairs.len() > 0).then_some(slots)
}

/// Drops candidates of which no vertex has moved, where that counts, and those that the query
/// leaves out: if others are excluded already, only those of marked vertices.
#[inline(always)]
fn drop_unasked(
    world: StepWorld<'_>,
    item: &WorkItem,
    groups: [&StepGroup; 2],
    only_marked: bool,
    lane_pairs: &mut LanePairs,
) {
    if let Some([of_a, of_b]) = world.moved(item) {
        lane_pairs.retain(|[a, b]| (of_a >> a | of_b >> b) & 1 == 1);
    }
    let leaves_out = match only_marked {
        true => world.plan.leaves_out_marked(),
        false => world.plan.leaves_out_between(item.a, item.b),
    };
    if leaves_out {
        lane_pairs.retain(|lanes| !is_left_out(world, item, groups, lanes, only_marked));
    }
}

/// By how much farther the boxes of two parts reach together than elements are apart that count: of
/// near pairs an edge and a face count where they meet, whatever the distance. 0 of all others.
#[inline(always)]
fn farther_than_meeting(world: StepWorld<'_>, item: &WorkItem, between: Between) -> f32 {
    let plan = world.plan;
    if between.kind != PairKind::EdgeFace || plan.question != Question::Nearness {
        return 0.0;
    }
    // Not above the exact difference: two operations, each corrected by a step down.
    let inflation = plan.inflation(between.a) + plan.inflation(between.b);
    let farther = round_down((inflation.next_down() - margin(world)).next_down());
    let [Aabb { min, max }, _] = world.cache(item.a).ends(item.cluster_a);
    let widest = (0..3).fold(0.0, |widest: f32, axis| widest.max(max[axis] - min[axis]));
    // Little beside the elements is not worth the work.
    match farther * 32.0 > widest {
        true => farther,
        false => 0.0,
    }
}

/// How far elements that are listed may be from counting.
#[inline(always)]
fn margin(world: StepWorld<'_>) -> f64 {
    match world.answer {
        StepAnswer::Listed { margin } => margin,
        _ => 0.0,
    }
}

/// The slots of a work item's groups, and the lanes of each that meet the other's box and that have
/// wanted keys; `None` if there are none.
#[inline(always)]
fn cull<S: Simd>(
    simd: S,
    world: StepWorld<'_>,
    (item, farther): (&WorkItem, f32),
    lower: Option<[Number; 2]>,
    groups: &mut GroupCache<StepGroup>,
) -> Option<([usize; 2], [u64; 2])> {
    let moved = world.moved(item);
    if moved == Some([0; 2]) {
        return None;
    }
    let sides = [(item.a, item.cluster_a), (item.b, item.cluster_b)];
    let is_own = sides[0] == sides[1];
    let boxes = sides.map(|(part, cluster)| world.cache(part).ends(cluster));
    let is_deflated = farther > 0.0;
    let deflated = |ends: &[Aabb; 2]| ends.each_ref().map(|held| held.deflated(farther));
    let mine = match is_deflated {
        true => deflated(&boxes[0]),
        false => boxes[0],
    };
    if !is_own && !meet(&mine, &boxes[1]) {
        return None;
    }
    let wanted = match lower {
        Some(lower) => Some(lanes_with_lower(world, item, lower)?),
        None => None,
    };
    let slot_a = groups.slot(simd, world, sides[0], usize::MAX);
    let slot_b = groups.slot(simd, world, sides[1], slot_a);
    let (a, b) = (groups.at(slot_a), groups.at(slot_b));
    let mut ends = [a.ends, b.ends];
    if is_deflated {
        ends = ends.each_ref().map(deflated);
    }
    let (mut lanes_a, mut lanes_b) = (full(a.size), full(b.size));
    if !is_own {
        let is_single = world.sweep.is_single();
        // Boxes of clusters: where they are single, both ends have the same.
        lanes_a = if is_single {
            simd.overlaps_64(&a.start, &ends[1][0], lanes_a)
        } else {
            simd.meets_64([&a.start, &a.end], &ends[1], lanes_a)
        };
        if lanes_a == 0 {
            return None;
        }
        lanes_b = if is_single {
            simd.overlaps_64(&b.start, &ends[0][0], lanes_b)
        } else {
            simd.meets_64([&b.start, &b.end], &ends[0], lanes_b)
        };
        if lanes_b == 0 {
            return None;
        }
        // Where one cluster has not moved, only the other one's lanes that have are wanted.
        match moved {
            Some([0, moved]) => lanes_b &= moved,
            Some([moved, 0]) => lanes_a &= moved,
            _ => {}
        }
        if lanes_a == 0 || lanes_b == 0 {
            return None;
        }
        if let Some(wanted) = wanted {
            lanes_a &= wanted[0];
            lanes_b &= wanted[1];
            if lanes_a == 0 || lanes_b == 0 {
                return None;
            }
        }
    }
    Some(([slot_a, slot_b], [lanes_a, lanes_b]))
}

/// Masks of the lanes of one group whose boxes meet those of each row of the other. `listed`: how
/// many lanes are put side by side first, which is in whose places the masks then are. `farther`:
/// by how much boxes reach too far, where they are single.
#[inline(always)]
fn overlap<S: Simd>(
    simd: S,
    (is_single, is_own): (bool, bool),
    ([own, other], rows, lanes): ([&StepGroup; 2], u64, u64),
    (listed, farther): (Option<usize>, f32),
    survivors: &mut [LaneBounds; 2],
    masks: &mut Masks,
) {
    let [start, end] = survivors;
    let (boxes, among) = match listed {
        None => ([&other.start, &other.end], lanes),
        Some(n) => {
            simd.put_survivors(&other.start, lanes, start);
            if !is_single {
                simd.put_survivors(&other.end, lanes, end);
            }
            ([&*start, &*end], full(n))
        }
    };
    // All lanes of a cluster that meets itself survive, each in its place.
    match (is_single, is_own) {
        (true, true) => simd.overlaps_within(boxes[0], among, masks),
        (true, false) if farther > 0.0 => {
            let own = own.start.deflated(farther);
            simd.overlaps_rows(boxes[0], among, &own, rows, masks);
        }
        (true, false) => simd.overlaps_rows(boxes[0], among, &own.start, rows, masks),
        (false, true) => simd.meets_within(boxes, among, masks),
        (false, false) => simd.meets_rows(boxes, among, [&own.start, &own.end], rows, masks),
    }
}

/// Whether the elements of two lanes are left out: because of how their vertices are marked, if
/// other reasons have been looked at.
fn is_left_out(
    world: StepWorld<'_>,
    item: &WorkItem,
    groups: [&StepGroup; 2],
    lanes: [u8; 2],
    only_marked: bool,
) -> bool {
    let corners: [[u32; 3]; 2] = std::array::from_fn(|side| {
        let lane = usize::from(lanes[side]);
        groups[side]
            .corners
            .each_ref()
            .map(|corners| corners.0[lane])
    });
    let of = |side: usize| &corners[side][..groups[side].n_corners];
    let pair = [(item.a, of(0)), (item.b, of(1))];
    match only_marked {
        true => world.plan.is_left_out_marked(pair),
        false => world.plan.is_left_out(key_in(groups, lanes), pair),
    }
}

/// The lanes of two clusters that may have a key whose lower number is in a range, ends included;
/// `None` if no pair has.
#[inline(always)]
fn lanes_with_lower(
    world: StepWorld<'_>,
    item: &WorkItem,
    [low, high]: [Number; 2],
) -> Option<[u64; 2]> {
    let lanes = |part: PartIx, cluster: ClusterIx, [low, high]: [Number; 2]| {
        let first = world.plan.part(part).first;
        let elements = world.cache(part).clustering.elements(cluster);
        let mut are_in = [0u8; GROUP];
        for (is_in, &element) in are_in.iter_mut().zip(elements) {
            let number = first.plus(element);
            *is_in = u8::from(low <= number && number <= high);
        }
        // The product has the lowest bits of eight bytes in its highest byte.
        let (bytes, _) = are_in.as_chunks::<8>();
        let bits = bytes
            .iter()
            .map(|bytes| u64::from_le_bytes(*bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56);
        bits.rev().fold(0, |lanes, bits| lanes << 8 | bits)
    };
    let in_a = lanes(item.a, item.cluster_a, [low, high]);
    if item.a != item.b {
        // The elements of the lower part have lower numbers.
        return (in_a != 0).then_some([in_a, u64::MAX]);
    }
    let in_b = lanes(item.b, item.cluster_b, [low, high]);
    if in_a | in_b == 0 {
        return None;
    }
    // Either element may have the lower number, and the other one's is not below it.
    let above = |cluster| lanes(item.a, cluster, [low, Number::new(u32::MAX)]);
    let wanted = |others: u64, cluster: ClusterIx, own: u64| match others {
        0 => own,
        _ => above(cluster),
    };
    Some([
        wanted(in_b, item.cluster_a, in_a),
        wanted(in_a, item.cluster_b, in_b),
    ])
}

/// Whether two moving boxes are not beside each other on the same side of an axis at both ends.
#[inline(always)]
fn meet(a: &[Aabb; 2], b: &[Aabb; 2]) -> bool {
    let beside = |a: &[Aabb; 2], b: &[Aabb; 2], axis: usize| {
        (0..2).all(|end| a[end].max[axis] < b[end].min[axis])
    };
    (0..3).all(|axis| !beside(a, b, axis) && !beside(b, a, axis))
}
