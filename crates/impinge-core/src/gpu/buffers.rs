//! Typed buffers that grow.
//!
//! A [`Storage<T>`] is bound to kernels as [`Read<T>`] or [`Write<T>`], and kernels name the `T` of
//! each binding: two swapped buffers do not compile. A buffer never exceeds the device's binding
//! limit; the engine splits work that does not fit.

use std::future::Future;
use std::marker::PhantomData;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use bytemuck::Pod;

use super::device::{Device, Scopes};
use super::layout::Params;
use crate::scene::error::Error;

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

/// The first bytes of a buffer.
#[derive(Debug, Clone)]
pub struct Slice {
    /// The name of the buffer.
    pub label: &'static str,
    /// The buffer itself, which may be longer.
    pub buffer: wgpu::Buffer,
    /// How many bytes from the first on.
    pub bytes: u64,
}

/// What a launch binds.
#[derive(Debug, Clone)]
pub enum Bound {
    /// A storage buffer, or the first part of one.
    Buffer(Slice),
    /// A uniform: the parameters of the launch.
    Params(Params),
}

/// A binding that kernels only read.
#[derive(Debug, Clone)]
pub struct Read<T>(Slice, PhantomData<T>);

/// A binding that kernels write.
#[derive(Debug, Clone)]
pub struct Write<T>(Slice, PhantomData<T>);

/// The parameters of a launch.
#[derive(Debug, Clone)]
pub struct Uniform<T>(pub T);

/// Elements are numbered with 32 bits.
pub fn count(n: usize) -> u64 {
    n as u64
}

impl<T: Pod> Storage<T> {
    /// An empty buffer for these uses, and copies to and from it.
    pub fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Storage {
            label,
            // Any buffer can be read back, see `Launcher::run_each`.
            usage: usage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
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

    /// Binds exactly `len` elements; if it must grow, by a quarter more than needed. Growing loses
    /// the contents.
    ///
    /// # Errors
    /// More elements than one binding may hold.
    pub fn resize(&mut self, gpu: &Device, len: u64) -> Result<(), Error> {
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
        self.len = len;
        if self.buffer.is_none() || len > self.capacity {
            let spare = if self.capacity == 0 { 0 } else { len / 4 };
            self.allocate(gpu, (len + spare).min(limit));
        }
        Ok(())
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

    /// Holds exactly `data`.
    ///
    /// # Errors
    /// As [`resize`](Storage::resize).
    pub fn upload(&mut self, gpu: &Device, data: &[T]) -> Result<(), Error> {
        self.resize(gpu, count(data.len()))?;
        self.write(gpu, 0, data);
        Ok(())
    }

    /// Writes elements from `first` on, which must fit.
    pub fn write(&self, gpu: &Device, first: u64, data: &[T]) {
        if !data.is_empty() {
            let bytes = bytemuck::cast_slice(data);
            gpu.queue
                .write_buffer(self.buffer(), first * Self::SIZE, bytes);
        }
    }

    /// Has `len` elements written from `first` on, which must fit: by `fill`, straight into what is
    /// sent.
    pub fn write_with(
        &self,
        gpu: &Device,
        (first, len): (u64, u64),
        fill: impl FnOnce(wgpu::WriteOnly<'_, [u8]>),
    ) {
        let Some(size) = wgpu::BufferSize::new(len * Self::SIZE) else {
            return;
        };
        // What the device refuses goes to the open error scopes.
        let view = gpu
            .queue
            .write_buffer_with(self.buffer(), first * Self::SIZE, size);
        if let Some(mut view) = view {
            fill(view.slice(..));
        }
    }

    /// [`write_with`](Storage::write_with) by a command: after those that the encoder has already,
    /// where the queue would write before them.
    pub fn encode_with(
        &self,
        gpu: &Device,
        (first, len): (u64, u64),
        encoder: &mut wgpu::CommandEncoder,
        fill: impl FnOnce(wgpu::WriteOnly<'_, [u8]>),
    ) {
        let size = len * Self::SIZE;
        if size == 0 {
            return;
        }
        let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(self.label),
            size,
            usage: wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: true,
        });
        // What the device refuses goes to its owner.
        if let Ok(mut view) = staging.get_mapped_range_mut(..) {
            fill(view.slice(..));
        }
        staging.unmap();
        encoder.copy_buffer_to_buffer(&staging, 0, self.buffer(), first * Self::SIZE, size);
    }

    /// The underlying buffer; it exists from the first `resize` on.
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.buffer.as_ref().expect("resized before it is used")
    }

    /// The number of elements that are bound.
    #[expect(clippy::len_without_is_empty, reason = "there is always one element")]
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Bytes on the device, spare room included.
    pub fn bytes(&self) -> u64 {
        self.capacity * Self::SIZE
    }

    /// Binds all elements for reading.
    pub fn read(&self) -> Read<T> {
        Read(self.first(self.len), PhantomData)
    }

    /// Binds all elements for reading and writing.
    pub fn write_to(&self) -> Write<T> {
        Write(self.first(self.len), PhantomData)
    }

    /// The first `len` elements.
    pub fn first(&self, len: u64) -> Slice {
        Slice {
            label: self.label,
            buffer: self.buffer().clone(),
            bytes: len * Self::SIZE,
        }
    }

    /// All elements.
    pub fn all(&self) -> Slice {
        self.first(self.len)
    }
}

impl<T> Read<T> {
    /// Binds the first bytes of a buffer of the caller's for reading.
    pub fn of_caller(slice: Slice) -> Self {
        Read(slice, PhantomData)
    }
}

impl<T> Write<T> {
    /// Binds the first bytes of a buffer of the caller's for reading and writing.
    pub fn of_caller(slice: Slice) -> Self {
        Write(slice, PhantomData)
    }
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
    /// What is bound: a part of a buffer, or the parameters.
    fn bound(&self) -> Bound;
}

impl<T: Pod> Binding for Read<T> {
    const ACCESS: Access = Access::Read;
    const STRIDE: u64 = size_of::<T>() as u64;
    fn bound(&self) -> Bound {
        Bound::Buffer(self.0.clone())
    }
}

impl<T: Pod> Binding for Write<T> {
    const ACCESS: Access = Access::Write;
    const STRIDE: u64 = size_of::<T>() as u64;
    fn bound(&self) -> Bound {
        Bound::Buffer(self.0.clone())
    }
}

impl Binding for Uniform<Params> {
    const ACCESS: Access = Access::Uniform;
    const STRIDE: u64 = size_of::<Params>() as u64;
    fn bound(&self) -> Bound {
        Bound::Params(self.0)
    }
}

/// Waits for the device and reads the first bytes of a buffer.
///
/// # Errors
/// Device errors.
pub async fn read(gpu: &Device, slice: &Slice) -> Result<Vec<u8>, Error> {
    let scopes = Scopes::open(&gpu.device);
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(slice.label),
        size: slice.bytes,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(&slice.buffer, 0, &staging, 0, slice.bytes);
    gpu.queue.submit([encoder.finish()]);
    scopes.close().await?;
    let view = map(gpu, &staging, slice.bytes).await?;
    Ok(view.to_vec())
}

/// Maps the first bytes of a buffer for reading.
///
/// # Errors
/// Device errors.
pub async fn map(
    gpu: &Device,
    buffer: &wgpu::Buffer,
    bytes: u64,
) -> Result<wgpu::BufferView, Error> {
    // What a lost device refuses goes to the scopes, and would end the program without them.
    let scopes = Scopes::open(&gpu.device);
    let mapping = Mapping::default();
    let shared = Arc::clone(&mapping.0);
    buffer.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
        let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
        shared.result = Some(result);
        if let Some(waker) = shared.waker.take() {
            waker.wake();
        }
    });
    scopes.close().await?;
    // It may have been lost meanwhile.
    let failed = |what: String| match gpu.check_lost() {
        Ok(()) => Error::Gpu { what },
        Err(lost) => lost,
    };
    mapping.await.map_err(|error| failed(error.to_string()))?;
    buffer
        .get_mapped_range(0..bytes)
        .map_err(|error| failed(error.to_string()))
}

#[derive(Debug, Default)]
struct MappingState {
    result: Option<Result<(), wgpu::BufferAsyncError>>,
    waker: Option<Waker>,
}

/// Ready when the device has called back.
#[derive(Debug, Default)]
struct Mapping(Arc<Mutex<MappingState>>);

impl Future for Mapping {
    type Output = Result<(), wgpu::BufferAsyncError>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match state.result.take() {
            Some(result) => Poll::Ready(result),
            None => {
                state.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}
