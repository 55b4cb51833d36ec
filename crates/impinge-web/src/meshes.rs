//! Mesh files from the bytes that a page or a program has.

use impinge_io::{
    Elements, Format, Mesh, NamedMesh, Positions, ReadOptions, Sequence, SequenceFormat, Summary,
    Weld, read_bodies_bytes, read_bytes_with_summary,
};

use crate::error::Error;

/// The most bytes that a compressed file may expand to. A module of 32 bits has 4 GiB in all.
const MAX_EXPANDED_BYTES: u64 = 1 << 30;

/// A mesh as flat arrays.
#[derive(Debug, Clone, PartialEq)]
pub struct FileMesh {
    /// The name of the file, or of a node or a group in it.
    pub name: String,
    /// Vertex numbers, `corners` per element.
    pub index: Vec<u32>,
    /// One position per vertex, in the file's precision.
    pub positions: Positions,
    /// 3 for triangles, 4 for tetrahedra.
    pub corners: u32,
    /// For each vertex of the file, its number in the mesh: they differ if vertices were welded.
    pub map: Vec<u32>,
    /// What of the file was left out or changed.
    pub notes: Vec<String>,
}

/// Reads the bytes of a mesh file. The extension of its name is that of its format. With `weld`,
/// vertices at the same position become one.
///
/// # Errors
/// An unknown extension; files that the reader refuses.
pub fn read(name: &str, bytes: &[u8], weld: bool) -> Result<FileMesh, Error> {
    let format = Format::from_name(name)?;
    let (mesh, summary) = read_bytes_with_summary(bytes, format, name, &options())?;
    Ok(FileMesh::new(name, mesh, &summary, weld))
}

/// Reads the bodies of a file, each as a mesh: the nodes of a glTF file, the objects or groups of
/// an OBJ file. Their maps are of the vertices that their own elements name.
///
/// # Errors
/// As [`read`].
pub fn read_bodies(name: &str, bytes: &[u8], weld: bool) -> Result<Vec<FileMesh>, Error> {
    let format = Format::from_name(name)?;
    let (bodies, summary) = read_bodies_bytes(bytes, format, name, &options())?;
    let bodies = bodies.into_iter().map(|body| {
        let NamedMesh {
            name: own, mesh, ..
        } = body;
        FileMesh::new(own.as_deref().unwrap_or(name), mesh, &summary, weld)
    });
    Ok(bodies.collect())
}

fn options() -> ReadOptions {
    ReadOptions {
        max_expanded_bytes: MAX_EXPANDED_BYTES,
        ..ReadOptions::as_they_are()
    }
}

impl FileMesh {
    fn new(name: &str, mut mesh: Mesh, summary: &Summary, weld: bool) -> Self {
        let map = if weld {
            let weld = Weld::by_position(&mesh.positions);
            weld.apply(&mut mesh);
            weld.map().to_vec()
        } else {
            // The reader's limit on vertices is 32 bits.
            (0..mesh.n_vertices() as u32).collect()
        };
        FileMesh {
            name: name.to_owned(),
            index: mesh.elements.indices().to_vec(),
            corners: match &mesh.elements {
                Elements::Triangles(_) => 3,
                Elements::Tetrahedra(_) => 4,
            },
            positions: mesh.positions,
            map,
            notes: summary.notes(),
        }
    }
}

/// Reads the bytes of a point cache (`.pc2`, `.mdd`): the positions of each frame.
///
/// # Errors
/// An unknown extension; files that the reader refuses.
pub fn read_frames(name: &str, bytes: Vec<u8>) -> Result<Vec<Positions>, Error> {
    let extension = name.rsplit('.').next().unwrap_or_default();
    let Some(format) = SequenceFormat::from_extension(extension) else {
        return Err(Error::PointCache(extension.to_owned()));
    };
    let sequence = Sequence::from_bytes(bytes, format, name)?;
    let frames = (0..sequence.n_frames()).map(|frame| sequence.frame(frame));
    Ok(frames.collect::<Result<_, _>>()?)
}
