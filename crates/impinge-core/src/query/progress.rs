//! Cancellation and progress on long runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::scene::error::Error;

/// A flag that stops a running detection from another thread or a signal handler.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// Creates a token that is not cancelled.
    pub fn new() -> Self {
        CancelToken::default()
    }

    /// Makes every detection with this token stop soon with [`Error::Cancelled`].
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the token was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The progress of a detection: `done` of `total` units of work. Units differ by stage, and each
/// stage begins with 0. Where several threads report, one may be a few units late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Units done.
    pub done: u64,
    /// All units; at least 1.
    pub total: u64,
}

/// What a caller holds over a detector's questions: a token to stop them, a callback to watch them.
/// See [`Detector::set_control`](crate::Detector::set_control).
#[derive(Clone, Default)]
#[must_use]
pub struct Control {
    cancel: Option<CancelToken>,
    progress: Option<Arc<Callback>>,
}

type Callback = dyn Fn(Progress) + Send + Sync;

impl Control {
    /// No controls: questions run to their end without callbacks.
    pub fn new() -> Self {
        Control::default()
    }

    /// Stops with [`Error::Cancelled`] soon after the token is cancelled.
    pub fn cancel(mut self, token: &CancelToken) -> Self {
        self.cancel = Some(token.clone());
        self
    }

    /// Calls `each` from time to time, from any of the threads used.
    pub fn progress(mut self, each: impl Fn(Progress) + Send + Sync + 'static) -> Self {
        self.progress = Some(Arc::new(each));
        self
    }

    /// The token, if there is one.
    pub(crate) fn token(&self) -> Option<&CancelToken> {
        self.cancel.as_ref()
    }

    /// Called by the stages between pieces of work.
    ///
    /// # Errors
    /// Cancellation.
    #[doc(hidden)]
    pub fn step(&self, done: u64, total: u64) -> Result<(), Error> {
        if self.cancel.as_ref().is_some_and(CancelToken::is_cancelled) {
            return Err(Error::Cancelled);
        }
        match &self.progress {
            Some(callback) if total > 0 => callback(Progress { done, total }),
            _ => {}
        }
        Ok(())
    }
}

/// Pieces of work that several threads take, in any order.
pub(crate) struct Pieces<'a> {
    control: &'a Control,
    n_taken: AtomicU64,
    n: u64,
}

impl<'a> Pieces<'a> {
    pub fn new(control: &'a Control, n: usize) -> Self {
        Pieces {
            control,
            n_taken: AtomicU64::new(0),
            n: n as u64,
        }
    }

    /// Called before each.
    ///
    /// # Errors
    /// Cancellation.
    pub fn take(&self) -> Result<(), Error> {
        let n_taken = self.n_taken.fetch_add(1, Ordering::Relaxed);
        self.control.step(n_taken, self.n)
    }

    /// Called after all.
    ///
    /// # Errors
    /// Cancellation.
    pub fn end(&self) -> Result<(), Error> {
        self.control.step(self.n, self.n)
    }
}

impl std::fmt::Debug for Control {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Control");
        short.field("cancel", &self.cancel);
        short.field("progress", &self.progress.is_some());
        short.finish()
    }
}
