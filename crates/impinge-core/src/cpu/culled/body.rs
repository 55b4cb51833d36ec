//! The clusters of a body, sorted into those that are near and six groups that lie beside the other
//! bodies.

use std::ops::Range;

use crate::bvh::bounds::Aabb;
use crate::bvh::clusters::Clustering;
use crate::cpu::bounds::TreeBounds;
use crate::scene::index::ClusterIx;
use crate::simd::runs::{Members, RUN};
use crate::simd::{Lanes, Simd};
use crate::workers::tuning::Tuning;

use super::extents::{self, Extents, FreeSide, FreeSides, Intervals};
use super::outlook::Outlook;

/// Some clusters of a node of level 1: bit `k` for child `k`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SomeClusters {
    pub node: u32,
    pub children: u8,
}

/// The clusters of a body, sorted or not, and when to sort them. Memory is kept.
#[derive(Debug)]
pub(crate) struct Culled {
    is_sorted: bool,
    /// The group of each cluster; `None` for clusters that are near. Clusters in a group have empty
    /// boxes.
    sides: Vec<Option<FreeSide>>,
    /// The clusters that are near.
    near: Vec<SomeClusters>,
    /// The groups of each vertex, run by run.
    members: Vec<Members>,
    n_vertices: usize,
    /// The intervals of the groups in the current pose.
    groups: Intervals,
    /// Groups whose clusters are to be sorted again at the frame's end.
    unsorted: FreeSides,
    /// Clusters just found to lie beside the other bodies, and on which side.
    fresh: Vec<(ClusterIx, FreeSide)>,
    /// Clusters stay sorted if at least one in this many is in a group.
    one_in: usize,
    outlook: Outlook,
}

impl Culled {
    pub fn new(tuning: &Tuning) -> Self {
        Culled {
            is_sorted: false,
            sides: Vec::new(),
            near: Vec::new(),
            members: Vec::new(),
            n_vertices: 0,
            groups: Intervals::EMPTY,
            unsorted: FreeSides::default(),
            fresh: Vec::new(),
            one_in: tuning.culled_one_in,
            outlook: Outlook::new(tuning),
        }
    }

    /// Whether the clusters are sorted.
    pub fn is_sorted(&self) -> bool {
        self.is_sorted
    }

    /// Whether clusters are to be sorted at the frame's end, once the boxes of all near clusters
    /// are known.
    pub(super) fn is_due(&self) -> bool {
        !self.unsorted.is_empty() || (!self.is_sorted && !self.outlook.waits())
    }

    /// The clusters that are near, node by node, if the clusters are sorted.
    pub fn near(&self) -> &[SomeClusters] {
        &self.near
    }

    /// The number of clusters that are near.
    pub(super) fn n_near(&self) -> usize {
        let near = self.near.iter().map(|near| near.children.count_ones());
        near.sum::<u32>() as usize
    }

    /// The number of runs of vertices.
    pub fn n_runs(&self) -> usize {
        self.members.len()
    }

    /// Whether the sorting fits a body of `n_vertices` vertices and is not due for renewal.
    pub(super) fn is_fit_for(&self, n_vertices: usize) -> bool {
        self.n_vertices == n_vertices && !self.outlook.is_old()
    }

    /// Begins a frame of a body that moved: its positions are not known yet.
    pub(super) fn begin(&mut self) {
        self.outlook.grow_older(self.is_sorted);
        self.groups = Intervals::EMPTY;
    }

    /// Adds the extents of positions that were read.
    pub fn add(&mut self, extents: &Extents) {
        self.groups.join(&extents.groups);
    }

    /// The groups that are not beside a box.
    pub(super) fn back_at(&self, other: &Aabb) -> FreeSides {
        self.groups.back_at(other)
    }

    /// Ends the sorting. Returns whether all boxes must be found again.
    #[must_use]
    pub(super) fn end(&mut self) -> bool {
        self.unsorted = FreeSides::default();
        std::mem::take(&mut self.is_sorted)
    }

    /// A frame needs all boxes: the caller ends the sorting. It does not begin again at once, for
    /// the next frames may need all boxes too.
    pub(super) fn interrupt(&mut self) {
        if self.is_sorted {
            self.outlook.pause();
        }
    }

    /// Some groups have come back: their clusters are near from now on. False if groups have come
    /// back too often lately: then the caller ends the sorting.
    pub(super) fn come_back(&mut self, groups: FreeSides, clustering: &Clustering) -> bool {
        if !self.outlook.affords(groups) {
            return false;
        }
        self.unsorted = groups;
        for side in &mut self.sides {
            if side.is_some_and(|side| groups.contains(side)) {
                *side = None;
            }
        }
        self.list_near(clustering);
        true
    }

    /// The extents of some of the body's runs of vertices.
    #[inline(always)]
    pub fn read<S: Simd>(&self, simd: S, positions: &[[f32; 3]], runs: Range<usize>) -> Extents {
        let vertices = RUN * runs.start..positions.len().min(RUN * runs.end);
        extents::of(simd, &positions[vertices], &self.members[runs])
    }

    /// Sorts near clusters by their boxes against the joint box of `others`, and empties the boxes
    /// of clusters that lie beside it. False if there are too few of these: then the caller ends
    /// the sorting.
    #[must_use]
    pub(super) fn sort(
        &mut self,
        clustering: &Clustering,
        n_vertices: usize,
        bounds: &mut TreeBounds,
        whole: &Aabb,
        others: &Aabb,
    ) -> bool {
        let [leaves, parents, ..] = &mut bounds.levels[..] else {
            return false;
        };
        if !self.is_sorted {
            self.unsorted = FreeSides::ALL;
            self.outlook.begin();
            self.n_vertices = n_vertices;
            self.sides.clear();
            self.sides.resize(leaves.len(), None);
            self.members.clear();
            self.members
                .resize(n_vertices.div_ceil(RUN), Members::default());
        }
        let slack = self.outlook.slack(whole);
        self.fresh.clear();
        let mut n_beside = 0;
        for (cluster, known) in clustering.clusters().zip(&mut self.sides) {
            if known.is_none() {
                *known = side(&leaves.at(cluster.index()), others, &slack);
                if let Some(side) = *known {
                    self.fresh.push((cluster, side));
                }
            }
            n_beside += usize::from(known.is_some());
        }
        if n_beside.saturating_mul(self.one_in) < leaves.len() {
            self.outlook.too_few();
            return false;
        }
        self.is_sorted = true;
        let unsorted = std::mem::take(&mut self.unsorted);
        extents::clear(&mut self.members, unsorted);
        self.groups.clear(unsorted);
        for &(cluster, side) in &self.fresh {
            self.groups.extend(side, &leaves.at(cluster.index()));
            leaves.put(cluster.index(), &Aabb::EMPTY);
            for &vertex in clustering.vertices(cluster) {
                extents::insert(&mut self.members, vertex, side);
            }
        }
        self.list_near(clustering);
        let mut near = self.near.iter().map(|near| near.node as usize).peekable();
        for node in 0..parents.len() {
            if near.next_if_eq(&node).is_none() {
                parents.put(node, &Aabb::EMPTY);
            }
        }
        true
    }

    fn list_near(&mut self, clustering: &Clustering) {
        self.near.clear();
        for node in 0..clustering.shape.n_nodes(1) {
            let mut children = 0u8;
            for (child, cluster) in clustering.shape.children(1, node).enumerate() {
                children |= u8::from(self.sides[cluster].is_none()) << child;
            }
            if children != 0 {
                let node = node as u32;
                self.near.push(SomeClusters { node, children });
            }
        }
    }

    pub fn bytes(&self) -> usize {
        size_of::<Culled>()
            + size_of::<Members>() * self.members.capacity()
            + size_of::<SomeClusters>() * self.near.capacity()
            + size_of::<Option<FreeSide>>() * self.sides.capacity()
            + size_of::<(ClusterIx, FreeSide)>() * self.fresh.capacity()
    }
}

/// The side on which a box is farthest beside others, measured in units of that side's slack;
/// `None` if no gap is larger than its slack.
fn side(cluster: &Aabb, others: &Aabb, slack: &[f32; 6]) -> Option<FreeSide> {
    let mut best = None;
    let mut farthest = 1.0;
    for axis in 0..3 {
        let below = others.min[axis] - cluster.max[axis];
        let above = cluster.min[axis] - others.max[axis];
        for (gap, is_above) in [(below, false), (above, true)] {
            let side = FreeSide::new(axis, is_above);
            let far = gap / slack[side.number()];
            if gap > 0.0 && far > farthest {
                farthest = far;
                best = Some(side);
            }
        }
    }
    best
}

/// Iterates over some of a node's clusters.
pub(crate) struct Children {
    first: usize,
    lanes: Lanes,
}

impl Children {
    /// The children whose bits are set in `only`.
    #[inline(always)]
    pub fn new(children: Range<usize>, only: u8) -> Self {
        Children {
            first: children.start,
            lanes: Lanes(u64::from(only & (u8::MAX >> (8 - children.len())))),
        }
    }
}

impl Iterator for Children {
    type Item = ClusterIx;

    #[inline(always)]
    fn next(&mut self) -> Option<ClusterIx> {
        Some(ClusterIx::from_usize(self.first + self.lanes.next()?))
    }
}
