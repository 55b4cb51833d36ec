//! Stage `narrow` of proximity: which candidates are within a distance, at the start of a step.
//!
//! In: candidates, whose boxes overlap when they reach half as far each, and that the batch filter (`exact::filter::nearness`) has
//! left open. Out: whether they are near. `f64` with bounds settles most (`exact::distance`), exact arithmetic the others.

use crate::elements::Elements;
use crate::exact::{Reach, are_within_certainly, unsure_are_within};
use crate::index::{LayerIx, Place};
use crate::narrow::Corners;
use crate::positions::Positions;

use super::world::World;

/// Two layers, and within which distance their elements are near.
pub(super) struct Near<'a> {
    sides: [(&'a Elements, &'a Positions); 2],
    reach: Reach,
    /// Two `f32` that enclose the distance.
    pub enclosing: [f32; 2],
}

impl<'a> Near<'a> {
    pub fn new(world: World<'a>, layers: [LayerIx; 2]) -> Self {
        let sides = layers.map(|layer| {
            let body = world.frame.body(world.scene, layer);
            (&world.cache(layer).clustering.corners, body.positions())
        });
        let reach = world.frame.reach(layers[0], layers[1]);
        Near {
            sides,
            enclosing: reach.enclosing_f32(),
            reach,
        }
    }

    /// Whether the elements at two places are near, if that is certain.
    #[inline(always)]
    pub fn certainly(&self, places: [Place; 2]) -> Option<bool> {
        let [a, b] = self.corners(places);
        are_within_certainly(a.points(), b.points(), &self.reach)
    }

    /// Whether the elements at two places are near, if that is not certain.
    #[inline(never)]
    pub fn exactly(&self, places: [Place; 2]) -> bool {
        let [a, b] = self.corners(places);
        unsure_are_within(a.points(), b.points(), &self.reach)
    }

    #[inline(always)]
    fn corners(&self, places: [Place; 2]) -> [Corners; 2] {
        [0, 1].map(|side| {
            let (elements, positions) = self.sides[side];
            Corners::new(positions, elements.corners(places[side].index()))
        })
    }
}
