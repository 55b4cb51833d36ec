//! Where helpers run: not on the caller's core, while there is another.
//!
//! A helper that is woken on the core of the busy thread that wakes it runs when that thread is through, which is too
//! late; and two that both run on a core are not soon moved apart. (Linux wakes threads there when it thinks that the other
//! cores are busy, and one of two cores is enough for that: on the machine of the records every second
//! burst of frames began so, with 1.0 ms a frame in place of 0.55.) So helpers are told to keep off the core that the caller
//! is on: one look at its number a region, and a request a helper when it has changed.
//!
//! Where there is no such request, or it fails, or helpers are many (then a core is free for them), they run where the
//! system lets them.

#[cfg(target_os = "linux")]
pub(super) use linux::Places;
#[cfg(not(target_os = "linux"))]
pub(super) use other::Places;

#[cfg(target_os = "linux")]
mod linux {
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use rustix::thread::{CpuSet, Pid, gettid, sched_getaffinity, sched_getcpu, sched_setaffinity};

    /// The core of the caller, and who its helpers are.
    pub(crate) struct Places {
        caller: AtomicUsize,
        helpers: Box<[OnceLock<Helper>]>,
        /// Whose threads they are: a process that was forked has none of them.
        process: u32,
    }

    struct Helper {
        thread: Pid,
        /// Where it may run by itself.
        cores: CpuSet,
    }

    const UNKNOWN: usize = usize::MAX;
    /// Helpers from which on they are left alone.
    const MANY: usize = 8;

    impl Places {
        pub fn new(n_helpers: usize) -> Self {
            let n = if n_helpers < MANY { n_helpers } else { 0 };
            Places {
                caller: AtomicUsize::new(UNKNOWN),
                helpers: (0..n).map(|_| OnceLock::new()).collect(),
                process: std::process::id(),
            }
        }

        /// To be called by the caller before it calls helpers.
        pub fn caller_is_here(&self) {
            if self.helpers.is_empty() {
                return;
            }
            let core = sched_getcpu();
            if self.caller.swap(core, Ordering::SeqCst) == core
                || self.process != std::process::id()
            {
                return;
            }
            for helper in self.helpers.iter().filter_map(OnceLock::get) {
                helper.keep_off(core);
            }
        }

        /// To be called by a helper when it starts.
        pub fn helper_is_here(&self, seat: usize) {
            let Some(place) = self.helpers.get(seat - 1) else {
                return;
            };
            let Ok(cores) = sched_getaffinity(None) else {
                return;
            };
            let helper = place.get_or_init(|| Helper {
                thread: gettid(),
                cores,
            });
            // The caller sees the helper from here on; what it said before is looked up, until it has not changed.
            let mut core = UNKNOWN;
            loop {
                let now = self.caller.load(Ordering::SeqCst);
                if now == core {
                    return;
                }
                core = now;
                helper.keep_off(core);
            }
        }
    }

    impl Helper {
        /// Lets it run where it may but for one core, unless that is the only one.
        fn keep_off(&self, core: usize) {
            let mut cores = self.cores;
            if core < CpuSet::MAX_CPU {
                cores.unset(core);
            }
            if cores.count() > 0 {
                // A system that refuses has its reasons; the answer is the same.
                let _ = sched_setaffinity(Some(self.thread), &cores);
            }
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use std::sync::mpsc;

        #[test]
        fn helpers_keep_off_the_callers_core() {
            let allowed = sched_getaffinity(None).expect("has a set of cores");
            let places = Places::new(1);
            places.caller_is_here();
            let (started, is_started) = mpsc::channel();
            let (end, ended) = mpsc::channel::<()>();
            std::thread::scope(|scope| {
                let places = &places;
                scope.spawn(move || {
                    places.helper_is_here(1);
                    started.send(()).expect("somebody waits");
                    let _ = ended.recv();
                });
                is_started.recv().expect("it starts");
                let helper = places.helpers[0].get().expect("it has said so").thread;
                for _ in 0..2 {
                    let core = places.caller.load(Ordering::SeqCst);
                    let cores = sched_getaffinity(Some(helper)).expect("it lives");
                    assert_eq!(cores.is_set(core), allowed.count() == 1);
                    let mut others = (0..CpuSet::MAX_CPU).filter(|&other| other != core);
                    assert!(others.all(|other| cores.is_set(other) == allowed.is_set(other)));
                    // As if the caller had come from elsewhere.
                    places.caller.store(UNKNOWN - 1, Ordering::SeqCst);
                    places.caller_is_here();
                }
                drop(end);
            });
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod other {
    /// Nothing is known of cores.
    pub(crate) struct Places;

    impl Places {
        pub fn new(_: usize) -> Self {
            Places
        }

        pub fn caller_is_here(&self) {}

        pub fn helper_is_here(&self, _: usize) {}
    }
}
