//! Structures that callers pass with their size: those of an older header are shorter.

use crate::status::Failure;
use crate::types::*;

/// A structure that callers pass with its size, and that grows at its end only.
///
/// # Safety
/// `#[repr(C)]`, the first field is `size: u32`, and all bytes that a caller may give are a valid
/// value.
pub unsafe trait Sized32: Copy + Default {
    const NAME: &'static str;
}

// SAFETY: numbers and pointers; a callback that is not NULL is the caller's function.
unsafe impl Sized32 for impinge_query {
    const NAME: &'static str = "impinge_query";
}

// SAFETY: as above.
unsafe impl Sized32 for impinge_settings {
    const NAME: &'static str = "impinge_settings";
}

/// The structure of a caller, whose header may be older: the defaults stand for what it lacks. NULL
/// is all defaults.
///
/// # Safety
/// `given` is NULL or points to a structure of as many bytes as its first field says.
pub unsafe fn read_sized<T: Sized32>(given: *const T) -> Result<T, Failure> {
    let mut read = T::default();
    if given.is_null() {
        return Ok(read);
    }
    if !given.is_aligned() {
        return Err(Failure::misaligned(given, T::NAME));
    }
    // SAFETY: the first field is a `u32`, and the caller says that it is there.
    let size = unsafe { given.cast::<u32>().read() } as usize;
    let least = size_of::<u32>();
    if size <= least || size > size_of::<T>() {
        return Err(Failure::invalid(format!(
            "{}: its size is {size}, and this library knows {} bytes: fill it by {}_default first, and use the header of this library",
            T::NAME,
            size_of::<T>(),
            T::NAME
        )));
    }
    // SAFETY: both have at least `size` bytes.
    unsafe {
        std::ptr::copy_nonoverlapping(
            given.cast::<u8>(),
            std::ptr::from_mut(&mut read).cast::<u8>(),
            size,
        );
    }
    Ok(read)
}
