//! Whether work that rayon could share is done by the thread at hand.
//!
//! A detector with one worker, and one in a forked process that has none of the parent's threads,
//! must not go to a pool of rayon. So loops that may ask [`is_alone`] first.

use std::cell::Cell;

thread_local! {
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Does some work on this thread, and none of it on another one.
pub(crate) fn alone<T>(work: impl FnOnce() -> T) -> T {
    /// Ends even if the work panics.
    struct End(bool);
    impl Drop for End {
        fn drop(&mut self) {
            IS_ALONE.set(self.0);
        }
    }
    let _end = End(IS_ALONE.replace(true));
    work()
}

/// Whether no other thread may help.
pub(crate) fn is_alone() -> bool {
    cfg!(target_family = "wasm") || IS_ALONE.get()
}
