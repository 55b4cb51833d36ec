//! Scenes with known structure, shared by tests, benches, demo and viewer.
//!
//! * Generators: [`surfaces`] (balls, tori, knots, cloth, boxes), [`solids`] (tetrahedra) and
//!   [`soup`] (random elements, on an integer lattice too, where everything is degenerate).
//! * [`regular`]: flat and regular surfaces, hard for filters.
//! * [`deform`]: positions as functions of the rest pose and of time, written into a buffer.
//! * [`BuiltScene`]: bodies and a query about them, ready for a detector.
//! * [`adversarial`]: scenes that break methods which are only fast on average.
//!
//! Everything is deterministic: random generators take a seed, and nothing reads the clock.
//! Generators that use trigonometry may differ in the last bit between operating systems.
//!
//! ```
//! use impinge_scenes::{BuiltScene, surfaces};
//! # fn main() -> Result<(), impinge::Error> {
//! let ball = surfaces::ball(1_000);
//! let built = BuiltScene::two_body("balls", &ball, [0.9, 0.0, 0.0])?;
//! assert_eq!(built.n_elements(), 2_000);
//! # Ok(()) }
//! ```

pub mod adversarial;
mod built;
pub mod deform;
mod model;
mod random;
pub mod regular;
pub mod solids;
pub mod soup;
pub mod surfaces;

pub use built::BuiltScene;
pub use model::{MAX_ELEMENTS, Model};
pub use random::Random;
