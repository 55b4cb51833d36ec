//! The live shaders and their bindings.

use bytemuck::{Pod, Zeroable};
use impinge::wgpu;

/// Uniform data of a frame: `View` of `live.wgsl`.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ViewUniform {
    pub right: [f32; 4],
    pub up: [f32; 4],
    pub back: [f32; 4],
    pub projection: [f32; 4],
    pub sky: [f32; 4],
    pub screen: [f32; 4],
    pub line: [f32; 4],
    pub only_marked: [u32; 4],
}

/// Uniform data of a body: `Body` of `live_faces.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BodyUniform {
    pub other: [f32; 4],
    pub marked: [f32; 4],
    pub has_colors: [u32; 4],
    pub place: [f32; 4],
}

/// Names and texts of the live shaders.
pub(crate) const SHADERS: [(&str, &str); 2] = [
    (
        "live_faces",
        concat!(
            include_str!("../shaders/live.wgsl"),
            include_str!("../shaders/live_faces.wgsl")
        ),
    ),
    (
        "live_lines",
        concat!(
            include_str!("../shaders/live.wgsl"),
            include_str!("../shaders/live_lines.wgsl")
        ),
    ),
];

pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Storage buffers that the vertex shader of faces reads.
pub(crate) const N_STORAGE_BUFFERS: u32 = 4;

/// The compiled shaders.
#[derive(Debug)]
pub(crate) struct Pipelines {
    /// All faces, or those that are marked.
    pub faces: wgpu::RenderPipeline,
    /// Marked faces that others hide.
    pub hidden_faces: wgpu::RenderPipeline,
    pub lines: wgpu::RenderPipeline,
    pub hidden_lines: wgpu::RenderPipeline,
    pub view_layout: wgpu::BindGroupLayout,
    pub body_layout: wgpu::BindGroupLayout,
    pub lines_layout: wgpu::BindGroupLayout,
}

impl Pipelines {
    /// Compiles the shaders; errors go to the open error scopes, or to the device's handler.
    pub fn new(device: &wgpu::Device, format: wgpu::TextureFormat, samples: u32) -> Self {
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let view_layout = layout(device, stages, Some(size_of::<ViewUniform>()), 0);
        let vertex = wgpu::ShaderStages::VERTEX;
        let body_layout = layout(
            device,
            vertex,
            Some(size_of::<BodyUniform>()),
            N_STORAGE_BUFFERS,
        );
        let lines_layout = layout(device, vertex, None, 1);
        let [faces, lines] = SHADERS.map(|(name, text)| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            })
        });
        let make = |module, layout, entries: [&str; 2], is_hidden| {
            pipeline(
                device,
                module,
                [&view_layout, layout],
                entries,
                is_hidden,
                format,
                samples,
            )
        };
        Pipelines {
            faces: make(&faces, &body_layout, ["vertex", "fragment"], false),
            hidden_faces: make(
                &faces,
                &body_layout,
                ["vertex_marked", "fragment_hidden"],
                true,
            ),
            lines: make(&lines, &lines_layout, ["vertex", "fragment"], false),
            hidden_lines: make(&lines, &lines_layout, ["vertex", "fragment_hidden"], true),
            view_layout,
            body_layout,
            lines_layout,
        }
    }
}

/// A uniform of a size, if any, followed by storage buffers.
fn layout(
    device: &wgpu::Device,
    visibility: wgpu::ShaderStages,
    uniform: Option<usize>,
    n_storage: u32,
) -> wgpu::BindGroupLayout {
    let buffer = |binding, ty, bytes: u64| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: wgpu::BufferSize::new(bytes),
        },
        count: None,
    };
    let first = u32::from(uniform.is_some());
    let uniform = uniform.map(|bytes| buffer(0, wgpu::BufferBindingType::Uniform, bytes as u64));
    let read_only = wgpu::BufferBindingType::Storage { read_only: true };
    let storage = (first..first + n_storage).map(|binding| buffer(binding, read_only, 0));
    let entries: Vec<wgpu::BindGroupLayoutEntry> = uniform.into_iter().chain(storage).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}

/// What is visible replaces what is farther away. What is hidden is blended over what hides it.
fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    layouts: [&wgpu::BindGroupLayout; 2],
    [vertex, fragment]: [&str; 2],
    is_hidden: bool,
    format: wgpu::TextureFormat,
    samples: u32,
) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &layouts.map(Some),
        immediate_size: 0,
    });
    // Depth falls from 1 at the eye to 0 far away: so f32 is as precise far away as it is near.
    let compare = match is_hidden {
        false => wgpu::CompareFunction::GreaterEqual,
        true => wgpu::CompareFunction::Less,
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(!is_hidden),
            depth_compare: Some(compare),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState {
            count: samples,
            ..Default::default()
        },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options: Default::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format,
                blend: is_hidden.then_some(wgpu::BlendState::ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipelines::tests::{layout_here, layout_in};

    #[test]
    fn shaders_are_valid_and_know_the_uniforms_as_the_host_does() {
        let view = layout_here!(ViewUniform: right up back projection sky screen line only_marked);
        assert_eq!(layout_in("live_faces", "View"), Some(view.clone()));
        assert_eq!(layout_in("live_lines", "View"), Some(view));
        let body = layout_here!(BodyUniform: other marked has_colors place);
        assert_eq!(layout_in("live_faces", "Body"), Some(body));
    }
}
