//! Remote clusters: proven, without their boxes, to be beside all other bodies.
//!
//! Computing a cluster's box reads vertices from all over memory; reading vertices in memory order costs a fraction of
//! that. Bodies that meet mostly do so with only a part of them, and clusters that lie beside the
//! other body mostly stay there for many frames. So clusters are *sorted*: those that lie beside all
//! bodies that their body could meet go into one of six groups, below or above them along x, y or z.
//!
//! ```text
//!            below, x |  near   | above, x
//!   body    .c..c..c..|c.c.c..cc|..c...
//!   others            [.........]
//! ```
//!
//! Each frame reads all positions in order and finds the interval that each group spans along its axis, and the box of
//! the whole body. A group whose interval touches no other body's box is proven *remote*, however bodies have
//! moved: none of its primitives can be in a pair, and its clusters keep empty boxes. A group that touches another box
//! has come back: its clusters are near in this frame and are sorted again at its end, with more slack between them and
//! the others if the group came back soon.
//!
//! In: boxes of clusters, then positions frame by frame. Out: which clusters' boxes a frame needs.

use std::ops::{Range, RangeInclusive};

use crate::grouping::bounds::{Bounds, greater};
use crate::grouping::clusters::Clustering;

use super::bounds::TreeBounds;
use super::extents::{self, Extents, FreeSide, Intervals, Sides};
use super::runs::{Members, RUN};
use super::simd::{Lanes, Simd};

/// Some clusters of a node of level 1: bit `k` for child `k`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SomeClusters {
    pub node: u32,
    pub children: u8,
}

/// The clusters of a body, sorted or not, and when to sort them. Memory is kept.
#[derive(Debug, Default)]
pub(crate) struct Remote {
    is_sorted: bool,
    /// The group of each cluster; `None` for clusters that are near. Clusters in a group have empty boxes.
    sides: Vec<Option<FreeSide>>,
    /// The clusters that are near.
    near: Vec<SomeClusters>,
    /// The groups of each vertex, run by run.
    members: Vec<Members>,
    n_vertices: usize,
    /// The intervals of the groups in the current pose.
    groups: Intervals,
    /// Groups whose clusters are to be sorted again at the frame's end.
    unsorted: Sides,
    /// Clusters just found to lie beside the others, and their sides.
    fresh: Vec<(u32, FreeSide)>,
    outlook: Outlook,
}

impl Remote {
    /// Whether the clusters are sorted.
    pub fn is_sorted(&self) -> bool {
        self.is_sorted
    }

    /// Whether clusters are to be sorted at the frame's end, once the boxes of all near clusters are known.
    pub fn is_due(&self) -> bool {
        !self.unsorted.is_empty() || (!self.is_sorted && self.outlook.wait == 0)
    }

    /// The clusters that are near.
    pub fn near(&self) -> &[SomeClusters] {
        &self.near
    }

    /// The number of clusters that are near.
    pub fn n_near(&self) -> usize {
        let near = self.near.iter().map(|near| near.children.count_ones());
        near.sum::<u32>() as usize
    }

    /// The number of runs of vertices.
    pub fn n_runs(&self) -> usize {
        self.members.len()
    }

    /// Whether the sorting fits a body of `n_vertices` vertices and is not due for renewal.
    pub fn is_fit_for(&self, n_vertices: usize) -> bool {
        self.n_vertices == n_vertices && self.outlook.age < RENEWED_AFTER
    }

    /// Begins a frame of a body that moved: its positions are not known yet.
    pub fn begin(&mut self) {
        self.outlook.grow_older(self.is_sorted);
        self.groups = Intervals::EMPTY;
    }

    /// Adds the extents of positions that were read.
    pub fn add(&mut self, extents: &Extents) {
        self.groups.join(&extents.groups);
    }

    /// The groups that are not beside a box.
    pub fn back_at(&self, other: &Bounds) -> Sides {
        self.groups.back_at(other)
    }

    /// Ends the sorting. Returns whether all boxes must be found again.
    #[must_use]
    pub fn end(&mut self) -> bool {
        self.unsorted = Sides::default();
        std::mem::take(&mut self.is_sorted)
    }

    /// A frame needs all boxes: the caller ends the sorting. It does not begin again at once, for the next frames may need
    /// all boxes too.
    pub fn interrupt(&mut self) {
        if self.is_sorted {
            self.outlook.pause();
        }
    }

    /// Some groups have come back: their clusters are near from now on. False if groups have come back too often lately:
    /// then the caller ends the sorting.
    pub fn come_back(&mut self, groups: Sides, clustering: &Clustering) -> bool {
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

    /// Sorts near clusters by their boxes against the joint box of `others`, and empties the boxes of clusters that lie beside
    /// it. False if there are too few of these: then the caller ends the sorting.
    #[must_use]
    pub fn sort(
        &mut self,
        clustering: &Clustering,
        n_vertices: usize,
        bounds: &mut TreeBounds,
        whole: &Bounds,
        others: &Bounds,
    ) -> bool {
        let [leaves, parents, ..] = &mut bounds.levels[..] else {
            return false;
        };
        if !self.is_sorted {
            self.unsorted = Sides::ALL;
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
        for (cluster, known) in self.sides.iter_mut().enumerate() {
            if known.is_none() {
                *known = side(&leaves.at(cluster), others, &slack);
                if let Some(side) = *known {
                    self.fresh.push((cluster as u32, side));
                }
            }
            n_beside += usize::from(known.is_some());
        }
        if 4 * n_beside < leaves.len() {
            self.outlook.too_few();
            return false;
        }
        self.is_sorted = true;
        let unsorted = std::mem::take(&mut self.unsorted);
        extents::clear(&mut self.members, unsorted);
        self.groups.clear(unsorted);
        for &(cluster, side) in &self.fresh {
            self.groups.extend(side, &leaves.at(cluster as usize));
            leaves.put(cluster as usize, &Bounds::EMPTY);
            for &vertex in clustering.vertices(cluster as usize) {
                extents::insert(&mut self.members, vertex, side);
            }
        }
        self.list_near(clustering);
        let mut near = self.near.iter().map(|near| near.node as usize).peekable();
        for node in 0..parents.len() {
            if near.next_if_eq(&node).is_none() {
                parents.put(node, &Bounds::EMPTY);
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
        size_of::<Remote>()
            + size_of::<Members>() * self.members.capacity()
            + size_of::<SomeClusters>() * self.near.capacity()
            + size_of::<Option<FreeSide>>() * self.sides.capacity()
            + size_of::<(u32, FreeSide)>() * self.fresh.capacity()
    }
}

/// The side on which a box is farthest beside others, measured in units of that side's slack; `None` if no gap is larger
/// than its slack.
fn side(cluster: &Bounds, others: &Bounds, slack: &[f32; 6]) -> Option<FreeSide> {
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
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        Some(self.first + self.lanes.next()?)
    }
}

/// When a body's clusters should be sorted, and how cautiously.
#[derive(Debug, Clone, Copy)]
struct Outlook {
    /// Frames to wait before sorting.
    wait: u32,
    /// Frames to wait the next time that groups come back too often.
    next_wait: u32,
    /// Frames since all clusters were sorted.
    age: u32,
    /// Frames since each group was sorted.
    ages: [u32; 6],
    /// Grows by one per frame; sorting groups again costs [`COST`].
    credit: u32,
    /// How far beside the others a cluster must be to be in a group, as a share of the body's longest side.
    slack: [f32; 6],
}

/// Frames after which all boxes are found again, to see which clusters are remote by now and how well clusters fit.
const RENEWED_AFTER: u32 = 64;
/// Frames that a group should last.
const LASTS: u32 = 24;
/// Sorting groups again costs as much as they save in this many frames.
const COST: u32 = 6;
const MOST_CREDIT: u32 = 4 * COST;
const SLACK: RangeInclusive<f32> = 1.0 / 128.0..=0.25;

impl Default for Outlook {
    fn default() -> Self {
        Outlook {
            // The second frame shows whether the body moves.
            wait: 2,
            next_wait: 1,
            age: 0,
            ages: [0; 6],
            credit: 0,
            slack: [*SLACK.start(); 6],
        }
    }
}

impl Outlook {
    /// The slacks for a body of this size.
    fn slack(&self, whole: &Bounds) -> [f32; 6] {
        let sides = [0, 1, 2].map(|axis| whole.max[axis] - whole.min[axis]);
        let longest = greater(sides[0], greater(sides[1], sides[2]));
        self.slack.map(|slack| slack * longest)
    }

    fn grow_older(&mut self, is_sorted: bool) {
        self.wait = self.wait.saturating_sub(1);
        self.age += u32::from(is_sorted);
        self.ages = self.ages.map(|age| age.saturating_add(1));
        self.credit = (self.credit + 1).min(MOST_CREDIT);
    }

    /// All clusters are sorted now.
    fn begin(&mut self) {
        if self.age >= RENEWED_AFTER {
            self.next_wait = 1;
            self.slack = self.slack.map(|slack| slack_for(slack, RENEWED_AFTER));
        }
        self.age = 0;
        self.ages = [0; 6];
        self.credit = COST;
    }

    /// Groups have come back: returns whether it pays to sort them again.
    fn affords(&mut self, groups: Sides) -> bool {
        for side in groups.sides() {
            let group = side.number();
            self.slack[group] = slack_for(self.slack[group], self.ages[group]);
            self.ages[group] = 0;
        }
        if self.credit >= COST {
            self.credit -= COST;
            return true;
        }
        self.pause();
        false
    }

    /// Makes the sorting wait, longer each time.
    fn pause(&mut self) {
        self.wait = self.next_wait;
        self.next_wait = (2 * self.next_wait).min(RENEWED_AFTER);
    }

    /// Too few clusters lie beside the others: waits.
    fn too_few(&mut self) {
        self.wait = RENEWED_AFTER / 4;
    }
}

/// The slack with which a group would have lasted [`LASTS`] frames, given that it lasted `age` frames with this one.
fn slack_for(slack: f32, age: u32) -> f32 {
    (slack * LASTS as f32 / (age as f32 + 1.0)).clamp(*SLACK.start(), *SLACK.end())
}
