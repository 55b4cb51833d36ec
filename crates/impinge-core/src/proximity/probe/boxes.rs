//! The boxes of a body as instruction sets read them, and the way down the tree past them.
//!
//! ```text
//! level 2     [ root ]                one node
//! level 1     [ eight boxes ]  …      read at once
//! level 0     [ clusters ]     …
//! elements    [ 64 boxes ]     …      found when a probe first comes to the cluster
//! faces       [ 64 faces ]     …      as are their corners, side by side
//! ```
//!
//! Cost: a copy of the boxes of clusters and nodes per pose, and the boxes and corners of elements
//! where they are needed.

use std::sync::{Arc, OnceLock};

use crate::boxes;
use crate::bvh::GROUP;
use crate::bvh::bounds::{Bounds, BoundsArray};
use crate::bvh::clusters::Clustering;
use crate::scene::Body;
use crate::scene::elements::Elements;
use crate::scene::index::ClusterIx;
use crate::scene::positions::{Positions, Real};
use crate::simd::{LaneBounds, Simd};
use impinge_exact::internal::filter::Triangles64;

/// The boxes of one pose.
#[derive(Debug)]
pub(super) struct Boxes {
    pub clustering: Arc<Clustering>,
    positions_stamp: Option<u64>,
    /// Of each level's nodes, from the clusters up.
    levels: Vec<BoundsArray>,
    /// Of the elements of each cluster.
    elements: Vec<OnceLock<LaneBounds>>,
    /// The corners of each cluster's faces, rounded to nearest; none for other elements.
    faces: Vec<OnceLock<Triangles64>>,
    /// More than a corner may be moved by rounding.
    rounding: f64,
}

impl Boxes {
    /// Of no pose yet.
    pub fn new(clustering: Arc<Clustering>) -> Self {
        let n = clustering.n_clusters();
        let n_of_faces = match clustering.corners {
            Elements::Triangles(_) => n,
            _ => 0,
        };
        Boxes {
            clustering,
            positions_stamp: None,
            levels: Vec::new(),
            elements: (0..n).map(|_| OnceLock::new()).collect(),
            faces: (0..n_of_faces).map(|_| OnceLock::new()).collect(),
            rounding: 0.0,
        }
    }

    /// Takes the boxes of the body's pose, if they are of another one.
    pub fn take(&mut self, body: &Body, of_levels: &[Vec<Bounds>]) {
        let stamp = Some(body.positions_stamp());
        if self.positions_stamp == stamp {
            return;
        }
        self.positions_stamp = stamp;
        self.levels.resize_with(of_levels.len(), Default::default);
        for (boxes, level) in self.levels.iter_mut().zip(of_levels) {
            boxes.resize(level.len());
            for (ix, bounds) in level.iter().enumerate() {
                boxes.put(ix, bounds);
            }
        }
        for lanes in &mut self.elements {
            lanes.take();
        }
        for faces in &mut self.faces {
            faces.take();
        }
        self.rounding = match body.positions() {
            Positions::F32(_) => 0.0,
            Positions::F64(_) => {
                let Bounds { min, max } = self.root();
                rounding_of(min).max(rounding_of(max))
            }
        };
    }

    /// Whether they are of these clusters.
    pub fn fits(&self, clustering: &Arc<Clustering>) -> bool {
        Arc::ptr_eq(&self.clustering, clustering)
    }

    pub fn bytes(&self) -> usize {
        let levels: usize = self.levels.iter().map(BoundsArray::bytes).sum();
        levels + size_of_val(&self.elements[..]) + size_of_val(&self.faces[..])
    }

    /// More than the corners of [`faces`](Boxes::faces) may be moved by rounding.
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// The corners of a cluster's faces, rounded to nearest; none if elements are no triangles.
    #[inline(always)]
    pub fn faces(&self, body: &Body, cluster: ClusterIx) -> Option<&Triangles64> {
        let faces = self.faces.get(cluster.index())?;
        Some(match faces.get() {
            Some(faces) => faces,
            None => self.find_faces(body, cluster, faces),
        })
    }

    #[cold]
    #[inline(never)]
    fn find_faces<'a>(
        &self,
        body: &Body,
        cluster: ClusterIx,
        into: &'a OnceLock<Triangles64>,
    ) -> &'a Triangles64 {
        into.get_or_init(|| {
            let mut faces = [[[0.0; GROUP]; 3]; 3];
            for (lane, slot) in self.clustering.slots(cluster).enumerate() {
                let vertices = self.clustering.corners.corners(slot);
                for (rows, &vertex) in faces.iter_mut().zip(vertices) {
                    let point = body.positions().point(vertex as usize);
                    for (row, x) in rows.iter_mut().zip(point) {
                        row[lane] = <f32 as Real>::round(x);
                    }
                }
            }
            faces
        })
    }

    /// The box of the whole body; the empty box without elements.
    pub fn root(&self) -> Bounds {
        match self.levels.last() {
            Some(top) => top.at(0),
            None => Bounds::EMPTY,
        }
    }

    /// How many levels of nodes there are, the clusters among them.
    pub fn n_levels(&self) -> usize {
        self.levels.len()
    }

    /// Eight consecutive boxes of a level, low and high ends; levels are padded by as many.
    #[inline(always)]
    pub fn eight(&self, level: usize, first: usize) -> [[&[f32; 8]; 3]; 2] {
        const NONE: &[f32; 8] = &[0.0; 8];
        let boxes = &self.levels[level];
        [&boxes.min, &boxes.max].map(|rows| {
            rows.each_ref()
                .map(|row| row[first..].first_chunk().unwrap_or(NONE))
        })
    }

    /// The boxes of a cluster's elements.
    #[inline(always)]
    pub fn elements(&self, body: &Body, cluster: ClusterIx) -> &LaneBounds {
        let lanes = &self.elements[cluster.index()];
        match lanes.get() {
            Some(lanes) => lanes,
            None => self.find_elements(body, cluster),
        }
    }

    #[cold]
    #[inline(never)]
    fn find_elements(&self, body: &Body, cluster: ClusterIx) -> &LaneBounds {
        self.elements[cluster.index()].get_or_init(|| {
            let mut lanes = LaneBounds::EMPTY;
            boxes::fill(body.positions(), &self.clustering, cluster, &mut lanes);
            lanes
        })
    }
}

/// 1 and more than the relative error of a few operations in `f32`.
pub(super) const GROWN: f32 = 1.0 + 16.0 * f32::EPSILON;

/// A node that waits to be opened: how far it is, its level and its number there.
pub(super) type Waiting = (f32, u32, u32);

/// Adds a node to those from `first` on, so that the nearest of these is popped first.
#[inline(always)]
pub(super) fn wait_in_order(waiting: &mut Vec<Waiting>, first: usize, node: Waiting) {
    let mut place = waiting.len();
    waiting.push(node);
    while place > first && waiting[place - 1].0 < node.0 {
        waiting.swap(place - 1, place);
        place -= 1;
    }
}

/// More than the length by which a point with some coordinates is moved where each is rounded to
/// single precision.
#[inline(always)]
pub(super) fn rounding_of([x, y, z]: [f32; 3]) -> f64 {
    let largest = x.abs().max(y.abs()).max(z.abs());
    // Half a unit in the last place of each of three, and what is lost below the smallest float.
    f64::from(largest) * f64::from(f32::EPSILON) + f64::from(f32::MIN_POSITIVE)
}

/// The way down a tree: siblings that are left to be visited.
#[derive(Debug, Default)]
pub(super) struct Descent {
    stack: Vec<Siblings>,
}

/// Up to eight consecutive nodes of one level.
#[derive(Debug)]
struct Siblings {
    level: usize,
    first: usize,
    /// Those whose boxes meet the query and that were not visited.
    mask: u32,
}

impl Descent {
    /// Starts at the root, whose box must meet the query.
    pub fn start(&mut self, boxes: &Boxes) {
        self.stack.clear();
        if let Some(level) = boxes.levels.len().checked_sub(1) {
            self.stack.push(Siblings {
                level,
                first: 0,
                mask: 1,
            });
        }
    }

    /// The next cluster whose box meets the query.
    #[inline(always)]
    pub fn next<S: Simd>(&mut self, simd: S, boxes: &Boxes, query: &Bounds) -> Option<ClusterIx> {
        loop {
            let top = self.stack.last_mut()?;
            if top.mask == 0 {
                self.stack.pop();
                continue;
            }
            let node = top.first + top.mask.trailing_zeros() as usize;
            top.mask &= top.mask - 1;
            if top.level == 0 {
                return Some(ClusterIx::new(node as u32));
            }
            let level = top.level - 1;
            let children = boxes.clustering.shape.children(top.level, node);
            let mask = simd.overlaps_8(&boxes.levels[level], children.start, query)
                & ((1 << children.len()) - 1);
            self.stack.push(Siblings {
                level,
                first: children.start,
                mask,
            });
        }
    }
}
