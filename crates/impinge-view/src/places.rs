//! Where bodies collide.

use crate::find::Answer;
use crate::stage::Stage;

/// A group of pairs that are connected by shared primitives or vertices.
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
    let bodies = &stage.content.bodies;
    let number = |id| bodies.iter().position(|shown| shown.id == id).unwrap_or(0);
    let found = found.map_err(|error| error.to_string())?.into_iter();
    let places = found.map(|place| {
        let mut bounds = [place.low, place.high];
        for (id, primitive) in place.bodies.into_iter().zip(place.first) {
            let Ok(body) = stage.scene().body(id) else {
                continue;
            };
            for &vertex in body.elements().corners(primitive as usize) {
                let point = body.positions().point(vertex as usize);
                for (k, x) in point.into_iter().enumerate() {
                    bounds[0][k] = bounds[0][k].min(x);
                    bounds[1][k] = bounds[1][k].max(x);
                }
            }
        }
        Place {
            bodies: place.bodies.map(number),
            n_pairs: place.n_pairs,
            bounds,
        }
    });
    Ok(places.collect())
}
