//! Contestants: the library with each of its methods, and the peer of the paper.

use std::time::Instant;

use impinge::{Backend, BodyId, CancelToken, Control, Detector, Pairs, Query, Scene, Settings};
use impinge_baseline::UniformGrid;

use crate::error::Error;
use crate::machine::Adapter;
use crate::published::LAMBDA_FWZS11;
use crate::report::Method;

/// Where a contestant runs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Place {
    Cpu { n_threads: usize },
    Gpu(Adapter),
}

impl Place {
    pub fn name(&self) -> &str {
        match self {
            Place::Cpu { .. } => "cpu",
            Place::Gpu(adapter) => &adapter.name,
        }
    }

    pub fn is_gpu(&self) -> bool {
        matches!(self, Place::Gpu(_))
    }

    pub fn is_software(&self) -> bool {
        matches!(self, Place::Gpu(adapter) if adapter.is_software)
    }

    /// The settings of the library's detector for this place.
    pub fn settings(&self) -> Settings {
        match self {
            Place::Cpu { n_threads } => Settings::new().backend(Backend::Cpu).threads(*n_threads),
            Place::Gpu(adapter) => Settings::new()
                .backend(Backend::Gpu)
                .device(Some(adapter.name.clone())),
        }
    }
}

/// Times and counts of a frame.
#[derive(Debug, Clone, Default)]
pub(crate) struct Found {
    pub ms: f64,
    pub stages: Vec<(&'static str, f64)>,
    pub n_cells: u64,
    pub n_subdivided: u64,
    pub n_entries: u64,
    pub n_candidates: u64,
    pub n_unsure: u64,
    pub bytes_held: u64,
}

/// Finds all pairs of a frame.
pub(crate) trait Finder {
    /// Finds the pairs between two bodies in the current state of the scene. After the clock has
    /// stopped, it writes them to `rows`, sorted.
    fn find(
        &mut self,
        scene: &Scene,
        bodies: [BodyId; 2],
        cancel: &CancelToken,
        rows: &mut Vec<[u32; 4]>,
    ) -> Result<Found, Error>;
}

/// A finder that has not been set up.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Setup {
    pub method: Method,
    pub place: Place,
    /// λ; only grids use it.
    pub lambda: f64,
}

impl Setup {
    pub fn build(&self) -> Result<Box<dyn Finder>, Error> {
        let method = match self.method {
            Method::Cells => impinge::Method::Cells,
            Method::Clusters => impinge::Method::Clusters,
            Method::Fwzs11 => return self.place.uniform_grid(self.lambda),
        };
        Ok(Box::new(Detector::new(
            self.place.settings().method(method).density(self.lambda),
        )?))
    }

    /// Whether the method has a λ.
    pub fn has_lambda(&self) -> bool {
        self.method != Method::Clusters
    }
}

impl Place {
    /// The method of [FWZS11] for this place.
    fn uniform_grid(&self, lambda: f64) -> Result<Box<dyn Finder>, Error> {
        match self {
            Place::Cpu { n_threads } => {
                Ok(Box::new(UniformGrid::new(impinge_baseline::Settings {
                    lambda,
                    // With the paper's λ as described there; with its best λ, with everything that
                    // helps `Cells`.
                    coarse_map: lambda != LAMBDA_FWZS11,
                    threads: *n_threads,
                    ..impinge_baseline::Settings::default()
                })?))
            }
            #[cfg(feature = "gpu")]
            Place::Gpu(adapter) => {
                use impinge_baseline::gpu;
                Ok(Box::new(gpu::UniformGrid::new(gpu::Settings {
                    lambda,
                    device: Some(adapter.name.clone()),
                    ..gpu::Settings::default()
                })?))
            }
            #[cfg(not(feature = "gpu"))]
            Place::Gpu(adapter) => Err(impinge::Error::NoAdapter {
                found: adapter.name.clone(),
            }
            .into()),
        }
    }
}

#[cfg(feature = "gpu")]
impl Finder for impinge_baseline::gpu::UniformGrid {
    fn find(
        &mut self,
        scene: &Scene,
        [a, b]: [BodyId; 2],
        _: &CancelToken,
        rows: &mut Vec<[u32; 4]>,
    ) -> Result<Found, Error> {
        let start = Instant::now();
        let outcome = self.detect(scene, a, b)?;
        Ok(Found::of(start, outcome.pairs, rows))
    }
}

impl Finder for Detector {
    fn find(
        &mut self,
        scene: &Scene,
        [a, b]: [BodyId; 2],
        cancel: &CancelToken,
        rows: &mut Vec<[u32; 4]>,
    ) -> Result<Found, Error> {
        let query = Query::between(a, b);
        self.set_control(Control::new().cancel(cancel));
        let start = Instant::now();
        let pairs = self.detect(scene, &query)?;
        Ok(Found::of(start, &pairs, rows))
    }
}

impl Finder for UniformGrid {
    fn find(
        &mut self,
        scene: &Scene,
        [a, b]: [BodyId; 2],
        _: &CancelToken,
        rows: &mut Vec<[u32; 4]>,
    ) -> Result<Found, Error> {
        let start = Instant::now();
        let outcome = self.detect(scene, a, b)?;
        Ok(Found::of(start, outcome.pairs, rows))
    }
}

impl Found {
    /// The times and counts of an answer whose search began at `start`. Stops the clock first.
    fn of(start: Instant, pairs: &Pairs, rows: &mut Vec<[u32; 4]>) -> Self {
        let ms = start.elapsed().as_secs_f64() * 1e3;
        rows.clear();
        rows.extend(pairs.rows());
        let stats = pairs.stats();
        let stages = stats.stages.iter();
        Found {
            ms,
            stages: stages.map(|stage| (stage.name, stage.ms)).collect(),
            n_cells: stats
                .grid
                .map_or(0, |grid| grid.into_iter().map(u64::from).product()),
            n_subdivided: stats.n_subdivided,
            n_entries: stats.n_entries,
            n_candidates: stats.n_candidates,
            n_unsure: stats.n_unsure,
            bytes_held: stats.bytes_held,
        }
    }
}
