//! Rules for a pair found in a cell, in place of impinge's owner rule.

use impinge_core::cpu::cells::Rule;
use impinge_core::cpu::cull_map::InRegion;
use impinge_core::cpu::subcells::SubcellQuery;
use impinge_core::plan::{Plan, pair_key};

use super::Possible;

impl Possible {
    /// Which pairs that touch a common sub-cell are possible, in any cell.
    pub(super) fn query(self) -> SubcellQuery {
        SubcellQuery {
            boxes: self != Possible::Masks,
            owned: false,
            adjacent: true,
        }
    }
}

/// Every cell tests the pairs that it finds.
pub(super) struct Every(pub Possible);

impl Rule for Every {
    fn query(&self) -> SubcellQuery {
        self.0.query()
    }

    #[inline(always)]
    fn admits(&self, _: &InRegion, _: &InRegion, _: &mut Vec<u64>) -> bool {
        true
    }
}

/// Tests nothing; records the key of every pair that would be tested.
pub(super) struct Recorded<'a> {
    pub possible: Possible,
    pub plan: &'a Plan,
}

impl Rule for Recorded<'_> {
    fn query(&self) -> SubcellQuery {
        self.possible.query()
    }

    #[inline(always)]
    fn admits(&self, a: &InRegion, b: &InRegion, keys: &mut Vec<u64>) -> bool {
        let [a, b] = [a, b].map(|kept| self.plan.part(kept.part).number(kept.element));
        keys.push(pair_key(a, b));
        false
    }
}
