//! The oracle: the intersection of two triangles, in integers and by another algorithm.
//!
//! A point of both is a blend of either's corners with weights λ, μ ≥ 0 of sum 1. The solutions
//! form a polytope whose vertices are *basic*: their nonzero weights belong to independent columns.
//! Trying all sets of columns finds them all. If neither triangle is degenerate, points and weights
//! determine each other, so these are the corners. Else all lie on one line, and the corners are
//! the first and the last in lexicographic order.

use dashu_int::IBig;

/// Coordinates over a positive common denominator, in multiples of the scale's unit.
#[derive(Debug, Clone)]
pub struct Rational {
    pub numerators: [IBig; 3],
    pub denominator: IBig,
}

/// `f64` as integer multiples of a power of two.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    unit: i32,
}

fn parts(x: f64) -> (i64, i32) {
    let bits = x.to_bits();
    let biased = (bits >> 52) as i32 & 0x7ff;
    let fraction = (bits & ((1 << 52) - 1)) as i64;
    let (magnitude, exponent) = if biased == 0 {
        (fraction, -1074)
    } else {
        (fraction | 1 << 52, biased - 1075)
    };
    (if x < 0.0 { -magnitude } else { magnitude }, exponent)
}

impl Scale {
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Self {
        let unit = numbers
            .into_iter()
            .filter(|&x| x != 0.0)
            .map(|x| parts(x).1)
            .min();
        Scale {
            // Spare bits for the neighbours of results.
            unit: unit.unwrap_or(0) - 200,
        }
    }

    pub fn whole(self, x: f64) -> IBig {
        let (magnitude, exponent) = parts(x);
        match magnitude {
            0 => IBig::ZERO,
            _ => {
                let shift = exponent - self.unit;
                assert!(shift >= 0, "{x:e} is no multiple of the unit");
                IBig::from(magnitude) << shift as usize
            }
        }
    }

    pub fn point(self, point: [f64; 3]) -> [IBig; 3] {
        point.map(|x| self.whole(x))
    }
}

fn is_positive(x: &IBig) -> bool {
    *x > IBig::ZERO
}

/// The corners of the intersection of two triangles.
pub fn corners(a: &[[IBig; 3]; 3], b: &[[IBig; 3]; 3]) -> Vec<Rational> {
    let mut found: Vec<Rational> = Vec::new();
    for set in 1u32..64 {
        if let Some(point) = basic(a, b, set)
            && !found.iter().any(|held| equal(held, &point))
        {
            found.push(point);
        }
    }
    if found.len() > 2 && (is_flat(a) || is_flat(b)) {
        found.sort_by(|x, y| {
            let by = |k: usize| {
                (&x.numerators[k] * &y.denominator).cmp(&(&y.numerators[k] * &x.denominator))
            };
            by(0).then(by(1)).then(by(2))
        });
        found = vec![found[0].clone(), found[found.len() - 1].clone()];
    }
    found
}

pub fn difference(p: &[IBig; 3], q: &[IBig; 3]) -> [IBig; 3] {
    [0, 1, 2].map(|k| &p[k] - &q[k])
}

pub fn cross(p: &[IBig; 3], q: &[IBig; 3]) -> [IBig; 3] {
    [0, 1, 2].map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        &p[i] * &q[j] - &p[j] * &q[i]
    })
}

pub fn dot(p: &[IBig; 3], q: &[IBig; 3]) -> IBig {
    (0..3).map(|k| &p[k] * &q[k]).fold(IBig::ZERO, |x, y| x + y)
}

pub fn normal(t: &[[IBig; 3]; 3]) -> [IBig; 3] {
    cross(&difference(&t[1], &t[0]), &difference(&t[2], &t[0]))
}

pub fn is_flat(t: &[[IBig; 3]; 3]) -> bool {
    normal(t).iter().all(|x| *x == IBig::ZERO)
}

/// `q - p`, times a positive number.
pub fn between(p: &Rational, q: &Rational) -> [IBig; 3] {
    [0, 1, 2].map(|k| &q.numerators[k] * &p.denominator - &p.numerators[k] * &q.denominator)
}

pub fn equal(p: &Rational, q: &Rational) -> bool {
    between(p, q).iter().all(|x| *x == IBig::ZERO)
}

/// The point of the basic solution of a set of columns; `None` if they are linearly dependent or a
/// weight is not positive.
fn basic(a: &[[IBig; 3]; 3], b: &[[IBig; 3]; 3], set: u32) -> Option<Rational> {
    let columns: Vec<usize> = (0..6).filter(|k| set >> k & 1 == 1).collect();
    if columns.len() > 5 || columns[0] > 2 || columns[columns.len() - 1] < 3 {
        return None;
    }
    let entry = |row: usize, column: usize| match (row, column < 3) {
        (0..3, true) => a[column][row].clone(),
        (0..3, false) => -b[column - 3][row].clone(),
        (3, true) | (4, false) => IBig::ONE,
        _ => IBig::ZERO,
    };
    let n = columns.len();
    // Rows of the set's columns, and the right-hand side.
    let mut rows: Vec<Vec<IBig>> = (0..5)
        .map(|row| {
            let right = IBig::from(i32::from(row > 2));
            columns
                .iter()
                .map(|&column| entry(row, column))
                .chain([right])
                .collect()
        })
        .collect();
    // Gauss-Jordan without fractions: each row is only known up to a factor.
    for pivot in 0..n {
        let found = (pivot..5).find(|&row| rows[row][pivot] != IBig::ZERO)?;
        rows.swap(pivot, found);
        let base = rows[pivot].clone();
        for (ix, row) in rows.iter_mut().enumerate() {
            if ix != pivot && row[pivot] != IBig::ZERO {
                let (p, q) = (base[pivot].clone(), row[pivot].clone());
                for (x, y) in row.iter_mut().zip(&base) {
                    *x = &*x * &p - y * &q;
                }
            }
        }
    }
    if rows[n..].iter().any(|row| row[n] != IBig::ZERO) {
        return None;
    }
    // Weight k is rows[k][n] / rows[k][k].
    let mut numerators = [IBig::ZERO, IBig::ZERO, IBig::ZERO];
    let mut denominator = IBig::ONE;
    for (k, &column) in columns.iter().enumerate() {
        let (mut top, mut bottom) = (rows[k][n].clone(), rows[k][k].clone());
        if bottom < IBig::ZERO {
            (top, bottom) = (-top, -bottom);
        }
        if !is_positive(&top) {
            return None;
        }
        if column < 3 {
            for axis in 0..3 {
                numerators[axis] =
                    &numerators[axis] * &bottom + &a[column][axis] * &top * &denominator;
            }
            denominator *= bottom;
        }
    }
    Some(Rational {
        numerators,
        denominator,
    })
}

/// Whether `x` is the number nearest to `numerator / denominator`, ties to even; in single
/// precision, the nearest `f32`.
pub fn is_nearest(
    scale: Scale,
    x: f64,
    numerator: &IBig,
    denominator: &IBig,
    single: bool,
) -> bool {
    let far = |y: f64| {
        let gap = scale.whole(y) * denominator - numerator;
        if gap < IBig::ZERO { -gap } else { gap }
    };
    let is_even = |x: f64| {
        if single {
            (x as f32).to_bits().is_multiple_of(2)
        } else {
            x.to_bits().is_multiple_of(2)
        }
    };
    let neighbours = if single {
        if f64::from(x as f32) != x {
            return false;
        }
        [(x as f32).next_down(), (x as f32).next_up()].map(f64::from)
    } else {
        [x.next_down(), x.next_up()]
    };
    let here = far(x);
    if here == IBig::ZERO {
        return true;
    }
    // Unless numbers are tiny, zero is the nearest only to zero itself.
    let may_be_zero = scale.unit <= -1074;
    (x != 0.0 || may_be_zero)
        && neighbours.into_iter().all(|other| {
            let there = far(other);
            here < there || (here == there && is_even(x))
        })
}
