//! Names of the elements of an answer: the body and the element of each global number.

use crate::ids::BodyId;
use crate::index::{Number, pair_numbers};
use crate::pairs::Primitive;
use crate::plan::{Plan, owner_by_first};

/// Maps global numbers to elements of bodies.
#[derive(Debug, Clone, Default)]
pub(crate) struct Numbering {
    /// Bodies, and the first number of each of their layers.
    layers: Vec<(BodyId, Number)>,
}

impl Numbering {
    pub fn begin(&mut self, frame: &Plan) {
        self.layers.clear();
        let layers = frame.layers.iter().map(|layer| (layer.id, layer.first));
        self.layers.extend(layers);
    }

    fn name(&self, number: Number) -> Primitive {
        let (body, first) = self.layers[owner_by_first(&self.layers, number, |layer| layer.1)];
        Primitive {
            body,
            primitive: number.minus(first).raw(),
        }
    }

    pub fn pair(&self, key: u64) -> (Primitive, Primitive) {
        let [a, b] = pair_numbers(key).map(|number| self.name(number));
        (a, b)
    }
}

/// `[body_a, element_a, body_b, element_b]`, with bodies by their [`index`](BodyId::index).
pub(crate) fn row(a: Primitive, b: Primitive) -> [u32; 4] {
    let index = |body: BodyId| body.index() as u32;
    [index(a.body), a.primitive, index(b.body), b.primitive]
}
