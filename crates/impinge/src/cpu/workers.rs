//! Threads: the caller works too, the others come from a rayon pool.

use std::cell::UnsafeCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};

use crate::error::Error;

/// How many workers there are and where they come from.
pub(crate) struct Workers {
    /// `None` for the global pool.
    pool: Option<rayon::ThreadPool>,
    n: usize,
    /// One for each worker but the caller.
    desks: Vec<Arc<Desk>>,
}

impl Workers {
    /// `threads` workers, the caller among them; 0 for one a core.
    pub fn new(threads: usize) -> Result<Self, Error> {
        let (pool, n) = match threads {
            0 => (None, rayon::current_num_threads()),
            1 => (None, 1),
            n => {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(n - 1)
                    .thread_name(|ix| format!("impinge-{ix}"))
                    .build()
                    .map_err(|error| Error::Threads(error.to_string()))?;
                (Some(pool), n)
            }
        };
        let desks = (1..n).map(|_| Arc::new(Desk::new())).collect();
        Ok(Workers { pool, n, desks })
    }

    pub fn n(&self) -> usize {
        self.n
    }

    /// Runs something that uses rayon on its own, within the limits of this pool.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None if self.n == 1 => match single() {
                Some(pool) => pool.install(work),
                None => work(),
            },
            None => work(),
        }
    }

    /// Calls `task(scratch, ix)` once for each `ix` below `n_tasks`, in any order, each worker with a
    /// scratch of its own. With a single task or worker nobody is woken.
    pub fn for_each<S: Send>(
        &self,
        scratches: &mut [S],
        n_tasks: usize,
        task: impl Fn(&mut S, usize) + Sync,
    ) {
        let n_workers = self.n.min(n_tasks).min(scratches.len());
        if n_workers <= 1 {
            for ix in 0..n_tasks {
                task(&mut scratches[0], ix);
            }
            return;
        }
        let next = AtomicUsize::new(0);
        let work = |scratch: &mut S| {
            loop {
                let ix = next.fetch_add(1, Ordering::Relaxed);
                if ix >= n_tasks {
                    break;
                }
                task(scratch, ix);
            }
        };
        let base = Base(scratches.as_mut_ptr());
        // SAFETY: worker `k` is one of `n_workers`, and no two workers have the same number.
        let as_worker = |k: usize| work(unsafe { base.at(k) });
        let region = Region::open(self, n_workers, &as_worker);
        as_worker(0);
        drop(region);
    }
}

/// The scratches, of which each worker takes its own.
struct Base<S>(*mut S);

// SAFETY: a pointer does nothing by itself; `at` says what its callers owe.
unsafe impl<S: Send> Sync for Base<S> {}

impl<S> Base<S> {
    /// # Safety
    /// `k` must lie within the scratches, and nobody else may use that one meanwhile.
    #[allow(clippy::mut_from_ref)]
    unsafe fn at(&self, k: usize) -> &mut S {
        // SAFETY: said above.
        unsafe { &mut *self.0.add(k) }
    }
}

type Job = &'static (dyn Fn(usize) + Sync);

/// No job, or one that was taken back.
const IDLE: u8 = 0;
/// A job that nobody has taken up.
const PENDING: u8 = 1;
/// A job that a thread works on.
const RUNNING: u8 = 2;

/// Where a job waits for a thread of the pool to take it up.
///
/// A thread that sleeps takes tens of microseconds to wake. The caller does not wait for one that has
/// not begun by the time all tasks are done: it takes the job back.
struct Desk {
    state: AtomicU8,
    /// Whether a message to the pool is under way.
    called: AtomicBool,
    job: UnsafeCell<Option<Job>>,
}

// SAFETY: `job` is written by the caller while the state is `IDLE` and read only by the thread that turned
// `PENDING` into `RUNNING`.
unsafe impl Sync for Desk {}
// SAFETY: as above; a job is a reference to something `Sync`.
unsafe impl Send for Desk {}

impl Desk {
    fn new() -> Self {
        Desk {
            state: AtomicU8::new(IDLE),
            called: AtomicBool::new(false),
            job: UnsafeCell::new(None),
        }
    }

    fn turn(&self, from: u8, to: u8) -> bool {
        self.state
            .compare_exchange(from, to, Ordering::SeqCst, Ordering::SeqCst)
            .is_ok()
    }

    /// What a thread of the pool does.
    fn take_up(&self, k: usize) {
        self.called.store(false, Ordering::SeqCst);
        if self.turn(PENDING, RUNNING) {
            // SAFETY: this thread turned the state, so the job is written and nobody touches it; the
            // region that lent it stays open until the state is idle again.
            let job = unsafe { *self.job.get() };
            job.expect("a pending job is there")(k);
            self.state.store(IDLE, Ordering::SeqCst);
        }
    }
}

/// Jobs that are lent to the pool until this is dropped, also when the caller panics.
struct Region<'a> {
    desks: &'a [Arc<Desk>],
}

impl<'a> Region<'a> {
    fn open(workers: &'a Workers, n_workers: usize, job: &(dyn Fn(usize) + Sync)) -> Self {
        // SAFETY: the reference is used by threads that turned a desk to `RUNNING` only, and dropping
        // the region waits for those.
        let job: Job = unsafe { std::mem::transmute::<&(dyn Fn(usize) + Sync), Job>(job) };
        let region = Region {
            desks: &workers.desks[..n_workers - 1],
        };
        for (k, desk) in (1..).zip(region.desks) {
            // SAFETY: the last region left the desk idle, and nobody reads the job of an idle one.
            unsafe { *desk.job.get() = Some(job) };
            desk.state.store(PENDING, Ordering::SeqCst);
            if !desk.called.swap(true, Ordering::SeqCst) {
                let desk = Arc::clone(desk);
                match &workers.pool {
                    Some(pool) => pool.spawn(move || desk.take_up(k)),
                    None => rayon::spawn(move || desk.take_up(k)),
                }
            }
        }
        region
    }
}

impl Drop for Region<'_> {
    fn drop(&mut self) {
        for desk in self.desks {
            if desk.turn(PENDING, IDLE) {
                continue;
            }
            let mut n_looks = 0u32;
            while desk.state.load(Ordering::SeqCst) != IDLE {
                n_looks += 1;
                if n_looks < 10_000 {
                    std::hint::spin_loop();
                } else {
                    std::thread::yield_now();
                }
            }
        }
    }
}

/// One thread shared by every detector that was told to use one, so that what rayon would spread
/// (clustering) stays on one core.
fn single() -> Option<&'static rayon::ThreadPool> {
    static POOL: std::sync::OnceLock<Option<rayon::ThreadPool>> = std::sync::OnceLock::new();
    POOL.get_or_init(|| rayon::ThreadPoolBuilder::new().num_threads(1).build().ok())
        .as_ref()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_is_done_once_whoever_wakes() {
        let workers = Workers::new(3).unwrap();
        let mut scratches = vec![Vec::new(); 3];
        for round in 0..2000 {
            let n_tasks = 1 + round % 37;
            workers.for_each(&mut scratches, n_tasks, |scratch: &mut Vec<usize>, ix| {
                scratch.push(ix);
            });
            let mut done: Vec<usize> = scratches.iter_mut().flat_map(|s| s.drain(..)).collect();
            done.sort_unstable();
            assert!(done.into_iter().eq(0..n_tasks));
        }
    }

    #[test]
    fn a_panic_of_the_caller_leaves_nothing_running() {
        let workers = Workers::new(2).unwrap();
        let caller = std::thread::current().id();
        for _ in 0..50 {
            let mut scratches = [0u64; 2];
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                workers.for_each(&mut scratches, 64, |scratch, _| {
                    assert!(std::thread::current().id() != caller, "on purpose");
                    *scratch += 1;
                });
            }));
            assert!(result.is_err() || scratches.iter().sum::<u64>() == 64);
        }
    }
}
