//! Tetrahedron against tetrahedron.

use super::Point;
use super::determinant::{Determinant, Normal, difference};

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
struct Sides([FaceSides; 4]);

/// Where four points lie by the plane of one face.
#[derive(Clone, Copy)]
struct FaceSides {
    /// Whether a point is certainly on the side of the tetrahedron.
    inner: [bool; 4],
    /// Whether a point is certainly on the other side.
    outer: [bool; 4],
}

impl FaceSides {
    /// `points` by the face pqr of a tetrahedron with the fourth vertex `apex`.
    #[inline(always)]
    fn new([p, q, r]: [&Point; 3], apex: &Point, points: &[Point; 4]) -> Self {
        let normal = Normal::new(&difference(q, p), &difference(r, p));
        let apex = normal.dot(&difference(apex, p));
        let [a, b, c, d] = points;
        let sides = [a, b, c, d].map(|point| normal.dot(&difference(point, p)));
        Self {
            inner: sides.map(|side| side.is_same(apex)),
            outer: sides.map(|side| side.is_opposite(apex)),
        }
    }
}

impl Sides {
    /// `points` by the faces of `k`.
    #[inline(always)]
    fn new([k0, k1, k2, k3]: &[Point; 4], points: &[Point; 4]) -> Self {
        Self([
            FaceSides::new([k1, k3, k2], k0, points),
            FaceSides::new([k0, k2, k3], k1, points),
            FaceSides::new([k0, k3, k1], k2, points),
            FaceSides::new([k0, k1, k2], k3, points),
        ])
    }

    /// Whether some face certainly has all points on its outer side.
    #[inline(always)]
    fn parted_by_face(&self) -> bool {
        let [a, b, c, d] = self.0.map(
            |FaceSides {
                 outer: [p, q, r, s],
                 ..
             }| p & q & r & s,
        );
        a | b | c | d
    }

    /// Whether some point is certainly inside.
    #[inline(always)]
    fn any_inside(&self) -> bool {
        let [a, b, c, d] = self.0.map(|face| face.inner);
        (a[0] & b[0] & c[0] & d[0])
            | (a[1] & b[1] & c[1] & d[1])
            | (a[2] & b[2] & c[2] & d[2])
            | (a[3] & b[3] & c[3] & d[3])
    }

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
