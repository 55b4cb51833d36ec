//! Devices, the limits that they must offer, and their errors.

use std::fmt;
use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use super::waiting::drive;
use crate::scene::error::Error;

/// A GPU on this machine, or a software driver that emulates one.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// The name that the driver gives, or the interface's name if that is empty. Any part of it
    /// selects this device in [`Settings::device`](crate::Settings::device).
    pub name: String,
    /// The programming interface: `"vulkan"`, `"metal"`, `"dx12"`, or `"webgpu"` in a browser.
    pub interface: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether it runs in software on the CPU. `Backend::Auto` ignores such devices.
    pub is_software: bool,
    /// The most bytes of one buffer binding.
    pub max_binding: u64,
}

impl fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.interface)
    }
}

/// Storage buffers per stage that every adapter must allow: WebGPU's guaranteed minimum.
pub(super) const STORAGE_BUFFERS: u32 = 8;

pub(super) fn suffices(limits: &wgpu::Limits) -> bool {
    limits.max_storage_buffers_per_shader_stage >= STORAGE_BUFFERS
        && limits.max_compute_invocations_per_workgroup >= 256
        && limits.max_compute_workgroups_per_dimension >= 32_768
}

pub(super) fn describe(info: &wgpu::AdapterInfo, limits: &wgpu::Limits) -> DeviceInfo {
    let interface = info.backend.to_str();
    // Browsers do not reveal the name.
    let name = match info.name.as_str() {
        "" => interface,
        name => name,
    };
    DeviceInfo {
        name: name.to_owned(),
        interface: interface.to_owned(),
        driver: format!("{} {}", info.driver, info.driver_info)
            .trim()
            .to_owned(),
        is_software: info.device_type == wgpu::DeviceType::Cpu,
        max_binding: max_binding(limits),
    }
}

fn max_binding(limits: &wgpu::Limits) -> u64 {
    limits
        .max_storage_buffer_binding_size
        .min(limits.max_buffer_size)
}

/// An open device.
pub struct Device {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Whether stages can be timed.
    pub has_timestamps: bool,
    info: DeviceInfo,
    lost: Arc<Mutex<Option<String>>>,
    /// Whether a callback records the loss: that of a device of our own.
    listens: bool,
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device").field("info", &self.info).finish()
    }
}

impl Device {
    /// Wraps an open device. The caller checks its limits, see [`suffices`].
    pub(super) fn new(device: wgpu::Device, queue: wgpu::Queue, info: DeviceInfo) -> Device {
        Device {
            has_timestamps: device.features().contains(wgpu::Features::TIMESTAMP_QUERY),
            device,
            queue,
            info,
            lost: Arc::default(),
            listens: false,
        }
    }

    /// Registers a callback that records the loss of the device. A device has only one, so that of
    /// a device of the caller's is the caller's.
    pub(super) fn listen(&mut self) {
        self.listens = true;
        let of_pass = Arc::clone(&self.lost);
        self.device
            .set_device_lost_callback(move |reason, message| {
                let mut of_pass = of_pass.lock().unwrap_or_else(PoisonError::into_inner);
                *of_pass = Some(format!("device lost ({reason:?}): {message}"));
            });
    }

    /// Whether a detector has opened it, and not the caller.
    pub fn is_own(&self) -> bool {
        self.listens
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// The most bytes of one binding.
    pub fn max_binding(&self) -> u64 {
        self.info.max_binding
    }

    /// Runs a future of this device to completion, waiting for the device when necessary.
    ///
    /// # Errors
    /// The future's errors; a device that cannot be waited for. Always an error in a browser.
    pub fn block_on<T>(&self, future: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
        drive(&self.device, future, || self.check_lost())
    }

    /// An error once the device is lost.
    pub fn check_lost(&self) -> Result<(), Error> {
        let known = || {
            let lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner);
            lost.clone()
        };
        if let Some(what) = known() {
            return Err(Error::Gpu { what });
        }
        if !self.listens && !self.takes_work() {
            let what = "device lost".to_owned();
            let mut lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner);
            *lost = Some(what.clone());
            return Err(Error::Gpu { what });
        }
        Ok(())
    }

    /// Whether the device makes buffers: those of a lost one are not valid, and nothing can be
    /// written to them. In a browser, lost devices say nothing.
    fn takes_work(&self) -> bool {
        if cfg!(target_family = "wasm") {
            return true;
        }
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("is the device lost"),
            size: 4,
            usage: wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, &[]);
        let error = pin!(scope.pop()).poll(&mut Context::from_waker(Waker::noop()));
        !matches!(error, Poll::Ready(Some(_)))
    }
}

/// Catches this thread's device errors until it is closed.
pub struct Scopes([wgpu::ErrorScopeGuard; 3]);

impl Scopes {
    pub fn open(device: &wgpu::Device) -> Self {
        Scopes([
            device.push_error_scope(wgpu::ErrorFilter::Internal),
            device.push_error_scope(wgpu::ErrorFilter::Validation),
            device.push_error_scope(wgpu::ErrorFilter::OutOfMemory),
        ])
    }

    /// Closes immediately. The future returns the first error; out-of-memory comes before the
    /// errors that follow from it.
    pub fn close(self) -> impl Future<Output = Result<(), Error>> {
        let [internal, validation, memory] = self.0;
        // Innermost first.
        let popped = (memory.pop(), validation.pop(), internal.pop());
        async move {
            let (memory, validation, internal) = popped;
            let errors = [memory.await, validation.await, internal.await];
            match errors.into_iter().flatten().next() {
                None => Ok(()),
                Some(wgpu::Error::OutOfMemory { source }) => Err(Error::Gpu {
                    what: format!("out of device memory: {source}"),
                }),
                Some(error) => Err(Error::Gpu {
                    what: error.to_string(),
                }),
            }
        }
    }
}
