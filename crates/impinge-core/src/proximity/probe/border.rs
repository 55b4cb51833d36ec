//! The border of a body of tetrahedra: its faces, which are all but those between two different
//! tetrahedra.
//!
//! Cost: `O(n log n)` once per topology, one byte per tetrahedron.

use crate::scene::Body;
use crate::scene::elements::{Elements, is_boundary};
use crate::scene::error::Error;
use crate::search::sink::{filled, reserve};
use crate::search::work::{Equal, Work};

/// Tetrahedra whose faces are sorted by one task.
const TETRAHEDRA: usize = 8 * 1024;
/// What memory is for.
const WHAT: &str = "faces of tetrahedra";

/// The corners of each face; face k is opposite corner k.
pub(super) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// Which faces are on the border.
#[derive(Debug)]
pub(super) struct Border {
    topology_stamp: u64,
    /// Bit `k`: face `k` of the tetrahedron is.
    masks: Vec<u8>,
}

impl Border {
    /// # Errors
    /// Cancellation, no memory.
    pub fn new(body: &Body, work: Work<'_>) -> Result<Self, Error> {
        let mut masks = filled(0u8, body.n_elements(), WHAT)?;
        let Elements::Tetrahedra(tetrahedra) = body.elements() else {
            unreachable!("asked for bodies of tetrahedra alone")
        };
        // The vertices of each face in ascending order, and where it is.
        let mut runs: Vec<Vec<([u32; 3], u32, u8)>> = Vec::new();
        runs.resize_with(tetrahedra.len().div_ceil(TETRAHEDRA), Vec::new);
        work.each(&mut runs, |ix, run| {
            let first = ix * TETRAHEDRA;
            let some = tetrahedra[first..].iter().take(TETRAHEDRA);
            reserve(run, FACES.len() * some.len(), WHAT)?;
            for (number, corners) in (first as u32..).zip(some) {
                run.extend(FACES.iter().zip(0..).map(|(face, k)| {
                    let mut face = face.map(|corner| corners[corner]);
                    face.sort_unstable();
                    (face, number, k)
                }));
            }
            run.sort_unstable();
            Ok(())
        })?;
        let faces = work.merged(runs, Equal::All, WHAT)?;
        for same in faces.chunk_by(|x, y| x.0 == y.0) {
            let opposite = |ix: usize| tetrahedra[same[ix].1 as usize][usize::from(same[ix].2)];
            if is_boundary(same.len(), opposite) {
                for (_, number, k) in same {
                    masks[*number as usize] |= 1 << k;
                }
            }
        }
        Ok(Border {
            topology_stamp: body.topology_stamp(),
            masks,
        })
    }

    /// Whether it was found for the body's current topology.
    pub fn fits(&self, body: &Body) -> bool {
        self.topology_stamp == body.topology_stamp()
    }

    /// The faces of a tetrahedron that are on the border.
    pub fn mask(&self, tetrahedron: usize) -> u8 {
        self.masks[tetrahedron]
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.masks[..])
    }
}
