//! The places where bodies meet, with the numbers of the bodies.

use std::collections::HashMap;

use impinge::{BodyId, Pairs, Place, Scene};

use crate::error::Error;

/// The most pairs for which regions are computed: beyond, they take seconds and are hardly useful.
const MOST_PAIRS: usize = 2_000_000;

/// A place where two bodies meet, or one body itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The numbers of the bodies, the lower one first; the same number twice for self-collision.
    pub bodies: [usize; 2],
    place: Place,
}

impl std::ops::Deref for Region {
    type Target = Place;

    fn deref(&self) -> &Place {
        &self.place
    }
}

/// The regions of an answer, those with the most pairs first; `None` if there are too many pairs.
pub fn regions(
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
) -> Result<Option<Vec<Region>>, Error> {
    if pairs.len() > MOST_PAIRS {
        return Ok(None);
    }
    let numbers: HashMap<BodyId, usize> = bodies
        .iter()
        .enumerate()
        .map(|(ix, &(id, _))| (id, ix))
        .collect();
    let places = pairs.places(scene)?.into_iter();
    let regions = places.map(|place| Region {
        bodies: place.bodies.map(|id| numbers[&id]),
        place,
    });
    Ok(Some(regions.collect()))
}

#[cfg(test)]
mod tests {
    use impinge::{Backend, Detector, Query};

    use super::*;

    /// A horizontal sheet of two triangles without shared vertices. Two upright triangles pierce it
    /// far apart; so does a third triangle of another body.
    #[test]
    fn pairs_that_hang_together_are_one_region() {
        let sheet = [[0u32, 1, 2], [3, 4, 5]];
        let corners = [
            [0f32, 0.0, 0.0],
            [9.0, 0.0, 0.0],
            [0.0, 9.0, 0.0],
            [0.0, 9.0, 0.0],
            [9.0, 0.0, 0.0],
            [9.0, 9.0, 0.0],
        ];
        let upright = |x: f32, y: f32| [[x, y, -1.0], [x + 0.25, y, 1.0], [x, y + 0.25, 1.0]];
        let mut scene = Scene::new();
        let a = scene.add_triangles(&sheet, &corners).unwrap();
        let spikes = [upright(1.0, 1.0), upright(8.0, 8.0)].concat();
        let b = scene
            .add_triangles(&[[0, 1, 2], [3, 4, 5]], &spikes)
            .unwrap();
        let c = scene
            .add_triangles(&[[0, 1, 2]], &upright(4.5, 4.375))
            .unwrap();
        let mut detector = Detector::new(Backend::Cpu).unwrap();
        let pairs = detector.detect(&scene, &Query::between_all()).unwrap();
        let bodies = [(a, "a"), (b, "b"), (c, "c")];
        let regions = regions(&scene, &bodies, &pairs).unwrap().unwrap();
        let found: Vec<_> = regions
            .iter()
            .map(|r| (r.bodies, r.n_pairs, r.first))
            .collect();
        // The last one touches both triangles of the sheet.
        assert_eq!(
            found,
            [
                ([0, 2], 2, [0, 0]),
                ([0, 1], 1, [0, 0]),
                ([0, 1], 1, [1, 1])
            ]
        );
        let center = regions[1].center();
        assert!(
            (center[0] - 1.125).abs() < 0.01 && center[2] == 0.0,
            "{center:?}"
        );
        assert_eq!(regions[1].size(), 0.25);
    }
}
