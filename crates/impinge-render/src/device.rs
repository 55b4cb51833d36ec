//! Adapters, the device, and their errors.

use std::sync::{Arc, Mutex, PoisonError};

use impinge::wgpu;

use crate::error::Error;

/// A device to draw with.
#[derive(Debug)]
pub(crate) struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
}

impl Gpu {
    /// Opens the first adapter whose name contains `name`, ignoring case; hardware before software.
    ///
    /// # Errors
    /// No adapter has such a name; the driver returns an error.
    pub fn open(name: Option<&str>) -> Result<Gpu, Error> {
        let mut adapters = adapters();
        adapters.sort_by_key(|adapter| adapter.get_info().device_type == wgpu::DeviceType::Cpu);
        let fits = |adapter: &&wgpu::Adapter| match name {
            None => true,
            Some(name) => {
                let own = adapter.get_info().name.to_lowercase();
                own.contains(&name.to_lowercase())
            }
        };
        let Some(adapter) = adapters.iter().find(fits) else {
            let names: Vec<String> = adapters
                .iter()
                .map(|adapter| adapter.get_info().name)
                .collect();
            let there = match &names[..] {
                [] => format!("there is none on this machine{}", advice()),
                names => format!("there are {}", names.join(", ")),
            };
            let found = match name {
                None => there,
                Some(name) => format!("none is called \"{name}\"; {there}"),
            };
            return Err(Error::NoAdapter { found });
        };
        let offered = adapter.limits();
        // wgpu's downlevel limits, but textures and buffers as large as the adapter allows.
        let required_limits = wgpu::Limits {
            max_buffer_size: offered.max_buffer_size,
            max_texture_dimension_2d: offered.max_texture_dimension_2d,
            ..wgpu::Limits::downlevel_defaults()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("impinge-render"),
            required_limits,
            ..Default::default()
        }))
        .map_err(|error| Error::Gpu {
            what: format!("{}: {error}", adapter.get_info().name),
        })?;
        Ok(Gpu { device, queue })
    }

    /// Runs `work` and catches the device's errors.
    ///
    /// # Errors
    /// Those of `work`, else the device's.
    pub fn scoped<T>(&self, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
        let [internal, validation, memory] = [
            wgpu::ErrorFilter::Internal,
            wgpu::ErrorFilter::Validation,
            wgpu::ErrorFilter::OutOfMemory,
        ]
        .map(|filter| self.device.push_error_scope(filter));
        let done = work();
        // Innermost scope first. Memory errors come first in the list, because they cause other
        // errors.
        let (memory, validation, internal) = (memory.pop(), validation.pop(), internal.pop());
        let errors = [memory, validation, internal].map(pollster::block_on);
        match errors.into_iter().flatten().next() {
            None => done,
            Some(wgpu::Error::OutOfMemory { source }) => Err(Error::Gpu {
                what: format!("out of device memory: {source}"),
            }),
            Some(error) => Err(Error::Gpu {
                what: error.to_string(),
            }),
        }
    }

    /// Waits for the device and reads a buffer.
    ///
    /// # Errors
    /// The device is lost, or cannot map the buffer.
    pub fn read<T>(
        &self,
        buffer: &wgpu::Buffer,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, Error> {
        let failed = |what: String| Error::Gpu { what };
        let mapped = Arc::new(Mutex::new(None));
        let told = Arc::clone(&mapped);
        buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        });
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| failed(error.to_string()))?;
        let result = mapped.lock().unwrap_or_else(PoisonError::into_inner).take();
        match result {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(failed(error.to_string())),
            None => return Err(failed("the device never mapped a buffer".to_owned())),
        }
        let view = buffer
            .get_mapped_range(..)
            .map_err(|error| failed(error.to_string()))?;
        let taken = take(&view);
        drop(view);
        buffer.unmap();
        Ok(taken)
    }
}

/// Advice for a machine without an adapter.
fn advice() -> &'static str {
    if cfg!(target_os = "linux") {
        "; install a Vulkan driver (a software one suffices: mesa-vulkan-drivers on Debian, Ubuntu and Fedora)"
    } else {
        ""
    }
}

/// All adapters that can draw.
fn adapters() -> Vec<wgpu::Adapter> {
    if wgpu::Instance::enabled_backend_features().is_empty() {
        return Vec::new();
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        flags: wgpu::InstanceFlags::empty(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
}
