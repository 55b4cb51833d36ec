//! Exact answers: do two closed primitives share a point?
//!
//! What it does: decides, without any tolerance, whether two triangles, two tetrahedra or a
//! triangle and a tetrahedron share at least one point when their coordinates are read as real
//! numbers. Primitives are *closed*: touching counts, coplanar overlap counts, and a degenerate
//! primitive is the segment, the point or the flat polygon that it is.
//!
//! How: every answer is a combination of signs of two determinants, [`orient2d`] and
//! [`orient3d`], and of comparisons of single coordinates. The signs are exact (adaptive
//! arithmetic after Shewchuk, *Adaptive Precision Floating-Point Arithmetic and Fast Robust
//! Geometric Predicates*, 1997), so the answers are.
//!
//! Invariant: answers are exact for all finite coordinates, of whatever size: where doubles would overflow or lose a
//! bit to underflow, integers decide. Others never cause a panic, but the answer is then unspecified; callers check their
//! input once.
//!
//! `docs/exactness.md` derives every bound and draws every case.

mod algebra;
mod distance;
mod element_pair;
pub(crate) mod filter;
mod orientation;
mod rounding;
mod segment;
mod shared;
mod sign;
mod sweep;
mod tetrahedron;
mod triangle;

#[cfg(test)]
mod tests;

pub(crate) use algebra::{Integer, unit_of};
pub(crate) use distance::{
    Approach, Keep, NearestOfElements, Reach, approach, are_within_certainly, closest_of_elements,
    elements_are_within, elements_meet, nearest_of_elements, unsure_are_within,
};
pub use distance::{
    Closest, Feature, NearestFeatures, are_within, closest_points, edge_face_are_within,
    faces_are_within, first_within, nearest_features,
};
pub use element_pair::ElementPair;
pub(crate) use orientation::{Projection, collinear};
pub use orientation::{orient2d, orient3d};
pub(crate) use rounding::two_sum;
pub(crate) use segment::strictly_between;
pub use shared::{
    tetrahedra_intersect_beyond_shared, triangle_tetrahedron_intersect_beyond_shared,
    triangles_intersect_beyond_shared,
};
pub use sign::Sign;
pub use sweep::{Contact, first_contact, touch, touch_during};
pub use tetrahedron::{tetrahedra_intersect, triangle_tetrahedron_intersect};
pub use triangle::triangles_intersect;

/// A position: x, y, z in the unit of the scene. `f32` coordinates are widened, which is exact.
pub type Point = [f64; 3];
