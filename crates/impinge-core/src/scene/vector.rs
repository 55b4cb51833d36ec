//! Points and differences of points, in `f64` and one fixed order of operations.

use impinge_exact::Point;

#[inline]
pub(crate) fn add(p: Point, q: Point) -> Point {
    [p[0] + q[0], p[1] + q[1], p[2] + q[2]]
}

#[inline]
pub(crate) fn sub(p: Point, q: Point) -> Point {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

#[inline]
pub(crate) fn scaled(p: Point, by: f64) -> Point {
    p.map(|x| x * by)
}

#[inline]
pub(crate) fn dot(p: Point, q: Point) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

#[inline]
pub(crate) fn cross(p: Point, q: Point) -> Point {
    [
        p[1] * q[2] - p[2] * q[1],
        p[2] * q[0] - p[0] * q[2],
        p[0] * q[1] - p[1] * q[0],
    ]
}
