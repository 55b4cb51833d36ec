//! Whether elements come within a distance during a step, and when first.
//!
//! ```text
//! tables    sixteen pairs at a time in f32: certainly near at the start, or apart until the end
//! approach  one pair at a time in f64: when it comes near, nearly always to all bits of an f32
//! ```

use crate::cpu::simd::{Lanes, Simd};
use crate::exact::filter::{self, BATCH};
use crate::exact::{Approach, Contact, approach};
use crate::grouping::bounds::round_up;

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
    let reach = world.frame.reach(between.a, between.b);
    let in_tables = batch.near_in_tables(&reach);
    let tables = batch.groups.map(|group| &group.points);
    let until = round_up(contacts.until(world));
    for first in (0..batch.met.len()).step_by(BATCH) {
        let lanes = batch.met.batch(first);
        let n = (batch.met.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if let Some((pair, reach)) = in_tables {
            let verdict = filter::are_within_in_tables::<S::F32>(pair, tables, lanes, reach);
            for lane in Lanes(u64::from(verdict.yes & open)) {
                let places = batch.places(first + lane);
                contacts.report(world, between, places, Contact::AT_START);
            }
            open &= !verdict.yes;
            if open != 0 {
                open &=
                    !filter::stay_beyond_in_tables::<S::F32>(pair, tables, lanes, until, reach[1]);
            }
        }
        for lane in Lanes(u64::from(open)) {
            contacts.settle_separated(world, between, batch.places(first + lane));
        }
    }
}

impl FirstContacts {
    /// Settles a pair in `f64` or exactly.
    #[inline(never)]
    fn settle_separated(&mut self, world: World<'_>, between: Between, places: Places) {
        let Some(pair) = exact_pair(between.kind) else {
            return;
        };
        if world.frame.filters_early() && !counts(world, between, places) {
            return;
        }
        let [start, end] = points(world, between, pair, places);
        let until = self.until(world);
        match approach(pair, &start, &end, world.frame.distance(), until) {
            Approach::Apart => {}
            Approach::AtStart => self.report(world, between, places, Contact::AT_START),
            Approach::Between(span) => self.report_within(world, (between, pair), places, span),
            Approach::Unsure => self.settle_exactly(world, between, pair, places),
        }
    }
}
