//! Exact continuous collision and distances: against an independent oracle, against published
//! answers, and asked in other ways.

mod data;
mod distance;
#[path = "../exact/generators.rs"]
#[allow(dead_code, reason = "made for another test")]
mod generators;
mod grid;
mod moving;
mod oracle;
