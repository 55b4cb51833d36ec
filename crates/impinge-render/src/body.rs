//! Bodies of a scene as surfaces.

use impinge::{Body, Elements};

use crate::error::Error;
use crate::faces::Faces;
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
    /// As [`Surface::of_elements`].
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
        let positions = (0..body.n_vertices()).map(|ix| body.positions().point(ix));
        let color = |element: usize| match collides[element] {
            true => (colors.colliding, true),
            false => (colors.other, false),
        };
        Ok(Surface::of_elements(
            positions.collect(),
            body.elements(),
            color,
        ))
    }

    /// Elements with a `color` each, and whether they show through.
    ///
    /// Triangles are drawn with smooth normals. Tetrahedra are drawn with flat faces: the faces of
    /// only one tetrahedron, and all faces of tetrahedra that show through. Edges and points have
    /// no surface to show.
    pub fn of_elements(
        positions: Vec<[f64; 3]>,
        elements: &Elements,
        color: impl Fn(usize) -> ([u8; 3], bool),
    ) -> Self {
        let faces = Faces::of_elements(elements, positions.len());
        let shows = |element: u32| color(element as usize).1;
        // Of each face that is drawn the element whose colour it has.
        let owner = |face| faces.element(face).filter(|_| !faces.is_inner(face));
        let mut owners: Vec<Option<u32>> = (0..faces.len()).map(owner).collect();
        for element in (0u32..).take(elements.len()).filter(|&ix| shows(ix)) {
            for face in faces.of_element(element) {
                // Of two that show through, the first.
                if owners[face].is_none_or(|owner| !shows(owner)) {
                    owners[face] = Some(element);
                }
            }
        }
        let drawn = owners.into_iter().enumerate().filter_map(|(ix, owner)| {
            let (color, shows_through) = color(owner? as usize);
            Some(Face {
                corners: faces.corners(ix)?,
                color,
                shows_through,
            })
        });
        Surface {
            positions,
            faces: drawn.collect(),
            normals: match elements {
                Elements::Triangles(_) => Normals::Smooth,
                _ => Normals::Flat,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tetrahedra_have_six_sides_and_seven_where_they_collide() {
        let elements = Elements::from(vec![[0, 1, 2, 3], [1, 2, 3, 4]]);
        let sides = |shows: [bool; 2]| {
            let color = |element: usize| ([element as u8; 3], shows[element]);
            Surface::of_elements(vec![[0.0; 3]; 5], &elements, color).faces
        };
        let counts = |shows: [bool; 2]| {
            let sides = sides(shows);
            let n_through = sides.iter().filter(|side| side.shows_through).count();
            (sides.len(), n_through)
        };
        assert_eq!(counts([false, false]), (6, 0));
        assert_eq!(counts([true, false]), (7, 4));
        assert_eq!(counts([false, true]), (7, 4));
        assert_eq!(counts([true, true]), (7, 7));
        let shared = |side: &&Face| [1, 2, 3].iter().all(|vertex| side.corners.contains(vertex));
        assert_eq!(sides([false, false]).iter().find(shared), None);
        for (shows, owner) in [([true, false], 0), ([false, true], 1), ([true, true], 0)] {
            let sides = sides(shows);
            let shared = sides.iter().find(shared).expect("drawn");
            assert_eq!((shared.color, shared.shows_through), ([owner; 3], true));
        }
    }
}
