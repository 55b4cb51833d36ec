//! Exact numbers rounded to floats.

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
