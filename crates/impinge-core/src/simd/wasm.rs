//! The box tests of [`Portable`](super::Portable) with WebAssembly's registers of four numbers.
//!
//! Compilers unroll the plain loops into hundreds of single comparisons, in every kernel that uses
//! them. These functions are smaller and faster. They are not inlined: a module for browsers is
//! loaded over the network.

use std::arch::wasm32::{f32x4_le, f32x4_splat, i32x4_bitmask, v128, v128_and, v128_or};

use impinge_exact::internal::filter::number::memory::read;

use super::LaneBounds;
use crate::bvh::bounds::{Aabb, BoundsArray};

/// Lanes of a register.
const FOUR: usize = 4;

#[inline(always)]
fn load(row: &[f32], first: usize) -> v128 {
    let row: &[f32; FOUR] = row[first..].first_chunk().expect("whole registers");
    read(row)
}

/// Bit `k`: box `first + k` overlaps `query`, for `k` below 4.
#[inline(always)]
fn overlaps_4(min: [&[f32]; 3], max: [&[f32]; 3], first: usize, query: &Aabb) -> u32 {
    let axis = |axis: usize| {
        let below = f32x4_le(load(min[axis], first), f32x4_splat(query.max[axis]));
        let above = f32x4_le(f32x4_splat(query.min[axis]), load(max[axis], first));
        v128_and(below, above)
    };
    let overlap = v128_and(v128_and(axis(0), axis(1)), axis(2));
    u32::from(i32x4_bitmask(overlap))
}

/// See [`Simd::overlaps_8`](super::Simd::overlaps_8).
#[inline(never)]
pub fn overlaps_8(boxes: &BoundsArray, first: usize, query: &Aabb) -> u32 {
    let min = [0, 1, 2].map(|axis| &boxes.min[axis][..]);
    let max = [0, 1, 2].map(|axis| &boxes.max[axis][..]);
    overlaps_4(min, max, first, query) | overlaps_4(min, max, first + FOUR, query) << FOUR
}

/// See [`Simd::overlaps_64`](super::Simd::overlaps_64).
#[inline(never)]
pub fn overlaps_64(boxes: &LaneBounds, query: &Aabb, among: u64) -> u64 {
    let min = [0, 1, 2].map(|axis| &boxes.min[axis][..]);
    let max = [0, 1, 2].map(|axis| &boxes.max[axis][..]);
    by_fours(among, |first| overlaps_4(min, max, first, query))
}

/// See [`Simd::meets_64`](super::Simd::meets_64).
#[inline(never)]
pub fn meets_64(
    [start, end]: [&LaneBounds; 2],
    [query_start, query_end]: &[Aabb; 2],
    among: u64,
) -> u64 {
    by_fours(among, |first| {
        let axis = |axis: usize| {
            let below = |boxes: &LaneBounds, query: &Aabb| {
                f32x4_le(load(&boxes.min[axis], first), f32x4_splat(query.max[axis]))
            };
            let above = |boxes: &LaneBounds, query: &Aabb| {
                f32x4_le(f32x4_splat(query.min[axis]), load(&boxes.max[axis], first))
            };
            v128_and(
                v128_or(below(start, query_start), below(end, query_end)),
                v128_or(above(start, query_start), above(end, query_end)),
            )
        };
        u32::from(i32x4_bitmask(v128_and(v128_and(axis(0), axis(1)), axis(2))))
    })
}

/// Asks about four lanes at a time, if any of them counts.
#[inline(always)]
fn by_fours(among: u64, ask: impl Fn(usize) -> u32) -> u64 {
    let mut mask = 0;
    for first in (0..64).step_by(FOUR) {
        if among >> first & 0xf != 0 {
            mask |= u64::from(ask(first)) << first;
        }
    }
    mask & among
}
