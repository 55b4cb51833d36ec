//! Stopping a run, and watching it.

use impinge::CancelToken;

use crate::error::Error;

/// How far a run has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// The benchmark that is running.
    pub what: &'a str,
    /// Frames of it that are done.
    pub done: usize,
    /// Its frames in all.
    pub total: usize,
}

/// Who may stop a run, and who watches it.
pub struct Control<'a> {
    /// Stops the run soon after it is cancelled.
    pub cancel: &'a CancelToken,
    /// Called after each frame.
    pub progress: &'a dyn Fn(Progress<'_>),
}

impl Control<'_> {
    /// Fails where somebody has asked to stop.
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
