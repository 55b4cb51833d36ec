//! Triangle against triangle.

use super::determinant::{Determinant, Normal, difference};
use super::number::{Lookup, Number, Vector, load_vertex};
use super::projections::{self, are_parted};
use super::{
    BATCH, LANES, Point, TABLE, TrianglePairs8, Triangles8, Triangles64, Verdict, Verdict16,
};

/// The lanes whose triangles are certainly apart because the plane of one has the other strictly
/// on one side. The cheap first step; the other lanes go to [`classify`].
#[inline(always)]
#[must_use]
pub fn reject_by_planes<V: Vector>(pairs: &TrianglePairs8) -> u8 {
    let mut no = 0;
    for first in (0..LANES).step_by(V::N) {
        let (a, b) = (load::<V>(&pairs.a, first), load::<V>(&pairs.b, first));
        no |= V::bits(VertexSides::new(&a, &b).are_apart()) << first;
    }
    no
}

/// Which lanes certainly intersect and which certainly do not.
#[inline(always)]
#[must_use]
pub fn classify<V: Vector>(pairs: &TrianglePairs8) -> Verdict {
    let mut verdict = Verdict::default();
    for first in (0..LANES).step_by(V::N) {
        let (a, b) = (load::<V>(&pairs.a, first), load::<V>(&pairs.b, first));
        let sides = VertexSides::new(&a, &b);
        let (apart, sure) = (sides.are_apart(), sides.are_sure());
        let (meet, miss) = cross_on_line(&a, &b, &sides);
        let (yes, mut no) = (
            V::bits(sure & !apart & meet),
            V::bits(apart | (sure & miss)),
        );
        let all = u8::MAX >> (LANES - V::N);
        let bound = projections::bound(&a, &b);
        for plane in 0..3 {
            if (yes | no) & all == all {
                break;
            }
            no |= !yes & V::bits(are_parted(&a, &b, plane, bound));
        }
        verdict.yes |= yes << first;
        verdict.no |= no << first;
    }
    verdict
}

/// [`classify`] in `f32`, for triangles of two groups that are named by their slots in the groups'
/// tables. Only the lanes of `among` are needed. Coordinate magnitudes must not exceed
/// [`LARGEST_F32`](super::LARGEST_F32).
#[inline(always)]
#[must_use]
pub fn classify_in_tables<V: Lookup>(
    [a, b]: [&Triangles64; 2],
    [slots_a, slots_b]: [&[u8; BATCH]; 2],
    among: u16,
) -> Verdict16 {
    let mut verdict = Verdict16::default();
    for first in (0..BATCH).step_by(V::N) {
        let a = look_up::<V>(a, V::slots(slots_a, first));
        let b = look_up::<V>(b, V::slots(slots_b, first));
        let sides = VertexSides::new(&a, &b);
        let (apart, sure) = (sides.are_apart(), sides.are_sure());
        let among = among >> first & u16::MAX >> (BATCH - V::N);
        let (mut yes, mut no) = (0, V::bits(apart));
        let left = V::bits(sure & !apart);
        if left & among != 0 {
            let (meet, miss) = cross_on_line(&a, &b, &sides);
            yes = left & V::bits(meet);
            no |= left & V::bits(miss);
        }
        if among & !(yes | no) != 0 {
            let bound = projections::bound(&a, &b);
            for plane in 0..3 {
                no |= !yes & V::bits(are_parted(&a, &b, plane, bound));
                if among & !(yes | no) == 0 {
                    break;
                }
            }
        }
        verdict.yes |= yes << first;
        verdict.no |= no << first;
    }
    verdict
}

// Here and below no closures are passed to library functions: those would be compiled on their
// own, without the instruction set, and every operation would become a call.

#[inline(always)]
fn load<V: Vector>([p, q, r]: &Triangles8, first: usize) -> [[V; 3]; 3] {
    [
        load_vertex(p, first),
        load_vertex(q, first),
        load_vertex(r, first),
    ]
}

#[inline(always)]
fn look_up<V: Lookup>([p, q, r]: &Triangles64, slots: V::Slots) -> [[V; 3]; 3] {
    [
        look_up_vertex(p, slots),
        look_up_vertex(q, slots),
        look_up_vertex(r, slots),
    ]
}

#[inline(always)]
fn look_up_vertex<V: Lookup>([x, y, z]: &[[f32; TABLE]; 3], slots: V::Slots) -> [V; 3] {
    [
        V::look_up(x, slots),
        V::look_up(y, slots),
        V::look_up(z, slots),
    ]
}

/// [`classify`] for one pair, with an early exit; `None` when unsure.
#[inline]
pub(crate) fn triangles_answer(a: &[Point; 3], b: &[Point; 3]) -> Option<bool> {
    let sides = VertexSides::new(a, b);
    if sides.are_apart() {
        return Some(false);
    }
    if !sides.are_sure() {
        return None;
    }
    match cross_on_line(a, b, &sides) {
        (true, _) => Some(true),
        (_, true) => Some(false),
        _ => None,
    }
}

/// How far (times a constant of the plane) each vertex of each triangle is above the plane of the
/// other.
struct VertexSides<T: Number> {
    a: [Determinant<T>; 3],
    b: [Determinant<T>; 3],
}

impl<T: Number> VertexSides<T> {
    #[inline(always)]
    fn new(a: &[[T; 3]; 3], b: &[[T; 3]; 3]) -> Self {
        Self {
            a: above(b, a),
            b: above(a, b),
        }
    }

    /// Whether one triangle is certainly on one side of the other's plane.
    #[inline(always)]
    fn are_apart(&self) -> T::Mask {
        all_on_one_side(&self.a) | all_on_one_side(&self.b)
    }

    /// Whether certainly no vertex lies in the plane of the other triangle.
    #[inline(always)]
    fn are_sure(&self) -> T::Mask {
        all_sure(&self.a) & all_sure(&self.b)
    }
}

/// How far each vertex of `other` is above the plane of `triangle`.
#[inline(always)]
fn above<T: Number>(triangle: &[[T; 3]; 3], other: &[[T; 3]; 3]) -> [Determinant<T>; 3] {
    let origin = &triangle[0];
    let normal = Normal::new(
        &difference(&triangle[1], origin),
        &difference(&triangle[2], origin),
    );
    let [p, q, r] = other;
    [
        normal.dot(&difference(p, origin)),
        normal.dot(&difference(q, origin)),
        normal.dot(&difference(r, origin)),
    ]
}

#[inline(always)]
fn all_on_one_side<T: Number>(&[x, y, z]: &[Determinant<T>; 3]) -> T::Mask {
    (x.is_positive() & y.is_positive() & z.is_positive())
        | (x.is_negative() & y.is_negative() & z.is_negative())
}

#[inline(always)]
fn all_sure<T: Number>(&[x, y, z]: &[Determinant<T>; 3]) -> T::Mask {
    x.is_sure() & y.is_sure() & z.is_sure()
}

/// For two triangles that certainly cross each other's plane: whether they certainly meet, and
/// whether they certainly miss. Without a branch.
///
/// Both cross the line L where the planes meet. Turn each triangle so that vertex 0 is the one
/// that is alone on its side, and exchange vertices 1 and 2 of the *other* triangle where vertex
/// 0 lies below its plane, so that it lies above. Then along L, in the direction of (normal of
/// a) x (normal of b), a covers the interval from edge 02 to edge 01, and b from 01 to 02:
///
/// ```text
///       a0            edge 02 and edge 01 of a cross L at 2 and 1,
///      /  \           those of b at 2' and 1'
///     /    \
/// ---2======1------------------> L      the intervals meet if and only if
/// -----------1'=========2'-----> L      2 is not beyond 2' and 1' is not beyond 1
/// ```
///
/// Which of two crossings comes first is the sign of one determinant of the two edges.
#[inline(always)]
fn cross_on_line<T: Number>(
    a: &[[T; 3]; 3],
    b: &[[T; 3]; 3],
    sides: &VertexSides<T>,
) -> (T::Mask, T::Mask) {
    let (a_alone, a_above) = alone(&sides.a);
    let (b_alone, b_above) = alone(&sides.b);
    let [a0, a1, a2] = turned(a, a_alone, !b_above);
    let [b0, b1, b2] = turned(b, b_alone, !a_above);
    let between = difference(&b0, &a0);
    let low = Determinant::new(&difference(&a2, &a0), &difference(&b2, &b0), &between);
    let high = Determinant::new(&difference(&a1, &a0), &difference(&b1, &b0), &between);
    (
        low.is_negative() & high.is_positive(),
        low.is_positive() | high.is_negative(),
    )
}

/// Which vertex is alone on its side (vertex 1, vertex 2; else vertex 0), and whether it is the
/// upper side.
#[inline(always)]
fn alone<T: Number>(sides: &[Determinant<T>; 3]) -> ([T::Mask; 2], T::Mask) {
    let [x, y, z] = [
        sides[0].seems_positive(),
        sides[1].seems_positive(),
        sides[2].seems_positive(),
    ];
    let is_1 = !(x ^ z) & (y ^ z);
    let is_2 = !(x ^ y) & (y ^ z);
    ([is_1, is_2], (is_1 & y) | (is_2 & z) | (!is_1 & !is_2 & x))
}

/// The triangle with its vertices turned so that the lone one comes first, the other two
/// exchanged if `exchange`.
#[inline(always)]
fn turned<T: Number>(
    triangle: &[[T; 3]; 3],
    [is_1, is_2]: [T::Mask; 2],
    exchange: T::Mask,
) -> [[T; 3]; 3] {
    let [p, q, r] = triangle;
    let first = pick(is_1, q, &pick(is_2, r, p));
    let next = pick(is_1, r, &pick(is_2, p, q));
    let last = pick(is_1, p, &pick(is_2, q, r));
    [
        first,
        pick(exchange, &last, &next),
        pick(exchange, &next, &last),
    ]
}

#[inline(always)]
fn pick<T: Number>(mask: T::Mask, yes: &[T; 3], no: &[T; 3]) -> [T; 3] {
    [
        T::select(mask, yes[0], no[0]),
        T::select(mask, yes[1], no[1]),
        T::select(mask, yes[2], no[2]),
    ]
}
