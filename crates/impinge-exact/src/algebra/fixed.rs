//! Integers of fixed width, and what they have in common with those of any size.
//!
//! What it does: lets one algorithm run on integers of fixed width where numbers are short, and on
//! [`Integer`] where they are not. The product of two numbers has a type of its own, with twice the
//! bits:
//!
//! ```text
//! i64  x  i64  ->  i128  x  i128  ->  Wide<4> (256 bits)  x  Wide<4>  ->  Wide<8> (512 bits)
//! ```
//!
//! Cost: a product of two `i64` is one instruction, one of two `i128` four, one of two `Wide<4>`
//! sixteen. Nothing is allocated.
//!
//! Invariant: products are exact. Sums are exact as long as their value fits the type: callers
//! bound their numbers.

use super::integer::{Integer, approximate, halves};
use crate::Sign;

/// An integer of some type.
pub(crate) trait Whole: Clone {
    /// A number below 2^63.
    fn small(x: u64) -> Self;
    fn one() -> Self {
        Self::small(1)
    }
    fn plus(&self, other: &Self) -> Self;
    fn minus(&self, other: &Self) -> Self;
    /// `self * 2^by`, which must fit.
    fn shifted(&self, by: u64) -> Self;
    fn sign(&self) -> Sign;
    /// `x * 2^exponent` with 1 <= |x| < 2, rounded towards zero to 53 bits; (0, 0) for zero.
    fn approximate(&self) -> (f64, i64);
}

/// An integer whose products have a type.
pub(crate) trait Factor: Whole {
    type Product: Whole;
    fn product(&self, other: &Self) -> Self::Product;
    /// The same number.
    fn widened(&self) -> Self::Product;
}

/// An integer from which products of up to eight are made.
pub(crate) trait Coordinate: Factor<Product: Factor<Product: Factor>> {}
impl<T: Factor<Product: Factor<Product: Factor>>> Coordinate for T {}

/// A vector of integers.
pub(crate) type WholeVector<T = Integer> = [T; 3];

#[inline]
pub(crate) fn difference<T: Whole>(a: &WholeVector<T>, b: &WholeVector<T>) -> WholeVector<T> {
    [a[0].minus(&b[0]), a[1].minus(&b[1]), a[2].minus(&b[2])]
}

#[inline]
pub(crate) fn cross<T: Factor>(
    [x, y, z]: &WholeVector<T>,
    [u, v, w]: &WholeVector<T>,
) -> WholeVector<T::Product> {
    [
        y.product(w).minus(&z.product(v)),
        z.product(u).minus(&x.product(w)),
        x.product(v).minus(&y.product(u)),
    ]
}

#[inline]
pub(crate) fn dot<T: Factor>(a: &WholeVector<T>, b: &WholeVector<T>) -> T::Product {
    let first = a[0].product(&b[0]).plus(&a[1].product(&b[1]));
    first.plus(&a[2].product(&b[2]))
}

/// Products of two, four and eight.
pub(crate) type Two<T> = <T as Factor>::Product;
pub(crate) type Four<T> = Two<Two<T>>;
pub(crate) type Eight<T> = Two<Four<T>>;

impl Whole for Integer {
    fn small(x: u64) -> Self {
        Integer::from(x)
    }

    fn plus(&self, other: &Self) -> Self {
        self + other
    }

    fn minus(&self, other: &Self) -> Self {
        self - other
    }

    fn shifted(&self, by: u64) -> Self {
        self.shifted(by)
    }

    fn sign(&self) -> Sign {
        self.sign()
    }

    fn approximate(&self) -> (f64, i64) {
        self.approximate()
    }
}

impl Factor for Integer {
    type Product = Integer;

    fn product(&self, other: &Self) -> Integer {
        self * other
    }

    fn widened(&self) -> Integer {
        self.clone()
    }
}

impl From<u64> for Wide<4> {
    fn from(x: u64) -> Self {
        Self([x, 0, 0, 0])
    }
}

macro_rules! whole {
    ($type:ty) => {
        impl Whole for $type {
            #[allow(clippy::cast_possible_wrap, reason = "below 2^63")]
            #[allow(clippy::cast_lossless, reason = "not from u64 to i64")]
            #[inline]
            fn small(x: u64) -> Self {
                x as $type
            }

            #[inline]
            fn plus(&self, other: &Self) -> Self {
                self + other
            }

            #[inline]
            fn minus(&self, other: &Self) -> Self {
                self - other
            }

            #[inline]
            fn shifted(&self, by: u64) -> Self {
                self << by
            }

            #[inline]
            fn sign(&self) -> Sign {
                match self.signum() {
                    -1 => Sign::Negative,
                    0 => Sign::Zero,
                    _ => Sign::Positive,
                }
            }

            fn approximate(&self) -> (f64, i64) {
                approximate(*self < 0, &halves(self.unsigned_abs().into()))
            }
        }
    };
}

whole!(i64);
whole!(i128);

impl Factor for i64 {
    type Product = i128;

    #[inline]
    fn product(&self, other: &Self) -> i128 {
        i128::from(*self) * i128::from(*other)
    }

    #[inline]
    fn widened(&self) -> i128 {
        i128::from(*self)
    }
}

impl Factor for i128 {
    type Product = Wide<4>;

    #[inline]
    fn product(&self, other: &Self) -> Wide<4> {
        let limbs = products(halves(self.unsigned_abs()), halves(other.unsigned_abs()));
        Wide::new((*self < 0) != (*other < 0), limbs)
    }

    #[inline]
    fn widened(&self) -> Wide<4> {
        let [low, high] = halves(self.unsigned_abs());
        Wide::new(*self < 0, [low, high, 0, 0])
    }
}

/// An integer of N limbs of 64 bits, lowest first, in two's complement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wide<const N: usize>([u64; N]);

impl<const N: usize> Wide<N> {
    /// From sign and magnitude.
    #[inline]
    fn new(is_negative: bool, magnitude: [u64; N]) -> Self {
        let wide = Self(magnitude);
        if is_negative { wide.negated() } else { wide }
    }

    /// 2^`exponent`, which must be below 2^(64 N - 1).
    #[inline]
    pub(super) fn power_of_two(exponent: u64) -> Self {
        Self(core::array::from_fn(|ix| {
            let bit = exponent.checked_sub(64 * ix as u64);
            bit.filter(|&bit| bit < 64).map_or(0, |bit| 1 << bit)
        }))
    }

    #[inline]
    fn is_negative(&self) -> bool {
        self.0[N - 1] >> 63 == 1
    }

    #[inline]
    fn negated(&self) -> Self {
        Self([0; N]).minus(self)
    }

    #[inline]
    fn magnitude(&self) -> [u64; N] {
        if self.is_negative() {
            self.negated().0
        } else {
            self.0
        }
    }
}

impl<const N: usize> Whole for Wide<N> {
    #[inline]
    fn small(x: u64) -> Self {
        let mut limbs = [0; N];
        limbs[0] = x;
        Self(limbs)
    }

    #[inline]
    fn plus(&self, other: &Self) -> Self {
        let mut sum = *self;
        let mut carry = false;
        for (limb, &addend) in sum.0.iter_mut().zip(&other.0) {
            let (x, first) = limb.overflowing_add(addend);
            let (x, second) = x.overflowing_add(u64::from(carry));
            *limb = x;
            carry = first | second;
        }
        sum
    }

    #[inline]
    fn minus(&self, other: &Self) -> Self {
        let mut difference = *self;
        let mut borrow = false;
        for (limb, &subtrahend) in difference.0.iter_mut().zip(&other.0) {
            let (x, first) = limb.overflowing_sub(subtrahend);
            let (x, second) = x.overflowing_sub(u64::from(borrow));
            *limb = x;
            borrow = first | second;
        }
        difference
    }

    #[inline]
    fn shifted(&self, by: u64) -> Self {
        let (n_limbs, n_bits) = ((by / 64) as usize, (by % 64) as u32);
        Self(core::array::from_fn(|ix| {
            let limb = |back: usize| ix.checked_sub(back).map_or(0, |ix| self.0[ix]);
            let below = limb(n_limbs + 1).checked_shr(64 - n_bits).unwrap_or(0);
            limb(n_limbs) << n_bits | below
        }))
    }

    #[inline]
    fn sign(&self) -> Sign {
        if self.is_negative() {
            Sign::Negative
        } else if self.0 == [0; N] {
            Sign::Zero
        } else {
            Sign::Positive
        }
    }

    fn approximate(&self) -> (f64, i64) {
        approximate(self.is_negative(), &self.magnitude())
    }
}

impl Factor for Wide<4> {
    type Product = Wide<8>;

    #[inline]
    fn product(&self, other: &Self) -> Wide<8> {
        let limbs = products(self.magnitude(), other.magnitude());
        Wide::new(self.is_negative() != other.is_negative(), limbs)
    }

    #[inline]
    fn widened(&self) -> Wide<8> {
        let sign = if self.is_negative() { u64::MAX } else { 0 };
        Wide(core::array::from_fn(|ix| {
            self.0.get(ix).copied().unwrap_or(sign)
        }))
    }
}

/// The product of two magnitudes of N limbs; M is 2 N.
#[inline]
fn products<const N: usize, const M: usize>(a: [u64; N], b: [u64; N]) -> [u64; M] {
    const { assert!(M == 2 * N) };
    let mut limbs = [0; M];
    for (i, x) in a.into_iter().enumerate() {
        let mut carry = 0;
        for (j, y) in b.into_iter().enumerate() {
            // At most (2^64 - 1)^2 + 2 (2^64 - 1) = 2^128 - 1.
            let wide = u128::from(x) * u128::from(y) + u128::from(limbs[i + j]) + u128::from(carry);
            [limbs[i + j], carry] = halves(wide);
        }
        limbs[i + N] = carry;
    }
    limbs
}
