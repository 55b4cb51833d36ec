//! Clusters that no other body comes near, proven so without their boxes.
//!
//! A cluster's box takes a look at its vertices wherever they lie in memory; read in the order of memory, vertices
//! cost a fraction of that. Bodies that meet mostly do so with a part of them, and what lies beside the
//! other body mostly stays there for many frames. So now and then clusters are *sorted*: those that lie beside all
//! that their body could meet go into one of six groups, below or above it along x, y or z.
//!
//! ```text
//!            below, x |  near   | above, x
//!   body    .c..c..c..|c.c.c..cc|..c...
//!   others            [.........]
//! ```
//!
//! Each frame reads all positions in order and finds the interval that each group spans along its axis, and the box of
//! the whole. A group whose interval touches none of the other boxes is proven *remote*, whatever has moved and
//! however: none of its primitives can be in a pair, and its clusters keep empty boxes. A group that touches one has come
//! back: then all boxes are found, as without sorting.
//!
//! In: positions, groups. Out: [`Extents`]. Cost: 12 bytes of positions and 0.75 of membership a vertex, read once.

use std::ops::{Range, RangeInclusive};

use crate::grouping::bounds::{Bounds, greater, lesser};
use crate::grouping::clusters::Clustering;

use super::bounds::TreeBounds;
use super::simd::{Lanes, Simd};

/// Vertices read together.
pub(crate) const RUN: usize = 16;
/// Their coordinates.
pub(crate) const COORDINATES: usize = 3 * RUN;

/// Which coordinates of a run belong to a group: those along x of what is beside others along x, and so on. One bit
/// each, first below, then above; a vertex of several clusters may be in several groups.
pub(crate) type Members = [[u16; 3]; 2];

/// What a kernel finds, coordinate by coordinate of a run.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct RunExtents {
    pub min: [f32; COORDINATES],
    pub max: [f32; COORDINATES],
    pub sum: [f32; COORDINATES],
    pub group_min: [[f32; COORDINATES]; 2],
    pub group_max: [[f32; COORDINATES]; 2],
}

impl RunExtents {
    pub const EMPTY: RunExtents = RunExtents {
        min: [f32::INFINITY; COORDINATES],
        max: [f32::NEG_INFINITY; COORDINATES],
        sum: [0.0; COORDINATES],
        group_min: [[f32::INFINITY; COORDINATES]; 2],
        group_max: [[f32::NEG_INFINITY; COORDINATES]; 2],
    };
}

/// For each byte of members, all ones in the place of what is none: as f32 a NaN, which minimum and maximum pass over.
static NO_MEMBERS: [[u32; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut k = 0;
    while k < 8 * 256 {
        if (k / 8) >> (k % 8) & 1 == 0 {
            table[k / 8][k % 8] = u32::MAX;
        }
        k += 1;
    }
    table
};

/// Those of one eight of a run's coordinates that are not in a group.
#[inline(always)]
pub(crate) fn no_members(members: &Members, side: usize, eight: usize) -> &'static [u32; 8] {
    let byte = members[side][eight / 2] >> (8 * (eight % 2)) & 0xff;
    &NO_MEMBERS[usize::from(byte)]
}

/// Runs looked at again and again, eight coordinates of each at a time, while they are in the first-level cache.
pub(crate) const BLOCK: usize = 32;

/// Adds runs with their members, as plain loops.
#[inline(always)]
pub(crate) fn add_runs(runs: &[[[f32; 3]; RUN]], members: &[Members], into: &mut RunExtents) {
    for (runs, members) in runs.chunks(BLOCK).zip(members.chunks(BLOCK)) {
        for eight in 0..COORDINATES / 8 {
            add_eight(runs, members, eight, into);
        }
    }
}

/// The same for one eight of their coordinates: so few that all that is found of them stays in registers.
#[inline(always)]
fn add_eight(runs: &[[[f32; 3]; RUN]], members: &[Members], eight: usize, into: &mut RunExtents) {
    let mut min = [f32::INFINITY; 8];
    let mut max = [f32::NEG_INFINITY; 8];
    let mut sum = [0.0f32; 8];
    let mut group_min = [[f32::INFINITY; 8]; 2];
    let mut group_max = [[f32::NEG_INFINITY; 8]; 2];
    for (run, members) in runs.iter().zip(members) {
        let x = &run.as_flattened().as_chunks::<8>().0[eight];
        let none = [0, 1].map(|side| no_members(members, side, eight));
        for k in 0..8 {
            min[k] = lesser(x[k], min[k]);
            max[k] = greater(x[k], max[k]);
            sum[k] += x[k];
            for side in 0..2 {
                let x = f32::from_bits(x[k].to_bits() | none[side][k]);
                group_min[side][k] = lesser(x, group_min[side][k]);
                group_max[side][k] = greater(x, group_max[side][k]);
            }
        }
    }
    for k in 0..8 {
        let at = 8 * eight + k;
        into.min[at] = lesser(min[k], into.min[at]);
        into.max[at] = greater(max[k], into.max[at]);
        into.sum[at] += sum[k];
        for side in 0..2 {
            into.group_min[side][at] = lesser(group_min[side][k], into.group_min[side][at]);
            into.group_max[side][at] = greater(group_max[side][k], into.group_max[side][at]);
        }
    }
}

/// How far a body and its groups reach.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extents {
    /// The box of all vertices.
    pub whole: Bounds,
    /// The groups below and above: each axis by itself, so not boxes. Groups without members span nothing.
    pub groups: [Bounds; 2],
    /// Whether all positions are certainly finite; the rest is of use only if they are.
    pub all_finite: bool,
}

impl Extents {
    /// Of no vertices.
    pub const EMPTY: Extents = Extents {
        whole: Bounds::EMPTY,
        groups: [Bounds::EMPTY; 2],
        all_finite: true,
    };

    /// Adds those of other vertices.
    pub fn join(&mut self, other: &Extents) {
        self.whole.join(&other.whole);
        for (group, other) in self.groups.iter_mut().zip(&other.groups) {
            group.join(other);
        }
        self.all_finite &= other.all_finite;
    }

    /// Whether every group is beside a box: closed intervals that share no number.
    pub fn are_beside(&self, other: &Bounds) -> bool {
        self.groups.iter().all(|group| {
            (0..3)
                .all(|axis| group.max[axis] < other.min[axis] || other.max[axis] < group.min[axis])
        })
    }
}

/// Those of a run of runs; the last one may be shorter. Positions and members begin at the same vertex.
#[inline(always)]
fn extents<S: Simd>(simd: S, positions: &[[f32; 3]], members: &[Members]) -> Extents {
    let mut found = RunExtents::EMPTY;
    let (runs, rest) = positions.as_chunks::<RUN>();
    let (members, last_members) = members.split_at(runs.len());
    simd.add_runs(runs, members, &mut found);
    if let [first, ..] = rest {
        // Its first vertex again and again: no member in those places.
        let mut run = [*first; RUN];
        run[..rest.len()].copy_from_slice(rest);
        simd.add_runs(&[run], &last_members[..1], &mut found);
    }
    let mut extents = Extents::EMPTY;
    let mut sum = 0.0;
    for k in 0..COORDINATES {
        let axis = k % 3;
        let Extents { whole, groups, .. } = &mut extents;
        whole.min[axis] = lesser(whole.min[axis], found.min[k]);
        whole.max[axis] = greater(whole.max[axis], found.max[k]);
        for (side, group) in groups.iter_mut().enumerate() {
            group.min[axis] = lesser(group.min[axis], found.group_min[side][k]);
            group.max[axis] = greater(group.max[axis], found.group_max[side][k]);
        }
        // Finite only if all terms are. It may overflow on finite ones: then they are looked at.
        sum += found.sum[k];
    }
    extents.all_finite = sum.is_finite();
    extents
}

/// The clusters of a body, sorted or not, and when to sort them. Memory is kept.
#[derive(Debug, Default)]
pub(crate) struct Remote {
    /// Frames since clusters were sorted. Those in a group have empty boxes as long as there is an age.
    age: Option<u32>,
    /// Run by run.
    members: Vec<Members>,
    n_vertices: usize,
    n_beside: usize,
    /// What is in no group.
    near: Vec<SomeClusters>,
    outlook: Outlook,
    /// Of each cluster, while they are sorted.
    sides: Vec<Option<Side>>,
}

/// Some clusters of a node of level 1: bit `k` for its child `k`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SomeClusters {
    pub node: u32,
    pub children: u8,
}

/// Where a cluster lies beside others.
#[derive(Debug, Clone, Copy)]
struct Side {
    axis: u8,
    is_above: bool,
}

/// Groups that hold a lesser share of the clusters gain nothing.
const LEAST_SHARE: f32 = 0.25;

impl Remote {
    /// Whether the clusters are sorted.
    pub fn is_sorted(&self) -> bool {
        self.age.is_some()
    }

    /// How many clusters are in groups.
    pub fn n_clusters(&self) -> usize {
        self.age.map_or(0, |_| self.n_beside)
    }

    /// What is in no group.
    pub fn near(&self) -> &[SomeClusters] {
        &self.near
    }

    /// How many runs of vertices there are.
    pub fn n_runs(&self) -> usize {
        self.members.len()
    }

    /// Whether it can be read with so many positions, and need not be renewed.
    pub fn is_fit_for(&self, n_vertices: usize) -> bool {
        self.n_vertices == n_vertices && self.age.is_some_and(|age| age < RENEWED_AFTER)
    }

    /// The positions are read once more.
    pub fn grow_older(&mut self) {
        self.age = self.age.map(|age| age + 1);
    }

    /// Ends it. All boxes must be found again if this says so.
    #[must_use]
    pub fn end(&mut self) -> bool {
        let age = self.age.take();
        if let Some(age) = age {
            self.outlook.ended(age);
        }
        age.is_some()
    }

    /// The extents of some of the body's runs of vertices.
    #[inline(always)]
    pub fn read<S: Simd>(&self, simd: S, positions: &[[f32; 3]], runs: Range<usize>) -> Extents {
        let vertices = RUN * runs.start..positions.len().min(RUN * runs.end);
        extents(simd, &positions[vertices], &self.members[runs])
    }

    /// To be called in a frame that has found all boxes. Where it is time, sorts clusters by their boxes against the joint box
    /// of `others`, empties the boxes of those that lie beside it, and finds how far their groups reach.
    pub fn sort(
        &mut self,
        clustering: &Clustering,
        n_vertices: usize,
        bounds: &mut TreeBounds,
        others: &Bounds,
        extents: &mut Extents,
    ) {
        let [leaves, parents, ..] = &mut bounds.levels[..] else {
            return;
        };
        if !self.outlook.is_due() {
            return;
        }
        let slack = self.outlook.slack(&extents.whole);
        self.sides.clear();
        self.sides
            .extend((0..leaves.len()).map(|cluster| side(&leaves.at(cluster), others, slack)));
        self.n_beside = self.sides.iter().flatten().count();
        if (self.n_beside as f32) < LEAST_SHARE * self.sides.len() as f32 {
            self.outlook.nothing_found();
            return;
        }
        self.age = Some(0);
        self.n_vertices = n_vertices;
        self.members.clear();
        self.members
            .resize(n_vertices.div_ceil(RUN), Members::default());
        self.near.clear();
        extents.groups = Extents::EMPTY.groups;
        for node in 0..parents.len() {
            let mut near = 0u8;
            for (child, cluster) in clustering.shape.children(1, node).enumerate() {
                let Some(side) = self.sides[cluster] else {
                    near |= 1 << child;
                    continue;
                };
                let bounds = leaves.at(cluster);
                leaves.put(cluster, &Bounds::EMPTY);
                let (group, axis) = (usize::from(side.is_above), usize::from(side.axis));
                let extent = &mut extents.groups[group];
                extent.min[axis] = lesser(extent.min[axis], bounds.min[axis]);
                extent.max[axis] = greater(extent.max[axis], bounds.max[axis]);
                for &vertex in clustering.vertices(cluster) {
                    let (run, place) = (vertex as usize / RUN, vertex as usize % RUN);
                    let coordinate = 3 * place + axis;
                    self.members[run][group][coordinate / RUN] |= 1 << (coordinate % RUN);
                }
            }
            if near == 0 {
                parents.put(node, &Bounds::EMPTY);
            } else {
                self.near.push(SomeClusters {
                    node: node as u32,
                    children: near,
                });
            }
        }
    }

    pub fn bytes(&self) -> usize {
        size_of::<Members>() * self.members.capacity()
            + size_of::<SomeClusters>() * self.near.capacity()
            + size_of::<Option<Side>>() * self.sides.capacity()
    }
}

/// Where a box is farthest beside another, if by more than `slack`.
fn side(cluster: &Bounds, others: &Bounds, slack: f32) -> Option<Side> {
    let mut side = None;
    let mut widest = slack;
    for axis in 0..3 {
        let below = others.min[axis] - cluster.max[axis];
        let above = cluster.min[axis] - others.max[axis];
        for (gap, is_above) in [(below, false), (above, true)] {
            if gap > widest {
                widest = gap;
                let axis = axis as u8;
                side = Some(Side { axis, is_above });
            }
        }
    }
    side
}

/// The clusters among a node's children.
#[derive(Clone)]
pub(crate) struct Children {
    first: usize,
    lanes: u8,
}

impl Children {
    /// Those of a node's children that `only` has bits of.
    #[inline(always)]
    pub fn new(children: Range<usize>, only: u8) -> Self {
        Children {
            first: children.start,
            lanes: only & (u8::MAX >> (8 - children.len())),
        }
    }
}

impl Iterator for Children {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let mut lanes = Lanes(self.lanes.into());
        let lane = lanes.next()?;
        self.lanes = lanes.0 as u8;
        Some(self.first + lane)
    }
}

/// When a body's clusters should be sorted, and how cautiously.
#[derive(Debug, Clone, Copy)]
struct Outlook {
    /// Frames to wait.
    wait: u32,
    /// What the next failure makes of it.
    next_wait: u32,
    /// How far beside the others a cluster must be, as a share of the body's longest side.
    slack: f32,
}

/// Frames after which all boxes are found again, to see what else is remote by now and how well clusters fit.
const RENEWED_AFTER: u32 = 64;
/// Groups that did not last for so many frames were not worth their making.
const WORTH: u32 = 8;
const SLACK: RangeInclusive<f32> = 1.0 / 128.0..=0.25;

impl Default for Outlook {
    fn default() -> Self {
        Outlook {
            // The second frame shows whether the body moves.
            wait: 1,
            next_wait: 1,
            slack: *SLACK.start(),
        }
    }
}

impl Outlook {
    /// Whether this frame should sort.
    fn is_due(&mut self) -> bool {
        let is_due = self.wait == 0;
        self.wait = self.wait.saturating_sub(1);
        is_due
    }

    /// The slack for a body of this size.
    fn slack(&self, whole: &Bounds) -> f32 {
        let sides = [0, 1, 2].map(|axis| whole.max[axis] - whole.min[axis]);
        self.slack * greater(sides[0], greater(sides[1], sides[2]))
    }

    /// Too little was beside the others.
    fn nothing_found(&mut self) {
        self.wait = RENEWED_AFTER / 4;
    }

    /// Groups have ended at this age.
    fn ended(&mut self, age: u32) {
        if age < WORTH {
            self.slack = (2.0 * self.slack).min(*SLACK.end());
            self.wait = self.next_wait;
            self.next_wait = (2 * self.next_wait).min(RENEWED_AFTER);
        } else {
            self.next_wait = 1;
            if age >= RENEWED_AFTER {
                self.slack = (0.5 * self.slack).max(*SLACK.start());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::simd::{Isa, dispatch};
    use super::*;
    use crate::settings::InstructionSet;

    /// Numbers without a pattern.
    fn hash(x: usize) -> u32 {
        let mut x = (x as u32).wrapping_add(1).wrapping_mul(0x9e37_79b9);
        x ^= x >> 15;
        x = x.wrapping_mul(0x85eb_ca6b);
        x ^ x >> 13
    }

    fn one_by_one(positions: &[[f32; 3]], members: &[Members]) -> Extents {
        let mut extents = Extents::EMPTY;
        for (vertex, point) in positions.iter().enumerate() {
            let only = Bounds {
                min: *point,
                max: *point,
            };
            extents.whole.join(&only);
            for axis in 0..3 {
                let coordinate = 3 * (vertex % RUN) + axis;
                for side in 0..2 {
                    let row = members[vertex / RUN][side][coordinate / RUN];
                    if row >> (coordinate % RUN) & 1 == 1 {
                        let group = &mut extents.groups[side];
                        group.min[axis] = group.min[axis].min(point[axis]);
                        group.max[axis] = group.max[axis].max(point[axis]);
                    }
                }
            }
            extents.all_finite &= point.iter().all(|x| x.is_finite());
        }
        extents
    }

    #[test]
    fn kernels_find_the_extents_of_single_vertices() {
        let sets = [
            InstructionSet::Portable,
            InstructionSet::Avx2,
            InstructionSet::Avx512,
        ];
        for n in (1..70).chain([16 * BLOCK, 16 * BLOCK + 5, 3000]) {
            let mut positions: Vec<[f32; 3]> = (0..n)
                .map(|vertex| {
                    [0, 1, 2].map(|axis| (hash(3 * vertex + axis) as i32 >> 8) as f32 / 4096.0)
                })
                .collect();
            let n_runs = n.div_ceil(RUN);
            let bits = |run: usize, ix: usize| {
                // A few members; none past the last vertex.
                let bits = hash(6 * run + ix + 77) & hash(6 * run + ix + 99) & 0xffff;
                let end = (3 * (n - RUN * run)).saturating_sub(RUN * (ix % 3));
                (bits as u16) & (((1u32 << end.min(RUN)) - 1) as u16)
            };
            let members: Vec<Members> = (0..n_runs)
                .map(|run| [0, 3].map(|side| [0, 1, 2].map(|row| bits(run, side + row))))
                .collect();
            for bad in [None, Some(f32::NAN), Some(f32::INFINITY)] {
                if let Some(bad) = bad {
                    positions[n - 1][n % 3] = bad;
                }
                let expected = one_by_one(&positions, &members);
                for isa in sets.map(Isa::detect) {
                    let found = dispatch!(isa, extents, (
                        positions: &[[f32; 3]] = &positions,
                        members: &[Members] = &members,
                    ) -> Extents);
                    assert_eq!(found.all_finite, bad.is_none(), "{n} {isa:?}");
                    if found.all_finite {
                        assert_eq!(found.whole, expected.whole, "{n} {isa:?}");
                        assert_eq!(found.groups, expected.groups, "{n} {isa:?}");
                    }
                }
            }
        }
    }
}
