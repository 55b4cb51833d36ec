//! The detector that users hold: one file per kind of question. Each makes a plan, picks what finds
//! its pairs, and has the loop (`run`) do the rest.

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
mod probe;
#[cfg(feature = "gpu")]
mod resident;
mod solver;
mod steps;
mod truncate;

#[cfg(feature = "gpu")]
pub use resident::Gpu;

use crate::answers::candidates::Candidates;
use crate::answers::closest::Closest;
use crate::answers::hits::Hits;
use crate::answers::home::Home;
use crate::answers::impacts::Impacts;
use crate::answers::near::NearPairs;
use crate::answers::neighbours::Neighbours;
use crate::answers::pairs::Pairs;
use crate::answers::safe::SafeDistances;
use crate::clusterings::Clusterings;
use crate::contact::Topologies;
use crate::cpu::Cpu;
use crate::proximity::Distances;
use crate::proximity::probe::Probes;
use crate::query::progress::Control;
use crate::query::settings::Settings;
use crate::scene::error::Error;
use crate::search::runner::Runner;
use crate::search::stats::Stats;
use crate::simd::Isa;

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
/// assert_eq!(pairs.between(a, b).collect::<Vec<_>>(), [[0, 0]]);
/// # Ok(()) }
/// ```
pub struct Detector {
    settings: Settings,
    runner: Runner,
    homes: Homes,
    control: Control,
    /// Of the last question.
    stats: Stats,
    /// Shared by all of the following.
    #[cfg(any(feature = "gpu", test))]
    pub(crate) clusterings: Clusterings,
    cpu: Cpu,
    steps: steps::StepMemory,
    solver: solver::SolverMemory,
    touching: distance::Touching,
    /// The last question whether any elements meet.
    any: Option<intersections::KeptPlan>,
    distances: Distances,
    topologies: Topologies,
    probes: Probes,
    #[cfg(feature = "gpu")]
    gpu: Option<crate::gpu::Engine>,
    /// Whether a GPU is still to be opened, when it first pays.
    #[cfg(feature = "gpu")]
    gpu_waits: bool,
    /// Of the last frame: whether a GPU pays for the next one.
    #[cfg(feature = "gpu")]
    n_candidates: u64,
}

impl std::fmt::Debug for Detector {
    /// Its settings: what else it holds is memory for the next question.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Detector");
        short.field("settings", &self.settings);
        short.finish_non_exhaustive()
    }
}

/// Where the buffers of dropped answers are. With a memory budget they are freed: they would count
/// twice.
struct Homes {
    pairs: Home<Pairs>,
    impacts: Home<Impacts>,
    candidates: Home<Candidates>,
    near: Home<NearPairs>,
    neighbours: Home<Neighbours>,
    safe: Home<SafeDistances>,
    closest: Home<Closest>,
    hits: Home<Hits>,
}

impl Homes {
    fn new(settings: &Settings) -> Self {
        let keeps = settings.memory_budget.is_none();
        Homes {
            pairs: Home::new(keeps),
            impacts: Home::new(keeps),
            candidates: Home::new(keeps),
            near: Home::new(keeps),
            neighbours: Home::new(keeps),
            safe: Home::new(keeps),
            closest: Home::new(keeps),
            hits: Home::new(keeps),
        }
    }
}

impl Detector {
    /// Creates a detector with explicit settings.
    ///
    /// # Errors
    /// A setting out of its range; no adapter for `Backend::Gpu`.
    pub fn new(settings: impl Into<Settings>) -> Result<Self, Error> {
        let settings = settings.into();
        settings.check()?;
        let clusterings = Clusterings::new(&settings);
        #[cfg(feature = "gpu")]
        let gpu = match gpu::may_wait(&settings) {
            true => None,
            false => gpu::open(&settings, &clusterings)?,
        };
        Ok(Detector::assemble(
            settings,
            clusterings,
            #[cfg(feature = "gpu")]
            gpu,
        ))
    }

    /// [`new`](Detector::new) without blocking. In a browser this is the only way to open a GPU.
    ///
    /// # Errors
    /// As `new`.
    pub async fn open(settings: Settings) -> Result<Self, Error> {
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
            gpu_waits: gpu.is_none() && gpu::may_wait(&settings),
            #[cfg(feature = "gpu")]
            gpu,
            #[cfg(feature = "gpu")]
            n_candidates: 0,
            runner: Runner::new(&settings),
            homes: Homes::new(&settings),
            control: Control::new(),
            stats: Stats::default(),
            cpu: Cpu::new(&settings, &clusterings),
            steps: steps::StepMemory::new(&settings, clusterings.clone()),
            solver: solver::SolverMemory::default(),
            any: None,
            touching: distance::Touching::default(),
            distances: Distances::new(&settings, clusterings.clone()),
            topologies: Topologies::default(),
            probes: Probes::new(Isa::detect(settings.instruction_set)),
            #[cfg(any(feature = "gpu", test))]
            clusterings,
            settings,
        }
    }

    /// The settings it was created with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// What all later questions heed: a token to stop them, a callback to watch them. Until it is
    /// called, there is none.
    ///
    /// A token that was cancelled stays so: set another control before the next question.
    pub fn set_control(&mut self, control: Control) {
        self.control = control;
    }

    /// How the last question was answered, whatever it was, and if it failed how far: stages,
    /// counts, bytes. Answers have their own, too: [`Pairs::stats`].
    pub fn stats(&self) -> &Stats {
        &self.stats
    }
}
