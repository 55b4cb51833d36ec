//! Axis-aligned boxes in single precision, rounded outward: one, the boxes of a group, arrays of
//! many.
//!
//! Rounding may only grow a box, never shrink it. So boxes that do not overlap prove that their
//! contents do not meet. Boxes of f32 positions are not rounded at all.

use super::GROUP;

/// A closed box. The empty one has `min > max` and overlaps nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Low ends.
    pub min: [f32; 3],
    /// High ends.
    pub max: [f32; 3],
}

impl Aabb {
    /// The empty box.
    pub const EMPTY: Aabb = Aabb {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
    };

    /// The box that reaches less far, as [`LaneBounds::deflated`].
    #[inline(always)]
    pub fn deflated(&self, by: f32) -> Aabb {
        Aabb {
            min: self.min.map(|low| low + by),
            max: self.max.map(|high| high - by),
        }
    }

    /// Whether the two share a point.
    #[inline(always)]
    pub fn overlaps(&self, other: &Aabb) -> bool {
        let mut overlap = true;
        for axis in 0..3 {
            overlap &= self.min[axis] <= other.max[axis] && other.min[axis] <= self.max[axis];
        }
        overlap
    }

    /// Grows to hold another box.
    #[inline(always)]
    pub fn join(&mut self, other: &Aabb) {
        for axis in 0..3 {
            self.min[axis] = lesser(self.min[axis], other.min[axis]);
            self.max[axis] = greater(self.max[axis], other.max[axis]);
        }
    }

    /// The intersection; empty when they do not overlap.
    #[inline(always)]
    pub fn intersection(&self, other: &Aabb) -> Aabb {
        let mut both = *self;
        for axis in 0..3 {
            both.min[axis] = greater(self.min[axis], other.min[axis]);
            both.max[axis] = lesser(self.max[axis], other.max[axis]);
        }
        both
    }

    /// The middle of the box; halves first, so that the sum cannot overflow.
    #[inline]
    pub fn center(&self) -> [f32; 3] {
        std::array::from_fn(|axis| 0.5 * self.min[axis] + 0.5 * self.max[axis])
    }

    /// Half the surface: a measure of how often other boxes meet this one. In double precision,
    /// where the squares of f32 extents cannot overflow.
    #[inline]
    pub fn half_area(&self) -> f64 {
        self.half_area_within(0.0)
    }

    /// The same of the box that is smaller by a margin on all sides.
    #[inline]
    pub fn half_area_within(&self, margin: f64) -> f64 {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| {
            let extent = f64::from(self.max[k]) - f64::from(self.min[k]);
            (extent - 2.0 * margin).max(0.0)
        });
        x * y + y * z + z * x
    }
}

/// The minimum as one instruction. It need not handle NaN, which validation has excluded.
#[inline(always)]
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The maximum as one instruction.
#[inline(always)]
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The largest f32 that is at most `x`. Without a branch: half of all roundings would mispredict
/// it.
#[inline]
pub(crate) fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    stepped(nearest, -i32::from(f64::from(nearest) > x))
}

/// The smallest f32 that is at least `x`.
#[inline]
pub(crate) fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    stepped(nearest, i32::from(f64::from(nearest) < x))
}

/// The number itself, or its neighbour above (1) or below (-1). Never steps from a zero across it:
/// a number that rounds to zero leaves it its sign.
#[inline]
fn stepped(x: f32, by: i32) -> f32 {
    let bits = x.to_bits().cast_signed();
    // Bits of negative numbers descend: the sign is 0 or -1.
    let sign = bits >> 31;
    f32::from_bits((bits + ((by ^ sign) - sign)).cast_unsigned())
}

/// The boxes of one group, one per lane; lanes past the group's size hold empty boxes.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub struct LaneBounds {
    /// Low ends, one row per axis.
    pub min: [[f32; GROUP]; 3],
    /// High ends.
    pub max: [[f32; GROUP]; 3],
}

impl LaneBounds {
    /// Boxes that reach less far, on all sides. Low ends may pass high ends. Where `low + by` is at
    /// most another end, it is so rounded, too: that end is a float.
    #[inline(always)]
    pub fn deflated(&self, by: f32) -> LaneBounds {
        LaneBounds {
            min: self.min.map(|ends| ends.map(|low| low + by)),
            max: self.max.map(|ends| ends.map(|high| high - by)),
        }
    }

    /// Empty boxes in all lanes.
    pub const EMPTY: LaneBounds = LaneBounds {
        min: [[f32::INFINITY; GROUP]; 3],
        max: [[f32::NEG_INFINITY; GROUP]; 3],
    };

    /// The box of a lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Aabb {
        Aabb {
            min: [self.min[0][lane], self.min[1][lane], self.min[2][lane]],
            max: [self.max[0][lane], self.max[1][lane], self.max[2][lane]],
        }
    }

    /// Sets the box of a lane.
    #[inline(always)]
    pub fn put(&mut self, lane: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.min[axis][lane] = bounds.min[axis];
            self.max[axis][lane] = bounds.max[axis];
        }
    }

    /// Empties the lanes from `lane` on. Inlined, it would be a kilobyte in twenty places.
    #[inline(never)]
    pub fn clear_from(&mut self, lane: usize) {
        for axis in 0..3 {
            self.min[axis][lane..].fill(f32::INFINITY);
            self.max[axis][lane..].fill(f32::NEG_INFINITY);
        }
    }
}

/// Boxes as a structure of arrays: six arrays, padded so that eight boxes can be read anywhere.
///
/// ```text
/// min x | b0 b1 b2 b3 b4 b5 b6 b7 b8 … | padding: empty boxes |
/// min y | …
/// …
/// max z | …
/// ```
#[derive(Debug, Clone, Default)]
pub(crate) struct BoundsArray {
    pub min: [Vec<f32>; 3],
    pub max: [Vec<f32>; 3],
    len: usize,
}

/// How many boxes are read at once; arrays are padded by as many.
pub(crate) const READ_AHEAD: usize = 8;

impl BoundsArray {
    pub fn resize(&mut self, len: usize) {
        self.len = len;
        for axis in 0..3 {
            self.min[axis].resize(len + READ_AHEAD, f32::INFINITY);
            self.max[axis].resize(len + READ_AHEAD, f32::NEG_INFINITY);
            self.min[axis][len..].fill(f32::INFINITY);
            self.max[axis][len..].fill(f32::NEG_INFINITY);
        }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    pub fn at(&self, ix: usize) -> Aabb {
        Aabb {
            min: [self.min[0][ix], self.min[1][ix], self.min[2][ix]],
            max: [self.max[0][ix], self.max[1][ix], self.max[2][ix]],
        }
    }

    #[inline(always)]
    pub fn put(&mut self, ix: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.min[axis][ix] = bounds.min[axis];
            self.max[axis][ix] = bounds.max[axis];
        }
    }

    /// Write access to single boxes for several threads at once.
    pub fn raw(&mut self) -> RawBoundsArray {
        RawBoundsArray {
            min: self.min.each_mut().map(|values| values.as_mut_ptr()),
            max: self.max.each_mut().map(|values| values.as_mut_ptr()),
        }
    }

    pub fn bytes(&self) -> usize {
        6 * size_of::<f32>() * (self.len + READ_AHEAD)
    }
}

/// Pointers into a [`BoundsArray`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct RawBoundsArray {
    min: [*mut f32; 3],
    max: [*mut f32; 3],
}

// SAFETY: a pointer does nothing by itself; the contract of `put` covers its use.
unsafe impl Send for RawBoundsArray {}
// SAFETY: a shared copy gives no access to memory but by `put`, whose contract covers it.
unsafe impl Sync for RawBoundsArray {}

impl RawBoundsArray {
    /// # Safety
    /// `ix` must lie within the array, which must still live; no other thread may use that box at
    /// the same time.
    #[inline(always)]
    pub unsafe fn put(self, ix: usize, bounds: &Aabb) {
        for axis in 0..3 {
            // SAFETY: by the contract of `put`.
            unsafe {
                self.min[axis].add(ix).write(bounds.min[axis]);
                self.max[axis].add(ix).write(bounds.max[axis]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_testing::random::Random;

    #[test]
    fn roundings_are_the_nearest_on_either_side() {
        let mut random = Random::new(1);
        let of_any_size = (0..100_000).map(|_| f64::from_bits(random.bits()));
        let small = [0.0, f64::MIN_POSITIVE, 1e-300, 1e-45, 1e-46, 1.2e-38, 1e-40];
        let large = [f64::from(f32::MAX), 3.5e38, f64::MAX, f64::INFINITY];
        let near_one = [1.0, 1.0 + f64::EPSILON, 1.0 - f64::EPSILON, 1.5];
        let chosen = small.into_iter().chain(large).chain(near_one);
        for x in of_any_size.chain(chosen.flat_map(|x| [x, -x])) {
            if x.is_nan() {
                continue;
            }
            let (low, high) = (round_down(x), round_up(x));
            assert!(f64::from(low) <= x && x <= f64::from(high), "{x:e}");
            let is_exact = f64::from(low) == x;
            assert!(
                if is_exact {
                    low == high
                } else {
                    low.next_up() == high
                },
                "{x:e}"
            );
        }
    }
}
