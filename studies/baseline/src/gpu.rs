//! The uniform grid on a GPU: the same stages in WGSL, on any adapter.
//!
//! Pairs that the filter on the device leaves unsure are decided exactly on the CPU, as in impinge.
//! So the pairs are those of [`crate::UniformGrid`] on every device.
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

use impinge_core::gpu::cells::Guest;
use impinge_core::gpu::pass_buffers::Capacities;
use impinge_core::host::gpu::GpuHost;
use impinge_core::{BodyId, Query, Scene};

use crate::{Counts, Error, Outcome, check_lambda};
use kernels::Kernels;
#[doc(hidden)]
pub use kernels::shaders;
use plan::Buffers;

/// Settings of a [`UniformGrid`] on a GPU.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The density coefficient λ of the paper's equation (1), above 0. The paper found 5 to be best
    /// for this method.
    pub lambda: f64,
    /// Whether a pair is tested in only one of its common cells, as in impinge.
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
    host: GpuHost,
}

impl UniformGrid {
    /// Opens the adapter, or shares the device that impinge has open on it. The first frame
    /// compiles the kernels.
    ///
    /// # Errors
    /// A setting out of its range; no adapter matches; the driver returns an error.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        UniformGrid::with_room(settings, None, None)
    }

    /// Like [`new`](UniformGrid::new), with the initial and the largest capacities of impinge's
    /// buffers. For tests: normally buffers grow by themselves, up to the limits of the device.
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
        let (kernels, owner_rule) = (Arc::new(Kernels::new()), settings.owner_rule);
        let guest = Guest::new(move || {
            let (kernels, mut buffers) = (Arc::clone(&kernels), Buffers::new());
            Box::new(move |recorder, lambda, cells| {
                buffers.record(&kernels, owner_rule, recorder, lambda, cells)
            })
        });
        let host = GpuHost::new(device, settings.lambda, first, memory_budget, guest)?;
        Ok(UniformGrid { settings, host })
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Finds all intersecting pairs of elements of two different bodies, in the current state of
    /// the scene.
    ///
    /// The device times its stages if it has a clock; `upload`, `decide` and `collect` are stages
    /// of the host.
    ///
    /// # Errors
    /// A stale id, one body named twice, refused positions; more than the device can hold.
    pub fn detect(&mut self, scene: &Scene, a: BodyId, b: BodyId) -> Result<Outcome<'_>, Error> {
        let query = Query::between(a, b);
        let (pairs, passes) = self.host.detect(scene, &query, "uniform grid")?;
        let mut counts = Counts::default();
        for pass in passes {
            // Each pass makes all entries, but pairs only those of its cells.
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
