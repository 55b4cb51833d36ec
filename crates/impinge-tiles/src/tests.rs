//! Tests that need the inside of the crate.

mod lattice;
mod made;
mod refusals;
mod stops;
