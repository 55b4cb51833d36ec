//! The sign of a number.

use core::cmp::Ordering;

/// The sign of an exactly known number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(i8)]
pub enum Sign {
    /// Less than zero.
    Negative = -1,
    /// Zero.
    Zero = 0,
    /// Greater than zero.
    Positive = 1,
}

impl Sign {
    /// The sign of a floating-point number; NaN counts as zero.
    #[inline]
    pub(super) fn of(x: f64) -> Self {
        if x > 0.0 {
            Self::Positive
        } else if x < 0.0 {
            Self::Negative
        } else {
            Self::Zero
        }
    }

    /// How the number compares with zero.
    #[inline]
    pub(super) fn order(self) -> Ordering {
        (self as i8).cmp(&0)
    }

    /// Whether the number is zero.
    #[inline]
    #[must_use]
    pub fn is_zero(self) -> bool {
        self == Self::Zero
    }

    /// Whether both numbers are nonzero and of the same sign: two points strictly on the same side.
    #[inline]
    pub fn strictly_same(self, other: Self) -> bool {
        self as i8 * other as i8 > 0
    }

    /// Whether the numbers are nonzero and of different signs: two points strictly apart.
    #[inline]
    pub fn strictly_opposite(self, other: Self) -> bool {
        (self as i8) * (other as i8) < 0
    }
}

impl core::ops::Neg for Sign {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        match self {
            Self::Negative => Self::Positive,
            Self::Zero => Self::Zero,
            Self::Positive => Self::Negative,
        }
    }
}
