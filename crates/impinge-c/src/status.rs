//! What a call answers: its status, the message of the thread's last failure, and the guard that no
//! panic passes.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;
use std::sync::atomic::{AtomicU8, Ordering};

use impinge::Error;

use crate::types::*;

/// Why a call failed.
#[derive(Debug)]
pub struct Failure {
    pub status: Status,
    pub message: String,
}

impl Failure {
    pub fn invalid(message: impl Into<String>) -> Self {
        Failure {
            status: INVALID,
            message: message.into(),
        }
    }

    pub fn null(what: &str) -> Self {
        Failure::invalid(format!("{what} is NULL"))
    }

    pub fn out_of_memory(what: &str, n: usize) -> Self {
        Failure {
            status: OUT_OF_MEMORY,
            message: format!("out of memory: there is none for {n} {what}"),
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::OutOfMemory { .. } => OUT_OF_MEMORY,
            Error::MemoryBudget { .. } => BUDGET,
            Error::TooManyPairs { .. } => TOO_MANY_PAIRS,
            Error::Cancelled => CANCELLED,
            Error::NoAdapter { .. } | Error::Gpu { .. } => DEVICE,
            _ => INVALID,
        };
        Failure {
            status,
            message: error.to_string(),
        }
    }
}

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
    /// How many guards this thread is in.
    static GUARDS: Cell<u32> = const { Cell::new(0) };
    /// Where the last panic within a guard was.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps a message for `impinge_error_message`.
pub fn remember(message: &str) {
    let text: Vec<u8> = message.bytes().filter(|&byte| byte != 0).collect();
    MESSAGE.with(|held| *held.borrow_mut() = CString::new(text).unwrap_or_default());
}

/// The message of this thread's last failure.
#[unsafe(no_mangle)]
pub extern "C" fn impinge_error_message() -> *const c_char {
    MESSAGE.with(|held| held.borrow().as_ptr())
}

/// A panic within a guard prints nothing: its message becomes that of the call.
fn watch_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if GUARDS.with(Cell::get) == 0 {
                return before(panic);
            }
            let place = panic.location().map(ToString::to_string);
            PLACE.with(|held| *held.borrow_mut() = place.unwrap_or_default());
        }));
    });
}

/// Runs an entry of the library. A failure, or a panic, becomes a status and the thread's message.
/// No panic leaves it, because callers in C cannot unwind.
pub fn guard(entry: impl FnOnce() -> Result<(), Failure>) -> Status {
    watch_panics();
    GUARDS.with(|n| n.set(n.get() + 1));
    let result = catch_unwind(AssertUnwindSafe(entry));
    GUARDS.with(|n| n.set(n.get() - 1));
    let failure = match result {
        Ok(Ok(())) => return OK,
        Ok(Err(failure)) => failure,
        Err(panic) => Failure {
            status: INTERNAL,
            message: describe(&*panic),
        },
    };
    remember(&failure.message);
    failure.status
}

fn describe(panic: &(dyn Any + Send)) -> String {
    let what = match (panic.downcast_ref::<&str>(), panic.downcast_ref::<String>()) {
        (Some(what), _) => what,
        (_, Some(what)) => what.as_str(),
        _ => "a panic",
    };
    let place = PLACE.with(|held| std::mem::take(&mut *held.borrow_mut()));
    format!("internal error, please report it: {what} ({place})")
}

/// Whether a call may use a handle: one call at a time, and none after a panic.
#[derive(Default)]
pub struct State(AtomicU8);

const FREE: u8 = 0;
const IN_USE: u8 = 1;
const BROKEN: u8 = 2;

impl State {
    /// Reserves the handle for one call. `change` releases it.
    fn reserve<H: Handle>(&self) -> Result<(), Failure> {
        let reserved = self
            .0
            .compare_exchange(FREE, IN_USE, Ordering::Acquire, Ordering::Relaxed);
        reserved.map(drop).map_err(refused::<H>)
    }

    /// That no call is changing the handle, and none has ended in a panic.
    pub fn sound<H: Handle>(&self) -> Result<(), Failure> {
        match self.0.load(Ordering::Acquire) {
            FREE => Ok(()),
            state => Err(refused::<H>(state)),
        }
    }
}

/// Why a handle in such a state is refused.
fn refused<H: Handle>(state: u8) -> Failure {
    match state {
        IN_USE => Failure::invalid(format!("the {} is in use: {}", H::NAME, H::ONE_AT_A_TIME)),
        _ => Failure {
            status: INTERNAL,
            message: format!(
                "the {} is broken: an earlier call ended in an internal error; destroy it and make another",
                H::NAME
            ),
        },
    }
}

/// A handle that one call at a time changes, and that a panic makes unusable.
pub trait Handle {
    const NAME: &'static str;
    /// What a caller is told who asks for a handle that is in use.
    const ONE_AT_A_TIME: &'static str;

    /// The state alone: another call may be changing the rest of the handle.
    ///
    /// # Safety
    /// `handle` points to a handle that lives as long as the reference.
    unsafe fn state<'a>(handle: *const Self) -> &'a State;
}

/// Runs an entry that changes a handle. The handle is given to `entry`. Until the entry returns,
/// other calls are refused: those of other threads, and those of callbacks. After a panic all are.
///
/// # Safety
/// `handle` is NULL or a handle of this library that nobody destroys during the call.
pub unsafe fn change<H: Handle>(
    handle: *mut H,
    entry: impl FnOnce(&mut H) -> Result<(), Failure>,
) -> Status {
    if handle.is_null() {
        return guard(|| Err(Failure::null(H::NAME)));
    }
    // SAFETY: the caller's promise. No reference to the whole handle is made before it is reserved.
    let state = unsafe { H::state(handle) };
    if let Err(failure) = state.reserve::<H>() {
        remember(&failure.message);
        return failure.status;
    }
    // SAFETY: the caller's promise, and other calls are refused until the state is FREE.
    let status = guard(|| entry(unsafe { &mut *handle }));
    let left = if status == INTERNAL { BROKEN } else { FREE };
    state.0.store(left, Ordering::Release);
    status
}

/// The handle, or that it is NULL.
///
/// # Safety
/// `handle` is NULL or a handle of this library that nobody changes while the reference lives.
pub unsafe fn held<'a, H>(handle: *const H, what: &str) -> Result<&'a H, Failure> {
    // SAFETY: the caller's promise.
    unsafe { handle.as_ref() }.ok_or_else(|| Failure::null(what))
}

/// Writes a result where the caller wants it.
///
/// # Safety
/// `to` is NULL or can be written.
pub unsafe fn put<T>(to: *mut T, what: &str, value: T) -> Result<(), Failure> {
    if to.is_null() {
        return Err(Failure::null(what));
    }
    // SAFETY: the caller's promise.
    unsafe { to.write(value) };
    Ok(())
}

/// Sets an out-pointer to NULL, so that it is NULL after a failure.
///
/// # Safety
/// As [`put`].
pub unsafe fn clear<T>(to: *mut *mut T, what: &str) -> Result<(), Failure> {
    // SAFETY: the caller's promise.
    unsafe { put(to, what, std::ptr::null_mut()) }
}

/// Ends a handle that [`Box::into_raw`] gave out. NULL is none.
///
/// # Safety
/// `handle` is NULL or comes from `Box::into_raw`, and is not used again.
pub unsafe fn destroy<T>(handle: *mut T) {
    if handle.is_null() {
        return;
    }
    guard(|| {
        // SAFETY: the caller's promise.
        drop(unsafe { Box::from_raw(handle) });
        Ok(())
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    #[test]
    fn a_panic_is_a_status_and_a_message() {
        assert_eq!(guard(|| panic!("on purpose")), INTERNAL);
        // SAFETY: the message lives until this thread's next failure.
        let message = unsafe { CStr::from_ptr(impinge_error_message()) };
        let message = message.to_str().expect("UTF-8");
        assert!(
            message.contains("on purpose (") && message.contains("status.rs"),
            "{message}"
        );
        assert_eq!(guard(|| Ok(())), OK);
    }
}
