//! How deep below the surface each vertex lies at rest.
//!
//! Contact takes the depth of a point as the interpolation of its tetrahedron's depths, wherever
//! that has been deformed to ("deformed distance fields", Fisher & Lin 2001). Here the depth is the
//! length of the shortest path along edges to the surface (Dijkstra 1959): at least the distance,
//! cheap on any mesh, and exact enough for what is made of it: directions and a stiffness.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::element::{Element, Vec3};
use crate::lists::Lists;

/// A vertex waiting for its turn: nearest first, ties by number.
#[derive(PartialEq)]
struct Waiting {
    depth: f64,
    vertex: usize,
}

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .depth
            .total_cmp(&self.depth)
            .then(other.vertex.cmp(&self.vertex))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The depth of each vertex in metres. A solid always has a surface, so every depth is finite.
pub(crate) fn depths(
    rest: &[Vec3],
    elements: &[Element],
    tets_at: &Lists,
    faces_at: &Lists,
) -> Vec<f64> {
    let mut depths = vec![f64::INFINITY; rest.len()];
    let mut waiting = BinaryHeap::new();
    for (vertex, depth) in depths.iter_mut().enumerate() {
        if !faces_at.get(vertex).is_empty() {
            *depth = 0.0;
            waiting.push(Waiting { depth: 0.0, vertex });
        }
    }
    while let Some(Waiting { depth, vertex }) = waiting.pop() {
        if depth > depths[vertex] {
            continue;
        }
        for &entry in tets_at.get(vertex) {
            for corner in elements[entry as usize / 4].corners {
                let next = corner as usize;
                let through = depth + (rest[next] - rest[vertex]).norm();
                if through < depths[next] {
                    depths[next] = through;
                    waiting.push(Waiting {
                        depth: through,
                        vertex: next,
                    });
                }
            }
        }
    }
    // A face that more than two tetrahedra claim is no surface; a mesh of nothing else has none.
    depths
        .iter_mut()
        .filter(|depth| depth.is_infinite())
        .for_each(|depth| *depth = 0.0);
    depths
}
