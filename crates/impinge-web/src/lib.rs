//! impinge in browsers and in Node: the crate that the npm package `impinge` is compiled from.
//!
//! [`World`] has the logic: a scene whose bodies are numbered, and a detector. It is plain Rust and tested natively.
//! `bindings` exposes it to JavaScript and exists on wasm alone. `web/package` wraps the bindings in the classes that
//! users see.

#[cfg(target_family = "wasm")]
mod bindings;
mod error;
#[cfg(feature = "io")]
mod meshes;
mod step;
mod world;

pub use error::Error;
#[cfg(feature = "io")]
pub use meshes::{FileMesh, read, read_bodies, read_frames};
pub use step::{FlatImpacts, StepOptions};
pub use world::{Asked, World, welded};
