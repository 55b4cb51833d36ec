//! Many meshes, each checked in a child process.
//!
//! A child answers one mesh after the other ([`serve`](crate::serve)). A child that takes too long
//! is killed. If a child ends by itself, its current mesh is tried once more in a child of its own,
//! so that the row does not depend on the meshes that the first child checked before. A mesh that
//! fails gets a row of kind `timeout`, `memory` or `crash`.

mod child;

use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use impinge::CancelToken;

use self::child::{Answer, Child};
use crate::row::{ErrorKind, Row};
use crate::worker::question;

/// Checks meshes in child processes, several at a time.
pub struct Pool<'a> {
    /// The command of a child, which must call [`apply_limits`](crate::apply_limits) and
    /// [`serve`](crate::serve).
    pub command: &'a (dyn Fn() -> Command + Sync),
    /// How many children run at a time; at least 1.
    pub jobs: usize,
    /// How long one mesh may take; `None` for no limit.
    pub timeout: Option<Duration>,
    /// Whether the children weld; needed for rows that no child wrote.
    pub weld: bool,
}

/// Why a run stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoolError {
    /// No child process could be started. Check the limits on processes and memory.
    #[error("cannot start a child process: {0}")]
    Start(#[source] io::Error),
    /// The caller cancelled the run.
    #[error("cancelled")]
    Cancelled,
}

impl Pool<'_> {
    /// Checks `paths` and passes each row, with the number of its path, to `done`, in the order in
    /// which they are finished.
    ///
    /// # Errors
    /// A child that can't be started; cancellation. Rows passed before that are valid.
    pub fn run(
        &self,
        paths: &[PathBuf],
        cancel: &CancelToken,
        mut done: impl FnMut(usize, Row),
    ) -> Result<(), PoolError> {
        let next = AtomicUsize::new(0);
        let (sender, rows) = mpsc::channel();
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..self.jobs.clamp(1, paths.len().max(1)))
                .map(|_| {
                    let (sender, next) = (sender.clone(), &next);
                    scope.spawn(move || self.work(paths, next, cancel, &sender))
                })
                .collect();
            drop(sender);
            for (ix, row) in rows {
                done(ix, row);
            }
            let mut result = Ok(());
            for worker in workers {
                let ended = worker
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                result = result.and(ended);
            }
            result
        })
    }

    /// The work of one thread: takes the next mesh until there is none left.
    fn work(
        &self,
        paths: &[PathBuf],
        next: &AtomicUsize,
        cancel: &CancelToken,
        rows: &mpsc::Sender<(usize, Row)>,
    ) -> Result<(), PoolError> {
        let mut child = None;
        loop {
            let ix = next.fetch_add(1, Ordering::Relaxed);
            let Some(path) = paths.get(ix) else {
                return Ok(());
            };
            let row = match self.check(path, &mut child, cancel) {
                Ok(row) => row,
                Err(error) => {
                    // The other threads stop as well.
                    next.store(paths.len(), Ordering::Relaxed);
                    return Err(error);
                }
            };
            if rows.send((ix, row)).is_err() {
                return Ok(());
            }
        }
    }

    fn check(
        &self,
        path: &Path,
        held: &mut Option<Child>,
        cancel: &CancelToken,
    ) -> Result<Row, PoolError> {
        let name = path.display().to_string();
        let failed = |kind, message: &str| Row::failed(&name, self.weld, kind, message);
        let Some(question) = question(path) else {
            return Ok(failed(ErrorKind::File, "the path is not Unicode"));
        };
        loop {
            let (mut child, is_fresh) = match held.take() {
                Some(child) => (child, false),
                None => (
                    Child::start((self.command)()).map_err(PoolError::Start)?,
                    true,
                ),
            };
            match child.ask(&question, &name, self.timeout, cancel) {
                Answer::Row(row) => {
                    // A child that has worked before may have less memory left than a fresh one.
                    let is_short = matches!(&row.result, Err(why) if why.kind.may_pass());
                    if is_short && !is_fresh {
                        continue;
                    }
                    if !is_short {
                        *held = Some(child);
                    }
                    return Ok(*row);
                }
                Answer::Cancelled => return Err(PoolError::Cancelled),
                Answer::TooLate => {
                    let seconds = self.timeout.unwrap_or_default().as_secs_f64();
                    let message = format!("took longer than {seconds} s");
                    return Ok(failed(ErrorKind::Timeout, &message));
                }
                Answer::Ended { .. } if !is_fresh => {}
                Answer::Ended { kind, message } => return Ok(failed(kind, &message)),
            }
        }
    }
}
