//! What [`nearness`](super::nearness) says of many pairs: of sixteen that two tables hold, or of
//! eight that are put side by side.

use super::motion::Vec3;
use super::moving::{are_edges, look_up, two_edges, vertex_and_face};
use super::nearness::{Polygon, edges_of, stay_beyond};
use super::number::{self, Lookup, load_points};
use super::{BATCH, LANES, Moving64, Points8, Spans8, Triangles64, Verdict16};
use crate::ElementPair;

/// Which of sixteen pairs are within a distance at the start. The elements are those of two groups,
/// named by their slots; the distance is between two numbers.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn are_within_in_tables<V: Lookup>(
    pair: ElementPair,
    groups: [&Moving64; 2],
    slots: [&[u8; BATCH]; 2],
    reach: [f32; 2],
) -> Verdict16 {
    let [low, high] = [V::splat(f64::from(reach[0])), V::splat(f64::from(reach[1]))];
    let mut verdict = Verdict16::default();
    for first in (0..BATCH).step_by(V::N) {
        let (are_edges, points) = points_of::<V>(pair, groups, slots, first, 0);
        let (yes, no) = Polygon::new(are_edges, &points).verdict(low, high);
        verdict.yes |= V::bits(yes) << first;
        verdict.no |= V::bits(no) << first;
    }
    verdict
}

/// Which of sixteen pairs are within a distance, and which parts of their difference polygons are
/// then nearest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Near16 {
    /// Which are within the distance.
    pub verdict: Verdict16,
    /// Bit after bit, from the lowest, of the number of a part: corner i is i, edge i is 4 + i, the
    /// face is 8. All bits are set where signs are not certain to tell, or no pair of the register
    /// is certainly near.
    pub parts: [u16; 4],
}

impl Near16 {
    /// The number of the nearest part of a lane.
    #[inline(always)]
    #[must_use]
    pub fn part(&self, lane: usize) -> u8 {
        let bit = |ix: usize| ((self.parts[ix] >> lane & 1) as u8) << ix;
        bit(0) | bit(1) | bit(2) | bit(3)
    }
}

/// The number of a part of the difference polygon of two edges, by its number where the edges
/// change slots.
///
/// ```text
///  corner 3 (a0, b1) --- edge 2 (a, b1) --- corner 2 (a1, b1)
///      |                                        |
///  edge 3 (a0, b)                           edge 1 (a1, b)
///      |                                        |
///  corner 0 (a0, b0) --- edge 0 (a, b0) --- corner 1 (a1, b0)
/// ```
pub const SWAPPED_PARTS: [u8; 16] = [0, 3, 2, 1, 7, 6, 5, 4, 8, 9, 10, 11, 12, 13, 14, 15];

/// Which of sixteen pairs are within a distance, and two numbers between which the distance of each
/// certainly is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounded16 {
    /// Which are within the distance.
    pub verdict: Verdict16,
    /// At most the distances; 0 where no pair of the register is certainly near.
    pub low: [f32; BATCH],
    /// At least the distances; infinite where no pair of the register is certainly near.
    pub high: [f32; BATCH],
}

/// As [`are_within_in_tables`], with bounds of the distances of pairs that are certainly near, and
/// two numbers for the distance of each pair.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn bounded_in_tables<V: Lookup>(
    pair: ElementPair,
    groups: [&Moving64; 2],
    slots: [&[u8; BATCH]; 2],
    reach: &[[f32; BATCH]; 2],
) -> Bounded16 {
    let mut bounded = Bounded16 {
        verdict: Verdict16::default(),
        low: [0.0; BATCH],
        high: [f32::INFINITY; BATCH],
    };
    for first in (0..BATCH).step_by(V::N) {
        let (are_edges, points) = points_of::<V>(pair, groups, slots, first, 0);
        let polygon = Polygon::new(are_edges, &points);
        let [least, most] = reach.each_ref().map(|of| V::row(of, first));
        let (yes, no) = polygon.verdict(least, most);
        let yes = V::bits(yes);
        bounded.verdict.yes |= yes << first;
        bounded.verdict.no |= V::bits(no) << first;
        if yes != 0 {
            let (_, [low, high]) = polygon.bounds();
            low.put(&mut bounded.low, first);
            high.put(&mut bounded.high, first);
        }
    }
    bounded
}

/// Two numbers between which the distance of each of eight pairs certainly is: 0 and infinity where
/// sizes are out of range. The same bits as those of one pair after the other.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn distance_bounds<V: number::Vector>(pair: ElementPair, points: &Points8) -> Spans8 {
    let mut bounds = Spans8::default();
    for first in (0..LANES).step_by(V::N) {
        let polygon = Polygon::of_pair(pair, &load_points::<V>(points, first));
        let (is_small, [low, high]) = polygon.bounds();
        let unknown = V::splat(f64::INFINITY);
        V::select(is_small, low, V::splat(0.0)).store(&mut bounds.low, first);
        V::select(is_small, high, unknown).store(&mut bounds.high, first);
    }
    bounds
}

/// Two numbers between which the distance of each of eight pairs certainly is, as
/// [`distance_bounds`] says, and the numbers of the nearest parts of their difference polygons, as
/// in `Near16`. The pairs are a vertex and a face each, or two edges.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn bounds_and_parts<V: number::Vector>(
    pair: ElementPair,
    points: &Points8,
) -> (Spans8, [u8; LANES]) {
    let bounds = distance_bounds::<V>(pair, points);
    let mut parts = [0; LANES];
    for first in (0..LANES).step_by(V::N) {
        let points = load_points::<V>(points, first);
        let are_edges = are_edges(pair);
        let polygon = Polygon::new(are_edges, &points);
        let bits = polygon.nearest_part(&edges_of(are_edges, &points));
        let bits = [
            V::bits(bits[0]),
            V::bits(bits[1]),
            V::bits(bits[2]),
            V::bits(bits[3]),
        ];
        for (ix, part) in parts[first..first + V::N].iter_mut().enumerate() {
            let bit = |of: usize| (bits[of] >> ix & 1) << of;
            *part = bit(0) | bit(1) | bit(2) | bit(3);
        }
    }
    (bounds, parts)
}

/// Two numbers between which the distances of sixteen faces from a point certainly are, lowest and
/// highest: 0 and infinity where sizes are out of range. The faces are those of a group, named by
/// their slots. The point's coordinates are finite.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn point_bounds_in_tables<V: Lookup>(
    point: &[f32; 3],
    faces: &Triangles64,
    slots: &[u8; BATCH],
) -> [[f32; BATCH]; 2] {
    let [mut lowest, mut highest] = [[0.0; BATCH]; 2];
    let [x, y, z] = *point;
    let point = [
        V::splat(f64::from(x)),
        V::splat(f64::from(y)),
        V::splat(f64::from(z)),
    ];
    for first in (0..BATCH).step_by(V::N) {
        let slots = V::slots(slots, first);
        let [q, r, s] = faces;
        let points = [
            point,
            look_up(q, slots),
            look_up(r, slots),
            look_up(s, slots),
        ];
        let (is_small, [low, high]) = Polygon::new(false, &points).bounds_of_triangle();
        V::select(is_small, low, V::splat(0.0)).put(&mut lowest, first);
        V::select(is_small, high, V::splat(f64::INFINITY)).put(&mut highest, first);
    }
    [lowest, highest]
}

/// As [`are_within_in_tables`], with the nearest parts of pairs that are certainly near, and two
/// numbers for the distance of each pair.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn nearest_in_tables<V: Lookup>(
    pair: ElementPair,
    groups: [&Moving64; 2],
    slots: [&[u8; BATCH]; 2],
    reach: &[[f32; BATCH]; 2],
) -> Near16 {
    let mut near = Near16::default();
    for first in (0..BATCH).step_by(V::N) {
        let (are_edges, points) = points_of::<V>(pair, groups, slots, first, 0);
        let polygon = Polygon::new(are_edges, &points);
        let [low, high] = reach.each_ref().map(|of| V::row(of, first));
        let (yes, no) = polygon.verdict(low, high);
        let yes = V::bits(yes);
        near.verdict.yes |= yes << first;
        near.verdict.no |= V::bits(no) << first;
        let all = u16::MAX >> (BATCH - V::N);
        let mut parts = [all; 4];
        if yes != 0 {
            let [odd, upper, border, face] = polygon.nearest_part(&edges_of(are_edges, &points));
            parts = [V::bits(odd), V::bits(upper), V::bits(border), V::bits(face)];
        }
        for (bits, part) in near.parts.iter_mut().zip(parts) {
            *bits |= part << first;
        }
    }
    near
}

/// Which of sixteen pairs certainly stay farther apart than a distance from t = 0 to `until`. The
/// elements are those of two groups, named by their slots; the distance is at most the number
/// given.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn stay_beyond_in_tables<V: Lookup>(
    pair: ElementPair,
    groups: [&Moving64; 2],
    slots: [&[u8; BATCH]; 2],
    until: f32,
    distance: f32,
) -> u16 {
    let (until, distance) = (V::splat(f64::from(until)), V::splat(f64::from(distance)));
    let mut stay = 0;
    for first in (0..BATCH).step_by(V::N) {
        let (are_edges, start) = points_of::<V>(pair, groups, slots, first, 0);
        let (_, end) = points_of::<V>(pair, groups, slots, first, 1);
        let start = Polygon::new(are_edges, &start);
        let end = Polygon::new(are_edges, &end);
        let last = start.at(&end, until);
        let largest = start.size().larger(end.size());
        stay |= V::bits(stay_beyond(&start, &last, largest, distance)) << first;
    }
    stay
}

#[inline(always)]
fn points_of<V: Lookup>(
    pair: ElementPair,
    [group_a, group_b]: [&Moving64; 2],
    [slots_a, slots_b]: [&[u8; BATCH]; 2],
    first: usize,
    end: usize,
) -> (bool, [Vec3<V>; 4]) {
    let (a, b) = (V::slots(slots_a, first), V::slots(slots_b, first));
    let are_edges = are_edges(pair);
    let points = if are_edges {
        two_edges::<V>(&group_a[end], a, &group_b[end], b)
    } else {
        vertex_and_face::<V>(&group_a[end], a, &group_b[end], b)
    };
    (are_edges, points)
}
