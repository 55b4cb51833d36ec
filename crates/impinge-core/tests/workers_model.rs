//! The protocol of caller and helpers under loom, which tries the interleavings of threads and the
//! values that the memory model lets them read: no helper sees work that has ended, no task is done
//! twice or left out, nobody sleeps for ever.

mod sync {
    pub(crate) use loom::cell::UnsafeCell;
    pub(crate) use loom::sync::Mutex;
    pub(crate) use loom::sync::atomic::{AtomicBool, AtomicU64, Ordering, fence};
    pub(crate) use loom::thread::park;

    pub(crate) fn pause(_looks: u32) {
        loom::thread::yield_now();
    }
}

#[path = "../src/workers/crew.rs"]
#[allow(dead_code, reason = "the library calls what is not called here")]
mod crew;

use std::sync::atomic::{AtomicUsize, Ordering};

use loom::cell::UnsafeCell;
use loom::sync::Arc;
use loom::thread::{self, JoinHandle};

use crew::{Claims, Crew};

/// Interleavings with more forced changes of thread than this are not tried.
const CHANGES: usize = 3;

fn model(check: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(CHANGES);
    builder.check(check);
}

/// A helper that sleeps whenever there is nothing to do.
fn helper(crew: &Arc<Crew>, seat: usize) -> JoinHandle<()> {
    let crew = Arc::clone(crew);
    thread::spawn(move || {
        let mut last_region = 0;
        while !crew.is_over() {
            let seen = crew.look();
            match seen.open_region() {
                Some(region) if region != last_region => {
                    if crew.help(seat, seen) {
                        last_region = region;
                    }
                }
                _ => crew.sleep(seat, seen),
            }
            thread::yield_now();
        }
    })
}

fn end(crew: &Crew, helpers: Vec<JoinHandle<()>>) {
    crew.quit();
    for helper in helpers {
        helper.thread().unpark();
        helper.join().expect("a helper never panics");
    }
}

/// Memory of a region that is gone when the region is: loom notices whoever looks at it later, and
/// two who write.
struct Task {
    done: UnsafeCell<u32>,
}

fn region(crew: &Crew, n_tasks: usize) {
    let tasks: Vec<Task> = (0..n_tasks)
        .map(|_| Task {
            done: UnsafeCell::new(0),
        })
        .collect();
    let tasks = Tasks(tasks);
    let claims = Claims::new();
    crew.region(&|worker| {
        while let Some(ix) = claims.next(n_tasks, worker == 0) {
            tasks.work(ix);
        }
    });
    for ix in 0..n_tasks {
        // SAFETY: a read; loom fails where another thread may still write.
        let done = tasks.0[ix].done.with(|done| unsafe { *done });
        assert_eq!(done, 1, "task {ix}");
    }
}

struct Tasks(Vec<Task>);

// SAFETY: loom's cells notice what is not synchronised, which is what is tested.
unsafe impl Sync for Tasks {}

impl Tasks {
    fn work(&self, ix: usize) {
        // SAFETY: loom fails where another thread may touch it.
        self.0[ix].done.with_mut(|done| unsafe { *done += 1 });
    }
}

#[test]
fn work_is_done_once_and_has_ended_when_the_region_has() {
    model(|| {
        let crew = Arc::new(Crew::new(1));
        let helpers = vec![helper(&crew, 1)];
        for _ in 0..2 {
            if crew.wakes(1) {
                helpers[0].thread().unpark();
            }
            region(&crew, 2);
        }
        end(&crew, helpers);
    });
}

#[test]
fn two_helpers_and_a_caller_share_the_tasks() {
    model(|| {
        let crew = Arc::new(Crew::new(2));
        let helpers: Vec<_> = (1..=2).map(|seat| helper(&crew, seat)).collect();
        region(&crew, 2);
        end(&crew, helpers);
    });
}

#[test]
fn another_caller_meanwhile_works_alone() {
    model(|| {
        let crew = Arc::new(Crew::new(1));
        let other = {
            let crew = Arc::clone(&crew);
            thread::spawn(move || region(&crew, 1))
        };
        region(&crew, 1);
        other.join().expect("the other caller");
    });
}

#[test]
fn a_helper_that_was_told_to_end_ends() {
    // Nothing is done: whether the helper looks, is about to sleep or sleeps, it must end.
    let runs = std::sync::Arc::new(AtomicUsize::new(0));
    let counted = runs.clone();
    model(move || {
        counted.fetch_add(1, Ordering::Relaxed);
        let crew = Arc::new(Crew::new(1));
        let helpers = vec![helper(&crew, 1)];
        end(&crew, helpers);
    });
    assert!(runs.load(Ordering::Relaxed) > 1, "interleavings were tried");
}
