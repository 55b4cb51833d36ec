//! The needed parts of NumPy's array format (NEP 1): reads headers, writes arrays of rows.

use std::io::{self, Write};

use impinge_io::npy_header;

/// The content of a header.
#[derive(Debug, PartialEq, Eq)]
pub struct Header {
    /// The type, such as `<f4`.
    pub descr: String,
    /// The dimensions.
    pub shape: Vec<u64>,
    /// Where the data starts.
    pub start: u64,
}

/// Reads the header at the beginning of a file; `None` if it is not valid, or if the data is in Fortran order.
pub fn parse(head: &[u8]) -> Option<Header> {
    let rest = head.strip_prefix(b"\x93NUMPY")?;
    let (length, preamble) = match *rest {
        [1, _, a, b, ..] => (u32::from(u16::from_le_bytes([a, b])), 10),
        [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([a, b, c, d]), 12),
        _ => return None,
    };
    let end = preamble + length as usize;
    let text = std::str::from_utf8(head.get(preamble..end)?).ok()?;
    let after = |key: &str| {
        Some(
            text.split_once(key)?
                .1
                .trim_start()
                .strip_prefix(':')?
                .trim_start(),
        )
    };
    let descr = after("'descr'")?.strip_prefix('\'')?.split_once('\'')?.0;
    after("'fortran_order'")?
        .starts_with("False")
        .then_some(())?;
    let shape = after("'shape'")?.strip_prefix('(')?.split_once(')')?.0;
    let dimensions = shape
        .split(',')
        .map(str::trim)
        .filter(|dimension| !dimension.is_empty());
    Some(Header {
        descr: descr.to_owned(),
        shape: dimensions
            .map(|dimension| dimension.parse().ok())
            .collect::<Option<_>>()?,
        start: end as u64,
    })
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
            let expected = Header {
                descr: "<u4".to_owned(),
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
