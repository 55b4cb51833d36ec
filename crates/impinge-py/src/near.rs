//! `impinge.NearPairs`: elements within a distance of each other.

use impinge::exact::Feature;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::columns;
use crate::result::collect;
use crate::scene::Scene;
use crate::settings::{Argument, unexpected};
use crate::statistics::Statistics;

/// All pairs of elements that are within the distance that was asked for, sorted by kind, then by bodies and
/// elements. The same bytes on every method and thread count.
///
/// ``len(near)`` is their number. The attributes below are arrays with one row per pair. Each access makes new
/// arrays.
#[pyclass(module = "impinge", frozen)]
pub struct NearPairs {
    inner: impinge::NearPairs,
    has_closest: bool,
}

impl NearPairs {
    pub fn new(inner: impinge::NearPairs, has_closest: bool) -> Self {
        NearPairs { inner, has_closest }
    }

    /// Refuses to speak of distances that were not asked for.
    fn check_closest(&self) -> PyResult<()> {
        match self.has_closest {
            true => Ok(()),
            false => Err(PyValueError::new_err(
                "distances and points were not asked for: pass closest_points=True",
            )),
        }
    }
}

#[pymethods]
impl NearPairs {
    /// numpy.ndarray of str, shape (n,) : ``"vf"`` (a vertex and a face), ``"ee"`` (two edges), ``"ev"`` (an edge
    /// and a vertex), ``"vv"`` (two vertices), ``"ef"`` (an edge and a face) or ``"ff"`` (two faces).
    #[getter]
    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let kinds = self.inner.iter().map(|pair| pair.kind);
        columns::kinds(py, self.inner.len(), kinds)
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two bodies.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.inner.iter().map(|pair| pair.row());
        columns::bodies(py, self.inner.len(), rows)
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two elements in their bodies, as those of
    /// `Impacts.elements`.
    #[getter]
    fn elements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.inner.iter().map(|pair| pair.row());
        columns::elements(py, self.inner.len(), rows)
    }

    /// numpy.ndarray of str, shape (n,) : which features are nearest, with ipc-toolkit's names: ``"P_T"``,
    /// ``"P_E0"``, ``"P_T0"``, ``"EA_EB"``, ``"EA_EB0"``, ``"EA0_EB0"``, …; of an edge and a face, and of two
    /// faces, without numbers. Decided exactly.
    #[getter]
    fn types<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let names = self.inner.iter().map(|pair| pair.name());
        columns::strings::<7>(py, self.inner.len(), names)
    }

    /// numpy.ndarray of str, shape (n, 2) : the nearest feature of either element: ``"v0"`` to ``"v2"``, ``"e0"``
    /// to ``"e2"`` (edge k goes from vertex k to the next) or ``"f"``.
    #[getter]
    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let names = self
            .inner
            .iter()
            .flat_map(|pair| pair.features.map(feature));
        columns::strings::<2>(py, 2 * self.inner.len(), names)?.call_method1("reshape", ((-1, 2),))
    }

    /// numpy.ndarray of bool, shape (n,) : where nearest points may not be the only ones.
    #[getter]
    fn parallel<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let flags = self.inner.iter().map(|pair| pair.is_parallel);
        Ok(PyArray1::from_vec(py, collect(self.inner.len(), flags)?))
    }

    /// numpy.ndarray of float64, shape (n,) : distances, rounded; the same bits on every machine. Only after
    /// ``closest_points=True``.
    #[getter]
    fn distances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.check_closest()?;
        let closest = self.inner.iter().filter_map(|pair| pair.closest);
        let distances = closest.map(|closest| closest.distance);
        Ok(PyArray1::from_vec(
            py,
            collect(self.inner.len(), distances)?,
        ))
    }

    /// numpy.ndarray of float64, shape (n, 2, 3) : a nearest point of either element, rounded. Only after
    /// ``closest_points=True``.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        self.check_closest()?;
        let closest = self.inner.iter().filter_map(|pair| pair.closest);
        let points = collect(self.inner.len(), closest.map(|closest| closest.points))?;
        let flat = points.into_flattened().into_flattened();
        PyArray1::from_vec(py, flat).reshape([self.inner.len(), 2, 3])
    }

    /// int : a 64-bit hash of the set of pairs and their features; equal sets have equal hashes everywhere.
    #[getter]
    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.inner.hash())
    }

    /// Statistics : what the answer cost.
    #[getter]
    fn stats(&self) -> Statistics {
        Statistics {
            inner: self.inner.stats().clone(),
        }
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        columns::counted("NearPairs", |kind| self.inner.of(kind).len())
    }
}

fn feature(feature: Feature) -> &'static str {
    match feature {
        Feature::Vertex(ix) => ["v0", "v1", "v2"][usize::from(ix) % 3],
        Feature::Edge(ix) => ["e0", "e1", "e2"][usize::from(ix) % 3],
        Feature::Face => "f",
    }
}

/// The thickness of bodies, from a dictionary.
pub fn thickness(
    scene: &Scene,
    argument: Argument<'_, '_>,
) -> PyResult<Vec<(impinge::BodyId, f64)>> {
    let Some(argument) = argument else {
        return Ok(Vec::new());
    };
    let expected = "a dictionary of bodies and numbers";
    let map = argument
        .cast::<PyDict>()
        .map_err(|_| unexpected(argument, "thickness", expected))?;
    map.iter()
        .map(|(body, number)| {
            let id = scene.id(&body, "thickness")?;
            let number = number.extract().map_err(|error: PyErr| {
                match error.is_instance_of::<PyTypeError>(argument.py()) {
                    true => unexpected(&number, "thickness", "a number"),
                    false => error,
                }
            })?;
            Ok((id, number))
        })
        .collect()
}
