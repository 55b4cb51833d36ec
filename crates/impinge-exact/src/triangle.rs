//! Triangle against segment and triangle against triangle.

use super::Point;
use super::filter::{apart_in_a_plane, triangles_answer};
use super::orientation::{Projection, on_one_side, orient2d, orient3d, strictly_on_one_side};
use super::segment::{segments_intersect, segments_intersect_2d};
use super::sign::Sign;

/// The edges of a triangle as vertex numbers.
const EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// Whether two closed triangles share a point.
///
/// Touching and coplanar overlap count; a degenerate triangle is the segment or the point that
/// it is. Exact for finite coordinates; never panics.
///
/// Most pairs are settled by a filter in plain `f64`, the rest by exact signs.
///
/// ```
/// use impinge_exact::triangles_intersect;
/// let a = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let touching = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, 1.0]];
/// let above = a.map(|[x, y, _]| [x, y, 1e-30]);
/// assert!(triangles_intersect(&a, &touching));
/// assert!(!triangles_intersect(&a, &above));
/// ```
#[must_use]
pub fn triangles_intersect(a: &[Point; 3], b: &[Point; 3]) -> bool {
    triangles_answer(a, b).unwrap_or_else(|| {
        have_common_point(a, b) || (!apart_in_a_plane(a, b) && triangles_intersect_by_signs(a, b))
    })
}

/// Whether both elements have a vertex with the same coordinates: then they touch. Most pairs
/// that no filter can settle are such neighbours in a mesh that repeats its vertices.
pub(super) fn have_common_point(a: &[Point], b: &[Point]) -> bool {
    a.iter().any(|point| b.contains(point))
}

/// [`triangles_intersect`] by exact signs alone.
///
/// Two triangles meet if and only if an edge of one meets the other: a point of both can be
/// moved inside both, along the line (or over the plane) where they overlap, until it reaches an
/// edge of one of them.
pub(super) fn triangles_intersect_by_signs(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let b_sides = sides(a, b);
    if strictly_on_one_side(&b_sides) {
        return false;
    }
    let a_sides = sides(b, a);
    if strictly_on_one_side(&a_sides) {
        return false;
    }
    if a_sides.iter().chain(&b_sides).all(|side| side.is_zero())
        && let Some(answer) = intersect_in_plane(a, b)
    {
        return answer;
    }
    any_edge_meets(a, a_sides, b) || any_edge_meets(b, b_sides, a)
}

/// Whether two coplanar triangles share a point; `None` when one is degenerate.
///
/// Two convex polygons in a plane are apart if and only if the line of an edge of one has the other
/// strictly on its outer side. Proof: their difference is a convex polygon with edges parallel to
/// theirs. If they are apart, the origin lies strictly beyond one of its edges.
fn intersect_in_plane(a: &[Point; 3], b: &[Point; 3]) -> Option<bool> {
    let projection = Projection::injective(&a[0], &a[1], &a[2])?;
    let (a, b) = (projection.apply_all(a), projection.apply_all(b));
    let a_turn = orient2d(a[0], a[1], a[2]);
    let b_turn = orient2d(b[0], b[1], b[2]);
    if b_turn.is_zero() {
        return None;
    }
    let parts = |t: &[[f64; 2]; 3], turn: Sign, other: &[[f64; 2]; 3]| {
        EDGES.iter().any(|&[i, j]| {
            other
                .iter()
                .all(|&vertex| orient2d(t[i], t[j], vertex).strictly_opposite(turn))
        })
    };
    Some(!parts(&a, a_turn, &b) && !parts(&b, b_turn, &a))
}

/// On which side of the plane of `triangle` each vertex of `other` lies. All zero when
/// `triangle` is degenerate.
fn sides(triangle: &[Point; 3], other: &[Point; 3]) -> [Sign; 3] {
    let [p, q, r] = triangle;
    other.each_ref().map(|vertex| orient3d(p, q, r, vertex))
}

/// Whether an edge of `a` meets `b`. `sides`: on which side of `b`'s plane each vertex of `a` lies.
fn any_edge_meets(a: &[Point; 3], sides: [Sign; 3], b: &[Point; 3]) -> bool {
    EDGES
        .iter()
        .any(|&[i, j]| segment_meets_triangle_with_sides(&a[i], &a[j], sides[i], sides[j], b))
}

/// Whether the closed segment pq and the closed triangle share a point.
pub(super) fn segment_meets_triangle(p: &Point, q: &Point, triangle: &[Point; 3]) -> bool {
    let [a, b, c] = triangle;
    let (p_side, q_side) = (orient3d(a, b, c, p), orient3d(a, b, c, q));
    segment_meets_triangle_with_sides(p, q, p_side, q_side, triangle)
}

/// Whether the open segment pq passes through the inside of the triangle, so that no border of one
/// touches the other.
pub(super) fn passes_inside(p: &Point, q: &Point, triangle: &[Point; 3]) -> bool {
    let [a, b, c] = triangle;
    if !orient3d(a, b, c, p).strictly_opposite(orient3d(a, b, c, q)) {
        return false;
    }
    let side = orient3d(p, q, a, b);
    side.strictly_same(orient3d(p, q, b, c)) && side.strictly_same(orient3d(p, q, c, a))
}

/// [`segment_meets_triangle`] when it is known on which side of the triangle's plane p and q lie.
fn segment_meets_triangle_with_sides(
    p: &Point,
    q: &Point,
    p_side: Sign,
    q_side: Sign,
    triangle: &[Point; 3],
) -> bool {
    if p_side.strictly_same(q_side) {
        return false;
    }
    if p_side.is_zero() && q_side.is_zero() {
        return segment_meets_triangle_in_plane(p, q, triangle);
    }
    // The segment meets the plane in one point. It lies in the triangle when the line pq passes
    // all three edges on the same side (or touches them).
    let [a, b, c] = triangle;
    on_one_side(&[
        orient3d(p, q, a, b),
        orient3d(p, q, b, c),
        orient3d(p, q, c, a),
    ])
}

/// Segment against triangle when p and q lie in the triangle's plane or the triangle is degenerate.
fn segment_meets_triangle_in_plane(p: &Point, q: &Point, triangle: &[Point; 3]) -> bool {
    let [a, b, c] = triangle;
    let Some(projection) = Projection::injective(a, b, c) else {
        // A degenerate triangle is the union of its edges.
        return EDGES
            .iter()
            .any(|&[i, j]| segments_intersect(p, q, &triangle[i], &triangle[j]));
    };
    let [a, b, c] = projection.apply_all(triangle);
    let (p, q) = (projection.apply(p), projection.apply(q));
    // Either the segment lies inside, and then so does p, or it meets an edge.
    on_one_side(&[orient2d(a, b, p), orient2d(b, c, p), orient2d(c, a, p)])
        || segments_intersect_2d(p, q, a, b)
        || segments_intersect_2d(p, q, b, c)
        || segments_intersect_2d(p, q, c, a)
}
