#![no_main]

use impinge_io::SequenceFormat;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| impinge_fuzz::sequence(bytes, SequenceFormat::Mdd));
