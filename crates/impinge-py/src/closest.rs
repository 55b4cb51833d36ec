//! What `impinge.Closest` is made of: the elements nearest to points.

use impinge::ClosestElement;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::{collect, to_array};
use crate::near::number;
use crate::statistics;

/// What `impinge.Closest` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Closest {
    pub inner: impinge::Closest,
}

impl Closest {
    /// A value per point; `none` where nothing is near.
    fn column<T>(&self, none: T, value: impl Fn(ClosestElement) -> T) -> PyResult<Vec<T>>
    where
        T: Copy,
    {
        let values = self.inner.iter().map(|found| found.map_or(none, &value));
        collect(self.inner.len(), values)
    }
}

#[pymethods]
impl Closest {
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        to_array(py, collect(self.inner.len(), self.inner.rows())?)
    }

    fn distances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let distances = self.column(f64::INFINITY, |found| found.distance)?;
        Ok(PyArray1::from_vec(py, distances))
    }

    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = self.column([f64::NAN; 3], |found| found.point)?;
        PyArray1::from_vec(py, points.into_flattened()).reshape([self.inner.len(), 3])
    }

    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let features = self.column(u8::MAX, |found| number(found.feature))?;
        Ok(PyArray1::from_vec(py, features))
    }

    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.inner.hash())
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        statistics::to_dict(py, self.inner.stats())
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }
}
