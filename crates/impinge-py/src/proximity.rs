//! `impinge.Nearest`: how near two bodies are.

use impinge::proximity;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::bodies::Body;

/// The pair of primitives of two bodies that are nearest to each other.
#[pyclass(module = "impinge", frozen)]
pub struct Nearest {
    inner: proximity::Nearest,
    /// The number of the scene.
    scene: u64,
}

impl Nearest {
    pub fn new(inner: proximity::Nearest, scene: u64) -> Self {
        Nearest { inner, scene }
    }
}

#[pymethods]
impl Nearest {
    /// float : their distance in the unit of the scene. 0 if and only if they share a point, which is decided
    /// exactly; else rounded, with an error of a few units in the last place of the largest coordinate.
    #[getter]
    fn distance(&self) -> f64 {
        self.inner.distance
    }

    /// tuple of two Body : the bodies as they were asked for; of many, the nearest two, the lower number first.
    #[getter]
    fn bodies(&self) -> (Body, Body) {
        let scene = self.scene;
        let [a, b] = self.inner.bodies.map(|id| Body { id, scene });
        (a, b)
    }

    /// tuple of two int : the primitive of the first body, and of the second; of several pairs at the same computed
    /// distance the lowest.
    #[getter]
    fn primitives(&self) -> (u32, u32) {
        self.inner.primitives.into()
    }

    /// numpy.ndarray of float64, shape (2, 3) : a point of each that is nearest to the other, rounded; where they touch, a point
    /// that they share, twice.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(PyArray2::from_vec2(py, &self.inner.points.map(Vec::from))?)
    }

    fn __repr__(&self) -> String {
        let [a, b] = self.inner.primitives;
        format!("Nearest({:?}, primitives ({a}, {b}))", self.inner.distance)
    }
}
