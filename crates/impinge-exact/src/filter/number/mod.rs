//! The numbers that the filters compute with: one `f64`, or a vector register of `f64` or `f32`.
//!
//! The filter is written once, generic over [`Number`]; comparisons give a mask and branches are
//! selects. Additions, subtractions and multiplications are those of IEEE 754 in every
//! implementation, one rounding each, so every instruction set gives the same masks.

use core::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Not, Sub};

use super::{BATCH, LANES, Points8, TABLE, Vertex8};
use crate::rounding::root;

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

    /// What rounding, underflow and overflow may do to these numbers.
    const LIMITS: FormatLimits;
    /// See [`FormatLimits::bound`].
    const BOUND: f64 = Self::LIMITS.bound;
    /// See [`FormatLimits::underflow`].
    const UNDERFLOW: f64 = Self::LIMITS.underflow;
    /// See [`FormatLimits::underflow_per_size`].
    const UNDERFLOW_PER_SIZE: f64 = Self::LIMITS.underflow_per_size;
    /// See [`FormatLimits::headroom`].
    const HEADROOM: f64 = Self::LIMITS.headroom;
    /// See [`FormatLimits::largest`].
    const LARGEST: f64 = Self::LIMITS.largest;
    /// See [`FormatLimits::tiny`].
    const TINY: [f64; 3] = Self::LIMITS.tiny;
    /// See [`FormatLimits::shortest`].
    const SHORTEST: f64 = Self::LIMITS.shortest;

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
    /// The larger of two; if `self` is NaN, `other`.
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
    /// `N` numbers from memory, from place `first` on.
    fn row(numbers: &[f32], first: usize) -> Self;
    /// Writes the numbers to memory, from place `first` on.
    fn put(self, row: &mut [f32], first: usize);
    /// Bit k for number k.
    fn bits(mask: Self::Mask) -> u16;
}

/// Points from memory, from lane `first` on.
#[inline(always)]
pub(crate) fn load_vertex<V: Vector>([x, y, z]: &Vertex8, first: usize) -> [V; 3] {
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

/// What rounding, underflow and overflow may do to numbers of a format.
#[derive(Debug, Clone, Copy)]
pub struct FormatLimits {
    /// 64 unit roundoffs: the error of a determinant, relative to the product of its vectors'
    /// sizes. The derivation needs a little more than 60.
    pub bound: f64,
    /// The error that underflow may add: 2^-1000 for `f64`, 2^-69 for `f32` with coordinates up to
    /// 2^24, there even where the processor flushes subnormal numbers to zero.
    pub underflow: f64,
    /// For `f64`, whose coordinates have any size: what underflow may add to a vector's product,
    /// per size of the other vector; see `determinant`. 0 for `f32`, whose coordinates are known to
    /// be small.
    pub underflow_per_size: f64,
    /// For `f64`: a bound is computed so many times larger, so that it overflows before a
    /// determinant does. 1 for `f32`.
    pub headroom: f64,
    /// The largest coordinate difference that the filter for moving elements accepts; see `motion`.
    pub largest: f64,
    /// The error that underflow may add, with such differences, to the product of a vector with a
    /// known one, to a determinant of three, and to a product of four.
    pub tiny: [f64; 3],
    /// Squares of lengths above this are not wrong by underflow, but for a fraction of a unit
    /// roundoff; see `nearness`.
    pub shortest: f64,
}

impl FormatLimits {
    /// Of double precision.
    pub const F64: FormatLimits = FormatLimits {
        bound: power(-47),
        underflow: power(-1000),
        underflow_per_size: power(-900),
        headroom: power(50),
        largest: power(100),
        tiny: [power(-800), power(-800), power(-700)],
        shortest: power(-450),
    };
    /// Of single precision.
    pub const F32: FormatLimits = FormatLimits {
        bound: power(-18),
        underflow: power(-69),
        underflow_per_size: 0.0,
        headroom: 1.0,
        largest: power(16),
        tiny: [power(-80), power(-80), power(-60)],
        shortest: power(-49),
    };
}

/// A power of two.
const fn power(exponent: i64) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

impl Number for f64 {
    type Mask = bool;
    const LIMITS: FormatLimits = FormatLimits::F64;

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

pub mod memory;
mod portable;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use portable::{Portable, Portable32};
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub use wasm::{Wasm, WasmF32};
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx2F32, Avx512, Avx512F32};
