//! impinge in browsers and in Node: the crate that the npm package `impinge` is compiled from.
//!
//! [`World`] is a scene whose bodies are numbered, [`Asker`] a detector. Questions and answers are
//! lists of numbers: `js` gives them the names and shapes that users see. All of this is
//! plain Rust and tested natively; `bindings` exposes it to JavaScript and exists on wasm alone.

mod answer;
mod ask;
#[cfg(target_family = "wasm")]
mod bindings;
mod error;
#[cfg(feature = "io")]
mod meshes;
mod probe;
mod world;

pub use answer::Answer;
pub use ask::{Asker, Question, query};
pub use error::Error;
#[cfg(feature = "io")]
pub use meshes::{FileMesh, read, read_bodies, read_frames};
pub use world::{Put, World, welded};
