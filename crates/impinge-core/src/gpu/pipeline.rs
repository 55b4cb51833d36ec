//! Kernels with typed bindings.

use std::fmt;
use std::marker::PhantomData;
use std::sync::{Arc, OnceLock};

use super::buffers::{Access, Bound};
use super::device::Device;

/// One binding as a kernel declares it.
#[derive(Debug, Clone, Copy)]
pub struct BindingEntry {
    /// Its name in the kernel; tests compare the two.
    pub name: &'static str,
    /// How the kernel uses it.
    pub access: Access,
    /// Bytes of one element.
    pub stride: u64,
}

/// All bindings of a kernel, in the order of their numbers.
pub trait Bindings {
    /// The bindings as the kernel declares them.
    const ENTRIES: &'static [BindingEntry];
    /// What is bound, in the same order.
    fn bound(&self) -> Vec<Bound>;
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
            const ENTRIES: &'static [$crate::gpu::pipeline::BindingEntry] = &[
                $($crate::gpu::pipeline::BindingEntry {
                    name: stringify!($field),
                    access: <$crate::gpu::buffers::$access<$type>
                        as $crate::gpu::buffers::Binding>::ACCESS,
                    stride: <$crate::gpu::buffers::$access<$type>
                        as $crate::gpu::buffers::Binding>::STRIDE,
                },)*
            ];

            fn bound(&self) -> Vec<$crate::gpu::buffers::Bound> {
                use $crate::gpu::buffers::Binding;
                vec![$(self.$field.bound(),)*]
            }
        }
    };
}
pub use crate::bindings;

/// A kernel's text: the shared files that it uses, then its own file.
#[derive(Debug)]
pub struct Source {
    /// The name of the file, without `.wgsl`.
    pub name: &'static str,
    /// The shared files, `layout` first, and the file itself.
    pub parts: &'static [&'static str],
}

impl Source {
    /// All of it, for the compiler.
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

/// A kernel that takes the bindings `B`.
pub struct Kernel<B> {
    program: Arc<Program>,
    takes: PhantomData<fn(B)>,
}

impl<B> fmt::Debug for Kernel<B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Kernel")
            .field(&self.program.source.name)
            .finish()
    }
}

/// A kernel without the types of its bindings, compiled when it is first bound.
pub struct Program {
    source: Source,
    constants: &'static [(&'static str, f64)],
    entries: &'static [BindingEntry],
    /// Replaces the text of `source`, for tests.
    damaged: Option<String>,
    compiled: OnceLock<Compiled>,
}

impl fmt::Debug for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.source.name)
    }
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
        entries: &[BindingEntry],
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
        Kernel::with_text(source, constants, None)
    }

    /// The same kernel with another text; with its own for `None`.
    pub(crate) fn with_text(
        source: Source,
        constants: &'static [(&'static str, f64)],
        damaged: Option<String>,
    ) -> Self {
        Kernel {
            program: Arc::new(Program {
                source,
                constants,
                entries: B::ENTRIES,
                damaged,
                compiled: OnceLock::new(),
            }),
            takes: PhantomData,
        }
    }

    pub(super) fn program(&self) -> &Arc<Program> {
        &self.program
    }
}

impl Program {
    pub(super) fn name(&self) -> &'static str {
        self.source.name
    }

    pub(super) fn entries(&self) -> &'static [BindingEntry] {
        self.entries
    }

    /// The bind group of the first bytes of some buffers. The first call on this device, by any
    /// detector, compiles the kernel; errors go to the open error scopes.
    pub(super) fn bind(&self, gpu: &Device, buffers: &[(wgpu::Buffer, u64)]) -> wgpu::BindGroup {
        let compiled = self.compiled.get_or_init(|| {
            let text = self.damaged.clone();
            let text = text.unwrap_or_else(|| self.source.text());
            Compiled::new(&gpu.device, self.name(), text, self.constants, self.entries)
        });
        let entries = (0u32..).zip(buffers).map(|(binding, (buffer, bytes))| {
            let buffer = wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: wgpu::BufferSize::new(*bytes),
            };
            wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::Buffer(buffer),
            }
        });
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.name()),
            layout: &compiled.layout,
            entries: &entries.collect::<Vec<_>>(),
        })
    }

    /// The compiled kernel.
    pub(super) fn pipeline(&self) -> &wgpu::ComputePipeline {
        &self.compiled.get().expect("bound before it runs").pipeline
    }
}
