//! Elastic solids of tetrahedra that deform, collide and push each other: the large deformations of
//! the paper's table 2 and figure 6.
//!
//! * **Elasticity** is linear in a frame that turns with each element (corotated: Müller & Gross,
//!   "Interactive virtual materials", 2004) and recovers from inversion (signed singular values:
//!   Irving, Teran & Fedkiw, "Invertible finite elements for robust simulation of large
//!   deformation", 2004); see [`rotation`].
//! * **Time** is integrated by backward Euler, with one linear system per step, solved by conjugate
//!   gradients with a block-Jacobi preconditioner. It is stable for long steps, and damps the
//!   motion.
//! * **Pairs** come from an [`impinge::Detector`], of any method and backend.
//!
//! # Contact
//! The two tetrahedra of each pair push each other with a force proportional to the volume of their
//! intersection, along a direction that leads out of both bodies. The forces are equal and opposite
//! and act at one point. Where bodies overlap by a depth d, this is a pressure of
//! [`contact_stiffness`](Settings::contact_stiffness) · E · d / edge. It is a penalty method:
//! bodies in contact overlap a little, and bodies that move fast enough pass through each other.
//! Friction is Coulomb's.
//!
//! # Determinism
//! The same solids and settings give the same bits on any number of threads, any method and
//! backend, because every sum has a fixed order.

mod contact;
mod elasticity;
mod element;
mod error;
mod lists;
mod matrix;
mod mesh;
mod rotation;
pub mod scenes;
mod settings;
mod simulation;
mod solid;
mod solver;

pub use error::Error;
pub use rotation::rotation;
pub use settings::{Damping, Ground, Settings};
pub use simulation::{Energy, Simulation, StepReport};
pub use solid::{Material, Solid};
