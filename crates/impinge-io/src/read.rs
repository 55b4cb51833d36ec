//! Reading a mesh: by path or from bytes.

use std::path::Path;

use crate::bodies::NamedMesh;
use crate::collect::Collector;
use crate::encoding::check_encoding;
use crate::error::{Error, Name, Place};
use crate::files::{Source, folder_of};
use crate::format::Format;
use crate::formats::{gltf, medit, msh, obj, off, ply, stl, tetgen, threemf, vtk, vtu};
use crate::mesh::Mesh;
use crate::options::{ReadOptions, Summary};

/// Reads the mesh at `path`; the extension decides the format ([`Format::from_path`]).
///
/// All bodies, groups and nodes of a file become one mesh; [`read_bodies`] tells them apart. `path`
/// may be either of TetGen's two files; the other must lie beside it. Only regular files are read.
/// Files that belong to the mesh file must lie in its folder or below, after resolving links.
///
/// # Errors
/// Any [`Error`] except [`Error::Mismatch`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<Mesh, Error> {
    Ok(read_with_summary(path, options)?.0)
}

/// Like [`read`], and also returns what was fanned, skipped and welded.
///
/// # Errors
/// As [`read`].
pub fn read_with_summary(path: &Path, options: &ReadOptions) -> Result<(Mesh, Summary), Error> {
    collect_file(path, options, |parts| parts.finish(options))
}

/// Reads the bodies of the file at `path`, each as a mesh of its own: the nodes of a glTF file that
/// have a mesh; the items of a 3MF file; the objects (`o`) of an OBJ file, or its groups (`g`) if
/// it has no objects; faces before the first of them are a body named `default`. Other files, files
/// with tetrahedra and files with only one such part are one body, which has the name of its part,
/// if it has one.
///
/// The elements of a body are numbered from 0, in the order of the file. Vertices that bodies
/// share are in each of them.
///
/// # Errors
/// As [`read`].
pub fn read_bodies(path: &Path, options: &ReadOptions) -> Result<(Vec<NamedMesh>, Summary), Error> {
    collect_file(path, options, |parts| parts.finish_bodies(options))
}

/// Like [`read_bodies`], from the bytes of a file.
///
/// # Errors
/// As [`read_bytes`].
pub fn read_bodies_bytes(
    bytes: &[u8],
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<(Vec<NamedMesh>, Summary), Error> {
    collect_bytes(bytes, format, Name(name), None, options)?.finish_bodies(options)
}

/// Reads a mesh from the bytes of a file. Errors use `name` for the file.
///
/// # Errors
/// As [`read`]. A mesh in several files can't be read this way ([`Error::Unsupported`]): TetGen
/// (see [`read_tetgen_bytes`]) and glTF with buffers in other files.
pub fn read_bytes(
    bytes: &[u8],
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<Mesh, Error> {
    Ok(read_bytes_with_summary(bytes, format, name, options)?.0)
}

/// Like [`read_bytes`], and also returns what was fanned, skipped and welded.
///
/// # Errors
/// As [`read_bytes`].
pub fn read_bytes_with_summary(
    bytes: &[u8],
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<(Mesh, Summary), Error> {
    collect_bytes(bytes, format, Name(name), None, options)?.finish(options)
}

/// Reads a TetGen mesh from the bytes of its `.node` file and of its `.ele` or `.face` file; the
/// extension of `cells_name` says which of these it is. Errors use the given names for the files.
///
/// # Errors
/// As [`read`].
pub fn read_tetgen_bytes(
    nodes: &[u8],
    nodes_name: &str,
    cells: &[u8],
    cells_name: &str,
    options: &ReadOptions,
) -> Result<Mesh, Error> {
    Ok(
        tetgen::read(nodes, Name(nodes_name), cells, Name(cells_name))?
            .finish(options)?
            .0,
    )
}

/// Gives all parts of the file at `path` to `then`, before any of them is chosen. A file without
/// elements is not an error here.
pub(crate) fn collect_file<T>(
    path: &Path,
    options: &ReadOptions,
    then: impl FnOnce(Collector) -> Result<T, Error>,
) -> Result<T, Error> {
    collect(Source::Named(path), options, then)
}

/// Like [`collect_file`], for a file that the caller or a pattern named.
pub(crate) fn collect<T>(
    source: Source,
    options: &ReadOptions,
    then: impl FnOnce(Collector) -> Result<T, Error>,
) -> Result<T, Error> {
    let path = source.path();
    let folder = folder_of(path);
    let format = Format::from_path(path)?;
    if format == Format::Tetgen {
        let (nodes_path, cells_path) = tetgen::paths(path);
        let of = |companion| match companion == path {
            true => source,
            false => Source::Beside(companion, folder),
        };
        let nodes = of(&nodes_path).read(options)?;
        let cells = of(&cells_path).read(options)?;
        let (nodes_name, cells_name) = (
            nodes_path.display().to_string(),
            cells_path.display().to_string(),
        );
        return then(tetgen::read(
            &nodes,
            Name(&nodes_name),
            &cells,
            Name(&cells_name),
        )?);
    }
    let bytes = source.read(options)?;
    let name = path.display().to_string();
    then(collect_bytes(
        &bytes,
        format,
        Name(&name),
        Some(folder),
        options,
    )?)
}

/// The parts of a file's bytes. `folder` is the folder of the files that it refers to; `None` if
/// these may not be read.
fn collect_bytes<'a>(
    bytes: &[u8],
    format: Format,
    name: Name<'a>,
    folder: Option<&Path>,
    options: &ReadOptions,
) -> Result<Collector<'a>, Error> {
    check_encoding(bytes, format, name)?;
    match format {
        Format::Obj => obj::read(bytes, name),
        Format::Ply => ply::read(bytes, name),
        Format::Stl => stl::read(bytes, name),
        Format::Off => off::read(bytes, name),
        Format::Gltf => gltf::read(bytes, name, folder, options),
        Format::Msh => msh::read(bytes, name),
        Format::Vtk => vtk::read(bytes, name),
        Format::Vtu => vtu::read(bytes, name, options),
        Format::ThreeMf => threemf::read(bytes, name, options),
        Format::Medit => medit::read(bytes, name),
        Format::Tetgen => Err(name.unsupported(
            Place::File,
            "a TetGen mesh in one piece (it is two files, .node and .ele)",
        )),
    }
}
