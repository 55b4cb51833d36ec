//! The moving difference polygon, and when the origin first lies in it.

use alloc::vec::Vec;

use crate::algebra::{
    Integer, Polynomial, PolynomialVector, Root, Roots, Time, common_integers, cross, difference,
    dot, floor_between,
};
use crate::{Point, Sign};

/// A convex polygon of one to four corners, which move linearly.
pub(crate) struct SweptPolygon {
    corners: Vec<PolynomialVector>,
}

impl SweptPolygon {
    /// The polygon whose corners are differences of points, each given by two numbers of points.
    pub(super) fn new(corners: &[[usize; 2]], start: &[Point; 4], end: &[Point; 4]) -> Self {
        Self::with_distance(corners, start, end, 0.0).0
    }

    /// [`SweptPolygon::new`], and a distance as an integer times the same power of two.
    pub(crate) fn with_distance(
        corners: &[[usize; 2]],
        start: &[Point; 4],
        end: &[Point; 4],
        distance: f64,
    ) -> (Self, Integer) {
        let numbers: [f64; 25] = core::array::from_fn(|ix| {
            let x = match ix {
                0..12 => start[ix / 3][ix % 3],
                12..24 => end[ix % 12 / 3][ix % 3],
                _ => distance,
            };
            // Points that do not belong to the pair may hold anything.
            if x.is_finite() { x } else { 0.0 }
        });
        let (integers, _) = common_integers(numbers);
        let corners = corners
            .iter()
            .map(|&[i, j]| {
                core::array::from_fn(|axis| {
                    let between =
                        |at: usize| &integers[at + 3 * i + axis] - &integers[at + 3 * j + axis];
                    Polynomial::linear(between(0), between(12))
                })
            })
            .collect();
        let [.., distance] = integers;
        (Self { corners }, distance)
    }

    /// The only root of f between two times that are not roots, rounded down. For triangles and
    /// parallelograms.
    pub(super) fn time_between(&self, low: f64, high: f64) -> Time {
        floor_between(&plane_and_height(&self.corners).1, low, high)
    }

    pub(crate) fn corners(&self) -> &[PolynomialVector] {
        &self.corners
    }

    /// The first time in (0, 1] at which the origin is in the polygon, provided that it is not in
    /// it at the start.
    pub(super) fn first_time(&self) -> Option<Time> {
        match &self.corners[..] {
            [corner] => first_at_corner(corner),
            [a, b] => SweptEdge::new(a, b).first_time(),
            corners => first_in_face(corners),
        }
    }
}

/// [`SweptPolygon::first_time`] of a triangle or a parallelogram.
///
/// Let f = N . V_0 and w_i = N . (V_i x V_(i+1)). The origin is inside at t if and only if f(t) = 0
/// and all w_i(t) > 0, or it is on an edge. If all w_i(t) are at least 0 and one is greater, f(t) =
/// 0 is sufficient.
fn first_in_face(corners: &[PolynomialVector]) -> Option<Time> {
    let (normal, f) = plane_and_height(corners);
    if f.is_zero() {
        // The first contact is on an edge.
        return edges(corners)
            .filter_map(|edge| edge.first_time())
            .reduce(Time::earlier);
    }
    if f.has_no_root() {
        return None;
    }
    let edges: Vec<SweptEdge> = edges(corners).collect();
    let sides: Vec<Polynomial> = edges.iter().map(|edge| dot(&normal, &edge.cross)).collect();
    Roots::of(f).find_map(|mut root| is_inside(&mut root, &sides, &edges).then(|| root.floor()))
}

/// N and f.
fn plane_and_height(corners: &[PolynomialVector]) -> (PolynomialVector, Polynomial) {
    let normal = cross(
        &difference(&corners[1], &corners[0]),
        &difference(&corners[2], &corners[1]),
    );
    let f = dot(&normal, &corners[0]);
    (normal, f)
}

/// Whether the origin is in the polygon at a root of f.
fn is_inside(root: &mut Root, sides: &[Polynomial], edges: &[SweptEdge]) -> bool {
    let mut all_zero = true;
    for side in sides {
        match root.sign_of(side) {
            Sign::Negative => return false,
            Sign::Zero => {}
            Sign::Positive => all_zero = false,
        }
    }
    !all_zero || edges.iter().any(|edge| edge.has_origin(root))
}

fn edges(corners: &[PolynomialVector]) -> impl Iterator<Item = SweptEdge> {
    (0..corners.len()).map(|ix| SweptEdge::new(&corners[ix], &corners[(ix + 1) % corners.len()]))
}

/// An edge AB of the polygon. The origin is on it at t if and only if A x B = 0 and A . B <= 0
/// there.
struct SweptEdge {
    cross: PolynomialVector,
    dot: Polynomial,
}

impl SweptEdge {
    fn new(a: &PolynomialVector, b: &PolynomialVector) -> Self {
        Self {
            cross: cross(a, b),
            dot: dot(a, b),
        }
    }

    /// Whether the origin is on the edge at a root.
    fn has_origin(&self, root: &mut Root) -> bool {
        self.cross.iter().all(|x| root.sign_of(x).is_zero())
            && root.sign_of(&self.dot) != Sign::Positive
    }

    /// The first time in (0, 1] at which the origin is on the edge, provided that it is not on it
    /// at the start.
    fn first_time(&self) -> Option<Time> {
        let moving: Vec<&Polynomial> = self.cross.iter().filter(|x| !x.is_zero()).collect();
        if moving.iter().any(|x| x.has_no_root()) {
            return None;
        }
        let Some(&first) = moving.first() else {
            // The edge's line passes through the origin at all times. A . B is positive at the
            // start, and the origin comes onto the edge when A . B becomes zero.
            return (!self.dot.is_zero())
                .then(|| Roots::of(self.dot.clone()).next())
                .flatten()
                .map(|root| root.floor());
        };
        Roots::of(first.clone())
            .find_map(|mut root| self.has_origin(&mut root).then(|| root.floor()))
    }
}

/// The first time in (0, 1] at which a corner is at the origin, provided that it is not there at
/// the start.
fn first_at_corner(corner: &PolynomialVector) -> Option<Time> {
    let first = corner.iter().find(|x| !x.is_zero())?;
    Roots::of(first.clone()).find_map(|mut root| {
        corner
            .iter()
            .all(|x| root.sign_of(x).is_zero())
            .then(|| root.floor())
    })
}
