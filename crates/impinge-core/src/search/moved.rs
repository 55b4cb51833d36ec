//! Vertices that have moved since a question was answered: only pairs with one of them may have
//! another answer.

use crate::bvh::clusters::Clustering;
use crate::scene::index::{ClusterIx, PartIx};

/// Which vertices of all bodies have moved.
#[derive(Clone, Copy)]
pub(crate) struct Moved<'a> {
    /// The first vertex of the body of each part.
    pub firsts: &'a [usize],
    pub are: &'a [bool],
}

impl Moved<'_> {
    /// For each cluster of a part, the lanes of elements with a vertex that has moved.
    pub fn lanes(&self, part: PartIx, clustering: &Clustering) -> Vec<u64> {
        let are = &self.are[self.firsts[part.index()]..];
        let is_moved = |&vertex: &u32| are[vertex as usize];
        let lanes_of = |cluster: ClusterIx| {
            let (starts, ix) = (&clustering.vertex_starts, cluster.index());
            let own = starts[ix] as usize..starts[ix + 1] as usize;
            if !clustering.vertices[own].iter().any(is_moved) {
                return 0;
            }
            let slots = clustering.slots(cluster);
            let moved = slots.map(|slot| clustering.corners.corners(slot).iter().any(is_moved));
            let bits = moved.enumerate();
            bits.fold(0, |lanes, (lane, is_moved)| {
                lanes | u64::from(is_moved) << lane
            })
        };
        clustering.clusters().map(lanes_of).collect()
    }
}
