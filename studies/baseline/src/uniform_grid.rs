//! Parallel spatial hashing on the CPU: settings, counts and results.

use impinge_core::host::Host;
use impinge_core::{BodyId, InstructionSet, Pairs, Query, Scene};

use crate::method::Method;
use crate::{Error, check_lambda, check_threads};

/// Settings of a [`UniformGrid`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The density coefficient λ of the paper's equation (1), above 0. The paper found 5 to be best
    /// for this method.
    pub lambda: f64,
    /// Whether a pair is tested in only one of its common cells, as in impinge. The method as
    /// described has no such rule: a pair is tested in every common cell.
    pub owner_rule: bool,
    /// Whether impinge's coarse map drops elements that the other body comes nowhere near, before
    /// the grid. The method as described has no such map.
    pub coarse_map: bool,
    /// CPU threads; 0 means one per core.
    pub threads: usize,
    /// The widest vector instructions that may be used.
    pub instruction_set: InstructionSet,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            lambda: 5.0,
            owner_rule: false,
            coarse_map: false,
            threads: 0,
            instruction_set: InstructionSet::default(),
        }
    }
}

/// Counts of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Cells along x, y, z; 0 if the bodies' boxes do not overlap.
    pub resolution: [u32; 3],
    /// Elements that reach the region where the bodies' boxes overlap.
    pub n_reaching: u64,
    /// Cell-element pairs: an element is counted once per cell.
    pub n_entries: u64,
    /// Cells with elements of both bodies.
    pub n_mixed_cells: u64,
    /// Pairs of boxes tested: `n_a n_b` summed over cells.
    pub n_box_tests: u64,
    /// Pairs of elements tested exactly, including repetitions.
    pub n_tests: u64,
    /// Of those, the pairs that floating-point filters left to exact arithmetic.
    pub n_unsure: u64,
}

impl Counts {
    /// The number of cells of the grid.
    pub fn n_cells(&self) -> u64 {
        self.resolution
            .iter()
            .map(|&along| u64::from(along))
            .product()
    }
}

/// The pairs, and the counts of the work.
#[derive(Debug, Clone, Copy)]
pub struct Outcome<'a> {
    /// The pairs, sorted, each once; stages in milliseconds are in its statistics, and
    /// [`Pairs::colliding`] has the colliding elements of a body.
    pub pairs: &'a Pairs,
    /// The counts.
    pub counts: Counts,
}

/// Parallel spatial hashing between two bodies. Memory lives here and is reused.
pub struct UniformGrid {
    settings: Settings,
    host: Host,
    method: Method,
}

impl UniformGrid {
    /// Creates the method with explicit settings.
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        check_lambda(settings.lambda)?;
        check_threads(settings.threads)?;
        Ok(UniformGrid {
            settings,
            host: Host::new(settings.threads),
            method: Method::new(settings.instruction_set),
        })
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Finds all intersecting pairs of elements of two different bodies, in the current state of
    /// the scene.
    ///
    /// # Errors
    /// A stale id, one body named twice, refused positions; 2^32 cell-element pairs or more.
    pub fn detect(&mut self, scene: &Scene, a: BodyId, b: BodyId) -> Result<Outcome<'_>, Error> {
        let UniformGrid {
            settings,
            host,
            method,
        } = self;
        let mut counts = Counts::default();
        let query = Query::between(a, b);
        let pairs = host.detect(scene, &query, "uniform grid", |job, answer, stats| {
            method.run(job, answer, settings, stats)?;
            counts = method.counts;
            Ok(())
        })?;
        Ok(Outcome { pairs, counts })
    }
}
