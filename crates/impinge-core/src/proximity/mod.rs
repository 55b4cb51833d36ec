//! Proximity: how near two bodies are.

mod axes;
mod distance;
mod features;
mod many;
mod scale;
mod shared;
mod tree;

pub(crate) use distance::Distances;
pub use distance::Nearest;
