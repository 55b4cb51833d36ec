//! Steps: what touches on the way, and when first.

#[path = "../common/mod.rs"]
mod common;
mod data;
mod impacts;
mod start;
