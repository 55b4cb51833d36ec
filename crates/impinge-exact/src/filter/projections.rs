//! Pairs separated in a coordinate plane: for triangles of flat and regular meshes, whose own
//! planes separate nothing.
//!
//! Neighbours in a flat mesh lie in one plane, and every determinant of the other filters is zero.
//! But projected along a coordinate axis, they are separated like triangles in a plane: by the line
//! of an edge.
//!
//! ```text
//! a2            b2      Triangles that are apart in the projection are apart in space. Of the
//! | \         / |       three projections, one shows a triangle at more than half of its area.
//! |  \  |    /  |
//! a0--a1|   b0--b1      all of b beyond the line of edge a1a2: apart
//! ```
//!
//! Every value here is a determinant of two differences of input points, wrong by less than 8.1 u
//! S^2 with S the largest difference (`docs/exactness.md`, "Projections"). NaN and overflow make
//! comparisons fail: unsure.

use super::Point;
use super::determinant::difference;
use super::number::Number;

/// The coordinates that stay when z, x or y is dropped.
const PLANES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// The determinant of two vectors of a plane.
#[inline(always)]
fn cross<T: Number>(d: &[T; 2], e: &[T; 2]) -> T {
    d[0] * e[1] - d[1] * e[0]
}

#[inline(always)]
fn minus<T: Number>(p: &[T; 2], q: &[T; 2]) -> [T; 2] {
    [p[0] - q[0], p[1] - q[1]]
}

#[inline(always)]
fn in_plane<T: Number>(triangle: &[[T; 3]; 3], [i, j]: [usize; 2]) -> [[T; 2]; 3] {
    let [p, q, r] = triangle;
    [[p[i], p[j]], [q[i], q[j]], [r[i], r[j]]]
}

/// The error of two determinants together, for triangles whose coordinates differ by at most S
/// along each axis: 32 u S^2.
#[inline(always)]
pub(super) fn bound<T: Number>(a: &[[T; 3]; 3], b: &[[T; 3]; 3]) -> T {
    let (mut largest, mut sum) = (T::splat(0.0), T::splat(0.0));
    for axis in 0..3 {
        let (mut low, mut high) = (a[0][axis], a[0][axis]);
        sum = sum + a[0][axis];
        for point in [&a[1], &a[2], &b[0], &b[1], &b[2]] {
            low = low.smaller(point[axis]);
            high = high.larger(point[axis]);
            sum = sum + point[axis];
        }
        largest = largest.larger(high - low);
    }
    // Minimum and maximum may drop a NaN. The sum of all coordinates keeps it: times zero, the sum
    // is NaN if a coordinate is NaN or infinite, else it adds 0.
    let bound = T::splat(0.5 * T::BOUND) * (largest * largest);
    bound.with_underflow() + sum * T::splat(0.0)
}

/// Whether the triangles are certainly apart in coordinate plane number `plane` of three: one lies
/// strictly beyond the line of an edge of the other. `bound` is the result of [`bound`] for the
/// same triangles.
#[inline(always)]
pub(super) fn are_parted<T: Number>(
    a: &[[T; 3]; 3],
    b: &[[T; 3]; 3],
    plane: usize,
    bound: T,
) -> T::Mask {
    let (a, b) = (in_plane(a, PLANES[plane]), in_plane(b, PLANES[plane]));
    parts(&a, &b, bound) | parts(&b, &a, bound)
}

/// Whether the line of an edge of `a` has `b` strictly on one side, and `a` not.
#[inline(always)]
fn parts<T: Number>(a: &[[T; 2]; 3], b: &[[T; 2]; 3], bound: T) -> T::Mask {
    let edges = [
        minus(&a[1], &a[0]),
        minus(&a[2], &a[1]),
        minus(&a[0], &a[2]),
    ];
    // How far the vertex opposite an edge is from the edge's line: for all three edges, twice the
    // area.
    let own = cross(&edges[2], &edges[0]);
    let zero = T::splat(0.0);
    let (above, below) = (own.larger(zero) + bound, own.smaller(zero) - bound);
    is_beyond(&a[0], &edges[0], b, above, below)
        | is_beyond(&a[1], &edges[1], b, above, below)
        | is_beyond(&a[2], &edges[2], b, above, below)
}

/// Whether all of `b` is more than `above` over the line of an edge, or less than `below`. No
/// closure: it would be compiled without the instruction set.
#[inline(always)]
fn is_beyond<T: Number>(
    from: &[T; 2],
    edge: &[T; 2],
    b: &[[T; 2]; 3],
    above: T,
    below: T,
) -> T::Mask {
    let x = cross(edge, &minus(&b[0], from));
    let y = cross(edge, &minus(&b[1], from));
    let z = cross(edge, &minus(&b[2], from));
    let (low, high) = (x.smaller(y).smaller(z), x.larger(y).larger(z));
    low.gt(above) | below.gt(high)
}

/// Whether two triangles are certainly apart in some coordinate plane.
#[inline]
pub(crate) fn apart_in_a_plane(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let bound = bound(a, b);
    (0..3).any(|plane| are_parted(a, b, plane, bound))
}

/// Whether the triangles v, a and v, b certainly meet in v alone, because seen along a coordinate
/// axis no ray from v lies in both: none of their edges at v lies in the angle of the other.
#[inline]
pub(crate) fn angles_apart(v: &Point, a: [&Point; 2], b: [&Point; 2]) -> bool {
    let (a, b) = (a.map(|p| difference(p, v)), b.map(|p| difference(p, v)));
    let size = [a[0], a[1], b[0], b[1]]
        .as_flattened()
        .iter()
        .fold(0.0, |size: f64, x| size.max(x.abs()));
    let bound = (0.5 * f64::BOUND * (size * size)).with_underflow();
    PLANES.iter().any(|&[i, j]| {
        let (a, b) = (a.map(|d| [d[i], d[j]]), b.map(|d| [d[i], d[j]]));
        let across = a.map(|d| b.map(|e| cross(&d, &e)));
        let (turn_a, turn_b) = (cross(&a[0], &a[1]), cross(&b[0], &b[1]));
        // Both angles counterclockwise.
        let [[s, t], [u, w]] = match (turn_a > bound, turn_b > bound) {
            (true, true) => across,
            (true, false) => across.map(|[x, y]| [y, x]),
            (false, true) => [across[1], across[0]],
            (false, false) => [across[1], across[0]].map(|[x, y]| [y, x]),
        };
        turn_a.abs() > bound
            && turn_b.abs() > bound
            // a x b for the first and second edge of each: b0, b1 outside of a; a0, a1 outside of
            // b.
            && (s < -bound || u > bound)
            && (t < -bound || w > bound)
            && (s > bound || t < -bound)
            && (u > bound || w < -bound)
    })
}

/// Whether the triangles u, v, p and u, v, q certainly share the edge uv and nothing else, because
/// seen along a coordinate axis p and q lie on different sides of it.
#[inline]
pub(crate) fn sides_apart(u: &Point, v: &Point, p: &Point, q: &Point) -> bool {
    let [e, p, q] = [v, p, q].map(|point| difference(point, u));
    let size = [e, p, q]
        .as_flattened()
        .iter()
        .fold(0.0, |size: f64, x| size.max(x.abs()));
    let bound = (0.5 * f64::BOUND * (size * size)).with_underflow();
    PLANES.iter().any(|&[i, j]| {
        let side = |d: &Point| cross(&[e[i], e[j]], &[d[i], d[j]]);
        let (p, q) = (side(&p), side(&q));
        (p > bound && q < -bound) || (p < -bound && q > bound)
    })
}
