//! The places where bodies meet: pairs that hang together, with a position and a size.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

use crate::answers::pairs::Pairs;
use crate::boxes::Extent;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::{Body, Scene};
use crate::search::sets::Sets;

/// Pairs of two bodies, or of one body with itself, that are connected by shared elements or
/// vertices.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Place {
    /// The bodies, the lower id first; the same twice for self-collision.
    pub bodies: [BodyId; 2],
    /// How many pairs it has.
    pub n_pairs: usize,
    /// The first pair: one element of each body.
    pub first: [u32; 2],
    /// The box around the overlaps of the two elements' boxes, over all pairs: its low ends.
    pub low: [f64; 3],
    /// Its high ends.
    pub high: [f64; 3],
}

impl Place {
    /// The middle of the box.
    pub fn center(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.low[axis] / 2.0 + self.high[axis] / 2.0)
    }

    /// The longest side of the box.
    pub fn size(&self) -> f64 {
        (0..3)
            .map(|axis| self.high[axis] - self.low[axis])
            .fold(0.0, f64::max)
    }
}

impl Pairs {
    /// The places where the bodies of an answer meet: those with the most pairs first, equally
    /// large ones in the order of their first pair. The program and the window number places like
    /// this.
    ///
    /// Cost: a few hash look-ups per pair.
    ///
    /// # Errors
    /// A body is no longer in the scene.
    pub fn places(&self, scene: &Scene) -> Result<Vec<Place>, Error> {
        // One node per vertex of a colliding element, separately for each pair of bodies: (body,
        // other body, vertex).
        let mut sets = Sets::default();
        let mut nodes: HashMap<(usize, usize, u32), u32> = HashMap::new();
        let mut of_pairs = Vec::with_capacity(self.len());
        for (a, b) in self.iter() {
            let mut last = None;
            for (own, other) in [(a, b), (b, a)] {
                let body = scene.body(own.body)?;
                for &vertex in body.elements().corners(own.element as usize) {
                    let key = (own.body.index(), other.body.index(), vertex);
                    let node = match nodes.entry(key) {
                        Entry::Occupied(known) => *known.get(),
                        Entry::Vacant(new) => *new.insert(sets.add("places")?),
                    };
                    if let Some(last) = last {
                        sets.join(last, node);
                    }
                    last = Some(node);
                }
            }
            of_pairs.push(last.unwrap_or_default());
        }
        let mut places: Vec<Place> = Vec::new();
        let mut of_roots: HashMap<u32, usize> = HashMap::new();
        for ((a, b), node) in self.iter().zip(of_pairs) {
            let place = *of_roots.entry(sets.find(node)).or_insert_with(|| {
                places.push(Place {
                    bodies: [a.body, b.body],
                    n_pairs: 0,
                    first: [a.element, b.element],
                    low: [f64::INFINITY; 3],
                    high: [f64::NEG_INFINITY; 3],
                });
                places.len() - 1
            });
            let place = &mut places[place];
            place.n_pairs += 1;
            let a = extent(scene.body(a.body)?, a.element);
            let b = extent(scene.body(b.body)?, b.element);
            for axis in 0..3 {
                place.low[axis] = place.low[axis].min(a.min[axis].max(b.min[axis]));
                place.high[axis] = place.high[axis].max(a.max[axis].min(b.max[axis]));
            }
        }
        // The sort is stable.
        places.sort_by_key(|place| Reverse(place.n_pairs));
        Ok(places)
    }
}

/// The box of an element.
fn extent(body: &Body, element: u32) -> Extent {
    let corners = body.elements().corners(element as usize).iter();
    Extent::of(corners.map(|&vertex| body.positions().point(vertex as usize)))
}
