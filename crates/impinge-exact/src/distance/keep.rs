//! How near two moving elements may come, by how far apart they are at the start.
//!
//! What it does: two elements keep a separation s, and beyond it the lesser of a clearance c and a
//! share p of what they are apart at the start: s + min(c, p (d - s)), with d their distance at the
//! start.
//!
//! How: the excess d - s is rounded up to 24 bits. An enclosure of d in `f64` nearly always decides
//! which number that is, and exact comparisons do so elsewhere. So the number depends on the pair
//! alone, and costs about as much as a filter.
//!
//! Invariant: for elements that are farther apart than s at the start, the number is at least s and
//! below d.

use crate::element_pair::ElementPair;
use crate::rounding::power_of_two;
use crate::sweep::{Contact, touch};
use crate::twice::two_sum;
use crate::{Point, first_within};

use super::reach::Reach;
use super::{are_within, are_within_reach, filter};

/// What the elements of a step keep.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keep {
    /// Finite, 0 or more.
    pub separation: f64,
    /// The same. With 0, the share means nothing.
    pub clearance: f64,
    /// From 0 to less than 1.
    pub share: f64,
    /// Whether the distance is kept by positions on the way that are computed in floats, not only
    /// by the way itself.
    pub is_rounded: bool,
}

/// The bits of an `f64` beyond the first 24 of its significand.
const N_DROPPED: u32 = 29;

impl Keep {
    /// Whether every pair keeps the separation alone.
    #[inline]
    pub fn is_plain(&self) -> bool {
        self.clearance == 0.0 || self.share == 0.0
    }

    /// What two elements keep that are so thick: their thickness adds to the separation. Each of
    /// the two sums is rounded up, and none is above the largest float, unless the separation is.
    #[inline]
    #[must_use]
    pub fn with_thickness(self, [a, b]: [f64; 2]) -> Self {
        Self {
            separation: sum_up(self.separation, sum_up(a, b)),
            ..self
        }
    }

    /// A distance that is at least what any pair keeps, for coordinates up to a magnitude, stored
    /// in a precision with this unit roundoff.
    pub fn most(&self, magnitude: f64, unit: f64) -> f64 {
        if self.is_plain() {
            return self.separation;
        }
        let rounded = if self.is_rounded {
            moved_by_rounding(magnitude, unit)
        } else {
            0.0
        };
        sum_above((self.separation + self.clearance).next_up(), rounded)
    }

    /// What a pair keeps, positions as they are computed included. `unit` is the unit roundoff of
    /// the positions' precision.
    pub fn distance(&self, pair: ElementPair, [start, end]: [&[Point; 4]; 2], unit: f64) -> f64 {
        if self.is_plain() {
            return self.separation;
        }
        let rounded = if self.is_rounded {
            rounded_of(pair, [start, end], unit)
        } else {
            0.0
        };
        sum_above(self.beyond(pair, start), rounded)
    }

    /// The first time at which two elements are as near as they may come. Only elements within the
    /// separation are in contact at the start.
    pub fn first(&self, pair: ElementPair, ends: [&[Point; 4]; 2], unit: f64) -> Option<Contact> {
        let distance = self.distance(pair, ends, unit);
        let contact = first_within(pair, ends[0], ends[1], distance)?;
        Some(match contact.at_start {
            true => self.at_start(pair, ends[0]),
            false => contact,
        })
    }

    /// [`Keep::first`] for those who do not ask when: the time is a bound, not above the first.
    ///
    /// Nearly all pairs that floats do not decide are as near at the end, just so: what comes to
    /// rest on something ends on it. That is found out without roots.
    pub fn whenever(
        &self,
        pair: ElementPair,
        ends: [&[Point; 4]; 2],
        unit: f64,
    ) -> Option<Contact> {
        let [start, end] = ends;
        let distance = self.distance(pair, ends, unit);
        let are_near = |points: &[Point; 4]| match distance == 0.0 {
            true => touch(pair, points),
            false => are_within(pair, points, distance),
        };
        if !are_near(end) {
            return self.first(pair, ends, unit);
        }
        Some(match are_near(start) {
            true => self.at_start(pair, start),
            false => Contact {
                at_start: false,
                is_exact: false,
                time: 0.0,
            },
        })
    }

    /// The contact of elements that are as near as they may come from the start on.
    pub fn at_start(&self, pair: ElementPair, start: &[Point; 4]) -> Contact {
        Contact {
            at_start: self.is_plain() || are_within(pair, start, self.separation),
            ..Contact::AT_START
        }
    }

    /// s + min(c, p (d - s)); s, if d is at most s.
    fn beyond(&self, pair: ElementPair, start: &[Point; 4]) -> f64 {
        let bounds = filter::bounds(pair, start);
        if let Some([low, _]) = bounds {
            let excess = (low - self.separation).next_down();
            // Products are rounded in the order of their factors: a larger excess gives no less.
            if excess > 0.0 && self.share * excess >= self.clearance {
                return sum_below(self.separation, self.clearance);
            }
        }
        let Some(excess) = self.excess(pair, start, bounds) else {
            return self.separation;
        };
        let share = f64::min(self.share * excess.value(), excess.before().value());
        sum_below(self.separation, share.min(self.clearance))
    }

    /// d - s rounded up to 24 bits, or the largest such number if it is larger; `None` if it is not
    /// above 0.
    fn excess(
        &self,
        pair: ElementPair,
        start: &[Point; 4],
        bounds: Option<[f64; 2]>,
    ) -> Option<Short> {
        let [low, high] = bounds.unwrap_or([0.0, 0.0]);
        let between = [
            (low - self.separation).next_down(),
            (high - self.separation).next_up(),
        ];
        excess_over([self.separation, 0.0], (pair, start), between)
    }
}

/// What the distance of two elements is beyond the exact sum of two numbers, rounded up to 24 bits,
/// or the largest such number if it is larger; `None` if it is not above 0. It should be between
/// two numbers, and is if the first one is above 0.
fn excess_over(
    [first, second]: [f64; 2],
    (pair, points): (ElementPair, &[Point; 4]),
    [low, high]: [f64; 2],
) -> Option<Short> {
    if low > 0.0 && Short::not_below(low) == Short::not_below(high) {
        return Some(Short::not_below(low));
    }
    let reaches = |excess: Short| {
        let reach = Reach::of_sum([first, second, excess.value()]);
        are_within_reach(pair, points, &reach)
    };
    if reaches(Short::ZERO) {
        return None;
    }
    // Between the last number that is known not to reach and the first that does: away from a guess
    // in growing strides, then by halves.
    let (mut below, mut above) = (Short::ZERO, Short::not_below(high.max(0.0)));
    let mut stride = 1;
    while !reaches(above) {
        if above == Short::LARGEST {
            return Some(above);
        }
        below = above;
        above = above.later(stride);
        stride *= 2;
    }
    let mut stride = 1;
    while below.0 + stride < above.0 && reaches(Short(above.0 - stride)) {
        above = Short(above.0 - stride);
        stride *= 2;
    }
    if below.0 + stride < above.0 {
        below = Short(above.0 - stride);
    }
    while below.0 + 1 < above.0 {
        let middle = Short(below.0 + (above.0 - below.0) / 2);
        if reaches(middle) {
            above = middle;
        } else {
            below = middle;
        }
    }
    Some(above)
}

/// A number below what the distance of two elements is beyond the exact sum of two numbers, by at
/// most 2^-23 of it, or by 2^-1045; 0 if and only if they are within that sum, or farther by at
/// most 2^-1045. The excess should be between two numbers, and is if the first one is above 0.
pub(super) fn below_excess(
    sum: [f64; 2],
    pair: (ElementPair, &[Point; 4]),
    between: [f64; 2],
) -> f64 {
    let excess = excess_over(sum, pair, between);
    excess.map_or(0.0, |excess| excess.before().value())
}

/// A number of at most 24 bits, 0 or more, as its place among all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Short(u64);

impl Short {
    const ZERO: Self = Self(0);
    const LARGEST: Self = Self(f64::MAX.to_bits() >> N_DROPPED);

    /// The least that is not below a number, which is 0 or more.
    fn not_below(x: f64) -> Self {
        let bits = x.to_bits();
        Self((bits >> N_DROPPED) + u64::from(bits & ((1 << N_DROPPED) - 1) != 0)).later(0)
    }

    fn value(self) -> f64 {
        f64::from_bits(self.0 << N_DROPPED)
    }

    fn before(self) -> Self {
        Self(self.0.saturating_sub(1))
    }

    fn later(self, stride: u64) -> Self {
        Self(self.0.saturating_add(stride).min(Self::LARGEST.0))
    }
}

/// The largest float that is not above the sum of two.
fn sum_below(a: f64, b: f64) -> f64 {
    let [sum, error] = two_sum(a, b);
    if error < 0.0 { sum.next_down() } else { sum }
}

/// The least float that is not below the sum of two; the largest one if there is none. Infinity,
/// if that is the first of them.
#[inline]
fn sum_up(a: f64, b: f64) -> f64 {
    let [sum, error] = two_sum(a, b);
    let sum = if error > 0.0 { sum.next_up() } else { sum };
    if a < f64::INFINITY {
        sum.min(f64::MAX)
    } else {
        a
    }
}

/// A float that is not below the sum of a number and another one; the number itself if that is 0.
fn sum_above(kept: f64, rounded: f64) -> f64 {
    if rounded > 0.0 {
        (kept + rounded).next_up()
    } else {
        kept
    }
}

/// A distance by which rounding moves two elements towards each other certainly less, where
/// vertices stand at `x0 + a * (x1 - x0)` or `x0 + a * dx` as floats give them
/// (`docs/exactness.md`, "Clearance").
fn moved_by_rounding(magnitude: f64, unit: f64) -> f64 {
    // What is below the normal numbers is wrong by less than this, too.
    let least = if unit < power_of_two(-30) {
        f64::MIN_POSITIVE
    } else {
        power_of_two(-140)
    };
    20.0 * unit * magnitude + least
}

/// The same for one pair: only vertices that move are rounded.
fn rounded_of(pair: ElementPair, [start, end]: [&[Point; 4]; 2], unit: f64) -> f64 {
    let mut magnitude: Option<f64> = None;
    for (from, to) in start.iter().zip(end).take(pair.n_points()) {
        if from != to {
            let largest = from
                .iter()
                .chain(to)
                .fold(0.0, |most: f64, x| most.max(x.abs()));
            magnitude = Some(magnitude.map_or(largest, |most| most.max(largest)));
        }
    }
    magnitude.map_or(0.0, |magnitude| moved_by_rounding(magnitude, unit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closest_points;
    use impinge_testing::random::Random;

    fn keep(separation: f64, clearance: f64, share: f64) -> Keep {
        Keep {
            separation,
            clearance,
            share,
            is_rounded: false,
        }
    }

    const FACE: [Point; 3] = [[-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [-1.0, 2.0, 0.0]];

    fn above(z: f64) -> [Point; 4] {
        [[0.0, 0.0, z], FACE[0], FACE[1], FACE[2]]
    }

    #[test]
    fn short_numbers_are_in_order() {
        for x in [
            0.0,
            1.0,
            1.0f64.next_up(),
            0.1,
            1e-300,
            5e-324,
            1e300,
            f64::MAX,
        ] {
            let short = Short::not_below(x);
            assert!(short.value() >= x || short == Short::LARGEST, "{x:e}");
            assert!(short.before().value() < x || x == 0.0 || short == Short::LARGEST);
        }
        assert_eq!(Short::not_below(1.0).value(), 1.0);
        assert_eq!(
            Short::not_below(1.0f64.next_up()).value(),
            1.0 + 2f64.powi(-23)
        );
    }

    #[test]
    fn a_pair_keeps_a_share_of_its_distance_or_the_clearance() {
        let of = |keep: Keep, z: f64| keep.beyond(ElementPair::VertexFace, &above(z));
        for (separation, clearance, share, z, expected) in [
            (0.0, 0.25, 0.25, 8.0, 0.25),
            (0.0, 0.25, 0.25, 1.0, 0.25),
            (0.0, 0.25, 0.25, 0.5, 0.125),
            (0.5, 0.25, 0.25, 1.0, 0.625),
            (0.5, 0.25, 0.25, 9.0, 0.75),
            (0.5, 0.25, 0.25, 0.5, 0.5),
            (0.5, 0.25, 0.25, 0.25, 0.5),
            (0.0, 0.25, 0.25, 0.0, 0.0),
            (0.0, 1e-4, 0.2, 1.0, 1e-4),
        ] {
            assert_eq!(of(keep(separation, clearance, share), z), expected, "{z}");
        }
        // Not above what is there, however little that is, and by the same bits as exact
        // comparisons alone.
        for z in [1e-9_f64, 1e-12, 3e-17, 0.1, 1.0 / 3.0, 5e-5, 1e-30] {
            for separation in [0.0, 1e-3, 0.1 - 1e-17, z, z.next_down(), z / 2.0] {
                for share in [0.2, 0.5, 1.0f64.next_down()] {
                    let keep = keep(separation, 1e-4, share);
                    let points = above(z);
                    let kept = keep.beyond(ElementPair::VertexFace, &points);
                    assert!(kept >= separation);
                    assert!(kept < z || z <= separation, "{z:e} {separation:e}");
                    let exact = keep.excess(ElementPair::VertexFace, &points, None);
                    let bounds = filter::bounds(ElementPair::VertexFace, &points);
                    let quick = keep.excess(ElementPair::VertexFace, &points, bounds);
                    assert_eq!(exact, quick, "{z:e} {separation:e}");
                    assert_eq!(exact.is_none(), z <= separation);
                    if let Some(excess) = exact {
                        assert!(excess.before().value() < z - separation || separation > 0.0);
                    }
                }
            }
        }
    }

    #[test]
    fn thickness_adds_to_the_separation_and_is_rounded_up() {
        let of = |separation, thickness| {
            let keep = keep(separation, 0.0, 0.0).with_thickness(thickness);
            keep.separation
        };
        assert_eq!(of(0.0, [0.0; 2]), 0.0);
        assert_eq!(of(0.5, [0.25, 0.125]), 0.875);
        // 0.1 and 0.2 add up to less than 0.30000000000000004, and to more than the float before.
        assert_eq!(of(0.0, [0.1, 0.2]), 0.1 + 0.2);
        assert_eq!(of(0.0, [1.0, 1e-300]), 1f64.next_up());
        assert_eq!(of(1e-300, [1.0, 0.0]), 1f64.next_up());
        assert_eq!(of(1.0, [0.1, 0.7]), of(1.0, [0.7, 0.1]));
        assert_eq!(of(0.0, [f64::MAX, f64::MAX]), f64::MAX);
        assert_eq!(of(f64::MAX, [5e-324, 0.0]), f64::MAX);
        assert_eq!(of(f64::INFINITY, [1.0, f64::MAX]), f64::INFINITY);
    }

    /// On a small lattice, where pairs begin and end in touch, or as far apart as they may come.
    #[test]
    fn whether_elements_come_near_does_not_depend_on_when_they_do() {
        let mut random = Random::new(7);
        let pairs = [
            ElementPair::VertexVertex,
            ElementPair::VertexEdge,
            ElementPair::VertexFace,
            ElementPair::EdgeEdge,
        ];
        let mut n_at_end_alone = 0;
        for round in 0..20_000 {
            let pair = pairs[round % 4];
            let mut at = || [(); 4].map(|()| [(); 3].map(|()| f64::from(random.below(4))));
            let ends = [at(), at()];
            let keep = [
                keep(0.0, 0.0, 0.0),
                keep(1.0, 0.0, 0.0),
                keep(0.5, 0.5, 0.5),
                keep(0.0, 0.25, 0.5),
            ][round / 4 % 4];
            let ends = ends.each_ref();
            let [first, whenever] =
                [Keep::first, Keep::whenever].map(|ask| ask(&keep, pair, ends, f64::EPSILON));
            assert_eq!(
                whenever.map(|contact| contact.at_start),
                first.map(|contact| contact.at_start),
                "{pair:?} {keep:?} {ends:?}"
            );
            if let (Some(whenever), Some(first)) = (whenever, first) {
                assert!(whenever.time <= first.time);
                n_at_end_alone += usize::from(first.time == 1.0);
            }
        }
        assert!(n_at_end_alone > 100, "{n_at_end_alone}");
    }

    /// No number of 24 bits reaches elements that are farther apart than the largest of them.
    #[test]
    fn elements_may_be_farther_apart_than_any_number() {
        let pair = ElementPair::VertexVertex;
        let points = [
            [-1.7e308, 0.0, 0.0],
            [1.7e308, 0.0, 0.0],
            [0.0; 3],
            [0.0; 3],
        ];
        for separation in [0.0, 1.0, 1e308] {
            let kept = keep(separation, 1e-4, 0.2).beyond(pair, &points);
            assert_eq!(kept, sum_below(separation, 1e-4));
        }
    }

    /// Enclosures of distances and exact comparisons give the same number for elements in any
    /// position.
    #[test]
    fn the_excess_does_not_depend_on_the_enclosure() {
        let mut random = Random::new(1);
        let pairs = [
            ElementPair::VertexVertex,
            ElementPair::VertexEdge,
            ElementPair::VertexFace,
            ElementPair::EdgeEdge,
        ];
        for round in 0..400 {
            let mut points: [Point; 4] = Default::default();
            let scale = [1.0, 1e-6, 1024.0][round % 3];
            points
                .as_flattened_mut()
                .iter_mut()
                .for_each(|x| *x = scale * f64::from(random.unit()));
            let pair = pairs[round % 4];
            let keep = keep(0.0, 1.0, 0.5);
            let bounds = filter::bounds(pair, &points);
            let quick = keep.excess(pair, &points, bounds);
            assert_eq!(quick, keep.excess(pair, &points, None));
            let distance = closest_points(pair, &points).distance;
            let excess = quick.expect("apart").value();
            assert!((excess / distance - 1.0).abs() < 2e-7);
        }
    }

    /// Positions as floats give them are no farther from the way than the number says.
    #[test]
    fn rounding_moves_positions_by_less() {
        let mut random = Random::new(7);
        let mut next = || random.range(-1.0, 1.0);
        let mut most: f64 = 0.0;
        for _ in 0..100_000 {
            let (x0, dx, a) = (next(), next(), next().abs());
            let x1 = x0 + dx;
            let unit = 2f64.powi(-24);
            let bound = moved_by_rounding(f64::from(x0.abs().max(x1.abs())), unit);
            let way = f64::from(x0) + f64::from(a) * (f64::from(x1) - f64::from(x0));
            for at in [x0 + a * (x1 - x0), x0 + a * dx] {
                let off = (f64::from(at) - way).abs();
                most = most.max(2.0 * 3f64.sqrt() * off / bound);
            }
        }
        assert!((0.1..1.0).contains(&most), "{most}");
    }
}
