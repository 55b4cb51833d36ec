//! Two elements by their surfaces: where they meet, and how far apart they are.

use impinge_exact::Point;
use impinge_exact::internal::{closest_of_elements, distance_under};

use crate::scene::elements::BodyKind;
use crate::search::narrow::intersect;

/// A point that two elements share which intersect, rounded: where their borders or surfaces meet;
/// else, as one is inside the other, a corner of the inner one.
pub(super) fn shared_point(kinds: [BodyKind; 2], corners: [&[Point; 4]; 2]) -> Point {
    let [of_a, of_b] = [0, 1].map(|side| surface(kinds[side], corners[side]));
    for (a, n_a) in &of_a {
        for (b, n_b) in &of_b {
            let (_, distance, points) = closest_of_elements(&a[..*n_a], &b[..*n_b]);
            if distance == 0.0 {
                return points[0];
            }
        }
    }
    let [a, b] = corners;
    let first_of_b = [b[0]; 4];
    match intersect(kinds[0], a, BodyKind::Points, &first_of_b) {
        true => b[0],
        false => a[0],
    }
}

/// The distance of two elements that do not meet, rounded down to the largest `f64` that is not
/// above it, if that is below a limit.
pub(super) fn exact_distance(
    kinds: [BodyKind; 2],
    corners: [&[Point; 4]; 2],
    limit: f64,
) -> Option<f64> {
    let [of_a, of_b] = [0, 1].map(|side| surface(kinds[side], corners[side]));
    let mut least = None;
    for (a, n_a) in &of_a {
        for (b, n_b) in &of_b {
            let limit = least.unwrap_or(limit);
            least = distance_under(&a[..*n_a], &b[..*n_b], limit).or(least);
        }
    }
    least
}

/// The faces of a tetrahedron; any other element itself. Each with how many corners it has.
fn surface(kind: BodyKind, &[p, q, r, s]: &[Point; 4]) -> Vec<([Point; 3], usize)> {
    match kind {
        BodyKind::Tetrahedra => [[p, q, r], [p, q, s], [p, r, s], [q, r, s]]
            .map(|face| (face, 3))
            .to_vec(),
        kind => vec![([p, q, r], kind.n_corners())],
    }
}
