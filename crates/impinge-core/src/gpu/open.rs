//! Finds adapters, and opens one device per adapter for all detectors that use it.

use std::fmt;
use std::ops::Deref;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use super::device::{Device, DeviceInfo, STORAGE_BUFFERS, describe, suffices};
use super::kernels::Kernels;
use super::pipeline::Source;
use super::waiting::wait;
use crate::scene::error::Error;

/// The adapters on this machine that can run the kernels, hardware first. Empty in a browser, where
/// a program cannot wait for the answer: use [`devices_async`].
pub fn devices() -> Vec<DeviceInfo> {
    wait(async { Ok(devices_async().await) }).unwrap_or_default()
}

/// [`devices`] without blocking. A browser has one adapter at most.
pub async fn devices_async() -> Vec<DeviceInfo> {
    let adapters = adapters().await;
    adapters.into_iter().map(|(_, info)| info).collect()
}

async fn adapters() -> Vec<(wgpu::Adapter, DeviceInfo)> {
    if wgpu::Instance::enabled_backend_features().is_empty() {
        return Vec::new();
    }
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| {
        wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::PRIMARY,
            // Indirect arguments need no validation: they come from our own kernel, which keeps to
            // the limits.
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        })
    });
    let found = instance.enumerate_adapters(wgpu::Backends::PRIMARY).await;
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

/// Whether the system may have a GPU. On Linux every GPU driver makes a device file. If there is
/// none, no driver is loaded at all, because software drivers write to standard error when loaded.
fn may_have_hardware() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    // Direct rendering (most drivers), NVIDIA, AMD compute, Windows' subsystem for Linux, Mali,
    // Adreno, PowerVR.
    let of_drivers = [
        "dri",
        "nvidiactl",
        "nvidia0",
        "kfd",
        "dxg",
        "mali0",
        "kgsl-3d0",
        "pvr_sync",
    ];
    let dev = std::path::Path::new("/dev");
    of_drivers.iter().any(|name| dev.join(name).exists())
}

/// A device and its kernels, compiled when first needed. Detectors on the same adapter share one.
pub struct GpuContext {
    opened: Device,
    pub(crate) kernels: Kernels,
}

impl fmt::Debug for GpuContext {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.opened.fmt(f)
    }
}

impl Deref for GpuContext {
    type Target = Device;

    fn deref(&self) -> &Device {
        &self.opened
    }
}

/// Which adapters are acceptable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WantedAdapter<'a> {
    /// Any, hardware before software.
    Any,
    /// Hardware only.
    Hardware,
    /// Those whose name contains this; upper and lower case are the same.
    Named(&'a str),
}

/// Devices in use, by name and interface.
static SHARED: Mutex<Vec<(DeviceInfo, Weak<GpuContext>)>> = Mutex::new(Vec::new());

impl GpuContext {
    /// Opens an adapter, or shares the device of another detector.
    ///
    /// # Errors
    /// No adapter fits; the driver refuses. Always an error in a browser.
    pub fn open(wanted: WantedAdapter<'_>) -> Result<Arc<GpuContext>, Error> {
        wait(GpuContext::open_async(wanted))
    }

    /// [`open`](GpuContext::open) without blocking.
    ///
    /// # Errors
    /// No adapter fits; the driver refuses.
    pub async fn open_async(wanted: WantedAdapter<'_>) -> Result<Arc<GpuContext>, Error> {
        if wanted == WantedAdapter::Hardware && !may_have_hardware() {
            let found = "none in hardware: the system has no device of a GPU".to_owned();
            return Err(Error::NoAdapter { found });
        }
        let adapters = adapters().await;
        let fits = |info: &DeviceInfo| match wanted {
            WantedAdapter::Any => true,
            WantedAdapter::Hardware => !info.is_software,
            WantedAdapter::Named(name) => info.name.to_lowercase().contains(&name.to_lowercase()),
        };
        let Some((adapter, info)) = adapters.iter().find(|(_, info)| fits(info)) else {
            let names: Vec<String> = adapters.iter().map(|(_, info)| info.to_string()).collect();
            let there = match &names[..] {
                [] => "there is none on this machine".to_owned(),
                names => format!("there are {}", names.join(", ")),
            };
            let found = match wanted {
                WantedAdapter::Any => there,
                WantedAdapter::Hardware => format!("none in hardware; {there}"),
                WantedAdapter::Named(name) => format!("none is called \"{name}\"; {there}"),
            };
            return Err(Error::NoAdapter { found });
        };
        if let Some(gpu) = GpuContext::shared(info) {
            return Ok(gpu);
        }
        // The lock is not held while the device is awaited, so another detector may have opened it
        // first.
        let gpu = Arc::new(GpuContext::request(adapter, info.clone()).await?);
        if let Some(gpu) = GpuContext::shared(info) {
            return Ok(gpu);
        }
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        shared.push((info.clone(), Arc::downgrade(&gpu)));
        Ok(gpu)
    }

    /// The device that another detector has opened on this adapter.
    fn shared(info: &DeviceInfo) -> Option<Arc<GpuContext>> {
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        shared.retain(|(_, gpu)| gpu.strong_count() > 0);
        shared
            .iter()
            .filter(|(known, _)| known == info)
            .find_map(|(_, gpu)| gpu.upgrade().filter(|gpu| gpu.check_lost().is_ok()))
    }

    async fn request(adapter: &wgpu::Adapter, info: DeviceInfo) -> Result<GpuContext, Error> {
        let offered = adapter.limits();
        // WebGPU's guaranteed minimum, but buffers as large as the adapter allows.
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
        let mut opened = Device::new(device, queue, info);
        opened.listen();
        Ok(GpuContext {
            opened,
            kernels: Kernels::new(|_| None),
        })
    }

    /// Wraps a device of the caller's. Its callbacks are not changed.
    ///
    /// # Errors
    /// It allows too little.
    pub fn of_caller(device: wgpu::Device, queue: wgpu::Queue) -> Result<GpuContext, Error> {
        GpuContext::of_caller_with(device, queue, |_| None)
    }

    /// The same, where `damage` may replace a kernel's text.
    pub(crate) fn of_caller_with(
        device: wgpu::Device,
        queue: wgpu::Queue,
        damage: impl Fn(&Source) -> Option<String>,
    ) -> Result<GpuContext, Error> {
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
        Ok(GpuContext {
            opened: Device::new(device, queue, info),
            kernels: Kernels::new(damage),
        })
    }
}
