//! Exact distances: are two elements within a distance, which of their features are nearest, and when first?
//!
//! What it does: decides whether the Euclidean distance of two elements is at most d, without any tolerance: d is read
//! exactly and its square never rounded. Names the features (vertex, edge, face) that are nearest. Finds the first time
//! at which two moving elements are within d, rounded down as in [`first_contact`](super::first_contact).
//!
//! How: the distance of two elements is the distance of the origin from their difference polygon (see `exact::sweep`).
//! Signs of polynomials of degree four say whether the nearest point of this convex polygon is inside, on an edge or at
//! a corner. Then one comparison of degree six decides. Most pairs are settled before that by a nearest point in `f64`
//! and the plane through it.
//!
//! In: positions and d. Out: booleans, [`Nearest`], [`Contact`](super::Contact). Distances and points as `f64` are
//! rounded, but computed in one fixed order of operations, so they are the same everywhere.
//!
//! `docs/exactness.md`, "Distances", has the proofs.

mod filter;
mod moving;
mod nearest;
mod rounded;

use super::algebra::Integer;
use super::sweep::ElementPair;
use super::triangle::segment_meets_triangle;
use super::{Point, triangles_intersect};
pub use moving::first_within;
pub use nearest::{Feature, Nearest, nearest_features};
pub use rounded::{Closest, closest_points};

/// Whether the distance of two elements is at most `distance`.
///
/// The points and their order are those of the [`ElementPair`]. Closed: a distance of exactly `distance` counts, and with 0 the
/// elements must touch. Exact for coordinates and distances [`in_range`](super::in_range). False for a distance below zero or NaN, true for
/// infinity.
///
/// ```
/// use impinge::exact::{ElementPair, are_within};
/// let points = [[0.0, 0.0, 3.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
/// assert!(are_within(ElementPair::VertexFace, &points, 3.0));
/// assert!(!are_within(ElementPair::VertexFace, &points, 3.0_f64.next_down()));
/// ```
#[must_use]
pub fn are_within(pair: ElementPair, points: &[Point; 4], distance: f64) -> bool {
    if distance.is_nan() || distance < 0.0 {
        return false;
    }
    if distance == f64::INFINITY {
        return true;
    }
    filter::answer(pair, points, distance)
        .unwrap_or_else(|| nearest::are_within(pair, points, distance))
}

/// Whether the distance of an edge and a face is at most `distance`. See [`are_within`].
#[must_use]
pub fn edge_face_are_within(edge: &[Point; 2], face: &[Point; 3], distance: f64) -> bool {
    let [p, q] = edge;
    let [a, b, c] = face;
    // Where they do not meet, the shortest way between them starts at an end of the edge or ends on the face's border.
    distance >= 0.0
        && (segment_meets_triangle(p, q, face)
            || [p, q]
                .iter()
                .any(|v| are_within(ElementPair::VertexFace, &[**v, *a, *b, *c], distance))
            || EDGES.iter().any(|&[i, j]| {
                are_within(ElementPair::EdgeEdge, &[*p, *q, face[i], face[j]], distance)
            }))
}

/// Whether the distance of two faces is at most `distance`. See [`are_within`].
#[must_use]
pub fn faces_are_within(a: &[Point; 3], b: &[Point; 3], distance: f64) -> bool {
    let vertex_near = |a: &[Point; 3], b: &[Point; 3]| {
        a.iter()
            .any(|v| are_within(ElementPair::VertexFace, &[*v, b[0], b[1], b[2]], distance))
    };
    distance >= 0.0
        && (triangles_intersect(a, b)
            || vertex_near(a, b)
            || vertex_near(b, a)
            || EDGES.iter().any(|&[i, j]| {
                EDGES.iter().any(|&[k, l]| {
                    are_within(ElementPair::EdgeEdge, &[a[i], a[j], b[k], b[l]], distance)
                })
            }))
}

/// The edges of a face as vertex numbers.
const EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// A vector of integers.
type Vector = [Integer; 3];

fn difference(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &(&a[i] * &b[j]) - &(&a[j] * &b[i]))
}

fn dot(a: &Vector, b: &Vector) -> Integer {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}
