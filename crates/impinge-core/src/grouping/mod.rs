//! How primitives are gathered into groups of at most 64, and how groups meet: what both
//! backends share. This floor knows nobody.

pub(crate) mod adjacency;
#[allow(missing_docs)]
pub mod bounds;
pub(crate) mod clusters;
#[allow(missing_docs)]
pub mod grid;
pub(crate) mod hierarchy;
pub(crate) mod hubs;

/// The most primitives a group holds: one bit each in a 64-bit mask.
pub const GROUP: usize = 64;
