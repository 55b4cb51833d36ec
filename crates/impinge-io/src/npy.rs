//! NumPy's array format.

/// The header of NumPy's array format, version 1.0 (NEP 1): magic, version, length of the description, description
/// padded with spaces so that the data starts at a multiple of 64. The data is little-endian, in C order.
pub fn npy_header(kind: &str, shape: &str) -> Vec<u8> {
    npy_header_in(0, kind, shape)
}

/// The same in `n_bytes` bytes, a multiple of 64, or in more where it needs more: for a header that is written over one of
/// that length, once the number of rows is known.
pub(crate) fn npy_header_in(n_bytes: usize, kind: &str, shape: &str) -> Vec<u8> {
    const PREAMBLE: usize = 10;
    let mut text = format!("{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}");
    let length = (PREAMBLE + text.len() + 1).next_multiple_of(64);
    let length = length.max(n_bytes) - PREAMBLE;
    text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    // At most a few hundred bytes, whatever the number of rows.
    header.extend(u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes());
    header.extend(text.as_bytes());
    header
}
