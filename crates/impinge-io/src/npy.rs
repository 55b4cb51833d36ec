//! NumPy's array format.

use std::io::{self, Write};

/// The header of NumPy's array format, version 1.0 (NEP 1): magic, version, length of the description, description
/// padded with spaces so that the data starts at a multiple of 64. The data is little-endian, in C order.
pub fn npy_header(kind: &str, shape: &str) -> Vec<u8> {
    npy_header_in(0, kind, shape)
}

/// The same in `n_bytes` bytes, a multiple of 64, or in more where it needs more: for a header that is written over one of
/// that length, once the number of rows is known.
pub fn npy_header_in(n_bytes: usize, kind: &str, shape: &str) -> Vec<u8> {
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

/// Writes impacts, each its kind (`"vf"`, `"ee"`, `"ev"` or `"vv"`), `[body_a, element_a, body_b, element_b]` and time, as a packed
/// structured array with the fields `kind`, `body_a`, `element_a`, `body_b`, `element_b` and `toi`. Times are f64, or f32, if they all are.
///
/// # Errors
/// Those of `to`.
pub fn write_impacts_npy(
    to: &mut dyn Write,
    impacts: impl ExactSizeIterator<Item = (&'static str, [u32; 4], f64)>,
    in_f64: bool,
) -> io::Result<()> {
    let time = if in_f64 { "<f8" } else { "<f4" };
    // As in NumPy, a kind is two characters of four bytes each.
    let fields = format!(
        "[('kind', '<U2'), ('body_a', '<u4'), ('element_a', '<u4'), ('body_b', '<u4'), ('element_b', '<u4'), ('toi', '{time}')]"
    );
    to.write_all(&npy_header(&fields, &format!("({},)", impacts.len())))?;
    for (kind, row, toi) in impacts {
        for letter in kind.chars() {
            to.write_all(&u32::from(letter).to_le_bytes())?;
        }
        to.write_all(row.map(u32::to_le_bytes).as_flattened())?;
        match in_f64 {
            true => to.write_all(&toi.to_le_bytes())?,
            false => to.write_all(&(toi as f32).to_le_bytes())?,
        }
    }
    Ok(())
}
