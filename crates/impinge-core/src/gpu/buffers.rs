//! Typed buffers that grow.
//!
//! A [`Storage<T>`] is bound to kernels as [`Read<T>`] or [`Write<T>`], and kernels name the `T` of
//! each binding: two swapped buffers do not compile. A buffer never exceeds the device's binding limit;
//! the engine splits work that does not fit.

use std::marker::PhantomData;

use bytemuck::Pod;

use super::device::Device;
use super::layout::{Params, Step};
use crate::error::Error;

/// A device buffer of `T`, at least one element long.
#[derive(Debug)]
pub struct Storage<T> {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
    /// The number of elements that are bound.
    len: u64,
    /// The number of elements that there is room for.
    capacity: u64,
    holds: PhantomData<T>,
}

/// A binding that kernels only read.
#[derive(Debug, Clone)]
pub struct Read<T>(wgpu::Buffer, u64, PhantomData<T>);

/// A binding that kernels write.
#[derive(Debug, Clone)]
pub struct Write<T>(wgpu::Buffer, u64, PhantomData<T>);

/// A binding of one `T` that is constant during a dispatch, at an offset given with the dispatch.
#[derive(Debug, Clone)]
pub struct Uniform<T>(wgpu::Buffer, PhantomData<T>);

/// Elements are numbered with 32 bits.
pub fn count(n: usize) -> u64 {
    n as u64
}

impl<T: Pod> Storage<T> {
    pub fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Storage {
            label,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            buffer: None,
            len: 0,
            capacity: 0,
            holds: PhantomData,
        }
    }

    /// A buffer that kernels read or write.
    pub fn plain(label: &'static str) -> Self {
        Storage::new(label, wgpu::BufferUsages::STORAGE)
    }

    const SIZE: u64 = size_of::<T>() as u64;

    /// The most elements that one binding may hold on this device.
    pub fn limit(gpu: &Device) -> u64 {
        (gpu.max_binding() / Self::SIZE).min(u64::from(u32::MAX))
    }

    /// Binds exactly `len` elements; if it must grow, by a quarter more than needed. Growing loses the
    /// contents. Returns whether the bound buffer or its bound length has changed.
    ///
    /// # Errors
    /// More elements than one binding may hold.
    pub fn resize(&mut self, gpu: &Device, len: u64) -> Result<bool, Error> {
        let limit = Self::limit(gpu);
        if len > limit {
            return Err(Error::Gpu {
                what: format!(
                    "{}: {len} elements of {} bytes needed, but {} binds at most {} bytes",
                    self.label,
                    Self::SIZE,
                    gpu.name(),
                    gpu.max_binding()
                ),
            });
        }
        let len = len.max(1);
        let is_other = self.buffer.is_none() || len != self.len;
        self.len = len;
        if self.buffer.is_none() || len > self.capacity {
            let spare = if self.capacity == 0 { 0 } else { len / 4 };
            self.allocate(gpu, (len + spare).min(limit));
        }
        Ok(is_other)
    }

    /// Binds exactly `len` elements with no room to spare, whatever size it had.
    pub fn resize_exactly(&mut self, gpu: &Device, len: u64) {
        self.len = len.clamp(1, Self::limit(gpu));
        if self.capacity != self.len {
            self.allocate(gpu, self.len);
        }
    }

    fn allocate(&mut self, gpu: &Device, capacity: u64) {
        // Free the old buffer first: both together may not fit.
        self.buffer = None;
        self.capacity = capacity;
        self.buffer = Some(gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(self.label),
            size: (capacity * Self::SIZE).next_multiple_of(4),
            usage: self.usage,
            mapped_at_creation: false,
        }));
    }

    /// Holds exactly `data`. Returns as [`resize`](Storage::resize).
    ///
    /// # Errors
    /// As [`resize`](Storage::resize).
    pub fn upload(&mut self, gpu: &Device, data: &[T]) -> Result<bool, Error> {
        let grew = self.resize(gpu, count(data.len()))?;
        self.write(gpu, 0, data);
        Ok(grew)
    }

    /// Writes elements from `first` on, which must fit.
    pub fn write(&self, gpu: &Device, first: u64, data: &[T]) {
        if !data.is_empty() {
            let bytes = bytemuck::cast_slice(data);
            gpu.queue
                .write_buffer(self.buffer(), first * Self::SIZE, bytes);
        }
    }

    /// The underlying buffer; it exists from the first `resize` on.
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.buffer.as_ref().expect("resized before it is used")
    }

    #[expect(clippy::len_without_is_empty, reason = "there is always one element")]
    pub fn len(&self) -> u64 {
        self.len
    }

    pub fn bytes(&self) -> u64 {
        self.capacity * Self::SIZE
    }

    pub fn read(&self) -> Read<T> {
        Read(self.buffer().clone(), self.len * Self::SIZE, PhantomData)
    }

    pub fn write_to(&self) -> Write<T> {
        Write(self.buffer().clone(), self.len * Self::SIZE, PhantomData)
    }
}

impl Storage<Step> {
    /// The parameters of all steps; a dispatch chooses one by its offset.
    pub fn params(&self) -> Uniform<Params> {
        Uniform(self.buffer().clone(), PhantomData)
    }
}

fn resource(buffer: &wgpu::Buffer, size: u64) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::Buffer(wgpu::BufferBinding {
        buffer,
        offset: 0,
        size: wgpu::BufferSize::new(size),
    })
}

/// How a kernel uses a binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// `var<storage, read>`
    Read,
    /// `var<storage, read_write>`
    Write,
    /// `var<uniform>` at a dynamic offset.
    Uniform,
}

/// One of the three kinds of bindings.
pub trait Binding {
    /// How the kernel uses it.
    const ACCESS: Access;
    /// Bytes of one element.
    const STRIDE: u64;
    fn resource(&self) -> wgpu::BindingResource<'_>;
}

impl<T: Pod> Binding for Read<T> {
    const ACCESS: Access = Access::Read;
    const STRIDE: u64 = size_of::<T>() as u64;
    fn resource(&self) -> wgpu::BindingResource<'_> {
        resource(&self.0, self.1)
    }
}

impl<T: Pod> Binding for Write<T> {
    const ACCESS: Access = Access::Write;
    const STRIDE: u64 = size_of::<T>() as u64;
    fn resource(&self) -> wgpu::BindingResource<'_> {
        resource(&self.0, self.1)
    }
}

impl<T: Pod> Binding for Uniform<T> {
    const ACCESS: Access = Access::Uniform;
    const STRIDE: u64 = size_of::<T>() as u64;
    fn resource(&self) -> wgpu::BindingResource<'_> {
        resource(&self.0, Self::STRIDE)
    }
}
