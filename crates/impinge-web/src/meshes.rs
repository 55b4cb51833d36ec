//! Mesh files from the bytes that a page or a program has.

use impinge_io::{Elements, Format, Positions, ReadOptions, read_bytes};

use crate::error::Error;

/// The most bytes that a compressed file may expand to. A module of 32 bits has 4 GiB in all.
const MAX_EXPANDED_BYTES: u64 = 1 << 30;

/// A mesh as flat arrays.
#[derive(Debug, Clone, PartialEq)]
pub struct FileMesh {
    /// Vertex numbers, `corners` per primitive.
    pub index: Vec<u32>,
    /// One position per vertex, in the file's precision.
    pub positions: Positions,
    /// 3 for triangles, 4 for tetrahedra.
    pub corners: u32,
}

/// Reads the bytes of a mesh file. The extension of its name is that of its format. With `weld`, vertices at the same
/// position become one.
///
/// # Errors
/// An unknown extension; files that the reader refuses.
pub fn read(name: &str, bytes: &[u8], weld: bool) -> Result<FileMesh, Error> {
    let format = Format::from_path(name.as_ref())?;
    let options = ReadOptions {
        weld,
        max_expanded_bytes: MAX_EXPANDED_BYTES,
        ..ReadOptions::default()
    };
    let mesh = read_bytes(bytes, format, name, &options)?;
    Ok(FileMesh {
        index: mesh.elements.indices().to_vec(),
        positions: mesh.positions,
        corners: match &mesh.elements {
            Elements::Triangles(_) => 3,
            Elements::Tetrahedra(_) => 4,
        },
    })
}
