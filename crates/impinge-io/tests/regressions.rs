//! Inputs found by fuzzing, reduced to a few bytes.

mod common;

use common::samples;
use impinge_io::{Error, Format, ReadOptions, read_bytes};

/// A byte order mark was not counted, so offsets fell into the middle of characters.
#[test]
fn vtu_with_byte_order_marks() {
    let read = |bytes: &[u8]| read_bytes(bytes, Format::Vtu, "file", &ReadOptions::as_they_are());
    let error = read(b"\xef\xbb\xbf<>\0f\n|!DOCT\x11\0\n>\n").unwrap_err();
    assert!(matches!(error, Error::Syntax { .. }), "{error}");
    for sample in samples()
        .iter()
        .filter(|sample| sample.format == Format::Vtu)
    {
        for n_marks in 1..3 {
            let marked = [&b"\xef\xbb\xbf".repeat(n_marks), sample.bytes.as_slice()].concat();
            assert_eq!(read(&marked).unwrap(), sample.mesh, "{}", sample.name);
        }
    }
}
