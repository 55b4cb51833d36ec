//! One file a command.

mod answer;
mod demo;
mod demo_scene;
mod record;
mod sequence;
mod simulate;

pub use answer::{pairs, within};
pub use demo::demo;
pub use sequence::sequence;
pub use simulate::simulate;
