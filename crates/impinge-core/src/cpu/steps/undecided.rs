//! Stage `decide`: finds the first contacts of pairs that the device could not rule out.
//!
//! In: pairs of elements by their places in cluster order, in any order. Each pair has a time
//! before which it has no contact. Besides, an upper bound on the earliest contact of all pairs.
//! Out: contacts, as from stage `narrow`, whose lists and filters do the work. A task is a run of
//! pairs. It is sorted first, so that pairs of the same two parts come together. Where the earliest
//! contact is sought, pairs are taken in the order of their times, a few at first, up to the
//! earliest contact found. Where any contact is sought, a pair that certainly touches ends the
//! search.

use std::sync::{Mutex, PoisonError};

use crate::plan::{TestId, owner_by_first};
use crate::query::progress::Pieces;
use crate::scene::error::Error;
use crate::scene::index::{PartIx, Slot};
use crate::search::found::StepAnswer;
use crate::search::runner::Job;
use crate::search::sink::Ending;
use crate::search::undecided::{Undecided, UndecidedPair};

use super::narrow::{Between, FirstContacts, Narrow};
use super::pairing::StepWorker;
use super::unsure;
use super::world::StepWorld;

/// Pairs per task.
const TASK: usize = 2048;
/// Where the earliest contact is sought: pairs decided first. The times of the other pairs are then
/// compared with the earliest contact found.
const SOONEST: usize = 256;

/// Decides pairs as they come.
pub(super) struct Deciding<'a, 'b> {
    pub job: Job<'a>,
    pub world: StepWorld<'a>,
    pub answer: StepAnswer<'a>,
    pub workers: &'b mut [StepWorker],
    /// The first slot of each part, then the end of the last part.
    pub first_slots: Vec<u32>,
}

impl Deciding<'_, '_> {
    /// Decides some pairs. Returns whether more are wanted.
    ///
    /// # Errors
    /// Cancellation, those of the answer, and pairs that nobody asked for.
    pub fn decide(&mut self, undecided: Undecided<'_>) -> Result<bool, Error> {
        let Undecided { pairs, touches_by } = undecided;
        if let Some(time) = touches_by {
            self.workers[0].contacts().found_by(self.world, time);
        }
        if !self.workers[0].contacts().seeks_earliest() {
            return self.decide_each(pairs);
        }
        let (mut pairs, mut n_soonest) = (pairs, SOONEST);
        loop {
            // The pairs that are dropped here touch after the earliest contact known, if at all.
            let until = self.workers[0].contacts().until(self.world);
            let mut n = 0;
            for ix in 0..pairs.len() {
                if f64::from(pairs[ix].free_until) <= until {
                    pairs.swap(n, ix);
                    n += 1;
                }
            }
            pairs = &mut pairs[..n];
            n_soonest = n_soonest.min(n);
            if n_soonest < n {
                let by_time =
                    |a: &UndecidedPair, b: &UndecidedPair| a.free_until.total_cmp(&b.free_until);
                pairs.select_nth_unstable_by(n_soonest, by_time);
            }
            let (soonest, later) = pairs.split_at_mut(n_soonest);
            let goes_on = self.decide_each(soonest)?;
            if !goes_on || later.is_empty() {
                return Ok(goes_on);
            }
            pairs = later;
            n_soonest *= 4;
        }
    }

    /// Decides pairs, run by run.
    fn decide_each(&mut self, pairs: &[UndecidedPair]) -> Result<bool, Error> {
        let Deciding {
            job,
            world,
            answer,
            workers,
            first_slots,
        } = self;
        let (world, answer, job) = (*world, *answer, *job);
        let first_slots = &first_slots[..];
        let wrong = Mutex::new(None);
        let tasks: Vec<&[UndecidedPair]> = pairs.chunks(TASK).collect();
        let n_workers = workers.len().min(tasks.len()).max(1);
        let pieces = Pieces::new(job.control, tasks.len());
        job.workers
            .for_each(&mut workers[..n_workers], tasks.len(), |worker, ix| {
                let is_over = answer.is_over() || world.known.is_over();
                if is_over || pieces.take().is_err() {
                    return;
                }
                if let Err(error) = decide(world, first_slots, tasks[ix], worker.contacts()) {
                    *wrong.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                }
            });
        pieces.end()?;
        answer.check()?;
        match wrong.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => Ok(!world.known.is_over()),
        }
    }

    /// Hands over the remaining contacts.
    ///
    /// # Errors
    /// Cancellation, and those of the answer.
    pub fn end(self) -> Result<(), Error> {
        unsure::decide(self.job, self.world, self.workers)?;
        for worker in self.workers {
            worker.end(self.answer);
        }
        self.answer.check()
    }
}

/// Decides the pairs of one task, sorted by their two parts. Pairs of the same two parts stay in
/// the order of the device, which lists pairs of two clusters next to each other.
fn decide(
    world: StepWorld<'_>,
    first_slots: &[u32],
    pairs: &[UndecidedPair],
    contacts: &mut FirstContacts,
) -> Result<(), Error> {
    let n_slots = first_slots.last().copied().unwrap_or(0);
    let part = |slot: u32| PartIx::from_usize(owner_by_first(first_slots, slot, |first| *first));
    let mut by_parts = Vec::with_capacity(pairs.len());
    for pair in pairs {
        let mut slots = pair.slots;
        slots.sort_unstable();
        if slots[1] >= n_slots {
            return Err(not_asked(slots));
        }
        by_parts.push((slots.map(part), slots, pair));
    }
    by_parts.sort_by_key(|(parts, ..)| *parts);
    for run in by_parts.chunk_by(|(parts, ..), (next, ..)| parts == next) {
        let ([a, b], first, _) = run[0];
        let Some(TestId::Elements(kind)) = world.plan.test(a, b) else {
            return Err(not_asked(first));
        };
        let firsts = [a, b].map(|part| first_slots[part.index()]);
        let pairs = run.iter().map(|(_, [p, q], pair)| {
            let slots = [p - firsts[0], q - firsts[1]].map(Slot::new);
            (
                slots,
                pair.free_until.into(),
                pair.touches_by.map(f64::from),
            )
        });
        contacts.take_undecided(world.isa, world, Between { a, b, kind }, pairs);
    }
    contacts.decide(world.isa, world);
    Ok(())
}

fn not_asked([a, b]: [u32; 2]) -> Error {
    Error::Gpu {
        what: format!("the device named slots {a} and {b}, which are no pair of this step"),
    }
}
