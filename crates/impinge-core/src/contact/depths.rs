//! The depth of each vertex of a solid below its surface: the shortest path along edges.
//!
//! Interpolated in the tetrahedra, wherever they move, this is a deformed distance field (Fisher
//! and Lin 2001). The path along edges (Dijkstra 1959) is at least the distance, cheap on any mesh,
//! and accurate enough for directions and a stiffness.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::scene::error::Error;
use crate::scene::index::{ElementIx, VertexIx};
use crate::search::sink::filled;
use crate::search::sparse_rows::SparseRows;
use impinge_exact::Point;

/// What memory is for.
const WHAT: &str = "depths of vertices";

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
/// # Errors
/// There is no memory.
///
/// # Panics
/// If a tetrahedron or a triangle names a vertex that has no position.
///
/// ```
/// use impinge::contact::solid_depths;
/// # fn main() -> Result<(), impinge::Error> {
/// let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let depths = solid_depths(&corners, &[[0, 1, 2, 3]], &[[0, 1, 2]])?;
/// assert_eq!(depths, [0.0, 0.0, 0.0, 1.0]);
/// # Ok(()) }
/// ```
pub fn solid_depths(
    positions: &[Point],
    tetrahedra: &[[u32; 4]],
    surface: &[[u32; 3]],
) -> Result<Vec<f64>, Error> {
    let corners = || {
        let numbered = (0..).map(ElementIx::new).zip(tetrahedra);
        numbered.flat_map(|(ix, corners)| corners.iter().map(move |&corner| (corner, ix)))
    };
    let around = SparseRows::new(positions.len(), corners, WHAT)?;
    let mut depths = filled(f64::INFINITY, positions.len(), WHAT)?;
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
        for &tetrahedron in around.of(vertex.index()) {
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
    Ok(depths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_tetrahedra_is_as_deep_as_it_is_long() {
        // Each tetrahedron shares three corners with the next one.
        let positions: Vec<Point> = (0..12).map(|ix| [f64::from(ix), 0.0, 0.0]).collect();
        let tetrahedra: Vec<[u32; 4]> = (0..9).map(|ix| [ix, ix + 1, ix + 2, ix + 3]).collect();
        let depths = |positions: &[Point], surface: &[[u32; 3]]| {
            solid_depths(positions, &tetrahedra, surface).expect("memory")
        };
        let expected: Vec<f64> = (0..12).map(|ix| f64::from(ix - 1).max(0.0)).collect();
        assert_eq!(depths(&positions, &[[0, 1, 0]]), expected);
        // A vertex of no tetrahedron, and no surface at all.
        let alone = [positions, vec![[5.0; 3]]].concat();
        assert_eq!(depths(&alone, &[[0, 1, 0]])[12], 0.0);
        assert_eq!(depths(&alone, &[]), [0.0; 13]);
    }
}
