//! Names of bodies.

use std::sync::atomic::{AtomicU64, Ordering};

/// Names a body of a [`Scene`](crate::Scene): a slot, and a number that no other body of this process has.
///
/// Ids are ordered by slot. A slot is used again after its body was removed, but the new body has another
/// number: an old id, or one of another scene, never names a body by mistake. The ids of a scene also name
/// the bodies of its clones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId {
    slot: u32,
    number: u64,
}

impl BodyId {
    /// The id of a new body in a slot.
    pub(crate) fn new(slot: u32) -> Self {
        let number = new_stamp();
        BodyId { slot, number }
    }

    /// The body's number in the scene: 0 for the first body added, and so on.
    pub fn index(self) -> usize {
        self.slot as usize
    }

    pub(crate) fn slot(self) -> u32 {
        self.slot
    }
}

impl std::fmt::Display for BodyId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.slot)
    }
}

/// A number that was not handed out before. Stamps of topology and positions tell a detector what has changed since it
/// last looked: they come from one counter of the process, so no two states of any two bodies ever carry the same one.
pub(crate) fn new_stamp() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}
