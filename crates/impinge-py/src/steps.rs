//! `impinge.Impacts`, `Impact`, `Advance` and `Candidates`: the answers about a step.

use std::sync::{Arc, Mutex, PoisonError};

use impinge::{PairKind, Primitive};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::arrays::{from_end, positions_array};
use crate::bodies::Body;
use crate::columns;
use crate::errors::raise;
use crate::result::{collect, to_array};
use crate::scene::Scene;
use crate::settings::{Argument, choose_one, unexpected};
use crate::statistics::Statistics;

/// Two elements that touch during a step, and when first.
#[pyclass(module = "impinge", frozen, from_py_object)]
#[derive(Clone)]
pub struct Impact {
    inner: impinge::Impact,
    scene: u64,
}

impl Impact {
    pub fn new(inner: impinge::Impact, scene: u64) -> Self {
        Impact { inner, scene }
    }
}

#[pymethods]
impl Impact {
    /// str : ``"vf"`` (a vertex and a face), ``"ee"`` (two edges), ``"ev"`` (an edge and a vertex) or
    /// ``"vv"`` (two vertices).
    #[getter]
    fn kind(&self) -> &'static str {
        self.inner.kind.name()
    }

    /// tuple of two Body : whose elements they are. The first is that of the element which `kind` names first.
    #[getter]
    fn bodies(&self) -> (Body, Body) {
        let scene = self.scene;
        let body = |of: Primitive| Body { id: of.body, scene };
        (body(self.inner.a), body(self.inner.b))
    }

    /// tuple of two int : the numbers of the elements in their bodies; `Scene.elements` has their vertices.
    #[getter]
    fn elements(&self) -> (u32, u32) {
        (self.inner.a.primitive, self.inner.b.primitive)
    }

    /// float : the first time in [0, 1] at which they touch, rounded down.
    #[getter]
    fn toi(&self) -> f64 {
        self.inner.toi
    }

    /// bool : whether they touch at the start, at time 0.
    #[getter]
    fn at_start(&self) -> bool {
        self.inner.at_start
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        let other = other.cast::<Impact>();
        other.is_ok_and(|other| {
            let other = other.get();
            self.scene == other.scene && self.inner == other.inner
        })
    }

    fn __hash__(&self) -> u64 {
        let [body_a, a, body_b, b] = self.inner.row().map(u64::from);
        (a << 32 | b) ^ (body_a << 48 | body_b << 16) ^ self.inner.toi.to_bits()
    }

    fn __repr__(&self) -> String {
        let impinge::Impact {
            kind, a, b, toi, ..
        } = self.inner;
        format!(
            "Impact({:?}, {} of body {} and {} of body {}, toi={toi:?})",
            kind.name(),
            a.primitive,
            a.body,
            b.primitive,
            b.body
        )
    }
}

/// All pairs of elements that touch during a step, sorted by kind, then by bodies and elements. The same
/// bytes on every method and thread count.
///
/// ``len(impacts)`` is their number; impacts of a free step are false. They are indexed and iterated as
/// `Impact`, and taken as arrays by the attributes below, one row per impact. Each access makes new arrays.
#[pyclass(module = "impinge", frozen)]
pub struct Impacts {
    inner: Arc<impinge::Impacts>,
    /// The only kind, if this is a part.
    kind: Option<PairKind>,
    scene: u64,
    /// Whether times are double precision.
    is_double: bool,
}

impl Impacts {
    pub fn new(inner: impinge::Impacts, scene: u64, is_double: bool) -> Self {
        Impacts {
            inner: Arc::new(inner),
            kind: None,
            scene,
            is_double,
        }
    }

    fn slice(&self) -> &[impinge::Impact] {
        match self.kind {
            Some(kind) => self.inner.of(kind),
            None => self.inner.as_slice(),
        }
    }
}

#[pymethods]
impl Impacts {
    /// numpy.ndarray of uint32, shape (n, 4) : number of a body, its element, number of the other body, its element; see
    /// `elements`.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.slice().iter().map(impinge::Impact::row);
        to_array(py, collect(self.slice().len(), rows)?)
    }

    /// numpy.ndarray of uint8, shape (n,) : what they are, as an index of `impinge.KINDS`: ``"vf"``, ``"ee"``, ``"ev"`` or
    /// ``"vv"``.
    #[getter]
    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let kinds = self.slice().iter().map(|impact| impact.kind);
        columns::kinds(py, self.slice().len(), kinds)
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two bodies.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.slice().iter().map(impinge::Impact::row);
        columns::bodies(py, self.slice().len(), rows)
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two elements in their bodies.
    ///
    /// A vertex is numbered as positions are, a face as it was given (of tetrahedra: as
    /// ``Scene.elements(body, "faces")``), an edge as ``Scene.elements(body, "edges")``. Of ``"vf"`` the
    /// vertex is in the first column, of ``"ev"`` the edge.
    #[getter]
    fn elements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.slice().iter().map(impinge::Impact::row);
        columns::elements(py, self.slice().len(), rows)
    }

    /// numpy.ndarray of float32, or float64 after ``toi="f64"``, shape (n,) : first times in [0, 1], each
    /// rounded down.
    #[getter]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "they were rounded to f32 before"
    )]
    fn toi<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let n = self.slice().len();
        let times = self.slice().iter().map(|impact| impact.toi);
        Ok(match self.is_double {
            true => PyArray1::from_vec(py, collect(n, times)?).into_any(),
            false => {
                let times = times.map(|toi| toi as f32);
                PyArray1::from_vec(py, collect(n, times)?).into_any()
            }
        })
    }

    /// numpy.ndarray of bool, shape (n,) : which touch at the start, at time 0.
    #[getter]
    fn at_start<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let at_start = self.slice().iter().map(|impact| impact.at_start);
        Ok(PyArray1::from_vec(
            py,
            collect(self.slice().len(), at_start)?,
        ))
    }

    /// bool or None : whether elements intersect at the start of the step; ``None`` if nobody asked, which only
    /// ``start="verify"`` does.
    #[getter]
    fn start_intersects(&self) -> Option<bool> {
        self.inner.start_intersects()
    }

    /// Those of one kind.
    ///
    /// Parameters
    /// ----------
    /// kind : {"vf", "ee", "ev", "vv", "ef", "ff"}
    ///
    /// Returns
    /// -------
    /// Impacts
    ///     Of the same answer: nothing is copied.
    fn of(&self, kind: &Bound<'_, PyAny>) -> PyResult<Impacts> {
        let kind = choose_one(kind, "kind", &PairKind::ALL.map(|kind| (kind.name(), kind)))?;
        // Of a part of another kind nothing is left.
        let inner = match self.kind {
            Some(own) if own != kind => Arc::default(),
            _ => Arc::clone(&self.inner),
        };
        Ok(Impacts {
            inner,
            kind: Some(kind),
            ..*self
        })
    }

    /// The impact with the least time; of several, the first row.
    ///
    /// Returns
    /// -------
    /// Impact or None
    ///     ``None`` where nothing touches.
    fn earliest(&self) -> Option<Impact> {
        let all = self.slice().iter().copied();
        let earliest = all.reduce(|best, other| if other.toi < best.toi { other } else { best });
        earliest.map(|impact| Impact::new(impact, self.scene))
    }

    /// int : a 64-bit hash of the set of impacts, times included; equal sets have equal hashes everywhere.
    #[getter]
    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| {
            let rows = self.slice().iter();
            impinge::hash_impact_rows(rows.map(|impact| (impact.kind, impact.row(), impact.toi)))
        })
    }

    /// Statistics : what the answer cost.
    #[getter]
    fn stats(&self) -> Statistics {
        Statistics {
            inner: self.inner.stats().clone(),
        }
    }

    fn __len__(&self) -> usize {
        self.slice().len()
    }

    fn __getitem__(&self, index: isize) -> PyResult<Impact> {
        let ix = from_end(index, self.slice().len(), "impacts")?;
        Ok(Impact::new(self.slice()[ix], self.scene))
    }

    fn __iter__(slf: PyRef<'_, Self>) -> ImpactIterator {
        ImpactIterator {
            impacts: slf.into(),
            next: 0,
        }
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "Impacts name bodies of a live scene: pickle their arrays",
        ))
    }

    fn __repr__(&self) -> String {
        match self.earliest() {
            None if self.inner.start_intersects() == Some(true) => {
                "Impacts(0, the start intersects)".into()
            }
            None => "Impacts(0, nothing touches)".into(),
            Some(first) => format!(
                "Impacts({}, the first at {:?})",
                self.__len__(),
                first.inner.toi
            ),
        }
    }
}

/// Impacts one after the other.
#[pyclass]
pub struct ImpactIterator {
    impacts: Py<Impacts>,
    next: usize,
}

#[pymethods]
impl ImpactIterator {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&mut self) -> Option<Impact> {
        let impacts = self.impacts.get();
        let impact = *impacts.slice().get(self.next)?;
        self.next += 1;
        Some(Impact::new(impact, impacts.scene))
    }
}

/// How far a step can be taken, and where vertices are then.
#[pyclass(module = "impinge", frozen)]
pub struct Advance {
    inner: impinge::Advance,
    scene: u64,
}

impl Advance {
    pub fn new(inner: impinge::Advance, scene: u64) -> Self {
        Advance { inner, scene }
    }
}

#[pymethods]
impl Advance {
    /// float : the part of the step that can be taken: 1 for all of it, 0 for none. With a clearance it holds for all smaller
    /// parts, and for positions that you compute (see `Detector.advance`).
    #[getter]
    fn fraction(&self) -> f64 {
        self.inner.fraction
    }

    /// bool or None : whether elements intersect at the start, so that no part of the step can be taken; ``None`` if nobody
    /// asked, which only ``start="verify"`` does.
    #[getter]
    fn start_intersects(&self) -> Option<bool> {
        self.inner.start_intersects
    }

    /// Impact or None : the first contact of the whole step, its time rounded down to float64; ``None`` where
    /// nothing touches.
    #[getter]
    fn first(&self) -> Option<Impact> {
        let first = self.inner.first;
        first.map(|impact| Impact::new(impact, self.scene))
    }

    /// int : how many fractions were tried.
    #[getter]
    fn n_tried(&self) -> u32 {
        self.inner.n_tried
    }

    /// list of (Body, numpy.ndarray of shape (v, 3)) : where the vertices of all bodies that move are then,
    /// rounded to the precision in which they are held. The straight way from the start to these rounded
    /// positions is free, if the start was free of intersections, and but for what touches at the start.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Vec<(Body, Bound<'py, PyAny>)>> {
        let scene = self.scene;
        let positions = self.inner.positions.iter();
        positions
            .map(|(id, positions)| Ok((Body { id: *id, scene }, positions_array(py, positions)?)))
            .collect()
    }

    /// Takes the step: these positions become those of the scene, and its bodies stand still until they are
    /// given end positions again.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    ///     The scene that was asked about.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A body that is gone, or that has another number of vertices now.
    fn apply(&self, scene: &Bound<'_, PyAny>) -> PyResult<()> {
        let scene = scene
            .cast::<Scene>()
            .map_err(|_| unexpected(scene, "scene", "a Scene"))?;
        let mut scene = scene.try_borrow_mut().map_err(|_| {
            PyRuntimeError::new_err("the scene is being read by a detection: wait for it to end")
        })?;
        self.inner.apply(&mut scene.inner).map_err(raise)
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "an Advance names bodies of a live scene: pickle its arrays",
        ))
    }

    fn __repr__(&self) -> String {
        format!(
            "Advance(fraction={:?}, {} bodies)",
            self.inner.fraction,
            self.inner.positions.len()
        )
    }
}

/// Pairs of elements whose boxes overlap during a step, sorted by kind, then by bodies and elements.
#[pyclass(module = "impinge", frozen)]
pub struct Candidates {
    inner: impinge::Candidates,
    spare: Option<Spare>,
}

/// Candidates that are no longer needed. Their detector uses their memory again.
#[derive(Clone, Default)]
pub struct Spare(Arc<Mutex<Option<impinge::Candidates>>>);

impl Spare {
    pub fn take(&self) -> Option<impinge::Candidates> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Drop for Candidates {
    fn drop(&mut self) {
        if let Some(Spare(spare)) = &self.spare {
            let mut spare = spare.lock().unwrap_or_else(PoisonError::into_inner);
            spare.get_or_insert_with(|| std::mem::take(&mut self.inner));
        }
    }
}

impl Candidates {
    /// Candidates that go to `spare`, if there is one, when Python drops them.
    pub fn new(inner: impinge::Candidates, spare: Option<Spare>) -> Self {
        Candidates { inner, spare }
    }

    fn all(&self) -> impl Iterator<Item = (PairKind, [u32; 4])> + '_ {
        PairKind::ALL
            .into_iter()
            .flat_map(|kind| self.inner.rows(kind).map(move |row| (kind, row)))
    }
}

#[pymethods]
impl Candidates {
    /// The pairs of one kind.
    ///
    /// Parameters
    /// ----------
    /// kind : {"vf", "ee", "ev", "vv", "ef", "ff"}
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of uint32, shape (n, 4)
    ///     Number of a body, its element, number of the other body, its element; sorted. The element that the
    ///     kind names first comes first.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        kind: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let kind = choose_one(kind, "kind", &PairKind::ALL.map(|kind| (kind.name(), kind)))?;
        let rows = py.detach(|| collect(self.inner.rows(kind).len(), self.inner.rows(kind)))?;
        to_array(py, rows)
    }

    /// numpy.ndarray of uint8, shape (n,) : the kind of each pair, as an index of `impinge.KINDS`.
    #[getter]
    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        columns::kinds(py, self.inner.len(), self.all().map(|(kind, _)| kind))
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two bodies.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        columns::bodies(py, self.inner.len(), self.all().map(|(_, row)| row))
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two elements in their bodies, as those of
    /// `Impacts.elements`.
    #[getter]
    fn elements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        columns::elements(py, self.inner.len(), self.all().map(|(_, row)| row))
    }

    /// int : a 64-bit hash of the set that does not depend on its order.
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

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "Candidates name bodies of a live scene: pickle their arrays",
        ))
    }

    fn __repr__(&self) -> String {
        columns::counted("Candidates", |kind| self.inner.of(kind).len())
    }
}

/// The kinds that `candidates` is asked for; by default vertices and faces, and edges and edges.
pub fn kinds(argument: Argument<'_, '_>) -> PyResult<Vec<PairKind>> {
    let choices = PairKind::ALL.map(|kind| (kind.name(), kind));
    let Some(argument) = argument else {
        return Ok(vec![PairKind::VertexFace, PairKind::EdgeEdge]);
    };
    // A string is a sequence of strings, too, of letters.
    if argument.is_instance_of::<PyString>() {
        return Ok(vec![choose_one(argument, "kinds", &choices)?]);
    }
    let kinds = argument.try_iter().map_err(|_| {
        unexpected(
            argument,
            "kinds",
            "a sequence of names such as (\"vf\", \"ee\")",
        )
    })?;
    kinds
        .enumerate()
        .map(|(ix, kind)| choose_one(&kind?, &format!("kinds[{ix}]"), &choices))
        .collect()
}

/// A number that is a distance; `CandidateQuery` refuses what is not finite or below 0.
pub fn distance(argument: Argument<'_, '_>, name: &str) -> PyResult<f64> {
    let Some(argument) = argument else {
        return Ok(0.0);
    };
    argument.extract().map_err(|error: PyErr| {
        match error.is_instance_of::<PyTypeError>(argument.py()) {
            true => unexpected(argument, name, "a number"),
            false => error,
        }
    })
}
