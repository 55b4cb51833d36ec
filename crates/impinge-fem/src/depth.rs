//! The depth of each vertex below the surface, at rest.
//!
//! Contact interpolates the depth of a point from the corners of its tetrahedron, wherever the
//! tetrahedron has moved ("deformed distance fields", Fisher & Lin 2001). Here the depth is the
//! length of the shortest path along edges to the surface (Dijkstra 1959). It is at least the distance,
//! cheap on any mesh, and accurate enough for its uses: directions and a stiffness.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::element::{Element, Vec3};
use crate::lists::Lists;

/// A vertex in the queue: nearest first, ties by number.
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

/// The depth of each vertex in metres: finite, and 0 for vertices without a path to a surface.
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
    // Without a surface there is no path to it: a face of more than two tetrahedra does not count as surface.
    depths
        .iter_mut()
        .filter(|depth| depth.is_infinite())
        .for_each(|depth| *depth = 0.0);
    depths
}
