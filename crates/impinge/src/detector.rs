//! The frame loop: resolves a query, picks method and backend, sorts the answer.

#[cfg(feature = "gpu")]
mod gpu;

use std::time::Instant;

use crate::cpu::Job;
use crate::cpu::cells::{self, Cells};
use crate::cpu::clusters::{self, Clusters};
use crate::cpu::workers::Workers;
use crate::error::Error;
use crate::frame::Frame;
use crate::naive;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::scene::Scene;

/// How candidates are found. All methods give the same pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Method {
    /// Groups fixed by topology; each frame only their boxes move. The fast one.
    #[default]
    Clusters,
    /// The two-level grid of the paper: groups are what a cell holds, made anew each frame.
    Cells,
    /// Every box against every box: the oracle, quadratic in primitives.
    Naive,
}

impl Method {
    /// `"clusters"`, `"cells"` or `"naive"`.
    pub fn name(self) -> &'static str {
        match self {
            Method::Clusters => "clusters",
            Method::Cells => "cells",
            Method::Naive => "naive",
        }
    }
}

/// Where the work is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Backend {
    /// A GPU where there is one in hardware, else the CPU; also when the GPU fails or the scene is
    /// more than it can hold.
    #[default]
    Auto,
    /// All cores, or as many threads as told.
    Cpu,
    /// A GPU; an error where there is none.
    Gpu,
}

/// Whether a body that has flowed far from the pose in which it was clustered is clustered anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Recluster {
    /// When the summed surface of its cluster boxes has grown enough for it to pay. A GPU judges by a sample of
    /// them, and only bodies whose positions are in the scene, not in a buffer of the caller's.
    #[default]
    Auto,
    /// Never: no frame ever pays for it. Boxes may grow and frames get slower.
    Never,
}

/// The widest vector instructions that the CPU backend may use, where the processor has them.
/// The pairs do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum InstructionSet {
    /// Plain loops, vectorised by the compiler for the target's baseline.
    Portable,
    /// 256 bits on x86-64.
    Avx2,
    /// 512 bits on x86-64.
    #[default]
    Avx512,
}

/// What a detector may be told.
#[derive(Debug, Clone)]
pub struct Settings {
    /// How candidates are found.
    pub method: Method,
    /// Where.
    pub backend: Backend,
    /// CPU threads; 0 means one a core.
    pub threads: usize,
    /// The widest vector instructions that the CPU backend may use.
    pub instruction_set: InstructionSet,
    /// `Cells`: the density coefficient λ of the paper's equation (1), above 0.
    pub lambda: f64,
    /// `Cells`: the most primitives a group may hold, 1 to 64.
    pub group_size: u32,
    /// Bytes the detector may hold besides the answer; `None` for as many as it takes.
    pub memory_budget: Option<u64>,
    /// `Clusters`: whether bodies are clustered again.
    pub recluster: Recluster,
    /// GPU: part of an adapter's name, to choose among several.
    pub device: Option<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            method: Method::default(),
            backend: Backend::default(),
            threads: 0,
            instruction_set: InstructionSet::default(),
            lambda: 1.0,
            group_size: 64,
            memory_budget: None,
            recluster: Recluster::default(),
            device: None,
        }
    }
}

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
        check(&settings)?;
        Ok(Detector {
            #[cfg(feature = "gpu")]
            gpu: gpu::open(&settings)?,
            workers: Workers::new(settings.threads)?,
            frame: Frame::default(),
            pairs: Pairs::default(),
            clusters: Clusters::new(settings.instruction_set),
            cells: Cells::new(settings.instruction_set),
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
                    naive::run(scene, &self.frame, control, keys, stats)
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

fn check(settings: &Settings) -> Result<(), Error> {
    let refuse = |setting, given: String, allowed| {
        Err(Error::Setting {
            setting,
            given,
            allowed,
        })
    };
    if !(settings.lambda.is_finite() && settings.lambda > 0.0) {
        return refuse("lambda", settings.lambda.to_string(), "a number above 0");
    }
    if !(1..=64).contains(&settings.group_size) {
        return refuse("group size", settings.group_size.to_string(), "1 to 64");
    }
    if settings.backend == Backend::Gpu {
        if !cfg!(feature = "gpu") {
            return Err(Error::NoAdapter {
                found: "impinge was built without its feature `gpu`".to_owned(),
            });
        }
        if settings.method == Method::Naive {
            let given = settings.method.name().to_owned();
            return refuse("method on a GPU", given, "clusters or cells");
        }
    }
    if settings.threads > 1024 {
        return refuse("threads", settings.threads.to_string(), "0 to 1024");
    }
    Ok(())
}
