//! Boxes in double precision: of elements exactly as they are, where few boxes are asked for.

use crate::bvh::bounds::Aabb;
use impinge_exact::Point;

/// A closed box. The empty one has `min > max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub min: Point,
    pub max: Point,
}

impl From<&Aabb> for Extent {
    fn from(bounds: &Aabb) -> Self {
        Extent {
            min: bounds.min.map(f64::from),
            max: bounds.max.map(f64::from),
        }
    }
}

impl Extent {
    /// The empty box.
    pub const EMPTY: Self = Extent {
        min: [f64::INFINITY; 3],
        max: [f64::NEG_INFINITY; 3],
    };

    /// The box of some points.
    #[inline]
    pub fn of(points: impl Iterator<Item = Point>) -> Self {
        let mut extent = Extent::EMPTY;
        for point in points {
            extent.join(&Extent {
                min: point,
                max: point,
            });
        }
        extent
    }

    /// Grows to hold another box.
    #[inline]
    pub fn join(&mut self, other: &Extent) {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    /// The box that reaches beyond this one on all sides by so much, rounded outward.
    pub fn inflated(&self, by: f64) -> Self {
        Extent {
            min: self.min.map(|x| (x - by).next_down()),
            max: self.max.map(|x| (x + by).next_up()),
        }
    }

    /// Whether two boxes have a point in common.
    pub fn overlaps(&self, other: &Extent) -> bool {
        (0..3).all(|axis| self.min[axis] <= other.max[axis] && other.min[axis] <= self.max[axis])
    }

    /// The square of the distance of two boxes, rounded; 0 where they meet.
    pub fn squared_distance(&self, other: &Extent) -> f64 {
        let mut sum = 0.0;
        for k in 0..3 {
            let gap = (other.min[k] - self.max[k])
                .max(self.min[k] - other.max[k])
                .max(0.0);
            sum += gap * gap;
        }
        sum
    }

    /// The square of the diagonal's length, rounded.
    pub fn squared_diagonal(&self) -> f64 {
        (0..3)
            .map(|k| self.max[k] - self.min[k])
            .map(|x| x * x)
            .sum()
    }

    /// The largest magnitude of a coordinate.
    pub fn magnitude(&self) -> f64 {
        let corners = self.min.iter().chain(&self.max);
        corners.fold(0.0, |most: f64, x| most.max(x.abs()))
    }
}
