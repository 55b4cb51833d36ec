//! The C interface of impinge. `include/impinge.h` is its documentation: what pointers are, who
//! owns what, which errors there are.
//!
//! The crate has no Rust interface. Each entry runs within a guard (`status`), reads what the
//! caller gives (`arrays`, `query`), and asks the crate `impinge`.

#![allow(non_camel_case_types)]
#![allow(
    missing_docs,
    clippy::missing_safety_doc,
    reason = "impinge.h documents every entry once"
)]

mod answers;
mod arrays;
mod changes;
mod contacts;
mod detector;
mod devices;
mod motion;
mod neighbours;
mod probe;
mod query;
mod questions;
mod safe;
mod scene;
mod sized;
mod stats;
mod status;
mod stencils;
mod types;

#[cfg(test)]
mod tests;

use std::ffi::c_char;

#[unsafe(no_mangle)]
pub extern "C" fn impinge_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

#[unsafe(no_mangle)]
pub extern "C" fn impinge_abi_version() -> u32 {
    types::ABI_VERSION
}
