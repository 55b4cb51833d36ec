//! The boxes that are tested, made from moving boxes.

use crate::grouping::GROUP;
use crate::grouping::bounds::{Bounds, greater, lesser, round_down, round_up};

use crate::cpu::simd::LaneBounds;

/// Which part of a step is examined, and by how much boxes are inflated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    /// The time up to which elements move, above 0 and at most 1.
    pub until: f64,
    /// How far boxes reach beyond their contents, on all sides.
    pub margin: f64,
    /// Whether boxes hold the whole path from the start to the end, so that both are the same.
    pub is_swept: bool,
}

impl Pose {
    /// The whole step.
    pub const WHOLE: Pose = Pose {
        until: 1.0,
        margin: 0.0,
        is_swept: false,
    };

    /// Whether the boxes at both ends are used unchanged.
    fn is_plain(self) -> bool {
        self == Pose::WHOLE
    }

    /// The boxes to be tested, from those at the start and at the end of the step.
    ///
    /// The box at a time between lies within the interpolation of the boxes at both ends: each coordinate is at least the
    /// interpolated minimum. Everything is rounded outward.
    #[inline(always)]
    pub fn close(self, [start, end]: [Bounds; 2]) -> [Bounds; 2] {
        if self.is_plain() {
            return [start, end];
        }
        let at = |x: f32, y: f32| {
            let (x, y) = (f64::from(x), f64::from(y));
            x + self.until * (y - x)
        };
        // Two roundings of numbers up to twice the larger end: 2^-51 of it is more than enough.
        let slack = |x: f32, y: f32| f64::from(greater(x.abs(), y.abs())) * 2f64.powi(-50);
        let mut end = Bounds {
            min: std::array::from_fn(|axis| {
                let (x, y) = (start.min[axis], end.min[axis]);
                if self.until < 1.0 {
                    greater(round_down(at(x, y) - slack(x, y)), lesser(x, y))
                } else {
                    y
                }
            }),
            max: std::array::from_fn(|axis| {
                let (x, y) = (start.max[axis], end.max[axis]);
                if self.until < 1.0 {
                    lesser(round_up(at(x, y) + slack(x, y)), greater(x, y))
                } else {
                    y
                }
            }),
        };
        let mut start = start;
        if self.is_swept {
            start.join(&end);
            end = start;
        }
        [self.inflated(start), self.inflated(end)]
    }

    fn inflated(self, bounds: Bounds) -> Bounds {
        if self.margin == 0.0 {
            return bounds;
        }
        Bounds {
            min: bounds
                .min
                .map(|x| round_down((f64::from(x) - self.margin).next_down())),
            max: bounds
                .max
                .map(|x| round_up((f64::from(x) + self.margin).next_up())),
        }
    }

    /// [`close`](Self::close) for the boxes of a group, of so many elements.
    #[inline(always)]
    pub fn close_all(self, [start, end]: [&mut LaneBounds; 2], size: usize) {
        if self.is_plain() {
            return;
        }
        debug_assert!(size <= GROUP);
        for lane in 0..size {
            let [at_start, at_end] = self.close([start.at(lane), end.at(lane)]);
            start.put(lane, &at_start);
            end.put(lane, &at_end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_between_hold_what_is_in_them() {
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            // Between -1 and 1, then of many sizes.
            let x = (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0;
            x * 2f32.powi((state >> 33 & 15) as i32 - 8)
        };
        for until in [1.0, 0.5, 0.1, 1e-3, 1e-9] {
            for (margin, is_swept) in [(0.0, false), (0.0, true), (0.25, true), (1e-9, true)] {
                let pose = Pose {
                    until,
                    margin,
                    is_swept,
                };
                for _ in 0..1000 {
                    let (points, mut boxes) =
                        ([[next(), next()], [next(), next()]], [Bounds::EMPTY; 2]);
                    for point in points {
                        for end in 0..2 {
                            let at = [point[end]; 3];
                            boxes[end].join(&Bounds { min: at, max: at });
                        }
                    }
                    let [start, end] = pose.close(boxes);
                    for point in points {
                        let [x, y] = point.map(f64::from);
                        let z = x + until * (y - x);
                        assert!(
                            f64::from(start.min[0]) <= x - margin
                                && x + margin <= f64::from(start.max[0])
                        );
                        let slack = 1e-15 * x.abs().max(y.abs());
                        assert!(
                            f64::from(end.min[0]) <= z - margin + slack,
                            "{until} {point:?} {end:?}"
                        );
                        assert!(z + margin - slack <= f64::from(end.max[0]));
                    }
                }
            }
        }
    }
}
