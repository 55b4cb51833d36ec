//! Whether elements come nearer than they may during a step, by a separation, their thickness or a
//! clearance, and when first.
//!
//! ```text
//! tables    sixteen pairs at a time in f32: certainly near at the start, or apart until the end
//! approach  one pair at a time in f64: what the pair keeps, and when it is that near, nearly
//!           always to all bits of an f32
//! ```
//!
//! Reason for each discard: no pair of two parts keeps more than `Plan::most_kept`.

use crate::bvh::bounds::round_up;
use crate::simd::{Lanes, Simd};
use impinge_exact::internal::filter::{self, BATCH, Search};
use impinge_exact::internal::{Approach, Reach, approach};
use impinge_exact::{Contact, ElementPair};

use super::super::world::StepWorld;
use super::batch::{Batch, Between, Slots, counts, exact_pair, located, points};
use super::contacts::{FirstContacts, Open};

/// Decides the candidates of a work item.
#[inline(always)]
pub(super) fn take<S: Simd>(
    _: S,
    contacts: &mut FirstContacts,
    world: StepWorld<'_>,
    batch: Batch<'_>,
) {
    let between = batch.between;
    // With a clearance, and where elements of a body differ in thickness, a pair may keep less.
    let (most, is_kept_by_all) = world.plan.most_kept(between.a, between.b);
    let in_tables = batch.near_in_tables(&Reach::from(most));
    let tables = batch.groups.map(|group| &group.points);
    let until = round_up(contacts.until(world));
    for first in (0..batch.lane_pairs.len()).step_by(BATCH) {
        if world.known.is_cancelled() {
            return;
        }
        let lanes = batch.lane_pairs.batch(first);
        let n = (batch.lane_pairs.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if let Some((pair, reach)) = in_tables {
            if is_kept_by_all {
                let verdict = filter::are_within_in_tables::<S::F32>(pair, tables, lanes, reach);
                for lane in Lanes(u64::from(verdict.yes & open)) {
                    let slots = batch.slots(first + lane);
                    contacts.report(world, between, slots, Contact::AT_START);
                }
                open &= !verdict.yes;
            }
            if open != 0 {
                open &=
                    !filter::stay_beyond_in_tables::<S::F32>(pair, tables, lanes, until, reach[1]);
            }
        }
        for lane in Lanes(u64::from(open)) {
            contacts.decide_kept(world, between, batch.slots(first + lane));
        }
    }
}

impl FirstContacts {
    /// Decides a pair in `f64`, or leaves it.
    #[inline(never)]
    pub(super) fn decide_kept(&mut self, world: StepWorld<'_>, between: Between, slots: Slots) {
        let Some(pair) = exact_pair(between.kind) else {
            return;
        };
        if world.plan.filters_early() && !counts(world, between, slots) {
            return;
        }
        let [start, end] = points(world, between, pair, slots);
        let elements = located(world, between, slots);
        let kept = (world.plan).kept(world.scene, elements, pair, [&start, &end]);
        if kept == 0.0 {
            return self.look_for_touching(world, (between, pair), slots);
        }
        match approach(pair, &start, &end, kept, self.until(world)) {
            Approach::Apart => {}
            Approach::AtStart => {
                let contact = world.plan.at_start(elements, pair, &start);
                self.report(world, between, slots, contact);
            }
            Approach::Between(span) => self.report_within(world, (between, pair), slots, span),
            Approach::Unsure => self.leave(world, between, pair, slots),
        }
    }

    /// Leaves a pair that keeps nothing to the search for touching elements.
    fn look_for_touching(
        &mut self,
        world: StepWorld<'_>,
        (between, pair): (Between, ElementPair),
        slots: Slots,
    ) {
        if !matches!(pair, ElementPair::VertexFace | ElementPair::EdgeEdge) {
            return self.decide_exactly(world, between, pair, slots);
        }
        self.is_first = true;
        self.open.push(Open {
            slots,
            search: Search::new(self.until(world)),
        });
    }
}
