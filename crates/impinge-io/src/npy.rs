//! NumPy's array format.

/// The header of NumPy's array format, version 1.0 (NEP 1): magic, version, length of the
/// description, description padded with spaces so that the data starts at a multiple of 64. The
/// data is little-endian, in C order.
pub fn npy_header(kind: &str, shape: &str) -> Vec<u8> {
    npy_header_in(0, kind, shape)
}

/// The same in `n_bytes` bytes, a multiple of 64, or in more where it needs more: for a header that
/// is written over one of that length, once the number of rows is known.
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

/// The content of the header of a NumPy array (NEP 1).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// The type of plain numbers, such as `<f4`.
    pub descr: String,
    /// Whether columns, not rows, are stored one after the other.
    pub fortran_order: bool,
    /// The dimensions.
    pub shape: Vec<u64>,
    /// Where the data starts.
    pub start: u64,
}

impl NpyHeader {
    /// Reads the header at the beginning of a file; `None` if it is not valid, or if the array
    /// holds something else than plain numbers.
    pub fn parse(head: &[u8]) -> Option<Self> {
        let rest = head.strip_prefix(b"\x93NUMPY")?;
        let (length, preamble) = match *rest {
            [1, _, a, b, ..] => (u32::from(u16::from_le_bytes([a, b])), 10),
            [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([a, b, c, d]), 12),
            _ => return None,
        };
        let end = preamble + length as usize;
        let text = std::str::from_utf8(head.get(preamble..end)?).ok()?;
        let after = |key: &str| {
            let (_, rest) = text.split_once(key)?;
            Some(rest.trim_start().strip_prefix(':')?.trim_start())
        };
        let descr = after("'descr'")?.strip_prefix('\'')?.split_once('\'')?.0;
        let order = after("'fortran_order'")?;
        let fortran_order = order.starts_with("True");
        if !fortran_order && !order.starts_with("False") {
            return None;
        }
        let shape = after("'shape'")?.strip_prefix('(')?.split_once(')')?.0;
        let dimensions = shape.split(',').map(str::trim);
        let dimensions = dimensions.filter(|dimension| !dimension.is_empty());
        Some(NpyHeader {
            descr: descr.to_owned(),
            fortran_order,
            shape: dimensions
                .map(|dimension| dimension.parse().ok())
                .collect::<Option<_>>()?,
            start: end as u64,
        })
    }
}
