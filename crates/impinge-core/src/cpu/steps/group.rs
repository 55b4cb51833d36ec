//! A worker's own copy of a cluster: the boxes of its elements at both ends, and their corners.

use crate::cpu::bounds::of_cluster_primitives;
use crate::cpu::group_cache::Kept;
use crate::cpu::simd::{LaneBounds, Lanes32, Simd};
use crate::elements::with_corners;
use crate::grouping::GROUP;

use super::World;

/// One cluster's elements, one per lane.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct Group {
    /// The elements' boxes at the start and at the end.
    pub start: LaneBounds,
    pub end: LaneBounds,
    /// The vertices of each corner; lists past an element's number of corners mean nothing.
    pub corners: [Lanes32; 3],
    pub n_corners: usize,
    pub size: usize,
}

impl<'a> Kept<World<'a>> for Group {
    const EMPTY: Self = Group {
        start: LaneBounds::EMPTY,
        end: LaneBounds::EMPTY,
        corners: [const { Lanes32([0; GROUP]) }; 3],
        n_corners: 0,
        size: 0,
    };

    #[inline(always)]
    fn fill<S: Simd>(&mut self, _: S, world: World<'a>, layer: u32, cluster: usize) {
        let clustering = &world.cache(layer).clustering;
        let body = world.frame.body(world.scene, layer as usize);
        let start = body.positions();
        of_cluster_primitives(start, clustering, cluster, &mut self.start);
        match body.end_positions() {
            Some(end) => of_cluster_primitives(end, clustering, cluster, &mut self.end),
            None => self.end.clone_from(&self.start),
        }
        self.size = clustering.size(cluster);
        world
            .asked
            .pose
            .close_all([&mut self.start, &mut self.end], self.size);
        let first = cluster * GROUP;
        with_corners!(&clustering.corners, |elements| {
            let elements = &elements[first..first + self.size];
            self.n_corners = elements.first().map_or(0, |corners| corners.len());
            for (lane, corners) in elements.iter().enumerate() {
                // Of tetrahedra, which no step has, the fourth corner has no list.
                for (lanes, &corner) in self.corners.iter_mut().zip(corners) {
                    lanes.0[lane] = corner;
                }
            }
        });
    }
}

impl Group {
    /// The corners of the element in a lane.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> impl Iterator<Item = u32> + '_ {
        let corners = &self.corners[..self.n_corners.min(3)];
        corners.iter().map(move |corner| corner.0[lane])
    }
}
