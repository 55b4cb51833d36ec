//! Whether the boxes of elements over the whole step, inflated, overlap.
//!
//! Stage `pairing` has tested boxes in `f32` that were rounded outward; here they are tested as they are.

use crate::cpu::simd::Isa;
use crate::elements::Elements;
use crate::hull::{Extent, Hull};
use crate::impacts::StepAnswer;
use crate::index::Place;
use crate::narrow::are_near;

use super::super::world::World;
use super::batch::{Batch, Keys, Narrow, NarrowCounts, key_in};

/// The test of one worker.
#[derive(Debug, Default)]
pub(super) struct Overlaps {
    /// By how much boxes are inflated.
    distance: f64,
    keys: Keys,
}

impl Overlaps {
    /// Prepares for a step.
    pub fn begin(&mut self, distance: f64) {
        self.distance = distance;
        self.keys.begin();
    }

    pub fn bytes(&self) -> usize {
        self.keys.bytes()
    }
}

impl Narrow for Overlaps {
    fn take(&mut self, _: Isa, world: World<'_>, batch: Batch<'_>) {
        let (distance, between) = (self.distance, batch.between);
        let is_in_tables = batch.is_in_tables();
        let has_cell = world.frame.has_cell();
        if is_in_tables && distance == 0.0 && !has_cell {
            // The boxes of groups in tables are not rounded.
            for ix in 0..batch.met.len() {
                let key = key_in(batch.groups, batch.met.lanes(ix));
                self.keys.push(between.kind, key);
            }
            return self.keys.hand_over(world, between.kind);
        }
        let sides = [between.a, between.b].map(|layer| LayerSide {
            elements: &world.cache(layer).clustering.corners,
            hull: world.hull(layer),
        });
        for ix in 0..batch.met.len() {
            let lanes = batch.met.lanes(ix);
            let [a, b] = if is_in_tables {
                [0, 1].map(|side| batch.groups[side].extent(lanes[side].into()))
            } else {
                let [a, b] = batch.places(ix);
                [sides[0].extent(a), sides[1].extent(b)]
            };
            let key = key_in(batch.groups, lanes);
            if are_near(&a, &b, distance) && world.frame.is_owned(world.scene, key) {
                self.keys.push(between.kind, key);
            }
        }
        self.keys.hand_over(world, between.kind);
    }

    fn end(&mut self, answer: StepAnswer<'_>) {
        self.keys.end(answer);
    }

    fn counts(&self) -> NarrowCounts {
        NarrowCounts::default()
    }
}

/// The elements of a layer, and what makes their boxes.
struct LayerSide<'a> {
    elements: &'a Elements,
    hull: Hull<'a>,
}

impl LayerSide<'_> {
    /// The box of an element over the whole step.
    #[inline(always)]
    fn extent(&self, place: Place) -> Extent {
        self.hull.extent(self.elements.corners(place.index()))
    }
}
