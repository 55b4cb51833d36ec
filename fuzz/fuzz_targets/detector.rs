//! The pairs of scenes made from bytes: every method must agree with the oracle, and nothing may
//! panic.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    impinge_fuzz::scene::pairs(data);
});
