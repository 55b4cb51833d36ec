//! Watching a running detection: Ctrl-C, progress, cancellation from another thread.
//!
//! The detection runs on the thread that called it, with the interpreter released, and steps by
//! here between pieces of its work. Now and then the calling thread takes the interpreter back for
//! a moment, lets Python look at its signals and calls the progress callback; an exception that
//! comes of it stops the detection and is raised. Python delivers signals to the main thread
//! alone, so nothing is gained by looking from a worker.

use std::sync::Mutex;
use std::thread::ThreadId;
use std::time::{Duration, Instant};

use impinge::Progress;
use pyo3::prelude::*;

/// A flag that stops a running detection from another thread.
///
/// Hand it to `Detector.detect` as ``cancel=token``. After ``token.cancel()`` that detection, and
/// every later one with this token, ends soon with `Cancelled`.
#[pyclass(module = "impinge", frozen)]
#[derive(Default)]
pub struct CancelToken {
    pub inner: impinge::CancelToken,
}

#[pymethods]
impl CancelToken {
    #[new]
    fn new() -> Self {
        CancelToken::default()
    }

    /// Asks every detection that holds this token to stop soon.
    fn cancel(&self) {
        self.inner.cancel();
    }

    /// bool : whether somebody asked.
    #[getter]
    fn is_cancelled(&self) -> bool {
        self.inner.is_cancelled()
    }
}

/// How often Python gets a look.
const INTERVAL: Duration = Duration::from_millis(50);

/// What watches one detection.
pub struct Watch {
    caller: ThreadId,
    progress: Option<Py<PyAny>>,
    /// Stopped by whatever happens here.
    pub stop: impinge::CancelToken,
    /// The user's own token.
    cancel: Option<impinge::CancelToken>,
    state: Mutex<State>,
}

struct State {
    looked: Instant,
    raised: Option<PyErr>,
}

impl Watch {
    /// For a detection that runs on this thread from now on.
    pub fn new(progress: Option<Py<PyAny>>, cancel: Option<impinge::CancelToken>) -> Self {
        let stop = impinge::CancelToken::new();
        // A question may look only once.
        if cancel
            .as_ref()
            .is_some_and(impinge::CancelToken::is_cancelled)
        {
            stop.cancel();
        }
        Watch {
            caller: std::thread::current().id(),
            progress,
            stop,
            cancel,
            state: Mutex::new(State {
                looked: Instant::now(),
                raised: None,
            }),
        }
    }

    /// Called by the detection, from any of its threads, without the interpreter.
    pub fn step(&self, at: Progress) {
        if self
            .cancel
            .as_ref()
            .is_some_and(impinge::CancelToken::is_cancelled)
        {
            self.stop.cancel();
        }
        if std::thread::current().id() != self.caller {
            return;
        }
        let Ok(mut state) = self.state.lock() else {
            return;
        };
        let ended = at.done >= at.total && self.progress.is_some();
        if state.raised.is_some() || (!ended && state.looked.elapsed() < INTERVAL) {
            return;
        }
        // An interpreter that is shutting down cannot be had any more: nobody waits for the answer.
        match Python::try_attach(|py| self.look(py, at)) {
            Some(Ok(())) => {}
            Some(Err(error)) => {
                state.raised = Some(error);
                self.stop.cancel();
            }
            None => self.stop.cancel(),
        }
        state.looked = Instant::now();
    }

    fn look(&self, py: Python<'_>, at: Progress) -> PyResult<()> {
        py.check_signals()?;
        if let Some(progress) = &self.progress {
            progress.call1(py, (at.done, at.total))?;
        }
        Ok(())
    }

    /// The exception that stopped the detection, if one did.
    pub fn raised(&self) -> Option<PyErr> {
        let state = self.state.lock();
        state
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .raised
            .take()
    }
}
