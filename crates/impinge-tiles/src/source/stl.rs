//! Binary STL: 80 bytes of title, a count, 50 bytes per triangle (a normal, three corners, two
//! bytes).

use std::path::{Path, PathBuf};

use super::{Source, check_count, f32_at, head, length, read_at};
use crate::chunk::{Chunk, Shape};
use crate::error::Error;

const START: u64 = 84;
const STRIDE: usize = 50;

pub struct Stl {
    path: PathBuf,
    n: u64,
}

impl Stl {
    /// `None` if the file is text: then its length does not match the count.
    pub fn open(path: &Path) -> Result<Option<Self>, Error> {
        let head = head(path, START)?;
        let &[.., a, b, c, d] = head.as_slice() else {
            return Ok(None);
        };
        let n = u64::from(u32::from_le_bytes([a, b, c, d]));
        if head.len() as u64 != START || length(path)? != START + n * STRIDE as u64 || n == 0 {
            return Ok(None);
        }
        check_count(path, "corners", 3 * n)?;
        Ok(Some(Stl {
            path: path.to_owned(),
            n,
        }))
    }
}

impl Source for Stl {
    fn reader(&self) -> String {
        "stl".to_owned()
    }

    fn shape(&self) -> Shape {
        Shape {
            corners: 3,
            width: 4,
            poses: 1,
        }
    }

    fn n_elements(&self) -> u64 {
        self.n
    }

    fn n_vertices(&self) -> u64 {
        3 * self.n
    }

    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let bytes = read_at(&self.path, START + first * STRIDE as u64, n * STRIDE)?;
        let mut positions = Vec::with_capacity(3 * n);
        for facet in bytes.chunks_exact(STRIDE) {
            positions.extend((0..3).map(|corner| -> [f64; 3] {
                std::array::from_fn(|axis| f32_at(facet, 12 + 12 * corner + 4 * axis))
            }));
        }
        let vertices = (3 * first..3 * (first + n as u64))
            .map(|ix| ix as u32)
            .collect();
        Ok(Some(Chunk {
            first,
            vertices,
            positions,
        }))
    }
}
