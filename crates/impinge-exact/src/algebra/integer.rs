//! Integers of any size: sign and magnitude.

use core::cmp::Ordering;
use core::ops::{Add, Mul, Neg, Sub};

use smallvec::SmallVec;

use crate::Sign;

/// Limbs of 64 bits that are kept without allocation: 512 bits.
const INLINE: usize = 8;

type Limbs = SmallVec<[u64; INLINE]>;

/// An integer of any size.
///
/// Zero has no limbs and is not negative; the last limb of any other number is not zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Integer {
    is_negative: bool,
    limbs: Limbs,
}

impl Integer {
    /// The number 0.
    pub const fn zero() -> Self {
        Self {
            is_negative: false,
            limbs: SmallVec::new_const(),
        }
    }

    /// Whether it is 0.
    #[inline]
    pub fn is_zero(&self) -> bool {
        self.limbs.is_empty()
    }

    /// Its sign.
    #[inline]
    pub fn sign(&self) -> Sign {
        match (self.limbs.is_empty(), self.is_negative) {
            (true, _) => Sign::Zero,
            (_, true) => Sign::Negative,
            _ => Sign::Positive,
        }
    }

    /// Bits of the magnitude; 0 for zero.
    pub(crate) fn n_bits(&self) -> u64 {
        self.limbs.last().map_or(0, |last| {
            64 * self.limbs.len() as u64 - u64::from(last.leading_zeros())
        })
    }

    /// The number times 2^`shift`.
    pub(crate) fn shifted(&self, shift: u64) -> Self {
        if self.is_zero() || shift == 0 {
            return self.clone();
        }
        let n_limbs = usize::try_from(shift / 64).expect("a shift below the size of the memory");
        let n_bits = shift % 64;
        let mut limbs: Limbs = SmallVec::from_elem(0, n_limbs);
        if n_bits == 0 {
            limbs.extend_from_slice(&self.limbs);
        } else {
            let mut carry = 0;
            for &limb in &self.limbs {
                limbs.push(limb << n_bits | carry);
                carry = limb >> (64 - n_bits);
            }
            if carry != 0 {
                limbs.push(carry);
            }
        }
        Self {
            is_negative: self.is_negative,
            limbs,
        }
    }

    /// How many times 2 divides the number; 0 for zero.
    pub(crate) fn trailing_zeros(&self) -> u64 {
        self.limbs
            .iter()
            .position(|&limb| limb != 0)
            .map_or(0, |ix| {
                64 * ix as u64 + u64::from(self.limbs[ix].trailing_zeros())
            })
    }

    /// The number divided by 2^`shift`, which must divide it.
    pub(crate) fn unshifted(&self, shift: u64) -> Self {
        if self.is_zero() || shift == 0 {
            return self.clone();
        }
        let n_limbs = usize::try_from(shift / 64).expect("a shift below the size of the number");
        let n_bits = shift % 64;
        let kept = &self.limbs[n_limbs..];
        let mut limbs: Limbs = SmallVec::with_capacity(kept.len());
        for (ix, &limb) in kept.iter().enumerate() {
            let above = kept.get(ix + 1).copied().unwrap_or(0);
            limbs.push(if n_bits == 0 {
                limb
            } else {
                limb >> n_bits | above << (64 - n_bits)
            });
        }
        Self::new(self.is_negative, limbs)
    }

    /// `self * factor`, for a small factor.
    pub(crate) fn times(&self, factor: u64) -> Self {
        if factor == 1 {
            return self.clone();
        }
        self * &Self::from(factor)
    }

    /// `x * 2^exponent` with 1 <= |x| < 2, rounded towards zero; (0, 0) for zero. Only for guesses.
    pub(crate) fn approximate(&self) -> (f64, i64) {
        approximate(self.is_negative, &self.limbs)
    }

    /// Compares magnitudes.
    pub(super) fn compare_magnitude(&self, other: &Self) -> Ordering {
        compare_magnitudes(&self.limbs, &other.limbs)
    }

    /// The magnitude, lowest limb first, without leading zeros.
    #[cfg(test)]
    pub(super) fn limbs(&self) -> &[u64] {
        &self.limbs
    }

    /// Drops leading zeros.
    fn new(is_negative: bool, mut limbs: Limbs) -> Self {
        while limbs.last() == Some(&0) {
            limbs.pop();
        }
        Self {
            is_negative: is_negative && !limbs.is_empty(),
            limbs,
        }
    }

    /// A number of at most two limbs, from its magnitude.
    #[inline]
    fn short(is_negative: bool, magnitude: u128) -> Self {
        let [low, high] = halves(magnitude);
        let n = usize::from(magnitude != 0) + usize::from(high != 0);
        let mut limbs = [0; INLINE];
        [limbs[0], limbs[1]] = [low, high];
        Self {
            is_negative: is_negative && n > 0,
            limbs: SmallVec::from_buf_and_len(limbs, n),
        }
    }

    /// The magnitude, if it is below 2^127.
    #[inline]
    fn short_magnitude(&self) -> Option<u128> {
        match *self.limbs {
            [] => Some(0),
            [low] => Some(u128::from(low)),
            [low, high] if high >> 63 == 0 => Some(u128::from(high) << 64 | u128::from(low)),
            _ => None,
        }
    }

    #[inline]
    fn sum(&self, other: &Self, other_is_negative: bool) -> Self {
        if let (Some(a), Some(b)) = (self.short_magnitude(), other.short_magnitude()) {
            return if self.is_negative == other_is_negative {
                Self::short(self.is_negative, a + b)
            } else if a >= b {
                Self::short(self.is_negative, a - b)
            } else {
                Self::short(other_is_negative, b - a)
            };
        }
        self.long_sum(other, other_is_negative)
    }

    fn long_sum(&self, other: &Self, other_is_negative: bool) -> Self {
        if other.is_zero() {
            return self.clone();
        }
        if self.is_zero() {
            return Self {
                is_negative: other_is_negative,
                limbs: other.limbs.clone(),
            };
        }
        if self.is_negative == other_is_negative {
            let limbs = add_magnitudes(&self.limbs, &other.limbs);
            return Self {
                is_negative: self.is_negative,
                limbs,
            };
        }
        match compare_magnitudes(&self.limbs, &other.limbs) {
            Ordering::Equal => Self::zero(),
            Ordering::Greater => Self::new(
                self.is_negative,
                subtract_magnitudes(&self.limbs, &other.limbs),
            ),
            Ordering::Less => Self::new(
                other_is_negative,
                subtract_magnitudes(&other.limbs, &self.limbs),
            ),
        }
    }
}

/// `x * 2^exponent` with 1 <= |x| < 2, rounded towards zero to 53 bits; (0, 0) for zero. Limbs are
/// lowest first.
#[allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_wrap,
    reason = "53 bits; fewer than 2^63 bits fit any memory"
)]
pub(super) fn approximate(is_negative: bool, limbs: &[u64]) -> (f64, i64) {
    let Some(last) = limbs.iter().rposition(|&limb| limb != 0) else {
        return (0.0, 0);
    };
    let below = if last > 0 { limbs[last - 1] } else { 0 };
    let n_zeros = limbs[last].leading_zeros();
    let top = (u128::from(limbs[last]) << 64 | u128::from(below)) << n_zeros;
    // 53 bits: a conversion of 64 bits is one instruction, one of 128 a function.
    let magnitude = ((top >> 75) as u64 as f64) * f64::from_bits((1023 - 52) << 52);
    let x = if is_negative { -magnitude } else { magnitude };
    (x, 64 * last as i64 + 63 - i64::from(n_zeros))
}

impl From<u64> for Integer {
    fn from(x: u64) -> Self {
        let mut limbs = Limbs::new();
        if x != 0 {
            limbs.push(x);
        }
        Self {
            is_negative: false,
            limbs,
        }
    }
}

#[allow(clippy::cast_possible_truncation, reason = "the lower half is wanted")]
#[inline]
pub(super) fn halves(x: u128) -> [u64; 2] {
    [x as u64, (x >> 64) as u64]
}

fn compare_magnitudes(a: &[u64], b: &[u64]) -> Ordering {
    a.len()
        .cmp(&b.len())
        .then_with(|| a.iter().rev().cmp(b.iter().rev()))
}

fn add_magnitudes(a: &[u64], b: &[u64]) -> Limbs {
    let (long, short) = if a.len() < b.len() { (b, a) } else { (a, b) };
    let mut sum = Limbs::from_slice(long);
    let mut carry = false;
    for (limb, &other) in sum.iter_mut().zip(short) {
        let (x, first) = limb.overflowing_add(other);
        let (x, second) = x.overflowing_add(u64::from(carry));
        *limb = x;
        carry = first | second;
    }
    for limb in &mut sum[short.len()..] {
        if !carry {
            break;
        }
        (*limb, carry) = limb.overflowing_add(1);
    }
    if carry {
        sum.push(1);
    }
    sum
}

/// a - b where a > b.
fn subtract_magnitudes(a: &[u64], b: &[u64]) -> Limbs {
    let mut difference = Limbs::from_slice(a);
    let mut borrow = false;
    for (limb, &other) in difference.iter_mut().zip(b) {
        let (x, first) = limb.overflowing_sub(other);
        let (x, second) = x.overflowing_sub(u64::from(borrow));
        *limb = x;
        borrow = first | second;
    }
    for limb in &mut difference[b.len()..] {
        if !borrow {
            break;
        }
        (*limb, borrow) = limb.overflowing_sub(1);
    }
    difference
}

impl Add for &Integer {
    type Output = Integer;

    fn add(self, other: Self) -> Integer {
        self.sum(other, other.is_negative)
    }
}

impl Sub for &Integer {
    type Output = Integer;

    fn sub(self, other: Self) -> Integer {
        self.sum(other, !other.is_negative)
    }
}

impl Neg for &Integer {
    type Output = Integer;

    fn neg(self) -> Integer {
        Integer {
            is_negative: !self.is_negative && !self.is_zero(),
            limbs: self.limbs.clone(),
        }
    }
}

impl Mul for &Integer {
    type Output = Integer;

    #[allow(clippy::cast_possible_truncation, reason = "limbs of wide products")]
    fn mul(self, other: Self) -> Integer {
        let (a, b) = (&self.limbs, &other.limbs);
        if let ([x], [y]) = (&**a, &**b) {
            let product = u128::from(*x) * u128::from(*y);
            return Self::Output::short(self.is_negative != other.is_negative, product);
        }
        if a.is_empty() || b.is_empty() {
            return Integer::zero();
        }
        let mut limbs: Limbs = SmallVec::from_elem(0, a.len() + b.len());
        for (i, &x) in a.iter().enumerate() {
            let mut carry = 0_u64;
            let (row, above) = limbs[i..].split_at_mut(b.len());
            for (limb, &y) in row.iter_mut().zip(b) {
                let wide = u128::from(x) * u128::from(y) + u128::from(*limb) + u128::from(carry);
                *limb = wide as u64;
                carry = (wide >> 64) as u64;
            }
            above[0] = carry;
        }
        Integer::new(self.is_negative != other.is_negative, limbs)
    }
}

/// Finite floats as integers over one power of two.
///
/// Returns the integers n and the exponent e: each number is n * 2^e. All zero: e is 0.
pub(crate) fn common_integers<const N: usize>(numbers: [f64; N]) -> ([Integer; N], i64) {
    let parts = numbers.map(parts);
    let lowest = parts
        .iter()
        .filter(|(mantissa, _)| *mantissa != 0)
        .map(|&(_, exponent)| exponent)
        .min()
        .unwrap_or(0);
    let integers = core::array::from_fn(|ix| {
        let (mantissa, exponent) = parts[ix];
        if mantissa == 0 {
            return Integer::zero();
        }
        let mut integer = Integer::from(mantissa)
            .shifted(u64::try_from(exponent - lowest).expect("not below the lowest"));
        integer.is_negative = numbers[ix] < 0.0;
        integer
    });
    (integers, lowest)
}

/// Magnitude of a finite float as mantissa * 2^exponent; the mantissa is odd or zero.
#[allow(clippy::cast_possible_wrap, reason = "eleven bits")]
pub(crate) fn parts(x: f64) -> (u64, i64) {
    let bits = x.to_bits();
    let biased = (bits >> 52 & 0x7ff) as i64;
    let fraction = bits & ((1 << 52) - 1);
    let (mantissa, exponent) = if biased == 0 {
        (fraction, -1074)
    } else {
        (fraction | 1 << 52, biased - 1075)
    };
    if mantissa == 0 {
        return (0, 0);
    }
    let shift = mantissa.trailing_zeros();
    (mantissa >> shift, exponent + i64::from(shift))
}
