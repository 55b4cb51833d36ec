//! What a call answers: its status, the message of the thread's last failure, and the guard that no
//! panic passes. And handles: which calls may use one at the same time.

use std::any::Any;
use std::cell::{Cell, RefCell, UnsafeCell};
use std::ffi::{CString, c_char};
use std::ops::{Deref, DerefMut};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::{Mutex, Once, PoisonError};

use impinge::Error;

use crate::types::*;

/// Why a call failed.
#[derive(Clone, Debug)]
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

    /// That a body was not there when an answer was found.
    pub fn no_body(body: u32, n_bodies: usize) -> Self {
        Failure::invalid(format!(
            "there was no body {body} among the {n_bodies} of the scene"
        ))
    }

    /// That a pointer to a `T` is not aligned.
    pub fn misaligned<T>(at: *const T, what: &str) -> Self {
        let needed = align_of::<T>();
        Failure::invalid(format!("{what} at {at:p} is not aligned to {needed} bytes"))
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
        let message = match error {
            // The settings that C names in other words.
            Error::Setting {
                setting: "owned_by",
                given,
                allowed,
            } => format!("cell_low and cell_high: {given} given, {allowed} allowed"),
            error => {
                let named = "those that are named by `of` or `across`";
                error.to_string().replace(named, "the one in the field a")
            }
        };
        Failure { status, message }
    }
}

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
    /// How many guards this thread is in.
    static OWN_GUARDS: Cell<u32> = const { Cell::new(0) };
    /// Where the last panic within a guard of this thread was.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// How many guards all threads are in.
static GUARDS: AtomicUsize = AtomicUsize::new(0);
/// Where the last panic of a thread without a guard was, as a helper is: the thread that it helps
/// passes the panic on.
static PLACE_OF_HELPER: Mutex<String> = Mutex::new(String::new());

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

/// A panic within a guard, or of a thread that helps one, prints nothing: its message becomes that
/// of the call. The first guard also says that nobody else uses the rayon pool of the process.
fn watch() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        impinge::own_pool();
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let place = panic.location().map(ToString::to_string);
            let place = place.unwrap_or_default();
            if OWN_GUARDS.with(Cell::get) > 0 {
                PLACE.with(|held| *held.borrow_mut() = place);
            } else if GUARDS.load(Ordering::Relaxed) > 0 && may_help() {
                *place_of_helper() = place;
            } else {
                before(panic);
            }
        }));
    });
}

/// Whether this thread is one of the library's, whose names begin so.
fn may_help() -> bool {
    let thread = std::thread::current();
    thread
        .name()
        .is_some_and(|name| name.starts_with("impinge-"))
}

fn place_of_helper() -> impl DerefMut<Target = String> {
    let place = PLACE_OF_HELPER.lock();
    place.unwrap_or_else(PoisonError::into_inner)
}

/// Runs an entry of the library. A failure, or a panic, becomes a status and the thread's message.
/// No panic leaves it, because callers in C cannot unwind.
pub fn guard(entry: impl FnOnce() -> Result<(), Failure>) -> Status {
    answer(catch(entry).unwrap_or_else(Err))
}

/// What a caller is told: a status, and the thread's message.
pub fn answer(result: Result<(), Failure>) -> Status {
    match result {
        Ok(()) => OK,
        Err(failure) => {
            remember(&failure.message);
            failure.status
        }
    }
}

/// What an entry gives, or that it has panicked: `Err` says so, and nothing else does.
fn catch<T>(entry: impl FnOnce() -> T) -> Result<T, Failure> {
    watch();
    GUARDS.fetch_add(1, Ordering::Relaxed);
    OWN_GUARDS.with(|n| n.set(n.get() + 1));
    let result = catch_unwind(AssertUnwindSafe(entry));
    OWN_GUARDS.with(|n| n.set(n.get() - 1));
    GUARDS.fetch_sub(1, Ordering::Relaxed);
    result.map_err(|panic| Failure {
        status: INTERNAL,
        message: describe(&*panic),
    })
}

fn describe(panic: &(dyn Any + Send)) -> String {
    let what = match (panic.downcast_ref::<&str>(), panic.downcast_ref::<String>()) {
        (Some(what), _) => what,
        (_, Some(what)) => what.as_str(),
        _ => "a panic",
    };
    let mut place = PLACE.with(|held| std::mem::take(&mut *held.borrow_mut()));
    if place.is_empty() {
        // This thread passes on the panic of a helper.
        place = std::mem::take(&mut *place_of_helper());
    }
    format!("internal error, please report it: {what} ({place})")
}

/// What a handle holds that calls reserve: many to read it, or one to change it. Calls of any thread
/// do, several at a time where they read, and C asks for no bound: so all that is held is `Sync`.
pub trait Held: Send + Sync {
    const NAME: &'static str;
    /// What a caller is told while another call changes it.
    const CHANGED: &'static str;
    /// What a caller who would change it is told while others read it.
    const READ: &'static str;
}

/// A handle. References to what it holds are made only of a call that has reserved it, so that
/// other threads, and callbacks, may try to reserve it at any time.
#[derive(Default)]
pub struct Handle<T> {
    /// How many calls read it; [`CHANGING`] while one changes it.
    n_readers: AtomicU32,
    /// Whether a change has ended in a panic. Set and read by calls that have reserved the handle.
    is_broken: AtomicBool,
    inner: UnsafeCell<T>,
}

const CHANGING: u32 = u32::MAX;

impl<T: Held> Handle<T> {
    pub fn new(inner: T) -> Self {
        Handle {
            n_readers: AtomicU32::new(0),
            is_broken: AtomicBool::new(false),
            inner: UnsafeCell::new(inner),
        }
    }

    /// Reserves the handle for one call that reads it. A broken one is refused.
    pub fn read(&self) -> Result<Reading<'_, T>, Failure> {
        let one_more = |n: u32| n.checked_add(1).filter(|&n| n < CHANGING);
        let entered = self
            .n_readers
            .fetch_update(Ordering::Acquire, Ordering::Relaxed, one_more);
        entered.map_err(|_| in_use::<T>(T::CHANGED))?;
        let reading = Reading(self);
        self.sound().map(|()| reading)
    }

    /// Reserves the handle for one call that changes it. [`Changing::run`] refuses a broken one.
    pub fn reserve(&self) -> Result<Changing<'_, T>, Failure> {
        let reserved =
            self.n_readers
                .compare_exchange(0, CHANGING, Ordering::Acquire, Ordering::Relaxed);
        match reserved {
            Ok(_) => Ok(Changing(self)),
            Err(CHANGING) => Err(in_use::<T>(T::CHANGED)),
            Err(_) => Err(in_use::<T>(T::READ)),
        }
    }

    fn sound(&self) -> Result<(), Failure> {
        match self.is_broken.load(Ordering::Relaxed) {
            false => Ok(()),
            true => Err(Failure {
                status: INTERNAL,
                message: format!(
                    "the {} is broken: an earlier call ended in an internal error; destroy it and make another",
                    T::NAME
                ),
            }),
        }
    }
}

fn in_use<T: Held>(why: &str) -> Failure {
    Failure::invalid(format!("the {} is in use: {why}", T::NAME))
}

/// A call that reads a handle. Until it is dropped, nothing changes the handle.
pub struct Reading<'a, T>(&'a Handle<T>);

impl<T> Deref for Reading<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: this call is counted in `n_readers`, so `reserve` refuses, and only `Changing`
        // makes references that change what the handle holds.
        unsafe { &*self.0.inner.get() }
    }
}

impl<T> Drop for Reading<'_, T> {
    fn drop(&mut self) {
        self.0.n_readers.fetch_sub(1, Ordering::Release);
    }
}

/// The only call that uses a handle. Until it is dropped, all others are refused: those of other
/// threads, and those of callbacks.
pub struct Changing<'a, T>(&'a Handle<T>);

impl<T: Held> Changing<'_, T> {
    pub fn get(&mut self) -> &mut T {
        // SAFETY: `n_readers` is CHANGING, so `read` and `reserve` refuse, and the reference
        // borrows the only `Changing` of this handle.
        unsafe { &mut *self.0.inner.get() }
    }

    /// Runs an entry that changes the handle. A panic breaks it; a failure, whatever its status,
    /// does not.
    pub fn run(
        &mut self,
        entry: impl FnOnce(&mut T) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.0.sound()?;
        catch(|| entry(self.get())).unwrap_or_else(|panic| {
            self.0.is_broken.store(true, Ordering::Relaxed);
            Err(panic)
        })
    }
}

impl<T> Drop for Changing<'_, T> {
    fn drop(&mut self) {
        self.0.n_readers.store(0, Ordering::Release);
    }
}

/// Runs an entry that changes a handle, while all other calls are refused.
///
/// # Safety
/// `handle` is NULL or a handle of this library that nobody destroys during the call.
pub unsafe fn change<T: Held>(
    handle: *mut Handle<T>,
    entry: impl FnOnce(&mut T) -> Result<(), Failure>,
) -> Status {
    // SAFETY: the caller's promise.
    let reserved = unsafe { held(handle, T::NAME) }.and_then(Handle::reserve);
    answer(reserved.and_then(|mut reserved| reserved.run(entry)))
}

/// Reserves a handle for reading. `None` for NULL, and where it is in use or broken.
///
/// # Safety
/// As [`change`], while the answer lives.
pub unsafe fn look<'a, T: Held>(handle: *const Handle<T>) -> Option<Reading<'a, T>> {
    // SAFETY: the caller's promise.
    unsafe { handle.as_ref() }?.read().ok()
}

/// Ends a handle that [`Box::into_raw`] gave out, unless a call is using it. NULL is none.
///
/// # Safety
/// `handle` is NULL or comes from `Box::into_raw`, and is not used again.
pub unsafe fn end<T: Held>(handle: *mut Handle<T>) {
    // SAFETY: the caller's promise.
    let Some(reserved) = unsafe { handle.as_ref() }.map(Handle::reserve) else {
        return;
    };
    match reserved.map(std::mem::forget) {
        Err(failure) => remember(&format!("{}; it is not destroyed", failure.message)),
        // SAFETY: the caller's promise; the handle stays reserved, so that no call enters it.
        Ok(()) => unsafe { destroy(handle) },
    }
}

/// The handle, or that it is NULL or not aligned.
///
/// # Safety
/// `handle` is NULL or a handle of this library that nobody changes while the reference lives.
pub unsafe fn held<'a, H>(handle: *const H, what: &str) -> Result<&'a H, Failure> {
    if !handle.is_aligned() {
        return Err(Failure::misaligned(handle, what));
    }
    // SAFETY: the caller's promise.
    unsafe { handle.as_ref() }.ok_or_else(|| Failure::null(what))
}

/// Writes a result where the caller wants it, aligned or not.
///
/// # Safety
/// `to` is NULL or can be written.
pub unsafe fn put<T>(to: *mut T, what: &str, value: T) -> Result<(), Failure> {
    if to.is_null() {
        return Err(Failure::null(what));
    }
    // SAFETY: the caller's promise.
    unsafe { to.write_unaligned(value) };
    Ok(())
}

/// Writes numbers where the caller wants them, aligned or not.
///
/// # Safety
/// All of them can be written to `to`, which may be NULL if there are none.
pub unsafe fn write_all<T>(to: *mut T, numbers: impl IntoIterator<Item = T>) {
    for (ix, number) in numbers.into_iter().enumerate() {
        // SAFETY: the caller's promise.
        unsafe { to.add(ix).write_unaligned(number) };
    }
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

    #[test]
    fn a_panic_of_a_helper_has_its_place() {
        let help = || {
            let named = std::thread::Builder::new().name("impinge-pool-0".to_owned());
            let helper = named.spawn(|| panic!("on a helper")).expect("a thread");
            std::panic::resume_unwind(helper.join().expect_err("it panics"));
        };
        assert_eq!(guard(help), INTERNAL);
        // SAFETY: as above.
        let message = unsafe { CStr::from_ptr(impinge_error_message()) };
        let message = message.to_str().expect("UTF-8");
        assert!(
            message.contains("on a helper (") && message.contains("status.rs"),
            "{message}"
        );
    }

    struct Number {
        value: u32,
    }
    impl Held for Number {
        const NAME: &'static str = "number";
        const CHANGED: &'static str = "it is changed";
        const READ: &'static str = "it is read";
    }

    #[track_caller]
    fn message<T>(refused: Result<T, Failure>) -> String {
        refused.err().expect("it is refused").message
    }

    #[test]
    fn many_calls_read_a_handle_or_one_changes_it() {
        let handle = Handle::new(Number { value: 1 });
        let (one, other) = (handle.read().expect("free"), handle.read().expect("read"));
        assert_eq!((one.value, other.value), (1, 1));
        drop(one);
        let refused = message(handle.reserve());
        assert_eq!(refused, "the number is in use: it is read");
        drop(other);
        let mut changing = handle.reserve().expect("free");
        changing.get().value = 2;
        for refused in [message(handle.reserve()), message(handle.read())] {
            assert_eq!(refused, "the number is in use: it is changed");
        }
        drop(changing);
        assert_eq!(handle.read().expect("free").value, 2);
    }

    #[test]
    fn only_a_panic_breaks_a_handle() {
        let handle = Handle::new(Number { value: 1 });
        let internal = || {
            Err(Failure {
                status: INTERNAL,
                message: "that of another handle".into(),
            })
        };
        let change = |entry: &dyn Fn() -> Result<(), Failure>| {
            handle.reserve().expect("free").run(|_| entry())
        };
        assert_eq!(message(change(&internal)), "that of another handle");
        assert!(change(&|| Ok(())).is_ok());
        assert!(message(change(&|| panic!("on purpose"))).contains("on purpose"));
        for refused in [message(change(&|| Ok(()))), message(handle.read())] {
            assert!(refused.contains("the number is broken"), "{refused}");
        }
        // A refused call has left it.
        assert!(handle.reserve().is_ok());
    }
}
