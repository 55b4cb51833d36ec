//! The filters of the GPU in a model of WGSL's arithmetic, against exact answers: needs no device.

mod bound;
#[path = "../../../../impinge-exact/tests/exact/generators.rs"]
#[allow(dead_code, reason = "made for another test")]
mod generators;
mod moving;
