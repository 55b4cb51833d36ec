//! Keys of near pairs that carry the nearest part of the pair, while they are found and sorted.
//!
//! ```text
//!   63          32 31           4 3    0
//! | lower number | higher number | part |     part: `impinge_exact::filter::Near16`; 15: not known
//! ```
//!
//! The order is that of the keys. Where numbers need more than 28 bits, no part is carried.

use crate::scene::index::{Number, pair_numbers};

/// The bits of a part.
const BITS: u32 = 4;

/// How keys carry parts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Labels {
    bits: u32,
}

impl Labels {
    /// The part of a pair whose nearest features are not known.
    pub const UNKNOWN: u8 = (1 << BITS) - 1;

    /// For pairs of numbers below `n_numbers`.
    pub fn new(n_numbers: u64) -> Self {
        Labels {
            bits: if n_numbers <= 1 << (u32::BITS - BITS) {
                BITS
            } else {
                0
            },
        }
    }

    /// A key with a part.
    #[inline(always)]
    pub fn put(self, key: u64, part: u8) -> u64 {
        let [low, high] = pair_numbers(key);
        let part = u32::from(part) & ((1 << self.bits) - 1);
        low.key_with(Number::new(high.raw() << self.bits | part))
    }

    /// A key and its part.
    #[inline(always)]
    pub fn split(self, labelled: u64) -> (u64, u8) {
        let [low, high] = pair_numbers(labelled);
        let part = match self.bits {
            0 => Self::UNKNOWN,
            _ => high.raw() as u8 & Self::UNKNOWN,
        };
        (low.key_with(Number::new(high.raw() >> self.bits)), part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_come_back_with_their_parts_as_far_as_there_is_room() {
        let most = 1 << 28;
        for (n_numbers, has_room) in [
            (10, true),
            (most, true),
            (most + 1, false),
            (1 << 32, false),
        ] {
            let labels = Labels::new(n_numbers);
            let last = Number::new((n_numbers - 1) as u32);
            let mut before = None;
            for [low, high] in [[0, 1], [0, 2], [3, 9]]
                .map(|pair| pair.map(Number::new))
                .into_iter()
                .chain([[last; 2]])
            {
                let key = low.key_with(high);
                for part in [0, 8, Labels::UNKNOWN] {
                    let labelled = labels.put(key, part);
                    let expected = if has_room { part } else { Labels::UNKNOWN };
                    assert_eq!(labels.split(labelled), (key, expected), "{n_numbers}");
                    assert!(before < Some(labelled) || !has_room && before == Some(labelled));
                    before = Some(labelled);
                }
            }
        }
    }
}
