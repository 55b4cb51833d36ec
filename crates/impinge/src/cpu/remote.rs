//! Clusters that no other body comes near, proven so without their boxes.
//!
//! A cluster's box takes a look at its vertices wherever they lie in memory; read in the order of memory, vertices
//! cost a fraction of that. Bodies that meet mostly do so with a part of them, and what lies beside the
//! other body mostly stays there for many frames. So clusters are *sorted*: those that lie beside all
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
//! back: its clusters are near in this frame, and are sorted again at its end, with more room between them and the others if
//! the group has come back soon.
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

    /// The groups that are not beside a box, that is, closed intervals that share a number.
    pub fn back_at(&self, other: &Bounds) -> Groups {
        let mut back = Groups::default();
        for (is_above, group) in [(false, &self.groups[0]), (true, &self.groups[1])] {
            for axis in 0..3 {
                if group.min[axis] <= other.max[axis] && other.min[axis] <= group.max[axis] {
                    back.insert(Side { axis, is_above });
                }
            }
        }
        back
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

/// Where a cluster lies beside others: the name of its group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Side {
    axis: usize,
    is_above: bool,
}

impl Side {
    fn number(self) -> usize {
        3 * usize::from(self.is_above) + self.axis
    }
}

/// Some of the groups.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Groups(u8);

impl Groups {
    const ALL: Groups = Groups(0b11_1111);

    fn insert(&mut self, side: Side) {
        self.0 |= 1 << side.number();
    }

    fn contains(self, side: Side) -> bool {
        self.0 >> side.number() & 1 == 1
    }

    pub fn union(self, other: Groups) -> Groups {
        Groups(self.0 | other.0)
    }

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    fn sides(self) -> impl Iterator<Item = Side> {
        [false, true]
            .into_iter()
            .flat_map(|is_above| (0..3).map(move |axis| Side { axis, is_above }))
            .filter(move |&side| self.contains(side))
    }
}

/// Some clusters of a node of level 1: bit `k` for its child `k`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SomeClusters {
    pub node: u32,
    pub children: u8,
}

/// The clusters of a body, sorted or not, and when to sort them. Memory is kept.
#[derive(Debug, Default)]
pub(crate) struct Remote {
    is_sorted: bool,
    /// The group of each cluster, none for those that are near. Those in a group have empty boxes.
    sides: Vec<Option<Side>>,
    /// What is near.
    near: Vec<SomeClusters>,
    /// The groups by vertices, run by run.
    members: Vec<Members>,
    n_vertices: usize,
    /// Groups whose clusters are to be sorted at the frame's end.
    unsorted: Groups,
    /// Clusters that have just been found to lie beside the others.
    fresh: Vec<u32>,
    outlook: Outlook,
}

impl Remote {
    /// Whether the clusters are sorted.
    pub fn is_sorted(&self) -> bool {
        self.is_sorted
    }

    /// Whether clusters are to be sorted at the frame's end, once boxes of all that is near have been found.
    pub fn is_due(&self) -> bool {
        !self.unsorted.is_empty() || (!self.is_sorted && self.outlook.wait == 0)
    }

    /// What is near.
    pub fn near(&self) -> &[SomeClusters] {
        &self.near
    }

    /// How many clusters are near.
    pub fn n_near(&self) -> usize {
        let near = self.near.iter().map(|near| near.children.count_ones());
        near.sum::<u32>() as usize
    }

    /// How many runs of vertices there are.
    pub fn n_runs(&self) -> usize {
        self.members.len()
    }

    /// Whether it can be read with so many positions, and need not be renewed.
    pub fn is_fit_for(&self, n_vertices: usize) -> bool {
        self.n_vertices == n_vertices && self.outlook.age < RENEWED_AFTER
    }

    /// A frame of a body that moved begins.
    pub fn grow_older(&mut self) {
        self.outlook.grow_older(self.is_sorted);
    }

    /// Ends it. All boxes must be found again if this says so.
    #[must_use]
    pub fn end(&mut self) -> bool {
        self.unsorted = Groups::default();
        std::mem::take(&mut self.is_sorted)
    }

    /// Some groups have come back: their clusters are near from now on. Or else, if too many have come back of late, this says so:
    /// then it should be ended.
    pub fn come_back(&mut self, groups: Groups, clustering: &Clustering) -> bool {
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
        extents(simd, &positions[vertices], &self.members[runs])
    }

    /// Sorts what is near, by its boxes, against the joint box of `others`: empties the boxes of clusters that lie beside it, and
    /// finds how far their groups reach. Whether there are enough of them: else it should be ended.
    #[must_use]
    pub fn sort(
        &mut self,
        clustering: &Clustering,
        n_vertices: usize,
        bounds: &mut TreeBounds,
        others: &Bounds,
        extents: &mut Extents,
    ) -> bool {
        let [leaves, parents, ..] = &mut bounds.levels[..] else {
            return false;
        };
        if !self.is_sorted {
            self.unsorted = Groups::ALL;
            self.outlook.begin();
            self.n_vertices = n_vertices;
            self.sides.clear();
            self.sides.resize(leaves.len(), None);
            self.members.clear();
            self.members
                .resize(n_vertices.div_ceil(RUN), Members::default());
        }
        let slack = self.outlook.slack(&extents.whole);
        self.fresh.clear();
        let mut n_beside = 0;
        for (cluster, known) in self.sides.iter_mut().enumerate() {
            if known.is_none() {
                *known = side(&leaves.at(cluster), others, &slack);
                if known.is_some() {
                    self.fresh.push(cluster as u32);
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
        self.empty(unsorted, extents);
        for &cluster in &self.fresh {
            let cluster = cluster as usize;
            let Some(side) = self.sides[cluster] else {
                continue;
            };
            let found = leaves.at(cluster);
            leaves.put(cluster, &Bounds::EMPTY);
            let (group, axis) = (usize::from(side.is_above), side.axis);
            let extent = &mut extents.groups[group];
            extent.min[axis] = lesser(extent.min[axis], found.min[axis]);
            extent.max[axis] = greater(extent.max[axis], found.max[axis]);
            for &vertex in clustering.vertices(cluster) {
                let (run, place) = (vertex as usize / RUN, vertex as usize % RUN);
                let coordinate = 3 * place + axis;
                self.members[run][group][coordinate / RUN] |= 1 << (coordinate % RUN);
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

    /// Empties some groups.
    fn empty(&mut self, groups: Groups, extents: &mut Extents) {
        let mut kept = [[!0u16; 3]; 2];
        for side in groups.sides() {
            let group = usize::from(side.is_above);
            for coordinate in (side.axis..COORDINATES).step_by(3) {
                kept[group][coordinate / RUN] &= !(1 << (coordinate % RUN));
            }
            extents.groups[group].min[side.axis] = f32::INFINITY;
            extents.groups[group].max[side.axis] = f32::NEG_INFINITY;
        }
        for members in &mut self.members {
            for (members, kept) in members
                .as_flattened_mut()
                .iter_mut()
                .zip(kept.as_flattened())
            {
                *members &= kept;
            }
        }
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
        size_of::<Members>() * self.members.capacity()
            + size_of::<SomeClusters>() * self.near.capacity()
            + size_of::<Option<Side>>() * self.sides.capacity()
    }
}

/// The side on which a box is farthest beside others, measured by the slack that is asked for there, if it is beside them by more
/// than that.
fn side(cluster: &Bounds, others: &Bounds, slack: &[f32; 6]) -> Option<Side> {
    let mut best = None;
    let mut farthest = 1.0;
    for axis in 0..3 {
        let below = others.min[axis] - cluster.max[axis];
        let above = cluster.min[axis] - others.max[axis];
        for (gap, is_above) in [(below, false), (above, true)] {
            let side = Side { axis, is_above };
            let far = gap / slack[side.number()];
            if gap > 0.0 && far > farthest {
                farthest = far;
                best = Some(side);
            }
        }
    }
    best
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
    /// The same, when the groups come back too often.
    next_wait: u32,
    /// Frames since all were sorted.
    age: u32,
    /// Frames since each group was.
    ages: [u32; 6],
    /// Frames that sorting has paid for.
    credit: u32,
    /// How far beside the others a cluster must be to be in a group, as a share of the body's longest side.
    slack: [f32; 6],
}

/// Frames after which all boxes are found again, to see what else is remote by now and how well clusters fit.
const RENEWED_AFTER: u32 = 64;
/// Frames that a group should last. To sort it again costs what it saves in some of them.
const LASTS: u32 = 24;
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
        self.ages = self.ages.map(|age| age + 1);
        self.credit = (self.credit + 1).min(MOST_CREDIT);
    }

    /// All are sorted.
    fn begin(&mut self) {
        if self.age >= RENEWED_AFTER {
            self.next_wait = 1;
            self.slack = self.slack.map(|slack| slack_for(slack, RENEWED_AFTER));
        }
        self.age = 0;
        self.ages = [0; 6];
        self.credit = COST;
    }

    /// Groups have come back: whether it pays to sort them again.
    fn affords(&mut self, groups: Groups) -> bool {
        for side in groups.sides() {
            let group = side.number();
            self.slack[group] = slack_for(self.slack[group], self.ages[group]);
            self.ages[group] = 0;
        }
        if self.credit >= COST {
            self.credit -= COST;
            return true;
        }
        self.wait = self.next_wait;
        self.next_wait = (2 * self.next_wait).min(RENEWED_AFTER);
        false
    }

    /// Hardly any cluster lies beside the others.
    fn too_few(&mut self) {
        self.wait = RENEWED_AFTER / 4;
    }
}

/// The slack with which a group would have lasted, by how long it lasted with this one.
fn slack_for(slack: f32, age: u32) -> f32 {
    (slack * LASTS as f32 / (age + 1) as f32).clamp(*SLACK.start(), *SLACK.end())
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
