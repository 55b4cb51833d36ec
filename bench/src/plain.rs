//! The pair tests of the peers: plain double precision, without error bounds, written to be fast.
//! They may be wrong for elements that touch or nearly touch, which shows as a difference in
//! counts.

/// A point in double precision.
pub type Point = [f64; 3];

/// The corners of an element: three or four points.
pub trait Corners: Copy + Send + Sync + 'static {
    /// The number of corners.
    const N: usize;
    /// Builds the corners one by one.
    fn from_fn(corner: impl FnMut(usize) -> Point) -> Self;
    /// Whether two elements meet, by the plain test.
    fn meet(&self, other: &Self) -> bool;
}

impl Corners for [Point; 3] {
    const N: usize = 3;
    #[inline(always)]
    fn from_fn(corner: impl FnMut(usize) -> Point) -> Self {
        std::array::from_fn(corner)
    }
    #[inline(always)]
    fn meet(&self, other: &Self) -> bool {
        triangles(self, other)
    }
}

impl Corners for [Point; 4] {
    const N: usize = 4;
    #[inline(always)]
    fn from_fn(corner: impl FnMut(usize) -> Point) -> Self {
        std::array::from_fn(corner)
    }
    #[inline(always)]
    fn meet(&self, other: &Self) -> bool {
        tetrahedra(self, other)
    }
}

#[inline(always)]
fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Positive if `d` lies on the side of the plane `abc` from which `abc` appears counterclockwise.
#[inline(always)]
fn orient(a: Point, b: Point, c: Point, d: Point) -> f64 {
    dot(sub(d, a), cross(sub(b, a), sub(c, a)))
}

/// Signed distances, scaled, of the corners of `t` from the plane of `plane`.
#[inline(always)]
fn sides(plane: &[Point; 3], t: &[Point; 3]) -> [f64; 3] {
    let normal = cross(sub(plane[1], plane[0]), sub(plane[2], plane[0]));
    t.map(|p| dot(sub(p, plane[0]), normal))
}

#[inline(always)]
fn one_sided(d: [f64; 3]) -> bool {
    (d[0] > 0.0 && d[1] > 0.0 && d[2] > 0.0) || (d[0] < 0.0 && d[1] < 0.0 && d[2] < 0.0)
}

/// The corner that is alone on its side of the other triangle's plane, and whether that is the
/// upper side. A corner in the plane is assigned to a side so that one corner is alone.
/// `None` if all three lie in the plane.
#[inline(always)]
fn apex(d: [f64; 3]) -> Option<(usize, bool)> {
    let bits = |keep: fn(f64) -> bool| {
        usize::from(keep(d[0])) | usize::from(keep(d[1])) << 1 | usize::from(keep(d[2])) << 2
    };
    let above = bits(|x| x > 0.0);
    let below = bits(|x| x < 0.0);
    let in_plane = 7 & !(above | below);
    let single = |mask: usize| mask.count_ones() == 1;
    let corner = |mask: usize| mask.trailing_zeros() as usize;
    if single(above) {
        Some((corner(above), true))
    } else if single(below) {
        Some((corner(below), false))
    } else if in_plane == 7 {
        None
    } else {
        // One corner in the plane, the others together on one side: it counts as being on the other
        // side.
        Some((corner(in_plane), below != 0))
    }
}

/// Whether two triangles meet: Guigue and Devillers 2003, "Fast and robust triangle-triangle
/// overlap test using orientation predicates".
#[inline]
pub fn triangles(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let from_b = sides(b, a);
    if one_sided(from_b) {
        return false;
    }
    let from_a = sides(a, b);
    if one_sided(from_a) {
        return false;
    }
    let (Some((i, a_above)), Some((j, b_above))) = (apex(from_b), apex(from_a)) else {
        return coplanar(a, b);
    };
    // Each apex first, and each triangle turned so that the other's apex lies above it.
    let [p1, mut q1, mut r1] = [a[i], a[(i + 1) % 3], a[(i + 2) % 3]];
    let [p2, mut q2, mut r2] = [b[j], b[(j + 1) % 3], b[(j + 2) % 3]];
    if !a_above {
        std::mem::swap(&mut q2, &mut r2);
    }
    if !b_above {
        std::mem::swap(&mut q1, &mut r1);
    }
    // The two segments in which the planes' common line meets the triangles overlap.
    orient(p1, q1, p2, q2) <= 0.0 && orient(p1, r1, r2, p2) <= 0.0
}

/// Coplanar triangles: no edge of either has the other on its far side, seen along the axis in
/// which the plane is steepest.
#[cold]
fn coplanar(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let normal = cross(sub(a[1], a[0]), sub(a[2], a[0])).map(f64::abs);
    let (u, v) = if normal[0] >= normal[1] && normal[0] >= normal[2] {
        (1, 2)
    } else if normal[1] >= normal[2] {
        (2, 0)
    } else {
        (0, 1)
    };
    let turn = |p: Point, q: Point, r: Point| {
        (q[u] - p[u]) * (r[v] - p[v]) - (q[v] - p[v]) * (r[u] - p[u])
    };
    let separates = |s: &[Point; 3], t: &[Point; 3]| {
        let inside = turn(s[0], s[1], s[2]).signum();
        (0..3).any(|k| {
            t.iter()
                .all(|&p| turn(s[k], s[(k + 1) % 3], p) * inside < 0.0)
        })
    };
    !separates(a, b) && !separates(b, a)
}

/// Whether two tetrahedra meet: separating axes, the faces of both first, then the cross
/// products of edges. If the face tests show a corner of one inside the other, the test ends.
#[inline]
pub fn tetrahedra(a: &[Point; 4], b: &[Point; 4]) -> bool {
    match (faces(a, b), faces(b, a)) {
        (Faces::Separate, _) | (_, Faces::Separate) => return false,
        (Faces::Inside, _) | (_, Faces::Inside) => return true,
        _ => {}
    }
    const EDGES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let edges = |t: &[Point; 4]| EDGES.map(|(i, j)| sub(t[j], t[i]));
    let (edges_a, edges_b) = (edges(a), edges(b));
    for &e in &edges_a {
        for &f in &edges_b {
            let axis = cross(e, f);
            let range = |t: &[Point; 4]| {
                let d = t.map(|p| dot(axis, sub(p, a[0])));
                (
                    d[0].min(d[1]).min(d[2].min(d[3])),
                    d[0].max(d[1]).max(d[2].max(d[3])),
                )
            };
            let ((min_a, max_a), (min_b, max_b)) = (range(a), range(b));
            if max_a < min_b || max_b < min_a {
                return false;
            }
        }
    }
    true
}

enum Faces {
    /// A face has all of the other tetrahedron beyond it.
    Separate,
    /// A corner of the other tetrahedron is inside.
    Inside,
    Unknown,
}

#[inline(always)]
fn faces(a: &[Point; 4], b: &[Point; 4]) -> Faces {
    const FACES: [[usize; 4]; 4] = [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]];
    let mut outside_any = 0u32;
    for [i, j, k, opposite] in FACES {
        let normal = cross(sub(a[j], a[i]), sub(a[k], a[i]));
        let inward = dot(sub(a[opposite], a[i]), normal);
        let mut outside = 0u32;
        for (corner, &p) in b.iter().enumerate() {
            let beyond = dot(sub(p, a[i]), normal) * inward < 0.0;
            outside |= u32::from(beyond) << corner;
        }
        if outside == 0b1111 {
            return Faces::Separate;
        }
        outside_any |= outside;
    }
    if outside_any != 0b1111 {
        return Faces::Inside;
    }
    Faces::Unknown
}

/// The square of the distance of a point and a triangle, by the regions of the triangle's nearest
/// point: C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
#[cfg_attr(not(feature = "embree"), allow(dead_code, reason = "for peers"))]
#[inline]
pub fn square_of_point_and_triangle(p: Point, [a, b, c]: [Point; 3]) -> f64 {
    let along =
        |from: Point, way: Point, share: f64| std::array::from_fn(|k| from[k] + share * way[k]);
    let square = |q: Point| {
        let way = sub(p, q);
        dot(way, way)
    };
    let (ab, ac) = (sub(b, a), sub(c, a));
    let (ap, bp, cp) = (sub(p, a), sub(p, b), sub(p, c));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return square(a);
    }
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return square(b);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return square(along(a, ab, d1 / (d1 - d3)));
    }
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return square(c);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return square(along(a, ac, d2 / (d2 - d6)));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return square(along(b, sub(c, b), share));
    }
    let normal = cross(ab, ac);
    let height = dot(normal, ap);
    height * height / dot(normal, normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge::exact;
    use impinge_scenes::soup;

    fn corners<const K: usize>(model: &impinge_scenes::Model) -> Vec<[Point; K]> {
        (0..model.n_elements())
            .map(|element| {
                let corners = model.elements.corners(element);
                std::array::from_fn(|k| model.positions[corners[k] as usize].map(f64::from))
            })
            .collect()
    }

    /// Random elements nearly never touch without crossing: the plain tests agree with the
    /// exact ones on all of them.
    #[test]
    fn plain_tests_agree_with_exact_ones_in_general_position() {
        let soup_a = corners::<3>(&soup::triangles(400, 0.9, 1));
        let soup_b = corners::<3>(&soup::triangles(400, 0.9, 2));
        let mut n_meet = 0;
        for a in &soup_a {
            for b in &soup_b {
                let meet = exact::triangles_intersect(a, b);
                n_meet += usize::from(meet);
                assert_eq!(triangles(a, b), meet, "{a:?} {b:?}");
            }
        }
        assert!(n_meet > 1_000, "{n_meet}");
        let solid_a = corners::<4>(&soup::tetrahedra(200, 0.9, 3));
        let solid_b = corners::<4>(&soup::tetrahedra(200, 0.9, 4));
        let mut n_meet = 0;
        for a in &solid_a {
            for b in &solid_b {
                let meet = exact::tetrahedra_intersect(a, b);
                n_meet += usize::from(meet);
                assert_eq!(tetrahedra(a, b), meet, "{a:?} {b:?}");
            }
        }
        assert!(n_meet > 1_000, "{n_meet}");
    }

    /// On a small lattice nothing rounds, so for triangles that are not degenerate the plain test
    /// is exact even where they touch.
    #[test]
    fn plain_triangle_test_is_right_on_a_lattice() {
        let soup_a = corners::<3>(&soup::lattice_triangles(600, 3, 1));
        let proper = |t: &&[Point; 3]| {
            let normal = cross(sub(t[1], t[0]), sub(t[2], t[0]));
            dot(normal, normal) > 0.0
        };
        let mut n_meet = 0;
        for a in soup_a.iter().filter(proper) {
            for b in soup_a.iter().filter(proper) {
                let meet = exact::triangles_intersect(a, b);
                n_meet += usize::from(meet);
                assert_eq!(triangles(a, b), meet, "{a:?} {b:?}");
            }
        }
        assert!(n_meet > 10_000, "{n_meet}");
    }
}
