//! The faces of a body, in the form in which they are drawn.

use std::collections::HashMap;

use impinge::{Body, Elements};

/// No face has this number.
const NONE: u32 = u32::MAX;

/// The faces that stand for a body's elements: its triangles, or the faces of its tetrahedra,
/// each once. Edges and points have none.
///
/// A face between two tetrahedra is inside the body, so it is drawn only where one of the two is
/// marked.
#[derive(Debug, Clone, Default)]
pub struct Faces {
    /// Three vertices, and 1 for a face inside the body.
    corners: Vec<[u32; 4]>,
    /// The element of each face; the first of two.
    owners: Vec<u32>,
    /// The faces of each tetrahedron; empty for triangles, which are their own faces.
    of_tetrahedra: Vec<[u32; 4]>,
    n_elements: usize,
    n_vertices: usize,
}

impl Faces {
    /// The faces of a body.
    pub fn of_body(body: &Body) -> Self {
        Faces::of_elements(body.elements(), body.n_vertices())
    }

    /// The faces of elements of so many vertices.
    pub fn of_elements(elements: &Elements, n_vertices: usize) -> Self {
        let mut faces = Faces {
            n_elements: elements.len(),
            n_vertices,
            ..Faces::default()
        };
        match elements {
            Elements::Triangles(triangles) => {
                faces.corners = triangles.iter().map(|&[a, b, c]| [a, b, c, 0]).collect();
                faces.owners = (0u32..).take(triangles.len()).collect();
            }
            Elements::Tetrahedra(tetrahedra) => faces.add_tetrahedra(tetrahedra),
            Elements::Edges(_) | Elements::Points(_) => {}
        }
        faces
    }

    fn add_tetrahedra(&mut self, tetrahedra: &[[u32; 4]]) {
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::with_capacity(2 * tetrahedra.len());
        for (element, &[a, b, c, d]) in (0u32..).zip(tetrahedra) {
            let own = [[a, c, b], [a, b, d], [b, c, d], [c, a, d]].map(|corners| {
                let mut key = corners;
                key.sort_unstable();
                let next = u32::try_from(self.corners.len()).unwrap_or(NONE);
                let number = *numbers.entry(key).or_insert(next);
                if number == next {
                    let [a, b, c] = corners;
                    self.corners.push([a, b, c, 0]);
                    self.owners.push(element);
                } else if let Some(shared) = self.corners.get_mut(number as usize) {
                    shared[3] = 1;
                }
                number
            });
            self.of_tetrahedra.push(own);
        }
    }

    /// The number of faces.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The vertices of a face, or `None` beyond the last.
    pub fn corners(&self, face: usize) -> Option<[u32; 3]> {
        let &[a, b, c, _] = self.corners.get(face)?;
        Some([a, b, c])
    }

    /// Whether a face lies between two tetrahedra, so that only marked tetrahedra show it.
    pub fn is_inner(&self, face: usize) -> bool {
        self.corners
            .get(face)
            .is_some_and(|corners| corners[3] == 1)
    }

    /// The element to which a face belongs; of two tetrahedra the first. `None` beyond the last
    /// face.
    pub fn element(&self, face: usize) -> Option<u32> {
        self.owners.get(face).copied()
    }

    /// The faces of an element; none beyond the last element.
    pub fn of_element(&self, element: u32) -> impl Iterator<Item = usize> + '_ {
        let ix = element as usize;
        let of_tetrahedron = self.of_tetrahedra.get(ix).into_iter().flatten();
        let is_own = self.of_tetrahedra.is_empty() && ix < self.corners.len();
        let own = is_own.then_some(ix);
        own.into_iter()
            .chain(of_tetrahedron.map(|&face| face as usize))
    }

    /// The number of elements of the body.
    pub fn n_elements(&self) -> usize {
        self.n_elements
    }

    /// The number of vertices of the body.
    pub fn n_vertices(&self) -> usize {
        self.n_vertices
    }

    /// As the shader reads them.
    #[cfg(feature = "gpu")]
    pub(crate) fn packed(&self) -> &[[u32; 4]] {
        &self.corners
    }
}

#[cfg(test)]
mod tests {
    use impinge::Scene;

    use super::*;

    #[test]
    fn two_tetrahedra_share_one_inner_face() {
        let mut scene = Scene::new();
        let positions: Vec<[f32; 3]> = (0u8..5).map(|x| [f32::from(x), 0.0, 0.0]).collect();
        let body = scene
            .add_tetrahedra(&[[0, 1, 2, 3], [1, 2, 3, 4]], &positions)
            .expect("a body");
        let faces = Faces::of_body(scene.body(body).expect("there"));
        assert_eq!(faces.len(), 7);
        let inner: Vec<usize> = (0..7).filter(|&face| faces.is_inner(face)).collect();
        assert_eq!(inner.len(), 1);
        for element in 0..2 {
            let own: Vec<usize> = faces.of_element(element).collect();
            assert_eq!(own.len(), 4);
            assert!(own.contains(&inner[0]));
        }
        assert_eq!(faces.element(inner[0]), Some(0));
        assert_eq!(faces.of_element(2).count(), 0);
    }

    #[test]
    fn triangles_are_their_own_faces() {
        let mut scene = Scene::new();
        let positions = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let body = scene
            .add_triangles(&[[0, 1, 2], [2, 1, 0]], &positions)
            .expect("a body");
        let faces = Faces::of_body(scene.body(body).expect("there"));
        assert_eq!(faces.corners(1), Some([2, 1, 0]));
        assert_eq!(faces.of_element(1).collect::<Vec<_>>(), [1]);
        assert_eq!(faces.of_element(2).count(), 0);
        assert_eq!(faces.corners(2), None);
    }
}
