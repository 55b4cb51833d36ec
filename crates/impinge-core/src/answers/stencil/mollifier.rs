//! The factor that makes a potential of nearly parallel edges smooth, with its derivatives.
//!
//! Li et al., *Incremental Potential Contact* (2020), equations 24 and 25: with `s` the squared
//! length of the cross product of the edges, and a threshold `e`, the factor is `s/e (2 - s/e)`
//! below the threshold and 1 from there on. The threshold is 1e-3 of the product of the squared
//! lengths at rest.
//!
//! Lengths to the fourth power would soon overflow or underflow, so lengths are measured in a power
//! of two near those at rest. That is exact: a scene that is 2^300 times as large has the same
//! mollifiers, bit by bit.

use std::array::from_fn;

use super::{Gradient, Hessian, Point, cross, dot, sub};
use crate::scene::vector::scaled;
use impinge_exact::internal::power_of_two;

/// What the squared length of the cross product is compared with; 0 by default, which none is
/// below.
///
/// Packed for the sake of stencils, of which there are many.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, packed(2))]
pub(crate) struct Threshold {
    /// Where lengths are measured in `2^exponent`.
    value: f64,
    exponent: i16,
}

impl Threshold {
    /// Of edges 0-1 and 2-3 of four points at rest.
    pub fn at_rest(rest: &[Point; 4]) -> Self {
        let edges = edges(rest);
        let [a, b] = edges.map(exponent_of);
        // Halfway between both edges, so that the product is near 1 and each square finite.
        let halfway = ((a + b) >> 1).max(a.max(b) - 500);
        let exponent = halfway.clamp(-1000, 1000);
        let unit = power_of_two(-i32::from(exponent));
        let [u, v] = edges.map(|edge| scaled(edge, unit));
        Threshold {
            value: 1e-3 * dot(u, u) * dot(v, v),
            exponent,
        }
    }
}

/// Edges 0-1 and 2-3.
fn edges(points: &[Point; 4]) -> [Point; 2] {
    [sub(points[1], points[0]), sub(points[3], points[2])]
}

/// Of the largest coordinate; that of the smallest normal numbers, or one less, below them.
fn exponent_of(edge: Point) -> i16 {
    let largest = edge.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    (largest.to_bits() >> 52) as i16 - 1023
}

/// The mollifier of edges 0-1 and 2-3 of four points, below its threshold.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mollifier {
    /// Lengths are multiplied by this power of two here.
    unit: f64,
    edges: [Point; 2],
    normal: Point,
    threshold: f64,
}

impl Mollifier {
    /// None at the threshold and above.
    pub fn below(points: &[Point; 4], threshold: Threshold) -> Option<Self> {
        let unit = power_of_two(-i32::from(threshold.exponent));
        let edges = edges(points).map(|edge| scaled(edge, unit));
        let normal = cross(edges[0], edges[1]);
        let threshold = threshold.value;
        (dot(normal, normal) < threshold).then_some(Mollifier {
            unit,
            edges,
            normal,
            threshold,
        })
    }

    /// The share of the threshold.
    fn share(&self) -> f64 {
        dot(self.normal, self.normal) / self.threshold
    }

    pub fn value(&self) -> f64 {
        let share = self.share();
        share * (2.0 - share)
    }

    /// The derivative by the squared length of the cross product.
    fn slope(&self) -> f64 {
        2.0 * (1.0 - self.share()) / self.threshold
    }

    /// Of the squared length of the cross product `n` of `u` and `v`: `2 v x n` by `u` and
    /// `2 n x u` by `v`.
    fn gradient_of_square(&self) -> Gradient {
        let [u, v] = self.edges;
        let by_edge = [cross(v, self.normal), cross(self.normal, u)];
        from_fn(|i| 2.0 * sign(i) * by_edge[i / 6][i % 3])
    }

    pub fn gradient(&self) -> Gradient {
        let slope = self.slope();
        self.gradient_of_square().map(|x| slope * x * self.unit)
    }

    pub fn hessian(&self) -> Hessian {
        let [u, v] = self.edges;
        let (uu, uv, vv) = (dot(u, u), dot(u, v), dot(v, v));
        let square = self.gradient_of_square();
        let slope = self.slope();
        let curvature = -2.0 / (self.threshold * self.threshold);
        let second = |i: usize, j: usize| {
            let (k, l) = (i % 3, j % 3);
            let same = |x: f64| if k == l { x } else { 0.0 };
            match (i / 6, j / 6) {
                (0, 0) => 2.0 * (same(vv) - v[k] * v[l]),
                (1, 1) => 2.0 * (same(uu) - u[k] * u[l]),
                (0, 1) => 4.0 * u[k] * v[l] - 2.0 * v[k] * u[l] - same(2.0 * uv),
                _ => 4.0 * u[l] * v[k] - 2.0 * v[l] * u[k] - same(2.0 * uv),
            }
        };
        from_fn(|i| {
            from_fn(|j| {
                let signs = sign(i) * sign(j);
                let sum = slope * signs * second(i, j) + curvature * (square[i] * square[j]);
                sum * self.unit * self.unit
            })
        })
    }
}

/// An edge goes from its first point, which counts with a minus.
fn sign(i: usize) -> f64 {
    if i % 6 < 3 { -1.0 } else { 1.0 }
}
