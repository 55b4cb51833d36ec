//! Vertices as four lanes: the box of some vertices on every processor, whatever instruction set is
//! chosen.

use crate::bvh::bounds::Aabb;
use impinge_exact::internal::filter::number::memory::{read, write};

use four::Four;

/// x, y, z and a fourth number that is ignored.
#[derive(Clone, Copy)]
pub(crate) struct Vec4(pub(crate) Four);

impl Vec4 {
    #[inline(always)]
    pub(crate) fn splat(x: f32) -> Self {
        Vec4(read(&[x; 4]))
    }

    /// Loads one vertex. All but the last are read as four numbers: the fourth is the next vertex's
    /// x.
    #[inline(always)]
    pub(crate) fn load(positions: &[[f32; 3]], vertex: usize) -> Self {
        let vertex = &positions[vertex..];
        Vec4(match vertex.first_chunk::<2>() {
            Some(&[[x, y, z], [next, ..]]) => read(&[x, y, z, next]),
            None => {
                let [x, y, z] = vertex[0];
                read(&[x, y, z, z])
            }
        })
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Vec4(four::min(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Vec4(four::max(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn add(self, other: Self) -> Self {
        Vec4(four::add(self.0, other.0))
    }

    #[inline(always)]
    fn half(self) -> Self {
        Vec4(four::mul(self.0, Self::splat(0.5).0))
    }

    #[inline(always)]
    pub(crate) fn xyz(self) -> [f32; 3] {
        let [x, y, z, _] = numbers(self.0);
        [x, y, z]
    }

    /// Four vertices as the rows of x, of y and of z.
    #[inline(always)]
    pub(crate) fn transpose(vertices: [Self; 4]) -> [[f32; 4]; 3] {
        four::transpose(vertices.map(|vertex| vertex.0)).map(numbers)
    }
}

#[inline(always)]
fn numbers(four: Four) -> [f32; 4] {
    let mut numbers = [0.0; 4];
    write(four, &mut numbers);
    numbers
}

/// Four numbers in a register. A minimum or maximum with what is no number is the second number.
#[cfg(target_arch = "x86_64")]
mod four {
    use std::arch::x86_64::*;

    pub type Four = __m128;

    sse2! {
        fn min(a: Four, b: Four) -> Four { _mm_min_ps(a, b) }
        fn max(a: Four, b: Four) -> Four { _mm_max_ps(a, b) }
        fn add(a: Four, b: Four) -> Four { _mm_add_ps(a, b) }
        fn mul(a: Four, b: Four) -> Four { _mm_mul_ps(a, b) }

        fn transpose(rows: [Four; 4]) -> [Four; 3] {
            let [a, b, c, d] = rows;
            let (xy_ab, xy_cd) = (_mm_unpacklo_ps(a, b), _mm_unpacklo_ps(c, d));
            let (zw_ab, zw_cd) = (_mm_unpackhi_ps(a, b), _mm_unpackhi_ps(c, d));
            [
                _mm_movelh_ps(xy_ab, xy_cd),
                _mm_movehl_ps(xy_cd, xy_ab),
                _mm_movelh_ps(zw_ab, zw_cd),
            ]
        }
    }
}

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod four {
    use std::arch::wasm32::*;

    pub type Four = v128;
    pub use std::arch::wasm32::{f32x4_add as add, f32x4_mul as mul};

    #[inline(always)]
    pub fn min(a: Four, b: Four) -> Four {
        // `pmin(b, a)` is a where a < b, else b.
        f32x4_pmin(b, a)
    }

    #[inline(always)]
    pub fn max(a: Four, b: Four) -> Four {
        f32x4_pmax(b, a)
    }

    #[inline(always)]
    pub fn transpose([a, b, c, d]: [Four; 4]) -> [Four; 3] {
        let [xy_ab, xy_cd] = [[a, b], [c, d]].map(|[a, b]| i32x4_shuffle::<0, 4, 1, 5>(a, b));
        let [zw_ab, zw_cd] = [[a, b], [c, d]].map(|[a, b]| i32x4_shuffle::<2, 6, 3, 7>(a, b));
        [
            i64x2_shuffle::<0, 2>(xy_ab, xy_cd),
            i64x2_shuffle::<1, 3>(xy_ab, xy_cd),
            i64x2_shuffle::<0, 2>(zw_ab, zw_cd),
        ]
    }
}

#[cfg(not(any(
    target_arch = "x86_64",
    all(target_arch = "wasm32", target_feature = "simd128")
)))]
mod four {
    use crate::bvh::bounds::{greater, lesser};
    use std::array::from_fn;

    pub type Four = [f32; 4];

    #[inline(always)]
    pub fn min(a: Four, b: Four) -> Four {
        from_fn(|k| lesser(a[k], b[k]))
    }

    #[inline(always)]
    pub fn max(a: Four, b: Four) -> Four {
        from_fn(|k| greater(a[k], b[k]))
    }

    #[inline(always)]
    pub fn add(a: Four, b: Four) -> Four {
        from_fn(|k| a[k] + b[k])
    }

    #[inline(always)]
    pub fn mul(a: Four, b: Four) -> Four {
        from_fn(|k| a[k] * b[k])
    }

    #[inline(always)]
    pub fn transpose(rows: [Four; 4]) -> [Four; 3] {
        from_fn(|axis| rows.map(|row| row[axis]))
    }
}

/// The box of some vertices, and whether all are certainly finite. The latter costs one addition
/// per vertex: a sum is finite only if all its terms are. (If a sum of finite terms overflows, they
/// are checked one by one.)
#[inline]
pub(crate) fn of_vertices_f32(positions: &[[f32; 3]], vertices: &[u32]) -> (Aabb, bool) {
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
    let bounds = Aabb {
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

/// The middle of an element's box: the result of [`Aabb::center`].
#[inline(always)]
pub(crate) fn center_f32<const N: usize>(positions: &[[f32; 3]], corners: &[u32; N]) -> [f32; 3] {
    let (min, max) = extent(positions, corners);
    min.half().add(max.half()).xyz()
}
