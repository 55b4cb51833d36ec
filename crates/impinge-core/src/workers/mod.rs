//! Threads: the caller, which works too, and its helpers.
//!
//! Waking a sleeping thread takes as long as a small frame (on the machine of the records, 15 µs of
//! the caller's time and 45 µs until the thread runs; through a rayon pool 35 µs of the caller's).
//! So helpers are called once per frame, the caller never waits for a helper that has not come yet,
//! and helpers do not go to sleep at once:
//!
//! ```text
//! caller    | call | region 1 ......... | alone | region 2 .... | end of the shift
//! helper    : (waking) ..........|      | spins | ............. | lingers for as long | sleeps
//! ```
//!
//! A helper that lingers yields to every other thread. Clustering, which rayon parallelises, runs
//! in a rayon pool.

pub(crate) mod affinity;
pub(crate) mod alone;
pub(crate) mod clock;
mod crew;
pub(crate) mod in_parts;
mod sync;
pub(crate) mod tuning;

use crate::scene::words::debug_by_name;
use crate::workers::clock::Instant;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, Once, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::scene::error::Error;
use crate::workers::alone::alone;

use affinity::{Affinity, HelperCores};
use crew::{Claims, Crew};
use tuning::{Tuning, Ways};

/// How long a helper spins while it waits for the next region; after that it yields between checks.
const SPIN: Duration = Duration::from_micros(50);
/// How long a helper lingers within a shift, and at most after a shift.
const LINGER: Duration = Duration::from_millis(1);
/// How long a frame must take to be worth waking a helper that will sleep again before the next
/// frame.
const WORTH: Duration = Duration::from_micros(800);
/// How often a helper checks the gate between two looks at the clock.
const LOOKS: u32 = 64;

debug_by_name!(Workers => "Workers", Shift<'_> => "Shift");

/// The workers of a detector: the caller, its helpers and the rayon pool.
pub struct Workers {
    n: usize,
    helpers: Arc<Helpers>,
    /// Started when first needed.
    threads: OnceLock<Vec<JoinHandle<()>>>,
    /// When the last shift ended and how long it took.
    last: Mutex<Option<(Instant, Duration)>>,
    /// Whether helpers that sleep are woken in this shift.
    wakes: AtomicBool,
    /// The pool of [`install`](Workers::install), started when first needed.
    pool: OnceLock<Pool>,
    /// The process that created the workers: a fork of that process has none of its threads.
    process: u32,
    tuning: Tuning,
    ways: Mutex<Ways>,
}

/// The rayon pool in use.
enum Pool {
    /// Rayon's global pool, with one thread per core of the process, which all detectors share.
    OfProcess,
    OfDetector(rayon::ThreadPool),
}

/// While it lives, helpers expect more work.
pub struct Shift<'a> {
    workers: &'a Workers,
    start: Instant,
}

impl Drop for Shift<'_> {
    fn drop(&mut self) {
        let end = Instant::now();
        let took = end - self.start;
        *self.workers.last() = Some((end, took));
        self.workers.helpers.linger(took.min(LINGER));
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        if self.process != process() {
            // The threads do not exist in this process: waiting for them would never end.
            std::mem::forget(self.threads.take());
            return;
        }
        self.helpers.crew.quit();
        for helper in self.threads.take().into_iter().flatten() {
            helper.thread().unpark();
            // Helpers catch panics of the work; there is nothing else to report.
            let _ = helper.join();
        }
    }
}

impl Workers {
    /// `threads` workers, the caller among them; 0 for one per core. Threads are started when first
    /// needed.
    pub fn new(threads: usize) -> Self {
        Workers::tuned(threads, Affinity::default(), Tuning::default())
    }

    /// As [`new`](Workers::new), with another affinity of helpers and other thresholds.
    pub(crate) fn tuned(threads: usize, affinity: Affinity, tuning: Tuning) -> Self {
        let (pool, n) = match threads {
            // One thread, without what a pool needs.
            0 if cfg!(target_family = "wasm") => (OnceLock::new(), 1),
            0 if is_forked() => (OnceLock::new(), n_at_hand()),
            0 => (Pool::OfProcess.into(), n_at_hand()),
            n => (OnceLock::new(), n),
        };
        Workers {
            n,
            helpers: Arc::new(Helpers::new(n - 1, affinity)),
            threads: OnceLock::new(),
            last: Mutex::new(None),
            wakes: AtomicBool::new(true),
            pool,
            process: process(),
            tuning,
            ways: Mutex::default(),
        }
    }

    /// The number of workers, the caller included.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Keeps helpers awake between regions until the returned shift is dropped.
    ///
    /// Sleeping helpers are woken unless the frame will probably be over before they come. They are
    /// woken if it has very many elements; if the last frame took long, for so will this one; and
    /// if it follows the last one closely, for then they stay awake for the next one.
    pub fn shift(&self, n_elements: u64) -> Shift<'_> {
        let start = Instant::now();
        let wakes = n_elements >= self.tuning.wake_from
            || self
                .last()
                .is_none_or(|(end, took)| took >= WORTH || start - end <= LINGER);
        self.wakes.store(wakes, Ordering::Relaxed);
        *self.ways() = Ways {
            wakes,
            ..Ways::default()
        };
        self.helpers.linger(LINGER);
        Shift {
            workers: self,
            start,
        }
    }

    /// Adds the ways that were gone in this shift to those of a frame.
    pub(crate) fn report(&self, plan: &mut Ways) {
        let Ways {
            n_shared,
            n_tasks,
            n_called,
            wakes,
            n_pooled,
            ..
        } = *self.ways();
        *plan = Ways {
            n_shared,
            n_tasks,
            n_called,
            wakes,
            n_pooled,
            ..*plan
        };
    }

    fn ways(&self) -> MutexGuard<'_, Ways> {
        self.ways.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How many units of work to put into a task whose best size this is.
    pub fn task(&self, size: usize) -> usize {
        size.min(self.tuning.most_per_task).max(1)
    }

    fn last(&self) -> MutexGuard<'_, Option<(Instant, Duration)>> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs work that rayon parallelises, on as many threads as there are workers. With one worker,
    /// or few elements, it runs on this thread, for going to a pool takes 70 µs. Such work must
    /// ask `alone::is_alone` before it shares.
    ///
    /// Why a second pool beside the helpers: clustering splits a body recursively, which takes a
    /// work-stealing scheduler, while helpers only take equal tasks from a list. The pool works
    /// when a body is new or has flowed away from its clusters; in all other frames its threads
    /// sleep.
    ///
    /// # Errors
    /// The pool's threads do not start.
    pub fn install<T: Send>(
        &self,
        n_elements: usize,
        work: impl FnOnce() -> T + Send,
    ) -> Result<T, Error> {
        // One worker is this thread; in a fork, the pools of the process that created the workers
        // have no threads.
        if self.n == 1 || n_elements < self.tuning.pool_from || self.process != process() {
            return Ok(alone(work));
        }
        let pool = match self.pool.get() {
            Some(pool) => pool,
            None => {
                let pool = Pool::OfDetector(build_pool(self.n)?);
                self.pool.get_or_init(|| pool)
            }
        };
        Ok(match pool {
            Pool::OfProcess => work(),
            Pool::OfDetector(pool) => {
                self.ways().n_pooled += 1;
                pool.install(work)
            }
        })
    }

    /// Calls `task(scratch, ix)` once for each `ix` below `n_tasks`, each worker with its own
    /// scratch. The caller takes tasks from the first on, helpers from the last: neighbouring tasks
    /// tend to use the same memory. With a single task or worker, no helper is woken.
    pub fn for_each<S: Send>(
        &self,
        scratches: &mut [S],
        n_tasks: usize,
        task: impl Fn(&mut S, usize) + Sync,
    ) {
        let n_workers = self.n.min(n_tasks).min(scratches.len());
        {
            let mut ways = self.ways();
            ways.n_tasks += n_tasks as u64;
            ways.n_shared += u64::from(n_workers > 1);
        }
        if n_workers <= 1 {
            for ix in 0..n_tasks {
                task(&mut scratches[0], ix);
            }
            return;
        }
        let claims = Claims::new();
        let scratches = Scratches(scratches.as_mut_ptr());
        let work = |worker: usize| {
            if worker >= n_workers {
                return;
            }
            // SAFETY: there are at least `n_workers` scratches, and every worker has a different
            // number.
            let scratch = unsafe { &mut *scratches.at(worker) };
            while let Some(ix) = claims.next(n_tasks, worker == 0) {
                task(scratch, ix);
            }
        };
        self.call(n_workers - 1);
        self.helpers.crew.region(&work);
    }

    /// Wakes all helpers, so that they are awake when they are needed.
    pub fn call_all(&self) {
        self.ways().n_called += 1;
        self.call(self.n - 1);
    }

    /// Wakes those of the first `n` helpers that sleep, if the shift is worth it.
    fn call(&self, n: usize) {
        if !self.wakes.load(Ordering::Relaxed) {
            return;
        }
        // Within a region the calling thread is a helper, or another thread.
        if !self.helpers.crew.is_busy() {
            self.helpers.cores.caller_is_here();
        }
        let threads = self.threads.get_or_init(|| {
            let start = |seat| {
                let helpers = Arc::clone(&self.helpers);
                thread::Builder::new()
                    .name(format!("impinge-{seat}"))
                    .spawn(move || helpers.serve(seat))
            };
            // If a thread does not start, there are fewer helpers.
            (1..self.n).map_while(|seat| start(seat).ok()).collect()
        });
        for (seat, helper) in (1..).zip(threads).take(n) {
            if self.helpers.crew.wakes(seat) {
                helper.thread().unpark();
            }
        }
    }
}

/// The first of some scratches, one per worker.
struct Scratches<S>(*mut S);

// SAFETY: each worker takes a different scratch, and `S` may be sent to it.
unsafe impl<S: Send> Sync for Scratches<S> {}

impl<S> Scratches<S> {
    /// # Safety
    /// There must be more than `worker` scratches.
    unsafe fn at(&self, worker: usize) -> *mut S {
        // SAFETY: by the contract of `at`.
        unsafe { self.0.add(worker) }
    }
}

/// The helpers of a detector: the protocol that they share with the caller, and how long they stay
/// awake.
struct Helpers {
    crew: Crew,
    /// How long helpers that have nothing to do stay awake.
    linger_ns: AtomicU64,
    cores: HelperCores,
}

impl Helpers {
    fn new(n: usize, affinity: Affinity) -> Self {
        Helpers {
            crew: Crew::new(n),
            linger_ns: AtomicU64::new(0),
            cores: HelperCores::new(n, affinity),
        }
    }

    /// Sets how long helpers that have nothing to do stay awake.
    fn linger(&self, time: Duration) {
        self.linger_ns
            .store(time.as_nanos() as u64, Ordering::Relaxed);
    }

    /// The loop of a helper thread.
    fn serve(&self, seat: usize) {
        self.cores.helper_is_here(seat);
        let mut last_region = 0;
        let mut since = Instant::now();
        let mut looks = 0u32;
        while !self.crew.is_over() {
            let seen = self.crew.look();
            if let Some(region) = seen.open_region()
                && region != last_region
            {
                if self.crew.help(seat, seen) {
                    last_region = region;
                    since = Instant::now();
                }
                continue;
            }
            std::hint::spin_loop();
            looks += 1;
            if looks < LOOKS {
                continue;
            }
            looks = 0;
            let idle = since.elapsed();
            if idle > Duration::from_nanos(self.linger_ns.load(Ordering::Relaxed)) {
                self.crew.sleep(seat, seen);
                since = Instant::now();
            } else if idle > SPIN {
                thread::yield_now();
            }
        }
    }
}

/// The number of this process.
fn process() -> u32 {
    #[cfg(not(target_family = "wasm"))]
    return std::process::id();
    #[cfg(target_family = "wasm")]
    return 1;
}

/// Whether this process was forked from one that had workers, whose threads do not exist here.
pub fn is_forked() -> bool {
    static FIRST: AtomicU32 = AtomicU32::new(0);
    let this = process();
    let first = FIRST.compare_exchange(0, this, Ordering::Relaxed, Ordering::Relaxed);
    first.is_err_and(|first| first != this)
}

/// Whether the rayon pool of the process is this library's alone.
static OWNS_POOL: AtomicBool = AtomicBool::new(false);

/// Says that nobody else uses the rayon pool of the process, as in a library for C. Where it is
/// first needed, it then gets one thread per core, whatever the environment says.
#[doc(hidden)]
pub fn own_pool() {
    OWNS_POOL.store(true, Ordering::Relaxed);
}

/// The number of threads of the rayon pool at hand. Outside of all others that is the pool of the
/// process, which is started then.
pub(crate) fn n_at_hand() -> usize {
    static SIZED: Once = Once::new();
    if OWNS_POOL.load(Ordering::Relaxed) && rayon::current_thread_index().is_none() {
        SIZED.call_once(|| {
            let n = thread::available_parallelism().map_or(1, usize::from);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n);
            let pool = pool.thread_name(|ix| format!("impinge-pool-{ix}"));
            // Where threads cannot be had, rayon panics when the pool is first used.
            let _ = pool.build_global();
        });
    }
    rayon::current_num_threads()
}

fn build_pool(n_threads: usize) -> Result<rayon::ThreadPool, Error> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(n_threads)
        .thread_name(|ix| format!("impinge-pool-{ix}"))
        .build()
        .map_err(|error| Error::Threads(error.to_string()))
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    #[test]
    fn every_task_is_done_once_whoever_comes() {
        for threads in [1, 2, 5] {
            let workers = Workers::new(threads);
            let _shift = workers.shift(u64::MAX);
            let mut sums = vec![0u64; threads];
            for n_tasks in (0..200).chain([10_000]) {
                sums.fill(0);
                workers.for_each(&mut sums, n_tasks, |sum, ix| *sum += ix as u64 + 1);
                let n = n_tasks as u64;
                assert_eq!(sums.iter().sum::<u64>(), n * (n + 1) / 2, "{n_tasks} tasks");
            }
        }
    }

    #[test]
    fn helpers_come_again_after_they_slept() {
        let workers = Workers::new(2);
        for _ in 0..3 {
            let shift = workers.shift(u64::MAX);
            let deadline = Instant::now() + Duration::from_secs(60);
            let mut helped = [false; 2];
            while !helped[1] {
                assert!(Instant::now() < deadline, "no helper came");
                workers.for_each(&mut helped, 64, |helped, _| {
                    *helped = true;
                    thread::sleep(Duration::from_micros(20));
                });
            }
            drop(shift);
            thread::sleep(2 * LINGER);
        }
    }

    #[test]
    fn a_panic_of_any_worker_reaches_the_caller() {
        let workers = Workers::new(3);
        for bad in [0, 63] {
            let mut scratches = [(); 3];
            let run = catch_unwind(AssertUnwindSafe(|| {
                workers.for_each(&mut scratches, 64, |(), ix| {
                    thread::sleep(Duration::from_micros(50));
                    assert_ne!(ix, bad, "a task that fails");
                });
            }));
            assert!(run.is_err());
        }
        let mut sums = [0usize; 3];
        workers.for_each(&mut sums, 100, |sum, ix| *sum += ix);
        assert_eq!(sums.iter().sum::<usize>(), 4950, "works on after a panic");
    }

    #[test]
    fn regions_nest() {
        let workers = Workers::new(2);
        let mut sums = [0usize; 2];
        workers.for_each(&mut sums, 10, |sum, _| {
            let mut inner = [0usize; 2];
            workers.for_each(&mut inner, 10, |sum, ix| *sum += ix);
            *sum += inner.iter().sum::<usize>();
        });
        assert_eq!(sums.iter().sum::<usize>(), 450);
    }

    /// The caller moves from core to core, and another program moves a helper.
    #[cfg(target_os = "linux")]
    #[test]
    fn affinities_are_set_by_auto_alone() {
        use rustix::thread::{CpuSet, Pid, gettid, sched_getaffinity, sched_setaffinity};

        let cores_of = |thread: Option<Pid>| sched_getaffinity(thread).expect("has a set of cores");
        let with_core = |core: usize| {
            let mut cores = CpuSet::new();
            cores.set(core);
            cores
        };
        let moves = |affinity: Affinity| {
            let all = cores_of(None);
            let mut cores = (0..CpuSet::MAX_CPU).filter(|&core| all.is_set(core));
            let workers = Workers::tuned(3, affinity, Tuning::default());
            let _shift = workers.shift(u64::MAX);
            let deadline = Instant::now() + Duration::from_secs(60);
            let mut threads = [None; 3];
            while threads.contains(&None) {
                assert!(Instant::now() < deadline, "no helper came");
                workers.for_each(&mut threads, 64, |thread, _| {
                    *thread = Some(gettid());
                    thread::sleep(Duration::from_micros(20));
                });
            }
            let helpers = &threads[1..];
            let first = cores.next().expect("at least one core");
            for core in [Some(first), cores.next(), Some(first)]
                .into_iter()
                .flatten()
            {
                sched_setaffinity(None, &with_core(core)).expect("its own core");
                workers.for_each(&mut threads.clone(), 64, |_, _| ());
                let mut expected = all;
                if affinity == Affinity::Auto && all.count() > 1 {
                    expected.unset(core);
                }
                for &helper in helpers {
                    assert!(cores_of(helper) == expected, "{affinity:?}, core {core}");
                }
            }
            if affinity == Affinity::Inherited {
                sched_setaffinity(helpers[0], &with_core(first)).expect("the helper lives");
                sched_setaffinity(None, &all).expect("its own cores");
                workers.for_each(&mut threads.clone(), 64, |_, _| ());
                assert!(cores_of(helpers[0]) == with_core(first), "overwritten");
            }
        };
        for affinity in [Affinity::Auto, Affinity::Inherited] {
            // The caller is a thread of its own, whose affinity ends with it.
            thread::scope(|scope| {
                scope.spawn(|| moves(affinity));
            });
        }
    }
}
