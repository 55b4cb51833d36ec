//! The power of two in which searches for distances and depths read coordinates.
//!
//! Squares of very small or very large lengths underflow or overflow. There all coordinates are
//! multiplied by one power of two, with which the largest is between 2^-80 and 2^30. That is exact
//! but for coordinates that are very much smaller than the largest; what those lose is far below
//! the error that the search allows for. Anywhere else the factor is 1.

use super::Extent;
use impinge_exact::Point;

/// A power of two.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale(f64);

/// Where coordinates are read as they are. Every square of a difference that matters is then a
/// normal number.
const USUAL: std::ops::Range<f64> = power(-200)..power(200);
/// The exponents of factors, so that the factor and its inverse are normal numbers.
const MOST: i64 = 1000;

impl Scale {
    /// For bodies of which boxes in `f32` have coordinates up to `boxed`. `exact` is the largest
    /// coordinate itself, which is asked for only where `f32` has no exponents for it.
    pub fn of(boxed: f64, exact: impl FnOnce() -> f64) -> Self {
        let is_held = boxed >= f64::from(f32::MIN_POSITIVE) && boxed < f64::from(f32::MAX);
        let largest = if is_held { boxed } else { exact() };
        if largest == 0.0 || USUAL.contains(&largest) {
            return Scale(1.0);
        }
        let exponent = (largest.to_bits() >> 52).cast_signed() - 1023;
        Scale(power((-exponent).clamp(-MOST, MOST)))
    }

    /// For some points.
    pub fn of_points(points: impl IntoIterator<Item = Point>) -> Self {
        let coordinates = points.into_iter().flatten();
        let largest = coordinates.fold(0.0f64, |largest, x| largest.max(x.abs()));
        Scale::of(largest, || largest)
    }

    /// Whether coordinates are read as they are.
    pub fn is_one(self) -> bool {
        self.0 == 1.0
    }

    #[inline]
    pub fn point(self, point: Point) -> Point {
        point.map(|x| x * self.0)
    }

    #[inline]
    pub fn extent(self, extent: &Extent) -> Extent {
        Extent {
            min: self.point(extent.min),
            max: self.point(extent.max),
        }
    }

    pub fn length(self, length: f64) -> f64 {
        length * self.0
    }

    /// The length that a scaled length is.
    pub fn length_back(self, length: f64) -> f64 {
        length * (1.0 / self.0)
    }

    /// The area, or the component of one, that a scaled area is.
    pub fn area_back(self, area: f64) -> f64 {
        self.length_back(self.length_back(area))
    }

    /// The volume that a scaled volume is.
    pub fn volume_back(self, volume: f64) -> f64 {
        self.length_back(self.area_back(volume))
    }

    /// The point that a scaled point is.
    pub fn point_back(self, point: Point) -> Point {
        point.map(|x| x * (1.0 / self.0))
    }
}

const fn power(exponent: i64) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}
