//! NumPy arrays of corners: `(n, 3, 3)` triangles or `(n, 4, 3)` tetrahedra, `<f4` or `<f8`; each
//! element has vertices of its own.

use std::path::{Path, PathBuf};

use super::{Source, check_count, f32_at, f64_at, head, length, read_at};
use crate::chunk::{Chunk, Shape};
use crate::error::Error;
use crate::npy;

pub struct Npy {
    path: PathBuf,
    start: u64,
    shape: Shape,
    n: u64,
}

impl Npy {
    pub fn open(path: &Path) -> Result<Self, Error> {
        let refuse = |found: &str| Error::Argument {
            what: "array of a mesh",
            given: format!("{}: {found}", path.display()),
            allowed: "'<f4' or '<f8' of shape (n, 3, 3) or (n, 4, 3), in C order,".to_owned(),
        };
        let header = npy::parse(&head(path, 4096)?).ok_or_else(|| refuse("no valid header"))?;
        let width = match header.descr.as_str() {
            "<f4" => 4,
            "<f8" => 8,
            other => return Err(refuse(other)),
        };
        let &[n, corners @ (3 | 4), 3] = header.shape.as_slice() else {
            return Err(refuse(&format!("shape {:?}", header.shape)));
        };
        let corners = corners as usize;
        check_count(path, "corners", n.saturating_mul(corners as u64))?;
        let needed = header.start + n * (corners * 3 * width) as u64;
        if length(path)? < needed || n == 0 {
            return Err(refuse(&format!("{} bytes for {n} elements", length(path)?)));
        }
        Ok(Npy {
            path: path.to_owned(),
            start: header.start,
            shape: Shape {
                corners,
                width,
                poses: 1,
            },
            n,
        })
    }
}

impl Source for Npy {
    fn reader(&self) -> String {
        "npy".to_owned()
    }

    fn shape(&self) -> Shape {
        self.shape
    }

    fn n_elements(&self) -> u64 {
        self.n
    }

    fn n_vertices(&self) -> u64 {
        self.n * self.shape.corners as u64
    }

    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let Shape { corners, width, .. } = self.shape;
        let stride = 3 * corners * width;
        let bytes = read_at(&self.path, self.start + first * stride as u64, n * stride)?;
        let positions = bytes.chunks_exact(3 * width).map(|point| -> [f64; 3] {
            std::array::from_fn(|axis| match width {
                4 => f32_at(point, 4 * axis),
                _ => f64_at(point, 8 * axis),
            })
        });
        let k = corners as u64;
        Ok(Some(Chunk {
            first,
            vertices: (k * first..k * (first + n as u64))
                .map(|ix| ix as u32)
                .collect(),
            positions: positions.collect(),
        }))
    }
}
