//! Exact distances: are two elements within a distance, which of their features are nearest, and
//! when first?
//!
//! What it does: decides whether the Euclidean distance of two elements is at most d, without any
//! tolerance: d is read exactly and its square never rounded. Names the features (vertex, edge,
//! face) that are nearest. Finds the first time at which two moving elements are within d, rounded
//! down as in [`first_contact`](super::first_contact).
//!
//! How: the distance of two elements is the distance of the origin from their difference polygon
//! (see `crate::sweep`). Signs of polynomials of degree four say whether the nearest point of this
//! convex polygon is inside, on an edge or at a corner. Then one comparison of degree six decides.
//! Most pairs are settled before that by a nearest point in `f64` and the plane through it.
//!
//! In: positions and d. Out: booleans, [`NearestFeatures`], [`Contact`](super::Contact). A distance
//! as `f64` is the largest that is not above the true one. Points are rounded, but computed in one
//! fixed order of operations, so they are the same everywhere.
//!
//! `docs/exactness.md`, "Distances", has the proofs.

mod apart;
mod by_part;
mod elements;
mod features;
mod filter;
mod keep;
mod moving;
mod nearest;
mod point;
mod reach;
mod rounded;
#[cfg(test)]
mod tests;

use super::Point;
use super::algebra::fixed::{WholeVector, cross, difference, dot};
use super::element_pair::ElementPair;
pub use apart::{shares_apart, shares_at_rest, shares_without_room};
pub use by_part::{PairAtPart, closest_by_part};
pub use elements::{NearestOfElements, are_within_certainly, elements_are_within};
pub use elements::{
    closest_of_elements, distance_under, elements_meet, gap_below, gap_by_bounds,
    nearest_of_elements, unsure_are_within,
};
pub use features::{Feature, NearestFeatures};
pub use filter::{Approach, approach};
pub use keep::Keep;
pub use moving::first_within;
pub use nearest::nearest_features;
pub use point::{compare_point_distances, nearest_part_of_element, paired, point_distance_bounds};
pub use reach::Reach;
pub use rounded::{NearestPoints, closest_points};

/// Whether the distance of two elements is at most `distance`.
///
/// The points and their order are those of the [`ElementPair`]. Closed: a distance of exactly
/// `distance` counts, and with 0 the elements must touch. Exact for finite coordinates. False for a
/// distance below zero or NaN, true for infinity.
///
/// ```
/// use impinge_exact::{ElementPair, are_within};
/// let points = [[0.0, 0.0, 3.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
/// assert!(are_within(ElementPair::VertexFace, &points, 3.0));
/// assert!(!are_within(ElementPair::VertexFace, &points, 3.0_f64.next_down()));
/// ```
#[must_use]
pub fn are_within(pair: ElementPair, points: &[Point; 4], distance: f64) -> bool {
    if !is_distance(distance) {
        return false;
    }
    if distance == f64::INFINITY {
        return true;
    }
    are_within_reach(pair, points, &Reach::from(distance))
}

fn are_within_reach(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> bool {
    filter::answer(pair, points, reach).unwrap_or_else(|| nearest::are_within(pair, points, reach))
}

/// Whether the distance of an edge and a face is at most `distance`. See [`are_within`].
#[must_use]
pub fn edge_face_are_within(edge: &[Point; 2], face: &[Point; 3], distance: f64) -> bool {
    is_distance(distance)
        && (distance == f64::INFINITY || elements_are_within(edge, face, &Reach::from(distance)))
}

/// Whether the distance of two faces is at most `distance`. See [`are_within`].
#[must_use]
pub fn faces_are_within(a: &[Point; 3], b: &[Point; 3], distance: f64) -> bool {
    is_distance(distance)
        && (distance == f64::INFINITY || elements_are_within(a, b, &Reach::from(distance)))
}

/// Whether a distance is a number of at least zero.
fn is_distance(distance: f64) -> bool {
    distance >= 0.0
}
