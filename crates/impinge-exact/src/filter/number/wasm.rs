//! WebAssembly's registers of 128 bits, for modules that are compiled for them.
//!
//! Compilers turn many of [`Portable`](super::Portable)'s operations into single ones, number by
//! number: the filters then take three times as much code, and a module for browsers is loaded over
//! the network.

use core::arch::wasm32::*;

use super::*;

macro_rules! register {
    (
        $(#[$doc:meta])* $type:ident, $mask:ident,
        $bound:expr, $underflow:expr, $any_size:expr, $largest:expr, $tiny:expr, $shortest:expr,
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
            const BOUND: f64 = $bound;
            const UNDERFLOW: f64 = $underflow;
            const UNDERFLOW_PER_SIZE: f64 = $any_size[0];
            const HEADROOM: f64 = $any_size[1];
            const LARGEST: f64 = $largest;
            const TINY: [f64; 3] = $tiny;
            const SHORTEST: f64 = $shortest;

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
    Wasm, WasmMask, BOUND_F64, UNDERFLOW_F64, ANY_SIZE_F64, LARGEST_DIFFERENCE_F64, TINY_F64, SHORTEST_F64,
    add f64x2_add, sub f64x2_sub, mul f64x2_mul, div f64x2_div, pmax f64x2_pmax, splat |x| f64x2_splat(x),
    abs f64x2_abs, sqrt f64x2_sqrt, gt f64x2_gt,
}

register! {
    /// Four `f32` in a register of WebAssembly.
    WasmF32, WasmF32Mask, BOUND_F32, UNDERFLOW_F32, ANY_SIZE_F32, LARGEST_DIFFERENCE_F32, TINY_F32, SHORTEST_F32,
    add f32x4_add, sub f32x4_sub, mul f32x4_mul, div f32x4_div, pmax f32x4_pmax, splat |x| f32x4_splat(x as f32),
    abs f32x4_abs, sqrt f32x4_sqrt, gt f32x4_gt,
}

impl Vector for Wasm {
    const N: usize = 2;

    #[inline(always)]
    fn load(lanes: &[f64; LANES], first: usize) -> Self {
        let two: &[f64; 2] = lanes[first..].first_chunk().expect("two lanes");
        // SAFETY: the two numbers are 16 readable bytes; loads need no alignment.
        Wasm(unsafe { v128_load(two.as_ptr().cast()) })
    }
    #[inline(always)]
    fn store(self, lanes: &mut [f64; LANES], first: usize) {
        let two: &mut [f64; 2] = lanes[first..].first_chunk_mut().expect("two lanes");
        // SAFETY: the two numbers are 16 writable bytes; stores need no alignment.
        unsafe { v128_store(two.as_mut_ptr().cast(), self.0) }
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
    fn row(table: &[f32; TABLE], first: usize) -> Self {
        let four: &[f32; 4] = table[first..].first_chunk().expect("four slots");
        // SAFETY: the four numbers are 16 readable bytes; loads need no alignment.
        WasmF32(unsafe { v128_load(four.as_ptr().cast()) })
    }
    #[inline(always)]
    fn put(self, row: &mut [f32], first: usize) {
        let four: &mut [f32; 4] = row[first..].first_chunk_mut().expect("four slots");
        // SAFETY: the four numbers are 16 writable bytes; stores need no alignment.
        unsafe { v128_store(four.as_mut_ptr().cast(), self.0) }
    }
    #[inline(always)]
    fn bits(mask: WasmF32Mask) -> u16 {
        i32x4_bitmask(mask.0).into()
    }
}
