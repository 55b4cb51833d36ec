//! The needed parts of NumPy's array format (NEP 1): reads headers, writes arrays of rows.

use std::io::{self, Write};

use impinge_io::{NpyHeader, npy_header};

/// Reads the header at the beginning of a file; `None` if it is not valid, or if the data is in
/// Fortran order.
pub fn parse(head: &[u8]) -> Option<NpyHeader> {
    NpyHeader::parse(head).filter(|header| !header.fortran_order)
}

/// The header for `n` rows of `words` u32.
pub fn rows_header(n: u64, words: usize) -> Vec<u8> {
    npy_header("'<u4'", &format!("({n}, {words})"))
}

/// Writes one row.
pub fn write_row<const N: usize>(to: &mut dyn Write, row: [u32; N]) -> io::Result<()> {
    to.write_all(row.map(u32::to_le_bytes).as_flattened())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_as_written() {
        for n in [0, 7, 1 << 40] {
            let bytes = rows_header(n, 4);
            let expected = NpyHeader {
                descr: "<u4".to_owned(),
                fortran_order: false,
                shape: vec![n, 4],
                start: bytes.len() as u64,
            };
            assert_eq!(parse(&bytes), Some(expected));
            assert_eq!(bytes.len() % 64, 0);
        }
        let fortran = String::from_utf8_lossy(&rows_header(1, 4)[10..]).replace("False", "True ");
        let mut bytes = rows_header(1, 4)[..10].to_vec();
        bytes.extend(fortran.bytes());
        assert_eq!(parse(&bytes), None);
        assert_eq!(parse(b"\x93NUMPY\x01\x00\xff\xff{"), None);
    }
}
