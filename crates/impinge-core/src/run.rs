//! The frame loop: resolves a query, has a [`Finder`] find the keys of all pairs, sorts them.
//!
//! There is one loop for every backend and for methods of other crates. It is async because a GPU must be waited for. A
//! finder that works on the CPU never waits: its frame is complete at the first poll, see [`ready`].

use std::pin::pin;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};

use crate::clock::Instant;
use crate::error::Error;
use crate::frame::Frame;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::scene::Scene;
use crate::settings::{Method, Placement};
use crate::sink::{Answer, Limits, Wanted};
use crate::stats::Statistics;
use crate::tuning::Tuning;
use crate::workers::Workers;

/// One frame as a finder sees it.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// The layers that take part, and their tests.
    pub frame: &'a Frame,
    /// The threads.
    pub workers: &'a Workers,
    /// Stops and watches the frame.
    pub control: &'a Control<'a>,
}

/// Finds the pairs of a frame: a backend of this crate, or a method of another one.
pub trait Finder {
    /// The name of the method, for the statistics.
    fn method(&self) -> &'static str;

    /// `"cpu"`, or the name of the GPU.
    fn backend(&self) -> &str;

    /// Whether [`find`](Finder::find) itself refuses positions that were written in place and are not finite. If not,
    /// the loop checks them before.
    fn checks_positions(&self) -> bool {
        false
    }

    /// Whether a key may come more than once. The loop then drops repetitions.
    fn repeats(&self) -> bool {
        false
    }

    /// Hands over the keys of all pairs that the frame asks for, in any order, and tells the answer how many bytes the
    /// finder holds itself.
    ///
    /// # Errors
    /// Refused positions, cancellation, a memory budget that is too small, a GPU failure, those of the answer.
    fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Statistics,
    ) -> impl Future<Output = Result<(), Error>>;
}

/// The frame, answer and threads that every finder needs. The memory is kept from frame to frame.
pub struct FrameLoop {
    frame: Frame,
    pairs: Pairs,
    n_pairs: u64,
    answer: Arc<Answer>,
    limits: Limits,
    workers: Workers,
}

impl FrameLoop {
    /// Creates a loop with `threads` workers; 0 for one per core.
    pub fn new(threads: usize, placement: Placement, limits: Limits, tuning: Tuning) -> Self {
        FrameLoop {
            frame: Frame::default(),
            pairs: Pairs::default(),
            n_pairs: 0,
            answer: Arc::default(),
            limits,
            workers: Workers::tuned(threads, placement, tuning),
        }
    }

    /// One frame. Its answer is in [`pairs`](FrameLoop::pairs) or [`n_pairs`](FrameLoop::n_pairs).
    ///
    /// # Errors
    /// A stale id, refused positions, errors of the finder.
    pub async fn run(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
        wanted: Wanted,
        finder: &mut impl Finder,
    ) -> Result<(), Error> {
        let start = Instant::now();
        self.frame.resolve(scene, query)?;
        let _shift = self.workers.shift(self.frame.n_primitives());
        self.pairs.begin(&self.frame);
        if !finder.checks_positions() {
            self.frame.check(scene)?;
        }
        let keys = self.pairs.take_keys();
        // Which pairs belong to a cell is known only when they are found.
        let (mut wanted_first, mut limits) = (wanted, self.limits);
        if self.frame.has_cell() {
            wanted_first = Wanted::Pairs;
            if wanted == Wanted::Any {
                limits.max_pairs = None;
            }
        }
        self.answer.begin(limits, wanted_first, [keys]);
        let stats = self.pairs.stats_mut();
        stats.method = finder.method();
        stats.n_threads = self.workers.n();
        stats.backend.push_str(finder.backend());
        let job = Job {
            scene,
            frame: &self.frame,
            workers: &self.workers,
            control,
        };
        let found = finder.find(job, &self.answer, stats).await;
        let is_enough = self.answer.is_enough();
        let joined = self.answer.finish();
        if !is_enough {
            found?;
        }
        let ([mut keys], n_pairs) = joined?;
        self.n_pairs = n_pairs;
        stats.time("collect", |_| {
            if self.frame.has_cell() {
                keys.retain(|&key| self.frame.is_owned(scene, key));
                self.n_pairs = keys.len() as u64;
                if wanted != Wanted::Pairs {
                    keys.clear();
                }
            }
            keys.sort_unstable();
            if finder.repeats() {
                keys.dedup();
            }
        });
        stats.bytes_held += size_of::<u64>() as u64 * keys.capacity() as u64;
        self.workers.report(&mut stats.ways);
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
        self.pairs.put_keys(keys);
        Ok(())
    }

    /// The answer of the last frame, unless it failed.
    pub fn pairs(&self) -> &Pairs {
        &self.pairs
    }

    /// The same, out of the loop.
    pub fn take_pairs(&mut self) -> Pairs {
        std::mem::take(&mut self.pairs)
    }

    /// How many pairs the last frame had, if it had no error.
    pub fn n_pairs(&self) -> u64 {
        self.n_pairs
    }

    /// Takes note of an answer to the query that was [resolved](FrameLoop::resolve) last, found by one thread without this loop.
    pub(crate) fn note(&mut self, n_pairs: u64, start: Instant) {
        self.pairs.begin(&self.frame);
        self.n_pairs = n_pairs;
        let stats = self.pairs.stats_mut();
        stats.method = Method::Clusters.name();
        stats.backend.push_str("cpu");
        stats.n_threads = 1;
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
    }

    /// The threads, for answers found without this loop.
    pub fn workers(&self) -> &Workers {
        &self.workers
    }

    /// A query resolved and its positions checked, and the threads: for frames whose answer stays elsewhere.
    ///
    /// # Errors
    /// A stale id, refused positions, a query for the pairs of a cell.
    pub fn resolve(&mut self, scene: &Scene, query: &Query) -> Result<(&Frame, &Workers), Error> {
        self.frame.resolve(scene, query)?;
        if self.frame.has_cell() {
            return Err(Error::Setting {
                setting: "owned_by",
                given: "a cell in a frame that stays on a device".to_owned(),
                allowed: "only detect, count and any",
            });
        }
        self.frame.check(scene)?;
        Ok((&self.frame, &self.workers))
    }
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
