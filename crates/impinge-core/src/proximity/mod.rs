//! Proximity: how near two bodies are.

mod axes;
mod distance;
mod features;
mod tree;

pub use distance::{Distances, Nearest};
