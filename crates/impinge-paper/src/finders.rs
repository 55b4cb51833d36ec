//! Whoever finds pairs: the library by each of its methods, and the peer of the paper.

use std::time::Instant;

use impinge::{Backend, CancelToken, Control, Detector, Query, Scene, Settings};

use crate::error::Error;
use crate::machine::Adapter;
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

    /// Settings of the library's detector here.
    pub fn settings(&self) -> Settings {
        match self {
            Place::Cpu { n_threads } => Settings {
                backend: Backend::Cpu,
                threads: *n_threads,
                ..Settings::default()
            },
            Place::Gpu(adapter) => Settings {
                backend: Backend::Gpu,
                device: Some(adapter.name.clone()),
                ..Settings::default()
            },
        }
    }
}

/// What is known of a frame besides its pairs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Found {
    pub ms: f64,
    pub stages: Vec<(&'static str, f64)>,
    pub n_cells: u64,
    pub n_subdivided: u64,
    pub n_candidates: u64,
    pub n_unsure: u64,
    pub bytes_held: u64,
}

/// Finds all pairs of a frame.
pub(crate) trait Finder {
    /// Finds pairs as things are in the scene now; `rows` takes their place, sorted, after the clock has
    /// stopped.
    fn find(
        &mut self,
        scene: &Scene,
        query: &Query,
        cancel: &CancelToken,
        rows: &mut Vec<[u32; 4]>,
    ) -> Result<Found, Error>;
}

/// A finder that has not been set up.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Setup {
    pub method: Method,
    pub place: Place,
    /// Of grids only.
    pub lambda: f64,
}

impl Setup {
    pub fn build(&self) -> Result<Box<dyn Finder>, Error> {
        let method = match self.method {
            Method::Cells => impinge::Method::Cells,
            Method::Clusters => impinge::Method::Clusters,
            Method::Fwzs11 => impinge::Method::Cells,
        };
        Ok(Box::new(Ours(Detector::with_settings(Settings {
            method,
            lambda: self.lambda,
            ..self.place.settings()
        })?)))
    }

    /// Whether the method has a λ.
    pub fn has_lambda(&self) -> bool {
        self.method != Method::Clusters
    }
}

/// The library.
struct Ours(Detector);

impl Finder for Ours {
    fn find(
        &mut self,
        scene: &Scene,
        query: &Query,
        cancel: &CancelToken,
        rows: &mut Vec<[u32; 4]>,
    ) -> Result<Found, Error> {
        let control = Control::new().cancel(cancel);
        let start = Instant::now();
        let pairs = self.0.detect_with(scene, query, &control)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        rows.clear();
        rows.extend(pairs.rows());
        let stats = pairs.stats();
        Ok(Found {
            ms,
            stages: stats
                .stages
                .iter()
                .map(|stage| (stage.name, stage.ms))
                .collect(),
            n_cells: stats
                .grid
                .map_or(0, |grid| grid.into_iter().map(u64::from).product()),
            n_subdivided: stats.n_subdivided,
            n_candidates: stats.n_candidates,
            n_unsure: stats.n_unsure,
            bytes_held: stats.bytes_held,
        })
    }
}
