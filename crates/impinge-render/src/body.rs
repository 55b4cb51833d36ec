//! Bodies of a scene as surfaces.

use impinge::{Body, Elements};

use crate::error::Error;
use crate::picture::{Face, Normals, Surface};

/// The two colours of a body, sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colors {
    /// The colour of elements that collide.
    pub colliding: [u8; 3],
    /// The colour of all other elements.
    pub other: [u8; 3],
}

impl Surface {
    /// A body in its current pose; its `colliding` elements are coloured and show through.
    ///
    /// Triangles are drawn with smooth normals. Tetrahedra are drawn with flat faces: the faces of
    /// only one tetrahedron, and all faces of colliding tetrahedra.
    ///
    /// # Errors
    /// A number in `colliding` that the body does not have.
    pub fn of_body(body: &Body, colliding: &[u32], colors: Colors) -> Result<Self, Error> {
        let n_elements = body.n_elements();
        let mut collides = vec![false; n_elements];
        for &element in colliding {
            match collides.get_mut(element as usize) {
                Some(collides) => *collides = true,
                None => {
                    return Err(Error::ElementOutOfRange {
                        element,
                        n_elements,
                    });
                }
            }
        }
        let face = |corners, collides| Face {
            corners,
            color: if collides {
                colors.colliding
            } else {
                colors.other
            },
            shows_through: collides,
        };
        let positions = body.positions();
        Ok(Surface {
            positions: (0..body.n_vertices())
                .map(|ix| positions.point(ix))
                .collect(),
            faces: match body.elements() {
                Elements::Triangles(faces) => faces
                    .iter()
                    .zip(&collides)
                    .map(|(&corners, &collides)| face(corners, collides))
                    .collect(),
                Elements::Tetrahedra(tets) => shown_sides(tets, &collides)
                    .map(|side| face(side.corners, side.collides))
                    .collect(),
                // Edges and points have no surface to show.
                Elements::Edges(_) | Elements::Points(_) => Vec::new(),
            },
            normals: match body.elements() {
                Elements::Triangles(_) => Normals::Smooth,
                _ => Normals::Flat,
            },
        })
    }
}

/// A face of a tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Side {
    /// The corners in ascending order: the same for both tetrahedra that share the face.
    key: [u32; 3],
    corners: [u32; 3],
    collides: bool,
}

/// The faces of only one tetrahedron, and the faces of colliding tetrahedra, each once.
fn shown_sides(tets: &[[u32; 4]], collides: &[bool]) -> impl Iterator<Item = Side> {
    let mut sides: Vec<Side> = tets
        .iter()
        .zip(collides)
        .flat_map(|(&[a, b, c, d], &collides)| {
            [[a, c, b], [a, b, d], [b, c, d], [c, a, d]].map(|corners| {
                let mut key = corners;
                key.sort_unstable();
                Side {
                    key,
                    corners,
                    collides,
                }
            })
        })
        .collect();
    // The sort is stable: of two tetrahedra that share a face, the first one's side is drawn.
    sides.sort_by_key(|side| side.key);
    let shown: Vec<Side> = sides
        .chunk_by(|a, b| a.key == b.key)
        .filter_map(|same| {
            let collides = same.iter().any(|side| side.collides);
            (same.len() == 1 || collides).then_some(Side {
                collides,
                ..same[0]
            })
        })
        .collect();
    shown.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tetrahedra_have_six_sides_and_seven_where_they_collide() {
        let tets = [[0, 1, 2, 3], [1, 2, 3, 4]];
        let corners = |collides: [bool; 2]| {
            let shown: Vec<Side> = shown_sides(&tets, &collides).collect();
            let n_colliding = shown.iter().filter(|side| side.collides).count();
            (shown.len(), n_colliding)
        };
        assert_eq!(corners([false, false]), (6, 0));
        assert_eq!(corners([true, false]), (7, 4));
        assert_eq!(corners([false, true]), (7, 4));
        assert_eq!(corners([true, true]), (7, 7));
        let keys: Vec<_> = shown_sides(&tets, &[false, false])
            .map(|side| side.key)
            .collect();
        assert!(!keys.contains(&[1, 2, 3]), "{keys:?}");
    }
}
