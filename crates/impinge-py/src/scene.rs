//! `impinge.Scene`: bodies, their topology and positions.

use impinge::{BodyId, Elements, Filter, Kind, Positions, Real, Weld};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use crate::arrays::{self, PositionArray, RowKind, positions_array, slice_rows};
use crate::bodies::{Body, body_id, new_scene_number};
use crate::errors::{Names, raise, refuse};
use crate::lent;
use crate::meshes;
use crate::settings::{self, Argument, unsigned};

const ARGUMENTS: Names<'static> = Names {
    vertices: "vertices",
    elements: "faces",
};

/// Bodies with fixed topology, and where their vertices are now.
///
/// Examples
/// --------
/// >>> import numpy as np, impinge
/// >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
/// >>> scene = impinge.Scene()
/// >>> a = scene.add(corners, [[0, 1, 2]])
/// >>> b = scene.add(corners[:, [0, 2, 1]] + [0, 0.25, -0.25], [[0, 1, 2]])
/// >>> impinge.Detector().detect(scene, between=(a, b)).pairs()
/// array([[0, 0]], dtype=uint32)
#[pyclass(module = "impinge")]
pub struct Scene {
    pub inner: impinge::Scene,
    pub number: u64,
}

impl Scene {
    /// A scene without bodies.
    pub fn empty() -> Self {
        Scene {
            inner: impinge::Scene::new(),
            number: new_scene_number(),
        }
    }

    /// The body that an argument names.
    pub fn id(&self, argument: &Bound<'_, PyAny>, name: &str) -> PyResult<BodyId> {
        let id = body_id(
            argument,
            name,
            self.number,
            self.inner.bodies().map(|(id, _)| id),
        )?;
        self.inner.body(id).map_err(raise)?;
        Ok(id)
    }

    fn body(&self, argument: &Bound<'_, PyAny>) -> PyResult<&impinge::Body> {
        self.inner.body(self.id(argument, "body")?).map_err(raise)
    }

    fn handle(&self, id: BodyId) -> Body {
        Body {
            id,
            scene: self.number,
        }
    }

    /// Adds a body whose arguments go by other names in the caller's signature.
    pub fn add_named(
        &mut self,
        vertices: &Bound<'_, PyAny>,
        elements: &Bound<'_, PyAny>,
        kind: Option<RowKind>,
        names: Names<'_>,
    ) -> PyResult<BodyId> {
        self.add_welded(vertices, elements, kind, names, false)
    }

    /// As [`add_named`](Self::add_named); with `weld`, vertices at the same position become one.
    pub fn add_welded(
        &mut self,
        vertices: &Bound<'_, PyAny>,
        elements: &Bound<'_, PyAny>,
        kind: Option<RowKind>,
        names: Names<'_>,
        weld: bool,
    ) -> PyResult<BodyId> {
        let positions = PositionArray::new(vertices, names.vertices)?;
        let mut elements = arrays::elements(elements, names.elements, kind, positions.len())?;
        let held = if weld {
            let (weld, welded) = welded(&positions)?;
            elements = apply(&weld, &elements);
            welded
        } else {
            stored(&positions)?
        };
        self.inner
            .add(elements, held)
            .map_err(|error| refuse(error, names))
    }
}

/// A welding of vertices at the same position, and the positions that stay.
pub fn welded(positions: &PositionArray<'_>) -> PyResult<(Weld, Positions)> {
    fn welded<R: Real>(positions: &[[R; 3]]) -> PyResult<(Weld, Positions)> {
        let weld = Weld::by_position(positions);
        let welded = weld
            .positions(positions)
            .map_err(|error| raise(error.into()))?;
        Ok((weld, welded.into()))
    }
    match positions {
        PositionArray::F32(array) => welded::<f32>(slice_rows(array)?),
        PositionArray::F64(array) => welded::<f64>(slice_rows(array)?),
    }
}

/// Elements with the indices of welded vertices.
fn apply(weld: &Weld, elements: &Elements) -> Elements {
    match elements {
        Elements::Points(points) => Elements::Points(weld.apply(points)),
        Elements::Edges(edges) => Elements::Edges(weld.apply(edges)),
        Elements::Triangles(faces) => Elements::Triangles(weld.apply(faces)),
        Elements::Tetrahedra(tets) => Elements::Tetrahedra(weld.apply(tets)),
    }
}

fn stored(positions: &PositionArray<'_>) -> PyResult<Positions> {
    Ok(match positions {
        PositionArray::F32(array) => Positions::F32(slice_rows(array)?.to_vec().into()),
        PositionArray::F64(array) => Positions::F64(slice_rows(array)?.to_vec().into()),
    })
}

/// How deep two convex bodies overlap, which way, and where.
type Overlap = (f64, [f64; 3], [f64; 3]);

/// Borrows a scene to change it; a detection in another thread may be reading it.
fn change<'py>(scene: &Bound<'py, Scene>) -> PyResult<PyRefMut<'py, Scene>> {
    scene.try_borrow_mut().map_err(|_| {
        PyRuntimeError::new_err("the scene is being read by a detection: wait for it to end")
    })
}

#[pymethods]
impl Scene {
    #[new]
    fn new() -> Self {
        Scene::empty()
    }

    /// Adds a body of triangles or tetrahedra. The arrays are copied.
    ///
    /// Parameters
    /// ----------
    /// vertices : array_like, shape (v, 3), or a mesh
    ///     Positions. float32 and float64 are taken as they are and answered exactly; other
    ///     dtypes are converted where that loses nothing. Or, without `faces`, an object with ``vertices`` and
    ///     ``faces`` (trimesh and many others) or ``triangles`` (Open3D), or with ``points`` and ``cells_dict``
    ///     (meshio).
    /// faces : array_like of int, shape (n, 3) or (n, 4), optional
    ///     Vertex indices: three per triangle, four per tetrahedron. Orientation does not matter.
    /// kind : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
    ///     What the rows of `faces` are. ``"quads"`` cuts row ``i`` into the triangles ``2 * i`` and ``2 * i + 1``,
    ///     along the diagonal from its first corner. By default three columns are triangles, and four are
    ///     tetrahedra if two rows share exactly three vertices, as neighbours in a mesh of tetrahedra do and quads do
    ///     not; else four columns are refused.
    ///
    /// Returns
    /// -------
    /// Body
    ///     The handle by which the body is named from now on.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A wrong shape, an index out of range, a position that is not finite or outside the
    ///     range in which answers are exact, a number that a conversion would change, rows of four that may be quads,
    ///     a mesh with cells of several kinds.
    /// TypeError
    ///     An array that holds no real numbers, an object that is no mesh.
    #[pyo3(signature = (vertices, faces=None, kind=None))]
    fn add(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyAny>,
        faces: Argument<'_, '_>,
        kind: Argument<'_, '_>,
    ) -> PyResult<Body> {
        let kind = settings::kind(kind)?;
        let id = match faces {
            Some(faces) => change(slf)?.add_named(vertices, faces, kind, ARGUMENTS)?,
            None => {
                let mesh = meshes::parts(vertices, kind)?;
                change(slf)?.add_named(&mesh.vertices, &mesh.elements, mesh.kind, mesh.names)?
            }
        };
        Ok(slf.try_borrow()?.handle(id))
    }

    /// Adds many bodies in one call: all of them, or none. The arrays are copied.
    ///
    /// Parameters
    /// ----------
    /// vertices : array_like, shape (v, 3)
    ///     The positions of all bodies, one after the other.
    /// faces : array_like of int, shape (n, 3) or (n, 4)
    ///     The elements of all bodies, one after the other. Each names the vertices of its own body, from 0.
    /// vertex_offsets, face_offsets : array_like of int, shape (m + 1,)
    ///     Body ``i`` of ``m`` has the rows ``offsets[i]`` to ``offsets[i + 1]``: they begin with 0, never fall, and end
    ///     with the number of rows.
    /// kind : str, optional
    ///     As for `add`, but for ``"quads"``, which is refused.
    ///
    /// Returns
    /// -------
    /// list of Body
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `add`; the scene is unchanged then. Bodies are named by the number that they would have had.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, impinge
    /// >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    /// >>> scene = impinge.Scene()
    /// >>> parts = scene.add_many(np.tile(corners, (1000, 1)), [[0, 1, 2]] * 1000,
    /// ...                        np.arange(1001) * 3, np.arange(1001))
    /// >>> len(parts), parts[999]
    /// (1000, Body(999))
    #[pyo3(signature = (vertices, faces, vertex_offsets, face_offsets, kind=None))]
    fn add_many(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        vertex_offsets: &Bound<'_, PyAny>,
        face_offsets: &Bound<'_, PyAny>,
        kind: Argument<'_, '_>,
    ) -> PyResult<Vec<Body>> {
        let kind = settings::kind(kind)?;
        if kind == Some(RowKind::Quads) {
            return Err(PyValueError::new_err(
                "kind: \"quads\" given, which would move the offsets; cut them into triangles first",
            ));
        }
        let positions = PositionArray::new(vertices, "vertices")?;
        let elements = arrays::elements(faces, "faces", kind, positions.len())?;
        let of_vertices = arrays::offsets(vertex_offsets, "vertex_offsets")?;
        let of_faces = arrays::offsets(face_offsets, "face_offsets")?;
        let mut scene = change(slf)?;
        let inner = &mut scene.inner;
        let ids = match &positions {
            PositionArray::F32(array) => {
                let rows = slice_rows::<f32, 3>(array)?;
                inner.add_many(&elements, &of_faces, rows, &of_vertices)
            }
            PositionArray::F64(array) => {
                let rows = slice_rows::<f64, 3>(array)?;
                inner.add_many(&elements, &of_faces, rows, &of_vertices)
            }
        };
        let ids = ids.map_err(|error| match error {
            impinge::Error::Setting {
                setting: "element_offsets",
                given,
                allowed,
            } => PyValueError::new_err(format!("face_offsets: {given} given, {allowed} allowed")),
            error => raise(error),
        })?;
        Ok(ids.into_iter().map(|id| scene.handle(id)).collect())
    }

    /// Adds a body of edges, such as strands of hair. The arrays are copied.
    ///
    /// Parameters
    /// ----------
    /// vertices : array_like, shape (v, 3)
    ///     As for `add`.
    /// edges : array_like of int, shape (n, 2)
    ///     Vertex indices.
    ///
    /// Returns
    /// -------
    /// Body
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `add`.
    fn add_edges(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyAny>,
        edges: &Bound<'_, PyAny>,
    ) -> PyResult<Body> {
        let names = Names {
            vertices: "vertices",
            elements: "edges",
        };
        let mut scene = change(slf)?;
        let id = scene.add_named(vertices, edges, Some(RowKind::Of(Kind::Edges)), names)?;
        Ok(scene.handle(id))
    }

    /// Adds a body of points, one per row. The array is copied.
    ///
    /// Parameters
    /// ----------
    /// vertices : array_like, shape (v, 3)
    ///     As for `add`.
    ///
    /// Returns
    /// -------
    /// Body
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `add`.
    fn add_points(slf: &Bound<'_, Self>, vertices: &Bound<'_, PyAny>) -> PyResult<Body> {
        let mut scene = change(slf)?;
        let positions = PositionArray::new(vertices, "vertices")?;
        let id = match &positions {
            PositionArray::F32(array) => scene.inner.add_points::<f32>(slice_rows(array)?),
            PositionArray::F64(array) => scene.inner.add_points::<f64>(slice_rows(array)?),
        }
        .map_err(|error| refuse(error, ARGUMENTS))?;
        Ok(scene.handle(id))
    }

    /// Moves the vertices of a body. The array is copied; the precision may change. A new step starts: the
    /// body has no end positions until they are set.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// vertices : array_like, shape (v, 3)
    ///     As many positions as the body has vertices.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `add`; the body keeps its old positions then.
    fn set_positions(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let positions = PositionArray::new(vertices, "vertices")?;
        match &positions {
            PositionArray::F32(array) => scene.inner.set_positions::<f32>(id, slice_rows(array)?),
            PositionArray::F64(array) => scene.inner.set_positions::<f64>(id, slice_rows(array)?),
        }
        .map_err(|error| refuse(error, ARGUMENTS))
    }

    /// Moves the vertices of a body to those of a read-only array, which is neither copied nor let go of: the scene
    /// reads it where it lies until the body gets other positions or is removed, or the scene is gone. As `set_positions` otherwise;
    /// the positions are checked now.
    ///
    /// The array must not change while it is lent. Arrays that can be written, and views of such, are refused. That
    /// is all that can be checked: whoever writes to the memory in another way, through a view made before or by making the
    /// array writeable again, gets answers about no one pose, and may read torn numbers.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// vertices : numpy.ndarray of float32 or float64, shape (v, 3)
    ///     In C order, with ``vertices.flags.writeable`` False, and so for the array that it is a view of.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `add`; an array that can be written or would have to be copied. The body keeps its old positions then.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, impinge
    /// >>> scene = impinge.Scene()
    /// >>> corners = np.eye(3, dtype=np.float32)
    /// >>> body = scene.add(corners, [[0, 1, 2]])
    /// >>> frame = corners + np.float32(1)
    /// >>> frame.flags.writeable = False
    /// >>> scene.lend_positions(body, frame)
    /// >>> scene.positions(body)[0].tolist()
    /// [2.0, 1.0, 1.0]
    fn lend_positions(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let positions = PositionArray::new(vertices, "vertices")?;
        let lent = lent::positions(vertices, &positions, "vertices")?;
        let lending = scene.inner.lend_positions(id, lent);
        lending.map_err(|error| refuse(error, ARGUMENTS))
    }

    /// Says where the vertices of a body are at the end of a step, as `set_end_positions` does, by a read-only array that
    /// is not copied, as for `lend_positions`. Where start and end come in different precisions, the single one is copied.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// vertices : numpy.ndarray of float32 or float64, shape (v, 3)
    ///     As for `lend_positions`.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `lend_positions`; the body keeps its old end positions then.
    fn lend_end_positions(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let positions = PositionArray::new(vertices, "vertices")?;
        let lent = lent::positions(vertices, &positions, "vertices")?;
        let lending = scene.inner.lend_end_positions(id, lent);
        lending.map_err(|error| refuse(error, ARGUMENTS))
    }

    /// Says where the vertices of a body are at the end of a step: between its positions and these, each moves
    /// on a straight line at constant speed. They hold until the next `set_positions`, `remesh` or
    /// `clear_end_positions`. A body without end positions stands still.
    ///
    /// Where start and end come in different precisions, the single one is widened, which is exact.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// vertices : array_like, shape (v, 3)
    ///     As many positions as the body has vertices. The array is copied.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `add`; the body keeps its old end positions then.
    fn set_end_positions(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let positions = PositionArray::new(vertices, "vertices")?;
        let inner = &mut scene.inner;
        match &positions {
            PositionArray::F32(array) => inner.set_end_positions::<f32>(id, slice_rows(array)?),
            PositionArray::F64(array) => inner.set_end_positions::<f64>(id, slice_rows(array)?),
        }
        .map_err(|error| refuse(error, ARGUMENTS))
    }

    /// Forgets where a body is at the end of a step: it stands still.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    fn clear_end_positions(slf: &Bound<'_, Self>, body: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        scene.inner.clear_end_positions(id).map_err(raise)
    }

    /// Gives a body new topology and positions under its old handle.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// vertices, faces, kind
    ///     As in `add`.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `add`; the body is unchanged then.
    #[pyo3(signature = (body, vertices, faces, kind=None))]
    fn remesh(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        kind: Argument<'_, '_>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let positions = PositionArray::new(vertices, ARGUMENTS.vertices)?;
        let kind = settings::kind(kind)?;
        let elements = arrays::elements(faces, ARGUMENTS.elements, kind, positions.len())?;
        scene
            .inner
            .remesh(id, elements, stored(&positions)?)
            .map_err(|error| refuse(error, ARGUMENTS))
    }

    /// Moves a body by an affine matrix, such as a rigid motion, without its vertices being given again.
    ///
    /// The body moves from its rest positions, which are those that were given last (`add`, `set_positions`, `remesh`);
    /// a second transform replaces the first. Answers are exact as if the moved vertices had been given, and these are
    /// rounded in one way: row ``a, b, c, d`` of the matrix takes ``(x, y, z)`` to ``((a*x + b*y) + c*z) + d``, each
    /// product and each sum rounded to float64 in this order, the last sum rounded once more to the dtype of the
    /// rest positions. End positions are forgotten.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// matrix : array_like, shape (4, 4)
    ///     In float64. The last row is ``0, 0, 0, 1``.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     A matrix of another shape, not finite, or not affine; a moved position that is refused. The body is
    ///     unchanged then.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, impinge
    /// >>> scene = impinge.Scene()
    /// >>> body = scene.add(np.eye(3, dtype=np.float32), [[0, 1, 2]])
    /// >>> up = np.eye(4)
    /// >>> up[2, 3] = 0.5
    /// >>> scene.set_transform(body, up)
    /// >>> scene.positions(body)[2].tolist(), scene.rest_positions(body)[2].tolist()
    /// ([0.0, 0.0, 1.5], [0.0, 0.0, 1.0])
    fn set_transform(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        matrix: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let matrix = arrays::matrix(matrix, "matrix")?;
        scene
            .inner
            .set_transform(id, &matrix)
            .map_err(|error| match error {
                impinge::Error::Setting { given, allowed, .. } => {
                    PyValueError::new_err(format!("matrix: {given} given, {allowed} allowed"))
                }
                error => raise(error),
            })
    }

    /// How a body was moved by `set_transform`.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of float64, shape (4, 4), or None
    ///     ``None`` for a body that was not, or whose positions were given since.
    fn transform<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let matrix = self.body(body)?.transform();
        let flat = matrix.map(|rows| PyArray1::from_slice(py, rows.as_flattened()));
        flat.map(|flat| Ok(flat.reshape([4, 4])?.into_any()))
            .transpose()
    }

    /// The positions that were given last, before any transform.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray, shape (v, 3), float32 or float64
    ///     A copy.
    fn rest_positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        positions_array(py, self.body(body)?.rest_positions())
    }

    /// Removes a body. Its handle is refused from now on; its number may be used again.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    fn remove(slf: &Bound<'_, Self>, body: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        scene.inner.remove(id).map_err(raise)
    }

    /// Sets who a body meets when a question is about all bodies.
    ///
    /// Two bodies meet when each one's `category` shares a bit with the other one's `mask`.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// category : int, 64 bits
    ///     The groups to which the body belongs.
    /// mask : int, 64 bits
    ///     The groups that it meets; all of them by default.
    #[pyo3(signature = (body, category=None, mask=None))]
    fn set_filter(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        category: Argument<'_, '_>,
        mask: Argument<'_, '_>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let mut filter = Filter::default();
        if let Some(category) = category {
            filter.category = unsigned(category, "category", u64::MAX)?;
        }
        if let Some(mask) = mask {
            filter.mask = unsigned(mask, "mask", u64::MAX)?;
        }
        scene.inner.set_filter(id, filter).map_err(raise)
    }

    /// The current positions of a body.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray, shape (v, 3), float32 or float64
    ///     A copy, in the precision in which they were given.
    fn positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        positions_array(py, self.body(body)?.positions())
    }

    /// The end positions of a body.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray, shape (v, 3), float32 or float64, or None
    ///     A copy; ``None`` for a body that stands still.
    fn end_positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let end = self.body(body)?.end_positions();
        end.map(|end| positions_array(py, end)).transpose()
    }

    /// The elements of a body as vertex indices.
    ///
    /// Parameters
    /// ----------
    /// body : Body or int
    /// part : {"given", "vertices", "edges", "faces"}
    ///     Those that it was given as, or its vertices, edges or faces, as `Impacts.elements` numbers the last
    ///     two. Edges are the unique pairs (low, high) of vertices in the order of (high, low), as
    ///     ``igl.edges`` has them; of tetrahedra the surface counts. ``"vertices"`` are those that some element
    ///     names; impacts number vertices as positions are.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of uint32, shape (n, 1), (n, 2), (n, 3) or (n, 4)
    ///     A copy.
    #[pyo3(signature = (body, part=None), text_signature = "($self, body, part=\"given\")")]
    fn elements<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
        part: Argument<'py, 'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let elements = self.body(body)?.part(settings::part(part)?);
        let (flat, n_columns) = match elements {
            Elements::Points(points) => (points.as_flattened(), 1),
            Elements::Edges(edges) => (edges.as_flattened(), 2),
            Elements::Triangles(faces) => (faces.as_flattened(), 3),
            Elements::Tetrahedra(tets) => (tets.as_flattened(), 4),
        };
        let shape = [elements.len(), n_columns];
        Ok(PyArray1::from_slice(py, flat).reshape(shape)?.into_any())
    }

    /// ``"points"``, ``"edges"``, ``"triangles"`` or ``"tetrahedra"``: what a body is made of.
    fn kind(&self, body: &Bound<'_, PyAny>) -> PyResult<&'static str> {
        Ok(self.body(body)?.kind().name())
    }

    /// How many primitives a body has.
    fn n_primitives(&self, body: &Bound<'_, PyAny>) -> PyResult<usize> {
        Ok(self.body(body)?.n_primitives())
    }

    /// The shortest way that takes two convex bodies apart, for `CollisionManager`: its length, its direction for the second body,
    /// and the position of the vertex of the first that is farthest along it. ``None`` where they are flat.
    fn _convex_overlap(
        &self,
        py: Python<'_>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
    ) -> PyResult<Option<Overlap>> {
        let bodies = [self.body(a)?, self.body(b)?];
        Ok(py.detach(|| {
            let [a, b] = bodies.map(|body| -> Vec<[f64; 3]> {
                let vertices = 0..body.n_vertices();
                vertices.map(|ix| body.positions().point(ix)).collect()
            });
            let found = impinge::contact::convex_overlap(&a, &b)?;
            Some((found.depth, found.normal, a[found.vertex]))
        }))
    }

    /// How many vertices a body has.
    fn n_vertices(&self, body: &Bound<'_, PyAny>) -> PyResult<usize> {
        Ok(self.body(body)?.n_vertices())
    }

    /// list of Body : the bodies in the order of their numbers.
    #[getter]
    fn bodies(&self) -> Vec<Body> {
        self.inner.bodies().map(|(id, _)| self.handle(id)).collect()
    }

    /// int : bytes held for topology and positions.
    #[getter]
    fn nbytes(&self) -> usize {
        self.inner.bytes()
    }

    fn __len__(&self) -> usize {
        self.inner.n_bodies()
    }

    fn __contains__(&self, body: &Bound<'_, PyAny>) -> bool {
        self.id(body, "body").is_ok()
    }

    fn __repr__(&self) -> String {
        const SHOWN: usize = 6;
        let bodies = self.inner.bodies();
        let counts = bodies.map(|(id, body)| (id, body.n_primitives(), body.kind().name()));
        if self.inner.n_bodies() <= SHOWN {
            let each = counts.map(|(id, n, kind)| format!("{id}: {n} {kind}"));
            return format!("Scene({})", each.collect::<Vec<_>>().join(", "));
        }
        let mut totals = Kind::ALL.map(|kind| (kind.name(), 0));
        for (_, n, kind) in counts {
            for total in totals.iter_mut().filter(|total| total.0 == kind) {
                total.1 += n;
            }
        }
        let totals = totals.iter().filter(|(_, n)| *n > 0);
        let totals: Vec<String> = totals.map(|(kind, n)| format!("{n} {kind}")).collect();
        format!(
            "Scene({} bodies: {})",
            self.inner.n_bodies(),
            totals.join(", ")
        )
    }

    /// Pickles, and copies, hold all bodies under their numbers. Handles of the bodies are those of the scene that they
    /// came from.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let scene = slf.try_borrow()?;
        let bodies = PyList::empty(py);
        for (id, body) in scene.inner.bodies() {
            let number = id.index().into_pyobject(py)?;
            let filter = body.filter();
            bodies.append((
                id.index(),
                body.kind().name(),
                positions_array(py, body.rest_positions())?,
                scene.elements(py, &number, None)?,
                scene.transform(py, &number)?,
                scene.end_positions(py, &number)?,
                filter.category,
                filter.mask,
            ))?;
        }
        (slf.get_type(), (), bodies).into_pyobject(py)
    }

    fn __setstate__(slf: &Bound<'_, Self>, bodies: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut scene = change(slf)?;
        let mut gaps = Vec::new();
        for state in bodies.try_iter()? {
            let state = state?;
            let item = |ix: usize| state.get_item(ix);
            // Numbers of bodies that were removed are left free.
            let number: usize = item(0)?.extract()?;
            while scene.inner.n_bodies() < number {
                gaps.push(scene.inner.add_points::<f32>(&[]).map_err(raise)?);
            }
            let (kind, vertices, elements) = (item(1)?, item(2)?, item(3)?);
            let kind = settings::kind(Some(&kind))?;
            let id = scene.add_named(&vertices, &elements, kind, ARGUMENTS)?;
            let (matrix, end) = (item(4)?, item(5)?);
            if !matrix.is_none() {
                let matrix = arrays::matrix(&matrix, "matrix")?;
                scene.inner.set_transform(id, &matrix).map_err(raise)?;
            }
            if !end.is_none() {
                match PositionArray::new(&end, "vertices")? {
                    PositionArray::F32(end) => {
                        scene.inner.set_end_positions::<f32>(id, slice_rows(&end)?)
                    }
                    PositionArray::F64(end) => {
                        scene.inner.set_end_positions::<f64>(id, slice_rows(&end)?)
                    }
                }
                .map_err(raise)?;
            }
            let filter = Filter {
                category: item(6)?.extract()?,
                mask: item(7)?.extract()?,
            };
            scene.inner.set_filter(id, filter).map_err(raise)?;
        }
        for id in gaps.into_iter().rev() {
            scene.inner.remove(id).map_err(raise)?;
        }
        Ok(())
    }
}
