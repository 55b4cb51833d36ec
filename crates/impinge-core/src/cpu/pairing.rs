//! Stage `pairing`: which elements of two clusters have boxes that meet.
//!
//! In: work items (two clusters). Out: candidates, which `narrow` decides item by item, while both
//! groups are in the cache.
//!
//! 0. The boxes of a cluster's elements, and their corners, are computed when first needed; a
//!    worker caches those of the clusters it saw last. Work items come in the order of the tree, so
//!    most clusters are cached.
//! 1. The two clusters' boxes intersect in a box; elements of either side that do not meet it
//!    drop out, for a partner's box lies in its cluster's box.
//! 2. Each survivor of the smaller side is tested against the survivors of the other, 16 (or 8)
//!    lanes at a time: one 64-bit mask per element.
//!    Where these are very many, `directions` clears most of them.
//! 3. Within one body the adjacency masks clear the lanes that share a vertex, or set apart those
//!    that `creases` leaves open. Pairs that share a hub are cleared under any rule: `hubs` decides
//!    them.
//!
//! Invariant: a pair of elements lies in one work item only, so no candidate comes twice. On a
//! CPU these box tests beat the 4x4x4 sub-cell masks of the paper, see `docs/lab/intersections.md`.

use crate::workers::clock::Instant;
use std::sync::Arc;

use crate::bvh::GROUP;
use crate::bvh::hubs::Hubs;
use crate::query::SharedVertex;
use crate::query::settings::Settings;
use crate::scene::index::{ClusterIx, Number, PartIx};
use crate::search::sink::Answer;

use super::directions::Directions;
use super::group_cache::{Group, GroupCache};
use super::hubs::HubScratch;
use super::lane_pairs::{LanePairs, RowSide, WorkItem};
use super::narrow::Decider;
use super::world::{BodyCache, BodyRef, World};
use crate::simd::{Isa, Lanes, Masks, Simd};

/// The narrow stage is timed for one work item in this many: reading the clock takes longer than
/// some items.
const SAMPLED: u32 = 16;

/// The state of one worker. Two of them share no cache line, nor a pair of lines that is fetched
/// together.
#[derive(Debug, Default)]
#[repr(align(128))]
pub(crate) struct Worker {
    pub decider: Decider,
    /// Scratch for pairs that share a hub.
    pub(super) around: HubScratch,
    groups: GroupCache<Group>,
    directions: Directions,
    lane_pairs: LanePairs,
    masks: Masks,
    /// For each row of `masks` in one body, the lanes that share a vertex with it.
    shared: Masks,
    /// The number of work items whose candidates were decided.
    n_decided: u32,
}

impl Worker {
    /// Prepares for a frame of `n_clusters` clusters.
    pub fn begin(&mut self, n_clusters: u64, settings: &Settings, answer: &Arc<Answer>) {
        self.decider.begin(answer, &settings.tuning);
        self.n_decided = 0;
        self.groups.begin::<World<'_>>(n_clusters, settings);
        self.directions.begin::<World<'_>>(n_clusters, settings);
    }

    /// Pairs that directions told apart, in this frame.
    pub fn n_parted(&self) -> u64 {
        self.directions.n_parted
    }

    /// Clusters that took the slot of others in the cache, in this frame.
    pub fn n_evicted(&self) -> u64 {
        self.groups.n_evicted
    }

    pub fn bytes(&self) -> usize {
        self.decider.bytes()
            + self.groups.bytes()
            + self.directions.bytes()
            + self.around.bytes()
            + LanePairs::BYTES
    }
}

/// The mask of a group's first `size` lanes.
#[inline(always)]
pub(crate) fn full(size: usize) -> u64 {
    u64::MAX >> (GROUP - size)
}

/// Pairs the elements of some work items and decides the candidates.
#[inline(always)]
pub(crate) fn run<S: Simd>(
    simd: S,
    isa: Isa,
    world: World<'_>,
    items: &[WorkItem],
    worker: &mut Worker,
) {
    let Worker {
        decider,
        groups,
        directions,
        lane_pairs,
        masks,
        shared,
        n_decided,
        ..
    } = worker;
    for item in items {
        if decider.is_over() {
            break;
        }
        let wanted = match decider.up_to() {
            None => [u64::MAX; 2],
            Some((RowSide::A, to)) => [lanes_up_to(world, item.a, item.cluster_a, to), u64::MAX],
            Some((RowSide::B, to)) => [u64::MAX, lanes_up_to(world, item.b, item.cluster_b, to)],
        };
        let Some(CulledItem { slots, lanes }) = cull(simd, world, item, wanted, groups) else {
            continue;
        };
        let groups = slots.map(|slot| groups.at(slot));
        lane_pairs.clear();
        let (side, rows) = overlap(simd, item, (groups, lanes), masks);
        let is_same_body = item.a == item.b;
        if is_same_body {
            put_shared(
                world.cache(item.a),
                item,
                (side, rows),
                masks,
                &mut shared.0,
            );
        }
        if directions.may_pay(lanes) {
            let aside = if is_same_body { &shared.0 } else { &[0; GROUP] };
            let rows = (side, rows);
            // Their boxes overlap: they count as candidates.
            decider.n_candidates +=
                directions.thin(simd, isa, world, item, rows, 0.0, aside, masks);
        }
        if is_same_body {
            within_body(
                simd,
                world,
                item,
                (side, rows),
                (masks, &shared.0),
                lane_pairs,
                decider,
            );
        } else {
            for row in Lanes(rows) {
                lane_pairs.push_row(simd, side, row, masks.0[row]);
            }
        }
        if lane_pairs.len() > 0 {
            *n_decided += 1;
            let is_sample = n_decided.is_multiple_of(SAMPLED);
            let start = is_sample.then(Instant::now);
            decider.decide_item(simd, world, item, groups, lane_pairs);
            if let Some(start) = start {
                decider.busy += start.elapsed() * SAMPLED;
            }
        }
        decider.decide_when_full(isa, world);
    }
    decider.decide(isa, world);
}

/// The slots of a work item's groups, and the lanes of each that meet the intersection of the two
/// clusters' boxes.
struct CulledItem {
    slots: [usize; 2],
    lanes: [u64; 2],
}

/// The lanes of a cluster whose elements have numbers up to one.
#[inline(never)]
fn lanes_up_to(world: World<'_>, part: PartIx, cluster: ClusterIx, to: Number) -> u64 {
    let elements = world.cache(part).clustering.elements(cluster);
    let part = world.plan.part(part);
    (0..).zip(elements).fold(0, |lanes, (lane, &element)| {
        lanes | u64::from(part.number(element) <= to) << lane
    })
}

/// Only the lanes in `wanted` matter. `None` if one side has no lane that meets the intersection of
/// the two clusters' boxes.
#[inline(always)]
fn cull<S: Simd>(
    simd: S,
    world: World<'_>,
    item: &WorkItem,
    wanted: [u64; 2],
    groups: &mut GroupCache<Group>,
) -> Option<CulledItem> {
    const NOWHERE: usize = usize::MAX;
    let sides = [(item.a, item.cluster_a), (item.b, item.cluster_b)];
    let caches = [world.cache(item.a), world.cache(item.b)];
    let size = |side: usize| caches[side].clustering.size(sides[side].1);
    let leaf = |side: usize| caches[side].bounds.levels[0].at(sides[side].1.index());
    let both = leaf(0).intersection(&leaf(1));
    let mut slots = [NOWHERE; 2];
    let mut lanes = [0; 2];
    if wanted[0] == 0 || wanted[1] == 0 {
        return None;
    }
    // Test a cached group first: if no lane of it is left, the other group need not be computed.
    let first = usize::from(!groups.holds(sides[0]) && groups.holds(sides[1]));
    for side in [first, 1 - first] {
        slots[side] = groups.slot(simd, world, sides[side], slots[1 - side]);
        let all = full(size(side)) & wanted[side];
        if sides[0] == sides[1] {
            slots = [slots[side]; 2];
            lanes = [all; 2];
            break;
        }
        lanes[side] = simd.overlaps_64(&groups.at(slots[side]).boxes, &both, all);
        if lanes[side] == 0 {
            return None;
        }
    }
    Some(CulledItem { slots, lanes })
}

/// Finds the pairs of lanes whose boxes overlap: one mask per row, which is a lane of the side that
/// is returned.
#[inline(always)]
fn overlap<S: Simd>(
    simd: S,
    item: &WorkItem,
    ([group_a, group_b], [lanes_a, lanes_b]): ([&Group; 2], [u64; 2]),
    masks: &mut Masks,
) -> (RowSide, u64) {
    let (boxes_a, boxes_b) = (&group_a.boxes, &group_b.boxes);
    let [n_a, n_b] = [lanes_a, lanes_b].map(u64::count_ones);
    let is_same_body = item.a == item.b;
    if is_same_body && item.cluster_a == item.cluster_b {
        simd.overlaps_within(boxes_a, lanes_a, masks);
        return (RowSide::A, lanes_a);
    }
    // Adjacency is stored by lanes of a: transposing it costs more than a few more rows.
    let n_b = if is_same_body { 2 * n_b } else { n_b };
    if n_a <= n_b {
        simd.overlaps_rows(boxes_b, lanes_b, boxes_a, lanes_a, masks);
        (RowSide::A, lanes_a)
    } else {
        simd.overlaps_rows(boxes_a, lanes_a, boxes_b, lanes_b, masks);
        (RowSide::B, lanes_b)
    }
}

/// Makes candidates of the pairs of one body.
#[inline(always)]
fn within_body<S: Simd>(
    simd: S,
    world: World<'_>,
    item: &WorkItem,
    (side, rows): (RowSide, u64),
    (masks, shared): (&Masks, &[u64; GROUP]),
    lane_pairs: &mut LanePairs,
    decider: &mut Decider,
) {
    let cache = world.cache(item.a);
    let (cluster_a, cluster_b) = (item.cluster_a, item.cluster_b);
    let rule = VertexRule {
        body: world.body(item.a),
        cluster_a,
        cluster_b,
        shared_vertex: world.plan.shared_vertex,
        folded: [cluster_a, cluster_b].map(|cluster| {
            let creases = cache.creases.as_ref();
            creases.map_or(u64::MAX, |creases| creases.of(cluster))
        }),
    };
    for row in Lanes(rows) {
        rule.put_row(
            simd,
            side,
            row,
            masks.0[row],
            shared[row],
            lane_pairs,
            decider,
        );
    }
}

/// Clears the pairs of one body that share a hub, and lists for each row the lanes that share
/// another vertex with it.
#[inline(always)]
fn put_shared(
    cache: &BodyCache,
    item: &WorkItem,
    (side, rows): (RowSide, u64),
    masks: &mut Masks,
    shared: &mut [u64; GROUP],
) {
    let (cluster_a, cluster_b) = (item.cluster_a, item.cluster_b);
    if let Some(hubs) = cache.clustering.hubs() {
        clear_hubs(hubs, item, side, masks);
    }
    let adjacency = cache.clustering.adjacency();
    if cluster_a == cluster_b {
        let own = adjacency.own(cluster_a);
        shared[..own.len()].copy_from_slice(own);
        return;
    }
    shared.fill(0);
    for (lane, mask) in adjacency.between(cluster_a, cluster_b) {
        match side {
            RowSide::A => shared[lane] = mask,
            RowSide::B => Lanes(mask & rows).for_each(|lane_b| shared[lane_b] |= 1 << lane),
        }
    }
}

/// Clears the pairs that share a hub.
#[inline(never)]
fn clear_hubs(hubs: &Hubs, item: &WorkItem, rows: RowSide, masks: &mut Masks) {
    for (lanes_a, lanes_b) in hubs.between(item.cluster_a, item.cluster_b) {
        let (rows, lanes) = match rows {
            RowSide::A => (lanes_a, lanes_b),
            RowSide::B => (lanes_b, lanes_a),
        };
        for row in Lanes(rows) {
            masks.0[row] &= !lanes;
        }
    }
}

/// Treats the elements of one body that share a vertex.
struct VertexRule<'a> {
    body: BodyRef<'a>,
    cluster_a: ClusterIx,
    cluster_b: ClusterIx,
    shared_vertex: SharedVertex,
    /// The lanes of each cluster that may meet a neighbour, under `SharedVertex::Resolve`.
    folded: [u64; 2],
}

impl VertexRule<'_> {
    /// Makes candidates of the lanes that a row has met; treats those in `shared` by the rule.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "one call for each way to meet")]
    fn put_row<S: Simd>(
        &self,
        simd: S,
        side: RowSide,
        row: usize,
        mask: u64,
        shared: u64,
        lane_pairs: &mut LanePairs,
        decider: &mut Decider,
    ) {
        lane_pairs.push_row(simd, side, row, mask & !shared);
        if self.shared_vertex == SharedVertex::Skip {
            return;
        }
        let (folded_rows, folded_lanes) = match side {
            RowSide::A => (self.folded[0], self.folded[1]),
            RowSide::B => (self.folded[1], self.folded[0]),
        };
        let neighbors = mask & shared;
        let open = match folded_rows >> row & 1 {
            1 => neighbors & folded_lanes,
            _ => 0,
        };
        decider.n_candidates += u64::from((neighbors & !open).count_ones());
        for lane in Lanes(open) {
            let (lane_a, lane_b) = match side {
                RowSide::A => (row, lane),
                RowSide::B => (lane, row),
            };
            let slot_a = self.cluster_a.slot(lane_a as u32);
            let slot_b = self.cluster_b.slot(lane_b as u32);
            decider.decide_shared(&self.body, slot_a, slot_b);
        }
    }
}
