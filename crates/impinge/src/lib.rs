//! Exact, real-time collision detection for deforming meshes.
//!
//! Bodies have fixed topology and positions that change every frame. A [`Detector`] answers
//! which of their primitives intersect: between bodies and within one.
//!
//! * **Closed sets.** Touching counts, coplanar overlap counts, a degenerate triangle is the
//!   segment or the point that it is.
//! * **Exact.** A pair is reported if and only if the two primitives share a point when the given
//!   coordinates are read as real numbers. There is no tolerance anywhere.
//! * **The same bytes everywhere.** The answer is sorted and depends on the input alone: not on
//!   method, backend, threads or memory.

mod cpu;
mod detector;
mod error;
pub mod exact;
mod frame;
#[cfg(feature = "gpu")]
mod gpu;
mod grouping;
#[doc(hidden)]
pub mod guest;
mod naive;
mod narrow;
mod pairs;
mod progress;
mod query;
mod scene;
mod settings;
mod stats;

pub use detector::Detector;
pub use error::Error;
#[cfg(feature = "gpu")]
#[doc(hidden)]
pub use gpu::Capacities;
#[cfg(feature = "gpu")]
pub use gpu::{DeviceInfo, ResidentPairs, devices};
pub use pairs::{Pairs, Primitive, hash_rows};
pub use progress::{CancelToken, Control, Progress};
pub use query::{Query, SharedVertex};
pub use scene::{Body, BodyId, Elements, Filter, Kind, Positions, Real, Scene};
pub use settings::{Backend, InstructionSet, Method, Recluster, Settings};
pub use stats::{Stage, Statistics};
/// The GPU interface that [`Detector::with_device`] and [`Detector::encode`] speak.
#[cfg(feature = "gpu")]
pub use wgpu;

// What users hold may be moved to, and lent to, other threads.
const _: () = {
    const fn threads_may_share<T: Send + Sync>() {}
    threads_may_share::<Detector>();
    threads_may_share::<Scene>();
    threads_may_share::<Pairs>();
    threads_may_share::<Query>();
};
