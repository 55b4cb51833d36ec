//! `impinge.Contacts`: where the triangles of each pair meet.

use impinge::contact::{Contacts as Inner, Curves, Feature, Region, Shape};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::columns::strings;
use crate::errors::raise;
use crate::result::{Answer, to_array};
use crate::scene::Scene;
use crate::settings::unexpected;

/// Where the triangles of each pair of a `Result` meet: points, segments, and polygons where both lie in one
/// plane; and the curves in which surfaces cross.
///
/// Which features meet where, and which points are one, is exact. Coordinates are the exact numbers rounded: to
/// float32 where both bodies hold float32, else to float64. Each access makes new arrays.
///
/// Parameters
/// ----------
/// scene : Scene
///     As it was when the pairs were found.
/// result : Result
///
/// Raises
/// ------
/// ValueError
///     A result of another scene, or a body that is gone or has fewer primitives.
///
/// Examples
/// --------
/// >>> import impinge
/// >>> scene = impinge.Scene()
/// >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
/// >>> blade = scene.add([[1, 1, -1], [2, 1, -1], [1, 1, 1]], [[0, 1, 2]])
/// >>> contacts = impinge.Contacts(scene, impinge.Detector(backend="cpu").detect(scene))
/// >>> contacts.shapes.tolist(), contacts.points.tolist()
/// (['segment'], [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]])
/// >>> [curve.tolist() for curve in contacts.curves()]
/// [[0, 1]]
#[pyclass(module = "impinge", frozen)]
pub struct Contacts {
    inner: Inner,
    curves: Curves,
}

#[pymethods]
impl Contacts {
    #[new]
    fn new(py: Python<'_>, scene: &Bound<'_, PyAny>, result: &Bound<'_, PyAny>) -> PyResult<Self> {
        let scene = scene
            .cast::<Scene>()
            .map_err(|_| unexpected(scene, "scene", "a Scene"))?;
        let result = result
            .cast::<Answer>()
            .map_err(|_| unexpected(result, "result", "a Result"))?;
        let scene = scene
            .try_borrow()
            .map_err(|_| PyRuntimeError::new_err("the scene is being changed by another thread"))?;
        let (pairs, number) = result.get().parts();
        if number != scene.number {
            return Err(PyValueError::new_err("result: of another scene"));
        }
        let scene = &scene.inner;
        let (inner, curves) = py
            .detach(|| {
                let contacts = Inner::new(scene, pairs)?;
                let curves = contacts.curves()?;
                Ok((contacts, curves))
            })
            .map_err(raise)?;
        Ok(Contacts { inner, curves })
    }

    /// numpy.ndarray of uint32, shape (n, 4) : the pairs: number of a body, its triangle, number of the other
    /// body, its triangle.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        to_array(py, self.inner.rows().to_vec())
    }

    /// numpy.ndarray of str, shape (n,) : what each pair has in common: ``"point"``, ``"segment"``,
    /// ``"polygon"``, ``"solid"`` (a pair that is not of triangles) or ``"apart"`` (the scene has moved since).
    #[getter]
    fn shapes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let names = self.inner.shapes().iter().map(|shape| match shape {
            Shape::Solid => "solid",
            Shape::Apart => "apart",
            Shape::Point => "point",
            Shape::Segment => "segment",
            Shape::Polygon => "polygon",
        });
        strings::<7>(py, self.inner.shapes().len(), names)
    }

    /// numpy.ndarray of float64, shape (p, 3) : the points of contact, each once.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat = self.inner.points().as_flattened().to_vec();
        PyArray1::from_vec(py, flat).reshape([self.inner.points().len(), 3])
    }

    /// numpy.ndarray of uint32, shape (c,) : the corners of all contacts as rows of `points`, one contact after the
    /// other: one for a point, two for a segment, three to six for a polygon.
    #[getter]
    fn corners<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.inner.all_corners())
    }

    /// numpy.ndarray of uint64, shape (n + 1,) : where each contact's corners start in `corners`, and one past the
    /// last.
    #[getter]
    fn starts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        let starts = self.inner.starts().iter().map(|&start| start as u64);
        PyArray1::from_vec(py, starts.collect())
    }

    /// numpy.ndarray of uint32, shape (p, 2) : numbers of the two bodies of each point.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let names = self.inner.names().iter();
        to_array(py, names.map(|name| name.bodies).collect())
    }

    /// numpy.ndarray of str, shape (p, 2) : what each point lies on, of either body: ``"v"`` (a vertex), ``"e"``
    /// (an edge) or ``"f"`` (a face).
    #[getter]
    fn feature_kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let features = self.inner.names().iter().flat_map(|name| name.features);
        let kinds = features.map(|feature| match feature {
            Feature::Vertex(_) => "v",
            Feature::Edge(_) => "e",
            Feature::Face(_) => "f",
        });
        strings::<1>(py, 2 * self.inner.names().len(), kinds)?.call_method1("reshape", ((-1, 2),))
    }

    /// numpy.ndarray of uint32, shape (p, 2, 2) : the numbers of these features: the two vertices of an edge, the
    /// lower first; of a vertex and of a face their number twice.
    #[getter]
    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let features = self.inner.names().iter().flat_map(|name| name.features);
        let rows: Vec<[u32; 2]> = features
            .map(|feature| match feature {
                Feature::Edge(vertices) => vertices,
                Feature::Vertex(ix) | Feature::Face(ix) => [ix, ix],
            })
            .collect();
        to_array(py, rows)?.call_method1("reshape", ((-1, 2, 2),))
    }

    /// The curves in which surfaces cross: segments chained into loops and open curves.
    ///
    /// Returns
    /// -------
    /// list of numpy.ndarray of uint32
    ///     The points of each curve in order, as rows of `points`. A loop ends with its first point.
    fn curves<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray1<u32>>> {
        (0..self.curves.len())
            .map(|ix| {
                let mut points = self.curves.points(ix).to_vec();
                if self.curves.is_closed(ix) {
                    points.extend(points.first().copied());
                }
                PyArray1::from_vec(py, points)
            })
            .collect()
    }

    /// numpy.ndarray of float64 : the length of each curve, in the unit of the scene.
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let lengths = (0..self.curves.len()).map(|ix| self.curves.length(ix));
        PyArray1::from_vec(py, lengths.collect())
    }

    /// The connected regions of contact.
    ///
    /// Returns
    /// -------
    /// list of dict
    ///     ``bodies`` (two numbers), ``contacts`` (rows of the pairs), ``position``, ``bounds`` (lowest and highest
    ///     coordinates), ``length`` of curves, ``patch_area`` where faces lie in one plane, ``normal`` (the unit
    ///     direction in which to push the first body apart, or ``None``).
    fn regions<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let regions = py.detach(|| self.inner.regions()).map_err(raise)?;
        regions.iter().map(|region| to_dict(py, region)).collect()
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        format!(
            "Contacts({} pairs, {} points, {} curves)",
            self.inner.len(),
            self.inner.points().len(),
            self.curves.len()
        )
    }
}

fn to_dict<'py>(py: Python<'py>, region: &Region) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("bodies", (region.bodies[0], region.bodies[1]))?;
    dict.set_item("contacts", PyArray1::from_slice(py, &region.contacts))?;
    dict.set_item("position", PyArray1::from_slice(py, &region.position))?;
    let bounds = PyArray1::from_slice(py, region.bounds.as_flattened());
    dict.set_item("bounds", bounds.reshape([2, 3])?)?;
    dict.set_item("length", region.length)?;
    dict.set_item("patch_area", region.patch_area)?;
    let normal = region
        .normal
        .map(|normal| PyArray1::from_slice(py, &normal));
    dict.set_item("normal", normal)?;
    Ok(dict)
}
