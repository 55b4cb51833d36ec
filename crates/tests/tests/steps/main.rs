//! Steps: what touches on the way, and when first.

mod data;
mod impacts;
mod start;
