//! Vertices as four lanes: the box of some vertices on every processor, whatever instruction set is
//! chosen.

use crate::bvh::bounds::Bounds;
#[cfg(not(target_arch = "x86_64"))]
use crate::bvh::bounds::{greater, lesser};

/// x, y, z and a fourth number that is ignored.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Vec4(pub(crate) std::arch::x86_64::__m128);

#[cfg(target_arch = "x86_64")]
impl Vec4 {
    #[inline(always)]
    pub(crate) fn splat(x: f32) -> Self {
        // SAFETY: every x86-64 processor has SSE2 (here and below).
        Vec4(unsafe { std::arch::x86_64::_mm_set1_ps(x) })
    }

    /// Loads one vertex. All but the last are read as 16 bytes: the fourth number is the next
    /// vertex's x.
    #[inline(always)]
    pub(crate) fn load(positions: &[[f32; 3]], vertex: usize) -> Self {
        use std::arch::x86_64::*;
        if vertex + 1 < positions.len() {
            // SAFETY: 16 bytes from a vertex that has a successor lie within the slice.
            Vec4(unsafe { _mm_loadu_ps(positions.as_ptr().add(vertex).cast()) })
        } else {
            let [x, y, z] = positions[vertex];
            // SAFETY: SSE2.
            Vec4(unsafe { _mm_set_ps(z, z, y, x) })
        }
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        // SAFETY: SSE2.
        Vec4(unsafe { std::arch::x86_64::_mm_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        // SAFETY: SSE2.
        Vec4(unsafe { std::arch::x86_64::_mm_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    pub(crate) fn add(self, other: Self) -> Self {
        // SAFETY: SSE2.
        Vec4(unsafe { std::arch::x86_64::_mm_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn half(self) -> Self {
        // SAFETY: SSE2.
        Vec4(unsafe { std::arch::x86_64::_mm_mul_ps(self.0, Self::splat(0.5).0) })
    }

    #[inline(always)]
    pub(crate) fn xyz(self) -> [f32; 3] {
        let mut out = [0.0f32; 4];
        // SAFETY: `out` holds 16 bytes.
        unsafe { std::arch::x86_64::_mm_storeu_ps(out.as_mut_ptr(), self.0) };
        [out[0], out[1], out[2]]
    }

    /// Four vertices as the rows of x, of y and of z.
    #[inline(always)]
    pub(crate) fn transpose([a, b, c, d]: [Self; 4]) -> [[f32; 4]; 3] {
        use std::arch::x86_64::*;
        let mut rows = [[0.0f32; 4]; 3];
        // SAFETY: SSE2; each row holds 16 bytes.
        unsafe {
            let xy_ab = _mm_unpacklo_ps(a.0, b.0);
            let xy_cd = _mm_unpacklo_ps(c.0, d.0);
            let zw_ab = _mm_unpackhi_ps(a.0, b.0);
            let zw_cd = _mm_unpackhi_ps(c.0, d.0);
            _mm_storeu_ps(rows[0].as_mut_ptr(), _mm_movelh_ps(xy_ab, xy_cd));
            _mm_storeu_ps(rows[1].as_mut_ptr(), _mm_movehl_ps(xy_cd, xy_ab));
            _mm_storeu_ps(rows[2].as_mut_ptr(), _mm_movelh_ps(zw_ab, zw_cd));
        }
        rows
    }
}

#[cfg(not(target_arch = "x86_64"))]
#[derive(Clone, Copy)]
pub(crate) struct Vec4([f32; 4]);

#[cfg(not(target_arch = "x86_64"))]
impl Vec4 {
    #[inline(always)]
    pub(crate) fn splat(x: f32) -> Self {
        Vec4([x; 4])
    }

    #[inline(always)]
    pub(crate) fn load(positions: &[[f32; 3]], vertex: usize) -> Self {
        let [x, y, z] = positions[vertex];
        Vec4([x, y, z, z])
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Vec4(std::array::from_fn(|k| lesser(self.0[k], other.0[k])))
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Vec4(std::array::from_fn(|k| greater(self.0[k], other.0[k])))
    }

    #[inline(always)]
    pub(crate) fn add(self, other: Self) -> Self {
        Vec4(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }

    #[inline(always)]
    fn half(self) -> Self {
        Vec4(self.0.map(|x| 0.5 * x))
    }

    #[inline(always)]
    pub(crate) fn xyz(self) -> [f32; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }

    #[inline(always)]
    pub(crate) fn transpose(vertices: [Self; 4]) -> [[f32; 4]; 3] {
        std::array::from_fn(|axis| std::array::from_fn(|k| vertices[k].0[axis]))
    }
}

/// The box of some vertices, and whether all are certainly finite. The latter costs one addition
/// per vertex: a sum is finite only if all its terms are. (If a sum of finite terms overflows, they
/// are checked one by one.)
#[inline]
pub(crate) fn of_vertices_f32(positions: &[[f32; 3]], vertices: &[u32]) -> (Bounds, bool) {
    const CHAINS: usize = 4;
    let mut min = [Vec4::splat(f32::INFINITY); CHAINS];
    let mut max = [Vec4::splat(f32::NEG_INFINITY); CHAINS];
    let mut sum = [Vec4::splat(0.0); CHAINS];
    let (chunks, rest) = vertices.as_chunks::<CHAINS>();
    // Several chains hide the latency of the instructions.
    for chunk in chunks {
        for k in 0..CHAINS {
            let vertex = Vec4::load(positions, chunk[k] as usize);
            min[k] = min[k].min(vertex);
            max[k] = max[k].max(vertex);
            sum[k] = sum[k].add(vertex);
        }
    }
    for &vertex in rest {
        let vertex = Vec4::load(positions, vertex as usize);
        min[0] = min[0].min(vertex);
        max[0] = max[0].max(vertex);
        sum[0] = sum[0].add(vertex);
    }
    let bounds = Bounds {
        min: min[0].min(min[1]).min(min[2].min(min[3])).xyz(),
        max: max[0].max(max[1]).max(max[2].max(max[3])).xyz(),
    };
    let [x, y, z] = sum[0].add(sum[1]).add(sum[2].add(sum[3])).xyz();
    (bounds, (x + y + z).is_finite())
}

/// The ends of an element's box.
#[inline(always)]
pub(super) fn extent<const N: usize>(positions: &[[f32; 3]], corners: &[u32; N]) -> (Vec4, Vec4) {
    let first = Vec4::load(positions, corners[0] as usize);
    let (mut min, mut max) = (first, first);
    for &corner in &corners[1..] {
        let vertex = Vec4::load(positions, corner as usize);
        min = min.min(vertex);
        max = max.max(vertex);
    }
    (min, max)
}

/// The middle of an element's box: the result of [`Bounds::center`].
#[inline(always)]
pub(crate) fn center_f32<const N: usize>(positions: &[[f32; 3]], corners: &[u32; N]) -> [f32; 3] {
    let (min, max) = extent(positions, corners);
    min.half().add(max.half()).xyz()
}
