//! Exact numbers rounded to floats, and what rounding leaves out.

/// The sum of two floats, rounded, and its error, which is a float too (Knuth). NaN where it overflows.
#[inline]
pub(crate) fn two_sum(a: f64, b: f64) -> [f64; 2] {
    let sum = a + b;
    let part = sum - a;
    [sum, (a - (sum - part)) + (b - part)]
}

/// The largest `f32` that is not above a number.
#[allow(clippy::cast_possible_truncation, reason = "rounded here")]
pub(super) fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x {
        nearest.next_down()
    } else {
        nearest
    }
}
