//! What `impinge.Closest` is made of: the elements nearest to points.

use impinge::ClosestElement;
use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::collect;
use crate::near::number;
use crate::statistics;

/// What `impinge.Closest` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Closest {
    pub inner: impinge::Closest,
}

impl Closest {
    /// A value per point and element; `none` where nothing is near.
    fn column<T>(&self, none: T, value: impl Fn(ClosestElement) -> T) -> PyResult<Vec<T>>
    where
        T: Copy,
    {
        let values = self.inner.iter();
        collect(values.len(), values.map(|found| found.map_or(none, &value)))
    }

    /// As an array with one row per point; of several elements per point, one of these for each.
    fn shaped<'py, T: Element>(
        &self,
        py: Python<'py>,
        values: Vec<T>,
        n_columns: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
        let mut shape = vec![self.inner.len()];
        if self.inner.n_nearest() > 1 {
            shape.push(self.inner.n_nearest());
        }
        shape.extend(n_columns);
        PyArray1::from_vec(py, values).reshape(shape)
    }
}

#[pymethods]
impl Closest {
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<u32>>> {
        let rows = self.inner.rows();
        let rows = collect(rows.len(), rows)?;
        self.shaped(py, rows.into_flattened(), Some(2))
    }

    fn distances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let distances = self.column(f64::INFINITY, |found| found.distance)?;
        self.shaped(py, distances, None)
    }

    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.column([f64::NAN; 3], |found| found.point)?;
        self.shaped(py, points.into_flattened(), Some(3))
    }

    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let features = self.column(u8::MAX, |found| number(found.feature))?;
        self.shaped(py, features, None)
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
