//! The oracle: the same questions answered in exact integer arithmetic by another algorithm.
//!
//! Two convex hulls share a point if and only if weights λ ≥ 0 and μ ≥ 0 with sum 1 each exist
//! that blend the vertices to the same point. Such a system has a solution if and only if it has
//! a *basic* one, whose nonzero weights belong to linearly independent columns; so all sets of
//! columns are tried, each solved by fraction-free elimination. The basic solutions are more than
//! an answer: the points that they blend span the intersection, so that it is larger than the
//! hull of the shared vertices if and only if one of them lies outside that hull.
//!
//! No orientation sign, no case distinction, no floating-point operation.

use dashu_int::IBig;

/// The integer operations that elimination needs.
trait Integer: Clone {
    fn from_big(big: &IBig) -> Self;
    fn sign(&self) -> i32;
    /// `(p * x - y * q) / divisor`, a division without remainder.
    fn cross(p: &Self, x: &Self, y: &Self, q: &Self, divisor: &Self) -> Self;
    fn multiply_add(&self, x: &Self, sum: &Self) -> Self;
    fn negate(&self) -> Self;
}

impl Integer for IBig {
    fn from_big(big: &IBig) -> Self {
        big.clone()
    }

    fn sign(&self) -> i32 {
        self.cmp(&IBig::ZERO) as i32
    }

    fn cross(p: &Self, x: &Self, y: &Self, q: &Self, divisor: &Self) -> Self {
        (p * x - y * q) / divisor
    }

    fn multiply_add(&self, x: &Self, sum: &Self) -> Self {
        self * x + sum
    }

    fn negate(&self) -> Self {
        -self
    }
}

/// For small coordinates, with every operation checked.
impl Integer for i128 {
    fn from_big(big: &IBig) -> Self {
        Self::try_from(big).expect("small coordinates")
    }

    fn sign(&self) -> i32 {
        self.signum() as i32
    }

    fn cross(p: &Self, x: &Self, y: &Self, q: &Self, divisor: &Self) -> Self {
        let left = p.checked_mul(*x).expect("small coordinates");
        let right = y.checked_mul(*q).expect("small coordinates");
        let difference = left.checked_sub(right).expect("small coordinates");
        assert_eq!(
            difference % divisor,
            0,
            "elimination divides without remainder"
        );
        difference / divisor
    }

    fn multiply_add(&self, x: &Self, sum: &Self) -> Self {
        self.checked_mul(*x)
            .and_then(|product| product.checked_add(*sum))
            .expect("small coordinates")
    }

    fn negate(&self) -> Self {
        -self
    }
}

/// Whether the convex hulls of two sets of points share a point.
pub fn intersect(a: &[[f64; 3]], b: &[[f64; 3]]) -> bool {
    with_integers(a, b, |a, b| answer(&a, &b, &[]), |a, b| answer(&a, &b, &[]))
}

/// Whether the intersection of the two hulls is larger than the hull of the shared vertices.
/// Also true for elements with the same vertices.
pub fn intersect_beyond_shared(
    a: &[[f64; 3]],
    ids_a: &[u32],
    b: &[[f64; 3]],
    ids_b: &[u32],
) -> bool {
    let same_vertices =
        ids_a.iter().all(|id| ids_b.contains(id)) && ids_b.iter().all(|id| ids_a.contains(id));
    let shared: Vec<usize> = (0..a.len())
        .filter(|&ix| ids_b.contains(&ids_a[ix]))
        .collect();
    same_vertices
        || with_integers(
            a,
            b,
            |a, b| answer(&a, &b, &shared),
            |a, b| answer(&a, &b, &shared),
        )
}

/// Makes all coordinates integers over one power of two, and calls `small` if they are small, else
/// `big`.
fn with_integers(
    a: &[[f64; 3]],
    b: &[[f64; 3]],
    small: impl Fn(Vec<[i128; 3]>, Vec<[i128; 3]>) -> bool,
    big: impl Fn(Vec<[IBig; 3]>, Vec<[IBig; 3]>) -> bool,
) -> bool {
    let parts = |x: f64| -> (i64, i32) {
        let bits = x.to_bits();
        let biased = (bits >> 52) as i32 & 0x7ff;
        assert!(biased < 0x7ff, "finite coordinates");
        let fraction = (bits & ((1 << 52) - 1)) as i64;
        let (mantissa, exponent) = if biased == 0 {
            (fraction, -1074)
        } else {
            (fraction | (1 << 52), biased - 1075)
        };
        let shift = if mantissa == 0 {
            0
        } else {
            mantissa.trailing_zeros()
        };
        let magnitude = mantissa >> shift;
        (
            if x < 0.0 { -magnitude } else { magnitude },
            if magnitude == 0 {
                i32::MAX
            } else {
                exponent + shift as i32
            },
        )
    };
    let lowest = a
        .iter()
        .chain(b)
        .flatten()
        .map(|&x| parts(x).1)
        .min()
        .expect("at least one point");
    let integer = |x: f64| -> IBig {
        let (mantissa, exponent) = parts(x);
        if mantissa == 0 {
            IBig::ZERO
        } else {
            IBig::from(mantissa) << (exponent - lowest) as usize
        }
    };
    let convert = |points: &[[f64; 3]]| -> Vec<[IBig; 3]> {
        points.iter().map(|point| point.map(integer)).collect()
    };
    let (a, b) = (convert(a), convert(b));
    let limit = IBig::from(1 << 12);
    let is_small = |points: &[[IBig; 3]]| points.iter().flatten().all(|x| *x < limit && -x < limit);
    if is_small(&a) && is_small(&b) {
        let narrow = |points: &[[IBig; 3]]| -> Vec<[i128; 3]> {
            points
                .iter()
                .map(|point| point.each_ref().map(i128::from_big))
                .collect()
        };
        small(narrow(&a), narrow(&b))
    } else {
        big(a, b)
    }
}

/// Whether a point of both hulls lies outside the hull of the vertices `shared` of `a`.
fn answer<T: Integer>(a: &[[T; 3]], b: &[[T; 3]], shared: &[usize]) -> bool {
    let one = T::from_big(&IBig::ONE);
    let zero = T::from_big(&IBig::ZERO);
    // Rows: x, y, z of (sum of λ a - sum of μ b), sum of λ, sum of μ.
    let columns: Vec<Vec<T>> = a
        .iter()
        .map(|[x, y, z]| vec![x.clone(), y.clone(), z.clone(), one.clone(), zero.clone()])
        .chain(b.iter().map(|[x, y, z]| {
            vec![
                x.negate(),
                y.negate(),
                z.negate(),
                zero.clone(),
                one.clone(),
            ]
        }))
        .collect();
    let target = vec![
        zero.clone(),
        zero.clone(),
        zero.clone(),
        one.clone(),
        one.clone(),
    ];
    if shared.is_empty() {
        return any_basic_solution(&columns, &target, |_, _, _| true);
    }
    let shared_columns: Vec<Vec<T>> = shared
        .iter()
        .map(|&ix| {
            let [x, y, z] = &a[ix];
            vec![x.clone(), y.clone(), z.clone(), one.clone()]
        })
        .collect();
    any_basic_solution(&columns, &target, |support, weights, scale| {
        // The blended point times `scale`, then `scale`.
        let mut point = vec![zero.clone(), zero.clone(), zero.clone(), scale.clone()];
        for (&column_ix, weight) in support.iter().zip(weights) {
            if let Some(vertex) = a.get(column_ix) {
                for axis in 0..3 {
                    point[axis] = weight.multiply_add(&vertex[axis], &point[axis]);
                }
            }
        }
        !any_basic_solution(&shared_columns, &point, |_, _, _| true)
    })
}

/// Whether `accept(support, weights, scale)` holds for some basic solution of
/// "columns times weights = target, weights ≥ 0"; the solution is weights / scale, scale > 0.
fn any_basic_solution<T: Integer>(
    columns: &[Vec<T>],
    target: &[T],
    accept: impl Fn(&[usize], &[T], &T) -> bool,
) -> bool {
    (1_u32..1 << columns.len())
        .filter(|set| set.count_ones() as usize <= target.len())
        .any(|set| {
            let support: Vec<usize> = (0..columns.len()).filter(|ix| set >> ix & 1 == 1).collect();
            solve(columns, target, &support)
                .is_some_and(|(weights, scale)| accept(&support, &weights, &scale))
        })
}

/// The solution with exactly these nonzero weights, all positive, if the columns are linearly
/// independent and there is one: weights and their common denominator, which is positive.
///
/// Fraction-free Gauss-Jordan elimination (Bareiss 1968): all entries stay minors of the matrix.
fn solve<T: Integer>(columns: &[Vec<T>], target: &[T], support: &[usize]) -> Option<(Vec<T>, T)> {
    let n_rows = target.len();
    let mut rows: Vec<Vec<T>> = (0..n_rows)
        .map(|row_ix| {
            let mut row: Vec<T> = support
                .iter()
                .map(|&column_ix| columns[column_ix][row_ix].clone())
                .collect();
            row.push(target[row_ix].clone());
            row
        })
        .collect();
    let mut divisor = T::from_big(&IBig::ONE);
    for step in 0..support.len() {
        let pivot_ix = (step..n_rows).find(|&row_ix| rows[row_ix][step].sign() != 0)?;
        rows.swap(step, pivot_ix);
        let pivot_row = rows[step].clone();
        for (row_ix, row) in rows.iter_mut().enumerate() {
            if row_ix != step {
                let factor = row[step].clone();
                for (entry, above) in row.iter_mut().zip(&pivot_row) {
                    *entry = T::cross(&pivot_row[step], entry, &factor, above, &divisor);
                }
            }
        }
        divisor = pivot_row[step].clone();
    }
    let last = support.len();
    if rows[last..].iter().any(|row| row[last].sign() != 0) {
        return None;
    }
    let weights: Vec<T> = rows[..last]
        .iter()
        .map(|row| {
            if divisor.sign() > 0 {
                row[last].clone()
            } else {
                row[last].negate()
            }
        })
        .collect();
    let scale = if divisor.sign() > 0 {
        divisor
    } else {
        divisor.negate()
    };
    weights
        .iter()
        .all(|weight| weight.sign() > 0)
        .then_some((weights, scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    /// The oracle itself, on cases with obvious answers.
    #[test]
    fn oracle_knows_the_obvious() {
        let point = |x, y, z| [[x, y, z]; 3];
        assert!(intersect(&UNIT, &UNIT));
        assert!(intersect(&UNIT, &point(0.25, 0.25, 0.0)));
        assert!(intersect(&UNIT, &point(0.5, 0.5, 0.0)));
        assert!(!intersect(&UNIT, &point(0.5, 0.5 + f64::EPSILON, 0.0)));
        assert!(!intersect(&UNIT, &point(0.25, 0.25, 1e-300)));
        assert!(!intersect(&UNIT, &point(1e300, 0.25, 0.0)));
    }

    #[test]
    fn oracle_knows_obvious_neighbours() {
        let with_apex = |apex| [UNIT[0], UNIT[1], apex];
        let beyond =
            |apex| intersect_beyond_shared(&UNIT, &[0, 1, 2], &with_apex(apex), &[0, 1, 3]);
        assert!(!beyond([0.0, 0.0, 1.0]));
        assert!(!beyond([0.0, -1.0, 0.0]));
        assert!(beyond([7.0, 1.0, 0.0]));
        assert!(intersect_beyond_shared(
            &UNIT,
            &[0, 1, 2],
            &UNIT,
            &[2, 0, 1]
        ));
    }
}
