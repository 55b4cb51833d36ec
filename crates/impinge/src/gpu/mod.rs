//! The GPU backend: the whole pipeline in WGSL, the same bytes as the CPU.
//!
//! Stages carry the names that they have on the CPU; each kernel file begins with a card. One
//! submission a frame: positions go up, counters and results come back, see [`clusters`] and [`cells`]. What the filter on
//! the device leaves open is settled exactly on the CPU from the numbers as given. Nothing here
//! blocks but [`device::Gpu::block_on`].

mod bounds;
mod buffers;
mod cells;
mod clusters;
mod collect;
mod device;
mod engine;
mod kernels;
mod layout;
mod narrow;
mod pipeline;
mod resident;
mod room;
mod steps;
mod world;

pub use device::{DeviceInfo, devices};
pub use resident::ResidentPairs;
pub use room::Capacities;

pub(crate) use device::{Gpu, Wanted};
pub(crate) use engine::{Engine, Options};

#[cfg(test)]
mod tests;
