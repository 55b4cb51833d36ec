//! The compiled shaders and their bindings.

use bytemuck::{Pod, Zeroable};
use impinge::wgpu;

use crate::corners::{CORNER, FACE_BYTES};

/// Uniform data of all shaders: `frame.wgsl` has the same struct.
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
    /// Width and height of the picture; first column and row of the tile.
    pub picture: [f32; 4],
    /// Occlusion's radius in the scene; its largest radius in pixels; its strength; the visibility
    /// of hidden faces.
    pub amounts: [f32; 4],
}

/// Names and texts of all shaders.
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

/// The name and the text of every shader that this crate compiles, for compilers other than naga to
/// check.
pub fn shaders() -> impl Iterator<Item = (&'static str, String)> {
    let all = SHADERS.into_iter().chain(crate::live::SHADERS);
    all.map(|(name, text)| (name, text.to_owned()))
}

pub(crate) const SAMPLES: u32 = 4;
pub(crate) const LIGHT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Occlusion and distance.
pub(crate) const OCCLUSION: wgpu::TextureFormat = wgpu::TextureFormat::Rg16Float;
pub(crate) const PIXELS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// The compiled shaders.
#[derive(Debug)]
pub(crate) struct Pipelines {
    /// All faces.
    pub surface: wgpu::RenderPipeline,
    /// Faces that show through. They are drawn slightly nearer, so that they win against faces in
    /// the same place.
    pub raised: wgpu::RenderPipeline,
    pub occlusion: wgpu::RenderPipeline,
    pub composite: wgpu::RenderPipeline,
    pub frame_layout: wgpu::BindGroupLayout,
    pub occlusion_layout: wgpu::BindGroupLayout,
    pub composite_layout: wgpu::BindGroupLayout,
}

impl Pipelines {
    /// Compiles the shaders; errors go to the open error scopes.
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
                constant: -8,
                // No bias by slope: it would raise steep sides of tetrahedra out of the body.
                ..Default::default()
            }),
            occlusion: pipeline(device, &occlusion, &occlusion_layout, OCCLUSION, None),
            composite: pipeline(device, &composite, &composite_layout, PIXELS, None),
            frame_layout,
            occlusion_layout,
            composite_layout,
        }
    }
}

/// The layout of the frame's uniform, followed by textures for the fragment shader.
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

/// With a bias, a pipeline that draws faces with depth and multisampling; without, one triangle
/// over all pixels.
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

#[cfg(test)]
pub(crate) mod tests {
    use naga::AddressSpace::Uniform;
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use naga::{StructMember, TypeInner};

    use super::*;

    /// Names and offsets of the members of a struct, and its size.
    pub type Layout = (Vec<(String, usize)>, usize);

    /// The layout of a struct of the host with all of its members.
    macro_rules! layout_here {
        ($host:ident: $($name:ident)*) => {
            (
                vec![$((stringify!($name).to_owned(), std::mem::offset_of!($host, $name))),*],
                size_of::<$host>(),
            )
        };
    }
    pub(crate) use layout_here;

    /// The layout of a uniform of that type in a valid shader.
    pub fn layout_in(shader: &str, uniform: &str) -> Option<Layout> {
        let (_, text) = shaders().find(|(name, _)| *name == shader)?;
        let module = naga::front::wgsl::parse_str(&text)
            .unwrap_or_else(|error| panic!("{shader}: {}", error.emit_to_string(&text)));
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|error| panic!("{shader}: {}", error.emit_to_string(&text)));
        let uniforms = module.global_variables.iter();
        let mut types = uniforms
            .filter(|(_, variable)| variable.space == Uniform)
            .map(|(_, variable)| &module.types[variable.ty]);
        let ty = types.find(|ty| ty.name.as_deref() == Some(uniform))?;
        let TypeInner::Struct { members, span } = &ty.inner else {
            return None;
        };
        let member = |member: &StructMember| {
            let name = member.name.clone().unwrap_or_default();
            (name, member.offset as usize)
        };
        Some((members.iter().map(member).collect(), *span as usize))
    }

    #[test]
    fn shaders_are_valid_and_know_the_frame_as_the_host_does() {
        let frame = layout_here!(FrameUniform: right up back projection sky background_top
            background_bottom picture amounts);
        for (name, _) in SHADERS {
            assert_eq!(layout_in(name, "Frame"), Some(frame.clone()), "{name}");
        }
    }
}
