//! `impinge.Result`: the pairs as arrays.

use std::sync::OnceLock;

use impinge::{BodyId, Pairs};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};

use crate::arrays::from_end;
use crate::bodies::{Body, body_id};
use crate::settings::{Argument, unexpected};
use crate::statistics::Statistics;

/// Which columns `pairs()` has.
#[derive(Clone, Copy)]
pub enum Asked {
    Between(BodyId, BodyId),
    Within(BodyId),
    Many,
}

/// The pairs that a detection found: sorted, the same bytes on every method, backend and thread
/// count.
///
/// ``len(result)`` is the number of pairs; a result without pairs is false. A result is a sequence of rows, each a tuple
/// of four int: number of a body, its primitive, number of the other body, its primitive. A slice of it is an array, and
/// so is ``numpy.asarray(result)``, which has shape (n, 4).
#[pyclass(module = "impinge", name = "Result", frozen)]
pub struct Answer {
    pairs: Pairs,
    scene: u64,
    asked: Asked,
    hash: OnceLock<u64>,
}

impl Answer {
    pub fn new(pairs: Pairs, scene: u64, asked: Asked) -> Self {
        Answer {
            pairs,
            scene,
            asked,
            hash: OnceLock::new(),
        }
    }

    /// The pairs, and the number of the scene that they belong to.
    pub fn parts(&self) -> (&Pairs, u64) {
        (&self.pairs, self.scene)
    }

    fn id(&self, argument: &Bound<'_, PyAny>, name: &str) -> PyResult<BodyId> {
        let known = || self.pairs.bodies().map(|(id, _)| id);
        let id = body_id(argument, name, self.scene, known())?;
        if known().any(|held| held == id) {
            Ok(id)
        } else {
            Err(PyValueError::new_err(format!(
                "{name}: body {id} took no part in this detection"
            )))
        }
    }

    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// A pair that there is.
    fn row(&self, ix: usize) -> (u32, u32, u32, u32) {
        let (a, b) = self.pairs.get(ix).expect("the index was checked");
        // Numbers of bodies fit 32 bits.
        (
            a.body.index() as u32,
            a.primitive,
            b.body.index() as u32,
            b.primitive,
        )
    }

    /// Keeps the pairs whose places in `keep` are true.
    pub fn retain(&mut self, keep: &[bool]) {
        let mut keep = keep.iter();
        self.pairs.retain(|_, _| keep.next() == Some(&true));
    }

    fn pairs_between(&self, a: BodyId, b: BodyId) -> PyResult<Vec<[u32; 2]>> {
        let n = self.pairs.between(a, b).count();
        let mut pairs = collect(n, self.pairs.between(a, b).map(Into::into))?;
        // They are held in the order of the body with the lower number.
        if b < a {
            pairs.sort_unstable();
        }
        Ok(pairs)
    }

    fn pairs_within(&self, body: BodyId) -> PyResult<Vec<[u32; 2]>> {
        let n = self.pairs.within(body).count();
        collect(n, self.pairs.within(body).map(Into::into))
    }
}

/// Rows in a list, or a `MemoryError`.
pub fn collect<T>(n: usize, rows: impl Iterator<Item = T>) -> PyResult<Vec<T>> {
    let mut list = Vec::new();
    list.try_reserve_exact(n).map_err(|_| {
        let bytes = size_of::<T>() * n;
        PyMemoryError::new_err(format!("an array of {n} pairs needs {bytes} bytes"))
    })?;
    list.extend(rows);
    Ok(list)
}

/// An `(n, N)` array that owns its rows.
pub fn to_array<const N: usize>(
    py: Python<'_>,
    rows: Vec<[u32; N]>,
) -> PyResult<Bound<'_, PyArray2<u32>>> {
    let shape = [rows.len(), N];
    PyArray1::from_vec(py, rows.into_flattened()).reshape(shape)
}

#[pymethods]
impl Answer {
    /// The pairs of a question about two bodies or about one.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of uint32, shape (n, 2)
    ///     Sorted. ``between=(a, b)``: primitives of `a` and of `b`. ``within=a``: both of `a`,
    ///     the lower one first.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The question was about all bodies: see `rows`, `between` and `within`.
    pub fn pairs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let pairs = match self.asked {
            Asked::Between(a, b) => py.detach(|| self.pairs_between(a, b))?,
            Asked::Within(body) => py.detach(|| self.pairs_within(body))?,
            Asked::Many => {
                return Err(PyValueError::new_err(
                    "the question was about all bodies: take rows, between(a, b) or within(a)",
                ));
            }
        };
        to_array(py, pairs)
    }

    /// The pairs of two bodies.
    ///
    /// Parameters
    /// ----------
    /// a, b : Body or int
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of uint32, shape (n, 2)
    ///     Primitive of `a`, primitive of `b`; sorted.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A body that took no part, or one named twice.
    fn between<'py>(
        &self,
        py: Python<'py>,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let (a, b) = (self.id(a, "a")?, self.id(b, "b")?);
        if a == b {
            return Err(PyValueError::new_err(format!(
                "a and b are both body {a}: take within({a})"
            )));
        }
        to_array(py, py.detach(|| self.pairs_between(a, b))?)
    }

    /// The pairs of primitives of one body.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of uint32, shape (n, 2)
    ///     The lower primitive first; sorted.
    fn within<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let body = self.id(body, "body")?;
        to_array(py, py.detach(|| self.pairs_within(body))?)
    }

    /// numpy.ndarray of uint32, shape (n, 4) : all pairs, sorted, one per row: number of a body,
    /// its primitive, number of the other body, its primitive. A new array at each access.
    #[getter]
    pub fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = py.detach(|| collect(self.pairs.len(), self.pairs.rows()))?;
        to_array(py, rows)
    }

    /// The primitives that take part in any pair, for colouring: of a body, or of all bodies in one pass.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int, optional
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of uint32, shape (n,)
    ///     Sorted, each once. Without a body, a dict with such an array for each Body that has any, in order; it is
    ///     indexed by the numbers of bodies, too.
    #[pyo3(signature = (body=None))]
    fn colliding<'py>(
        &self,
        py: Python<'py>,
        body: Argument<'py, 'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let Some(body) = body else {
            let all = PyDict::new(py);
            for (id, colliding) in py.detach(|| self.pairs.all_colliding()) {
                let scene = self.scene;
                all.set_item(Body { id, scene }, PyArray1::from_vec(py, colliding))?;
            }
            return Ok(all.into_any());
        };
        let body = self.id(body, "body")?;
        let colliding = py.detach(|| self.pairs.colliding(body));
        Ok(PyArray1::from_vec(py, colliding).into_any())
    }

    /// list of Body : the bodies that took part, in order.
    #[getter]
    fn bodies(&self) -> Vec<Body> {
        let scene = self.scene;
        self.pairs
            .bodies()
            .map(|(id, _)| Body { id, scene })
            .collect()
    }

    /// int : a 64-bit hash of the set of pairs; equal sets have equal hashes everywhere.
    #[getter]
    fn hash(&self, py: Python<'_>) -> u64 {
        *self.hash.get_or_init(|| py.detach(|| self.pairs.hash()))
    }

    /// Statistics : what the detection cost.
    #[getter]
    fn stats(&self) -> Statistics {
        Statistics {
            inner: self.pairs.stats().clone(),
        }
    }

    fn __len__(&self) -> usize {
        self.len()
    }

    fn __getitem__<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if index.is_instance_of::<PySlice>() {
            return self.rows(py)?.get_item(index);
        }
        let index = index
            .extract()
            .map_err(|_| unexpected(index, "index", "a whole number or a slice"))?;
        let ix = from_end(index, self.pairs.len(), "pairs")?;
        Ok(self.row(ix).into_pyobject(py)?.into_any())
    }

    fn __iter__(slf: PyRef<'_, Self>) -> RowIterator {
        RowIterator {
            answer: slf.into(),
            next: 0,
        }
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Argument<'py, 'py>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if copy == Some(false) {
            return Err(PyValueError::new_err(
                "copy=False: the rows are made when they are asked for",
            ));
        }
        let rows = self.rows(py)?.into_any();
        match dtype {
            Some(dtype) => rows.call_method1("astype", (dtype,)),
            None => Ok(rows),
        }
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a Result names the bodies of a live scene: pickle result.rows",
        ))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!(
            "Result({} pairs of {} bodies, hash {:#018x})",
            self.pairs.len(),
            self.pairs.bodies().len(),
            self.hash(py)
        )
    }
}

/// Rows one after the other.
#[pyclass]
pub struct RowIterator {
    answer: Py<Answer>,
    next: usize,
}

#[pymethods]
impl RowIterator {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&mut self) -> Option<(u32, u32, u32, u32)> {
        let answer = self.answer.get();
        let row = (self.next < answer.pairs.len()).then(|| answer.row(self.next));
        self.next += 1;
        row
    }
}
