//! Cancellation and progress on long runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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

/// The progress of a detection: `done` of `total` units of work. Units differ by stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Units done.
    pub done: u64,
    /// All units.
    pub total: u64,
}

/// Controls that a caller may attach to a detection: a token to stop it, a callback to watch it.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    cancel: Option<&'a CancelToken>,
    progress: Option<&'a (dyn Fn(Progress) + Sync)>,
}

impl<'a> Control<'a> {
    /// No controls: the detection runs to its end without callbacks.
    pub fn new() -> Self {
        Control::default()
    }

    /// Stops with [`Error::Cancelled`] soon after the token is cancelled.
    pub fn cancel(mut self, token: &'a CancelToken) -> Self {
        self.cancel = Some(token);
        self
    }

    /// Calls `callback` from time to time, from any of the threads used.
    pub fn progress(mut self, callback: &'a (dyn Fn(Progress) + Sync)) -> Self {
        self.progress = Some(callback);
        self
    }

    /// The token, if there is one.
    pub(crate) fn token(&self) -> Option<&CancelToken> {
        self.cancel
    }

    /// Called by the stages between pieces of work.
    ///
    /// # Errors
    /// Cancellation.
    #[doc(hidden)]
    pub fn step(&self, done: u64, total: u64) -> Result<(), Error> {
        if self.cancel.is_some_and(CancelToken::is_cancelled) {
            return Err(Error::Cancelled);
        }
        if let Some(callback) = self.progress {
            callback(Progress { done, total });
        }
        Ok(())
    }
}
