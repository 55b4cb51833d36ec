//! Bodies: topology once, positions every frame; and the numbers that name them and their elements.

pub(crate) mod bodies;
pub(crate) mod body;
pub(crate) mod by_body;
mod edges;
pub(crate) mod elements;
pub(crate) mod error;
pub(crate) mod ids;
pub mod index;
pub(crate) mod mesh;
mod motion;
pub(crate) mod position_rows;
pub(crate) mod positions;
mod thickness;
pub(crate) mod transform;
pub(crate) mod vector;
pub(crate) mod words;

pub use bodies::Scene;
pub use body::{Body, Filter};
pub(crate) use thickness::Each;
pub use thickness::Thickness;
