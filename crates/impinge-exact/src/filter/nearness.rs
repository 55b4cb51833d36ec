//! Elements near each other: certainly within a distance, certainly not, or unsure.
//!
//! What it does: tests the difference polygon of two elements (see `crate::distance`) in plain
//! `f64` or `f32`, one pair per lane, for elements that rest ([`Polygon::verdict`]) and for
//! elements that move ([`stay_beyond`]).
//!
//! In: the elements' points, and floats that enclose the distance. Out: masks. Cost of a verdict:
//! about 250 operations for all lanes.
//!
//! Method: compute a point of the polygon that is nearest to the origin, but for rounding. If it is
//! nearer than the distance, so is the polygon. If the whole polygon lies beyond the plane through
//! that point, or beyond a plane along the polygon, farther away than the distance, it is not.
//! Neither answer depends on how good the nearest point is.
//!
//! Which part of the polygon is nearest follows from signs of V . E and w, if those of one region
//! are certain ([`Polygon::nearest_part`]).
//!
//! Invariant: with |.| the largest coordinate and u the unit roundoff, n . V is wrong by less than
//! 22 u |n| |V| for any known n and a corner V at any time of a step, and a blend of corners by
//! less than 24 u |V| (`docs/exactness.md`, "Distances"). NaN and overflow end as unsure.

use super::motion::{Vec3, between, cross, difference, dot, size};
use super::moving::{are_edges, look_up, two_edges, vertex_and_face};
use super::number::{self, Lookup, Number, load_points};
use super::{BATCH, LANES, Moving64, Points8, Spans8, Triangles64, Verdict16};
use crate::ElementPair;

/// The number of a part of a polygon, bit after bit from the lowest: corner i is i, edge i is 4 +
/// i, the face is 8. All bits are set where signs are not certain to tell.
pub(crate) type PartBits<M> = [M; 4];

/// The difference polygon of pairs of elements: a point, a segment, a triangle or a parallelogram.
#[derive(Clone, Copy)]
pub(crate) struct Polygon<T: Number = f64> {
    /// 1 to 4.
    n_corners: usize,
    corners: [Vec3<T>; 4],
}

// Here and below no closures are passed to library functions: those would be compiled on their own,
// without the instruction set.

impl<T: Number> Polygon<T> {
    /// The polygon of a pair.
    #[inline(always)]
    pub(crate) fn of_pair(pair: ElementPair, points: &[Vec3<T>; 4]) -> Self {
        let mut corners = [[T::splat(0.0); 3]; 4];
        let numbers = pair.corners();
        for (corner, &[i, j]) in corners.iter_mut().zip(numbers) {
            *corner = difference(&points[i], &points[j]);
        }
        Polygon {
            n_corners: numbers.len(),
            corners,
        }
    }

    /// Its corners.
    #[inline(always)]
    pub(crate) fn corners(&self) -> &[Vec3<T>] {
        &self.corners[..self.n_corners]
    }

    /// Of a vertex, point 0, and a face; or of two edges, points 0 and 1, and points 2 and 3.
    #[inline(always)]
    fn new(are_edges: bool, [p, q, r, s]: &[Vec3<T>; 4]) -> Self {
        if are_edges {
            Polygon {
                n_corners: 4,
                corners: [
                    difference(p, r),
                    difference(q, r),
                    difference(q, s),
                    difference(p, s),
                ],
            }
        } else {
            let corners = [difference(q, p), difference(r, p), difference(s, p)];
            Polygon {
                n_corners: 3,
                corners: [corners[0], corners[1], corners[2], corners[0]],
            }
        }
    }

    /// The largest coordinate of a corner.
    #[inline(always)]
    pub(crate) fn size(&self) -> T {
        let mut largest = size(&self.corners[0]);
        for corner in &self.corners[1..self.n_corners] {
            largest = largest.larger(size(corner));
        }
        largest
    }

    /// The sum of the magnitudes of all coordinates: not below the largest one, and NaN where any
    /// coordinate is.
    #[inline(always)]
    fn total(&self) -> T {
        let mut total = T::splat(0.0);
        for [x, y, z] in &self.corners[..self.n_corners] {
            total = total + (x.abs() + y.abs() + z.abs());
        }
        total
    }

    /// A normal; zero for a point or a segment.
    #[inline(always)]
    pub(crate) fn normal(&self) -> Vec3<T> {
        let [a, b, c, _] = &self.corners;
        if self.n_corners > 2 {
            cross(&difference(b, a), &difference(c, b))
        } else {
            [T::splat(0.0); 3]
        }
    }

    /// The polygon at a time in a step that ends with another one.
    #[inline(always)]
    pub(crate) fn at(&self, end: &Self, time: T) -> Self {
        let mut here = *self;
        for ix in 0..self.n_corners {
            here.corners[ix] = between(&self.corners[ix], &end.corners[ix], time);
        }
        here
    }

    /// A point of the polygon that is nearest to the origin, but for rounding.
    #[inline(always)]
    pub(crate) fn nearest(&self, normal: &Vec3<T>) -> Vec3<T> {
        let (mut best, square) = self.nearest_of_border();
        if self.n_corners > 2 {
            let (is_inside, foot) = self.foot(normal);
            let is_nearer = is_inside & square.gt(dot(&foot, &foot));
            best = select(is_nearer, &foot, &best);
        }
        best
    }

    /// A point of the edges that is nearest to the origin, but for rounding, and the square of its
    /// distance.
    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    fn nearest_of_border(&self) -> (Vec3<T>, T) {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let n = self.n_corners;
        let mut best = self.corners[0];
        let mut square = dot(&best, &best);
        for ix in 0..if n > 2 { n } else { n - 1 } {
            let next = if ix + 1 == n { 0 } else { ix + 1 };
            let (a, b) = (&self.corners[ix], &self.corners[next]);
            let along = difference(b, a);
            let share = (zero - dot(a, &along)) / dot(&along, &along);
            // NaN, where the edge is a point, becomes 0.
            let share = T::select(share.gt(zero), share, zero);
            let share = T::select(share.gt(one), one, share);
            let point = between(a, b, share);
            let of_point = dot(&point, &point);
            let is_nearer = square.gt(of_point);
            best = select(is_nearer, &point, &best);
            square = T::select(is_nearer, of_point, square);
        }
        (best, square)
    }

    /// The foot of the perpendicular from the origin, as a blend of the corners, and where it lies
    /// in the polygon.
    #[inline(always)]
    fn foot(&self, normal: &Vec3<T>) -> (T::Mask, Vec3<T>) {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let [a, b, c, d] = &self.corners;
        let square = dot(normal, normal);
        // Weights of a triangle; of a parallelogram the fourth corner is a - b + c.
        let of_a = dot(normal, &cross(b, c)) / square;
        let of_c = dot(normal, &cross(a, b)) / square;
        let weights = if self.n_corners == 3 {
            [of_a, dot(normal, &cross(c, a)) / square, of_c, zero]
        } else {
            // Shares along a -> b and b -> c. Inside the parallelogram, their products are
            // nonnegative weights.
            let (s, t) = (one - of_a, of_c);
            let (before, below) = (one - s, one - t);
            [before * below, s * below, s * t, before * t]
        };
        let sum = weights[0] + weights[1] + weights[2] + weights[3];
        // Otherwise the weights mean nothing; and they must not overflow.
        let is_one = sum.gt(T::splat(0.5)) & T::splat(2.0).gt(sum);
        let is_negative =
            zero.gt(weights[0]) | zero.gt(weights[1]) | zero.gt(weights[2]) | zero.gt(weights[3]);
        let shares = [
            weights[0] / sum,
            weights[1] / sum,
            weights[2] / sum,
            weights[3] / sum,
        ];
        let mut foot = *a;
        for axis in 0..3 {
            foot[axis] = (a[axis] * shares[0] + b[axis] * shares[1])
                + (c[axis] * shares[2] + d[axis] * shares[3]);
        }
        (is_one & !is_negative, foot)
    }

    /// The part with the nearest point in its inside, as the bits of its number ([`PartBits`]).
    /// Each edge is a difference of two input points, rounded once.
    ///
    /// The regions of a polygon with a normal have no point in common, so the signs of one region
    /// are enough:
    ///
    /// ```text
    /// face      every w_i > 0                            the origin is above or below the inside
    /// edge i    w_i < 0, V_i . E_i < 0 < V_{i+1} . E_i   beyond the edge, and between its ends
    /// corner i  V_i . E_i > 0 > V_i . E_{i-1}, N != 0    both edges lead away from the origin
    /// ```
    ///
    /// V . E is wrong by less than 16 u |V| |E|, a coordinate of N by less than 9 u |E_0| |E_1|,
    /// and w by less than 133 u |E_0| |E_1| |V| |E| (`docs/exactness.md`, "Distances").
    #[inline(always)]
    pub(crate) fn nearest_part(&self, edges: &[Vec3<T>; 4]) -> PartBits<T::Mask> {
        let (zero, n) = (T::splat(0.0), self.n_corners);
        let never = zero.gt(zero);
        let size = self.size();
        let sizes = [
            self::size(&edges[0]),
            self::size(&edges[1]),
            self::size(&edges[2]),
            self::size(&edges[3]),
        ];
        let is_small = T::splat(T::LARGEST).gt(self.total());
        // Of each edge: the signs of V . E at its start and at its end. First whether it is
        // positive, then negative.
        let (mut starts, mut ends) = ([[never; 2]; 4], [[never; 2]; 4]);
        for ix in 0..if n > 2 { n } else { n - 1 } {
            let next = if ix + 1 == n { 0 } else { ix + 1 };
            let bound = T::splat(T::BOUND) * (size * sizes[ix]) + T::splat(T::TINY[0]);
            starts[ix] = signs(dot(&self.corners[ix], &edges[ix]), bound);
            ends[ix] = signs(dot(&self.corners[next], &edges[ix]), bound);
        }
        let mut corners = [never; 4];
        let mut borders = [never; 4];
        let mut face = never;
        match n {
            1 => corners[0] = !never,
            2 => {
                corners = [starts[0][0], ends[0][1], never, never];
                borders[0] = starts[0][1] & ends[0][0];
            }
            _ => {
                let normal = cross(&edges[0], &edges[1]);
                let scale = T::splat(T::BOUND) * (sizes[0] * sizes[1]);
                let has_normal = self::size(&normal).gt(scale + T::splat(T::TINY[0]));
                let scale = T::splat(4.0) * (scale * size);
                face = !never;
                for ix in 0..n {
                    let before = if ix == 0 { n - 1 } else { ix - 1 };
                    let w = dot(&self.corners[ix], &cross(&edges[ix], &normal));
                    let [inner, outer] = signs(w, scale * sizes[ix] + T::splat(T::TINY[2]));
                    face = face & inner;
                    borders[ix] = outer & starts[ix][1] & ends[ix][0];
                    corners[ix] = has_normal & starts[ix][0] & ends[before][1];
                }
            }
        }
        let odd = corners[1] | corners[3] | borders[1] | borders[3];
        let upper = corners[2] | corners[3] | borders[2] | borders[3];
        let border = borders[0] | borders[1] | borders[2] | borders[3];
        let is_known = is_small & (corners[0] | odd | upper | border | face);
        [
            odd | !is_known,
            upper | !is_known,
            border | !is_known,
            face | !is_known,
        ]
    }

    /// Two numbers between which the distance from the origin certainly is, where the mask is set.
    #[inline(always)]
    pub(crate) fn bounds(&self) -> (T::Mask, [T; 2]) {
        let size = self.size();
        let normal = self.normal();
        let near = self.nearest(&normal);
        let [of_near, of_normal] = [
            self.least_beyond(&near, size),
            self.least_beyond(&normal, size),
        ];
        let is_small = T::splat(T::LARGEST).gt(size);
        let low = of_near.larger(of_normal);
        (is_small, [low, most(&near, size)])
    }

    /// [`bounds`](Self::bounds) of a triangle by about half of the operations: 0 is said of a low
    /// bound where the origin nearly lies in the face.
    #[inline(always)]
    fn bounds_of_triangle(&self) -> (T::Mask, [T; 2]) {
        let zero = T::splat(0.0);
        let size = self.size();
        let (best, square) = self.nearest_of_border();
        let [a, b, c, _] = &self.corners;
        let normal = self.normal();
        let weights = [
            dot(&normal, &cross(b, c)),
            dot(&normal, &cross(c, a)),
            dot(&normal, &cross(a, b)),
        ];
        let sum = weights[0] + weights[1] + weights[2];
        // Otherwise the weights mean nothing; and they must not overflow.
        let all = dot(&normal, &normal);
        let is_sum = sum.gt(T::splat(0.5) * all) & (all + all).gt(sum);
        let is_negative = zero.gt(weights[0]) | zero.gt(weights[1]) | zero.gt(weights[2]);
        let shares = [weights[0] / sum, weights[1] / sum, weights[2] / sum];
        let mut foot = *a;
        for axis in 0..3 {
            foot[axis] = (a[axis] * shares[0] + b[axis] * shares[1]) + c[axis] * shares[2];
        }
        let is_nearer = is_sum & !is_negative & square.gt(dot(&foot, &foot));
        let near = select(is_nearer, &foot, &best);
        let low = self.least_beyond(&near, size);
        (T::splat(T::LARGEST).gt(size), [low, most(&near, size)])
    }

    /// About the shortest way from the origin, where the mask is set.
    #[inline(always)]
    pub(crate) fn way(&self) -> (T::Mask, Vec3<T>) {
        let is_small = T::splat(T::LARGEST).gt(self.size());
        (is_small, self.nearest(&self.normal()))
    }

    /// A distance from a plane through the origin that all corners certainly have, all on one side;
    /// 0 if that is not certain.
    #[inline(always)]
    fn least_beyond(&self, normal: &Vec3<T>, largest: T) -> T {
        let zero = T::splat(0.0);
        let [_, error] = beyond(normal, largest, zero);
        let mut lowest = dot(normal, &self.corners[0]);
        let mut highest = lowest;
        for corner in &self.corners[1..self.n_corners] {
            let height = dot(normal, corner);
            lowest = lowest.smaller(height);
            highest = highest.larger(height);
        }
        let length = dot(normal, normal).sqrt();
        // The quotient has a few more roundings; the bound covers them many times.
        let least = (lowest.larger(zero - highest) - error) / length * T::splat(1.0 - T::BOUND);
        let is_certain = size(normal).gt(T::splat(T::SHORTEST)) & least.gt(zero);
        T::select(is_certain, least, zero)
    }

    /// Which polygons are certainly within a distance of the origin, and which certainly are not.
    /// The distance is between two numbers.
    #[inline(always)]
    pub(crate) fn verdict(&self, low: T, high: T) -> (T::Mask, T::Mask) {
        let size = self.size();
        let normal = self.normal();
        let near = self.nearest(&normal);
        let is_small = T::splat(T::LARGEST).gt(self.total());
        let polygons = [*self];
        let no =
            are_beyond(&near, &polygons, size, high) | are_beyond(&normal, &polygons, size, high);
        (is_small & low.gt(most(&near, size)), is_small & no)
    }
}

/// The edges of the polygon of a vertex and a face or of two edges, each a difference of two input
/// points. A triangle has no fourth edge.
#[inline(always)]
fn edges_of<T: Number>(are_edges: bool, [p, q, r, s]: &[Vec3<T>; 4]) -> [Vec3<T>; 4] {
    if are_edges {
        [
            difference(q, p),
            difference(r, s),
            difference(p, q),
            difference(s, r),
        ]
    } else {
        let last = difference(q, s);
        [difference(r, q), difference(s, r), last, last]
    }
}

/// A number that the length of a computed point of a polygon of some size certainly does not
/// exceed.
#[inline(always)]
pub(crate) fn most<T: Number>(point: &Vec3<T>, size: T) -> T {
    dot(point, point).sqrt() * T::splat(1.0 + T::BOUND)
        + (T::splat(T::BOUND) * size + T::splat(T::SHORTEST))
}

/// The least n . V that is certainly farther away than a distance along n: the distance times the
/// length of n, and the error. The second number is the part of it that is for errors.
#[inline(always)]
pub(crate) fn beyond<T: Number>(normal: &Vec3<T>, largest: T, distance: T) -> [T; 2] {
    let error = T::splat(T::BOUND) * (size(normal) * largest) + T::splat(T::TINY[0]);
    let length = dot(normal, normal).sqrt();
    [distance * length * T::splat(1.0 + T::BOUND) + error, error]
}

/// Whether n . V > d |n| for all corners V of some polygons, or n . V < -d |n| for all. The normal
/// n is taken as exact; `largest` is the largest coordinate of a corner.
#[inline(always)]
pub(crate) fn are_beyond<T: Number>(
    normal: &Vec3<T>,
    polygons: &[Polygon<T>],
    largest: T,
    distance: T,
) -> T::Mask {
    let [bound, _] = beyond(normal, largest, distance);
    let opposite = T::splat(0.0) - bound;
    let is_long = size(normal).gt(T::splat(T::SHORTEST));
    // Masks, not minima and maxima, which would lose NaN.
    let mut above = is_long & T::splat(T::LARGEST).gt(distance);
    let mut below = above;
    for polygon in polygons {
        for corner in &polygon.corners[..polygon.n_corners] {
            let height = dot(normal, corner);
            above = above & height.gt(bound);
            below = below & opposite.gt(height);
        }
    }
    above | below
}

/// Which polygons certainly stay farther away from the origin than a distance, on the way from one
/// to the other. `largest` is the largest coordinate of a corner at either end of the step.
#[inline(always)]
pub(crate) fn stay_beyond<T: Number>(
    first: &Polygon<T>,
    last: &Polygon<T>,
    largest: T,
    distance: T,
) -> T::Mask {
    let ends = [*first, *last];
    let normals = [first.normal(), last.normal()];
    let nearest = [first.nearest(&normals[0]), last.nearest(&normals[1])];
    let mut sum = [T::splat(0.0); 3];
    for polygon in &ends {
        for corner in &polygon.corners[..polygon.n_corners] {
            for axis in 0..3 {
                sum[axis] = sum[axis] + corner[axis];
            }
        }
    }
    let mut stay = are_beyond(&sum, &ends, largest, distance);
    for normal in [&nearest[0], &nearest[1], &normals[0], &normals[1]] {
        stay = stay | are_beyond(normal, &ends, largest, distance);
    }
    stay & T::splat(T::LARGEST).gt(largest)
}

/// Whether values that are wrong by less than a bound are certainly positive, and whether certainly
/// negative.
#[inline(always)]
fn signs<T: Number>(value: T, bound: T) -> [T::Mask; 2] {
    [value.gt(bound), (T::splat(0.0) - bound).gt(value)]
}

#[inline(always)]
fn select<T: Number>(mask: T::Mask, yes: &Vec3<T>, no: &Vec3<T>) -> Vec3<T> {
    [
        T::select(mask, yes[0], no[0]),
        T::select(mask, yes[1], no[1]),
        T::select(mask, yes[2], no[2]),
    ]
}

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
