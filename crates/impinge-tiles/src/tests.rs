//! Tests that use private items of the crate.

mod lattice;
mod made;
mod refusals;
mod steps;
mod stops;
