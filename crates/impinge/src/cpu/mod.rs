//! The CPU backend: one file a stage, SIMD chosen at run time.

pub(crate) mod bounds;
pub(crate) mod clusters;
pub(crate) mod dispatch;
pub(crate) mod narrow;
pub(crate) mod pairing;
pub(crate) mod simd;
pub(crate) mod workers;
pub(crate) mod world;
