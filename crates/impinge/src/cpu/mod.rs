//! The CPU backend: one file a stage, SIMD chosen at run time.

pub(crate) mod bounds;
pub(crate) mod cells;
pub(crate) mod clusters;
pub(crate) mod dispatch;
pub(crate) mod narrow;
pub(crate) mod pairing;
pub(crate) mod simd;
pub(crate) mod slabs;
pub(crate) mod top_level;
pub(crate) mod workers;
pub(crate) mod world;

use crate::frame::Frame;
use crate::progress::Control;
use crate::scene::Scene;

use workers::Workers;

/// What a method is asked to do, and with whom.
#[derive(Clone, Copy)]
pub(crate) struct Job<'a> {
    pub scene: &'a Scene,
    pub frame: &'a Frame,
    pub workers: &'a Workers,
    pub control: &'a Control<'a>,
}
