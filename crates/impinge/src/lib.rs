//! Exact collision detection for deforming meshes.
pub mod exact;
