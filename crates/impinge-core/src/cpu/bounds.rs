//! Stage `bounds`: the box of each cluster, and of the tree above it.
//!
//! In: positions and the unique vertices of each cluster. Out: one box per cluster and per tree
//! node, as structures of arrays. A vertex is one 4-lane load and two instructions. Cost: every
//! vertex of a body once per cluster that has it (1.35 times on average in a closed mesh).
//! Invariant: a box holds all its vertices; f64 positions are rounded outward.

use crate::boxes::{self, ReadVertices};
use crate::bvh::bounds::{Aabb, BoundsArray, RawBoundsArray};
use crate::bvh::clusters::Clustering;
use crate::bvh::tree::TreeShape;
use crate::scene::index::ClusterIx;
use crate::scene::positions::Positions;

/// A summary of some clusters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Summary {
    /// The box of all of these vertices.
    pub bounds: Aabb,
    /// Half their summed surface; infinite if squares of extents overflow.
    pub surface: f32,
    /// Whether all positions that were read are certainly finite. (f64 positions are checked
    /// before.)
    pub all_finite: bool,
}

impl Summary {
    /// The summary of no clusters.
    pub const EMPTY: Summary = Summary {
        bounds: Aabb::EMPTY,
        surface: 0.0,
        all_finite: true,
    };

    /// Adds other clusters.
    #[inline(always)]
    pub fn join(&mut self, other: &Summary) {
        self.bounds.join(&other.bounds);
        self.surface += other.surface;
        self.all_finite &= other.all_finite;
    }
}

/// The boxes of some clusters.
///
/// # Safety
/// `into` must be as long as the clustering, and no other thread may access these clusters' boxes
/// at the same time.
#[inline(always)]
pub(crate) unsafe fn of_clusters<S: ReadVertices>(
    simd: S,
    positions: &Positions,
    clustering: &Clustering,
    clusters: impl Iterator<Item = ClusterIx>,
    into: RawBoundsArray,
) -> Summary {
    let mut summary = Summary::EMPTY;
    for cluster in clusters {
        let (bounds, all_finite) = boxes::of_cluster(simd, positions, clustering, cluster);
        let [x, y, z] = [0, 1, 2].map(|axis| bounds.max[axis] - bounds.min[axis]);
        summary.join(&Summary {
            bounds,
            surface: x * y + y * z + z * x,
            all_finite,
        });
        // SAFETY: by the contract of this function.
        unsafe { into.put(cluster.index(), &bounds) };
    }
    summary
}

/// The boxes of a tree, level by level, leaves first.
#[derive(Debug, Default)]
pub(crate) struct TreeBounds {
    pub levels: Vec<BoundsArray>,
}

impl TreeBounds {
    /// Makes room for the boxes of a shape.
    pub fn resize(&mut self, shape: &TreeShape) {
        self.levels
            .resize_with(shape.n_levels(), BoundsArray::default);
        for (level, boxes) in self.levels.iter_mut().enumerate() {
            boxes.resize(shape.n_nodes(level));
        }
    }

    /// Computes the boxes of the nodes above a level from those of the level.
    pub fn refit_above(&mut self, below: usize, shape: &TreeShape) {
        for level in below + 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(level);
            let (children, nodes) = (&below[level - 1], &mut above[0]);
            for node in 0..nodes.len() {
                let mut bounds = Aabb::EMPTY;
                for child in shape.children(level, node) {
                    bounds.join(&children.at(child));
                }
                nodes.put(node, &bounds);
            }
        }
    }

    /// The box of the whole tree.
    pub fn root(&self) -> Aabb {
        self.levels.last().map_or(Aabb::EMPTY, |root| root.at(0))
    }

    pub fn bytes(&self) -> usize {
        self.levels.iter().map(BoundsArray::bytes).sum()
    }
}
