//! Where helpers run: not on the caller's core, if there is another, unless users place threads
//! themselves.
//!
//! A helper that wakes on the core of the busy caller runs only when the caller is done, which is
//! too late, and the system does not soon move one of two busy threads to another core. (Linux
//! wakes threads on the caller's core when it thinks that the other cores are busy, and one busy
//! core of two is enough for that: on the machine of the records every second burst of frames began
//! so, with 1.0 ms per frame instead of 0.55.) So helpers are kept off the caller's core: the
//! core's number is read once per region, and if it has changed there is one system call per
//! helper.
//!
//! Helpers run where the system puts them with [`Affinity::Inherited`], if there is no such call,
//! if the call fails, or if there are many helpers, for whom a core is free then.

use crate::scene::words::words;

#[cfg(target_os = "linux")]
pub(super) use linux::HelperCores;
#[cfg(not(target_os = "linux"))]
pub(super) use other::HelperCores;

/// Which cores the helper threads of the CPU backend may run on. The answer does not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Affinity {
    /// On Linux, with up to 8 threads: every core that the helper was started with, except the one
    /// on which the calling thread is running. Otherwise as `Inherited`.
    ///
    /// The system often wakes a helper on the caller's core, where it runs only after the caller is
    /// done. A frame then takes as long as with fewer threads.
    Auto,
    /// Those that the system chooses: no thread's affinity is ever set. A helper starts with the
    /// affinity of the thread that asked the first question.
    ///
    /// For programs that place threads themselves: ranks of MPI, real-time threads, containers
    /// whose cores are changed while they run, `taskset` on a running process. `Auto` would
    /// overwrite what they set for a helper.
    #[default]
    Inherited,
}

words!("affinity", "auto or inherited", Affinity: [Auto = "auto", Inherited = "inherited"; 2]);

#[cfg(target_os = "linux")]
mod linux {
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use crate::workers::affinity::Affinity;
    use rustix::thread::{CpuSet, Pid, gettid, sched_getaffinity, sched_getcpu, sched_setaffinity};

    /// The caller's core, and the helpers' threads.
    pub(crate) struct HelperCores {
        caller: AtomicUsize,
        helpers: Box<[OnceLock<Helper>]>,
        /// The process of the threads: a forked process has none of them.
        process: u32,
    }

    struct Helper {
        thread: Pid,
        /// The cores on which it may run.
        cores: CpuSet,
    }

    const UNKNOWN: usize = usize::MAX;
    /// From this many helpers on, they are left alone.
    const MANY: usize = 8;

    impl HelperCores {
        pub fn new(n_helpers: usize, affinity: Affinity) -> Self {
            let n = match affinity {
                Affinity::Auto if n_helpers < MANY => n_helpers,
                _ => 0,
            };
            HelperCores {
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
            // From here on the caller sees the helper. Apply the caller's core until it has not
            // changed meanwhile.
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
        /// Excludes one core from those on which the helper may run, unless it is the only one.
        fn keep_off(&self, core: usize) {
            let mut cores = self.cores;
            if core < CpuSet::MAX_CPU {
                cores.unset(core);
            }
            if cores.count() > 0 {
                // If the system refuses, only speed suffers.
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
            let helper_cores = HelperCores::new(1, Affinity::Auto);
            helper_cores.caller_is_here();
            let (started, is_started) = mpsc::channel();
            let (end, ended) = mpsc::channel::<()>();
            std::thread::scope(|scope| {
                let helper_cores = &helper_cores;
                scope.spawn(move || {
                    helper_cores.helper_is_here(1);
                    started.send(()).expect("somebody waits");
                    let _ = ended.recv();
                });
                is_started.recv().expect("it starts");
                let helper = helper_cores.helpers[0]
                    .get()
                    .expect("it has said so")
                    .thread;
                for _ in 0..2 {
                    let core = helper_cores.caller.load(Ordering::SeqCst);
                    let cores = sched_getaffinity(Some(helper)).expect("it lives");
                    assert_eq!(cores.is_set(core), allowed.count() == 1);
                    let mut others = (0..CpuSet::MAX_CPU).filter(|&other| other != core);
                    assert!(others.all(|other| cores.is_set(other) == allowed.is_set(other)));
                    // As if the caller had moved from another core.
                    helper_cores.caller.store(UNKNOWN - 1, Ordering::SeqCst);
                    helper_cores.caller_is_here();
                }
                drop(end);
            });
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod other {
    use crate::workers::affinity::Affinity;

    /// Does nothing: cores are not known.
    pub(crate) struct HelperCores;

    impl HelperCores {
        pub fn new(_: usize, _: Affinity) -> Self {
            HelperCores
        }

        pub fn caller_is_here(&self) {}

        pub fn helper_is_here(&self, _: usize) {}
    }
}
