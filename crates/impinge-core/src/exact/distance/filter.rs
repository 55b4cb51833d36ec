//! Distances in `f64` with bounds: most pairs are settled here.

use super::features::Part;
use super::reach::Reach;
use crate::exact::Point;
use crate::exact::element_pair::ElementPair;

/// 64 unit roundoffs.
const BOUND: f64 = 32.0 * f64::EPSILON;

/// Numbers within these are far from underflow and overflow in products of four.
const SMALLEST: f64 = 1e-60;
const LARGEST: f64 = 1e60;

/// Whether two elements are within a distance; `None` when unsure.
///
/// No, if the whole difference polygon lies beyond a plane that is farther from the origin than the reach. Yes, if
/// some point of the polygon is nearer than the reach.
pub(super) fn answer(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> Option<bool> {
    let (corners, n) = corners(pair, points);
    let corners = &corners[..n];
    let size = largest(corners);
    let is_in_range = |x: f64| x == 0.0 || (SMALLEST..LARGEST).contains(&x);
    if !(SMALLEST..LARGEST).contains(&size) || ![reach.low, reach.high].into_iter().all(is_in_range)
    {
        return None;
    }
    let normal = (n > 2).then(|| normal_of(corners));
    let is_beyond = |normal| is_beyond(normal, corners.iter(), size, reach.high);
    if normal.as_ref().is_some_and(is_beyond) {
        return Some(false);
    }
    let near = nearest_point(corners, normal.as_ref());
    if is_beyond(&near) {
        return Some(false);
    }
    let length = dot(&near, &near).sqrt();
    (length * (1.0 + BOUND) + BOUND * size < reach.low).then_some(true)
}

/// Two numbers between which the distance of two elements certainly is; none where sizes are out of range.
pub(super) fn bounds(pair: ElementPair, points: &[Point; 4]) -> Option<[f64; 2]> {
    let (corners, n) = corners(pair, points);
    let corners = &corners[..n];
    let size = largest(corners);
    if !(SMALLEST..LARGEST).contains(&size) {
        return None;
    }
    let normal = (n > 2).then(|| normal_of(corners));
    let near = nearest_point(corners, normal.as_ref());
    let low = [Some(near), normal]
        .iter()
        .flatten()
        .map(|normal| least_beyond(normal, corners.iter(), size))
        .fold(0.0, f64::max);
    let length = dot(&near, &near).sqrt();
    Some([low, length * (1.0 + BOUND) + BOUND * size])
}

/// The part of the polygon with the nearest point in its inside, if signs of rounded values are certain to tell.
///
/// As the exact decision goes by signs (`Polygon::nearest`), with none of them zero.
pub(super) fn nearest_part(pair: ElementPair, points: &[Point; 4]) -> Option<Part> {
    let (corners, n) = corners(pair, points);
    let corners = &corners[..n];
    if !(SMALLEST..LARGEST).contains(&largest(corners)) {
        return None;
    }
    let edges: [Point; 4] = std::array::from_fn(|ix| edge_of(pair, points, ix % n));
    // Whether corner . edge is positive.
    let is_along = |corner: usize, ix: usize| {
        let (corner, edge) = (&corners[corner % n], &edges[ix]);
        is_positive(dot(corner, edge), size_of(corner) * size_of(edge))
    };
    match n {
        1 => return Some(Part::Corner(0)),
        2 => {
            return match (is_along(0, 0)?, is_along(1, 0)?) {
                (true, _) => Some(Part::Corner(0)),
                (_, false) => Some(Part::Corner(1)),
                (false, true) => Some(Part::Edge(0)),
            };
        }
        _ => {}
    }
    let normal = cross(&edges[0], &edges[1]);
    let scale = size_of(&edges[0]) * size_of(&edges[1]);
    let mut is_inner = [true; 4];
    for (ix, corner) in corners.iter().enumerate() {
        let moment = cross(corner, &edges[ix]);
        let size = scale * size_of(corner) * size_of(&edges[ix]);
        is_inner[ix] = is_positive(dot(&normal, &moment), 4.0 * size)?;
    }
    if is_inner[..n].iter().all(|&is_inner| is_inner) {
        return Some(Part::Face);
    }
    for (ix, is_inner) in is_inner[..n].iter().enumerate() {
        if !is_inner && !is_along(ix, ix)? && is_along(ix + 1, ix)? {
            return Some(Part::Edge(ix));
        }
    }
    for ix in 0..n {
        if is_along(ix, ix)? && !is_along(ix, (ix + n - 1) % n)? {
            return Some(Part::Corner(ix));
        }
    }
    None
}

/// Whether a value is positive or negative, where it is wrong by less than [`BOUND`] times a size; none where it may be
/// zero. Only the last product can underflow.
fn is_positive(value: f64, size: f64) -> Option<bool> {
    let bound = BOUND * size + f64::MIN_POSITIVE;
    if value > bound {
        Some(true)
    } else if value < -bound {
        Some(false)
    } else {
        None
    }
}

/// From a corner of the polygon to the next: a difference of two points, rounded once.
fn edge_of(pair: ElementPair, points: &[Point; 4], ix: usize) -> Point {
    let numbers = pair.corners();
    let ([i, j], [k, l]) = (numbers[ix], numbers[(ix + 1) % numbers.len()]);
    if i == k {
        edge(&points[l], &points[j])
    } else {
        edge(&points[i], &points[k])
    }
}

fn size_of(vector: &Point) -> f64 {
    vector.iter().fold(0.0, |size: f64, x| size.max(x.abs()))
}

/// A point of the polygon that is nearest to the origin, but for rounding.
fn nearest_point(corners: &[Point], normal: Option<&Point>) -> Point {
    let near = nearest_on_edges(corners);
    match normal.and_then(|normal| foot_in(corners, normal)) {
        Some(foot) if dot(&foot, &foot) < dot(&near, &near) => foot,
        _ => near,
    }
}

/// Whether two moving elements certainly stay farther apart than a distance: one plane has their difference polygon
/// beyond it at both ends of the step.
pub(super) fn stay_apart(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
    distance: f64,
) -> bool {
    let (first, n) = corners(pair, start);
    let (last, _) = corners(pair, end);
    let (first, last) = (&first[..n], &last[..n]);
    let size = largest(first).max(largest(last));
    if !(SMALLEST..LARGEST).contains(&size) || !(SMALLEST..LARGEST).contains(&distance) {
        return false;
    }
    let both = || first.iter().chain(last);
    let mut sum = [0.0; 3];
    for corner in both() {
        for axis in 0..3 {
            sum[axis] += corner[axis];
        }
    }
    let mut normals = vec![
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        sum,
        nearest_on_edges(first),
        nearest_on_edges(last),
    ];
    if n > 2 {
        normals.extend([normal_of(first), normal_of(last)]);
    }
    normals
        .iter()
        .any(|normal| is_beyond(normal, both(), size, distance))
}

/// Whether n . V > d |n| for all corners V, or n . V < -d |n| for all. The normal n is taken as exact.
fn is_beyond<'a>(
    normal: &Point,
    corners: impl Iterator<Item = &'a Point>,
    size: f64,
    distance: f64,
) -> bool {
    let length = dot(normal, normal).sqrt();
    if !(SMALLEST * SMALLEST..LARGEST * LARGEST).contains(&length) {
        return false;
    }
    // n . V is wrong by less than BOUND |n| |V|; the length is wrong by four roundings.
    let bound = distance * length * (1.0 + BOUND) + BOUND * length * size;
    let [least, most] = extent_along(normal, corners);
    least > bound || most < -bound
}

/// A distance at which all corners are certainly, beyond a plane through the origin; 0 if that is not certain.
fn least_beyond<'a>(normal: &Point, corners: impl Iterator<Item = &'a Point>, size: f64) -> f64 {
    let length = dot(normal, normal).sqrt();
    if !(SMALLEST * SMALLEST..LARGEST * LARGEST).contains(&length) {
        return 0.0;
    }
    let [least, most] = extent_along(normal, corners);
    // The quotient has one more rounding, as the bound covers many times.
    (least.max(-most) / length * (1.0 - BOUND) - BOUND * size).max(0.0)
}

/// The least and the greatest n . V.
fn extent_along<'a>(normal: &Point, corners: impl Iterator<Item = &'a Point>) -> [f64; 2] {
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for corner in corners {
        let x = dot(normal, corner);
        least = least.min(x);
        most = most.max(x);
    }
    [least, most]
}

fn corners(pair: ElementPair, points: &[Point; 4]) -> ([Point; 4], usize) {
    let mut corners = [[0.0; 3]; 4];
    let numbers = pair.corners();
    for (corner, &[i, j]) in corners.iter_mut().zip(numbers) {
        for axis in 0..3 {
            corner[axis] = points[i][axis] - points[j][axis];
        }
    }
    (corners, numbers.len())
}

fn largest(corners: &[Point]) -> f64 {
    corners
        .iter()
        .flatten()
        .fold(0.0, |size: f64, x| size.max(x.abs()))
}

/// The point of the polygon's border that is nearest to the origin, up to rounding.
fn nearest_on_edges(corners: &[Point]) -> Point {
    let mut best = corners[0];
    for (ix, a) in corners.iter().enumerate() {
        let b = &corners[(ix + 1) % corners.len()];
        let e = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let share = -dot(a, &e) / dot(&e, &e);
        // The share is NaN, and becomes 0, where the edge is a point.
        let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
        let rest = 1.0 - share;
        let at = [
            a[0] * rest + b[0] * share,
            a[1] * rest + b[1] * share,
            a[2] * rest + b[2] * share,
        ];
        if dot(&at, &at) < dot(&best, &best) {
            best = at;
        }
    }
    best
}

/// The foot of the perpendicular from the origin, as a blend of the corners, if it lies in the polygon.
fn foot_in(corners: &[Point], normal: &Point) -> Option<Point> {
    let [a, b, c] = [corners[0], corners[1], corners[2]];
    let square = dot(normal, normal);
    let area = |p: &Point, q: &Point| dot(normal, &cross(p, q)) / square;
    // Weights of a triangle; of a parallelogram the fourth corner is a - b + c.
    let (weight_a, weight_c) = (area(&b, &c), area(&a, &b));
    let weights = if corners.len() == 3 {
        let weight_b = area(&c, &a);
        [weight_a, weight_b, weight_c, 0.0]
    } else {
        // Shares along a -> b and b -> c. Inside the parallelogram, their products are nonnegative weights.
        let (s, t) = (1.0 - weight_a, weight_c);
        [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]
    };
    if !weights.iter().all(|&weight| weight >= 0.0) {
        return None;
    }
    let sum: f64 = weights.iter().sum();
    let mut foot = [0.0; 3];
    for (corner, weight) in corners.iter().zip(weights) {
        for axis in 0..3 {
            foot[axis] += corner[axis] * (weight / sum);
        }
    }
    Some(foot)
}

fn edge(from: &Point, to: &Point) -> Point {
    [to[0] - from[0], to[1] - from[1], to[2] - from[2]]
}

fn normal_of(corners: &[Point]) -> Point {
    cross(
        &edge(&corners[0], &corners[1]),
        &edge(&corners[1], &corners[2]),
    )
}

fn cross(a: &Point, b: &Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn dot(a: &Point, b: &Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
