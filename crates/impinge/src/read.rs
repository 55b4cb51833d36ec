//! Meshes from files.

use std::path::Path;

use impinge_core::{Error, Mesh};
use impinge_io::{Elements, Positions, ReadOptions};

/// Reads a mesh from a file; its extension decides the format: OBJ, PLY, STL, OFF, glTF, MSH,
/// MEDIT, VTK, VTU or TetGen.
///
/// Vertices at the same position become one, as in all that reads files: [`Mesh::n_welded`] says
/// how many there were, and [`Mesh::notes`] what was left out. A file with tetrahedra is a mesh of these, else of its triangles. The crate
/// `impinge-io` reads bodies apart, sequences of frames and bytes, and has other options.
///
/// ```no_run
/// use impinge::{Backend, Detector, Query, Scene, read};
/// # fn main() -> Result<(), impinge::Error> {
/// let mut scene = Scene::new();
/// let (a, b) = (scene.add(read("a.obj")?)?, scene.add(read("b.stl")?)?);
/// println!("{}", Detector::new(Backend::Auto)?.any(&scene, &Query::between(a, b))?);
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`Error::File`]: no such file, a format that is not known, or bad content, with the line or the byte.
pub fn read(path: impl AsRef<Path>) -> Result<Mesh, Error> {
    let (mesh, summary) = impinge_io::read_with_summary(path.as_ref(), &ReadOptions::default())
        .map_err(|error| Error::File(error.to_string()))?;
    let elements: impinge_core::Elements = match mesh.elements {
        Elements::Triangles(faces) => faces.into(),
        Elements::Tetrahedra(tetrahedra) => tetrahedra.into(),
    };
    let positions: impinge_core::Positions = match mesh.positions {
        Positions::F32(positions) => positions.into(),
        Positions::F64(positions) => positions.into(),
    };
    let mut mesh = Mesh::from((elements, positions));
    mesh.n_welded = usize::try_from(summary.n_welded).unwrap_or(usize::MAX);
    mesh.notes = summary.notes();
    Ok(mesh)
}
