//! The GPU backend of one detector: its method, its share of the memory, its buffers.
//!
//! [`passes`](super::passes) runs the passes of a frame.

use crate::clock::Instant;
use std::sync::Arc;

use super::buffers::{Storage, count};
use super::cells::Guest;
use super::collect::Collector;
use super::device::Scopes;
use super::layout::Cell;
use super::open::Gpu;
use super::pieces;
use super::recording::{Launcher, Ran, Recording};
use super::room::{Capacities, CellsWanted, PassCounts, Room};
use super::topology::Most;
use super::world::World;
use crate::error::Error;
use crate::ids::BodyId;
use crate::plan::Plan as Frame;
use crate::run::{Finder, Job};
use crate::scene::Scene;
use crate::settings::{Backend, Method, Recluster, Settings};
use crate::sink::Answer;
use crate::sink::Goal;
use crate::stats::Statistics;
use crate::undecided::Left;

/// The most cells, for any lambda.
const MOST_CELLS: u64 = 1 << 25;
/// The share of a memory budget that cells may have.
const SHARE_OF_CELLS: u64 = 8;

/// The largest buffer that 32 bits can number: positions by words, places with a flag.
const WIDEST: u64 = 1 << 34;

/// The GPU backend of one detector.
#[derive(Debug)]
pub struct Engine {
    pub(super) gpu: Arc<Gpu>,
    pub(super) settings: Settings,
    pub(super) first: Capacities,
    /// The method in use: `Clusters` for frames that are too large for `Cells`.
    pub(super) method: Method,
    /// The number of primitives of the frame that was too large for `Cells`.
    too_much: Option<u64>,
    /// The most bytes of one buffer of topology or positions, if less than the device allows.
    pub most_bound: u64,
    /// Whether the device holds a piece of a frame, not a whole one.
    has_pieces: bool,
    /// Whether the last pass was encoded for the caller, who has its results on the device.
    pub(super) is_encoded: bool,
    pub(super) world: World,
    pub(super) room: Room,
    /// The method of another crate that is run instead of `Cells`.
    pub(super) guest: Option<Guest>,
    pub(super) launcher: Launcher,
    /// The last pass.
    pub recording: Recording,
    /// Whether passes are run launch by launch too, and what came of the last one.
    pub is_traced: bool,
    pub ran: Vec<Ran>,
    /// The counts of each complete pass of the last frame.
    pub complete: Vec<PassCounts>,
    pub(super) collector: Collector,
    /// Keys that each worker has settled, until they are appended to the answer.
    pub(super) settled: Vec<Vec<u64>>,
    /// Which contacts of a step the host seeks, and the least time by which some pair certainly touches, as far as passes have said.
    pub(super) sought: Goal,
    pub(super) touches_by: Option<f32>,
    /// The engine for steps, once there was one.
    pub of_steps: Option<Box<Engine>>,
}

/// Takes what the device says about a part of a step. Returns whether more is wanted.
pub(crate) type TakeLeft<'a> = dyn FnMut(Left<'_>) -> Result<bool, Error> + 'a;

/// Takes the results of complete passes.
pub(super) enum Taker<'a, 'b> {
    /// Pairs that intersect.
    Answer(&'a Answer),
    /// Pairs of a step that may touch.
    Left(&'a mut TakeLeft<'b>),
}

/// How a list of work ended.
#[derive(Debug)]
pub(super) enum Outcome {
    Complete,
    /// There is not enough room for work that cannot be split.
    Crowded(Error),
}

impl Engine {
    /// Creates an engine. Of `Auto` it answers what `Clusters` are to answer.
    pub fn new(gpu: Arc<Gpu>, settings: &Settings, first: Capacities) -> Self {
        let settings = Settings {
            method: settings.method.in_the_long_run(),
            ..settings.clone()
        };
        Engine::with_guest(gpu, settings, first, None)
    }

    /// Creates an engine; with a method of another crate, if there is one, instead of `Cells`.
    pub fn with_guest(
        gpu: Arc<Gpu>,
        settings: Settings,
        first: Capacities,
        guest: Option<Guest>,
    ) -> Self {
        Engine {
            gpu,
            first,
            method: settings.method,
            settings,
            too_much: None,
            most_bound: u64::MAX,
            has_pieces: false,
            is_encoded: false,
            world: World::new(),
            room: Room::new(),
            guest,
            launcher: Launcher::default(),
            recording: Recording::default(),
            is_traced: false,
            ran: Vec::new(),
            complete: Vec::new(),
            collector: Collector::default(),
            settled: Vec::new(),
            sought: Goal::All,
            touches_by: None,
            of_steps: None,
        }
    }

    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Starts with new buffers after a device error: the old ones may be in any state.
    pub(super) fn begin_anew(&mut self) {
        let guest = self.guest.take().map(Guest::anew);
        let gpu = Arc::clone(&self.gpu);
        *self = Engine {
            most_bound: self.most_bound,
            is_traced: self.is_traced,
            ..Engine::with_guest(gpu, self.settings.clone(), self.first, guest)
        };
    }

    async fn answer(
        &mut self,
        job: Job<'_>,
        answer: &Answer,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job { scene, frame, .. } = job;
        self.gpu.check_lost()?;
        // The engine's own bytes are on the device.
        answer.share(0);
        self.complete.clear();
        if self.too_much.is_some_and(|n| frame.n_primitives() < n) {
            self.too_much = None;
            self.take(self.settings.method);
        }
        let start = Instant::now();
        let recluster = self.reclusters();
        let clusterings = &mut self.world.clusterings;
        clusterings.update(job, &[], recluster, stats)?;
        if !self.is_held(scene, frame) && self.falls_back() {
            self.take_clusters(frame);
        }
        if !self.is_held(scene, frame) && self.guest.is_none() {
            stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
            self.may_cut(scene, frame)?;
            return self.in_pieces(job, answer, stats).await;
        }
        let scopes = Scopes::open(&self.gpu.device);
        let updated = self.update(job, &[], stats);
        let closed = scopes.close();
        updated?;
        closed.await?;
        if self.first_room(self.cells_wanted(frame)).is_err() {
            // The buffers' spare room exceeds the budget.
            self.world.forget_buffers();
            self.update(job, &[], stats)?;
        }
        stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
        let before = self.falls_back().then(|| stats.clone());
        let work = Vec::from_iter(self.whole(frame));
        let outcome = self.work_off(job, Taker::Answer(answer), work, stats);
        if let Outcome::Crowded(error) = outcome.await? {
            let Some(before) = before else {
                return Err(error);
            };
            // Drop the keys found so far: `Clusters` finds them again.
            answer.forget();
            let n_reruns = stats.n_slabs + stats.n_reruns;
            *stats = before;
            stats.n_reruns = n_reruns;
            self.take_clusters(frame);
            if !self.is_held(scene, frame) {
                return self.in_pieces(job, answer, stats).await;
            }
            let work = Vec::from_iter(self.whole(frame));
            let outcome = self.work_off(job, Taker::Answer(answer), work, stats);
            if let Outcome::Crowded(error) = outcome.await? {
                return Err(error);
            }
        }
        self.finish(stats);
        Ok(())
    }

    /// Answers the frame piece by piece, see [`pieces`].
    async fn in_pieces(
        &mut self,
        job: Job<'_>,
        answer: &Answer,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job { scene, frame, .. } = job;
        if !self.has_pieces {
            // The buffers are sized for a whole frame.
            self.world.forget_buffers();
            self.has_pieces = true;
        }
        let most = self.most();
        // Two chunks per piece, and a quarter to spare in each buffer.
        let most = Most {
            binding: most.binding / 2,
            bytes: most.bytes / 4,
        };
        let world = &self.world;
        stats.n_clusters = world.weigh(scene, frame).n_clusters;
        let clustering = |layer| world.clustering(frame, layer);
        let chunks = pieces::cut(job, most, clustering)?;
        for (ix, a) in chunks.iter().enumerate() {
            for b in &chunks[ix..] {
                let both = [a, b];
                let piece = if std::ptr::eq(a, b) {
                    &both[..1]
                } else {
                    &both
                };
                let pairs = pieces::meeting(frame, piece);
                if pairs.is_empty() {
                    continue;
                }
                let start = Instant::now();
                let scopes = Scopes::open(&self.gpu.device);
                let sent = self.world.send_piece(&self.gpu, scene, frame, piece);
                let closed = scopes.close();
                sent?;
                closed.await?;
                stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
                stats.n_pieces += 1;
                let work = self.seeds_in_batches(frame, &pairs);
                let outcome = self.work_off(job, Taker::Answer(answer), work, stats);
                if let Outcome::Crowded(error) = outcome.await? {
                    return Err(error);
                }
            }
        }
        self.finish(stats);
        Ok(())
    }

    fn finish(&self, stats: &mut Statistics) {
        if self.method == Method::Clusters {
            stats.method = Method::Clusters.name();
        }
        stats.bytes_held = self.bytes();
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> u64 {
        self.world.bytes() + self.room.bytes()
    }

    /// Whether bodies are clustered again. Not in `Cells`, where clusters only show which primitives are out of reach.
    fn reclusters(&self) -> bool {
        self.settings.recluster == Recluster::Auto && self.method == Method::Clusters
    }

    /// The most topology and positions that may be on the device.
    pub(super) fn most(&self) -> Most {
        let least = Capacities::LEAST.of(self.method).bytes();
        let budget = self.settings.memory_budget;
        Most {
            binding: self.most_bound.min(self.gpu.max_binding()).min(WIDEST),
            bytes: budget.map_or(u64::MAX, |budget| budget.saturating_sub(least)),
        }
    }

    /// Whether topology and positions of a whole frame fit the device and the budget.
    fn is_held(&self, scene: &Scene, frame: &Frame) -> bool {
        let cells = self.cells_wanted(frame).map_or(0, |cells| cells.bytes());
        let most = self.most();
        self.world.weigh(scene, frame).fits(Most {
            bytes: most.bytes.saturating_sub(cells),
            ..most
        })
    }

    /// Whether a frame that does not fit may be answered in pieces.
    ///
    /// # Errors
    /// The device binds less than the frame needs, and with `Backend::Auto` the CPU is to answer it.
    fn may_cut(&self, scene: &Scene, frame: &Frame) -> Result<(), Error> {
        let (needed, most) = (self.world.weigh(scene, frame).binding(), self.most());
        if self.settings.backend == Backend::Gpu || needed <= most.binding {
            return Ok(());
        }
        Err(Error::Gpu {
            what: format!(
                "{} binds at most {} bytes at once, but {needed} bytes are needed",
                self.gpu.name(),
                most.binding
            ),
        })
    }

    /// Whether `Clusters` may answer a frame that is too large for the method.
    fn falls_back(&self) -> bool {
        self.method == Method::Cells && self.guest.is_none()
    }

    /// Answers this frame, and later ones with at least as many primitives, by `Clusters`.
    fn take_clusters(&mut self, frame: &Frame) {
        self.too_much = Some(frame.n_primitives());
        self.take(Method::Clusters);
    }

    /// Switches to a built-in method.
    fn take(&mut self, method: Method) {
        self.method = method;
        self.room = Room::new();
    }

    /// Sends what has changed since the last frame, except the positions of `resident` bodies.
    pub(super) fn update(
        &mut self,
        job: Job<'_>,
        resident: &[BodyId],
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let recluster = self.reclusters();
        self.has_pieces = false;
        self.world
            .update(&self.gpu, job, resident, recluster, stats)
    }

    /// The part of the budget that is left for buffers that grow.
    pub(super) fn budget_for_room(&self) -> Option<u64> {
        let fixed = self.world.bytes() + self.room.bytes_of_cells();
        let budget = self.settings.memory_budget;
        budget.map(|budget| budget.saturating_sub(fixed))
    }

    /// Sets the room from the next frame on.
    pub(super) fn grow_to(&mut self, capacities: Capacities) {
        self.first = capacities;
    }

    /// Room for the grid: as many cells as equation (1) can give.
    pub(super) fn cells_wanted(&self, frame: &Frame) -> Option<CellsWanted> {
        if self.method != Method::Cells {
            return None;
        }
        let most = MOST_CELLS.min(Storage::<Cell>::limit(&self.gpu));
        let most = self.settings.memory_budget.map_or(most, |budget| {
            most.min(budget / SHARE_OF_CELLS / CellsWanted::CELL)
        });
        // Below 2^25, so the cast back is exact enough.
        let asked = (frame.n_primitives() as f64 * self.settings.lambda).min(MOST_CELLS as f64);
        Some(CellsWanted {
            n_cells: (asked.ceil() as u64).min(most).max(1),
            n_bodies: count(frame.layers.len()),
        })
    }

    /// Room for the first pass: the present room, unless the budget allows less.
    pub(super) fn first_room(&self, cells: Option<CellsWanted>) -> Result<Capacities, Error> {
        let wanted = self.first.of(self.method).max(self.room.capacities());
        let Some(budget) = self.settings.memory_budget else {
            return Ok(wanted);
        };
        let fixed = self.world.bytes() + cells.map_or(0, |cells| cells.bytes());
        let held = self.room.capacities();
        for wanted in [wanted, held.max(Capacities::LEAST)] {
            if fixed + wanted.bytes() <= budget {
                return Ok(wanted);
            }
        }
        let least = Capacities::LEAST.of(self.method);
        let needed = fixed + least.bytes();
        if needed > budget {
            return Err(Error::MemoryBudget {
                what: "positions, clusters and the smallest pass on the GPU",
                needed,
                budget,
            });
        }
        Ok(least)
    }

    pub(super) fn too_small(&self, what: &'static str, needed: Capacities) -> Error {
        match self.settings.memory_budget {
            Some(budget) => Error::MemoryBudget {
                what,
                needed: self.world.bytes() + needed.bytes(),
                budget,
            },
            None => Error::Gpu {
                what: format!("{} cannot hold {what}", self.gpu.name()),
            },
        }
    }
}

impl Finder for Engine {
    fn method(&self) -> &'static str {
        self.settings.method.name()
    }

    fn backend(&self) -> &str {
        self.gpu.name()
    }

    /// # Errors
    /// Device errors, a budget too small for the smallest pass, cancellation.
    async fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let result = self.answer(job, answer, stats).await;
        if let Err(Error::Gpu { .. }) = result {
            self.begin_anew();
        }
        result
    }
}
