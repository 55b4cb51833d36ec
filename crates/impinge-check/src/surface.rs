//! A surface of triangles, and its closed pieces.

use impinge::exact::{Point, Sign};
use impinge_io::{Elements, Mesh, Positions};

use crate::facets::{facets, groups, is_simplex};
use crate::union_find::UnionFind;
use crate::volume;

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

/// A closed piece of one orientation.
pub struct Shell {
    /// Ascending.
    pub faces: Vec<u32>,
    /// Of the volume that it encloses.
    pub sign: Sign,
    /// The box around it.
    pub low: Point,
    pub high: Point,
    /// How many shells it is inside.
    pub depth: u32,
}

/// The closed pieces of one orientation.
pub fn shells(surface: &Surface) -> Vec<Shell> {
    let n = surface.faces.len();
    let sorted = facets(&surface.faces, surface.n_vertices());
    let mut pieces = UnionFind::new(n as u32);
    let mut is_closed: Vec<bool> = surface.faces.iter().map(is_simplex).collect();
    for group in groups(&sorted) {
        let closes = matches!(group, [a, b] if a.is_even != b.is_even);
        for facet in group {
            pieces.join(group[0].element, facet.element);
            is_closed[facet.element as usize] &= closes;
        }
    }
    drop(sorted);
    let roots: Vec<u32> = (0..n as u32).map(|face| pieces.root(face)).collect();
    for face in 0..n {
        let closed = is_closed[face];
        is_closed[roots[face] as usize] &= closed;
    }
    let mut places = vec![usize::MAX; n];
    let mut shells: Vec<Shell> = Vec::new();
    for (face, &root) in roots.iter().enumerate() {
        let root = root as usize;
        if !is_closed[root] {
            continue;
        }
        // The root is the lowest face of its piece.
        if root == face {
            places[root] = shells.len();
            shells.push(Shell {
                faces: Vec::new(),
                sign: Sign::Zero,
                low: [f64::INFINITY; 3],
                high: [f64::NEG_INFINITY; 3],
                depth: 0,
            });
        }
        let shell = &mut shells[places[root]];
        shell.faces.push(face as u32);
        for point in surface.corners(surface.faces[face]) {
            for (axis, x) in point.into_iter().enumerate() {
                shell.low[axis] = shell.low[axis].min(x);
                shell.high[axis] = shell.high[axis].max(x);
            }
        }
    }
    for shell in &mut shells {
        let faces = shell.faces.iter();
        shell.sign = volume::sign(faces.map(|&face| surface.corners(surface.faces[face as usize])));
    }
    shells
}
