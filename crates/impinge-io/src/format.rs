//! The supported formats, and how to find the format of a file.

use std::fs;
use std::path::{Path, is_separator};

use crate::error::Error;

/// A format of meshes that [`read`](crate::read) knows. Text and binary flavours are told apart by
/// content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Wavefront OBJ (`.obj`).
    Obj,
    /// Stanford polygon file, ascii or binary of either byte order (`.ply`).
    Ply,
    /// Stereolithography, ascii or binary (`.stl`).
    Stl,
    /// Geomview OFF, text and binary (`.off`, `.coff`, `.noff`).
    Off,
    /// glTF 2.0, JSON or binary container (`.gltf`, `.glb`).
    Gltf,
    /// Gmsh 2.x and 4.1, ascii or binary (`.msh`).
    Msh,
    /// Legacy VTK, ascii or binary (`.vtk`).
    Vtk,
    /// VTK XML unstructured grid (`.vtu`).
    Vtu,
    /// Medit, ascii (`.mesh`).
    Medit,
    /// 3MF, core and production extension (`.3mf`).
    ThreeMf,
    /// TetGen, two files: `.node` and `.ele` (or `.face`).
    Tetgen,
}

/// The extensions of [`Format::from_extension`], for messages.
const KNOWN: &str =
    "obj, ply, stl, off, coff, noff, gltf, glb, msh, vtk, vtu, mesh, 3mf, node, ele, face";

/// The last of them: a TetGen mesh is two files, so it is not read from the bytes of one.
const OF_TWO_FILES: &str = ", node, ele, face";

impl Format {
    /// The format of files with this extension (without the dot; case does not matter).
    ///
    /// ```
    /// use impinge_io::Format;
    /// assert_eq!(Format::from_extension("GLB"), Some(Format::Gltf));
    /// assert_eq!(Format::from_extension("txt"), None);
    /// ```
    pub fn from_extension(extension: &str) -> Option<Self> {
        Some(match extension.to_ascii_lowercase().as_str() {
            "obj" => Format::Obj,
            "ply" => Format::Ply,
            "stl" => Format::Stl,
            "off" | "coff" | "noff" => Format::Off,
            "gltf" | "glb" => Format::Gltf,
            "msh" => Format::Msh,
            "vtk" => Format::Vtk,
            "vtu" => Format::Vtu,
            "mesh" => Format::Medit,
            "3mf" => Format::ThreeMf,
            "node" | "ele" | "face" => Format::Tetgen,
            _ => return None,
        })
    }

    /// The format of the file at `path`, by its extension.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`] if the extension is not known; [`Error::NotAFile`] of a folder;
    /// [`Error::Io`] of the name of a folder that is not there.
    pub fn from_path(path: &Path) -> Result<Self, Error> {
        let name = path.as_os_str().as_encoded_bytes();
        let is_of_folder = name.last().is_some_and(|&end| is_separator(end.into()));
        Self::of_extension(path).map_err(|extension| match fs::metadata(path) {
            Ok(found) if found.is_dir() => Error::NotAFile {
                path: path.to_owned(),
                what: "a folder",
            },
            Err(source) if is_of_folder => Error::io(path, "open", source),
            _ => unknown(path, extension, KNOWN),
        })
    }

    /// The format of bytes that have the name of a file, by its extension: for
    /// [`read_bytes`](crate::read_bytes). No file is looked at.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`] if the extension is not known.
    pub fn from_name(name: &str) -> Result<Self, Error> {
        let path = Path::new(name);
        let known = KNOWN.trim_end_matches(OF_TWO_FILES);
        Self::of_extension(path).map_err(|extension| unknown(path, extension, known))
    }

    /// The format of the path's extension, or this extension.
    fn of_extension(path: &Path) -> Result<Self, String> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        Self::from_extension(&extension).ok_or_else(|| extension.into_owned())
    }
}

fn unknown(path: &Path, extension: String, known: &'static str) -> Error {
    Error::UnknownFormat {
        path: path.to_owned(),
        extension,
        known,
    }
}
