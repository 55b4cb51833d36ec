//! Limits on data that is larger in memory than in its file.

use crate::error::{Error, Name, Place};

/// Reserves room for `n` more elements. Returns an error if there is not enough memory, instead of
/// ending the process.
pub(crate) fn reserve<T>(name: Name, place: Place, to: &mut Vec<T>, n: u64) -> Result<(), Error> {
    usize::try_from(n)
        .ok()
        .and_then(|n| to.try_reserve_exact(n).ok())
        .ok_or_else(|| Error::NoMemory {
            at: name.at(place),
            needed: n.saturating_mul(size_of::<T>() as u64),
        })
}

/// The most bytes that the compressed data of a file of `length` bytes may expand to. Meshes rarely
/// compress to less than a tenth of their size. Constant arrays compress by a factor of a thousand,
/// but they are a small part of a mesh.
pub(crate) fn most_expanded(length: u64, limit: u64) -> u64 {
    const FACTOR: u64 = 200;
    const FLOOR: u64 = 64 << 20;
    limit.min(length.saturating_mul(FACTOR).max(FLOOR))
}

/// A number of bytes that may still be used.
#[derive(Debug)]
pub(crate) struct Budget {
    limit: u64,
    used: u64,
}

impl Budget {
    pub(crate) fn new(limit: u64) -> Self {
        Budget { limit, used: 0 }
    }

    /// Charges `n` elements of `size` bytes to the budget, before memory is reserved for them.
    pub(crate) fn charge(
        &mut self,
        name: Name,
        place: Place,
        n: u64,
        size: u64,
    ) -> Result<(), Error> {
        self.used = self.used.saturating_add(n.saturating_mul(size));
        if self.used > self.limit {
            return Err(name.too_large(
                place,
                "bytes of expanded data (see ReadOptions::max_expanded_bytes)",
                self.limit,
                self.used,
            ));
        }
        Ok(())
    }
}
