//! The boxes of a body as instruction sets read them, and the way down the tree past them.
//!
//! ```text
//! level 2     [ root ]                one node
//! level 1     [ eight boxes ]  …      read at once
//! level 0     [ clusters ]     …
//! elements    [ 64 boxes ]     …      found when a probe first comes to the cluster
//! ```
//!
//! Cost: a copy of the boxes of clusters and nodes per pose, and the boxes of elements where they
//! are needed.

use std::sync::{Arc, OnceLock};

use crate::boxes;
use crate::bvh::bounds::{Bounds, BoundsArray};
use crate::bvh::clusters::Clustering;
use crate::scene::Body;
use crate::scene::index::ClusterIx;
use crate::simd::{LaneBounds, Simd};

/// The boxes of one pose.
#[derive(Debug)]
pub(super) struct Boxes {
    pub clustering: Arc<Clustering>,
    positions_stamp: u64,
    /// Of each level's nodes, from the clusters up.
    levels: Vec<BoundsArray>,
    /// Of the elements of each cluster.
    elements: Vec<OnceLock<LaneBounds>>,
}

impl Boxes {
    pub fn new(
        clustering: Arc<Clustering>,
        positions_stamp: u64,
        of_levels: &[Vec<Bounds>],
    ) -> Self {
        let levels = of_levels.iter().map(|level| {
            let mut boxes = BoundsArray::default();
            boxes.resize(level.len());
            for (ix, bounds) in level.iter().enumerate() {
                boxes.put(ix, bounds);
            }
            boxes
        });
        Boxes {
            levels: levels.collect(),
            elements: (0..clustering.n_clusters())
                .map(|_| OnceLock::new())
                .collect(),
            clustering,
            positions_stamp,
        }
    }

    /// Whether they are of these clusters in the pose with this stamp.
    pub fn fits(&self, clustering: &Arc<Clustering>, positions_stamp: u64) -> bool {
        Arc::ptr_eq(&self.clustering, clustering) && self.positions_stamp == positions_stamp
    }

    pub fn bytes(&self) -> usize {
        let levels: usize = self.levels.iter().map(BoundsArray::bytes).sum();
        levels + size_of_val(&self.elements[..])
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

    /// The boxes of a level's nodes.
    #[inline(always)]
    pub fn level(&self, level: usize) -> &BoundsArray {
        &self.levels[level]
    }

    /// The box of a node.
    #[inline(always)]
    pub fn node(&self, level: usize, node: usize) -> Bounds {
        self.levels[level].at(node)
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
