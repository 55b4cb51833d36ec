//! What the stages look at: a scene, who takes part, and what is cached a body.

use crate::exact::Point;
use crate::frame::{Frame, Participant};
use crate::grouping::clusters::Clustering;
use crate::scene::{Elements, Positions, Scene};

use super::bounds::TreeBounds;
use super::dispatch::Tree;

/// What is kept of a body from frame to frame.
#[derive(Debug)]
pub(crate) struct BodyCache {
    /// The topology that was clustered.
    pub topology_stamp: u64,
    /// The positions that the boxes belong to; 0 for none.
    pub positions_stamp: u64,
    pub clustering: Clustering,
    pub bounds: TreeBounds,
    /// Summed surface of the clusters over that of the body, at its best so far.
    pub best_spread: f64,
}

/// Caches by slot of the body.
pub(crate) type Caches = Vec<Option<Box<BodyCache>>>;

/// Everything that a frame reads.
#[derive(Clone, Copy)]
pub(crate) struct World<'a> {
    pub scene: &'a Scene,
    pub frame: &'a Frame,
    pub caches: &'a Caches,
}

/// One participant, looked up.
#[derive(Clone, Copy)]
pub(crate) struct BodyRef<'a> {
    pub participant: &'a Participant,
    pub positions: &'a Positions,
    pub clustering: &'a Clustering,
    pub bounds: &'a TreeBounds,
}

impl<'a> World<'a> {
    #[inline(always)]
    pub fn body(&self, participant_ix: u32) -> BodyRef<'a> {
        let participant = &self.frame.participants[participant_ix as usize];
        let slot = participant.id.slot();
        let cache = self.caches[slot as usize]
            .as_deref()
            .expect("every participant was clustered");
        BodyRef {
            participant,
            positions: self.scene.body_in(slot).positions(),
            clustering: &cache.clustering,
            bounds: &cache.bounds,
        }
    }
}

impl<'a> BodyRef<'a> {
    #[inline(always)]
    pub fn tree(&self) -> Tree<'a> {
        Tree {
            shape: &self.clustering.shape,
            bounds: self.bounds,
        }
    }

    /// The global number of the primitive at a place of the order.
    #[inline(always)]
    pub fn global(&self, place: u32) -> u32 {
        self.participant.first + self.clustering.order[place as usize]
    }

    /// The vertex ids of the primitive at a place.
    #[inline(always)]
    pub fn corners(&self, place: u32) -> &'a [u32] {
        self.clustering.corners.corners(place as usize)
    }

    /// The corners at a place in double precision; a triangle repeats its last one.
    #[inline(always)]
    pub fn points(&self, place: u32) -> [Point; 4] {
        let corners: [u32; 4] = match &self.clustering.corners {
            Elements::Triangles(faces) => {
                let [a, b, c] = faces[place as usize];
                [a, b, c, c]
            }
            Elements::Tetrahedra(tets) => tets[place as usize],
        };
        corners.map(|corner| self.positions.point(corner as usize))
    }
}
