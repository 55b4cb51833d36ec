//! A worker's own copy of the clusters it saw last, for `pairing` and `narrow`: one element per
//! lane.
//!
//! In: positions and corners of a cluster. Out: the boxes of its elements and, for triangles in
//! f32, their corners as tables, so that the filter reads them from the first-level cache and not
//! from all over the body. Cost: each corner of a cluster once, when it is first needed; 3.8 KB per
//! cluster.

use crate::boxes;
use crate::bvh::GROUP;
use crate::bvh::bounds::Aabb;
use crate::query::settings::Settings;
use crate::scene::elements::Elements;
use crate::scene::index::{ClusterIx, PartIx};
use crate::scene::positions::Positions;
use impinge_exact::internal::filter::{LARGEST_F32, Triangles64};

use super::world::World;
use crate::simd::{ClusterFaces, LaneBounds, Simd};

/// One cluster's elements.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct Group {
    /// The elements' boxes.
    pub boxes: LaneBounds,
    /// The elements' corners, if `in_tables`.
    pub corners: Triangles64,
    /// Whether the elements are triangles in f32 that are small enough for the filter in f32.
    pub in_tables: bool,
}

impl PerCluster<World<'_>> for Group {
    const EMPTY: Group = Group {
        boxes: LaneBounds::EMPTY,
        corners: [[[0.0; GROUP]; 3]; 3],
        in_tables: false,
    };

    #[inline(always)]
    fn fill<S: Simd>(&mut self, simd: S, world: World<'_>, part: PartIx, cluster: ClusterIx) {
        let positions = world.body(part).positions;
        let cache = world.cache(part);
        let clustering = &cache.clustering;
        let (Positions::F32(points), Elements::Triangles(faces)) = (positions, &clustering.corners)
        else {
            self.in_tables = false;
            return boxes::fill(positions, clustering, cluster, &mut self.boxes);
        };
        let size = clustering.size(cluster);
        let faces = ClusterFaces {
            faces: &faces[clustering.slots(cluster)],
            vertices: clustering.vertices(cluster),
            local: clustering.local_faces(cluster),
        };
        simd.put_corners(points, &faces, &mut self.corners);
        self.boxes.hold(self.corners.each_ref(), size);
        self.in_tables = is_small(&cache.bounds.levels[0].at(cluster.index()));
    }
}

/// Whether all coordinates are small enough for the filter in f32.
fn is_small(bounds: &Aabb) -> bool {
    let largest = |ends: &[f32; 3]| ends.iter().all(|x| x.abs() <= LARGEST_F32);
    largest(&bounds.min) && largest(&bounds.max)
}

/// The data kept per cluster.
pub(super) trait PerCluster<W>: Clone {
    /// The data of no cluster.
    const EMPTY: Self;

    /// Computes the data of a cluster of a part.
    fn fill<S: Simd>(&mut self, simd: S, world: W, part: PartIx, cluster: ClusterIx);
}

/// The clusters that a worker has seen last.
///
/// A cluster has two possible slots, `h` and `h ^ 1`; a new one replaces the cluster that is not in
/// use.
#[derive(Debug)]
pub(super) struct GroupCache<G> {
    /// Part and cluster of each slot.
    keys: Vec<u64>,
    groups: Vec<G>,
    /// Clusters that took the slot of others.
    pub n_evicted: u64,
}

impl<G> Default for GroupCache<G> {
    fn default() -> Self {
        GroupCache {
            keys: Vec::new(),
            groups: Vec::new(),
            n_evicted: 0,
        }
    }
}

/// The key of an empty slot: there are fewer than 2^32 parts.
const NOBODY: u64 = u64::MAX;
/// Clusters kept under a memory budget, 31 KB: hardly slower, for neighbouring clusters come in a
/// row.
const MOST_IN_BUDGET: u64 = 8;

impl<G> GroupCache<G> {
    /// Prepares for a frame of `n_clusters` clusters.
    pub fn begin<W>(&mut self, n_clusters: u64, settings: &Settings)
    where
        G: PerCluster<W>,
    {
        self.n_evicted = 0;
        self.reset(Self::capacity(n_clusters, settings));
    }

    /// How many clusters are kept in a frame of `n_clusters`.
    pub fn capacity(n_clusters: u64, settings: &Settings) -> usize {
        let most = match settings.memory_budget {
            Some(_) => MOST_IN_BUDGET,
            None => settings.tuning.most_cached.max(2),
        };
        n_clusters.max(4).min(most).next_power_of_two() as usize
    }

    /// Forgets all clusters and makes room for `n`, at least.
    pub fn reset<W>(&mut self, n: usize)
    where
        G: PerCluster<W>,
    {
        if self.groups.len() < n {
            self.groups.resize(n, G::EMPTY);
        }
        self.keys.clear();
        self.keys.resize(self.groups.len(), NOBODY);
    }

    /// Whether there is no room for any cluster.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Forgets all clusters.
    pub fn clear(&mut self) {
        self.keys.fill(NOBODY);
    }

    pub fn bytes(&self) -> usize {
        size_of::<u64>() * self.keys.capacity() + size_of::<G>() * self.groups.capacity()
    }

    fn key((part, cluster): (PartIx, ClusterIx)) -> u64 {
        u64::from(part.raw()) << 32 | u64::from(cluster.raw())
    }

    fn first_slot(&self, (part, cluster): (PartIx, ClusterIx)) -> usize {
        let hash = part.raw().wrapping_mul(67).wrapping_add(cluster.raw()) as usize;
        hash & (self.keys.len() - 1)
    }

    /// Whether a cluster of a part is cached.
    #[inline(always)]
    pub fn holds(&self, whose: (PartIx, ClusterIx)) -> bool {
        let (key, first) = (Self::key(whose), self.first_slot(whose));
        self.keys[first] == key || self.keys[first ^ 1] == key
    }

    /// The slot of a cluster of a part; computes its data if it is not cached. The cluster at the
    /// slot `pinned` stays.
    #[inline(always)]
    pub fn slot<S: Simd, W>(
        &mut self,
        simd: S,
        world: W,
        whose: (PartIx, ClusterIx),
        pinned: usize,
    ) -> usize
    where
        G: PerCluster<W>,
    {
        let (key, first) = (Self::key(whose), self.first_slot(whose));
        for slot in [first, first ^ 1] {
            if self.keys[slot] == key {
                return slot;
            }
        }
        let slot = if first == pinned { first ^ 1 } else { first };
        self.n_evicted += u64::from(self.keys[slot] != NOBODY);
        self.keys[slot] = key;
        self.groups[slot].fill(simd, world, whose.0, whose.1);
        slot
    }

    /// The cluster at a slot.
    #[inline(always)]
    pub fn at(&self, slot: usize) -> &G {
        &self.groups[slot]
    }
}
