//! Conjugate gradients with a block-Jacobi preconditioner.
//!
//! Hestenes & Stiefel 1952; fixed vertices are filtered as by Baraff & Witkin 1998 (section 5.3):
//! their unknowns do not change and their residuals count as 0. Sums run over fixed pieces of the
//! vertices, each in order, and then over the pieces in order, so they do not depend on the number
//! of threads.

use rayon::prelude::*;

use crate::contact::Couplings;
use crate::elasticity::GRAIN;
use crate::element::{Mat3, Vec3};
use crate::matrix::BlockMatrix;

/// The symmetric positive definite operator: the sparse matrix, and the couplings of bodies in
/// contact.
pub(crate) struct System<'a> {
    pub matrix: &'a BlockMatrix,
    pub couplings: &'a Couplings,
    pub fixed: &'a [bool],
}

/// The result of the solver.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Solved {
    pub n_iterations: usize,
    /// The preconditioned residual's norm over that of the right side.
    pub residual: f64,
}

/// Scratch vectors of the solver, reused from step to step.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    residual: Vec<Vec3>,
    direction: Vec<Vec3>,
    product: Vec<Vec3>,
    preconditioned: Vec<Vec3>,
    inverse: Vec<Mat3>,
    coupled: Vec<Vec3>,
    sums: Vec<f64>,
}

impl System<'_> {
    /// Computes `out = A x`, 0 at fixed vertices; returns `x · out`.
    fn multiply(
        &self,
        x: &[Vec3],
        coupled: &mut Vec<Vec3>,
        out: &mut [Vec3],
        sums: &mut Vec<f64>,
    ) -> f64 {
        self.couplings.react(x, coupled);
        out.par_chunks_mut(GRAIN)
            .enumerate()
            .map(|(piece, out)| {
                let mut sum = 0.0;
                for (row, out) in (piece * GRAIN..).zip(out) {
                    if self.fixed[row] {
                        *out = Vec3::zeros();
                        continue;
                    }
                    let product = self.matrix.row_times(row, x);
                    *out = self.couplings.add_row(row, coupled, product);
                    sum += x[row].dot(out);
                }
                sum
            })
            .collect_into_vec(sums);
        sums.iter().sum()
    }

    /// The inverse of each block on the diagonal; 0 at fixed vertices.
    fn precondition(&self, inverse: &mut Vec<Mat3>) {
        (0..self.fixed.len())
            .into_par_iter()
            .with_min_len(GRAIN)
            .map(|row| {
                if self.fixed[row] {
                    return Mat3::zeros();
                }
                let block = self.matrix.diagonal(row) + self.couplings.diagonal(row);
                block.try_inverse().unwrap_or_else(Mat3::zeros)
            })
            .collect_into_vec(inverse);
    }

    /// Solves A x = b from the `x` given, to a residual of `tolerance` relative to `b` in the
    /// preconditioner's norm, in at most `max_iterations`.
    pub fn solve(
        &self,
        b: &[Vec3],
        x: &mut [Vec3],
        tolerance: f64,
        max_iterations: usize,
        scratch: &mut Scratch,
    ) -> Solved {
        let Scratch {
            residual,
            direction,
            product,
            preconditioned,
            inverse,
            coupled,
            sums,
        } = scratch;
        let n = b.len();
        for vector in [&mut *residual, direction, product, preconditioned] {
            vector.clear();
            vector.resize(n, Vec3::zeros());
        }
        self.precondition(inverse);
        let scale = pieces(sums, n, |k| b[k].dot(&(inverse[k] * b[k])));
        self.multiply(x, coupled, product, sums);
        let fixed = self.fixed;
        residual
            .iter_mut()
            .enumerate()
            .filter(|&(k, _)| !fixed[k])
            .for_each(|(k, r)| *r = b[k] - product[k]);
        preconditioned
            .iter_mut()
            .zip(&*inverse)
            .zip(&*residual)
            .for_each(|((z, inverse), r)| *z = inverse * r);
        direction.copy_from_slice(preconditioned);
        let mut norm = pieces(sums, n, |k| residual[k].dot(&preconditioned[k]));
        let goal = tolerance * tolerance * scale;
        let mut n_iterations = 0;
        while norm > goal && n_iterations < max_iterations {
            n_iterations += 1;
            let curvature = self.multiply(direction, coupled, product, sums);
            // Stops if rounding made the matrix indefinite, or if a vector is not finite.
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let step = norm / curvature;
            // One pass over all vectors updates the solution, the residual, the preconditioned
            // residual and the product of these two.
            x.par_chunks_mut(GRAIN)
                .zip(residual.par_chunks_mut(GRAIN))
                .zip(preconditioned.par_chunks_mut(GRAIN))
                .zip(direction.par_chunks(GRAIN).zip(product.par_chunks(GRAIN)))
                .zip(inverse.par_chunks(GRAIN))
                .map(|((((x, r), z), (d, p)), inverse)| {
                    let mut sum = 0.0;
                    for k in 0..x.len() {
                        x[k] += d[k] * step;
                        r[k] -= p[k] * step;
                        z[k] = inverse[k] * r[k];
                        sum += r[k].dot(&z[k]);
                    }
                    sum
                })
                .collect_into_vec(sums);
            let next: f64 = sums.iter().sum();
            let keep = next / norm;
            norm = next;
            direction
                .par_chunks_mut(GRAIN)
                .zip(preconditioned.par_chunks(GRAIN))
                .for_each(|(direction, preconditioned)| {
                    for (d, z) in direction.iter_mut().zip(preconditioned) {
                        *d = z + *d * keep;
                    }
                });
        }
        Solved {
            n_iterations,
            residual: if scale > 0.0 {
                (norm / scale).sqrt()
            } else {
                0.0
            },
        }
    }
}

/// A sum over vertices, piece by piece.
fn pieces(sums: &mut Vec<f64>, n: usize, of: impl Fn(usize) -> f64 + Sync) -> f64 {
    (0..n.div_ceil(GRAIN))
        .into_par_iter()
        .map(|piece| {
            (piece * GRAIN..n.min((piece + 1) * GRAIN))
                .map(&of)
                .sum::<f64>()
        })
        .collect_into_vec(sums);
    sums.iter().sum()
}
