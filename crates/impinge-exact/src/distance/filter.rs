//! Distances in `f64` with bounds: most pairs are settled here.

use super::features::PolygonPart;
use super::reach::Reach;
use crate::Point;
use crate::element_pair::ElementPair;
use crate::filter::motion::{difference, dot};
use crate::filter::nearness::{Polygon, are_beyond, beyond, most, stay_beyond};
use crate::filter::number::Number;
use crate::rounding::{root, to_usual_size};

/// Whether two elements are within a distance; `None` when unsure.
///
/// No, if the whole difference polygon lies beyond a plane that is farther from the origin than the
/// reach. Yes, if some point of the polygon is nearer than the reach.
pub(super) fn answer(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> Option<bool> {
    let between = [reach.low, reach.high];
    answer_as_given(pair, points, between).or_else(|| {
        let scaled = Scaled::of([points])?;
        answer_as_given(pair, &scaled.ends[0], scaled.lengths(between)?)
    })
}

fn answer_as_given(pair: ElementPair, points: &[Point; 4], [low, high]: [f64; 2]) -> Option<bool> {
    let (yes, no) = Polygon::of_pair(pair, points).verdict(low, high);
    if yes { Some(true) } else { no.then_some(false) }
}

/// Two numbers between which the distance of two elements certainly is; none where sizes are out of
/// range.
pub(super) fn bounds(pair: ElementPair, points: &[Point; 4]) -> Option<[f64; 2]> {
    let bounds = bounds_as_given(pair, points);
    if bounds.is_some_and(|[low, _]| low > 0.0) {
        return bounds;
    }
    let of_scaled = || {
        let scaled = Scaled::of([points])?;
        scaled.lengths_back(bounds_as_given(pair, &scaled.ends[0])?)
    };
    of_scaled().or(bounds)
}

fn bounds_as_given(pair: ElementPair, points: &[Point; 4]) -> Option<[f64; 2]> {
    let (is_small, bounds) = Polygon::of_pair(pair, points).bounds();
    is_small.then_some(bounds)
}

/// Points of sizes that are out of range, all multiplied by one power of two, with which the
/// largest coordinate is about 1: distances are multiplied by it too, and times are the same.
struct Scaled<const N: usize> {
    ends: [[Point; 4]; N],
    factor: f64,
}

impl<const N: usize> Scaled<N> {
    /// None where sizes are in range, or where a coordinate would lose bits.
    fn of(ends: [&[Point; 4]; N]) -> Option<Self> {
        let factor = to_usual_size(&ends)?;
        let mut scaled = Scaled {
            ends: ends.map(|points| *points),
            factor,
        };
        let mut all = scaled.ends.as_flattened_mut().as_flattened_mut().iter_mut();
        all.all(|x| Self::multiply(x, factor)).then_some(scaled)
    }

    /// Whether the product is exact.
    fn multiply(x: &mut f64, factor: f64) -> bool {
        let before = *x;
        *x *= factor;
        *x / factor == before
    }

    /// Distances; none if one would lose bits.
    fn lengths(&self, lengths: [f64; 2]) -> Option<[f64; 2]> {
        Self::products(lengths, self.factor)
    }

    /// The distances of points before they were multiplied.
    fn lengths_back(&self, lengths: [f64; 2]) -> Option<[f64; 2]> {
        Self::products(lengths, 1.0 / self.factor)
    }

    fn products(mut lengths: [f64; 2], factor: f64) -> Option<[f64; 2]> {
        let mut all = lengths.iter_mut();
        all.all(|x| Self::multiply(x, factor)).then_some(lengths)
    }
}

/// When two moving elements are first within a distance, as far as plain floats can decide it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Approach {
    /// Not up to the time asked for.
    Apart,
    /// At the start.
    AtStart,
    /// After the first of these times, and not after the second.
    Between([f64; 2]),
    /// Exact arithmetic is needed.
    Unsure,
}

/// The most planes that are tried.
const N_PLANES: usize = 64;

/// The least time by which elements are looked at later: times are numbers from 0 to 1.
const LEAST_WIDTH: f64 = 2.0 * f64::EPSILON;

/// How often the elements are looked at where planes lead no farther, each time eight times as far
/// beyond.
const N_LOOKS: usize = 9;

/// Follows two elements from t = 0 to when they are within a distance, at most to `until`.
///
/// From a time at which they are certainly farther apart, time advances to where some corner of the
/// difference polygon reaches a plane at the distance from the origin, across the nearest point. Up
/// to then all corners are beyond that plane. As with Newton's method, the steps become shorter
/// fast, until rounding ends them; then the elements are certainly near a little later, unless they
/// only graze. How much later depends on how fast the nearest points come, which may be slower than
/// the corner that reaches the plane: so a few times are tried.
pub fn approach(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
    distance: f64,
    until: f64,
) -> Approach {
    let found = approach_as_given(pair, [start, end], distance, until);
    if found != Approach::Unsure {
        return found;
    }
    let of_scaled = || {
        let scaled = Scaled::of([start, end])?;
        let [start, end] = &scaled.ends;
        let [distance, _] = scaled.lengths([distance; 2])?;
        Some(approach_as_given(pair, [start, end], distance, until))
    };
    of_scaled().unwrap_or(found)
}

fn approach_as_given(
    pair: ElementPair,
    [start, end]: [&[Point; 4]; 2],
    distance: f64,
    until: f64,
) -> Approach {
    let (first, last) = (Polygon::of_pair(pair, start), Polygon::of_pair(pair, end));
    match first.verdict(distance, distance) {
        (true, _) => return Approach::AtStart,
        (_, true) => {}
        _ => return Approach::Unsure,
    }
    let largest = first.size().larger(last.size());
    if largest >= f64::LARGEST {
        return Approach::Unsure;
    }
    let goal = first.at(&last, until);
    if stay_beyond(&first, &goal, largest, distance) {
        return Approach::Apart;
    }
    let nearest_at = |time: f64| {
        let there = first.at(&last, time);
        there.nearest(&there.normal())
    };
    let is_near_at = |time: f64| distance > most(&nearest_at(time), largest);
    // How far a plane leads from a polygon at some time, and how much later the elements may be
    // near.
    let leads = |here: &Polygon, time: f64, normal: &Point| {
        // Beyond the bound by more than rounding, so that the next polygon is certainly beyond it.
        let [bound, error] = beyond(normal, largest, distance);
        let level = bound + 2.0 * error;
        let (mut next, mut speed) = (1.0, 0.0);
        for (from, to) in first.corners().iter().zip(last.corners()) {
            let (from, to) = (dot(normal, from), dot(normal, to));
            let reached = (from - level) / (from - to);
            if to < level && reached < next {
                (next, speed) = (reached, from - to);
            }
        }
        let there = first.at(&last, next);
        let is_later = time < next && next < 1.0;
        (is_later && are_beyond(normal, &[*here, there], largest, distance))
            .then(|| (next, there, f64::max(16.0 * error / speed, LEAST_WIDTH)))
    };
    let (mut time, mut here, mut width) = (0.0, first, LEAST_WIDTH);
    let mut before: Option<[f64; 2]> = None;
    for _ in 0..N_PLANES {
        let near = here.nearest(&here.normal());
        if are_beyond(&near, &[here, goal], largest, distance) {
            return Approach::Apart;
        }
        // A plane as it is at the contact turns no more until then. By how the gap has become
        // smaller, that is here:
        let gap = root(dot(&near, &near)) - distance;
        let guess = before.map(|[then, wide]| time + gap * (time - then) / (wide - gap));
        let ahead = guess
            .filter(|&guess| time < guess && guess < 1.0)
            .and_then(|guess| leads(&here, time, &nearest_at(guess)));
        let Some((next, there, least_width)) = ahead.or_else(|| leads(&here, time, &near)) else {
            break;
        };
        width = least_width;
        let later = f64::min(next + width, 1.0);
        if is_near_at(later) {
            return Approach::Between([next, later]);
        }
        before = Some([time, gap]);
        (time, here) = (next, there);
    }
    for _ in 0..N_LOOKS {
        let later = f64::min(time + width, 1.0);
        if is_near_at(later) {
            return Approach::Between([time, later]);
        }
        width *= 8.0;
    }
    Approach::Unsure
}

/// The part of the polygon with the nearest point in its inside, if signs of rounded values can
/// decide it.
///
/// As the exact decision goes by signs (`Polygon::nearest`), with none of them zero.
pub(super) fn nearest_part(pair: ElementPair, points: &[Point; 4]) -> Option<PolygonPart> {
    PolygonPart::numbered(part_number(pair, points))
}

/// The number of that part; of no part, if signs cannot decide it.
pub(super) fn part_number(pair: ElementPair, points: &[Point; 4]) -> u8 {
    let n = pair.corners().len();
    let mut edges = [[0.0; 3]; 4];
    for (ix, edge) in edges.iter_mut().enumerate().take(n) {
        *edge = edge_of(pair, points, ix);
    }
    let bits = Polygon::of_pair(pair, points).nearest_part(&edges);
    bits.iter()
        .rev()
        .fold(0, |number, &bit| 2 * number + u8::from(bit))
}

/// From a corner of the polygon to the next: a difference of two points, rounded once.
fn edge_of(pair: ElementPair, points: &[Point; 4], ix: usize) -> Point {
    let [from, to] = edge_ends(pair, ix);
    difference(&points[to], &points[from])
}

/// Between which points a corner of the polygon leads to the next.
#[inline]
pub(super) fn edge_ends(pair: ElementPair, ix: usize) -> [usize; 2] {
    let numbers = pair.corners();
    let ([i, j], [k, l]) = (numbers[ix], numbers[(ix + 1) % numbers.len()]);
    if i == k { [l, j] } else { [i, k] }
}
