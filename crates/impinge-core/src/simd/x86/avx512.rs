//! Registers of 512 bits.

use std::arch::x86_64::*;

use impinge_exact::internal::filter::{BATCH, TABLE};

use super::{
    Avx512, Load4, PAGE, of_ascending, put_corners_by_eights, put_corners_by_vertices, put_points,
    rows,
};
use crate::simd::{
    Aabb, BoundsArray, ClusterFaces, GROUP, LANES, LaneBounds, Lanes, Lanes32, Masks, Members, RUN,
    ReadVertices, RunExtents, Simd, Triangles64, number, put_vertices, up_to,
};

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
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Aabb, bool) {
        // SAFETY: `Avx512` exists only where the processor has AVX2 too; the caller guarantees the
        // order.
        unsafe { of_ascending(positions, vertices) }
    }
}

impl Simd for Avx512 {
    type F64 = number::Avx512;
    type F32 = number::Avx512F32;

    #[inline(always)]
    fn overlaps_8(self, boxes: &BoundsArray, first: usize, query: &Aabb) -> u32 {
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
    fn overlaps_64(self, boxes: &LaneBounds, query: &Aabb, among: u64) -> u64 {
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
        [query_start, query_end]: &[Aabb; 2],
        among: u64,
    ) -> u64 {
        // SAFETY: `Avx512` exists only where the processor has it; sixteen lanes of 64 are read
        // from rows that are aligned to 64 bytes.
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
        // SAFETY: `Avx512` exists only where the processor has it; sixteen lanes of 64 are read
        // from an array that is aligned to 64 bytes.
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
