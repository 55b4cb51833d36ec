//! The coarse grid of the paper: resolution, cell index, cell ranges, owner rule.
//!
//! Source: "Real-time Collision Detection with Two-level Spatial Hashing on GPU", section 3.1.
//!
//! A box is stored once as a range of *fine* cells: a coarse cell has four along each axis, so
//! coarse is fine shifted right by two. `floor((x - origin) * scale)` is monotone under any
//! rounding, and so is clamping to the grid: boxes that overlap have ranges that overlap, on any
//! device.
//!
//! ```text
//! fine    | 0 | 1 | 2 | 3 | 4 | 5 | 6 | 7 | 8 | …      one axis
//! coarse  |       0       |       1       |     2
//!                 [---- box ----]                       fine 2..=5, coarse 0..=1
//! ```

use super::bounds::Aabb;

/// The most cells along one axis, so that fine coordinates fit 16 bits.
pub(crate) const MOST_ALONG: u32 = 1 << 14;
/// The most entries of the cell lists per element, on average.
pub const MOST_ENTRIES_EACH: u64 = 16;
/// The most cells of the first level, for any lambda: 4 bytes each.
const MOST_CELLS: u64 = 1 << 25;

/// A uniform grid over a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    origin: [f32; 3],
    /// Fine cells per unit of length.
    scale: [f32; 3],
    extent: [f32; 3],
    /// Coarse cells along each axis.
    pub resolution: [u32; 3],
}

/// Fine cells that a box touches, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FineRange {
    /// The first cell along each axis.
    pub lo: [u16; 3],
    /// The last cell along each axis.
    pub hi: [u16; 3],
}

impl Grid {
    /// Equation (1): `R_i = d_i (lambda N / V)^(1/3)`, at least one cell per axis.
    ///
    /// If the region is so thin along an axis that the equation gives less than one cell, the axis
    /// gets one cell and the other axes share the cells (with the square root, or no root, in place
    /// of the cube root). So a flat cloth, with V = 0, gets a grid of squares, and a needle gets a
    /// row of cells.
    #[allow(
        clippy::disallowed_methods,
        reason = "how large cells are changes no answer"
    )]
    pub fn new(region: &Aabb, n_elements: u64, lambda: f64) -> Self {
        let extent: [f64; 3] = std::array::from_fn(|axis| {
            (f64::from(region.max[axis]) - f64::from(region.min[axis])).clamp(0.0, 2f64.powi(129))
        });
        let wanted = (lambda * n_elements as f64).clamp(1.0, MOST_CELLS as f64);
        let mut resolution = [1u32; 3];
        let mut wide = extent.map(|extent| extent > 0.0);
        loop {
            // Extents are at most 2^129 and at least 2^-149: their products are normal f64.
            let axes = || (0..3).filter(|&axis| wide[axis]);
            let volume: f64 = axes().map(|axis| extent[axis]).product();
            let density = match axes().count() {
                3 => (wanted / volume).cbrt(),
                2 => (wanted / volume).sqrt(),
                _ => wanted / volume,
            };
            let cells = |axis: usize| extent[axis] * density;
            match axes().find(|&axis| cells(axis) < 1.0) {
                Some(thin) => wide[thin] = false,
                None => {
                    for axis in axes() {
                        resolution[axis] = (cells(axis) as u32).clamp(1, MOST_ALONG);
                    }
                    break;
                }
            }
        }
        Grid::with_resolution(region, resolution)
    }

    fn with_resolution(region: &Aabb, resolution: [u32; 3]) -> Self {
        let extent: [f32; 3] = std::array::from_fn(|axis| region.max[axis] - region.min[axis]);
        let scale = std::array::from_fn(|axis| {
            let scale = (4 * resolution[axis]) as f32 / extent[axis];
            if scale.is_finite() { scale } else { 0.0 }
        });
        Grid {
            origin: region.min,
            scale,
            extent,
            resolution,
        }
    }

    /// The same region with half the cells along each axis; `None` when there is one cell left.
    pub fn coarser(&self) -> Option<Self> {
        let region = Aabb {
            min: self.origin,
            max: std::array::from_fn(|axis| self.origin[axis] + self.extent[axis]),
        };
        (self.resolution != [1; 3])
            .then(|| Grid::with_resolution(&region, self.resolution.map(|along| along.div_ceil(2))))
    }

    /// The number of coarse cells.
    pub fn n_cells(&self) -> u64 {
        self.resolution
            .iter()
            .map(|&along| u64::from(along))
            .product()
    }

    /// Equation (3) at four times the resolution, clamped to the grid.
    #[inline(always)]
    pub fn range(&self, bounds: &Aabb) -> FineRange {
        FineRange {
            lo: self.fine(&bounds.min),
            hi: self.fine(&bounds.max),
        }
    }

    #[inline(always)]
    fn fine(&self, point: &[f32; 3]) -> [u16; 3] {
        std::array::from_fn(|axis| {
            let fine = (point[axis] - self.origin[axis]) * self.scale[axis];
            // A cast from float rounds towards 0, which is down; below 0 it saturates, and it sends
            // NaN (only where the scale is 0) to 0.
            (fine as u32).min(4 * self.resolution[axis] - 1) as u16
        })
    }

    /// Equation (2): the cell's index in the linear array.
    #[inline(always)]
    pub fn index(&self, cell: [u32; 3]) -> usize {
        let [n_x, n_y, _] = self.resolution;
        ((cell[2] as usize * n_y as usize) + cell[1] as usize) * n_x as usize + cell[0] as usize
    }

    /// The cell with an index in the linear array.
    #[inline(always)]
    pub fn cell(&self, index: usize) -> [u32; 3] {
        let [n_x, n_y, _] = self.resolution;
        // There are far fewer than 2^32 cells.
        let index = index as u32;
        [index % n_x, index / n_x % n_y, index / n_x / n_y]
    }
}

impl FineRange {
    /// The coarse cells touched, first and last along each axis.
    #[inline(always)]
    pub fn coarse(&self) -> ([u32; 3], [u32; 3]) {
        (
            self.lo.map(|fine| u32::from(fine >> 2)),
            self.hi.map(|fine| u32::from(fine >> 2)),
        )
    }

    /// How many coarse cells are touched.
    #[inline(always)]
    pub fn n_coarse(&self) -> u64 {
        let (lo, hi) = self.coarse();
        (0..3)
            .map(|axis| u64::from(hi[axis] - lo[axis] + 1))
            .product()
    }

    /// The level-2 occupancy of one coarse cell, bit `x + 4 y + 16 z` for sub-cell (x, y, z).
    ///
    /// ```text
    /// bit   63 … 48 | 47 … 32 | 31 … 16 | 15 … 12  11 … 8  7 … 4  3 2 1 0
    ///        z = 3     z = 2     z = 1     y = 3    y = 2   y = 1  x of y = 0
    /// ```
    #[inline(always)]
    pub fn occupancy(&self, cell: [u32; 3]) -> u64 {
        let along = |axis: usize| {
            let first = 4 * cell[axis];
            let lo = u32::from(self.lo[axis]).max(first) - first;
            let hi = u32::from(self.hi[axis]).min(first + 3) - first;
            (0b1111u64 >> (3 - hi)) & (0b1111 << lo)
        };
        let x = along(0);
        // Four bits become four runs of 4 bits, then of 16: one multiplication each.
        let y = spread(along(1), 4) * 0b1111;
        let z = spread(along(2), 16) * 0xffff;
        (x * 0x1111_1111_1111_1111) & (y * 0x0001_0001_0001_0001) & z
    }
}

/// Bits 0 to 3 moved to multiples of `stride`.
#[inline(always)]
fn spread(bits: u64, stride: u32) -> u64 {
    (0..4).fold(0, |spread, k| spread | (bits >> k & 1) << (k * stride))
}

/// The owner rule: of all cells that two boxes share, the pair belongs to the one that holds the
/// lower corner of their common range, `max(lo_a, lo_b)`. It is exact and needs no memory. The
/// paper has a table hashed by DJB2 instead, which lost 2.7 to 4.3 % of the collisions (table 3).
#[inline(always)]
pub fn owns(cell: [u32; 3], a: &FineRange, b: &FineRange) -> bool {
    (0..3).all(|axis| u32::from(a.lo[axis].max(b.lo[axis]) >> 2) == cell[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(max: [f32; 3]) -> Aabb {
        Aabb { min: [0.0; 3], max }
    }

    #[test]
    fn resolution_follows_equation_1() {
        let grid = Grid::new(&region([2.0, 1.0, 1.0]), 2000, 1.0);
        assert_eq!(grid.resolution, [20, 10, 10]);
        let grid = Grid::new(&region([2.0, 1.0, 1.0]), 2000, 8.0);
        assert_eq!(grid.resolution, [40, 20, 20]);
    }

    #[test]
    fn flat_thin_and_empty_regions_have_cells() {
        assert_eq!(
            Grid::new(&region([1.0, 1.0, 0.0]), 100, 1.0).resolution,
            [10, 10, 1]
        );
        assert_eq!(
            Grid::new(&region([0.0, 7.0, 0.0]), 100, 1.0).resolution,
            [1, 100, 1]
        );
        assert_eq!(
            Grid::new(&region([1.0, 1.0, 1e-30]), 100, 1.0).resolution,
            [10, 10, 1]
        );
        assert_eq!(Grid::new(&region([0.0; 3]), 100, 1.0).resolution, [1, 1, 1]);
        let huge = Aabb {
            min: [-3e38; 3],
            max: [3e38; 3],
        };
        assert!(Grid::new(&huge, 1 << 30, 1e9).n_cells() <= MOST_CELLS);
    }

    #[test]
    fn occupancy_has_the_bits_of_the_range() {
        let grid = Grid::new(&region([8.0; 3]), 8, 1.0);
        assert_eq!(grid.resolution, [2, 2, 2]);
        let range = grid.range(&Aabb {
            min: [1.5, 0.0, 3.0],
            max: [5.0, 1.0, 9.0],
        });
        assert_eq!((range.lo, range.hi), ([1, 0, 3], [5, 1, 7]));
        for (cell, xs, ys, zs) in [
            ([0, 0, 0], 1..=3, 0..=1, 3..=3),
            ([1, 0, 0], 0..=1, 0..=1, 3..=3),
            ([0, 0, 1], 1..=3, 0..=1, 0..=3),
        ] {
            let mut expected = 0u64;
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        expected |= 1 << (x + 4 * y + 16 * z);
                    }
                }
            }
            assert_eq!(range.occupancy(cell), expected);
        }
    }

    #[test]
    fn each_overlapping_pair_has_one_owner() {
        let a = FineRange {
            lo: [1, 2, 3],
            hi: [9, 9, 9],
        };
        let b = FineRange {
            lo: [5, 0, 3],
            hi: [12, 5, 3],
        };
        let (lo, hi) = a.coarse();
        let mut owners = Vec::new();
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                for x in lo[0]..=hi[0] {
                    if owns([x, y, z], &a, &b) {
                        owners.push([x, y, z]);
                    }
                }
            }
        }
        assert_eq!(owners, [[1, 0, 0]]);
    }
}
