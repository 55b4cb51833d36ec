//! Whether elements come nearer than they may during a step, by a separation or a clearance, and when first.
//!
//! ```text
//! tables    sixteen pairs at a time in f32: certainly near at the start, or apart until the end
//! approach  one pair at a time in f64: what the pair keeps, and when it is that near, nearly always to all bits of an f32
//! ```
//!
//! Reason for each discard: no pair keeps more than the bound of the frame (`Plan::bound`).

use crate::cpu::simd::{Lanes, Simd};
use crate::grouping::bounds::round_up;
use impinge_exact::Contact;
use impinge_exact::internal::filter::{self, BATCH};
use impinge_exact::internal::{Approach, Reach, approach};

use super::super::world::World;
use super::batch::{Batch, Between, Places, counts, exact_pair, points};
use super::contacts::FirstContacts;

/// Settles the candidates of a work item.
#[inline(always)]
pub(super) fn take<S: Simd>(
    _: S,
    contacts: &mut FirstContacts,
    world: World<'_>,
    batch: Batch<'_>,
) {
    let between = batch.between;
    let in_tables = batch.near_in_tables(&Reach::from(world.frame.bound()));
    let tables = batch.groups.map(|group| &group.points);
    let until = round_up(contacts.until(world));
    // With a clearance, what a pair keeps is less than the bound.
    let is_at_bound = !world.frame.has_clearance();
    for first in (0..batch.met.len()).step_by(BATCH) {
        if world.known.is_cancelled() {
            return;
        }
        let lanes = batch.met.batch(first);
        let n = (batch.met.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if let Some((pair, reach)) = in_tables {
            if is_at_bound {
                let verdict = filter::are_within_in_tables::<S::F32>(pair, tables, lanes, reach);
                for lane in Lanes(u64::from(verdict.yes & open)) {
                    let places = batch.places(first + lane);
                    contacts.report(world, between, places, Contact::AT_START);
                }
                open &= !verdict.yes;
            }
            if open != 0 {
                open &=
                    !filter::stay_beyond_in_tables::<S::F32>(pair, tables, lanes, until, reach[1]);
            }
        }
        for lane in Lanes(u64::from(open)) {
            contacts.settle_kept(world, between, batch.places(first + lane));
        }
    }
}

impl FirstContacts {
    /// Settles a pair in `f64`, or leaves it.
    #[inline(never)]
    pub(super) fn settle_kept(&mut self, world: World<'_>, between: Between, places: Places) {
        let Some(pair) = exact_pair(between.kind) else {
            return;
        };
        if world.frame.filters_early() && !counts(world, between, places) {
            return;
        }
        let [start, end] = points(world, between, pair, places);
        let layers = [between.a, between.b];
        let kept = (world.frame).kept(world.scene, layers, pair, [&start, &end]);
        match approach(pair, &start, &end, kept, self.until(world)) {
            Approach::Apart => {}
            Approach::AtStart => {
                self.report(world, between, places, world.frame.at_start(pair, &start));
            }
            Approach::Between(span) => self.report_within(world, (between, pair), places, span),
            Approach::Unsure => self.leave(world, between, pair, places),
        }
    }
}
