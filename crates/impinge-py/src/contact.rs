//! `impinge.Contacts`: where the triangles of each pair meet.

use std::sync::OnceLock;

use impinge::contact::{self, Contacts as Inner, Curves, Feature, Region, Shape};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::to_array;
use crate::errors::raise;

/// Where the triangles of each pair of `Pairs` meet: points, segments, and polygons where both lie
/// in one plane; and the curves in which surfaces cross. `Detector.contacts` finds them.
///
/// Which features meet where, and which points are one, is exact. Points are one if they have one name,
/// by features: where a face is there twice, or faces of one body overlap in a plane, points and
/// curves double, and what they would connect can be several regions. Coordinates are the exact
/// numbers rounded: to float32 where both bodies hold float32, else to float64. Each access makes new
/// arrays.
#[pyclass(module = "impinge", frozen)]
pub struct Contacts {
    pub inner: Inner,
    /// The number of the scene.
    pub scene: u64,
    curves: OnceLock<Curves>,
}

impl Contacts {
    pub fn new(inner: Inner, scene: u64) -> Self {
        Contacts {
            inner,
            scene,
            curves: OnceLock::new(),
        }
    }

    /// The curves, found when they are first asked for.
    fn found_curves(&self, py: Python<'_>) -> PyResult<&Curves> {
        if let Some(curves) = self.curves.get() {
            return Ok(curves);
        }
        let found = py.detach(|| self.inner.curves()).map_err(raise)?;
        Ok(self.curves.get_or_init(|| found))
    }
}

#[pymethods]
impl Contacts {
    /// numpy.ndarray of uint32, shape (n, 4) : the pairs: number of a body, its triangle, number of
    /// the other body, its triangle.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        to_array(py, self.inner.rows().to_vec())
    }

    /// numpy.ndarray of str, shape (n,) : what each pair has in common: ``"point"``, ``"segment"``,
    /// ``"polygon"``, ``"solid"`` (a pair that is not of triangles) or ``"apart"`` (the scene has
    /// moved since).
    #[getter]
    fn shapes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let names = self.inner.shapes().iter().map(|shape| match shape {
            Shape::Solid => "solid",
            Shape::Apart => "apart",
            Shape::Point => "point",
            Shape::Segment => "segment",
            Shape::Polygon => "polygon",
        });
        strings::<7>(py, names)
    }

    /// numpy.ndarray of float64, shape (p, 3) : the points of contact, each name once.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat = self.inner.points().as_flattened().to_vec();
        PyArray1::from_vec(py, flat).reshape([self.inner.points().len(), 3])
    }

    /// numpy.ndarray of uint32, shape (c,) : the corners of all contacts as rows of `points`, one
    /// contact after the other: one for a point, two for a segment, three to six for a polygon.
    #[getter]
    fn corners<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.inner.all_corners())
    }

    /// numpy.ndarray of uint64, shape (n + 1,) : where each contact's corners start in `corners`,
    /// and one past the last.
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

    /// numpy.ndarray of str, shape (p, 2) : what each point lies on, of either body: ``"v"`` (a
    /// vertex), ``"e"`` (an edge) or ``"f"`` (a face).
    #[getter]
    fn feature_kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let features = self.inner.names().iter().flat_map(|name| name.features);
        let kinds = features.map(|feature| match feature {
            Feature::Vertex(_) => "v",
            Feature::Edge(_) => "e",
            Feature::Face(_) => "f",
        });
        strings::<1>(py, kinds)?.call_method1("reshape", ((-1, 2),))
    }

    /// numpy.ndarray of uint32, shape (p, 2, 2) : the numbers of these features: the two vertices
    /// of an edge, the lower first; of a vertex and of a face their number twice.
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
    fn curves<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray1<u32>>>> {
        let curves = self.found_curves(py)?;
        let of_curve = |ix| {
            let mut points = curves.points(ix).to_vec();
            if curves.is_closed(ix) {
                points.extend(points.first().copied());
            }
            PyArray1::from_vec(py, points)
        };
        Ok((0..curves.len()).map(of_curve).collect())
    }

    /// numpy.ndarray of float64 : the length of each curve, in the unit of the scene.
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let curves = self.found_curves(py)?;
        let lengths = (0..curves.len()).map(|ix| curves.length(ix));
        Ok(PyArray1::from_vec(py, lengths.collect()))
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
        let n_points = self.inner.points().len();
        format!("Contacts({} pairs, {n_points} points)", self.inner.len())
    }
}

/// How deep two closed bodies are in each other: `Detector.penetration`.
#[pyclass(module = "impinge", frozen)]
pub struct Penetration {
    pub inner: contact::Penetration,
}

#[pymethods]
impl Penetration {
    /// tuple of two numpy.ndarray of uint32 : the vertices of the body with the lower number that
    /// are strictly inside the other one, and those of the other one inside the first; sorted.
    #[getter]
    fn inside<'py>(
        &self,
        py: Python<'py>,
    ) -> (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>) {
        let [a, b] = &self.inner.inside;
        (PyArray1::from_slice(py, a), PyArray1::from_slice(py, b))
    }

    /// float or None : the volume that both bodies have in common, in cubic units; ``None`` where
    /// it is unknown because they meet other than by edges that cross faces. Infinite if larger than
    /// all floats, unknown if infinite regions cancel. Of a body that crosses itself, volume, area,
    /// normal, depth and regions mean nothing.
    #[getter]
    fn volume(&self) -> Option<f64> {
        self.inner.volume()
    }

    /// The connected regions of the overlap.
    ///
    /// Returns
    /// -------
    /// list of dict
    ///     As of `Contacts.regions`, and ``inside`` (vertices of either body inside the other), ``depth`` (the extent of the
    ///     region along its normal; bodies that are pushed that far may still overlap) and ``volume``; depth and volume may be
    ///     ``None``.
    fn regions<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let of_region = |region: &Region| {
            let dict = to_dict(py, region)?;
            let [a, b] = &region.inside;
            let inside = [a, b].map(|vertices| PyArray1::from_slice(py, vertices));
            dict.set_item("inside", inside)?;
            dict.set_item("depth", region.depth)?;
            dict.set_item("volume", region.volume)?;
            Ok(dict)
        };
        self.inner.regions.iter().map(of_region).collect()
    }

    fn __repr__(&self) -> String {
        let [a, b] = self.inner.inside.each_ref().map(Vec::len);
        let n = self.inner.regions.len();
        format!("Penetration({n} regions, {a} and {b} vertices inside)")
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

/// Short names as NumPy holds them: one 32-bit number per letter, filled up with zeros.
fn strings<const WIDTH: usize>(
    py: Python<'_>,
    names: impl Iterator<Item = &'static str>,
) -> PyResult<Bound<'_, PyAny>> {
    let letters = |name: &str| -> [u32; WIDTH] {
        let name = name.as_bytes();
        std::array::from_fn(|at| name.get(at).copied().map_or(0, u32::from))
    };
    let letters: Vec<u32> = names.flat_map(letters).collect();
    let dtype = format!("U{WIDTH}");
    if letters.is_empty() {
        return py.import("numpy")?.call_method1("empty", (0, dtype));
    }
    PyArray1::from_vec(py, letters).call_method1("view", (dtype,))
}
