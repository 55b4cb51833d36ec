//! What becomes of a pair found in a cell, where impinge asks who owns it.

use impinge_core::cpu::cells::Rule;
use impinge_core::cpu::kept::Kept;
use impinge_core::cpu::subcells::Asked;
use impinge_core::frame::{Frame, pair_key};

use super::Possible;

impl Possible {
    /// Which pairs that touch a common sub-cell go on, whichever cell they are found in.
    pub(super) fn asked(self) -> Asked {
        Asked {
            boxes: self != Possible::Masks,
            owned: false,
            adjacent: true,
        }
    }
}

/// Every cell tests what it finds.
pub(super) struct Every(pub Possible);

impl Rule for Every {
    fn asked(&self) -> Asked {
        self.0.asked()
    }

    #[inline(always)]
    fn admits(&self, _: &Kept, _: &Kept, _: &mut Vec<u64>) -> bool {
        true
    }
}

/// Nothing is tested; the key of every pair that would be is written down.
pub(super) struct Recorded<'a> {
    pub possible: Possible,
    pub frame: &'a Frame,
}

impl Rule for Recorded<'_> {
    fn asked(&self) -> Asked {
        self.possible.asked()
    }

    #[inline(always)]
    fn admits(&self, a: &Kept, b: &Kept, keys: &mut Vec<u64>) -> bool {
        let global =
            |kept: &Kept| self.frame.layers[kept.participant as usize].first + kept.primitive;
        keys.push(pair_key(global(a), global(b)));
        false
    }
}
