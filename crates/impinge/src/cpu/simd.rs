//! Box tests, many at a time: AVX-512, AVX2, or plain loops that any compiler vectorises (NEON).
//!
//! A binary built for plain x86-64 finds out at run time what the processor has. Kernels are
//! generic over [`Simd`] and wrapped once per instruction set by `dispatch!`; everything between wrapper
//! and intrinsic is `inline(always)`, so a kernel is compiled whole for its set. Kernels pass no closures
//! to library functions: those would be compiled on their own, without the set.
//! The answers are bit masks of exact comparisons: no set can differ from another.

use crate::exact::filter::number::{self, Lookup, Vector};
use crate::exact::filter::{LANES, Triangles64};
use crate::grouping::GROUP;
use crate::grouping::bounds::{Bounds, BoundsArray};
#[cfg(target_arch = "x86_64")]
use crate::grouping::clusters::CHUNK;
use crate::grouping::clusters::LocalFaces;
use crate::settings::InstructionSet;

use super::bounds::of_vertices_f32;

/// The boxes of one group, a lane each; lanes past the group's size hold empty boxes.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub struct LaneBounds {
    /// Low ends, an axis a row.
    pub min: [[f32; GROUP]; 3],
    /// High ends.
    pub max: [[f32; GROUP]; 3],
}

impl LaneBounds {
    /// Nothing in any lane.
    pub const EMPTY: LaneBounds = LaneBounds {
        min: [[f32::INFINITY; GROUP]; 3],
        max: [[f32::NEG_INFINITY; GROUP]; 3],
    };

    /// The box of a lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Bounds {
        Bounds {
            min: [self.min[0][lane], self.min[1][lane], self.min[2][lane]],
            max: [self.max[0][lane], self.max[1][lane], self.max[2][lane]],
        }
    }

    /// Sets the box of a lane.
    #[inline(always)]
    pub fn put(&mut self, lane: usize, bounds: &Bounds) {
        for axis in 0..3 {
            self.min[axis][lane] = bounds.min[axis];
            self.max[axis][lane] = bounds.max[axis];
        }
    }

    /// Empties the lanes from this one on.
    pub fn clear_from(&mut self, lane: usize) {
        for axis in 0..3 {
            self.min[axis][lane..].fill(f32::INFINITY);
            self.max[axis][lane..].fill(f32::NEG_INFINITY);
        }
    }
}

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

/// The triangles of a cluster, twice: for those who load each corner, and for those who load each vertex once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClusterFaces<'a> {
    /// At most 64.
    pub faces: &'a [[u32; 3]],
    /// Unique vertices, in whole chunks of [`CHUNK`](crate::grouping::clusters::CHUNK).
    pub vertices: &'a [u32],
    /// The corners as numbers of `vertices`.
    pub local: &'a LocalFaces,
}

/// A mask for each primitive of a group.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub struct Masks(pub [u64; GROUP]);

impl Default for Masks {
    fn default() -> Self {
        Masks([0; GROUP])
    }
}

/// The lanes from the first to a lane.
#[inline(always)]
pub(crate) fn up_to(lane: usize) -> u64 {
    u64::MAX >> (GROUP - 1 - lane)
}

/// A number for each primitive of a group.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Lanes32(pub [u32; GROUP]);

/// An instruction set: the box tests that kernels are made of.
pub(crate) trait Simd: Copy {
    /// The f64 of the narrow stage's filters.
    type F64: Vector;

    /// The f32 of the filter that settles most pairs of triangles.
    type F32: Lookup;

    /// Bit `k`: box `first + k` overlaps `query`, for `k` below 8.
    fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Bounds) -> u32;

    /// Bit `k`: lane `k` overlaps `query`; only lanes of `among` are looked at.
    fn overlaps_64(self, boxes: &LaneBounds, query: &Bounds, among: u64) -> u64;

    /// For each lane of `rows`, the mask of the lanes of `boxes` that its box among `queries` overlaps; only
    /// lanes of `among` are looked at. Masks of other rows are zero.
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

    /// For each lane of `among`, the mask of the lanes of `among` beyond it that it overlaps. Other masks are
    /// zero.
    #[inline(always)]
    fn overlaps_within(self, boxes: &LaneBounds, among: u64, masks: &mut Masks) {
        masks.0 = [0; GROUP];
        for row in Lanes(among) {
            masks.0[row] = self.overlaps_64(boxes, &boxes.at(row), among & !up_to(row));
        }
    }

    /// Writes the lanes of a mask, lowest first, and anything after them; returns how many there are.
    #[inline(always)]
    fn list_lanes(self, mask: u64, list: &mut [u8; GROUP]) -> usize {
        let mut n = 0;
        for lane in Lanes(mask) {
            list[n] = lane as u8;
            n += 1;
        }
        n
    }

    /// Bit `k`: lane `k` equals `query`; only lanes of `among` are looked at.
    fn equals_64(self, lanes: &Lanes32, query: u32, among: u64) -> u64;

    /// The box of some vertices, and whether all are certainly finite, as [`of_vertices_f32`] finds them.
    ///
    /// # Panics
    /// If there is no such vertex.
    ///
    /// # Safety
    /// `vertices` must not descend.
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool);

    /// The corners of a cluster's triangles as tables; places past its size hold anything.
    ///
    /// # Panics
    /// If there is no such vertex.
    fn put_corners(
        self,
        positions: &[[f32; 3]],
        cluster: &ClusterFaces<'_>,
        into: &mut Triangles64,
    );

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

/// One coordinate after the other, from a place on.
#[inline(always)]
fn put_corners(positions: &[[f32; 3]], faces: &[[u32; 3]], first: usize, into: &mut Triangles64) {
    for (place, face) in (first..).zip(faces) {
        for (corner, &vertex) in face.iter().enumerate() {
            let point = &positions[vertex as usize];
            for axis in 0..3 {
                into[corner][axis][place] = point[axis];
            }
        }
    }
}

/// Plain loops.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable;

impl Simd for Portable {
    type F64 = number::Portable;
    type F32 = number::Portable32;

    #[inline(always)]
    fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Bounds) -> u32 {
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

    #[inline(always)]
    fn overlaps_64(self, boxes: &LaneBounds, query: &Bounds, among: u64) -> u64 {
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
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool) {
        of_vertices_f32(positions, vertices)
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

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use crate::exact::filter::number::Lookup;
    use crate::exact::filter::{BATCH, TABLE};

    use super::{
        Bounds, BoundsArray, CHUNK, ClusterFaces, GROUP, LANES, LaneBounds, Lanes, Lanes32, Masks,
        Simd, Triangles64, number, of_vertices_f32, put_corners, put_vertices, up_to,
    };

    /// 256-bit registers. Only made where `avx2` was detected.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx2(());

    /// 512-bit registers and mask registers. Only made where `avx512f` and its extensions `vl`, `dq`, `bw` and
    /// `vbmi2` were detected.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx512(());

    impl Avx2 {
        /// # Safety
        /// The processor must have AVX2.
        pub(crate) unsafe fn new() -> Self {
            Avx2(())
        }
    }

    impl Avx512 {
        /// # Safety
        /// The processor must have AVX-512 F, VL, DQ, BW and VBMI2.
        pub(crate) unsafe fn new() -> Self {
            Avx512(())
        }
    }

    /// Eight vertices as rows of x, y and z: two columns of four, transposed side by side. None where one
    /// of them is the last one or past it: a vertex is read as 16 bytes, of which its successor has four.
    ///
    /// # Safety
    /// The caller must be compiled for AVX2.
    #[inline(always)]
    unsafe fn rows(positions: &[[f32; 3]], vertices: [u32; LANES]) -> Option<[__m256; 3]> {
        let end = positions.len().saturating_sub(1);
        let mut all_inside = true;
        for vertex in vertices {
            all_inside &= (vertex as usize) < end;
        }
        if !all_inside {
            return None;
        }
        let first = positions.as_ptr();
        // SAFETY: all vertices have a successor, as was just seen, so 16 bytes lie in the slice.
        unsafe {
            let load = [
                _mm_loadu_ps(first.add(vertices[0] as usize).cast()),
                _mm_loadu_ps(first.add(vertices[1] as usize).cast()),
                _mm_loadu_ps(first.add(vertices[2] as usize).cast()),
                _mm_loadu_ps(first.add(vertices[3] as usize).cast()),
                _mm_loadu_ps(first.add(vertices[4] as usize).cast()),
                _mm_loadu_ps(first.add(vertices[5] as usize).cast()),
                _mm_loadu_ps(first.add(vertices[6] as usize).cast()),
                _mm_loadu_ps(first.add(vertices[7] as usize).cast()),
            ];
            let a = _mm256_set_m128(load[4], load[0]);
            let b = _mm256_set_m128(load[5], load[1]);
            let c = _mm256_set_m128(load[6], load[2]);
            let d = _mm256_set_m128(load[7], load[3]);
            let xy_ab = _mm256_unpacklo_ps(a, b);
            let xy_cd = _mm256_unpacklo_ps(c, d);
            let z_ab = _mm256_unpackhi_ps(a, b);
            let z_cd = _mm256_unpackhi_ps(c, d);
            Some([
                _mm256_shuffle_ps::<0b01_00_01_00>(xy_ab, xy_cd),
                _mm256_shuffle_ps::<0b11_10_11_10>(xy_ab, xy_cd),
                _mm256_shuffle_ps::<0b01_00_01_00>(z_ab, z_cd),
            ])
        }
    }

    /// As `Simd::put_corners`.
    ///
    /// # Safety
    /// The caller must be compiled for AVX2.
    #[inline(always)]
    unsafe fn put_corners_by_eights(
        positions: &[[f32; 3]],
        faces: &[[u32; 3]],
        into: &mut Triangles64,
    ) {
        assert!(faces.len() <= TABLE);
        let (eights, rest) = faces.as_chunks::<8>();
        for (eight_ix, eight) in eights.iter().enumerate() {
            let place = 8 * eight_ix;
            for corner in 0..3 {
                let vertices = [
                    eight[0][corner],
                    eight[1][corner],
                    eight[2][corner],
                    eight[3][corner],
                    eight[4][corner],
                    eight[5][corner],
                    eight[6][corner],
                    eight[7][corner],
                ];
                // SAFETY: the caller's.
                let Some(rows) = (unsafe { rows(positions, vertices) }) else {
                    put_corners(positions, eight, place, into);
                    break;
                };
                for axis in 0..3 {
                    let row = into[corner][axis][place..].first_chunk_mut::<8>();
                    let row = row.expect("at most 64 faces");
                    // SAFETY: a row of eight.
                    unsafe { _mm256_storeu_ps(row.as_mut_ptr(), rows[axis]) };
                }
            }
        }
        put_corners(positions, rest, 8 * eights.len(), into);
    }

    /// As `Simd::put_corners`, for at most 64 vertices: each is loaded once, and corners are looked up.
    ///
    /// # Safety
    /// The caller must be compiled for AVX-512.
    #[inline(always)]
    unsafe fn put_corners_by_vertices(
        positions: &[[f32; 3]],
        cluster: &ClusterFaces<'_>,
        into: &mut Triangles64,
    ) {
        let mut points = Table([[0.0f32; TABLE]; 3]);
        let (chunks, _) = cluster.vertices.as_chunks::<CHUNK>();
        for (chunk_ix, &chunk) in chunks.iter().take(TABLE / CHUNK).enumerate() {
            let first = CHUNK * chunk_ix;
            // SAFETY: the caller's.
            if let Some(rows) = unsafe { rows(positions, chunk) } {
                for (table, row) in points.0.iter_mut().zip(rows) {
                    let eight = table[first..].first_chunk_mut::<CHUNK>();
                    let eight = eight.expect("at most 64 vertices");
                    // SAFETY: a row of eight.
                    unsafe { _mm256_storeu_ps(eight.as_mut_ptr(), row) };
                }
            } else {
                for (place, vertex) in (first..).zip(chunk) {
                    for (table, x) in points.0.iter_mut().zip(positions[vertex as usize]) {
                        table[place] = x;
                    }
                }
            }
        }
        for (local, corner) in cluster.local.iter().zip(into) {
            let (batches, _) = local.as_chunks::<BATCH>();
            for (batch_ix, batch) in batches.iter().enumerate() {
                let places = number::Avx512F32::places(batch, 0);
                for (table, row) in points.0.iter().zip(&mut *corner) {
                    number::Avx512F32::look_up(table, places).store(row, BATCH * batch_ix);
                }
            }
        }
    }

    #[repr(C, align(64))]
    struct Table([[f32; TABLE]; 3]);

    /// As `Simd::of_ascending`: two vertices a register and four chains, which hide the latency of minimum
    /// and maximum.
    ///
    /// # Safety
    /// The caller must be compiled for AVX2, and `vertices` must not descend.
    #[inline(always)]
    unsafe fn of_ascending(positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool) {
        let (chunks, rest) = vertices.as_chunks::<CHUNK>();
        let last = vertices.last().map_or(0, |&last| last as usize);
        if !rest.is_empty() || last + 1 >= positions.len() {
            return of_vertices_f32(positions, vertices);
        }
        let first = positions.as_ptr();
        // SAFETY: no vertex is higher than the last one, which has a successor: the 16 bytes of which a vertex
        // is the first 12 lie within the slice.
        unsafe {
            let mut min = [_mm256_set1_ps(f32::INFINITY); CHUNK / 2];
            let mut max = [_mm256_set1_ps(f32::NEG_INFINITY); CHUNK / 2];
            let mut sum = [_mm256_setzero_ps(); CHUNK / 2];
            for chunk in chunks {
                for k in 0..CHUNK / 2 {
                    let low = _mm_loadu_ps(first.add(chunk[2 * k] as usize).cast());
                    let high = _mm_loadu_ps(first.add(chunk[2 * k + 1] as usize).cast());
                    let two = _mm256_set_m128(high, low);
                    min[k] = _mm256_min_ps(min[k], two);
                    max[k] = _mm256_max_ps(max[k], two);
                    sum[k] = _mm256_add_ps(sum[k], two);
                }
            }
            let min = _mm256_min_ps(_mm256_min_ps(min[0], min[1]), _mm256_min_ps(min[2], min[3]));
            let max = _mm256_max_ps(_mm256_max_ps(max[0], max[1]), _mm256_max_ps(max[2], max[3]));
            let sum = _mm256_add_ps(_mm256_add_ps(sum[0], sum[1]), _mm256_add_ps(sum[2], sum[3]));
            let (low, high) = (_mm256_castps256_ps128(min), _mm256_extractf128_ps::<1>(min));
            let min = xyz(_mm_min_ps(low, high));
            let (low, high) = (_mm256_castps256_ps128(max), _mm256_extractf128_ps::<1>(max));
            let max = xyz(_mm_max_ps(low, high));
            let (low, high) = (_mm256_castps256_ps128(sum), _mm256_extractf128_ps::<1>(sum));
            let [x, y, z] = xyz(_mm_add_ps(low, high));
            (Bounds { min, max }, (x + y + z).is_finite())
        }
    }

    #[inline(always)]
    fn xyz(row: __m128) -> [f32; 3] {
        let mut out = [0.0f32; 4];
        // SAFETY: SSE belongs to every x86-64 processor, and `out` holds 16 bytes.
        unsafe { _mm_storeu_ps(out.as_mut_ptr(), row) };
        [out[0], out[1], out[2]]
    }

    impl Simd for Avx2 {
        type F64 = number::Avx2;
        type F32 = number::Avx2F32;

        #[inline(always)]
        fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Bounds) -> u32 {
            assert!(first <= boxes.len());
            // SAFETY: `Avx2` exists only where the processor has it; arrays are padded by
            // `READ_AHEAD` past `len`, and `first <= len` was just asserted.
            unsafe {
                let mut all = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
                for axis in 0..3 {
                    let min = _mm256_loadu_ps(boxes.min[axis].as_ptr().add(first));
                    let max = _mm256_loadu_ps(boxes.max[axis].as_ptr().add(first));
                    let low = _mm256_cmp_ps::<_CMP_LE_OQ>(min, _mm256_set1_ps(query.max[axis]));
                    let high = _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_set1_ps(query.min[axis]), max);
                    all = _mm256_and_ps(all, _mm256_and_ps(low, high));
                }
                _mm256_movemask_ps(all) as u32
            }
        }

        #[inline(always)]
        fn overlaps_64(self, boxes: &LaneBounds, query: &Bounds, among: u64) -> u64 {
            // SAFETY: `Avx2` exists only where the processor has it; lanes 8 c .. 8 c + 8 of 64
            // lie within their array, which is aligned to 64 bytes.
            unsafe {
                let query_min = [
                    _mm256_set1_ps(query.min[0]),
                    _mm256_set1_ps(query.min[1]),
                    _mm256_set1_ps(query.min[2]),
                ];
                let query_max = [
                    _mm256_set1_ps(query.max[0]),
                    _mm256_set1_ps(query.max[1]),
                    _mm256_set1_ps(query.max[2]),
                ];
                let mut mask = 0u64;
                for chunk in 0..8 {
                    if (among >> (8 * chunk)) & 0xff == 0 {
                        continue;
                    }
                    let mut all = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
                    for axis in 0..3 {
                        let min = _mm256_load_ps(boxes.min[axis].as_ptr().add(8 * chunk));
                        let max = _mm256_load_ps(boxes.max[axis].as_ptr().add(8 * chunk));
                        let low = _mm256_cmp_ps::<_CMP_LE_OQ>(min, query_max[axis]);
                        let high = _mm256_cmp_ps::<_CMP_LE_OQ>(query_min[axis], max);
                        all = _mm256_and_ps(all, _mm256_and_ps(low, high));
                    }
                    mask |= u64::from(_mm256_movemask_ps(all) as u32) << (8 * chunk);
                }
                mask & among
            }
        }

        #[inline(always)]
        fn equals_64(self, lanes: &Lanes32, query: u32, among: u64) -> u64 {
            // SAFETY: as above, lane for lane.
            unsafe {
                let query = _mm256_set1_epi32(query as i32);
                let mut mask = 0u64;
                for chunk in 0..8 {
                    if (among >> (8 * chunk)) & 0xff == 0 {
                        continue;
                    }
                    let lanes = _mm256_load_si256(lanes.0.as_ptr().add(8 * chunk).cast());
                    let equal = _mm256_castsi256_ps(_mm256_cmpeq_epi32(lanes, query));
                    mask |= u64::from(_mm256_movemask_ps(equal) as u32) << (8 * chunk);
                }
                mask & among
            }
        }

        #[inline(always)]
        unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool) {
            // SAFETY: `Avx2` exists only where the processor has AVX2; the caller keeps the order.
            unsafe { of_ascending(positions, vertices) }
        }

        #[inline(always)]
        fn put_corners(
            self,
            positions: &[[f32; 3]],
            cluster: &ClusterFaces<'_>,
            into: &mut Triangles64,
        ) {
            // SAFETY: `Avx2` exists only where the processor has AVX2.
            unsafe { put_corners_by_eights(positions, cluster.faces, into) };
        }

        #[inline(always)]
        fn put_vertices(
            self,
            positions: &[[f32; 3]],
            vertices: [u32; LANES],
            into: &mut [[f64; LANES]; 3],
        ) {
            // SAFETY: `Avx2` exists only where the processor has it; a row holds two times four.
            unsafe {
                let Some(rows) = rows(positions, vertices) else {
                    return put_vertices(positions, vertices, into);
                };
                for axis in 0..3 {
                    let low = _mm256_cvtps_pd(_mm256_castps256_ps128(rows[axis]));
                    let high = _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(rows[axis]));
                    _mm256_storeu_pd(into[axis].as_mut_ptr(), low);
                    _mm256_storeu_pd(into[axis].as_mut_ptr().add(4), high);
                }
            }
        }
    }

    /// What sixteen lanes add to the masks of some rows. The lanes' boxes stay in registers.
    ///
    /// # Safety
    /// The caller must be compiled for AVX-512.
    #[inline(always)]
    unsafe fn chunk_overlaps(
        boxes: &LaneBounds,
        chunk: usize,
        among: u64,
        queries: &LaneBounds,
        rows: u64,
        masks: &mut Masks,
    ) {
        let among = (among >> (16 * chunk)) as __mmask16;
        if among == 0 {
            return;
        }
        // SAFETY: lanes 16 c .. 16 c + 16 of 64 lie within their array, which is aligned to 64 bytes.
        unsafe {
            let row = |axis: &[f32; GROUP]| _mm512_load_ps(axis.as_ptr().add(16 * chunk));
            let min = [row(&boxes.min[0]), row(&boxes.min[1]), row(&boxes.min[2])];
            let max = [row(&boxes.max[0]), row(&boxes.max[1]), row(&boxes.max[2])];
            for row in Lanes(rows) {
                let mut all = among;
                for axis in 0..3 {
                    let query_min = _mm512_set1_ps(queries.min[axis][row]);
                    let query_max = _mm512_set1_ps(queries.max[axis][row]);
                    all = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(all, min[axis], query_max);
                    all = _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(all, max[axis], query_min);
                }
                masks.0[row] |= u64::from(all) << (16 * chunk);
            }
        }
    }

    /// The number of each lane.
    #[repr(C, align(64))]
    struct Numbers([u8; GROUP]);

    static LANE: Numbers = {
        let mut lanes = [0; GROUP];
        let mut lane = 0;
        while lane < GROUP {
            lanes[lane] = lane as u8;
            lane += 1;
        }
        Numbers(lanes)
    };

    impl Simd for Avx512 {
        type F64 = number::Avx512;
        type F32 = number::Avx512F32;

        #[inline(always)]
        fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Bounds) -> u32 {
            assert!(first <= boxes.len());
            // SAFETY: as for `Avx2`, with the mask comparisons of AVX-512 VL.
            unsafe {
                let mut all: __mmask8 = 0xff;
                for axis in 0..3 {
                    let min = _mm256_loadu_ps(boxes.min[axis].as_ptr().add(first));
                    let max = _mm256_loadu_ps(boxes.max[axis].as_ptr().add(first));
                    let query_max = _mm256_set1_ps(query.max[axis]);
                    let query_min = _mm256_set1_ps(query.min[axis]);
                    all = _mm256_mask_cmp_ps_mask::<_CMP_LE_OQ>(all, min, query_max);
                    all = _mm256_mask_cmp_ps_mask::<_CMP_LE_OQ>(all, query_min, max);
                }
                u32::from(all)
            }
        }

        #[inline(always)]
        fn overlaps_64(self, boxes: &LaneBounds, query: &Bounds, among: u64) -> u64 {
            // SAFETY: `Avx512` exists only where the processor has it; lanes 16 c .. 16 c + 16 of
            // 64 lie within their array, which is aligned to 64 bytes.
            unsafe {
                let query_min = [
                    _mm512_set1_ps(query.min[0]),
                    _mm512_set1_ps(query.min[1]),
                    _mm512_set1_ps(query.min[2]),
                ];
                let query_max = [
                    _mm512_set1_ps(query.max[0]),
                    _mm512_set1_ps(query.max[1]),
                    _mm512_set1_ps(query.max[2]),
                ];
                let mut mask = 0u64;
                for chunk in 0..4 {
                    let mut all = (among >> (16 * chunk)) as __mmask16;
                    if all == 0 {
                        continue;
                    }
                    for axis in 0..3 {
                        let min = _mm512_load_ps(boxes.min[axis].as_ptr().add(16 * chunk));
                        let max = _mm512_load_ps(boxes.max[axis].as_ptr().add(16 * chunk));
                        all = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(all, min, query_max[axis]);
                        all = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(all, query_min[axis], max);
                    }
                    mask |= u64::from(all) << (16 * chunk);
                }
                mask
            }
        }

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
            for chunk in 0..4 {
                // SAFETY: `Avx512` exists only where the processor has it.
                unsafe { chunk_overlaps(boxes, chunk, among, queries, rows, masks) };
            }
        }

        #[inline(always)]
        fn overlaps_within(self, boxes: &LaneBounds, among: u64, masks: &mut Masks) {
            masks.0 = [0; GROUP];
            for chunk in 0..4 {
                // A lane of this chunk is beyond no row that is past the chunk.
                let rows = among & up_to(16 * chunk + 15);
                // SAFETY: `Avx512` exists only where the processor has it.
                unsafe { chunk_overlaps(boxes, chunk, among, boxes, rows, masks) };
            }
            for (row, mask) in masks.0.iter_mut().enumerate() {
                *mask &= !up_to(row);
            }
        }

        #[inline(always)]
        fn list_lanes(self, mask: u64, list: &mut [u8; GROUP]) -> usize {
            // SAFETY: `Avx512` exists only where the processor has it; one store of 64 bytes.
            unsafe {
                let lanes =
                    _mm512_maskz_compress_epi8(mask, _mm512_load_si512(LANE.0.as_ptr().cast()));
                _mm512_storeu_si512(list.as_mut_ptr().cast(), lanes);
            }
            mask.count_ones() as usize
        }

        #[inline(always)]
        fn equals_64(self, lanes: &Lanes32, query: u32, among: u64) -> u64 {
            // SAFETY: as above, lane for lane.
            unsafe {
                let query = _mm512_set1_epi32(query as i32);
                let mut mask = 0u64;
                for chunk in 0..4 {
                    let among = (among >> (16 * chunk)) as __mmask16;
                    if among == 0 {
                        continue;
                    }
                    let lanes = _mm512_load_si512(lanes.0.as_ptr().add(16 * chunk).cast());
                    let equal = _mm512_mask_cmpeq_epi32_mask(among, lanes, query);
                    mask |= u64::from(equal) << (16 * chunk);
                }
                mask
            }
        }

        #[inline(always)]
        unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool) {
            // SAFETY: `Avx512` exists only where the processor has AVX2 too; the caller keeps the order.
            unsafe { of_ascending(positions, vertices) }
        }

        #[inline(always)]
        fn put_corners(
            self,
            positions: &[[f32; 3]],
            cluster: &ClusterFaces<'_>,
            into: &mut Triangles64,
        ) {
            // SAFETY: `Avx512` exists only where the processor has it, and AVX2 too.
            unsafe {
                if cluster.vertices.len() > TABLE {
                    put_corners_by_eights(positions, cluster.faces, into);
                } else {
                    put_corners_by_vertices(positions, cluster, into);
                }
            }
        }

        #[inline(always)]
        fn put_vertices(
            self,
            positions: &[[f32; 3]],
            vertices: [u32; LANES],
            into: &mut [[f64; LANES]; 3],
        ) {
            // SAFETY: `Avx512` exists only where the processor has it; a row holds eight.
            unsafe {
                let Some(rows) = rows(positions, vertices) else {
                    return put_vertices(positions, vertices, into);
                };
                for axis in 0..3 {
                    _mm512_storeu_pd(into[axis].as_mut_ptr(), _mm512_cvtps_pd(rows[axis]));
                }
            }
        }
    }
}

/// The instruction sets that kernels are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// Plain loops.
    Portable,
    /// 256 bits.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 512 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// The best one that this processor has, and that is allowed.
    pub fn detect(allowed: InstructionSet) -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if allowed >= InstructionSet::Avx512
                && is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512vbmi2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("popcnt")
                && is_x86_feature_detected!("lzcnt")
            {
                return Isa::Avx512;
            }
            if allowed >= InstructionSet::Avx2
                && is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("popcnt")
                && is_x86_feature_detected!("lzcnt")
            {
                return Isa::Avx2;
            }
        }
        let _ = allowed;
        Isa::Portable
    }
}

/// Calls a kernel `fn kernel(simd: impl Simd, …)`, marked `inline(always)`, compiled for `$isa`.
macro_rules! dispatch {
    ($isa:expr, $kernel:path, ($($name:ident: $type:ty = $value:expr),* $(,)?) $(-> $result:ty)?) => {{
        // A function of its own, as the others are: not optimised, a kernel's frame is half a megabyte.
        fn portable($($name: $type),*) $(-> $result)? {
            $kernel($crate::cpu::simd::Portable, $($name),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
        fn avx2($($name: $type),*) $(-> $result)? {
            // SAFETY: the caller's features include AVX2.
            $kernel(unsafe { $crate::cpu::simd::Avx2::new() }, $($name),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi2,avx2,bmi1,bmi2,popcnt,lzcnt")]
        fn avx512($($name: $type),*) $(-> $result)? {
            // SAFETY: the caller's features include AVX-512 F, VL, DQ, BW and VBMI2.
            $kernel(unsafe { $crate::cpu::simd::Avx512::new() }, $($name),*)
        }
        match $isa {
            $crate::cpu::simd::Isa::Portable => portable($($value),*),
            // SAFETY: an `Isa` is only ever one that `Isa::detect` found on this processor.
            #[cfg(target_arch = "x86_64")]
            $crate::cpu::simd::Isa::Avx2 => unsafe { avx2($($value),*) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            $crate::cpu::simd::Isa::Avx512 => unsafe { avx512($($value),*) },
        }
    }};
}
pub(crate) use dispatch;

/// For each query, which of the lanes of `among` it overlaps: `overlaps_64` for callers that are not
/// themselves compiled once an instruction set. As many queries are answered as there are masks.
pub fn masks(isa: Isa, boxes: &LaneBounds, among: u64, queries: &[Bounds], masks: &mut [u64]) {
    dispatch!(isa, all_masks, (
        boxes: &LaneBounds = boxes,
        among: u64 = among,
        queries: &[Bounds] = queries,
        masks: &mut [u64] = masks,
    ));
}

#[inline(always)]
fn all_masks<S: Simd>(
    simd: S,
    boxes: &LaneBounds,
    among: u64,
    queries: &[Bounds],
    masks: &mut [u64],
) {
    for (mask, query) in masks.iter_mut().zip(queries) {
        *mask = simd.overlaps_64(boxes, query, among);
    }
}
