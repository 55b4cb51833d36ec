//! What a call answers: its status, the message of the thread's last failure, and the guard that no
//! panic passes.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

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

/// A handle that a panic makes unusable.
pub trait Handle {
    const NAME: &'static str;
    fn is_broken(&mut self) -> &mut bool;
}

/// That a handle is unusable.
pub fn broken(name: &str) -> Failure {
    Failure {
        status: INTERNAL,
        message: format!(
            "the {name} is broken: an earlier call ended in an internal error; destroy it and make another"
        ),
    }
}

/// Runs an entry that changes a handle. The handle is given to `entry`, and refuses further use
/// after a panic.
///
/// # Safety
/// `handle` is NULL or a handle of this library that nobody else uses at the same time.
pub unsafe fn change<H: Handle>(
    handle: *mut H,
    entry: impl FnOnce(&mut H) -> Result<(), Failure>,
) -> Status {
    // SAFETY: the caller's promise.
    let Some(handle) = (unsafe { handle.as_mut() }) else {
        return guard(|| Err(Failure::null(H::NAME)));
    };
    if *handle.is_broken() {
        remember(&broken(H::NAME).message);
        return INTERNAL;
    }
    // Until the entry returns. A panic leaves it so.
    *handle.is_broken() = true;
    let status = guard(|| entry(handle));
    *handle.is_broken() = status == INTERNAL;
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
