//! Exact continuous collision: do two elements touch while their points move, and when first?
//!
//! What it does: takes two elements (vertex, edge or face) whose points move on straight lines at
//! constant speed over t in [0, 1], and decides whether there is a time at which they share a
//! point, without any tolerance. The first such time is an algebraic number; it is returned rounded
//! down to a float.
//!
//! How: at each time two elements share a point if and only if the origin lies in their *difference
//! polygon*: a point, a segment, a triangle or a parallelogram, whose corners move linearly. When
//! its plane passes through the origin, a cubic f in t is zero. The signs of three or four quartics
//! then say whether the origin is inside. If f is zero at all times, the first contact is on an
//! edge of the polygon, at a root of a quadratic.
//!
//! In: the positions of the points at the start and at the end. Out: `None`, or a [`Contact`].
//! Cost: nearly always a few microseconds, and much less for most pairs that do not touch.
//!
//! Invariant: `contact.time <= t < contact.time.next_up()` for the exact first time t. Degenerate
//! elements are the segments and points that they are; touching counts, at t = 1 as well, and so
//! does contact over a whole interval.
//!
//! `docs/exactness.md`, "Continuous collision", has the proofs.

mod polygon;
mod shift;
#[cfg(test)]
pub(crate) mod tests;

use super::Point;
use super::algebra::Time;
use super::element_pair::ElementPair;
use super::filter::{Next, contact_answer, search_contact};
use super::rounding::round_down;
use super::segment::segments_intersect;
use super::triangle::segment_meets_triangle;
pub(super) use polygon::SweptPolygon;

/// The first time at which two moving elements share a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The first time, in [0, 1], rounded down: the largest `f64` that is not above it.
    ///
    /// 0 if the elements touch at the start, or if the first time is below the smallest positive
    /// `f64`.
    pub time: f64,
    /// Whether `time` is the first time exactly, not rounded.
    pub is_exact: bool,
    /// Whether the elements touch at the start, at t = 0.
    pub at_start: bool,
}

impl Contact {
    /// Contact at t = 0.
    pub const AT_START: Self = Self {
        time: 0.0,
        is_exact: true,
        at_start: true,
    };

    /// The first time rounded down to `f32`: the largest `f32` that is not above it.
    #[inline]
    #[must_use]
    pub fn time_f32(&self) -> f32 {
        round_down(self.time)
    }

    /// Whether the elements touch at some time up to and including `end`.
    #[inline]
    #[must_use]
    pub fn is_within(&self, end: f64) -> bool {
        self.time < end || (self.is_exact && self.time == end)
    }

    pub(super) fn later(time: Time) -> Self {
        Self {
            time: time.floor,
            is_exact: time.is_exact,
            at_start: false,
        }
    }
}

/// The first time at which two elements share a point while their points move from `start` to `end`
/// on straight lines.
///
/// `None` if they share no point at any time in [0, 1]. The points and their order are those of the
/// [`ElementPair`]. Exact for finite coordinates; unspecified for others, but never a panic.
///
/// ```
/// use impinge_exact::{ElementPair, first_contact};
/// let face = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let at = |z: f64| [[0.25, 0.25, z], face[0], face[1], face[2]];
/// let contact = first_contact(ElementPair::VertexFace, &at(1.0), &at(-2.0)).unwrap();
/// assert!(contact.time <= 1.0 / 3.0 && 1.0 / 3.0 < contact.time.next_up() && !contact.at_start);
/// assert!(first_contact(ElementPair::VertexFace, &at(1.0), &at(1e-40)).is_none());
/// assert_eq!(first_contact(ElementPair::VertexFace, &at(1.0), &at(0.0)).unwrap().time, 1.0);
/// ```
#[must_use]
pub fn first_contact(pair: ElementPair, start: &[Point; 4], end: &[Point; 4]) -> Option<Contact> {
    if is_apart_on_an_axis(pair, start, end) || !are_finite(pair, start, end) {
        return None;
    }
    match search_contact(pair, start, end) {
        (Next::Apart, _) => None,
        // One root of f lies between these times, which are not roots: it is the first contact.
        (Next::Contact, [low, high]) => {
            let polygon = SweptPolygon::new(pair.corners(), start, end);
            Some(Contact::later(polygon.time_between(low, high)))
        }
        _ => first_contact_by_roots(pair, start, end),
    }
}

/// [`first_contact`] by exact arithmetic alone.
fn first_contact_by_roots(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
) -> Option<Contact> {
    if touch(pair, start) {
        return Some(Contact::AT_START);
    }
    shift::first_time(pair.corners(), start, end)
        .unwrap_or_else(|| SweptPolygon::new(pair.corners(), start, end).first_time())
        .map(Contact::later)
}

/// Whether two elements share a point at some time in [0, 1]: [`first_contact`] without the time,
/// and faster.
#[must_use]
pub fn touch_during(pair: ElementPair, start: &[Point; 4], end: &[Point; 4]) -> bool {
    if is_apart_on_an_axis(pair, start, end) || !are_finite(pair, start, end) {
        return false;
    }
    contact_answer(pair, start, end)
        .unwrap_or_else(|| touch(pair, end) || first_contact_by_roots(pair, start, end).is_some())
}

/// Whether two elements share a point at one moment.
///
/// The points and their order are those of the [`ElementPair`]. Exact for finite coordinates.
#[must_use]
pub fn touch(pair: ElementPair, points: &[Point; 4]) -> bool {
    let [p, q, r, s] = points;
    match pair {
        ElementPair::VertexVertex => p == q,
        ElementPair::VertexEdge => segments_intersect(p, p, q, r),
        ElementPair::VertexFace => segment_meets_triangle(p, p, &[*q, *r, *s]),
        ElementPair::EdgeEdge => segments_intersect(p, q, r, s),
    }
}

/// Whether on some axis one element is strictly before the other at the start and at the end. Then
/// it is so at all times between. Uses only comparisons, so it is exact for all numbers.
fn is_apart_on_an_axis(pair: ElementPair, start: &[Point; 4], end: &[Point; 4]) -> bool {
    let corners = pair.corners();
    (0..3).any(|axis| {
        let below = |points: &[Point; 4], i: usize, j: usize| points[i][axis] < points[j][axis];
        corners
            .iter()
            .all(|&[i, j]| below(start, i, j) && below(end, i, j))
            || corners
                .iter()
                .all(|&[i, j]| below(start, j, i) && below(end, j, i))
    })
}

fn are_finite(pair: ElementPair, start: &[Point; 4], end: &[Point; 4]) -> bool {
    let n = pair.n_points();
    start[..n]
        .iter()
        .chain(&end[..n])
        .flatten()
        .all(|x| x.is_finite())
}
