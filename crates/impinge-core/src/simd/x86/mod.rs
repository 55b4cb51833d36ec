//! The registers of x86-64: 256 bits here, 512 in [`avx512`].

mod avx512;

use std::arch::x86_64::*;

use impinge_exact::internal::filter::number::Lookup;
use impinge_exact::internal::filter::number::memory::write;
use impinge_exact::internal::filter::{BATCH, TABLE};

use super::{
    Aabb, BoundsArray, CHUNK, ClusterFaces, GROUP, LANES, LaneBounds, Lanes32, LocalFaces, Members,
    RUN, ReadVertices, RunExtents, Simd, Triangles64, number, of_vertices_f32, put_corners,
    put_vertices,
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
unsafe fn of_ascending(positions: &[[f32; 3]], vertices: &[u32]) -> (Aabb, bool) {
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
        (Aabb { min, max }, (x + y + z).is_finite())
    }
}

impl ReadVertices for Avx2 {
    #[inline(always)]
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Aabb, bool) {
        // SAFETY: `Avx2` exists only where the processor has AVX2; the caller guarantees the order.
        unsafe { of_ascending(positions, vertices) }
    }
}

impl Simd for Avx2 {
    type F64 = number::Avx2;
    type F32 = number::Avx2F32;

    #[inline(always)]
    fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Aabb) -> u32 {
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
    fn overlaps_64(self, boxes: &LaneBounds, query: &Aabb, among: u64) -> u64 {
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
        [query_start, query_end]: &[Aabb; 2],
        among: u64,
    ) -> u64 {
        let mut mask = 0u64;
        for chunk in 0..8 {
            if (among >> (8 * chunk)) & 0xff == 0 {
                continue;
            }
            // SAFETY: `Avx2` exists only where the processor has it; eight lanes of 64 are read
            // from rows that are aligned to 64 bytes.
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
        // SAFETY: `Avx2` exists only where the processor has it; eight lanes of 64 are read from an
        // array that is aligned to 64 bytes.
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
