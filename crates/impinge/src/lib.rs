//! Exact, real-time collision detection for deforming meshes.
//!
//! Bodies have fixed topology and positions that change every frame. A [`Detector`] finds
//! which of their primitives intersect, between bodies and within one body.
//!
//! * **Closed sets.** Touching counts, coplanar overlap counts, a degenerate triangle is the
//!   segment or the point that it is.
//! * **Exact.** A pair is reported if and only if the two primitives share a point when the given
//!   coordinates are read as real numbers. There is no tolerance anywhere.
//! * **The same bytes everywhere.** The answer is sorted and depends on the input alone: not on
//!   method, backend, threads or memory.
//! * **Continuous detection.** [`Detector::impacts`] finds which vertices, edges and faces touch while bodies move from their
//!   positions to their [end positions](Scene::set_end_positions), and the first time of each pair, exact and rounded down.
//!   For solvers, [`Detector::earliest`] finds the first contact of a step, [`Detector::is_free`] decides whether there is any,
//!   and [`Detector::advance`] finds how far a step can be taken.
//!
//! This crate is the stable interface of the engine in `impinge-core`.

/// The GPU interface of [`Detector::with_device`] and [`Detector::encode`].
#[cfg(feature = "gpu")]
pub use impinge_core::wgpu;
pub use impinge_core::{
    Advance, Backend, Body, BodyId, CancelToken, CandidateQuery, Candidates, Control, Detector,
    Elements, Error, Filter, Impact, Impacts, InstructionSet, Kind, Method, PairKind, PairKinds,
    Pairs, Part, Positions, Primitive, Progress, Query, Real, Recluster, Scene, Settings,
    SharedVertex, Stage, Start, Statistics, Step, Toi, hash_rows,
};
#[cfg(feature = "gpu")]
pub use impinge_core::{DeviceInfo, ResidentPairs, devices, devices_async};
pub use impinge_core::{contact, exact, proximity};

// The types that users hold are `Send` and `Sync`.
const _: () = {
    const fn threads_may_share<T: Send + Sync>() {}
    threads_may_share::<Detector>();
    threads_may_share::<Scene>();
    threads_may_share::<Pairs>();
    threads_may_share::<Query>();
    threads_may_share::<Impacts>();
    threads_may_share::<Step>();
};
