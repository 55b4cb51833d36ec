//! The test of one pair, as a trait. Every method and backend ends with it.

mod impact;
mod intersection;
mod overlap;
mod within;

#[cfg(feature = "gpu")]
pub(crate) use intersection::decide;
pub(crate) use intersection::{Intersection, intersect, intersect_shared};

pub(crate) use impact::{FirstContact, exact_kind};
pub(crate) use overlap::{BoxOverlap, are_near};
pub(crate) use within::{Corners, Within};

use crate::boxes::Extent;
use crate::plan::{Plan, TestId};
use crate::scene::Scene;
use crate::scene::index::{ElementIx, PartIx};

/// One element of one part of a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PairElement<'a> {
    pub scene: &'a Scene,
    pub plan: &'a Plan,
    /// The part.
    pub part: PartIx,
    /// Its number in the part.
    pub element: ElementIx,
    /// Its corners, as vertices of the part's body.
    pub corners: &'a [u32],
}

/// A test of a pair of elements, and its answer.
pub(crate) trait Test {
    /// The value of a reported pair: nothing, a time, a distance.
    type Value: Copy;

    /// A box around an element: pairs whose boxes have no point in common are not reported.
    fn extent(&self, element: PairElement<'_>) -> Extent;

    /// Whether the adjacency rule lets a pair whose extents meet be a candidate.
    fn admits(&self, _: TestId, _: PairElement<'_>, _: PairElement<'_>) -> bool {
        true
    }

    /// The value of a pair, decided exactly and by the adjacency rule; `None` if the pair is not
    /// reported.
    fn decide(&self, test: TestId, a: PairElement<'_>, b: PairElement<'_>) -> Option<Self::Value>;
}

impl<'a> PairElement<'a> {
    /// An element that was located by its number.
    pub fn new(scene: &'a Scene, plan: &'a Plan, (part, element): &'a (PartIx, ElementIx)) -> Self {
        let of = plan.part(*part).part;
        PairElement {
            scene,
            plan,
            part: *part,
            element: *element,
            corners: plan.body(scene, *part).corners(of, element),
        }
    }
}

impl PairElement<'_> {
    /// Whether two elements are of one body and name a common vertex of it.
    pub fn shares_vertex(&self, other: &PairElement<'_>) -> bool {
        let same_body = self.plan.part(self.part).id == self.plan.part(other.part).id;
        same_body && share_vertex(self.corners, other.corners)
    }

    /// The corners at the start of a step and at its end.
    fn ends(&self) -> impl Iterator<Item = [[f64; 3]; 2]> {
        self.ends_at(1.0)
    }

    /// The corners at the start of a step and at a fraction of it, rounded to the precision of the
    /// positions.
    fn ends_at(&self, fraction: f64) -> impl Iterator<Item = [[f64; 3]; 2]> {
        let body = self.plan.body(self.scene, self.part);
        let start = body.positions();
        let end = body.end_positions().unwrap_or(start);
        self.corners.iter().map(move |&corner| {
            let vertex = corner as usize;
            [
                start.point(vertex),
                start.blend_point(end, vertex, fraction),
            ]
        })
    }
}

/// Whether two elements of one body name a common vertex.
#[inline]
pub(crate) fn share_vertex(a: &[u32], b: &[u32]) -> bool {
    a.iter().any(|corner| b.contains(corner))
}
