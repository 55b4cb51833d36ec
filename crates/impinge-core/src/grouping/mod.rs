//! Groups of at most 64 primitives, and the structures over them that both backends share: boxes,
//! clusters, trees, adjacency masks, the grid. Imports only `elements`.

pub(crate) mod adjacency;
#[allow(missing_docs)]
pub mod bounds;
pub(crate) mod clusters;
#[allow(missing_docs)]
pub mod grid;
pub(crate) mod hierarchy;
pub(crate) mod hubs;
pub(crate) mod rings;
mod unique;

/// The most primitives that a group holds: one bit each in a 64-bit mask.
pub const GROUP: usize = 64;

/// A cluster's vertices are padded to whole chunks of this many: a loop over them needs no remainder, and its end
/// is easy to predict.
pub(crate) const CHUNK: usize = 8;
