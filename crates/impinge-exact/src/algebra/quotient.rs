//! Integers as multiples of a power of two, and their quotients rounded to floats.

use core::cmp::Ordering;

use super::integer::{Integer, parts};
use crate::Sign;
use crate::rounding::power_of_two;

impl Integer {
    /// `x · 2^-unit`, where `x` is a multiple of `2^unit`.
    pub fn of_multiple(x: f64, unit: i64) -> Self {
        let (magnitude, exponent) = parts(x);
        if magnitude == 0 {
            return Integer::zero();
        }
        let shift = u64::try_from(exponent - unit).expect("a multiple of the unit");
        let whole = Integer::from(magnitude).shifted(shift);
        if x < 0.0 { -&whole } else { whole }
    }

    /// The magnitude.
    pub fn abs(self) -> Self {
        if self.sign() == Sign::Negative {
            -&self
        } else {
            self
        }
    }

    /// `self / divisor · 2^unit` for a positive divisor, rounded to the nearest number with
    /// `precision` bits that is a multiple of `2^lowest`, ties to even. `precision` is at most 53
    /// and `lowest` at least -1074, so that an `f64` holds the result.
    pub fn quotient(&self, divisor: &Self, unit: i64, precision: u32, lowest: i64) -> f64 {
        debug_assert!(divisor.sign() == Sign::Positive);
        if self.is_zero() {
            return 0.0;
        }
        // |self| / divisor lies in [2^(e-1), 2^(e+1)), so with this quantum the quotient has at
        // most one bit too many, and never too few.
        let bits = |number: &Integer| number.n_bits().cast_signed();
        let mut quantum = (bits(self) - bits(divisor) + unit - i64::from(precision)).max(lowest);
        let (mut whole, mut rest, mut scaled) = self.divided(divisor, quantum - unit);
        if whole >> precision != 0 {
            quantum += 1;
            (whole, rest, scaled) = self.divided(divisor, quantum - unit);
        }
        match rest.shifted(1).compare_magnitude(&scaled) {
            Ordering::Greater => whole += 1,
            Ordering::Equal => whole += whole & 1,
            Ordering::Less => {}
        }
        // At most 2^53 times a power of two that is not below the smallest `f64`: exact.
        #[allow(clippy::cast_precision_loss, reason = "at most 2^53")]
        let magnitude = whole as f64 * power_of_two(i32::try_from(quantum).unwrap_or(0));
        if self.sign() == Sign::Negative {
            -magnitude
        } else {
            magnitude
        }
    }

    /// Quotient and remainder of `|self|` divided by `divisor · 2^exponent`, and the divisor that
    /// belongs to the remainder: both are scaled so that they are integers. The quotient must fit
    /// 64 bits.
    fn divided(&self, divisor: &Self, exponent: i64) -> (u64, Integer, Integer) {
        let by = |n: i64| n.max(0).unsigned_abs();
        let mut rest = self.clone().abs().shifted(by(-exponent));
        let scaled = divisor.shifted(by(exponent));
        let n_bits = (rest.n_bits() + 1).saturating_sub(scaled.n_bits());
        let mut whole = 0u64;
        for bit in (0..n_bits).rev() {
            let part = scaled.shifted(bit);
            whole <<= 1;
            if rest.compare_magnitude(&part) != Ordering::Less {
                rest = &rest - &part;
                whole |= 1;
            }
        }
        (whole, rest, scaled)
    }
}

/// The largest `e` such that `x` is a multiple of `2^e`; `None` for zero.
pub fn unit_of(x: f64) -> Option<i64> {
    match parts(x) {
        (0, _) => None,
        (_, exponent) => Some(exponent),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dashu_int::IBig;
    use impinge_testing::random::Random;

    fn big(x: &Integer) -> IBig {
        let magnitude = x
            .limbs()
            .iter()
            .rev()
            .fold(IBig::ZERO, |sum, &limb| (sum << 64) + limb);
        match x.sign() {
            Sign::Negative => -magnitude,
            _ => magnitude,
        }
    }

    fn of_limbs(limbs: &[u64]) -> Integer {
        limbs.iter().rev().fold(Integer::zero(), |sum, &limb| {
            &sum.shifted(64) + &Integer::from(limb)
        })
    }

    /// An awkward number.
    fn integer(random: &mut Random) -> Integer {
        let limbs = (0..random.below(5)).map(|_| match random.below(4) {
            0 => 0,
            1 => u64::MAX,
            _ => random.bits(),
        });
        let number = of_limbs(&Vec::from_iter(limbs));
        match random.below(2) {
            0 => -&number,
            _ => number,
        }
    }

    #[test]
    fn sums_and_products() {
        let mut random = Random::new(1);
        for _ in 0..20_000 {
            let (a, b) = (integer(&mut random), integer(&mut random));
            assert_eq!(big(&(&a + &b)), big(&a) + big(&b));
            assert_eq!(big(&(&a - &b)), big(&a) - big(&b));
            assert_eq!(big(&(&a * &b)), big(&a) * big(&b));
            assert_eq!(&a - &a, Integer::zero());
        }
    }

    #[test]
    fn numbers_in_units() {
        let mut random = Random::new(2);
        for _ in 0..2_000 {
            let x = f64::from_bits(random.bits());
            if !x.is_finite() {
                continue;
            }
            let unit = unit_of(x).unwrap();
            let divisor = Integer::of_multiple(1.0, 0);
            for lower in [0, 1, 70, 300] {
                let unit = (unit - lower).max(-1400);
                let whole = Integer::of_multiple(x, unit);
                assert_eq!(
                    whole.quotient(&divisor, unit, 53, -1074).to_bits(),
                    x.to_bits()
                );
                let single = whole.quotient(&divisor, unit, 24, -149);
                if (x as f32).is_finite() {
                    assert_eq!(single, f64::from(x as f32), "{x:e}");
                }
            }
        }
        assert_eq!(unit_of(0.0), None);
        assert_eq!(Integer::of_multiple(-0.0, 5), Integer::zero());
    }

    /// No number with 53 bits lies nearer; of two equally near, the result is the even one.
    #[test]
    fn quotients_are_the_nearest() {
        let mut random = Random::new(3);
        for round in 0..20_000 {
            let mut a = integer(&mut random);
            let b = integer(&mut random).abs();
            if b.is_zero() {
                continue;
            }
            if round % 3 == 0 {
                // A tie, or next to one: an odd number of 54 bits.
                let tie = Integer::from(random.bits() >> 10 | 1 | 1 << 53);
                let more = Integer::from(random.bits() % 2);
                a = &b * &tie;
                a = if round % 2 == 0 {
                    &a - &more
                } else {
                    &a + &more
                };
            }
            let x = a.quotient(&b, 0, 53, -1074);
            // |a/b - y| for multiples of 2^-400, times b.
            let scaled = a.shifted(400);
            let far = |y: f64| (&scaled - &(&Integer::of_multiple(y, -400) * &b)).abs();
            if x == 0.0 {
                assert!(a.is_zero());
                continue;
            }
            let here = far(x);
            for other in [x.next_down(), x.next_up()] {
                match here.compare_magnitude(&far(other)) {
                    Ordering::Less => {}
                    Ordering::Equal => assert!(x.to_bits().is_multiple_of(2), "{x}"),
                    Ordering::Greater => panic!("{x} is farther than {other}"),
                }
            }
        }
    }
}
