//! The arrays of a VTU file, whatever their storage.

use std::borrow::Cow;

use super::xml::Node;
use crate::base64;
use crate::binary::{Endian, Scalar};
use crate::budget::{Budget, reserve};
use crate::collect::finite;
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::text::Text;

#[derive(Debug, Clone, Copy)]
pub(super) enum Compressor {
    Zlib,
    Lz4,
}

/// The numbers of an array.
pub(super) enum Values<'b> {
    Floats(Vec<f64>),
    Integers(Vec<i64>),
    Binary {
        bytes: Cow<'b, [u8]>,
        scalar: Scalar,
        endian: Endian,
    },
}

impl Values<'_> {
    pub(super) fn len(&self) -> usize {
        match self {
            Values::Floats(values) => values.len(),
            Values::Integers(values) => values.len(),
            Values::Binary { bytes, scalar, .. } => bytes.len() / scalar.size(),
        }
    }

    /// Value `ix`, which must exist, as an integer.
    pub(super) fn integer(&self, ix: usize) -> i64 {
        match self {
            Values::Floats(values) => values[ix] as i64,
            Values::Integers(values) => values[ix],
            Values::Binary {
                bytes,
                scalar,
                endian,
            } => scalar.integer(&bytes[ix * scalar.size()..], *endian),
        }
    }

    /// All values as positions; the first is that of vertex `first`.
    pub(super) fn positions(
        &self,
        name: Name,
        place: Place,
        first: u64,
    ) -> Result<Positions, Error> {
        let checked = |positions: Vec<[f64; 3]>| {
            for (ix, &position) in positions.iter().enumerate() {
                finite(name, place, first as usize + ix, position)?;
            }
            Ok(Positions::F64(positions))
        };
        match self {
            Values::Floats(values) => checked(values.as_chunks::<3>().0.to_vec()),
            Values::Integers(values) => checked(
                values
                    .as_chunks::<3>()
                    .0
                    .iter()
                    .map(|v| v.map(|c| c as f64))
                    .collect(),
            ),
            Values::Binary {
                bytes,
                scalar,
                endian,
            } => super::super::positions(name, bytes, *scalar, *endian, |_| place),
        }
    }
}

/// The appended data.
#[derive(Clone, Copy)]
pub(super) struct Appended<'b> {
    pub bytes: &'b [u8],
    /// Where they start in the file.
    pub start: usize,
    pub is_base64: bool,
}

/// Everything needed to read the arrays of a file.
pub(super) struct Arrays<'b> {
    pub name: Name<'b>,
    pub xml: &'b str,
    pub appended: Option<Appended<'b>>,
    pub endian: Endian,
    /// The type of the numbers before binary data.
    pub header: Scalar,
    pub compressor: Option<Compressor>,
    pub budget: Budget,
}

/// Encoded bytes from some place on; their number is known only while reading.
struct Encoded<'b> {
    bytes: &'b [u8],
    is_base64: bool,
    at: Place,
}

impl<'b> Arrays<'b> {
    /// Reads the `DataArray` at `node`.
    pub(super) fn read(&mut self, node: Node) -> Result<Values<'b>, Error> {
        let (name, at) = (self.name, node.place());
        let kind = node.attribute("type").unwrap_or_default();
        let scalar = match kind {
            "Int8" => Scalar::I8,
            "UInt8" => Scalar::U8,
            "Int16" => Scalar::I16,
            "UInt16" => Scalar::U16,
            "Int32" => Scalar::I32,
            "UInt32" => Scalar::U32,
            "Int64" => Scalar::I64,
            "UInt64" => Scalar::U64,
            "Float32" => Scalar::F32,
            "Float64" => Scalar::F64,
            other => return Err(name.syntax(at, "a type of numbers", shown(other.as_bytes()))),
        };
        let text = node.text();
        let encoded = match node.attribute("format") {
            None | Some("ascii") => return self.read_ascii(scalar, text),
            Some("binary") => Encoded {
                bytes: self.xml[text].as_bytes().trim_ascii(),
                is_base64: true,
                at,
            },
            Some("appended") => {
                let appended = self
                    .appended
                    .ok_or_else(|| name.syntax(at, "an element 'AppendedData'", "none"))?;
                let offset = node.attribute("offset").unwrap_or_default();
                let offset = offset.trim().parse::<usize>().map_err(|_| {
                    name.syntax(at, "a number in 'offset'", shown(offset.as_bytes()))
                })?;
                let bytes = appended.bytes.get(offset..).ok_or_else(|| {
                    name.truncated(
                        at,
                        "the appended data",
                        offset as u64,
                        appended.bytes.len() as u64,
                    )
                })?;
                Encoded {
                    bytes,
                    is_base64: appended.is_base64,
                    at: Place::Byte((appended.start + offset) as u64),
                }
            }
            Some(other) => {
                return Err(name.syntax(
                    at,
                    "'ascii', 'binary' or 'appended'",
                    shown(other.as_bytes()),
                ));
            }
        };
        let bytes = match self.compressor {
            None => self.plain(&encoded)?,
            Some(compressor) => Cow::Owned(self.compressed(&encoded, compressor)?),
        };
        if !bytes.len().is_multiple_of(scalar.size()) {
            let whole = bytes.len().next_multiple_of(scalar.size());
            return Err(name.count(
                encoded.at,
                format!("bytes of numbers of type {kind}"),
                whole as u64,
                bytes.len() as u64,
            ));
        }
        Ok(Values::Binary {
            bytes,
            scalar,
            endian: self.endian,
        })
    }

    fn read_ascii(
        &self,
        scalar: Scalar,
        range: std::ops::Range<usize>,
    ) -> Result<Values<'b>, Error> {
        let mut text =
            Text::new(self.name, &self.xml.as_bytes()[range.clone()]).in_bytes(range.start);
        if scalar.is_float() {
            let mut values = Vec::new();
            while text.peek_word().is_some() {
                values.push(text.number("a number")?);
            }
            return Ok(Values::Floats(values));
        }
        let mut values = Vec::new();
        while text.peek_word().is_some() {
            values.push(text.number("an integer")?);
        }
        Ok(Values::Integers(values))
    }

    /// The first `n` decoded bytes of `encoded`, charged to the budget.
    fn fetch(&mut self, encoded: &Encoded<'b>, n: u64, what: &str) -> Result<Cow<'b, [u8]>, Error> {
        let (name, at) = (self.name, encoded.at);
        self.budget
            .charge(name, at, n.min(encoded.bytes.len() as u64), 1)?;
        let most = usize::try_from(n).unwrap_or(usize::MAX);
        let bytes = if encoded.is_base64 {
            let wrong = |base64::Wrong(ix): base64::Wrong| {
                name.syntax(
                    at,
                    "base64",
                    format!(
                        "{} at its byte {ix}",
                        encoded
                            .bytes
                            .get(ix..)
                            .map_or("the end".to_owned(), |rest| shown(
                                &rest[..rest.len().min(1)]
                            ))
                    ),
                )
            };
            Cow::Owned(base64::decode(encoded.bytes, most).map_err(wrong)?)
        } else {
            Cow::Borrowed(&encoded.bytes[..encoded.bytes.len().min(most)])
        };
        if (bytes.len() as u64) < n {
            return Err(name.truncated(at, what, n, bytes.len() as u64));
        }
        Ok(bytes)
    }

    /// Reads data that follows its length.
    fn plain(&mut self, encoded: &Encoded<'b>) -> Result<Cow<'b, [u8]>, Error> {
        let size = self.header.size();
        let header = self.fetch(encoded, size as u64, "the length of an array")?;
        let length = self.header.integer(&header, self.endian).unsigned_abs();
        let all = self.fetch(encoded, length.saturating_add(size as u64), "an array")?;
        Ok(match all {
            Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[size..]),
            Cow::Owned(mut bytes) => {
                bytes.drain(..size);
                Cow::Owned(bytes)
            }
        })
    }

    /// Reads compressed data that follows its header: the number of blocks, the size of a block,
    /// the size of the last block (0 if it is full), then the compressed size of each block.
    fn compressed(
        &mut self,
        encoded: &Encoded<'b>,
        compressor: Compressor,
    ) -> Result<Vec<u8>, Error> {
        let (name, at, size, endian) = (self.name, encoded.at, self.header.size(), self.endian);
        let header = self.header;
        let numbers = |bytes: &[u8]| -> Vec<u64> {
            bytes
                .chunks_exact(size)
                .map(|bytes| header.integer(bytes, endian).unsigned_abs())
                .collect()
        };
        let start =
            numbers(&self.fetch(encoded, 3 * size as u64, "the header of compressed data")?);
        let (n_blocks, block, last) = (start[0], start[1], start[2]);
        if n_blocks == 0 {
            return Ok(Vec::new());
        }
        let header_length = n_blocks.saturating_add(3).saturating_mul(size as u64);
        let sizes =
            numbers(&self.fetch(encoded, header_length, "the header of compressed data")?)
                .split_off(3);
        let length = sizes
            .iter()
            .fold(header_length, |sum, &size| sum.saturating_add(size));
        let all = self.fetch(encoded, length, "compressed data")?;
        // All blocks are full, except perhaps the last.
        let expanded = |ix: u64| match last {
            1.. if ix == n_blocks => last,
            _ => block,
        };
        let mut total = 0u64;
        for (ix, &compressed) in (1..).zip(&sizes) {
            // Neither method expands data more than this. A header that claims more is wrong, and
            // no memory is reserved for it.
            let most = compressed.saturating_mul(1100).saturating_add(64);
            if expanded(ix) > most {
                return Err(name.too_large(
                    at,
                    format!("length of block {ix} out of {compressed} bytes"),
                    most,
                    expanded(ix),
                ));
            }
            total = total.saturating_add(expanded(ix));
        }
        self.budget.charge(name, at, total, 1)?;
        let mut out: Vec<u8> = Vec::new();
        reserve(name, at, &mut out, total)?;
        // The sizes add up to at most the fetched length, so they fit.
        let mut rest = &all[header_length as usize..];
        for (ix, &compressed) in (1..).zip(&sizes) {
            let (bytes, behind) = rest.split_at(compressed as usize);
            rest = behind;
            let (start, expected) = (out.len(), expanded(ix) as usize);
            out.resize(start + expected, 0);
            let found = decompress(bytes, &mut out[start..], compressor).map_err(|message| {
                name.syntax(
                    at,
                    format!("a compressed block {ix} of {expected} bytes"),
                    message,
                )
            })?;
            if found != expected {
                let what = format!("bytes in block {ix}");
                return Err(name.count(at, what, expected as u64, found as u64));
            }
        }
        Ok(out)
    }
}

/// Decompresses a block into `out` and returns how many bytes it filled.
fn decompress(bytes: &[u8], out: &mut [u8], compressor: Compressor) -> Result<usize, String> {
    use miniz_oxide::inflate::{TINFLStatus, core};
    match compressor {
        Compressor::Zlib => {
            let flags = core::inflate_flags::TINFL_FLAG_PARSE_ZLIB_HEADER
                | core::inflate_flags::TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF;
            let mut state = Box::<core::DecompressorOxide>::default();
            let (status, _, n_written) = core::decompress(&mut state, bytes, out, 0, flags);
            match status {
                TINFLStatus::Done => Ok(n_written),
                status => Err(format!("zlib: {status:?}")),
            }
        }
        Compressor::Lz4 => lz4_flex::block::decompress_into(bytes, out)
            .map_err(|error| format!("LZ4: {error}").replace('\n', " ")),
    }
}
