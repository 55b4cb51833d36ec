//! Progress bars, and cancellation between detections.

use std::io::{IsTerminal, stderr, stdout};
use std::time::{Duration, Instant};

use impinge::{CancelToken, Control, Progress};
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::Error;

/// A detection that takes less time than this shows no bar.
const PATIENCE: Duration = Duration::from_millis(500);

/// Fails if a stop was requested; for use between detections.
pub fn go_on(cancel: &CancelToken) -> Result<(), Error> {
    if cancel.is_cancelled() {
        return Err(impinge::Error::Cancelled.into());
    }
    Ok(())
}

/// A progress bar on standard error, if that is a terminal and a bar is requested.
pub struct Watch {
    bar: Option<ProgressBar>,
    started: Instant,
}

impl Watch {
    /// Watches one detection through [`report`](Watch::report).
    pub fn detection(wanted: bool, what: &'static str) -> Self {
        Watch::new(wanted, 0, "{msg} {wide_bar} {percent:>3} % {eta:>4}", what)
    }

    /// Watches `n_frames` frames through [`frame_done`](Watch::frame_done). No bar is shown if the
    /// frames themselves are printed on the terminal (`prints_frames`).
    pub fn frames(wanted: bool, n_frames: usize, prints_frames: bool) -> Self {
        let wanted = wanted && !(prints_frames && stdout().is_terminal());
        Watch::new(
            wanted,
            n_frames as u64,
            "{msg} {wide_bar} {pos}/{len} {eta:>4}",
            "frames",
        )
    }

    /// Watches `n` items through [`frame_done`](Watch::frame_done). No bar is shown if rows are
    /// printed on the terminal (`prints_rows`).
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

    /// Stops a detector's questions with the token, and shows their progress.
    pub fn control(&self, cancel: &CancelToken) -> Control {
        let control = Control::new().cancel(cancel);
        match self.bar.clone() {
            None => control,
            Some(bar) => {
                let started = self.started;
                control.progress(move |progress| report(&bar, started, progress))
            }
        }
    }

    /// Shows the progress of a detection, once it has taken a while.
    pub fn report(&self, progress: Progress) {
        if let Some(bar) = &self.bar {
            report(bar, self.started, progress);
        }
    }

    /// Counts one more frame as done.
    pub fn frame_done(&self) {
        if let Some(bar) = &self.bar {
            bar.inc(1);
        }
    }
}

fn report(bar: &ProgressBar, started: Instant, progress: Progress) {
    if started.elapsed() >= PATIENCE {
        bar.set_length(progress.total);
        bar.set_position(progress.done);
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
