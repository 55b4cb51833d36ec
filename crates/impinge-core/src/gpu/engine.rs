//! The GPU backend of one detector: its method, its share of the memory, its buffers.
//!
//! [`passes`](super::passes) runs the passes of a frame.

use crate::workers::clock::Instant;
use std::sync::Arc;

use super::buffers::{Storage, count};
use super::cells::Guest;
use super::collect::Collector;
use super::device::Scopes;
use super::layout::Cell;
use super::open::GpuContext;
use super::pass_buffers::{Capacities, CellsWanted, PassBuffers, PassCounts};
use super::pieces;
use super::recording::{Launcher, Ran, Recording};
use super::topology::Most;
use super::view::{Asks, Motion};
use super::world::{DeviceWorld, ResidentEnds, weigh};
use crate::bvh::clusters::Clustering;
use crate::clusterings::Clusterings;
use crate::plan::Plan;
use crate::query::goal::Goal;
use crate::query::settings::{Backend, Method, Settings};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::PartIx;
use crate::search::runner::{Finder, Job};
use crate::search::sink::Answer;
use crate::search::stats::Stats;
use crate::search::undecided::Undecided;

/// The most cells, for any lambda.
const MOST_CELLS: u64 = 1 << 25;
/// The share of a memory budget that cells may have.
const SHARE_OF_CELLS: u64 = 8;

/// More bytes than the levels of trees take, and a list of no pairs.
const VIEWS: u64 = 1024;
/// The largest buffer that 32 bits can number: positions by words, slots with a flag.
const WIDEST: u64 = 1 << 34;

/// The GPU backend of one detector.
#[derive(Debug)]
pub struct Engine {
    pub(super) gpu: Arc<GpuContext>,
    pub(super) settings: Settings,
    /// The number of elements of the frame that was too large for `Cells`.
    too_much: Option<u64>,
    /// The most bytes of one buffer of topology or positions, if less than the device allows.
    pub most_bound: u64,
    /// Whether the device holds a piece of a frame, not a whole one.
    has_pieces: bool,
    clusterings: Clusterings,
    pub(super) world: DeviceWorld,
    /// The method of another crate that is run instead of `Cells`.
    pub(super) guest: Option<Guest>,
    /// What the question at hand writes, and what the other kind of question has written: the
    /// caller may still read that.
    pub lane: Lane,
    pub(super) other: Lane,
    /// The counts of each complete pass of the last question.
    pub complete: Vec<PassCounts>,
    /// Keys that each worker has decided, until they are appended to the answer.
    pub(super) decided: Vec<Vec<u64>>,
    /// Which contacts of a step the host seeks, and the least time by which some pair certainly
    /// touches, as far as passes have said.
    pub(super) sought: Goal,
    pub(super) touches_by: Option<f32>,
    /// What is asked of elements that may move.
    pub(super) asks: Asks,
    /// The stamp of the safe distances that were encoded last; 0 if there are none.
    pub(super) safe_stamp: u64,
    /// Runs truncations, whose parameters are apart from those of safe distances: one submission
    /// has both.
    pub(super) truncations: Launcher,
    /// Whether passes are run launch by launch too.
    pub is_traced: bool,
}

/// The buffers for the results of one kind of question, and its last pass.
#[derive(Debug)]
pub struct Lane {
    pub(super) motion: Motion,
    /// The method in use: `Clusters` for steps, and for frames that are too large for `Cells`.
    pub(super) method: Method,
    /// The room to begin with.
    pub(super) first: Capacities,
    pub(super) pass_buffers: PassBuffers,
    pub(super) launcher: Launcher,
    pub(super) collector: Collector,
    /// Whether the last pass was encoded for the caller, who has its results on the device.
    pub(super) is_encoded: bool,
    /// The last pass.
    pub recording: Recording,
    /// What came of its launches, if it was traced.
    pub ran: Vec<Ran>,
}

impl Lane {
    fn new(motion: Motion, method: Method, first: Capacities) -> Self {
        Lane {
            motion,
            method,
            first,
            pass_buffers: PassBuffers::new(),
            launcher: Launcher::default(),
            collector: Collector::default(),
            is_encoded: false,
            recording: Recording::default(),
            ran: Vec::new(),
        }
    }

    /// Lets go of all buffers that launches have bound.
    fn unbind(&mut self) {
        self.recording = Recording::default();
        self.launcher = Launcher::default();
    }
}

/// Takes what the device says about a part of a step. Returns whether more is wanted.
pub(crate) type TakeUndecided<'a> = dyn FnMut(Undecided<'_>) -> Result<bool, Error> + 'a;

/// Takes the results of complete passes.
pub(super) enum PassSink<'a, 'b> {
    /// Pairs that intersect.
    Answer(&'a Answer),
    /// Pairs of a step that may touch.
    Undecided(&'a mut TakeUndecided<'b>),
}

/// How a list of work ended.
#[derive(Debug)]
pub(super) enum PassesEnd {
    Complete,
    /// There is not enough room for work that cannot be split.
    Crowded(Error),
}

impl Engine {
    /// Creates an engine that shares clusterings. Of `Auto` it answers what `Clusters` are to
    /// answer.
    pub(crate) fn new(
        gpu: Arc<GpuContext>,
        settings: &Settings,
        clusterings: Clusterings,
        first: Capacities,
    ) -> Self {
        let settings = Settings {
            method: settings.method.in_the_long_run(),
            ..settings.clone()
        };
        Engine {
            clusterings,
            ..Engine::with_guest(gpu, settings, first, None)
        }
    }

    /// Creates an engine; with a method of another crate, if there is one, instead of `Cells`.
    pub fn with_guest(
        gpu: Arc<GpuContext>,
        settings: Settings,
        first: Capacities,
        guest: Option<Guest>,
    ) -> Self {
        // Counters are compared with the room that there is.
        let first = first.within(&gpu);
        Engine {
            gpu,
            lane: Lane::new(Motion::Still, settings.method, first),
            other: Lane::new(Motion::Moving, Method::Clusters, first),
            clusterings: Clusterings::new(&settings),
            settings,
            too_much: None,
            most_bound: u64::MAX,
            has_pieces: false,
            world: DeviceWorld::new(),
            guest,
            complete: Vec::new(),
            decided: Vec::new(),
            sought: Goal::All,
            touches_by: None,
            asks: Asks::default(),
            safe_stamp: 0,
            truncations: Launcher::default(),
            is_traced: false,
        }
    }

    /// Turns to a kind of question.
    pub(super) fn turn_to(&mut self, motion: Motion) {
        if self.lane.motion != motion {
            std::mem::swap(&mut self.lane, &mut self.other);
        }
        self.complete.clear();
        (self.sought, self.touches_by, self.asks) = (Goal::All, None, Asks::default());
    }

    pub fn gpu(&self) -> &Arc<GpuContext> {
        &self.gpu
    }

    /// Starts with new buffers after a device error: the old ones may be in any state.
    pub(super) fn begin_anew(&mut self) {
        let guest = self.guest.take().map(Guest::anew);
        let gpu = Arc::clone(&self.gpu);
        let first = self.lane.first;
        *self = Engine {
            most_bound: self.most_bound,
            is_traced: self.is_traced,
            clusterings: self.clusterings.clone(),
            ..Engine::with_guest(gpu, self.settings.clone(), first, guest)
        };
    }

    async fn answer(
        &mut self,
        job: Job<'_>,
        answer: &Answer,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Job { plan, .. } = job;
        self.gpu.check_lost()?;
        self.turn_to(Motion::Still);
        // The engine's own bytes are on the device.
        answer.share(0);
        if self.too_much.is_some_and(|n| plan.n_elements() < n) {
            self.too_much = None;
            self.take(self.settings.method);
        }
        let start = Instant::now();
        let clusterings = self.cluster(job, &[], stats)?;
        let clusterings = &clusterings[..];
        if !self.is_held(job, clusterings) && self.falls_back() {
            self.take_clusters(plan);
        }
        if !self.is_held(job, clusterings) && self.guest.is_none() {
            stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
            self.may_cut(job, clusterings)?;
            return self.in_pieces(job, clusterings, answer, stats).await;
        }
        self.send(job, clusterings, stats).await?;
        stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
        let before = self.falls_back().then(|| stats.clone());
        let work = Vec::from_iter(self.whole(plan));
        let outcome = self.work_off(job, PassSink::Answer(answer), work, stats);
        if let PassesEnd::Crowded(error) = outcome.await? {
            let Some(before) = before else {
                return Err(error);
            };
            // Drop the keys found so far: `Clusters` finds them again.
            answer.forget();
            let n_reruns = stats.n_batches + stats.n_reruns;
            *stats = before;
            stats.n_reruns = n_reruns;
            self.take_clusters(plan);
            if !self.is_held(job, clusterings) {
                return self.in_pieces(job, clusterings, answer, stats).await;
            }
            let work = Vec::from_iter(self.whole(plan));
            let outcome = self.work_off(job, PassSink::Answer(answer), work, stats);
            if let PassesEnd::Crowded(error) = outcome.await? {
                return Err(error);
            }
        }
        self.finish(stats);
        Ok(())
    }

    /// Hands over all pairs of a step that the device has not dropped, as far as they matter for
    /// what is sought. So times of contact come from the CPU alone. Returns false if the device, or
    /// the memory budget, cannot hold the step; then nothing has been handed over.
    ///
    /// # Errors
    /// Device errors, a budget too small for the smallest pass, cancellation, those of `take`.
    pub async fn find_undecided(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        (sought, take): (Goal, &mut TakeUndecided<'_>),
        stats: &mut Stats,
    ) -> Result<bool, Error> {
        let result = self
            .answer_step(job, clusterings, (sought, take), stats)
            .await;
        if let Err(Error::Gpu { .. }) = result {
            self.begin_anew();
        }
        result
    }

    async fn answer_step(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        (sought, take): (Goal, &mut TakeUndecided<'_>),
        stats: &mut Stats,
    ) -> Result<bool, Error> {
        self.gpu.check_lost()?;
        self.turn_to(Motion::Moving);
        self.sought = sought;
        let start = Instant::now();
        if !self.is_held(job, clusterings) {
            return Ok(false);
        }
        self.send(job, clusterings, stats).await?;
        let gpu = Arc::clone(&self.gpu);
        let scopes = Scopes::open(&gpu.device);
        let sent = self.send_rules(job.plan);
        let sent = sent.and_then(|()| self.ask_kept(job.scene, job.plan));
        let closed = scopes.close();
        closed.await?;
        match sent {
            // They are more than the device can bind.
            Err(Error::Gpu { .. }) => return Ok(false),
            sent => sent?,
        }
        stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
        let work = Vec::from_iter(self.whole(job.plan));
        let outcome = self.work_off(job, PassSink::Undecided(take), work, stats);
        match outcome.await? {
            PassesEnd::Complete => {
                stats.bytes_held += self.bytes();
                Ok(true)
            }
            PassesEnd::Crowded(error) => Err(error),
        }
    }

    /// The clusters of all bodies of a frame. The host does not know the pose of `resident` bodies,
    /// so it does not judge their clusters.
    pub(super) fn cluster(
        &mut self,
        job: Job<'_>,
        resident: &[BodyId],
        stats: &mut Stats,
    ) -> Result<Vec<Arc<Clustering>>, Error> {
        // Not judged in `Cells`, where clusters only show which elements are out of reach.
        let is_judged = self.lane.method == Method::Clusters;
        let judges = |id| is_judged && !resident.contains(&id);
        self.clusterings.of_frame(job, judges, stats)
    }

    /// Sends what has changed since the last question.
    async fn send(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.update_caught(job, clusterings, stats).await?;
        if self.first_capacities(self.cells_wanted(job.plan)).is_err() {
            // What is held for the other kind of question, or the buffers' spare room, exceeds the
            // budget.
            self.world.forget();
            if !self.other.is_encoded {
                self.other.pass_buffers = PassBuffers::new();
            }
            self.update_caught(job, clusterings, stats).await?;
        }
        Ok(())
    }

    /// Sends what has changed, and catches device errors.
    async fn update_caught(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let gpu = Arc::clone(&self.gpu);
        let scopes = Scopes::open(&gpu.device);
        let updated = self.update(job, clusterings, &ResidentEnds::default(), stats);
        let closed = scopes.close();
        updated?;
        closed.await
    }

    /// Sends what has changed since the last question, except positions that are on the device.
    pub(super) fn update(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        resident: &ResidentEnds<'_>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.has_pieces = false;
        let most = self.most();
        let of = (self.lane.motion, clusterings);
        if !self.world.is_seen(job, of) {
            // Buffers that are replaced should be free.
            self.lane.unbind();
            self.other.unbind();
        }
        self.world
            .update(&self.gpu, job, of, (resident, most), stats)
    }

    /// Answers the frame piece by piece, see [`pieces`].
    async fn in_pieces(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        answer: &Answer,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Job { scene, plan, .. } = job;
        if !self.has_pieces {
            // The buffers are sized for a whole frame.
            self.world.forget();
            self.has_pieces = true;
        }
        let most = self.most();
        // Two chunks per piece, and a quarter to spare in each buffer.
        let most = Most {
            binding: most.binding / 2,
            bytes: most.bytes / 4,
        };
        let n_clusters = clusterings.iter().map(|held| held.n_clusters());
        stats.n_clusters = n_clusters.map(count).sum();
        let clustering = |part: PartIx| &*clusterings[part.index()];
        let chunks = pieces::cut(job, most, clustering)?;
        for (ix, a) in chunks.iter().enumerate() {
            for b in &chunks[ix..] {
                let both = [a, b];
                let piece = if std::ptr::eq(a, b) {
                    &both[..1]
                } else {
                    &both
                };
                let pairs = pieces::meeting(plan, piece);
                if pairs.is_empty() {
                    continue;
                }
                let start = Instant::now();
                let scopes = Scopes::open(&self.gpu.device);
                let sent = self
                    .world
                    .send_piece(&self.gpu, scene, plan, piece, clustering);
                let closed = scopes.close();
                sent?;
                closed.await?;
                stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
                stats.n_pieces += 1;
                let work = self.seeds_in_batches(plan, &pairs);
                let outcome = self.work_off(job, PassSink::Answer(answer), work, stats);
                if let PassesEnd::Crowded(error) = outcome.await? {
                    return Err(error);
                }
            }
        }
        self.finish(stats);
        Ok(())
    }

    fn finish(&self, stats: &mut Stats) {
        if self.lane.method == Method::Clusters {
            stats.method = Method::Clusters.name();
        }
        stats.bytes_held = self.bytes();
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> u64 {
        self.bytes_of_world() + self.lane.pass_buffers.bytes() + self.other.pass_buffers.bytes()
    }

    /// Bytes of topology and positions on the device.
    pub fn bytes_of_world(&self) -> u64 {
        self.world.bytes()
    }

    /// The most topology and positions that may be on the device.
    pub(super) fn most(&self) -> Most {
        let least = Capacities::LEAST.of(self.lane.method).bytes();
        let budget = self.settings.memory_budget;
        Most {
            binding: self.most_bound.min(self.gpu.max_binding()).min(WIDEST),
            bytes: budget.map_or(u64::MAX, |budget| budget.saturating_sub(least)),
        }
    }

    /// Whether topology and positions of a whole frame, or step, fit the device and the budget.
    pub(super) fn is_held(&self, job: Job<'_>, clusterings: &[Arc<Clustering>]) -> bool {
        let cells = self.cells_wanted(job.plan);
        let cells = cells.map_or(0, |cells| cells.bytes());
        let most = self.most();
        let most = Most {
            bytes: most.bytes.saturating_sub(cells),
            ..most
        };
        weigh(job, self.lane.motion, clusterings).is_some_and(|weight| weight.fits(most))
    }

    /// Whether a frame that does not fit may be answered in pieces.
    ///
    /// # Errors
    /// The device binds less than the frame needs, and with `Backend::Auto` the CPU is to answer
    /// it.
    fn may_cut(&self, job: Job<'_>, clusterings: &[Arc<Clustering>]) -> Result<(), Error> {
        let weight = weigh(job, self.lane.motion, clusterings);
        let (needed, most) = (
            weight.map_or(u64::MAX, |weight| weight.binding()),
            self.most(),
        );
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
        self.lane.method == Method::Cells && self.guest.is_none()
    }

    /// Answers this frame, and later ones with at least as many elements, by `Clusters`.
    fn take_clusters(&mut self, plan: &Plan) {
        self.too_much = Some(plan.n_elements());
        self.take(Method::Clusters);
    }

    /// Switches to a built-in method.
    fn take(&mut self, method: Method) {
        self.lane.method = method;
        self.lane.pass_buffers = PassBuffers::new();
    }

    /// The part of the budget that is left for buffers that grow.
    pub(super) fn budget_for_buffers(&self) -> Option<u64> {
        let budget = self.settings.memory_budget;
        budget.map(|budget| budget.saturating_sub(self.bytes_besides()))
    }

    /// Bytes held besides buffers that grow.
    fn bytes_besides(&self) -> u64 {
        let other = self.other.pass_buffers.bytes();
        let own = &self.lane.pass_buffers;
        self.world.bytes() + other + own.bytes_of_cells() + own.bytes_of_elements()
    }

    /// Sets the room from the next frame on.
    pub(super) fn grow_to(&mut self, capacities: Capacities) {
        self.lane.first = capacities;
    }

    /// Room for the grid: as many cells as equation (1) can give.
    pub(super) fn cells_wanted(&self, plan: &Plan) -> Option<CellsWanted> {
        if self.lane.method != Method::Cells {
            return None;
        }
        let most = MOST_CELLS.min(Storage::<Cell>::limit(&self.gpu));
        let most = self.settings.memory_budget.map_or(most, |budget| {
            most.min(budget / SHARE_OF_CELLS / CellsWanted::CELL)
        });
        // Below 2^25, so the cast back is exact enough.
        let asked = (plan.n_elements() as f64 * self.settings.density).min(MOST_CELLS as f64);
        Some(CellsWanted {
            n_cells: (asked.ceil() as u64).min(most).max(1),
            n_bodies: count(plan.parts.len()).max(self.world.n_parts()),
        })
    }

    /// Room for the first pass: the present room, unless the budget allows less.
    pub(super) fn first_capacities(&self, cells: Option<CellsWanted>) -> Result<Capacities, Error> {
        let held = self.lane.pass_buffers.capacities();
        let wanted = self.lane.first.of(self.lane.method).max(held);
        let Some(budget) = self.settings.memory_budget else {
            return Ok(wanted);
        };
        let other = self.other.pass_buffers.bytes();
        let of_elements = self.lane.pass_buffers.bytes_of_elements();
        let cells = cells.map_or(0, |cells| cells.bytes());
        let fixed = self.world.bytes() + other + of_elements + cells;
        for wanted in [wanted, held.max(Capacities::LEAST)] {
            if fixed + wanted.bytes() <= budget {
                return Ok(wanted);
            }
        }
        let least = Capacities::LEAST.of(self.lane.method);
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

    /// The error about work that needs this much room, besides what is held.
    pub(super) fn too_small(&self, what: &'static str, needed: Capacities) -> Error {
        self.beyond(what, Some(self.bytes_besides() + needed.bytes()))
    }

    /// The error about a question whose topology and positions do not [fit](Engine::is_held): with
    /// all that its smallest pass has on the device, `of_elements` being what is known of each.
    pub(super) fn not_held(
        &self,
        what: &'static str,
        (job, clusterings): (Job<'_>, &[Arc<Clustering>]),
        of_elements: u64,
    ) -> Error {
        let of_elements = of_elements.max(self.lane.pass_buffers.bytes_of_elements());
        let least = Capacities::LEAST.of(self.lane.method).bytes();
        let besides = VIEWS + self.other.pass_buffers.bytes() + of_elements + least;
        let weight = weigh(job, self.lane.motion, clusterings);
        self.beyond(what, weight.map(|weight| weight.bytes() + besides))
    }

    /// The error about what needs so many bytes, or more than 32 bits number: of the budget, if it
    /// has fewer.
    fn beyond(&self, what: &'static str, needed: Option<u64>) -> Error {
        match (self.settings.memory_budget, needed) {
            (Some(budget), Some(needed)) if needed > budget => Error::MemoryBudget {
                what,
                needed,
                budget,
            },
            _ => Error::Gpu {
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
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let result = self.answer(job, answer, stats).await;
        if let Err(Error::Gpu { .. }) = result {
            self.begin_anew();
        }
        result
    }
}
