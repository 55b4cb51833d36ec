//! Stage `settle`: finds the first contacts of pairs that the device could not rule out.
//!
//! In: pairs of elements by their places in cluster order, in any order. Each pair has a time before which it has no
//! contact. Besides, an upper bound on the earliest contact of all pairs.
//! Out: contacts, as from stage `narrow`, whose lists and filters do the work. A task is a run of pairs. It is sorted
//! first, so that pairs of the same two layers come together. Where the earliest contact is sought, pairs are taken in
//! the order of their times, a few at first, up to the earliest contact found. Where any contact is sought, a pair that
//! certainly touches ends the search.

use std::sync::{Mutex, PoisonError};

use crate::error::Error;
use crate::found::StepAnswer;
use crate::index::{LayerIx, Place};
use crate::plan::{TestId, owner_by_first};
use crate::run::Job;
use crate::sink::Ending;
use crate::undecided::{Left, LeftPair};

use super::narrow::{Between, FirstContacts, Narrow};
use super::pairing::Worker;
use super::unsure;
use super::world::World;

/// Pairs per task.
const TASK: usize = 2048;
/// Where the earliest contact is sought: pairs settled first. The times of the other pairs are then compared with the
/// earliest contact found.
const SOONEST: usize = 256;

/// Settles pairs as they come.
pub(super) struct Settling<'a, 'b> {
    pub job: Job<'a>,
    pub world: World<'a>,
    pub answer: StepAnswer<'a>,
    pub workers: &'b mut [Worker],
    /// The first place of each layer, then the end of the last layer.
    pub first_places: Vec<u32>,
}

impl Settling<'_, '_> {
    /// Settles some pairs. Returns whether more are wanted.
    ///
    /// # Errors
    /// Cancellation, those of the answer, and pairs that nobody asked for.
    pub fn settle(&mut self, left: Left<'_>) -> Result<bool, Error> {
        let Left { pairs, touches_by } = left;
        if let Some(time) = touches_by {
            self.workers[0].contacts().found_by(self.world, time);
        }
        if !self.workers[0].contacts().seeks_earliest() {
            return self.settle_each(pairs);
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
                let by_time = |a: &LeftPair, b: &LeftPair| a.free_until.total_cmp(&b.free_until);
                pairs.select_nth_unstable_by(n_soonest, by_time);
            }
            let (soonest, later) = pairs.split_at_mut(n_soonest);
            let goes_on = self.settle_each(soonest)?;
            if !goes_on || later.is_empty() {
                return Ok(goes_on);
            }
            pairs = later;
            n_soonest *= 4;
        }
    }

    /// Settles pairs, run by run.
    fn settle_each(&mut self, pairs: &[LeftPair]) -> Result<bool, Error> {
        let Settling {
            job,
            world,
            answer,
            workers,
            first_places,
        } = self;
        let (world, answer, job) = (*world, *answer, *job);
        let first_places = &first_places[..];
        let wrong = Mutex::new(None);
        let tasks: Vec<&[LeftPair]> = pairs.chunks(TASK).collect();
        let n_workers = workers.len().min(tasks.len()).max(1);
        job.workers
            .for_each(&mut workers[..n_workers], tasks.len(), |worker, ix| {
                let is_over = answer.is_over() || world.known.is_over();
                if is_over || job.control.step(ix as u64, tasks.len() as u64).is_err() {
                    return;
                }
                if let Err(error) = settle(world, first_places, tasks[ix], worker.contacts()) {
                    *wrong.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                }
            });
        job.control.step(tasks.len() as u64, tasks.len() as u64)?;
        answer.check()?;
        match wrong.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => Ok(!world.known.is_over()),
        }
    }

    /// Hands over the remaining contacts.
    pub fn end(self) -> Result<(), Error> {
        unsure::settle(self.job, self.world, self.workers);
        for worker in self.workers {
            worker.end(self.answer);
        }
        self.answer.check()
    }
}

/// Settles the pairs of one task, sorted by their two layers. Pairs of the same two layers stay in the order of the
/// device, which lists pairs of two clusters next to each other.
fn settle(
    world: World<'_>,
    first_places: &[u32],
    pairs: &[LeftPair],
    contacts: &mut FirstContacts,
) -> Result<(), Error> {
    let n_places = first_places.last().copied().unwrap_or(0);
    let layer =
        |place: u32| LayerIx::from_usize(owner_by_first(first_places, place, |first| *first));
    let mut by_layers = Vec::with_capacity(pairs.len());
    for pair in pairs {
        let mut places = pair.places;
        places.sort_unstable();
        if places[1] >= n_places {
            return Err(not_asked(places));
        }
        by_layers.push((places.map(layer), places, pair));
    }
    by_layers.sort_by_key(|(layers, ..)| *layers);
    for run in by_layers.chunk_by(|(layers, ..), (next, ..)| layers == next) {
        let ([a, b], first, _) = run[0];
        let Some(TestId::Elements(kind)) = world.frame.test(a, b) else {
            return Err(not_asked(first));
        };
        let firsts = [a, b].map(|layer| first_places[layer.index()]);
        let pairs = run.iter().map(|(_, [p, q], pair)| {
            let places = [p - firsts[0], q - firsts[1]].map(Place::new);
            (
                places,
                pair.free_until.into(),
                pair.touches_by.map(f64::from),
            )
        });
        contacts.take_left(world.isa, world, Between { a, b, kind }, pairs);
    }
    contacts.settle(world.isa, world);
    Ok(())
}

fn not_asked([a, b]: [u32; 2]) -> Error {
    Error::Gpu {
        what: format!("the device named places {a} and {b}, which are no pair of this step"),
    }
}
