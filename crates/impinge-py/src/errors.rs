//! The library's errors as Python exceptions that name the argument at fault.

use impinge::Error;
use pyo3::import_exception;
use pyo3::prelude::*;

import_exception!(impinge._errors, Budget);
import_exception!(impinge._errors, Cancelled);
import_exception!(impinge._errors, DeviceError);
import_exception!(impinge._errors, InternalError);
import_exception!(impinge._errors, InvalidError);
import_exception!(impinge._errors, OutOfMemory);
import_exception!(impinge._errors, Seam);
import_exception!(impinge._errors, TooManyPairs);

/// An argument, or a state of a scene, that no question can be answered with.
pub fn invalid(message: impl Into<String>) -> PyErr {
    InvalidError::new_err(message.into())
}

/// What the arguments of the failing call are called.
#[derive(Clone, Copy)]
pub struct Names<'a> {
    /// The argument with positions.
    pub vertices: &'a str,
    /// The argument with vertex indices.
    pub elements: &'a str,
    /// The argument that says what rows of these are.
    pub kind: &'a str,
}

/// An error of a call that took no arrays.
pub fn raise(error: Error) -> PyErr {
    let message = error.to_string();
    raise_as(error, message)
}

/// The same with another message.
pub fn raise_as(error: Error, message: String) -> PyErr {
    match error {
        Error::MemoryBudget { .. } => Budget::new_err(message),
        Error::OutOfMemory { .. } => OutOfMemory::new_err(message),
        Error::TooManyPairs { .. } => TooManyPairs::new_err(message),
        Error::Seam { .. } => Seam::new_err(message),
        Error::Cancelled => Cancelled::new_err("the detection was cancelled"),
        Error::NoAdapter { .. } | Error::Gpu { .. } => DeviceError::new_err(message),
        Error::Threads(_) => InternalError::new_err(message),
        Error::NonFinitePoint { what, row, value } => {
            let axis = value.iter().position(|x| !x.is_finite()).unwrap_or(0);
            let value = number(value[axis]);
            InvalidError::new_err(format!("{what}[{row}, {axis}] = {value}: must be finite"))
        }
        _ => InvalidError::new_err(message),
    }
}

/// An error of a call that took arrays: positions are named by the index into the argument.
pub fn refuse(error: Error, names: Names<'_>) -> PyErr {
    let Names {
        vertices, elements, ..
    } = names;
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
            element,
            index,
            n_vertices,
            ..
        } => format!(
            "{elements}[{element}] names vertex {index}, but {vertices} has {n_vertices} rows"
        ),
        _ => return raise(error),
    };
    invalid(message)
}

/// A float as Python writes it.
pub fn number(x: f64) -> String {
    if x.is_nan() {
        "nan".into()
    } else {
        format!("{x:?}")
    }
}
