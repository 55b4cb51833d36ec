//! Integers of any size, for exact coordinates when `f64` is not enough.
//!
//! A sign and a magnitude in 64-bit limbs, lowest first, without leading zero limbs. It can only do what
//! [`coordinates`](super::coordinates) needs: conversion from `f64`, sum, product, order, and the
//! quotient of two numbers rounded to nearest. Products are schoolbook: numbers have at most a few
//! thousand bits.

use std::cmp::Ordering;

/// An integer of any size.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Integer {
    negative: bool,
    limbs: Vec<u64>,
}

impl Integer {
    fn new(negative: bool, mut limbs: Vec<u64>) -> Self {
        while limbs.last() == Some(&0) {
            limbs.pop();
        }
        Integer {
            negative: negative && !limbs.is_empty(),
            limbs,
        }
    }

    /// `x · 2^-unit`, where `x` is a multiple of `2^unit`.
    pub fn of_multiple(x: f64, unit: i32) -> Self {
        let (magnitude, exponent) = parts(x);
        if magnitude == 0 {
            return Integer::default();
        }
        let shift = u32::try_from(exponent - unit).expect("a multiple of the unit");
        Integer::new(x < 0.0, vec![magnitude]).shifted(shift)
    }

    pub fn is_zero(&self) -> bool {
        self.limbs.is_empty()
    }

    pub fn abs(mut self) -> Self {
        self.negative = false;
        self
    }

    pub fn add(&self, other: &Self) -> Self {
        if self.negative == other.negative {
            return Integer::new(self.negative, sum(&self.limbs, &other.limbs));
        }
        match compare(&self.limbs, &other.limbs) {
            Ordering::Less => Integer::new(other.negative, difference(&other.limbs, &self.limbs)),
            _ => Integer::new(self.negative, difference(&self.limbs, &other.limbs)),
        }
    }

    pub fn sub(&self, other: &Self) -> Self {
        let negated = Integer {
            negative: !other.negative && !other.is_zero(),
            limbs: other.limbs.clone(),
        };
        self.add(&negated)
    }

    pub fn mul(&self, other: &Self) -> Self {
        let mut limbs = vec![0u64; self.limbs.len() + other.limbs.len()];
        for (i, &x) in self.limbs.iter().enumerate() {
            let mut carry = 0u128;
            for (j, &y) in other.limbs.iter().enumerate() {
                let word = u128::from(x) * u128::from(y) + u128::from(limbs[i + j]) + carry;
                limbs[i + j] = low(word);
                carry = word >> 64;
            }
            limbs[i + other.limbs.len()] = low(carry);
        }
        Integer::new(self.negative != other.negative, limbs)
    }

    /// The number of bits of the magnitude; 0 for zero.
    fn bits(&self) -> i32 {
        let whole = self.limbs.len() * 64;
        let spare = self.limbs.last().map_or(0, |limb| limb.leading_zeros());
        i32::try_from(whole).expect("numbers of a few thousand bits") - spare.cast_signed()
    }

    fn shifted(&self, by: u32) -> Self {
        let (words, bits) = ((by / 64) as usize, by % 64);
        let mut limbs = vec![0u64; words];
        let mut carry = 0;
        for &limb in &self.limbs {
            let word = (u128::from(limb) << bits) | carry;
            limbs.push(low(word));
            carry = word >> 64;
        }
        limbs.push(low(carry));
        Integer::new(self.negative, limbs)
    }

    /// `self / divisor · 2^unit` for a positive divisor, rounded to the nearest number with
    /// `precision` bits that is a multiple of `2^lowest`, ties to even. `precision` is at most 53 and
    /// `lowest` at least -1074, so that an `f64` holds the result.
    pub fn quotient(&self, divisor: &Self, unit: i32, precision: i32, lowest: i32) -> f64 {
        debug_assert!(!divisor.negative && !divisor.is_zero());
        if self.is_zero() {
            return 0.0;
        }
        // |self| / divisor lies in [2^(e-1), 2^(e+1)), so with this quantum the quotient has at most
        // one bit too many, and never too few.
        let mut quantum = (self.bits() - divisor.bits() + unit - precision).max(lowest);
        let (mut whole, mut rest, mut scaled) = self.divided(divisor, quantum - unit);
        if whole >> precision != 0 {
            quantum += 1;
            (whole, rest, scaled) = self.divided(divisor, quantum - unit);
        }
        let twice = rest.shifted(1);
        match compare(&twice.limbs, &scaled.limbs) {
            Ordering::Greater => whole += 1,
            Ordering::Equal => whole += whole & 1,
            Ordering::Less => {}
        }
        // At most 2^53 times a power of two that is not below the smallest `f64`: exact.
        let magnitude = whole as f64 * power(quantum);
        if self.negative { -magnitude } else { magnitude }
    }

    /// Quotient and remainder of `|self|` divided by `divisor · 2^exponent`, and the divisor that belongs to the
    /// remainder: both are scaled so that they are integers. The quotient must fit 64 bits.
    fn divided(&self, divisor: &Self, exponent: i32) -> (u64, Integer, Integer) {
        let by = |n: i32| n.max(0).unsigned_abs();
        let mut rest = self.clone().abs().shifted(by(-exponent));
        let scaled = divisor.shifted(by(exponent));
        let n_bits = rest.bits() - scaled.bits() + 1;
        let mut whole = 0u64;
        for bit in (0..by(n_bits)).rev() {
            let part = scaled.shifted(bit);
            whole <<= 1;
            if compare(&rest.limbs, &part.limbs) != Ordering::Less {
                rest = Integer::new(false, difference(&rest.limbs, &part.limbs));
                whole |= 1;
            }
        }
        (whole, rest, scaled)
    }
}

/// Magnitude and exponent: `|x| = magnitude · 2^exponent`, the magnitude odd or zero.
fn parts(x: f64) -> (u64, i32) {
    let bits = x.to_bits();
    let biased = i32::from((bits >> 52) as u16 & 0x7ff);
    let fraction = bits & ((1 << 52) - 1);
    let (magnitude, exponent) = match biased {
        0 => (fraction, -1074),
        _ => (fraction | 1 << 52, biased - 1075),
    };
    if magnitude == 0 {
        return (0, 0);
    }
    let zeros = magnitude.trailing_zeros();
    (magnitude >> zeros, exponent + zeros.cast_signed())
}

/// The largest `e` such that `x` is a multiple of `2^e`; `None` for zero.
pub(super) fn unit_of(x: f64) -> Option<i32> {
    match parts(x) {
        (0, _) => None,
        (_, exponent) => Some(exponent),
    }
}

/// `2^exponent` for exponents from -1074 to 1023.
fn power(exponent: i32) -> f64 {
    if exponent >= -1022 {
        f64::from_bits(u64::from((exponent + 1023).unsigned_abs()) << 52)
    } else {
        f64::from_bits(1 << (exponent + 1074))
    }
}

fn low(word: u128) -> u64 {
    word as u64
}

fn compare(a: &[u64], b: &[u64]) -> Ordering {
    a.len()
        .cmp(&b.len())
        .then_with(|| a.iter().rev().cmp(b.iter().rev()))
}

fn sum(a: &[u64], b: &[u64]) -> Vec<u64> {
    let (long, short) = if a.len() < b.len() { (b, a) } else { (a, b) };
    let mut carry = 0u128;
    let mut limbs = Vec::with_capacity(long.len() + 1);
    for (ix, &limb) in long.iter().enumerate() {
        let other = short.get(ix).copied().unwrap_or(0);
        let word = u128::from(limb) + u128::from(other) + carry;
        limbs.push(low(word));
        carry = word >> 64;
    }
    limbs.push(low(carry));
    limbs
}

/// `a - b`, where `a >= b`.
fn difference(a: &[u64], b: &[u64]) -> Vec<u64> {
    let mut borrow = false;
    a.iter()
        .enumerate()
        .map(|(ix, &limb)| {
            let (part, first) = limb.overflowing_sub(b.get(ix).copied().unwrap_or(0));
            let (word, second) = part.overflowing_sub(u64::from(borrow));
            borrow = first || second;
            word
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use dashu_int::IBig;

    fn big(x: &Integer) -> IBig {
        let magnitude = x
            .limbs
            .iter()
            .rev()
            .fold(IBig::ZERO, |sum, &limb| (sum << 64) + limb);
        if x.negative { -magnitude } else { magnitude }
    }

    /// A generator of awkward numbers.
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> u64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            self.0
        }

        fn integer(&mut self) -> Integer {
            let n = self.next() % 5;
            let limbs = (0..n)
                .map(|_| match self.next() % 4 {
                    0 => 0,
                    1 => u64::MAX,
                    _ => self.next(),
                })
                .collect();
            Integer::new(self.next().is_multiple_of(2), limbs)
        }
    }

    #[test]
    fn sums_and_products() {
        let mut numbers = Numbers(1);
        for _ in 0..20_000 {
            let (a, b) = (numbers.integer(), numbers.integer());
            assert_eq!(big(&a.add(&b)), big(&a) + big(&b));
            assert_eq!(big(&a.sub(&b)), big(&a) - big(&b));
            assert_eq!(big(&a.mul(&b)), big(&a) * big(&b));
            assert_eq!(a.sub(&a), Integer::default());
        }
    }

    #[test]
    fn numbers_in_units() {
        let mut numbers = Numbers(2);
        for _ in 0..2_000 {
            let x = f64::from_bits(numbers.next());
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
        assert_eq!(Integer::of_multiple(-0.0, 5), Integer::default());
    }

    /// No number with 53 bits lies nearer; of two equally near, the result is the even one.
    #[test]
    fn quotients_are_the_nearest() {
        let mut numbers = Numbers(3);
        for round in 0..20_000 {
            let mut a = numbers.integer();
            let mut b = numbers.integer().abs();
            if b.is_zero() {
                continue;
            }
            if round % 3 == 0 {
                // A tie, or next to one: an odd number of 54 bits.
                let tie = Integer::new(false, vec![numbers.next() >> 10 | 1 | 1 << 53]);
                a = b
                    .mul(&tie)
                    .add(&Integer::new(round % 2 == 0, vec![numbers.next() % 2]));
                b = b.abs();
            }
            let x = a.quotient(&b, 0, 53, -1074);
            // |a/b - y| for multiples of 2^-400, times b.
            let scaled = a.shifted(400);
            let far = |y: f64| scaled.sub(&Integer::of_multiple(y, -400).mul(&b)).abs();
            if x == 0.0 {
                assert!(a.is_zero());
                continue;
            }
            let here = far(x);
            for other in [x.next_down(), x.next_up()] {
                match compare(&here.limbs, &far(other).limbs) {
                    Ordering::Less => {}
                    Ordering::Equal => assert!(x.to_bits().is_multiple_of(2), "{x}"),
                    Ordering::Greater => panic!("{x} is farther than {other}"),
                }
            }
        }
    }
}
