//! Where bodies collide.

use std::collections::HashMap;

use impinge::BodyId;

use crate::find::Answer;
use crate::stage::{Stage, include};

/// A group of pairs that are connected by shared elements or vertices.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Place {
    /// Its bodies, by their numbers.
    pub bodies: [usize; 2],
    pub n_pairs: usize,
    /// A box with the overlaps, and with the first pair.
    pub bounds: [[f64; 3]; 2],
}

/// The places of an answer, in the order in which the program numbers them.
pub(crate) fn places(stage: &Stage, answer: &Answer) -> Result<Vec<Place>, String> {
    let found = answer.pairs.places(stage.scene());
    let ids = stage.content.bodies.iter().map(|shown| shown.id);
    let numbers: HashMap<BodyId, usize> = ids.zip(0..).collect();
    let number = |id| numbers.get(&id).copied().unwrap_or(0);
    let found = found.map_err(|error| error.to_string())?.into_iter();
    let places = found.map(|place| {
        let mut bounds = [place.low, place.high];
        let bodies = place.bodies.map(number);
        for (body, element) in bodies.into_iter().zip(place.first) {
            let corners = stage.element_bounds(body, element);
            for point in corners.into_iter().flatten() {
                include(&mut bounds, point);
            }
        }
        Place {
            bodies,
            n_pairs: place.n_pairs,
            bounds,
        }
    });
    Ok(places.collect())
}
