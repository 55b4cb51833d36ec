//! The kernels of the uniform grid: their sources, their bindings, and the compiled set.

use bytemuck::{Pod, Zeroable};
use impinge_core::gpu::layout::{Candidate, CellItem, Counter, Grid, Kept, Params};
use impinge_core::gpu::pipeline::bindings;
use impinge_core::gpu::pipeline::{Kernel, Source};

/// A cell-element pair; the bits are drawn in `kernels/entries.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Entry {
    pub key: u32,
    pub kept: u32,
}

/// Declares buffers of one word per element, each with its own type.
macro_rules! words {
    ($($(#[$doc:meta])* $name:ident)*) => {
        $(
            $(#[$doc])*
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
            #[repr(C)]
            pub(crate) struct $name {
                word: u32,
            }
        )*
    };
}

words! {
    /// Entries of the elements before this one in its workgroup.
    First
    /// The number of entries of each workgroup of elements; after the scan, of all workgroups
    /// before it.
    Sum
    /// How often a digit occurs in each block; after the scan, in all blocks before it.
    DigitCount
    /// How often a digit occurs in total.
    DigitTotal
}

bindings! {
    /// `fill_count.wgsl`
    FillCount {
        grid: Read<Grid>,
        kept: Write<Kept>,
        firsts: Write<First>,
        sums: Write<Sum>,
        counters: Write<Counter>,
    }
}

bindings! {
    /// `fill_scan.wgsl`
    FillScan {
        sums: Write<Sum>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `fill_entries.wgsl`
    FillEntries {
        grid: Read<Grid>,
        kept: Read<Kept>,
        firsts: Read<First>,
        sums: Read<Sum>,
        entries: Write<Entry>,
        counters: Write<Counter>,
    }
}

bindings! {
    /// `sort_count.wgsl`
    SortCount {
        entries: Read<Entry>,
        counts: Write<DigitCount>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `sort_scan.wgsl`
    SortScan {
        counts: Write<DigitCount>,
        totals: Write<DigitTotal>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `sort_scatter.wgsl`
    SortScatter {
        entries: Read<Entry>,
        counts: Read<DigitCount>,
        totals: Read<DigitTotal>,
        sorted: Write<Entry>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `compact.wgsl`
    Compact {
        entries: Read<Entry>,
        items: Write<CellItem>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `pairing.wgsl`
    Pairing {
        grid: Read<Grid>,
        kept: Read<Kept>,
        entries: Read<Entry>,
        items: Read<CellItem>,
        candidates: Write<Candidate>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

/// Shader text shared by kernels: the library's, and that of the uniform grid.
mod shared {
    pub use impinge_core::gpu::shared::*;

    pub const SUMS: &str = include_str!("kernels/sums.wgsl");
}

/// Declares the set of kernels: the bindings of each kernel, and the shared text that it uses.
macro_rules! kernels {
    ($($name:ident: $bindings:ident from $file:literal ($($shared:ident),*);)*) => {
        /// Every kernel, compiled when it is first bound.
        pub(crate) struct Kernels {
            $(pub $name: Kernel<$bindings>,)*
        }

        impl Kernels {
            /// Declares all kernels.
            pub fn new() -> Self {
                Kernels {
                    $($name: Kernel::new(source::$name(), &[]),)*
                }
            }
        }

        /// The text of each kernel.
        mod source {
            use super::{Source, shared};

            $(
                pub(super) fn $name() -> Source {
                    Source {
                        name: stringify!($name),
                        parts: &[
                            shared::LAYOUT,
                            include_str!("kernels/entries.wgsl"),
                            $(shared::$shared,)*
                            include_str!(concat!("kernels/", $file, ".wgsl")),
                        ],
                    }
                }
            )*
        }

        /// The source and the bindings of every kernel.
        fn all() -> Vec<(Source, &'static [impinge_core::gpu::pipeline::BindingEntry])> {
            use impinge_core::gpu::pipeline::Bindings;
            vec![$((source::$name(), $bindings::ENTRIES),)*]
        }
    };
}

kernels! {
    fill_count: FillCount from "fill_count" (COARSE, GROUPS, SUMS);
    fill_scan: FillScan from "fill_scan" (SUMS);
    fill_entries: FillEntries from "fill_entries" (COARSE, GROUPS);
    sort_count: SortCount from "sort_count" (GROUPS);
    sort_scan: SortScan from "sort_scan" (SUMS);
    sort_scatter: SortScatter from "sort_scatter" (GROUPS, SUMS);
    compact: Compact from "compact" (GROUPS, RESERVE);
    pairing: Pairing from "pairing" (BOXES, COARSE, GROUPS, RESERVE);
}

/// The name and the text of every shader that this crate compiles, for compilers other than naga to
/// check.
pub fn shaders() -> impl Iterator<Item = (&'static str, String)> {
    let sources = all().into_iter();
    sources.map(|(source, _)| (source.name, source.text()))
}

#[cfg(test)]
mod tests {
    use impinge_core::gpu::buffers::Access;
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use naga::{AddressSpace, StorageAccess, TypeInner};

    use super::all;

    #[test]
    fn kernels_are_valid_and_bind_what_the_host_binds() {
        for (source, entries) in all() {
            let (text, name) = (source.text(), source.name);
            let module = naga::front::wgsl::parse_str(&text)
                .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(&text)));
            Validator::new(ValidationFlags::all(), Capabilities::empty())
                .validate(&module)
                .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(&text)));
            let variables = module.global_variables.iter().map(|(_, variable)| variable);
            let bound: Vec<_> = variables
                .filter_map(|variable| Some((variable.binding?, variable)))
                .collect();
            assert_eq!(bound.len(), entries.len(), "{name}");
            let is_storage = |space| matches!(space, AddressSpace::Storage { .. });
            let n_storage = bound
                .iter()
                .filter(|(_, held)| is_storage(held.space))
                .count();
            assert!(n_storage <= 8, "{name} binds {n_storage} buffers");
            for (binding, variable) in bound {
                let entry = &entries[binding.binding as usize];
                assert_eq!(variable.name.as_deref(), Some(entry.name), "{name}");
                let access = match variable.space {
                    AddressSpace::Uniform => Access::Uniform,
                    AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                        Access::Write
                    }
                    _ => Access::Read,
                };
                assert_eq!(access, entry.access, "{name}: {}", entry.name);
                let stride = match module.types[variable.ty].inner {
                    TypeInner::Array { stride, .. } => stride,
                    TypeInner::Struct { span, .. } => span,
                    ref other => panic!("{name}: {} is {other:?}", entry.name),
                };
                assert_eq!(u64::from(stride), entry.stride, "{name}: {}", entry.name);
            }
            let shared: u32 = module
                .global_variables
                .iter()
                .filter(|(_, variable)| variable.space == AddressSpace::WorkGroup)
                .map(|(_, variable)| module.types[variable.ty].inner.size(module.to_ctx()))
                .sum();
            assert!(shared <= 16 * 1024, "{name}: {shared} bytes");
        }
    }
}
