//! What tests of several crates share. It stands on none of them.
//!
//! * [`data`]: locations of real meshes and published answers.
//! * [`npy`]: arrays of NumPy.
//! * [`published`]: pairs of triangles with published answers.
//! * [`random`]: random numbers for tests of crates that `impinge-scenes` stands on.
//! * [`schema`]: `docs/*.schema.json`, made from types.

pub mod data;
pub mod npy;
pub mod published;
// One source for both: a crate that is published cannot import this one.
#[path = "../../impinge-scenes/src/random.rs"]
pub mod random;
pub mod schema;
