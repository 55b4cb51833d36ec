//! The shaders with what they bind, and the textures that they draw to.

use bytemuck::{Pod, Zeroable};
use impinge::wgpu;

use crate::corners::{CORNER, FACE_BYTES};

/// What all shaders know: `frame.wgsl` has the same.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FrameUniform {
    pub right: [f32; 4],
    pub up: [f32; 4],
    pub back: [f32; 4],
    pub projection: [f32; 4],
    /// `w` is 1 in perspective, else 0.
    pub sky: [f32; 4],
    pub background_top: [f32; 4],
    pub background_bottom: [f32; 4],
    /// Width and height of the picture; column and row at which the tile begins.
    pub picture: [f32; 4],
    /// Radius in the scene; largest radius in pixels; strength of occlusion; how far hidden faces are seen.
    pub amounts: [f32; 4],
}

/// The text of every shader.
pub(crate) const SHADERS: [(&str, &str); 3] = [
    (
        "surface",
        concat!(
            include_str!("shaders/frame.wgsl"),
            include_str!("shaders/surface.wgsl")
        ),
    ),
    (
        "occlusion",
        concat!(
            include_str!("shaders/frame.wgsl"),
            include_str!("shaders/occlusion.wgsl")
        ),
    ),
    (
        "composite",
        concat!(
            include_str!("shaders/frame.wgsl"),
            include_str!("shaders/composite.wgsl")
        ),
    ),
];

const SAMPLES: u32 = 4;
const LIGHT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Occlusion and distance.
const OCCLUSION: wgpu::TextureFormat = wgpu::TextureFormat::Rg16Float;
const PIXELS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// The compiled shaders.
#[derive(Debug)]
pub(crate) struct Pipelines {
    /// All faces.
    surface: wgpu::RenderPipeline,
    /// Faces that show through, a little nearer, so that they win against faces in the same place.
    raised: wgpu::RenderPipeline,
    occlusion: wgpu::RenderPipeline,
    composite: wgpu::RenderPipeline,
    frame_layout: wgpu::BindGroupLayout,
    occlusion_layout: wgpu::BindGroupLayout,
    composite_layout: wgpu::BindGroupLayout,
}

impl Pipelines {
    /// Compiles; errors go to the error scopes that are open.
    pub fn new(device: &wgpu::Device) -> Self {
        let depth = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Depth,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: true,
        };
        let float = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let frame_layout = layout(device, &[]);
        let occlusion_layout = layout(device, &[depth]);
        let composite_layout = layout(device, &[float, float, float]);
        let [surface, occlusion, composite] = SHADERS.map(|(name, text)| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            })
        });
        let faces = |bias| pipeline(device, &surface, &frame_layout, LIGHT, Some(bias));
        Pipelines {
            surface: faces(wgpu::DepthBiasState::default()),
            raised: faces(wgpu::DepthBiasState {
                constant: -2,
                slope_scale: -0.5,
                clamp: 0.0,
            }),
            occlusion: pipeline(device, &occlusion, &occlusion_layout, OCCLUSION, None),
            composite: pipeline(device, &composite, &composite_layout, PIXELS, None),
            frame_layout,
            occlusion_layout,
            composite_layout,
        }
    }
}

/// The frame's uniform, then textures for the fragment shader.
fn layout(device: &wgpu::Device, textures: &[wgpu::BindingType]) -> wgpu::BindGroupLayout {
    let uniform = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: wgpu::BufferSize::new(size_of::<FrameUniform>() as u64),
    };
    let entries: Vec<wgpu::BindGroupLayoutEntry> = (0u32..)
        .zip([uniform].iter().chain(textures))
        .map(|(binding, &ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty,
            count: None,
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}

/// Draws faces with depth and samples where there is a bias, else one triangle over all pixels.
fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    layout: &wgpu::BindGroupLayout,
    format: wgpu::TextureFormat,
    faces: Option<wgpu::DepthBiasState>,
) -> wgpu::RenderPipeline {
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let corners = [Some(wgpu::VertexBufferLayout {
        array_stride: FACE_BYTES / 3,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &CORNER,
    })];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&pipeline_layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: if faces.is_some() { &corners } else { &[] },
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: faces.map(|bias| wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
            stencil: wgpu::StencilState::default(),
            bias,
        }),
        multisample: wgpu::MultisampleState {
            count: if faces.is_some() { SAMPLES } else { 1 },
            ..Default::default()
        },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Faces on the device: the plain ones, and those that show through.
#[derive(Debug, Default)]
pub(crate) struct Chunks {
    pub plain: Vec<wgpu::Buffer>,
    pub raised: Vec<wgpu::Buffer>,
}

/// The textures of a tile, and what binds them.
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
    /// Of a tile of this width and height.
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

    /// Where the picture's pixels are read from: rows of [`row_bytes`](Self::row_bytes).
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
        // Before the depths are overwritten.
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
        // The whole picture, of which the tile is a part: so tiles fit together.
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

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use naga::{AddressSpace, TypeInner};

    use super::*;

    #[test]
    fn shaders_are_valid_and_know_the_frame_as_the_host_does() {
        for (name, text) in SHADERS {
            let module = naga::front::wgsl::parse_str(text)
                .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(text)));
            Validator::new(ValidationFlags::all(), Capabilities::empty())
                .validate(&module)
                .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(text)));
            let (_, uniform) = module
                .global_variables
                .iter()
                .find(|(_, variable)| variable.space == AddressSpace::Uniform)
                .expect(name);
            let TypeInner::Struct { members, span } = &module.types[uniform.ty].inner else {
                panic!("{name}: the frame is a struct");
            };
            assert_eq!(*span as usize, size_of::<FrameUniform>(), "{name}");
            let offsets = std::mem::offset_of!(FrameUniform, right)..;
            let names =
                "right up back projection sky background_top background_bottom picture amounts";
            for ((member, name), offset) in members
                .iter()
                .zip(names.split(' '))
                .zip(offsets.step_by(16))
            {
                assert_eq!(member.name.as_deref(), Some(name));
                assert_eq!(member.offset as usize, offset);
            }
            assert_eq!(members.len(), names.split(' ').count());
        }
    }
}
