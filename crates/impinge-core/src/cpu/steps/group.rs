//! A worker's own copy of a cluster: its elements at both ends, their boxes, and their corners.
//!
//! Cost: each corner of a cluster once, when it is first needed; 8.8 KB per cluster.

use crate::boxes::Extent;
use crate::bvh::GROUP;
use crate::bvh::bounds::Aabb;
use crate::cpu::group_cache::PerCluster;
use crate::scene::elements::with_corners;
use crate::scene::index::{ClusterIx, PartIx};
use crate::scene::positions::Positions;
use crate::simd::{LaneBounds, Lanes32, Simd, with_isa};
use impinge_exact::internal::filter::Moving64;

use super::world::StepWorld;

/// One cluster's elements, one per lane.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct StepGroup {
    /// The elements' boxes at the start and at the end; where boxes hold the whole path, only the
    /// first.
    pub start: LaneBounds,
    pub end: LaneBounds,
    /// The cluster's own boxes.
    pub ends: [Aabb; 2],
    /// The vertices of each corner; lists past an element's number of corners mean nothing.
    pub corners: [Lanes32; 3],
    pub n_corners: usize,
    /// The elements' global numbers.
    pub numbers: Lanes32,
    pub size: usize,
    /// The elements' points at the start and at the end, rounded to `f32`.
    pub points: Moving64,
    /// The largest coordinate, or more.
    pub largest: f64,
    /// By how much coordinates of `points` are rounded at most: 0 if positions are `f32`. Infinite
    /// if `points` mean nothing, for coordinates that are too large.
    pub rounded: f64,
}

/// The largest coordinate that is rounded to `f32`.
const LARGEST: f64 = (1u64 << 32) as f64;

impl<'a> PerCluster<StepWorld<'a>> for StepGroup {
    const EMPTY: Self = StepGroup {
        start: LaneBounds::EMPTY,
        end: LaneBounds::EMPTY,
        ends: [Aabb::EMPTY; 2],
        corners: [const { Lanes32([0; GROUP]) }; 3],
        n_corners: 0,
        numbers: Lanes32([0; GROUP]),
        size: 0,
        points: [[[[0.0; GROUP]; 3]; 3]; 2],
        largest: 0.0,
        rounded: f64::INFINITY,
    };

    #[inline(always)]
    fn fill<S: Simd>(&mut self, _: S, world: StepWorld<'a>, part: PartIx, cluster: ClusterIx) {
        self.fill_by(world, (part, cluster));
    }
}

impl StepGroup {
    /// It is long and seldom called, from many places: compiled once per instruction set.
    #[cold]
    #[inline(never)]
    fn fill_by(&mut self, world: StepWorld<'_>, whose: (PartIx, ClusterIx)) {
        with_isa!(world.isa, StepGroup::fill_with, (
            group: &mut StepGroup = self,
            world: StepWorld<'_> = world,
            whose: (PartIx, ClusterIx) = whose,
        ));
    }

    #[inline(always)]
    fn fill_with<S: Simd>(
        simd: S,
        group: &mut StepGroup,
        world: StepWorld<'_>,
        (part, cluster): (PartIx, ClusterIx),
    ) {
        let clustering = &world.cache(part).clustering;
        group.size = clustering.size(cluster);
        group.ends = world.ends(part, cluster);
        let slots = clustering.slots(cluster);
        with_corners!(&clustering.corners, |elements| {
            let elements = &elements[slots];
            // Tetrahedra, which steps never have, would have no list for their fourth corner.
            group.n_corners = elements.first().map_or(0, |corners| corners.len().min(3));
            for (k, lanes) in group.corners.iter_mut().enumerate().take(group.n_corners) {
                // Lanes without an element hold a vertex that exists.
                let of_first = elements[0][k];
                for (lane, corners) in elements.iter().enumerate() {
                    lanes.0[lane] = corners[k];
                }
                lanes.0[group.size..].fill(of_first);
            }
        });
        let first = world.plan.part(part).first;
        let elements = clustering.elements(cluster);
        for (number, &element) in group.numbers.0.iter_mut().zip(elements) {
            *number = first.plus(element).raw();
        }
        let source = world.source(part);
        let ends = source.ends();
        let are_single = ends.iter().all(|end| matches!(end, Positions::F32(_)));
        let boxes = world.cache(part).ends(cluster);
        let largest = boxes.map(|bounds| Extent::from(&bounds).magnitude());
        group.largest = f64::max(largest[0], largest[1]);
        group.rounded = if are_single {
            0.0
        } else if group.largest <= LARGEST {
            // Half a unit in the last place, or of the smallest number.
            group.largest * 2f64.powi(-24) + 2f64.powi(-149)
        } else {
            f64::INFINITY
        };
        if group.rounded.is_finite() {
            // Rounding keeps the order of coordinates: boxes that are apart then are so of the
            // points as they are.
            group.put_points(simd, ends);
        } else {
            source.fill(clustering, cluster, [&mut group.start, &mut group.end]);
        }
        source.close(clustering, cluster, [&mut group.start, &mut group.end]);
    }

    /// Fills the tables of points, and the boxes from those.
    #[inline(always)]
    fn put_points<S: Simd>(&mut self, simd: S, ends: [&Positions; 2]) {
        let boxes = [&mut self.start, &mut self.end];
        for ((positions, points), boxes) in ends.into_iter().zip(&mut self.points).zip(boxes) {
            for (vertices, point) in self
                .corners
                .iter()
                .zip(points.iter_mut())
                .take(self.n_corners)
            {
                match positions {
                    Positions::F32(positions) => {
                        simd.put_points(positions, &vertices.0, self.size, point);
                    }
                    Positions::F64(positions) => {
                        simd.put_points(positions, &vertices.0, self.size, point);
                    }
                }
            }
            let [p, q, r] = &*points;
            match self.n_corners {
                1 => boxes.hold([p], self.size),
                2 => boxes.hold([p, q], self.size),
                _ => boxes.hold([p, q, r], self.size),
            }
        }
    }
}
