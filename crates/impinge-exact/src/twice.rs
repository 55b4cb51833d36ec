//! Numbers of about 106 bits: the unevaluated sum of two floats.
//!
//! Algorithms: Joldes, Muller & Popescu, *Tight and rigorous error bounds for basic building blocks
//! of double-word arithmetic*, 2017. No fused multiply-add, so the bits are the same on every
//! machine and in every register. In WebAssembly, where size counts, they are functions.

use crate::filter::number::Number;

/// The sum of two floats, rounded, and its error, which is a float too (Knuth). NaN where it
/// overflows.
#[inline(always)]
pub fn two_sum<N: Number>(a: N, b: N) -> [N; 2] {
    let sum = a + b;
    let part = sum - a;
    [sum, (a - (sum - part)) + (b - part)]
}

/// The product of two floats, rounded, and its error, which is a float too unless it underflows
/// (Dekker). NaN beyond 2^996.
#[inline(always)]
pub fn two_product<N: Number>(a: N, b: N) -> [N; 2] {
    let product = a * b;
    let ([a_high, a_low], [b_high, b_low]) = (halves(a), halves(b));
    let rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    [product, rest]
}

/// Two halves of 26 bits each (Veltkamp).
#[inline(always)]
fn halves<N: Number>(x: N) -> [N; 2] {
    const SPLITTER: f64 = ((1u64 << 27) + 1) as f64;
    let scaled = N::splat(SPLITTER) * x;
    let high = scaled - (scaled - x);
    [high, x - high]
}

/// The sum of two floats, of which the second is at most half a last bit of the first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Twice<N>(pub [N; 2]);

impl<N: Number> Twice<N> {
    /// p - q, without error.
    #[inline(always)]
    pub fn difference(p: &[N; 3], q: &[N; 3]) -> [Self; 3] {
        let minus = |p: N, q: N| Self(two_sum(p, N::splat(0.0) - q));
        [minus(p[0], q[0]), minus(p[1], q[1]), minus(p[2], q[2])]
    }

    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    pub fn plus(self, other: Self) -> Self {
        let [sum, rest] = two_sum(self.0[0], other.0[0]);
        Self(two_sum(sum, rest + (self.0[1] + other.0[1])))
    }

    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        self.plus(other.turned(N::splat(-1.0)))
    }

    /// Times a power of two, or its negative.
    #[inline(always)]
    pub fn turned(self, sign: N) -> Self {
        Self([self.0[0] * sign, self.0[1] * sign])
    }

    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    pub fn times(self, other: Self) -> Self {
        let [product, rest] = two_product(self.0[0], other.0[0]);
        let rest = rest + (self.0[0] * other.0[1] + self.0[1] * other.0[0]);
        Self(two_sum(product, rest))
    }

    #[inline(always)]
    pub fn minus_each(p: &[Self; 3], q: &[Self; 3]) -> [Self; 3] {
        [p[0].minus(q[0]), p[1].minus(q[1]), p[2].minus(q[2])]
    }

    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    pub fn dot(p: &[Self; 3], q: &[Self; 3]) -> Self {
        let (x, y, z) = (p[0].times(q[0]), p[1].times(q[1]), p[2].times(q[2]));
        x.plus(y).plus(z)
    }

    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    pub fn cross(p: &[Self; 3], q: &[Self; 3]) -> [Self; 3] {
        [
            p[1].times(q[2]).minus(p[2].times(q[1])),
            p[2].times(q[0]).minus(p[0].times(q[2])),
            p[0].times(q[1]).minus(p[1].times(q[0])),
        ]
    }

    /// The quotient of two positive numbers with errors: the nearest float or one beside it, what
    /// is left, at most half a last bit, and more than the error of both together.
    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    pub fn over(self, divisor: Self, error: N, of_divisor: N) -> [N; 3] {
        const UNIT: f64 = f64::EPSILON * f64::EPSILON;
        let quotient = self.0[0] / divisor.0[0];
        let product = divisor.times(Self([quotient, N::splat(0.0)]));
        let rest = self.minus(product).0[0] / divisor.0[0];
        let [quotient, rest] = two_sum(quotient, rest);
        // Four more than there are, for the roundings of the quotient of what is left.
        let doubt = N::splat(4.0) * (error + quotient * of_divisor) / divisor.0[0]
            + N::splat(16.0 * UNIT) * quotient;
        [quotient, rest, doubt]
    }
}

/// The largest coordinate of a vector.
#[inline(always)]
pub(crate) fn size<N: Number>(v: &[Twice<N>; 3]) -> N {
    let [x, y, z] = v;
    x.0[0].abs().larger(y.0[0].abs()).larger(z.0[0].abs())
}

/// Sizes of numbers of which no product and no quotient overflows or loses bits to underflow.
pub(crate) const MODERATE: core::ops::Range<f64> = 1e-30..1e30;
/// More than the error of a determinant in twice the precision, relative to the cube of its largest
/// number.
pub(crate) const ERROR: f64 = f64::EPSILON * f64::EPSILON * 4096.0;
