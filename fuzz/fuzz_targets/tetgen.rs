#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| impinge_fuzz::tetgen(bytes));
