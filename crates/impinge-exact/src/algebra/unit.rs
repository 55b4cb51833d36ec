//! Floats as whole numbers of a unit, in 64 bits.

use crate::Point;
use crate::twice::two_sum;

/// The magnitude of numbers of units is below 2^61.
const BITS: i64 = 61;

/// Sizes between which powers of two are far from the ends of the floats.
const SMALLEST: f64 = f64::from_bits((1023 - 400) << 52);
const LARGEST: f64 = f64::from_bits((1023 + 400) << 52);

/// A power of two.
pub(crate) struct Unit {
    unit: f64,
    per_unit: f64,
    pub(crate) exponent: i64,
}

impl Unit {
    /// Differences of points and the unit that they are counted in, with which `other` is below
    /// 2^61 too. `None` if one is not a whole number of units.
    ///
    /// Each coordinate is the sum of a rounded difference and its error. With the unit that keeps
    /// all of them below 2^61, they only have to be whole.
    pub(crate) fn differences<const N: usize>(
        pairs: [[&Point; 2]; N],
        other: f64,
    ) -> Option<(Self, [[i64; 3]; N])> {
        let mut largest = other;
        let parts = pairs.map(|[p, q]| {
            core::array::from_fn::<_, 3, _>(|axis| {
                let part = two_sum(p[axis], -q[axis]);
                largest = largest.max(part[0].abs());
                part
            })
        });
        let unit = Self::for_sizes_to(largest)?;
        let mut are_whole = true;
        let numbers = parts.map(|parts| {
            parts.map(|part| {
                let (number, is_whole) = unit.count_both(part);
                are_whole &= is_whole;
                number
            })
        });
        are_whole.then_some((unit, numbers))
    }

    /// The unit of which numbers up to a size are less than 2^61. `None` for sizes far out.
    fn for_sizes_to(largest: f64) -> Option<Self> {
        if largest >= LARGEST {
            return None;
        }
        // The inverse is 2^(BITS - 1 - e), where 2^e <= largest < 2^(e+1).
        let exponent = exponent_of(largest.max(SMALLEST)) + 1 - BITS;
        Some(Self {
            unit: power(exponent),
            per_unit: power(-exponent),
            exponent,
        })
    }

    /// A number in units, and whether it is a whole number of them.
    #[allow(clippy::cast_possible_truncation, reason = "checked")]
    #[allow(clippy::cast_precision_loss, reason = "checked")]
    #[inline]
    pub(crate) fn count(&self, x: f64) -> (i64, bool) {
        let n = (x * self.per_unit) as i64;
        (n, n as f64 * self.unit == x)
    }

    /// [`Unit::count`] of the sum of two numbers, each of which must be whole.
    #[inline]
    fn count_both(&self, [high, low]: [f64; 2]) -> (i64, bool) {
        let (high, is_high) = self.count(high);
        let (low, is_low) = self.count(low);
        (high + low, is_high & is_low)
    }
}

/// The exponent of a positive float that is normal: 2^exponent <= x < 2^(exponent + 1).
#[allow(clippy::cast_possible_wrap, reason = "eleven bits")]
fn exponent_of(x: f64) -> i64 {
    (x.to_bits() >> 52) as i64 - 1023
}

/// 2^exponent, for exponents of magnitude below 1000.
#[allow(clippy::cast_sign_loss, reason = "positive")]
fn power(exponent: i64) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}
