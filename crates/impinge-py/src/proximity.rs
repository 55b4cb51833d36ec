//! `impinge.Distances`: how near two bodies are.

use impinge::proximity;
use numpy::PyArray2;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::errors::raise;
use crate::scene::Scene;
use crate::settings::unexpected;

/// The pair of primitives of two bodies that are nearest to each other.
#[pyclass(module = "impinge", frozen)]
pub struct Nearest {
    inner: proximity::Nearest,
}

impl From<proximity::Nearest> for Nearest {
    fn from(inner: proximity::Nearest) -> Self {
        Nearest { inner }
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

    /// tuple of two int : the primitive of the first body, and of the second; of several pairs at the same computed
    /// distance the lowest.
    #[getter]
    fn primitives(&self) -> (u32, u32) {
        self.inner.primitives.into()
    }

    /// numpy.ndarray of float64, shape (2, 3), or None : a point of each that is nearest to the other, rounded;
    /// ``None`` where they share points.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let rows = self.inner.points.map(|points| points.map(Vec::from));
        rows.map(|rows| Ok(PyArray2::from_vec2(py, &rows)?))
            .transpose()
    }

    fn __repr__(&self) -> String {
        let [a, b] = self.inner.primitives;
        format!("Nearest({:?}, primitives ({a}, {b}))", self.inner.distance)
    }
}

/// Finds the smallest distance of two bodies. Trees of the bodies are kept, so that later frames cost less.
///
/// Examples
/// --------
/// >>> import numpy as np, impinge
/// >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
/// >>> scene = impinge.Scene()
/// >>> a = scene.add(corners, [[0, 1, 2]])
/// >>> b = scene.add(corners + np.float32([0, 0, 3]), [[0, 1, 2]])
/// >>> impinge.Distances().between(scene, a, b).distance
/// 3.0
#[pyclass(module = "impinge")]
#[derive(Default)]
pub struct Distances {
    inner: proximity::Distances,
}

#[pymethods]
impl Distances {
    #[new]
    fn new() -> Self {
        Distances::default()
    }

    /// The smallest distance of two bodies and the pair of primitives that has it. Tetrahedra are solid.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    /// a, b : Body or int
    ///
    /// Returns
    /// -------
    /// Nearest or None
    ///     ``None`` where one of them has no primitive.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     A body that the scene does not have, twice the same body.
    /// RuntimeError
    ///     A scene or a `Distances` that is busy in another thread.
    fn between(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
    ) -> PyResult<Option<Nearest>> {
        let py = slf.py();
        let scene = scene
            .cast::<Scene>()
            .map_err(|_| unexpected(scene, "scene", "a Scene"))?;
        let mut distances = slf.try_borrow_mut().map_err(|_| {
            PyRuntimeError::new_err("these Distances are busy: give each thread ones of its own")
        })?;
        let scene = scene
            .try_borrow()
            .map_err(|_| PyRuntimeError::new_err("the scene is being changed by another thread"))?;
        let (a, b) = (scene.id(a, "a")?, scene.id(b, "b")?);
        let (inner, bodies) = (&mut distances.inner, &scene.inner);
        let nearest = py.detach(|| inner.between(bodies, a, b)).map_err(raise)?;
        Ok(nearest.map(Nearest::from))
    }
}
