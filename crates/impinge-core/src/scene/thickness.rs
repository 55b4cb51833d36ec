//! How thick the elements of a body are.

use std::borrow::Cow;
use std::sync::Arc;

use crate::scene::elements::{EdgeFinder, Part, Parts};
use crate::scene::error::{Error, shown};
use crate::scene::ids::{BodyId, new_stamp};

/// How thick a body is, in the unit of the scene: one number, or one per vertex, edge or face. See
/// [`Scene::set_thickness`](crate::Scene::set_thickness).
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Thickness<'a>(GivenThickness<'a>);

#[derive(Debug, Clone, PartialEq)]
enum GivenThickness<'a> {
    One(f64),
    Each(Part, Cow<'a, [f64]>),
}

impl From<f64> for Thickness<'_> {
    fn from(one: f64) -> Self {
        Thickness(GivenThickness::One(one))
    }
}

impl<'a> Thickness<'a> {
    /// One number per vertex. An edge or a face is as thick as the thickest of its vertices.
    pub fn vertices(each: impl Into<Cow<'a, [f64]>>) -> Self {
        Thickness(GivenThickness::Each(Part::Vertices, each.into()))
    }

    /// One number per [edge](crate::Body::edges). A vertex is as thick as the thickest edge that
    /// has it, a face as the thickest of its edges.
    pub fn edges(each: impl Into<Cow<'a, [f64]>>) -> Self {
        Thickness(GivenThickness::Each(Part::Edges, each.into()))
    }

    /// One number per [face](crate::Body::faces). A vertex or an edge is as thick as the thickest
    /// face that has it.
    pub fn faces(each: impl Into<Cow<'a, [f64]>>) -> Self {
        Thickness(GivenThickness::Each(Part::Faces, each.into()))
    }

    /// How thick the elements of a body are.
    ///
    /// # Errors
    /// A number that is negative or not finite; more or fewer numbers than elements.
    pub(super) fn held(
        self,
        body: BodyId,
        of: &Parts,
        n_vertices: usize,
    ) -> Result<HeldThickness, Error> {
        match self.0 {
            GivenThickness::One(one) if is_length(one) => Ok(HeldThickness {
                most: one,
                each: None,
            }),
            GivenThickness::One(one) => Err(Error::Setting {
                setting: "thickness",
                given: shown(one),
                allowed: "a finite number that is not below 0",
            }),
            GivenThickness::Each(part, given) => {
                let n = match part {
                    Part::Vertices => n_vertices,
                    _ => of.part(part).len(),
                };
                check(body, part, &given, n)?;
                let each = Each::new(part, given.into_owned(), of, n_vertices);
                let all = [&each.vertices, &each.edges, &each.faces];
                let most = all.into_iter().flat_map(|of| of.iter());
                Ok(HeldThickness {
                    most: most.fold(0.0, |most: f64, &one| most.max(one)),
                    each: Some(Arc::new(each)),
                })
            }
        }
    }
}

fn is_length(x: f64) -> bool {
    x >= 0.0 && x.is_finite()
}

/// Refuses another number of numbers than there are elements, and the first that is no length.
fn check(body: BodyId, part: Part, given: &[f64], n: usize) -> Result<(), Error> {
    let what = match part {
        Part::Edges => "edges",
        Part::Faces | Part::Given => "faces",
        Part::Vertices => "vertices",
    };
    if given.len() != n {
        return Err(Error::PerElement {
            body,
            what: "thicknesses",
            given: given.len(),
            n,
            elements: what,
        });
    }
    match given.iter().position(|&one| !is_length(one)) {
        None => Ok(()),
        Some(element) => Err(Error::Thickness {
            body,
            elements: what,
            element,
            given: given[element],
        }),
    }
}

/// How thick the elements of a body are.
#[derive(Debug, Clone, Default)]
pub(crate) struct HeldThickness {
    /// The largest.
    pub most: f64,
    /// Of each element, if they differ.
    pub each: Option<Arc<Each>>,
}

/// How thick each element of a body is.
#[derive(Debug)]
pub(crate) struct Each {
    /// For which elements it was given.
    given: Part,
    vertices: Arc<[f64]>,
    edges: Arc<[f64]>,
    faces: Arc<[f64]>,
    /// Differs from that of all others.
    stamp: u64,
}

impl Each {
    fn new(part: Part, given: Vec<f64>, of: &Parts, n_vertices: usize) -> Self {
        let of_vertices = match part {
            Part::Vertices => given.clone(),
            _ => {
                let mut of_vertices = vec![0.0; n_vertices];
                for (ix, &own) in given.iter().enumerate() {
                    for &corner in of.part(part).corners(ix) {
                        raise(&mut of_vertices[corner as usize], own);
                    }
                }
                of_vertices
            }
        };
        let of_part = |other: Part| -> Vec<f64> {
            match part {
                _ if part == other => given.clone(),
                Part::Vertices => {
                    let elements = of.part(other);
                    let most = |corners: &[u32]| {
                        let own = corners.iter().map(|&corner| given[corner as usize]);
                        own.fold(0.0, f64::max)
                    };
                    (0..elements.len())
                        .map(|ix| most(elements.corners(ix)))
                        .collect()
                }
                _ => across(part, &given, other, of),
            }
        };
        Each {
            given: part,
            edges: of_part(Part::Edges).into(),
            faces: of_part(Part::Faces).into(),
            vertices: of_vertices.into(),
            stamp: new_stamp(),
        }
    }

    /// The same elements, with edges in the order of these numbers.
    pub fn with_edges(&self, old_numbers: &[usize]) -> Self {
        Each {
            given: self.given,
            edges: Vec::from_iter(old_numbers.iter().map(|&ix| self.edges[ix])).into(),
            faces: Arc::clone(&self.faces),
            vertices: Arc::clone(&self.vertices),
            stamp: new_stamp(),
        }
    }

    /// Of the elements of a part, by their numbers.
    pub fn of(&self, part: Part) -> &Arc<[f64]> {
        match part {
            Part::Vertices => &self.vertices,
            Part::Edges => &self.edges,
            Part::Faces | Part::Given => &self.faces,
        }
    }

    /// What was given, and for which elements.
    pub fn given(&self) -> (Part, &[f64]) {
        (self.given, self.of(self.given))
    }

    /// Differs from that of all others.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }
}

/// From edges to faces or back: of each element, the most of those that have it or that it has.
fn across(part: Part, given: &[f64], other: Part, of: &Parts) -> Vec<f64> {
    let faces = of.part(Part::Faces);
    let edges = EdgeFinder::new(of.part(Part::Edges));
    let mut most = vec![0.0; of.part(other).len()];
    for face in 0..faces.len() {
        let corners = faces.corners(face);
        for k in 0..3 {
            // The same vertex twice is no edge.
            if let Some(edge) = edges.find([corners[k], corners[(k + 1) % 3]]) {
                match part {
                    Part::Edges => raise(&mut most[face], given[edge]),
                    _ => raise(&mut most[edge], given[face]),
                }
            }
        }
    }
    most
}

fn raise(to: &mut f64, by: f64) {
    *to = to.max(by);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::elements::Elements;

    /// Two triangles across an edge, and a vertex that no face names.
    #[test]
    fn other_elements_are_as_thick_as_the_thickest_beside_them() {
        let parts = Parts::new(Elements::from(vec![[0, 1, 2], [1, 3, 2]]));
        // 0-1, 0-2, 1-2, 1-3, 2-3.
        let each = |thickness: Thickness<'_>| {
            let held = thickness.held(BodyId::new(0, 1), &parts, 5);
            let held = held.expect("good");
            let each = held.each.expect("of each element");
            let of = |part| each.of(part).to_vec();
            (
                [of(Part::Vertices), of(Part::Edges), of(Part::Faces)],
                held.most,
            )
        };
        let (of, most) = each(Thickness::vertices(vec![1.0, 2.0, 3.0, 4.0, 9.0]));
        assert_eq!(of[1], [2.0, 3.0, 3.0, 4.0, 4.0]);
        assert_eq!((&of[2][..], most), (&[3.0, 4.0][..], 9.0));
        let (of, _) = each(Thickness::edges(vec![1.0, 2.0, 3.0, 4.0, 5.0]));
        assert_eq!(of[0], [2.0, 4.0, 5.0, 5.0, 0.0]);
        assert_eq!(of[2], [3.0, 5.0]);
        let (of, _) = each(Thickness::faces(&[1.0, 2.0][..]));
        assert_eq!(of[0], [1.0, 2.0, 2.0, 2.0, 0.0]);
        assert_eq!(of[1], [1.0, 1.0, 2.0, 2.0, 2.0]);
    }
}
