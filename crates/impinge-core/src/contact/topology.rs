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
use crate::search::sink::{filled, with_capacity};
use crate::search::sparse_rows::SparseRows;
use crate::search::work::{Equal, Work};

/// Faces whose edges are sorted by one task.
const FACES: usize = 8 * 1024;
/// What memory is for.
const WHAT: &str = "edges of a closed surface";

/// The edges at each vertex.
#[derive(Debug)]
pub(super) struct EdgesAround {
    neighbours: SparseRows<VertexIx>,
    /// For each vertex, the number of its connected piece; 0 for a vertex of no face.
    pieces: Vec<u32>,
    n_pieces: usize,
}

impl EdgesAround {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.neighbours.bytes() + size_of_val(&self.pieces[..])
    }

    /// How many pieces there are that no edge connects.
    pub fn n_pieces(&self) -> usize {
        self.n_pieces
    }

    /// The number of the piece of a vertex that some face has.
    pub fn piece(&self, vertex: VertexIx) -> usize {
        self.pieces[vertex.index()] as usize
    }

    /// Numbers the connected pieces.
    fn find_pieces(&mut self, n_vertices: usize) -> Result<(), Error> {
        const NONE: u32 = u32::MAX;
        self.pieces = filled(NONE, n_vertices, WHAT)?;
        let mut members = Vec::new();
        for seed in VertexIx::up_to(n_vertices) {
            if self.pieces[seed.index()] != NONE {
                continue;
            }
            if self.neighbours(seed).is_empty() {
                self.pieces[seed.index()] = 0;
                continue;
            }
            let piece = self.n_pieces as u32;
            self.n_pieces += 1;
            self.pieces[seed.index()] = piece;
            members.push(seed);
            while let Some(vertex) = members.pop() {
                for other in self.neighbours.of(vertex.index()) {
                    if self.pieces[other.index()] == NONE {
                        self.pieces[other.index()] = piece;
                        members.push(*other);
                    }
                }
            }
        }
        Ok(())
    }

    /// # Errors
    /// The surface is not closed; the error names an edge. There is no memory, cancellation.
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
        let mut edges: Vec<[u32; 2]> = with_capacity(sides.len() / 2, WHAT)?;
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
        let ends = || {
            let both = |&[low, high]: &[u32; 2]| [(low, high), (high, low)];
            let ends = edges.iter().flat_map(both);
            ends.map(|(at, other)| (at, VertexIx::new(other)))
        };
        let mut topology = EdgesAround {
            neighbours: SparseRows::new(n_vertices, ends, WHAT)?,
            pieces: Vec::new(),
            n_pieces: 0,
        };
        topology.find_pieces(n_vertices)?;
        // Faces that name a vertex twice may have no edges at all.
        topology.n_pieces = topology.n_pieces.max(1);
        Ok(topology)
    }

    /// The vertices that share an edge with this one; none for a vertex of no face.
    pub fn neighbours(&self, vertex: VertexIx) -> &[VertexIx] {
        self.neighbours.of(vertex.index())
    }
}
