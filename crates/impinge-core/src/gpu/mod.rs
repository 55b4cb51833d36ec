//! The GPU backend: the whole pipeline in WGSL, the same bytes as the CPU.
//!
//! Stages have the same names as on the CPU; each kernel file begins with a card. If all buffers
//! are large enough, a frame is one submission: positions go up, counters and results come back,
//! see `clusters` and `cells`. Pairs of which the filter on the device is unsure are decided
//! exactly on the CPU, from the numbers as given. Only `waiting` blocks.
//!
//! A step runs through the same stages, with two boxes per node, up to a filter. The device drops
//! pairs that certainly do not touch, and the host finds the first contacts of all others.

pub mod buffers;
pub mod cells;
pub mod clusters;
mod collect;
mod device;
pub(crate) mod engine;
mod kernels;
pub mod layout;
mod left_out;
mod limits;
mod open;
pub mod pass_buffers;
mod passes;
mod pieces;
pub mod pipeline;
pub mod recording;
mod records;
mod resident;
mod seeds;
mod top_level;
mod topology;
mod uploads;
pub mod view;
mod waiting;
pub mod world;

pub use device::{Device, DeviceInfo};
pub use pass_buffers::Capacities;
pub use resident::{ResidentPairs, ResidentPart, ResidentSafe, ResidentStep, ResidentVertices};

pub(crate) use engine::Engine;
pub use kernels::shaders;
pub(crate) use limits::MOST_KEPT;
pub use open::{GpuContext, WantedAdapter, devices, devices_async};

/// The texts from which kernels are assembled. `LAYOUT`, with the structs of all kernels, comes
/// first.
pub mod shared {
    macro_rules! shared {
        ($($name:ident = $file:literal;)*) => {
            $(
                #[doc = concat!("`", $file, ".wgsl`")]
                pub const $name: &str =
                    include_str!(concat!("kernels/shared/", $file, ".wgsl"));
            )*
        };
    }

    shared! {
        LAYOUT = "layout";
        ARGUMENTS = "arguments";
        BOXES = "boxes";
        COARSE = "coarse";
        GROUPS = "groups";
        RESERVE = "reserve";
    }
}

#[cfg(test)]
mod tests;
