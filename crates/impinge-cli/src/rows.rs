//! Rows of pairs as files: NumPy arrays and CSV.

use std::io::{self, Write};

use impinge::Pairs;
use impinge_io::AtomicFile;

use crate::error::Error;
use crate::values::{RowsFile, RowsFormat};

/// Writes rows `body_a, primitive_a, body_b, primitive_b`, sorted.
pub fn write(file: &RowsFile, pairs: &Pairs) -> Result<(), Error> {
    let mut to = AtomicFile::create(&file.path)?;
    let written = match file.format {
        RowsFormat::Npy => npy(&mut to, pairs.rows()),
        RowsFormat::Csv => csv(&mut to, pairs.rows()),
    };
    written.map_err(|source| Error::Write {
        path: file.path.clone(),
        source,
    })?;
    Ok(to.finish()?)
}

fn npy(to: &mut impl Write, rows: impl ExactSizeIterator<Item = [u32; 4]>) -> io::Result<()> {
    to.write_all(&npy_header("'<u4'", &format!("({}, 4)", rows.len())))?;
    for row in rows {
        to.write_all(row.map(u32::to_le_bytes).as_flattened())?;
    }
    Ok(())
}

/// The header of NumPy's array format, version 1.0 (NEP 1): magic, version, length of the description, description
/// padded with spaces so that data starts at a multiple of 64. Data are little endian, in C order.
pub fn npy_header(kind: &str, shape: &str) -> Vec<u8> {
    const PREAMBLE: usize = 10;
    let mut text = format!("{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}");
    let length = (PREAMBLE + text.len() + 1).next_multiple_of(64) - PREAMBLE;
    text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    // Some hundred bytes at most, whatever the number of rows.
    header.extend(u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes());
    header.extend(text.as_bytes());
    header
}

fn csv(to: &mut impl Write, rows: impl Iterator<Item = [u32; 4]>) -> io::Result<()> {
    writeln!(to, "body_a,primitive_a,body_b,primitive_b")?;
    for [body_a, a, body_b, b] in rows {
        writeln!(to, "{body_a},{a},{body_b},{b}")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn npy_bytes() {
        for n_rows in [0, 2, 1000] {
            let mut bytes = Vec::new();
            npy(&mut bytes, vec![[0, 7, 1, 0x0102_0304]; n_rows].into_iter()).unwrap();
            assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
            let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
            assert_eq!(start % 64, 0);
            let header = std::str::from_utf8(&bytes[10..start]).unwrap();
            assert!(header.contains(&format!("'shape': ({n_rows}, 4)")) && header.ends_with('\n'));
            assert_eq!(bytes.len(), start + 16 * n_rows);
            if n_rows > 0 {
                let row = &bytes[start..start + 16];
                assert_eq!(row, [0, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 4, 3, 2, 1]);
            }
        }
    }

    #[test]
    fn csv_text() {
        let mut bytes = Vec::new();
        csv(&mut bytes, [[0, 7, 1, 3]].into_iter()).unwrap();
        assert_eq!(bytes, b"body_a,primitive_a,body_b,primitive_b\n0,7,1,3\n");
    }
}
