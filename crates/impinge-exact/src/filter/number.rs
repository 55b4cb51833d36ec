//! The numbers that the filters compute with: one `f64`, or a vector register of `f64` or `f32`.
//!
//! The filter is written once, generic over [`Number`]; comparisons give a mask and branches are
//! selects. Additions, subtractions and multiplications are those of IEEE 754 in every
//! implementation, one rounding each, so every instruction set gives the same masks.

use core::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Not, Sub};

use super::{BATCH, LANES, Points8, TABLE};
use crate::rounding::{root, root_f32};

/// One number or several, side by side.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + sealed::Sealed
{
    /// One condition per number.
    type Mask: Copy
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + BitXor<Output = Self::Mask>
        + Not<Output = Self::Mask>;

    /// 64 unit roundoffs: the error of a determinant, relative to the product of its vectors'
    /// sizes. The derivation needs a little more than 60.
    const BOUND: f64;
    /// The error that underflow may add: 2^-1000 for `f64`, 2^-69 for `f32` with coordinates up to
    /// 2^24, there even where the processor flushes subnormal numbers to zero.
    const UNDERFLOW: f64;
    /// For `f64`, whose coordinates have any size: what underflow may add to a vector's product,
    /// per size of the other vector. 0 for `f32`.
    const UNDERFLOW_PER_SIZE: f64;
    /// For `f64`: a bound is computed so many times larger, so that it overflows before a
    /// determinant does. 1 for `f32`.
    const HEADROOM: f64;

    /// The largest coordinate difference that the filter for moving elements accepts; see `motion`.
    const LARGEST: f64;
    /// The error that underflow may add, with such differences, to the product of a vector with a
    /// known one, to a determinant of three, and to a product of four.
    const TINY: [f64; 3];
    /// Squares of lengths above this are not wrong by underflow, but for a fraction of a unit
    /// roundoff; see `nearness`.
    const SHORTEST: f64;

    /// A bound plus the error that underflow may add.
    #[inline(always)]
    fn with_underflow(self) -> Self {
        self + Self::splat(Self::UNDERFLOW)
    }
    /// One number in every lane, rounded to `f32` where the lanes are `f32`.
    fn splat(x: f64) -> Self;
    /// The magnitude.
    fn abs(self) -> Self;
    /// The square root, rounded once.
    fn sqrt(self) -> Self;
    /// The larger of two; if one is NaN, either.
    fn larger(self, other: Self) -> Self;
    /// The smaller of two; if one is NaN, either.
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Self::select(self.gt(other), other, self)
    }
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
    /// Writes the numbers to memory, from lane `first` on.
    fn store(self, lanes: &mut [f64; LANES], first: usize);
    /// Bit k for number k.
    fn bits(mask: Self::Mask) -> u8;
}

/// A register of `f32` that are looked up in tables.
pub trait Lookup: Number {
    /// Numbers in a register: a divisor of [`BATCH`].
    const N: usize;
    /// Which numbers of a table to take.
    type Slots: Copy;

    /// Slots from memory, from lane `first` on, modulo the table's length.
    fn slots(slots: &[u8; BATCH], first: usize) -> Self::Slots;
    /// The numbers at some slots.
    fn look_up(table: &[f32; TABLE], slots: Self::Slots) -> Self;
    /// `N` numbers of a table, from slot `first` on.
    fn row(table: &[f32; TABLE], first: usize) -> Self;
    /// Writes the numbers to memory, from place `first` on.
    fn put(self, row: &mut [f32], first: usize);
    /// Bit k for number k.
    fn bits(mask: Self::Mask) -> u16;
}

/// Points from memory, from lane `first` on.
#[inline(always)]
pub(super) fn load_vertex<V: Vector>([x, y, z]: &[[f64; LANES]; 3], first: usize) -> [V; 3] {
    [V::load(x, first), V::load(y, first), V::load(z, first)]
}

/// Four points of each pair, from lane `first` on.
#[inline(always)]
pub(crate) fn load_points<V: Vector>(Points8(points): &Points8, first: usize) -> [[V; 3]; 4] {
    [
        load_vertex(&points[0], first),
        load_vertex(&points[1], first),
        load_vertex(&points[2], first),
        load_vertex(&points[3], first),
    ]
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f64 {}
    impl Sealed for super::Portable {}
    impl Sealed for super::Portable32 {}
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    impl Sealed for super::Wasm {}
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    impl Sealed for super::WasmF32 {}
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
/// 2^-1000.
const UNDERFLOW_F64: f64 = f64::from_bits((1023 - 1000) << 52);
/// 2^-69.
const UNDERFLOW_F32: f64 = f64::from_bits((1023 - 69) << 52);
/// `UNDERFLOW_PER_SIZE` and `HEADROOM`: see `determinant`.
const ANY_SIZE_F64: [f64; 2] = [power(-900), power(50)];
/// Coordinates are known to be small.
const ANY_SIZE_F32: [f64; 2] = [0.0, 1.0];

/// A power of two.
const fn power(exponent: i64) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

const LARGEST_DIFFERENCE_F64: f64 = power(100);
const LARGEST_DIFFERENCE_F32: f64 = power(16);
const TINY_F64: [f64; 3] = [power(-800), power(-800), power(-700)];
const TINY_F32: [f64; 3] = [power(-80), power(-80), power(-60)];
const SHORTEST_F64: f64 = power(-450);
const SHORTEST_F32: f64 = power(-49);

impl Number for f64 {
    type Mask = bool;
    const BOUND: f64 = BOUND_F64;
    const UNDERFLOW: f64 = UNDERFLOW_F64;
    const UNDERFLOW_PER_SIZE: f64 = ANY_SIZE_F64[0];
    const HEADROOM: f64 = ANY_SIZE_F64[1];
    const LARGEST: f64 = LARGEST_DIFFERENCE_F64;
    const TINY: [f64; 3] = TINY_F64;
    const SHORTEST: f64 = SHORTEST_F64;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        root(self)
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

/// Numbers as a plain array, for processors without a known vector instruction set; the compiler
/// may vectorise it. Every operation names its lanes: loops over them, thousands in one function,
/// took the compiler minutes.
macro_rules! portable {
    (
        $type:ident, $mask:ident, $number:ty, $bits:ty, $n:expr, [$($k:literal),*], $bound:expr, $underflow:expr, $any_size:expr,
        $largest:expr, $tiny:expr, $shortest:expr, $root:path
    ) => {
        #[doc = concat!("Some `", stringify!($number), "` in 128 bits, which SSE2 and NEON have.")]
        #[derive(Debug, Clone, Copy)]
        pub struct $type([$number; $n]);

        /// One condition per number: all bits set, or none.
        #[derive(Debug, Clone, Copy)]
        pub struct $mask([$bits; $n]);

        #[cfg_attr(
            all(target_arch = "wasm32", target_feature = "simd128"),
            allow(dead_code, reason = "WebAssembly has registers of its own")
        )]
        impl $type {
            #[inline(always)]
            fn zip(self, other: Self, op: impl Fn($number, $number) -> $number) -> Self {
                $type([$(op(self.0[$k], other.0[$k])),*])
            }
        }

        #[cfg_attr(
            all(target_arch = "wasm32", target_feature = "simd128"),
            allow(dead_code, reason = "WebAssembly has registers of its own")
        )]
        impl $mask {
            #[inline(always)]
            fn zip(self, other: Self, op: impl Fn($bits, $bits) -> $bits) -> Self {
                $mask([$(op(self.0[$k], other.0[$k])),*])
            }
        }

        operator!($type, Add, add, |a, b| a.zip(b, |x, y| x + y));
        operator!($type, Sub, sub, |a, b| a.zip(b, |x, y| x - y));
        operator!($type, Mul, mul, |a, b| a.zip(b, |x, y| x * y));
        operator!($type, Div, div, |a, b| a.zip(b, |x, y| x / y));
        operator!($mask, BitAnd, bitand, |a, b| a.zip(b, |x, y| x & y));
        operator!($mask, BitOr, bitor, |a, b| a.zip(b, |x, y| x | y));
        operator!($mask, BitXor, bitxor, |a, b| a.zip(b, |x, y| x ^ y));

        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                $mask([$(!self.0[$k]),*])
            }
        }

        impl Number for $type {
            type Mask = $mask;
            const BOUND: f64 = $bound;
            const UNDERFLOW: f64 = $underflow;
            const UNDERFLOW_PER_SIZE: f64 = $any_size[0];
            const HEADROOM: f64 = $any_size[1];
            const LARGEST: f64 = $largest;
            const TINY: [f64; 3] = $tiny;
            const SHORTEST: f64 = $shortest;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                $type([x as $number; $n])
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type([$(self.0[$k].abs()),*])
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type([$($root(self.0[$k])),*])
            }
            #[inline(always)]
            fn larger(self, other: Self) -> Self {
                self.zip(other, |x, y| if x > y { x } else { y })
            }
            #[inline(always)]
            fn gt(self, other: Self) -> $mask {
                let is = |is: bool| if is { <$bits>::MAX } else { 0 };
                $mask([$(is(self.0[$k] > other.0[$k])),*])
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                let bits = |mask: $bits, yes: $number, no: $number| {
                    <$number>::from_bits((yes.to_bits() & mask) | (no.to_bits() & !mask))
                };
                $type([$(bits(mask.0[$k], yes.0[$k], no.0[$k])),*])
            }
        }
    };
}

const PORTABLE: usize = 2;
const PORTABLE_F32: usize = 4;

portable!(
    Portable,
    PortableMask,
    f64,
    u64,
    PORTABLE,
    [0, 1],
    BOUND_F64,
    UNDERFLOW_F64,
    ANY_SIZE_F64,
    LARGEST_DIFFERENCE_F64,
    TINY_F64,
    SHORTEST_F64,
    root
);
portable!(
    Portable32,
    Portable32Mask,
    f32,
    u32,
    PORTABLE_F32,
    [0, 1, 2, 3],
    BOUND_F32,
    UNDERFLOW_F32,
    ANY_SIZE_F32,
    LARGEST_DIFFERENCE_F32,
    TINY_F32,
    SHORTEST_F32,
    root_f32
);

impl Vector for Portable {
    const N: usize = PORTABLE;

    #[inline(always)]
    fn load(lanes: &[f64; LANES], first: usize) -> Self {
        Portable([lanes[first], lanes[first + 1]])
    }
    #[inline(always)]
    fn store(self, lanes: &mut [f64; LANES], first: usize) {
        lanes[first..][..PORTABLE].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn bits(mask: PortableMask) -> u8 {
        (mask.0[0] & 1) as u8 | ((mask.0[1] & 1) as u8) << 1
    }
}

impl Lookup for Portable32 {
    const N: usize = PORTABLE_F32;
    type Slots = [u8; PORTABLE_F32];

    #[inline(always)]
    fn slots(slots: &[u8; BATCH], first: usize) -> Self::Slots {
        let four: &[u8; PORTABLE_F32] = slots[first..].first_chunk().expect("four lanes");
        *four
    }
    #[inline(always)]
    fn look_up(table: &[f32; TABLE], slots: Self::Slots) -> Self {
        let [a, b, c, d] = slots;
        let at = |slot: u8| table[slot as usize % TABLE];
        Portable32([at(a), at(b), at(c), at(d)])
    }
    #[inline(always)]
    fn row(table: &[f32; TABLE], first: usize) -> Self {
        let four: &[f32; PORTABLE_F32] = table[first..].first_chunk().expect("four slots");
        Portable32(*four)
    }
    #[inline(always)]
    fn put(self, row: &mut [f32], first: usize) {
        row[first..][..PORTABLE_F32].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn bits(mask: Portable32Mask) -> u16 {
        let [a, b, c, d] = mask.0;
        (a & 1 | (b & 1) << 1 | (c & 1) << 2 | (d & 1) << 3) as u16
    }
}

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub use wasm::{Wasm, WasmF32};
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx2F32, Avx512, Avx512F32};

/// The methods are sound only inside a function that enables the instruction set. Values of these
/// types start with `load`, `splat` or `look_up`, and only such functions call those.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use core::arch::x86_64::*;

    // SAFETY (all below): these types are used inside functions compiled for, and called on
    // processors with, their instruction set; the intrinsics touch no memory but that of `load`,
    // whose array has eight numbers, and of `slots` and `look_up`.
    macro_rules! register {
        (
            $(#[$doc:meta])* $type:ident($register:ty), $mask:ident($bits:ty),
            $bound:expr, $underflow:expr, $any_size:expr, $largest:expr, $tiny:expr, $shortest:expr,
            add $add:ident, sub $sub:ident, mul $mul:ident, div $div:ident, max $max:ident, splat |$x:ident| $splat:expr,
            abs |$y:ident| $abs:expr, sqrt $sqrt:ident, gt |$a:ident, $b:ident| $gt:expr,
            select |$m:ident, $yes:ident, $no:ident| $select:expr,
            and |$p:ident, $q:ident| $and:expr, or |$r:ident, $s:ident| $or:expr,
            xor |$t:ident, $u:ident| $xor:expr, not |$v:ident| $not:expr $(,)?
        ) => {
            $(#[$doc])*
            #[derive(Debug, Clone, Copy)]
            pub struct $type($register);

            /// A condition for each number.
            #[derive(Debug, Clone, Copy)]
            pub struct $mask($bits);

            operator!($type, Add, add, |a, b| {
                // SAFETY: see above.
                unsafe { $type($add(a.0, b.0)) }
            });
            operator!($type, Sub, sub, |a, b| {
                // SAFETY: see above.
                unsafe { $type($sub(a.0, b.0)) }
            });
            operator!($type, Mul, mul, |a, b| {
                // SAFETY: see above.
                unsafe { $type($mul(a.0, b.0)) }
            });
            operator!($type, Div, div, |a, b| {
                // SAFETY: see above.
                unsafe { $type($div(a.0, b.0)) }
            });
            operator!($mask, BitAnd, bitand, |a, b| {
                let ($p, $q) = (a.0, b.0);
                #[allow(unused_unsafe, reason = "masks of 512 bits are integers")]
                // SAFETY: see above.
                let bits = unsafe { $and };
                $mask(bits)
            });
            operator!($mask, BitOr, bitor, |a, b| {
                let ($r, $s) = (a.0, b.0);
                #[allow(unused_unsafe, reason = "masks of 512 bits are integers")]
                // SAFETY: see above.
                let bits = unsafe { $or };
                $mask(bits)
            });
            operator!($mask, BitXor, bitxor, |a, b| {
                let ($t, $u) = (a.0, b.0);
                #[allow(unused_unsafe, reason = "masks of 512 bits are integers")]
                // SAFETY: see above.
                let bits = unsafe { $xor };
                $mask(bits)
            });

            impl Not for $mask {
                type Output = Self;
                #[inline(always)]
                fn not(self) -> Self {
                    let $v = self.0;
                    #[allow(unused_unsafe, reason = "masks of 512 bits are integers")]
                    // SAFETY: see above.
                    let bits = unsafe { $not };
                    $mask(bits)
                }
            }

            impl Number for $type {
                type Mask = $mask;
                const BOUND: f64 = $bound;
                const UNDERFLOW: f64 = $underflow;
                const UNDERFLOW_PER_SIZE: f64 = $any_size[0];
                const HEADROOM: f64 = $any_size[1];
                const LARGEST: f64 = $largest;
                const TINY: [f64; 3] = $tiny;
                const SHORTEST: f64 = $shortest;

                #[inline(always)]
                fn splat($x: f64) -> Self {
                    // SAFETY: see above.
                    $type(unsafe { $splat })
                }
                #[inline(always)]
                fn abs(self) -> Self {
                    let $y = self.0;
                    // SAFETY: see above.
                    $type(unsafe { $abs })
                }
                #[inline(always)]
                fn sqrt(self) -> Self {
                    // SAFETY: see above.
                    $type(unsafe { $sqrt(self.0) })
                }
                #[inline(always)]
                fn larger(self, other: Self) -> Self {
                    // SAFETY: see above.
                    $type(unsafe { $max(self.0, other.0) })
                }
                #[inline(always)]
                fn gt(self, other: Self) -> $mask {
                    let ($a, $b) = (self.0, other.0);
                    // SAFETY: see above.
                    $mask(unsafe { $gt })
                }
                #[inline(always)]
                fn select(mask: $mask, yes: Self, no: Self) -> Self {
                    let ($m, $yes, $no) = (mask.0, yes.0, no.0);
                    // SAFETY: see above.
                    $type(unsafe { $select })
                }
            }
        };
    }

    register! {
        /// Four numbers in a 256-bit register. To be used where `avx2` was detected.
        Avx2(__m256d), Avx2Mask(__m256d), BOUND_F64, UNDERFLOW_F64, ANY_SIZE_F64, LARGEST_DIFFERENCE_F64, TINY_F64, SHORTEST_F64,
        add _mm256_add_pd, sub _mm256_sub_pd, mul _mm256_mul_pd, div _mm256_div_pd, max _mm256_max_pd,
        splat |x| _mm256_set1_pd(x),
        abs |x| _mm256_andnot_pd(_mm256_set1_pd(-0.0), x),
        sqrt _mm256_sqrt_pd,
        gt |a, b| _mm256_cmp_pd::<_CMP_GT_OQ>(a, b),
        select |mask, yes, no| _mm256_blendv_pd(no, yes, mask),
        and |a, b| _mm256_and_pd(a, b),
        or |a, b| _mm256_or_pd(a, b),
        xor |a, b| _mm256_xor_pd(a, b),
        not |a| _mm256_xor_pd(a, _mm256_castsi256_pd(_mm256_set1_epi32(-1))),
    }

    register! {
        /// Eight `f32` in a 256-bit register. To be used where `avx2` was detected.
        Avx2F32(__m256), Avx2F32Mask(__m256), BOUND_F32, UNDERFLOW_F32, ANY_SIZE_F32, LARGEST_DIFFERENCE_F32, TINY_F32, SHORTEST_F32,
        add _mm256_add_ps, sub _mm256_sub_ps, mul _mm256_mul_ps, div _mm256_div_ps, max _mm256_max_ps,
        splat |x| _mm256_set1_ps(x as f32),
        abs |x| _mm256_andnot_ps(_mm256_set1_ps(-0.0), x),
        sqrt _mm256_sqrt_ps,
        gt |a, b| _mm256_cmp_ps::<_CMP_GT_OQ>(a, b),
        select |mask, yes, no| _mm256_blendv_ps(no, yes, mask),
        and |a, b| _mm256_and_ps(a, b),
        or |a, b| _mm256_or_ps(a, b),
        xor |a, b| _mm256_xor_ps(a, b),
        not |a| _mm256_xor_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(-1))),
    }

    register! {
        /// Eight numbers in a 512-bit register. To be used where `avx512f` and `avx512dq` were
        /// detected.
        Avx512(__m512d), Avx512Mask(__mmask8), BOUND_F64, UNDERFLOW_F64, ANY_SIZE_F64, LARGEST_DIFFERENCE_F64, TINY_F64, SHORTEST_F64,
        add _mm512_add_pd, sub _mm512_sub_pd, mul _mm512_mul_pd, div _mm512_div_pd, max _mm512_max_pd,
        splat |x| _mm512_set1_pd(x),
        abs |x| _mm512_abs_pd(x),
        sqrt _mm512_sqrt_pd,
        gt |a, b| _mm512_cmp_pd_mask::<_CMP_GT_OQ>(a, b),
        select |mask, yes, no| _mm512_mask_blend_pd(mask, no, yes),
        and |a, b| a & b, or |a, b| a | b, xor |a, b| a ^ b, not |a| !a,
    }

    register! {
        /// Sixteen `f32` in a 512-bit register. To be used where `avx512f` and `avx512dq` were
        /// detected.
        Avx512F32(__m512), Avx512F32Mask(__mmask16), BOUND_F32, UNDERFLOW_F32, ANY_SIZE_F32, LARGEST_DIFFERENCE_F32, TINY_F32, SHORTEST_F32,
        add _mm512_add_ps, sub _mm512_sub_ps, mul _mm512_mul_ps, div _mm512_div_ps, max _mm512_max_ps,
        splat |x| _mm512_set1_ps(x as f32),
        abs |x| _mm512_abs_ps(x),
        sqrt _mm512_sqrt_ps,
        gt |a, b| _mm512_cmp_ps_mask::<_CMP_GT_OQ>(a, b),
        select |mask, yes, no| _mm512_mask_blend_ps(mask, no, yes),
        and |a, b| a & b, or |a, b| a | b, xor |a, b| a ^ b, not |a| !a,
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
        fn store(self, lanes: &mut [f64; LANES], first: usize) {
            let four: &mut [f64; 4] = lanes[first..].first_chunk_mut().expect("four lanes");
            // SAFETY: see above; one store of four.
            unsafe { _mm256_storeu_pd(four.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn bits(mask: Avx2Mask) -> u8 {
            // SAFETY: see above.
            unsafe { _mm256_movemask_pd(mask.0) as u8 }
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
        fn store(self, lanes: &mut [f64; LANES], _: usize) {
            // SAFETY: see above; one store of eight.
            unsafe { _mm512_storeu_pd(lanes.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn bits(mask: Avx512Mask) -> u8 {
            mask.0
        }
    }

    impl Lookup for Avx2F32 {
        const N: usize = 8;
        type Slots = __m256i;

        #[inline(always)]
        fn slots(slots: &[u8; BATCH], first: usize) -> __m256i {
            let eight: &[u8; 8] = slots[first..].first_chunk().expect("eight lanes");
            // SAFETY: see above; one load of eight bytes.
            unsafe {
                let slots = _mm256_cvtepu8_epi32(_mm_loadl_epi64(eight.as_ptr().cast()));
                _mm256_and_si256(slots, _mm256_set1_epi32(TABLE as i32 - 1))
            }
        }
        #[inline(always)]
        fn look_up(table: &[f32; TABLE], slots: __m256i) -> Self {
            // SAFETY: see above; every slot is below `TABLE`, as `slots` made it.
            Avx2F32(unsafe { _mm256_i32gather_ps::<4>(table.as_ptr(), slots) })
        }
        #[inline(always)]
        fn row(table: &[f32; TABLE], first: usize) -> Self {
            let eight: &[f32; 8] = table[first..].first_chunk().expect("eight slots");
            // SAFETY: see above; one load of eight.
            Avx2F32(unsafe { _mm256_loadu_ps(eight.as_ptr()) })
        }
        #[inline(always)]
        fn put(self, row: &mut [f32], first: usize) {
            let eight: &mut [f32; 8] = row[first..].first_chunk_mut().expect("eight slots");
            // SAFETY: see above; one store of eight.
            unsafe { _mm256_storeu_ps(eight.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn bits(mask: Avx2F32Mask) -> u16 {
            // SAFETY: see above.
            unsafe { _mm256_movemask_ps(mask.0) as u16 }
        }
    }

    impl Lookup for Avx512F32 {
        const N: usize = BATCH;
        type Slots = __m512i;

        #[inline(always)]
        fn slots(slots: &[u8; BATCH], _: usize) -> __m512i {
            // SAFETY: see above; one load of sixteen bytes.
            unsafe { _mm512_cvtepu8_epi32(_mm_loadu_si128(slots.as_ptr().cast())) }
        }
        #[inline(always)]
        fn look_up(table: &[f32; TABLE], slots: __m512i) -> Self {
            const {
                assert!(TABLE == 64, "two permutations of 32 and a choice");
            }
            let first = table.as_ptr();
            // SAFETY: see above; four loads of sixteen from a table of 64. A permutation reads the
            // five lowest bits of a slot, the blend reads the sixth.
            unsafe {
                let low = _mm512_permutex2var_ps(
                    _mm512_loadu_ps(first),
                    slots,
                    _mm512_loadu_ps(first.add(16)),
                );
                let high = _mm512_permutex2var_ps(
                    _mm512_loadu_ps(first.add(32)),
                    slots,
                    _mm512_loadu_ps(first.add(48)),
                );
                let is_high = _mm512_test_epi32_mask(slots, _mm512_set1_epi32(32));
                Avx512F32(_mm512_mask_blend_ps(is_high, low, high))
            }
        }
        #[inline(always)]
        fn row(table: &[f32; TABLE], first: usize) -> Self {
            let sixteen: &[f32; BATCH] = table[first..].first_chunk().expect("sixteen slots");
            // SAFETY: see above; one load of sixteen.
            Avx512F32(unsafe { _mm512_loadu_ps(sixteen.as_ptr()) })
        }
        #[inline(always)]
        fn put(self, row: &mut [f32], first: usize) {
            let sixteen: &mut [f32; BATCH] = row[first..].first_chunk_mut().expect("sixteen slots");
            // SAFETY: see above; one store of sixteen.
            unsafe { _mm512_storeu_ps(sixteen.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn bits(mask: Avx512F32Mask) -> u16 {
            mask.0
        }
    }
}
