//! Groups of at most 64 elements, and the structures over them that both backends share: boxes,
//! clusters, trees, adjacency masks, the grid. Imports only `elements` and `index`.

mod adjacency;
pub mod bounds;
pub(crate) mod clusters;
pub mod grid;
pub(crate) mod hubs;
mod parallel;
pub(crate) mod rings;
pub(crate) mod tree;
mod unique;

#[cfg(feature = "gpu")]
pub(crate) use parallel::for_each;
pub(crate) use parallel::made_from;

pub use crate::scene::index::GROUP;

/// A cluster's vertices are padded to whole chunks of this many: a loop over them needs no
/// remainder, and its end is easy to predict.
pub(crate) const CHUNK: usize = 8;
