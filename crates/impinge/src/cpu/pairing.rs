//! Stage `pairing`: which primitives of two clusters have boxes that meet.
//!
//! In: work items (two clusters) and a box a primitive for each cluster that takes part. Out:
//! candidates, which `narrow` settles in runs of about a thousand, while they are in the cache.
//!
//! 1. The two clusters' boxes intersect in a box; primitives of either side that do not meet it
//!    drop out, for a partner's box lies in its cluster's box.
//! 2. Each survivor of the smaller side is tested against the survivors of the other, 16 (or 8)
//!    lanes at a time: one 64-bit mask a primitive.
//! 3. Within one body the adjacency masks clear, or set apart, the lanes that share a vertex.
//!
//! Invariant: a pair of primitives lies in one work item only, so no candidate comes twice.
//! On a CPU these box tests beat the 4x4x4 sub-cell masks of the paper, see `docs/performance.md`.

use crate::grouping::GROUP;
use crate::narrow::share_vertex;
use crate::query::SharedVertex;

use super::narrow::{Candidate, Settler};
use super::simd::{LaneBounds, Simd};
use super::world::{BodyRef, World};

/// Two clusters that may meet: participants, clusters, and where their primitives' boxes are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WorkItem {
    pub a: u32,
    pub b: u32,
    pub cluster_a: u32,
    pub cluster_b: u32,
    pub slot_a: u32,
    pub slot_b: u32,
}

/// Lanes of a mask, lowest first.
pub(crate) struct Lanes(pub u64);

impl Iterator for Lanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        (self.0 != 0).then(|| {
            let lane = self.0.trailing_zeros() as usize;
            self.0 &= self.0 - 1;
            lane
        })
    }
}

/// The mask of a group's first `size` lanes.
#[inline(always)]
pub(crate) fn full(size: usize) -> u64 {
    u64::MAX >> (GROUP - size)
}

/// Pairs the primitives of some work items and settles the candidates.
#[inline(always)]
pub(crate) fn run<S: Simd>(
    simd: S,
    world: World<'_>,
    items: &[WorkItem],
    boxes: &[LaneBounds],
    settler: &mut Settler,
) {
    for item in items {
        let (boxes_a, boxes_b) = (&boxes[item.slot_a as usize], &boxes[item.slot_b as usize]);
        if item.a == item.b {
            within_body(simd, world, item, boxes_a, boxes_b, settler);
        } else {
            between_bodies(simd, world, item, boxes_a, boxes_b, settler);
        }
        settler.settle_when_full(simd, world);
    }
    settler.settle(simd, world);
}

#[inline(always)]
fn between_bodies<S: Simd>(
    simd: S,
    world: World<'_>,
    item: &WorkItem,
    boxes_a: &LaneBounds,
    boxes_b: &LaneBounds,
    settler: &mut Settler,
) {
    let (a, b) = (world.cache(item.a), world.cache(item.b));
    let (cluster_a, cluster_b) = (item.cluster_a as usize, item.cluster_b as usize);
    let both = a.bounds.levels[0]
        .at(cluster_a)
        .intersection(&b.bounds.levels[0].at(cluster_b));
    let lanes_a = simd.overlaps_64(boxes_a, &both, full(a.clustering.size(cluster_a)));
    if lanes_a == 0 {
        return;
    }
    let lanes_b = simd.overlaps_64(boxes_b, &both, full(b.clustering.size(cluster_b)));
    let mut candidate = Candidate {
        a: item.a,
        b: item.b,
        place_a: 0,
        place_b: 0,
    };
    let (first_a, first_b) = (item.cluster_a * GROUP as u32, item.cluster_b * GROUP as u32);
    if lanes_a.count_ones() <= lanes_b.count_ones() {
        for lane_a in Lanes(lanes_a) {
            candidate.place_a = first_a + lane_a as u32;
            for lane_b in Lanes(simd.overlaps_64(boxes_b, &boxes_a.at(lane_a), lanes_b)) {
                candidate.place_b = first_b + lane_b as u32;
                settler.push(candidate);
            }
        }
    } else {
        for lane_b in Lanes(lanes_b) {
            candidate.place_b = first_b + lane_b as u32;
            for lane_a in Lanes(simd.overlaps_64(boxes_a, &boxes_b.at(lane_b), lanes_a)) {
                candidate.place_a = first_a + lane_a as u32;
                settler.push(candidate);
            }
        }
    }
}

#[inline(always)]
fn within_body<S: Simd>(
    simd: S,
    world: World<'_>,
    item: &WorkItem,
    boxes_a: &LaneBounds,
    boxes_b: &LaneBounds,
    settler: &mut Settler,
) {
    let cache = world.cache(item.a);
    let adjacency = cache.clustering.adjacency();
    let (cluster_a, cluster_b) = (item.cluster_a as usize, item.cluster_b as usize);
    let row = Row {
        body: world.body(item.a),
        a: item.a,
        first_a: item.cluster_a * GROUP as u32,
        first_b: item.cluster_b * GROUP as u32,
        needs_ids: adjacency.needs_ids(cluster_a, cluster_b),
        rule: world.frame.shared_vertex,
    };
    let all_a = full(cache.clustering.size(cluster_a));
    if cluster_a == cluster_b {
        let own = adjacency.own(cluster_a);
        for (lane, &shared) in own.iter().enumerate() {
            let after = all_a & (u64::MAX << lane << 1);
            let met = simd.overlaps_64(boxes_a, &boxes_a.at(lane), after);
            row.put(lane, met, shared, settler);
        }
        return;
    }
    let leaves = &cache.bounds.levels[0];
    let both = leaves.at(cluster_a).intersection(&leaves.at(cluster_b));
    let lanes_a = simd.overlaps_64(boxes_a, &both, all_a);
    if lanes_a == 0 {
        return;
    }
    let lanes_b = simd.overlaps_64(boxes_b, &both, full(cache.clustering.size(cluster_b)));
    if lanes_b == 0 {
        return;
    }
    let mut shared = [0u64; GROUP];
    for (lane, mask) in adjacency.between(cluster_a, cluster_b) {
        shared[lane] = mask;
    }
    for lane in Lanes(lanes_a) {
        let met = simd.overlaps_64(boxes_b, &boxes_a.at(lane), lanes_b);
        row.put(lane, met, shared[lane], settler);
    }
}

/// Where the partners of a primitive of the same body go.
struct Row<'a> {
    body: BodyRef<'a>,
    a: u32,
    first_a: u32,
    first_b: u32,
    needs_ids: bool,
    rule: SharedVertex,
}

impl Row<'_> {
    /// Lanes `met` by `lane` become candidates; those of `shared` only as the rule says.
    #[inline(always)]
    fn put(&self, lane: usize, met: u64, shared: u64, settler: &mut Settler) {
        let place_a = self.first_a + lane as u32;
        for lane_b in Lanes(met & !shared) {
            let place_b = self.first_b + lane_b as u32;
            if self.needs_ids && self.share_vertex(place_a, place_b) {
                self.put_shared(place_a, place_b, settler);
                continue;
            }
            settler.push(Candidate {
                a: self.a,
                b: self.a,
                place_a,
                place_b,
            });
        }
        if self.rule == SharedVertex::Resolve {
            for lane_b in Lanes(met & shared) {
                self.put_shared(place_a, self.first_b + lane_b as u32, settler);
            }
        }
    }

    fn share_vertex(&self, place_a: u32, place_b: u32) -> bool {
        share_vertex(self.body.corners(place_a), self.body.corners(place_b))
    }

    fn put_shared(&self, place_a: u32, place_b: u32, settler: &mut Settler) {
        if self.rule == SharedVertex::Resolve {
            settler.settle_shared(&self.body, place_a, place_b);
        }
    }
}
