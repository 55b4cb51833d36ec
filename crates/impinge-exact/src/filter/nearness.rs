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
use super::number::Number;
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
    pub(super) fn new(are_edges: bool, [p, q, r, s]: &[Vec3<T>; 4]) -> Self {
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
    pub(super) fn bounds_of_triangle(&self) -> (T::Mask, [T; 2]) {
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
pub(super) fn edges_of<T: Number>(are_edges: bool, [p, q, r, s]: &[Vec3<T>; 4]) -> [Vec3<T>; 4] {
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
