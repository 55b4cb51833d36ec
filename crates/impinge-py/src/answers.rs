//! What the answers of `impinge` are made of: their columns as arrays. An array for which there is
//! no memory is a `MemoryError`.

use std::sync::Arc;

use impinge::{BodyId, Changes, PairKind, Positions};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyMemoryError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, positions_array};
use crate::bodies::{Body, body_id};
use crate::errors::{invalid, raise};
use crate::options::pair_kind;
use crate::scene::Scene;
use crate::settings::{unexpected, unsigned};
use crate::statistics;

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

/// Indices as NumPy takes them.
type Indices<'py, D> = Bound<'py, numpy::PyArray<i64, D>>;

/// The fields of `impinge.Changes`.
pub type ChangeArrays<'py> = (
    Indices<'py, numpy::Ix2>,
    Indices<'py, numpy::Ix1>,
    Indices<'py, numpy::Ix1>,
);

/// What has changed, as arrays.
pub fn changes<'py>(py: Python<'py>, changes: &Changes) -> PyResult<ChangeArrays<'py>> {
    let index = |&ix: &usize| i64::try_from(ix).unwrap_or(i64::MAX);
    let list = |of: &[usize]| collect(of.len(), of.iter().map(index));
    let kept = list(changes.kept.as_flattened())?;
    Ok((
        PyArray1::from_vec(py, kept).reshape([changes.kept.len(), 2])?,
        PyArray1::from_vec(py, list(&changes.new)?),
        PyArray1::from_vec(py, list(&changes.gone)?),
    ))
}

/// Kinds, as indices of `impinge.KINDS`.
pub fn kind_numbers(
    py: Python<'_>,
    n: usize,
    kinds: impl Iterator<Item = PairKind>,
) -> PyResult<Bound<'_, PyArray1<u8>>> {
    let numbers = collect(n, kinds.map(|kind| kind as u8))?;
    Ok(PyArray1::from_vec(py, numbers))
}

/// What `impinge.Pairs` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Pairs {
    inner: impinge::Pairs,
    scene: u64,
}

impl Pairs {
    pub fn new(inner: impinge::Pairs, scene: u64) -> Self {
        Pairs { inner, scene }
    }

    /// The pairs, and the number of the scene that they belong to.
    pub fn parts(&self) -> (&impinge::Pairs, u64) {
        (&self.inner, self.scene)
    }

    fn id(&self, argument: &Bound<'_, PyAny>, name: &str) -> PyResult<BodyId> {
        let known = || self.inner.bodies().map(|(id, _)| id);
        let id = body_id(argument, name, self.scene, known())?;
        match known().any(|held| held == id) {
            true => Ok(id),
            false => Err(invalid(format!(
                "{name}: body {id} took no part in this detection"
            ))),
        }
    }
}

#[pymethods]
impl Pairs {
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = py.detach(|| collect(self.inner.len(), self.inner.rows()))?;
        to_array(py, rows)
    }

    fn between<'py>(
        &self,
        py: Python<'py>,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let (a, b) = (self.id(a, "a")?, self.id(b, "b")?);
        if a == b {
            return Err(invalid(format!(
                "a and b are both body {a}: take self_of({a})"
            )));
        }
        let pairs = py.detach(|| {
            let n = self.inner.between(a, b).count();
            let mut pairs = collect(n, self.inner.between(a, b))?;
            // They are held in the order of the body with the lower number.
            if b < a {
                pairs.sort_unstable();
            }
            PyResult::Ok(pairs)
        })?;
        to_array(py, pairs)
    }

    fn self_of<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let body = self.id(body, "body")?;
        let pairs =
            py.detach(|| collect(self.inner.self_of(body).count(), self.inner.self_of(body)));
        to_array(py, pairs?)
    }

    fn colliding<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        let body = self.id(body, "body")?;
        Ok(PyArray1::from_vec(
            py,
            py.detach(|| self.inner.colliding(body)),
        ))
    }

    fn all_colliding<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (id, colliding) in py.detach(|| self.inner.all_colliding()) {
            let scene = self.scene;
            all.set_item(Body { id, scene }, PyArray1::from_vec(py, colliding))?;
        }
        Ok(all)
    }

    fn changes<'py>(
        &self,
        py: Python<'py>,
        old: &Bound<'py, Pairs>,
    ) -> PyResult<ChangeArrays<'py>> {
        let old = old.get();
        let found = py.detach(|| self.inner.changes(&old.inner));
        changes(py, &found.map_err(raise)?)
    }

    fn retain(&self, py: Python<'_>, keep: &Bound<'_, PyAny>) -> PyResult<Pairs> {
        let keep = arrays::mask(keep, "keep", self.inner.len())?;
        let mut inner = self.inner.clone();
        py.detach(|| {
            let mut keep = keep.iter();
            inner.retain(|_, _| keep.next() == Some(&true));
        });
        Ok(Pairs { inner, ..*self })
    }

    fn bodies(&self) -> Vec<Body> {
        let scene = self.scene;
        let bodies = self.inner.bodies();
        bodies.map(|(id, _)| Body { id, scene }).collect()
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

/// The fields of `impinge.Impact`.
pub type Row = (&'static str, Body, u32, Body, u32, f64, bool);

/// The fields of `impinge.Impact`.
pub fn impact(found: &impinge::Impact, scene: u64) -> Row {
    let [a, b] = [found.a, found.b];
    let body = |id| Body { id, scene };
    (
        found.kind.name(),
        body(a.body),
        a.element,
        body(b.body),
        b.element,
        found.toi,
        found.at_start,
    )
}

/// What `impinge.Impacts` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
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
            None => self.inner.iter().as_slice(),
        }
    }
}

#[pymethods]
impl Impacts {
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.slice().iter().map(impinge::Impact::row);
        to_array(py, collect(self.slice().len(), rows)?)
    }

    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let kinds = self.slice().iter().map(|impact| impact.kind);
        kind_numbers(py, self.slice().len(), kinds)
    }

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

    fn at_start<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let at_start = self.slice().iter().map(|impact| impact.at_start);
        Ok(PyArray1::from_vec(
            py,
            collect(self.slice().len(), at_start)?,
        ))
    }

    fn start_intersects(&self) -> Option<bool> {
        self.inner.start_intersects()
    }

    fn changes<'py>(
        &self,
        py: Python<'py>,
        old: &Bound<'py, Impacts>,
    ) -> PyResult<ChangeArrays<'py>> {
        let old = old.get();
        (self
            .inner
            .check_comparable(&old.inner, self.kind.or(old.kind)))
        .map_err(raise)?;
        let [old, new] = [old, self].map(|impacts| {
            let all = impacts.slice().iter();
            all.map(|impact| (impact.kind, impact.a, impact.b))
        });
        changes(py, &py.detach(|| Changes::between(old, new)))
    }

    fn of(&self, kind: &Bound<'_, PyAny>) -> PyResult<Impacts> {
        let kind = pair_kind(kind)?;
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

    fn earliest(&self) -> Option<Row> {
        let all = self.slice().iter();
        let earliest = all.reduce(|best, other| if other.toi < best.toi { other } else { best });
        earliest.map(|first| impact(first, self.scene))
    }

    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| {
            let rows = self.slice().iter();
            impinge::hash_impact_rows(rows.map(|impact| (impact.kind, impact.row(), impact.toi)))
        })
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        statistics::to_dict(py, self.inner.stats())
    }

    fn __len__(&self) -> usize {
        self.slice().len()
    }

    fn __getitem__(&self, index: isize) -> PyResult<Row> {
        let ix = arrays::from_end(index, self.slice().len(), "impacts")?;
        Ok(impact(&self.slice()[ix], self.scene))
    }
}

/// What `impinge.Advance` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Advance {
    inner: impinge::Advance,
    scene: u64,
}

impl Advance {
    pub fn new(inner: impinge::Advance, scene: u64) -> Self {
        Advance { inner, scene }
    }

    fn moving(&self) -> impl Iterator<Item = (BodyId, &Positions)> {
        self.inner.iter()
    }
}

#[pymethods]
impl Advance {
    #[getter]
    fn fraction(&self) -> f64 {
        self.inner.fraction
    }

    #[getter]
    fn start_intersects(&self) -> Option<bool> {
        self.inner.start_intersects
    }

    fn first(&self) -> Option<Row> {
        let first = self.inner.first.as_ref();
        first.map(|found| impact(found, self.scene))
    }

    #[getter]
    fn n_tried(&self) -> u32 {
        self.inner.n_tried
    }

    fn bodies(&self) -> Vec<Body> {
        bodies_of(self.moving(), self.scene)
    }

    fn positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        positions_of(py, self.moving(), self.scene, body)
    }

    fn apply(&self, scene: &Bound<'_, PyAny>) -> PyResult<()> {
        changed(scene, |scene| self.inner.apply(scene))
    }
}

/// What `impinge.Truncation` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Truncation {
    inner: impinge::Truncation,
    scene: u64,
}

impl Truncation {
    pub fn new(inner: impinge::Truncation, scene: u64) -> Self {
        Truncation { inner, scene }
    }
}

#[pymethods]
impl Truncation {
    #[getter]
    fn n_cut(&self) -> u64 {
        self.inner.n_cut()
    }

    #[getter]
    fn n_touching(&self) -> u64 {
        self.inner.n_touching()
    }

    #[getter]
    fn rounds(&self) -> u32 {
        self.inner.rounds()
    }

    fn pairs(&self, py: Python<'_>) -> Candidates {
        Candidates::new(py.detach(|| self.inner.pairs()))
    }

    #[getter]
    fn start_intersects(&self) -> Option<bool> {
        self.inner.start_intersects()
    }

    fn bodies(&self) -> Vec<Body> {
        bodies_of(self.inner.iter(), self.scene)
    }

    fn positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        positions_of(py, self.inner.iter(), self.scene, body)
    }

    fn apply(&self, scene: &Bound<'_, PyAny>) -> PyResult<()> {
        changed(scene, |scene| self.inner.apply(scene))
    }
}

/// The bodies that an answer moves.
fn bodies_of<'a>(moving: impl Iterator<Item = (BodyId, &'a Positions)>, scene: u64) -> Vec<Body> {
    moving.map(|(id, _)| Body { id, scene }).collect()
}

/// Where an answer moves the vertices of a body; `None` for one that stands still.
fn positions_of<'py, 'a>(
    py: Python<'py>,
    mut moving: impl Iterator<Item = (BodyId, &'a Positions)>,
    scene: u64,
    body: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let found = match body.cast::<Body>() {
        Ok(body) if body.get().scene != scene => {
            return Err(invalid("body: of another scene"));
        }
        Ok(body) => moving.find(|(id, _)| *id == body.get().id),
        Err(_) => {
            let number = unsigned(body, "body", u64::from(u32::MAX))?;
            moving.find(|(id, _)| id.index() as u64 == number)
        }
    };
    let found = found.map(|(_, positions)| positions_array(py, positions));
    found.transpose()
}

/// Changes a scene that nobody reads.
fn changed(
    scene: &Bound<'_, PyAny>,
    change: impl FnOnce(&mut impinge::Scene) -> Result<(), impinge::Error>,
) -> PyResult<()> {
    let scene = scene
        .cast::<Scene>()
        .map_err(|_| unexpected(scene, "scene", "a Scene"))?;
    let mut scene = scene.try_borrow_mut().map_err(|_| {
        PyRuntimeError::new_err("the scene is being read by a detection: wait for it to end")
    })?;
    change(&mut scene.inner).map_err(raise)
}

/// What `impinge.Candidates` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Candidates {
    inner: Arc<impinge::Candidates>,
    /// The only kind, if this is a part.
    kind: Option<PairKind>,
}

impl Candidates {
    pub fn new(inner: impinge::Candidates) -> Self {
        Candidates {
            inner: Arc::new(inner),
            kind: None,
        }
    }

    fn own(&self) -> impl Iterator<Item = PairKind> + '_ {
        let kinds = PairKind::ALL.into_iter();
        kinds.filter(|kind| self.kind.is_none_or(|own| own == *kind))
    }

    fn all(&self) -> impl Iterator<Item = (PairKind, [u32; 4])> + '_ {
        self.own()
            .flat_map(|kind| self.inner.rows_of(kind).map(move |row| (kind, row)))
    }
}

#[pymethods]
impl Candidates {
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = py.detach(|| collect(self.__len__(), self.all().map(|(_, row)| row)))?;
        to_array(py, rows)
    }

    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        kind_numbers(py, self.__len__(), self.all().map(|(kind, _)| kind))
    }

    fn of(&self, kind: &Bound<'_, PyAny>) -> PyResult<Candidates> {
        let kind = pair_kind(kind)?;
        // Of a part of another kind nothing is left.
        let inner = match self.kind {
            Some(own) if own != kind => Arc::default(),
            _ => Arc::clone(&self.inner),
        };
        Ok(Candidates {
            inner,
            kind: Some(kind),
        })
    }

    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| {
            let kinds = self.own();
            kinds.fold(0, |sum: u64, kind| {
                sum.wrapping_add(self.inner.hash_of(kind))
            })
        })
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        statistics::to_dict(py, self.inner.stats())
    }

    fn __len__(&self) -> usize {
        self.own().map(|kind| self.inner.of(kind).len()).sum()
    }
}
