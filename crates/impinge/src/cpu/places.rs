//! Where helpers run: not on the caller's core, while there is another.
//!
//! A helper that is woken on the core of the busy thread that wakes it runs when that thread is through, which is too
//! late; and two that both run on a core are not soon moved apart. (Linux wakes threads there when it thinks that the other
//! cores are busy, and one of two cores is enough for that: on the machine of the records every second
//! burst of frames began so, with 1.0 ms a frame in place of 0.55.) So helpers are told to keep off the core that the caller
//! is on, anew when it has changed. It costs the caller one look at its core's number a region.
//!
//! Where the system has no such request, or refuses it, helpers run wherever it lets them.

#[cfg(target_os = "linux")]
pub(super) use linux::Places;
#[cfg(not(target_os = "linux"))]
pub(super) use other::Places;

#[cfg(target_os = "linux")]
mod linux {
    use std::sync::atomic::{AtomicI32, AtomicUsize, Ordering};

    use rustix::thread::{CpuSet, Pid, gettid, sched_getaffinity, sched_getcpu, sched_setaffinity};

    /// The core of the caller, and who its helpers are.
    pub(crate) struct Places {
        caller: AtomicUsize,
        /// Thread ids; 0 before a helper has started.
        helpers: Box<[AtomicI32]>,
    }

    const UNKNOWN: usize = usize::MAX;

    impl Places {
        pub fn new(n_helpers: usize) -> Self {
            Places {
                caller: AtomicUsize::new(UNKNOWN),
                helpers: (0..n_helpers).map(|_| AtomicI32::new(0)).collect(),
            }
        }

        /// To be called by the caller before it calls helpers.
        pub fn caller_is_here(&self) {
            let core = sched_getcpu();
            // Of a caller that moves and a helper that starts, one sees the other.
            if self.caller.swap(core, Ordering::SeqCst) == core {
                return;
            }
            for helper in &self.helpers {
                if let Some(helper) = Pid::from_raw(helper.load(Ordering::SeqCst)) {
                    keep_off(helper, core);
                }
            }
        }

        /// To be called by a helper when it starts.
        pub fn helper_is_here(&self, seat: usize) {
            let helper = gettid();
            self.helpers[seat - 1].store(Pid::as_raw(Some(helper)), Ordering::SeqCst);
            let core = self.caller.load(Ordering::SeqCst);
            if core != UNKNOWN {
                keep_off(helper, core);
            }
        }
    }

    /// Lets a thread run on all cores that this thread may run on, but one; if that is the only one, wherever it did.
    fn keep_off(thread: Pid, core: usize) {
        let Ok(mut cores) = sched_getaffinity(None) else {
            return;
        };
        if core < CpuSet::MAX_CPU {
            cores.unset(core);
        }
        if cores.count() > 0 {
            // A system that refuses has its reasons; the answer is the same.
            let _ = sched_setaffinity(Some(thread), &cores);
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
                let helper = Pid::from_raw(places.helpers[0].load(Ordering::SeqCst));
                let may_run_on = |core| {
                    let cores = sched_getaffinity(helper).expect("it lives");
                    cores.is_set(core)
                };
                for _ in 0..2 {
                    let core = places.caller.load(Ordering::SeqCst);
                    assert_eq!(may_run_on(core), allowed.count() == 1);
                    let others = (0..CpuSet::MAX_CPU).filter(|&other| other != core);
                    assert!(
                        others
                            .into_iter()
                            .all(|core| may_run_on(core) == allowed.is_set(core))
                    );
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
