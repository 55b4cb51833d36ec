//! A coarse map of where bodies are, which drops primitives that no other body comes near.
//!
//! ```text
//! quantise   each vertex once: the cell of the map that it lies in, a byte an axis
//! mark       each primitive: the range of its vertices' cells; its body's bit in all of them
//! look up    each primitive again: whether some cell of its range has the bits of two bodies
//! ```
//!
//! In: positions and where each body may be met. Out: whether a primitive may have a partner. Cost: three
//! bytes a vertex, twelve a primitive near other bodies. Invariant: the map from coordinates to
//! cells is monotone under any rounding, so that a point of two primitives lies in a cell that both mark.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::grouping::bounds::{Bounds, greater, lesser};
use crate::grouping::grid::Grid;
use crate::scene::Positions;

use super::kept::Run;
use super::simd::{Isa, Simd, dispatch};
use super::world::World;

/// Cells along an axis at most: two more hold what lies outside, and a byte numbers them all.
const MOST_ALONG: u32 = 253;
/// Primitives of all bodies a cell of the map.
const PRIMITIVES_A_CELL: u64 = 4;
/// Cells of the map that one primitive marks at most; a larger one counts as being everywhere.
const MOST_MARKED: u32 = 512;
/// The bit of all participants from the eighth on. Two of them are not told apart: it stands for several.
const SEVERAL: u8 = 1 << 7;

/// A primitive near where its body is met, and the cells of its vertices along x, y, z, a byte each.
#[derive(Debug, Clone, Copy)]
struct Near {
    primitive: u32,
    low: u32,
    high: u32,
}

/// The map and the memory for it.
#[derive(Default)]
pub(crate) struct Cull {
    origin: [f32; 3],
    /// Cells a unit of length, above zero.
    scale: [f32; 3],
    /// Cells along each axis, those outside included.
    along: [u32; 3],
    /// Three bytes a vertex, body after body.
    codes: Vec<u8>,
    /// Where each participant's codes start.
    firsts: Vec<usize>,
    /// For each cell the bits of the bodies that are there.
    marks: Vec<AtomicU8>,
    /// Bits of bodies with primitives too large to be marked.
    everywhere: AtomicU8,
    /// Bits that pair with themselves.
    alone: u8,
    near: Vec<Mutex<Vec<Near>>>,
}

impl Cull {
    /// Makes ready for a frame: all bodies meet within the region, its primitives come in `n_runs`.
    pub fn begin(&mut self, world: World<'_>, region: &Bounds, n_runs: usize) {
        let frame = world.frame;
        let wanted = frame.n_primitives() / PRIMITIVES_A_CELL;
        let along = Grid::new(region, wanted, 1.0).resolution;
        let along = along.map(|along| along.min(MOST_ALONG));
        for axis in 0..3 {
            // A little less than all cells, so that the region's end is still within the last one.
            let scale = (along[axis] as f32 - 0.01) / (region.max[axis] - region.min[axis]);
            let usable = scale.is_finite() && scale > 0.0;
            self.scale[axis] = if usable { scale } else { 1.0 };
        }
        self.origin = region.min;
        self.along = along.map(|along| along + 2);
        self.firsts.clear();
        self.alone = SEVERAL;
        let mut n_codes = 0;
        for (ix, participant) in frame.participants.iter().enumerate() {
            self.firsts.push(n_codes);
            n_codes += 3 * world.body(ix as u32).positions.len();
            self.alone |= if participant.within { bit(ix) } else { 0 };
        }
        // Codes are read four bytes at a time.
        self.codes.resize(n_codes + 1, 0);
        self.everywhere = AtomicU8::new(0);
        self.marks.clear();
        let n_cells = self.along.iter().map(|&along| along as usize).product();
        self.marks.resize_with(n_cells, || AtomicU8::new(0));
        self.near
            .resize_with(n_runs.max(self.near.len()), Mutex::default);
    }

    pub fn bytes(&self) -> usize {
        let near = |part: &Mutex<Vec<Near>>| part.lock().map_or(0, |part| part.capacity());
        self.codes.capacity()
            + self.marks.capacity()
            + size_of::<usize>() * self.firsts.capacity()
            + size_of::<Near>() * self.near.iter().map(near).sum::<usize>()
    }

    /// Write access to the vertices' cells for several threads at once.
    pub fn codes(&mut self) -> Codes {
        Codes {
            first: self.codes.as_mut_ptr(),
            origin: self.origin,
            scale: self.scale,
            limit: self.along.map(|along| (along - 1) as f32),
        }
    }

    /// Where a participant's codes start.
    pub fn first_code(&self, participant: u32) -> usize {
        self.firsts[participant as usize]
    }

    /// Notes the primitives of a run that are near `reach`, and marks their cells.
    pub fn mark(&self, world: World<'_>, run: Run, run_ix: usize, reach: &Bounds) {
        let mut near = self.near[run_ix].lock().expect("no task panics");
        near.clear();
        let body = world.body(run.participant);
        let codes = &self.codes[self.first_code(run.participant)..];
        let reach = (self.code(&reach.min), self.code(&reach.max));
        let own = bit(run.participant as usize);
        match body.elements {
            crate::Elements::Triangles(faces) => {
                self.mark_all(codes, faces, run, reach, own, &mut near);
            }
            crate::Elements::Tetrahedra(tets) => {
                self.mark_all(codes, tets, run, reach, own, &mut near);
            }
        }
    }

    fn mark_all<const N: usize>(
        &self,
        codes: &[u8],
        corners: &[[u32; N]],
        run: Run,
        reach: (u32, u32),
        own: u8,
        near: &mut Vec<Near>,
    ) {
        let corners = &corners[run.first as usize..run.end as usize];
        for (primitive, corners) in (run.first..).zip(corners) {
            let first = code(codes, corners[0]);
            let (mut low, mut high) = (first, first);
            for &corner in &corners[1..] {
                let vertex = code(codes, corner);
                low = lesser_bytes(low, vertex);
                high = greater_bytes(high, vertex);
            }
            // Partners are met within reach only.
            low = greater_bytes(low, reach.0);
            high = lesser_bytes(high, reach.1);
            if greater_bytes(low, high) & 0xff_ffff != high & 0xff_ffff {
                continue;
            }
            near.push(Near {
                primitive,
                low,
                high,
            });
            if n_cells(low, high) > MOST_MARKED {
                self.everywhere.fetch_or(own, Ordering::Relaxed);
                continue;
            }
            self.for_cells(low, high, |cell| {
                if cell.load(Ordering::Relaxed) & own == 0 {
                    cell.fetch_or(own, Ordering::Relaxed);
                }
                true
            });
        }
    }

    /// Calls back for the primitives of a run that may have partners, in their order; how many were near.
    pub fn for_live(&self, run_ix: usize, mut call: impl FnMut(u32)) -> usize {
        let near = self.near[run_ix].lock().expect("no task panics");
        let everywhere = self.everywhere.load(Ordering::Relaxed);
        for near in &*near {
            let mut live = n_cells(near.low, near.high) > MOST_MARKED;
            if !live {
                self.for_cells(near.low, near.high, |cell| {
                    let bits = cell.load(Ordering::Relaxed) | everywhere;
                    live |= bits & self.alone != 0 || bits & (bits - 1) != 0;
                    !live
                });
            }
            if live {
                call(near.primitive);
            }
        }
        near.len()
    }

    /// Calls back for the cells of a range until told to stop.
    #[inline(always)]
    fn for_cells(&self, low: u32, high: u32, mut call: impl FnMut(&AtomicU8) -> bool) {
        let ([x, y, z, _], [x_end, y_end, z_end, _]) = (low.to_le_bytes(), high.to_le_bytes());
        let [n_x, n_y, _] = self.along.map(|along| along as usize);
        for z in usize::from(z)..=usize::from(z_end) {
            for y in usize::from(y)..=usize::from(y_end) {
                let row = (z * n_y + y) * n_x;
                for cell in &self.marks[row + usize::from(x)..=row + usize::from(x_end)] {
                    if !call(cell) {
                        return;
                    }
                }
            }
        }
    }

    fn code(&self, point: &[f32; 3]) -> u32 {
        let mut bytes = [0u8; 4];
        for axis in 0..3 {
            let limit = (self.along[axis] - 1) as f32;
            bytes[axis] = quantised(point[axis], self.origin[axis], self.scale[axis], limit);
        }
        u32::from_le_bytes(bytes)
    }
}

fn bit(participant: usize) -> u8 {
    1 << participant.min(7)
}

fn n_cells(low: u32, high: u32) -> u32 {
    let ([x, y, z, _], [x_end, y_end, z_end, _]) = (low.to_le_bytes(), high.to_le_bytes());
    let along = |low: u8, high: u8| u32::from(high - low) + 1;
    along(x, x_end) * along(y, y_end) * along(z, z_end)
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

#[inline(always)]
fn code(codes: &[u8], vertex: u32) -> u32 {
    let at = 3 * vertex as usize;
    u32::from_le_bytes(*codes[at..].first_chunk().expect("padded"))
}

/// The lesser of each byte of two numbers.
#[inline(always)]
fn lesser_bytes(a: u32, b: u32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: SSE2 belongs to every x86-64 processor.
    unsafe {
        use std::arch::x86_64::*;
        let both = _mm_min_epu8(_mm_cvtsi32_si128(a as i32), _mm_cvtsi32_si128(b as i32));
        _mm_cvtsi128_si32(both) as u32
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let (a, b) = (a.to_le_bytes(), b.to_le_bytes());
        u32::from_le_bytes([0, 1, 2, 3].map(|k| a[k].min(b[k])))
    }
}

/// The greater of each byte of two numbers.
#[inline(always)]
fn greater_bytes(a: u32, b: u32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: SSE2 belongs to every x86-64 processor.
    unsafe {
        use std::arch::x86_64::*;
        let both = _mm_max_epu8(_mm_cvtsi32_si128(a as i32), _mm_cvtsi32_si128(b as i32));
        _mm_cvtsi128_si32(both) as u32
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let (a, b) = (a.to_le_bytes(), b.to_le_bytes());
        u32::from_le_bytes([0, 1, 2, 3].map(|k| a[k].max(b[k])))
    }
}

/// A pointer to the cells of the vertices, and the map from coordinates.
#[derive(Clone, Copy)]
pub(crate) struct Codes {
    first: *mut u8,
    origin: [f32; 3],
    scale: [f32; 3],
    limit: [f32; 3],
}

// SAFETY: a pointer does nothing by itself; `put` says what its callers owe.
unsafe impl Send for Codes {}
// SAFETY: as above.
unsafe impl Sync for Codes {}

/// Vertices whose coordinates are taken at once, as one row of floats.
const CHUNK: usize = 16;

impl Codes {
    /// Writes the cells of vertices `range` of a body whose codes start at `first`.
    ///
    /// # Safety
    /// The codes must still live and hold the body's; nobody else may use those of `range` meanwhile.
    pub unsafe fn put(
        self,
        isa: Isa,
        positions: &Positions,
        range: std::ops::Range<usize>,
        first: usize,
    ) {
        // SAFETY: said above.
        let into = unsafe {
            std::slice::from_raw_parts_mut(self.first.add(first + 3 * range.start), 3 * range.len())
        };
        match positions {
            Positions::F32(positions) => {
                dispatch!(isa, quantise, (
                    positions: &[[f32; 3]] = &positions[range],
                    map: Codes = self,
                    into: &mut [u8] = into,
                ));
            }
            Positions::F64(positions) => {
                for (point, code) in positions[range].iter().zip(into.as_chunks_mut::<3>().0) {
                    for axis in 0..3 {
                        // Rounding is monotone as well.
                        let (origin, scale) = (self.origin[axis], self.scale[axis]);
                        let x = point[axis] as f32;
                        code[axis] = quantised(x, origin, scale, self.limit[axis]);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn quantise<S: Simd>(_: S, positions: &[[f32; 3]], map: Codes, into: &mut [u8]) {
    let mut row = [[0.0f32; 3 * CHUNK]; 3];
    for k in 0..3 * CHUNK {
        row[0][k] = map.origin[k % 3];
        row[1][k] = map.scale[k % 3];
        row[2][k] = map.limit[k % 3];
    }
    let (chunks, rest) = positions.as_flattened().as_chunks::<{ 3 * CHUNK }>();
    let (into_chunks, into_rest) = into.as_chunks_mut::<{ 3 * CHUNK }>();
    for (chunk, codes) in chunks.iter().zip(into_chunks) {
        for k in 0..3 * CHUNK {
            codes[k] = quantised(chunk[k], row[0][k], row[1][k], row[2][k]);
        }
    }
    for (k, (&x, code)) in rest.iter().zip(into_rest).enumerate() {
        *code = quantised(x, row[0][k], row[1][k], row[2][k]);
    }
}
