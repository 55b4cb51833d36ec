//! A vertex in double precision, on every processor, whatever instruction set is chosen.

use impinge_exact::internal::filter::number::memory::{read, write};

use two::Two;

/// x and y, and z.
#[derive(Clone, Copy)]
pub(super) struct Vec64 {
    xy: Two,
    z: f64,
}

impl Vec64 {
    #[inline(always)]
    pub fn load(positions: &[[f64; 3]], vertex: u32) -> Self {
        let [x, y, z] = positions[vertex as usize];
        Vec64 {
            xy: read(&[x, y]),
            z,
        }
    }

    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Vec64 {
            xy: two::min(self.xy, other.xy),
            z: if self.z < other.z { self.z } else { other.z },
        }
    }

    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Vec64 {
            xy: two::max(self.xy, other.xy),
            z: if self.z > other.z { self.z } else { other.z },
        }
    }

    #[inline(always)]
    pub fn xyz(self) -> [f64; 3] {
        let mut xy = [0.0; 2];
        write(self.xy, &mut xy);
        [xy[0], xy[1], self.z]
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

/// Two numbers in a register. Minima and maxima are written out, because the compiler makes several
/// instructions of a comparison of each number.
#[cfg(target_arch = "x86_64")]
mod two {
    use std::arch::x86_64::*;

    pub type Two = __m128d;

    sse2! {
        fn min(a: Two, b: Two) -> Two { _mm_min_pd(a, b) }
        fn max(a: Two, b: Two) -> Two { _mm_max_pd(a, b) }
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod two {
    use std::array::from_fn;

    pub type Two = [f64; 2];

    #[inline(always)]
    pub fn min(a: Two, b: Two) -> Two {
        from_fn(|k| if a[k] < b[k] { a[k] } else { b[k] })
    }

    #[inline(always)]
    pub fn max(a: Two, b: Two) -> Two {
        from_fn(|k| if a[k] > b[k] { a[k] } else { b[k] })
    }
}
