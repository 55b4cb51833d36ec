//! Rules for a pair found in a cell, in place of impinge's owner rule.

use impinge_core::cpu::cells::Rule;
use impinge_core::cpu::kept::Kept;
use impinge_core::cpu::subcells::Asked;
use impinge_core::plan::{Plan, pair_key};

use super::Possible;

impl Possible {
    /// Which pairs that touch a common sub-cell are possible, in any cell.
    pub(super) fn asked(self) -> Asked {
        Asked {
            boxes: self != Possible::Masks,
            owned: false,
            adjacent: true,
        }
    }
}

/// Every cell tests the pairs that it finds.
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

/// Tests nothing; records the key of every pair that would be tested.
pub(super) struct Recorded<'a> {
    pub possible: Possible,
    pub frame: &'a Plan,
}

impl Rule for Recorded<'_> {
    fn asked(&self) -> Asked {
        self.possible.asked()
    }

    #[inline(always)]
    fn admits(&self, a: &Kept, b: &Kept, keys: &mut Vec<u64>) -> bool {
        let [a, b] = [a, b].map(|kept| self.frame.layer(kept.layer).number(kept.primitive));
        keys.push(pair_key(a, b));
        false
    }
}
