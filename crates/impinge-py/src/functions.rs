//! The everyday case in one line.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, PositionArray, positions_array};
use crate::detector::Detector;
use crate::errors::Names;
use crate::result::Answer;
use crate::scene::{Scene, welded};
use crate::settings::{self, Argument, kind};

/// Which primitives of two meshes intersect.
///
/// Parameters
/// ----------
/// vertices_a, vertices_b : array_like, shape (v, 3)
///     Positions, float32 or float64.
/// faces_a, faces_b : array_like of int, shape (n, 3) or (n, 4)
///     Triangles or tetrahedra as vertex indices.
/// weld : bool
///     Whether vertices of one mesh at the same position become one first. This does not change which primitives of two
///     meshes intersect.
/// kind_a, kind_b : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
///     What the rows of `faces_a` and `faces_b` are, as for `Scene.add`.
/// **settings
///     As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given: waking a GPU
///     does not pay for one question.
///
/// Returns
/// -------
/// numpy.ndarray of uint32, shape (n, 2)
///     Every pair (row of `faces_a`, row of `faces_b`) that shares a point, touching included;
///     sorted.
///
/// Raises
/// ------
/// ValueError, TypeError
///     As `Scene.add` and `Detector`.
///
/// Examples
/// --------
/// >>> import numpy as np, impinge
/// >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
/// >>> impinge.pairs(corners, [[0, 1, 2]], corners + [0, 0, 1], [[0, 1, 2]])
/// array([], shape=(0, 2), dtype=uint32)
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
#[pyo3(
    signature = (vertices_a, faces_a, vertices_b, faces_b, *, weld=false, kind_a=None, kind_b=None, **settings)
)]
pub fn pairs<'py>(
    py: Python<'py>,
    vertices_a: &Bound<'py, PyAny>,
    faces_a: &Bound<'py, PyAny>,
    vertices_b: &Bound<'py, PyAny>,
    faces_b: &Bound<'py, PyAny>,
    weld: bool,
    kind_a: Argument<'py, 'py>,
    kind_b: Argument<'py, 'py>,
    settings: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let mut scene = Scene::empty();
    let a = Names {
        vertices: "vertices_a",
        elements: "faces_a",
    };
    let b = Names {
        vertices: "vertices_b",
        elements: "faces_b",
    };
    scene.add_welded(vertices_a, faces_a, kind(kind_a)?, a, weld)?;
    scene.add_welded(vertices_b, faces_b, kind(kind_b)?, b, weld)?;
    let question = PyDict::new(py);
    question.set_item("between", (0, 1))?;
    ask(py, scene, &question, settings)
}

/// Which primitives of one mesh intersect each other.
///
/// Parameters
/// ----------
/// vertices : array_like, shape (v, 3)
///     Positions, float32 or float64.
/// faces : array_like of int, shape (n, 3) or (n, 4)
///     Triangles or tetrahedra as vertex indices.
/// kind : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
///     What the rows of `faces` are, as for `Scene.add`.
/// shared_vertex : {"resolve", "skip"}
///     Primitives that share a vertex index are reported when they share more points than the vertices
///     they have in common, or never. Vertices at one position with different indices are not
///     shared, unless they are welded.
/// weld : bool
///     Whether vertices at the same position become one first, as `weld` does. Rows of the answer stay those of
///     `faces`; with it, the answer about the arrays of a file is that of the program ``impinge self``.
/// **settings
///     As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given: waking a GPU
///     does not pay for one question.
///
/// Returns
/// -------
/// numpy.ndarray of uint32, shape (n, 2)
///     Pairs of rows of `faces`, the lower one first; sorted.
///
/// Raises
/// ------
/// ValueError, TypeError
///     As `Scene.add` and `Detector`.
#[pyfunction]
#[pyo3(
    signature = (vertices, faces, shared_vertex=None, *, weld=false, kind=None, **settings),
    text_signature = "(vertices, faces, shared_vertex=\"resolve\", *, weld=False, kind=None, **settings)"
)]
pub fn self_pairs<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    shared_vertex: Argument<'py, 'py>,
    weld: bool,
    kind: Argument<'py, 'py>,
    settings: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let mut scene = Scene::empty();
    let names = Names {
        vertices: "vertices",
        elements: "faces",
    };
    scene.add_welded(vertices, faces, settings::kind(kind)?, names, weld)?;
    let question = PyDict::new(py);
    question.set_item("within", 0)?;
    question.set_item("shared_vertex", shared_vertex)?;
    ask(py, scene, &question, settings)
}

/// Vertices that stay, elements that name them, and the vertex that each vertex became.
type Welded<'py> = (
    Bound<'py, PyAny>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray1<u32>>,
);

/// Makes one vertex of all vertices at the same position.
///
/// Files such as STL, and meshes of renderers, repeat a vertex along each seam. Faces on both sides of a seam
/// then touch, but are no neighbours, because vertices are shared when their indices are equal.
///
/// Parameters
/// ----------
/// vertices : array_like, shape (v, 3)
///     Positions, float32 or float64. They are compared as numbers, without a tolerance; of equal ones the
///     first stays. NaN equals nothing.
/// faces : array_like of int, shape (n, k), k from 1 to 4
///     Elements of any kind as vertex indices.
///
/// Returns
/// -------
/// vertices : numpy.ndarray, shape (w, 3)
///     The vertices that stay, in their order and precision.
/// faces : numpy.ndarray of uint32, shape (n, k)
///     The same elements in the same order, with the indices of the vertices that stay.
/// map : numpy.ndarray of uint32, shape (v,)
///     For each vertex its index among those that stay. The positions of a later frame are welded by
///     ``positions[numpy.unique(map, return_index=True)[1]]``.
///
/// Raises
/// ------
/// ValueError, TypeError
///     As `Scene.add`.
///
/// Examples
/// --------
/// >>> import impinge
/// >>> soup = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
/// >>> vertices, faces, index = impinge.weld(soup, [[0, 1, 2], [3, 4, 5]])
/// >>> faces
/// array([[0, 1, 2],
///        [1, 3, 2]], dtype=uint32)
/// >>> index
/// array([0, 1, 2, 1, 3, 2], dtype=uint32)
#[pyfunction]
pub fn weld<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
) -> PyResult<Welded<'py>> {
    let positions = PositionArray::new(vertices, "vertices")?;
    let (mut indices, n_columns) =
        arrays::index_rows(faces, "faces", &[1, 2, 3, 4], positions.len())?;
    let (weld, welded) = welded(&positions)?;
    for index in &mut indices {
        *index = weld.index(*index);
    }
    let shape = [indices.len() / n_columns, n_columns];
    Ok((
        positions_array(py, &welded)?,
        PyArray1::from_vec(py, indices).reshape(shape)?,
        PyArray1::from_slice(py, weld.map()),
    ))
}

fn ask<'py>(
    py: Python<'py>,
    scene: Scene,
    question: &Bound<'py, PyDict>,
    settings: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let settings = match settings {
        Some(settings) => settings.copy()?,
        None => PyDict::new(py),
    };
    // Waking a GPU costs more than any single question.
    if !settings.contains("backend")? {
        settings.set_item("backend", "cpu")?;
    }
    let detector = py.get_type::<Detector>().call((), Some(&settings))?;
    let result = detector.call_method("detect", (Bound::new(py, scene)?,), Some(question))?;
    result.cast::<Answer>()?.get().pairs(py)
}

/// `Result.hash` of rows that come from elsewhere.
///
/// Parameters
/// ----------
/// rows : array_like of int, shape (n, 4)
///     As `Result.rows`. The order of rows does not matter; in each, the lower (body, primitive) comes first.
///
/// Returns
/// -------
/// int
#[pyfunction]
pub fn hash_rows(rows: &Bound<'_, PyAny>) -> PyResult<u64> {
    let rows = arrays::rows(rows, "rows", 4)?;
    Ok(impinge::hash_rows(rows.as_chunks().0.iter().copied()))
}
