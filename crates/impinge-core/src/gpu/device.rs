//! Adapters, devices, and what may go wrong with them.

use std::fmt;
use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};
use std::task::{Context, Poll, Waker};

use super::kernels::Kernels;
use super::pipeline::Source;
use crate::error::Error;

/// A GPU, or a driver that imitates one, on this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// Its name as the driver gives it. Any part of it chooses it in
    /// [`Settings::device`](crate::Settings::device).
    pub name: String,
    /// The programming interface: `"vulkan"`, `"metal"` or `"dx12"`.
    pub interface: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether it is a program on the CPU, which `Backend::Auto` passes over.
    pub is_software: bool,
    /// Bytes that one buffer binding may have.
    pub max_binding: u64,
}

impl fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.interface)
    }
}

/// The adapters on this machine that can run the kernels, hardware first.
pub fn devices() -> Vec<DeviceInfo> {
    adapters().iter().map(|(_, info)| info.clone()).collect()
}

/// What every adapter must have: the least that WebGPU promises.
const STORAGE_BUFFERS: u32 = 8;

fn adapters() -> Vec<(wgpu::Adapter, DeviceInfo)> {
    if wgpu::Instance::enabled_backend_features().is_empty() {
        return Vec::new();
    }
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| {
        wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::PRIMARY,
            // Indirect arguments come from our own kernel, which keeps to the limits.
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        })
    });
    let found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let mut adapters: Vec<_> = found
        .into_iter()
        .filter(|adapter| suffices(&adapter.limits()))
        .map(|adapter| {
            let info = describe(&adapter.get_info(), &adapter.limits());
            (adapter, info)
        })
        .collect();
    adapters.sort_by_key(|(_, info)| info.is_software);
    adapters
}

fn suffices(limits: &wgpu::Limits) -> bool {
    limits.max_storage_buffers_per_shader_stage >= STORAGE_BUFFERS
        && limits.max_compute_invocations_per_workgroup >= 256
        && limits.max_compute_workgroups_per_dimension >= 32_768
}

fn describe(info: &wgpu::AdapterInfo, limits: &wgpu::Limits) -> DeviceInfo {
    DeviceInfo {
        name: info.name.clone(),
        interface: info.backend.to_str().to_owned(),
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

/// A device with its kernels compiled. Detectors on the same adapter share one.
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    pub(crate) kernels: Kernels,
    /// Whether stages can be timed.
    pub has_timestamps: bool,
    info: DeviceInfo,
    lost: Arc<Mutex<Option<String>>>,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gpu").field("info", &self.info).finish()
    }
}

/// Which adapters come into question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted<'a> {
    /// Any, hardware before software.
    Any,
    /// Hardware only.
    Hardware,
    /// Those whose name contains this, whatever the case.
    Named(&'a str),
}

/// Devices in use, by name and interface.
static SHARED: Mutex<Vec<(DeviceInfo, Weak<Gpu>)>> = Mutex::new(Vec::new());

impl Gpu {
    /// Opens an adapter, or shares the device of another detector.
    ///
    /// # Errors
    /// No adapter fits; the driver refuses; a kernel does not compile.
    pub fn open(wanted: Wanted<'_>) -> Result<Arc<Gpu>, Error> {
        let adapters = adapters();
        let fits = |info: &DeviceInfo| match wanted {
            Wanted::Any => true,
            Wanted::Hardware => !info.is_software,
            Wanted::Named(name) => info.name.to_lowercase().contains(&name.to_lowercase()),
        };
        let Some((adapter, info)) = adapters.iter().find(|(_, info)| fits(info)) else {
            let names: Vec<String> = adapters.iter().map(|(_, info)| info.to_string()).collect();
            let there = match &names[..] {
                [] => "there is none on this machine".to_owned(),
                names => format!("there are {}", names.join(", ")),
            };
            let found = match wanted {
                Wanted::Any => there,
                Wanted::Hardware => format!("none in hardware; {there}"),
                Wanted::Named(name) => format!("none is called \"{name}\"; {there}"),
            };
            return Err(Error::NoAdapter { found });
        };
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        shared.retain(|(_, gpu)| gpu.strong_count() > 0);
        let open = shared
            .iter()
            .filter(|(known, _)| known == info)
            .find_map(|(_, gpu)| gpu.upgrade().filter(|gpu| gpu.check_lost().is_ok()));
        if let Some(gpu) = open {
            return Ok(gpu);
        }
        let gpu = Arc::new(pollster::block_on(Gpu::request(adapter, info.clone()))?);
        shared.push((info.clone(), Arc::downgrade(&gpu)));
        Ok(gpu)
    }

    async fn request(adapter: &wgpu::Adapter, info: DeviceInfo) -> Result<Gpu, Error> {
        let offered = adapter.limits();
        // The least that WebGPU promises, but buffers as large as the adapter has them.
        let required_limits = wgpu::Limits {
            max_buffer_size: offered.max_buffer_size,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
            ..wgpu::Limits::downlevel_defaults()
        };
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("impinge"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits,
            ..Default::default()
        });
        let (device, queue) = request.await.map_err(|error| Error::Gpu {
            what: format!("{info}: {error}"),
        })?;
        let gpu = Gpu::with_kernels(device, queue, info, Source::text).await?;
        let told = Arc::clone(&gpu.lost);
        gpu.device.set_device_lost_callback(move |reason, message| {
            let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
            *told = Some(format!("device lost ({reason:?}): {message}"));
        });
        Ok(gpu)
    }

    /// A device that is the caller's. Its callbacks are left alone.
    ///
    /// # Errors
    /// It allows too little; a kernel does not compile.
    pub fn of_caller(device: wgpu::Device, queue: wgpu::Queue) -> Result<Gpu, Error> {
        Gpu::of_caller_with(device, queue, Source::text)
    }

    /// The same with other texts than the kernels' own.
    pub(crate) fn of_caller_with(
        device: wgpu::Device,
        queue: wgpu::Queue,
        text: impl Fn(&Source) -> String,
    ) -> Result<Gpu, Error> {
        let limits = device.limits();
        if !suffices(&limits) {
            return Err(Error::Gpu {
                what: format!(
                    "the device allows {} storage buffers a stage, {} invocations a workgroup \
                     and {} workgroups along an axis; {STORAGE_BUFFERS}, 256 and 32768 are needed",
                    limits.max_storage_buffers_per_shader_stage,
                    limits.max_compute_invocations_per_workgroup,
                    limits.max_compute_workgroups_per_dimension,
                ),
            });
        }
        let info = describe(&device.adapter_info(), &limits);
        pollster::block_on(Gpu::with_kernels(device, queue, info, text))
    }

    async fn with_kernels(
        device: wgpu::Device,
        queue: wgpu::Queue,
        info: DeviceInfo,
        text: impl Fn(&Source) -> String,
    ) -> Result<Gpu, Error> {
        let scopes = Scopes::open(&device);
        let kernels = Kernels::new(&device, text);
        scopes.close().await?;
        Ok(Gpu {
            has_timestamps: device.features().contains(wgpu::Features::TIMESTAMP_QUERY),
            device,
            queue,
            kernels,
            info,
            lost: Arc::default(),
        })
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// Bytes that one binding may have.
    pub fn max_binding(&self) -> u64 {
        self.info.max_binding
    }

    /// Runs what makes things on the device, kernels above all.
    ///
    /// # Errors
    /// The first of the device's own.
    pub fn make<T>(&self, make: impl FnOnce(&wgpu::Device) -> T) -> Result<T, Error> {
        let scopes = Scopes::open(&self.device);
        let made = make(&self.device);
        self.block_on(scopes.close())?;
        Ok(made)
    }

    /// An error once the device is lost.
    pub fn check_lost(&self) -> Result<(), Error> {
        let lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner);
        match &*lost {
            Some(what) => Err(Error::Gpu { what: what.clone() }),
            None => Ok(()),
        }
    }

    /// Drives a future of this device to its end, waiting for the device whenever it must. The
    /// only place that blocks.
    ///
    /// # Errors
    /// Those of the future; a device that cannot be waited for.
    pub fn block_on<T>(&self, future: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
        let mut future = pin!(future);
        let mut context = Context::from_waker(Waker::noop());
        loop {
            if let Poll::Ready(result) = future.as_mut().poll(&mut context) {
                return result;
            }
            self.device
                .poll(wgpu::PollType::wait_indefinitely())
                .map_err(|error| Error::Gpu {
                    what: error.to_string(),
                })?;
            self.check_lost()?;
        }
    }
}

/// Catches the device's errors of this thread until it is closed.
pub struct Scopes([wgpu::ErrorScopeGuard; 3]);

impl Scopes {
    pub fn open(device: &wgpu::Device) -> Self {
        Scopes([
            device.push_error_scope(wgpu::ErrorFilter::Internal),
            device.push_error_scope(wgpu::ErrorFilter::Validation),
            device.push_error_scope(wgpu::ErrorFilter::OutOfMemory),
        ])
    }

    /// Closes at once; the future has the first error, memory before consequences.
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
