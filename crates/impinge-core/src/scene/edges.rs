//! The numbers of edges: the library's own, or those of the caller.

use std::sync::Arc;

use crate::scene::bodies::Scene;
use crate::scene::elements::{BodyKind, EdgeFinder, Elements};
use crate::scene::error::Error;
use crate::scene::ids::{BodyId, new_stamp};

impl Scene {
    /// Numbers the edges of a body as its caller does: edge `i` of [`Body::edges`], of every
    /// answer and of [`Thickness::edges`] is row `i` of `edges`, `(n, 2)` vertex indices, and goes
    /// in its direction. Every edge must be there once, in any order; of tetrahedra these are the
    /// edges of their surface. No rows: the library's own numbers again. [`remesh`](Scene::remesh)
    /// forgets them.
    ///
    /// Set them before the first question: afterwards answers from before name other edges, and are
    /// refused where they are left out or made stencils of, unless the rows are those that the body
    /// has. Hashes of answers are of these numbers, too.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Elements, PairKind, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let face = scene.add_triangles(&[[0, 1, 2]], &corners)?;
    /// scene.add_edges(&[[0, 1]], &[[0.5f32, -0.5, 0.25], [0.5, 0.25, 0.25]])?;
    /// scene.set_edges(face, &[[2, 1], [2, 0], [0, 1]])?;
    /// assert_eq!(*scene.body(face)?.edges(), Elements::from(vec![[2, 1], [2, 0], [0, 1]]));
    /// let query = Query::between_all().kinds([PairKind::EdgeEdge]);
    /// let near = Detector::new(Backend::Cpu)?.near(&scene, 0.25, &query)?;
    /// // The strand passes over the edge between vertices 0 and 1, which is row 2.
    /// assert_eq!(near.rows().collect::<Vec<_>>(), [[0, 2, 1, 0]]);
    /// # Ok(()) }
    /// ```
    ///
    /// [`Body::edges`]: crate::Body::edges
    /// [`Thickness::edges`]: crate::Thickness::edges
    ///
    /// # Errors
    /// The id names no body; a body of edges, which have the numbers of their rows, or of points;
    /// a row that is no edge of the body, or the same as another; an edge that no row has. The body
    /// keeps its numbers then.
    pub fn set_edges(&mut self, body: BodyId, edges: &[[u32; 2]]) -> Result<(), Error> {
        let held = self.body_mut(body)?;
        if let kind @ (BodyKind::Points | BodyKind::Edges) = held.kind() {
            return Err(Error::WrongKind {
                body,
                kind: kind.name(),
                expected: "triangles or tetrahedra",
            });
        }
        let own = (!edges.is_empty()).then(|| Arc::new(Elements::from(edges.to_vec())));
        let new = own.as_deref();
        let new = new.unwrap_or_else(|| held.parts.found_edges());
        let before = old_numbers(body, held.edges(), new)?;
        if let Some(each) = &mut held.thickness.each {
            *each = Arc::new(each.with_edges(&before));
        }
        let are_new = new != held.edges();
        held.parts.own_edges = own;
        if are_new {
            held.topology_stamp = new_stamp();
        }
        Ok(())
    }
}

/// The old number of each of the new edges, which must be the same edges.
fn old_numbers(body: BodyId, old: &Elements, new: &Elements) -> Result<Vec<usize>, Error> {
    let old = EdgeFinder::new(old);
    let (n, given) = (old.len(), new.len());
    let mut row_of: Vec<Option<usize>> = vec![None; n];
    let mut numbers = Vec::with_capacity(given);
    for row in 0..given {
        let vertices = [0, 1].map(|end| new.corners(row)[end]);
        let wrong = |why: String| Error::Edge {
            body,
            row,
            vertices,
            why,
        };
        let Some(number) = old.find(vertices) else {
            return Err(wrong("between which there is no edge".to_owned()));
        };
        if let Some(first) = row_of[number].replace(row) {
            return Err(wrong(format!("as row {first} has")));
        }
        numbers.push(number);
    }
    match given == n {
        true => Ok(numbers),
        false => Err(Error::PerElement {
            body,
            what: "rows of edges",
            given,
            n,
            elements: "edges",
        }),
    }
}
