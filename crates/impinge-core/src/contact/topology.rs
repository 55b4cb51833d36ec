//! The topology of a closed surface: which vertices are joined by edges.
//!
//! A surface is closed when every edge has as many faces along it as against it. Winding numbers
//! are then integers and change only at faces. Several shells, and edges of more than two faces,
//! are fine.
//!
//! Cost: `O(n log n)` once per topology.

use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::VertexIx;
use crate::search::work::{Equal, Work};

/// Faces whose edges are sorted by one task.
const FACES: usize = 8 * 1024;
/// What memory is for.
const WHAT: &str = "edges of a closed surface";

/// The edges at each vertex.
#[derive(Debug)]
pub(super) struct EdgesAround {
    starts: Vec<u32>,
    neighbours: Vec<VertexIx>,
}

impl EdgesAround {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.starts[..]) + size_of_val(&self.neighbours[..])
    }

    /// # Errors
    /// The surface is not closed; the error names an edge. Cancellation.
    pub fn new(
        body: BodyId,
        faces: &[[u32; 3]],
        n_vertices: usize,
        work: Work<'_>,
    ) -> Result<Self, Error> {
        // Low vertex, high vertex, direction: packed so that sorting puts an edge's faces next to
        // each other.
        let side = |face: &[u32; 3], k: usize| {
            let (from, to) = (face[k], face[(k + 1) % 3]);
            let (low, high) = (from.min(to), from.max(to));
            // A face that names a vertex twice runs along one edge, there and back.
            (low != high).then_some((u64::from(low) << 32 | u64::from(high), from < to))
        };
        let mut runs: Vec<Vec<(u64, bool)>> = Vec::new();
        runs.resize_with(faces.len().div_ceil(FACES), Vec::new);
        work.each(&mut runs, |ix, run| {
            let faces = faces[ix * FACES..].iter().take(FACES);
            run.extend(faces.flat_map(|face| (0..3).filter_map(|k| side(face, k))));
            run.sort_unstable();
            Ok(())
        })?;
        let sides = work.merged(runs, Equal::All, WHAT)?;
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(sides.len() / 2);
        for edge in sides.chunk_by(|x, y| x.0 == y.0) {
            let ends = [(edge[0].0 >> 32) as u32, edge[0].0 as u32];
            let n_forward = edge.iter().filter(|side| side.1).count();
            let n_backward = edge.len() - n_forward;
            if n_forward != n_backward {
                return Err(Error::NotClosed {
                    body,
                    edge: ends,
                    n_forward,
                    n_backward,
                });
            }
            edges.push(ends);
        }
        work.step()?;
        let mut starts = vec![0u32; n_vertices + 2];
        for end in edges.as_flattened() {
            starts[*end as usize + 2] += 1;
        }
        for vertex in 2..starts.len() {
            starts[vertex] += starts[vertex - 1];
        }
        let mut neighbours = vec![VertexIx::default(); 2 * edges.len()];
        for &[low, high] in &edges {
            for (at, other) in [(low, high), (high, low)] {
                let place = &mut starts[at as usize + 1];
                neighbours[*place as usize] = VertexIx::new(other);
                *place += 1;
            }
        }
        Ok(EdgesAround { starts, neighbours })
    }

    /// The vertices that share an edge with this one; none for a vertex of no face.
    pub fn neighbours(&self, vertex: VertexIx) -> &[VertexIx] {
        let at = vertex.index();
        &self.neighbours[self.starts[at] as usize..self.starts[at + 1] as usize]
    }
}
