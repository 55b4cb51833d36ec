//! The symmetric matrix without negative eigenvalues that is nearest to a given one.
//!
//! Reflections make the matrix tridiagonal, and rotations with implicit shifts then make it
//! diagonal (Householder's method and the QL algorithm: Bowdler, Martin, Reinsch and Wilkinson,
//! *The QR and QL algorithms for symmetric matrices*, 1968). What negative eigenvalues contribute
//! is taken off.

use std::array::from_fn;

use crate::query::settings::InstructionSet;
use crate::scene::error::Error;
use crate::scene::positions::Real;
use crate::simd::{Isa, Simd, with_isa};
use crate::workers::in_parts::in_parts;

/// Matrices that a thread takes at a time.
const PART: usize = 64;

/// More steps per eigenvalue than any matrix needs: two are usual.
const MOST_STEPS: usize = 60;

/// Numbers of `N` rows.
type Square<const N: usize> = [[f64; N]; N];

/// Replaces a symmetric matrix by the nearest one that is positive semidefinite, in the Frobenius
/// norm: negative eigenvalues become 0.
///
/// The mean of the matrix and its transpose is taken first. A matrix without negative eigenvalues
/// is not changed beyond that. Wrong by a few units in the last place of the largest entry.
/// One fixed order of operations: the same bits on every machine. A matrix with entries that are
/// not finite gives entries that are not.
///
/// ```
/// use impinge::project_psd;
/// let mut matrix = [[1.0, 2.0], [2.0, 1.0]]; // The eigenvalues are 3 and -1.
/// project_psd(&mut matrix);
/// assert!(matrix.as_flattened().iter().all(|x| (x - 1.5).abs() < 1e-15));
/// ```
pub fn project_psd<const N: usize>(matrix: &mut Square<N>) {
    project(matrix);
}

/// Inlined, as all that it calls, so that it is compiled for each instruction set.
#[inline(always)]
fn project<const N: usize>(matrix: &mut Square<N>) {
    // Halves of the smallest numbers would be rounded.
    let mean = |i: usize, j: usize| {
        let sum = matrix[i][j] + matrix[j][i];
        let halves = 0.5 * matrix[i][j] + 0.5 * matrix[j][i];
        if sum.is_finite() { 0.5 * sum } else { halves }
    };
    let symmetric: Square<N> = from_fn(|i| from_fn(|j| mean(i, j)));
    let largest = symmetric.as_flattened().iter();
    let largest = largest.fold(0.0_f64, |most, x| most.max(x.abs()));
    *matrix = symmetric;
    if largest == 0.0 {
        return;
    }
    // The power of two below, so that squares neither overflow nor vanish and nothing is rounded.
    let exponents = largest.to_bits() & f64::INFINITY.to_bits();
    let scale = f64::from_bits(exponents.max(1 << largest.to_bits().ilog2()));
    let (values, vectors) = eigen(symmetric.map(|row| row.map(|x| x / scale)));
    for (value, vector) in values.into_iter().zip(vectors) {
        // What is negative by rounding alone is left: taking it off would be no more accurate.
        if value < -f64::EPSILON {
            for (row, x) in matrix.iter_mut().zip(vector) {
                for (entry, y) in row.iter_mut().zip(vector) {
                    *entry -= value * (x * y) * scale;
                }
            }
        }
    }
}

/// [`project_psd`] of many matrices of `size` rows and columns, one after another, on threads of
/// the rayon pool at hand: on at most `threads` of them, or on all if that is 0. The bytes are
/// those of [`project_psd`], however many there are.
///
/// ```
/// # fn main() -> Result<(), impinge::Error> {
/// let mut matrices = [2.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.5];
/// impinge::project_psd_all(&mut matrices, 3, 0)?;
/// assert_eq!(matrices, [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5]);
/// # Ok(()) }
/// ```
///
/// # Errors
/// A size that is not 3, 6, 9 or 12; numbers that are no whole matrices; a number that is not
/// finite. The matrices are as they were then.
pub fn project_psd_all(matrices: &mut [f64], size: usize, threads: usize) -> Result<(), Error> {
    if !matches!(size, 3 | 6 | 9 | 12) {
        return Err(Error::Setting {
            setting: "size",
            given: size.to_string(),
            allowed: "3, 6, 9 or 12",
        });
    }
    if !matrices.len().is_multiple_of(size * size) {
        return Err(Error::Setting {
            setting: "matrices",
            given: format!("{} numbers", matrices.len()),
            allowed: "size x size numbers of each",
        });
    }
    if !f64::all_finite(matrices)
        && let Some(at) = matrices.iter().position(|x| !x.is_finite())
    {
        let (matrix, entry) = (at / (size * size), at % (size * size));
        return Err(Error::Setting {
            setting: "matrices",
            given: format!(
                "{} in row {}, column {} of matrix {matrix}",
                matrices[at],
                entry / size,
                entry % size
            ),
            allowed: "finite numbers",
        });
    }
    let isa = Isa::detect(InstructionSet::default());
    in_parts(matrices, PART * size * size, threads, |_, part| {
        with_isa!(isa, project_part, (part: &mut [f64] = part, size: usize = size));
    });
    Ok(())
}

#[inline(always)]
fn project_part<S: Simd>(_: S, matrices: &mut [f64], size: usize) {
    #[inline(always)]
    fn each<const N: usize>(matrices: &mut [f64]) {
        let rows = matrices.as_chunks_mut::<N>().0;
        rows.as_chunks_mut::<N>().0.iter_mut().for_each(project);
    }
    match size {
        3 => each::<3>(matrices),
        6 => each::<6>(matrices),
        9 => each::<9>(matrices),
        _ => each::<12>(matrices),
    }
}

#[inline(always)]
fn dot<const N: usize>(x: &[f64; N], y: &[f64; N]) -> f64 {
    x.iter().zip(y).fold(0.0, |sum, (x, y)| sum + x * y)
}

/// Eigenvalues of a symmetric matrix whose largest entry is about 1, and its eigenvectors as rows.
#[inline(always)]
fn eigen<const N: usize>(mut matrix: Square<N>) -> ([f64; N], Square<N>) {
    let mut vectors = from_fn(|i| from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    for k in 0..N.saturating_sub(2) {
        reflect(&mut matrix, &mut vectors, k);
    }
    let mut values = from_fn(|i| matrix[i][i]);
    let mut beside = from_fn(|i| if i + 1 < N { matrix[i][i + 1] } else { 0.0 });
    for first in 0..N {
        for _ in 0..MOST_STEPS {
            // The block from here to the first entry that is negligible.
            let is_negligible = |i: usize| {
                let size = values[i].abs() + values[i + 1].abs();
                beside[i].abs() <= 0.5 * f64::EPSILON * size
            };
            let last = (first..N - 1).find(|&i| is_negligible(i));
            let last = last.unwrap_or(N - 1);
            if last == first {
                break;
            }
            step(&mut values, &mut beside, &mut vectors, [first, last]);
        }
    }
    (values, vectors)
}

/// Reflects so that row and column `k` are zero beyond the entry beside the diagonal.
#[inline(always)]
fn reflect<const N: usize>(matrix: &mut Square<N>, vectors: &mut Square<N>, k: usize) {
    let mut normal: [f64; N] = from_fn(|i| if i > k { matrix[k][i] } else { 0.0 });
    let head = std::mem::take(&mut normal[k + 1]);
    let tail = dot(&normal, &normal);
    if tail == 0.0 {
        return;
    }
    normal[k + 1] = head + (head * head + tail).sqrt().copysign(head);
    let factor = 2.0 / dot(&normal, &normal);
    // The matrix loses `normal other^T + other normal^T`.
    let image: [f64; N] = from_fn(|i| factor * dot(&matrix[i], &normal));
    let half = 0.5 * factor * dot(&image, &normal);
    let other: [f64; N] = from_fn(|i| image[i] - half * normal[i]);
    for (i, row) in matrix.iter_mut().enumerate() {
        for (j, x) in row.iter_mut().enumerate() {
            *x -= normal[i] * other[j] + other[i] * normal[j];
        }
    }
    let sums: [f64; N] = vectors
        .iter()
        .zip(normal)
        .fold([0.0; N], |sums, (row, x)| from_fn(|j| sums[j] + x * row[j]));
    for (row, x) in vectors.iter_mut().zip(normal) {
        for (entry, sum) in row.iter_mut().zip(sums) {
            *entry -= factor * x * sum;
        }
    }
}

/// A step of the QL algorithm with an implicit shift, on a block of a tridiagonal matrix.
#[inline(always)]
fn step<const N: usize>(
    values: &mut [f64; N],
    beside: &mut [f64; N],
    vectors: &mut Square<N>,
    [first, last]: [usize; 2],
) {
    let ratio = (values[first + 1] - values[first]) / (2.0 * beside[first]);
    let root = (ratio * ratio + 1.0).sqrt().copysign(ratio);
    let mut chased = values[last] - values[first] + beside[first] / (ratio + root);
    let (mut sine, mut cosine, mut shift) = (1.0, 1.0, 0.0);
    for i in (first..last).rev() {
        let (bulge, next) = (sine * beside[i], cosine * beside[i]);
        let length = (bulge * bulge + chased * chased).sqrt();
        beside[i + 1] = length;
        if length == 0.0 {
            // The block falls apart here.
            values[i + 1] -= shift;
            beside[last] = 0.0;
            return;
        }
        (sine, cosine) = (bulge / length, chased / length);
        let value = values[i + 1] - shift;
        let slope = (values[i] - value) * sine + 2.0 * cosine * next;
        shift = sine * slope;
        values[i + 1] = value + shift;
        chased = cosine * slope - next;
        let (low, high) = (vectors[i], vectors[i + 1]);
        vectors[i + 1] = from_fn(|k| sine * low[k] + cosine * high[k]);
        vectors[i] = from_fn(|k| cosine * low[k] - sine * high[k]);
    }
    values[first] -= shift;
    beside[first] = chased;
    beside[last] = 0.0;
}
