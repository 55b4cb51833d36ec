//! Elements of which one moves against the other as a whole, without turning: the first contact in
//! integers of fixed width.
//!
//! What it does: where all corners of the difference polygon move by one vector, its edges E and
//! its normal N do not move, so f, w and V x E are linear in t. Each has one root, a fraction, and
//! the sign of another at it is that of a sum of two products.
//!
//! Cost: about 100 multiplications, nothing allocated. Layers of cloth that move against each other
//! consist of such pairs, and floats decide few of them.
//!
//! `docs/exactness.md`, "Continuous collision", has the proof and the bounds.

use crate::algebra::fixed::{Factor, Whole, WholeVector, Wide, cross, difference, dot};
use crate::algebra::{Time, Unit, floor_of_share};
use crate::{Point, Sign};

/// The first time in (0, 1] at which two elements share a point, provided that they do not at the
/// start. Corners are differences of points, each given by two numbers of points.
///
/// The outer `None`: not decided here.
#[allow(
    clippy::option_option,
    reason = "undecided, or an answer that may be none"
)]
pub(super) fn first_time(
    numbers: &[[usize; 2]],
    start: &[Point; 4],
    end: &[Point; 4],
) -> Option<Option<Time>> {
    let n = numbers.len();
    if n < 2 {
        return None;
    }
    let pairs: [_; 8] = core::array::from_fn(|ix| {
        let points = [start, end][ix / 4];
        numbers[ix % 4 % n].map(|ix| &points[ix])
    });
    let (_, corners) = Unit::differences(pairs, 0.0)?;
    let corners: [[WholeVector<i64>; 4]; 2] =
        [0, 4].map(|first| core::array::from_fn(|ix| corners[first + ix]));
    let shift = |ix: usize| difference(&corners[1][ix], &corners[0][ix]);
    if (1..n).any(|ix| shift(ix) != shift(0)) {
        return None;
    }
    let edge = |ix: usize| difference(&corners[0][(ix + 1) % n], &corners[0][ix]);
    let moments = |ix: usize| [0, 1].map(|at: usize| cross(&corners[at][ix], &edge(ix)));
    if n > 2 {
        let normal = cross(&edge(0), &edge(1));
        let heights = corners.map(|corners| dot(&normal, &corners[0].map(i128::from)));
        if heights.iter().any(|height| !height.sign().is_zero()) {
            return Some(TimeShare::of(&heights).and_then(|share| {
                let is_inside = (0..n).all(|ix| {
                    let sides = moments(ix).map(|moment| dot(&normal, &moment));
                    share.sign_of(&sides) != Sign::Negative
                });
                is_inside.then(|| share.floor())
            }));
        }
    }
    let mut first: Option<Time> = None;
    for ix in 0..if n > 2 { n } else { 1 } {
        let moments = moments(ix);
        let along = |axis: usize| moments.map(|moment| moment[axis]);
        // If the edge's line always has the origin, this is not decided here.
        let moving = (0..3).find(|&axis| along(axis) != [0, 0])?;
        let Some(share) = TimeShare::of(&along(moving)) else {
            continue;
        };
        let is_on_line = (0..3).all(|axis| share.sign_of(&along(axis)).is_zero());
        if is_on_line {
            let at = |ix: usize| share.blend([0, 1].map(|at: usize| corners[at][ix % n]));
            if dot(&at(ix), &at(ix + 1)).sign() != Sign::Positive {
                let time = share.floor();
                first = Some(first.map_or(time, |first| first.earlier(time)));
            }
        }
    }
    Some(first)
}

/// The root in (0, 1] of a linear function, as before / (before + after).
struct TimeShare<T> {
    /// Magnitude at the start; not 0.
    before: T,
    /// Magnitude at the end.
    after: T,
}

impl<T: Factor> TimeShare<T> {
    /// From the values at the start and at the end, not both 0.
    fn of([start, end]: &[T; 2]) -> Option<Self> {
        let (sign, sign_at_end) = (start.sign(), end.sign());
        if sign.is_zero() || sign == sign_at_end {
            return None;
        }
        Some(Self {
            before: magnitude(start),
            after: magnitude(end),
        })
    }

    /// The sign at this time of a linear function, given by its values at the start and at the end.
    fn sign_of(&self, [start, end]: &[T; 2]) -> Sign {
        let sum = start.product(&self.after).plus(&end.product(&self.before));
        sum.sign()
    }
}

impl TimeShare<Wide<4>> {
    fn floor(&self) -> Time {
        floor_of_share(&self.before, &self.after)
    }
}

impl TimeShare<i128> {
    fn floor(&self) -> Time {
        floor_of_share(&self.before.widened(), &self.after.widened())
    }

    /// A moving point at this time, times a positive number.
    fn blend(&self, [start, end]: [WholeVector<i64>; 2]) -> WholeVector<Wide<4>> {
        core::array::from_fn(|k| {
            let [start, end] = [start[k], end[k]].map(i128::from);
            start.product(&self.after).plus(&end.product(&self.before))
        })
    }
}

fn magnitude<T: Whole>(x: &T) -> T {
    if x.sign() == Sign::Negative {
        x.minus(x).minus(x)
    } else {
        x.clone()
    }
}
