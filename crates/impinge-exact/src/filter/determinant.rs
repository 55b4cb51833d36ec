//! The one determinant of the filter, with the bound of its error.

use super::number::Number;

/// The computed value of a determinant (d x e) . f of three differences of input points, with
/// the bound of its error.
#[derive(Clone, Copy)]
pub(super) struct Determinant<T: Number = f64> {
    value: T,
    bound: T,
}

impl<T: Number> Determinant<T> {
    /// The determinant (d x e) . f.
    #[inline(always)]
    pub(super) fn new(d: &[T; 3], e: &[T; 3], f: &[T; 3]) -> Self {
        Normal::new(d, e).dot(f)
    }

    /// Certainly greater than zero.
    #[inline(always)]
    pub(super) fn is_positive(self) -> T::Mask {
        self.value.gt(self.bound)
    }

    /// Certainly less than zero.
    #[inline(always)]
    pub(super) fn is_negative(self) -> T::Mask {
        (T::splat(0.0) - self.bound).gt(self.value)
    }

    /// Certainly not zero. False for NaN.
    #[inline(always)]
    pub(super) fn is_sure(self) -> T::Mask {
        self.value.abs().gt(self.bound)
    }

    /// The likely sign: right where [`is_sure`](Self::is_sure).
    #[inline(always)]
    pub(super) fn seems_positive(self) -> T::Mask {
        self.value.gt(T::splat(0.0))
    }

    /// Certainly of different signs.
    #[inline(always)]
    pub(super) fn is_opposite(self, other: Self) -> T::Mask {
        (self.is_positive() & other.is_negative()) | (self.is_negative() & other.is_positive())
    }

    /// Certainly of one sign.
    #[inline(always)]
    pub(super) fn is_same(self, other: Self) -> T::Mask {
        (self.is_positive() & other.is_positive()) | (self.is_negative() & other.is_negative())
    }
}

/// A vector d x e, with [`BOUND`](Number::BOUND) |d| |e|.
///
/// In `f64` coordinates may have any size, so products may underflow or overflow. An underflow in d
/// x e grows with f: it is part of the bound that is multiplied by |f|. Where (d x e) . f might
/// overflow, 8 |d| |e| |f| does, and with it the bound: so it is computed with a factor of
/// [`HEADROOM`](Number::HEADROOM), which the last step takes away.
#[derive(Clone, Copy)]
pub(super) struct Normal<T: Number = f64> {
    vector: [T; 3],
    bound: T,
}

impl<T: Number> Normal<T> {
    #[inline(always)]
    pub(super) fn new(d: &[T; 3], e: &[T; 3]) -> Self {
        Self {
            vector: [
                d[1] * e[2] - d[2] * e[1],
                d[2] * e[0] - d[0] * e[2],
                d[0] * e[1] - d[1] * e[0],
            ],
            bound: bound_of_normal(size(d) * size(e)),
        }
    }

    /// (d x e) . f
    #[inline(always)]
    pub(super) fn dot(&self, f: &[T; 3]) -> Determinant<T> {
        Determinant {
            value: self.vector[0] * f[0] + self.vector[1] * f[1] + self.vector[2] * f[2],
            bound: bound_of_determinant(self.bound * size(f)),
        }
    }
}

#[inline(always)]
fn bound_of_normal<T: Number>(sizes: T) -> T {
    let bound = T::splat(T::BOUND * T::HEADROOM) * sizes;
    if T::UNDERFLOW_PER_SIZE > 0.0 {
        bound + T::splat(T::UNDERFLOW_PER_SIZE)
    } else {
        bound
    }
}

#[inline(always)]
fn bound_of_determinant<T: Number>(bound: T) -> T {
    if T::HEADROOM > 1.0 {
        (bound * T::splat(1.0 / T::HEADROOM)).with_underflow()
    } else {
        bound.with_underflow()
    }
}

#[inline(always)]
pub(super) fn difference<T: Number>(p: &[T; 3], q: &[T; 3]) -> [T; 3] {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

/// The largest magnitude of the three coordinates.
#[inline(always)]
fn size<T: Number>(d: &[T; 3]) -> T {
    d[0].abs().larger(d[1].abs()).larger(d[2].abs())
}
