//! Meshes from files.

use std::path::PathBuf;

use impinge_io::{Elements, Error, NamedMesh, Positions, ReadOptions, Summary};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;

use crate::errors::invalid;

use crate::arrays::{RowKind, positions_array};
use crate::settings::flags;

/// A mesh that was read from a file. `Scene.add` takes it as it is.
#[pyclass(module = "impinge", frozen)]
pub struct Mesh {
    vertices: Py<PyAny>,
    faces: Py<PyArray2<u32>>,
    kind: impinge::BodyKind,
    name: String,
    n_welded: usize,
    notes: Vec<String>,
}

impl Mesh {
    /// What the rows of its faces are.
    pub fn kind(&self) -> RowKind {
        RowKind::Of(self.kind)
    }
}

/// Vertices, faces, name, how many vertices were welded, and notes.
type Parts = (Py<PyAny>, Py<PyArray2<u32>>, String, usize, Vec<String>);

#[pymethods]
impl Mesh {
    /// numpy.ndarray, shape (v, 3) : positions, in the precision of the file; numbers in text are
    /// float64.
    #[getter]
    fn vertices(&self, py: Python<'_>) -> Py<PyAny> {
        self.vertices.clone_ref(py)
    }

    /// numpy.ndarray of uint32, shape (n, 3) or (n, 4) : triangles or tetrahedra as vertex indices,
    /// in the order of the file.
    #[getter]
    fn faces(&self, py: Python<'_>) -> Py<PyArray2<u32>> {
        self.faces.clone_ref(py)
    }

    /// str : ``"triangles"`` or ``"tetrahedra"``.
    #[getter(kind)]
    fn kind_name(&self) -> &'static str {
        self.kind.name()
    }

    /// str : the path as given, or the name of a node or a group.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// int : vertices that welding removed.
    #[getter]
    fn n_welded(&self) -> usize {
        self.n_welded
    }

    /// list of str : what of the file was left out or changed: lines skipped, polygons split into
    /// triangles. Of bodies that were read apart, that of the whole file.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// Pickles and copies hold the same arrays.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let make = py.import("impinge._impinge")?.getattr("_mesh")?;
        let faces = self.faces(py);
        let (name, notes) = (self.name.clone(), self.notes.clone());
        let parts = (self.vertices(py), faces, name, self.n_welded, notes);
        Ok((make, parts))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let n = |array: &Bound<'_, PyAny>| array.len();
        Ok(format!(
            "Mesh({:?}, {} vertices, {} {}, {} welded)",
            self.name,
            n(self.vertices.bind(py))?,
            n(self.faces.bind(py))?,
            self.kind.name(),
            self.n_welded
        ))
    }
}

/// A mesh of the parts that a pickle holds.
#[pyfunction]
pub fn _mesh(
    vertices: Py<PyAny>,
    faces: Bound<'_, PyArray2<u32>>,
    name: String,
    n_welded: usize,
    notes: Vec<String>,
) -> Mesh {
    let kind = match faces.dims()[1] {
        4 => impinge::BodyKind::Tetrahedra,
        _ => impinge::BodyKind::Triangles,
    };
    Mesh {
        vertices,
        faces: faces.unbind(),
        kind,
        name,
        n_welded,
        notes,
    }
}

/// Reads a mesh file: OBJ, PLY, STL, OFF, glTF/GLB, 3MF, MSH, VTK, VTU, Medit or TetGen.
///
/// All bodies, groups and nodes of a file become one mesh; `read_bodies` tells them apart.
///
/// Parameters
/// ----------
/// path : path
///     Its extension says which format it is.
/// weld : bool
///     Whether vertices at the same position become one, as in the program. Many files repeat a vertex along
///     each seam, so that neighbours share none.
///
/// Returns
/// -------
/// Mesh
///     With ``vertices``, ``faces``, ``kind``, ``name``, ``n_welded`` and ``notes``.
///
/// Raises
/// ------
/// OSError, ValueError
///     A file that cannot be read, or is refused: the message names the file, the line or byte, and both numbers.
#[pyfunction]
#[pyo3(signature = (path, *, weld=true))]
pub fn read(
    py: Python<'_>,
    path: PathBuf,
    #[pyo3(from_py_with = flags::weld)] weld: bool,
) -> PyResult<Mesh> {
    let read = py.detach(|| impinge_io::read_with_summary(&path, &options(weld)));
    let (mesh, summary) = read.map_err(refuse)?;
    let name = path.display().to_string();
    let n_welded = usize::try_from(summary.n_welded).unwrap_or(usize::MAX);
    let mesh = NamedMesh::whole(None, mesh);
    to_python(py, mesh, &name, n_welded, &summary)
}

/// Reads the bodies of a file, each as a mesh of its own.
///
/// The bodies of a glTF file are its nodes that have a mesh; those of an OBJ file its objects
/// (``o``), or its groups (``g``) if it has no objects; faces before the first of them are one named
/// ``default``. A file of another format, or with one body, is a list of one mesh.
///
/// Parameters
/// ----------
/// path : path
///     As for `read`.
/// weld : bool
///     As for `read`, within each body.
///
/// Returns
/// -------
/// list of Mesh
///     With the names of nodes or groups, or the path where the only body has no name, in the order of the file.
///     Rows of ``faces`` are numbered within each body.
///
/// Raises
/// ------
/// OSError, ValueError
///     As `read`.
#[pyfunction]
#[pyo3(signature = (path, *, weld=true))]
pub fn read_bodies(
    py: Python<'_>,
    path: PathBuf,
    #[pyo3(from_py_with = flags::weld)] weld: bool,
) -> PyResult<Vec<Mesh>> {
    let read = py.detach(|| {
        let (mut bodies, summary) = impinge_io::read_bodies(&path, &options(false))?;
        let n_welded = bodies.iter_mut().map(|body| match weld {
            true => impinge_io::weld(&mut body.mesh),
            false => 0,
        });
        let n_welded: Vec<usize> = n_welded.collect();
        Ok((bodies, n_welded, summary))
    });
    let (bodies, n_welded, summary) = read.map_err(refuse)?;
    let name = path.display().to_string();
    let bodies = bodies.into_iter().zip(n_welded);
    bodies
        .map(|(body, n_welded)| to_python(py, body, &name, n_welded, &summary))
        .collect()
}

fn options(weld: bool) -> ReadOptions {
    ReadOptions {
        weld,
        ..ReadOptions::default()
    }
}

fn refuse(error: Error) -> PyErr {
    match error {
        // With an errno, Python picks the class: FileNotFoundError, PermissionError, …
        Error::Io { path, source, .. } if source.raw_os_error().is_some() => {
            let text = source.to_string();
            let text = text
                .split(" (os error")
                .next()
                .unwrap_or_default()
                .to_owned();
            PyOSError::new_err((source.raw_os_error(), text, path.into_os_string()))
        }
        Error::Io { .. } => PyOSError::new_err(error.to_string()),
        error => invalid(error.to_string()),
    }
}

fn to_python(
    py: Python<'_>,
    body: NamedMesh,
    file: &str,
    n_welded: usize,
    summary: &Summary,
) -> PyResult<Mesh> {
    let NamedMesh { name, mesh, .. } = body;
    let positions: impinge::Positions = match mesh.positions {
        Positions::F32(positions) => positions.into(),
        Positions::F64(positions) => positions.into(),
    };
    let (kind, n_columns) = match mesh.elements {
        Elements::Triangles(_) => (impinge::BodyKind::Triangles, 3),
        Elements::Tetrahedra(_) => (impinge::BodyKind::Tetrahedra, 4),
    };
    let indices = PyArray1::from_slice(py, mesh.elements.indices());
    let faces = indices.reshape([mesh.elements.len(), n_columns])?;
    Ok(Mesh {
        vertices: positions_array(py, &positions)?.unbind(),
        faces: faces.unbind(),
        kind,
        name: name.unwrap_or_else(|| file.to_owned()),
        n_welded,
        notes: summary.notes(),
    })
}
