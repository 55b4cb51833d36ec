//! Whether two elements are within a distance, at the positions that their bodies have.

use crate::boxes::Extent;
use crate::plan::TestId;
use crate::query::pair_kind::PairKind;
use crate::scene::positions::Positions;
use impinge_exact::Point;
use impinge_exact::internal::{elements_are_within, elements_meet};

use super::{PairElement, Test};

/// The test of [`Detector::near`](crate::Detector::near).
pub(crate) struct Within;

impl Test for Within {
    type Value = ();

    fn extent(&self, element: PairElement<'_>) -> Extent {
        let extent = Extent::of(element.corners().points().iter().copied());
        extent.inflated(element.plan.inflation_of(element.part, element.element))
    }

    fn decide(&self, test: TestId, a: PairElement<'_>, b: PairElement<'_>) -> Option<()> {
        if a.shares_vertex(&b) {
            return None;
        }
        let pair = [&a, &b].map(|of| (of.part, of.element));
        let reach = a.plan.reach_of(pair);
        let (a, b) = (a.corners(), b.corners());
        match test {
            // What else is near has vertices and edges that are.
            TestId::Elements(PairKind::EdgeFace) => elements_meet(a.points(), b.points()),
            _ => elements_are_within(a.points(), b.points(), &reach),
        }
        .then_some(())
    }
}

impl PairElement<'_> {
    fn corners(&self) -> Corners {
        let body = self.plan.body(self.scene, self.part);
        Corners::new(body.positions(), self.corners)
    }
}

/// The corners of a vertex, an edge or a face.
pub(crate) struct Corners {
    points: [Point; 3],
    n: usize,
}

impl Corners {
    #[inline(always)]
    pub fn new(positions: &Positions, corners: &[u32]) -> Self {
        let mut points = [[0.0; 3]; 3];
        let n = corners.len().min(3);
        for (point, &corner) in points.iter_mut().zip(corners) {
            *point = positions.point(corner as usize);
        }
        Corners { points, n }
    }

    #[inline]
    pub fn points(&self) -> &[Point] {
        &self.points[..self.n]
    }
}
