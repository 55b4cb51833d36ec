//! A vertex in double precision, on every processor, whatever instruction set is chosen.

/// x, y and z.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(super) struct Vec64 {
    xy: std::arch::x86_64::__m128d,
    z: std::arch::x86_64::__m128d,
}

// Minima and maxima are written out, because the compiler makes several instructions of a
// comparison of each coordinate.
#[cfg(target_arch = "x86_64")]
impl Vec64 {
    #[inline(always)]
    pub fn load(positions: &[[f64; 3]], vertex: u32) -> Self {
        use std::arch::x86_64::*;
        let point = &positions[vertex as usize];
        // SAFETY: every x86-64 processor has SSE2 (here and below); a point holds two numbers, and
        // a third.
        unsafe {
            Vec64 {
                xy: _mm_loadu_pd(point.as_ptr()),
                z: _mm_load_sd(&raw const point[2]),
            }
        }
    }

    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        use std::arch::x86_64::*;
        // SAFETY: SSE2.
        unsafe {
            Vec64 {
                xy: _mm_min_pd(self.xy, other.xy),
                z: _mm_min_sd(self.z, other.z),
            }
        }
    }

    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        use std::arch::x86_64::*;
        // SAFETY: SSE2.
        unsafe {
            Vec64 {
                xy: _mm_max_pd(self.xy, other.xy),
                z: _mm_max_sd(self.z, other.z),
            }
        }
    }

    #[inline(always)]
    pub fn xyz(self) -> [f64; 3] {
        use std::arch::x86_64::*;
        let mut point = [0.0; 3];
        // SAFETY: SSE2; `point` holds two numbers, and a third.
        unsafe {
            _mm_storeu_pd(point.as_mut_ptr(), self.xy);
            _mm_store_sd(&raw mut point[2], self.z);
        }
        point
    }
}

#[cfg(not(target_arch = "x86_64"))]
#[derive(Clone, Copy)]
pub(super) struct Vec64([f64; 3]);

#[cfg(not(target_arch = "x86_64"))]
impl Vec64 {
    #[inline(always)]
    pub fn load(positions: &[[f64; 3]], vertex: u32) -> Self {
        Vec64(positions[vertex as usize])
    }

    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        let lesser = |a, b| if a < b { a } else { b };
        Vec64(std::array::from_fn(|k| lesser(self.0[k], other.0[k])))
    }

    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let greater = |a, b| if a > b { a } else { b };
        Vec64(std::array::from_fn(|k| greater(self.0[k], other.0[k])))
    }

    #[inline(always)]
    pub fn xyz(self) -> [f64; 3] {
        self.0
    }
}

/// The ends of the box of some vertices.
#[inline(always)]
pub(super) fn ends(positions: &[[f64; 3]], vertices: &[u32]) -> [[f64; 3]; 2] {
    let Some((&first, rest)) = vertices.split_first() else {
        return [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    };
    let first = Vec64::load(positions, first);
    let (mut min, mut max) = (first, first);
    for &vertex in rest {
        let point = Vec64::load(positions, vertex);
        min = min.min(point);
        max = max.max(point);
    }
    [min.xyz(), max.xyz()]
}
