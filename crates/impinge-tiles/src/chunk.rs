//! Elements with all the data that a tile needs.

use std::path::Path;

use crate::cells::Bounds;
use crate::error::Error;

/// The kind of a file's elements, and the width of their coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Corners per element: 3 or 4.
    pub corners: usize,
    /// Bytes per coordinate: 4 or 8.
    pub width: usize,
    /// Positions per vertex: 1, or 2 if the file is a body of a step, which has a start and an end.
    pub poses: usize,
}

impl Shape {
    /// Positions per element: those of its corners in each pose.
    pub fn points(self) -> usize {
        self.corners * self.poses
    }

    /// Bytes per record: the element's number, its vertices' numbers, their coordinates.
    pub fn stride(self) -> usize {
        4 + 4 * self.corners + 3 * self.width * self.points()
    }
}

/// Consecutive elements of one file.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// The number of the first element.
    pub first: u64,
    /// Vertex numbers, `corners` per element.
    pub vertices: Vec<u32>,
    /// Positions of these vertices: `corners` per element; in a step, `corners` at the start and
    /// then as many at the end.
    pub positions: Vec<[f64; 3]>,
}

impl Chunk {
    /// The box of each element, in a step over both ends.
    pub fn bounds(&self, shape: Shape) -> impl Iterator<Item = Bounds> {
        self.positions.chunks_exact(shape.points()).map(bounds)
    }

    /// Refuses coordinates that are not finite, which no tile holds. `paths` are the files of the
    /// start and of the end.
    pub fn check(&self, paths: [&Path; 2], shape: Shape) -> Result<(), Error> {
        let bad = |x: &f64| !x.is_finite();
        match self.positions.iter().position(|p| p.iter().any(bad)) {
            None => Ok(()),
            Some(ix) => {
                let value = self.positions[ix].into_iter().find(bad).unwrap_or_default();
                Err(Error::Coordinate {
                    path: paths[ix % shape.points() / shape.corners].to_owned(),
                    element: self.first + (ix / shape.points()) as u64,
                    value,
                })
            }
        }
    }

    /// Appends the record of an element of this chunk.
    pub fn encode(&self, shape: Shape, ix: usize, to: &mut Vec<u8>) {
        let corners = ix * shape.corners..(ix + 1) * shape.corners;
        to.extend(((self.first + ix as u64) as u32).to_le_bytes());
        for vertex in &self.vertices[corners] {
            to.extend(vertex.to_le_bytes());
        }
        for position in &self.positions[ix * shape.points()..][..shape.points()] {
            for &x in position {
                if shape.width == 4 {
                    to.extend(back_to_f32(x).to_le_bytes());
                } else {
                    to.extend(x.to_le_bytes());
                }
            }
        }
    }
}

/// Converts an f32 that was widened to f64 back, exactly.
pub fn back_to_f32(x: f64) -> f32 {
    x as f32
}

/// The box of points.
pub fn bounds(points: &[[f64; 3]]) -> Bounds {
    points[1..]
        .iter()
        .fold((points[0], points[0]), |(lo, hi), p| {
            (
                std::array::from_fn(|axis| lo[axis].min(p[axis])),
                std::array::from_fn(|axis| hi[axis].max(p[axis])),
            )
        })
}

/// A record in the form in which it is stored on disk and in memory.
#[derive(Clone, Copy)]
pub struct Record<'a> {
    shape: Shape,
    bytes: &'a [u8],
}

impl<'a> Record<'a> {
    /// A record of `bytes`, whose length is the stride of the shape.
    pub fn new(shape: Shape, bytes: &'a [u8]) -> Self {
        Record { shape, bytes }
    }

    fn word(&self, at: usize) -> u32 {
        u32::from_le_bytes(std::array::from_fn(|ix| self.bytes[at + ix]))
    }

    /// The number of the element in its file.
    pub fn element(&self) -> u32 {
        self.word(0)
    }

    /// The number of a vertex in its file.
    pub fn vertex(&self, corner: usize) -> u32 {
        self.word(4 + 4 * corner)
    }

    /// The position of a corner; those at the end of a step follow all those at its start.
    pub fn position(&self, point: usize) -> [f64; 3] {
        let Shape { corners, width, .. } = self.shape;
        let start = 4 + 4 * corners + 3 * width * point;
        std::array::from_fn(|axis| {
            let at = start + width * axis;
            if width == 4 {
                f64::from(f32::from_bits(self.word(at)))
            } else {
                f64::from_le_bytes(std::array::from_fn(|ix| self.bytes[at + ix]))
            }
        })
    }

    /// The box of the element, by the same comparisons of the same numbers as in scattering.
    pub fn bounds(&self) -> Bounds {
        let points: [[f64; 3]; 8] =
            std::array::from_fn(|point| self.position(point.min(self.shape.points() - 1)));
        bounds(&points)
    }
}
