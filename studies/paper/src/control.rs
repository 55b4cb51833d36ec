//! Cancellation and progress of a run.

use impinge::CancelToken;

use crate::error::Error;

/// The progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// The benchmark that is running.
    pub what: &'a str,
    /// How many of its frames are done.
    pub done: usize,
    /// The total number of its frames.
    pub total: usize,
}

/// Cancellation and progress of a run.
pub struct Control<'a> {
    /// Stops the run soon after it is cancelled.
    pub cancel: &'a CancelToken,
    /// Called after each frame.
    pub progress: &'a dyn Fn(Progress<'_>),
}

impl Control<'_> {
    /// Fails if a stop was requested.
    pub(crate) fn go_on(&self) -> Result<(), Error> {
        match self.cancel.is_cancelled() {
            true => Err(impinge::Error::Cancelled.into()),
            false => Ok(()),
        }
    }

    pub(crate) fn report(&self, what: &str, done: usize, total: usize) {
        (self.progress)(Progress { what, done, total });
    }
}
