//! Registers for processors without a known vector instruction set: plain arrays, of which the
//! compiler may make vectors.

use super::*;
use crate::rounding::root_f32;

/// Numbers as a plain array, for processors without a known vector instruction set; the compiler
/// may vectorise it. Every operation names its lanes: loops over them, thousands in one function,
/// took the compiler minutes.
macro_rules! portable {
    (
        $type:ident, $mask:ident, $number:ty, $bits:ty, $n:expr, [$($k:literal),*], $limits:expr,
        $root:path
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
            const LIMITS: FormatLimits = $limits;

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
    FormatLimits::F64,
    root
);
portable!(
    Portable32,
    Portable32Mask,
    f32,
    u32,
    PORTABLE_F32,
    [0, 1, 2, 3],
    FormatLimits::F32,
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
    fn row(numbers: &[f32], first: usize) -> Self {
        let four: &[f32; PORTABLE_F32] = numbers[first..].first_chunk().expect("four numbers");
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
