//! The extent of a body's vertices, and of groups of them, read in memory order.
//!
//! In: positions and, for each coordinate, whether it belongs to a group. Out: the box of the whole
//! body, and an interval along one axis for each of six groups (see `culled`). Sixteen vertices
//! fill three 512-bit registers of interleaved x, y, z. Axes are separated once, after the last
//! run. Cost: 12 bytes of positions and 0.75 bytes of membership per vertex, read once.

use crate::bvh::bounds::{Aabb, greater, lesser};

use crate::simd::Simd;
use crate::simd::runs::{COORDINATES, Members, ROW, RUN, RunExtents};

/// Makes a vertex a member of a group.
#[inline(always)]
pub(super) fn insert(members: &mut [Members], vertex: u32, side: FreeSide) {
    let (run, at) = (vertex as usize / RUN, vertex as usize % RUN);
    let coordinate = 3 * at + side.axis();
    members[run][side.end()][coordinate / ROW] |= 1 << (coordinate % ROW);
}

/// Removes all members from some groups.
pub(super) fn clear(members: &mut [Members], groups: FreeSides) {
    let mut kept: Members = [[!0; 3]; 2];
    for side in groups.sides() {
        for coordinate in (side.axis()..COORDINATES).step_by(3) {
            let row = &mut kept[side.end()][coordinate / ROW];
            *row &= !(1 << (coordinate % ROW));
        }
    }
    for members in members {
        for (members, kept) in members
            .as_flattened_mut()
            .iter_mut()
            .zip(kept.as_flattened())
        {
            *members &= kept;
        }
    }
}

/// The extents of some vertices, and of those of each group.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extents {
    /// The box of all of these vertices.
    pub whole: Aabb,
    pub(super) groups: Intervals,
    /// Whether all positions are certainly finite. If not, the other fields mean nothing.
    pub all_finite: bool,
}

impl Extents {
    /// The extents of no vertices.
    pub const EMPTY: Extents = Extents {
        whole: Aabb::EMPTY,
        groups: Intervals::EMPTY,
        all_finite: true,
    };

    /// The extents of vertices that were read for their boxes, and none for their groups.
    pub fn without_groups(whole: Aabb, all_finite: bool) -> Extents {
        Extents {
            whole,
            all_finite,
            ..Extents::EMPTY
        }
    }
}

/// The intervals that the groups span: those below along x, y and z, then those above. Each axis
/// stands for itself, so these are not boxes. Sides without members have empty intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Intervals([Aabb; 2]);

impl Default for Intervals {
    fn default() -> Self {
        Intervals::EMPTY
    }
}

impl Intervals {
    pub const EMPTY: Intervals = Intervals([Aabb::EMPTY; 2]);

    /// Adds the intervals of other vertices.
    pub fn join(&mut self, other: &Intervals) {
        for (groups, other) in self.0.iter_mut().zip(&other.0) {
            groups.join(other);
        }
    }

    /// Extends a group's interval to that of a box.
    pub fn extend(&mut self, side: FreeSide, bounds: &Aabb) {
        let (groups, axis) = (&mut self.0[side.end()], side.axis());
        groups.min[axis] = lesser(groups.min[axis], bounds.min[axis]);
        groups.max[axis] = greater(groups.max[axis], bounds.max[axis]);
    }

    /// Empties the intervals of some groups.
    pub fn clear(&mut self, which: FreeSides) {
        for side in which.sides() {
            let (groups, axis) = (&mut self.0[side.end()], side.axis());
            groups.min[axis] = f32::INFINITY;
            groups.max[axis] = f32::NEG_INFINITY;
        }
    }

    /// The groups that are not beside a box: the closed intervals share a number.
    pub fn back_at(&self, other: &Aabb) -> FreeSides {
        let mut back = FreeSides::default();
        for side in FreeSides::ALL.sides() {
            let (groups, axis) = (&self.0[side.end()], side.axis());
            if groups.min[axis] <= other.max[axis] && other.min[axis] <= groups.max[axis] {
                back.insert(side);
            }
        }
        back
    }
}

/// The extents of consecutive runs, the last of which may be shorter. Positions and members begin
/// at the same vertex.
#[inline(always)]
pub(super) fn of<S: Simd>(simd: S, positions: &[[f32; 3]], members: &[Members]) -> Extents {
    let mut found = RunExtents::EMPTY;
    let (runs, rest) = positions.as_chunks::<RUN>();
    let (members, last_members) = members.split_at(runs.len());
    simd.add_runs(runs, members, &mut found);
    if let [first, ..] = rest {
        // Filled up with its first vertex; these entries have no members.
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
        for (end, groups) in groups.0.iter_mut().enumerate() {
            groups.min[axis] = lesser(groups.min[axis], found.group_min[end][k]);
            groups.max[axis] = greater(groups.max[axis], found.group_max[end][k]);
        }
        // Finite only if all terms are. If it overflows on finite terms, the positions are checked
        // one by one.
        sum += found.sum[k];
    }
    extents.all_finite = sum.is_finite();
    extents
}

/// The side on which a cluster lies beside others, which is its group: below (0 to 2) or above (3
/// to 5) along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FreeSide(u8);

impl FreeSide {
    #[inline(always)]
    pub fn new(axis: usize, is_above: bool) -> FreeSide {
        FreeSide(axis as u8 + 3 * u8::from(is_above))
    }

    #[inline(always)]
    fn axis(self) -> usize {
        usize::from(self.0 % 3)
    }

    /// 0 for below, 1 for above.
    #[inline(always)]
    fn end(self) -> usize {
        usize::from(self.0 / 3)
    }

    pub fn number(self) -> usize {
        self.0.into()
    }
}

/// Some of the groups.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct FreeSides(u8);

impl FreeSides {
    pub const ALL: FreeSides = FreeSides(0b11_1111);

    fn insert(&mut self, side: FreeSide) {
        self.0 |= 1 << side.number();
    }

    pub fn contains(self, side: FreeSide) -> bool {
        self.0 >> side.number() & 1 == 1
    }

    pub fn union(self, other: FreeSides) -> FreeSides {
        FreeSides(self.0 | other.0)
    }

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub fn sides(self) -> impl Iterator<Item = FreeSide> {
        (0..6)
            .map(FreeSide)
            .filter(move |&side| self.contains(side))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::settings::InstructionSet;
    use crate::simd::{Isa, with_isa};

    /// Pseudo-random numbers.
    fn hash(x: usize) -> u32 {
        let mut x = (x as u32).wrapping_add(1).wrapping_mul(0x9e37_79b9);
        x ^= x >> 15;
        x = x.wrapping_mul(0x85eb_ca6b);
        x ^ x >> 13
    }

    fn one_by_one(positions: &[[f32; 3]], members: &[Members]) -> Extents {
        let mut extents = Extents::EMPTY;
        for (vertex, point) in positions.iter().enumerate() {
            let only = Aabb {
                min: *point,
                max: *point,
            };
            extents.whole.join(&only);
            for (axis, x) in point.iter().enumerate() {
                let coordinate = 3 * (vertex % RUN) + axis;
                for (group, rows) in extents.groups.0.iter_mut().zip(&members[vertex / RUN]) {
                    if rows[coordinate / ROW] >> (coordinate % ROW) & 1 == 1 {
                        group.min[axis] = group.min[axis].min(*x);
                        group.max[axis] = group.max[axis].max(*x);
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
        for n in (1..70).chain([512, 517, 3000]) {
            let mut positions: Vec<[f32; 3]> = (0..n)
                .map(|vertex| {
                    [0, 1, 2].map(|axis| (hash(3 * vertex + axis) as i32 >> 8) as f32 / 4096.0)
                })
                .collect();
            let n_runs = n.div_ceil(RUN);
            let bits = |run: usize, ix: usize| {
                // A few members, and none past the last vertex.
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
                    let found = with_isa!(isa, of, (
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
