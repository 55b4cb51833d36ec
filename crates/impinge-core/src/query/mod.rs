//! What is asked: queries, settings, cancellation and progress, and what can go wrong.

pub mod goal;
pub(crate) mod pair_kind;
pub(crate) mod pair_set;
pub(crate) mod progress;
mod scope;
pub(crate) mod settings;
pub(crate) mod step;
pub(crate) mod vertex_lists;

pub use scope::*;
