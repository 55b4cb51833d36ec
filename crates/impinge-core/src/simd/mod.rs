//! Box tests, many at a time: AVX-512, AVX2, WebAssembly's vectors, or plain loops that any
//! compiler vectorises (NEON).
//!
//! A binary built for plain x86-64 detects at run time which instruction sets the processor has.
//! Kernels are generic over `Simd` and wrapped once per instruction set by `traversal!`; everything
//! between wrapper and intrinsic is `inline(always)`, so a whole kernel is compiled for its set.
//! Kernels pass no closures to library functions: those would be compiled separately, without the
//! set. The answers are bit masks of exact comparisons, so they are the same for every set.

#[cfg(target_arch = "x86_64")]
use crate::bvh::CHUNK;
use crate::bvh::GROUP;
pub use crate::bvh::bounds::LaneBounds;
use crate::bvh::bounds::{Aabb, BoundsArray};
use crate::bvh::clusters::LocalFaces;
use impinge_exact::internal::filter::number::{self, Lookup, Vector};
use impinge_exact::internal::filter::{BATCH, LANES, Triangles64};

use self::runs::{Members, RUN, RunExtents};
use crate::boxes::{ReadVertices, of_vertices_f32};
use crate::scene::positions::Real;

/// A coordinate of a vertex, as instruction sets read it.
#[cfg(not(target_arch = "x86_64"))]
pub(crate) use crate::scene::positions::Real as Coordinate;
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::Load4 as Coordinate;

/// Lanes of a mask, lowest first.
pub(crate) struct Lanes(pub u64);

impl Iterator for Lanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        (self.0 != 0).then(|| {
            let lane = self.0.trailing_zeros() as usize;
            self.0 &= self.0 - 1;
            lane
        })
    }
}

/// The triangles of a cluster in two forms: for kernels that load each corner, and for kernels that
/// load each vertex once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClusterFaces<'a> {
    /// At most 64.
    pub faces: &'a [[u32; 3]],
    /// Unique vertices, in whole chunks of [`CHUNK`](crate::bvh::CHUNK).
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub vertices: &'a [u32],
    /// The corners as numbers of `vertices`, if the instruction set looks them up.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub local: Option<&'a LocalFaces>,
}

/// One mask per element of a group.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub struct Masks(pub [u64; GROUP]);

impl Default for Masks {
    fn default() -> Self {
        Masks([0; GROUP])
    }
}

/// The lanes up to and including `lane`.
#[inline(always)]
pub(crate) fn up_to(lane: usize) -> u64 {
    u64::MAX >> (GROUP - 1 - lane)
}

/// One number per element of a group.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Lanes32(pub [u32; GROUP]);

/// An instruction set: the box tests that kernels are made of.
pub(crate) trait Simd: ReadVertices {
    /// The f64 register of the narrow stage's filters.
    type F64: Vector;

    /// The f32 register of the filter that decides most pairs of triangles.
    type F32: Lookup;

    /// Bit `k`: box `first + k` overlaps `query`, for `k` below 8.
    fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Aabb) -> u32;

    /// Bit `k`: lane `k` overlaps `query`; only lanes of `among` are tested.
    fn overlaps_64(self, boxes: &LaneBounds, query: &Aabb, among: u64) -> u64;

    /// Bit `k`: lane `k`, whose box moves from `start` to `end`, is not beside `query` on the same
    /// side of one axis at both ends; only lanes of `among` are tested. A box that is beside it at
    /// both ends is so all the time.
    #[inline(always)]
    fn meets_64(
        self,
        [start, end]: [&LaneBounds; 2],
        [query_start, query_end]: &[Aabb; 2],
        among: u64,
    ) -> u64 {
        let mut mask = 0;
        for chunk in 0..8 {
            if among >> (8 * chunk) & 0xff == 0 {
                continue;
            }
            let mut meets = [1u8; 8];
            for axis in 0..3 {
                for (k, bit) in meets.iter_mut().enumerate() {
                    let lane = 8 * chunk + k;
                    let below = u8::from(start.min[axis][lane] <= query_start.max[axis])
                        | u8::from(end.min[axis][lane] <= query_end.max[axis]);
                    let above = u8::from(query_start.min[axis] <= start.max[axis][lane])
                        | u8::from(query_end.min[axis] <= end.max[axis][lane]);
                    *bit &= below & above;
                }
            }
            for (k, bit) in meets.into_iter().enumerate() {
                mask |= u64::from(bit) << (8 * chunk + k);
            }
        }
        mask & among
    }

    /// For each lane of `rows`, the mask of the lanes of `boxes` that its box in `queries`
    /// overlaps; only lanes of `among` are tested. Masks of other rows are zero.
    #[inline(always)]
    fn overlaps_rows(
        self,
        boxes: &LaneBounds,
        among: u64,
        queries: &LaneBounds,
        rows: u64,
        masks: &mut Masks,
    ) {
        masks.0 = [0; GROUP];
        for row in Lanes(rows) {
            masks.0[row] = self.overlaps_64(boxes, &queries.at(row), among);
        }
    }

    /// For each lane of `among`, the mask of the higher lanes of `among` that it overlaps. Other
    /// masks are zero.
    #[inline(always)]
    fn overlaps_within(self, boxes: &LaneBounds, among: u64, masks: &mut Masks) {
        masks.0 = [0; GROUP];
        for row in Lanes(among) {
            masks.0[row] = self.overlaps_64(boxes, &boxes.at(row), among & !up_to(row));
        }
    }

    /// As [`overlaps_rows`](Simd::overlaps_rows), where boxes move: the lanes that each row
    /// [meets](Simd::meets_64).
    #[inline(always)]
    fn meets_rows(
        self,
        boxes: [&LaneBounds; 2],
        among: u64,
        [start, end]: [&LaneBounds; 2],
        rows: u64,
        masks: &mut Masks,
    ) {
        masks.0 = [0; GROUP];
        for row in Lanes(rows) {
            masks.0[row] = self.meets_64(boxes, &[start.at(row), end.at(row)], among);
        }
    }

    /// As [`overlaps_within`](Simd::overlaps_within), where boxes move.
    #[inline(always)]
    fn meets_within(self, boxes: [&LaneBounds; 2], among: u64, masks: &mut Masks) {
        masks.0 = [0; GROUP];
        for row in Lanes(among) {
            let query = boxes.map(|boxes| boxes.at(row));
            masks.0[row] = self.meets_64(boxes, &query, among & !up_to(row));
        }
    }

    /// The rows whose masks are not zero.
    #[inline(always)]
    fn rows_with_lanes(self, masks: &Masks) -> u64 {
        let (eights, _) = masks.0.as_chunks::<8>();
        let mut rows = 0;
        for (eight_ix, eight) in eights.iter().enumerate() {
            for (k, &mask) in eight.iter().enumerate() {
                rows |= u64::from(mask != 0) << (8 * eight_ix + k);
            }
        }
        rows
    }

    /// Writes the lanes of a mask, lowest first; the rest of the list is arbitrary. Returns the
    /// number of lanes.
    #[inline(always)]
    fn list_lanes(self, mask: u64, list: &mut [u8; GROUP]) -> usize {
        let mut n = 0;
        for lane in Lanes(mask) {
            list[n] = lane as u8;
            n += 1;
        }
        n
    }

    /// Bit `k`: lane `k` equals `query`; only lanes of `among` are tested.
    fn equals_64(self, lanes: &Lanes32, query: u32, among: u64) -> u64;

    /// Writes `map[k]` for each lane k of a mask, lowest first; the rest of the list is arbitrary.
    /// Returns the number of lanes.
    #[inline(always)]
    fn list_mapped(self, mask: u64, map: &[u8; GROUP], list: &mut [u8; GROUP]) -> usize {
        let mut n = 0;
        for lane in Lanes(mask) {
            list[n] = map[lane];
            n += 1;
        }
        n
    }

    /// Writes the lanes of a mask, lowest first; the rest of the list is arbitrary.
    #[inline(always)]
    fn keep_16(self, mask: u16, lanes: &[u8; BATCH], list: &mut [u8; BATCH]) {
        for (slot, lane) in Lanes(mask.into()).enumerate() {
            list[slot] = lanes[lane];
        }
    }

    /// Writes the boxes in the lanes of a mask side by side; the boxes after them are arbitrary.
    #[inline(always)]
    fn put_survivors(self, boxes: &LaneBounds, mask: u64, into: &mut LaneBounds) {
        for axis in 0..3 {
            for (n, lane) in Lanes(mask).enumerate() {
                into.min[axis][n] = boxes.min[axis][lane];
                into.max[axis][n] = boxes.max[axis][lane];
            }
        }
    }

    /// Bit `k`: some corner of the element `slots_a[k]` is a corner of `slots_b[k]`. Slots are
    /// below [`GROUP`], except those whose bits are ignored.
    #[inline(always)]
    fn share_16(self, [a, b]: [&[Lanes32]; 2], [slots_a, slots_b]: [&[u8; BATCH]; 2]) -> u16 {
        let mut mask = 0;
        for lane in 0..BATCH {
            let slot = |slots: &[u8; BATCH]| usize::from(slots[lane]) % GROUP;
            let (slot_a, slot_b) = (slot(slots_a), slot(slots_b));
            let mut is = false;
            for a in a {
                for b in b {
                    is |= a.0[slot_a] == b.0[slot_b];
                }
            }
            mask |= u16::from(is) << lane;
        }
        mask
    }

    /// Adds runs of vertices, each with its members, to the extents in `into`.
    #[inline(always)]
    fn add_runs(self, runs: &[[[f32; 3]; RUN]], members: &[Members], into: &mut RunExtents) {
        runs::add_runs(runs, members, into);
    }

    /// The corners of a cluster's triangles as tables; slots past its size are arbitrary.
    ///
    /// # Panics
    /// If there is no such vertex.
    fn put_corners(
        self,
        positions: &[[f32; 3]],
        cluster: &ClusterFaces<'_>,
        into: &mut Triangles64,
    );

    /// The first `n` of some vertices as rows of x, y and z, rounded to nearest; the rest of the
    /// rows is arbitrary.
    ///
    /// # Panics
    /// If there is no such vertex.
    #[inline(always)]
    fn put_points<R: Coordinate>(
        self,
        positions: &[[R; 3]],
        vertices: &[u32; GROUP],
        n: usize,
        into: &mut [[f32; GROUP]; 3],
    ) {
        put_points(positions, vertices, n, into);
    }

    /// Eight vertices as rows of x, y and z in double precision.
    ///
    /// # Panics
    /// If there is no such vertex.
    fn put_vertices(
        self,
        positions: &[[f32; 3]],
        vertices: [u32; LANES],
        rows: &mut [[f64; LANES]; 3],
    );
}

/// One coordinate after the other, rounded to nearest.
#[inline(always)]
fn put_points<R: Real>(
    positions: &[[R; 3]],
    vertices: &[u32; GROUP],
    n: usize,
    into: &mut [[f32; GROUP]; 3],
) {
    for lane in 0..n {
        let point = &positions[vertices[lane] as usize];
        for axis in 0..3 {
            into[axis][lane] = <f32 as Real>::round(point[axis].widen());
        }
    }
}

/// One coordinate after the other.
#[inline(always)]
fn put_vertices(positions: &[[f32; 3]], vertices: [u32; LANES], rows: &mut [[f64; LANES]; 3]) {
    for (lane, &vertex) in vertices.iter().enumerate() {
        let [x, y, z] = positions[vertex as usize];
        rows[0][lane] = x.into();
        rows[1][lane] = y.into();
        rows[2][lane] = z.into();
    }
}

/// One coordinate after the other, from a slot on.
#[inline(always)]
fn put_corners(positions: &[[f32; 3]], faces: &[[u32; 3]], first: usize, into: &mut Triangles64) {
    for (slot, face) in (first..).zip(faces) {
        for (corner, &vertex) in face.iter().enumerate() {
            let point = &positions[vertex as usize];
            for axis in 0..3 {
                into[corner][axis][slot] = point[axis];
            }
        }
    }
}

/// Plain loops.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable;

impl ReadVertices for Portable {
    #[inline(always)]
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Aabb, bool) {
        of_vertices_f32(positions, vertices)
    }
}

impl Simd for Portable {
    #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
    type F64 = number::Portable;
    #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
    type F32 = number::Portable32;

    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    type F64 = number::Wasm;
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    type F32 = number::WasmF32;

    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    #[inline(always)]
    fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Aabb) -> u32 {
        wasm::overlaps_8(boxes, first, query)
    }

    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    #[inline(always)]
    fn overlaps_64(self, boxes: &LaneBounds, query: &Aabb, among: u64) -> u64 {
        wasm::overlaps_64(boxes, query, among)
    }

    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    #[inline(always)]
    fn meets_64(self, boxes: [&LaneBounds; 2], query: &[Aabb; 2], among: u64) -> u64 {
        wasm::meets_64(boxes, query, among)
    }

    #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
    #[inline(always)]
    fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Aabb) -> u32 {
        let mut overlap = [1u8; 8];
        for axis in 0..3 {
            let min: &[f32; 8] = boxes.min[axis][first..].first_chunk().expect("padded");
            let max: &[f32; 8] = boxes.max[axis][first..].first_chunk().expect("padded");
            for k in 0..8 {
                overlap[k] &=
                    u8::from(min[k] <= query.max[axis]) & u8::from(query.min[axis] <= max[k]);
            }
        }
        (0..8).fold(0, |mask, k| mask | u32::from(overlap[k]) << k)
    }

    #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
    #[inline(always)]
    fn overlaps_64(self, boxes: &LaneBounds, query: &Aabb, among: u64) -> u64 {
        let mut mask = 0;
        for chunk in 0..8 {
            if among >> (8 * chunk) & 0xff == 0 {
                continue;
            }
            let mut overlap = [1u8; 8];
            for axis in 0..3 {
                for (k, bit) in overlap.iter_mut().enumerate() {
                    let lane = 8 * chunk + k;
                    *bit &= u8::from(boxes.min[axis][lane] <= query.max[axis])
                        & u8::from(query.min[axis] <= boxes.max[axis][lane]);
                }
            }
            for (k, bit) in overlap.into_iter().enumerate() {
                mask |= u64::from(bit) << (8 * chunk + k);
            }
        }
        mask & among
    }

    #[inline(always)]
    fn equals_64(self, lanes: &Lanes32, query: u32, mut among: u64) -> u64 {
        let mut mask = 0;
        while among != 0 {
            let lane = among.trailing_zeros() as usize;
            mask |= u64::from(lanes.0[lane] == query) << lane;
            among &= among - 1;
        }
        mask
    }

    #[inline(always)]
    fn put_corners(
        self,
        positions: &[[f32; 3]],
        cluster: &ClusterFaces<'_>,
        into: &mut Triangles64,
    ) {
        put_corners(positions, cluster.faces, 0, into);
    }

    #[inline(always)]
    fn put_vertices(
        self,
        positions: &[[f32; 3]],
        vertices: [u32; LANES],
        rows: &mut [[f64; LANES]; 3],
    ) {
        put_vertices(positions, vertices, rows);
    }
}

mod isa;
pub(crate) mod runs;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use isa::with_isa;
pub use isa::{Isa, closest_of_pairs, masks};
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};
