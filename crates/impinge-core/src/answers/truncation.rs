//! How far each vertex may go in a step, and where it is afterwards.

use crate::answers::reached::{Reached, StepStart};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;

/// Where the vertices are after each has gone as far as it may: see
/// [`Detector::truncate`](crate::Detector::truncate).
///
/// The same input gives the same bytes on every method, backend, thread count and budget.
#[derive(Clone, Default, PartialEq)]
pub struct Truncation {
    pub(crate) reached: Reached,
    pub(crate) n_cut: u64,
    pub(crate) n_touching: u64,
    pub(crate) n_rounds: u32,
    pub(crate) start_intersects: Option<bool>,
}

impl Truncation {
    /// The positions of a body, in the precision of its positions; `None` for one that does not
    /// move or was not in the scene.
    pub fn positions(&self, body: BodyId) -> Option<&Positions> {
        self.reached.of(body)
    }

    /// The bodies that move, each with its positions.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (BodyId, &Positions)> {
        self.reached.iter()
    }

    /// How many vertices were stopped before the end of their way.
    pub fn n_cut(&self) -> u64 {
        self.n_cut
    }

    /// How many pairs already touch at the start, or are at most as far apart as they are to keep:
    /// their vertices were not moved. Pairs of which no vertex moves are not counted.
    pub fn n_touching(&self) -> u64 {
        self.n_touching
    }

    /// How often pairs were looked at again, because vertices had been stopped.
    pub fn rounds(&self) -> u32 {
        self.n_rounds
    }

    /// Whether elements intersect at the start; no vertex was moved then. `None` if nobody asked:
    /// only [`Start::Verify`](crate::Start::Verify) does.
    pub fn start_intersects(&self) -> Option<bool> {
        self.start_intersects
    }

    #[doc(hidden)]
    pub fn start(&self) -> &StepStart {
        &self.reached.start
    }

    /// Takes the step: sets these positions in the scene, or in a clone of it. Of bodies whose end
    /// a [transform](Scene::set_end_transform) set, the rest positions stay the same.
    ///
    /// # Errors
    /// A body that has other positions than when the step was found, also one that does not move:
    /// nothing would be known of the step; a body that is new, or that moves and was removed. The
    /// scene is unchanged then.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), Error> {
        self.reached.apply(scene)
    }
}

impl std::fmt::Debug for Truncation {
    /// Without the positions: these may be millions.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Truncation");
        short.field("n_cut", &self.n_cut);
        short.field("n_touching", &self.n_touching);
        short.field("n_rounds", &self.n_rounds);
        short.field("start_intersects", &self.start_intersects);
        short.field("n_bodies", &self.reached.positions.len());
        short.finish_non_exhaustive()
    }
}
