//! The uniform grid on a GPU: the same stages in WGSL, on any adapter.
//!
//! What the filter on the device leaves open is settled exactly on the CPU, as in impinge; so the pairs
//! are those of [`crate::UniformGrid`], whatever the device.
//!
//! ```no_run
//! use impinge_baseline::gpu::{Settings, UniformGrid};
//! # fn detect(scene: &impinge_core::Scene, a: impinge_core::BodyId, b: impinge_core::BodyId) -> Result<(), impinge_core::Error> {
//! let mut grid = UniformGrid::new(Settings::default())?;
//! let outcome = grid.detect(scene, a, b)?;
//! println!("{} pairs, {} tests", outcome.pairs.len(), outcome.counts.n_tests);
//! # Ok(()) }
//! ```

mod kernels;
mod plan;

use std::sync::Arc;

use impinge_core::gpu::room::Capacities;
use impinge_core::host::gpu::Host;
use impinge_core::{BodyId, Query, Scene};

use crate::{Counts, Error, Outcome, check_lambda};
use kernels::Kernels;
#[doc(hidden)]
pub use kernels::shaders;
use plan::Plan;

/// What a [`UniformGrid`] on a GPU may be told.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The density coefficient λ of the paper's equation (1), above 0. The paper found 5 to be best for
    /// this method.
    pub lambda: f64,
    /// Whether a pair is tested in one of the cells that it shares only, as impinge does it.
    pub owner_rule: bool,
    /// Part of an adapter's name, to choose among several; hardware comes before software.
    pub device: Option<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            lambda: 5.0,
            owner_rule: false,
            device: None,
        }
    }
}

/// Parallel spatial hashing between two bodies on a GPU. Memory lives on the device and is reused.
pub struct UniformGrid {
    settings: Settings,
    host: Host,
}

impl UniformGrid {
    /// Opens the adapter, or shares the device that impinge has open on it. Kernels are compiled by the first frame.
    ///
    /// # Errors
    /// A setting out of its range; no adapter fits; the driver refuses.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        UniformGrid::with_room(settings, None, None)
    }

    /// [`new`](UniformGrid::new), and how much room impinge's buffers begin with and may have. For tests:
    /// they grow by themselves, as far as the device goes.
    ///
    /// # Errors
    /// As `new`.
    #[doc(hidden)]
    pub fn with_capacities(
        settings: Settings,
        first: Capacities,
        memory_budget: Option<u64>,
    ) -> Result<Self, Error> {
        UniformGrid::with_room(settings, Some(first), memory_budget)
    }

    fn with_room(
        settings: Settings,
        first: Option<Capacities>,
        memory_budget: Option<u64>,
    ) -> Result<Self, Error> {
        check_lambda(settings.lambda)?;
        let device = settings.device.as_deref();
        let plan = Plan::new(Arc::new(Kernels::new()), settings.owner_rule);
        let host = Host::new(
            device,
            settings.lambda,
            first,
            memory_budget,
            Box::new(plan),
        )?;
        Ok(UniformGrid { settings, host })
    }

    /// What it was told.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// All pairs of primitives of two different bodies that intersect, as things are in the scene now.
    ///
    /// Stages are timed by the device where it has a clock; `upload`, `settle` and `collect` are the host's.
    ///
    /// # Errors
    /// A stale id, one body named twice, refused positions; more than the device can hold.
    pub fn detect(&mut self, scene: &Scene, a: BodyId, b: BodyId) -> Result<Outcome<'_>, Error> {
        let query = Query::between(a, b);
        let (pairs, passes) = self.host.detect(scene, &query, "uniform grid")?;
        let mut counts = Counts::default();
        for pass in passes {
            // Each pass makes all entries, and pairs those of its cells.
            counts.n_reaching = pass.needed.kept;
            counts.n_entries = pass.needed.entries;
            counts.n_mixed_cells += pass.n_subdivided;
            counts.n_box_tests += pass.n_box_tests;
            counts.n_tests += pass.needed.candidates;
            counts.n_unsure += pass.needed.unsure;
        }
        if counts.n_reaching > 0 {
            counts.resolution = pairs.stats().grid.unwrap_or_default();
        }
        Ok(Outcome { pairs, counts })
    }
}
