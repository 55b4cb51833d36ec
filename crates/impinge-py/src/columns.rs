//! Columns of answers about pairs of elements, as NumPy arrays. An array for which there is no memory is a `MemoryError`.

use impinge::PairKind;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::result::{collect, to_array};

/// The numbers of the two bodies in each row.
pub fn bodies(
    py: Python<'_>,
    n: usize,
    rows: impl Iterator<Item = [u32; 4]>,
) -> PyResult<Bound<'_, PyArray2<u32>>> {
    to_array(py, collect(n, rows.map(|[a, _, b, _]| [a, b]))?)
}

/// The numbers of the two elements in each row.
pub fn elements(
    py: Python<'_>,
    n: usize,
    rows: impl Iterator<Item = [u32; 4]>,
) -> PyResult<Bound<'_, PyArray2<u32>>> {
    to_array(py, collect(n, rows.map(|[_, a, _, b]| [a, b]))?)
}

/// Kinds, as indices of `impinge.KINDS`.
pub fn kinds(
    py: Python<'_>,
    n: usize,
    kinds: impl Iterator<Item = PairKind>,
) -> PyResult<Bound<'_, PyArray1<u8>>> {
    let numbers = collect(n, kinds.map(|kind| kind as u8))?;
    Ok(PyArray1::from_vec(py, numbers))
}

/// `n` short names as NumPy holds them: one 32-bit number per letter, filled up with zeros.
pub fn strings<const WIDTH: usize>(
    py: Python<'_>,
    n: usize,
    names: impl Iterator<Item = &'static str>,
) -> PyResult<Bound<'_, PyAny>> {
    let letters = |name: &str| -> [u32; WIDTH] {
        let name = name.as_bytes();
        std::array::from_fn(|at| name.get(at).copied().map_or(0, u32::from))
    };
    let letters = collect(n, names.map(letters))?.into_flattened();
    let dtype = format!("U{WIDTH}");
    if letters.is_empty() {
        return py.import("numpy")?.call_method1("empty", (0, dtype));
    }
    PyArray1::from_vec(py, letters).call_method1("view", (dtype,))
}

/// An answer's `repr`: how many pairs it has of each kind.
pub fn counted(name: &str, count: impl Fn(PairKind) -> usize) -> String {
    let counts = PairKind::ALL.map(|kind| (kind.name(), count(kind)));
    let counts: Vec<String> = counts
        .iter()
        .filter(|(_, n)| *n > 0)
        .map(|(kind, n)| format!("{kind}: {n}"))
        .collect();
    format!("{name}({})", counts.join(", "))
}
