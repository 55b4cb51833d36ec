//! The loop that answers every question: has a [`Finder`] find the pairs of a [`Plan`], and sorts
//! them.
//!
//! ```text
//! scene + query  ->  Plan      what is asked: one constructor per question
//! Plan           ->  Finder    a backend, a method of another crate, or the oracle; its pairs go
//!                              to an `Answer`
//! Answer         ->  Outcome   pairs, impacts, candidates, near pairs: sorted, with statistics
//! ```
//!
//! There is one loop for all questions and backends, and for methods of other crates. It is async
//! because a GPU must be waited for. A finder that works on the CPU never waits: its frame is
//! complete at the first poll, see [`ready`].

use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use crate::plan::Plan;
use crate::query::goal::{Goal, Limits};
use crate::query::progress::Control;
use crate::query::settings::{Method, Settings};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::words::debug_by_name;
use crate::search::sink::Answer;
use crate::search::sort::{Keyed, Sorter};
use crate::search::stats::Stats;
use crate::workers::Workers;
use crate::workers::clock::Instant;

debug_by_name!(Job<'_> => "Job", Runner => "Runner");

/// One frame as a finder sees it.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// What is asked.
    pub plan: &'a Plan,
    /// The threads.
    pub workers: &'a Workers,
    /// Stops and watches the frame.
    pub control: &'a Control,
}

/// Finds the pairs of a question: a backend of this crate, or a method of another one.
pub trait Finder<T = u64, const LISTS: usize = 1> {
    /// The name of the method, for the statistics.
    fn method(&self) -> &'static str;

    /// `"cpu"`, or the name of the GPU.
    fn backend(&self) -> &str {
        "cpu"
    }

    /// Whether [`find`](Finder::find) itself refuses positions that were written in place and are
    /// not finite. If not, the loop checks them before.
    fn checks_positions(&self) -> bool {
        false
    }

    /// Whether a key may come more than once. The loop then drops repetitions.
    fn repeats(&self) -> bool {
        false
    }

    /// Hands over all pairs that the plan asks for, in any order, and tells the answer how many
    /// bytes the finder holds itself.
    ///
    /// # Errors
    /// Refused positions, cancellation, a memory budget that is too small, a GPU failure, those of
    /// the answer.
    fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer<T, LISTS>>,
        stats: &mut Stats,
    ) -> impl Future<Output = Result<(), Error>>;
}

/// What the pairs of a question become. The memory is kept from frame to frame.
pub trait Outcome<T, const LISTS: usize> {
    /// Makes ready: takes over the plan's numbering, and clears the statistics.
    fn begin(&mut self, plan: &Plan);

    /// How the answer is found.
    fn stats_mut(&mut self) -> &mut Stats;

    /// Memory of the last answer, for the pairs of this one.
    fn take_buffers(&mut self) -> [Vec<T>; LISTS];

    /// Takes the pairs, sorted if all are wanted, each once.
    ///
    /// # Errors
    /// There is no memory, cancellation.
    fn fill(&mut self, job: Job<'_>, lists: [Vec<T>; LISTS]) -> Result<(), Error>;

    /// Bytes of the answer.
    fn bytes(&self) -> u64;
}

/// Takes questions from their plans to their answers. Holds what they all need: threads, and memory
/// to sort in.
pub struct Runner {
    workers: Workers,
    sorter: Mutex<Sorter>,
}

impl Runner {
    /// For detectors with these settings.
    pub fn new(settings: &Settings) -> Self {
        Runner {
            workers: Workers::tuned(settings.threads, settings.affinity, settings.tuning),
            sorter: Mutex::new(Sorter::new(settings)),
        }
    }

    /// The threads, for answers found without the loop.
    pub fn workers(&self) -> &Workers {
        &self.workers
    }

    /// A frame as a finder sees it, with positions that were checked: for answers that stay on a
    /// device.
    ///
    /// # Errors
    /// Refused positions.
    pub fn job<'a>(
        &'a self,
        scene: &'a Scene,
        plan: &'a Plan,
        control: &'a Control,
    ) -> Result<Job<'a>, Error> {
        plan.check(scene, &self.workers)?;
        Ok(Job {
            scene,
            plan,
            workers: &self.workers,
            control,
        })
    }

    /// Answers a question whose answer is no list of pairs, with statistics and a memory budget as
    /// in [`run`](Runner::run). `find` says how many bytes the detector holds for it.
    ///
    /// # Errors
    /// Those of `find`, and more bytes held than the budget allows.
    pub(crate) fn measure<A>(
        &self,
        stats: &mut Stats,
        limits: Limits,
        find: impl FnOnce(&Workers, &mut Stats) -> Result<A, Error>,
    ) -> Result<A, Error> {
        let start = Instant::now();
        stats.clear();
        // Trees of clusters serve all of these.
        stats.found_by(Method::Clusters.name(), "cpu", self.workers.n());
        let answer = find(&self.workers, stats)?;
        self.workers.report(&mut stats.ways);
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
        match limits.memory_budget {
            Some(budget) if stats.bytes_held > budget => Err(Error::MemoryBudget {
                what: "the trees of the bodies, or the contacts",
                needed: stats.bytes_held,
                budget,
            }),
            _ => Ok(answer),
        }
    }

    /// Answers a question. Returns how many pairs there are: of [`Goal::Any`], at least one if
    /// there is any.
    ///
    /// # Errors
    /// Refused positions, errors of the finder, those of the answer.
    pub async fn run<T: Keyed, const LISTS: usize>(
        &self,
        scene: &Scene,
        plan: &Plan,
        control: &Control,
        finder: &mut impl Finder<T, LISTS>,
        outcome: &mut impl Outcome<T, LISTS>,
    ) -> Result<u64, Error> {
        let workers = &self.workers;
        let _shift = workers.shift(plan.n_elements());
        outcome.begin(plan);
        if !finder.checks_positions() {
            plan.check(scene, &self.workers)?;
        }
        let answer = Answer::new(plan.limits, plan.held(), outcome.take_buffers());
        let answer = Arc::new(answer);
        let stats = outcome.stats_mut();
        stats.found_by(finder.method(), finder.backend(), workers.n());
        let job = Job {
            scene,
            plan,
            workers,
            control,
        };
        let found = finder.find(job, &answer, stats).await;
        let collect = Instant::now();
        let is_enough = answer.is_enough();
        let joined = answer.finish();
        if !is_enough {
            found?;
        }
        let (mut lists, mut n) = joined?;
        if let Some(n_counted) = keep_counted(job, &mut lists) {
            n = n_counted;
        }
        let mut sorter = self.sorter.lock().unwrap_or_else(PoisonError::into_inner);
        if plan.goal == Goal::All {
            stats.ways.n_counted = sorter.sort(&mut lists, plan, workers);
        }
        if finder.repeats() {
            lists
                .iter_mut()
                .for_each(|list| list.dedup_by_key(|item| item.key()));
        }
        stats.add_ms("collect", collect.elapsed().as_secs_f64() * 1e3);
        outcome.fill(job, lists)?;
        let bytes = outcome.bytes() + sorter.bytes();
        let stats = outcome.stats_mut();
        stats.bytes_held += bytes;
        workers.report(&mut stats.ways);
        stats.total_ms = plan.since.elapsed().as_secs_f64() * 1e3;
        Ok(n)
    }
}

/// Drops pairs that do not count, if there may be any and finders have not looked. Returns how many
/// are left then.
fn keep_counted<T: Keyed, const LISTS: usize>(
    job: Job<'_>,
    lists: &mut [Vec<T>; LISTS],
) -> Option<u64> {
    if !job.plan.counts_late() {
        return None;
    }
    for list in &mut *lists {
        list.retain(|item| job.plan.counts(job.scene, item.key()));
    }
    let n = lists.iter().map(Vec::len).sum::<usize>();
    if job.plan.goal != Goal::All {
        lists.iter_mut().for_each(Vec::clear);
    }
    Some(n as u64)
}

/// The result of a future that never waits.
///
/// # Panics
/// If the future does wait.
pub fn ready<T>(future: impl Future<Output = T>) -> T {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => result,
        Poll::Pending => unreachable!("a finder on the CPU waits for nobody"),
    }
}
