//! How far a step can be taken, and where the vertices are afterwards.

use crate::answers::impacts::Impact;
use crate::answers::reached::{Reached, StepStart};
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
    /// The first contact of the whole step, its time rounded down to `f64`, whatever
    /// [`Query::precision`](crate::Query::precision) says: it may be later than that of
    /// [`earliest`](crate::Detector::earliest). `None` if nothing touches. With a clearance: the
    /// first time at which a pair is as near as it may come, rounding included, as an `f32`. This
    /// pair limits the step, also where nothing touches: [`impacts`](crate::Detector::impacts),
    /// without rounding, may be empty then.
    pub first: Option<Impact>,
    /// Whether elements intersect at the start; the fraction is then 0, whether or not there is a
    /// first contact. `None` if nobody asked: only [`Start::Verify`](crate::Start::Verify) does.
    pub start_intersects: Option<bool>,
    /// How many fractions were tried.
    pub n_tried: u32,
    pub(crate) reached: Reached,
}

impl std::fmt::Debug for Advance {
    /// Without the positions: these may be millions.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Advance");
        short.field("fraction", &self.fraction);
        short.field("first", &self.first);
        short.field("start_intersects", &self.start_intersects);
        short.field("n_tried", &self.n_tried);
        short.field("n_bodies", &self.reached.positions.len());
        short.finish_non_exhaustive()
    }
}

impl Advance {
    /// The vertex positions of a body at that fraction, rounded to the precision in which they are
    /// stored; `None` for one that does not move or was not in the scene. The straight path from
    /// the start to these rounded positions is free, if the start was free of intersections, and
    /// except for pairs that touch at the start.
    pub fn positions(&self, body: BodyId) -> Option<&Positions> {
        self.reached.of(body)
    }

    /// The bodies that move, each with its positions.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (BodyId, &Positions)> {
        self.reached.iter()
    }

    #[doc(hidden)]
    pub fn start(&self) -> &StepStart {
        &self.reached.start
    }

    /// Takes the step: sets these positions in the scene, or in a clone of it. Of bodies whose end
    /// a [transform](Scene::set_end_transform) set, the rest positions stay the same.
    /// Thickness, filters and end positions that have changed since the step was found are not
    /// noticed.
    ///
    /// # Errors
    /// A body that has other positions than when the step was found, also one that does not move:
    /// nothing would be known of the step; a body that is new, or that moves and was removed. The
    /// scene is unchanged then.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), Error> {
        self.reached.apply(scene)
    }
}
