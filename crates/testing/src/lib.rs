//! What tests of several crates share. It stands on none of them.
//!
//! * [`data`]: locations of real meshes and published answers.
//! * [`published`]: pairs of triangles with published answers.
//! * [`schema`]: `docs/*.schema.json`, made from types.

pub mod data;
pub mod published;
pub mod schema;
