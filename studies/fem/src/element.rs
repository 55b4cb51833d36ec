//! A tetrahedron of a solid, at rest and deformed.

use nalgebra::{Matrix3, Vector3};

pub(crate) type Vec3 = Vector3<f64>;
pub(crate) type Mat3 = Matrix3<f64>;

/// A tetrahedron at rest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Element {
    /// Vertices, numbered consecutively over all solids.
    pub corners: [u32; 4],
    /// Volume, above 0.
    pub volume: f64,
    /// Gradients of the linear shape functions of corners 1, 2, 3; that of corner 0 is minus their
    /// sum.
    pub gradients: [Vec3; 3],
    /// Lamé's λ and μ.
    pub lame: (f64, f64),
}

impl Element {
    /// The gradient of the shape function of a corner.
    #[inline]
    pub fn gradient(&self, corner: usize) -> Vec3 {
        match corner {
            0 => -(self.gradients[0] + self.gradients[1] + self.gradients[2]),
            _ => self.gradients[corner - 1],
        }
    }

    /// The deformation gradient: how rest edges are mapped to current ones.
    #[inline]
    pub fn deformation(&self, positions: &[Vec3]) -> Mat3 {
        let [a, b, c, d] = self.corners.map(|corner| positions[corner as usize]);
        (b - a) * self.gradients[0].transpose()
            + (c - a) * self.gradients[1].transpose()
            + (d - a) * self.gradients[2].transpose()
    }
}
