//! Corotated linear elasticity.
//!
//! Müller & Gross 2004 ("Interactive virtual materials"): strain is measured in a frame that turns
//! with the element, ε = RᵀF − 1 (symmetric, as R is the polar factor), and stress is linear in it:
//! σ = λ tr(ε) 1 + 2μ ε. A corner with rest gradient g is pulled by −V R σ g, and the stiffness is
//! the linear one turned by R; the derivative of R is ignored, which keeps the matrix positive
//! semidefinite. [`rotation`] returns a useful R even if the element is inverted.

use nalgebra::Matrix3;
use rayon::prelude::*;

use crate::element::{Element, Mat3, Vec3};
use crate::mesh::Mesh;
use crate::rotation::rotation;

/// The least number of vertices or elements per task of a thread, and the size of the pieces of
/// sums.
pub(crate) const GRAIN: usize = 512;

/// The current state of an element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turned {
    /// Volume times first Piola–Kirchhoff stress, R σ V.
    pub stress: Mat3,
    /// Turned gradients of corners 1, 2, 3.
    pub gradients: [Vec3; 3],
    /// V λ and V μ.
    pub lame: (f64, f64),
}

impl Turned {
    fn new(element: &Element, positions: &[Vec3]) -> Self {
        let f = element.deformation(positions);
        let r = rotation(&f);
        let (lambda, mu) = element.lame;
        let lame = (lambda * element.volume, mu * element.volume);
        let strain = r.transpose() * f - Matrix3::identity();
        let stress =
            strain * (2.0 * lame.1) + Matrix3::from_diagonal_element(lame.0 * strain.trace());
        Turned {
            stress: r * stress,
            gradients: element.gradients.map(|g| r * g),
            lame,
        }
    }

    #[inline]
    fn gradient(&self, corner: usize) -> Vec3 {
        match corner {
            0 => -(self.gradients[0] + self.gradients[1] + self.gradients[2]),
            _ => self.gradients[corner - 1],
        }
    }

    /// The stiffness between two corners: minus the derivative of the force on `a` with respect to
    /// the position of `b`.
    #[inline]
    pub fn stiffness(&self, a: usize, b: usize) -> Mat3 {
        let (p, q) = (self.gradient(a), self.gradient(b));
        let (lambda, mu) = self.lame;
        p * (q * lambda).transpose()
            + q * (p * mu).transpose()
            + Matrix3::from_diagonal_element(mu * p.dot(&q))
    }
}

/// Computes the current state of every element.
pub(crate) fn turn(mesh: &Mesh, positions: &[Vec3], turned: &mut Vec<Turned>) {
    mesh.elements
        .par_iter()
        .with_min_len(GRAIN)
        .map(|element| Turned::new(element, positions))
        .collect_into_vec(turned);
}

/// The elastic force on each vertex, summed over its tetrahedra in their order, so it does not
/// depend on the number of threads.
pub(crate) fn forces(mesh: &Mesh, turned: &[Turned], forces: &mut Vec<Vec3>) {
    (0..mesh.n_vertices())
        .into_par_iter()
        .with_min_len(GRAIN)
        .map(|vertex| {
            mesh.tets_at
                .get(vertex)
                .iter()
                .fold(Vec3::zeros(), |force, &entry| {
                    let (tet, corner) = (entry as usize / 4, entry as usize % 4);
                    force - turned[tet].stress * mesh.elements[tet].gradient(corner)
                })
        })
        .collect_into_vec(forces);
}

/// The elastic energy in joule, Σ V (μ |ε|² + λ/2 tr(ε)²).
pub(crate) fn energy(mesh: &Mesh, positions: &[Vec3]) -> f64 {
    let of = |element: &Element| {
        let f = element.deformation(positions);
        let strain = rotation(&f).transpose() * f - Matrix3::identity();
        let (lambda, mu) = element.lame;
        element.volume * (mu * strain.norm_squared() + 0.5 * lambda * strain.trace().powi(2))
    };
    mesh.elements.iter().map(of).sum()
}
