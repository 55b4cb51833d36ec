//! The only room of the GPU backend that blocks a thread.
//!
//! A browser's thread must never wait: promises are kept between its turns. So on wasm nothing here waits; it
//! is an error that names the way out.

use std::future::Future;

use crate::error::Error;

#[cfg(target_family = "wasm")]
fn cannot_wait<T>() -> Result<T, Error> {
    Err(Error::Gpu {
        what: "a browser cannot wait for its GPU: call the function of this name that ends in \
               _async"
            .to_owned(),
    })
}

/// Waits for a future that no device has to be polled for, such as the opening of one.
///
/// # Errors
/// Those of the future. In a browser always.
#[cfg(not(target_family = "wasm"))]
pub fn wait<T>(future: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    pollster::block_on(future)
}

/// As natively, but nothing waits in a browser.
#[cfg(target_family = "wasm")]
pub fn wait<T>(_: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    cannot_wait()
}

/// Drives a future to its end, waiting for the device whenever it must; in between `check` may give up.
///
/// # Errors
/// Those of the future and of `check`; a device that cannot be waited for. In a browser always, and before
/// anything is begun.
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

/// As natively, but nothing waits in a browser.
#[cfg(target_family = "wasm")]
pub fn drive<T>(
    _: &wgpu::Device,
    _: impl Future<Output = Result<T, Error>>,
    _: impl Fn() -> Result<(), Error>,
) -> Result<T, Error> {
    cannot_wait()
}
