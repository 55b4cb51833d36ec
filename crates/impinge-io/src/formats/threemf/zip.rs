//! The parts of a ZIP archive: stored or deflated, without encryption and without ZIP64.
//!
//! Source: PKWARE, "APPNOTE.TXT". Only the central directory says which parts there are. A part is
//! expanded when it is asked for, after its announced size has been charged to a budget, and its
//! length and checksum have to be those announced.

use miniz_oxide::inflate::{TINFLStatus, core};

use crate::budget::{Budget, reserve};
use crate::error::{Error, Name, Place, shown};

/// Deflate expands nothing by more than this.
const MOST_EXPANSION: u64 = 1032;
/// The length of the end record without its comment.
const END: usize = 22;

/// An archive in memory.
pub struct Archive<'b> {
    bytes: &'b [u8],
    entries: Vec<Entry<'b>>,
}

struct Entry<'b> {
    name: &'b [u8],
    flags: u16,
    method: u16,
    checksum: u32,
    packed: u32,
    expanded: u32,
    offset: u32,
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

impl<'b> Archive<'b> {
    /// Reads the central directory.
    pub fn open(bytes: &'b [u8], name: Name) -> Result<Self, Error> {
        let first = bytes.len().saturating_sub(END + usize::from(u16::MAX));
        let last = bytes.len().saturating_sub(END);
        let end = (first..=last)
            .rev()
            .find(|&at| bytes[at..].starts_with(b"PK\x05\x06"))
            .ok_or_else(|| name.syntax(Place::File, "a ZIP archive", "no end record"))?;
        let (Some(n), Some(start)) = (u16_at(bytes, end + 10), u32_at(bytes, end + 16)) else {
            return Err(name.syntax(
                Place::Byte(end as u64),
                "an end record",
                "the end of the file",
            ));
        };
        if n == u16::MAX || start == u32::MAX {
            return Err(name.unsupported(Place::Byte(end as u64), "ZIP64"));
        }
        let mut at = start as usize;
        let mut entries = Vec::new();
        for _ in 0..n {
            let entry = Entry::read(bytes, at).ok_or_else(|| {
                name.syntax(
                    Place::Byte(at as u64),
                    "an entry of the directory",
                    "other bytes",
                )
            })?;
            at = entry.1;
            entries.push(entry.0);
        }
        Ok(Archive { bytes, entries })
    }

    /// The bytes of a part; `None` if there is no part of this name. Case does not matter, as in
    /// packages of OPC.
    pub fn part(
        &self,
        part: &str,
        name: Name,
        budget: &mut Budget,
    ) -> Result<Option<Vec<u8>>, Error> {
        let is_it = |entry: &&Entry| entry.name.eq_ignore_ascii_case(part.as_bytes());
        let Some(entry) = self.entries.iter().find(is_it) else {
            return Ok(None);
        };
        let place = Place::Byte(entry.offset.into());
        if entry.flags & 1 != 0 {
            return Err(name.unsupported(place, "an encrypted part"));
        }
        let packed = self.packed(entry).ok_or_else(|| {
            name.syntax(
                place,
                format!("{} bytes of the part {}", entry.packed, shown(entry.name)),
                "fewer",
            )
        })?;
        let expanded = u64::from(entry.expanded);
        let most = match entry.method {
            0 => packed.len() as u64,
            8 => MOST_EXPANSION.saturating_mul(packed.len() as u64),
            other => return Err(name.unsupported(place, format!("the ZIP method {other}"))),
        };
        if expanded > most {
            let what = format!(
                "bytes of the part {}, by its packed size,",
                shown(entry.name)
            );
            return Err(name.too_large(place, &what, most, expanded));
        }
        budget.charge(name, place, expanded, 1)?;
        let mut out = Vec::new();
        reserve(name, place, &mut out, expanded)?;
        let n = if entry.method == 0 {
            out.extend_from_slice(packed);
            packed.len()
        } else {
            out.resize(expanded as usize, 0);
            let flags = core::inflate_flags::TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF;
            let mut state = Box::<core::DecompressorOxide>::default();
            let (status, _, n) = core::decompress(&mut state, packed, &mut out, 0, flags);
            if status != TINFLStatus::Done {
                let what = format!("the deflated part {}", shown(entry.name));
                return Err(name.syntax(place, what, format!("damaged data ({status:?})")));
            }
            n
        };
        if n as u64 != expanded {
            let what = format!("bytes of the part {}", shown(entry.name));
            return Err(name.count(place, what, expanded, n as u64));
        }
        if checksum(&out) != entry.checksum {
            let what = format!("the part {} as its checksum says", shown(entry.name));
            return Err(name.syntax(place, what, "damaged data"));
        }
        Ok(Some(out))
    }

    fn packed(&self, entry: &Entry) -> Option<&'b [u8]> {
        let at = entry.offset as usize;
        let is_header = self.bytes.get(at..)?.starts_with(b"PK\x03\x04");
        let lengths = [26, 28].map(|offset| u16_at(self.bytes, at + offset));
        let start = at + 30 + usize::from(lengths[0]?) + usize::from(lengths[1]?);
        let end = start.checked_add(entry.packed as usize)?;
        self.bytes.get(start..end).filter(|_| is_header)
    }
}

impl<'b> Entry<'b> {
    /// An entry of the directory, and where the next one begins.
    fn read(bytes: &'b [u8], at: usize) -> Option<(Self, usize)> {
        if !bytes.get(at..)?.starts_with(b"PK\x01\x02") {
            return None;
        }
        let short = |offset: usize| u16_at(bytes, at + offset);
        let long = |offset: usize| u32_at(bytes, at + offset);
        let n = usize::from(short(28)?);
        let entry = Entry {
            name: bytes.get(at + 46..at + 46 + n)?,
            flags: short(8)?,
            method: short(10)?,
            checksum: long(16)?,
            packed: long(20)?,
            expanded: long(24)?,
            offset: long(42)?,
        };
        let rest = usize::from(short(30)?) + usize::from(short(32)?);
        Some((entry, at + 46 + n + rest))
    }
}

/// CRC-32, as in Ethernet.
fn checksum(bytes: &[u8]) -> u32 {
    let table: [u32; 256] = std::array::from_fn(|ix| {
        (0..8).fold(ix as u32, |crc, _| {
            if crc & 1 == 0 {
                crc >> 1
            } else {
                crc >> 1 ^ 0xEDB8_8320
            }
        })
    });
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        crc >> 8 ^ table[usize::from(crc as u8 ^ byte)]
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn checksum_of_the_standard() {
        assert_eq!(super::checksum(b"123456789"), 0xCBF4_3926);
    }
}
