//! The cells of a coarse map that vertices lie in, one byte per axis: x + 2^8 y + 2^16 z.

use crate::bvh::bounds::{greater, lesser};
use crate::scene::positions::Positions;

use crate::simd::{Isa, Simd, with_isa};

/// The function from coordinates to cells of the map.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Function {
    /// The region's low corner.
    pub origin: [f32; 3],
    /// Cells per unit of length, above zero.
    pub scale: [f32; 3],
    /// The last cell along each axis, past the region: at most 254.
    pub limit: [f32; 3],
}

impl Function {
    #[inline(always)]
    pub fn code(&self, point: &[f32; 3]) -> u32 {
        let mut bytes = [0u8; 4];
        for axis in 0..3 {
            let (origin, scale) = (self.origin[axis], self.scale[axis]);
            bytes[axis] = quantised(point[axis], origin, scale, self.limit[axis]);
        }
        u32::from_le_bytes(bytes)
    }
}

/// A pointer to the cells of the vertices, and the function that computes them.
#[derive(Clone, Copy)]
pub(crate) struct Codes {
    pub(super) first: *mut u32,
    pub(super) function: Function,
}

// SAFETY: a pointer does nothing by itself; the contract of `put` covers its use.
unsafe impl Send for Codes {}
// SAFETY: a shared copy gives no access to memory but by `put`, whose contract covers it.
unsafe impl Sync for Codes {}

/// Vertices whose coordinates are processed at once, as one row of floats.
const CHUNK: usize = 16;

impl Codes {
    /// Writes the cells of vertices `range` of a body whose codes start at `first`.
    ///
    /// # Safety
    /// The codes must still live and include the body's; no other thread may use those of `range`
    /// at the same time.
    pub unsafe fn put(
        self,
        isa: Isa,
        positions: &Positions,
        range: std::ops::Range<usize>,
        first: usize,
    ) {
        // SAFETY: by the contract of this function.
        let into = unsafe {
            std::slice::from_raw_parts_mut(self.first.add(first + range.start), range.len())
        };
        match positions {
            Positions::F32(positions) => {
                with_isa!(isa, quantise, (
                    positions: &[[f32; 3]] = &positions[range],
                    function: Function = self.function,
                    into: &mut [u32] = into,
                ));
            }
            Positions::F64(positions) => {
                for (point, code) in positions[range].iter().zip(into) {
                    // Rounding is monotone as well.
                    *code = self.function.code(&point.map(|x| x as f32));
                }
            }
        }
    }
}

#[inline(always)]
fn quantise<S: Simd>(_: S, positions: &[[f32; 3]], function: Function, into: &mut [u32]) {
    let row = |of: [f32; 3]| -> [f32; 3 * CHUNK] { std::array::from_fn(|k| of[k % 3]) };
    let origin = row(function.origin);
    let scale = row(function.scale);
    let limit = row(function.limit);
    let (chunks, rest) = positions.as_chunks::<CHUNK>();
    let (into_chunks, into_rest) = into.as_chunks_mut::<CHUNK>();
    for (chunk, codes) in chunks.iter().zip(into_chunks) {
        let chunk: &[f32; 3 * CHUNK] = chunk.as_flattened().first_chunk().expect("48 of 48");
        let mut bytes = [0u8; 3 * CHUNK];
        for k in 0..3 * CHUNK {
            bytes[k] = quantised(chunk[k], origin[k], scale[k], limit[k]);
        }
        for k in 0..CHUNK {
            codes[k] = u32::from_le_bytes([bytes[3 * k], bytes[3 * k + 1], bytes[3 * k + 2], 0]);
        }
    }
    for (point, code) in rest.iter().zip(into_rest) {
        *code = function.code(point);
    }
}

/// The cell along one axis: 0 before the region, `limit` past it.
///
/// Each operation is monotone, for `scale` is above 0 and nothing is NaN.
#[inline(always)]
fn quantised(x: f32, origin: f32, scale: f32, limit: f32) -> u8 {
    let cell = greater(lesser((x - origin) * scale + 1.0, limit), 0.0);
    // SAFETY: between 0 and `limit`, which is at most 254; NaN would have become `limit`.
    (unsafe { cell.to_int_unchecked::<i32>() }) as u8
}

/// Four numbers in the bytes of one.
#[cfg(target_arch = "x86_64")]
mod bytes {
    use std::arch::x86_64::*;

    crate::boxes::sse2! {
        fn lesser_bytes(a: u32, b: u32) -> u32 {
            let both = _mm_min_epu8(_mm_cvtsi32_si128(a as i32), _mm_cvtsi32_si128(b as i32));
            _mm_cvtsi128_si32(both) as u32
        }

        fn greater_bytes(a: u32, b: u32) -> u32 {
            let both = _mm_max_epu8(_mm_cvtsi32_si128(a as i32), _mm_cvtsi32_si128(b as i32));
            _mm_cvtsi128_si32(both) as u32
        }
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod bytes {
    #[inline(always)]
    pub fn lesser_bytes(a: u32, b: u32) -> u32 {
        let (a, b) = (a.to_le_bytes(), b.to_le_bytes());
        u32::from_le_bytes([0, 1, 2, 3].map(|k| a[k].min(b[k])))
    }

    #[inline(always)]
    pub fn greater_bytes(a: u32, b: u32) -> u32 {
        let (a, b) = (a.to_le_bytes(), b.to_le_bytes());
        u32::from_le_bytes([0, 1, 2, 3].map(|k| a[k].max(b[k])))
    }
}

/// The lesser, and the greater, of two numbers, byte by byte.
pub(super) use bytes::{greater_bytes, lesser_bytes};
