#![no_main]

use impinge_io::Format;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| impinge_fuzz::mesh(bytes, Format::Medit));
