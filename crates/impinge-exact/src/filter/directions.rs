//! One element against a whole group: apart along a direction of either, 64 pairs at a time.
//!
//! What it does: a long triangle or edge that lies aslant has a box that holds far more than the
//! element. Where the boxes of many pairs of two groups overlap, the plane of a triangle, and the
//! directions across two edges, tell most of these pairs apart.
//!
//! In: for each element of a group its points in `f32`, the unit normal of a triangle or the unit
//! direction of an edge, and the span of a triangle along its normal, computed in `f64`
//! ([`Directions64`]). Out: bit masks. Cost: 70 operations for a register of pairs, without a table
//! look-up: two fifths of what a pair costs in [`classify_in_tables`](super::classify_in_tables).
//!
//! Method: any direction separates two elements whose spans along it are apart, so directions need
//! not be accurate. Two triangles are tested along the normal of either, and along the cross
//! product of their longest edges; two edges along the cross product of their directions, and along
//! the way from the line of the one to an end of the other. Before that, whole groups are tested
//! along the directions of one element of each ([`Directions64::near`]): clusters of long elements
//! are long themselves.
//!
//! Invariant: with L the largest coordinate of both groups and n a direction, a computed n . p is
//! wrong by less than 2^-20 L |n| + 2^-121, the rounding of p included. So spans that are farther
//! apart than a distance d along n, by more than 2^-19 L |n| + 2^-119, belong to elements that are
//! farther apart than d (`docs/exactness.md`, "Directions").

use super::TABLE;
use super::motion::{cross, difference, dot, size};
use super::number::{Lookup, Number};
use crate::Point;
use crate::rounding::root;

/// The elements of a group, and a direction of each: of triangles the normal, of edges their own.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Directions64 {
    /// Corners per element: 1 to 3. Lists of points past them mean nothing.
    n_corners: usize,
    /// Rounded to nearest: `[corner][axis][lane]`.
    points: [[[f32; TABLE]; 3]; 3],
    /// Of length 1, but for rounding; zero if the element has none.
    directions: [[f32; TABLE]; 3],
    /// Triangles only: the direction of the longest edge, of length 1, but for rounding; or zero.
    edges: [[f32; TABLE]; 3],
    /// Triangles only: the lowest and the highest n . p of their corners, rounded to nearest.
    spans: [[f32; TABLE]; 2],
    /// The largest coordinate.
    largest: f64,
}

/// The largest coordinate for which the bounds hold: nothing overflows.
const LARGEST: f64 = (1u64 << 32) as f64;
/// 2^-19.
const RELATIVE: f64 = 1.0 / (1u64 << 19) as f64;
/// 2^-119.
const ABSOLUTE: f64 = f64::from_bits((1023 - 119) << 52);
/// The squares of what is shorter lose digits to underflow, so that its length is not known.
const SHORTEST: f64 = f64::from_bits((1023 - 500) << 52);
/// Lengths of directions are wrong by less than this, relative to themselves.
const LONGER: f64 = 1.0 + 1.0 / (1u64 << 18) as f64;

impl Directions64 {
    /// A group without elements.
    pub const EMPTY: Self = Directions64 {
        n_corners: 0,
        points: [[[0.0; TABLE]; 3]; 3],
        directions: [[0.0; TABLE]; 3],
        edges: [[0.0; TABLE]; 3],
        spans: [[0.0; TABLE]; 2],
        largest: f64::INFINITY,
    };

    /// Prepares for elements of so many corners.
    #[inline]
    pub fn begin(&mut self, n_corners: usize) {
        self.n_corners = n_corners;
        self.largest = 0.0;
    }

    /// Puts an element into a lane. Elements of four corners and more have no directions.
    #[inline(always)]
    pub fn put<const N: usize>(&mut self, lane: usize, corners: &[Point; N]) {
        if N > 3 {
            self.largest = f64::INFINITY;
            return;
        }
        for (rows, corner) in self.points.iter_mut().zip(corners) {
            for (row, &x) in rows.iter_mut().zip(corner) {
                row[lane] = x as f32;
                self.largest = self.largest.max(x.abs());
            }
        }
        let direction = match N {
            2 => difference(&corners[1], &corners[0]),
            3 => cross(
                &difference(&corners[1], &corners[0]),
                &difference(&corners[2], &corners[0]),
            ),
            _ => return,
        };
        let unit = self::unit(&direction);
        if N == 3 {
            let ways = [(1, 0), (2, 0), (2, 1)].map(|(i, j)| difference(&corners[i], &corners[j]));
            let mut longest = &ways[0];
            for way in &ways[1..] {
                if dot(way, way) > dot(longest, longest) {
                    longest = way;
                }
            }
            put(&mut self.edges, lane, self::unit(longest));
        }
        let mut span = [f64::INFINITY, f64::NEG_INFINITY];
        for corner in corners {
            let along = dot(&unit.map(f64::from), corner);
            span = [span[0].min(along), span[1].max(along)];
        }
        put(&mut self.directions, lane, unit);
        for (row, x) in self.spans.iter_mut().zip(span) {
            row[lane] = x as f32;
        }
    }

    /// Whether the elements of two groups can be told apart: one group has triangles, or both have
    /// edges.
    #[inline(always)]
    #[must_use]
    pub fn can_part(&self, other: &Self) -> bool {
        let n_corners = [self.n_corners, other.n_corners];
        let have_directions = n_corners == [2, 2] || n_corners.contains(&3);
        have_directions && self.largest <= LARGEST && other.largest <= LARGEST
    }

    /// Which lanes of `among` are certainly farther than a distance from the element in lane `row`
    /// of another group. The two [can be told apart](Self::can_part).
    #[inline(always)]
    #[must_use]
    pub fn beyond<V: Lookup>(&self, among: u64, row: (&Self, usize), distance: f32) -> u64 {
        let (other, lane) = row;
        let largest = f64::max(self.largest, other.largest);
        let reach = above(f64::from(distance) + RELATIVE * largest);
        let mut apart = 0;
        for first in (0..TABLE).step_by(V::N) {
            if among >> first & (u64::MAX >> (TABLE - V::N)) == 0 {
                continue;
            }
            let is_apart = match (self.n_corners, other.n_corners) {
                (2, 2) => self.edges_beyond::<V>(first, other, lane, reach),
                (_, 3) if self.n_corners < 3 => self.points_beyond::<V>(first, other, lane, reach),
                (3, n) if n < 3 => self.planes_beyond::<V>(first, other, lane, reach),
                _ => {
                    self.points_beyond::<V>(first, other, lane, reach)
                        | self.planes_beyond::<V>(first, other, lane, reach)
                        | self.slivers_beyond::<V>(first, other, lane, reach)
                }
            };
            apart |= u64::from(V::bits(is_apart)) << first;
        }
        apart & among
    }

    /// Which elements lie beyond the plane of a triangle of another group.
    #[inline(always)]
    fn points_beyond<V: Lookup>(
        &self,
        first: usize,
        other: &Self,
        lane: usize,
        reach: f32,
    ) -> V::Mask {
        let span = widened(other.span::<V>(lane), reach);
        let points = [
            self.points_at::<V>(0, first),
            self.points_at::<V>(1, first),
            self.points_at::<V>(2, first),
        ];
        let points = &points[..self.n_corners];
        are_outside(&other.direction::<V>(lane), span, points)
    }

    /// Beyond the planes of which triangles the element of another group lies.
    #[inline(always)]
    fn planes_beyond<V: Lookup>(
        &self,
        first: usize,
        other: &Self,
        lane: usize,
        reach: f32,
    ) -> V::Mask {
        let [x, y, z] = &self.directions;
        let normals = [V::row(x, first), V::row(y, first), V::row(z, first)];
        let [low, high] = &self.spans;
        let span = widened([V::row(low, first), V::row(high, first)], reach);
        let points = [
            other.point::<V>(0, lane),
            other.point::<V>(1, lane),
            other.point::<V>(2, lane),
        ];
        are_outside(&normals, span, &points[..other.n_corners])
    }

    /// Which edges are apart from an edge of another group, along two directions across that one.
    #[inline(always)]
    fn edges_beyond<V: Lookup>(
        &self,
        first: usize,
        other: &Self,
        lane: usize,
        reach: f32,
    ) -> V::Mask {
        let [x, y, z] = &self.directions;
        let own = [V::row(x, first), V::row(y, first), V::row(z, first)];
        let ends = [self.points_at::<V>(0, first), self.points_at::<V>(1, first)];
        let others = [other.point::<V>(0, lane), other.point::<V>(1, lane)];
        let direction = other.direction::<V>(lane);
        let way = difference(&ends[0], &others[0]);
        let along = dot(&way, &direction);
        let across = [
            way[0] - along * direction[0],
            way[1] - along * direction[1],
            way[2] - along * direction[2],
        ];
        are_apart_along(&cross(&direction, &own), &ends, &others, reach)
            | are_apart_along(&across, &ends, &others, reach)
    }

    /// Which triangles are apart from a triangle of another group, across the longest edges of
    /// both.
    #[inline(always)]
    fn slivers_beyond<V: Lookup>(
        &self,
        first: usize,
        other: &Self,
        lane: usize,
        reach: f32,
    ) -> V::Mask {
        let [x, y, z] = &self.edges;
        let own = [V::row(x, first), V::row(y, first), V::row(z, first)];
        let [x, y, z] = &other.edges;
        let edge = [splat(x[lane]), splat(y[lane]), splat(z[lane])];
        let points = [
            self.points_at::<V>(0, first),
            self.points_at::<V>(1, first),
            self.points_at::<V>(2, first),
        ];
        let others = [
            other.point::<V>(0, lane),
            other.point::<V>(1, lane),
            other.point::<V>(2, lane),
        ];
        are_apart_along(&cross(&edge, &own), &points, &others, reach)
    }

    /// Of the lanes of two groups that [can be told apart](Self::can_part), those that may be near
    /// the other group: all others are certainly farther than a distance from each of `lanes`
    /// there. Cost: 60 operations on registers for each of three directions.
    #[inline(always)]
    #[must_use]
    pub fn near<V: Lookup>(&self, other: &Self, lanes: [u64; 2], distance: f32) -> [u64; 2] {
        let mut lanes = lanes;
        let groups = [self, other];
        let largest = f64::max(self.largest, other.largest);
        let reach = above(f64::from(distance) + RELATIVE * largest);
        for which in 0..3 {
            if lanes.contains(&0) {
                return [0; 2];
            }
            let firsts = lanes.map(|lanes| lanes.trailing_zeros() as usize);
            let axis = match which {
                2 if self.n_corners.min(other.n_corners) > 1 => {
                    let [a, b] = [0, 1].map(|k| groups[k].long(firsts[k]).map(f64::from));
                    unit(&cross(&a, &b))
                }
                side if side < 2 && groups[side].n_corners == 3 => groups[side]
                    .directions
                    .each_ref()
                    .map(|row| row[firsts[side]]),
                _ => continue,
            };
            // Not `map`: a closure that it does not inline would be compiled without the
            // instruction set.
            let spans = [self.along::<V>(&axis), other.along::<V>(&axis)];
            let whole = [0, 1].map(|k| spans[k].of(lanes[k]));
            for k in 0..2 {
                lanes[k] &= spans[k].meeting::<V>(whole[1 - k], reach);
            }
        }
        lanes
    }

    /// The direction of a long edge of an element.
    #[inline(always)]
    fn long(&self, lane: usize) -> [f32; 3] {
        let rows = match self.n_corners {
            3 => &self.edges,
            _ => &self.directions,
        };
        rows.each_ref().map(|row| row[lane])
    }

    /// The spans of all elements along a direction of length 1 or 0.
    #[inline(always)]
    fn along<V: Lookup>(&self, axis: &[f32; 3]) -> Spans {
        let axis = [splat::<V>(axis[0]), splat(axis[1]), splat(axis[2])];
        let mut spans = Spans([[0.0; TABLE]; 2]);
        for first in (0..TABLE).step_by(V::N) {
            let mut low = dot(&axis, &self.points_at::<V>(0, first));
            let mut high = low;
            for corner in 1..self.n_corners {
                let along = dot(&axis, &self.points_at::<V>(corner, first));
                (low, high) = (low.smaller(along), high.larger(along));
            }
            low.put(&mut spans.0[0], first);
            high.put(&mut spans.0[1], first);
        }
        spans
    }

    #[inline(always)]
    fn points_at<V: Lookup>(&self, corner: usize, first: usize) -> [V; 3] {
        let [x, y, z] = &self.points[corner];
        [V::row(x, first), V::row(y, first), V::row(z, first)]
    }

    #[inline(always)]
    fn point<V: Lookup>(&self, corner: usize, lane: usize) -> [V; 3] {
        let [x, y, z] = &self.points[corner];
        [splat(x[lane]), splat(y[lane]), splat(z[lane])]
    }

    #[inline(always)]
    fn direction<V: Lookup>(&self, lane: usize) -> [V; 3] {
        let [x, y, z] = &self.directions;
        [splat(x[lane]), splat(y[lane]), splat(z[lane])]
    }

    #[inline(always)]
    fn span<V: Lookup>(&self, lane: usize) -> [V; 2] {
        [splat(self.spans[0][lane]), splat(self.spans[1][lane])]
    }
}

/// The spans of the elements of a group along some direction.
#[repr(C, align(64))]
struct Spans([[f32; TABLE]; 2]);

impl Spans {
    /// The span of some elements together.
    #[inline(always)]
    fn of(&self, lanes: u64) -> [f32; 2] {
        let [lows, highs] = &self.0;
        let mut span = [f32::INFINITY, f32::NEG_INFINITY];
        let mut left = lanes;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            span = [span[0].min(lows[lane]), span[1].max(highs[lane])];
        }
        span
    }

    /// The elements whose spans come near a span.
    #[inline(always)]
    fn meeting<V: Lookup>(&self, [low, high]: [f32; 2], reach: f32) -> u64 {
        let [low, high] = widened([splat::<V>(low), splat::<V>(high)], reach);
        let mut lanes = 0;
        for first in (0..TABLE).step_by(V::N) {
            let is_above = V::row(&self.0[0], first).gt(high);
            let is_below = low.gt(V::row(&self.0[1], first));
            lanes |= u64::from(V::bits(!(is_above | is_below))) << first;
        }
        lanes
    }
}

/// Of length 1, but for rounding; zero if the length is not known.
#[inline(always)]
fn unit(direction: &Point) -> [f32; 3] {
    let length = root(dot(direction, direction));
    match length > SHORTEST && length < f64::INFINITY {
        true => direction.map(|x| (x / length) as f32),
        false => [0.0; 3],
    }
}

#[inline(always)]
fn put(rows: &mut [[f32; TABLE]; 3], lane: usize, direction: [f32; 3]) {
    for (row, x) in rows.iter_mut().zip(direction) {
        row[lane] = x;
    }
}

#[inline(always)]
fn splat<V: Number>(x: f32) -> V {
    V::splat(f64::from(x))
}

/// A number in `f32` that is not below.
#[inline(always)]
fn above(x: f64) -> f32 {
    ((x + ABSOLUTE) * LONGER) as f32
}

#[inline(always)]
fn widened<V: Number>([low, high]: [V; 2], reach: f32) -> [V; 2] {
    [low - splat(reach), high + splat(reach)]
}

/// Whether all of some points lie above a span along a direction, or all below it.
#[inline(always)]
fn are_outside<V: Number>(direction: &[V; 3], [low, high]: [V; 2], points: &[[V; 3]]) -> V::Mask {
    let zero = V::splat(0.0);
    let (mut above, mut below) = (!zero.gt(zero), !zero.gt(zero));
    for point in points {
        let along = dot(direction, point);
        above = above & along.gt(high);
        below = below & low.gt(along);
    }
    above | below
}

/// Whether the spans of two elements along some direction are farther apart than `reach`.
#[inline(always)]
fn are_apart_along<V: Number, const N: usize>(
    direction: &[V; 3],
    a: &[[V; 3]; N],
    b: &[[V; 3]; N],
    reach: f32,
) -> V::Mask {
    let length = dot(direction, direction).sqrt() * V::splat(LONGER);
    let bound = splat::<V>(reach) * length + V::splat(ABSOLUTE);
    let [low_a, high_a] = span(direction, a);
    let [low_b, high_b] = span(direction, b);
    let before = low_b - high_a;
    let after = low_a - high_b;
    // The squares of shorter ones underflow.
    size(direction).gt(V::splat(V::SHORTEST)) & (before.gt(bound) | after.gt(bound))
}

/// The lowest and the highest of some points along a direction.
#[inline(always)]
fn span<V: Number, const N: usize>(direction: &[V; 3], points: &[[V; 3]; N]) -> [V; 2] {
    let first = dot(direction, &points[0]);
    let mut span = [first, first];
    for point in &points[1..] {
        let along = dot(direction, point);
        span = [span[0].smaller(along), span[1].larger(along)];
    }
    span
}

#[cfg(test)]
mod tests {
    use super::super::number::Portable32;
    use super::*;
    use crate::internal::{Reach, elements_are_within};
    use crate::triangles_intersect;
    use impinge_testing::random::Random;

    /// Long elements of so many corners, some of them degenerate, in a space of some size.
    fn group<const N: usize>(random: &mut Random, size: f64, far: f64) -> Vec<[Point; N]> {
        (0..TABLE)
            .map(|lane| {
                let mut point =
                    || [(); 3].map(|()| far + size * f64::from(random.range(-1.0, 1.0)));
                let (start, way) = (point(), point());
                // Slivers: the last corner is near the line of the others.
                let mut corners = [start; N];
                for (k, corner) in corners.iter_mut().enumerate().skip(1) {
                    let near = point();
                    let width = [0.0, 1e-7, 1e-3, 0.3][lane % 4];
                    let share = if k == 1 { 1.0 } else { 0.6 };
                    for axis in 0..3 {
                        corner[axis] = start[axis]
                            + share * (way[axis] - start[axis])
                            + width * (near[axis] - far);
                    }
                }
                corners
            })
            .collect()
    }

    fn filled<const N: usize>(elements: &[[Point; N]]) -> Directions64 {
        let mut group = Directions64::EMPTY;
        group.begin(N);
        for (lane, corners) in elements.iter().enumerate() {
            group.put(lane, corners);
        }
        group
    }

    /// Compares each verdict with an exact one. Returns how many of all pairs were told apart, and
    /// how many are.
    fn compare<const N: usize, const M: usize>(
        seed: u64,
        (size, far): (f64, f64),
        distance: f32,
        is_near: impl Fn(&[Point; N], &[Point; M]) -> bool,
    ) -> [u32; 2] {
        let mut random = Random::new(seed);
        let (a, b) = (
            group::<N>(&mut random, size, far),
            group::<M>(&mut random, size, far),
        );
        let (of_a, of_b) = (filled(&a), filled(&b));
        assert!(of_a.can_part(&of_b) && of_b.can_part(&of_a));
        let mut counts = [0; 2];
        for (row, element) in a.iter().enumerate() {
            let beyond = of_b.beyond::<Portable32>(u64::MAX, (&of_a, row), distance);
            for (lane, other) in b.iter().enumerate() {
                let is_apart = !is_near(element, other);
                let is_beyond = beyond >> lane & 1 == 1;
                assert!(!is_beyond || is_apart, "{element:?} {other:?} {distance}");
                counts[0] += u32::from(is_beyond);
                counts[1] += u32::from(is_apart);
            }
        }
        counts
    }

    #[test]
    fn pairs_beyond_a_distance_are_farther_apart() {
        // Of coordinates that are small, as large as the distances between elements, and much
        // larger.
        for (seed, place) in [(1.0, 0.0), (1e-30, 0.0), (1e3, 2e4), (1.0, 1e6)]
            .into_iter()
            .enumerate()
        {
            let seed = seed as u64;
            let triangles = compare::<3, 3>(seed, place, 0.0, triangles_intersect);
            for share in [0.0, 1e-3, 0.2] {
                let distance = (share * place.0) as f32;
                let reach = Reach::from(f64::from(distance));
                let edges = compare::<2, 2>(seed + 9, place, distance, |a, b| {
                    elements_are_within(a, b, &reach)
                });
                let vertices = compare::<1, 3>(seed + 18, place, distance, |a, b| {
                    elements_are_within(a, b, &reach)
                });
                let faces = compare::<3, 1>(seed + 27, place, distance, |a, b| {
                    elements_are_within(a, b, &reach)
                });
                if place == (1.0, 0.0) {
                    for [beyond, apart] in [triangles, edges, vertices, faces] {
                        assert!(4 * beyond > 3 * apart, "{beyond} of {apart}");
                    }
                }
            }
        }
    }

    /// Slivers side by side, as on a shaft that lies aslant: each 1 long and 1e-4 wide.
    fn side_by_side(random: &mut Random) -> Vec<[Point; 3]> {
        let mut point = || [(); 3].map(|()| f64::from(random.range(-1.0, 1.0)));
        let (start, way, aside) = (point(), point(), point());
        (0..TABLE)
            .map(|lane| {
                let at = |along: f64, across: f64| {
                    [0, 1, 2].map(|k| start[k] + along * way[k] + across * aside[k])
                };
                let across = lane as f64 * 1e-4;
                [at(0.0, across), at(1.0, across), at(0.5, across + 1e-4)]
            })
            .collect()
    }

    #[test]
    fn elements_that_are_not_near_a_group_are_apart_from_all_of_it() {
        let mut random = Random::new(7);
        let (mut n_left_out, mut n_groups_apart) = (0, 0);
        for round in 0..200 {
            let a = side_by_side(&mut random);
            let b = match round % 4 {
                0 => group::<3>(&mut random, 1.0, 0.0),
                _ => side_by_side(&mut random),
            };
            let (of_a, of_b) = (filled(&a), filled(&b));
            let lanes = [u64::MAX >> (round % 60), !0 << (round % 50)];
            let near = of_a.near::<Portable32>(&of_b, lanes, 0.0);
            assert!(near[0] & !lanes[0] == 0 && near[1] & !lanes[1] == 0);
            n_groups_apart += u32::from(near == [0; 2]);
            for (i, first) in a.iter().enumerate() {
                for (j, second) in b.iter().enumerate() {
                    let is_asked = lanes[0] >> i & lanes[1] >> j & 1 == 1;
                    let is_near = near[0] >> i & near[1] >> j & 1 == 1;
                    if is_asked && !is_near {
                        n_left_out += 1;
                        assert!(!triangles_intersect(first, second), "{first:?} {second:?}");
                    }
                }
            }
        }
        // Nearly all groups are apart; the boxes of half of them overlap.
        assert!(n_left_out > 100_000, "{n_left_out}");
        assert!(n_groups_apart > 50, "{n_groups_apart}");
    }

    #[test]
    fn directions_whose_squares_underflow_tell_nothing_apart() {
        // The computed length of the normal would be 0.7 of the true one, and a unit normal 1.4
        // long.
        let (y, z) = (1.5716e-162, 2.72e-162);
        let triangle = filled(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.5, y, z]]]);
        let length = f64::hypot(y / z, 1.0);
        let near = [[0.5, -0.9 / length, 0.9 * (y / z) / length]];
        for point in [near, near.map(|p| p.map(|x| -x))] {
            let point = filled(&[point]);
            assert_eq!(triangle.beyond::<Portable32>(1, (&point, 0), 1.0), 0);
            assert_eq!(point.beyond::<Portable32>(1, (&triangle, 0), 1.0), 0);
        }
    }

    #[test]
    fn coordinates_out_of_range_are_not_told_apart() {
        let near = filled(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
        let far = filled(&[[[1e10; 3], [1e11, 0.0, 0.0], [0.0, 1e11, 0.0]]]);
        assert!(near.can_part(&near) && !near.can_part(&far) && !far.can_part(&near));
        let points = filled(&[[[0.0; 3]]]);
        let edges = filled(&[[[0.0; 3], [1.0; 3]]]);
        assert!(!points.can_part(&edges) && !points.can_part(&points));
        assert!(edges.can_part(&edges) && near.can_part(&points));
    }
}
