//! Ctrl-C and requests to terminate.
//!
//! The first request cancels a token that every detection watches. Some long operations can't watch
//! it (reading a file, a driver's compiler, a pipe that nobody reads). So if the program has not
//! ended within [`GRACE`], a thread ends it. A second request ends it at once.

use std::io::{Write, stderr};
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use impinge::CancelToken;

/// How long the program may take to end by itself.
const GRACE: Duration = Duration::from_millis(600);

/// The exit code for the first request: 128 plus the number of the signal, as in shells; 0 while
/// there is no request.
static CODE: AtomicU8 = AtomicU8::new(0);

/// The number of running parts that must finish before the program may be ended.
static N_PATIENT: AtomicUsize = AtomicUsize::new(0);

/// A token that the first Ctrl-C or request to terminate cancels.
pub fn cancel_on_signal() -> std::io::Result<CancelToken> {
    let token = CancelToken::new();
    listen(token.clone())?;
    Ok(token)
}

/// The exit code after a request to stop, if there was one.
pub fn exit_code() -> Option<u8> {
    Some(CODE.load(Ordering::Acquire)).filter(|&code| code > 0)
}

/// While this is held, the first request waits, so that results can be saved. The second request
/// does not wait.
pub struct Patience;

impl Patience {
    pub fn new() -> Self {
        N_PATIENT.fetch_add(1, Ordering::AcqRel);
        Patience
    }
}

impl Drop for Patience {
    fn drop(&mut self) {
        N_PATIENT.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Prints the reason for the end of the program on standard error, once.
pub fn say(line: &str) {
    static IS_SAID: AtomicBool = AtomicBool::new(false);
    if !IS_SAID.swap(true, Ordering::AcqRel) {
        // If standard error is closed, the reason can't be reported.
        let _ = writeln!(stderr(), "impinge: {line}");
    }
}

#[cfg(unix)]
fn listen(token: CancelToken) -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    // A signal that was ignored when the program was started (`nohup`) stays ignored.
    let wanted = [SIGINT, SIGTERM, SIGHUP]
        .into_iter()
        .filter(|&signal| !is_ignored(signal));
    let mut signals = Signals::new(wanted)?;
    thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            for signal in signals.forever() {
                // Signals have small numbers.
                asked(&token, 128 + signal.unsigned_abs() as u8);
            }
        })?;
    Ok(())
}

#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: no action is set, and the present one is written to memory of its size; all zeros are
    // a valid value of it.
    let action = unsafe {
        libc::sigaction(signal, std::ptr::null(), action.as_mut_ptr());
        action.assume_init()
    };
    action.sa_sigaction == libc::SIG_IGN
}

#[cfg(not(unix))]
fn listen(token: CancelToken) -> std::io::Result<()> {
    const INTERRUPTED: u8 = 130;
    ctrlc::set_handler(move || asked(&token, INTERRUPTED))
        .map_err(|error| std::io::Error::other(error.to_string()))
}

/// Handles a request to stop.
fn asked(token: &CancelToken, code: u8) {
    let first = CODE.compare_exchange(0, code, Ordering::AcqRel, Ordering::Acquire);
    token.cancel();
    if first.is_err() {
        end(code);
    }
    let watch = move || {
        loop {
            thread::sleep(GRACE);
            if N_PATIENT.load(Ordering::Acquire) == 0 {
                end(code);
            }
        }
    };
    if thread::Builder::new().spawn(watch).is_err() {
        // Without a thread that can wait, end at once.
        end(code);
    }
}

/// Ends the program, whatever it is doing.
fn end(code: u8) -> ! {
    impinge_io::remove_temporary_files();
    say("cancelled");
    // Exit handlers of drivers or libraries might wait for threads that are still working, so they
    // are not run.
    #[cfg(unix)]
    // SAFETY: ends the process at once; no more of its code runs.
    unsafe {
        libc::_exit(i32::from(code))
    }
    #[cfg(not(unix))]
    std::process::exit(i32::from(code))
}
