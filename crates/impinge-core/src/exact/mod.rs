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
//! Invariant: for coordinates that are [`in_range`], no intermediate value overflows or loses a
//! bit to underflow. Every finite `f32` is in range. Coordinates out of range never cause a panic,
//! but the answer is then unspecified; callers check their input once.
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
pub use orientation::{Sign, orient2d, orient3d};
pub(crate) use rounding::two_sum;
pub(crate) use segment::strictly_between;
pub use shared::{
    tetrahedra_intersect_beyond_shared, triangle_tetrahedron_intersect_beyond_shared,
    triangles_intersect_beyond_shared,
};
pub use sweep::{Contact, first_contact, touch, touch_during};
pub use tetrahedron::{tetrahedra_intersect, triangle_tetrahedron_intersect};
pub use triangle::triangles_intersect;

/// A position: x, y, z in the unit of the scene. `f32` coordinates are widened, which is exact.
pub type Point = [f64; 3];

/// The largest magnitude that a coordinate may have: 2^250, about 1.8e75.
///
/// Three differences of such coordinates multiply to less than 2^756, so that no product or sum
/// of the exact stages comes near the overflow threshold 2^1024 (`docs/exactness.md`, "Range").
pub const MAX_MAGNITUDE: f64 = f64::from_bits((1023 + 250) << 52);

/// The smallest magnitude that a nonzero coordinate may have: 2^-250, about 5.5e-76.
///
/// All coordinates are then multiples of 2^-302 and all determinants of 2^-906, so that no
/// product, error term or error bound underflows (`docs/exactness.md`, "Range"). The smallest
/// `f32` above zero, 2^-149, is well inside.
pub const MIN_MAGNITUDE: f64 = f64::from_bits((1023 - 250) << 52);

/// Whether a coordinate lies in the range for which all answers are exact: zero, or a magnitude
/// from [`MIN_MAGNITUDE`] to [`MAX_MAGNITUDE`].
///
/// False for NaN and the infinities. Every finite `f32`, subnormal ones included, is in range.
///
/// ```
/// use impinge::exact::in_range;
/// assert!(in_range(0.0) && in_range(f64::from(f32::MAX)) && in_range(f64::from(f32::from_bits(1))));
/// assert!(!in_range(f64::NAN) && !in_range(1e300) && !in_range(f64::MIN_POSITIVE));
/// ```
#[inline]
#[must_use]
pub fn in_range(x: f64) -> bool {
    x == 0.0 || (MIN_MAGNITUDE..=MAX_MAGNITUDE).contains(&x.abs())
}
