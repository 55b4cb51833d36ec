//! The area at rest that belongs to each vertex and edge of a body.
//!
//! As in ipc-toolkit: a third of each face around it. Where there is no face, an edge has its
//! length, and a vertex half the length of each of its edges; a vertex alone has 1.

use crate::scene::Body;
use crate::scene::elements::{EdgeFinder, Elements};
use crate::scene::error::Error;
use crate::scene::vector::{cross, dot, sub};
use crate::search::sink;
use impinge_exact::Point;

const WHAT: &str = "areas";

/// Areas by the numbers of vertices and edges.
pub(crate) struct Areas {
    pub vertices: Vec<f64>,
    pub edges: Vec<f64>,
}

fn length(of: Point) -> f64 {
    dot(of, of).sqrt()
}

impl Areas {
    /// Of a body whose vertices are at `rest`.
    pub fn new(body: &Body, rest: &[Point]) -> Result<Self, Error> {
        let at = |vertex: u32| rest[vertex as usize];
        let mut vertices = sink::filled(1.0, rest.len(), WHAT)?;
        let Elements::Edges(ends) = body.edges() else {
            // Points.
            return Ok(Areas {
                vertices,
                edges: Vec::new(),
            });
        };
        let mut edges = sink::filled(0.0, ends.len(), WHAT)?;
        for &end in ends.as_flattened() {
            vertices[end as usize] = 0.0;
        }
        match body.faces() {
            Elements::Triangles(faces) if !faces.is_empty() => {
                let numbers = EdgeFinder::new(body.edges());
                for &[a, b, c] in faces {
                    let [p, q, r] = [a, b, c].map(at);
                    let third = 0.5 * length(cross(sub(q, p), sub(r, p))) / 3.0;
                    for (i, j) in [(a, b), (b, c), (c, a)] {
                        vertices[i as usize] += third;
                        // The same vertex twice is no edge.
                        if let Some(edge) = numbers.find([i, j]) {
                            edges[edge] += third;
                        }
                    }
                }
            }
            _ => {
                for (edge, &[a, b]) in edges.iter_mut().zip(ends) {
                    *edge = length(sub(at(b), at(a)));
                    for end in [a, b] {
                        vertices[end as usize] += 0.5 * *edge;
                    }
                }
            }
        }
        Ok(Areas { vertices, edges })
    }
}
