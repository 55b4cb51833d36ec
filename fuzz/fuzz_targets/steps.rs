//! Steps of scenes made from bytes: all answers must agree with the oracle and with each other, and
//! nothing may panic.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    impinge_fuzz::scene::steps(data);
});
