//! Functions about arrays.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{self, PositionArray, positions_array};
use crate::scene::welded;

/// Vertices that stay, elements that name them, and the vertex that each vertex became.
type Welded<'py> = (
    Bound<'py, PyAny>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray1<u32>>,
);

#[pyfunction]
pub fn _weld<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
) -> PyResult<Welded<'py>> {
    let positions = PositionArray::new(vertices, "vertices")?;
    let (mut indices, n_columns) =
        arrays::index_rows(faces, "faces", &[1, 2, 3, 4], positions.len())?;
    let (weld, welded) = welded(&positions)?;
    for index in &mut indices {
        *index = weld.index(*index);
    }
    let shape = [indices.len() / n_columns, n_columns];
    Ok((
        positions_array(py, &welded)?,
        PyArray1::from_vec(py, indices).reshape(shape)?,
        PyArray1::from_slice(py, weld.map()),
    ))
}

#[pyfunction]
pub fn _hash_rows(rows: &Bound<'_, PyAny>) -> PyResult<u64> {
    let rows = arrays::rows(rows, "rows", 4)?;
    Ok(impinge::hash_rows(rows.as_chunks().0.iter().copied()))
}
