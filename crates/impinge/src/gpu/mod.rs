//! The GPU backend: the whole pipeline in WGSL, the same bytes as the CPU.
//!
//! Stages carry the names that they have on the CPU; each kernel file begins with a card. One
//! submission a frame: positions go up, counters and results come back, see [`plan`]. What the filter on
//! the device leaves open is settled exactly on the CPU from the numbers as given. Nothing here
//! blocks but [`device::Gpu::block_on`].

mod buffers;
mod collect;
mod device;
mod engine;
mod kernels;
mod layout;
mod pipeline;
mod plan;
mod room;
mod world;

pub use device::{DeviceInfo, devices};
pub use room::Capacities;

pub(crate) use device::{Gpu, Wanted};
pub(crate) use engine::Engine;

#[cfg(test)]
mod tests;
