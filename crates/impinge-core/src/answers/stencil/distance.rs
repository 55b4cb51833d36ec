//! The squared distance of two features, with gradient and Hessian: one formula for all types.
//!
//! A feature is spanned by one to three of the points `x_i`, as a point, a line or a plane. The way
//! from one feature to the other is `w = sum c_i x_i`, where the coefficients `c` depend linearly
//! on up to two parameters: `dc/dq_k = d_k`, `dw/dq_k = u_k = sum d_ki x_i`. At the nearest points
//! `w` is perpendicular to each `u_k`. The squared distance is `f = w . w` there, so by the
//! envelope theorem and the implicit function theorem
//!
//! ```text
//! df/dx_i        = 2 c_i w
//! d2f/dx_i dx_j  = 2 c_i c_j I  -  2 sum_kl (d_ki w + c_i u_k) (G^-1)_kl (d_lj w + c_j u_l)^T
//! ```
//!
//! with the Gram matrix `G_kl = u_k . u_l`. The directions are made orthonormal together with
//! their `d_k`, which is a change of parameters. Then `G` is the identity, and nothing is solved.
//! Compare the derivatives of Li et al., *Incremental Potential Contact* (2020), which are
//! generated from a formula per type.

use std::array::from_fn;

use super::{Gradient, Hessian, Point, dot, sub};

/// The way between the nearest points of two features.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NearestWay {
    /// The way from one nearest point to the other is the sum of coefficients times points.
    pub coefficients: [f64; 4],
    way: Point,
    /// Orthonormal, as far as there are parameters; 0 beyond.
    directions: [Direction; 2],
}

/// How the way changes with a parameter.
#[derive(Debug, Clone, Copy, Default)]
struct Direction {
    coefficients: [f64; 4],
    way: Point,
}

impl Direction {
    /// Takes off the part along a unit vector.
    fn remove(&mut self, other: &Direction) {
        let along = dot(self.way, other.way);
        for (to, from) in self.coefficients.iter_mut().zip(other.coefficients) {
            *to -= along * from;
        }
        for (to, from) in self.way.iter_mut().zip(other.way) {
            *to -= along * from;
        }
    }

    /// Of length 1; nothing at all if it has none, as where lines are parallel to rounding.
    fn normalised(self) -> Direction {
        let length = dot(self.way, self.way).sqrt();
        if length > 0.0 {
            Direction {
                coefficients: self.coefficients.map(|x| x / length),
                way: self.way.map(|x| x / length),
            }
        } else {
            Direction::default()
        }
    }
}

impl NearestWay {
    /// Of the features that some of the points span, given by their numbers: one to three each,
    /// four together.
    pub fn new(points: &[Point; 4], a: &[usize], b: &[usize]) -> Self {
        let between = |to: usize, from: usize| {
            let mut coefficients = [0.0; 4];
            coefficients[to] = 1.0;
            coefficients[from] = -1.0;
            Direction {
                coefficients,
                way: sub(points[to], points[from]),
            }
        };
        let spans = [a, b].into_iter();
        let mut spans = spans.flat_map(|of| of[1..].iter().map(|&to| between(to, of[0])));
        let mut directions = [Direction::default(); 2];
        let mut way = between(a[0], b[0]);
        for ix in 0..directions.len() {
            let Some(mut next) = spans.next() else {
                break;
            };
            // Once more, since rounding leaves a part of what is nearly parallel.
            for _ in 0..2 * ix {
                next.remove(&directions[0]);
            }
            directions[ix] = next.normalised();
            for _ in 0..2 {
                way.remove(&directions[ix]);
            }
        }
        NearestWay {
            coefficients: way.coefficients,
            way: way.way,
            directions,
        }
    }

    pub fn squared_distance(&self) -> f64 {
        dot(self.way, self.way)
    }

    pub fn gradient(&self) -> Gradient {
        from_fn(|i| 2.0 * self.coefficients[i / 3] * self.way[i % 3])
    }

    pub fn hessian(&self) -> Hessian {
        let c = &self.coefficients;
        let mixed = self.directions.each_ref().map(|direction| -> Gradient {
            from_fn(|i| {
                direction.coefficients[i / 3] * self.way[i % 3] + c[i / 3] * direction.way[i % 3]
            })
        });
        from_fn(|i| {
            from_fn(|j| {
                let same = if i % 3 == j % 3 {
                    c[i / 3] * c[j / 3]
                } else {
                    0.0
                };
                2.0 * (same - (mixed[0][i] * mixed[0][j] + mixed[1][i] * mixed[1][j]))
            })
        })
    }
}
