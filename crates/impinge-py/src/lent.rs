//! NumPy arrays that a scene reads where they lie, without a copy.

use std::sync::Arc;

use impinge::{Positions, Real};
use numpy::{Element, PyReadonlyArray2, PyUntypedArray};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::invalid;

use crate::arrays::{PositionArray, slice_rows};

/// The rows of a NumPy array, which lives as long as they do.
struct Lent<R> {
    _array: Py<PyAny>,
    first: *const [R; 3],
    n: usize,
}

// SAFETY: the rows are only read, from any thread, and numbers are `Sync`. Python objects may be
// dropped by any thread.
unsafe impl<R: Real> Send for Lent<R> {}
// SAFETY: as above.
unsafe impl<R: Real> Sync for Lent<R> {}

impl<R: Real> AsRef<[[R; 3]]> for Lent<R> {
    fn as_ref(&self) -> &[[R; 3]] {
        // SAFETY: `first` and `n` are those of a slice of the array, which is alive. NumPy moves no
        // data of an array that others refer to. `positions` has checked that no array over this
        // data can be written; that none is made to be is the caller's part of the contract.
        unsafe { std::slice::from_raw_parts(self.first, self.n) }
    }
}

/// The positions of a read-only array, shared with it. `array` is `argument` as positions.
pub fn positions(
    argument: &Bound<'_, PyAny>,
    array: &PositionArray<'_>,
    name: &str,
) -> PyResult<Positions> {
    check(argument, name)?;
    match array {
        PositionArray::F32(array) => share(argument, array, name),
        PositionArray::F64(array) => share(argument, array, name),
    }
}

fn share<R: Real + Element>(
    argument: &Bound<'_, PyAny>,
    array: &PyReadonlyArray2<'_, R>,
    name: &str,
) -> PyResult<Positions> {
    if !array.is(argument) {
        return Err(invalid(format!(
            "{name}: not an array that can be read as it is; lend a numpy.ndarray of float32 or float64 in C order, aligned"
        )));
    }
    let rows: &[[R; 3]] = slice_rows(array)?;
    Ok(Positions::shared(Arc::new(Lent {
        _array: argument.clone().unbind(),
        first: rows.as_ptr(),
        n: rows.len(),
    })))
}

/// Refuses an array that can be written, or that is a view of memory that can be.
fn check(argument: &Bound<'_, PyAny>, name: &str) -> PyResult<()> {
    let refused = |what: &str| Err(invalid(format!("{name}: {what}")));
    let mut owner = argument.clone();
    while let Ok(array) = owner.cast::<PyUntypedArray>() {
        if array.getattr("flags")?.getattr("writeable")?.is_truthy()? {
            return refused(match owner.is(argument) {
                true => {
                    "the array can be written, and a lent array is read where it lies: set array.flags.writeable = False first"
                }
                false => {
                    "the array is a view of one that can be written: set array.base.flags.writeable = False first"
                }
            });
        }
        let base = array.getattr("base")?;
        if base.is_none() {
            return Ok(());
        }
        owner = base;
    }
    if owner.is(argument) || owner.is_instance_of::<PyBytes>() {
        return Ok(());
    }
    refused(&format!(
        "the memory of the array belongs to a {}, which may change it; lend an array with memory of its own",
        owner.get_type().name()?
    ))
}
