//! The mathematics of stencils: squared distances and mollifiers with their derivatives.
//!
//! With them goes the projection of matrices onto those without negative eigenvalues.
//!
//! In: up to four points, and which of them span the features that are nearest. Out: numbers in
//! `f64`, in one fixed order of operations without fused multiply-add: the same bits everywhere.

mod distance;
mod mollifier;
mod projection;

use crate::scene::vector::{cross, dot, sub};
use impinge_exact::Point;

pub(crate) use distance::NearestWay;
pub(crate) use mollifier::{Mollifier, Threshold};
pub use projection::{project_psd, project_psd_all};

/// Derivatives by the coordinates of four points.
pub type Gradient = [f64; 12];

/// Second derivatives by the coordinates of four points.
pub type Hessian = [[f64; 12]; 12];
