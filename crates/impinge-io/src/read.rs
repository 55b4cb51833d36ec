//! Reading a mesh: by path or from bytes.

use std::path::Path;

use crate::collect::Collector;
use crate::error::{Error, Name, Place};
use crate::files::{Source, folder_of};
use crate::format::Format;
use crate::formats::{gltf, medit, msh, obj, off, ply, stl, tetgen, vtk, vtu};
use crate::mesh::Mesh;

/// Which primitives to take from a file that has triangles and tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prefer {
    /// The tetrahedra if there are any, else the triangles: a volume's file often repeats its surface.
    #[default]
    Volume,
    /// The triangles; a file without is an error.
    Triangles,
    /// The tetrahedra; a file without is an error.
    Tetrahedra,
}

/// How to read a mesh.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadOptions {
    /// Whether vertices at the same position become one; see [`weld`](crate::weld). Off by default.
    pub weld: bool,
    /// Which primitives to take where there are both kinds.
    pub prefer: Prefer,
    /// The most bytes that data may take which is larger in memory than in the file by its nature: compressed arrays,
    /// and glTF meshes placed many times. 4 GiB by default. Compressed arrays may not take more than 200 times the bytes of
    /// their file either, or 64 MiB where that is more.
    pub max_expanded_bytes: u64,
    /// The most bytes that a file may have; a longer one is refused before it is read. 16 GiB by default.
    pub max_file_bytes: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions {
            weld: false,
            prefer: Prefer::Volume,
            max_expanded_bytes: 4 << 30,
            max_file_bytes: 16 << 30,
        }
    }
}

/// What a reader did to a file's cells, so that nothing is left out unseen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Summary {
    /// Polygons of four corners or more, each of which became several triangles. Where it is 0, primitive ids are the file's.
    pub n_polygons_fanned: u64,
    /// Lines left out.
    pub n_lines_skipped: u64,
    /// Point cells left out.
    pub n_points_skipped: u64,
    /// Triangles left out beside tetrahedra.
    pub n_triangles_skipped: u64,
    /// Tetrahedra left out because triangles were asked for.
    pub n_tetrahedra_skipped: u64,
    /// Vertices that went away in welding.
    pub n_welded: u64,
}

/// Reads the mesh at `path`; the format goes by the extension ([`Format::from_path`]).
///
/// All bodies, groups and nodes of a file become one mesh. Of TetGen's files either may be named, the other is found beside it.
/// Only regular files are read, and of files that the mesh file names or that are found beside it only those in its own
/// folder or below, links resolved.
///
/// # Errors
/// Any [`Error`] but [`Error::Mismatch`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<Mesh, Error> {
    Ok(read_with_summary(path, options)?.0)
}

/// Like [`read`], and tells what was fanned, left out and welded.
///
/// # Errors
/// As [`read`].
pub fn read_with_summary(path: &Path, options: &ReadOptions) -> Result<(Mesh, Summary), Error> {
    collect_file(path, options, |parts| parts.finish(options))
}

/// Reads a mesh from the bytes of a file. `name` stands for the file in errors.
///
/// # Errors
/// As [`read`]. What lies in several files can't be read this way ([`Error::Unsupported`]): TetGen (see
/// [`read_tetgen_bytes`]) and glTF with buffers beside it.
pub fn read_bytes(
    bytes: &[u8],
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<Mesh, Error> {
    Ok(read_bytes_with_summary(bytes, format, name, options)?.0)
}

/// Like [`read_bytes`], and tells what was fanned, left out and welded.
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

/// Reads a TetGen mesh from the bytes of its `.node` file and of its `.ele` or `.face` file, which is told by its extension
/// in `cells_name`. The names stand for the files in errors.
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

/// Gives the parts of the file at `path` to `then`, before any choice among them. No primitives are no error here.
pub(crate) fn collect_file<T>(
    path: &Path,
    options: &ReadOptions,
    then: impl FnOnce(Collector) -> Result<T, Error>,
) -> Result<T, Error> {
    collect(Source::Named(path), options, then)
}

/// As [`collect_file`], for a file that the caller or a pattern named.
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

/// The parts of a file's bytes. `folder` is where files that it refers to are, if they may be read.
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
        Format::Medit => medit::read(bytes, name),
        Format::Tetgen => Err(name.unsupported(
            Place::File,
            "a TetGen mesh in one piece (it is two files, .node and .ele)",
        )),
    }
}

/// Refuses text in UTF-16, which some editors and shells write, by name.
///
/// Without a byte order mark UTF-16 shows by a zero in every other byte. No format starts like that but binary STL, whose
/// title may be anything: it is told by its length.
pub(crate) fn check_encoding(bytes: &[u8], format: Format, name: Name) -> Result<(), Error> {
    let is_utf16 = match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => true,
        &[a, 0, b, 0, ..] | &[0, a, 0, b, ..] => a != 0 && b != 0 && a.is_ascii() && b.is_ascii(),
        _ => false,
    };
    if is_utf16 && !(format == Format::Stl && stl::is_binary(bytes)) {
        return Err(name.unsupported(Place::File, "text in UTF-16 (UTF-8 is: save it as that)"));
    }
    Ok(())
}
