//! The second level: which elements of two groups of one cell touch a common sub-cell.
//!
//! A box touches a product of ranges of the 4 x 4 x 4 sub-cells. Two products share a sub-cell if
//! and only if their ranges overlap along x, along y and along z. So the 64 x 64 occupancy bits of
//! the paper, with their transposition, reduce to 8 masks of lanes per axis:
//!
//! ```text
//! begins[s]    lanes j whose range begins at sub-cell s or before      s = 0 … 3
//! ends[s]      lanes j whose range ends at sub-cell s or after
//! partners     of i: for all axes, begins[last of i] and ends[first of i]
//! ```
//!
//! The owner rule is a mask, too: of all cells that two boxes share, the pair belongs to the one in
//! which one of the two boxes begins along each axis.

use crate::bvh::GROUP;

use super::cull_map::InRegion;
use super::pairing::full;
use super::world::BodyRef;
use crate::simd::{Isa, LaneBounds, Lanes32, Simd, with_isa};

/// Which pairs of elements that share a sub-cell are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SubcellQuery {
    /// Only pairs whose boxes overlap.
    pub boxes: bool,
    /// Only pairs that the cell owns.
    pub owned: bool,
    /// Also pairs of one body that share a vertex.
    pub adjacent: bool,
}

/// Two groups of one cell: indices in `kept`.
#[derive(Clone, Copy)]
pub(crate) struct GroupPair<'a> {
    pub kept: &'a [InRegion],
    pub a: &'a [u32],
    pub b: &'a [u32],
    pub cell: [u32; 3],
    /// Whether both are the same group: each pair is then found once.
    pub same: bool,
    /// The body, if both groups are of the same body.
    pub body: Option<BodyRef<'a>>,
}

/// One group, and the partners found in it.
pub(crate) struct Lanes64 {
    boxes: LaneBounds,
    corners: [Lanes32; 4],
    /// For each element of the other group, the lanes that it meets.
    pub partners: [u64; GROUP],
    /// For each element of the other group, those of its partners that share a vertex with it.
    pub adjacent: [u64; GROUP],
}

impl Default for Lanes64 {
    fn default() -> Self {
        Lanes64 {
            boxes: LaneBounds::EMPTY,
            corners: [const { Lanes32([0; GROUP]) }; 4],
            partners: [0; GROUP],
            adjacent: [0; GROUP],
        }
    }
}

impl Lanes64 {
    /// Finds the partners in b of each element of a.
    pub fn find(&mut self, isa: Isa, groups: GroupPair<'_>, query: SubcellQuery) {
        with_isa!(isa, find, (
            lanes: &mut Lanes64 = self,
            groups: GroupPair<'_> = groups,
            query: SubcellQuery = query,
        ));
    }
}

/// The first and the last sub-cell along an axis, from 1 to 4. The first is 0 if the range begins
/// in an earlier cell.
#[inline(always)]
fn along(kept: &InRegion, cell: [u32; 3], axis: usize) -> (usize, usize) {
    let before = 4 * cell[axis];
    let first = (u32::from(kept.range.lo[axis]) + 1).saturating_sub(before);
    let last = (u32::from(kept.range.hi[axis]) + 1 - before).min(4);
    (first.min(4) as usize, last as usize & 7)
}

#[inline(always)]
fn find<S: Simd>(simd: S, lanes: &mut Lanes64, groups: GroupPair<'_>, query: SubcellQuery) {
    let GroupPair {
        kept,
        a,
        b,
        cell,
        same,
        body,
    } = groups;
    let mut begins = [[0u64; 8]; 3];
    let mut ends = [[0u64; 8]; 3];
    for (lane, &entry) in b.iter().enumerate() {
        let kept = &kept[entry as usize];
        lanes.boxes.put(lane, &kept.bounds);
        for axis in 0..3 {
            let (first, last) = along(kept, cell, axis);
            begins[axis][first] |= 1 << lane;
            ends[axis][last] |= 1 << lane;
        }
    }
    if let Some(body) = &body {
        for (lane, &entry) in b.iter().enumerate() {
            let corners = body.corners(kept[entry as usize].slot());
            for (row, &corner) in lanes.corners.iter_mut().zip(corners) {
                row.0[lane] = corner;
            }
        }
    }
    let all = full(b.len());
    let mut owned = [0u64; 3];
    for axis in 0..3 {
        owned[axis] = all & !begins[axis][0];
        for s in 1..5 {
            begins[axis][s] |= begins[axis][s - 1];
            ends[axis][4 - s] |= ends[axis][5 - s];
        }
    }
    for (lane, &entry) in a.iter().enumerate() {
        let kept = &kept[entry as usize];
        let mut partners = if same {
            all & (u64::MAX << lane << 1)
        } else {
            all
        };
        for axis in 0..3 {
            let (first, last) = along(kept, cell, axis);
            partners &= begins[axis][last] & ends[axis][first];
            if query.owned && first == 0 {
                partners &= owned[axis];
            }
        }
        if query.boxes && partners != 0 {
            partners = simd.overlaps_64(&lanes.boxes, &kept.bounds, partners);
        }
        lanes.partners[lane] = partners;
        let mut adjacent = 0;
        if let Some(body) = &body
            && partners != 0
        {
            let corners = body.corners(kept.slot());
            for row in &lanes.corners[..corners.len()] {
                for &corner in corners {
                    adjacent |= simd.equals_64(row, corner, partners);
                }
            }
        }
        lanes.adjacent[lane] = adjacent;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::bounds::Aabb;
    use crate::bvh::grid::{Grid, owns};
    use crate::query::settings::InstructionSet;
    use crate::scene::index::{ElementIx, PartIx};
    use impinge_testing::random::Random;

    #[test]
    fn partners_are_those_of_the_occupancy_bits() {
        let region = Aabb {
            min: [0.0; 3],
            max: [3.0; 3],
        };
        let grid = Grid::new(&region, 27, 1.0);
        assert_eq!(grid.resolution, [3; 3]);
        let mut random = Random::new(5);
        let kept: Vec<InRegion> = ElementIx::up_to(400)
            .map(|element| {
                let min: [f32; 3] = std::array::from_fn(|_| random.below(30) as f32 / 10.0);
                let bounds = Aabb {
                    min,
                    max: min.map(|x| x + random.below(14) as f32 / 10.0),
                };
                InRegion {
                    bounds,
                    range: grid.range(&bounds),
                    part: PartIx::new(0),
                    element,
                }
            })
            .collect();
        let cell = [1, 1, 1];
        let here: Vec<u32> = (0..400)
            .filter(|&ix| {
                let (lo, hi) = kept[ix as usize].range.coarse();
                (0..3).all(|axis| lo[axis] <= 1 && 1 <= hi[axis])
            })
            .collect();
        let here = &here[..60];
        let mut seen = 0;
        for (a, b, same) in [
            (&here[..15], &here[15..], false),
            (&here[..30], &here[..30], true),
        ] {
            let groups = GroupPair {
                kept: &kept,
                a,
                b,
                cell,
                same,
                body: None,
            };
            for (boxes, owned) in [(false, false), (true, false), (false, true), (true, true)] {
                let query = SubcellQuery {
                    boxes,
                    owned,
                    adjacent: false,
                };
                for isa in [Isa::Portable, Isa::detect(InstructionSet::Avx512)] {
                    let mut lanes = Lanes64::default();
                    lanes.find(isa, groups, query);
                    for (i, &entry_a) in a.iter().enumerate() {
                        for (j, &entry_b) in b.iter().enumerate() {
                            let (a, b) = (&kept[entry_a as usize], &kept[entry_b as usize]);
                            let expected = a.range.occupancy(cell) & b.range.occupancy(cell) != 0
                                && (!boxes || a.bounds.overlaps(&b.bounds))
                                && (!owned || owns(cell, &a.range, &b.range))
                                && (!same || j > i);
                            assert_eq!(lanes.partners[i] >> j & 1 == 1, expected);
                            seen += u32::from(expected);
                        }
                    }
                }
            }
        }
        assert!(seen > 100);
    }
}
