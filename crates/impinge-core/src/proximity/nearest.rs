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
    /// Their distance in the unit of the scene. 0 if and only if they share a point, which is
    /// decided exactly. Otherwise rounded: it is computed in `f64` from two points of the
    /// primitives, with an error of a few units in the last place of the largest coordinate.
    pub distance: f64,
    /// The element of the first body: of the first that was asked for, or of the lower of the
    /// nearest two of many.
    pub a: Element,
    /// The element of the second body. Of several pairs at the same computed distance, the lowest
    /// by `a` and then by `b`.
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
