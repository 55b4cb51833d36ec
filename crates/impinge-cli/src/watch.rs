//! Progress bars, and whether to go on.

use std::io::{IsTerminal, stderr, stdout};
use std::time::{Duration, Instant};

use impinge::{CancelToken, Progress};
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::Error;

/// A detection that is done sooner than this shows no bar.
const PATIENCE: Duration = Duration::from_millis(500);

/// Fails where somebody has asked to stop: for the time between detections.
pub fn go_on(cancel: &CancelToken) -> Result<(), Error> {
    if cancel.is_cancelled() {
        return Err(impinge::Error::Cancelled.into());
    }
    Ok(())
}

/// A progress bar on standard error, if that is a terminal and a bar is wanted.
pub struct Watch {
    bar: Option<ProgressBar>,
    started: Instant,
}

impl Watch {
    /// Watches one detection through [`report`](Watch::report).
    pub fn detection(wanted: bool, what: &'static str) -> Self {
        Watch::new(wanted, 0, "{msg} {wide_bar} {percent:>3} % {eta:>4}", what)
    }

    /// Watches `n_frames` frames through [`frame_done`](Watch::frame_done). No bar is shown where the
    /// frames themselves are printed on the terminal, `prints_frames`.
    pub fn frames(wanted: bool, n_frames: usize, prints_frames: bool) -> Self {
        let wanted = wanted && !(prints_frames && stdout().is_terminal());
        Watch::new(
            wanted,
            n_frames as u64,
            "{msg} {wide_bar} {pos}/{len} {eta:>4}",
            "frames",
        )
    }

    /// Watches `n` things of a kind through [`frame_done`](Watch::frame_done). No bar is shown where rows are printed on
    /// the terminal, `prints_rows`.
    pub fn things(wanted: bool, n: usize, what: &'static str, prints_rows: bool) -> Self {
        let wanted = wanted && !(prints_rows && stdout().is_terminal());
        let template = "{msg} {wide_bar} {pos}/{len} {eta:>4}";
        Watch::new(wanted, n as u64, template, what)
    }

    fn new(wanted: bool, length: u64, template: &str, what: &'static str) -> Self {
        let bar = (wanted && stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template(template)
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(length)
                .with_style(style)
                .with_message(what)
        });
        Watch {
            bar,
            started: Instant::now(),
        }
    }

    /// Whether anything is shown; where not, nobody need report.
    pub fn is_shown(&self) -> bool {
        self.bar.is_some()
    }

    /// Shows how far a detection has come, once it has taken a while.
    pub fn report(&self, progress: Progress) {
        if let Some(bar) = &self.bar
            && self.started.elapsed() >= PATIENCE
        {
            bar.set_length(progress.total);
            bar.set_position(progress.done);
        }
    }

    /// One frame more is done.
    pub fn frame_done(&self) {
        if let Some(bar) = &self.bar {
            bar.inc(1);
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
