//! Tetrahedron against tetrahedron.

use super::determinant::{Determinant, Normal, difference};
use super::number::{Number, Vector, load_vertex};
use super::{LANES, Point, Tetrahedra8, TetrahedronPairs8, Verdict};

/// Which lanes are certainly apart because a face of one separates them, and which certainly
/// intersect because one has a vertex inside the other.
///
/// The cheap first step. Unsure lanes, including those that only cross at edges, go to
/// [`classify_tetrahedra`]. About 900 operations for all eight lanes, without a branch.
#[inline(always)]
#[must_use]
pub fn classify_by_faces<V: Vector>(pairs: &TetrahedronPairs8) -> Verdict {
    let mut verdict = Verdict::default();
    for first in (0..LANES).step_by(V::N) {
        let (a, b) = (load::<V>(&pairs.a, first), load::<V>(&pairs.b, first));
        let (of_a, of_b) = (TetrahedronSides::new(&b, &a), TetrahedronSides::new(&a, &b));
        verdict.yes |= V::bits(of_a.any_inside() | of_b.any_inside()) << first;
        verdict.no |= V::bits(of_a.parted_by_face() | of_b.parted_by_face()) << first;
    }
    verdict
}

/// Which lanes certainly intersect and which certainly do not, by faces and by edges.
///
/// The reasons are those of `tetrahedra_answer`. Each of the 36 determinants of two edges is used
/// twice: for the edge of a against faces of b, and for the edge of b against faces of a. About
/// 3,000 operations.
#[inline(always)]
#[must_use]
pub fn classify_tetrahedra<V: Vector>(pairs: &TetrahedronPairs8) -> Verdict {
    let mut verdict = Verdict::default();
    for first in (0..LANES).step_by(V::N) {
        let (a, b) = (load::<V>(&pairs.a, first), load::<V>(&pairs.b, first));
        let (of_a, of_b) = (TetrahedronSides::new(&b, &a), TetrahedronSides::new(&a, &b));
        let passes = EdgePasses::new(&a, &b);
        let (a_crosses, a_may) = passes.crossings(&of_a);
        let (b_crosses, b_may) = passes.turned().crossings(&of_b);
        let meet = of_a.any_inside() | of_b.any_inside() | a_crosses | b_crosses;
        let parted = of_a.parted_by_face() | of_b.parted_by_face();
        let missed = !a_may & !b_may & of_a.is_first_outside() & of_b.is_first_outside();
        verdict.yes |= V::bits(meet) << first;
        verdict.no |= V::bits(parted | (missed & !meet)) << first;
    }
    verdict
}

/// On which side each edge of one tetrahedron passes each edge of the other, where that is certain:
/// `[edge][edge of the other]`.
struct EdgePasses<T: Number> {
    positive: [[T::Mask; 6]; 6],
    negative: [[T::Mask; 6]; 6],
}

impl<T: Number> EdgePasses<T> {
    #[inline(always)]
    fn new(a: &[[T; 3]; 4], b: &[[T; 3]; 4]) -> Self {
        let none = T::splat(0.0).gt(T::splat(0.0));
        let mut passes = EdgePasses {
            positive: [[none; 6]; 6],
            negative: [[none; 6]; 6],
        };
        for (edge, [from, to]) in EDGES.into_iter().enumerate() {
            let along = difference(&a[to], &a[from]);
            let corners = [
                difference(&b[0], &a[from]),
                difference(&b[1], &a[from]),
                difference(&b[2], &a[from]),
                difference(&b[3], &a[from]),
            ];
            // No edge starts at the last vertex.
            let normals = [
                Normal::new(&along, &corners[0]),
                Normal::new(&along, &corners[1]),
                Normal::new(&along, &corners[2]),
            ];
            for (other, [i, j]) in EDGES.into_iter().enumerate() {
                let determinant = normals[i].dot(&corners[j]);
                passes.positive[edge][other] = determinant.is_positive();
                passes.negative[edge][other] = determinant.is_negative();
            }
        }
        passes
    }

    /// The table as seen from the other tetrahedron: exchanging two edges keeps the sign of their
    /// determinant.
    #[inline(always)]
    fn turned(&self) -> Self {
        let mut turned = EdgePasses {
            positive: self.positive,
            negative: self.negative,
        };
        for edge in 0..6 {
            for other in 0..6 {
                turned.positive[other][edge] = self.positive[edge][other];
                turned.negative[other][edge] = self.negative[edge][other];
            }
        }
        turned
    }

    /// Whether an edge certainly crosses a face of the other tetrahedron, and whether one may.
    /// `sides`: where the edges' ends lie relative to these faces.
    #[inline(always)]
    fn crossings(&self, sides: &TetrahedronSides<T>) -> (T::Mask, T::Mask) {
        let none = T::splat(0.0).gt(T::splat(0.0));
        let (mut certain, mut possible) = (none, none);
        for (edge, [from, to]) in EDGES.into_iter().enumerate() {
            let (positive, negative) = (&self.positive[edge], &self.negative[edge]);
            let (mut edge_certain, mut edge_possible, mut outside) = (none, none, none);
            for (face, edges) in sides.0.iter().zip(FACE_EDGES) {
                let FaceSides { inner, outer } = face;
                outside = outside | (outer[from] & outer[to]);
                // The line passes the three edges of the face on the same side, or misses it.
                let [x, y, z] = edges;
                let (x, y, z) = (
                    x.signs(positive, negative),
                    y.signs(positive, negative),
                    z.signs(positive, negative),
                );
                let misses = (x.0 | y.0 | z.0) & (x.1 | y.1 | z.1);
                let hits = (x.0 & y.0 & z.0) | (x.1 & y.1 & z.1);
                let apart = (inner[from] & outer[to]) | (outer[from] & inner[to]);
                edge_certain = edge_certain | (apart & hits);
                edge_possible = edge_possible | !(misses | (inner[from] & inner[to]));
            }
            certain = certain | (edge_certain & !outside);
            possible = possible | (edge_possible & !outside);
        }
        (certain, possible)
    }
}

/// An edge of a face, as it runs around it.
#[derive(Clone, Copy)]
struct FaceEdge {
    edge: usize,
    backwards: bool,
}

impl FaceEdge {
    /// The lanes that certainly pass it on the positive side, and on the negative side.
    #[inline(always)]
    fn signs<M: Copy>(self, positive: &[M; 6], negative: &[M; 6]) -> (M, M) {
        match self.backwards {
            false => (positive[self.edge], negative[self.edge]),
            true => (negative[self.edge], positive[self.edge]),
        }
    }
}

/// The edges around each of [`FACES`].
const FACE_EDGES: [[FaceEdge; 3]; 4] = {
    const fn forth(edge: usize) -> FaceEdge {
        FaceEdge {
            edge,
            backwards: false,
        }
    }
    const fn back(edge: usize) -> FaceEdge {
        FaceEdge {
            edge,
            backwards: true,
        }
    }
    [
        [forth(4), back(5), back(3)],
        [forth(1), forth(5), back(2)],
        [forth(2), back(4), back(0)],
        [forth(0), forth(3), back(1)],
    ]
};

#[inline(always)]
fn load<V: Vector>([p, q, r, s]: &Tetrahedra8, first: usize) -> [[V; 3]; 4] {
    [
        load_vertex(p, first),
        load_vertex(q, first),
        load_vertex(r, first),
        load_vertex(s, first),
    ]
}

/// The answer for one pair, faces first, then edges; `None` when unsure.
///
/// A certain crossing of an edge with a face is a certain yes. If all edges certainly miss all
/// faces of the other, the surfaces share no point, and then either one tetrahedron is inside the
/// other, with all its vertices, or they are apart.
#[inline]
pub(crate) fn tetrahedra_answer(a: &[Point; 4], b: &[Point; 4]) -> Option<bool> {
    let of_b = TetrahedronSides::new(a, b);
    if of_b.parted_by_face() {
        return Some(false);
    }
    let of_a = TetrahedronSides::new(b, a);
    if of_a.parted_by_face() {
        return Some(false);
    }
    if of_a.any_inside() || of_b.any_inside() {
        return Some(true);
    }
    match (edges_cross(a, &of_a, b), edges_cross(b, &of_b, a)) {
        (Crossing::Certain, _) | (_, Crossing::Certain) => Some(true),
        (Crossing::None, Crossing::None) if of_a.is_first_outside() && of_b.is_first_outside() => {
            Some(false)
        }
        _ => None,
    }
}

/// The faces as vertex numbers; face k leaves out vertex k.
const FACES: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// The edges as vertex numbers.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Where the four points of one tetrahedron lie relative to the faces of the other.
struct TetrahedronSides<T: Number = f64>([FaceSides<T>; 4]);

/// Where four points lie relative to the plane of one face.
#[derive(Clone, Copy)]
struct FaceSides<T: Number = f64> {
    /// Whether a point is certainly on the side of the tetrahedron.
    inner: [T::Mask; 4],
    /// Whether a point is certainly on the other side.
    outer: [T::Mask; 4],
}

impl<T: Number> FaceSides<T> {
    /// Where `points` lie relative to face pqr of a tetrahedron with the fourth vertex `apex`.
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

impl<T: Number> TetrahedronSides<T> {
    /// Where `points` lie relative to the faces of `k`.
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

    /// Whether the first point is certainly outside.
    #[inline(always)]
    fn is_first_outside(&self) -> T::Mask {
        let [a, b, c, d] = &self.0;
        a.outer[0] | b.outer[0] | c.outer[0] | d.outer[0]
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

/// Whether edges of one tetrahedron cross faces of the other.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Crossing {
    /// An edge certainly crosses a face.
    Certain,
    /// All edges certainly miss all faces.
    None,
    /// Neither is certain.
    Unsure,
}

/// The edges of `points` against the faces of `k`. `sides`: where `points` lie relative to these
/// faces.
fn edges_cross(points: &[Point; 4], sides: &TetrahedronSides, k: &[Point; 4]) -> Crossing {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_around_faces_are_those_of_the_tables() {
        for (face, edges) in FACES.iter().zip(FACE_EDGES) {
            for (k, edge) in edges.iter().enumerate() {
                let [i, j] = EDGES[edge.edge];
                let expected = if edge.backwards { [j, i] } else { [i, j] };
                assert_eq!(expected, [face[k], face[(k + 1) % 3]]);
            }
        }
    }
}
