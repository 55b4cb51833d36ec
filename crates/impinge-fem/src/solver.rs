//! Conjugate gradients with a block-Jacobi preconditioner.
//!
//! Hestenes & Stiefel 1952; fixed vertices are filtered as by Baraff & Witkin 1998 (section 5.3):
//! their unknowns stay what they are and their residuals count as 0. Sums run over fixed pieces of
//! the vertices, each in order, and then over the pieces in order: the same bits on any number of threads.

use rayon::prelude::*;

use crate::contact::Couplings;
use crate::elasticity::GRAIN;
use crate::matrix::BlockMatrix;
use crate::mesh::{Mat3, Vec3};

/// The symmetric positive definite operator: the sparse matrix, and the couplings of bodies in contact.
pub(crate) struct System<'a> {
    pub matrix: &'a BlockMatrix,
    pub couplings: &'a Couplings,
    pub fixed: &'a [bool],
}

/// How far the solver came.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Solved {
    pub n_iterations: usize,
    /// The preconditioned residual's norm over that of the right side.
    pub residual: f64,
}

/// Vectors that the solver needs, kept from step to step.
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
    /// `out = A x`, 0 at fixed vertices.
    fn multiply(&self, x: &[Vec3], coupled: &mut Vec<Vec3>, out: &mut [Vec3]) {
        self.couplings.react(x, coupled);
        out.par_chunks_mut(GRAIN)
            .enumerate()
            .for_each(|(piece, out)| {
                for (row, out) in (piece * GRAIN..).zip(out) {
                    *out = if self.fixed[row] {
                        Vec3::zeros()
                    } else {
                        self.couplings
                            .add_row(row, coupled, self.matrix.row_times(row, x))
                    };
                }
            });
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
        self.multiply(x, coupled, product);
        let scale = pieces(sums, n, |k| b[k].dot(&(inverse[k] * b[k])));
        let fixed = self.fixed;
        residual
            .iter_mut()
            .enumerate()
            .filter(|&(k, _)| !fixed[k])
            .for_each(|(k, r)| *r = b[k] - product[k]);
        let mut norm = apply(residual, inverse, preconditioned, sums);
        direction.copy_from_slice(preconditioned);
        let goal = tolerance * tolerance * scale;
        let mut n_iterations = 0;
        while norm > goal && n_iterations < max_iterations {
            n_iterations += 1;
            self.multiply(direction, coupled, product);
            let curvature = pieces(sums, n, |k| direction[k].dot(&product[k]));
            // A matrix that rounding makes indefinite, or a vector that is not finite, ends the search.
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let step = norm / curvature;
            x.par_chunks_mut(GRAIN)
                .zip(residual.par_chunks_mut(GRAIN))
                .zip(direction.par_chunks(GRAIN).zip(product.par_chunks(GRAIN)))
                .for_each(|((x, residual), (direction, product))| {
                    for (((x, r), d), p) in x.iter_mut().zip(residual).zip(direction).zip(product) {
                        *x += d * step;
                        *r -= p * step;
                    }
                });
            let next = apply(residual, inverse, preconditioned, sums);
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

/// Applies the preconditioner, and gives the residual's norm in it, squared.
fn apply(residual: &[Vec3], inverse: &[Mat3], out: &mut [Vec3], sums: &mut Vec<f64>) -> f64 {
    out.par_chunks_mut(GRAIN)
        .enumerate()
        .map(|(piece, out)| {
            let range = piece * GRAIN..piece * GRAIN + out.len();
            let values = residual[range.clone()].iter().zip(&inverse[range]);
            out.iter_mut()
                .zip(values)
                .map(|(z, (r, inverse))| {
                    *z = inverse * r;
                    r.dot(z)
                })
                .sum::<f64>()
        })
        .collect_into_vec(sums);
    sums.iter().sum()
}
