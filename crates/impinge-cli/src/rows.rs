//! Rows of pairs: CSV, lines of JSON, NumPy arrays.

use std::io::{self, Write};

use impinge::Pairs;
use impinge_io::npy_header;

use crate::error::Error;
use crate::target::Target;
use crate::values::{RowsFile, RowsFormat};

/// Writes rows `body_a, primitive_a, body_b, primitive_b`, sorted.
pub fn write(file: &RowsFile, pairs: &Pairs) -> Result<(), Error> {
    Target::fill(file, |to| put(to, file.format, pairs))
}

fn put(to: &mut dyn Write, format: RowsFormat, pairs: &Pairs) -> io::Result<()> {
    match format {
        RowsFormat::Npy => npy(to, pairs.rows()),
        RowsFormat::Csv => csv(to, pairs.rows()),
        RowsFormat::Jsonl => jsonl(to, pairs.rows()),
    }
}

/// The rows of the frames of a sequence, each preceded by the number of its frame.
pub struct FrameRows {
    format: RowsFormat,
    to: Target,
}

impl FrameRows {
    /// Starts a file.
    pub fn create(file: &RowsFile) -> Result<Self, Error> {
        if file.format == RowsFormat::Npy {
            let text = "--pairs: the pairs of a sequence are written as .csv or .jsonl";
            return Err(Error::Usage(text.to_owned()));
        }
        let mut to = Target::create(file)?;
        if file.format == RowsFormat::Csv {
            to.write(|to| writeln!(to, "frame,body_a,primitive_a,body_b,primitive_b"))?;
        }
        Ok(FrameRows {
            format: file.format,
            to,
        })
    }

    /// Adds the pairs of a frame.
    pub fn frame(&mut self, frame_ix: usize, pairs: &Pairs) -> Result<(), Error> {
        let is_csv = self.format == RowsFormat::Csv;
        self.to.write(|to| {
            for [body_a, a, body_b, b] in pairs.rows() {
                if is_csv {
                    writeln!(to, "{frame_ix},{body_a},{a},{body_b},{b}")?;
                } else {
                    write!(to, "{{\"frame\":{frame_ix},")?;
                    members(to, [body_a, a, body_b, b])?;
                }
            }
            Ok(())
        })
    }

    /// Gives the file its name.
    pub fn finish(self) -> Result<(), Error> {
        self.to.finish()
    }
}

fn npy(to: &mut dyn Write, rows: impl ExactSizeIterator<Item = [u32; 4]>) -> io::Result<()> {
    to.write_all(&npy_header("'<u4'", &format!("({}, 4)", rows.len())))?;
    for row in rows {
        to.write_all(row.map(u32::to_le_bytes).as_flattened())?;
    }
    Ok(())
}

fn csv(to: &mut dyn Write, rows: impl Iterator<Item = [u32; 4]>) -> io::Result<()> {
    writeln!(to, "body_a,primitive_a,body_b,primitive_b")?;
    for [body_a, a, body_b, b] in rows {
        writeln!(to, "{body_a},{a},{body_b},{b}")?;
    }
    Ok(())
}

fn jsonl(to: &mut dyn Write, rows: impl Iterator<Item = [u32; 4]>) -> io::Result<()> {
    for row in rows {
        to.write_all(b"{")?;
        members(to, row)?;
    }
    Ok(())
}

/// The members of a JSON object, and its end.
fn members(to: &mut (impl Write + ?Sized), [body_a, a, body_b, b]: [u32; 4]) -> io::Result<()> {
    writeln!(
        to,
        "\"body_a\":{body_a},\"primitive_a\":{a},\"body_b\":{body_b},\"primitive_b\":{b}}}"
    )
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
