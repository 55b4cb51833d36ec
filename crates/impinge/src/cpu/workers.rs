//! Threads: the caller works too, the others come from a rayon pool.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::error::Error;

/// How many workers there are and where they come from.
pub struct Workers {
    /// `None` for the global pool.
    pool: Option<rayon::ThreadPool>,
    n: usize,
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
        Ok(Workers { pool, n })
    }

    /// How many there are.
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
        let (own, others) = scratches[..n_workers]
            .split_first_mut()
            .expect("at least two workers");
        let work = &work;
        match &self.pool {
            Some(pool) => pool.in_place_scope(|scope| region(scope, own, others, work)),
            None => rayon::in_place_scope(|scope| region(scope, own, others, work)),
        }
    }
}

/// The others work beside the caller.
fn region<'scope, S: Send>(
    scope: &rayon::Scope<'scope>,
    own: &mut S,
    others: &'scope mut [S],
    work: &'scope (impl Fn(&mut S) + Sync),
) {
    for scratch in others {
        scope.spawn(move |_| work(scratch));
    }
    work(own);
}

/// One thread shared by every detector that was told to use one, so that what rayon would spread
/// (clustering) stays on one core.
fn single() -> Option<&'static rayon::ThreadPool> {
    static POOL: std::sync::OnceLock<Option<rayon::ThreadPool>> = std::sync::OnceLock::new();
    POOL.get_or_init(|| rayon::ThreadPoolBuilder::new().num_threads(1).build().ok())
        .as_ref()
}
