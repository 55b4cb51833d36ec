//! When two moving elements are first within a distance.

use alloc::vec::Vec;

use crate::algebra::{
    Polynomial, PolynomialVector, Root, Roots, Time, cross, difference, dot, square_of_sum,
};
use crate::element_pair::ElementPair;
use crate::sweep::{Contact, SweptPolygon};
use crate::{Point, Sign, first_contact};

use super::are_within;
use super::filter::{self, Approach};

/// The first time at which the distance of two elements is at most `distance`, while their points
/// move from `start` to `end` on straight lines.
///
/// The time is rounded as in [`first_contact`], which answers for a distance of 0. `at_start` is
/// set if the elements are within the distance at t = 0. `None` if they never are, or if the
/// distance is NaN or below zero.
///
/// ```
/// use impinge_exact::{ElementPair, first_within};
/// let face = [[-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [-1.0, 2.0, 0.0]];
/// let at = |z: f64| [[0.0, 0.0, z], face[0], face[1], face[2]];
/// let contact = first_within(ElementPair::VertexFace, &at(3.0), &at(1.0), 2.0).unwrap();
/// assert!(contact.time == 0.5 && contact.is_exact);
/// ```
#[must_use]
pub fn first_within(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
    distance: f64,
) -> Option<Contact> {
    if distance == 0.0 {
        return first_contact(pair, start, end);
    }
    if distance.is_nan() || distance < 0.0 {
        return None;
    }
    match filter::approach(pair, start, end, distance, 1.0) {
        Approach::Apart => None,
        Approach::AtStart => Some(Contact::AT_START),
        Approach::Unsure if are_within(pair, start, distance) => Some(Contact::AT_START),
        Approach::Between(_) | Approach::Unsure => {
            first_within_by_roots(pair, start, end, distance)
        }
    }
}

/// [`first_within`] by exact arithmetic alone, for a finite distance above zero and elements that
/// are farther apart at the start.
pub(super) fn first_within_by_roots(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
    distance: f64,
) -> Option<Contact> {
    let (polygon, distance) = SweptPolygon::with_distance(pair.corners(), start, end, distance);
    let square = &distance * &distance;
    let corners = polygon.corners();
    let n = corners.len();
    let n_edges = if n > 2 { n } else { n - 1 };
    let edges: Vec<MovingEdge> = (0..n_edges)
        .map(|ix| MovingEdge::new(&corners[ix], &corners[(ix + 1) % n]))
        .collect();
    let mut times: Vec<Time> = Vec::new();
    for corner in corners {
        // |V|^2 - d^2
        let excess = &dot(corner, corner) - &square_of_sum().times(&square);
        times.extend(first_root(excess, |_| true));
    }
    for edge in &edges {
        // |V x E|^2 - d^2 |E|^2, where the nearest point of the line is on the edge.
        let along = dot(&edge.along, &edge.along).times(&square);
        let excess = &dot(&edge.moment, &edge.moment) - &along.product(&square_of_sum());
        times.extend(first_root(excess, |root| {
            root.sign_of(&edge.to_start) != Sign::Positive
                && root.sign_of(&edge.to_end) != Sign::Negative
                && !is_zero(root, &edge.along)
        }));
    }
    if n > 2 {
        // f^2 - d^2 |N|^2, where the nearest point of the plane is in the polygon.
        let normal = cross(&edges[0].along, &edges[1].along);
        let f = dot(&normal, &corners[0]);
        let across = dot(&normal, &normal).times(&square);
        let excess = &f.product(&f) - &across.product(&square_of_sum());
        let sides: Vec<Polynomial> = edges
            .iter()
            .map(|edge| dot(&normal, &edge.moment))
            .collect();
        times.extend(first_root(excess, |root| {
            sides
                .iter()
                .all(|side| root.sign_of(side) != Sign::Negative)
                && !is_zero(root, &normal)
        }));
    }
    times.into_iter().reduce(Time::earlier).map(Contact::later)
}

/// The first root that is valid; `None` for a polynomial that is zero everywhere.
fn first_root(polynomial: Polynomial, mut is_valid: impl FnMut(&mut Root) -> bool) -> Option<Time> {
    if polynomial.is_zero() {
        return None;
    }
    Roots::of(polynomial).find_map(|mut root| is_valid(&mut root).then(|| root.floor()))
}

fn is_zero(root: &mut Root, vector: &PolynomialVector) -> bool {
    vector.iter().all(|x| root.sign_of(x).is_zero())
}

/// An edge of the polygon.
struct MovingEdge {
    along: PolynomialVector,
    /// Corner x edge.
    moment: PolynomialVector,
    /// Corner . edge: at most 0 where the origin's projection does not lie before the edge.
    to_start: Polynomial,
    /// Next corner . edge: at least 0 where the origin's projection does not lie after the edge.
    to_end: Polynomial,
}

impl MovingEdge {
    fn new(from: &PolynomialVector, to: &PolynomialVector) -> Self {
        let along = difference(to, from);
        Self {
            moment: cross(from, &along),
            to_start: dot(from, &along),
            to_end: dot(to, &along),
            along,
        }
    }
}
