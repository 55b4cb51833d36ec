//! What becomes of a pair found in a cell, where impinge asks who owns it.

use impinge::guest::{Frame, Kept, Rule, pair_key};

use super::Possible;

impl Possible {
    /// Whether a pair that touches a common sub-cell goes on.
    #[inline(always)]
    pub(super) fn admits(self, a: &Kept, b: &Kept) -> bool {
        self == Possible::Masks || a.bounds.overlaps(&b.bounds)
    }
}

/// Every cell tests what it finds.
pub(super) struct Every(pub Possible);

impl Rule for Every {
    #[inline(always)]
    fn admits(&self, _: [u32; 3], a: &Kept, b: &Kept, _: &mut Vec<u64>) -> bool {
        self.0.admits(a, b)
    }
}

/// Nothing is tested; the key of every pair that would be is written down.
pub(super) struct Recorded<'a> {
    pub possible: Possible,
    pub frame: &'a Frame,
}

impl Rule for Recorded<'_> {
    #[inline(always)]
    fn admits(&self, _: [u32; 3], a: &Kept, b: &Kept, keys: &mut Vec<u64>) -> bool {
        if self.possible.admits(a, b) {
            let global = |kept: &Kept| {
                self.frame.participants[kept.participant as usize].first + kept.primitive
            };
            keys.push(pair_key(global(a), global(b)));
        }
        false
    }
}
