//! Where a ray meets an element of one to three corners: decided exactly.
//!
//! The points `origin + t direction`, for t from 0 to `most`, that lie in the element are an
//! interval of t, for the element is convex. It is a single t unless the ray lies in the plane of
//! the face or along the edge.
//!
//! With the corners a, b, c relative to the origin, the direction d and n = (b - a) x (c - a):
//!
//! - d . n not 0: t = (a . n) / (d . n), and the barycentrics are d . (b x c), d . (c x a) and d .
//!   (a x b), over d . n, their sum.
//! - d . n = 0 = a . n: in the projection in which n is not 0, each barycentric is a linear
//!   function of t, and none may be below 0.
//! - n = 0: the element is the union of its edges. The ray crosses an edge in a point, or lies
//!   along it.
//!
//! Cost: some 50 products of integers of any size: no filter, for what floats cannot decide.
//! [`meet_inside`] gives the same numbers of eight rays at a time for some hundredth of that, where
//! twice the precision of floats suffices, as it mostly does for rays through the inside of a face.

#[cfg(test)]
mod tests;

use core::cmp::Ordering;

use crate::algebra::fixed::{WholeVector, cross, difference, dot};
use crate::algebra::{Integer, common_integers, unit_of};
use crate::distance::Feature;
use crate::filter::number::{Vector, load_points, load_vertex};
use crate::filter::{LANES, Points8, Vertex8, put_point};
use crate::twice::{ERROR, MODERATE, Twice, size};
use crate::{Point, Sign};

/// The points `origin + t direction` for t from 0 to `most`, read as real numbers. A direction of
/// zero is the origin alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ray {
    /// Where t is 0.
    pub origin: Point,
    /// From there to where t is 1.
    pub direction: Point,
    /// The largest t: at least 0, or infinity.
    pub most: f64,
}

/// Where a ray meets an element.
#[derive(Clone, Debug)]
pub struct Meeting {
    /// The smallest t.
    pub entry: Parameter,
    /// The largest t.
    pub exit: Parameter,
    /// The smallest feature of the element that contains the point of entry; of several the one
    /// with the lowest number.
    pub feature: Feature,
    /// The barycentrics of that point, each rounded to nearest; of an edge and a point too, which
    /// have weights of 0 besides.
    pub barycentrics: [f64; 3],
}

/// A value of t: `over / under * 2^exponent`, where `under` is positive.
#[derive(Clone, Debug)]
pub struct Parameter {
    over: Integer,
    under: Integer,
    exponent: i64,
}

impl Parameter {
    fn of(x: f64) -> Self {
        let exponent = unit_of(x).unwrap_or(0);
        Self {
            over: Integer::of_multiple(x, exponent),
            under: Integer::from(1),
            exponent,
        }
    }

    /// The exact order of two values, of any two rays.
    #[must_use]
    pub fn compare(&self, other: &Self) -> Ordering {
        let left = &self.over * &other.under;
        let right = &other.over * &self.under;
        let lowest = self.exponent.min(other.exponent);
        let left = left.shifted((self.exponent - lowest).unsigned_abs());
        let right = right.shifted((other.exponent - lowest).unsigned_abs());
        (&left - &right).sign().order()
    }

    /// The largest float that is at most the value; the largest finite one if the value is larger.
    #[must_use]
    pub fn rounded_down(&self) -> f64 {
        let nearest = self.over.quotient(&self.under, self.exponent, 53, -1074);
        let is_above = nearest == f64::INFINITY || Self::of(nearest).compare(self).is_gt();
        if is_above {
            nearest.next_down()
        } else {
            nearest
        }
    }
}

/// A point of an element: t and weights of the corners, whose sum is `sum`.
struct At {
    entry: Parameter,
    exit: Parameter,
    weights: [Integer; 3],
    sum: Integer,
    feature: Feature,
}

/// Where a ray meets an element of one to three corners, if it does. Exact for finite numbers of
/// any size.
#[must_use]
pub fn meet(ray: &Ray, corners: &[Point]) -> Option<Meeting> {
    let last = corners.last()?;
    let corner = |ix: usize| corners.get(ix).unwrap_or(last);
    let points = [&ray.origin, corner(0), corner(1), corner(2)];
    let numbers: [f64; 12] = core::array::from_fn(|ix| points[ix / 3][ix % 3]);
    let (numbers, unit) = common_integers(numbers);
    let (direction, unit_of_direction) = common_integers(ray.direction);
    let exponent = unit - unit_of_direction;
    let corners_from_origin: [WholeVector; 3] =
        [3, 6, 9].map(|first| core::array::from_fn(|axis| &numbers[first + axis] - &numbers[axis]));
    let cast = Cast {
        direction,
        corners: corners_from_origin,
        n_corners: corners.len().min(3),
        exponent,
        most: (ray.most < f64::INFINITY).then(|| Parameter::of(ray.most)),
    };
    let [a, b, c] = &cast.corners;
    let normal = cross(&difference(b, a), &difference(c, a));
    let at = match axis_of(&normal) {
        Some(axis) => cast.face(&normal, axis),
        None => cast.edges(),
    }?;
    Some(Meeting {
        entry: at.entry,
        exit: at.exit,
        feature: at.feature,
        barycentrics: at.weights.map(|w| w.quotient(&at.sum, 0, 53, -1074)),
    })
}

/// Where rays meet the insides of faces, at most eight: the entry rounded down, and the
/// barycentrics, as [`meet`] gives them. `None` if that is in doubt or not so, as near an edge,
/// where the origin lies in the face, or where a number lies halfway between floats.
#[inline(always)]
#[must_use]
pub fn meet_inside<V: Vector>(
    rays_and_faces: &[(Ray, [Point; 3])],
) -> [Option<(f64, [f64; 3])>; LANES] {
    let mut points = Points8::default();
    let mut directions = Vertex8::default();
    for (lane, (ray, corners)) in rays_and_faces.iter().enumerate().take(LANES) {
        let [a, b, c] = corners;
        for (row, point) in points.0.iter_mut().zip([&ray.origin, a, b, c]) {
            put_point(row, lane, point);
        }
        put_point(&mut directions, lane, &ray.direction);
    }
    let mut inside = Inside8::default();
    let mut first = 0;
    while first < rays_and_faces.len().min(LANES) {
        inside.find::<V>(&points, &directions, first);
        first += V::N;
    }
    let mut met = [None; LANES];
    for (lane, (ray, _)) in rays_and_faces.iter().enumerate().take(LANES) {
        met[lane] = inside.rounded(lane, ray.most);
    }
    met
}

/// What twice the precision of floats says of eight rays and faces: of t and the barycentrics the
/// quotients, what is left of them, and how far these may be wrong.
#[derive(Default)]
struct Inside8 {
    is_inside: u8,
    numbers: [[[f64; LANES]; 3]; 4],
}

impl Inside8 {
    #[inline(always)]
    fn find<V: Vector>(&mut self, points: &Points8, directions: &Vertex8, first: usize) {
        let [origin, a, b, c] = load_points::<V>(points, first);
        let d = load_vertex::<V>(directions, first);
        let [zero, one] = [V::splat(0.0), V::splat(1.0)];
        let a = Twice::difference(&a, &origin);
        let b = Twice::difference(&b, &origin);
        let c = Twice::difference(&c, &origin);
        let d = [
            Twice([d[0], zero]),
            Twice([d[1], zero]),
            Twice([d[2], zero]),
        ];
        let largest = size(&a).larger(size(&b)).larger(size(&c));
        let of_way = size(&d);
        let [least, most] = [V::splat(MODERATE.start), V::splat(MODERATE.end)];
        let is_moderate =
            most.gt(largest) & most.gt(of_way) & !least.gt(largest) & !least.gt(of_way);
        let normal = Twice::cross(&Twice::minus_each(&b, &a), &Twice::minus_each(&c, &a));
        let across = Twice::cross(&a, &d);
        let slope = Twice::dot(&d, &normal);
        let sign = V::select(zero.gt(slope.0[0]), V::splat(-1.0), one);
        let slope = slope.turned(sign);
        let height = Twice::dot(&a, &normal).turned(sign);
        let weight_b = Twice::dot(&c, &across).turned(sign);
        let weight_c = Twice::dot(&b, &across).turned(zero - sign);
        let weight_a = slope.minus(weight_b).minus(weight_c);
        let error = V::splat(ERROR) * (largest * largest * of_way);
        let of_height = V::splat(ERROR) * (largest * largest * largest);
        let two = V::splat(2.0);
        let is_inside = weight_a.0[0].gt(two * error)
            & weight_b.0[0].gt(two * error)
            & weight_c.0[0].gt(two * error)
            & height.0[0].gt(two * of_height);
        self.is_inside |= V::bits(is_moderate & is_inside) << first;
        let quotients = [
            height.over(slope, of_height, error),
            weight_a.over(slope, error, error),
            weight_b.over(slope, error, error),
            weight_c.over(slope, error, error),
        ];
        for (of_one, rows) in quotients.into_iter().zip(&mut self.numbers) {
            for (number, row) in of_one.into_iter().zip(rows) {
                number.store(row, first);
            }
        }
    }

    /// The numbers of one ray, if roundings are certain.
    #[inline(always)]
    fn rounded(&self, lane: usize, most: f64) -> Option<(f64, [f64; 3])> {
        if self.is_inside >> lane & 1 == 0 {
            return None;
        }
        let [of_t, of_weights @ ..] = &self.numbers;
        let (t, rest, doubt) = (of_t[0][lane], of_t[1][lane], of_t[2][lane]);
        let t = match rest.abs() > doubt {
            true if rest > 0.0 => t,
            true => t.next_down(),
            false => return None,
        };
        if t.next_up() > most {
            return None;
        }
        let mut barycentrics = [0.0; 3];
        for (numbers, rounded) in of_weights.iter().zip(&mut barycentrics) {
            let (quotient, rest, doubt) = (numbers[0][lane], numbers[1][lane], numbers[2][lane]);
            if rest.abs() + doubt >= 0.5 * (quotient - quotient.next_down()) {
                return None;
            }
            *rounded = quotient;
        }
        Some((t, barycentrics))
    }
}

/// An axis along which a vector is not 0.
fn axis_of(vector: &WholeVector) -> Option<usize> {
    vector.iter().position(|x| !x.is_zero())
}

fn is_negative(x: &Integer) -> bool {
    x.sign() == Sign::Negative
}

/// A ray and an element in integers, relative to the origin of the ray.
struct Cast {
    direction: WholeVector,
    corners: [WholeVector; 3],
    n_corners: usize,
    /// Values of t are multiples of 2^exponent.
    exponent: i64,
    most: Option<Parameter>,
}

impl Cast {
    fn parameter(&self, over: Integer, under: Integer) -> Parameter {
        let (over, under) = positive(over, under);
        Parameter {
            over,
            under,
            exponent: self.exponent,
        }
    }

    fn is_within(&self, t: &Parameter) -> bool {
        !is_negative(&t.over)
            && self
                .most
                .as_ref()
                .is_none_or(|most| t.compare(most).is_le())
    }

    /// What the ray shares with an interval.
    fn clipped(&self, low: Parameter, high: Option<Parameter>) -> Option<(Parameter, Parameter)> {
        let entry = match is_negative(&low.over) {
            true => self.parameter(Integer::zero(), Integer::from(1)),
            false => low,
        };
        let exit = match (high, self.most.clone()) {
            (Some(high), Some(most)) if high.compare(&most).is_gt() => most,
            (Some(high), _) => high,
            (None, Some(most)) => most,
            (None, None) => entry.clone(),
        };
        entry.compare(&exit).is_le().then_some((entry, exit))
    }

    /// A face that is not degenerate; its normal is not 0 along an axis.
    fn face(&self, normal: &WholeVector, axis: usize) -> Option<At> {
        let [a, b, c] = &self.corners;
        let height = dot(a, normal);
        let slope = dot(&self.direction, normal);
        if slope.is_zero() {
            return height.is_zero().then(|| self.in_plane(normal, axis))?;
        }
        let is_reversed = is_negative(&slope);
        let weights = [[b, c], [c, a], [a, b]].map(|[p, q]| {
            let weight = dot(&self.direction, &cross(p, q));
            if is_reversed { -&weight } else { weight }
        });
        if weights.iter().any(is_negative) {
            return None;
        }
        let t = self.parameter(height, slope.clone());
        self.is_within(&t).then(|| At {
            entry: t.clone(),
            exit: t,
            feature: feature_of(&weights),
            weights,
            sum: slope.abs(),
        })
    }

    /// A ray in the plane of the face.
    fn in_plane(&self, normal: &WholeVector, axis: usize) -> Option<At> {
        let [a, b, c] = &self.corners;
        let is_reversed = is_negative(&normal[axis]);
        let part = |p: &WholeVector, q: &WholeVector| {
            let [x, y, z] = cross(p, q);
            let part = [x, y, z][axis].clone();
            if is_reversed { -&part } else { part }
        };
        // The weight of each corner, at t = 0 and per t.
        let weights = [[b, c], [c, a], [a, b]]
            .map(|[p, q]| (part(p, q), part(&difference(q, p), &self.direction)));
        let mut low = self.parameter(Integer::zero(), Integer::from(1));
        let mut high: Option<Parameter> = None;
        for (at_origin, per_t) in &weights {
            match per_t.sign() {
                Sign::Zero if is_negative(at_origin) => return None,
                Sign::Zero => {}
                Sign::Positive => {
                    let from = self.parameter(-at_origin, per_t.clone());
                    if from.compare(&low).is_gt() {
                        low = from;
                    }
                }
                Sign::Negative => {
                    let to = self.parameter(-at_origin, per_t.clone());
                    if high.as_ref().is_none_or(|high| to.compare(high).is_lt()) {
                        high = Some(to);
                    }
                }
            }
        }
        let is_point = axis_of(&self.direction).is_none();
        let high = if is_point { Some(low.clone()) } else { high };
        let (entry, exit) = self.clipped(low, high)?;
        let weights = weights
            .map(|(at_origin, per_t)| &(&at_origin * &entry.under) + &(&per_t * &entry.over));
        Some(At {
            feature: feature_of(&weights),
            sum: &normal[axis].clone().abs() * &entry.under,
            weights,
            entry,
            exit,
        })
    }

    /// An element that is the union of its edges.
    fn edges(&self) -> Option<At> {
        let n = self.n_corners;
        let n_edges = [1, 1, 1, 3][n];
        let mut all: Option<At> = None;
        for edge in 0..n_edges {
            let Some(at) = self.edge(edge, (edge + 1) % n) else {
                continue;
            };
            let Some(known) = &mut all else {
                all = Some(at);
                continue;
            };
            let exit = match at.exit.compare(&known.exit).is_gt() {
                true => at.exit.clone(),
                false => known.exit.clone(),
            };
            let order = at.entry.compare(&known.entry);
            if order.then(at.feature.cmp(&known.feature)).is_lt() {
                *known = at;
            }
            known.exit = exit;
        }
        all
    }

    /// The edge from corner i to corner j, which may be a point.
    fn edge(&self, i: usize, j: usize) -> Option<At> {
        let (p, q, d) = (&self.corners[i], &self.corners[j], &self.direction);
        let way = difference(q, p);
        let across = cross(d, &way);
        let one = || Integer::from(1);
        let (entry, exit, (share, sum)) = if let Some(axis) = axis_of(&across) {
            if !dot(p, &across).is_zero() {
                return None;
            }
            let t = self.parameter(cross(p, &way)[axis].clone(), across[axis].clone());
            if !self.is_within(&t) {
                return None;
            }
            let share = positive(cross(p, d)[axis].clone(), across[axis].clone());
            (t.clone(), t, share)
        } else {
            if axis_of(&cross(d, p)).is_some() || axis_of(&cross(&way, p)).is_some() {
                return None;
            }
            let (entry, exit) = if let Some(axis) = axis_of(d) {
                let [to_p, to_q] =
                    [p, q].map(|end| self.parameter(end[axis].clone(), d[axis].clone()));
                let (low, high) = match to_p.compare(&to_q).is_le() {
                    true => (to_p, to_q),
                    false => (to_q, to_p),
                };
                self.clipped(low, Some(high))?
            } else {
                let zero = self.parameter(Integer::zero(), one());
                (zero.clone(), zero)
            };
            let share = match axis_of(&way) {
                Some(axis) => {
                    let from_p = &(&d[axis] * &entry.over) - &(&p[axis] * &entry.under);
                    positive(from_p, &way[axis] * &entry.under)
                }
                None if axis_of(d).is_none() && axis_of(p).is_some() => return None,
                None => (Integer::zero(), one()),
            };
            (entry, exit, share)
        };
        let rest = &sum - &share;
        if is_negative(&share) || is_negative(&rest) {
            return None;
        }
        let number = |ix: usize| u8::try_from(ix).unwrap_or(0);
        let feature = match (share.is_zero(), rest.is_zero()) {
            (true, _) => Feature::Vertex(number(i)),
            (_, true) => Feature::Vertex(number(j)),
            _ => Feature::Edge(number(i)),
        };
        let mut weights = [0; 3].map(|_| Integer::zero());
        weights[j] = share;
        weights[i] = &weights[i] + &rest;
        Some(At {
            entry,
            exit,
            weights,
            sum,
            feature,
        })
    }
}

/// A quotient whose denominator is positive.
fn positive(over: Integer, under: Integer) -> (Integer, Integer) {
    match is_negative(&under) {
        true => (-&over, -&under),
        false => (over, under),
    }
}

/// The smallest feature of a face at some weights.
fn feature_of(weights: &[Integer; 3]) -> Feature {
    match weights.each_ref().map(Integer::is_zero) {
        [false, false, false] => Feature::Face,
        [false, true, true] => Feature::Vertex(0),
        [true, false, true] => Feature::Vertex(1),
        [true, true, false] => Feature::Vertex(2),
        // Edge k is opposite the corner before its ends.
        [true, ..] => Feature::Edge(1),
        [_, true, _] => Feature::Edge(2),
        [.., true] => Feature::Edge(0),
    }
}
