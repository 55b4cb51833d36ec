//! Tetrahedron against tetrahedron, triangle and point.

use super::Point;
use super::filter::tetrahedra_answer;
use super::orientation::orient3d;
use super::sign::Sign;
use super::triangle::{have_common_point, triangles_intersect};

/// The faces of a tetrahedron as vertex numbers; face k leaves out vertex k, and
/// `orient3d(face k, vertex k)` has the sign of the tetrahedron for every k.
const FACES: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// The corner points of face `face_ix`.
#[inline]
fn face(tetrahedron: &[Point; 4], face_ix: usize) -> [Point; 3] {
    FACES[face_ix].map(|vertex_ix| tetrahedron[vertex_ix])
}

/// The orientation of a tetrahedron; zero when it is flat.
#[inline]
fn orientation(k: &[Point; 4]) -> Sign {
    orient3d(&k[0], &k[1], &k[2], &k[3])
}

/// Whether two closed tetrahedra (with their inside) share a point.
///
/// Touching counts; a flat tetrahedron is the polygon, segment or point that it is. Exact for
/// finite coordinates; never panics. Orientation does not matter.
///
/// ```
/// use impinge_exact::tetrahedra_intersect;
/// let a = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
/// let inside = a.map(|p| p.map(|x| 0.5 + x / 8.0));
/// let touching = a.map(|[x, y, z]| [x + 4.0, y, z]);
/// let apart = a.map(|[x, y, z]| [x + 4.0, y + 1e-15, z]);
/// assert!(tetrahedra_intersect(&a, &inside));
/// assert!(tetrahedra_intersect(&a, &touching));
/// assert!(!tetrahedra_intersect(&a, &apart));
/// ```
#[must_use]
pub fn tetrahedra_intersect(a: &[Point; 4], b: &[Point; 4]) -> bool {
    tetrahedra_answer(a, b)
        .unwrap_or_else(|| have_common_point(a, b) || tetrahedra_intersect_by_signs(a, b))
}

/// [`tetrahedra_intersect`] by exact signs alone.
pub(super) fn tetrahedra_intersect_by_signs(a: &[Point; 4], b: &[Point; 4]) -> bool {
    let (a_sign, b_sign) = (orientation(a), orientation(b));
    if separated_by_face(a, a_sign, b) || separated_by_face(b, b_sign, a) {
        return false;
    }
    // Either one lies inside the other, and then so does each of its vertices, or their surfaces
    // meet. A flat tetrahedron is the union of its faces, so it needs no rule of its own.
    contains(a, a_sign, &b[0])
        || contains(b, b_sign, &a[0])
        || (0..4).any(|i| {
            let face_a = face(a, i);
            (0..4).any(|j| triangles_intersect(&face_a, &face(b, j)))
        })
}

/// Whether a closed triangle and a closed tetrahedron (with its inside) share a point.
///
/// Touching counts; degenerate elements are what they are. Exact for finite coordinates;
/// never panics.
///
/// ```
/// use impinge_exact::triangle_tetrahedron_intersect;
/// let k = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
/// assert!(triangle_tetrahedron_intersect(&[[0.5; 3], [0.6; 3], [0.5, 0.6, 0.5]], &k));
/// assert!(!triangle_tetrahedron_intersect(&[[2.0; 3], [3.0; 3], [2.0, 3.0, 2.0]], &k));
/// ```
#[must_use]
pub fn triangle_tetrahedron_intersect(t: &[Point; 3], k: &[Point; 4]) -> bool {
    if have_common_point(t, k) {
        return true;
    }
    let k_sign = orientation(k);
    if separated_by_face(k, k_sign, t) {
        return false;
    }
    contains(k, k_sign, &t[0]) || (0..4).any(|i| triangles_intersect(t, &face(k, i)))
}

/// Whether the plane of a face of `k` has all `points` strictly on its outer side.
fn separated_by_face<const N: usize>(k: &[Point; 4], k_sign: Sign, points: &[Point; N]) -> bool {
    !k_sign.is_zero()
        && (0..4).any(|i| {
            let [p, q, r] = face(k, i);
            points
                .iter()
                .all(|point| orient3d(&p, &q, &r, point).strictly_opposite(k_sign))
        })
}

/// Whether a full (not flat) tetrahedron contains a point; false for a flat one, whose faces
/// the callers test instead.
fn contains(k: &[Point; 4], k_sign: Sign, point: &Point) -> bool {
    !k_sign.is_zero()
        && (0..4).all(|i| {
            let [p, q, r] = face(k, i);
            !orient3d(&p, &q, &r, point).strictly_opposite(k_sign)
        })
}
