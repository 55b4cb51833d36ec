//! `impinge.NearPairs`: elements within a distance of each other.

use std::sync::Arc;

use impinge::exact::Feature;
use impinge::{NearIter, PairKind};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::columns;
use crate::result::{collect, to_array};
use crate::scene::Scene;
use crate::settings::{Argument, choose_one, unexpected};
use crate::statistics::Statistics;

/// The names of nearest features together by their numbers.
pub const TYPES: [&str; 20] = [
    "P_P", "P_E", "P_T", "E_E", "E_T", "P_T0", "P_T1", "P_T2", "P_E0", "P_E1", "P_E2", "EA0_EB0",
    "EA0_EB1", "EA1_EB0", "EA1_EB1", "EA_EB0", "EA_EB1", "EA0_EB", "EA1_EB", "EA_EB",
];

/// The names of features by their numbers.
pub const FEATURES: [&str; 7] = ["v0", "v1", "v2", "e0", "e1", "e2", "f"];

/// All pairs of elements that are within the distance that was asked for, sorted by kind, then by bodies and
/// elements. The same bytes on every method and thread count.
///
/// ``len(near)`` is their number. The attributes below are arrays with one row per pair. Each access makes new
/// arrays.
#[pyclass(module = "impinge", frozen)]
pub struct NearPairs {
    inner: Arc<impinge::NearPairs>,
    /// The only kind, if this is a part.
    kind: Option<PairKind>,
    has_distances: bool,
    has_points: bool,
}

impl NearPairs {
    pub fn new(inner: impinge::NearPairs, has_distances: bool, has_points: bool) -> Self {
        NearPairs {
            inner: Arc::new(inner),
            kind: None,
            has_distances,
            has_points,
        }
    }

    fn iter(&self) -> NearIter<'_> {
        match self.kind {
            Some(kind) => self.inner.of(kind),
            None => self.inner.iter(),
        }
    }
}

/// Refuses to speak of what was not asked for.
fn check_asked(is_asked: bool, what: &str, keyword: &str) -> PyResult<()> {
    match is_asked {
        true => Ok(()),
        false => Err(PyValueError::new_err(format!(
            "{what} were not asked for: pass {keyword}=True"
        ))),
    }
}

#[pymethods]
impl NearPairs {
    /// numpy.ndarray of uint32, shape (n, 4) : number of a body, its element, number of the other body, its element. Elements
    /// are numbered as those of `Impacts.elements`.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.iter().map(|pair| pair.row());
        to_array(py, collect(self.__len__(), rows)?)
    }

    /// numpy.ndarray of uint8, shape (n,) : what they are, as an index of `impinge.KINDS`: ``"vf"`` (a vertex and a face),
    /// ``"ee"`` (two edges), ``"ev"`` (an edge and a vertex), ``"vv"`` (two vertices), ``"ef"`` (an edge and a face) or
    /// ``"ff"`` (two faces).
    #[getter]
    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        columns::kinds(py, self.__len__(), self.iter().map(|pair| pair.kind))
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two bodies.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.iter().map(|pair| pair.row());
        columns::bodies(py, self.__len__(), rows)
    }

    /// numpy.ndarray of uint32, shape (n, 2) : numbers of the two elements in their bodies, as those of
    /// `Impacts.elements`.
    #[getter]
    fn elements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.iter().map(|pair| pair.row());
        columns::elements(py, self.__len__(), rows)
    }

    /// numpy.ndarray of uint8, shape (n,) : which features are nearest, as an index of `impinge.TYPES`, which are
    /// ipc-toolkit's names: ``"P_T"``, ``"P_E0"``, ``"P_T0"``, ``"EA_EB"``, ``"EA_EB0"``, ``"EA0_EB0"``, …; of an edge and
    /// a face, and of two faces, without numbers. Decided exactly.
    #[getter]
    fn types<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        // The name depends on the kind and the two features alone.
        const UNKNOWN: u8 = u8::MAX;
        let mut known = [[[UNKNOWN; FEATURES.len()]; FEATURES.len()]; PairKind::ALL.len()];
        let types = self.iter().map(|pair| {
            let [a, b] = pair.features.map(|feature| usize::from(number(feature)));
            let known = &mut known[pair.kind as usize][a][b];
            if *known == UNKNOWN {
                let name = pair.name();
                let found = TYPES.iter().position(|&own| own == name);
                *known = found.map_or(UNKNOWN, |ix| ix as u8);
            }
            *known
        });
        Ok(PyArray1::from_vec(py, collect(self.__len__(), types)?))
    }

    /// numpy.ndarray of uint8, shape (n, 2) : the nearest feature of either element, as an index of `impinge.FEATURES`: ``"v0"``
    /// to ``"v2"``, ``"e0"`` to ``"e2"`` (edge k goes from vertex k to the next) or ``"f"``.
    #[getter]
    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let numbers = self.iter().map(|pair| pair.features.map(number));
        let flat = collect(self.__len__(), numbers)?.into_flattened();
        PyArray1::from_vec(py, flat).reshape([self.__len__(), 2])
    }

    /// numpy.ndarray of bool, shape (n,) : where nearest points may not be the only ones.
    #[getter]
    fn parallel<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let flags = self.iter().map(|pair| pair.is_parallel);
        Ok(PyArray1::from_vec(py, collect(self.__len__(), flags)?))
    }

    /// numpy.ndarray of float64, shape (n,) : distances, rounded; the same bits on every machine. Only after
    /// ``distances=True`` or ``closest_points=True``.
    #[getter]
    fn distances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        check_asked(self.has_distances, "distances", "distances")?;
        let distances = self.iter().filter_map(|pair| pair.distance);
        let distances = collect(self.__len__(), distances)?;
        Ok(PyArray1::from_vec(py, distances))
    }

    /// numpy.ndarray of float64, shape (n, 2, 3) : a nearest point of either element, rounded. Only after
    /// ``closest_points=True``.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        check_asked(self.has_points, "points", "closest_points")?;
        let closest = self.iter().filter_map(|pair| pair.closest);
        let points = collect(self.__len__(), closest.map(|closest| closest.points))?;
        let flat = points.into_flattened().into_flattened();
        PyArray1::from_vec(py, flat).reshape([self.__len__(), 2, 3])
    }

    /// Those of one kind.
    ///
    /// Parameters
    /// ----------
    /// kind : {"vf", "ee", "ev", "vv", "ef", "ff"}
    ///
    /// Returns
    /// -------
    /// NearPairs
    ///     Of the same answer: nothing is copied.
    fn of(&self, kind: &Bound<'_, PyAny>) -> PyResult<NearPairs> {
        let choices = PairKind::ALL.map(|kind| (kind.name(), kind));
        let kind = choose_one(kind, "kind", &choices)?;
        // Of a part of another kind nothing is left.
        let (inner, kind) = match self.kind {
            Some(own) if own != kind => (Arc::default(), Some(kind)),
            _ => (Arc::clone(&self.inner), Some(kind)),
        };
        Ok(NearPairs {
            inner,
            kind,
            ..*self
        })
    }

    /// int : a 64-bit hash of the set of pairs and their features; equal sets have equal hashes everywhere.
    #[getter]
    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.iter().hash())
    }

    /// Statistics : what the answer cost.
    #[getter]
    fn stats(&self) -> Statistics {
        Statistics {
            inner: self.inner.stats().clone(),
        }
    }

    fn __len__(&self) -> usize {
        self.iter().len()
    }

    fn __repr__(&self) -> String {
        let is_own = |kind| self.kind.is_none_or(|own| own == kind);
        columns::counted("NearPairs", |kind| match is_own(kind) {
            true => self.inner.of(kind).len(),
            false => 0,
        })
    }
}

/// The number of a feature.
fn number(feature: Feature) -> u8 {
    match feature {
        Feature::Vertex(ix) => ix % 3,
        Feature::Edge(ix) => 3 + ix % 3,
        Feature::Face => 6,
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
