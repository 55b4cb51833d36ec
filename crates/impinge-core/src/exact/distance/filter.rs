//! Distances in `f64` with bounds: most pairs are settled here.

use crate::exact::Point;
use crate::exact::sweep::ElementPair;

/// 64 unit roundoffs.
const BOUND: f64 = 32.0 * f64::EPSILON;

/// Numbers within these are far from underflow and overflow in products of four.
const SMALLEST: f64 = 1e-60;
const LARGEST: f64 = 1e60;

/// Whether two elements are within a distance; `None` when unsure.
///
/// No, if the whole difference polygon lies beyond a plane that is farther from the origin than `distance`. Yes, if
/// some point of the polygon is nearer than `distance`.
pub(super) fn answer(pair: ElementPair, points: &[Point; 4], distance: f64) -> Option<bool> {
    let (corners, n) = corners(pair, points);
    let corners = &corners[..n];
    let size = largest(corners);
    if !(SMALLEST..LARGEST).contains(&size)
        || !(distance == 0.0 || (SMALLEST..LARGEST).contains(&distance))
    {
        return None;
    }
    let mut near = nearest_on_edges(corners);
    if n > 2 {
        let normal = normal_of(corners);
        if is_beyond(&normal, corners.iter(), size, distance) {
            return Some(false);
        }
        if let Some(foot) = foot_in(corners, &normal) {
            near = if dot(&foot, &foot) < dot(&near, &near) {
                foot
            } else {
                near
            };
        }
    }
    if is_beyond(&near, corners.iter(), size, distance) {
        return Some(false);
    }
    let length = dot(&near, &near).sqrt();
    (length * (1.0 + BOUND) + BOUND * size < distance).then_some(true)
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
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for corner in corners {
        let x = dot(normal, corner);
        least = least.min(x);
        most = most.max(x);
    }
    least > bound || most < -bound
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

fn normal_of(corners: &[Point]) -> Point {
    let edge = |a: &Point, b: &Point| [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
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
