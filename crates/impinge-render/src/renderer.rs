//! From a picture to an image: faces in chunks, pixels in tiles.

use impinge::wgpu;

use crate::corners::{FACE_BYTES, chunks};
use crate::device::Gpu;
use crate::error::Error;
use crate::image::Image;
use crate::picture::Picture;
use crate::pipelines::{FrameUniform, Pipelines};
use crate::software::{BLUR, REACH, REACH_PIXELS};
use crate::targets::{Chunks, Targets};
use crate::view::{Frame, View};

/// Draws pictures on one device. Textures are reused from picture to picture.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    pipelines: Pipelines,
    targets: Option<Targets>,
    /// Width and height of a tile without its margins.
    tile: u32,
    /// Faces per chunk.
    n_faces: usize,
}

/// The most bytes in a chunk of faces.
const CHUNK: u64 = 64 << 20;
/// Width and height of a tile. With its margins it takes up to 300 MB of textures.
const TILE: u32 = 1536;

impl Renderer {
    /// A renderer on the first GPU, or on a software driver if there is none.
    ///
    /// # Errors
    /// No adapter; an error of the driver.
    pub fn new() -> Result<Self, Error> {
        Renderer::on(Gpu::open(None)?)
    }

    /// A renderer on the first adapter whose name contains `name`, ignoring case.
    ///
    /// # Errors
    /// No adapter has such a name; an error of the driver.
    pub fn on_device_named(name: &str) -> Result<Self, Error> {
        Renderer::on(Gpu::open(Some(name))?)
    }

    /// A renderer on the caller's device. `wgpu::Limits::downlevel_defaults` suffice.
    ///
    /// # Errors
    /// A shader does not compile on the device.
    pub fn with_device(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, Error> {
        Renderer::on(Gpu { device, queue })
    }

    fn on(gpu: Gpu) -> Result<Self, Error> {
        let limits = gpu.device.limits();
        let pipelines = gpu.scoped(|| Ok(Pipelines::new(&gpu.device)))?;
        Ok(Renderer {
            pipelines,
            targets: None,
            // Both are far from 0 for every device with at least the downlevel limits, which allow
            // textures of 2,048 pixels.
            tile: limits
                .max_texture_dimension_2d
                .saturating_sub(2 * (REACH_PIXELS + BLUR))
                .clamp(1, TILE),
            n_faces: (limits.max_buffer_size.min(CHUNK) / FACE_BYTES).max(1) as usize,
            gpu,
        })
    }

    /// The same renderer with smaller tiles and chunks, at least 1 pixel and 1 face. For tests.
    #[doc(hidden)]
    pub fn with_room(self, tile: u32, n_faces: usize) -> Self {
        Renderer {
            tile: tile.clamp(1, self.tile),
            n_faces: n_faces.clamp(1, self.n_faces),
            targets: None,
            ..self
        }
    }

    /// Draws a picture.
    ///
    /// # Errors
    /// A position that is not finite or an index out of range; a size of 0 or beyond the device's
    /// textures; a setting out of its range; errors of the device.
    pub fn render(&mut self, picture: &Picture) -> Result<Image, Error> {
        let [width, height] = picture.size;
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        if width.min(height) == 0 || width.max(height) > most {
            return Err(Error::Size {
                given: picture.size,
                allowed: format!("1 x 1 to {most} x {most}"),
            });
        }
        picture.check()?;
        let frame = Frame::of(picture);
        let view = View::of(picture, &frame);
        let chunks = self.upload(picture, &frame)?;
        let mut image = Image::new(picture.size);
        for row in (0..height).step_by(self.tile as usize) {
            for column in (0..width).step_by(self.tile as usize) {
                self.tile(picture, &view, &chunks, [column, row], &mut image)?;
            }
        }
        Ok(image)
    }

    /// Uploads all faces to the device.
    fn upload(&self, picture: &Picture, frame: &Frame) -> Result<Chunks, Error> {
        let Gpu { device, queue } = &self.gpu;
        let upload = |shows_through| {
            let mut buffers = Vec::new();
            let wanted = |face: &crate::Face| face.shows_through == shows_through;
            chunks(picture, frame, self.n_faces, wanted, |corners| {
                let bytes: &[u8] = bytemuck::cast_slice(corners);
                let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("faces"),
                    size: bytes.len() as u64,
                    usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                queue.write_buffer(&buffer, 0, bytes);
                // Submit now; otherwise all chunks would be held twice until the first tile is
                // drawn.
                queue.submit([]);
                buffers.push(buffer);
            });
            buffers
        };
        self.gpu.scoped(|| {
            Ok(Chunks {
                plain: upload(false),
                raised: upload(true),
            })
        })
    }

    /// Draws the tile that begins at column and row `begin` into the image. A margin around the
    /// tile is drawn too, as wide as the reach of occlusion.
    fn tile(
        &mut self,
        picture: &Picture,
        view: &View,
        chunks: &Chunks,
        begin: [u32; 2],
        image: &mut Image,
    ) -> Result<(), Error> {
        let margin = REACH_PIXELS.min(picture.size[1] / 4) + BLUR;
        let end: [u32; 2] = std::array::from_fn(|k| (begin[k] + self.tile).min(picture.size[k]));
        let drawn = begin.map(|x| x.saturating_sub(margin));
        let size: [u32; 2] =
            std::array::from_fn(|k| (end[k] + margin).min(picture.size[k]) - drawn[k]);
        let uniform = uniform(picture, view, drawn, margin - BLUR);
        let (gpu, pipelines) = (&self.gpu, &self.pipelines);
        if self.targets.as_ref().is_none_or(|old| old.size() != size) {
            // Drop the old textures first: both may not fit in memory.
            self.targets = None;
            let targets = gpu.scoped(|| Ok(Targets::new(&gpu.device, pipelines, size)))?;
            self.targets = Some(targets);
        }
        let Some(targets) = &self.targets else {
            return Ok(());
        };
        gpu.scoped(|| {
            targets.draw(&gpu.device, &gpu.queue, pipelines, chunks, &uniform);
            Ok(())
        })?;
        gpu.read(targets.staging(), |bytes| {
            for y in begin[1]..end[1] {
                let from = u64::from(y - drawn[1]) * targets.row_bytes()
                    + 4 * u64::from(begin[0] - drawn[0]);
                let from: &[[u8; 4]] = bytes[from as usize..].as_chunks().0;
                let n = (end[0] - begin[0]) as usize;
                image.row_mut(begin[0], y)[..n].copy_from_slice(&from[..n]);
            }
        })
    }
}

/// The uniform data of a tile that begins at `drawn`.
fn uniform(picture: &Picture, view: &View, drawn: [u32; 2], reach: u32) -> FrameUniform {
    let narrow = |v: [f64; 4]| v.map(|x| x as f32);
    let [right, up, back] = view.axes.map(narrow);
    let [x, y, z] = view.sky;
    let [top, bottom] = picture
        .background
        .map(|[r, g, b]| [r, g, b, 255].map(|x| f32::from(x) / 255.0));
    FrameUniform {
        right,
        up,
        back,
        projection: narrow(view.projection),
        sky: narrow([x, y, z, if view.is_perspective { 1.0 } else { 0.0 }]),
        background_top: top,
        background_bottom: bottom,
        // Sizes are far below 2^24.
        picture: [picture.size[0], picture.size[1], drawn[0], drawn[1]].map(|x| x as f32),
        amounts: [REACH, reach as f32, picture.occlusion, picture.see_through],
    }
}
