//! Exact numbers rounded to floats, and powers of two.

use crate::Point;

/// 2^`exponent`: infinity above the largest `f64`, 0 below the smallest.
#[inline]
pub const fn power_of_two(exponent: i32) -> f64 {
    match exponent {
        1024.. => f64::INFINITY,
        -1022..1024 => f64::from_bits(((exponent + 1023) as u64) << 52),
        -1074..-1022 => f64::from_bits(1 << (exponent + 1074)),
        _ => 0.0,
    }
}

/// Sizes that are used as they are: no product of a few lengths overflows or underflows.
const USUAL: core::ops::Range<f64> = power_of_two(-90)..power_of_two(90);

/// A power of two that gives points a usual size: the largest coordinate is about 1, or at least
/// usual. `None` where it is usual, or all are 0.
#[allow(clippy::cast_possible_truncation, reason = "eleven bits")]
pub(crate) fn to_usual_size(points: &[&[Point; 4]]) -> Option<f64> {
    let numbers = points.iter().copied().flatten().flatten();
    let largest = numbers.fold(0.0, |largest: f64, x| largest.max(x.abs()));
    if largest == 0.0 || USUAL.contains(&largest) {
        return None;
    }
    // The exponent and its negative are those of normal numbers.
    let exponent = (largest.to_bits() >> 52) as i32 - 1023;
    Some(power_of_two((-exponent).clamp(-1000, 1000)))
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
