//! Handles of bodies: numbers that also know their scene and generation.

use std::sync::atomic::{AtomicU64, Ordering};

use impinge::BodyId;
use pyo3::basic::CompareOp;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::errors::invalid;

use crate::settings::unexpected;

/// A handle of a body in a scene; what `Scene.add` returns.
///
/// It stands for the body's number wherever an integer is taken (`int(body)`, `array[body]`) and
/// equals it; the first column of `Result.rows` holds these numbers. After the body was removed
/// the handle is refused, even if a later body has taken over the number.
#[pyclass(module = "impinge", frozen, from_py_object)]
#[derive(Clone, Copy)]
pub struct Body {
    pub id: BodyId,
    /// Which scene it belongs to, or a copy of that scene's answers.
    pub scene: u64,
}

#[pymethods]
impl Body {
    /// int : the body's number in its scene.
    #[getter]
    fn index(&self) -> usize {
        self.id.index()
    }

    fn __index__(&self) -> usize {
        self.id.index()
    }

    fn __int__(&self) -> usize {
        self.id.index()
    }

    fn __hash__(&self) -> isize {
        // Python's hash of a small integer is the integer; a slot number is at most 32 bits.
        self.id.index() as isize
    }

    fn __richcmp__(&self, other: &Bound<'_, PyAny>, op: CompareOp) -> PyResult<Py<PyAny>> {
        let py = other.py();
        let ordering = if let Ok(other) = other.cast::<Body>() {
            let other = other.get();
            (self.scene, self.id).cmp(&(other.scene, other.id))
        } else if let Ok(index) = other.extract::<i64>() {
            (self.id.index() as i64).cmp(&index)
        } else {
            return Ok(py.NotImplemented());
        };
        let answer = op.matches(ordering);
        Ok(PyBool::new(py, answer).to_owned().into_any().unbind())
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a Body is a handle of a live scene: pickle its number, int(body)",
        ))
    }

    fn __repr__(&self) -> String {
        format!("Body({})", self.id.index())
    }
}

/// A number for each scene of the process, so that a handle of one is not taken for another's.
pub fn new_scene_number() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// The body that an argument names: a handle, or the number of one of the `known` bodies.
pub fn body_id(
    argument: &Bound<'_, PyAny>,
    name: &str,
    scene: u64,
    known: impl IntoIterator<Item = BodyId>,
) -> PyResult<BodyId> {
    if let Ok(body) = argument.cast::<Body>() {
        let body = body.get();
        if body.scene != scene {
            return Err(invalid(format!(
                "{name}: body {} belongs to another scene",
                body.id
            )));
        }
        return Ok(body.id);
    }
    if argument.is_instance_of::<PyBool>() {
        return Err(not_a_body(argument, name));
    }
    let index: i64 = argument.extract().map_err(|_| not_a_body(argument, name))?;
    known
        .into_iter()
        .find(|id| usize::try_from(index) == Ok(id.index()))
        .ok_or_else(|| invalid(format!("{name}: there is no body {index}")))
}

fn not_a_body(argument: &Bound<'_, PyAny>, name: &str) -> PyErr {
    unexpected(argument, name, "a Body or its number")
}
