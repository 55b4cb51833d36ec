//! Pairs of one body that share vertices (`SharedVertex::Resolve`).
//!
//! Neighbours always meet in the simplex that they share: a vertex, an edge, a face. The
//! question is whether they meet *anywhere else*: a pair is reported if and only if the
//! intersection is larger than the convex hull of the shared vertices. Two elements with the
//! same vertices are always reported.
//!
//! Vertices are shared when their ids are equal, wherever they lie. For elements that are not
//! degenerate this is the usual rule (`docs/exactness.md`, "Shared vertices", has the proofs):
//!
//! | shared | triangles | tetrahedra |
//! |---|---|---|
//! | 1 | the edge opposite the vertex in one meets the other | the face opposite the vertex in one meets the other |
//! | 2 | coplanar, third vertices on the same side of the edge | the wedges around the edge share a half-plane |
//! | 3 | always | fourth vertices on the same side of the face |
//! | 4 | | always |

use super::Point;
use super::filter::{angles_apart, shared_edge, shared_vertex, sides_apart};
use super::orientation::{Projection, collinear, orient3d};
use super::segment::{same, segments_intersect, strictly_between};
use super::sign::Sign;
use super::tetrahedron::{tetrahedra_intersect, triangle_tetrahedron_intersect};
use super::triangle::{segment_meets_triangle, triangles_intersect};

/// Whether two triangles of one body meet beyond the vertices that they share.
///
/// `ids_a` and `ids_b` name the vertices; equal ids are shared vertices and must have equal
/// positions. With no shared id this is [`triangles_intersect`]. An id may be repeated within a
/// triangle, which is then degenerate. Never panics.
///
/// ```
/// use impinge_exact::triangles_intersect_beyond_shared;
/// let a = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let hinge = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]];
/// let folded = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
/// assert!(!triangles_intersect_beyond_shared(&a, [0, 1, 2], &hinge, [0, 1, 3]));
/// assert!(triangles_intersect_beyond_shared(&a, [0, 1, 2], &folded, [0, 1, 4]));
/// ```
#[must_use]
pub fn triangles_intersect_beyond_shared(
    a: &[Point; 3],
    ids_a: [u32; 3],
    b: &[Point; 3],
    ids_b: [u32; 3],
) -> bool {
    neighbours_answer(a, ids_a, b, ids_b)
        .unwrap_or_else(|| SplitCorners::new(a, ids_a, b, ids_b).meet_beyond_shared())
}

/// The filter's answer for triangles with three different ids each that share one or two; `None`
/// when unsure.
#[inline]
fn neighbours_answer(
    a: &[Point; 3],
    ids_a: [u32; 3],
    b: &[Point; 3],
    ids_b: [u32; 3],
) -> Option<bool> {
    let differ = |[p, q, r]: [u32; 3]| p != q && q != r && r != p;
    if !differ(ids_a) || !differ(ids_b) {
        return None;
    }
    let is_shared_a = ids_a.map(|id| ids_b.contains(&id));
    let is_shared_b = ids_b.map(|id| ids_a.contains(&id));
    let first = |flags: [bool; 3], sought: bool| flags.iter().position(|&flag| flag == sought);
    // The two vertices after a given one, in the triangle's order.
    let next = |vertex: usize| [(vertex + 1) % 3, (vertex + 2) % 3];
    match is_shared_a.iter().filter(|&&shared| shared).count() {
        1 => {
            let (i, j) = (first(is_shared_a, true)?, first(is_shared_b, true)?);
            let others_a = next(i).map(|vertex| &a[vertex]);
            let others_b = next(j).map(|vertex| &b[vertex]);
            match shared_vertex(&a[i], others_a, others_b) {
                (true, _) => Some(true),
                (_, true) => Some(false),
                _ => angles_apart(&a[i], others_a, others_b).then_some(false),
            }
        }
        2 => {
            let (i, j) = (first(is_shared_a, false)?, first(is_shared_b, false)?);
            let [u, v] = next(i).map(|vertex| &a[vertex]);
            let apart = shared_edge(u, v, &a[i], &b[j]) || sides_apart(u, v, &a[i], &b[j]);
            apart.then_some(false)
        }
        _ => None,
    }
}

/// Whether two tetrahedra of one body meet beyond the vertices that they share.
///
/// As [`triangles_intersect_beyond_shared`].
///
/// ```
/// use impinge_exact::tetrahedra_intersect_beyond_shared;
/// let a = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let (mut below, mut inverted) = (a, a);
/// below[3] = [0.0, 0.0, -1.0];
/// inverted[3] = [1.0, 1.0, 1.0];
/// let (ids_a, ids_b) = ([0, 1, 2, 3], [0, 1, 2, 4]);
/// assert!(!tetrahedra_intersect_beyond_shared(&a, ids_a, &below, ids_b));
/// assert!(tetrahedra_intersect_beyond_shared(&a, ids_a, &inverted, ids_b));
/// ```
#[must_use]
pub fn tetrahedra_intersect_beyond_shared(
    a: &[Point; 4],
    ids_a: [u32; 4],
    b: &[Point; 4],
    ids_b: [u32; 4],
) -> bool {
    SplitCorners::new(a, ids_a, b, ids_b).meet_beyond_shared()
}

/// Whether a triangle and a tetrahedron of one body meet beyond the vertices that they share.
///
/// As [`triangles_intersect_beyond_shared`]. A triangle that is a face of the tetrahedron, by
/// ids, meets it in that face and nowhere else, and is not reported.
#[must_use]
pub fn triangle_tetrahedron_intersect_beyond_shared(
    t: &[Point; 3],
    ids_t: [u32; 3],
    k: &[Point; 4],
    ids_k: [u32; 4],
) -> bool {
    SplitCorners::new(t, ids_t, k, ids_k).meet_beyond_shared()
}

/// Up to four points, without heap allocation.
#[derive(Clone, Copy)]
struct Points {
    points: [Point; 4],
    n: usize,
}

impl Points {
    const EMPTY: Self = Self {
        points: [[0.0; 3]; 4],
        n: 0,
    };

    fn push(&mut self, point: Point) {
        self.points[self.n] = point;
        self.n += 1;
    }

    fn from_slice(points: &[Point]) -> Self {
        let mut all = Self::EMPTY;
        for &point in points {
            all.push(point);
        }
        all
    }

    /// These points and one more.
    fn with(mut self, point: Point) -> Self {
        self.push(point);
        self
    }

    /// These points without the one at `left_out_ix`.
    fn without(self, left_out_ix: usize) -> Self {
        let mut rest = Self::EMPTY;
        for (point_ix, &point) in self.as_slice().iter().enumerate() {
            if point_ix != left_out_ix {
                rest.push(point);
            }
        }
        rest
    }

    fn as_slice(&self) -> &[Point] {
        &self.points[..self.n]
    }
}

/// Two elements split into the vertices that they share and the rest of each.
struct SplitCorners {
    shared: Points,
    rest_a: Points,
    rest_b: Points,
}

impl SplitCorners {
    fn new<const N: usize, const M: usize>(
        a: &[Point; N],
        ids_a: [u32; N],
        b: &[Point; M],
        ids_b: [u32; M],
    ) -> Self {
        let mut parts = Self {
            shared: Points::EMPTY,
            rest_a: Points::EMPTY,
            rest_b: Points::EMPTY,
        };
        for (ix, (id, &point)) in ids_a.iter().zip(a).enumerate() {
            if !ids_a[..ix].contains(id) {
                if ids_b.contains(id) {
                    parts.shared.push(point);
                } else {
                    parts.rest_a.push(point);
                }
            }
        }
        for (ix, (id, &point)) in ids_b.iter().zip(b).enumerate() {
            if !ids_b[..ix].contains(id) && !ids_a.contains(id) {
                parts.rest_b.push(point);
            }
        }
        parts
    }

    fn meet_beyond_shared(&self) -> bool {
        let (rest_a, rest_b) = (self.rest_a.as_slice(), self.rest_b.as_slice());
        match (self.shared.as_slice(), rest_a, rest_b) {
            (_, [], []) => true,
            // One is a face (or an edge, or a vertex) of the other by its ids.
            (_, [], _) | (_, _, []) => false,
            ([], _, _) => hulls_meet(rest_a, rest_b),
            ([v], _, _) => beyond_vertex(v, self.rest_a, self.rest_b),
            ([u, v], _, _) => beyond_edge(u, v, rest_a, rest_b),
            ([u, v, w], [a, ..], [b, ..]) => beyond_face([u, v, w], a, b),
            _ => true,
        }
    }
}

/// Whether the convex hulls of up to four points each share a point. A hull of fewer points is
/// a degenerate triangle or tetrahedron, with its last point repeated.
fn hulls_meet(a: &[Point], b: &[Point]) -> bool {
    match (a, b) {
        ([], _) | (_, []) => false,
        (&[p], &[q]) => same(&p, &q),
        ([p, q @ ..], [r, s @ ..]) if q.len() <= 1 && s.len() <= 1 => {
            segments_intersect(p, q.first().unwrap_or(p), r, s.first().unwrap_or(r))
        }
        ([p, q @ ..], &[r, s, t]) | (&[r, s, t], [p, q @ ..]) if q.len() <= 1 => {
            segment_meets_triangle(p, q.first().unwrap_or(p), &[r, s, t])
        }
        (&[p, q, r], &[s, t, u]) => triangles_intersect(&[p, q, r], &[s, t, u]),
        (_, &[p, q, r, s]) if a.len() <= 3 => {
            triangle_tetrahedron_intersect(&padded(a), &[p, q, r, s])
        }
        (&[p, q, r, s], _) if b.len() <= 3 => {
            triangle_tetrahedron_intersect(&padded(b), &[p, q, r, s])
        }
        _ => tetrahedra_intersect(&padded(a), &padded(b)),
    }
}

/// The first N points, the last one repeated where there are fewer.
fn padded<const N: usize>(points: &[Point]) -> [Point; N] {
    core::array::from_fn(|ix| points[ix.min(points.len() - 1)])
}

/// Whether conv(v, a) and conv(v, b) share a point other than v.
///
/// Follow the ray from v through a common point until it leaves one of the two elements. If v is
/// in neither conv(a) nor conv(b), the ray leaves each element through its face opposite v. So
/// one of these faces must meet the other element. As v is in neither face, that is also
/// sufficient.
fn beyond_vertex(v: &Point, a: Points, b: Points) -> bool {
    if let ([a0, a1], [b0, b1]) = (a.as_slice(), b.as_slice())
        && let Some(answer) = beyond_vertex_in_plane(v, [a0, a1], [b0, b1])
    {
        return answer;
    }
    if parted_by_face(v, a.as_slice(), b.as_slice())
        || parted_by_face(v, b.as_slice(), a.as_slice())
    {
        return false;
    }
    if hulls_meet(&[*v], a.as_slice()) {
        return parts_around(a).any(|part| beyond_vertex(v, part, b));
    }
    if hulls_meet(&[*v], b.as_slice()) {
        return parts_around(b).any(|part| beyond_vertex(v, a, part));
    }
    hulls_meet(a.as_slice(), b.with(*v).as_slice())
        || hulls_meet(b.as_slice(), a.with(*v).as_slice())
}

/// [`beyond_vertex`] for two coplanar triangles: whether their angles at v share a direction.
/// `None` when they are not coplanar, or one is degenerate.
fn beyond_vertex_in_plane(v: &Point, a: [&Point; 2], b: [&Point; 2]) -> Option<bool> {
    if b.iter()
        .any(|point| !orient3d(v, a[0], a[1], point).is_zero())
    {
        return None;
    }
    let projection = Projection::injective(v, a[0], a[1])?;
    let turn = |p: &Point, q: &Point| projection.turn(v, p, q);
    let (turn_a, turn_b) = (turn(a[0], a[1]), turn(b[0], b[1]));
    if turn_b.is_zero() {
        return None;
    }
    let within = |angle: [&Point; 2], inside: Sign, point: &Point| {
        !turn(angle[0], point).strictly_opposite(inside)
            && !turn(point, angle[1]).strictly_opposite(inside)
    };
    Some(
        b.iter().any(|point| within(a, turn_a, point))
            || a.iter().any(|point| within(b, turn_b, point)),
    )
}

/// Whether some face at v of the tetrahedron (v, a) has all of `b` strictly on its outer side. The
/// two can then only meet in that face's plane, and conv(v, b) has only v in that plane.
fn parted_by_face(v: &Point, a: &[Point], b: &[Point]) -> bool {
    let &[p, q, r] = a else { return false };
    let orientation = orient3d(v, &p, &q, &r);
    !orientation.is_zero()
        && [[p, q], [q, r], [r, p]].iter().any(|[p, q]| {
            b.iter()
                .all(|point| orient3d(v, p, q, point).strictly_opposite(orientation))
        })
}

/// If v lies in conv(a), then conv(a) is the union of conv(v, f) over the faces f of a. Returns
/// these faces; no face if `a` is one point.
fn parts_around(a: Points) -> impl Iterator<Item = Points> {
    let n_parts = if a.n > 1 { a.n } else { 0 };
    (0..n_parts).map(move |left_out_ix| a.without(left_out_ix))
}

/// Whether conv(u, v, a) and conv(u, v, b) have more than the segment uv in common, with one or
/// two points in each of `a` and `b`.
fn beyond_edge(u: &Point, v: &Point, a: &[Point], b: &[Point]) -> bool {
    if same(u, v) {
        return beyond_vertex(u, Points::from_slice(a), Points::from_slice(b));
    }
    // Off the line uv: seen along the line, each element is a wedge, the cone of the directions
    // towards its other vertices. Vertices on the line add no direction. Two cones in a plane
    // share a direction if and only if one contains an edge of the other.
    let off_line = |points: &[Point]| {
        let mut rest = Points::EMPTY;
        for point in points {
            if !collinear(u, v, point) {
                rest.push(*point);
            }
        }
        rest
    };
    let (wedge_a, wedge_b) = (off_line(a), off_line(b));
    let contains_one = |wedge: &Points, directions: &Points| {
        directions
            .as_slice()
            .iter()
            .any(|point| wedge_contains(u, v, wedge.as_slice(), point))
    };
    contains_one(&wedge_a, &wedge_b)
        || contains_one(&wedge_b, &wedge_a)
        // On the line: both extend beyond v, or both beyond u.
        || (extends_beyond(u, v, a) && extends_beyond(u, v, b))
        || (extends_beyond(v, u, a) && extends_beyond(v, u, b))
}

/// Whether `point` lies in the wedge around the line uv spanned by the directions of `wedge`
/// (none, one or two points); no point is on the line.
fn wedge_contains(u: &Point, v: &Point, wedge: &[Point], point: &Point) -> bool {
    if let [g, h] = wedge {
        let turn = orient3d(u, v, g, h);
        if !turn.is_zero() {
            return !orient3d(u, v, g, point).strictly_opposite(turn)
                && !orient3d(u, v, point, h).strictly_opposite(turn);
        }
    }
    wedge.iter().any(|g| same_half_plane(u, v, g, point))
}

/// Whether p and q, neither on the line uv, lie in one half-plane bounded by it.
fn same_half_plane(u: &Point, v: &Point, p: &Point, q: &Point) -> bool {
    orient3d(u, v, p, q).is_zero()
        && Projection::injective(u, v, p).is_some_and(|projection| {
            projection
                .turn(u, v, p)
                .strictly_same(projection.turn(u, v, q))
        })
}

/// Whether conv(u, v, a) contains a point of the line uv strictly beyond v; `a` has one or two
/// points.
fn extends_beyond(u: &Point, v: &Point, a: &[Point]) -> bool {
    let through_vertex = a
        .iter()
        .any(|point| collinear(u, v, point) && strictly_between(v, u, point));
    through_vertex
        || match a {
            // The segment pq crosses the line beyond v if and only if v lies in the triangle
            // upq and not on pq: then v is strictly between u and a point of pq.
            [p, q] => hulls_meet(&[*v], &[*u, *p, *q]) && !hulls_meet(&[*v], &[*p, *q]),
            _ => false,
        }
}

/// Whether conv(s, a) and conv(s, b) have more than the triangle s in common.
fn beyond_face(s: [&Point; 3], a: &Point, b: &Point) -> bool {
    let [u, v, w] = s;
    let Some(projection) = Projection::injective(u, v, w) else {
        // The shared face is the segment between its outermost points.
        let (u, v) = if contains_on_line(u, v, w) {
            (u, v)
        } else if contains_on_line(v, w, u) {
            (v, w)
        } else {
            (w, u)
        };
        return beyond_edge(u, v, &[*a], &[*b]);
    };
    let (a_side, b_side) = (orient3d(u, v, w, a), orient3d(u, v, w, b));
    if !(a_side.is_zero() && b_side.is_zero()) {
        // If one is flat and the other is not, they can only meet in the face's plane, and the one
        // that is not flat meets that plane in the face alone.
        return a_side.strictly_same(b_side);
    }
    // Both are flat. A common point outside the face lies beyond one of its edges, and then so do a
    // and b. Conversely, if a and b lie beyond the same edge, they share points next to its middle.
    let inside = projection.turn(u, v, w);
    [(u, v), (v, w), (w, u)].into_iter().any(|(p, q)| {
        let beyond = |point: &Point| -> bool {
            let side: Sign = projection.turn(p, q, point);
            side.strictly_opposite(inside)
        };
        beyond(a) && beyond(b)
    })
}

/// Whether the point w of the line uv lies on the closed segment uv.
fn contains_on_line(u: &Point, v: &Point, w: &Point) -> bool {
    same(u, w) || same(v, w) || strictly_between(w, u, v)
}
