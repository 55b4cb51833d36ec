//! Triangle against triangle.

use super::determinant::{Determinant, Normal, bit, difference, select};
use super::{LANES, Point, TrianglePairs8, Verdict};

/// The lanes whose triangles are certainly apart because the plane of one has the other strictly
/// on one side. The cheap first step; the rest is for [`classify`].
#[inline(always)]
#[must_use]
pub fn reject_by_planes(pairs: &TrianglePairs8) -> u8 {
    let mut no = 0;
    for lane in 0..LANES {
        let (a, b) = pairs.get(lane);
        no |= bit(Sides::new(&a, &b).are_apart(), lane);
    }
    no as u8
}

/// Which lanes certainly intersect and which certainly do not.
#[inline(always)]
#[must_use]
pub fn classify(pairs: &TrianglePairs8) -> Verdict {
    let (mut yes, mut no) = (0, 0);
    for lane in 0..LANES {
        let (a, b) = pairs.get(lane);
        let sides = Sides::new(&a, &b);
        let (apart, sure) = (sides.are_apart(), sides.are_sure());
        let (meet, miss) = cross_on_line(&a, &b, &sides);
        yes |= bit(sure & !apart & meet, lane);
        no |= bit(apart | (sure & miss), lane);
    }
    Verdict {
        yes: yes as u8,
        no: no as u8,
    }
}

/// [`classify`] for one pair, with an early end; none when unsure.
#[inline]
pub(in super::super) fn triangles_answer(a: &[Point; 3], b: &[Point; 3]) -> Option<bool> {
    let sides = Sides::new(a, b);
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
struct Sides {
    a: [Determinant; 3],
    b: [Determinant; 3],
}

impl Sides {
    #[inline(always)]
    fn new(a: &[Point; 3], b: &[Point; 3]) -> Self {
        Self {
            a: above(b, a),
            b: above(a, b),
        }
    }

    /// Whether one triangle is certainly on one side of the other's plane.
    #[inline(always)]
    fn are_apart(&self) -> bool {
        all_on_one_side(&self.a) | all_on_one_side(&self.b)
    }

    /// Whether no vertex may be in the plane of the other triangle.
    #[inline(always)]
    fn are_sure(&self) -> bool {
        all_sure(&self.a) & all_sure(&self.b)
    }
}

/// How far each vertex of `other` is above the plane of `triangle`.
#[inline(always)]
fn above(triangle: &[Point; 3], other: &[Point; 3]) -> [Determinant; 3] {
    let origin = &triangle[0];
    let normal = Normal::new(
        &difference(&triangle[1], origin),
        &difference(&triangle[2], origin),
    );
    other.map(|vertex| normal.dot(&difference(&vertex, origin)))
}

#[inline(always)]
fn all_on_one_side(&[x, y, z]: &[Determinant; 3]) -> bool {
    (x.is_positive() & y.is_positive() & z.is_positive())
        | (x.is_negative() & y.is_negative() & z.is_negative())
}

#[inline(always)]
fn all_sure(&[x, y, z]: &[Determinant; 3]) -> bool {
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
fn cross_on_line(a: &[Point; 3], b: &[Point; 3], sides: &Sides) -> (bool, bool) {
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
fn alone(sides: &[Determinant; 3]) -> ([bool; 2], bool) {
    let [x, y, z] = sides.map(Determinant::seems_positive);
    let is_1 = (x == z) & (y != z);
    let is_2 = (x == y) & (y != z);
    ([is_1, is_2], (is_1 & y) | (is_2 & z) | (!is_1 & !is_2 & x))
}

/// The triangle with its vertices turned so that the lone one comes first, the other two
/// exchanged if `exchange`.
#[inline(always)]
fn turned(triangle: &[Point; 3], [is_1, is_2]: [bool; 2], exchange: bool) -> [Point; 3] {
    let turn = |at_0: usize, at_1: usize, at_2: usize| -> Point {
        std::array::from_fn(|axis| {
            select(
                is_1,
                triangle[at_1][axis],
                select(is_2, triangle[at_2][axis], triangle[at_0][axis]),
            )
        })
    };
    let (next, last) = (turn(1, 2, 0), turn(2, 0, 1));
    let pick = |yes: &Point, no: &Point| -> Point {
        std::array::from_fn(|axis| select(exchange, yes[axis], no[axis]))
    };
    [turn(0, 1, 2), pick(&last, &next), pick(&next, &last)]
}
