//! How the triangles of a group are seen along the axes: which way each turns, and at which corners
//! its far side crosses a line.
//!
//! What it does: half of what says whether the triangles around a vertex overlap (`cpu::folds`),
//! once per triangle instead of once per corner, a register of triangles at a time.
//!
//! In: the corners of a group, as tables. Out: one word per triangle.
//!
//! ```text
//! bit  14 13 12 | 11 10 9 | 8 7 6 | 5 4 | 3 2 | 1 0
//!      crosses    crosses   crosses  z     y     x
//!      at 2       at 1      at 0
//!
//! x, y, z: certainly turns to the left (lower bit), to the right
//! crosses: along x (lowest bit), y, z
//! ```
//!
//! Seen from a corner along an axis, each of the other two corners is below the line through that
//! corner or not. The far side crosses the line if the answers differ. They are comparisons of
//! coordinates, so they are exact. Turns are twice the areas of the images, with a bound:
//! `docs/exactness.md`, "Folds".

use super::motion::{cross, difference};
use super::number::{Lookup, Number};
use super::{LARGEST_F32, TABLE, Triangles64};

/// Bits of a word that say how a triangle turns.
pub const TURNS: u32 = 0b11_1111;

/// 16 unit roundoffs.
const RELATIVE: f64 = 1.0 / (1u64 << 20) as f64;
/// 2^-90: more than underflow may lose, even where subnormal numbers become zero.
const ABSOLUTE: f64 = f64::from_bits((1023 - 90) << 52);

/// The word of each triangle of a group.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
pub fn turns<V: Lookup>(corners: &Triangles64, words: &mut [u32; TABLE]) {
    let mut numbers = [0.0; TABLE];
    for first in (0..TABLE).step_by(V::N) {
        let [a, b, c] = corners;
        word([row::<V>(a, first), row(b, first), row(c, first)]).put(&mut numbers, first);
    }
    for (word, number) in words.iter_mut().zip(numbers) {
        // Whole numbers below 2^15.
        *word = number as u32;
    }
}

/// Which axes a corner's far side crosses lines along, one bit per axis.
#[inline(always)]
#[must_use]
pub fn crossings(word: u32, corner: u32) -> u32 {
    word >> (6 + 3 * corner) & 0b111
}

#[inline(always)]
fn row<V: Lookup>([x, y, z]: &[[f32; TABLE]; 3], first: usize) -> [V; 3] {
    [V::row(x, first), V::row(y, first), V::row(z, first)]
}

/// The words as numbers, which are exact.
#[inline(always)]
fn word<V: Number>([a, b, c]: [[V; 3]; 3]) -> V {
    let zero = V::splat(0.0);
    let (to_b, to_c) = (difference(&b, &a), difference(&c, &a));
    let turn = cross(&to_b, &to_c);
    let mut sizes = zero;
    for axis in 0..3 {
        sizes = sizes + (a[axis].abs() + b[axis].abs() + c[axis].abs());
    }
    let is_small = V::splat(f64::from(LARGEST_F32)).gt(sizes);
    let mut word = zero;
    for (axis, &turn) in turn.iter().enumerate() {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let size = (to_b[i] * to_c[j]).abs() + (to_b[j] * to_c[i]).abs();
        let bound = V::splat(RELATIVE) * size + V::splat(ABSOLUTE);
        word = word + bit(is_small & turn.gt(bound), 2 * axis);
        word = word + bit(is_small & (zero - bound).gt(turn), 2 * axis + 1);
        // Unless two corners have one image, and then nothing is certain, p is below q or q is
        // below p.
        let below = [
            is_below(&b, &a, i, j),
            is_below(&c, &b, i, j),
            is_below(&a, &c, i, j),
        ];
        for corner in 0..3 {
            let before = (corner + 2) % 3;
            word = word + bit(!(below[corner] ^ below[before]), 6 + 3 * corner + axis);
        }
    }
    word
}

/// A bit of a word.
#[inline(always)]
fn bit<V: Number>(mask: V::Mask, bit: usize) -> V {
    V::select(mask, V::splat(f64::from(1u32 << bit)), V::splat(0.0))
}

/// Whether a point is below the line through another one, in the plane of the axes i and j.
#[inline(always)]
fn is_below<V: Number>(p: &[V; 3], from: &[V; 3], i: usize, j: usize) -> V::Mask {
    let is_level = !(p[j].gt(from[j]) | from[j].gt(p[j]));
    from[j].gt(p[j]) | (is_level & from[i].gt(p[i]))
}
