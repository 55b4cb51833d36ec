//! Detectors: `impinge_detector_*`, their settings, and the callbacks that questions call.

use std::ffi::{CStr, CString, c_void};
#[cfg(feature = "test-panic")]
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::ThreadId;
use std::time::{Duration, Instant};

use impinge::{Backend, CancelToken, Control, Detector, Error, Method, Progress, Settings};
#[cfg(feature = "test-panic")]
use impinge::{PairFilter, Query};

use crate::scene::{Bodies, impinge_scene};
use crate::sized::read_sized;
use crate::stats::{Texts, fill};
use crate::status::{Failure, Handle, Held, answer, clear, end, guard, held, look, put, remember};
use crate::types::*;

/// A detector, and the callbacks of its settings.
pub struct Opened {
    detector: Detector,
    callbacks: Callbacks,
    /// The strings of `impinge_detector_stats`.
    texts: Texts,
}

pub type impinge_detector = Handle<Opened>;

impl Held for Opened {
    const NAME: &'static str = "detector";
    const CHANGED: &'static str = "a detector answers one question at a time; make one per thread, and ask none from its own callbacks";
    const READ: &'static str = "another call is reading its statistics; make one per thread";
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

/// Asks a detector about a scene, and calls the callbacks of its settings meanwhile. A failure is
/// logged too. Until the last callback has returned, no other call uses the detector, and none
/// changes the scene.
///
/// # Safety
/// `detector` and `scene` are NULL or handles of this library that nobody destroys during the call.
pub unsafe fn ask(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    question: impl FnOnce(&mut Detector, &Bodies) -> Result<(), Failure>,
) -> Status {
    let mut question = Some(question);
    let mut once = |detector: &mut Detector, scene: &Bodies| match question.take() {
        Some(question) => question(detector, scene),
        None => Ok(()),
    };
    // SAFETY: the caller's promise.
    let (detector, scene) = unsafe { (held(detector, "detector"), held(scene, "scene")) };
    ask_by(detector, scene, &mut once)
}

/// The same, compiled once for all questions.
fn ask_by(
    detector: Result<&impinge_detector, Failure>,
    scene: Result<&impinge_scene, Failure>,
    question: &mut dyn FnMut(&mut Detector, &Bodies) -> Result<(), Failure>,
) -> Status {
    let mut reserved = match detector.and_then(Handle::reserve) {
        Ok(reserved) => reserved,
        // Whoever has the detector has its callbacks: they are not called by two threads at a time.
        Err(failure) => return answer(Err(failure)),
    };
    let callbacks = reserved.get().callbacks;
    let scene = scene.and_then(Handle::read);
    let result = reserved.run(|held| {
        let scene = scene.as_deref().map_err(Failure::clone)?;
        if callbacks.cancelled.is_some() || callbacks.progress.is_some() {
            let watch = Arc::new(Watch {
                callbacks,
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
        }
        question(&mut held.detector, scene)
    });
    if let Err(failure) = &result {
        remember(&failure.message);
        callbacks.log(LOG_ERROR, &failure.message);
    }
    // Again, as calls of the callback may have failed.
    answer(result)
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
        BACKEND_AUTO if cfg!(feature = "gpu") => Backend::Auto,
        BACKEND_AUTO | BACKEND_CPU => Backend::Cpu,
        BACKEND_GPU => Backend::Gpu,
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

/// Where a detector works, and why not on a GPU, for the log.
#[cfg(feature = "gpu")]
fn place(of: &Detector, given: &impinge_settings) -> String {
    if let Some(name) = of.gpu_name() {
        return format!("on the GPU {name}");
    }
    let why = match (given.backend, Method::ALL.get(given.method as usize)) {
        (BACKEND_CPU, _) => return "on the CPU".into(),
        (_, Some(Method::Naive)) => "no GPU is looked for with IMPINGE_METHOD_NAIVE",
        _ if of.waits_for_gpu() => "a GPU is looked for when one first pays",
        _ => "no GPU could be opened",
    };
    format!("on the CPU: {why}")
}

/// The same without a GPU backend. A device may have been named all the same: its name says which
/// one, if any.
#[cfg(not(feature = "gpu"))]
fn place(_: &Detector, given: &impinge_settings) -> String {
    const WHY: &str = "on the CPU: this library was built without the GPU backend";
    match (given.backend, given.device.is_null()) {
        (BACKEND_CPU, _) => "on the CPU".into(),
        (_, true) => WHY.into(),
        (_, false) => {
            // SAFETY: `impinge.h` says that it is a C string.
            let name = unsafe { CStr::from_ptr(given.device) }.to_string_lossy();
            format!("{WHY}, so the device {name:?} plays no part")
        }
    }
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
                "impinge {}: a detector was opened {}",
                env!("CARGO_PKG_VERSION"),
                place(&made, &given)
            ),
        );
        let made = Handle::new(Opened {
            detector: made,
            callbacks,
            texts: Texts::default(),
        });
        // SAFETY: as above.
        unsafe { put(detector, "detector", Box::into_raw(Box::new(made))) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detector_destroy(detector: *mut impinge_detector) {
    // SAFETY: see `impinge_settings_default`.
    unsafe { end(detector) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detector_stats(
    detector: *const impinge_detector,
    stats: *mut impinge_stats,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_settings_default`.
        let detector = unsafe { held(detector, "detector") }?.read()?;
        // SAFETY: as above.
        unsafe { fill(detector.detector.stats(), &detector.texts, stats) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detector_start_intersects(
    detector: *const impinge_detector,
) -> i32 {
    // SAFETY: see `impinge_settings_default`.
    let detector = unsafe { look(detector) };
    asked(detector.and_then(|held| held.detector.start_intersects()))
}

/// An answer that may not have been asked for: 1, 0 or -1.
pub fn asked(answer: Option<bool>) -> i32 {
    answer.map_or(-1, i32::from)
}

/// Panics on a helper of the detector, for tests of the guard: in a step of the scene, where all
/// threads are asked which pairs may collide.
#[cfg(feature = "test-panic")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_test_helper_panic(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
) -> Status {
    let caller = std::thread::current().id();
    let deadline = Instant::now() + Duration::from_secs(60);
    let has_helper = Arc::new(AtomicBool::new(false));
    let filter = PairFilter::new(move |_| {
        if std::thread::current().id() != caller {
            has_helper.store(true, Ordering::Relaxed);
            panic!("as a test asked of a helper");
        }
        while !has_helper.load(Ordering::Relaxed) && Instant::now() < deadline {
            std::thread::yield_now();
        }
        true
    });
    let query = Query::all().filter(filter);
    // SAFETY: see `impinge_settings_default`.
    unsafe {
        ask(detector, scene, |detector, scene| {
            detector.impacts(&scene.scene, &query)?;
            Ok(())
        })
    }
}

/// Panics, for tests of the guard.
#[cfg(feature = "test-panic")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_test_panic(detector: *mut impinge_detector) -> Status {
    let scene = impinge_scene::default();
    // SAFETY: see `impinge_settings_default`.
    unsafe { ask(detector, &scene, |_, _| panic!("as a test asked")) }
}
