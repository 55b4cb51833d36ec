//! The registers of x86-64: 256 and 512 bits.

use std::arch::x86_64::*;

use impinge_exact::internal::filter::number::Lookup;
use impinge_exact::internal::filter::number::memory::write;
use impinge_exact::internal::filter::{BATCH, TABLE};

use super::{
    Bounds, BoundsArray, CHUNK, ClusterFaces, GROUP, LANES, LaneBounds, Lanes, Lanes32, LocalFaces,
    Masks, Members, RUN, ReadVertices, RunExtents, Simd, Triangles64, number, of_vertices_f32,
    put_corners, put_vertices, up_to,
};
use crate::boxes::Vec4;
use crate::scene::positions::Real;
use crate::simd::runs::COORDINATES;

/// 256-bit registers. Only created if `avx2` was detected.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2(());

/// 512-bit registers and mask registers. Only created if `avx512f` and its extensions `vl`, `dq`,
/// `bw` and `vbmi2` were detected.
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

/// A coordinate of vertices, which are read four numbers at a time.
pub(crate) trait Load4: Real {
    /// Four numbers, rounded to nearest.
    ///
    /// # Safety
    /// They must be readable, and the caller compiled for AVX2.
    unsafe fn load(numbers: *const Self) -> __m128;
}

impl Load4 for f32 {
    #[inline(always)]
    unsafe fn load(numbers: *const f32) -> __m128 {
        // SAFETY: the caller's.
        unsafe { _mm_loadu_ps(numbers) }
    }
}

impl Load4 for f64 {
    #[inline(always)]
    unsafe fn load(numbers: *const f64) -> __m128 {
        // SAFETY: the caller's.
        unsafe { _mm256_cvtpd_ps(_mm256_loadu_pd(numbers)) }
    }
}

/// Eight vertices as rows of x, y and z: two columns of four, transposed side by side. `None` if
/// one of them is the last vertex or past it: a vertex is read as four numbers, one of which
/// belongs to its successor.
///
/// # Safety
/// The caller must be compiled for AVX2.
#[inline(always)]
unsafe fn rows<R: Load4>(positions: &[[R; 3]], vertices: [u32; LANES]) -> Option<[__m256; 3]> {
    let end = positions.len().saturating_sub(1);
    let mut all_inside = true;
    for vertex in vertices {
        all_inside &= (vertex as usize) < end;
    }
    if !all_inside {
        return None;
    }
    let first = positions.as_ptr();
    // SAFETY: all vertices have a successor, as just checked, so four numbers lie in the slice.
    unsafe {
        let load = [
            R::load(first.add(vertices[0] as usize).cast()),
            R::load(first.add(vertices[1] as usize).cast()),
            R::load(first.add(vertices[2] as usize).cast()),
            R::load(first.add(vertices[3] as usize).cast()),
            R::load(first.add(vertices[4] as usize).cast()),
            R::load(first.add(vertices[5] as usize).cast()),
            R::load(first.add(vertices[6] as usize).cast()),
            R::load(first.add(vertices[7] as usize).cast()),
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
        let slot = 8 * eight_ix;
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
                put_corners(positions, eight, slot, into);
                break;
            };
            for axis in 0..3 {
                let row = into[corner][axis][slot..].first_chunk_mut::<8>();
                let row = row.expect("at most 64 faces");
                write(rows[axis], row);
            }
        }
    }
    put_corners(positions, rest, 8 * eights.len(), into);
}

/// As `Simd::put_points`.
///
/// # Safety
/// The caller must be compiled for AVX2.
#[inline(always)]
unsafe fn put_points<R: Load4>(
    positions: &[[R; 3]],
    vertices: &[u32; GROUP],
    n: usize,
    into: &mut [[f32; GROUP]; 3],
) {
    let (eights, _) = vertices.as_chunks::<LANES>();
    for (eight_ix, &eight) in eights.iter().enumerate().take(n.div_ceil(LANES)) {
        let first = LANES * eight_ix;
        // SAFETY: the caller's.
        if let Some(rows) = unsafe { rows(positions, eight) } {
            for axis in 0..3 {
                let row = into[axis][first..].first_chunk_mut::<LANES>();
                let row = row.expect("eights of 64");
                write(rows[axis], row);
            }
        } else {
            for (slot, vertex) in (first..).zip(eight) {
                for (row, x) in into.iter_mut().zip(positions[vertex as usize]) {
                    row[slot] = <f32 as Real>::round(x.widen());
                }
            }
        }
    }
}

/// As `Simd::put_corners`, for at most 64 vertices: each is loaded once, and corners are looked up.
///
/// # Safety
/// The caller must be compiled for AVX-512.
#[inline(always)]
unsafe fn put_corners_by_vertices(
    positions: &[[f32; 3]],
    vertices: &[u32],
    local: &LocalFaces,
    into: &mut Triangles64,
) {
    let mut points = CornerTable([[0.0f32; TABLE]; 3]);
    let (chunks, _) = vertices.as_chunks::<CHUNK>();
    for (chunk_ix, &chunk) in chunks.iter().take(TABLE / CHUNK).enumerate() {
        let first = CHUNK * chunk_ix;
        // SAFETY: the caller's.
        if let Some(rows) = unsafe { rows(positions, chunk) } {
            for (table, row) in points.0.iter_mut().zip(rows) {
                let eight = table[first..].first_chunk_mut::<CHUNK>();
                let eight = eight.expect("at most 64 vertices");
                write(row, eight);
            }
        } else {
            for (slot, vertex) in (first..).zip(chunk) {
                for (table, x) in points.0.iter_mut().zip(positions[vertex as usize]) {
                    table[slot] = x;
                }
            }
        }
    }
    for (local, corner) in local.iter().zip(into) {
        let (batches, _) = local.as_chunks::<BATCH>();
        for (batch_ix, batch) in batches.iter().enumerate() {
            let slots = number::Avx512F32::slots(batch, 0);
            for (table, row) in points.0.iter().zip(&mut *corner) {
                number::Avx512F32::look_up(table, slots).put(row, BATCH * batch_ix);
            }
        }
    }
}

#[repr(C, align(64))]
struct CornerTable([[f32; TABLE]; 3]);

/// Expands eight membership bits into lane masks. Non-members become all ones, an f32 NaN, for
/// which `minps` and `maxps` return their second operand.
static NO_MEMBERS: [[u32; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut k = 0;
    while k < 8 * 256 {
        if (k / 8) >> (k % 8) & 1 == 0 {
            table[k / 8][k % 8] = u32::MAX;
        }
        k += 1;
    }
    table
};

/// The lane masks of those among eight of a run's coordinates that are not in a group.
#[inline(always)]
fn no_members(members: &Members, end: usize, eight: usize) -> &'static [u32; 8] {
    let byte = members[end][eight / 2] >> (8 * (eight % 2)) & 0xff;
    &NO_MEMBERS[usize::from(byte)]
}

/// Runs that are read repeatedly, eight coordinates of each at a time, while they are in the
/// first-level cache.
const BLOCK: usize = 32;

/// As `Simd::add_runs`, for eight of the runs' coordinates: so few that all their results stay in
/// registers.
///
/// # Safety
/// The caller must be compiled for AVX2.
#[inline(always)]
unsafe fn add_eight(
    runs: &[[[f32; 3]; RUN]],
    members: &[Members],
    eight: usize,
    into: &mut RunExtents,
) {
    let first = 8 * eight;
    assert!(first + 8 <= COORDINATES);
    // SAFETY: eight coordinates from `first` on lie within a run, and within each row of `into`.
    unsafe {
        let mut min = _mm256_loadu_ps(into.min.as_ptr().add(first));
        let mut max = _mm256_loadu_ps(into.max.as_ptr().add(first));
        let mut sum = _mm256_loadu_ps(into.sum.as_ptr().add(first));
        let load = |row: &[f32; COORDINATES]| _mm256_loadu_ps(row.as_ptr().add(first));
        let mut group_min = [load(&into.group_min[0]), load(&into.group_min[1])];
        let mut group_max = [load(&into.group_max[0]), load(&into.group_max[1])];
        for (run, members) in runs.iter().zip(members) {
            let x = _mm256_loadu_ps(run.as_ptr().cast::<f32>().add(first));
            min = _mm256_min_ps(x, min);
            max = _mm256_max_ps(x, max);
            sum = _mm256_add_ps(sum, x);
            for end in 0..2 {
                let none = no_members(members, end, eight);
                let x = _mm256_or_ps(x, _mm256_loadu_ps(none.as_ptr().cast()));
                // If the first operand is NaN, the result is the second.
                group_min[end] = _mm256_min_ps(x, group_min[end]);
                group_max[end] = _mm256_max_ps(x, group_max[end]);
            }
        }
        _mm256_storeu_ps(into.min.as_mut_ptr().add(first), min);
        _mm256_storeu_ps(into.max.as_mut_ptr().add(first), max);
        _mm256_storeu_ps(into.sum.as_mut_ptr().add(first), sum);
        for end in 0..2 {
            _mm256_storeu_ps(into.group_min[end].as_mut_ptr().add(first), group_min[end]);
            _mm256_storeu_ps(into.group_max[end].as_mut_ptr().add(first), group_max[end]);
        }
    }
}

/// Coordinates in 4 KiB: the processor's own prefetching ends with the page.
const PAGE: usize = 1024;

/// As `ReadVertices::of_ascending`: two vertices per register and four chains, which hide the
/// latency of minimum and maximum.
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
    // SAFETY: no vertex is higher than the last one, which has a successor. So the 16 bytes that
    // start with a vertex's 12 lie within the slice.
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
        let min = Vec4(_mm_min_ps(low, high)).xyz();
        let (low, high) = (_mm256_castps256_ps128(max), _mm256_extractf128_ps::<1>(max));
        let max = Vec4(_mm_max_ps(low, high)).xyz();
        let (low, high) = (_mm256_castps256_ps128(sum), _mm256_extractf128_ps::<1>(sum));
        let [x, y, z] = Vec4(_mm_add_ps(low, high)).xyz();
        (Bounds { min, max }, (x + y + z).is_finite())
    }
}

/// One number per axis, in all lanes.
///
/// # Safety
/// The caller must be compiled for AVX-512.
#[inline(always)]
unsafe fn splat_512(point: &[f32; 3]) -> [__m512; 3] {
    let [x, y, z] = *point;
    // SAFETY: the caller's.
    unsafe { [_mm512_set1_ps(x), _mm512_set1_ps(y), _mm512_set1_ps(z)] }
}

/// The numbers at some slots; a slot is taken modulo 64.
///
/// # Safety
/// The caller must be compiled for AVX-512.
#[inline(always)]
unsafe fn look_up_512(lanes: &Lanes32, slots: __m512i) -> __m512i {
    let first = lanes.0.as_ptr();
    // SAFETY: the caller's; four loads of sixteen from 64. A permutation looks at the five lowest
    // bits of a slot, the choice at the sixth.
    unsafe {
        let load = |chunk: usize| _mm512_load_si512(first.add(16 * chunk).cast());
        let low = _mm512_permutex2var_epi32(load(0), slots, load(1));
        let high = _mm512_permutex2var_epi32(load(2), slots, load(3));
        let is_high = _mm512_test_epi32_mask(slots, _mm512_set1_epi32(32));
        _mm512_mask_blend_epi32(is_high, low, high)
    }
}

impl ReadVertices for Avx2 {
    #[inline(always)]
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool) {
        // SAFETY: `Avx2` exists only where the processor has AVX2; the caller guarantees the order.
        unsafe { of_ascending(positions, vertices) }
    }
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
    fn meets_64(
        self,
        [start, end]: [&LaneBounds; 2],
        [query_start, query_end]: &[Bounds; 2],
        among: u64,
    ) -> u64 {
        let mut mask = 0u64;
        for chunk in 0..8 {
            if (among >> (8 * chunk)) & 0xff == 0 {
                continue;
            }
            // SAFETY: as above.
            unsafe {
                let load = |row: &[f32; GROUP]| _mm256_load_ps(row.as_ptr().add(8 * chunk));
                let mut all = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
                for axis in 0..3 {
                    let low_start = _mm256_set1_ps(query_start.min[axis]);
                    let low_end = _mm256_set1_ps(query_end.min[axis]);
                    let high_start = _mm256_set1_ps(query_start.max[axis]);
                    let high_end = _mm256_set1_ps(query_end.max[axis]);
                    let (min_start, min_end) = (load(&start.min[axis]), load(&end.min[axis]));
                    let (max_start, max_end) = (load(&start.max[axis]), load(&end.max[axis]));
                    let below = _mm256_or_ps(
                        _mm256_cmp_ps::<_CMP_LE_OQ>(min_start, high_start),
                        _mm256_cmp_ps::<_CMP_LE_OQ>(min_end, high_end),
                    );
                    let above = _mm256_or_ps(
                        _mm256_cmp_ps::<_CMP_LE_OQ>(low_start, max_start),
                        _mm256_cmp_ps::<_CMP_LE_OQ>(low_end, max_end),
                    );
                    all = _mm256_and_ps(all, _mm256_and_ps(below, above));
                }
                mask |= u64::from(_mm256_movemask_ps(all) as u32) << (8 * chunk);
            }
        }
        mask & among
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
    fn add_runs(self, runs: &[[[f32; 3]; RUN]], members: &[Members], into: &mut RunExtents) {
        for (runs, members) in runs.chunks(BLOCK).zip(members.chunks(BLOCK)) {
            for eight in 0..COORDINATES / 8 {
                // SAFETY: `Avx2` exists only where the processor has it.
                unsafe { add_eight(runs, members, eight, into) };
            }
        }
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
    fn put_points<R: Load4>(
        self,
        positions: &[[R; 3]],
        vertices: &[u32; GROUP],
        n: usize,
        into: &mut [[f32; GROUP]; 3],
    ) {
        // SAFETY: this set exists only where the processor has AVX2.
        unsafe { put_points(positions, vertices, n, into) }
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

/// Adds sixteen lanes' bits to the masks of some rows. The lanes' boxes stay in registers.
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

/// As [`chunk_overlaps`], where boxes move: the bits of lanes that are not beside a row on the same
/// side of an axis at both ends.
///
/// # Safety
/// The caller must be compiled for AVX-512.
#[inline(always)]
unsafe fn chunk_meets(
    [start, end]: [&LaneBounds; 2],
    chunk: usize,
    among: u64,
    [query_start, query_end]: [&LaneBounds; 2],
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
        let axes = |[x, y, z]: &[[f32; GROUP]; 3]| [row(x), row(y), row(z)];
        let (min_start, max_start) = (axes(&start.min), axes(&start.max));
        let (min_end, max_end) = (axes(&end.min), axes(&end.max));
        for row in Lanes(rows) {
            let mut beside = 0;
            for axis in 0..3 {
                let all = |rows: &[[f32; GROUP]; 3]| _mm512_set1_ps(rows[axis][row]);
                let above =
                    _mm512_cmp_ps_mask::<_CMP_NLE_UQ>(min_start[axis], all(&query_start.max));
                let below =
                    _mm512_cmp_ps_mask::<_CMP_NGE_UQ>(max_start[axis], all(&query_start.min));
                beside |= _mm512_mask_cmp_ps_mask::<_CMP_NLE_UQ>(
                    above,
                    min_end[axis],
                    all(&query_end.max),
                );
                beside |= _mm512_mask_cmp_ps_mask::<_CMP_NGE_UQ>(
                    below,
                    max_end[axis],
                    all(&query_end.min),
                );
            }
            masks.0[row] |= u64::from(among & !beside) << (16 * chunk);
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

impl ReadVertices for Avx512 {
    #[inline(always)]
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool) {
        // SAFETY: `Avx512` exists only where the processor has AVX2 too; the caller guarantees the
        // order.
        unsafe { of_ascending(positions, vertices) }
    }
}

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
    fn meets_64(
        self,
        [start, end]: [&LaneBounds; 2],
        [query_start, query_end]: &[Bounds; 2],
        among: u64,
    ) -> u64 {
        // SAFETY: as above.
        unsafe {
            let low_start = splat_512(&query_start.min);
            let low_end = splat_512(&query_end.min);
            let high_start = splat_512(&query_start.max);
            let high_end = splat_512(&query_end.max);
            let mut mask = 0u64;
            for chunk in 0..4 {
                let among = (among >> (16 * chunk)) as __mmask16;
                if among == 0 {
                    continue;
                }
                let mut beside = 0;
                for axis in 0..3 {
                    let load = |row: &[f32; GROUP]| _mm512_load_ps(row.as_ptr().add(16 * chunk));
                    let (min_start, min_end) = (load(&start.min[axis]), load(&end.min[axis]));
                    let (max_start, max_end) = (load(&start.max[axis]), load(&end.max[axis]));
                    let above = _mm512_cmp_ps_mask::<_CMP_NLE_UQ>(min_start, high_start[axis]);
                    let below = _mm512_cmp_ps_mask::<_CMP_NLE_UQ>(low_start[axis], max_start);
                    beside |=
                        _mm512_mask_cmp_ps_mask::<_CMP_NLE_UQ>(above, min_end, high_end[axis]);
                    beside |= _mm512_mask_cmp_ps_mask::<_CMP_NLE_UQ>(below, low_end[axis], max_end);
                }
                mask |= u64::from(among & !beside) << (16 * chunk);
            }
            mask
        }
    }

    #[inline(always)]
    fn list_mapped(self, mask: u64, map: &[u8; GROUP], list: &mut [u8; GROUP]) -> usize {
        // SAFETY: `Avx512` exists only where the processor has it; one load and one store of 64
        // bytes.
        unsafe {
            let lanes = _mm512_maskz_compress_epi8(mask, _mm512_loadu_si512(map.as_ptr().cast()));
            _mm512_storeu_si512(list.as_mut_ptr().cast(), lanes);
        }
        mask.count_ones() as usize
    }

    #[inline(always)]
    fn keep_16(self, mask: u16, lanes: &[u8; BATCH], list: &mut [u8; BATCH]) {
        // SAFETY: `Avx512` exists only where the processor has it; one load and one store of 16
        // bytes.
        unsafe {
            let lanes = _mm_maskz_compress_epi8(mask, _mm_loadu_si128(lanes.as_ptr().cast()));
            _mm_storeu_si128(list.as_mut_ptr().cast(), lanes);
        }
    }

    #[inline(always)]
    fn put_survivors(self, boxes: &LaneBounds, mask: u64, into: &mut LaneBounds) {
        for axis in 0..3 {
            let rows = [
                (&boxes.min[axis], &mut into.min[axis]),
                (&boxes.max[axis], &mut into.max[axis]),
            ];
            for (row, into) in rows {
                let mut n = 0;
                for chunk in 0..4 {
                    let mask = (mask >> (16 * chunk)) as __mmask16;
                    // SAFETY: `Avx512` exists only where the processor has it. At most 16 numbers
                    // of each chunk before were put, so sixteen more lie within the row.
                    unsafe {
                        let lanes = _mm512_load_ps(row.as_ptr().add(16 * chunk));
                        let lanes = _mm512_maskz_compress_ps(mask, lanes);
                        _mm512_storeu_ps(into.as_mut_ptr().add(n), lanes);
                    }
                    n += mask.count_ones() as usize;
                }
            }
        }
    }

    #[inline(always)]
    fn share_16(self, [a, b]: [&[Lanes32]; 2], [slots_a, slots_b]: [&[u8; BATCH]; 2]) -> u16 {
        // SAFETY: `Avx512` exists only where the processor has it; loads of sixteen bytes, and of
        // sixteen numbers of 64.
        unsafe {
            let slots =
                |slots: &[u8; BATCH]| _mm512_cvtepu8_epi32(_mm_loadu_si128(slots.as_ptr().cast()));
            let (slots_a, slots_b) = (slots(slots_a), slots(slots_b));
            let mut mask = 0;
            for a in a {
                let a = look_up_512(a, slots_a);
                for b in b {
                    mask |= _mm512_cmpeq_epi32_mask(a, look_up_512(b, slots_b));
                }
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
            // Rows past this chunk have no higher lanes in it.
            let rows = among & up_to(16 * chunk + 15);
            // SAFETY: `Avx512` exists only where the processor has it.
            unsafe { chunk_overlaps(boxes, chunk, among, boxes, rows, masks) };
        }
        for (row, mask) in masks.0.iter_mut().enumerate() {
            *mask &= !up_to(row);
        }
    }

    #[inline(always)]
    fn meets_rows(
        self,
        boxes: [&LaneBounds; 2],
        among: u64,
        queries: [&LaneBounds; 2],
        rows: u64,
        masks: &mut Masks,
    ) {
        masks.0 = [0; GROUP];
        for chunk in 0..4 {
            // SAFETY: `Avx512` exists only where the processor has it.
            unsafe { chunk_meets(boxes, chunk, among, queries, rows, masks) };
        }
    }

    #[inline(always)]
    fn meets_within(self, boxes: [&LaneBounds; 2], among: u64, masks: &mut Masks) {
        masks.0 = [0; GROUP];
        for chunk in 0..4 {
            // Rows past this chunk have no higher lanes in it.
            let rows = among & up_to(16 * chunk + 15);
            // SAFETY: `Avx512` exists only where the processor has it.
            unsafe { chunk_meets(boxes, chunk, among, boxes, rows, masks) };
        }
        for (row, mask) in masks.0.iter_mut().enumerate() {
            *mask &= !up_to(row);
        }
    }

    #[inline(always)]
    fn rows_with_lanes(self, masks: &Masks) -> u64 {
        let (eights, _) = masks.0.as_chunks::<8>();
        let mut rows = 0;
        for (eight_ix, eight) in eights.iter().enumerate() {
            // SAFETY: `Avx512` exists only where the processor has it; eight masks are 64 bytes.
            let is = unsafe {
                let masks = _mm512_loadu_si512(eight.as_ptr().cast());
                _mm512_test_epi64_mask(masks, masks)
            };
            rows |= u64::from(is) << (8 * eight_ix);
        }
        rows
    }

    #[inline(always)]
    fn list_lanes(self, mask: u64, list: &mut [u8; GROUP]) -> usize {
        // SAFETY: `Avx512` exists only where the processor has it; one store of 64 bytes.
        unsafe {
            let lanes = _mm512_maskz_compress_epi8(mask, _mm512_load_si512(LANE.0.as_ptr().cast()));
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
    fn add_runs(self, runs: &[[[f32; 3]; RUN]], members: &[Members], into: &mut RunExtents) {
        // SAFETY: `Avx512` exists only where the processor has it; a run is three registers of
        // coordinates, as is each row of `into`. A prefetch may go past the end: it is a hint and
        // never faults.
        unsafe {
            let load = |row: &[f32; 3 * RUN]| {
                let first = row.as_ptr();
                [
                    _mm512_loadu_ps(first),
                    _mm512_loadu_ps(first.add(16)),
                    _mm512_loadu_ps(first.add(32)),
                ]
            };
            let mut min = load(&into.min);
            let mut max = load(&into.max);
            let mut sum = load(&into.sum);
            let mut group_min = [load(&into.group_min[0]), load(&into.group_min[1])];
            let mut group_max = [load(&into.group_max[0]), load(&into.group_max[1])];
            for (run, members) in runs.iter().zip(members) {
                let first = run.as_ptr().cast::<f32>();
                for k in 0..3 {
                    let x = _mm512_loadu_ps(first.add(16 * k));
                    _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(16 * k + PAGE).cast());
                    min[k] = _mm512_min_ps(min[k], x);
                    max[k] = _mm512_max_ps(max[k], x);
                    sum[k] = _mm512_add_ps(sum[k], x);
                    for end in 0..2 {
                        let (low, high) = (&mut group_min[end][k], &mut group_max[end][k]);
                        *low = _mm512_mask_min_ps(*low, members[end][k], *low, x);
                        *high = _mm512_mask_max_ps(*high, members[end][k], *high, x);
                    }
                }
            }
            let store = |row: &mut [f32; 3 * RUN], registers: [__m512; 3]| {
                for (k, register) in registers.into_iter().enumerate() {
                    _mm512_storeu_ps(row.as_mut_ptr().add(16 * k), register);
                }
            };
            store(&mut into.min, min);
            store(&mut into.max, max);
            store(&mut into.sum, sum);
            for end in 0..2 {
                store(&mut into.group_min[end], group_min[end]);
                store(&mut into.group_max[end], group_max[end]);
            }
        }
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
            match cluster.local {
                Some(local) if cluster.vertices.len() <= TABLE => {
                    put_corners_by_vertices(positions, cluster.vertices, local, into);
                }
                _ => put_corners_by_eights(positions, cluster.faces, into),
            }
        }
    }

    #[inline(always)]
    fn put_points<R: Load4>(
        self,
        positions: &[[R; 3]],
        vertices: &[u32; GROUP],
        n: usize,
        into: &mut [[f32; GROUP]; 3],
    ) {
        // SAFETY: this set exists only where the processor has AVX2.
        unsafe { put_points(positions, vertices, n, into) }
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
