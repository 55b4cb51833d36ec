//! What tiles of a step write: first contacts whose elements have names instead of numbers, and the
//! names to number.
//!
//! ```text
//! results/tile-*.npy        per contact: kind, body, name, body, name, time, whether at the start: ten u32
//! results/tile-*-names.npy  per element that needs a number: body, part, name: four u32, sorted
//! ```

use impinge::PairKind;

use crate::hash;

/// A name of an element that every tile with this element knows, and whose order is that of the
/// numbers in the whole body:
///
/// | element | name |
/// |---|---|
/// | vertex | its number, 0 |
/// | edge | its higher vertex, its lower vertex |
/// | triangle | its number, 0 |
/// | boundary face of tetrahedra | the first tetrahedron that has it, the opposite corner in it |
pub type Name = [u32; 2];

/// A body and the name of one of its elements.
pub type Element = (u32, Name);

/// The parts whose elements have no number in a tile.
pub const EDGES: u32 = 0;
pub const BOUNDARY: u32 = 1;

/// One contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    pub kind: PairKind,
    /// Bodies and elements, as the kind orders them.
    pub elements: [Element; 2],
    pub toi: f64,
    pub at_start: bool,
}

/// The words of a contact on disk.
pub const WORDS: usize = 10;

impl Contact {
    pub fn to_words(self) -> [u32; WORDS] {
        let [(body_a, a), (body_b, b)] = self.elements;
        let toi = self.toi.to_bits();
        let (kind, at_start) = (self.kind as u32, u32::from(self.at_start));
        [
            kind,
            body_a,
            a[0],
            a[1],
            body_b,
            b[0],
            b[1],
            toi as u32,
            (toi >> 32) as u32,
            at_start,
        ]
    }

    /// `None` if the words are not those of a contact.
    pub fn from_words(words: [u32; WORDS]) -> Option<Self> {
        let [kind, body_a, a0, a1, body_b, b0, b1, low, high, at_start] = words;
        Some(Contact {
            kind: *PairKind::ALL.get(kind as usize)?,
            elements: [(body_a, [a0, a1]), (body_b, [b0, b1])],
            toi: f64::from_bits(u64::from(high) << 32 | u64::from(low)),
            at_start: at_start == 1,
        })
    }
}

/// A checksum of contacts on disk.
pub fn checksum(rows: &[[u32; WORDS]]) -> u64 {
    let bytes: Vec<u8> = rows
        .as_flattened()
        .iter()
        .flat_map(|word| word.to_le_bytes())
        .collect();
    hash::checksum(&bytes)
}

/// A contact with numbers in place of names: kind, `[body_a, element_a, body_b, element_b]`, time.
pub type Row = (PairKind, [u32; 4], f64);
