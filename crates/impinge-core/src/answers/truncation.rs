//! How far each vertex may go in a step, and where it is afterwards.

use crate::answers::candidates::Candidates;
use crate::answers::numbering::Numbering;
use crate::answers::reached::{Reached, StepStart};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;
use crate::search::found::PairList;

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
    pub(crate) stopped: Stopped,
    pub(crate) start_intersects: Option<bool>,
}

/// The pairs that stopped vertices.
#[derive(Clone, Default)]
pub(crate) struct Stopped {
    pub numbering: Numbering,
    /// In any order, and some of them more than once.
    pub pairs: PairList,
}

impl PartialEq for Stopped {
    fn eq(&self, other: &Self) -> bool {
        let [own, others] =
            [self, other].map(|of| Candidates::of_pairs(of.numbering.clone(), &of.pairs));
        own.iter().eq(others.iter())
    }
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

    /// How often pairs were looked at again, because vertices had been stopped; at most 256
    /// times.
    pub fn rounds(&self) -> u32 {
        self.n_rounds
    }

    /// The pairs that stopped vertices, those that touch at the start included, sorted by
    /// `(kind, body_a, element_a, body_b, element_b)`. Sorted anew each time.
    pub fn pairs(&self) -> Candidates {
        let Stopped { numbering, pairs } = &self.stopped;
        Candidates::of_pairs(numbering.clone(), pairs)
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
