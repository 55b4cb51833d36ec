//! One file per command.

mod answer;
mod cast;
mod check;
mod demo;
mod demo_scene;
#[cfg(feature = "gpu")]
mod devices;
mod distance;
mod fix;
mod near;
mod probe;
mod render;
mod safe;
mod sequence;
mod step;
mod tiles;
#[cfg(feature = "view")]
mod view;

pub use answer::{pairs, within};
pub use cast::cast;
pub use check::{CHECK_EXAMPLES, CheckArgs, CheckWorkerArgs, check, check_worker};
pub use demo::demo;
#[cfg(feature = "gpu")]
pub use devices::devices;
pub use distance::distance;
pub use fix::{FIX_EXAMPLES, FixArgs, fix};
pub use near::near;
pub use probe::probe;
pub use render::render;
pub use safe::safe;
pub use sequence::sequence;
pub use step::step;
pub use tiles::{TILES_EXAMPLES, TilesArgs, tiles};
#[cfg(feature = "view")]
pub use view::view;
