//! What is added to a scene.

use crate::scene::elements::Elements;
use crate::scene::positions::Positions;

/// What a body is made of: elements, and the positions of their vertices.
///
/// ```
/// use impinge::{Mesh, Scene};
/// # fn main() -> Result<(), impinge::Error> {
/// let faces = vec![[0, 1, 2]];
/// let positions = vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mut scene = Scene::new();
/// let body = scene.add((faces.clone(), positions.clone()))?; // the arrays are taken over
/// assert_eq!(scene.body(body)?.positions(), &Mesh::from((faces, positions)).positions);
/// # Ok(()) }
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Mesh {
    /// The vertices of each element.
    pub elements: Elements,
    /// `(v, 3)` positions.
    pub positions: Positions,
    /// How many vertices were welded when it was read from a file.
    pub n_welded: usize,
    /// What of the file it was read from was left out or changed, in words: lines skipped, polygons
    /// split into triangles.
    pub notes: Vec<String>,
}

impl<E: Into<Elements>, P: Into<Positions>> From<(E, P)> for Mesh {
    fn from((elements, positions): (E, P)) -> Self {
        Mesh {
            elements: elements.into(),
            positions: positions.into(),
            n_welded: 0,
            notes: Vec::new(),
        }
    }
}
