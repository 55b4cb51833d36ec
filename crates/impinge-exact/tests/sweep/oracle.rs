//! The oracle: the first contact of two moving elements by another algorithm.
//!
//! At one moment two elements share a point if and only if weights λ ≥ 0 with sum 1 exist that
//! blend the differences of their points to zero. If such weights exist, some exist with at most
//! three of them positive whose columns (difference, 1) are linearly independent (Carathéodory; the
//! differences lie in a plane). The signs of the minors of these columns decide whether they exist.
//! So the answer can change only at a root of a minor. All roots in [0, 1] of all minors are found
//! (Sturm), and at each root elimination looks for weights. Its entries are polynomials, whose
//! signs at a root are found by counting (Tarski).
//!
//! No normal, no area, no case distinction, no Bernstein form, no floating-point operation.

use std::cmp::Ordering;
use std::collections::HashSet;

use dashu_int::{IBig, ops::Gcd};

/// Coefficients by ascending powers of t, without leading zeros.
type Polynomial = Vec<IBig>;

/// A number n / 2^k.
#[derive(Clone, Debug)]
struct Dyadic(IBig, usize);

/// A moment in [0, 1].
#[derive(Clone, Debug)]
enum Moment {
    Dyadic(Dyadic),
    /// The only root of the polynomial between two numbers that are not roots.
    Root(Polynomial, Dyadic, Dyadic),
}

/// All moments at which a pair is known to touch, the first one among them.
#[derive(Debug)]
pub struct Moments(Vec<Moment>);

/// The moments at which the origin is in the hull of points that move from `start` to `end`.
pub fn contacts(start: &[[IBig; 3]], end: &[[IBig; 3]]) -> Moments {
    let columns: Vec<[Polynomial; 4]> = start
        .iter()
        .zip(end)
        .map(|(start, end)| {
            let moving = |k: usize| trimmed(vec![start[k].clone(), &end[k] - &start[k]]);
            [moving(0), moving(1), moving(2), vec![IBig::ONE]]
        })
        .collect();
    let mut moments = vec![
        Moment::Dyadic(Dyadic(IBig::ZERO, 0)),
        Moment::Dyadic(Dyadic(IBig::ONE, 0)),
    ];
    for minor in minors(&columns) {
        moments.extend(roots(&minor));
    }
    moments.retain(|moment| touches(&columns, moment));
    Moments(moments)
}

impl Moments {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether one of the moments is the start.
    pub fn include_start(&self) -> bool {
        self.0
            .iter()
            .any(|moment| moment.compare(&Dyadic(IBig::ZERO, 0)) == Ordering::Equal)
    }

    /// Whether the first of the moments is at `x` or later, and before `next`; and whether it is at
    /// `x`.
    pub fn first_is_between(&self, x: f64, next: f64) -> (bool, bool) {
        let (x, next) = (dyadic(x), dyadic(next));
        let none_before = self.0.iter().all(|m| m.compare(&x) != Ordering::Less);
        let some_before_next = self.0.iter().any(|m| m.compare(&next) == Ordering::Less);
        let at_x = self.0.iter().any(|m| m.compare(&x) == Ordering::Equal);
        (none_before && some_before_next, at_x)
    }
}

/// A nonnegative float as a dyadic number.
fn dyadic(x: f64) -> Dyadic {
    let bits = x.to_bits();
    let (biased, fraction) = ((bits >> 52) as usize, bits & ((1 << 52) - 1));
    match biased {
        0 => Dyadic(IBig::from(fraction), 1074),
        _ => Dyadic(IBig::from(fraction | 1 << 52), 1075 - biased),
    }
}

/// All minors of one to three columns that are not zero everywhere, each once up to constant
/// factors.
fn minors(columns: &[[Polynomial; 4]]) -> HashSet<Polynomial> {
    let subsets = |n: usize| {
        (1_u32..1 << n)
            .map(move |set| (0..n).filter(|ix| set >> ix & 1 == 1).collect::<Vec<_>>())
            .filter(|set| set.len() <= 3)
    };
    let mut found = HashSet::new();
    for columns_in in subsets(columns.len()) {
        for rows in subsets(4).filter(|rows| rows.len() == columns_in.len()) {
            let minor = determinant(columns, &columns_in, &rows);
            if minor.len() > 1 {
                found.insert(element(minor));
            }
        }
    }
    found
}

/// A determinant, by expansion along the first column.
fn determinant(columns: &[[Polynomial; 4]], chosen: &[usize], rows: &[usize]) -> Polynomial {
    let Some((&first, rest)) = chosen.split_first() else {
        return vec![IBig::ONE];
    };
    let mut sum = Vec::new();
    for (ix, &row) in rows.iter().enumerate() {
        let others: Vec<usize> = rows.iter().copied().filter(|&r| r != row).collect();
        let term = product(&columns[first][row], &determinant(columns, rest, &others));
        sum = if ix % 2 == 0 {
            difference(&sum, &product(&term, &vec![-IBig::ONE]))
        } else {
            difference(&sum, &term)
        };
    }
    sum
}

/// Whether weights exist at a moment.
fn touches(columns: &[[Polynomial; 4]], moment: &Moment) -> bool {
    (1_u32..1 << columns.len())
        .filter(|set| set.count_ones() <= 3)
        .any(|set| {
            let support: Vec<&[Polynomial; 4]> = (0..columns.len())
                .filter(|ix| set >> ix & 1 == 1)
                .map(|ix| &columns[ix])
                .collect();
            has_positive_weights(&support, moment)
        })
}

/// Whether the columns are linearly independent at the moment and positive weights with sum 1 blend
/// them to zero.
fn has_positive_weights(support: &[&[Polynomial; 4]], moment: &Moment) -> bool {
    let n = support.len();
    let mut rows: Vec<Vec<Polynomial>> = (0..4)
        .map(|row| {
            let target = if row == 3 {
                vec![IBig::ONE]
            } else {
                Vec::new()
            };
            let mut entries: Vec<Polynomial> =
                support.iter().map(|column| column[row].clone()).collect();
            entries.push(target);
            entries
        })
        .collect();
    for step in 0..n {
        let Some(pivot) = (step..4).find(|&row| moment.sign(&rows[row][step]) != 0) else {
            return false;
        };
        rows.swap(step, pivot);
        let pivot_row = rows[step].clone();
        for (ix, row) in rows.iter_mut().enumerate() {
            if ix != step {
                let factor = row[step].clone();
                for (entry, above) in row.iter_mut().zip(&pivot_row) {
                    *entry =
                        difference(&product(&pivot_row[step], entry), &product(&factor, above));
                }
            }
        }
    }
    rows[n..].iter().all(|row| moment.sign(&row[n]) == 0)
        && (0..n).all(|ix| moment.sign(&rows[ix][n]) * moment.sign(&rows[ix][ix]) > 0)
}

impl Moment {
    /// The sign of a polynomial at the moment.
    fn sign(&self, polynomial: &Polynomial) -> i32 {
        match self {
            Self::Dyadic(at) => sign_at(polynomial, at),
            Self::Root(root_of, low, high) => {
                if polynomial.is_empty() {
                    return 0;
                }
                let weighted = product(&derivative(root_of), polynomial);
                let chain = chain(root_of, &remainder(&weighted, root_of));
                variations(&chain, low) - variations(&chain, high)
            }
        }
    }

    fn compare(&self, x: &Dyadic) -> Ordering {
        match self {
            Self::Dyadic(at) => compare(at, x),
            Self::Root(_, low, _) if compare(x, low) != Ordering::Greater => Ordering::Greater,
            Self::Root(_, _, high) if compare(x, high) != Ordering::Less => Ordering::Less,
            Self::Root(root_of, low, _) => match sign_at(root_of, x) {
                0 => Ordering::Equal,
                sign if sign == sign_at(root_of, low) => Ordering::Greater,
                _ => Ordering::Less,
            },
        }
    }
}

/// The roots in [0, 1] of a polynomial that is not constant.
fn roots(polynomial: &Polynomial) -> Vec<Moment> {
    let common = common_divisor(polynomial, &derivative(polynomial));
    let mut simple = quotient(polynomial, &common);
    let mut found = Vec::new();
    let mut take = |simple: &mut Polynomial, at: &Dyadic| {
        if sign_at(simple, at) == 0 {
            let factor = vec![-at.0.clone(), IBig::ONE << at.1];
            *simple = quotient(simple, &factor);
            found.push(Moment::Dyadic(at.clone()));
        }
    };
    let (zero, one) = (Dyadic(IBig::ZERO, 0), Dyadic(IBig::ONE, 0));
    take(&mut simple, &zero);
    take(&mut simple, &one);
    let mut intervals = vec![(zero, one)];
    let mut isolated = Vec::new();
    while let Some((low, high)) = intervals.pop() {
        let chain = chain(&simple, &derivative(&simple));
        match variations(&chain, &low) - variations(&chain, &high) {
            0 => {}
            1 => isolated.push((low, high)),
            _ => {
                let middle = middle(&low, &high);
                take(&mut simple, &middle);
                intervals.push((low, middle.clone()));
                intervals.push((middle, high));
            }
        }
    }
    found.extend(
        isolated
            .into_iter()
            .map(|(low, high)| Moment::Root(simple.clone(), low, high)),
    );
    found
}

fn middle(Dyadic(a, j): &Dyadic, Dyadic(b, k): &Dyadic) -> Dyadic {
    let depth = (*j).max(*k);
    Dyadic((a << (depth - j)) + (b << (depth - k)), depth + 1)
}

fn compare(Dyadic(a, j): &Dyadic, Dyadic(b, k): &Dyadic) -> Ordering {
    (a << *k).cmp(&(b << *j))
}

/// The signed remainder sequence.
fn chain(first: &Polynomial, second: &Polynomial) -> Vec<Polynomial> {
    let mut chain = vec![first.clone(), second.clone()];
    while chain[chain.len() - 1].len() > 1 {
        let rest = remainder(&chain[chain.len() - 2], &chain[chain.len() - 1]);
        chain.push(element(rest.into_iter().map(|x| -x).collect()));
    }
    chain
}

fn variations(chain: &[Polynomial], at: &Dyadic) -> i32 {
    let signs: Vec<i32> = chain
        .iter()
        .map(|polynomial| sign_at(polynomial, at))
        .filter(|&sign| sign != 0)
        .collect();
    signs
        .windows(2)
        .map(|pair| i32::from(pair[0] != pair[1]))
        .sum()
}

fn sign_at(polynomial: &Polynomial, Dyadic(numerator, depth): &Dyadic) -> i32 {
    let mut value = IBig::ZERO;
    for (ix, coefficient) in polynomial.iter().rev().enumerate() {
        value = value * numerator + (coefficient << (depth * ix));
    }
    value.cmp(&IBig::ZERO) as i32
}

fn trimmed(mut polynomial: Polynomial) -> Polynomial {
    while polynomial.last().is_some_and(|x| *x == IBig::ZERO) {
        polynomial.pop();
    }
    polynomial
}

/// Divided by the greatest common divisor of the coefficients.
fn element(polynomial: Polynomial) -> Polynomial {
    let mut divisor = IBig::ZERO;
    for coefficient in &polynomial {
        if *coefficient != IBig::ZERO {
            divisor = match divisor == IBig::ZERO {
                true => coefficient.clone(),
                false => IBig::from(divisor.gcd(coefficient)),
            };
        }
    }
    if divisor == IBig::ZERO {
        return trimmed(polynomial);
    }
    if divisor < IBig::ZERO {
        divisor = -divisor;
    }
    trimmed(polynomial.into_iter().map(|x| x / &divisor).collect())
}

fn product(a: &Polynomial, b: &Polynomial) -> Polynomial {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let mut sums = vec![IBig::ZERO; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            sums[i + j] += x * y;
        }
    }
    trimmed(sums)
}

fn difference(a: &Polynomial, b: &Polynomial) -> Polynomial {
    let at = |polynomial: &Polynomial, ix: usize| polynomial.get(ix).cloned().unwrap_or(IBig::ZERO);
    let n = a.len().max(b.len());
    trimmed((0..n).map(|ix| at(a, ix) - at(b, ix)).collect())
}

fn derivative(polynomial: &Polynomial) -> Polynomial {
    let powers = polynomial.iter().enumerate().skip(1);
    trimmed(powers.map(|(ix, x)| x * IBig::from(ix)).collect())
}

/// Quotient and remainder, both times one positive number.
fn divide(polynomial: &Polynomial, divisor: &Polynomial) -> (Polynomial, Polynomial) {
    let lead = divisor.last().expect("a divisor that is not zero");
    let is_negative = *lead < IBig::ZERO;
    let size = if is_negative { -lead } else { lead.clone() };
    let mut rest = polynomial.clone();
    let mut quotient = vec![IBig::ZERO; (polynomial.len() + 1).saturating_sub(divisor.len())];
    while rest.len() >= divisor.len() {
        let shift = rest.len() - divisor.len();
        let top = rest[rest.len() - 1].clone();
        let top = if is_negative { -top } else { top };
        for coefficient in rest.iter_mut().chain(&mut quotient) {
            *coefficient *= &size;
        }
        quotient[shift] += &top;
        for (ix, coefficient) in divisor.iter().enumerate() {
            rest[shift + ix] -= &top * coefficient;
        }
        rest = trimmed(rest);
    }
    (trimmed(quotient), rest)
}

fn remainder(polynomial: &Polynomial, divisor: &Polynomial) -> Polynomial {
    element(divide(polynomial, divisor).1)
}

fn quotient(polynomial: &Polynomial, divisor: &Polynomial) -> Polynomial {
    element(divide(polynomial, divisor).0)
}

fn common_divisor(a: &Polynomial, b: &Polynomial) -> Polynomial {
    let (mut a, mut b) = (a.clone(), b.clone());
    while !b.is_empty() {
        let rest = remainder(&a, &b);
        (a, b) = (b, rest);
    }
    element(a)
}

/// The oracle itself, on cases with obvious answers.
#[test]
fn oracle_knows_the_obvious() {
    let points = |points: &[[i32; 3]]| -> Vec<[IBig; 3]> {
        points.iter().map(|p| p.map(IBig::from)).collect()
    };
    let face = |z: i32| points(&[[-1, -1, z], [3, -1, z], [-1, 3, z]]);
    // From 1 below to 2 above: at a third. From 1 to 1: never. From 0: at the start.
    let third = contacts(&face(-1), &face(2));
    let floor = 1.0_f64 / 3.0;
    assert_eq!(
        third.first_is_between(floor, floor.next_up()),
        (true, false)
    );
    assert_eq!(third.first_is_between(floor.next_up(), 1.0), (false, false));
    assert!(contacts(&face(1), &face(1)).is_empty());
    assert!(contacts(&face(0), &face(1)).include_start());
    assert!(contacts(&face(1), &face(0)).first_is_between(1.0, 2.0).1);
    // A point on a circle's chord: the root of 2 t^2 - 1, where an edge passes.
    let start = points(&[[1, -1, 0], [1, 1, 0]]);
    let end = points(&[[-1, -1, 0], [-1, 1, 0]]);
    assert!(contacts(&start, &end).first_is_between(0.5, 0.6).1);
}
