//! The engine of `impinge`: all its internals, public but without a promise of stability.
//!
//! Users of the library depend on the crate `impinge`, which re-exports the stable part. Methods in
//! other crates, such as the baselines that impinge is compared with, are built on this crate. They
//! share its frame, boxes, grid, threads, exact test and GPU engine, so that only the method
//! differs.

#![warn(missing_debug_implementations)]
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod answers;
mod boxes;
pub mod bvh;
mod clusterings;
pub mod contact;
pub mod cpu;
mod detector;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod plan;
pub mod proximity;
pub mod query;
pub mod scene;
pub mod search;
pub mod simd;
pub mod workers;

pub use answers::advance::Advance;
pub use answers::candidates::Candidates;
pub use answers::changes::Changes;
pub use answers::closest::{Closest, ClosestElement};
pub use answers::hits::{Hits, RayHit};
pub use answers::impacts::{Impact, Impacts, hash_impact_rows};
pub use answers::near::{ClosestPoints, NearIter, NearPair, NearPairs};
pub use answers::neighbours::{Csr, Neighbours};
pub use answers::pairs::{Element, Pairs, hash_rows};
pub use answers::places::Place;
#[doc(hidden)]
pub use answers::reached::{StartOfBody, StepStart};
pub use answers::safe::{Bounds, SafeDistances};
pub use answers::stencil::{Gradient, Hessian, project_psd, project_psd_all};
pub use answers::stencils::{Stencil, StencilIter, Stencils};
pub use answers::truncation::Truncation;
#[cfg(feature = "gpu")]
pub use detector::Gpu;
pub use detector::{Detector, host};
#[cfg(feature = "gpu")]
pub use gpu::Capacities;
#[cfg(feature = "gpu")]
pub use gpu::{
    DeviceInfo, ResidentPairs, ResidentPart, ResidentSafe, ResidentStep, ResidentVertices, devices,
    devices_async,
};
pub use impinge_exact as exact;
pub use impinge_weld::{Coordinate, Weld, WrongNumber};
pub use query::pair_kind::{PairKind, PairKinds};
pub use query::progress::{CancelToken, Control, Progress};
pub use query::settings::{Backend, InstructionSet, Method, Recluster, Settings};
pub use query::step::{Clearance, ElementVertices, Hit, PairFilter, Precision, Start};
pub use query::{Exclusion, Query, SharedVertex};
pub use scene::elements::{BodyKind, Elements, Part};
pub use scene::error::Error;
pub use scene::ids::BodyId;
pub use scene::mesh::Mesh;
pub use scene::position_rows::PositionRows;
pub use scene::positions::{NewPositions, Positions, Real};
pub use scene::{Body, Filter, Scene, Thickness};
pub use search::stats::{Stage, Stats};
#[cfg(feature = "gpu")]
pub use wgpu;
pub use workers::affinity::Affinity;
#[doc(hidden)]
pub use workers::own_pool;
pub use workers::tuning::{Tuning, Ways};
