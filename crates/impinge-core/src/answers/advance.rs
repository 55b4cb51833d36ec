//! How far a step can be taken, and where the vertices are afterwards.

use crate::answers::impacts::Impact;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;

/// How far a step can be taken.
#[derive(Clone, PartialEq)]
#[non_exhaustive]
pub struct Advance {
    /// The part of the step that can be taken: 1 for all of it, 0 for none. With a
    /// [clearance](crate::Query::clearance) it holds for positions that solvers compute, and for
    /// all smaller parts: see [`Detector::advance`](crate::Detector::advance).
    pub fraction: f64,
    /// The first contact of the whole step, its time rounded down to `f64`. `None` if nothing
    /// touches. With a clearance: the first time at which a pair is as near as it may come,
    /// rounding included, as an `f32`.
    pub first: Option<Impact>,
    /// Whether elements intersect at the start; the fraction is then 0, whether or not there is a
    /// first contact. `None` if nobody asked: only [`Start::Verify`](crate::Start::Verify) does.
    pub start_intersects: Option<bool>,
    /// The vertex positions of all moving bodies at that fraction, rounded to the precision in
    /// which they are stored. The straight path from the start to these rounded positions is free,
    /// if the start was free of intersections, and except for pairs that touch at the start.
    pub positions: Vec<(BodyId, Positions)>,
    /// How many fractions were tried.
    pub n_tried: u32,
    pub(crate) start: StartPositions,
}

/// Which positions each body of a scene had when a step was found.
#[derive(Debug, Clone, Default)]
pub(crate) struct StartPositions(Vec<(BodyId, u64)>);

/// Steps are equal if what they reach is.
impl PartialEq for StartPositions {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl StartPositions {
    pub fn of(scene: &Scene) -> Self {
        let bodies = scene.bodies();
        StartPositions(
            bodies
                .map(|(id, body)| (id, body.positions_stamp()))
                .collect(),
        )
    }

    /// Sets the positions of the bodies that move, if all bodies still are where they were.
    ///
    /// # Errors
    /// A body that was moved since, or is new; one that moves and was removed.
    pub fn take_step(
        &self,
        scene: &mut Scene,
        positions: &[(BodyId, Positions)],
    ) -> Result<(), Error> {
        for (id, body) in scene.bodies() {
            let known = self.0.binary_search_by_key(&id, |(id, _)| *id);
            let stamp = known.map(|ix| self.0[ix].1);
            if stamp != Ok(body.positions_stamp()) {
                return Err(Error::Moved { body: id });
            }
        }
        for (body, _) in positions {
            scene.body(*body)?;
        }
        let mut all = positions.iter();
        all.try_for_each(|(body, positions)| scene.take_step(*body, positions))
    }
}

impl std::fmt::Debug for Advance {
    /// Without the positions: these may be millions.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Advance");
        short.field("fraction", &self.fraction);
        short.field("first", &self.first);
        short.field("start_intersects", &self.start_intersects);
        short.field("n_tried", &self.n_tried);
        short.field("n_bodies", &self.positions.len());
        short.finish_non_exhaustive()
    }
}

impl Advance {
    /// Takes the step: sets these positions in the scene, or in a clone of it. Of bodies that
    /// [transforms](Scene::set_end_transform) move, the rest positions stay the same.
    ///
    /// # Errors
    /// A body that has other positions than when the step was found, also one that does not move:
    /// nothing would be known of the step; a body that is new, or that moves and was removed. The
    /// scene is unchanged then.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), Error> {
        self.start.take_step(scene, &self.positions)
    }
}
