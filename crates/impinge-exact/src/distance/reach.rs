//! A distance as callers give it: a sum of numbers, read as real numbers.

use crate::algebra::Integer;
use crate::rounding::round_down;

/// A sum of three floats that are finite and not below zero, and floats that enclose it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// The numbers whose exact sum it is.
    pub(super) parts: [f64; 3],
    /// At most the sum.
    pub(super) low: f64,
    /// At least the sum.
    pub(super) high: f64,
}

impl Reach {
    /// How many numbers are added.
    pub(super) const PARTS: usize = 3;

    /// The exact sum of some numbers that are finite and not below zero.
    #[inline]
    pub fn of_sum(parts: [f64; Self::PARTS]) -> Self {
        let sum = parts[0] + parts[1] + parts[2];
        let is_one_number = parts.iter().filter(|&&part| part != 0.0).count() <= 1;
        if is_one_number {
            return Self {
                parts,
                low: sum,
                high: sum,
            };
        }
        // Two roundings of sums without cancellation: the sum is wrong by less than two units in
        // the last place.
        Self {
            parts,
            low: sum.next_down().next_down().max(0.0),
            high: sum.next_up().next_up(),
        }
    }

    /// Two `f32` that enclose the sum.
    #[inline]
    pub fn enclosing_f32(&self) -> [f32; 2] {
        [round_down(self.low), -round_down(-self.high)]
    }

    /// The sum of its parts as integers.
    pub(super) fn sum(integers: &[Integer]) -> Integer {
        integers
            .iter()
            .fold(Integer::zero(), |sum, part| &sum + part)
    }
}

impl From<f64> for Reach {
    #[inline]
    fn from(distance: f64) -> Self {
        Self::of_sum([distance, 0.0, 0.0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_lies_between_its_bounds() {
        let one = Reach::from(0.1);
        assert_eq!((one.low, one.high), (0.1, 0.1));
        let least = f64::from_bits(1);
        for parts in [
            [0.1, 0.2, 0.3],
            [1.0, 2f64.powi(-80), 2f64.powi(-80)],
            [least, least, least],
            [f64::MAX, 1.0, 0.0],
        ] {
            let reach = Reach::of_sum(parts);
            let sum = parts[0] + parts[1] + parts[2];
            assert!(reach.low <= sum && sum <= reach.high);
            assert!(reach.low < reach.high);
            let [low, high] = reach.enclosing_f32().map(f64::from);
            assert!(low <= reach.low && reach.high <= high);
        }
    }
}
