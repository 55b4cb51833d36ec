//! The elements and points of one pair after another, by their keys.
//!
//! Reason: answers have millions of pairs, nearly all of the same two parts. What is known of a
//! part is held from pair to pair; to look it up for each costs more than to read the points.

use crate::plan::Plan;
use crate::scene::Scene;
use crate::scene::elements::{Elements, Part};
use crate::scene::index::{ElementIx, Number, PartIx, pair_numbers};
use crate::scene::positions::Positions;
use crate::search::narrow::Corners;
use impinge_exact::Point;

/// A part, and an element of it.
pub(crate) type Located = (PartIx, ElementIx);

/// Reads pairs of one kind.
pub(crate) struct PairReader<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    sides: [Held<'a>; 2],
}

impl<'a> PairReader<'a> {
    pub fn new(scene: &'a Scene, plan: &'a Plan) -> Self {
        let first = || Held::new(scene, plan, PartIx::new(0));
        PairReader {
            scene,
            plan,
            sides: [first(), first()],
        }
    }

    /// The elements of a pair, in the order of its key.
    #[inline(always)]
    pub fn locate(&mut self, key: u64) -> [Located; 2] {
        let [a, b] = pair_numbers(key);
        let [of_a, of_b] = &mut self.sides;
        [
            of_a.locate(self.scene, self.plan, a),
            of_b.locate(self.scene, self.plan, b),
        ]
    }

    /// The two elements that were located last.
    #[inline(always)]
    pub fn sides<'b>(&self, located: &'b [Located; 2]) -> [Side<'b>; 2]
    where
        'a: 'b,
    {
        let [of_a, of_b] = &self.sides;
        [of_a.side(&located[0].1), of_b.side(&located[1].1)]
    }
}

/// An element of a pair.
#[derive(Clone, Copy)]
pub(crate) struct Side<'a> {
    positions: &'a Positions,
    corners: &'a [u32],
}

impl<'a> Side<'a> {
    /// Its corners.
    #[inline(always)]
    pub fn points(self) -> impl Iterator<Item = Point> + 'a {
        let corners = self.corners.iter();
        corners.map(move |&corner| self.positions.point(corner as usize))
    }

    /// The same, together.
    #[inline(always)]
    pub fn corners(self) -> Corners {
        Corners::new(self.positions, self.corners)
    }
}

/// What is known of a part.
struct Held<'a> {
    part: PartIx,
    of: Part,
    elements: &'a Elements,
    positions: &'a Positions,
}

impl<'a> Held<'a> {
    fn new(scene: &'a Scene, plan: &'a Plan, part: PartIx) -> Self {
        let (of, body) = (plan.part(part).part, plan.body(scene, part));
        Held {
            part,
            of,
            elements: body.part(of),
            positions: body.positions(),
        }
    }

    /// Finds an element, and holds its part.
    #[inline(always)]
    fn locate(&mut self, scene: &'a Scene, plan: &'a Plan, number: Number) -> Located {
        let mut part = self.part;
        let located = plan.locate_after(number, &mut part);
        if part != self.part {
            *self = Self::new(scene, plan, part);
        }
        located
    }

    #[inline(always)]
    fn side<'b>(&self, element: &'b ElementIx) -> Side<'b>
    where
        'a: 'b,
    {
        Side {
            positions: self.positions,
            corners: self.elements.corners_in(self.of, element),
        }
    }
}
