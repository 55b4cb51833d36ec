//! The only module of the GPU backend that blocks a thread.
//!
//! A thread in a browser must never wait: promises are fulfilled only between its turns. So on wasm
//! these functions return an error that names the alternative.

use std::future::Future;

use crate::scene::error::Error;

#[cfg(target_family = "wasm")]
fn cannot_wait<T>() -> Result<T, Error> {
    Err(Error::Gpu {
        what: "a browser cannot wait for its GPU: call the function of this name that ends in \
               _async"
            .to_owned(),
    })
}

/// Waits for a future that needs no device to be polled, such as the opening of one.
///
/// # Errors
/// The future's errors. Always an error in a browser.
#[cfg(not(target_family = "wasm"))]
pub fn wait<T>(future: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    pollster::block_on(future)
}

/// In a browser, where a thread cannot wait: always an error.
#[cfg(target_family = "wasm")]
pub fn wait<T>(_: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    cannot_wait()
}

/// Runs a future to completion, waiting for the device when necessary; after each wait, `check` may
/// give up.
///
/// # Errors
/// The errors of the future and of `check`; a device that cannot be waited for. Always an error in
/// a browser, before the future is polled.
#[cfg(not(target_family = "wasm"))]
pub fn drive<T>(
    device: &wgpu::Device,
    future: impl Future<Output = Result<T, Error>>,
    check: impl Fn() -> Result<(), Error>,
) -> Result<T, Error> {
    use std::task::{Context, Poll, Waker};

    let mut future = std::pin::pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(result) = future.as_mut().poll(&mut context) {
            return result;
        }
        device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| Error::Gpu {
                what: error.to_string(),
            })?;
        check()?;
    }
}

/// In a browser, where a thread cannot wait: always an error.
#[cfg(target_family = "wasm")]
pub fn drive<T>(
    _: &wgpu::Device,
    _: impl Future<Output = Result<T, Error>>,
    _: impl Fn() -> Result<(), Error>,
) -> Result<T, Error> {
    cannot_wait()
}
