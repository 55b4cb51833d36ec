//! The methods that impinge is compared with, written to be as fast as possible.
//!
//! * [`UniformGrid`]: the parallel spatial hashing of `FWZS11`, as section 2 and section 4.1 of the
//!   paper ("Real-time Collision Detection with Two-level Spatial Hashing on GPU") describe it: one
//!   uniform grid with λ = 5, cell-element pairs sorted by a radix sort, compaction, all pairs of
//!   a cell tested.
//! * [`duplicates`]: the paper's two levels without impinge's owner rule: pairs are tested in every
//!   cell where they meet (table 3), or go through a table hashed by DJB2 that loses some of them
//!   (table 3, figure 7).
//!
//! Both use impinge's boxes, grid, threads and exact test, so that a comparison compares only
//! methods.
//!
//! The paper cites `FWZS11`. The code here follows the paper's description of it, not the
//! original text.
//!
//! ```
//! use impinge_core::Scene;
//! use impinge_baseline::{Settings, UniformGrid};
//! # fn main() -> Result<(), impinge_core::Error> {
//! let mut scene = Scene::new();
//! let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let a = scene.add_triangles(&[[0, 1, 2]], &triangle)?;
//! let b = scene.add_triangles(&[[0, 1, 2]], &triangle.map(|[x, y, z]| [x, z + 0.25, y - 0.25]))?;
//! let mut grid = UniformGrid::new(Settings::default())?;
//! let outcome = grid.detect(&scene, a, b)?;
//! assert_eq!(outcome.pairs.between(a, b).collect::<Vec<_>>(), [[0, 0]]);
//! # Ok(()) }
//! ```

pub mod duplicates;
#[cfg(feature = "gpu")]
pub mod gpu;
mod method;
mod pairing;
mod radix;
mod uniform_grid;

pub use impinge_core::Error;
pub use uniform_grid::{Counts, Outcome, Settings, UniformGrid};

/// Refuses a λ that is not a number above 0.
fn check_lambda(lambda: f64) -> Result<(), Error> {
    if lambda.is_finite() && lambda > 0.0 {
        return Ok(());
    }
    Err(Error::Setting {
        setting: "lambda",
        given: lambda.to_string(),
        allowed: "a number above 0",
    })
}

/// Refuses an unreasonable number of threads.
fn check_threads(threads: usize) -> Result<(), Error> {
    if threads <= 1024 {
        return Ok(());
    }
    Err(Error::Setting {
        setting: "threads",
        given: threads.to_string(),
        allowed: "0 to 1024",
    })
}
