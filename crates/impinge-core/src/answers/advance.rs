//! How far a step can be taken, and where the vertices are afterwards.

use crate::answers::impacts::Impact;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;
use crate::scene::{Body, Scene};

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
    /// How many fractions were tried.
    pub n_tried: u32,
    pub(crate) positions: Vec<(BodyId, Positions)>,
    pub(crate) start: StepStart,
}

/// Where the bodies of a scene were when a step was found.
#[doc(hidden)]
#[derive(Debug, Clone, Default)]
pub struct StepStart(Vec<StartOfBody>);

/// Where a body was when a step was found.
#[doc(hidden)]
#[derive(Debug, Clone, Copy)]
pub struct StartOfBody {
    pub body: BodyId,
    /// The stamp of its positions.
    pub stamp: u64,
    /// Whether a transform made its end, so that the next one begins with its rest positions, too.
    pub keeps_rest: bool,
}

/// Steps are equal if what they reach is.
impl PartialEq for StepStart {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// From bodies in the order of a scene.
impl FromIterator<StartOfBody> for StepStart {
    fn from_iter<I: IntoIterator<Item = StartOfBody>>(bodies: I) -> Self {
        StepStart(bodies.into_iter().collect())
    }
}

impl StepStart {
    pub(crate) fn of(scene: &Scene) -> Self {
        let start = |(body, held): (_, &Body)| StartOfBody {
            body,
            stamp: held.positions_stamp(),
            keeps_rest: held.has_end_by_transform(),
        };
        scene.bodies().map(start).collect()
    }

    /// Each body.
    pub fn bodies(&self) -> &[StartOfBody] {
        &self.0
    }

    fn of_body(&self, body: BodyId) -> Option<&StartOfBody> {
        let found = self.0.binary_search_by_key(&body, |start| start.body);
        Some(&self.0[found.ok()?])
    }

    /// Sets the positions of the bodies that move, if all bodies still are where they were.
    ///
    /// # Errors
    /// A body that was moved since, or is new; one that moves and was removed. The scene is
    /// unchanged then.
    pub fn take_step(
        &self,
        scene: &mut Scene,
        positions: &[(BodyId, Positions)],
    ) -> Result<(), Error> {
        for (id, body) in scene.bodies() {
            let start = self.of_body(id);
            if start.is_none_or(|start| start.stamp != body.positions_stamp()) {
                return Err(Error::Moved { body: id });
            }
        }
        for (id, positions) in positions {
            scene.body(*id)?.check(*id, &positions.into())?;
        }
        positions.iter().try_for_each(|(id, positions)| {
            let keeps_rest = self.of_body(*id).is_some_and(|start| start.keeps_rest);
            scene.take_step(*id, positions, keeps_rest)
        })
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
    /// The vertex positions of a body at that fraction, rounded to the precision in which they are
    /// stored; `None` for one that does not move or was not in the scene. The straight path from
    /// the start to these rounded positions is free, if the start was free of intersections, and
    /// except for pairs that touch at the start.
    pub fn positions(&self, body: BodyId) -> Option<&Positions> {
        positions_of(&self.positions, body)
    }

    /// The bodies that move, each with its positions.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (BodyId, &Positions)> {
        self.positions
            .iter()
            .map(|(id, positions)| (*id, positions))
    }

    #[doc(hidden)]
    pub fn start(&self) -> &StepStart {
        &self.start
    }

    /// Takes the step: sets these positions in the scene, or in a clone of it. Of bodies whose end
    /// a [transform](Scene::set_end_transform) set, the rest positions stay the same.
    ///
    /// # Errors
    /// A body that has other positions than when the step was found, also one that does not move:
    /// nothing would be known of the step; a body that is new, or that moves and was removed. The
    /// scene is unchanged then.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), Error> {
        self.start.take_step(scene, &self.positions)
    }
}

/// The positions of a body among those of all that move, sorted.
pub(crate) fn positions_of(all: &[(BodyId, Positions)], body: BodyId) -> Option<&Positions> {
    let found = all.binary_search_by_key(&body, |(id, _)| *id);
    Some(&all[found.ok()?].1)
}
