//! Edges and faces: those that certainly meet, and those that certainly do not.
//!
//! In: the tables of two groups, and the slots of sixteen pairs in them. Out: masks. Cost: about
//! 130 operations for all lanes, 60 where every edge is on one side of its face.
//!
//! Method: an edge with both ends strictly on one side of a face's plane misses it. Else the line
//! pq of the edge passes each edge of the face on one side or the other. If two of them are passed
//! on different sides, the line has no point of the closed face: seen along the line, a point of a
//! triangle is to the left of all its edges or to the right of all, but for those that it is on. If
//! all three are passed on the same side and the ends are on different sides of the plane, they
//! meet.
//!
//! Invariant: that of [`Determinant`](super::determinant::Determinant). Ties, degenerate elements
//! and NaN end as unsure.

use super::determinant::{Normal, difference};
use super::moving::look_up;
use super::number::Lookup;
use super::{BATCH, TABLE, Verdict16};

/// Edges or faces of a group: `[corner][axis][slot]`.
type Table = [[[f32; TABLE]; 3]; 3];

/// Which of sixteen edges and faces certainly share a point. The elements are those of two groups,
/// named by their slots. Coordinate magnitudes must not exceed [`LARGEST_F32`](super::LARGEST_F32).
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn meet_in_tables<V: Lookup>(
    [edges, faces]: [&Table; 2],
    [slots_a, slots_b]: [&[u8; BATCH]; 2],
) -> Verdict16 {
    let mut verdict = Verdict16::default();
    for first in (0..BATCH).step_by(V::N) {
        let (edge, face) = (V::slots(slots_a, first), V::slots(slots_b, first));
        let (p, q) = (look_up::<V>(&edges[0], edge), look_up::<V>(&edges[1], edge));
        let (a, b, c) = (
            look_up(&faces[0], face),
            look_up(&faces[1], face),
            look_up(&faces[2], face),
        );
        let normal = Normal::<V>::new(&difference(&b, &a), &difference(&c, &a));
        let of_p = normal.dot(&difference(&p, &a));
        let of_q = normal.dot(&difference(&q, &a));
        let beside = V::bits(of_p.is_same(of_q));
        let (mut yes, mut no) = (0, beside);
        if beside != u16::MAX >> (BATCH - V::N) {
            let along = difference(&q, &p);
            let (a, b, c) = (difference(&a, &p), difference(&b, &p), difference(&c, &p));
            let ab = Normal::new(&along, &a).dot(&b);
            let bc = Normal::new(&along, &b).dot(&c);
            let ca = Normal::new(&along, &c).dot(&a);
            no |= V::bits(ab.is_opposite(bc) | bc.is_opposite(ca) | ca.is_opposite(ab));
            yes = V::bits(of_p.is_opposite(of_q) & ab.is_same(bc) & bc.is_same(ca));
        }
        verdict.yes |= yes << first;
        verdict.no |= no << first;
    }
    verdict
}
