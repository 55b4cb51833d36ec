//! How much of the answer is wanted, and how large it may be.

/// What of the pairs is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Goal {
    /// All of them.
    #[default]
    All,
    /// How many there are.
    Count,
    /// Whether there is any.
    Any,
    /// Of contacts, the earliest, and all whose times may round to the same time.
    Earliest,
    /// The pair that comes first, by its element of one of two parts and then by that of the other.
    Lowest {
        /// Whether the element of the second part comes first.
        by_second: bool,
    },
}

impl Goal {
    /// Whether pairs are held.
    pub(crate) fn holds(self) -> bool {
        matches!(self, Goal::All | Goal::Earliest)
    }
}

/// Limits on the size of an answer.
#[derive(Debug, Clone, Copy, Default)]
pub struct Limits {
    /// Pairs at most.
    pub max_pairs: Option<u64>,
    /// Bytes that the detector may hold, the answer included.
    pub memory_budget: Option<u64>,
    /// Bytes per pair that the answer takes besides, once all pairs are found.
    pub besides: u64,
}
