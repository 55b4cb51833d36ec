//! The contacts that one worker has found in a step, and the pairs whose contacts are still sought.

use crate::cpu::narrow::waiting_capacity;
use crate::plan::Plan;
use crate::query::goal::Goal;
use crate::query::pair_kind::PairKind;
use crate::query::step::{Precision, Start};
use crate::search::found::{Found, FoundByKind, StepAnswer};
use crate::search::sink::BLOCK;
use crate::simd::Isa;
use crate::workers::tuning::Tuning;
use impinge_exact::internal::filter::{Search, time_between};
use impinge_exact::{Contact, ElementPair};

use super::super::world::StepWorld;
use super::batch::{Between, Narrow, NarrowCounts, Slots, counts, key, located, points};

/// The most pairs of one worker that are decided last.
const MOST_UNSURE: usize = 4096;
/// The most close pairs that one worker remembers: this many, or two per cluster if that is more.
/// With more of them, a search of all pairs is as fast.
const MOST_CLOSE: usize = 4096;

/// A pair whose first contact is sought.
#[derive(Debug, Clone, Copy)]
pub(super) struct Open {
    pub slots: Slots,
    pub search: Search,
}

/// Contacts found, and open pairs.
#[derive(Debug, Default)]
pub(crate) struct FirstContacts {
    pub(super) goal: Goal,
    start: Start,
    /// The precision of times; `None` if only bounds of them are wanted.
    toi: Option<Precision>,
    /// Contacts found, handed over in blocks.
    found: FoundByKind,
    pub(super) counts: NarrowCounts,
    /// Number of open pairs that triggers a search.
    pub(super) full: usize,
    /// Pairs of the current two parts that wait for root isolation; if `is_first`, for the
    /// separation tests before it.
    pub(super) open: Vec<Open>,
    /// Pairs that wait for the next round of root isolation.
    pub(super) later: Vec<Open>,
    /// Pairs with one candidate for a contact.
    pub(super) single: Vec<Open>,
    pub(super) between: Option<Between>,
    /// Pairs for exact arithmetic, which are decided last.
    unsure: Vec<(Between, Slots)>,
    /// Whether the pairs of `unsure` are being decided.
    is_last: bool,
    /// Most pairs in `close`.
    most_close: usize,
    /// Pairs that are not certainly farther apart than [the margin](Self::margin), by kind and key;
    /// one more than allowed if some are missing.
    close: Vec<(PairKind, u64)>,
    /// Whether the filter's first step is still to be taken, in `f64`.
    pub(super) is_first: bool,
}

impl FirstContacts {
    /// Prepares for a step.
    pub fn begin(&mut self, n_clusters: u64, plan: &Plan, tuning: &Tuning) {
        (self.goal, self.start) = (plan.goal, plan.start);
        self.toi = plan.asks_times().then_some(plan.precision);
        self.most_close = MOST_CLOSE.max(2 * n_clusters as usize);
        self.full = tuning.decide_from;
        self.counts = NarrowCounts::default();
        for list in [&mut self.open, &mut self.later, &mut self.single] {
            list.reserve_exact(waiting_capacity(tuning));
        }
        self.is_last = false;
    }

    /// Drops what a question has left that was cancelled or refused.
    pub fn forget(&mut self) {
        self.found.iter_mut().for_each(Vec::clear);
        for list in [&mut self.open, &mut self.later, &mut self.single] {
            list.clear();
        }
        self.between = None;
        self.unsure.clear();
        self.close.clear();
    }

    pub fn bytes(&self) -> usize {
        let found: usize = self.found.iter().map(Vec::capacity).sum();
        let lists = [&self.open, &self.later, &self.single];
        size_of::<Open>() * lists.iter().map(|list| list.capacity()).sum::<usize>()
            + size_of::<(Between, Slots)>() * self.unsure.capacity()
            + size_of::<(PairKind, u64)>() * self.close.capacity()
            + size_of::<Found<Contact>>() * found
    }

    /// Hands over the contacts that were found.
    pub fn hand_over(&mut self, answer: StepAnswer<'_>) {
        for (kind, found) in PairKind::ALL.into_iter().zip(&mut self.found) {
            answer.take(kind, found);
        }
    }

    /// Whether only the earliest contacts are wanted.
    #[cfg(feature = "gpu")]
    pub fn seeks_earliest(&self) -> bool {
        matches!(self.goal, Goal::Earliest)
    }

    /// Notes that some pair touches after the start and before this time.
    #[cfg(feature = "gpu")]
    pub fn found_by(&self, world: StepWorld<'_>, time: f32) {
        world.known.found(self.goal, f64::from(time));
    }

    /// Contacts later than this are not wanted.
    #[inline(always)]
    pub fn until(&self, world: StepWorld<'_>) -> f64 {
        match self.goal {
            // Contacts that are later by less than rounding are wanted, for their keys may be
            // lower.
            Goal::Earliest => {
                let time = world.known.earliest();
                let later = (time * (1.0 + 2f64.powi(-22))).max(f64::from(f32::MIN_POSITIVE));
                later.min(1.0)
            }
            _ => 1.0,
        }
    }

    /// By how much rounding may move two vertices relative to each other; 0 if close pairs are not
    /// wanted.
    #[inline(always)]
    pub(super) fn margin(&self, world: StepWorld<'_>, between: Between) -> f64 {
        // Pairs that are decided last are remembered already.
        if self.is_last {
            return 0.0;
        }
        2.0 * world.plan.rounded(between.a, between.b)
    }

    /// Remembers a pair that is not certainly farther apart than the margin.
    pub(super) fn remember_close(&mut self, world: StepWorld<'_>, between: Between, slots: Slots) {
        if self.margin(world, between) > 0.0 && self.close.len() <= self.most_close {
            self.close.push((between.kind, key(world, between, slots)));
        }
    }

    /// The close pairs that were remembered; `None` if there are too many.
    pub fn close(&self) -> Option<&[(PairKind, u64)]> {
        (self.close.len() <= self.most_close).then_some(&self.close)
    }

    /// The pairs to be decided last.
    pub fn unsure(&mut self) -> &mut Vec<(Between, Slots)> {
        &mut self.unsure
    }

    /// Decides a pair about which nothing is certain, now or last.
    #[inline(always)]
    pub(super) fn leave(
        &mut self,
        world: StepWorld<'_>,
        between: Between,
        pair: ElementPair,
        slots: Slots,
    ) {
        if !self.is_last && self.unsure.len() < MOST_UNSURE {
            self.unsure.push((between, slots));
        } else {
            self.decide_exactly(world, between, pair, slots);
        }
    }

    /// Decides pairs of two parts that were left.
    pub fn decide_unsure(&mut self, isa: Isa, world: StepWorld<'_>, pairs: &[(Between, Slots)]) {
        let Some(&(between, _)) = pairs.first() else {
            return;
        };
        (self.between, self.is_first, self.is_last) = (Some(between), true, true);
        let (most_kept, _) = world.plan.most_kept(between.a, between.b);
        if most_kept > 0.0 {
            for &(between, slots) in pairs {
                self.decide_kept(world, between, slots);
            }
        } else {
            let until = self.until(world);
            self.open.extend(pairs.iter().map(|&(_, slots)| Open {
                slots,
                search: Search::new(until),
            }));
        }
        self.decide(isa, world);
    }

    /// Decides a pair by exact arithmetic, unless the search was cancelled: whoever began the work
    /// tells. One pair may take as long as a million in a filter.
    #[inline(never)]
    pub(super) fn decide_exactly(
        &mut self,
        world: StepWorld<'_>,
        between: Between,
        pair: ElementPair,
        slots: Slots,
    ) {
        if world.known.is_cancelled() {
            return;
        }
        if world.plan.has_filter() && !counts(world, between, slots) {
            return;
        }
        self.counts.n_unsure += 1;
        let ends = points(world, between, pair, slots);
        let elements = located(world, between, slots);
        if let Some(contact) = (world.plan).first(world.scene, elements, pair, ends.each_ref()) {
            self.report(world, between, slots, contact);
        }
    }

    /// Records a contact, unless it is not wanted.
    #[inline(always)]
    pub(super) fn report(
        &mut self,
        world: StepWorld<'_>,
        between: Between,
        slots: Slots,
        contact: Contact,
    ) {
        if self.start == Start::Skip && contact.at_start {
            return;
        }
        if contact.time > self.until(world) || !counts(world, between, slots) {
            return;
        }
        world.known.found(self.goal, contact.time);
        self.push(world, between, slots, contact);
    }

    #[inline(always)]
    fn push(&mut self, world: StepWorld<'_>, between: Between, slots: Slots, contact: Contact) {
        let found = &mut self.found[between.kind as usize];
        found.push(Found {
            key: key(world, between, slots),
            value: contact,
        });
        if found.len() >= BLOCK {
            world.answer.take(between.kind, found);
        }
    }

    /// Records a contact that is certainly in an interval of time.
    #[inline(always)]
    pub(super) fn report_within(
        &mut self,
        world: StepWorld<'_>,
        (between, pair): (Between, ElementPair),
        slots: Slots,
        span: [f64; 2],
    ) {
        if span[0] > self.until(world) || !counts(world, between, slots) {
            return;
        }
        // Other pairs need not be searched beyond this time.
        world.known.found(self.goal, span[1]);
        let time = match self.toi {
            None => Some(span[0]),
            Some(Precision::F32) => time_between(span).map(f64::from),
            Some(Precision::F64) => None,
        };
        let Some(time) = time else {
            return self.decide_exactly(world, between, pair, slots);
        };
        let contact = Contact {
            time,
            is_exact: false,
            at_start: false,
        };
        self.report(world, between, slots, contact);
    }
}
