//! The protocol between a caller and its helpers: regions of work that helpers enter and leave,
//! sleep, and waking.
//!
//! All memory that threads share unsafely is here, and nothing else: `tests/workers_model.rs` runs
//! this file under a model checker that tries the interleavings and memory orders which the
//! language allows.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::PoisonError;

use super::sync::{AtomicBool, AtomicU64, Mutex, Ordering, UnsafeCell, fence, park, pause};

/// The work of a region: all workers call it, each with its number.
pub(crate) type RegionWork<'a> = dyn Fn(usize) + Sync + 'a;

/// The state that caller and helpers share.
///
/// The gate holds whether a region is open (bit 0), how many helpers are in it (bits 1 to 31), and
/// the region's number (above). A helper enters only through an open gate. The caller closes it and
/// waits until all helpers are out, so the region's work outlives every helper in it.
pub(crate) struct Crew {
    gate: AtomicU64,
    /// Valid while the gate is open or a helper is inside.
    work: UnsafeCell<Option<*const RegionWork<'static>>>,
    /// Whether the caller is in a region.
    busy: AtomicBool,
    /// Whether helpers should end.
    quit: AtomicBool,
    /// Which helpers sleep, or are about to.
    asleep: Box<[AtomicBool]>,
    panic: Mutex<Option<Box<dyn Any + Send>>>,
}

const OPEN: u64 = 1;
const INSIDE: u64 = 2;
const INSIDE_MASK: u64 = (1 << 32) - INSIDE;
const REGION: u64 = 1 << 32;

// SAFETY: only the one caller that has set `busy` writes `work`, while the gate is closed and no
// helper is inside; only helpers that entered an open gate read it.
unsafe impl Send for Crew {}
// SAFETY: helpers only read `work`, and only inside; `busy` admits one caller, which writes it only
// while the gate is closed and no helper is inside. All other fields are `Sync`.
unsafe impl Sync for Crew {}

/// A value of the gate that a helper has seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct GateValue(u64);

impl GateValue {
    /// The number of the region that is open.
    pub fn open_region(self) -> Option<u64> {
        (self.0 & OPEN != 0).then_some(self.0 / REGION)
    }
}

impl Crew {
    pub fn new(n_helpers: usize) -> Self {
        Crew {
            gate: AtomicU64::new(0),
            work: UnsafeCell::new(None),
            busy: AtomicBool::new(false),
            quit: AtomicBool::new(false),
            asleep: (0..n_helpers).map(|_| AtomicBool::new(false)).collect(),
            panic: Mutex::new(None),
        }
    }

    /// Whether a region is open.
    pub fn is_busy(&self) -> bool {
        self.busy.load(Ordering::Relaxed)
    }

    /// Tells helpers to end. Those that sleep must be unparked.
    pub fn quit(&self) {
        self.quit.store(true, Ordering::Relaxed);
    }

    /// Whether helpers should end.
    pub fn is_over(&self) -> bool {
        self.quit.load(Ordering::Relaxed)
    }

    /// Does the work as worker 0, together with the helpers that come. Panics if one of them did.
    pub fn region(&self, work: &RegionWork<'_>) {
        if self.busy.swap(true, Ordering::Acquire) {
            // A region within a region, or of another thread: the helpers are busy.
            return work(0);
        }
        // Drop a panic that was left over when the caller's own part panicked.
        self.take_panic();
        // SAFETY: only the lifetime changes; `Closing` makes sure that all helpers are out before
        // it ends.
        let work_ptr = unsafe {
            std::mem::transmute::<*const RegionWork<'_>, *const RegionWork<'static>>(work)
        };
        // SAFETY: the gate is closed and no helper is inside; `busy` excludes other callers.
        self.work.with_mut(|slot| unsafe { *slot = Some(work_ptr) });
        let number = self.gate.load(Ordering::Relaxed) & !(REGION - 1);
        self.gate
            .store(number.wrapping_add(REGION) | OPEN, Ordering::Release);
        let closing = Closing(self);
        work(0);
        drop(closing);
        if let Some(payload) = self.take_panic() {
            resume_unwind(payload);
        }
    }

    fn take_panic(&self) -> Option<Box<dyn Any + Send>> {
        let mut panic = self.panic.lock().unwrap_or_else(PoisonError::into_inner);
        panic.take()
    }

    /// What a helper sees of the gate.
    pub fn look(&self) -> GateValue {
        GateValue(self.gate.load(Ordering::Acquire))
    }

    /// Does a helper's part of the region that it has seen to be open. False if that has changed,
    /// or for no reason.
    pub fn help(&self, seat: usize, GateValue(gate): GateValue) -> bool {
        let entered = self.gate.compare_exchange_weak(
            gate,
            gate + INSIDE,
            Ordering::Acquire,
            Ordering::Relaxed,
        );
        if entered.is_err() {
            return false;
        }
        // SAFETY: the helper is inside, so the caller waits for it and the work is alive.
        let work = self.work.with(|slot| unsafe { *slot });
        if let Some(work) = work {
            // SAFETY: the caller closes the region only when no helper is inside; until then the
            // closure and all that it borrows live.
            let run = AssertUnwindSafe(|| unsafe { (*work)(seat) });
            if let Err(payload) = catch_unwind(run) {
                *self.panic.lock().unwrap_or_else(PoisonError::into_inner) = Some(payload);
            }
        }
        self.gate.fetch_sub(INSIDE, Ordering::Release);
        true
    }

    /// Sleeps until woken, unless something has happened since the helper looked at the gate. A
    /// call that comes too early for it to be seen is lost: the region goes on without this helper.
    pub fn sleep(&self, seat: usize, GateValue(gate): GateValue) {
        self.asleep[seat - 1].store(true, Ordering::Relaxed);
        fence(Ordering::SeqCst);
        if self.gate.load(Ordering::Acquire) == gate && !self.quit.load(Ordering::Relaxed) {
            park();
        }
        self.asleep[seat - 1].store(false, Ordering::Relaxed);
    }

    /// Whether a helper sleeps, or is about to, and nobody else has been told so: the one who is
    /// told must unpark it.
    pub fn wakes(&self, seat: usize) -> bool {
        let asleep = &self.asleep[seat - 1];
        asleep.load(Ordering::Relaxed) && asleep.swap(false, Ordering::AcqRel)
    }
}

/// Closes the gate and waits until all helpers are out, even if the caller's part of the work
/// panics.
struct Closing<'a>(&'a Crew);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        let crew = self.0;
        crew.gate.fetch_and(!OPEN, Ordering::AcqRel);
        let mut looks = 0u32;
        while crew.gate.load(Ordering::Acquire) & INSIDE_MASK != 0 {
            looks = looks.wrapping_add(1);
            pause(looks);
        }
        crew.busy.store(false, Ordering::Release);
    }
}

/// How many tasks were taken from the front (low half) and from the back (high half).
pub(crate) struct Claims(AtomicU64);

impl Claims {
    pub fn new() -> Self {
        Claims(AtomicU64::new(0))
    }

    /// The next task that no worker has taken.
    pub fn next(&self, n_tasks: usize, from_front: bool) -> Option<usize> {
        const BACK: u64 = 1 << 32;
        let step = if from_front { 1 } else { BACK };
        let taken = self.0.fetch_add(step, Ordering::Relaxed);
        let (front, back) = ((taken % BACK) as usize, (taken / BACK) as usize);
        if front + back >= n_tasks {
            return None;
        }
        Some(if from_front {
            front
        } else {
            n_tasks - 1 - back
        })
    }
}
