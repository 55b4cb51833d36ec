//! Contact geometry: where triangles meet, the curves in which surfaces cross, how deep.
//!
//! [`Contacts`] turns the pairs of a detection into points, segments and polygons; [`Curves`] chains these
//! into loops; [`Penetration`] finds what of two closed bodies lies inside the other, and per connected
//! region of contact a normal, a depth and a volume.
//!
//! **Exact combinatorics.** Which edge crosses which face, in which order, which points are one point,
//! which segments follow each other: decided by the signs of [`exact`](crate::exact), without
//! tolerance. **Rounded coordinates.** Each coordinate is the exact number rounded to nearest: to `f32` where both
//! bodies hold `f32`, else to `f64`. It depends on the point alone, so the bytes are the same on
//! every machine and for every number of threads. Lengths, areas,
//! normals, depths and volumes are computed from rounded coordinates in `f64`, in a fixed order.
//!
//! ```
//! use impinge_core::contact::{Contacts, Shape};
//! use impinge_core::{Backend, Detector, Query, Scene};
//! # fn main() -> Result<(), impinge_core::Error> {
//! let mut scene = Scene::new();
//! let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
//! let blade = [[1.0f32, 1.0, -1.0], [2.0, 1.0, -1.0], [1.0, 1.0, 1.0]];
//! let a = scene.add_triangles(&[[0, 1, 2]], &floor)?;
//! let b = scene.add_triangles(&[[0, 1, 2]], &blade)?;
//! let mut detector = Detector::new(Backend::Cpu)?;
//! let pairs = detector.detect(&scene, &Query::between(a, b))?;
//! let contacts = Contacts::new(&scene, pairs)?;
//! assert_eq!(contacts.shape(0), Shape::Segment);
//! let ends: Vec<_> = contacts.corners(0).iter().map(|&point| contacts.points()[point as usize]).collect();
//! assert_eq!(ends, [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]]);
//! assert!((contacts.curves().length(0) - 0.5).abs() < 1e-15);
//! # Ok(()) }
//! ```

mod build;
mod coordinates;
mod curves;
mod double;
mod inside;
mod integer;
mod meet;
mod penetration;
mod regions;
mod topology;

pub use curves::Curves;
pub use penetration::{Overlap, Penetration};
pub use regions::Region;

use crate::error::Error;
use crate::pairs::Pairs;
use crate::scene::Scene;

/// A vertex, edge or face of a body: what a point of contact lies in the relative interior of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Feature {
    /// A vertex index. Of several vertices at one position it is the lowest among the
    /// triangles in contact.
    Vertex(u32),
    /// Two vertex indices, the lower one first.
    Edge([u32; 2]),
    /// A face index.
    Face(u32),
}

/// What a pair of triangles has in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Shape {
    /// Not a pair of triangles: tetrahedra have a volume in common, which no curve describes.
    Solid,
    /// Nothing: the scene has moved since the pairs were found.
    Apart,
    /// One point.
    Point,
    /// A segment, from the first corner to the second.
    Segment,
    /// A convex polygon, where both triangles lie in one plane: three to six corners in order,
    /// counter-clockwise as seen from the side to which the first triangle's normal points.
    Polygon,
}

/// The name of a point of contact: bodies by number, and the feature of either one in which it lies. Within
/// one body the lower feature comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PointName {
    /// The bodies by their [`index`](crate::BodyId::index); twice the same within one body.
    pub bodies: [u32; 2],
    /// The feature of the first body, and of the second.
    pub features: [Feature; 2],
}

/// Where the triangles of each pair meet.
///
/// Contact `i` belongs to row `i` of the pairs. Its corners are numbers of points; a point that belongs to
/// several contacts is held once. A segment of two triangles with different planes points along
/// `n_a × n_b`, the product of their normals (counter-clockwise rule): seen from outside of body `a`, the part of `a`
/// beneath `b`'s surface lies to its left.
///
/// Degenerate triangles are the segments or points that they are.
#[derive(Debug, Clone, Default)]
pub struct Contacts {
    rows: Vec<[u32; 4]>,
    shapes: Vec<Shape>,
    /// Whether a segment points along the product of the normals.
    directed: Vec<bool>,
    /// Where each contact's corners start, and one past the last.
    starts: Vec<usize>,
    corners: Vec<u32>,
    names: Vec<PointName>,
    points: Vec<[f64; 3]>,
    /// Of each body: vertices that are not the lowest one at their position, with that one.
    doubles: Vec<(u32, Vec<(u32, u32)>)>,
}

impl Contacts {
    /// The contacts of all pairs, which must have been found in the scene as it is now.
    ///
    /// Runs in rayon's current thread pool; the result does not depend on it.
    ///
    /// # Errors
    /// A body of the pairs that the scene no longer has, or with fewer primitives; refused positions
    /// that were written in place since.
    pub fn new(scene: &Scene, pairs: &Pairs) -> Result<Self, Error> {
        build::contacts(scene, pairs)
    }

    /// How many contacts there are: as many as pairs.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Rows `[body_a, primitive_a, body_b, primitive_b]`, those of the pairs.
    pub fn rows(&self) -> &[[u32; 4]] {
        &self.rows
    }

    /// What each pair has in common.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// What the triangles of row `contact` have in common.
    pub fn shape(&self, contact: usize) -> Shape {
        self.shapes[contact]
    }

    /// Whether a contact is a segment of triangles with different planes, which has a direction.
    pub fn is_directed(&self, contact: usize) -> bool {
        self.directed[contact]
    }

    /// The corners of one contact as numbers of points: none, one, a segment's two, or a polygon's.
    pub fn corners(&self, contact: usize) -> &[u32] {
        &self.corners[self.starts[contact]..self.starts[contact + 1]]
    }

    /// The corners of all contacts, one contact after the other.
    pub fn all_corners(&self) -> &[u32] {
        &self.corners
    }

    /// Where each contact's corners start in [`all_corners`](Contacts::all_corners), and one past the last.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// `(n, 3)` coordinates of the points, each the exact one rounded to nearest: to `f32` where both bodies
    /// hold `f32` (a number that `f32` has, then), else to `f64`.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The name of each point: which features meet there. Sorted.
    pub fn names(&self) -> &[PointName] {
        &self.names
    }

    /// The segments chained into loops and open curves.
    pub fn curves(&self) -> Curves {
        Curves::new(self)
    }

    /// The contacts in connected regions, each with its position, its size and a normal. What lies inside, and
    /// how deep, is found by [`Penetration`].
    pub fn regions(&self) -> Vec<Region> {
        let mut sets = regions::Sets::new(self.points.len());
        regions::join_contacts(self, &mut sets);
        regions::regions(self, &self.curves(), &mut sets).0
    }

    /// The vertex that names have for this one: the lowest one at its position.
    fn lowest(&self, body: u32, vertex: u32) -> u32 {
        let Some((_, doubles)) = self.doubles.iter().find(|(held, _)| *held == body) else {
            return vertex;
        };
        doubles
            .binary_search_by_key(&vertex, |&(double, _)| double)
            .map_or(vertex, |ix| doubles[ix].1)
    }
}
