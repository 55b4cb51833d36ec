//! What `impinge.NearPairs` is made of: elements within a distance of each other.

use std::sync::Arc;

use impinge::exact::Feature;
use impinge::{Changes, NearIter, PairKind};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::{ChangeArrays, changes, collect, kind_numbers, to_array};
use crate::errors::{invalid, raise};
use crate::exclusion::Exclusion;
use crate::options::pair_kind;
use crate::scene::Scene;
use crate::statistics;

/// The names of nearest features together by their numbers.
pub const TYPES: [&str; 20] = [
    "P_P", "P_E", "P_T", "E_E", "E_T", "P_T0", "P_T1", "P_T2", "P_E0", "P_E1", "P_E2", "EA0_EB0",
    "EA0_EB1", "EA1_EB0", "EA1_EB1", "EA_EB0", "EA_EB1", "EA0_EB", "EA1_EB", "EA_EB",
];

/// The names of features by their numbers.
pub const FEATURES: [&str; 7] = ["v0", "v1", "v2", "e0", "e1", "e2", "f"];

/// What `impinge.NearPairs` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Near {
    inner: Arc<impinge::NearPairs>,
    /// The only kind, if this is a part.
    kind: Option<PairKind>,
    has_distances: bool,
    has_points: bool,
}

impl Near {
    pub fn new(inner: impinge::NearPairs, [has_distances, has_points]: [bool; 2]) -> Self {
        Near {
            inner: Arc::new(inner),
            kind: None,
            has_distances,
            has_points,
        }
    }

    pub fn iter(&self) -> NearIter<'_> {
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
        false => Err(invalid(format!(
            "{what} were not asked for: pass {keyword}=True"
        ))),
    }
}

#[pymethods]
impl Near {
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.iter().map(|pair| pair.row());
        to_array(py, collect(self.__len__(), rows)?)
    }

    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        kind_numbers(py, self.__len__(), self.iter().map(|pair| pair.kind))
    }

    fn types<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        type_numbers(
            py,
            self.iter()
                .map(|pair| (pair.kind, pair.features, pair.name())),
        )
    }

    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let numbers = self.iter().map(|pair| pair.features.map(number));
        let flat = collect(self.__len__(), numbers)?.into_flattened();
        PyArray1::from_vec(py, flat).reshape([self.__len__(), 2])
    }

    fn parallel<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let flags = self.iter().map(|pair| pair.is_parallel);
        Ok(PyArray1::from_vec(py, collect(self.__len__(), flags)?))
    }

    fn distances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        check_asked(self.has_distances, "distances", "distances")?;
        let distances = self.iter().filter_map(|pair| pair.distance);
        let distances = collect(self.__len__(), distances)?;
        Ok(PyArray1::from_vec(py, distances))
    }

    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        check_asked(self.has_points, "points", "closest_points")?;
        let closest = self.iter().filter_map(|pair| pair.closest);
        let points = collect(self.__len__(), closest.map(|closest| closest.points))?;
        let flat = points.into_flattened().into_flattened();
        PyArray1::from_vec(py, flat).reshape([self.__len__(), 2, 3])
    }

    fn changes<'py>(&self, py: Python<'py>, old: &Bound<'py, Near>) -> PyResult<ChangeArrays<'py>> {
        let old = old.get();
        (self
            .inner
            .check_comparable(&old.inner, self.kind.or(old.kind)))
        .map_err(raise)?;
        let found = py.detach(|| {
            let [old, new] = [old, self].map(|near| {
                let all = near.iter();
                all.map(|pair| (pair.kind, pair.a, pair.b))
            });
            Changes::between(old, new)
        });
        changes(py, &found)
    }

    fn of(&self, kind: &Bound<'_, PyAny>) -> PyResult<Near> {
        let kind = pair_kind(kind)?;
        // Of a part of another kind nothing is left.
        let (inner, kind) = match self.kind {
            Some(own) if own != kind => (Arc::default(), Some(kind)),
            _ => (Arc::clone(&self.inner), Some(kind)),
        };
        Ok(Near {
            inner,
            kind,
            ..*self
        })
    }

    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.iter().hash())
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        statistics::to_dict(py, self.inner.stats())
    }

    fn __len__(&self) -> usize {
        self.iter().len()
    }
}

/// Types by their numbers, given kinds, features and names.
pub fn type_numbers(
    py: Python<'_>,
    rows: impl ExactSizeIterator<Item = (PairKind, [Feature; 2], &'static str)>,
) -> PyResult<Bound<'_, PyArray1<u8>>> {
    // The name depends on the kind and the two features alone.
    const UNKNOWN: u8 = u8::MAX;
    let mut known = [[[UNKNOWN; FEATURES.len()]; FEATURES.len()]; PairKind::ALL.len()];
    let n = rows.len();
    let types = rows.map(|(kind, features, name)| {
        let [a, b] = features.map(|feature| usize::from(number(feature)));
        let known = &mut known[kind as usize][a][b];
        if *known == UNKNOWN {
            let found = TYPES.iter().position(|&own| own == name);
            *known = found.map_or(UNKNOWN, |ix| ix as u8);
        }
        *known
    });
    Ok(PyArray1::from_vec(py, collect(n, types)?))
}

/// The number of a feature.
pub fn number(feature: Feature) -> u8 {
    match feature {
        Feature::Vertex(ix) => ix % 3,
        Feature::Edge(ix) => 3 + ix % 3,
        Feature::Face => 6,
    }
}

/// What leaves out all pairs of an answer about a scene.
#[pyfunction]
pub fn _rest_pairs(near: &Bound<'_, Near>, scene: &Scene) -> Exclusion {
    Exclusion::pairs(&near.get().inner, scene.number)
}
