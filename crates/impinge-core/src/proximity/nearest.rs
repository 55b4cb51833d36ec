//! The nearest elements of two bodies.

use crate::answers::pairs::Element;
use crate::scene::ids::BodyId;
use crate::scene::index::ElementIx;
use impinge_exact::Point;

/// The nearest pair of elements of two bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Nearest {
    /// Their distance in the unit of the scene, rounded down: the largest `f64` that is not above
    /// the true one. 0 if and only if they share a point, which is decided exactly, or are nearer
    /// than the smallest `f64`.
    pub distance: f64,
    /// The element of the first body: of the first that was asked for, or of the lower of the
    /// nearest two of many.
    pub a: Element,
    /// The element of the second body. Of several pairs at the same distance, rounded down, the
    /// lowest by `a` and then by `b`.
    pub b: Element,
    /// The point of each element that is nearest to the other, rounded. Where they touch, a point
    /// that they share, twice: see [`contact`](crate::contact) for all of them.
    pub points: [[f64; 3]; 2],
}

impl Nearest {
    pub(super) fn new(
        distance: f64,
        bodies: [BodyId; 2],
        elements: [ElementIx; 2],
        points: [Point; 2],
    ) -> Self {
        let [a, b] = [0, 1].map(|side| Element {
            body: bodies[side],
            element: elements[side].raw(),
        });
        Nearest {
            distance,
            a,
            b,
            points,
        }
    }

    pub(super) fn bodies(&self) -> [BodyId; 2] {
        [self.a.body, self.b.body]
    }

    pub(super) fn elements(&self) -> [ElementIx; 2] {
        [self.a, self.b].map(|at| ElementIx::new(at.element))
    }
}
