//! A surface of triangles.

use impinge::exact::Point;
use impinge_io::{Elements, Mesh, Positions};

/// A surface. Its indices are in range.
pub struct Surface {
    pub positions: Positions,
    pub faces: Vec<[u32; 3]>,
}

impl Surface {
    pub fn new(positions: Positions, faces: Vec<[u32; 3]>) -> Self {
        Surface { positions, faces }
    }

    pub fn n_vertices(&self) -> usize {
        self.positions.len()
    }

    pub fn at(&self, vertex: u32) -> Point {
        at(&self.positions, vertex)
    }

    pub fn corners(&self, face: [u32; 3]) -> [Point; 3] {
        face.map(|vertex| self.at(vertex))
    }

    /// Adds a vertex with the bits of another one.
    pub fn copy_vertex(&mut self, vertex: u32) -> u32 {
        let fresh = self.positions.len() as u32;
        match &mut self.positions {
            Positions::F32(held) => held.push(held[vertex as usize]),
            Positions::F64(held) => held.push(held[vertex as usize]),
        }
        fresh
    }

    /// Takes back copies of vertices.
    pub fn truncate_vertices(&mut self, n: usize) {
        match &mut self.positions {
            Positions::F32(held) => held.truncate(n),
            Positions::F64(held) => held.truncate(n),
        }
    }

    pub fn mesh(&self) -> Mesh {
        Mesh {
            positions: self.positions.clone(),
            elements: Elements::Triangles(self.faces.clone()),
        }
    }
}

/// Positions as a scene takes them.
pub fn held(positions: &Positions) -> impinge::Positions {
    match positions {
        Positions::F32(positions) => positions.clone().into(),
        Positions::F64(positions) => positions.clone().into(),
    }
}

/// The position of a vertex whose index is in range.
pub fn at(positions: &Positions, vertex: u32) -> Point {
    let position = positions.get(vertex as usize);
    position.expect("the scene has refused indices out of range")
}
