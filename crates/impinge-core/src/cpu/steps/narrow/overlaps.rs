//! Whether the boxes of elements over the whole step, inflated, overlap.
//!
//! Stage `pairing` has tested boxes of points rounded to `f32`. Pairs whose boxes overlap by less
//! than rounding are tested again in `f64`.

use crate::boxes::{BoxSource, Extent};
use crate::bvh::bounds::round_up;
use crate::scene::elements::Elements;
use crate::scene::index::Slot;
use crate::search::found::StepAnswer;
use crate::search::narrow::are_near;
use crate::simd::{Isa, LaneBounds, Simd, with_isa};
use impinge_exact::internal::filter::BATCH;
use impinge_exact::internal::filter::number::Lookup;

use super::super::group::StepGroup;
use super::super::world::StepWorld;
use super::batch::{Batch, FoundKeys, Narrow, NarrowCounts, key_in, located};

/// The test of one worker.
#[derive(Debug, Default)]
pub(super) struct Overlaps {
    keys: FoundKeys,
}

impl Overlaps {
    /// Prepares for a step.
    pub fn begin(&mut self) {
        self.keys.begin();
    }

    pub fn bytes(&self) -> usize {
        self.keys.bytes()
    }
}

impl Narrow for Overlaps {
    fn take(&mut self, isa: Isa, world: StepWorld<'_>, batch: Batch<'_>) {
        if batch.rounded() > 0.0 || world.plan.keeps_distance() || world.plan.has_cell() {
            return with_isa!(isa, take, (
                overlaps: &mut Overlaps = self,
                world: StepWorld<'_> = world,
                batch: Batch<'_> = batch,
            ));
        }
        // The boxes of the groups are those of the elements.
        for ix in 0..batch.lane_pairs.len() {
            let key = key_in(batch.groups, batch.lane_pairs.lanes(ix));
            self.keys.push(batch.between.kind, key);
        }
        self.keys.hand_over(world, batch.between.kind);
    }

    fn end(&mut self, answer: StepAnswer<'_>) {
        self.keys.end(answer);
    }

    fn counts(&self) -> NarrowCounts {
        NarrowCounts::default()
    }
}

#[inline(always)]
fn take<S: Simd>(_: S, overlaps: &mut Overlaps, world: StepWorld<'_>, batch: Batch<'_>) {
    let between = batch.between;
    let (most, _) = world.plan.most_kept(between.a, between.b);
    let boxes = batch.groups.map(|group| &group.start);
    let farther_out = farther_out(batch.groups, most, world.plan.farther_than_kept());
    let sides = [between.a, between.b].map(|part| PartSide {
        elements: &world.cache(part).clustering.corners,
        source: world.source(part),
    });
    for first in (0..batch.lane_pairs.len()).step_by(BATCH) {
        let sure = overlap_by::<S::F32>(boxes, batch.lane_pairs.batch(first), farther_out);
        let n = (batch.lane_pairs.len() - first).min(BATCH);
        for lane in 0..n {
            let ix = first + lane;
            if sure >> lane & 1 == 0 {
                let slots @ [a, b] = batch.slots(ix);
                let gap = world.plan.separation(located(world, between, slots));
                if !are_near(&sides[0].extent(a), &sides[1].extent(b), gap) {
                    continue;
                }
            }
            let key = key_in(batch.groups, batch.lane_pairs.lanes(ix));
            if world.plan.is_owned(world.scene, key) {
                overlaps.keys.push(between.kind, key);
            }
        }
    }
    overlaps.keys.hand_over(world, between.kind);
}

/// By how much two boxes of groups together reach at most beyond the inflated boxes of elements, on
/// one axis.
///
/// An end is off by the rounding of points, at most 2^-24 of the largest coordinate, and moved
/// outward by a part of the gap that is allowed, 2^-20 of all, and 2^-126 (`boxes::Sweep`), twice
/// where elements differ in thickness: by less than 2^-18 of the largest coordinate and of that
/// gap, and 2^-124. Besides, boxes reach `farther` than any pair keeps.
fn farther_out([a, b]: [&StepGroup; 2], most: f64, farther: f64) -> f32 {
    let largest = f64::max(a.largest, b.largest) + most + farther;
    if largest * (1.0 + 2f64.powi(-17)) > f64::from(f32::MAX) {
        // Boxes may have infinite ends.
        return f32::INFINITY;
    }
    round_up(farther + largest * 2f64.powi(-17) + 2f64.powi(-120))
}

/// Which of sixteen pairs of boxes of two groups overlap by so much that the inflated boxes of the
/// elements certainly do.
#[inline(always)]
fn overlap_by<V: Lookup>(
    [a, b]: [&LaneBounds; 2],
    slots: [&[u8; BATCH]; 2],
    farther_out: f32,
) -> u16 {
    let bound = V::splat(farther_out.into());
    let mut yes = 0;
    for first in (0..BATCH).step_by(V::N) {
        let (of_a, of_b) = (V::slots(slots[0], first), V::slots(slots[1], first));
        let mut all = !bound.gt(bound);
        for axis in 0..3 {
            let before = V::look_up(&a.max[axis], of_a) - V::look_up(&b.min[axis], of_b);
            let after = V::look_up(&b.max[axis], of_b) - V::look_up(&a.min[axis], of_a);
            all = all & before.gt(bound) & after.gt(bound);
        }
        yes |= V::bits(all) << first;
    }
    yes
}

/// The elements of a part, and what makes their boxes.
struct PartSide<'a> {
    elements: &'a Elements,
    source: BoxSource<'a>,
}

impl PartSide<'_> {
    /// The box of an element over the whole step.
    #[inline(always)]
    fn extent(&self, slot: Slot) -> Extent {
        self.source.extent(self.elements.corners(slot.index()))
    }
}
