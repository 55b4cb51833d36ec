//! Which pairs count: those of a cell of space, and those that a filter lets pass.

use crate::boxes::Extent;
use crate::query::Cell;
use crate::query::step::PairFilter;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::index::{Number, pair_numbers};

use super::{Plan, Question};

impl Plan {
    pub(super) fn check_cell(&self) -> Result<(), Error> {
        let Some(Cell { low, high }) = self.cell else {
            return Ok(());
        };
        // NaN is not at most anything.
        match (0..3).all(|axis| low[axis] <= high[axis]) {
            true => Ok(()),
            false => Err(Error::Setting {
                setting: "owned_by",
                given: format!("{low:?} to {high:?}"),
                allowed: "a lower corner that is nowhere above the upper one",
            }),
        }
    }

    /// Whether only the pairs of a cell are wanted.
    pub fn has_cell(&self) -> bool {
        self.cell.is_some()
    }

    /// Whether a pair belongs to the cell, if only its pairs are wanted.
    #[inline(always)]
    pub fn is_owned(&self, scene: &Scene, key: u64) -> bool {
        match self.cell {
            None => true,
            Some(cell) => self.is_in_cell(scene, key, cell),
        }
    }

    #[inline(never)]
    fn is_in_cell(&self, scene: &Scene, key: u64, cell: Cell) -> bool {
        let [a, b] = pair_numbers(key).map(|number| self.lower_corner(scene, number));
        cell.holds(std::array::from_fn(|axis| a[axis].max(b[axis])))
    }

    /// The lower corner of the box of an element: over the whole step, if the question is about
    /// one.
    fn lower_corner(&self, scene: &Scene, number: Number) -> [f64; 3] {
        let (part, element) = self.locate(number);
        let body = self.body(scene, part);
        let corners = body.corners(self.part(part).part, &element);
        let end = body.end_positions().filter(|_| self.sweep.until > 0.0);
        let ends = std::iter::once(body.positions()).chain(end);
        let points = ends.flat_map(|at| corners.iter().map(|&corner| at.point(corner as usize)));
        Extent::of(points).min
    }

    /// Whether it is known in the end only which pairs count. Finders of other questions look
    /// themselves.
    pub(crate) fn counts_late(&self) -> bool {
        self.question == Question::Intersection && (self.cell.is_some() || self.leaves_out())
    }

    /// Whether some pairs do not count, because of their elements.
    pub(crate) fn has_filter(&self) -> bool {
        self.filter.is_some()
    }

    /// Whether pairs that do not count are best left out early.
    pub(crate) fn filters_early(&self) -> bool {
        self.filter.as_ref().is_some_and(PairFilter::is_early)
    }

    /// Whether a pair counts: it belongs to the cell, if there is one, the filter lets it pass, and
    /// it is not left out.
    #[inline(always)]
    pub fn counts(&self, scene: &Scene, key: u64) -> bool {
        self.is_owned(scene, key)
            && (self.filter.is_none() || self.passes(scene, key))
            && !(self.leaves_out() && self.is_key_left_out(scene, key))
    }

    #[inline(never)]
    fn passes(&self, scene: &Scene, key: u64) -> bool {
        let Some(filter) = &self.filter else {
            return true;
        };
        let [a, b] = self.located(key);
        let [a, b] = [&a, &b].map(|(part, element)| {
            let corners = self
                .body(scene, *part)
                .corners(self.part(*part).part, element);
            (self.part(*part).id, corners)
        });
        filter.passes([a, b])
    }
}
