//! Where a step leads, and from where.

use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;
use crate::scene::{Body, Scene};

/// Where a step leads: the positions of the bodies that move, sorted by body.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reached {
    pub positions: Vec<(BodyId, Positions)>,
    pub start: StepStart,
}

/// Wherever it starts.
impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.positions == other.positions
    }
}

impl Reached {
    /// Nowhere yet.
    pub fn from_start(scene: &Scene) -> Self {
        Reached {
            positions: Vec::new(),
            start: StepStart::of(scene),
        }
    }

    pub fn of(&self, body: BodyId) -> Option<&Positions> {
        let found = self.positions.binary_search_by_key(&body, |(id, _)| *id);
        Some(&self.positions[found.ok()?].1)
    }

    pub fn iter(&self) -> impl ExactSizeIterator<Item = (BodyId, &Positions)> {
        let each = self.positions.iter();
        each.map(|(id, positions)| (*id, positions))
    }

    /// See [`Advance::apply`](crate::Advance::apply).
    pub fn apply(&self, scene: &mut Scene) -> Result<(), Error> {
        self.start.take_step(scene, &self.positions)
    }
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
            let start = self.of_body(id).ok_or(Error::Added { body: id })?;
            if start.stamp != body.positions_stamp() {
                return Err(Error::Moved { body: id });
            }
        }
        for (id, positions) in positions {
            scene.body(*id)?.check(*id, &positions.into())?;
        }
        positions.iter().try_for_each(|(id, positions)| {
            let keeps_rest = self.of_body(*id).is_some_and(|start| start.keeps_rest);
            scene.take_checked_step(*id, positions, keeps_rest)
        })
    }
}
