//! Stage `bounds`: the box of each cluster, of the tree above it, and of single primitives.
//!
//! In: positions and the unique vertices of each cluster. Out: one box per cluster and per tree node, as
//! structures of arrays. A vertex is one 4-lane load and two instructions.
//! Cost: every vertex of a body once per cluster that has it (1.35 times on average in a closed mesh).
//! Invariant: a box holds all its vertices; f64 positions are rounded outward.

use crate::elements::with_corners;
use crate::grouping::GROUP;
use crate::grouping::bounds::{
    Bounds, BoundsArray, RawBoundsArray, greater, lesser, round_down, round_up,
};
use crate::grouping::clusters::Clustering;
use crate::grouping::hierarchy::Shape;
use crate::index::ClusterIx;
use crate::positions::Positions;

use super::simd::{LaneBounds, Simd};
use super::vec4::{Vec4, of_vertices_f32};

/// The box of some vertices.
#[inline]
pub(crate) fn of_vertices(positions: &Positions, vertices: &[u32]) -> Bounds {
    match positions {
        Positions::F32(positions) => of_vertices_f32(positions, vertices).0,
        Positions::F64(positions) => {
            let mut min = [f64::INFINITY; 3];
            let mut max = [f64::NEG_INFINITY; 3];
            for &vertex in vertices {
                let point = &positions[vertex as usize];
                for axis in 0..3 {
                    let x = point[axis];
                    min[axis] = if x < min[axis] { x } else { min[axis] };
                    max[axis] = if x > max[axis] { x } else { max[axis] };
                }
            }
            Bounds {
                min: min.map(round_down),
                max: max.map(round_up),
            }
        }
    }
}

/// Coordinates processed together in [`of_run`]: several registers hide the latency.
const TOGETHER: usize = 24;

/// The box of a run of a body's vertices.
pub(crate) fn of_run(positions: &Positions, run: std::ops::Range<usize>) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    match positions {
        Positions::F32(positions) => {
            let mut min = [f32::INFINITY; TOGETHER];
            let mut max = [f32::NEG_INFINITY; TOGETHER];
            let (chunks, rest) = positions[run].as_flattened().as_chunks::<TOGETHER>();
            for chunk in chunks {
                for k in 0..TOGETHER {
                    min[k] = lesser(min[k], chunk[k]);
                    max[k] = greater(max[k], chunk[k]);
                }
            }
            for (k, &x) in rest.iter().enumerate() {
                min[k] = lesser(min[k], x);
                max[k] = greater(max[k], x);
            }
            for k in 0..TOGETHER {
                bounds.min[k % 3] = lesser(bounds.min[k % 3], min[k]);
                bounds.max[k % 3] = greater(bounds.max[k % 3], max[k]);
            }
        }
        Positions::F64(positions) => {
            for point in &positions[run] {
                bounds.join(&Bounds {
                    min: point.map(round_down),
                    max: point.map(round_up),
                });
            }
        }
    }
    bounds
}

/// A summary of some clusters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Summary {
    /// The box of all of these vertices.
    pub bounds: Bounds,
    /// Half their summed surface; infinite if squares of extents overflow.
    pub surface: f32,
    /// Whether all positions that were read are certainly finite. (f64 positions are checked before.)
    pub all_finite: bool,
}

impl Summary {
    /// The summary of no clusters.
    pub const EMPTY: Summary = Summary {
        bounds: Bounds::EMPTY,
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
/// `into` must be as long as the clustering, and no other thread may access these clusters' boxes at the same time.
#[inline(always)]
pub(crate) unsafe fn of_clusters<S: Simd>(
    simd: S,
    positions: &Positions,
    clustering: &Clustering,
    clusters: impl Iterator<Item = ClusterIx>,
    into: RawBoundsArray,
) -> Summary {
    let mut summary = Summary::EMPTY;
    for cluster in clusters {
        let vertices = clustering.vertices(cluster);
        let (bounds, all_finite) = match positions {
            // SAFETY: a cluster's vertices ascend.
            Positions::F32(positions) => unsafe { simd.of_ascending(positions, vertices) },
            Positions::F64(_) => (of_vertices(positions, vertices), true),
        };
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

/// The boxes of a cluster's primitives, one per lane; lanes past its size become empty.
pub(crate) fn of_cluster_primitives(
    positions: &Positions,
    clustering: &Clustering,
    cluster: ClusterIx,
    lanes: &mut LaneBounds,
) {
    let places = clustering.places(cluster);
    with_corners!(&clustering.corners, |corners| of_primitives(
        positions,
        &corners[places],
        lanes
    ));
}

fn of_primitives<const N: usize>(
    positions: &Positions,
    corners: &[[u32; N]],
    lanes: &mut LaneBounds,
) {
    match positions {
        Positions::F32(positions) => {
            let (fours, rest) = corners.as_chunks::<4>();
            for (four_ix, four) in fours.iter().enumerate() {
                let [a, b, c, d] = four;
                let (min_a, max_a) = extent(positions, a);
                let (min_b, max_b) = extent(positions, b);
                let (min_c, max_c) = extent(positions, c);
                let (min_d, max_d) = extent(positions, d);
                let min = Vec4::transpose([min_a, min_b, min_c, min_d]);
                let max = Vec4::transpose([max_a, max_b, max_c, max_d]);
                let lane = 4 * four_ix;
                for axis in 0..3 {
                    lanes.min[axis][lane..lane + 4].copy_from_slice(&min[axis]);
                    lanes.max[axis][lane..lane + 4].copy_from_slice(&max[axis]);
                }
            }
            let done = corners.len() - rest.len();
            for (lane, corners) in (done..).zip(rest) {
                let (min, max) = extent(positions, corners);
                let (min, max) = (min.xyz(), max.xyz());
                lanes.put(lane, &Bounds { min, max });
            }
        }
        Positions::F64(_) => {
            for (lane, corners) in corners.iter().enumerate() {
                lanes.put(lane, &of_vertices(positions, corners));
            }
        }
    }
    if corners.len() < GROUP {
        lanes.clear_from(corners.len());
    }
}

#[inline(always)]
fn extent<const N: usize>(positions: &[[f32; 3]], corners: &[u32; N]) -> (Vec4, Vec4) {
    let first = Vec4::load(positions, corners[0] as usize);
    let (mut min, mut max) = (first, first);
    for &corner in &corners[1..] {
        let vertex = Vec4::load(positions, corner as usize);
        min = min.min(vertex);
        max = max.max(vertex);
    }
    (min, max)
}

/// The boxes of a tree, level by level, leaves first.
#[derive(Debug, Default)]
pub(crate) struct TreeBounds {
    pub levels: Vec<BoundsArray>,
}

impl TreeBounds {
    /// Makes room for the boxes of a shape.
    pub fn resize(&mut self, shape: &Shape) {
        self.levels
            .resize_with(shape.n_levels(), BoundsArray::default);
        for (level, boxes) in self.levels.iter_mut().enumerate() {
            boxes.resize(shape.n_nodes(level));
        }
    }

    /// Computes the boxes of the nodes above a level from those of the level.
    pub fn refit_above(&mut self, below: usize, shape: &Shape) {
        for level in below + 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(level);
            let (children, nodes) = (&below[level - 1], &mut above[0]);
            for node in 0..nodes.len() {
                let mut bounds = Bounds::EMPTY;
                for child in shape.children(level, node) {
                    bounds.join(&children.at(child));
                }
                nodes.put(node, &bounds);
            }
        }
    }

    /// The box of the whole tree.
    pub fn root(&self) -> Bounds {
        self.levels.last().map_or(Bounds::EMPTY, |root| root.at(0))
    }

    pub fn bytes(&self) -> usize {
        self.levels.iter().map(BoundsArray::bytes).sum()
    }
}
