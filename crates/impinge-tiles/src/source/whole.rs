//! Any mesh file, read as a whole.

use std::path::Path;

use impinge_io::{Elements, Mesh, Positions, ReadOptions, Weld, read};

use super::{Source, check_count};
use crate::chunk::{Chunk, Shape};
use crate::error::Error;

pub struct Whole {
    mesh: Mesh,
}

impl Whole {
    pub fn open(path: &Path) -> Result<Self, Error> {
        let mut mesh = read(path, &ReadOptions::as_they_are())?;
        check_count(path, "elements", mesh.n_elements() as u64)?;
        mesh.positions.narrow_if_exact();
        Ok(Whole { mesh })
    }
}

impl Source for Whole {
    fn reader(&self) -> String {
        "whole".to_owned()
    }

    fn shape(&self) -> Shape {
        Shape {
            corners: match self.mesh.elements {
                Elements::Triangles(_) => 3,
                Elements::Tetrahedra(_) => 4,
            },
            width: match self.mesh.positions {
                Positions::F32(_) => 4,
                Positions::F64(_) => 8,
            },
            poses: 1,
        }
    }

    fn n_elements(&self) -> u64 {
        self.mesh.n_elements() as u64
    }

    fn n_vertices(&self) -> u64 {
        self.mesh.n_vertices() as u64
    }

    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let corners = self.shape().corners;
        let start = first as usize * corners;
        let vertices = self.mesh.elements.indices()[start..start + n * corners].to_vec();
        // Readers refuse indices out of range.
        let position = |&vertex: &u32| self.mesh.positions.get(vertex as usize).unwrap_or_default();
        Ok(Some(Chunk {
            first,
            positions: vertices.iter().map(position).collect(),
            vertices,
        }))
    }

    fn weld(&self) -> Result<Weld, Error> {
        Ok(Weld::by_position(&self.mesh.positions))
    }
}
