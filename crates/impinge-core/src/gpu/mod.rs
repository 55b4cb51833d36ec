//! The GPU backend: the whole pipeline in WGSL, the same bytes as the CPU.
//!
//! Stages carry the names that they have on the CPU; each kernel file begins with a card. One
//! submission a frame: positions go up, counters and results come back, see `clusters` and `cells`. What the filter on
//! the device leaves open is settled exactly on the CPU from the numbers as given. Nothing here
//! blocks but what is in `waiting`.

mod bounds;
mod clusterings;
mod clusters;
mod collect;
mod device;
mod forest;
mod open;
mod passes;
mod pieces;
mod resident;

// Types are documented; fields and small methods of the inside speak for themselves.
#[allow(missing_docs)]
pub mod buffers;
#[allow(missing_docs)]
pub mod cells;
#[allow(missing_docs)]
pub(crate) mod engine;
mod kernels;
#[allow(missing_docs)]
pub mod layout;
#[allow(missing_docs)]
pub mod narrow;
#[allow(missing_docs)]
pub mod pipeline;
pub mod reaching;
#[allow(missing_docs)]
pub mod room;
#[allow(missing_docs)]
pub mod steps;
mod topology;
mod waiting;
#[allow(missing_docs)]
pub mod world;

pub use device::{Device, DeviceInfo};
pub use resident::ResidentPairs;
pub use room::Capacities;

pub(crate) use engine::Engine;
pub use kernels::shaders;
pub use open::{Gpu, Wanted, devices, devices_async};

/// Text that kernels are put together from: `LAYOUT` first, it has the structs of all.
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
