//! Pairs that filters have left to exact arithmetic, decided last.
//!
//! Reason: one such pair costs as much as a thousand pairs in a filter, and most of them are in one
//! place, where one worker finds them; now all workers share them. The search for the earliest
//! contact ends with an earlier time limit than it had when these pairs were found; up to that
//! limit, the filter drops most of them. The search for any contact has usually found one by then.

use crate::query::progress::Pieces;
use crate::scene::error::Error;
use crate::search::runner::Job;

use super::pairing::StepWorker;
use super::world::StepWorld;

/// Pairs per task.
const TASK: usize = 8;

/// Decides the unsure pairs of all workers.
///
/// # Errors
/// Cancellation.
pub(super) fn decide(
    job: Job<'_>,
    world: StepWorld<'_>,
    workers: &mut [StepWorker],
) -> Result<(), Error> {
    let mut are_empty = workers.iter_mut();
    if are_empty.all(|worker| worker.contacts().unsure().is_empty()) {
        return Ok(());
    }
    let taken = workers.iter_mut();
    let mut lists: Vec<_> = taken
        .map(|worker| std::mem::take(worker.contacts().unsure()))
        .collect();
    // They come in runs of two parts, as workers find them.
    let tasks: Vec<_> = lists
        .iter()
        .flat_map(|list| list.chunk_by(|(between, _), (next, _)| between == next))
        .flat_map(|run| run.chunks(TASK))
        .collect();
    let pieces = Pieces::new(job.control, tasks.len());
    job.workers.for_each(workers, tasks.len(), |worker, ix| {
        if !world.known.is_over() && pieces.take().is_ok() {
            worker.contacts().decide_unsure(world.isa, world, tasks[ix]);
        }
    });
    // Their memory serves the next step.
    for (worker, list) in workers.iter_mut().zip(&mut lists) {
        list.clear();
        std::mem::swap(worker.contacts().unsure(), list);
    }
    pieces.end()
}
