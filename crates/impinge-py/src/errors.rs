//! The library's errors as Python exceptions that name the argument at fault.

use impinge::Error;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::number;

create_exception!(
    impinge,
    Cancelled,
    PyException,
    "A detection was stopped by its CancelToken. The detector stays usable."
);

create_exception!(
    impinge,
    TooManyPairs,
    PyException,
    "More pairs were found than `max_pairs` allows. The detector stays usable."
);

create_exception!(
    impinge,
    Seam,
    PyValueError,
    "Elements of one body touch at the start of a step at vertices that are at one position but not shared. Weld the mesh \
     (`weld`), or skip pairs that touch at the start."
);

/// What the arguments of the failing call are called.
#[derive(Clone, Copy)]
pub struct Names<'a> {
    /// The argument with positions.
    pub vertices: &'a str,
    /// The argument with vertex indices.
    pub elements: &'a str,
}

/// An error of a call that took no arrays.
pub fn raise(error: Error) -> PyErr {
    match error {
        Error::MemoryBudget { .. } | Error::OutOfMemory { .. } => {
            PyMemoryError::new_err(error.to_string())
        }
        Error::TooManyPairs { .. } => TooManyPairs::new_err(error.to_string()),
        Error::Seam { .. } => Seam::new_err(error.to_string()),
        Error::Cancelled => Cancelled::new_err("the detection was cancelled"),
        Error::NoAdapter { .. } | Error::Gpu { .. } | Error::Threads(_) => {
            PyRuntimeError::new_err(error.to_string())
        }
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// An error of a call that took arrays: positions are named by the index into the argument.
pub fn refuse(error: Error, names: Names<'_>) -> PyErr {
    let Names { vertices, elements } = names;
    let message = match &error {
        Error::NonFinitePosition { vertex, value, .. } => {
            let axis = value.iter().position(|x| !x.is_finite()).unwrap_or(0);
            let value = number(value[axis]);
            format!("{vertices}[{vertex}, {axis}] = {value}: a position must be finite")
        }
        Error::WrongNumberOfPositions {
            body,
            given,
            expected,
        } => {
            format!("{vertices}: {given} positions given, but body {body} has {expected} vertices")
        }
        Error::VertexIndexOutOfRange {
            primitive,
            index,
            n_vertices,
            ..
        } => format!(
            "{elements}[{primitive}] names vertex {index}, but {vertices} has {n_vertices} rows"
        ),
        _ => return raise(error),
    };
    PyValueError::new_err(message)
}
