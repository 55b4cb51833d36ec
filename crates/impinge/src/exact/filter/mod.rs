//! The fast path: most pairs settled in plain `f64`, eight at a time, with a proven error bound.
//!
//! What it does: answers *yes*, *no* or *unsure* for a pair of triangles. Yes and no are certain;
//! unsure pairs go to [`triangles_intersect`](super::triangles_intersect). Pairs of random
//! triangles are settled in more than 99 of 100 cases; pairs that touch, are coplanar or
//! degenerate are always unsure.
//!
//! In: [`TrianglePairs8`], eight pairs with one array a coordinate ("structure of arrays").
//! Out: bit masks, bit k for pair k. Cost: [`reject_by_planes`] about 120 and [`classify`] about
//! 330 operations, without a branch, for all eight lanes at once. The functions are
//! `#[inline(always)]` so that a caller wraps them in a function with wider vectors enabled:
//!
//! ```
//! use impinge::exact::filter::{TrianglePairs8, Verdict, classify};
//!
//! # #[cfg(target_arch = "x86_64")]
//! #[target_feature(enable = "avx2")]
//! fn classify_avx2(pairs: &TrianglePairs8) -> Verdict {
//!     classify(pairs)
//! }
//!
//! let mut pairs = TrianglePairs8::default();
//! let a = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let b = [[0.2, 0.2, -1.0], [0.2, 0.2, 1.0], [5.0, 4.0, 1.0]];
//! pairs.set(0, &a, &b);
//! pairs.set(1, &a, &b.map(|[x, y, z]| [x, y, z + 1.5]));
//! assert_eq!(classify(&pairs), Verdict { yes: 0b01, no: 0b10 });
//! ```
//!
//! Method: planes first, then the two edge-edge determinants of Guigue and Devillers, *Fast and
//! Robust Triangle-Triangle Overlap Test Using Orientation Predicates*, 2003. They permute the
//! vertices by branches, we by selects; they test for zero, we give up near it.
//!
//! Invariant: every determinant here is a sum of the six products of three vectors d, e, f, each a
//! difference of two input points. Its computed value is wrong by less than
//! 2^-47 |d| |e| |f| with |.| the largest coordinate, whatever the order of
//! operations and whether or not products and sums are fused (`docs/exactness.md`, "The batch
//! filter"). NaN and overflow make comparisons fail, and so end as unsure.

mod determinant;
mod neighbours;
mod tetrahedra;
mod triangles;

use super::Point;

pub use neighbours::{classify_shared_vertex, reject_shared_edge};
pub(super) use neighbours::{shared_edge, shared_vertex};
pub(super) use tetrahedra::tetrahedra_answer;
pub use tetrahedra::{Tetrahedra8, TetrahedronPairs8, classify_by_faces};
pub(super) use triangles::triangles_answer;
pub use triangles::{classify, reject_by_planes};

/// How many pairs a batch has.
pub const LANES: usize = 8;

/// One triangle a lane: `[vertex][axis][lane]`.
pub type Triangles8 = [[[f64; LANES]; 3]; 3];

/// Eight pairs of triangles, one a lane.
///
/// Lanes that are not set hold triangles that are points, which are unsure: mask them out.
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct TrianglePairs8 {
    /// The first triangle of each pair, `[vertex][axis][lane]`.
    pub a: Triangles8,
    /// The second triangle of each pair, `[vertex][axis][lane]`.
    pub b: Triangles8,
}

impl TrianglePairs8 {
    /// Puts a pair into lane `lane`, which must be less than [`LANES`].
    #[inline(always)]
    pub fn set(&mut self, lane: usize, a: &[Point; 3], b: &[Point; 3]) {
        for vertex in 0..3 {
            for axis in 0..3 {
                self.a[vertex][axis][lane] = a[vertex][axis];
                self.b[vertex][axis][lane] = b[vertex][axis];
            }
        }
    }

    /// The pair of lane `lane`, which must be less than [`LANES`].
    #[inline(always)]
    #[must_use]
    pub fn get(&self, lane: usize) -> ([Point; 3], [Point; 3]) {
        (lane_of(&self.a, lane), lane_of(&self.b, lane))
    }
}

/// What a filter found out: bit k stands for lane k. A lane with neither bit is unsure; no lane
/// has both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// The pairs that certainly intersect.
    pub yes: u8,
    /// The pairs that certainly do not.
    pub no: u8,
}

#[inline(always)]
fn lane_of(triangles: &Triangles8, lane: usize) -> [Point; 3] {
    std::array::from_fn(|vertex| std::array::from_fn(|axis| triangles[vertex][axis][lane]))
}
