//! One file a command.

mod answer;
mod demo;
mod demo_scene;
mod sequence;

pub use answer::{pairs, within};
pub use demo::demo;
pub use sequence::sequence;
