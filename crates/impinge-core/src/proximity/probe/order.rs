//! An order of points in which most are near to the one before: along a Morton curve in their box.
//!
//! Cost: three passes over 8 bytes per point. No answer depends on this order.

use crate::scene::error::Error;
use crate::scene::positions::Real;
use crate::search::sink::{filled, with_capacity};

/// Bits per axis.
const BITS: u32 = 10;

/// The numbers of the points in the order of the curve; of equal places, the lower number first.
///
/// # Errors
/// There is no memory for them.
pub(super) fn along_curve<R: Real>(
    points: &[[R; 3]],
    what: &'static str,
) -> Result<Vec<u32>, Error> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for (axis, &x) in point.iter().enumerate() {
            low[axis] = low[axis].min(x.widen());
            high[axis] = high[axis].max(x.widen());
        }
    }
    // Halves, for the difference may overflow.
    let half = [0, 1, 2].map(|axis| 0.5 * high[axis] - 0.5 * low[axis]);
    let most = f64::from((1u32 << BITS) - 1);
    let place = |point: &[R; 3]| {
        let mut code = 0;
        for (axis, &x) in point.iter().enumerate() {
            // Where all are equal this is not a number, which becomes 0.
            let share = (0.5 * x.widen() - 0.5 * low[axis]) / half[axis];
            code |= spread((share * most) as u32) << axis;
        }
        code
    };
    let numbered = (0u32..).zip(points);
    let mut keys = with_capacity(points.len(), what)?;
    keys.extend(numbered.map(|(ix, point)| (place(point), ix)));
    sort(&mut keys, what)?;
    let mut numbers = with_capacity(points.len(), what)?;
    numbers.extend(keys.into_iter().map(|(_, ix)| ix));
    Ok(numbers)
}

/// Sorts by places, of equal ones the first first: by one part of the bits after the other.
fn sort(keys: &mut Vec<(u32, u32)>, what: &'static str) -> Result<(), Error> {
    const N: usize = 1 << BITS;
    let mut sorted = filled((0, 0), keys.len(), what)?;
    for part in 0..3 {
        let of = |place: u32| (place >> (part * BITS)) as usize % N;
        let mut starts = [0; N + 1];
        for &(place, _) in &*keys {
            starts[of(place) + 1] += 1;
        }
        for ix in 0..N {
            starts[ix + 1] += starts[ix];
        }
        for &(place, ix) in &*keys {
            let start = &mut starts[of(place)];
            sorted[*start] = (place, ix);
            *start += 1;
        }
        std::mem::swap(keys, &mut sorted);
    }
    Ok(())
}

/// Two zeros after each of the lowest ten bits.
fn spread(x: u32) -> u32 {
    let x = x.min((1 << BITS) - 1);
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}
