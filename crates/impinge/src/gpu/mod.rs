//! The GPU backend: the whole pipeline in WGSL, the same bytes as the CPU.
//!
//! Stages carry the names that they have on the CPU; each kernel file begins with a card. One
//! submission a frame: positions go up, counters and results come back, see [`clusters`] and [`cells`]. What the filter on
//! the device leaves open is settled exactly on the CPU from the numbers as given. Nothing here
//! blocks but [`device::Gpu::block_on`].

mod bounds;
mod clusterings;
mod clusters;
mod collect;
mod device;
mod forest;
mod passes;
mod pieces;
mod resident;

// What `guest` hands on of these is no part of the stable interface: its types are documented, their
// fields and small methods speak for themselves.
#[allow(missing_docs)]
pub(crate) mod buffers;
#[allow(missing_docs)]
pub(crate) mod cells;
#[allow(missing_docs)]
pub(crate) mod engine;
mod kernels;
#[allow(missing_docs)]
pub(crate) mod layout;
#[allow(missing_docs)]
pub(crate) mod narrow;
#[allow(missing_docs)]
pub(crate) mod pipeline;
pub(crate) mod reaching;
#[allow(missing_docs)]
pub(crate) mod room;
#[allow(missing_docs)]
pub(crate) mod steps;
mod topology;
#[allow(missing_docs)]
pub(crate) mod world;

pub use device::{DeviceInfo, devices};
pub use resident::ResidentPairs;
pub use room::Capacities;

pub use device::{Gpu, Wanted};
pub(crate) use engine::{Engine, Options};

#[cfg(test)]
mod tests;
