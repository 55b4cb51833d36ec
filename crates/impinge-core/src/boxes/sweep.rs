//! The boxes that are tested, made from moving boxes.

use crate::bvh::GROUP;
use crate::bvh::bounds::{Aabb, LaneBounds, greater, lesser, round_down, round_up};

/// Which part of a step is examined, and by how much boxes are inflated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sweep {
    /// The time up to which elements move, at most 1. With 0 nothing moves.
    pub until: f64,
    /// How far boxes reach beyond their contents, on all sides.
    pub inflation: f64,
    /// Whether boxes hold the whole path from the start to the end, so that both are the same.
    pub is_swept: bool,
}

impl Sweep {
    /// The whole step.
    pub const WHOLE: Sweep = Sweep {
        until: 1.0,
        inflation: 0.0,
        is_swept: false,
    };

    /// As things are at the start.
    pub const STILL: Sweep = Sweep {
        until: 0.0,
        inflation: 0.0,
        is_swept: false,
    };

    /// In this part of a step, elements hardly leave their boxes at the start: boxes that hold the
    /// whole path are as good as boxes at both ends, and cost half as much.
    pub const NEARLY_STILL: f64 = 1.0 / 64.0;

    /// The step up to a time.
    pub fn up_to(until: f64) -> Sweep {
        Sweep {
            until,
            inflation: 0.0,
            is_swept: until <= Sweep::NEARLY_STILL,
        }
    }

    /// The same sweep, with boxes that reach farther by so much.
    #[inline(always)]
    pub fn inflated_by(self, inflation: f64) -> Sweep {
        Sweep {
            inflation: self.inflation + inflation,
            ..self
        }
    }

    /// Whether the boxes at both ends are the same, so that one of them is enough.
    #[inline(always)]
    pub fn is_single(self) -> bool {
        self.is_swept || self.until == 0.0
    }

    /// Whether the boxes at both ends are used unchanged.
    fn is_plain(self) -> bool {
        self == Sweep::WHOLE
    }

    /// The boxes to be tested, from those at the start and at the end of the step.
    ///
    /// The box at a time between lies within the interpolation of the boxes at both ends: each
    /// coordinate is at least the interpolated minimum. Everything is rounded outward.
    #[inline(always)]
    pub fn close(self, [start, end]: [Aabb; 2]) -> [Aabb; 2] {
        if self.is_plain() {
            return [start, end];
        }
        if self.until == 0.0 {
            return [self.inflated(start); 2];
        }
        let at = |x: f32, y: f32| {
            let (x, y) = (f64::from(x), f64::from(y));
            x + self.until * (y - x)
        };
        // Two roundings of numbers up to twice the larger end: 2^-51 of it is more than enough.
        let slack = |x: f32, y: f32| f64::from(greater(x.abs(), y.abs())) * 2f64.powi(-50);
        let mut end = Aabb {
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

    fn inflated(self, bounds: Aabb) -> Aabb {
        if self.inflation == 0.0 {
            return bounds;
        }
        Aabb {
            min: bounds
                .min
                .map(|x| round_down((f64::from(x) - self.inflation).next_down())),
            max: bounds
                .max
                .map(|x| round_up((f64::from(x) + self.inflation).next_up())),
        }
    }

    /// [`close`](Self::close) for the boxes of a group of `size` elements: in `f32`, rounded
    /// farther outward. If the sweep [has single boxes](Self::is_single), `start` is that box, and
    /// `end` means nothing afterwards.
    #[inline(always)]
    pub fn close_all(self, [start, end]: [&mut LaneBounds; 2], size: usize) {
        if self.is_plain() {
            return;
        }
        debug_assert!(size <= GROUP);
        for axis in 0..3 {
            if self.until == 0.0 {
                self.inflate_lanes(&mut start.min[axis], -1.0);
                self.inflate_lanes(&mut start.max[axis], 1.0);
                continue;
            }
            if self.until < 1.0 {
                self.close_lanes::<true>(&start.min[axis], &mut end.min[axis]);
                self.close_lanes::<false>(&start.max[axis], &mut end.max[axis]);
            }
            if self.is_swept {
                for lane in 0..GROUP {
                    let (low, high) = (&mut start.min[axis][lane], &mut start.max[axis][lane]);
                    *low = lesser(*low, end.min[axis][lane]);
                    *high = greater(*high, end.max[axis][lane]);
                }
            } else {
                self.inflate_lanes(&mut end.min[axis], -1.0);
                self.inflate_lanes(&mut end.max[axis], 1.0);
            }
            self.inflate_lanes(&mut start.min[axis], -1.0);
            self.inflate_lanes(&mut start.max[axis], 1.0);
        }
        if size < GROUP {
            start.clear_from(size);
            end.clear_from(size);
        }
    }

    /// Low or high ends at `until`, from those at the start and at the end.
    #[inline(always)]
    fn close_lanes<const ARE_LOW: bool>(self, start: &[f32; GROUP], end: &mut [f32; GROUP]) {
        let until = nearest(self.until);
        for lane in 0..GROUP {
            let (x, y) = (start[lane], end[lane]);
            let between = x + until * (y - x);
            // Four roundings of numbers up to the sum of both sizes. Not farther out than both
            // ends, which also count if the interpolation overflows.
            let slack = SLACK * (x.abs() + y.abs()) + f32::MIN_POSITIVE;
            end[lane] = if ARE_LOW {
                greater(between - slack, lesser(x, y))
            } else {
                lesser(between + slack, greater(x, y))
            };
        }
    }

    /// Ends moved outward by the inflation; `outward` is 1 or -1.
    #[inline(always)]
    fn inflate_lanes(self, ends: &mut [f32; GROUP], outward: f32) {
        if self.inflation == 0.0 {
            return;
        }
        let inflation = round_up(self.inflation);
        for x in ends {
            *x = moved(*x, outward, inflation);
        }
    }
}

/// Makes the boxes of a group's elements reach farther, each by its own number, before they are
/// [closed](Sweep::close_all). Few have such numbers: compiled once, not into all that fill groups.
#[inline(never)]
pub(super) fn inflate_each(boxes: &mut LaneBounds, by: &[f32; GROUP]) {
    for (ends, outward) in [(&mut boxes.min, -1.0), (&mut boxes.max, 1.0)] {
        for ends in ends {
            for (x, &by) in ends.iter_mut().zip(by) {
                *x = moved(*x, outward, by);
            }
        }
    }
}

/// An end of a box moved outward; `outward` is 1 or -1.
#[inline(always)]
fn moved(x: f32, outward: f32, by: f32) -> f32 {
    let slack = SLACK * (x.abs() + by) + f32::MIN_POSITIVE;
    x + outward * (by + slack)
}

/// By how much boxes of elements are rounded outward, relative to their coordinates: 2^-20, sixteen
/// unit roundoffs. One of them is for coordinates in `f64` that were rounded.
const SLACK: f32 = 1.0 / 1_048_576.0;

#[allow(
    clippy::cast_possible_truncation,
    reason = "rounding is covered by slack"
)]
fn nearest(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_testing::random::Random;

    #[test]
    fn boxes_between_hold_what_is_in_them() {
        let mut random = Random::new(1);
        // Between -1 and 1, then of many sizes.
        let mut next = || random.range(-1.0, 1.0) * 2f32.powi(random.below(16) as i32 - 8);
        for until in [1.0, 0.5, 0.1, 1e-3, 1e-9, 0.0] {
            for (inflation, is_swept) in [(0.0, false), (0.0, true), (0.25, true), (1e-9, true)] {
                let sweep = Sweep {
                    until,
                    inflation,
                    is_swept,
                };
                for round in 0..1000 {
                    let (points, mut boxes) =
                        ([[next(), next()], [next(), next()]], [Aabb::EMPTY; 2]);
                    for point in points {
                        for end in 0..2 {
                            let at = [point[end]; 3];
                            boxes[end].join(&Aabb { min: at, max: at });
                        }
                    }
                    let closed = sweep.close(boxes);
                    let mut lanes = [LaneBounds::EMPTY, LaneBounds::EMPTY];
                    let lane = round % GROUP;
                    for end in 0..2 {
                        lanes[end].put(lane, &boxes[end]);
                    }
                    let [at_start, at_end] = &mut lanes;
                    sweep.close_all([at_start, at_end], lane + 1);
                    let last = usize::from(!sweep.is_single());
                    let of_group = [lanes[0].at(lane), lanes[last].at(lane)];
                    // Boxes of groups are not much larger: coordinates are at most 2^7.
                    let more = 4.0 * SLACK * 256.0;
                    for (wide, tight) in of_group.iter().zip(&closed) {
                        assert!(wide.min[0] >= tight.min[0] - more);
                        assert!(wide.max[0] <= tight.max[0] + more);
                    }
                    for (point, [start, end]) in points
                        .into_iter()
                        .flat_map(|point| [(point, closed), (point, of_group)])
                    {
                        let [x, y] = point.map(f64::from);
                        let z = x + until * (y - x);
                        assert!(
                            f64::from(start.min[0]) <= x - inflation
                                && x + inflation <= f64::from(start.max[0])
                        );
                        let slack = 1e-15 * x.abs().max(y.abs());
                        assert!(
                            f64::from(end.min[0]) <= z - inflation + slack,
                            "{until} {point:?} {end:?}"
                        );
                        assert!(z + inflation - slack <= f64::from(end.max[0]));
                    }
                }
            }
        }
    }
}
