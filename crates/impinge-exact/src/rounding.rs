//! Exact numbers rounded to floats, and what rounding leaves out.

/// The sum of two floats, rounded, and its error, which is a float too (Knuth). NaN where it
/// overflows.
#[inline]
pub fn two_sum(a: f64, b: f64) -> [f64; 2] {
    let sum = a + b;
    let part = sum - a;
    [sum, (a - (sum - part)) + (b - part)]
}

/// The product of two floats, rounded, and its error, which is a float too unless it underflows
/// (Dekker). No fused multiply-add, so the bits are the same on every machine. NaN beyond 2^996.
#[inline]
pub fn two_product(a: f64, b: f64) -> [f64; 2] {
    // Two halves of 26 bits each (Veltkamp).
    let halves = |x: f64| {
        const SPLITTER: f64 = ((1u64 << 27) + 1) as f64;
        let scaled = SPLITTER * x;
        let high = scaled - (scaled - x);
        [high, x - high]
    };
    let product = a * b;
    let [[a_high, a_low], [b_high, b_low]] = [halves(a), halves(b)];
    let rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    [product, rest]
}

/// 2^`exponent`: infinity above the largest `f64`, 0 below the smallest.
#[inline]
pub(crate) const fn power_of_two(exponent: i32) -> f64 {
    match exponent {
        1024.. => f64::INFINITY,
        -1022..1024 => f64::from_bits(((exponent + 1023) as u64) << 52),
        -1074..-1022 => f64::from_bits(1 << (exponent + 1074)),
        _ => 0.0,
    }
}

/// The square root, rounded once. The standard library has it, `core` does not.
#[inline(always)]
pub(crate) fn root(x: f64) -> f64 {
    #[cfg(feature = "std")]
    return x.sqrt();
    #[cfg(not(feature = "std"))]
    return libm::sqrt(x);
}

/// [`root`] in single precision.
#[inline(always)]
pub(crate) fn root_f32(x: f32) -> f32 {
    #[cfg(feature = "std")]
    return x.sqrt();
    #[cfg(not(feature = "std"))]
    return libm::sqrtf(x);
}

/// The largest `f32` that is not above a number.
#[allow(clippy::cast_possible_truncation, reason = "rounded here")]
#[inline]
pub(super) fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x {
        nearest.next_down()
    } else {
        nearest
    }
}
