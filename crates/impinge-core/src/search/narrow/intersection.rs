//! Whether two elements share a point.

use crate::boxes::Extent;
#[cfg(feature = "gpu")]
use crate::plan::Plan;
use crate::plan::TestId;
use crate::query::SharedVertex;
#[cfg(feature = "gpu")]
use crate::scene::Scene;
use crate::scene::elements::BodyKind;
#[cfg(feature = "gpu")]
use crate::scene::index::pair_numbers;
use impinge_exact::Point;

use super::{PairElement, Test};

/// The test of [`Detector::detect`](crate::Detector::detect).
pub(crate) struct Intersection;

impl Test for Intersection {
    type Value = ();

    fn extent(&self, element: PairElement<'_>) -> Extent {
        Extent::of(element.points().into_iter())
    }

    fn admits(&self, _: TestId, a: PairElement<'_>, b: PairElement<'_>) -> bool {
        a.plan.shared_vertex == SharedVertex::Resolve || !a.shares_vertex(&b)
    }

    fn decide(&self, _: TestId, a: PairElement<'_>, b: PairElement<'_>) -> Option<()> {
        let (points_a, points_b) = (a.points(), b.points());
        let kind = |element: PairElement<'_>| element.plan.part(element.part).kind;
        let is_reported = if a.shares_vertex(&b) {
            let rule = a.plan.shared_vertex;
            intersect_shared(
                rule,
                kind(a),
                (&points_a, a.corners),
                (&points_b, b.corners),
            )
        } else {
            intersect(kind(a), &points_a, kind(b), &points_b)
        };
        is_reported.then_some(())
    }
}

/// Decides a pair, given its key.
#[cfg(feature = "gpu")]
pub(crate) fn decide(scene: &Scene, plan: &Plan, key: u64) -> bool {
    let [a, b] = pair_numbers(key).map(|number| {
        let (part, element) = plan.locate(number);
        let elements = plan.body(scene, part).part(plan.part(part).part);
        PairElement {
            scene,
            plan,
            part,
            element,
            corners: elements.corners(element.index()),
        }
    });
    Intersection.decide(TestId::Intersection, a, b).is_some()
}

impl PairElement<'_> {
    /// The corners in double precision; an element with fewer than four repeats its last.
    fn points(&self) -> [Point; 4] {
        let positions = self.plan.body(self.scene, self.part).positions();
        let last = self.corners.len() - 1;
        std::array::from_fn(|k| positions.point(self.corners[k.min(last)] as usize))
    }
}

fn triangle(corners: &[Point; 4]) -> &[Point; 3] {
    corners.first_chunk().expect("three of four")
}

/// Whether two elements of different bodies, or of one body without a common vertex, share a
/// point. Points and edges are degenerate triangles.
pub(crate) fn intersect(
    kind_a: BodyKind,
    a: &[Point; 4],
    kind_b: BodyKind,
    b: &[Point; 4],
) -> bool {
    match (kind_a, kind_b) {
        (BodyKind::Tetrahedra, BodyKind::Tetrahedra) => impinge_exact::tetrahedra_intersect(a, b),
        (_, BodyKind::Tetrahedra) => impinge_exact::triangle_tetrahedron_intersect(triangle(a), b),
        (BodyKind::Tetrahedra, _) => impinge_exact::triangle_tetrahedron_intersect(triangle(b), a),
        _ => impinge_exact::triangles_intersect(triangle(a), triangle(b)),
    }
}

/// Whether a pair of one body that shares a vertex index is reported under the rule. Pairs of
/// points and of edges never are.
pub(crate) fn intersect_shared(
    rule: SharedVertex,
    kind: BodyKind,
    a: (&[Point; 4], &[u32]),
    b: (&[Point; 4], &[u32]),
) -> bool {
    let three = |corners: &[u32]| [corners[0], corners[1], corners[2]];
    let four = |corners: &[u32]| [corners[0], corners[1], corners[2], corners[3]];
    match (rule, kind) {
        (SharedVertex::Skip, _) | (_, BodyKind::Points | BodyKind::Edges) => false,
        (SharedVertex::Resolve, BodyKind::Triangles) => {
            impinge_exact::triangles_intersect_beyond_shared(
                triangle(a.0),
                three(a.1),
                triangle(b.0),
                three(b.1),
            )
        }
        (SharedVertex::Resolve, BodyKind::Tetrahedra) => {
            impinge_exact::tetrahedra_intersect_beyond_shared(a.0, four(a.1), b.0, four(b.1))
        }
    }
}
