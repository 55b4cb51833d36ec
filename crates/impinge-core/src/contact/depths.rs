//! The depth of each vertex of a solid below its surface: the shortest path along edges.
//!
//! Interpolated in the tetrahedra, wherever they move, this is a deformed distance field (Fisher
//! and Lin 2001). The path along edges (Dijkstra 1959) is at least the distance, cheap on any mesh,
//! and accurate enough for directions and a stiffness.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::scene::index::{ElementIx, VertexIx};
use impinge_exact::Point;

/// A vertex in the queue: nearest first, ties by number.
#[derive(PartialEq)]
struct WaitingVertex {
    depth: f64,
    vertex: VertexIx,
}

impl Eq for WaitingVertex {}

impl Ord for WaitingVertex {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .depth
            .total_cmp(&self.depth)
            .then(other.vertex.cmp(&self.vertex))
    }
}

impl PartialOrd for WaitingVertex {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The depth of each vertex of a mesh of tetrahedra below its surface, in the unit of the
/// positions: the length of the shortest path along edges to a vertex of a surface triangle.
/// Finite; 0 for vertices on the surface and for those without a path to it.
///
/// # Panics
/// If a tetrahedron or a triangle names a vertex that has no position.
///
/// ```
/// use impinge::contact::solid_depths;
/// let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// assert_eq!(solid_depths(&corners, &[[0, 1, 2, 3]], &[[0, 1, 2]]), [0.0, 0.0, 0.0, 1.0]);
/// ```
pub fn solid_depths(
    positions: &[Point],
    tetrahedra: &[[u32; 4]],
    surface: &[[u32; 3]],
) -> Vec<f64> {
    let around = TetrahedraAround::new(positions.len(), tetrahedra);
    let mut depths = vec![f64::INFINITY; positions.len()];
    let mut waiting = BinaryHeap::new();
    for &corner in surface.as_flattened() {
        let vertex = VertexIx::new(corner);
        if depths[vertex.index()] != 0.0 {
            depths[vertex.index()] = 0.0;
            waiting.push(WaitingVertex { depth: 0.0, vertex });
        }
    }
    while let Some(WaitingVertex { depth, vertex }) = waiting.pop() {
        if depth > depths[vertex.index()] {
            continue;
        }
        for &tetrahedron in around.of(vertex) {
            for next in tetrahedra[tetrahedron.index()].map(VertexIx::new) {
                let [p, q] = [vertex, next].map(|vertex| positions[vertex.index()]);
                let [x, y, z] = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
                let through = depth + (x * x + y * y + z * z).sqrt();
                if through < depths[next.index()] {
                    depths[next.index()] = through;
                    waiting.push(WaitingVertex {
                        depth: through,
                        vertex: next,
                    });
                }
            }
        }
    }
    for depth in &mut depths {
        if depth.is_infinite() {
            *depth = 0.0;
        }
    }
    depths
}

/// The tetrahedra around each vertex, one list after the other.
struct TetrahedraAround {
    starts: Vec<u32>,
    tetrahedra: Vec<ElementIx>,
}

impl TetrahedraAround {
    fn new(n_vertices: usize, tetrahedra: &[[u32; 4]]) -> Self {
        let mut starts = vec![0u32; n_vertices + 1];
        for &corner in tetrahedra.as_flattened() {
            starts[corner as usize + 1] += 1;
        }
        for ix in 0..n_vertices {
            starts[ix + 1] += starts[ix];
        }
        let mut next = starts.clone();
        let mut around = vec![ElementIx::default(); 4 * tetrahedra.len()];
        for (tetrahedron, corners) in (0..).map(ElementIx::new).zip(tetrahedra) {
            for &corner in corners {
                around[next[corner as usize] as usize] = tetrahedron;
                next[corner as usize] += 1;
            }
        }
        TetrahedraAround {
            starts,
            tetrahedra: around,
        }
    }

    fn of(&self, vertex: VertexIx) -> &[ElementIx] {
        let [start, end] = [0, 1].map(|k| self.starts[vertex.index() + k] as usize);
        &self.tetrahedra[start..end]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_tetrahedra_is_as_deep_as_it_is_long() {
        // Each tetrahedron shares three corners with the next one.
        let positions: Vec<Point> = (0..12).map(|ix| [f64::from(ix), 0.0, 0.0]).collect();
        let tetrahedra: Vec<[u32; 4]> = (0..9).map(|ix| [ix, ix + 1, ix + 2, ix + 3]).collect();
        let depths = solid_depths(&positions, &tetrahedra, &[[0, 1, 0]]);
        let expected: Vec<f64> = (0..12).map(|ix| f64::from(ix - 1).max(0.0)).collect();
        assert_eq!(depths, expected);
        // A vertex of no tetrahedron, and no surface at all.
        let alone = [positions, vec![[5.0; 3]]].concat();
        assert_eq!(solid_depths(&alone, &tetrahedra, &[[0, 1, 0]])[12], 0.0);
        assert_eq!(solid_depths(&alone, &tetrahedra, &[]), [0.0; 13]);
    }
}
