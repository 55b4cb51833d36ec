//! The exact test of one pair, whatever its kinds: what every backend ends in.

use crate::exact::{self, Point};
use crate::frame::{Frame, Participant};
use crate::query::SharedVertex;
use crate::scene::{Kind, Scene};

fn triangle(corners: &[Point; 4]) -> &[Point; 3] {
    corners.first_chunk().expect("three of four")
}

/// Whether two primitives of different bodies, or of one body without a common vertex, share a
/// point.
pub(crate) fn intersect(kind_a: Kind, a: &[Point; 4], kind_b: Kind, b: &[Point; 4]) -> bool {
    match (kind_a, kind_b) {
        (Kind::Triangles, Kind::Triangles) => exact::triangles_intersect(triangle(a), triangle(b)),
        (Kind::Tetrahedra, Kind::Tetrahedra) => exact::tetrahedra_intersect(a, b),
        (Kind::Triangles, Kind::Tetrahedra) => {
            exact::triangle_tetrahedron_intersect(triangle(a), b)
        }
        (Kind::Tetrahedra, Kind::Triangles) => {
            exact::triangle_tetrahedron_intersect(triangle(b), a)
        }
    }
}

/// Whether a pair of one body that shares a vertex index is reported under the rule.
pub(crate) fn intersect_shared(
    rule: SharedVertex,
    kind: Kind,
    a: (&[Point; 4], &[u32]),
    b: (&[Point; 4], &[u32]),
) -> bool {
    let ids = |corners: &[u32]| std::array::from_fn(|k| corners[k.min(corners.len() - 1)]);
    let three = |corners: &[u32]| [corners[0], corners[1], corners[2]];
    match (rule, kind) {
        (SharedVertex::Skip, _) => false,
        (SharedVertex::Resolve, Kind::Triangles) => exact::triangles_intersect_beyond_shared(
            triangle(a.0),
            three(a.1),
            triangle(b.0),
            three(b.1),
        ),
        (SharedVertex::Resolve, Kind::Tetrahedra) => {
            exact::tetrahedra_intersect_beyond_shared(a.0, ids(a.1), b.0, ids(b.1))
        }
    }
}

/// Whether two primitives of one body name a common vertex.
#[inline]
pub(crate) fn share_vertex(a: &[u32], b: &[u32]) -> bool {
    a.iter().any(|corner| b.contains(corner))
}

/// Settles one pair of global primitive numbers exactly, adjacency rule included.
pub(crate) fn settle(scene: &Scene, frame: &Frame, a: u32, b: u32) -> bool {
    let (a_ix, b_ix) = (frame.owner(a), frame.owner(b));
    let locate = |global: u32, participant: &Participant| (global - participant.first) as usize;
    let (body_a, body_b) = (frame.body(scene, a_ix), frame.body(scene, b_ix));
    let a = locate(a, &frame.participants[a_ix]);
    let b = locate(b, &frame.participants[b_ix]);
    let (points_a, points_b) = (body_a.corner_points(a), body_b.corner_points(b));
    if a_ix == b_ix {
        let (ids_a, ids_b) = (body_a.elements().corners(a), body_a.elements().corners(b));
        if share_vertex(ids_a, ids_b) {
            let rule = frame.shared_vertex;
            return intersect_shared(rule, body_a.kind(), (&points_a, ids_a), (&points_b, ids_b));
        }
    }
    intersect(body_a.kind(), &points_a, body_b.kind(), &points_b)
}
