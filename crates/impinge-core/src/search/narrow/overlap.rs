//! Whether the boxes of two elements overlap during a step.

use crate::boxes::Extent;
use crate::plan::TestId;
use impinge_exact::internal::two_sum;

use super::{PairElement, Test};

/// The test of [`Detector::candidates`](crate::Detector::candidates): whether the boxes over the
/// whole step overlap once each is inflated by the distance that the plan says, so that no axis has
/// a gap of more than twice that.
pub(crate) struct BoxOverlap;

impl Test for BoxOverlap {
    type Value = ();

    fn extent(&self, element: PairElement<'_>) -> Extent {
        let extent = Extent::of(element.ends().flatten());
        // Rounded outward: `decide` tests again without rounding.
        extent.inflated(element.plan.inflation(element.part))
    }

    fn decide(&self, _: TestId, a: PairElement<'_>, b: PairElement<'_>) -> Option<()> {
        if a.shares_vertex(&b) {
            return None;
        }
        // That of all parts.
        let distance = a.plan.inflation(a.part);
        let [a, b] = [a, b].map(|element| Extent::of(element.ends().flatten()));
        are_near(&a, &b, distance).then_some(())
    }
}

/// Whether two boxes overlap once each is inflated by `distance`, decided exactly.
pub(crate) fn are_near(a: &Extent, b: &Extent, distance: f64) -> bool {
    (0..3).all(|axis| {
        !is_beyond(a.min[axis], b.max[axis], distance)
            && !is_beyond(b.min[axis], a.max[axis], distance)
    })
}

/// Whether `low - high > 2 distance`, as real numbers.
fn is_beyond(low: f64, high: f64, distance: f64) -> bool {
    let [gap, error] = two_sum(low, -high);
    let most = 2.0 * distance;
    gap > most || (gap == most && error > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_compared_as_real_numbers() {
        let least = f64::MIN_POSITIVE;
        assert!(!is_beyond(1.0, 0.0, 0.5));
        assert!(is_beyond(1.0, -least, 0.5), "the difference rounds to 1");
        assert!(!is_beyond(1.0, least, 0.5), "and so does this one");
        assert!(is_beyond(1.0_f64.next_up(), 0.0, 0.5));
        assert!(is_beyond(least, 0.0, 0.0) && !is_beyond(0.0, 0.0, 0.0));
    }
}
