//! Stage `settle`: pairs that a device has not dropped, with their first contacts.
//!
//! In: places of two elements, in any order. Out: contacts, as from stage `narrow`, whose lists and filters do the work.
//! Runs of pairs are tasks; each is sorted first, so that pairs of two layers, and elements in memory, come together.

use std::sync::{Mutex, PoisonError};

use crate::cpu::simd::Isa;
use crate::error::Error;
use crate::frame::{TestId, owner_by_first};
use crate::impacts::StepAnswer;
use crate::index::{LayerIx, Place};
use crate::run::Job;
use crate::sink::Ending;

use super::narrow::{Between, FirstContacts, Narrow};
use super::pairing::Worker;
use super::unsure;
use super::world::World;

/// Pairs per task.
const TASK: usize = 2048;

/// Settles pairs as they come.
pub(super) struct Left<'a, 'b> {
    pub isa: Isa,
    pub job: Job<'a>,
    pub world: World<'a>,
    pub answer: StepAnswer<'a>,
    pub workers: &'b mut [Worker],
    /// Layers are numbered by their places: the first of each, then the end of the last.
    pub first_places: Vec<u32>,
}

impl Left<'_, '_> {
    /// Settles some pairs. Returns whether more are wanted.
    ///
    /// # Errors
    /// Cancellation, those of the answer, and pairs that nobody asked for.
    pub fn settle(&mut self, pairs: &mut [[u32; 2]]) -> Result<bool, Error> {
        let Left {
            isa,
            job,
            world,
            answer,
            workers,
            first_places,
        } = self;
        let (isa, world, answer, job) = (*isa, *world, *answer, *job);
        let first_places = &first_places[..];
        let wrong = Mutex::new(None);
        let tasks: Vec<Mutex<&mut [[u32; 2]]>> = pairs.chunks_mut(TASK).map(Mutex::new).collect();
        let n_workers = workers.len().min(tasks.len()).max(1);
        job.workers
            .for_each(&mut workers[..n_workers], tasks.len(), |worker, ix| {
                let is_over = answer.is_over() || world.known.is_over();
                if is_over || job.control.step(ix as u64, tasks.len() as u64).is_err() {
                    return;
                }
                let mut pairs = tasks[ix].lock().unwrap_or_else(PoisonError::into_inner);
                if let Err(error) = settle(isa, world, first_places, &mut pairs, worker.contacts())
                {
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

/// Settles the pairs of one task.
fn settle(
    isa: Isa,
    world: World<'_>,
    first_places: &[u32],
    pairs: &mut [[u32; 2]],
    contacts: &mut FirstContacts,
) -> Result<(), Error> {
    let n_places = first_places.last().copied().unwrap_or(0);
    for pair in &mut *pairs {
        pair.sort_unstable();
        if pair[1] >= n_places {
            return Err(not_asked(*pair));
        }
    }
    let layer =
        |place: u32| LayerIx::from_usize(owner_by_first(first_places, place, |first| *first));
    pairs.sort_unstable_by_key(|&[a, b]| (layer(a), layer(b), a, b));
    for run in pairs.chunk_by(|p, q| p.map(layer) == q.map(layer)) {
        let [a, b] = run[0].map(layer);
        let test = world.frame.test(a, b);
        let Some(TestId::Elements(kind)) = test else {
            return Err(not_asked(run[0]));
        };
        let firsts = [a, b].map(|layer| first_places[layer.index()]);
        let places = run
            .iter()
            .map(|&[p, q]| [p - firsts[0], q - firsts[1]].map(Place::new));
        contacts.take_left(isa, world, Between { a, b, kind }, places);
    }
    contacts.settle(isa, world);
    Ok(())
}

fn not_asked([a, b]: [u32; 2]) -> Error {
    Error::Gpu {
        what: format!("the device named places {a} and {b}, which are no pair of this step"),
    }
}
