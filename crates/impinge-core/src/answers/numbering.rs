//! Names of the elements of an answer: the body and the element of each global number.

use crate::answers::changes::check_comparable;
use crate::answers::pairs::Element;
use crate::plan::{Plan, owner_by_first};
use crate::query::pair_kind::PairKind;
use crate::scene::bodies::NumberedPart;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{Number, pair_numbers};

/// Maps global numbers to elements of bodies.
#[derive(Debug, Clone, Default)]
pub(crate) struct Numbering {
    /// Of the scene.
    family: u64,
    /// The first number of each part.
    parts: Vec<(Number, NumberedPart)>,
}

impl Numbering {
    pub fn begin(&mut self, plan: &Plan) {
        self.family = plan.family;
        self.parts.clear();
        let parts = plan.parts.iter();
        (self.parts).extend(parts.map(|of| (of.first, (of.id, of.part, of.numbers_stamp))));
    }

    /// The parts that were asked about: their elements have these numbers as long as their stamps
    /// are the same.
    pub fn numbered(&self) -> impl Iterator<Item = NumberedPart> + Clone + '_ {
        self.parts.iter().map(|&(_, part)| part)
    }

    /// Refuses to compare an answer with an older one, given the pairs of the old one and of the
    /// new.
    ///
    /// # Errors
    /// The older one is about another scene, or both name elements whose numbers have changed.
    pub fn check_comparable(
        &self,
        old: &Numbering,
        pairs: [impl Iterator<Item = (PairKind, Element, Element)>; 2],
    ) -> Result<(), Error> {
        let answers = [old, self].map(|of| (of.family, of.numbered()));
        let named = pairs.map(|pairs| {
            pairs.map(|(kind, a, b)| {
                let [part_a, part_b] = kind.parts();
                [(a.body, part_a), (b.body, part_b)]
            })
        });
        check_comparable(answers, named)
    }

    /// The part that has the element with this number, and the first and the last of its numbers.
    pub fn part_of(&self, number: Number) -> ([Number; 2], NumberedPart) {
        let ix = owner_by_first(&self.parts, number, |part| part.0);
        let (first, part) = self.parts[ix];
        let after = self.parts.get(ix + 1).map(|&(first, _)| first.raw());
        let last = after.map_or(u32::MAX, |after| after - 1);
        ([first, Number::new(last)], part)
    }

    pub fn pair(&self, key: u64) -> (Element, Element) {
        self.pair_after(key, &mut [0; 2])
    }

    /// The elements of a pair, which are often of the same parts as those of the last one.
    #[inline]
    pub fn pair_after(&self, key: u64, last: &mut [usize; 2]) -> (Element, Element) {
        let [a, b] = pair_numbers(key);
        let [of_a, of_b] = last;
        (self.name_after(a, of_a), self.name_after(b, of_b))
    }

    #[inline]
    fn name_after(&self, number: Number, last: &mut usize) -> Element {
        let is_below = |&(first, _): &(Number, NumberedPart)| number < first;
        let is_of_last =
            !is_below(&self.parts[*last]) && self.parts.get(*last + 1).is_none_or(is_below);
        if !is_of_last {
            *last = owner_by_first(&self.parts, number, |part| part.0);
        }
        let (first, (body, ..)) = self.parts[*last];
        Element {
            body,
            element: number.minus(first).raw(),
        }
    }
}

/// `[body_a, element_a, body_b, element_b]`, with bodies by their [`index`](BodyId::index).
pub(crate) fn row(a: Element, b: Element) -> [u32; 4] {
    let index = |body: BodyId| body.index() as u32;
    [index(a.body), a.element, index(b.body), b.element]
}
