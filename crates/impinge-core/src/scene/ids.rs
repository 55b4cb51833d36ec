//! Names of bodies.

use std::sync::atomic::{AtomicU64, Ordering};

/// Names a body of a [`Scene`](crate::Scene): a slot, a number that is unique in this process, and
/// the family of the scene.
///
/// Ids are ordered by slot. After a body was removed its slot is reused, but the new body has
/// another number: an old id, or one of another scene, never names a body by mistake. The ids of a
/// scene also name the bodies of its clones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId {
    slot: u32,
    number: u64,
    /// The lower half of the family's number, beside the slot: ids are not larger for it.
    family: u32,
}

impl BodyId {
    /// The id of a new body in a slot of a scene of a [family](crate::Scene::family).
    pub(crate) fn new(slot: u32, family: u64) -> Self {
        BodyId {
            slot,
            number: new_stamp(),
            family: half(family),
        }
    }

    /// Whether the body may have been added to a scene of a family: certainly not if this is false.
    pub(crate) fn may_be_of(self, family: u64) -> bool {
        self.family == half(family)
    }

    /// The body's slot in the scene: 0 for the first body added, and so on. Slots of removed bodies
    /// are reused.
    pub fn index(self) -> usize {
        self.slot as usize
    }

    pub(crate) fn slot(self) -> u32 {
        self.slot
    }
}

/// By its [`index`](BodyId::index), which rows have, too.
#[cfg(feature = "serde")]
impl serde::Serialize for BodyId {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u32(self.slot)
    }
}

/// An id that was read has its [`index`](BodyId::index), but it names no body of any scene: the
/// scene that it belonged to may be gone.
#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for BodyId {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let slot = <u32 as serde::Deserialize>::deserialize(from)?;
        // Stamps begin with 1.
        Ok(BodyId {
            slot,
            number: 0,
            family: 0,
        })
    }
}

impl std::fmt::Display for BodyId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.slot)
    }
}

#[allow(clippy::cast_possible_truncation, reason = "the lower half")]
fn half(family: u64) -> u32 {
    family as u32
}

/// A number that was not used before. Stamps of topology and positions tell a detector what has
/// changed since the last frame. They come from one counter per process, so no two states of any
/// bodies have the same stamp.
pub(crate) fn new_stamp() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}
