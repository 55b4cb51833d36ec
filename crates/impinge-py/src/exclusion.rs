//! `impinge.Exclusion`: what a question leaves out besides pairs of bodies.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use impinge::{BodyId, Exclusion as Inner};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::settings::unsigned;

/// Pairs of elements that a question leaves out: made by `rings`, `groups`,
/// `Scene.rest_pairs` and `Scene.vertex_pairs`.
#[pyclass(module = "impinge", frozen)]
pub struct Exclusion {
    pub inner: Inner,
    name: Name,
    /// The number of the scene whose bodies it names, if it names any.
    scene: Option<u64>,
}

impl Exclusion {
    /// The pairs of an answer about a scene.
    pub fn pairs(near: &impinge::NearPairs, scene: u64) -> Self {
        Exclusion {
            inner: Inner::from(near),
            name: Name::Pairs(near.len()),
            scene: Some(scene),
        }
    }

    /// What the caller lists.
    pub fn vertices(
        [a, b]: [BodyId; 2],
        offsets: Vec<u64>,
        vertices: Vec<u32>,
        scene: u64,
    ) -> Self {
        Exclusion {
            name: Name::Vertices(vertices.len()),
            inner: Inner::vertices(a, b, offsets, vertices),
            scene: Some(scene),
        }
    }

    /// Whether it can be asked of a scene: its pairs would be none in another one.
    pub fn is_of(&self, scene: u64) -> bool {
        self.scene.is_none_or(|own| own == scene)
    }
}

#[derive(Clone, Copy, PartialEq, Hash)]
enum Name {
    Rings(u32),
    Groups([u32; 2]),
    Pairs(usize),
    Vertices(usize),
}

#[pymethods]
impl Exclusion {
    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        let other = other.cast::<Exclusion>();
        other.is_ok_and(|other| self.inner == other.get().inner)
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.name.hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        match self.name {
            Name::Rings(n) => format!("rings({n})"),
            Name::Groups([g, h]) => format!("groups({g}, {h})"),
            Name::Pairs(n) => format!("Exclusion({n} pairs)"),
            Name::Vertices(n) => format!("Exclusion({n} pairs of vertices)"),
        }
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let module = py.import("impinge")?;
        match self.name {
            Name::Rings(n) => Ok((module.getattr("rings")?, PyTuple::new(py, [n])?)),
            Name::Groups(both) => Ok((module.getattr("groups")?, PyTuple::new(py, both)?)),
            Name::Pairs(_) | Name::Vertices(_) => Err(PyTypeError::new_err(
                "an Exclusion of pairs names bodies of a live scene",
            )),
        }
    }
}

#[pyfunction]
pub fn _rings(n: &Bound<'_, PyAny>) -> PyResult<Exclusion> {
    let n = unsigned(n, "n", u64::from(Inner::MOST_RINGS))? as u32;
    Ok(Exclusion {
        inner: Inner::rings(n),
        name: Name::Rings(n),
        scene: None,
    })
}

#[pyfunction]
pub fn _groups(g: &Bound<'_, PyAny>, h: &Bound<'_, PyAny>) -> PyResult<Exclusion> {
    let group = |value, name| unsigned(value, name, u64::from(u32::MAX)).map(|group| group as u32);
    let (g, h) = (group(g, "g")?, group(h, "h")?);
    Ok(Exclusion {
        inner: Inner::groups(g, h),
        name: Name::Groups([g.min(h), g.max(h)]),
        scene: None,
    })
}
