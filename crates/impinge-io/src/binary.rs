//! Binary data: scalar types, byte order, and a cursor that never reads past the end.

use crate::error::{Error, Name, Place};

/// The byte order of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Endian {
    Little,
    Big,
}

/// A type of number in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes per number.
    pub(crate) fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    pub(crate) fn is_float(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F64)
    }

    /// Whether every value of this type is an f32.
    pub(crate) fn fits_f32(self) -> bool {
        matches!(
            self,
            Scalar::F32 | Scalar::I8 | Scalar::U8 | Scalar::I16 | Scalar::U16
        )
    }

    /// The number at the start of `bytes`, which hold at least [`size`](Self::size), as an integer.
    /// A u64 beyond i64 becomes `i64::MAX`, which no index or count reaches; floats are truncated.
    pub(crate) fn integer(self, bytes: &[u8], endian: Endian) -> i64 {
        match self {
            Scalar::I8 => i64::from(i8::from_ne_bytes([bytes[0]])),
            Scalar::U8 => i64::from(bytes[0]),
            Scalar::I16 => i64::from(i16::from_le_bytes(array(bytes, endian))),
            Scalar::U16 => i64::from(u16::from_le_bytes(array(bytes, endian))),
            Scalar::I32 => i64::from(i32::from_le_bytes(array(bytes, endian))),
            Scalar::U32 => i64::from(u32::from_le_bytes(array(bytes, endian))),
            Scalar::I64 => i64::from_le_bytes(array(bytes, endian)),
            Scalar::U64 => {
                i64::try_from(u64::from_le_bytes(array(bytes, endian))).unwrap_or(i64::MAX)
            }
            Scalar::F32 | Scalar::F64 => self.float(bytes, endian) as i64,
        }
    }

    /// The number at the start of `bytes`, which hold at least [`size`](Self::size), in f64; a
    /// 64-bit integer is rounded.
    pub(crate) fn float(self, bytes: &[u8], endian: Endian) -> f64 {
        match self {
            Scalar::F32 => f64::from(f32::from_le_bytes(array(bytes, endian))),
            Scalar::F64 => f64::from_le_bytes(array(bytes, endian)),
            _ => self.integer(bytes, endian) as f64,
        }
    }

    /// The number at the start of `bytes` in f32. Callers make sure that
    /// [`fits_f32`](Self::fits_f32) holds, so it is exact.
    pub(crate) fn narrow(self, bytes: &[u8], endian: Endian) -> f32 {
        match self {
            Scalar::F32 => f32::from_le_bytes(array(bytes, endian)),
            _ => self.float(bytes, endian) as f32,
        }
    }
}

/// The first `N` bytes in little-endian order.
pub(crate) fn array<const N: usize>(bytes: &[u8], endian: Endian) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&bytes[..N]);
    if endian == Endian::Big {
        array.reverse();
    }
    array
}

/// A cursor over binary data that turns every read past the end into an error.
#[derive(Debug, Clone)]
pub(crate) struct Cursor<'a> {
    name: Name<'a>,
    bytes: &'a [u8],
    offset: usize,
    /// Added to offsets in messages: where this data starts in its file.
    base: usize,
    pub endian: Endian,
}

impl<'a> Cursor<'a> {
    /// A cursor at `offset`, which is at most the length of `bytes`.
    pub(crate) fn new(name: Name<'a>, bytes: &'a [u8], offset: usize, endian: Endian) -> Self {
        Cursor {
            name,
            bytes,
            offset: offset.min(bytes.len()),
            base: 0,
            endian,
        }
    }

    pub(crate) fn place(&self) -> Place {
        Place::Byte((self.base + self.offset) as u64)
    }

    pub(crate) fn offset(&self) -> usize {
        self.offset
    }

    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.offset
    }

    /// The next `n` things of `size` bytes each.
    pub(crate) fn take(&mut self, n: u64, size: usize, what: &str) -> Result<&'a [u8], Error> {
        let needed = n.saturating_mul(size as u64);
        let left = self.left();
        match usize::try_from(needed) {
            Ok(length) if length <= left => {
                let start = self.offset;
                self.offset += length;
                Ok(&self.bytes[start..self.offset])
            }
            _ => Err(self.name.truncated(self.place(), what, needed, left as u64)),
        }
    }

    /// The next number as an integer.
    pub(crate) fn integer(&mut self, scalar: Scalar, what: &str) -> Result<i64, Error> {
        let endian = self.endian;
        Ok(scalar.integer(self.take(1, scalar.size(), what)?, endian))
    }

    /// The next number as a count, which must not be negative.
    pub(crate) fn count(&mut self, scalar: Scalar, what: &str) -> Result<u64, Error> {
        let place = self.place();
        let value = self.integer(scalar, what)?;
        u64::try_from(value).map_err(|_| {
            self.name
                .syntax(place, format!("{what}, at least 0"), value.to_string())
        })
    }
}
