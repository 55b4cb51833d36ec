//! What is near, how near, and how far it may go.

mod filtered;
mod near;
mod piles;
mod rational;
mod reuse;
mod safe;
mod separation;
mod smallest;
mod stencils;
mod stopped;
mod thickness;
mod truncate;
