//! Whether two elements touch during a step, and when first.

use crate::boxes::Extent;
use crate::plan::TestId;
use crate::query::pair_kind::PairKind;
use impinge_exact::{Contact, ElementPair, Point};

use super::{PairElement, Test};

/// The test of [`Detector::impacts`](crate::Detector::impacts).
pub(crate) struct FirstContact;

impl Test for FirstContact {
    type Value = Contact;

    fn extent(&self, element: PairElement<'_>) -> Extent {
        let extent = Extent::of(element.ends().flatten());
        match element.plan.inflation_of(element.part, element.element) {
            0.0 => extent,
            inflation => extent.inflated(inflation),
        }
    }

    fn decide(&self, test: TestId, a: PairElement<'_>, b: PairElement<'_>) -> Option<Contact> {
        Self::decide_part(test, a, b, 1.0)
    }
}

impl FirstContact {
    /// The first contact on the straight way from the start to the positions at a fraction of the
    /// step, which are rounded as they are stored.
    pub fn decide_part(
        test: TestId,
        a: PairElement<'_>,
        b: PairElement<'_>,
        fraction: f64,
    ) -> Option<Contact> {
        if a.shares_vertex(&b) {
            return None;
        }
        let (pair, [a, b], [start, end]) = Self::ends(test, [a, b], fraction)?;
        let elements = [&a, &b].map(|of| (of.part, of.element));
        a.plan.first(a.scene, elements, pair, [&start, &end])
    }

    /// The pair as the exact predicate names it, with its elements in that order, and their points
    /// at the start and at a fraction of the step.
    pub fn ends(
        test: TestId,
        [a, b]: [PairElement<'_>; 2],
        fraction: f64,
    ) -> Option<(ElementPair, [PairElement<'_>; 2], [[Point; 4]; 2])> {
        let pair = exact_kind(test)?;
        // The pair is named "edge and vertex", but tested as vertex and edge.
        let (a, b) = match pair {
            ElementPair::VertexEdge => (b, a),
            _ => (a, b),
        };
        let mut points: [[Point; 4]; 2] = Default::default();
        let ends = a.ends_at(fraction).chain(b.ends_at(fraction));
        for (ix, ends) in ends.enumerate() {
            for (points, end) in points.iter_mut().zip(ends) {
                points[ix] = end;
            }
        }
        Some((pair, [a, b], points))
    }
}

/// The pair as the exact predicate names it; `None` for tests that look for no contact.
pub(crate) fn exact_kind(test: TestId) -> Option<ElementPair> {
    match test {
        TestId::Elements(PairKind::VertexFace) => Some(ElementPair::VertexFace),
        TestId::Elements(PairKind::EdgeEdge) => Some(ElementPair::EdgeEdge),
        TestId::Elements(PairKind::EdgeVertex) => Some(ElementPair::VertexEdge),
        TestId::Elements(PairKind::VertexVertex) => Some(ElementPair::VertexVertex),
        TestId::Elements(PairKind::EdgeFace | PairKind::FaceFace) | TestId::Intersection => None,
    }
}
