//! Detectors: `impinge_detector_*`, their settings, and the callbacks that questions call.

use std::cell::Cell;
use std::ffi::{CStr, CString, c_void};
use std::sync::{Arc, Mutex};
use std::thread::ThreadId;
use std::time::{Duration, Instant};

use impinge::{Backend, CancelToken, Control, Detector, Error, Method, Progress, Settings};

use crate::sized::read_sized;
use crate::stats::{Texts, fill};
use crate::status::{Failure, Handle, State, change, clear, destroy, guard, held, put};
use crate::types::*;

/// A detector, and the callbacks of its settings.
pub struct impinge_detector {
    pub detector: Detector,
    callbacks: Callbacks,
    /// The strings of `impinge_detector_stats`.
    texts: Texts,
    state: State,
}

impl Handle for impinge_detector {
    const NAME: &'static str = "detector";
    const ONE_AT_A_TIME: &'static str = "a detector answers one question at a time; make one per thread, and ask none from its own callbacks";

    unsafe fn state<'a>(handle: *const Self) -> &'a State {
        // SAFETY: the caller's promise.
        unsafe { &(*handle).state }
    }
}

#[derive(Clone, Copy)]
struct Callbacks {
    cancelled: Option<CancelledCallback>,
    progress: Option<ProgressCallback>,
    log: Option<LogCallback>,
    user: *mut c_void,
}

// SAFETY: `impinge.h` says that the callbacks are called by the thread that asks, which may be
// another one each time.
unsafe impl Send for Callbacks {}
// SAFETY: other threads of a question see them, and call none (`Watch`).
unsafe impl Sync for Callbacks {}

impl Callbacks {
    fn log(&self, level: u32, message: &str) {
        if let (Some(log), Ok(text)) = (self.log, CString::new(message)) {
            // SAFETY: the caller's function, with the caller's argument and a text that lives as
            // long as the call.
            unsafe { log(self.user, level, text.as_ptr()) };
        }
    }
}

/// How often callbacks are called at most.
const INTERVAL: Duration = Duration::from_millis(10);

/// What watches one question.
struct Watch {
    callbacks: Callbacks,
    caller: ThreadId,
    stop: CancelToken,
    called: Mutex<Option<Instant>>,
}

impl Watch {
    fn step(&self, at: Progress) {
        if std::thread::current().id() != self.caller {
            return;
        }
        let Ok(mut called) = self.called.try_lock() else {
            return;
        };
        let is_last = at.done >= at.total && self.callbacks.progress.is_some();
        if !is_last && called.is_some_and(|then| then.elapsed() < INTERVAL) {
            return;
        }
        let Callbacks {
            cancelled,
            progress,
            user,
            ..
        } = self.callbacks;
        if let Some(progress) = progress {
            // SAFETY: the caller's function, with the caller's argument, on the caller's thread.
            unsafe { progress(user, at.done, at.total) };
        }
        // SAFETY: as above.
        if cancelled.is_some_and(|cancelled| unsafe { cancelled(user) } != 0) {
            self.stop.cancel();
        }
        *called = Some(Instant::now());
    }
}

/// Asks a detector, which calls the callbacks of its settings meanwhile. A failure is logged too.
///
/// # Safety
/// `detector` is NULL or a detector that nobody destroys during the call.
pub unsafe fn ask(
    detector: *mut impinge_detector,
    question: impl FnOnce(&mut Detector) -> Result<(), Failure>,
) -> Status {
    let mut question = Some(question);
    let mut once = |detector: &mut Detector| match question.take() {
        Some(question) => question(detector),
        None => Ok(()),
    };
    // SAFETY: the caller's promise.
    unsafe { ask_by(detector, &mut once) }
}

/// The same, compiled once for all questions.
unsafe fn ask_by(
    detector: *mut impinge_detector,
    question: &mut dyn FnMut(&mut Detector) -> Result<(), Failure>,
) -> Status {
    let callbacks = Cell::new(None);
    // SAFETY: the caller's promise.
    let status = unsafe {
        change(detector, |held| {
            let callbacks_of = held.callbacks;
            callbacks.set(Some(callbacks_of));
            if callbacks_of.cancelled.is_none() && callbacks_of.progress.is_none() {
                return question(&mut held.detector);
            }
            let watch = Arc::new(Watch {
                callbacks: callbacks_of,
                caller: std::thread::current().id(),
                stop: CancelToken::new(),
                called: Mutex::new(None),
            });
            // A question may look only once, and a short one not at all.
            watch.step(Progress { done: 0, total: 1 });
            if watch.stop.is_cancelled() {
                return Err(Error::Cancelled.into());
            }
            let control = Control::new().cancel(&watch.stop);
            let control = control.progress(move |at| watch.step(at));
            held.detector.set_control(control);
            question(&mut held.detector)
        })
    };
    if let (Some(callbacks), true) = (callbacks.get(), status != OK) {
        // SAFETY: the message lives until this thread's next failure.
        let message = unsafe { CStr::from_ptr(crate::status::impinge_error_message()) };
        let message = message.to_string_lossy().into_owned();
        callbacks.log(LOG_ERROR, &message);
    }
    status
}

/// Settings in the words of the crate `impinge`.
///
/// # Safety
/// `device` of the settings is NULL or a C string.
unsafe fn settings(given: &impinge_settings) -> Result<Settings, Failure> {
    let out_of_range = |field: &str, given: u32, most: &str| {
        Err(Failure::invalid(format!(
            "{field}: {given} given, 0 to {most} allowed"
        )))
    };
    let backend = match given.backend {
        0 if cfg!(feature = "gpu") => Backend::Auto,
        0 | 1 => Backend::Cpu,
        2 => Backend::Gpu,
        other => return out_of_range("backend", other, "IMPINGE_BACKEND_GPU"),
    };
    let Some(&method) = Method::ALL.get(given.method as usize) else {
        return out_of_range("method", given.method, "IMPINGE_METHOD_NAIVE");
    };
    let device = match given.device.is_null() {
        true => None,
        // SAFETY: the caller's promise.
        false => Some(
            unsafe { CStr::from_ptr(given.device) }
                .to_string_lossy()
                .into_owned(),
        ),
    };
    let some = |limit: u64| (limit != 0).then_some(limit);
    Ok(Settings::new()
        .backend(backend)
        .method(method)
        .threads(given.threads as usize)
        .memory_budget(some(given.memory_budget))
        .max_pairs(some(given.max_pairs))
        .reuse_margin(given.reuse_margin)
        .device(device))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_settings_default(settings: *mut impinge_settings) {
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below. Without room for
    // it there is nothing to fill.
    let _ = unsafe { put(settings, "settings", impinge_settings::default()) };
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detector_create(
    settings_of: *const impinge_settings,
    detector: *mut *mut impinge_detector,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_settings_default`.
        unsafe { clear(detector, "detector") }?;
        // SAFETY: as above.
        let given = unsafe { read_sized(settings_of) }?;
        let callbacks = Callbacks {
            cancelled: given.cancelled,
            progress: given.progress,
            log: given.log,
            user: given.user,
        };
        // SAFETY: as above.
        let opened = unsafe { settings(&given) }.and_then(|settings| Ok(Detector::new(settings)?));
        let made = opened.inspect_err(|failure| callbacks.log(LOG_ERROR, &failure.message))?;
        callbacks.log(
            LOG_INFO,
            &format!(
                "impinge {}: a detector was opened",
                env!("CARGO_PKG_VERSION")
            ),
        );
        let made = impinge_detector {
            detector: made,
            callbacks,
            texts: Texts::default(),
            state: State::default(),
        };
        // SAFETY: as above.
        unsafe { put(detector, "detector", Box::into_raw(Box::new(made))) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detector_destroy(detector: *mut impinge_detector) {
    // SAFETY: see `impinge_settings_default`.
    unsafe { destroy(detector) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detector_stats(
    detector: *const impinge_detector,
    stats: *mut impinge_stats,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_settings_default`.
        let detector = unsafe { held(detector, "detector") }?;
        // SAFETY: as above.
        unsafe { fill(detector.detector.stats(), &detector.texts, stats) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detector_start_intersects(
    detector: *const impinge_detector,
) -> i32 {
    // SAFETY: see `impinge_settings_default`.
    let detector = unsafe { detector.as_ref() };
    asked(detector.and_then(|held| held.detector.start_intersects()))
}

/// An answer that may not have been asked for: 1, 0 or -1.
pub fn asked(answer: Option<bool>) -> i32 {
    answer.map_or(-1, i32::from)
}

/// Panics, for tests of the guard.
#[cfg(feature = "test-panic")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_test_panic(detector: *mut impinge_detector) -> Status {
    // SAFETY: see `impinge_settings_default`.
    unsafe { ask(detector, |_| panic!("as a test asked")) }
}
