//! Whether the boxes of two elements overlap during a step.

use crate::boxes::Extent;
use crate::plan::TestId;
use impinge_exact::internal::two_sum;

use super::{PairElement, Test};

/// The test of [`Detector::candidates`](crate::Detector::candidates): whether the boxes over the
/// whole step overlap once each is inflated by half of the separation that the plan says and the
/// thickness of its element, so that no axis has a gap of more than both together.
pub(crate) struct BoxOverlap;

impl Test for BoxOverlap {
    type Value = ();

    fn extent(&self, element: PairElement<'_>) -> Extent {
        let extent = Extent::of(element.ends().flatten());
        // Rounded outward: `decide` tests again without rounding.
        extent.inflated(element.plan.inflation_of(element.part, element.element))
    }

    fn decide(&self, _: TestId, a: PairElement<'_>, b: PairElement<'_>) -> Option<()> {
        if a.shares_vertex(&b) {
            return None;
        }
        let gap = (a.plan).separation([&a, &b].map(|of| (of.part, of.element)));
        let [a, b] = [a, b].map(|element| Extent::of(element.ends().flatten()));
        are_near(&a, &b, gap).then_some(())
    }
}

/// Whether no axis has a gap above `most` between two boxes, decided exactly.
pub(crate) fn are_near(a: &Extent, b: &Extent, most: f64) -> bool {
    (0..3).all(|axis| {
        !is_beyond(a.min[axis], b.max[axis], most) && !is_beyond(b.min[axis], a.max[axis], most)
    })
}

/// Whether `low - high > most`, as real numbers.
fn is_beyond(low: f64, high: f64, most: f64) -> bool {
    let [gap, error] = two_sum(low, -high);
    gap > most || (gap == most && error > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_compared_as_real_numbers() {
        let least = f64::MIN_POSITIVE;
        assert!(!is_beyond(1.0, 0.0, 1.0));
        assert!(is_beyond(1.0, -least, 1.0), "the difference rounds to 1");
        assert!(!is_beyond(1.0, least, 1.0), "and so does this one");
        assert!(is_beyond(1.0_f64.next_up(), 0.0, 1.0));
        assert!(is_beyond(least, 0.0, 0.0) && !is_beyond(0.0, 0.0, 0.0));
    }
}
