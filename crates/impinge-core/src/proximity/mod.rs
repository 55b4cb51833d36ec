//! Proximity: how near two bodies are, and where points and rays lie among them.

mod axes;
mod best_first;
mod distance;
mod features;
mod many;
mod nearest;
mod of_two;
pub(crate) mod probe;
mod shared;
mod tree;

pub(crate) use distance::Distances;
pub use nearest::Nearest;
