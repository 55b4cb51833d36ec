//! What the crew needs of the standard library. The model checker of `tests/workers_model.rs` puts
//! its own in its place.

pub(super) use std::sync::Mutex;
pub(super) use std::sync::atomic::{AtomicBool, AtomicU64, Ordering, fence};
pub(super) use std::thread::park;

/// [`std::cell::UnsafeCell`] with access by closures.
#[derive(Debug)]
pub(super) struct UnsafeCell<T>(std::cell::UnsafeCell<T>);

impl<T> UnsafeCell<T> {
    pub fn new(value: T) -> Self {
        UnsafeCell(std::cell::UnsafeCell::new(value))
    }

    pub fn with<R>(&self, read: impl FnOnce(*const T) -> R) -> R {
        read(self.0.get())
    }

    pub fn with_mut<R>(&self, write: impl FnOnce(*mut T) -> R) -> R {
        write(self.0.get())
    }
}

/// Waits for another thread for a moment; `looks` says how often this one has looked already.
pub(super) fn pause(looks: u32) {
    /// Looks before the thread gives way to others.
    const MANY: u32 = 4096;
    if looks >= MANY && looks.is_multiple_of(MANY) {
        std::thread::yield_now();
    }
    std::hint::spin_loop();
}
