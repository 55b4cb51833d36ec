//! Binary PLY, little-endian, with triangles only, so that all faces take the same number of bytes.

use std::path::{Path, PathBuf};

use impinge_io::{PlyLayout, Positions, Weld};

use super::{Source, check_count, head, length, read_at};
use crate::chunk::{Chunk, Shape};
use crate::error::Error;

/// The longest header that is read.
const HEADER: u64 = 1 << 16;

pub struct Ply {
    path: PathBuf,
    positions: Positions,
    layout: PlyLayout,
    faces_start: u64,
}

impl Ply {
    /// `None` if the file has another flavour, which is read whole.
    pub fn open(path: &Path) -> Result<Option<Self>, Error> {
        let layout = PlyLayout::parse(&head(path, HEADER)?).filter(|layout| layout.n_faces > 0);
        let Some(layout) = layout else {
            return Ok(None);
        };
        check_count(path, "vertices", layout.n_vertices)?;
        check_count(path, "faces", layout.n_faces)?;
        let vertex_bytes = layout.n_vertices * layout.vertex_stride as u64;
        let faces_start = layout.start + vertex_bytes;
        if length(path)? != faces_start + layout.n_faces * layout.face_stride as u64 {
            // Faces of other lengths, or a file that is too short: the reader of whole files
            // decides.
            return Ok(None);
        }
        Ok(Some(Ply {
            path: path.to_owned(),
            positions: positions(path, &layout)?,
            layout,
            faces_start,
        }))
    }
}

/// Reads only the positions, block by block.
fn positions(path: &Path, layout: &PlyLayout) -> Result<Positions, Error> {
    const BLOCK: u64 = 1 << 18;
    let mut narrow: Vec<[f32; 3]> = Vec::new();
    let mut wide: Vec<[f64; 3]> = Vec::new();
    for first in (0..layout.n_vertices).step_by(BLOCK as usize) {
        let n = BLOCK.min(layout.n_vertices - first) as usize;
        let start = layout.start + first * layout.vertex_stride as u64;
        let bytes = read_at(path, start, n * layout.vertex_stride)?;
        for vertex in bytes.chunks_exact(layout.vertex_stride) {
            if layout.is_f64 {
                wide.push(layout.xyz.map(|at| super::f64_at(vertex, at)));
            } else {
                let x = |at: usize| f32::from_le_bytes(std::array::from_fn(|ix| vertex[at + ix]));
                narrow.push(layout.xyz.map(x));
            }
        }
    }
    Ok(if layout.is_f64 {
        Positions::F64(wide)
    } else {
        Positions::F32(narrow)
    })
}

impl Source for Ply {
    fn reader(&self) -> String {
        "ply".to_owned()
    }

    fn shape(&self) -> Shape {
        Shape {
            corners: 3,
            width: match self.positions {
                Positions::F32(_) => 4,
                Positions::F64(_) => 8,
            },
            poses: 1,
        }
    }

    fn n_elements(&self) -> u64 {
        self.layout.n_faces
    }

    fn n_vertices(&self) -> u64 {
        self.positions.len() as u64
    }

    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let PlyLayout {
            face_stride: stride,
            corners: count,
            is_signed,
            ..
        } = self.layout;
        let bytes = read_at(
            &self.path,
            self.faces_start + first * stride as u64,
            n * stride,
        )?;
        let mut vertices = Vec::with_capacity(3 * n);
        let mut positions = Vec::with_capacity(3 * n);
        for (ix, face) in (first..).zip(bytes.chunks_exact(stride)) {
            if face[count] != 3 {
                return Ok(None);
            }
            for word in face[count + 1..].as_chunks().0.iter().take(3) {
                let vertex = u32::from_le_bytes(*word);
                let index = match is_signed {
                    true => i64::from(vertex.cast_signed()),
                    false => i64::from(vertex),
                };
                let position = usize::try_from(index).ok();
                let position = position.and_then(|ix| self.positions.get(ix));
                positions.push(position.ok_or_else(|| Error::VertexIndex {
                    path: self.path.clone(),
                    element: ix,
                    index,
                    n_vertices: self.n_vertices(),
                })?);
                vertices.push(vertex);
            }
        }
        Ok(Some(Chunk {
            first,
            vertices,
            positions,
        }))
    }

    fn weld(&self) -> Result<Weld, Error> {
        Ok(Weld::by_position(&self.positions))
    }
}
