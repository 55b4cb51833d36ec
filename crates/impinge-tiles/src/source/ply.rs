//! Binary PLY, little-endian, with triangles only, so that all faces take the same number of bytes.

use std::path::{Path, PathBuf};

use impinge_io::{Positions, Weld};

use super::{Source, check_count, head, length, read_at};
use crate::chunk::{Chunk, Shape};
use crate::error::Error;

/// The longest header that is read.
const HEADER: u64 = 1 << 16;

pub struct Ply {
    path: PathBuf,
    positions: Positions,
    n_faces: u64,
    faces_start: u64,
    face: FaceLayout,
}

/// The layout of a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct FaceLayout {
    stride: usize,
    /// The offset of the byte that holds the number of corners.
    count: usize,
    /// The offset of the first of three vertex numbers of 4 bytes.
    vertices: usize,
}

/// The content of a header that this reader supports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Layout {
    start: u64,
    n_vertices: u64,
    vertex_stride: usize,
    /// The offsets of x, y and z in a vertex.
    offsets: [usize; 3],
    is_f64: bool,
    n_faces: u64,
    face: FaceLayout,
}

impl Ply {
    /// `None` if the file has another flavour, which is read whole.
    pub fn open(path: &Path) -> Result<Option<Self>, Error> {
        let Some(layout) = layout(&head(path, HEADER)?) else {
            return Ok(None);
        };
        check_count(path, "vertices", layout.n_vertices)?;
        check_count(path, "faces", layout.n_faces)?;
        let vertex_bytes = layout.n_vertices * layout.vertex_stride as u64;
        let faces_start = layout.start + vertex_bytes;
        if length(path)? != faces_start + layout.n_faces * layout.face.stride as u64 {
            // Faces of other lengths, or a file that is too short: the reader of whole files
            // decides.
            return Ok(None);
        }
        Ok(Some(Ply {
            path: path.to_owned(),
            positions: positions(path, &layout)?,
            n_faces: layout.n_faces,
            faces_start,
            face: layout.face,
        }))
    }
}

/// Reads only the positions, block by block.
fn positions(path: &Path, layout: &Layout) -> Result<Positions, Error> {
    const BLOCK: u64 = 1 << 18;
    let mut narrow: Vec<[f32; 3]> = Vec::new();
    let mut wide: Vec<[f64; 3]> = Vec::new();
    for first in (0..layout.n_vertices).step_by(BLOCK as usize) {
        let n = BLOCK.min(layout.n_vertices - first) as usize;
        let start = layout.start + first * layout.vertex_stride as u64;
        let bytes = read_at(path, start, n * layout.vertex_stride)?;
        for vertex in bytes.chunks_exact(layout.vertex_stride) {
            if layout.is_f64 {
                wide.push(layout.offsets.map(|at| super::f64_at(vertex, at)));
            } else {
                let x = |at: usize| f32::from_le_bytes(std::array::from_fn(|ix| vertex[at + ix]));
                narrow.push(layout.offsets.map(x));
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
        self.n_faces
    }

    fn n_vertices(&self) -> u64 {
        self.positions.len() as u64
    }

    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let FaceLayout {
            stride,
            count,
            vertices: at,
        } = self.face;
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
            for corner in 0..3 {
                let vertex = u32::from_le_bytes(std::array::from_fn(|b| face[at + 4 * corner + b]));
                let position = self.positions.get(vertex as usize);
                positions.push(position.ok_or_else(|| Error::VertexIndex {
                    path: self.path.clone(),
                    element: ix,
                    index: i64::from(vertex),
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

/// Bytes of a scalar type.
fn size(name: &str) -> Option<usize> {
    Some(match name {
        "char" | "uchar" | "int8" | "uint8" => 1,
        "short" | "ushort" | "int16" | "uint16" => 2,
        "int" | "uint" | "int32" | "uint32" | "float" | "float32" => 4,
        "double" | "float64" => 8,
        _ => return None,
    })
}

/// Reads a header: vertices with x, y, z, then faces with one list of 4-byte vertex numbers, and
/// nothing else.
fn layout(head: &[u8]) -> Option<Layout> {
    let end_mark = b"end_header\n";
    let end = head
        .windows(end_mark.len())
        .position(|window| window == end_mark)?;
    let text = std::str::from_utf8(&head[..end]).ok()?;
    let mut lines = text
        .lines()
        .map(|line| line.split_ascii_whitespace().collect::<Vec<_>>());
    if lines.next()? != ["ply"] || lines.next()? != ["format", "binary_little_endian", "1.0"] {
        return None;
    }
    let (mut n_vertices, mut n_faces) = (None, None);
    let (mut stride, mut offsets, mut types) = (0, [None; 3], Vec::new());
    let (mut face_stride, mut list) = (0, None);
    for line in lines {
        match *line.as_slice() {
            ["comment" | "obj_info", ..] | [] => {}
            ["element", "vertex", n] if n_vertices.is_none() && n_faces.is_none() => {
                n_vertices = n.parse::<u64>().ok();
            }
            ["element", "face", n] if n_vertices.is_some() && n_faces.is_none() => {
                n_faces = n.parse::<u64>().ok();
            }
            [
                "property",
                "list",
                "uchar" | "uint8",
                "int" | "uint" | "int32" | "uint32",
                "vertex_indices" | "vertex_index",
            ] if n_faces.is_some() && list.is_none() => {
                list = Some(face_stride);
                face_stride += 1 + 12;
            }
            ["property", kind, name] => {
                let size = size(kind)?;
                if n_faces.is_some() {
                    face_stride += size;
                } else if n_vertices.is_some() {
                    if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
                        offsets[axis] = Some(stride);
                        types.push(kind);
                    }
                    stride += size;
                } else {
                    return None;
                }
            }
            _ => return None,
        }
    }
    let is = |names: [&str; 2]| types.iter().all(|kind| names.contains(kind));
    let is_f64 = is(["double", "float64"]);
    let list = list?;
    let [Some(x), Some(y), Some(z)] = offsets else {
        return None;
    };
    (types.len() == 3 && (is_f64 || is(["float", "float32"])) && n_faces? > 0).then_some(())?;
    Some(Layout {
        start: (end + end_mark.len()) as u64,
        n_vertices: n_vertices?,
        vertex_stride: stride,
        offsets: [x, y, z],
        is_f64,
        n_faces: n_faces?,
        face: FaceLayout {
            stride: face_stride,
            count: list,
            vertices: list + 1,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers() {
        let read = |text: &str| layout(text.as_bytes());
        let text = "ply\nformat binary_little_endian 1.0\ncomment x\nelement vertex 4\nproperty float x\n\
            property float y\nproperty float z\nproperty uchar red\nelement face 2\n\
            property list uchar int vertex_indices\nproperty uchar green\nend_header\n";
        let found = read(text).unwrap();
        assert_eq!(
            (found.vertex_stride, found.offsets, found.is_f64),
            (13, [0, 4, 8], false)
        );
        let face = FaceLayout {
            stride: 14,
            count: 0,
            vertices: 1,
        };
        assert_eq!(
            (found.n_faces, found.face, found.start),
            (2, face, text.len() as u64)
        );
        assert!(read(&text.replace("float", "double")).unwrap().is_f64);
        for (old, new) in [
            ("little", "big"),
            ("float x", "double x"),
            ("int vertex", "short vertex"),
            ("float z", "float w"),
            ("face 2", "edge 2"),
            (
                "element face 2\n",
                "element edge 1\nproperty int a\nelement face 2\n",
            ),
        ] {
            assert_eq!(read(&text.replace(old, new)), None, "{new}");
        }
    }
}
