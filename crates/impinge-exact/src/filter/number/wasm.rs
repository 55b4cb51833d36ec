//! WebAssembly's registers of 128 bits, for modules that are compiled for them.
//!
//! Compilers turn many of [`Portable`](super::Portable)'s operations into single ones, number by
//! number: the filters then take three times as much code, and a module for browsers is loaded over
//! the network.

use core::arch::wasm32::*;

use super::memory::{read, write};
use super::*;

macro_rules! register {
    (
        $(#[$doc:meta])* $type:ident, $mask:ident,
        $limits:expr,
        add $add:ident, sub $sub:ident, mul $mul:ident, div $div:ident, pmax $pmax:ident, splat |$x:ident| $splat:expr,
        abs $abs:ident, sqrt $sqrt:ident, gt $gt:ident $(,)?
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub struct $type(v128);

        /// A condition for each number: all bits set, or none.
        #[derive(Debug, Clone, Copy)]
        pub struct $mask(v128);

        operator!($type, Add, add, |a, b| $type($add(a.0, b.0)));
        operator!($type, Sub, sub, |a, b| $type($sub(a.0, b.0)));
        operator!($type, Mul, mul, |a, b| $type($mul(a.0, b.0)));
        operator!($type, Div, div, |a, b| $type($div(a.0, b.0)));
        operator!($mask, BitAnd, bitand, |a, b| $mask(v128_and(a.0, b.0)));
        operator!($mask, BitOr, bitor, |a, b| $mask(v128_or(a.0, b.0)));
        operator!($mask, BitXor, bitxor, |a, b| $mask(v128_xor(a.0, b.0)));

        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                $mask(v128_not(self.0))
            }
        }

        impl Number for $type {
            type Mask = $mask;
            const LIMITS: FormatLimits = $limits;

            #[inline(always)]
            fn splat($x: f64) -> Self {
                $type($splat)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type($abs(self.0))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type($sqrt(self.0))
            }
            #[inline(always)]
            fn larger(self, other: Self) -> Self {
                // `pmax(a, b)` is `b` where a < b, else `a`.
                $type($pmax(other.0, self.0))
            }
            #[inline(always)]
            fn gt(self, other: Self) -> $mask {
                $mask($gt(self.0, other.0))
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                $type(v128_bitselect(yes.0, no.0, mask.0))
            }
        }
    };
}

register! {
    /// Two numbers in a register of WebAssembly.
    Wasm, WasmMask, FormatLimits::F64,
    add f64x2_add, sub f64x2_sub, mul f64x2_mul, div f64x2_div, pmax f64x2_pmax, splat |x| f64x2_splat(x),
    abs f64x2_abs, sqrt f64x2_sqrt, gt f64x2_gt,
}

register! {
    /// Four `f32` in a register of WebAssembly.
    WasmF32, WasmF32Mask, FormatLimits::F32,
    add f32x4_add, sub f32x4_sub, mul f32x4_mul, div f32x4_div, pmax f32x4_pmax, splat |x| f32x4_splat(x as f32),
    abs f32x4_abs, sqrt f32x4_sqrt, gt f32x4_gt,
}

impl Vector for Wasm {
    const N: usize = 2;

    #[inline(always)]
    fn load(lanes: &[f64; LANES], first: usize) -> Self {
        Wasm(read::<[f64; 2], _>(
            lanes[first..].first_chunk().expect("two lanes"),
        ))
    }
    #[inline(always)]
    fn store(self, lanes: &mut [f64; LANES], first: usize) {
        write::<[f64; 2], _>(self.0, lanes[first..].first_chunk_mut().expect("two lanes"));
    }
    #[inline(always)]
    fn bits(mask: WasmMask) -> u8 {
        i64x2_bitmask(mask.0)
    }
}

impl Lookup for WasmF32 {
    const N: usize = 4;
    type Slots = [u8; 4];

    #[inline(always)]
    fn slots(slots: &[u8; BATCH], first: usize) -> Self::Slots {
        let four: &[u8; 4] = slots[first..].first_chunk().expect("four lanes");
        *four
    }
    #[inline(always)]
    fn look_up(table: &[f32; TABLE], slots: Self::Slots) -> Self {
        let [a, b, c, d] = slots;
        let at = |slot: u8| table[slot as usize % TABLE];
        WasmF32(f32x4(at(a), at(b), at(c), at(d)))
    }
    #[inline(always)]
    fn row(numbers: &[f32], first: usize) -> Self {
        WasmF32(read::<[f32; 4], _>(
            numbers[first..].first_chunk().expect("four numbers"),
        ))
    }
    #[inline(always)]
    fn put(self, row: &mut [f32], first: usize) {
        write::<[f32; 4], _>(
            self.0,
            row[first..].first_chunk_mut().expect("four numbers"),
        );
    }
    #[inline(always)]
    fn bits(mask: WasmF32Mask) -> u16 {
        i32x4_bitmask(mask.0).into()
    }
}
