//! Proximity: how near two bodies are.

mod axes;
mod best_first;
mod distance;
mod features;
mod many;
mod nearest;
mod of_two;
mod scale;
mod shared;
mod tree;

pub(crate) use distance::Distances;
pub use nearest::Nearest;
