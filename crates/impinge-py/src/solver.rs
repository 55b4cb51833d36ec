//! What `impinge.SafeDistances` and `impinge.Neighbours` are made of.

use impinge::{Bounds, Csr, PairKind};
use numpy::{
    Element, PyArray1, PyArrayMethods, PyReadwriteArray1, PyUntypedArray, PyUntypedArrayMethods,
};
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

    /// The lists of a kind, or those of the elements that it names second.
    fn lists(&self, kind: &Bound<'_, PyAny>, is_reversed: bool) -> PyResult<&Csr> {
        let kind: PairKind = pair_kind(kind)?;
        Ok(match is_reversed {
            true => self.inner.reversed(kind),
            false => self.inner.of(kind),
        })
    }
}

/// A caller's array, to be written, that has room for so many numbers.
fn room<'py, T: Element>(
    array: &Bound<'py, PyAny>,
    name: &str,
    types: &str,
    n: usize,
) -> PyResult<PyReadwriteArray1<'py, T>> {
    let refused = |what: String| invalid(format!("out.{name}: {what}"));
    let Ok(array) = array.cast::<PyArray1<T>>() else {
        let given = match array.cast::<PyUntypedArray>() {
            Ok(array) => format!("{} dimensions of {}", array.ndim(), array.dtype()),
            Err(_) => array.get_type().to_string(),
        };
        let allowed = format!("an array of {types} with 1 dimension");
        return Err(refused(format!("{given} given, {allowed} allowed")));
    };
    let array = array.try_readwrite();
    let mut array = array.map_err(|error| refused(error.to_string()))?;
    match array.as_slice_mut() {
        Ok(numbers) if numbers.len() >= n => Ok(array),
        Ok(numbers) => {
            let given = numbers.len();
            Err(refused(format!(
                "room for {given} numbers given, {n} needed"
            )))
        }
        Err(_) => Err(refused(
            "an array with gaps given, one without allowed".to_owned(),
        )),
    }
}

#[pymethods]
impl Neighbours {
    /// How many offsets and how many indices lists have.
    fn sizes(&self, kind: &Bound<'_, PyAny>, is_reversed: bool) -> PyResult<(usize, usize)> {
        let lists = self.lists(kind, is_reversed)?;
        Ok((lists.offsets.len(), lists.indices.len()))
    }

    /// Copies lists to the starts of arrays: nothing if one of them does not fit.
    fn fill(
        &self,
        kind: &Bound<'_, PyAny>,
        is_reversed: bool,
        offsets: &Bound<'_, PyAny>,
        indices: &Bound<'_, PyAny>,
        distances: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let lists = self.lists(kind, is_reversed)?;
        let (n_offsets, n) = (lists.offsets.len(), lists.indices.len());
        let mut offsets = room::<u64>(offsets, "offsets", "uint64", n_offsets)?;
        let mut indices = room::<u32>(indices, "indices", "uint32", n)?;
        if distances.cast::<PyArray1<f32>>().is_ok() {
            let mut distances = room::<f32>(distances, "distances", "float32", n)?;
            let room = distances.as_slice_mut()?;
            room.iter_mut()
                .zip(lists.distances_f32())
                .for_each(|(to, distance)| *to = distance);
        } else {
            let mut distances = room::<f64>(distances, "distances", "float64 or float32", n)?;
            distances.as_slice_mut()?[..n].copy_from_slice(&lists.distances);
        }
        offsets.as_slice_mut()?[..n_offsets].copy_from_slice(&lists.offsets);
        indices.as_slice_mut()?[..n].copy_from_slice(&lists.indices);
        Ok(())
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
