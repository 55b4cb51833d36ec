//! Real roots in (0, 1]: isolation, the sign of another polynomial at a root, rounding down.
//!
//! Isolation is by Descartes' rule of signs on dyadic intervals (Collins and Akritas, *Polynomial
//! real root isolation using Descartes' rule of signs*, 1976; in Bernstein form, Lane and
//! Riesenfeld 1981): no variation, no root; one variation, one simple root; else the interval is
//! halved. Halving ends if no root is multiple, so a polynomial that keeps two variations for long
//! is divided by the common divisor with its derivative.

use alloc::vec::Vec;
use core::cmp::Ordering;

use super::fixed::{Factor, Whole, Wide};
use super::integer::{Integer, common_integers, parts};
use super::polynomial::{Controls, Polynomial};
use crate::Sign;
use crate::rounding::power_of_two;

/// Halvings before multiple roots, or a common root, are looked for by a common divisor.
const PATIENCE: usize = 10;

/// The way to an interval by halving [0, 1]: true is the right half.
type Path = Vec<bool>;

/// A root, exactly: the time is algebraic.
#[derive(Debug)]
pub(crate) struct Root {
    /// The interval that isolates the root; not used for a dyadic root.
    path: Path,
    place: RootPlace,
}

#[derive(Debug)]
enum RootPlace {
    /// The only root of `polynomial` inside the interval, and simple. `controls` are over the
    /// interval.
    Inside {
        polynomial: Polynomial,
        controls: Controls,
    },
    /// `numerator / 2^depth`.
    At { numerator: Integer, depth: u64 },
}

/// A root rounded down: `floor <= root < floor.next_up()`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Time {
    /// The largest `f64` that is not above the root.
    pub(crate) floor: f64,
    /// Whether it is the root.
    pub(crate) is_exact: bool,
}

impl Time {
    /// The earlier of two roots, by their floors.
    pub(crate) fn earlier(self, other: Self) -> Self {
        match self.floor.total_cmp(&other.floor) {
            Ordering::Less => self,
            Ordering::Greater => other,
            // Of two roots with the same floor, one that equals the floor is the earlier.
            Ordering::Equal => Self {
                floor: self.floor,
                is_exact: self.is_exact || other.is_exact,
            },
        }
    }
}

/// The roots of a polynomial in (0, 1], ascending, each once whatever its multiplicity.
///
/// The polynomial must not be zero everywhere.
pub(crate) struct Roots {
    polynomial: Polynomial,
    is_squarefree: bool,
    /// Parts not yet examined, the earliest last.
    stack: Vec<Unexamined>,
}

enum Unexamined {
    Inside(Path, Controls),
    At(Integer, u64),
}

impl Roots {
    pub(crate) fn of(polynomial: Polynomial) -> Self {
        debug_assert!(!polynomial.is_zero(), "everything is a root of zero");
        let mut stack = Vec::new();
        if polynomial.sign_at_end().is_zero() {
            stack.push(Unexamined::At(Integer::from(1), 0));
        }
        if polynomial.variations() > 0 {
            stack.push(Unexamined::Inside(Path::new(), polynomial.controls()));
        }
        Self {
            polynomial,
            is_squarefree: false,
            stack,
        }
    }

    /// Divides by the common divisor with the derivative, which makes every root simple.
    fn remove_multiple_roots(&mut self) {
        self.is_squarefree = true;
        let divisor = self
            .polynomial
            .common_divisor(&self.polynomial.derivative());
        if divisor.is_constant() {
            return;
        }
        self.polynomial = self.polynomial.quotient(&divisor);
        for part in &mut self.stack {
            if let Unexamined::Inside(path, controls) = part {
                *controls = self.polynomial.controls_over(path);
            }
        }
    }
}

impl Iterator for Roots {
    type Item = Root;

    fn next(&mut self) -> Option<Root> {
        loop {
            let (path, controls) = match self.stack.pop()? {
                Unexamined::At(numerator, depth) => {
                    return Some(Root {
                        path: Path::new(),
                        place: RootPlace::At { numerator, depth },
                    });
                }
                Unexamined::Inside(path, controls) => (path, controls),
            };
            match controls.variations() {
                0 => {}
                1 => {
                    let place = RootPlace::Inside {
                        polynomial: self.polynomial.clone(),
                        controls,
                    };
                    return Some(Root { path, place });
                }
                _ if path.len() >= PATIENCE && !self.is_squarefree => {
                    self.stack.push(Unexamined::Inside(path, controls));
                    self.remove_multiple_roots();
                }
                _ => {
                    let [left, right] = controls.halves();
                    let middle = left.sign_at_end();
                    let mut right_path = path.clone();
                    right_path.push(true);
                    let mut left_path = path;
                    left_path.push(false);
                    if middle.is_zero() {
                        let at = Unexamined::At(start_of(&right_path), right_path.len() as u64);
                        self.stack.push(Unexamined::Inside(right_path, right));
                        self.stack.push(at);
                    } else {
                        self.stack.push(Unexamined::Inside(right_path, right));
                    }
                    self.stack.push(Unexamined::Inside(left_path, left));
                }
            }
        }
    }
}

/// The numerator of an interval's start, over 2^(length of the path).
fn start_of(path: &[bool]) -> Integer {
    let mut start = Integer::zero();
    for bits in path.chunks(32) {
        let number = bits.iter().fold(0, |n, &bit| n << 1 | u64::from(bit));
        start = &start.shifted(bits.len() as u64) + &Integer::from(number);
    }
    start
}

impl Root {
    /// The sign of a polynomial at the root.
    pub(crate) fn sign_of(&mut self, other: &Polynomial) -> Sign {
        if other.is_zero() {
            return Sign::Zero;
        }
        let mut controls = match &self.place {
            RootPlace::At { numerator, depth } => return other.sign_at(numerator, *depth),
            RootPlace::Inside { .. } => other.controls_over(&self.path),
        };
        for round in 0.. {
            if let Some(sign) = controls.sign() {
                return sign;
            }
            match &self.place {
                RootPlace::At { numerator, depth } => return other.sign_at(numerator, *depth),
                // A root of the divisor is a root of the polynomial, which has only this one
                // inside, and it is simple. So the divisor has at most one root inside, and its
                // variations are odd if and only if it has one.
                RootPlace::Inside { polynomial, .. } if round == PATIENCE => {
                    let divisor = polynomial.common_divisor(other);
                    if divisor.controls_over(&self.path).variations() % 2 == 1 {
                        return Sign::Zero;
                    }
                }
                RootPlace::Inside { .. } => {}
            }
            if let Some(is_right) = self.halve() {
                let [left, right] = controls.halves();
                controls = if is_right { right } else { left };
            }
        }
        unreachable!("halving ends where the sign is not zero")
    }

    /// Halves the interval. Returns whether the right half has the root; `None` where the root is
    /// the middle, and from then on.
    fn halve(&mut self) -> Option<bool> {
        let RootPlace::Inside { controls, .. } = &mut self.place else {
            return None;
        };
        let [left, right] = controls.halves();
        let middle = left.sign_at_end();
        if middle.is_zero() {
            self.path.push(true);
            self.place = RootPlace::At {
                numerator: start_of(&self.path),
                depth: self.path.len() as u64,
            };
            return None;
        }
        // The sign changes once inside, so the root is on the left where the middle has the later
        // sign.
        let is_right = middle == controls.first_sign();
        *controls = if is_right { right } else { left };
        self.path.push(is_right);
        Some(is_right)
    }

    /// The root rounded down.
    pub(crate) fn floor(&self) -> Time {
        floor_of(self.guess(), |x| self.compare(x))
    }

    /// The root compared with a float in [0, 1].
    fn compare(&self, x: f64) -> Ordering {
        let (numerator, depth) = dyadic(x);
        match &self.place {
            RootPlace::At {
                numerator: root,
                depth: root_depth,
            } => (&root.shifted(depth) - &numerator.shifted(*root_depth))
                .sign()
                .order(),
            RootPlace::Inside {
                polynomial,
                controls,
            } => {
                let path_depth = self.path.len() as u64;
                let start = start_of(&self.path);
                let x_here = numerator.shifted(path_depth);
                if (&x_here - &start.shifted(depth)).sign() != Sign::Positive {
                    return Ordering::Greater;
                }
                let end = &start + &Integer::from(1);
                if (&x_here - &end.shifted(depth)).sign() != Sign::Negative {
                    return Ordering::Less;
                }
                match polynomial.sign_at(&numerator, depth) {
                    Sign::Zero => Ordering::Equal,
                    sign if sign == controls.first_sign() => Ordering::Greater,
                    _ => Ordering::Less,
                }
            }
        }
    }

    /// The root as a float, nearly always to the last bit or two.
    fn guess(&self) -> f64 {
        match &self.place {
            RootPlace::At { numerator, depth } => scaled(numerator.approximate(), *depth),
            RootPlace::Inside { controls, .. } => {
                let inside = guess_inside(controls);
                let depth = self.path.len() as u64;
                scaled(start_of(&self.path).approximate(), depth) + scaled((inside, 0), depth)
            }
        }
    }
}

/// The only root of a polynomial between two floats in [0, 1] that are not roots themselves,
/// rounded down.
pub(crate) fn floor_between(polynomial: &Polynomial, low: f64, high: f64) -> Time {
    let value_at = |x: f64| {
        let (numerator, depth) = dyadic(x);
        polynomial.value_at(&numerator, depth)
    };
    let (at_low, at_high) = (value_at(low), value_at(high));
    // The root of the chord, as a guess: the values are over 2^(degree * depth).
    let power = |x: f64| i64::try_from(dyadic(x).1 * polynomial.degree()).unwrap_or(0);
    let ((a, i), (b, j)) = (at_low.approximate(), at_high.approximate());
    let apart = (j - power(high)) - (i - power(low));
    let b = b * power_of_two(i32::try_from(apart.clamp(-1000, 1000)).unwrap_or(0));
    let guess = low + (high - low) * (a / (a - b));
    let before = at_low.sign();
    floor_of(guess, |x| {
        if x <= low {
            return Ordering::Greater;
        }
        if x >= high {
            return Ordering::Less;
        }
        match value_at(x).sign() {
            Sign::Zero => Ordering::Equal,
            sign if sign == before => Ordering::Greater,
            _ => Ordering::Less,
        }
    })
}

/// `part / (part + rest)` rounded down, for numbers from 0 to 2^190, of which `part` is not 0.
pub(crate) fn floor_of_share(part: &Wide<4>, rest: &Wide<4>) -> Time {
    let whole = part.plus(rest);
    let ((a, i), (b, j)) = (part.approximate(), whole.approximate());
    floor_of(scaled((a / b, i), j.unsigned_abs()), |x| {
        let (mantissa, exponent) = parts(x);
        let depth = exponent.unsigned_abs();
        if mantissa == 0 || depth > 250 {
            // Below 2^-197.
            return Ordering::Greater;
        }
        let part = part.product(&Wide::power_of_two(depth));
        let difference = part.minus(&whole.product(&Wide::from(mantissa)));
        difference.sign().order()
    })
}

/// A root in [0, 1] rounded down, from a guess and a comparison of the root with floats.
fn floor_of(guess: f64, compare: impl Fn(f64) -> Ordering) -> Time {
    // Floats from 0 to 1 are ordered as their bits are: search there, from a guess outwards.
    let is_below = |bits: u64| compare(f64::from_bits(bits)) == Ordering::Less;
    let one = 1.0_f64.to_bits();
    let (mut low, mut high) = (0, one + 1);
    let mut at = guess.clamp(0.0, 1.0).to_bits();
    let mut step = 1_u64;
    while high - low > 1 {
        if is_below(at) {
            high = at;
        } else {
            low = at;
        }
        // Outwards in growing steps while one side is unbounded, then bisection.
        at = match (low, high) {
            (0, _) => high.saturating_sub(step),
            (_, high) if high == one + 1 => low.saturating_add(step).min(one),
            _ => low + (high - low) / 2,
        };
        step = step.saturating_mul(2);
        if at <= low || at >= high {
            at = low + (high - low) / 2;
        }
    }
    let floor = f64::from_bits(low);
    Time {
        floor,
        is_exact: compare(floor) == Ordering::Equal,
    }
}

/// A float in [0, 1] as an integer over 2^depth.
fn dyadic(x: f64) -> (Integer, u64) {
    let ([numerator], exponent) = common_integers([x]);
    match u64::try_from(-exponent) {
        Ok(depth) => (numerator, depth),
        Err(_) => unreachable!("a number of at most 1"),
    }
}

/// `x * 2^exponent / 2^depth`; only for guesses.
fn scaled((x, exponent): (f64, i64), depth: u64) -> f64 {
    let exponent = i128::from(exponent) - i128::from(depth);
    match i32::try_from(exponent) {
        Ok(exponent) => x * power_of_two(exponent.clamp(-1200, 1023)),
        Err(_) => 0.0,
    }
}

/// The only root of Bernstein coefficients with one variation, as a share of the interval: Newton's
/// method, with bisection where it would leave the bounds found so far.
fn guess_inside(controls: &Controls) -> f64 {
    let parts: Vec<(f64, i64)> = controls
        .coefficients()
        .iter()
        .map(Integer::approximate)
        .collect();
    let top = parts
        .iter()
        .filter(|(x, _)| *x != 0.0)
        .map(|&(_, exponent)| exponent)
        .max()
        .unwrap_or(0);
    let row: Vec<f64> = parts
        .iter()
        .map(|&(x, exponent)| {
            i32::try_from(exponent - top)
                .map_or(0.0, |exponent| x * power_of_two(exponent.max(-1100)))
        })
        .collect();
    let starts_positive = controls.first_sign() == Sign::Positive;
    let (mut low, mut high) = (0.0, 1.0);
    let mut at: f64 = 0.5;
    for _ in 0..100 {
        let (value, slope) = value_and_slope(&row, at);
        if (value > 0.0) == starts_positive && value != 0.0 {
            low = at;
        } else {
            high = at;
        }
        let newton = at - value / slope;
        let next = if newton > low && newton < high {
            newton
        } else {
            low + (high - low) / 2.0
        };
        if (next - at).abs() <= at * f64::EPSILON / 2.0 {
            return next;
        }
        at = next;
    }
    at
}

fn value_and_slope(controls: &[f64], at: f64) -> (f64, f64) {
    let mut row = [0.0; 7];
    let row = &mut row[..controls.len()];
    row.copy_from_slice(controls);
    let mut slope = 0.0;
    for level in (1..row.len()).rev() {
        if level == 1 {
            slope = row[1] - row[0];
        }
        for ix in 0..level {
            row[ix] = row[ix] * (1.0 - at) + row[ix + 1] * at;
        }
    }
    #[allow(clippy::cast_precision_loss, reason = "at most six")]
    let degree = (controls.len() - 1) as f64;
    (row[0], slope * degree)
}
