//! Exact continuous collision and distances against an oracle of another make, published answers, and itself in other words.

mod data;
mod distance;
#[path = "../exact/generators.rs"]
#[allow(dead_code, reason = "made for another test")]
mod generators;
mod moving;
mod oracle;
