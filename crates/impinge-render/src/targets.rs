//! The textures of a tile, and the passes that draw it: all faces; occlusion from their depths;
//! only the faces that show through; the composition of these.

use impinge::wgpu;

use crate::corners::FACE_BYTES;
use crate::pipelines::{DEPTH, FrameUniform, LIGHT, OCCLUSION, PIXELS, Pipelines, SAMPLES};

/// Faces on the device: plain faces, and faces that show through.
#[derive(Debug, Default)]
pub(crate) struct Chunks {
    pub plain: Vec<wgpu::Buffer>,
    pub raised: Vec<wgpu::Buffer>,
}

/// The textures of a tile and their bind groups.
#[derive(Debug)]
pub(crate) struct Targets {
    size: [u32; 2],
    samples: wgpu::TextureView,
    depth: wgpu::TextureView,
    scene: wgpu::TextureView,
    through: wgpu::TextureView,
    occlusion: wgpu::TextureView,
    pixels: wgpu::Texture,
    staging: wgpu::Buffer,
    uniform: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    occlusion_group: wgpu::BindGroup,
    composite_group: wgpu::BindGroup,
}

impl Targets {
    /// The textures of a tile of this width and height.
    pub fn new(device: &wgpu::Device, pipelines: &Pipelines, size: [u32; 2]) -> Self {
        let texture = |format, sample_count, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: extent(size),
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let view = |format, sample_count, usage| {
            texture(format, sample_count, usage).create_view(&Default::default())
        };
        let bound = wgpu::TextureUsages::TEXTURE_BINDING;
        let samples = view(LIGHT, SAMPLES, wgpu::TextureUsages::empty());
        let depth = view(DEPTH, SAMPLES, bound);
        let scene = view(LIGHT, 1, bound);
        let through = view(LIGHT, 1, bound);
        let occlusion = view(OCCLUSION, 1, bound);
        let buffer = |size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let uniform = buffer(
            size_of::<FrameUniform>() as u64,
            wgpu::BufferUsages::UNIFORM,
        );
        let group = |layout, views: &[&wgpu::TextureView]| {
            let textures = views
                .iter()
                .map(|view| wgpu::BindingResource::TextureView(view));
            let entries: Vec<wgpu::BindGroupEntry> = (0u32..)
                .zip([uniform.as_entire_binding()].into_iter().chain(textures))
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries: &entries,
            })
        };
        Targets {
            size,
            frame_group: group(&pipelines.frame_layout, &[]),
            occlusion_group: group(&pipelines.occlusion_layout, &[&depth]),
            composite_group: group(&pipelines.composite_layout, &[&scene, &through, &occlusion]),
            staging: buffer(
                row_bytes(size) * u64::from(size[1]),
                wgpu::BufferUsages::MAP_READ,
            ),
            pixels: texture(PIXELS, 1, wgpu::TextureUsages::COPY_SRC),
            uniform,
            samples,
            depth,
            scene,
            through,
            occlusion,
        }
    }

    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The buffer from which pixels are read back: rows of [`row_bytes`](Self::row_bytes).
    pub fn staging(&self) -> &wgpu::Buffer {
        &self.staging
    }

    /// Bytes from one row to the next.
    pub fn row_bytes(&self) -> u64 {
        row_bytes(self.size)
    }

    /// Draws a tile.
    pub fn draw(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pipelines: &Pipelines,
        chunks: &Chunks,
        frame: &FrameUniform,
    ) {
        queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(frame));
        let mut encoder = device.create_command_encoder(&Default::default());
        self.faces(
            &mut encoder,
            pipelines,
            &chunks.plain,
            &chunks.raised,
            &self.scene,
            frame,
        );
        let over_all = |encoder: &mut wgpu::CommandEncoder, pipeline, group, target| {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(clear(target, None))],
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.draw(0..3, 0..1);
        };
        // Occlusion reads the depths before the next pass overwrites them.
        over_all(
            &mut encoder,
            &pipelines.occlusion,
            &self.occlusion_group,
            &self.occlusion,
        );
        self.faces(
            &mut encoder,
            pipelines,
            &[],
            &chunks.raised,
            &self.through,
            frame,
        );
        let pixels = self.pixels.create_view(&Default::default());
        over_all(
            &mut encoder,
            &pipelines.composite,
            &self.composite_group,
            &pixels,
        );
        encoder.copy_texture_to_buffer(
            self.pixels.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    // A row of the largest texture has far fewer bytes than 2^32.
                    bytes_per_row: Some(self.row_bytes() as u32),
                    rows_per_image: None,
                },
            },
            extent(self.size),
        );
        queue.submit([encoder.finish()]);
    }

    fn faces(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipelines: &Pipelines,
        plain: &[wgpu::Buffer],
        raised: &[wgpu::Buffer],
        target: &wgpu::TextureView,
        frame: &FrameUniform,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(clear(&self.samples, Some(target)))],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        // The viewport is the whole picture, of which the tile is a part, so that tiles fit
        // together.
        let [width, height, x, y] = frame.picture;
        pass.set_viewport(-x, -y, width, height, 0.0, 1.0);
        pass.set_bind_group(0, &self.frame_group, &[]);
        for (pipeline, chunks) in [(&pipelines.surface, plain), (&pipelines.raised, raised)] {
            pass.set_pipeline(pipeline);
            for chunk in chunks {
                pass.set_vertex_buffer(0, chunk.slice(..));
                // A chunk has far fewer than 2^32 corners.
                let n_corners = 3 * (chunk.size() / FACE_BYTES) as u32;
                pass.draw(0..n_corners, 0..1);
            }
        }
    }
}

fn clear<'a>(
    view: &'a wgpu::TextureView,
    resolve_target: Option<&'a wgpu::TextureView>,
) -> wgpu::RenderPassColorAttachment<'a> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target,
        ops: wgpu::Operations {
            load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
            store: if resolve_target.is_some() {
                wgpu::StoreOp::Discard
            } else {
                wgpu::StoreOp::Store
            },
        },
    }
}

fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 1,
    }
}

fn row_bytes(size: [u32; 2]) -> u64 {
    (4 * u64::from(size[0])).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT.into())
}
