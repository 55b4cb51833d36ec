//! What `impinge.Hits` is made of: what rays hit.

use impinge::{Hit, RayHit};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::{collect, to_array};
use crate::errors::invalid;
use crate::near::number;
use crate::statistics;

/// What `impinge.Hits` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Hits {
    pub inner: impinge::Hits,
    pub hits: Hit,
}

impl Hits {
    /// A value per ray if the first hits were asked for, `none` where there is none; else a value
    /// per hit.
    fn column<T: Copy>(&self, none: T, value: impl Fn(&RayHit) -> T) -> PyResult<Vec<T>> {
        match self.hits {
            Hit::First => {
                let firsts = (0..self.inner.len()).map(|ray| self.inner.of(ray).first());
                collect(self.inner.len(), firsts.map(|hit| hit.map_or(none, &value)))
            }
            Hit::All => {
                let all = self.inner.iter();
                collect(all.len(), all.map(value))
            }
            _ => Err(invalid(
                "hits: \"any\" given, which says of each ray only whether it hits: ask for \"first\" or \"all\"",
            )),
        }
    }
}

#[pymethods]
impl Hits {
    fn hit<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, self.inner.is_hit())
    }

    fn offsets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let offsets = self.inner.offsets();
        let offsets = collect(offsets.len(), offsets.iter().map(|&ix| ix as u64))?;
        Ok(PyArray1::from_vec(py, offsets))
    }

    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.column([u32::MAX; 2], |hit| {
            [hit.element.body.index() as u32, hit.element.element]
        })?;
        to_array(py, rows)
    }

    fn t<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(
            py,
            self.column(f64::INFINITY, |hit| hit.t)?,
        ))
    }

    fn t_end<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(
            py,
            self.column(f64::INFINITY, |hit| hit.t_end)?,
        ))
    }

    fn barycentrics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let weights = self.column([f64::NAN; 3], |hit| hit.barycentrics)?;
        let shape = [weights.len(), 3];
        PyArray1::from_vec(py, weights.into_flattened()).reshape(shape)
    }

    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let features = self.column(u8::MAX, |hit| number(hit.feature))?;
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
