//! What `impinge.SafeDistances` and `impinge.Neighbours` are made of.

use impinge::{Bounds, Csr, PairKind};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::bodies::body_id;
use crate::errors::invalid;
use crate::near::Near;
use crate::options::pair_kind;
use crate::settings::choose_one;
use crate::statistics;

/// What `impinge.SafeDistances` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct SafeDistances {
    inner: impinge::SafeDistances,
    scene: u64,
    /// What the touching pairs have besides.
    has: [bool; 2],
}

impl SafeDistances {
    pub fn new(inner: impinge::SafeDistances, scene: u64, has: [bool; 2]) -> Self {
        SafeDistances { inner, scene, has }
    }
}

#[pymethods]
impl SafeDistances {
    fn of<'py>(&self, py: Python<'py>, body: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let id = body_id(body, "body", self.scene, self.inner.bodies())?;
        match self.inner.of(id) {
            Some(Bounds::F32(bounds)) => Ok(PyArray1::from_slice(py, bounds).into_any()),
            Some(Bounds::F64(bounds)) => Ok(PyArray1::from_slice(py, bounds).into_any()),
            None => Err(invalid(format!(
                "body: body {id} was not in the scene when it was asked about"
            ))),
        }
    }

    fn touching(&self) -> Near {
        Near::new(self.inner.touching().clone(), self.has)
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        statistics::to_dict(py, self.inner.stats())
    }

    fn n_vertices(&self) -> usize {
        self.inner.n_vertices()
    }

    fn n_touching(&self) -> usize {
        self.inner.touching().len()
    }
}

/// What `impinge.Neighbours` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Neighbours {
    inner: impinge::Neighbours,
    scene: u64,
}

impl Neighbours {
    pub fn new(inner: impinge::Neighbours, scene: u64) -> Self {
        Neighbours { inner, scene }
    }
}

/// The offsets, indices and distances of lists.
type Lists<'py> = (
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f64>>,
);

#[pymethods]
impl Neighbours {
    /// The lists of a kind, or those of the elements that it names second.
    fn lists<'py>(
        &self,
        py: Python<'py>,
        kind: &Bound<'py, PyAny>,
        is_reversed: bool,
    ) -> PyResult<Lists<'py>> {
        let kind: PairKind = pair_kind(kind)?;
        let Csr {
            offsets,
            indices,
            distances,
            ..
        } = match is_reversed {
            true => self.inner.reversed(kind),
            false => self.inner.of(kind),
        };
        Ok((
            PyArray1::from_slice(py, offsets),
            PyArray1::from_slice(py, indices),
            PyArray1::from_slice(py, distances),
        ))
    }

    fn first(&self, body: &Bound<'_, PyAny>, part: &Bound<'_, PyAny>) -> PyResult<u32> {
        use impinge::Part::{Edges, Faces, Vertices};
        let parts = [("vertices", Vertices), ("edges", Edges), ("faces", Faces)];
        let part = choose_one(part, "part", &parts)?;
        let id = body_id(body, "body", self.scene, self.inner.bodies())?;
        self.inner.first(id, part).ok_or_else(|| {
            invalid(format!(
                "body: body {id} was not in the scene when it was asked about"
            ))
        })
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        statistics::to_dict(py, self.inner.stats())
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }
}
