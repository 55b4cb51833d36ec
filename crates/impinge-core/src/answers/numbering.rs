//! Names of the elements of an answer: the body and the element of each global number.

use crate::answers::pairs::Element;
use crate::plan::{Plan, owner_by_first};
use crate::scene::ids::BodyId;
use crate::scene::index::{Number, pair_numbers};

/// Maps global numbers to elements of bodies.
#[derive(Debug, Clone, Default)]
pub(crate) struct Numbering {
    /// Bodies, and the first number of each of their parts.
    parts: Vec<(BodyId, Number)>,
}

impl Numbering {
    pub fn begin(&mut self, plan: &Plan) {
        self.parts.clear();
        let parts = plan.parts.iter().map(|part| (part.id, part.first));
        self.parts.extend(parts);
    }

    fn name(&self, number: Number) -> Element {
        let (body, first) = self.parts[owner_by_first(&self.parts, number, |part| part.1)];
        Element {
            body,
            element: number.minus(first).raw(),
        }
    }

    pub fn pair(&self, key: u64) -> (Element, Element) {
        let [a, b] = pair_numbers(key).map(|number| self.name(number));
        (a, b)
    }
}

/// `[body_a, element_a, body_b, element_b]`, with bodies by their [`index`](BodyId::index).
pub(crate) fn row(a: Element, b: Element) -> [u32; 4] {
    let index = |body: BodyId| body.index() as u32;
    [index(a.body), a.element, index(b.body), b.element]
}
