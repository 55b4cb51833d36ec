//! Kernels with typed bindings.

use std::marker::PhantomData;
use std::sync::OnceLock;

use super::buffers::Access;
use super::device::Device;

/// One binding as a kernel declares it.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Its name in the kernel; tests compare the two.
    pub name: &'static str,
    pub access: Access,
    /// Bytes of one element.
    pub stride: u64,
}

/// All bindings of a kernel, in the order of their numbers.
pub trait Bindings {
    const ENTRIES: &'static [Entry];
    fn resources(&self) -> Vec<wgpu::BindingResource<'_>>;
}

/// Declares the bindings of a kernel: `name: Read<T>`, `Write<T>` or `Uniform<T>`, in order.
#[macro_export]
#[doc(hidden)]
macro_rules! bindings {
    ($(#[$doc:meta])* $name:ident { $($field:ident: $access:ident<$type:ty>),* $(,)? }) => {
        $(#[$doc])*
        pub(crate) struct $name {
            $(pub $field: $crate::gpu::buffers::$access<$type>,)*
        }

        impl $crate::gpu::pipeline::Bindings for $name {
            const ENTRIES: &'static [$crate::gpu::pipeline::Entry] = &[
                $($crate::gpu::pipeline::Entry {
                    name: stringify!($field),
                    access: <$crate::gpu::buffers::$access<$type>
                        as $crate::gpu::buffers::Binding>::ACCESS,
                    stride: <$crate::gpu::buffers::$access<$type>
                        as $crate::gpu::buffers::Binding>::STRIDE,
                },)*
            ];

            fn resources(&self) -> Vec<wgpu::BindingResource<'_>> {
                use $crate::gpu::buffers::Binding;
                vec![$(self.$field.resource(),)*]
            }
        }
    };
}
pub use crate::bindings;

/// A kernel's text: the shared files that it uses, then its own file.
pub struct Source {
    pub name: &'static str,
    pub parts: &'static [&'static str],
}

impl Source {
    pub fn text(&self) -> String {
        self.parts.join("\n")
    }
}

/// The text of a kernel file and of the shared files that it needs.
macro_rules! source {
    ($file:literal, [$($shared:literal),*]) => {
        $crate::gpu::pipeline::source!($file as $file, [$($shared),*])
    };
    ($file:literal as $name:literal, [$($shared:literal),*]) => {
        $crate::gpu::pipeline::Source {
            name: $name,
            parts: &[
                include_str!("kernels/shared/layout.wgsl"),
                $(include_str!(concat!("kernels/shared/", $shared, ".wgsl")),)*
                include_str!(concat!("kernels/", $file, ".wgsl")),
            ],
        }
    };
}
pub(crate) use source;

/// A kernel that takes the bindings `B`, compiled when it is first bound.
pub struct Kernel<B> {
    source: Source,
    constants: &'static [(&'static str, f64)],
    /// Replaces the text of `source`, for tests.
    damaged: Option<String>,
    compiled: OnceLock<Compiled>,
    takes: PhantomData<fn(B)>,
}

struct Compiled {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Compiled {
    /// Errors go to the open error scopes.
    fn new(
        device: &wgpu::Device,
        name: &str,
        text: String,
        constants: &[(&str, f64)],
        entries: &[Entry],
    ) -> Self {
        let entries: Vec<wgpu::BindGroupLayoutEntry> = (0u32..)
            .zip(entries)
            .map(|(binding, entry)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: match entry.access {
                        Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
                        Access::Write => wgpu::BufferBindingType::Storage { read_only: false },
                        Access::Uniform => wgpu::BufferBindingType::Uniform,
                    },
                    has_dynamic_offset: entry.access == Access::Uniform,
                    min_binding_size: wgpu::BufferSize::new(entry.stride),
                },
                count: None,
            })
            .collect();
        let label = Some(name);
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &entries,
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                // Kernels write workgroup memory before they read it.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        Compiled { layout, pipeline }
    }
}

impl<B: Bindings> Kernel<B> {
    /// Not compiled yet.
    pub fn new(source: Source, constants: &'static [(&'static str, f64)]) -> Self {
        Kernel {
            source,
            constants,
            damaged: None,
            compiled: OnceLock::new(),
            takes: PhantomData,
        }
    }

    /// The same kernel with another text; with its own for `None`.
    pub(crate) fn with_text(self, damaged: Option<String>) -> Self {
        Kernel { damaged, ..self }
    }

    fn compiled(&self, device: &wgpu::Device) -> &Compiled {
        self.compiled.get_or_init(|| {
            let text = self.damaged.clone();
            let text = text.unwrap_or_else(|| self.source.text());
            Compiled::new(device, self.source.name, text, self.constants, B::ENTRIES)
        })
    }

    /// The kernel with its buffers. The first call on this device, by any detector, compiles it; errors go to
    /// the open error scopes.
    pub fn bind(&self, gpu: &Device, bindings: &B) -> Bound {
        let compiled = self.compiled(&gpu.device);
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0u32..)
            .zip(bindings.resources())
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        Bound {
            pipeline: compiled.pipeline.clone(),
            group: gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(self.source.name),
                layout: &compiled.layout,
                entries: &entries,
            }),
            has_params: B::ENTRIES
                .iter()
                .any(|entry| entry.access == Access::Uniform),
        }
    }
}

/// Bytes from the parameters of one step to those of the next.
const STEP: u32 = size_of::<super::layout::Step>() as u32;

/// A kernel with its buffers, ready to be dispatched.
#[derive(Debug)]
pub struct Bound {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    has_params: bool,
}

/// The number of workgroups of a dispatch.
pub enum Workgroups<'a> {
    /// This many, in rows if necessary.
    Known(u64),
    /// As many as the arguments in this slot say.
    Indirect(&'a wgpu::Buffer, u32),
}

/// The widest row of workgroups; `shared/arguments.wgsl` has the same.
pub(super) const WIDEST: u64 = 32_768;

impl Bound {
    /// Dispatches with the parameters of a step.
    pub fn run(&self, pass: &mut wgpu::ComputePass<'_>, step: u32, groups: Workgroups<'_>) {
        pass.set_pipeline(&self.pipeline);
        let offset = [step * STEP];
        let offsets: &[u32] = if self.has_params { &offset } else { &[] };
        pass.set_bind_group(0, &self.group, offsets);
        match groups {
            Workgroups::Known(n) => {
                // Both fit: counts are below 2^32.
                let x = n.min(WIDEST) as u32;
                let y = n.div_ceil(WIDEST) as u32;
                pass.dispatch_workgroups(x, y, 1);
            }
            Workgroups::Indirect(arguments, slot) => {
                let bytes = size_of::<super::layout::Arguments>() as u64;
                pass.dispatch_workgroups_indirect(arguments, u64::from(slot) * bytes);
            }
        }
    }
}
