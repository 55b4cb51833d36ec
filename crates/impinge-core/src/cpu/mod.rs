//! The CPU backend: one file a stage, SIMD chosen at run time.

pub(crate) mod bounds;
pub mod cells;
pub(crate) mod clusters;
pub(crate) mod cull;
pub(crate) mod dispatch;
pub(crate) mod extents;
mod group_cache;
mod hubs;
pub mod kept;
pub mod narrow;
pub(crate) mod pairing;
mod places;
mod refit;
pub(crate) mod remote;
pub mod simd;
pub(crate) mod slabs;
pub(crate) mod steps;
pub mod subcells;
pub(crate) mod top_level;
pub mod workers;
pub mod world;

use crate::frame::Frame;
use crate::progress::Control;
use crate::scene::Scene;

use workers::Workers;

/// What a method is asked to do, and with whom.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// Who takes part.
    pub frame: &'a Frame,
    /// The threads.
    pub workers: &'a Workers,
    /// Stops and watches it.
    pub control: &'a Control<'a>,
}
