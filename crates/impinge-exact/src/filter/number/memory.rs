//! Registers from memory and back.

/// A number, an array of numbers, or a register: any bits are a value, and there is no padding.
///
/// # Safety
/// The type must be so.
pub unsafe trait Plain: Copy {}

macro_rules! plain_arrays {
    ($($number:ty),* $(,)?) => {
        $(
            // SAFETY: an array of numbers is plain.
            unsafe impl<const N: usize> Plain for [$number; N] {}
        )*
    };
}

plain_arrays!(u8, u32, u64, f32, f64);

#[cfg(any(
    target_arch = "x86_64",
    all(target_arch = "wasm32", target_feature = "simd128")
))]
macro_rules! plain_registers {
    ($($register:ty),* $(,)?) => {
        $(
            // SAFETY: a register is bits.
            unsafe impl Plain for $register {}
        )*
    };
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Plain;
    use core::arch::x86_64::*;

    plain_registers!(__m128, __m128d, __m128i);
    plain_registers!(__m256, __m256d, __m256i);
    plain_registers!(__m512, __m512d, __m512i);
}

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
plain_registers!(core::arch::wasm32::v128);

/// A register with the bits of an array of its size.
#[inline(always)]
pub fn read<A: Plain, R: Plain>(array: &A) -> R {
    const {
        assert!(size_of::<A>() == size_of::<R>(), "all bits of a register");
    }
    // SAFETY: the array has as many bytes, and both types are plain; no alignment is needed.
    unsafe { core::ptr::from_ref(array).cast::<R>().read_unaligned() }
}

/// Writes the bits of a register to an array of its size.
#[inline(always)]
pub fn write<A: Plain, R: Plain>(register: R, array: &mut A) {
    const {
        assert!(size_of::<A>() == size_of::<R>(), "all bits of a register");
    }
    // SAFETY: the array has as many bytes, and both types are plain; no alignment is needed.
    unsafe {
        core::ptr::from_mut(array)
            .cast::<R>()
            .write_unaligned(register)
    }
}
