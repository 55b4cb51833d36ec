//! What the filter computes with: one `f64`, or a vector register of them, or of `f32`.
//!
//! The filter is written once, generic over [`Number`]; comparisons give a mask and branches are
//! selects. Additions, subtractions and multiplications are those of IEEE 754 in every
//! implementation, one rounding each, so every instruction set gives the same masks.

use std::ops::{Add, BitAnd, BitOr, BitXor, Mul, Not, Sub};

use super::{BATCH, LANES, TABLE};

/// One number or several, side by side.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + sealed::Sealed
{
    /// A condition for each.
    type Mask: Copy
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + BitXor<Output = Self::Mask>
        + Not<Output = Self::Mask>;

    /// 64 unit roundoffs: what a determinant may be wrong by, in parts of the product of its vectors' sizes. The
    /// derivation needs a little more than 60.
    const BOUND: f64;

    /// A bound with what underflow may add: nothing for `f64` within the range that a scene admits, 2^-69 for
    /// `f32` with coordinates up to 2^24.
    fn with_underflow(self) -> Self;
    /// The same number everywhere; rounded to `f32` where the numbers are.
    fn splat(x: f64) -> Self;
    /// The magnitude.
    fn abs(self) -> Self;
    /// The larger one; either where one is NaN.
    fn larger(self, other: Self) -> Self;
    /// Whether `self > other`; false for NaN.
    fn gt(self, other: Self) -> Self::Mask;
    /// `yes` where the mask is set, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
}

/// A register of `f64`, and masks as bits.
pub trait Vector: Number {
    /// Numbers in a register: a divisor of [`LANES`].
    const N: usize;
    /// `N` numbers from memory, from lane `first` on.
    fn load(lanes: &[f64; LANES], first: usize) -> Self;
    /// Bit k for number k.
    fn bits(mask: Self::Mask) -> u8;
}

/// A register of `f32` that are looked up in tables.
pub trait Lookup: Number {
    /// Numbers in a register: a divisor of [`BATCH`].
    const N: usize;
    /// Which numbers of a table to take.
    type Places: Copy;

    /// Places from memory, from lane `first` on; those past the table's end start again from its front.
    fn places(places: &[u8; BATCH], first: usize) -> Self::Places;
    /// The numbers at some places.
    fn look_up(table: &[f32; TABLE], places: Self::Places) -> Self;
    /// Bit k for number k.
    fn bits(mask: Self::Mask) -> u16;
}

/// Points from memory, from lane `first` on.
#[inline(always)]
pub(super) fn load_vertex<V: Vector>([x, y, z]: &[[f64; LANES]; 3], first: usize) -> [V; 3] {
    [V::load(x, first), V::load(y, first), V::load(z, first)]
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f64 {}
    impl Sealed for super::Portable {}
    impl Sealed for super::Portable32 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx2 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx512 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx2F32 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx512F32 {}
}

/// 2^-47.
const BOUND_F64: f64 = f64::from_bits((1023 - 47) << 52);
/// 2^-18.
const BOUND_F32: f64 = f64::from_bits((1023 - 18) << 52);
/// 2^-69: with coordinates up to 2^24, a determinant and its bound lose less than 2^-70 to underflow, even where the
/// processor flushes subnormal numbers to zero.
const UNDERFLOW_F32: f64 = f64::from_bits((1023 - 69) << 52);

impl Number for f64 {
    type Mask = bool;

    const BOUND: f64 = BOUND_F64;

    #[inline(always)]
    fn with_underflow(self) -> Self {
        self
    }

    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    /// A comparison: `f64::max` costs three instructions to keep NaN out, and NaN is harmless here.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn gt(self, other: Self) -> bool {
        self > other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

/// Numbers side by side where no wider set is known: 128 bits, which SSE2 and NEON have.
const PORTABLE: usize = 2;

/// Two numbers as an array: whatever the compiler makes of it.
#[derive(Debug, Clone, Copy)]
pub struct Portable([f64; PORTABLE]);

/// Two conditions, all bits set or none.
#[derive(Debug, Clone, Copy)]
pub struct PortableMask([u64; PORTABLE]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, op: impl Fn(f64, f64) -> f64) -> Self {
        Portable(std::array::from_fn(|k| op(self.0[k], other.0[k])))
    }
}

impl PortableMask {
    #[inline(always)]
    fn zip(self, other: Self, op: impl Fn(u64, u64) -> u64) -> Self {
        PortableMask(std::array::from_fn(|k| op(self.0[k], other.0[k])))
    }
}

macro_rules! operator {
    ($type:ty, $trait:ident, $method:ident, |$a:ident, $b:ident| $body:expr) => {
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                $body
            }
        }
    };
}

operator!(Portable, Add, add, |a, b| a.zip(b, |x, y| x + y));
operator!(Portable, Sub, sub, |a, b| a.zip(b, |x, y| x - y));
operator!(Portable, Mul, mul, |a, b| a.zip(b, |x, y| x * y));
operator!(PortableMask, BitAnd, bitand, |a, b| a.zip(b, |x, y| x & y));
operator!(PortableMask, BitOr, bitor, |a, b| a.zip(b, |x, y| x | y));
operator!(PortableMask, BitXor, bitxor, |a, b| a.zip(b, |x, y| x ^ y));

impl Not for PortableMask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        PortableMask(self.0.map(|x| !x))
    }
}

impl Number for Portable {
    type Mask = PortableMask;

    const BOUND: f64 = BOUND_F64;

    #[inline(always)]
    fn with_underflow(self) -> Self {
        self
    }

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Portable([x; PORTABLE])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Portable(self.0.map(f64::abs))
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.zip(other, Number::larger)
    }
    #[inline(always)]
    fn gt(self, other: Self) -> PortableMask {
        PortableMask(std::array::from_fn(|k| {
            if self.0[k] > other.0[k] { u64::MAX } else { 0 }
        }))
    }
    #[inline(always)]
    fn select(mask: PortableMask, yes: Self, no: Self) -> Self {
        Portable(std::array::from_fn(|k| {
            f64::from_bits((yes.0[k].to_bits() & mask.0[k]) | (no.0[k].to_bits() & !mask.0[k]))
        }))
    }
}

impl Vector for Portable {
    const N: usize = PORTABLE;

    #[inline(always)]
    fn load(lanes: &[f64; LANES], first: usize) -> Self {
        Portable([lanes[first], lanes[first + 1]])
    }
    #[inline(always)]
    fn bits(mask: PortableMask) -> u8 {
        (mask.0[0] & 1) as u8 | ((mask.0[1] & 1) as u8) << 1
    }
}

/// `f32` side by side where no wider set is known.
const PORTABLE_F32: usize = 4;

/// Four `f32` as an array.
#[derive(Debug, Clone, Copy)]
pub struct Portable32([f32; PORTABLE_F32]);

/// Four conditions, all bits set or none.
#[derive(Debug, Clone, Copy)]
pub struct Portable32Mask([u32; PORTABLE_F32]);

impl Portable32 {
    #[inline(always)]
    fn zip(self, other: Self, op: impl Fn(f32, f32) -> f32) -> Self {
        Portable32(std::array::from_fn(|k| op(self.0[k], other.0[k])))
    }
}

impl Portable32Mask {
    #[inline(always)]
    fn zip(self, other: Self, op: impl Fn(u32, u32) -> u32) -> Self {
        Portable32Mask(std::array::from_fn(|k| op(self.0[k], other.0[k])))
    }
}

operator!(Portable32, Add, add, |a, b| a.zip(b, |x, y| x + y));
operator!(Portable32, Sub, sub, |a, b| a.zip(b, |x, y| x - y));
operator!(Portable32, Mul, mul, |a, b| a.zip(b, |x, y| x * y));
operator!(Portable32Mask, BitAnd, bitand, |a, b| a
    .zip(b, |x, y| x & y));
operator!(Portable32Mask, BitOr, bitor, |a, b| a.zip(b, |x, y| x | y));
operator!(Portable32Mask, BitXor, bitxor, |a, b| a
    .zip(b, |x, y| x ^ y));

impl Not for Portable32Mask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Portable32Mask(self.0.map(|x| !x))
    }
}

impl Number for Portable32 {
    type Mask = Portable32Mask;

    const BOUND: f64 = BOUND_F32;

    #[inline(always)]
    fn with_underflow(self) -> Self {
        self + Self::splat(UNDERFLOW_F32)
    }

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Portable32([x as f32; PORTABLE_F32])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Portable32(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.zip(other, |x, y| if x > y { x } else { y })
    }
    #[inline(always)]
    fn gt(self, other: Self) -> Portable32Mask {
        Portable32Mask(std::array::from_fn(|k| {
            if self.0[k] > other.0[k] { u32::MAX } else { 0 }
        }))
    }
    #[inline(always)]
    fn select(mask: Portable32Mask, yes: Self, no: Self) -> Self {
        Portable32(std::array::from_fn(|k| {
            f32::from_bits((yes.0[k].to_bits() & mask.0[k]) | (no.0[k].to_bits() & !mask.0[k]))
        }))
    }
}

impl Lookup for Portable32 {
    const N: usize = PORTABLE_F32;
    type Places = [u8; PORTABLE_F32];

    #[inline(always)]
    fn places(places: &[u8; BATCH], first: usize) -> Self::Places {
        std::array::from_fn(|k| places[first + k])
    }
    #[inline(always)]
    fn look_up(table: &[f32; TABLE], places: Self::Places) -> Self {
        Portable32(places.map(|place| table[place as usize % TABLE]))
    }
    #[inline(always)]
    fn bits(mask: Portable32Mask) -> u16 {
        (0..PORTABLE_F32).fold(0, |bits, k| bits | ((mask.0[k] & 1) as u16) << k)
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx2F32, Avx512, Avx512F32};

/// Every method is sound only inside a function that enables the instruction set, which is why the
/// types can be had by `load` and `splat` alone and those are called by such functions.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use std::arch::x86_64::*;

    /// Four numbers in a 256-bit register. To be used where `avx2` was detected.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx2(__m256d);

    /// Four conditions in a register.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx2Mask(__m256d);

    /// Eight numbers in a 512-bit register. To be used where `avx512f` and `avx512dq` were detected.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx512(__m512d);

    /// Eight conditions in a mask register.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx512Mask(__mmask8);

    // SAFETY (all below): these types are used inside functions compiled for, and called on
    // processors with, their instruction set; the intrinsics touch no memory but that of `load`,
    // whose array has eight numbers, and of `places` and `look_up`.
    macro_rules! on_256 {
        ($type:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
            operator!($type, $trait, $method, |a, b| {
                // SAFETY: see above.
                unsafe { $type($intrinsic(a.0, b.0)) }
            });
        };
    }
    macro_rules! on_512 {
        ($type:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
            operator!($type, $trait, $method, |a, b| {
                // SAFETY: see above.
                unsafe { $type($intrinsic(a.0, b.0)) }
            });
        };
    }

    on_256!(Avx2, Add, add, _mm256_add_pd);
    on_256!(Avx2, Sub, sub, _mm256_sub_pd);
    on_256!(Avx2, Mul, mul, _mm256_mul_pd);
    on_256!(Avx2Mask, BitAnd, bitand, _mm256_and_pd);
    on_256!(Avx2Mask, BitOr, bitor, _mm256_or_pd);
    on_256!(Avx2Mask, BitXor, bitxor, _mm256_xor_pd);
    on_512!(Avx512, Add, add, _mm512_add_pd);
    on_512!(Avx512, Sub, sub, _mm512_sub_pd);
    on_512!(Avx512, Mul, mul, _mm512_mul_pd);
    operator!(Avx512Mask, BitAnd, bitand, |a, b| Avx512Mask(a.0 & b.0));
    operator!(Avx512Mask, BitOr, bitor, |a, b| Avx512Mask(a.0 | b.0));
    operator!(Avx512Mask, BitXor, bitxor, |a, b| Avx512Mask(a.0 ^ b.0));

    impl Not for Avx2Mask {
        type Output = Self;
        #[inline(always)]
        fn not(self) -> Self {
            // SAFETY: see above.
            let all = unsafe { _mm256_castsi256_pd(_mm256_set1_epi32(-1)) };
            self ^ Avx2Mask(all)
        }
    }

    impl Not for Avx512Mask {
        type Output = Self;
        #[inline(always)]
        fn not(self) -> Self {
            Avx512Mask(!self.0)
        }
    }

    impl Number for Avx2 {
        type Mask = Avx2Mask;

        const BOUND: f64 = BOUND_F64;

        #[inline(always)]
        fn with_underflow(self) -> Self {
            self
        }

        #[inline(always)]
        fn splat(x: f64) -> Self {
            // SAFETY: see above.
            Avx2(unsafe { _mm256_set1_pd(x) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see above.
            Avx2(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
        }
        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            // SAFETY: see above.
            Avx2(unsafe { _mm256_max_pd(self.0, other.0) })
        }
        #[inline(always)]
        fn gt(self, other: Self) -> Avx2Mask {
            // SAFETY: see above.
            Avx2Mask(unsafe { _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn select(mask: Avx2Mask, yes: Self, no: Self) -> Self {
            // SAFETY: see above.
            Avx2(unsafe { _mm256_blendv_pd(no.0, yes.0, mask.0) })
        }
    }

    impl Vector for Avx2 {
        const N: usize = 4;

        #[inline(always)]
        fn load(lanes: &[f64; LANES], first: usize) -> Self {
            let four: &[f64; 4] = lanes[first..].first_chunk().expect("four lanes");
            // SAFETY: see above; one load of four.
            Avx2(unsafe { _mm256_loadu_pd(four.as_ptr()) })
        }
        #[inline(always)]
        fn bits(mask: Avx2Mask) -> u8 {
            // SAFETY: see above.
            unsafe { _mm256_movemask_pd(mask.0) as u8 }
        }
    }

    impl Number for Avx512 {
        type Mask = Avx512Mask;

        const BOUND: f64 = BOUND_F64;

        #[inline(always)]
        fn with_underflow(self) -> Self {
            self
        }

        #[inline(always)]
        fn splat(x: f64) -> Self {
            // SAFETY: see above.
            Avx512(unsafe { _mm512_set1_pd(x) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see above.
            Avx512(unsafe { _mm512_abs_pd(self.0) })
        }
        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            // SAFETY: see above.
            Avx512(unsafe { _mm512_max_pd(self.0, other.0) })
        }
        #[inline(always)]
        fn gt(self, other: Self) -> Avx512Mask {
            // SAFETY: see above.
            Avx512Mask(unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn select(mask: Avx512Mask, yes: Self, no: Self) -> Self {
            // SAFETY: see above.
            Avx512(unsafe { _mm512_mask_blend_pd(mask.0, no.0, yes.0) })
        }
    }

    impl Vector for Avx512 {
        const N: usize = LANES;

        #[inline(always)]
        fn load(lanes: &[f64; LANES], _: usize) -> Self {
            // SAFETY: see above; one load of eight.
            Avx512(unsafe { _mm512_loadu_pd(lanes.as_ptr()) })
        }
        #[inline(always)]
        fn bits(mask: Avx512Mask) -> u8 {
            mask.0
        }
    }

    /// Eight `f32` in a 256-bit register. To be used where `avx2` was detected.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx2F32(__m256);

    /// Eight conditions in a register.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx2F32Mask(__m256);

    /// Sixteen `f32` in a 512-bit register. To be used where `avx512f` and `avx512dq` were detected.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx512F32(__m512);

    /// Sixteen conditions in a mask register.
    #[derive(Debug, Clone, Copy)]
    pub struct Avx512F32Mask(__mmask16);

    on_256!(Avx2F32, Add, add, _mm256_add_ps);
    on_256!(Avx2F32, Sub, sub, _mm256_sub_ps);
    on_256!(Avx2F32, Mul, mul, _mm256_mul_ps);
    on_256!(Avx2F32Mask, BitAnd, bitand, _mm256_and_ps);
    on_256!(Avx2F32Mask, BitOr, bitor, _mm256_or_ps);
    on_256!(Avx2F32Mask, BitXor, bitxor, _mm256_xor_ps);
    on_512!(Avx512F32, Add, add, _mm512_add_ps);
    on_512!(Avx512F32, Sub, sub, _mm512_sub_ps);
    on_512!(Avx512F32, Mul, mul, _mm512_mul_ps);
    operator!(Avx512F32Mask, BitAnd, bitand, |a, b| Avx512F32Mask(
        a.0 & b.0
    ));
    operator!(Avx512F32Mask, BitOr, bitor, |a, b| Avx512F32Mask(a.0 | b.0));
    operator!(Avx512F32Mask, BitXor, bitxor, |a, b| Avx512F32Mask(
        a.0 ^ b.0
    ));

    impl Not for Avx2F32Mask {
        type Output = Self;
        #[inline(always)]
        fn not(self) -> Self {
            // SAFETY: see above.
            let all = unsafe { _mm256_castsi256_ps(_mm256_set1_epi32(-1)) };
            self ^ Avx2F32Mask(all)
        }
    }

    impl Not for Avx512F32Mask {
        type Output = Self;
        #[inline(always)]
        fn not(self) -> Self {
            Avx512F32Mask(!self.0)
        }
    }

    impl Number for Avx2F32 {
        type Mask = Avx2F32Mask;

        const BOUND: f64 = BOUND_F32;

        #[inline(always)]
        fn with_underflow(self) -> Self {
            self + Self::splat(UNDERFLOW_F32)
        }

        #[inline(always)]
        fn splat(x: f64) -> Self {
            // SAFETY: see above.
            Avx2F32(unsafe { _mm256_set1_ps(x as f32) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see above.
            Avx2F32(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }
        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            // SAFETY: see above.
            Avx2F32(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn gt(self, other: Self) -> Avx2F32Mask {
            // SAFETY: see above.
            Avx2F32Mask(unsafe { _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn select(mask: Avx2F32Mask, yes: Self, no: Self) -> Self {
            // SAFETY: see above.
            Avx2F32(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
        }
    }

    impl Lookup for Avx2F32 {
        const N: usize = 8;
        type Places = __m256i;

        #[inline(always)]
        fn places(places: &[u8; BATCH], first: usize) -> __m256i {
            let eight: &[u8; 8] = places[first..].first_chunk().expect("eight lanes");
            // SAFETY: see above; one load of eight bytes.
            unsafe {
                let places = _mm256_cvtepu8_epi32(_mm_loadl_epi64(eight.as_ptr().cast()));
                _mm256_and_si256(places, _mm256_set1_epi32(TABLE as i32 - 1))
            }
        }
        #[inline(always)]
        fn look_up(table: &[f32; TABLE], places: __m256i) -> Self {
            // SAFETY: see above; every place is below `TABLE`, as `places` made it.
            Avx2F32(unsafe { _mm256_i32gather_ps::<4>(table.as_ptr(), places) })
        }
        #[inline(always)]
        fn bits(mask: Avx2F32Mask) -> u16 {
            // SAFETY: see above.
            unsafe { _mm256_movemask_ps(mask.0) as u16 }
        }
    }

    impl Number for Avx512F32 {
        type Mask = Avx512F32Mask;

        const BOUND: f64 = BOUND_F32;

        #[inline(always)]
        fn with_underflow(self) -> Self {
            self + Self::splat(UNDERFLOW_F32)
        }

        #[inline(always)]
        fn splat(x: f64) -> Self {
            // SAFETY: see above.
            Avx512F32(unsafe { _mm512_set1_ps(x as f32) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see above.
            Avx512F32(unsafe { _mm512_abs_ps(self.0) })
        }
        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            // SAFETY: see above.
            Avx512F32(unsafe { _mm512_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn gt(self, other: Self) -> Avx512F32Mask {
            // SAFETY: see above.
            Avx512F32Mask(unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn select(mask: Avx512F32Mask, yes: Self, no: Self) -> Self {
            // SAFETY: see above.
            Avx512F32(unsafe { _mm512_mask_blend_ps(mask.0, no.0, yes.0) })
        }
    }

    impl Avx512F32 {
        /// Writes the numbers into a table from `first` on.
        #[inline(always)]
        pub fn store(self, table: &mut [f32; TABLE], first: usize) {
            let sixteen: &mut [f32; 16] = table[first..].first_chunk_mut().expect("sixteen places");
            // SAFETY: see above; one store of sixteen.
            unsafe { _mm512_storeu_ps(sixteen.as_mut_ptr(), self.0) };
        }
    }

    impl Lookup for Avx512F32 {
        const N: usize = BATCH;
        type Places = __m512i;

        #[inline(always)]
        fn places(places: &[u8; BATCH], _: usize) -> __m512i {
            // SAFETY: see above; one load of sixteen bytes.
            unsafe { _mm512_cvtepu8_epi32(_mm_loadu_si128(places.as_ptr().cast())) }
        }
        #[inline(always)]
        fn look_up(table: &[f32; TABLE], places: __m512i) -> Self {
            const {
                assert!(TABLE == 64, "two permutations of 32 and a choice");
            }
            let first = table.as_ptr();
            // SAFETY: see above; four loads of sixteen from a table of 64. A permutation looks at the five
            // lowest bits of a place, the choice at the sixth.
            unsafe {
                let low = _mm512_permutex2var_ps(
                    _mm512_loadu_ps(first),
                    places,
                    _mm512_loadu_ps(first.add(16)),
                );
                let high = _mm512_permutex2var_ps(
                    _mm512_loadu_ps(first.add(32)),
                    places,
                    _mm512_loadu_ps(first.add(48)),
                );
                let is_high = _mm512_test_epi32_mask(places, _mm512_set1_epi32(32));
                Avx512F32(_mm512_mask_blend_ps(is_high, low, high))
            }
        }
        #[inline(always)]
        fn bits(mask: Avx512F32Mask) -> u16 {
            mask.0
        }
    }
}
