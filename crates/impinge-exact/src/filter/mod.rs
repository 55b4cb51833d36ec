//! The fast path: most pairs settled in plain `f64` or `f32`, many at a time, with a proven error
//! bound.
//!
//! What it does: answers *yes*, *no* or *unsure* for a pair of triangles. Yes and no are certain;
//! unsure pairs go to [`triangles_intersect`](super::triangles_intersect). Pairs of random
//! triangles are settled in more than 99 of 100 cases. Coplanar pairs that are apart are mostly
//! settled by [`projections`]; pairs that touch, or overlap in one plane, are always unsure.
//!
//! In: [`TrianglePairs8`], eight pairs with one array per coordinate ("structure of arrays"), in
//! `f64`; or, in `f32`, the corners of two groups as tables ([`Triangles64`]) and the slots of
//! sixteen pairs in them. Out: bit masks, bit k for pair k. Cost: [`reject_by_planes`] about 120
//! and [`classify`] about 330 operations, without a branch, for all eight lanes at once. Both are
//! generic over the vector registers that they use ([`number`]) and `#[inline(always)]`, so that a
//! caller compiles them for an instruction set by calling them from a function that enables it.
//!
//! Method: planes first, then the two edge-edge determinants of Guigue and Devillers, *Fast and
//! Robust Triangle-Triangle Overlap Test Using Orientation Predicates*, 2003. They permute the
//! vertices by branches, we use selects; they test for zero, we answer unsure near it.
//!
//! Invariant: every determinant here is a sum of the six products of three vectors d, e, f, each a
//! difference of two input points. Its computed value is wrong by less than 2^-47 |d| |e| |f| +
//! 2^-950 |f| + 2^-1000 in `f64`, 2^-18 |d| |e| |f| + 2^-69 in `f32`, with |.| the largest
//! coordinate, whatever the order of operations and whether or not products and sums are fused
//! (`docs/exactness.md`, "The batch filter"). NaN and overflow make comparisons fail, and so end as
//! unsure. In `f64` that holds for all finite coordinates.

mod determinant;
mod directions;
pub(super) mod motion;
mod moving;
mod near_tables;
pub(super) mod nearness;
mod neighbours;
pub mod number;
mod passing;
mod projections;
mod tetrahedra;
mod triangles;
mod turns;

use super::Point;

pub use directions::Directions64;
pub use motion::{cross, difference, dot, size};
pub use moving::{
    Enclosed8, Look8, Moving64, Next, Search, Spans8, Steps8, are_across_in_tables, are_apart,
    are_aside_in_tables, are_far_in_tables, enclose, look, time_between,
};
pub(super) use moving::{contact_answer, search_contact};
#[cfg(test)]
pub use near_tables::Near16;
pub use near_tables::{
    Bounded16, SWAPPED_PARTS, are_within_in_tables, bounded_in_tables, bounds_and_parts,
    distance_bounds, nearest_in_tables, point_bounds_in_tables, stay_beyond_in_tables,
};
pub(super) use neighbours::{shared_edge, shared_vertex};
pub use passing::meet_in_tables;
pub(super) use projections::{angles_apart, apart_in_a_plane, sides_apart};
pub(super) use tetrahedra::tetrahedra_answer;
pub use tetrahedra::{classify_by_faces, classify_tetrahedra};
pub(super) use triangles::triangles_answer;
pub use triangles::{classify, classify_in_tables, reject_by_planes};
pub use turns::{TURNS, crossings, turns};

/// How many pairs a batch has.
pub const LANES: usize = 8;

/// How many pairs a batch in `f32` has.
pub const BATCH: usize = 16;

/// How many triangles a table holds.
pub const TABLE: usize = 64;

/// The largest coordinate magnitude that the filter in `f32` accepts, 2^24: the error that
/// underflow may add to a determinant grows with the square of the coordinates.
pub const LARGEST_F32: f32 = f32::from_bits((127 + 24) << 23);

/// The triangles of a group: `[vertex][axis][slot]`.
pub type Triangles64 = [[[f32; TABLE]; 3]; 3];

/// One triangle per lane: `[vertex][axis][lane]`.
pub type Triangles8 = [[[f64; LANES]; 3]; 3];

/// Eight pairs of triangles, one per lane.
///
/// Unused lanes hold two points at the origin and come out as unsure: mask them out.
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct TrianglePairs8 {
    /// The first triangle of each pair, `[vertex][axis][lane]`.
    pub a: Triangles8,
    /// The second triangle of each pair, `[vertex][axis][lane]`.
    pub b: Triangles8,
}

/// One tetrahedron per lane: `[vertex][axis][lane]`.
pub type Tetrahedra8 = [[[f64; LANES]; 3]; 4];

/// Eight pairs of tetrahedra, one per lane.
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct TetrahedronPairs8 {
    /// The first tetrahedron of each pair, `[vertex][axis][lane]`.
    pub a: Tetrahedra8,
    /// The second tetrahedron of each pair, `[vertex][axis][lane]`.
    pub b: Tetrahedra8,
}

/// The points of eight pairs, one pair per lane: `[point][axis][lane]`, points in the order of the
/// [`ElementPair`](crate::ElementPair).
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Points8(pub [Vertex8; 4]);

/// One point per lane: `[axis][lane]`.
pub type Vertex8 = [[f64; LANES]; 3];

/// Writes a point into a lane.
#[inline(always)]
pub fn put_point(row: &mut Vertex8, lane: usize, point: &Point) {
    for (of_axis, &x) in row.iter_mut().zip(point) {
        of_axis[lane] = x;
    }
}

/// A filter's answers: bit k stands for lane k. A lane with neither bit is unsure; no lane has
/// both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// The pairs that certainly intersect.
    pub yes: u8,
    /// The pairs that certainly do not.
    pub no: u8,
}

/// A [`Verdict`] over [`BATCH`] pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict16 {
    /// The pairs that certainly intersect.
    pub yes: u16,
    /// The pairs that certainly do not.
    pub no: u16,
}
