//! Distances and nearest points as `f64`: roots and quotients of exact integers. Distances are
//! rounded down, to the largest float that is not above them.

use super::features::PolygonPart;
use super::nearest::ExactPolygon;
use super::reach::Reach;
use super::{NearestFeatures, WholeVector, cross, difference, dot, filter};
use crate::algebra::{Coordinate, Eight, Factor, Four, Integer, Whole, common_integers, parts};
use crate::element_pair::ElementPair;
use crate::rounding::{power_of_two, root};
use crate::{Point, Sign};

/// Nearest points of two elements.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NearestPoints {
    /// The features that contain them; exact.
    pub nearest: NearestFeatures,
    /// Their distance, rounded down: the largest `f64` that is not above it. 0 if and only if the
    /// elements touch, or are nearer than the smallest `f64`. To compare a distance with a number
    /// exactly, use [`are_within`](super::are_within).
    pub distance: f64,
    /// The points of the first and of the second element. Their places on the elements are wrong by
    /// a few parts in 2^52, also where edges are nearly parallel; their coordinates are rounded.
    pub points: [Point; 2],
}

/// Nearest points of two elements and their distance.
///
/// The features are exact, and the distance is the largest `f64` that is not above the true one.
/// The points are computed in `f64` from exact quotients, in one order of operations: the same on
/// every machine, but rounded. The points and their order are those of the [`ElementPair`].
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
    if let Some(polygon) = ExactPolygon::short(pair, points, &reach) {
        return closest_of(&polygon, polygon.nearest(), pair, points);
    }
    let polygon = ExactPolygon::of_any_size(pair, points, &reach);
    let part = filter::nearest_part(pair, points).unwrap_or_else(|| polygon.nearest());
    closest_of(&polygon, part, pair, points)
}

/// The distance of [`closest_points`] alone.
pub(super) fn distance(pair: ElementPair, points: &[Point; 4]) -> f64 {
    let reach = Reach::from(0.0);
    if let Some(polygon) = ExactPolygon::short(pair, points, &reach) {
        return distance_of(&polygon, polygon.nearest());
    }
    let polygon = ExactPolygon::of_any_size(pair, points, &reach);
    let part = filter::nearest_part(pair, points).unwrap_or_else(|| polygon.nearest());
    distance_of(&polygon, part)
}

/// By the nearest part of the polygon.
fn distance_of<T: Coordinate>(polygon: &ExactPolygon<T>, part: PolygonPart) -> f64 {
    let (over, under) = polygon.square_of_distance(part);
    root_below::<T>(&over, &under, polygon.exponent)
}

/// By the nearest part of the polygon.
pub(super) fn closest_of<T: Coordinate>(
    polygon: &ExactPolygon<T>,
    part: PolygonPart,
    pair: ElementPair,
    points: &[Point; 4],
) -> NearestPoints {
    let shares = match part {
        PolygonPart::Face => face_shares(polygon),
        PolygonPart::Edge(ix) => [edge_share(polygon, ix), 0.0],
        PolygonPart::Corner(_) => [0.0; 2],
    };
    NearestPoints {
        nearest: part.named(pair, polygon.is_flat()),
        distance: distance_of(polygon, part),
        points: points_at(pair, part, points, shares),
    }
}

/// The points at some shares of the first two edges of the polygon, or of the one edge that is
/// nearest.
#[inline]
pub(super) fn points_at(
    pair: ElementPair,
    part: PolygonPart,
    points: &[Point; 4],
    [first, second]: [f64; 2],
) -> [Point; 2] {
    let [p, q, r, s] = points;
    match (pair, part) {
        (ElementPair::EdgeEdge, PolygonPart::Face) => [between(p, q, first), between(r, s, second)],
        (ElementPair::EdgeEdge, PolygonPart::Edge(ix)) => match ix {
            0 => [between(p, q, first), *r],
            1 => [*q, between(r, s, first)],
            2 => [between(q, p, first), *s],
            _ => [*p, between(s, r, first)],
        },
        (ElementPair::EdgeEdge, PolygonPart::Corner(ix)) => {
            [[*p, *q, *q, *p][ix], [*r, *r, *s, *s][ix]]
        }
        (_, PolygonPart::Face) => {
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
            let next = points[1 + (ix + 1) % pair.corners().len()];
            [*p, between(&points[1 + ix], &next, first)]
        }
        (_, PolygonPart::Corner(ix)) => [*p, points[1 + ix]],
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

/// The largest float that is at most the square root of a quotient times 2^`exponent`; the largest
/// finite one if that is larger.
fn root_below<T: Coordinate>(over: &Eight<T>, under: &Four<T>, exponent: i64) -> f64 {
    if over.sign().is_zero() {
        return 0.0;
    }
    // over 4^exponent - x^2 under, as a multiple of 4 to the exponent that comes with it. For an x
    // near the root both terms are about as long as the longer of `over` and 106 bits more than
    // `under`, which fits the type of `over`.
    let rest = |x: f64| {
        let (mantissa, unit) = parts(x);
        let mantissa = T::small(mantissa);
        let square = mantissa.product(&mantissa).widened().product(under);
        let shift = 2 * (unit - exponent);
        if shift > 0 {
            let square = square.shifted(shift.unsigned_abs());
            (over.minus(&square), exponent)
        } else {
            (over.shifted(shift.unsigned_abs()).minus(&square), unit)
        }
    };
    let ((x, i), (y, j)) = (over.approximate(), under.approximate());
    let is_odd = (i - j).rem_euclid(2);
    let half = (i - j - is_odd) / 2;
    let estimate = times_power(root(times_power(x / y, is_odd)), half + exponent);
    // Wrong by two units in the last place at most.
    let mut found = estimate.min(f64::MAX);
    let (left, unit) = rest(found);
    if left.sign().is_zero() {
        return found;
    }
    // The root is at found + left / (2 found under), wrong by far less than a unit in the last
    // place: this says nearly always which floats it is between.
    let (z, k) = left.approximate();
    let gap = found.next_up() - found;
    let units = times_power(z / (2.0 * y), k + 2 * unit - j) / found / gap;
    if (1e-250..1e250).contains(&found) && units.abs() < 8.0 {
        #[allow(clippy::cast_possible_truncation, reason = "a floor below 16")]
        let n_units = f64::from((units + 8.0) as i32 - 8);
        let next = found + n_units * gap;
        if next.next_up() - next == gap && (1e-3..1.0 - 1e-3).contains(&(units - n_units)) {
            return next;
        }
    }
    let is_below = |x: f64| rest(x).0.sign() != Sign::Negative;
    if left.sign() == Sign::Positive {
        let mut next = found.next_up();
        while next < f64::INFINITY && is_below(next) {
            (found, next) = (next, next.next_up());
        }
        return found;
    }
    while !is_below(found) {
        found = found.next_down();
    }
    found
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
