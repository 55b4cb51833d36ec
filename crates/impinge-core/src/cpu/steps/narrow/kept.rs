//! Whether elements come nearer than they may during a step, by a separation or a clearance, and
//! when first.
//!
//! ```text
//! tables    sixteen pairs at a time in f32: certainly near at the start, or apart until the end
//! approach  one pair at a time in f64: what the pair keeps, and when it is that near, nearly always to all bits of an f32
//! ```
//!
//! Reason for each discard: no pair keeps more than the bound of the frame (`Plan::bound`).

use crate::bvh::bounds::round_up;
use crate::simd::{Lanes, Simd};
use impinge_exact::Contact;
use impinge_exact::internal::filter::{self, BATCH};
use impinge_exact::internal::{Approach, Reach, approach};

use super::super::world::StepWorld;
use super::batch::{Batch, Between, Slots, counts, exact_pair, points};
use super::contacts::FirstContacts;

/// Decides the candidates of a work item.
#[inline(always)]
pub(super) fn take<S: Simd>(
    _: S,
    contacts: &mut FirstContacts,
    world: StepWorld<'_>,
    batch: Batch<'_>,
) {
    let between = batch.between;
    let in_tables = batch.near_in_tables(&Reach::from(world.plan.bound()));
    let tables = batch.groups.map(|group| &group.points);
    let until = round_up(contacts.until(world));
    // With a clearance, what a pair keeps is less than the bound.
    let is_at_bound = !world.plan.has_clearance();
    for first in (0..batch.lane_pairs.len()).step_by(BATCH) {
        if world.known.is_cancelled() {
            return;
        }
        let lanes = batch.lane_pairs.batch(first);
        let n = (batch.lane_pairs.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if let Some((pair, reach)) = in_tables {
            if is_at_bound {
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
        let parts = [between.a, between.b];
        let kept = (world.plan).kept(world.scene, parts, pair, [&start, &end]);
        match approach(pair, &start, &end, kept, self.until(world)) {
            Approach::Apart => {}
            Approach::AtStart => {
                self.report(world, between, slots, world.plan.at_start(pair, &start));
            }
            Approach::Between(span) => self.report_within(world, (between, pair), slots, span),
            Approach::Unsure => self.leave(world, between, pair, slots),
        }
    }
}
