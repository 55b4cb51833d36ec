//! The engine of `impinge`: all its internals, public but without a promise of stability.
//!
//! Users of the library depend on the crate `impinge`, which re-exports the stable part. Methods in
//! other crates, such as the baselines that impinge is compared with, are built on this crate. They share its
//! frame, boxes, grid, threads, exact test and GPU engine, so that only the method differs.

mod alone;
pub mod clock;
mod clusterings;
// Types are documented; internal fields and small methods are self-explanatory.
mod advance;
mod candidates;
pub mod contact;
#[allow(missing_docs)]
pub mod cpu;
mod detector;
mod elements;
mod error;
mod found;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod grouping;
pub mod host;
mod hull;
mod ids;
mod impacts;
pub mod index;
mod key_ranges;
mod naive;
mod narrow;
mod near;
mod numbering;
mod pair_kind;
mod pairs;
mod places;
#[allow(missing_docs)]
pub mod plan;
mod position_rows;
mod positions;
mod progress;
pub mod proximity;
mod query;
#[allow(missing_docs)]
pub mod run;
mod scene;
mod sets;
mod settings;
#[allow(missing_docs)]
pub mod sink;
mod sort;
mod stats;
mod step;
mod transform;
mod tuning;
#[cfg(feature = "gpu")]
mod undecided;
#[allow(missing_docs)]
pub mod workers;

pub use advance::Advance;
pub use candidates::Candidates;
pub use detector::Detector;
pub use elements::{Elements, Kind, Part};
pub use error::Error;
#[cfg(feature = "gpu")]
pub use gpu::Capacities;
#[cfg(feature = "gpu")]
pub use gpu::{DeviceInfo, ResidentLayer, ResidentPairs, ResidentStep, devices, devices_async};
pub use ids::BodyId;
pub use impacts::{Impact, Impacts, hash_impact_rows};
pub use impinge_exact as exact;
pub use impinge_weld::{Coordinate, Weld, WrongNumber};
pub use near::{ClosestPoints, NearIter, NearPair, NearPairs, NearQuery};
pub use pair_kind::{PairKind, PairKinds};
pub use pairs::{Pairs, Primitive, hash_rows};
pub use places::Place;
pub use position_rows::PositionRows;
pub use positions::{Positions, Real};
pub use progress::{CancelToken, Control, Progress};
pub use query::{Query, SharedVertex};
pub use scene::{Body, Filter, Scene};
pub use settings::{Backend, InstructionSet, Method, Placement, Recluster, Settings};
pub use stats::{Stage, Statistics};
pub use step::{CandidateQuery, Clearance, ElementVertices, PairFilter, Start, Step, Toi};
pub use tuning::{Tuning, Ways};
#[cfg(feature = "gpu")]
pub use wgpu;
