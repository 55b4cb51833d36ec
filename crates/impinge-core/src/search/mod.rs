//! The search: the loop that answers every question, the test of one pair, and where the pairs go.

pub(crate) mod found;
pub(crate) mod key_ranges;
pub(crate) mod memory;
pub(crate) mod moved;
pub(crate) mod naive;
pub(crate) mod narrow;
pub(crate) mod pair_reader;
pub mod runner;
pub(crate) mod sets;
pub(crate) mod shares;
pub mod sink;
pub(crate) mod sort;
pub(crate) mod sparse_rows;
pub(crate) mod stats;
#[cfg(feature = "gpu")]
pub(crate) mod undecided;
pub(crate) mod work;
