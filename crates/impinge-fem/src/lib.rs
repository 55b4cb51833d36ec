//! Elastic solids of tetrahedra that deform, collide and push each other: a source of large
//! deformation for collision detection, and a use of it.
//!
//! * **Elasticity** is linear in a frame that turns with each element (corotated: Müller & Gross,
//!   "Interactive virtual materials", 2004) and recovers from inversion (signed singular values: Irving,
//!   Teran & Fedkiw, "Invertible finite elements for robust simulation of large deformation", 2004); see [`rotation`].
//! * **Time** goes by backward Euler, a linear system a step, solved by conjugate gradients with a
//!   block-Jacobi preconditioner. It is stable for long steps, and damps.
//! * **Pairs** come from an [`impinge::Detector`], of any method and backend.
//!
//! # Contact
//! Each pair of tetrahedra pushes with a force in proportion to the volume that it has in common, along a direction that
//! leads out of both bodies; forces are equal and opposite and act at one point. Where bodies overlap by a
//! depth d, this is a pressure of [`contact_stiffness`](Settings::contact_stiffness) · E · d / edge. It is a penalty:
//! bodies in contact do overlap a little, and ones thrown fast enough at each other pass through. Friction is Coulomb's.
//!
//! # Determinism
//! The same solids and settings give the same bits on any number of threads, method and backend: every
//! sum has a fixed order.

mod contact;
mod depth;
mod elasticity;
mod element;
mod error;
mod lists;
mod matrix;
mod mesh;
mod overlap;
mod rotation;
pub mod scenes;
mod settings;
mod simulation;
mod solid;
mod solver;
mod state;

pub use error::Error;
pub use rotation::rotation;
pub use settings::{Damping, Ground, Settings};
pub use simulation::{Energy, Simulation, StepReport};
pub use solid::{Material, Solid};
pub use state::State;
