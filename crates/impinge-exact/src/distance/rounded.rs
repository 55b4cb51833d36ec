//! Distances and nearest points as `f64`: quotients of exact integers, rounded.

use super::features::PolygonPart;
use super::nearest::ExactPolygon;
use super::reach::Reach;
use super::{NearestFeatures, WholeVector, cross, difference, dot};
use crate::Point;
use crate::algebra::{Coordinate, Integer, Whole, common_integers};
use crate::element_pair::ElementPair;
use crate::rounding::{power_of_two, root};

/// Nearest points of two elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoints {
    /// The features that contain them; exact.
    pub nearest: NearestFeatures,
    /// Their distance, wrong by a few units in the last place at most. For decisions use
    /// [`are_within`](super::are_within).
    pub distance: f64,
    /// The points of the first and of the second element. Their places on the elements are wrong by
    /// a few parts in 2^52, also where edges are nearly parallel; their coordinates are rounded.
    pub points: [Point; 2],
}

/// Nearest points of two elements and their distance.
///
/// The features are exact. Distance and points are computed in `f64` from exact quotients, in one
/// order of operations: the same on every machine, but rounded. The points and their order are
/// those of the [`ElementPair`].
///
/// ```
/// use impinge_exact::{ElementPair, closest_points};
/// let points = [[0.0, 0.0, 3.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
/// let closest = closest_points(ElementPair::VertexFace, &points);
/// assert_eq!((closest.distance, closest.points[1]), (3.0, [0.0, 0.0, 0.0]));
/// ```
#[must_use]
pub fn closest_points(pair: ElementPair, points: &[Point; 4]) -> NearestPoints {
    let reach = Reach::from(0.0);
    match ExactPolygon::short(pair, points, &reach) {
        Some(polygon) => closest_of(&polygon, pair, points),
        None => closest_of(
            &ExactPolygon::of_any_size(pair, points, &reach),
            pair,
            points,
        ),
    }
}

pub(super) fn closest_of<T: Coordinate>(
    polygon: &ExactPolygon<T>,
    pair: ElementPair,
    points: &[Point; 4],
) -> NearestPoints {
    let part = polygon.nearest();
    let [p, q, r, s] = points;
    let points = match (pair, part) {
        (ElementPair::EdgeEdge, PolygonPart::Face) => {
            let [share_a, share_b] = face_shares(polygon);
            [between(p, q, share_a), between(r, s, share_b)]
        }
        (ElementPair::EdgeEdge, PolygonPart::Edge(ix)) => {
            let share = edge_share(polygon, ix);
            match ix {
                0 => [between(p, q, share), *r],
                1 => [*q, between(r, s, share)],
                2 => [between(q, p, share), *s],
                _ => [*p, between(s, r, share)],
            }
        }
        (ElementPair::EdgeEdge, PolygonPart::Corner(ix)) => {
            [[*p, *q, *q, *p][ix], [*r, *r, *s, *s][ix]]
        }
        (_, PolygonPart::Face) => {
            let [first, second] = face_shares(polygon);
            let foot: Point =
                core::array::from_fn(|k| q[k] + (r[k] - q[k]) * first + (s[k] - r[k]) * second);
            if foot.iter().all(|x| x.is_finite()) {
                [*p, foot]
            } else {
                // A difference overflows: weights of the corners instead.
                let weights = [1.0 - first, first - second, second];
                let blend = |k: usize| weights[0] * q[k] + weights[1] * r[k] + weights[2] * s[k];
                [*p, core::array::from_fn(blend)]
            }
        }
        (_, PolygonPart::Edge(ix)) => {
            let next = points[1 + (ix + 1) % polygon.corners().len()];
            let share = edge_share(polygon, ix);
            [*p, between(&points[1 + ix], &next, share)]
        }
        (_, PolygonPart::Corner(ix)) => [*p, points[1 + ix]],
    };
    let (over, under) = polygon.square_of_distance(part);
    NearestPoints {
        nearest: part.named(pair, polygon.is_flat()),
        distance: root_of_quotient(&over, &under, polygon.exponent),
        points,
    }
}

/// How far along an edge of the polygon the point nearest to the origin is.
fn edge_share<T: Coordinate>(polygon: &ExactPolygon<T>, ix: usize) -> f64 {
    let edge = &polygon.edges()[ix];
    -quotient(&dot(&polygon.corners()[ix], edge), &dot(edge, edge))
}

/// How far along the first edge and the second the foot of the perpendicular is: with V_0 + s E_0 +
/// t E_1 = c N, s = -N . (V_0 x E_1) / |N|^2 and t = N . (V_0 x E_0) / |N|^2.
fn face_shares<T: Coordinate>(polygon: &ExactPolygon<T>) -> [f64; 2] {
    let corner = &polygon.corners()[0];
    let [first, second] = [&polygon.edges()[0], &polygon.edges()[1]];
    let normal = cross(first, second);
    let square = dot(&normal, &normal);
    [
        -quotient(&dot(&normal, &cross(corner, second)), &square),
        quotient(&dot(&normal, &cross(corner, first)), &square),
    ]
}

/// A quotient of at most about 1.
pub(super) fn quotient<T: Whole>(over: &T, under: &T) -> f64 {
    let ((x, i), (y, j)) = (over.approximate(), under.approximate());
    times_power(x / y, i - j)
}

/// The square root of a quotient, times a power of two.
fn root_of_quotient(over: &impl Whole, under: &impl Whole, exponent: i64) -> f64 {
    let ((x, i), (y, j)) = (over.approximate(), under.approximate());
    let is_odd = (i - j).rem_euclid(2);
    let half = (i - j - is_odd) / 2;
    times_power(root(times_power(x / y, is_odd)), half + exponent)
}

fn times_power(x: f64, exponent: i64) -> f64 {
    // In two steps: the power alone may be out of range.
    let exponent = i32::try_from(exponent.clamp(-2100, 2100)).unwrap_or(0);
    let half = exponent / 2;
    x * power_of_two(half) * power_of_two(exponent - half)
}

pub(super) fn between(from: &Point, to: &Point, share: f64) -> Point {
    core::array::from_fn(|k| {
        let way = to[k] - from[k];
        if way.is_finite() {
            from[k] + way * share
        } else {
            from[k] * (1.0 - share) + to[k] * share
        }
    })
}

/// How high two points are over the plane of a face, in a common unit.
pub(super) fn heights(p: &Point, q: &Point, [a, b, c]: [&Point; 3]) -> [Integer; 2] {
    let points = [p, q, a, b, c];
    let numbers: [f64; 15] = core::array::from_fn(|ix| points[ix / 3][ix % 3]);
    let (integers, _) = common_integers(numbers);
    let point =
        |ix: usize| -> WholeVector { core::array::from_fn(|k| integers[3 * ix + k].clone()) };
    let [a, b, c] = [2, 3, 4].map(point);
    let normal = cross(&difference(&b, &a), &difference(&c, &a));
    [0, 1].map(|ix| dot(&normal, &difference(&point(ix), &a)))
}
