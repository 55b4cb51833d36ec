//! The frame loop: resolves a query, picks method and backend, sorts the answer.

#[cfg(feature = "gpu")]
mod gpu;
mod steps;

use crate::clock::Instant;

use crate::cpu::Job;
use crate::cpu::cells::{self, Cells};
use crate::cpu::clusters::{self, Clusters};
use crate::cpu::workers::Workers;
use crate::error::Error;
use crate::frame::Frame;
use crate::naive;
use crate::narrow::Intersection;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::scene::Scene;
use crate::settings::{Backend, Method, Settings};

/// Finds intersecting pairs, frame after frame. Scratch memory lives here and is reused.
///
/// ```
/// use impinge::{Backend, Detector, Query, Scene};
/// # fn main() -> Result<(), impinge::Error> {
/// let mut scene = Scene::new();
/// let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let a = scene.add_triangles(&[[0, 1, 2]], &triangle)?;
/// let b = scene.add_triangles(&[[0, 1, 2]], &triangle.map(|[x, y, z]| [x, z + 0.25, y - 0.25]))?;
/// let mut detector = Detector::new(Backend::Cpu)?;
/// let pairs = detector.detect(&scene, &Query::between(a, b))?;
/// assert_eq!(pairs.between(a, b).collect::<Vec<_>>(), [(0, 0)]);
/// # Ok(()) }
/// ```
pub struct Detector {
    settings: Settings,
    frame: Frame,
    pairs: Pairs,
    workers: Workers,
    clusters: Clusters,
    cells: Cells,
    steps: steps::Steps,
    #[cfg(feature = "gpu")]
    gpu: Option<crate::gpu::Engine>,
}

impl Detector {
    /// A detector with the default method on the given backend.
    ///
    /// # Errors
    /// As [`with_settings`](Detector::with_settings).
    pub fn new(backend: Backend) -> Result<Self, Error> {
        Detector::with_settings(Settings {
            backend,
            ..Settings::default()
        })
    }

    /// A detector with everything said.
    ///
    /// # Errors
    /// A setting out of its range; no adapter for `Backend::Gpu`; threads that do not start.
    pub fn with_settings(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        #[cfg(feature = "gpu")]
        let gpu = gpu::open(&settings)?;
        Detector::assemble(
            settings,
            #[cfg(feature = "gpu")]
            gpu,
        )
    }

    /// [`with_settings`](Detector::with_settings) without blocking, for pages in a browser: there a GPU
    /// is opened in no other way.
    ///
    /// # Errors
    /// As `with_settings`.
    pub async fn with_settings_async(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        #[cfg(feature = "gpu")]
        let gpu = gpu::open_async(&settings).await?;
        Detector::assemble(
            settings,
            #[cfg(feature = "gpu")]
            gpu,
        )
    }

    fn assemble(
        settings: Settings,
        #[cfg(feature = "gpu")] gpu: Option<crate::gpu::Engine>,
    ) -> Result<Self, Error> {
        Ok(Detector {
            #[cfg(feature = "gpu")]
            gpu,
            workers: Workers::new(settings.threads)?,
            frame: Frame::default(),
            pairs: Pairs::default(),
            clusters: Clusters::new(settings.instruction_set),
            cells: Cells::new(settings.instruction_set),
            steps: steps::Steps::new(&settings),
            settings,
        })
    }

    /// What it was told.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// All pairs that the query asks for, as things are in the scene now.
    ///
    /// # Errors
    /// A stale id, refused positions, a memory budget too small for even one slab, a GPU failure.
    pub fn detect(&mut self, scene: &Scene, query: &Query) -> Result<&Pairs, Error> {
        self.detect_with(scene, query, &Control::new())
    }

    /// [`detect`](Detector::detect) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `detect`, and [`Error::Cancelled`].
    pub fn detect_with(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
    ) -> Result<&Pairs, Error> {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = self.gpu_in_use() {
            let result = gpu.block_on(self.detect_on_gpu(scene, query, control));
            if self.is_answered(result)? {
                return Ok(&self.pairs);
            }
        }
        let start = Instant::now();
        self.frame.resolve(scene, query)?;
        let _shift = self.workers.shift(self.frame.n_primitives());
        self.pairs.begin(&self.frame);
        let (keys, stats) = self.pairs.parts_mut();
        let settings = &self.settings;
        stats.method = settings.method.name();
        stats.n_threads = self.workers.n();
        stats.backend.push_str("cpu");
        let job = Job {
            scene,
            frame: &self.frame,
            workers: &self.workers,
            control,
        };
        match settings.method {
            Method::Naive => {
                self.frame.check(scene)?;
                stats.time("naive", |stats| {
                    naive::run(
                        &Intersection,
                        scene,
                        &self.frame,
                        control,
                        stats,
                        |_, key, ()| {
                            keys.push(key);
                        },
                    )
                })?;
            }
            Method::Cells => {
                self.frame.check(scene)?;
                let options = cells::Options {
                    lambda: settings.lambda,
                    group_size: settings.group_size,
                    memory_budget: settings.memory_budget,
                };
                self.cells.run(job, &options, &cells::Owner, keys, stats)?;
                stats.time("collect", |_| keys.sort_unstable());
            }
            Method::Clusters => {
                let options = clusters::Options {
                    recluster: settings.recluster,
                    memory_budget: settings.memory_budget,
                };
                self.clusters.run(job, &options, keys, stats)?;
                stats.time("collect", |_| keys.sort_unstable());
            }
        }
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(&self.pairs)
    }
}
