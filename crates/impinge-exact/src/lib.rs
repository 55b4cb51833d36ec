//! One exact test and nothing else: do two elements touch, how far apart are they, and when do they
//! first meet?
//!
//! What it does: decides, without any tolerance, whether two triangles, two tetrahedra or a
//! triangle and a tetrahedron share at least one point when their coordinates are read as real
//! numbers ([`triangles_intersect`]); whether vertices, edges and faces are within a distance
//! ([`are_within`]); and when two of them first touch while their points move ([`first_contact`]).
//! Elements are *closed*: touching counts, coplanar overlap counts, and a degenerate element is
//! the segment, the point or the flat polygon that it is.
//!
//! How: answers about elements at rest are combinations of signs of two determinants,
//! [`orient2d`] and [`orient3d`], and of comparisons of single coordinates. The signs are exact
//! (adaptive arithmetic after Shewchuk, *Adaptive Precision Floating-Point Arithmetic and Fast
//! Robust Geometric Predicates*, 1997), so the answers are. Answers about motion and distances are
//! signs of polynomials, in integers of any size where floats with an error bound cannot tell.
//!
//! Invariant: answers are exact for all finite coordinates, of whatever size: where doubles would
//! overflow or lose a bit to underflow, integers decide. Others never cause a panic, but the answer
//! is then unspecified; callers check their input once.
//!
//! `docs/exactness.md` of the repository derives every bound and draws every case.
//!
//! It has no scene and no threads: for whole meshes use the crate `impinge`, which is built on this
//! one. It needs an allocator, for integers above 512 bits and polynomials. With default features
//! it uses the standard library for square roots alone; without, the feature `libm` has them.

#![warn(missing_debug_implementations)]
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![cfg_attr(not(any(feature = "std", test)), no_std)]

extern crate alloc;

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("square roots come from the feature `std` or from the feature `libm`");

mod algebra;
mod distance;
mod element_pair;
mod filter;
mod orientation;
mod ray;
mod rounding;
mod segment;
mod shared;
mod sign;
mod sweep;
mod tetrahedron;
mod triangle;
mod twice;

#[cfg(test)]
mod tests;

pub use distance::{
    Feature, NearestFeatures, NearestPoints, are_within, closest_points, edge_face_are_within,
    faces_are_within, first_within, nearest_features,
};
pub use element_pair::ElementPair;
pub use orientation::{orient2d, orient3d};
pub use shared::{
    tetrahedra_intersect_beyond_shared, triangle_tetrahedron_intersect_beyond_shared,
    triangles_intersect_beyond_shared,
};
pub use sign::Sign;
pub use sweep::{Contact, first_contact, touch, touch_during};
pub use tetrahedron::{tetrahedra_intersect, triangle_tetrahedron_intersect};
pub use triangle::triangles_intersect;

/// The page of the crate, whose example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// A position: x, y, z in the unit of the scene. `f32` coordinates are widened, which is exact.
pub type Point = [f64; 3];

/// What the engine of impinge needs beyond single tests. **No promise of stability: do not rely on
/// it.**
///
/// The registers of an instruction set in [`filter::number`] may only be used where the processor
/// has been asked for that set, in functions compiled for it. Nothing checks that.
pub mod internal {
    pub use crate::algebra::{Integer, unit_of};
    pub use crate::distance::{
        Approach, Keep, NearestOfElements, PairAtPart, Reach, approach, are_within_certainly,
        closest_by_part, closest_of_elements, compare_point_distances, distance_under,
        elements_are_within, elements_meet, gap_below, gap_by_bounds, nearest_of_elements,
        nearest_part_of_element, paired, point_distance_bounds, shares_apart, shares_at_rest,
        shares_without_room, unsure_are_within,
    };
    pub use crate::orientation::{Projection, collinear};
    pub use crate::ray::{Meeting, Parameter, Ray, meet, meet_inside};
    pub use crate::rounding::power_of_two;
    pub use crate::segment::strictly_between;
    pub use crate::twice::{two_product, two_sum};

    /// The tests of many pairs at a time, in the registers of an instruction set: certain answers,
    /// or none.
    pub mod filter {
        pub use crate::filter::*;
    }
}
