//! The detector that users hold: one file per kind of question. Each makes a plan, picks what finds its pairs, and has the
//! loop (`run`) do the rest.

mod advance;
mod candidates;
mod contact;
mod distance;
#[cfg(feature = "gpu")]
mod gpu;
pub mod host;
mod in_step;
mod intersections;
mod near;
#[cfg(feature = "gpu")]
mod resident;
mod steps;

use crate::answers::pairs::Pairs;
use crate::clusterings::Clusterings;
use crate::contact::Topologies;
use crate::cpu::Cpu;
use crate::proximity::Distances;
use crate::query::settings::{Backend, Settings};
use crate::scene::error::Error;
use crate::search::runner::Runner;
use crate::search::stats::Statistics;

/// Finds intersecting pairs, frame after frame. Owns the scratch memory and reuses it.
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
    runner: Runner,
    pairs: Pairs,
    /// Of distances, contacts and runs of candidates.
    measured: Statistics,
    last: Last,
    /// Shared by all of the following.
    #[cfg(any(feature = "gpu", test))]
    pub(crate) clusterings: Clusterings,
    cpu: Cpu,
    steps: steps::StepMemory,
    touching: distance::Touching,
    distances: Distances,
    topologies: Topologies,
    #[cfg(feature = "gpu")]
    gpu: Option<crate::gpu::Engine>,
}

/// The kind of question that was asked last: its statistics are the detector's.
#[derive(Debug, Clone, Copy, Default)]
enum Last {
    #[default]
    Intersections,
    Contacts,
    Candidates,
    Near,
    Measured,
}

impl Detector {
    /// Creates a detector with the default method on the given backend.
    ///
    /// # Errors
    /// As [`with_settings`](Detector::with_settings).
    pub fn new(backend: Backend) -> Result<Self, Error> {
        Detector::with_settings(Settings {
            backend,
            ..Settings::default()
        })
    }

    /// Creates a detector with explicit settings.
    ///
    /// # Errors
    /// A setting out of its range; no adapter for `Backend::Gpu`.
    pub fn with_settings(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        let clusterings = Clusterings::new(&settings);
        #[cfg(feature = "gpu")]
        let gpu = gpu::open(&settings, &clusterings)?;
        Ok(Detector::assemble(
            settings,
            clusterings,
            #[cfg(feature = "gpu")]
            gpu,
        ))
    }

    /// [`with_settings`](Detector::with_settings) without blocking. In a browser this is the only way to open a GPU.
    ///
    /// # Errors
    /// As `with_settings`.
    pub async fn with_settings_async(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        let clusterings = Clusterings::new(&settings);
        #[cfg(feature = "gpu")]
        let gpu = gpu::open_async(&settings, &clusterings).await?;
        Ok(Detector::assemble(
            settings,
            clusterings,
            #[cfg(feature = "gpu")]
            gpu,
        ))
    }

    fn assemble(
        settings: Settings,
        clusterings: Clusterings,
        #[cfg(feature = "gpu")] gpu: Option<crate::gpu::Engine>,
    ) -> Self {
        Detector {
            #[cfg(feature = "gpu")]
            gpu,
            runner: Runner::new(&settings),
            pairs: Pairs::default(),
            measured: Statistics::default(),
            last: Last::default(),
            cpu: Cpu::new(&settings, &clusterings),
            steps: steps::StepMemory::new(&settings, clusterings.clone()),
            touching: distance::Touching::default(),
            distances: Distances::new(clusterings.clone()),
            topologies: Topologies::default(),
            #[cfg(any(feature = "gpu", test))]
            clusterings,
            settings,
        }
    }

    /// The settings it was created with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The pairs that [`detect`](Detector::detect) found last, out of the detector without a copy. Until the next
    /// frame it then holds none.
    pub fn take_pairs(&mut self) -> Pairs {
        std::mem::take(&mut self.pairs)
    }

    /// How the last question was answered, whatever it was: stages, counts, bytes. After [`detect`](Detector::detect) the same as
    /// [`Pairs::stats`], and there after [`count`](Detector::count) and [`any`](Detector::any) too. An answer that was
    /// moved out of the detector has its own.
    pub fn stats(&self) -> &Statistics {
        match self.last {
            Last::Intersections => self.pairs.stats(),
            Last::Contacts => self.steps.contacts.impacts.stats(),
            Last::Candidates => self.steps.candidates.stats(),
            Last::Near => self.steps.near.stats(),
            Last::Measured => &self.measured,
        }
    }
}
