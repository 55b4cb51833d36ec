//! Names of bodies.

/// Names a body of a [`Scene`](crate::Scene): a slot and the generation of its use.
///
/// Ids are ordered by slot. A slot is used again after its body was removed, under a new
/// generation, so an old id never names a new body by mistake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId {
    slot: u32,
    generation: u32,
}

impl BodyId {
    /// The body's number in the scene: 0 for the first body added, and so on.
    pub fn index(self) -> usize {
        self.slot as usize
    }

    pub(crate) fn new(slot: u32, generation: u32) -> Self {
        BodyId { slot, generation }
    }

    pub(crate) fn generation(self) -> u32 {
        self.generation
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
