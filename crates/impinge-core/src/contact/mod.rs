//! Contact geometry: where triangles meet, the curves in which surfaces cross, how deep.
//!
//! [`Contacts`], which [`Detector::contacts`](crate::Detector::contacts) finds for the pairs of a
//! detection, are points, segments and polygons; [`Curves`] chains these into loops;
//! [`Penetration`], which [`Detector::penetration`](crate::Detector::penetration) finds, has the
//! parts of two closed bodies that lie inside the other, and a normal, a depth and a volume per
//! connected region of contact. For solids of tetrahedra, [`SolidOverlap`] is what two of them have
//! in common, and [`solid_depths`] how deep vertices lie below the surface.
//!
//! **Exact combinatorics.** Which edge crosses which face, in which order, which points are one
//! point, which segments follow each other: decided by the signs of [`impinge_exact`], without
//! tolerance. **Rounded coordinates.** Each coordinate is the exact number rounded to nearest: to
//! `f32` if both bodies hold `f32`, else to `f64`. It depends on the point alone, so the bytes are
//! the same on every machine and for every number of threads. Lengths, areas, normals, depths and
//! volumes are computed from rounded coordinates in `f64`, in a fixed order.
//!
//! ```
//! use impinge::contact::Shape;
//! use impinge::{Backend, Detector, Query, Scene};
//! # fn main() -> Result<(), impinge::Error> {
//! let mut scene = Scene::new();
//! let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
//! let blade = [[1.0f32, 1.0, -1.0], [2.0, 1.0, -1.0], [1.0, 1.0, 1.0]];
//! let a = scene.add_triangles(&[[0, 1, 2]], &floor)?;
//! let b = scene.add_triangles(&[[0, 1, 2]], &blade)?;
//! let mut detector = Detector::new(Backend::Cpu)?;
//! let pairs = detector.detect(&scene, &Query::between(a, b))?.clone();
//! let contacts = detector.contacts(&scene, &pairs)?;
//! assert_eq!(contacts.shape(0), Shape::Segment);
//! let ends = [0, 1].map(|end| contacts.points()[contacts.corners(0)[end] as usize]);
//! assert_eq!(ends, [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]]);
//! assert!((contacts.curves()?.length(0) - 0.5).abs() < 1e-15);
//! # Ok(()) }
//! ```

mod build;
mod convex;
mod coordinates;
mod crossings;
mod curves;
mod depths;
mod double;
mod inside;
mod meet;
mod orientation;
mod parts;
mod penetration;
mod regions;
mod solids;
mod topology;

pub use convex::{ConvexOverlap, convex_overlap};
pub use curves::Curves;
pub use depths::solid_depths;
pub(crate) use inside::passes;
pub use penetration::Penetration;
pub(crate) use penetration::Topologies;
pub use regions::Region;
pub use solids::SolidOverlap;

use std::sync::Arc;

use crate::answers::pairs::Pairs;
use crate::plan::Gaps;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::VertexIx;
use crate::search::sets::Sets;
use crate::search::work::Work;

/// The vertex, edge or face of a body in whose relative interior a point of contact lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Feature {
    /// A vertex index. Of several vertices at one position, the lowest one of the
    /// triangles in contact.
    Vertex(u32),
    /// Two vertex indices, the lower one first.
    Edge([u32; 2]),
    /// A face index.
    Face(u32),
}

/// The intersection of a pair of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Shape {
    /// Not a pair of triangles. The intersection with a tetrahedron is a solid, which no curve
    /// describes.
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

/// The name of a point of contact: the numbers of both bodies, and the feature of each in which the
/// point lies. Within one body the lower feature comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PointName {
    /// The bodies by their [`index`](crate::BodyId::index); the same number twice within one body.
    pub bodies: [u32; 2],
    /// The feature of the first body, and of the second.
    pub features: [Feature; 2],
}

/// Where the triangles of each pair meet.
///
/// Contact `i` belongs to row `i` of the pairs. Its corners are numbers of points; a point that
/// belongs to several contacts is held once. Points are one if they have one name, by features:
/// where a face is there twice, or faces of one body overlap in a plane, points and curves double,
/// and what they would connect can be several regions.
///
/// A segment of two triangles with different planes points along `n_a × n_b`, the product of their
/// normals (counter-clockwise rule): seen from outside body `a`, the part of `a` beneath `b`'s
/// surface lies to its left.
///
/// Degenerate triangles are the segments or points that they are.
#[derive(Clone, Default)]
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
    /// For each body that has any: vertices that are not the lowest one at their position, each
    /// with the lowest.
    doubles: Arc<[(u32, Doubles)]>,
    /// The stamps of the positions of the bodies for which the pairs were found.
    stamps: Vec<(BodyId, u64)>,
    gaps: Gaps,
    by_bodies: parts::ByBodies,
}

impl std::fmt::Debug for Contacts {
    /// Their number and that of their points, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Contacts");
        short.field("len", &self.len());
        short.field("n_points", &self.points.len());
        short.finish_non_exhaustive()
    }
}

impl Contacts {
    /// The contacts of all pairs.
    pub(crate) fn new(scene: &Scene, pairs: &Pairs, work: Work<'_>) -> Result<Self, Error> {
        build::contacts(scene, pairs, work)
    }

    /// Refuses a body that has moved since.
    ///
    /// # Errors
    /// Names the body.
    pub(crate) fn refuse_moved(&self, scene: &Scene, id: BodyId) -> Result<(), Error> {
        let found = self.stamps.binary_search_by_key(&id, |(id, _)| *id);
        let stamp = found.map(|ix| self.stamps[ix].1);
        match stamp == Ok(scene.body(id)?.positions_stamp()) {
            true => Ok(()),
            false => Err(Error::Moved { body: id }),
        }
    }

    /// Why pairs of two bodies may not be among these.
    pub(crate) fn gaps(&self) -> &Gaps {
        &self.gaps
    }

    /// Bytes of the lists with an entry per contact, corner or point.
    pub(crate) fn bytes(&self) -> u64 {
        let of_contacts = size_of_val(&self.rows[..])
            + size_of_val(&self.shapes[..])
            + size_of_val(&self.directed[..])
            + size_of_val(&self.starts[..]);
        let of_points = size_of_val(&self.corners[..])
            + size_of_val(&self.names[..])
            + size_of_val(&self.points[..]);
        (of_contacts + of_points) as u64
    }

    /// The number of contacts, which is the number of pairs.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there are no contacts.
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// The rows of the pairs: `[body_a, element_a, body_b, element_b]`.
    pub fn rows(&self) -> &[[u32; 4]] {
        &self.rows
    }

    /// The shape of each pair's intersection.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// The shape of the intersection in row `contact`.
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

    /// Where each contact's corners start in [`all_corners`](Contacts::all_corners), and one past
    /// the last.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// `(n, 3)` coordinates of the points, each the exact number rounded to nearest: to an `f32`
    /// (widened to `f64`) if both bodies hold `f32`, else to an `f64`.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The name of each point: which features meet there. Sorted.
    pub fn names(&self) -> &[PointName] {
        &self.names
    }

    /// The segments chained into loops and open curves.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn curves(&self) -> Result<Curves, Error> {
        Curves::new(self)
    }

    /// The contacts in connected regions, each with its position, its size and a normal.
    /// [`Penetration`] finds what lies inside, and how deep.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn regions(&self) -> Result<Vec<Region>, Error> {
        let mut sets = Sets::new(self.points.len(), regions::WHAT)?;
        regions::join_contacts(self, &mut sets);
        let (regions, _) = regions::regions(self, &self.curves()?, &mut sets, |_| [1.0; 2])?;
        Ok(regions)
    }

    /// The vertex that stands for this one in names: the lowest one at its position.
    fn lowest(&self, body: u32, vertex: VertexIx) -> VertexIx {
        let found = self.doubles.binary_search_by_key(&body, |held| held.0);
        found.map_or(vertex, |ix| lowest(&self.doubles[ix].1, vertex))
    }
}

/// Vertices that are not the lowest one at their position, each with the lowest; sorted.
type Doubles = Vec<(VertexIx, VertexIx)>;

/// The lowest vertex at the position of a vertex.
fn lowest(doubles: &Doubles, vertex: VertexIx) -> VertexIx {
    let found = doubles.binary_search_by_key(&vertex, |&(double, _)| double);
    found.map_or(vertex, |ix| doubles[ix].1)
}
