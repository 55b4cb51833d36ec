//! Tetrahedron against tetrahedron.

use super::determinant::{Determinant, Normal, difference};
use super::number::{Number, Vector, load_vertex};
use super::{LANES, Point, Tetrahedra8, TetrahedronPairs8, Verdict};

/// Which lanes are certainly apart because a face of one parts them, and which certainly intersect
/// because one has a vertex inside the other.
///
/// Unsure lanes, those that only cross at edges among them, go to
/// [`tetrahedra_intersect`](crate::exact::tetrahedra_intersect), which tries its edges in `f64`
/// first. About 900 operations for all eight lanes, without a branch.
#[inline(always)]
#[must_use]
pub fn classify_by_faces<V: Vector>(pairs: &TetrahedronPairs8) -> Verdict {
    let mut verdict = Verdict::default();
    for first in (0..LANES).step_by(V::N) {
        let (a, b) = (load::<V>(&pairs.a, first), load::<V>(&pairs.b, first));
        let (of_a, of_b) = (Sides::new(&b, &a), Sides::new(&a, &b));
        verdict.yes |= V::bits(of_a.any_inside() | of_b.any_inside()) << first;
        verdict.no |= V::bits(of_a.parted_by_face() | of_b.parted_by_face()) << first;
    }
    verdict
}

#[inline(always)]
fn load<V: Vector>([p, q, r, s]: &Tetrahedra8, first: usize) -> [[V; 3]; 4] {
    [
        load_vertex(p, first),
        load_vertex(q, first),
        load_vertex(r, first),
        load_vertex(s, first),
    ]
}

/// The answer for one pair, faces first, then edges; none when unsure.
///
/// A certain crossing of an edge with a face is a certain yes. If all edges certainly miss all
/// faces of the other, the surfaces share no point, and then either one tetrahedron is inside the
/// other, with all its vertices, or they are apart.
#[inline]
pub(in super::super) fn tetrahedra_answer(a: &[Point; 4], b: &[Point; 4]) -> Option<bool> {
    let of_b = Sides::new(a, b);
    if of_b.parted_by_face() {
        return Some(false);
    }
    let of_a = Sides::new(b, a);
    if of_a.parted_by_face() {
        return Some(false);
    }
    if of_a.any_inside() || of_b.any_inside() {
        return Some(true);
    }
    match (edges_cross(a, &of_a, b), edges_cross(b, &of_b, a)) {
        (Crossing::Certain, _) | (_, Crossing::Certain) => Some(true),
        (Crossing::None, Crossing::None) if of_a.is_outside(0) && of_b.is_outside(0) => Some(false),
        _ => None,
    }
}

/// The faces as vertex numbers; face k leaves out vertex k.
const FACES: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// The edges as vertex numbers.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Where the four points of one tetrahedron lie by the faces of the other.
struct Sides<T: Number = f64>([FaceSides<T>; 4]);

/// Where four points lie by the plane of one face.
#[derive(Clone, Copy)]
struct FaceSides<T: Number = f64> {
    /// Whether a point is certainly on the side of the tetrahedron.
    inner: [T::Mask; 4],
    /// Whether a point is certainly on the other side.
    outer: [T::Mask; 4],
}

impl<T: Number> FaceSides<T> {
    /// `points` by the face pqr of a tetrahedron with the fourth vertex `apex`.
    #[inline(always)]
    fn new([p, q, r]: [&[T; 3]; 3], apex: &[T; 3], points: &[[T; 3]; 4]) -> Self {
        let normal = Normal::new(&difference(q, p), &difference(r, p));
        let apex = normal.dot(&difference(apex, p));
        let [a, b, c, d] = points;
        // No closures: see the note in `triangles.rs`.
        let (a, b) = (normal.dot(&difference(a, p)), normal.dot(&difference(b, p)));
        let (c, d) = (normal.dot(&difference(c, p)), normal.dot(&difference(d, p)));
        Self {
            inner: [
                a.is_same(apex),
                b.is_same(apex),
                c.is_same(apex),
                d.is_same(apex),
            ],
            outer: [
                a.is_opposite(apex),
                b.is_opposite(apex),
                c.is_opposite(apex),
                d.is_opposite(apex),
            ],
        }
    }
}

impl<T: Number> FaceSides<T> {
    #[inline(always)]
    fn all_outer(&self) -> T::Mask {
        let [p, q, r, s] = self.outer;
        p & q & r & s
    }
}

impl<T: Number> Sides<T> {
    /// `points` by the faces of `k`.
    #[inline(always)]
    fn new([k0, k1, k2, k3]: &[[T; 3]; 4], points: &[[T; 3]; 4]) -> Self {
        Self([
            FaceSides::new([k1, k3, k2], k0, points),
            FaceSides::new([k0, k2, k3], k1, points),
            FaceSides::new([k0, k3, k1], k2, points),
            FaceSides::new([k0, k1, k2], k3, points),
        ])
    }

    /// Whether some face certainly has all points on its outer side.
    #[inline(always)]
    fn parted_by_face(&self) -> T::Mask {
        let [a, b, c, d] = &self.0;
        a.all_outer() | b.all_outer() | c.all_outer() | d.all_outer()
    }

    /// Whether some point is certainly inside.
    #[inline(always)]
    fn any_inside(&self) -> T::Mask {
        let [a, b, c, d] = &self.0;
        let (a, b, c, d) = (&a.inner, &b.inner, &c.inner, &d.inner);
        (a[0] & b[0] & c[0] & d[0])
            | (a[1] & b[1] & c[1] & d[1])
            | (a[2] & b[2] & c[2] & d[2])
            | (a[3] & b[3] & c[3] & d[3])
    }
}

impl Sides {
    /// Whether the point is certainly outside.
    fn is_outside(&self, point: usize) -> bool {
        self.0.iter().any(|face| face.outer[point])
    }
}

/// What is known of the edges of one tetrahedron and the faces of the other.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Crossing {
    /// An edge certainly crosses a face.
    Certain,
    /// All edges certainly miss all faces.
    None,
    /// Neither.
    Unsure,
}

/// The edges of `points` against the faces of `k`, with the sides of `points` by these faces.
fn edges_cross(points: &[Point; 4], sides: &Sides, k: &[Point; 4]) -> Crossing {
    let mut crossing = Crossing::None;
    for [from, to] in EDGES {
        let (p, q) = (&points[from], &points[to]);
        // Most edges are outside of one face with both ends and miss the whole tetrahedron.
        if sides
            .0
            .iter()
            .any(|face| face.outer[from] && face.outer[to])
        {
            continue;
        }
        let along = difference(q, p);
        let corners = k.map(|corner| difference(&corner, p));
        for (face, FaceSides { inner, outer }) in FACES.iter().zip(&sides.0) {
            if inner[from] && inner[to] {
                continue;
            }
            // The line pq passes the three edges of the face on the same side, or misses it.
            let passes = [(0, 1), (1, 2), (2, 0)]
                .map(|(i, j)| Determinant::new(&along, &corners[face[i]], &corners[face[j]]));
            let [x, y, z] = passes;
            if x.is_opposite(y) || y.is_opposite(z) || z.is_opposite(x) {
                continue;
            }
            let apart = (inner[from] && outer[to]) || (outer[from] && inner[to]);
            if apart && x.is_same(y) && y.is_same(z) {
                return Crossing::Certain;
            }
            crossing = Crossing::Unsure;
        }
    }
    crossing
}
