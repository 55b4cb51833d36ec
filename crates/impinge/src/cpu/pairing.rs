//! Stage `pairing`: which primitives of two clusters have boxes that meet.
//!
//! In: work items (two clusters). Out: candidates, which `narrow` settles in runs of about a thousand,
//! while they are in the cache.
//!
//! 0. The boxes of a cluster's primitives are found when it is first needed; a worker keeps those of the
//!    clusters it saw last. Work items come in the order of the tree, so most are found again.
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

use super::bounds::of_cluster_primitives;
use super::narrow::{Candidate, Settler};
use super::simd::{Isa, LaneBounds, Simd};
use super::world::{BodyRef, World};

/// Two clusters that may meet: participants and their clusters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WorkItem {
    pub a: u32,
    pub b: u32,
    pub cluster_a: u32,
    pub cluster_b: u32,
}

/// What one worker has of its own.
#[derive(Debug, Default)]
pub(crate) struct Worker {
    pub settler: Settler,
    boxes: BoxCache,
}

impl Worker {
    /// Makes ready for a frame of so many clusters.
    pub fn begin(&mut self, n_clusters: u64) {
        self.settler.clear();
        self.boxes.begin(n_clusters);
    }

    pub fn bytes(&self) -> usize {
        self.settler.bytes() + self.boxes.bytes()
    }
}

/// The boxes of the primitives of the clusters seen last: 400 KB, which a second-level cache holds.
///
/// A cluster has two places, `h` and `h ^ 1`; the one that is not in use makes room.
#[derive(Debug, Default)]
struct BoxCache {
    /// Participant and cluster of each place.
    keys: Vec<u64>,
    boxes: Vec<LaneBounds>,
}

/// No participant has this number: there are fewer than 2^32 of them.
const NOBODY: u64 = u64::MAX;
const MOST_CACHED: u64 = 256;

impl BoxCache {
    fn begin(&mut self, n_clusters: u64) {
        let n = n_clusters.clamp(4, MOST_CACHED).next_power_of_two() as usize;
        if self.boxes.len() < n {
            self.boxes.resize(n, LaneBounds::EMPTY);
        }
        self.keys.clear();
        self.keys.resize(self.boxes.len(), NOBODY);
    }

    fn bytes(&self) -> usize {
        size_of::<u64>() * self.keys.capacity() + size_of::<LaneBounds>() * self.boxes.capacity()
    }

    /// The place of a cluster's boxes, found now if they are not there; `pinned` stays as it is.
    #[inline(always)]
    fn place(&mut self, world: World<'_>, participant: u32, cluster: u32, pinned: usize) -> usize {
        let key = u64::from(participant) << 32 | u64::from(cluster);
        let first =
            (participant.wrapping_mul(67).wrapping_add(cluster) as usize) & (self.keys.len() - 1);
        for place in [first, first ^ 1] {
            if self.keys[place] == key {
                return place;
            }
        }
        let place = if first == pinned { first ^ 1 } else { first };
        self.keys[place] = key;
        self.find(world, participant, cluster, place);
        place
    }

    #[inline(never)]
    fn find(&mut self, world: World<'_>, participant: u32, cluster: u32, place: usize) {
        let body = world.body(participant);
        let clustering = &world.cache(participant).clustering;
        let lanes = &mut self.boxes[place];
        of_cluster_primitives(body.positions, clustering, cluster as usize, lanes);
    }
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
    isa: Isa,
    world: World<'_>,
    items: &[WorkItem],
    worker: &mut Worker,
) {
    let Worker { settler, boxes } = worker;
    for item in items {
        let place_a = boxes.place(world, item.a, item.cluster_a, usize::MAX);
        let place_b = boxes.place(world, item.b, item.cluster_b, place_a);
        let (boxes_a, boxes_b) = (&boxes.boxes[place_a], &boxes.boxes[place_b]);
        if item.a == item.b {
            within_body(simd, world, item, boxes_a, boxes_b, settler);
        } else {
            between_bodies(simd, world, item, boxes_a, boxes_b, settler);
        }
        settler.settle_when_full(isa, world);
    }
    settler.settle(isa, world);
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
    // Masks are kept by lanes of a: turning them round costs more than some rows.
    if lanes_a.count_ones() <= 2 * lanes_b.count_ones() {
        for (lane, mask) in adjacency.between(cluster_a, cluster_b) {
            shared[lane] = mask;
        }
        for lane in Lanes(lanes_a) {
            let met = simd.overlaps_64(boxes_b, &boxes_a.at(lane), lanes_b);
            row.put(lane, met, shared[lane], settler);
        }
    } else {
        for (lane, mask) in adjacency.between(cluster_a, cluster_b) {
            for lane_b in Lanes(mask & lanes_b) {
                shared[lane_b] |= 1 << lane;
            }
        }
        let row = row.swapped();
        for lane in Lanes(lanes_b) {
            let met = simd.overlaps_64(boxes_a, &boxes_b.at(lane), lanes_a);
            row.put(lane, met, shared[lane], settler);
        }
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
    /// The same with the two clusters exchanged.
    #[inline(always)]
    fn swapped(self) -> Self {
        Row {
            first_a: self.first_b,
            first_b: self.first_a,
            ..self
        }
    }

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
