//! The one determinant of the filter, with the bound of its error.

use super::Point;

/// 64 unit roundoffs, 2^-47. The derivation needs a little more than 48.
pub(super) const DETERMINANT_BOUND: f64 = f64::from_bits((1023 - 47) << 52);

/// The computed value of a determinant (d x e) . f of three differences of input points, with
/// the bound of its error.
#[derive(Clone, Copy)]
pub(super) struct Determinant {
    value: f64,
    bound: f64,
}

impl Determinant {
    /// The determinant (d x e) . f.
    #[inline(always)]
    pub(super) fn new(d: &Point, e: &Point, f: &Point) -> Self {
        Normal::new(d, e).dot(f)
    }

    /// Certainly greater than zero.
    #[inline(always)]
    pub(super) fn is_positive(self) -> bool {
        self.value > self.bound
    }

    /// Certainly less than zero.
    #[inline(always)]
    pub(super) fn is_negative(self) -> bool {
        self.value < -self.bound
    }

    /// Certainly not zero. False for NaN.
    #[inline(always)]
    pub(super) fn is_sure(self) -> bool {
        self.value.abs() > self.bound
    }

    /// The likely sign: right where [`is_sure`](Self::is_sure).
    #[inline(always)]
    pub(super) fn seems_positive(self) -> bool {
        self.value > 0.0
    }

    /// Certainly of different signs.
    #[inline(always)]
    pub(super) fn is_opposite(self, other: Self) -> bool {
        (self.is_positive() & other.is_negative()) | (self.is_negative() & other.is_positive())
    }

    /// Certainly of one sign.
    #[inline(always)]
    pub(super) fn is_same(self, other: Self) -> bool {
        (self.is_positive() & other.is_positive()) | (self.is_negative() & other.is_negative())
    }
}

/// A vector d x e, with `DETERMINANT_BOUND` |d| |e|.
#[derive(Clone, Copy)]
pub(super) struct Normal {
    vector: Point,
    bound: f64,
}

impl Normal {
    #[inline(always)]
    pub(super) fn new(d: &Point, e: &Point) -> Self {
        Self {
            vector: [
                d[1] * e[2] - d[2] * e[1],
                d[2] * e[0] - d[0] * e[2],
                d[0] * e[1] - d[1] * e[0],
            ],
            bound: DETERMINANT_BOUND * (size(d) * size(e)),
        }
    }

    /// (d x e) . f
    #[inline(always)]
    pub(super) fn dot(&self, f: &Point) -> Determinant {
        Determinant {
            value: self.vector[0] * f[0] + self.vector[1] * f[1] + self.vector[2] * f[2],
            bound: self.bound * size(f),
        }
    }
}

#[inline(always)]
pub(super) fn difference(p: &Point, q: &Point) -> Point {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

/// The largest magnitude of the three coordinates. Written as comparisons because `f64::max`
/// costs three instructions to keep NaN out, and NaN in a determinant is harmless here.
#[inline(always)]
fn size(d: &Point) -> f64 {
    let larger = |x: f64, y: f64| if x > y { x } else { y };
    larger(larger(d[0].abs(), d[1].abs()), d[2].abs())
}

/// `yes` or `no`, as a blend of registers.
#[inline(always)]
pub(super) fn select(condition: bool, yes: f64, no: f64) -> f64 {
    if condition { yes } else { no }
}

/// Bit `lane` of a mask.
#[inline(always)]
pub(super) fn bit(set: bool, lane: usize) -> u32 {
    if set { 1 << lane } else { 0 }
}
