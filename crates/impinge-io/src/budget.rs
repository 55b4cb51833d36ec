//! What data may take that is larger in memory than in its file.

use crate::error::{Error, Name, Place};

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

    /// Takes `n` things of `size` bytes from the budget, before memory is reserved for them.
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
