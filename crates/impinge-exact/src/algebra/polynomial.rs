//! Polynomials in time with integer coefficients, in Bernstein form.
//!
//! A [`Polynomial`] of degree n holds c_0 .. c_n and stands for the sum of c_i (1-t)^(n-i) t^i:
//! Bernstein form with the binomials inside the coefficients. A point that moves from p to q is (p,
//! q), a product is a convolution, and nothing is divided. With x = t / (1-t) it is (1-t)^n times
//! the ordinary polynomial with coefficients c_i in x, and x runs over (0, infinity) as t runs over
//! (0, 1): degrees, remainders and Descartes' rule are those in x.
//!
//! [`Controls`] are the Bernstein coefficients proper, of a polynomial over a dyadic interval, all
//! times one positive number, for halving.

use alloc::{vec, vec::Vec};
use core::ops::{Add, Sub};

use super::integer::Integer;
use crate::Sign;

/// A polynomial in t over [0, 1].
#[derive(Clone, Debug)]
pub(crate) struct Polynomial(Vec<Integer>);

/// A vector whose coordinates are polynomials of one degree.
pub(crate) type PolynomialVector = [Polynomial; 3];

impl Polynomial {
    /// A number that moves from one value to another.
    pub(crate) fn linear(start: Integer, end: Integer) -> Self {
        Self(vec![start, end])
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.0.iter().all(Integer::is_zero)
    }

    /// The sign at t = 1.
    pub(crate) fn sign_at_end(&self) -> Sign {
        self.0[self.0.len() - 1].sign()
    }

    /// How often the coefficients change sign, ignoring zeros. Descartes: the number of roots in
    /// the open interval (0, 1), counted with multiplicity, is this or smaller by an even number.
    pub(crate) fn variations(&self) -> usize {
        variations(&self.0)
    }

    /// Whether it certainly has no root in (0, 1].
    pub(crate) fn has_no_root(&self) -> bool {
        self.variations() == 0 && !self.sign_at_end().is_zero()
    }

    pub(crate) fn product(&self, other: &Self) -> Self {
        let mut sums = vec![Integer::zero(); self.0.len() + other.0.len() - 1];
        for (i, x) in self.0.iter().enumerate() {
            if x.is_zero() {
                continue;
            }
            for (j, y) in other.0.iter().enumerate() {
                sums[i + j] = &sums[i + j] + &(x * y);
            }
        }
        Self(sums)
    }

    pub(crate) fn times(&self, factor: &Integer) -> Self {
        Self(self.0.iter().map(|x| x * factor).collect())
    }

    /// The sign at `numerator / 2^depth`, a time in [0, 1].
    pub(super) fn sign_at(&self, numerator: &Integer, depth: u64) -> Sign {
        self.value_at(numerator, depth).sign()
    }

    /// The value at `numerator / 2^depth`, times 2^(degree * depth).
    pub(super) fn value_at(&self, numerator: &Integer, depth: u64) -> Integer {
        let rest = &Integer::from(1).shifted(depth) - numerator;
        // Horner in (1-t) and t: ((c_n t + c_(n-1) (1-t)) t + c_(n-2) (1-t)^2) t + ...
        let mut power = rest.clone();
        let mut coefficients = self.0.iter().rev();
        let mut value = coefficients.next().cloned().unwrap_or_else(Integer::zero);
        for coefficient in coefficients {
            value = &(&value * numerator) + &(coefficient * &power);
            power = &power * &rest;
        }
        value
    }

    pub(super) fn degree(&self) -> u64 {
        self.0.len() as u64 - 1
    }

    /// Bernstein coefficients over [0, 1], times a positive number.
    pub(super) fn controls(&self) -> Controls {
        let scaled = match &self.0[..] {
            [a, b, c] => vec![a.times(2), b.clone(), c.times(2)],
            [a, b, c, d] => vec![a.times(3), b.clone(), c.clone(), d.times(3)],
            [a, b, c, d, e] => vec![a.times(12), b.times(3), c.times(2), d.times(3), e.times(12)],
            [a, b, c, d, e, f, g] => {
                let (ends, next) = (60, 10);
                vec![
                    a.times(ends),
                    b.times(next),
                    c.times(4),
                    d.times(3),
                    e.times(4),
                    f.times(next),
                    g.times(ends),
                ]
            }
            [a, b, c, d, e, f] => {
                vec![
                    a.times(10),
                    b.times(2),
                    c.clone(),
                    d.clone(),
                    e.times(2),
                    f.times(10),
                ]
            }
            few => few.to_vec(),
        };
        debug_assert!(scaled.len() <= 7, "degrees above six do not occur");
        Controls(scaled)
    }

    /// Bernstein coefficients over the interval at the end of a path: true is the right half.
    pub(super) fn controls_over(&self, path: &[bool]) -> Controls {
        path.iter().fold(self.controls(), |controls, &is_right| {
            let [left, right] = controls.halves();
            if is_right { right } else { left }
        })
    }

    /// The derivative in x = t / (1-t). It shares the multiple roots with the polynomial.
    pub(super) fn derivative(&self) -> Self {
        Self(
            (1_u64..)
                .zip(&self.0[1..])
                .map(|(i, coefficient)| coefficient.times(i))
                .collect(),
        )
    }

    /// A greatest common divisor as polynomials in x, up to a constant. Its roots in (0, 1) are the
    /// common ones.
    pub(super) fn common_divisor(&self, other: &Self) -> Self {
        let (mut a, mut b) = (self.trimmed(), other.trimmed());
        while !b.0.is_empty() {
            (a, b) = {
                let rest = a.divided(&b).1;
                (b, rest)
            };
        }
        a
    }

    /// The quotient by a divisor, up to a constant.
    pub(super) fn quotient(&self, divisor: &Self) -> Self {
        self.trimmed().divided(&divisor.trimmed()).0
    }

    pub(super) fn is_constant(&self) -> bool {
        self.trimmed().0.len() <= 1
    }

    /// Without leading zeros, and divided by the largest power of two that divides all
    /// coefficients. Zero becomes a polynomial without coefficients.
    fn trimmed(&self) -> Self {
        let n = self
            .0
            .iter()
            .rposition(|x| !x.is_zero())
            .map_or(0, |ix| ix + 1);
        let kept = &self.0[..n];
        let shift = kept
            .iter()
            .filter(|x| !x.is_zero())
            .map(Integer::trailing_zeros)
            .min()
            .unwrap_or(0);
        Self(kept.iter().map(|x| x.unshifted(shift)).collect())
    }

    /// Quotient and remainder of a positive or negative multiple of the polynomial in x.
    fn divided(&self, divisor: &Self) -> (Self, Self) {
        let lead = divisor.0.last().expect("a divisor that is not zero");
        let n_quotient = (self.0.len() + 1).saturating_sub(divisor.0.len());
        let mut rest = self.0.clone();
        let mut quotient = vec![Integer::zero(); n_quotient];
        for shift in (0..n_quotient).rev() {
            let top = rest.pop().expect("degrees fall one by one");
            for coefficient in &mut quotient {
                *coefficient = &*coefficient * lead;
            }
            quotient[shift] = top.clone();
            for (ix, coefficient) in rest.iter_mut().enumerate() {
                *coefficient = &*coefficient * lead;
                if ix >= shift {
                    *coefficient = &*coefficient - &(&top * &divisor.0[ix - shift]);
                }
            }
        }
        (Self(quotient), Self(rest).trimmed())
    }
}

impl Add for &Polynomial {
    type Output = Polynomial;

    fn add(self, other: Self) -> Polynomial {
        debug_assert_eq!(self.0.len(), other.0.len(), "polynomials of one degree");
        Polynomial(self.0.iter().zip(&other.0).map(|(x, y)| x + y).collect())
    }
}

impl Sub for &Polynomial {
    type Output = Polynomial;

    fn sub(self, other: Self) -> Polynomial {
        debug_assert_eq!(self.0.len(), other.0.len(), "polynomials of one degree");
        Polynomial(self.0.iter().zip(&other.0).map(|(x, y)| x - y).collect())
    }
}

/// 1 as a polynomial of degree 2, ((1-t) + t)^2: multiplying by it raises the degree by 2 and
/// changes no value.
pub(crate) fn square_of_sum() -> Polynomial {
    Polynomial([1, 2, 1].map(Integer::from).to_vec())
}

/// a - b
pub(crate) fn difference(a: &PolynomialVector, b: &PolynomialVector) -> PolynomialVector {
    core::array::from_fn(|k| &a[k] - &b[k])
}

/// a x b
pub(crate) fn cross(a: &PolynomialVector, b: &PolynomialVector) -> PolynomialVector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i].product(&b[j]) - &a[j].product(&b[i]))
}

/// a . b
pub(crate) fn dot(a: &PolynomialVector, b: &PolynomialVector) -> Polynomial {
    &(&a[0].product(&b[0]) + &a[1].product(&b[1])) + &a[2].product(&b[2])
}

/// Bernstein coefficients of a polynomial over some interval, all times one positive number.
#[derive(Clone, Debug)]
pub(super) struct Controls(Vec<Integer>);

impl Controls {
    /// See [`Polynomial::variations`]; for the roots inside the interval.
    pub(super) fn variations(&self) -> usize {
        variations(&self.0)
    }

    /// The sign inside the open interval, if all coefficients agree on it.
    pub(super) fn sign(&self) -> Option<Sign> {
        match self.variations() {
            0 => Some(first_sign(self.0.iter())),
            _ => None,
        }
    }

    /// The sign directly after the interval's start.
    pub(super) fn first_sign(&self) -> Sign {
        first_sign(self.0.iter())
    }

    /// The sign at the interval's end.
    pub(super) fn sign_at_end(&self) -> Sign {
        self.0[self.0.len() - 1].sign()
    }

    pub(super) fn coefficients(&self) -> &[Integer] {
        &self.0
    }

    /// The same polynomial over both halves of the interval (de Casteljau, without division).
    pub(super) fn halves(&self) -> [Self; 2] {
        let degree = self.0.len() - 1;
        let mut row = self.0.clone();
        let mut left = Vec::with_capacity(degree + 1);
        let mut right = vec![Integer::zero(); degree + 1];
        for level in (0..=degree).rev() {
            left.push(row[0].shifted(level as u64));
            right[level] = row[level].shifted(level as u64);
            for ix in 0..level {
                row[ix] = &row[ix] + &row[ix + 1];
            }
        }
        [Self(left), Self(right)]
    }
}

fn variations(coefficients: &[Integer]) -> usize {
    let mut last = Sign::Zero;
    let mut n = 0;
    for sign in coefficients.iter().map(Integer::sign) {
        if sign.is_zero() {
            continue;
        }
        if sign.strictly_opposite(last) {
            n += 1;
        }
        last = sign;
    }
    n
}

fn first_sign<'a>(coefficients: impl Iterator<Item = &'a Integer>) -> Sign {
    coefficients
        .map(Integer::sign)
        .find(|sign| !sign.is_zero())
        .unwrap_or(Sign::Zero)
}
