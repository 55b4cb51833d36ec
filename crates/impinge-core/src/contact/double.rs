//! Numbers of about 106 bits: the unevaluated sum of two `f64`.
//!
//! Algorithms and bounds: Joldes, Muller & Popescu, *Tight and rigorous error bounds for basic
//! building blocks of double-word arithmetic*, 2017: a sum has a relative error below 3 · 2^-106 +
//! …, a product below 7 · 2^-106, a quotient below 16 · 2^-106. No fused multiply-add, so the bits
//! are the same on every machine.

use impinge_exact::internal::{two_product, two_sum};

/// `high + low`, where `high` is the sum rounded to nearest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Double {
    pub high: f64,
    pub low: f64,
}

/// More than the relative error of any one operation here.
pub(super) const ERROR: f64 = 1.0 / (1u128 << 101) as f64;

/// `a + b`, without error.
fn sum(a: f64, b: f64) -> Double {
    let [high, low] = two_sum(a, b);
    Double { high, low }
}

/// [`sum`] where `|a| >= |b|`, or a is zero.
fn quick_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    Double {
        high,
        low: b - (high - a),
    }
}

/// `a * b`, without error.
pub(super) fn product(a: f64, b: f64) -> Double {
    let [high, low] = two_product(a, b);
    Double { high, low }
}

impl Double {
    /// `a - b`, without error.
    pub fn difference(a: f64, b: f64) -> Self {
        sum(a, -b)
    }

    pub fn abs(self) -> Self {
        if self.high < 0.0 { -self } else { self }
    }
}

impl From<f64> for Double {
    fn from(high: f64) -> Self {
        Double { high, low: 0.0 }
    }
}

impl std::ops::Neg for Double {
    type Output = Self;

    fn neg(self) -> Self {
        Double {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl std::ops::Add for Double {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let high = sum(self.high, other.high);
        let low = sum(self.low, other.low);
        let part = quick_sum(high.high, high.low + low.high);
        quick_sum(part.high, low.low + part.low)
    }
}

impl std::ops::Sub for Double {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl std::ops::Mul for Double {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = product(self.high, other.high);
        let cross = self.high * other.low + self.low * other.high;
        quick_sum(product.high, product.low + cross)
    }
}

impl std::ops::Div for Double {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Double::from(first);
        let second = rest.high / other.high;
        quick_sum(first, second)
    }
}
