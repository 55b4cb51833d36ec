//! The part of the window that shows the bodies: a texture that is drawn when something has
//! changed.

use std::sync::{Arc, Mutex, PoisonError};

use eframe::egui;
use egui_wgpu::RenderState;
use impinge::Detector;
use impinge_render::{Faces, Live, Look, Orbit, wgpu};

use crate::stage::Stage;

/// egui takes textures in this format for what they are: sRGB numbers.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Draws bodies for egui.
pub(crate) struct Screen {
    state: RenderState,
    pub live: Live,
    target: Option<Target>,
    errors: Arc<Mutex<Option<String>>>,
}

struct Target {
    size: [u32; 2],
    view: wgpu::TextureView,
    id: egui::TextureId,
}

impl Screen {
    /// A screen on the device of the window.
    pub fn new(state: RenderState) -> Result<Self, String> {
        let errors = Arc::new(Mutex::new(None));
        let to = Arc::clone(&errors);
        state
            .device
            .on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
                keep_first(&to, error.to_string());
            }));
        let to = Arc::clone(&errors);
        state.device.set_device_lost_callback(move |_, text| {
            keep_first(&to, format!("the device is lost: {text}"));
        });
        // Four samples cost a software driver more than everything else together.
        let is_software = state.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        let samples = if is_software { 1 } else { 4 };
        let (device, queue) = (state.device.clone(), state.queue.clone());
        let live = Live::new(device, queue, FORMAT, samples).map_err(|error| error.to_string())?;
        Ok(Screen {
            state,
            live,
            target: None,
            errors,
        })
    }

    /// The device for detection and pictures.
    pub fn device(&self) -> (wgpu::Device, wgpu::Queue) {
        (self.state.device.clone(), self.state.queue.clone())
    }

    /// The first error of the device since the last call.
    pub fn take_error(&self) -> Option<String> {
        // Without this, a loss would be told only when the next work is done, and there may be
        // none.
        let _ = self.state.device.poll(wgpu::PollType::Poll);
        let mut held = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
        held.take()
    }

    /// Shows the bodies of a stage and no others.
    pub fn show(&mut self, stage: &Stage) -> Result<(), String> {
        self.live.clear();
        if let Some(bounds) = stage.bounds(None) {
            self.live.set_bounds(bounds);
        }
        for shown in &stage.content.bodies {
            let body = stage
                .scene()
                .body(shown.id)
                .map_err(|error| error.to_string())?;
            self.live
                .add(Faces::of_body(body), shown.colors)
                .map_err(|error| format!("{}: {error}", shown.name))?;
        }
        self.send_positions(stage, None)
    }

    /// Sends the positions of all bodies, except those that a detector already has on the device:
    /// these are copied there.
    pub fn send_positions(
        &mut self,
        stage: &Stage,
        mut detector: Option<&mut Detector>,
    ) -> Result<(), String> {
        let device = &self.state.device;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (ix, shown) in stage.content.bodies.iter().enumerate() {
            let body = stage
                .scene()
                .body(shown.id)
                .map_err(|error| error.to_string())?;
            let gpu = detector.as_deref_mut().and_then(Detector::gpu);
            let there = gpu.and_then(|gpu| gpu.positions(stage.scene(), shown.id));
            let copied = there.is_some_and(|(buffer, offset)| {
                let copied = self.live.copy_positions(&mut encoder, ix, &buffer, offset);
                copied.is_ok()
            });
            if !copied {
                self.live
                    .set_positions(ix, body.positions())
                    .map_err(|error| error.to_string())?;
            }
        }
        self.state.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Whether the texture has this size.
    pub fn has_size(&self, size: [u32; 2]) -> bool {
        self.target.as_ref().is_some_and(|held| held.size == size)
    }

    /// Draws everything; returns the texture.
    pub fn draw(
        &mut self,
        size: [u32; 2],
        orbit: &Orbit,
        look: &Look,
    ) -> Result<egui::TextureId, String> {
        let most = self.state.device.limits().max_texture_dimension_2d;
        let size = size.map(|x| x.clamp(1, most));
        let (view, id) = match &self.target {
            Some(held) if held.size == size => (held.view.clone(), held.id),
            _ => self.make_target(size),
        };
        let mut encoder = self
            .state
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.live
            .encode(&mut encoder, &view, size, orbit, look)
            .map_err(|error| error.to_string())?;
        self.state.queue.submit([encoder.finish()]);
        Ok(id)
    }

    /// The texture as it was drawn last.
    pub fn drawn(&self) -> Option<egui::TextureId> {
        self.target.as_ref().map(|target| target.id)
    }

    /// Another texture in the place of the one that is held.
    fn make_target(&mut self, size: [u32; 2]) -> (wgpu::TextureView, egui::TextureId) {
        let mut renderer = self.state.renderer.write();
        if let Some(old) = self.target.take() {
            renderer.free_texture(&old.id);
        }
        let device = &self.state.device;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("bodies"),
            size: wgpu::Extent3d {
                width: size[0],
                height: size[1],
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let id = renderer.register_native_texture(device, &view, wgpu::FilterMode::Nearest);
        self.target = Some(Target {
            size,
            view: view.clone(),
            id,
        });
        (view, id)
    }
}

fn keep_first(to: &Mutex<Option<String>>, text: String) {
    let mut held = to.lock().unwrap_or_else(PoisonError::into_inner);
    held.get_or_insert(text);
}
