//! A device of the caller's, and buffers on it.

use impinge_core::{Detector, Settings, wgpu};

/// A device of the caller's.
pub struct Caller {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
}

impl Caller {
    pub fn new() -> Self {
        Caller::with(wgpu::Limits::default())
    }

    /// A device with these limits.
    pub fn with(required_limits: wgpu::Limits) -> Self {
        let instance = wgpu::Instance::default();
        let adapter = pollster::block_on(instance.request_adapter(&Default::default()));
        let adapter = adapter.expect("these tests need a GPU or a software driver");
        let device = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            required_limits,
            ..Default::default()
        }));
        let (device, queue) = device.expect("a device");
        Caller { device, queue }
    }

    pub fn detector(&self, settings: Settings) -> Detector {
        let (device, queue) = (self.device.clone(), self.queue.clone());
        Detector::new(settings.on_device(device, queue)).expect("settings")
    }

    /// A detector that has a line of a kernel replaced: the kernel, the line, and what is there
    /// instead.
    pub fn damaged(&self, settings: Settings, damage: (&str, &str, &str)) -> Detector {
        let (device, queue) = (self.device.clone(), self.queue.clone());
        Detector::with_damage(device, queue, settings, damage).expect("the kernel has this line")
    }

    pub fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&Default::default())
    }

    pub fn buffer(&self, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    /// Positions on the device, which kernels may read and write too.
    pub fn upload(&self, positions: &[[f32; 3]]) -> wgpu::Buffer {
        use wgpu::BufferUsages as Usage;
        let bytes: Vec<u8> = positions
            .as_flattened()
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let usage = Usage::COPY_SRC | Usage::COPY_DST | Usage::STORAGE;
        let buffer = self.buffer(bytes.len() as u64, usage);
        self.queue.write_buffer(&buffer, 0, &bytes);
        buffer
    }

    /// Words of a buffer on the device.
    pub fn read(&self, buffer: &wgpu::Buffer) -> Vec<u32> {
        use wgpu::BufferUsages as Usage;
        let staging = self.buffer(buffer.size(), Usage::MAP_READ | Usage::COPY_DST);
        let mut encoder = self.encoder();
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
        self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| ());
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        polled.expect("the device runs");
        let view = staging.get_mapped_range(..).expect("mapped");
        let words = view.as_chunks::<4>().0.iter();
        words.map(|word| u32::from_le_bytes(*word)).collect()
    }
}
