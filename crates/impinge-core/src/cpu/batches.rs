//! The stages of `Clusters` from `traversal` on: work items come in batches, and a full batch is
//! paired and decided before traversal goes on.

use std::sync::Arc;
use std::time::Duration;

use crate::bvh::hubs::Hubs;
use crate::plan::Plan;
use crate::query::SharedVertex;
use crate::query::progress::Pieces;
use crate::query::settings::Settings;
use crate::scene::error::Error;
use crate::scene::index::{ClusterIx, PartIx};
use crate::search::runner::Job;
use crate::search::sink::{Answer, Ending};
use crate::search::stats::Stats;
use crate::workers::clock::Instant;
use crate::workers::tuning::Tuning;

use super::lane_pairs::WorkItem;
use super::pairing::{self, Worker};
use super::top_level::TopLevel;
use super::traversal::{self, BodyTree, NodePair};
use super::world::World;
use crate::simd::{Isa, Simd, with_isa};

/// Work items per batch, unless the budget allows fewer.
const MOST_ITEMS: usize = 1 << 20;
/// The fewest work items with which a batch makes sense.
const FEWEST_ITEMS: usize = 256;
/// The fewest and the most work items per task. Neighbours in the batch are neighbours in space,
/// and a worker caches the boxes of the clusters it has just seen: long tasks find more of them
/// cached.
const TASK: std::ops::RangeInclusive<usize> = 16..=512;
/// Tasks per worker, so that no worker waits long for the last task.
const TASKS_EACH: usize = 12;

/// How many work items a batch may hold within the budget, if `held` bytes are held besides. An
/// eighth of the remaining bytes is for work items, the rest for the answer.
fn most_items(settings: &Settings, held: u64) -> Result<usize, Error> {
    let most = settings.tuning.most_batch_items.clamp(1, MOST_ITEMS);
    let Some(budget) = settings.memory_budget else {
        return Ok(most);
    };
    let each = size_of::<WorkItem>() as u64;
    let needed = held + each * FEWEST_ITEMS as u64;
    if needed > budget {
        return Err(Error::MemoryBudget {
            what: "clusters, their boxes and the smallest batch",
            needed,
            budget,
        });
    }
    let more = (budget - needed) / 8 / each;
    Ok((FEWEST_ITEMS as u64 + more).min(most as u64) as usize)
}

/// Where work items come from.
pub(crate) trait Traversed {
    /// The tree over the clusters of a part.
    fn tree(&self, part: PartIx) -> BodyTree<'_>;

    /// The hubs of a part: vertices that very many elements name.
    fn hubs(&self, part: PartIx) -> Option<&Hubs>;
}

/// Decides the work items that its trees give.
pub(crate) trait BatchStages: Traversed + Copy + Sync {
    /// The state of one worker.
    type Worker: Send;
    /// Where workers hand over the keys that they find.
    type Answer: Ending;

    /// Pairs the elements of some work items, and decides the candidates.
    fn pair<S: Simd>(self, simd: S, isa: Isa, items: &[WorkItem], worker: &mut Self::Worker);

    /// Lets a worker hand over the rest of its keys.
    fn end(worker: &mut Self::Worker, answer: Self::Answer);

    /// The counts of a worker.
    fn counts(worker: &Self::Worker) -> Counts;

    /// Called when all work items are decided, for the rest of the work.
    fn finish(
        &self,
        _: Job<'_>,
        _: Self::Answer,
        _: &mut [Self::Worker],
        _: &mut Stats,
    ) -> Result<(), Error> {
        Ok(())
    }

    /// Whether the answer is known, so that the remaining work items can be skipped.
    fn is_over(&self) -> bool {
        false
    }
}

/// The counts of one worker in a frame.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Counts {
    /// Time spent on candidates.
    pub busy: Duration,
    pub n_candidates: u64,
    pub n_unsure: u64,
    /// Clusters that took the place of others in the cache.
    pub n_evicted: u64,
    /// Times that there were enough candidates to decide them.
    pub n_full: u64,
    /// Times that less of a step was examined from then on.
    pub n_shortened: u64,
    /// Candidates that directions of elements told apart before `narrow`.
    pub n_parted: u64,
}

impl Counts {
    pub fn add_to(&self, stats: &mut Stats) {
        stats.n_candidates += self.n_candidates;
        stats.n_unsure += self.n_unsure;
        stats.ways.n_evicted += self.n_evicted;
        stats.ways.n_full += self.n_full;
        stats.ways.n_shortened += self.n_shortened;
        stats.ways.n_parted += self.n_parted;
    }
}

impl Traversed for World<'_> {
    fn tree(&self, part: PartIx) -> BodyTree<'_> {
        self.cache(part).tree()
    }

    fn hubs(&self, part: PartIx) -> Option<&Hubs> {
        self.cache(part).clustering.hubs()
    }
}

impl<'a> BatchStages for World<'a> {
    type Worker = Worker;
    type Answer = &'a Arc<Answer>;

    #[inline(always)]
    fn pair<S: Simd>(self, simd: S, isa: Isa, items: &[WorkItem], worker: &mut Worker) {
        pairing::run(simd, isa, self, items, worker);
    }

    /// Decides the pairs that share a hub, which `traversal` and `pairing` have skipped.
    fn finish(
        &self,
        job: Job<'_>,
        answer: Self::Answer,
        scratches: &mut [Worker],
        stats: &mut Stats,
    ) -> Result<(), Error> {
        if job.plan.shared_vertex != SharedVertex::Resolve {
            return Ok(());
        }
        for (ix, part) in job.plan.numbered_parts() {
            let Some(hubs) = self.hubs(ix).filter(|_| part.within) else {
                continue;
            };
            let start = Instant::now();
            let body = self.body(ix);
            let Worker {
                decider, around, ..
            } = &mut scratches[0];
            let n = hubs.n_to_decide();
            for (done, (shared, slots)) in hubs.to_decide().enumerate() {
                job.control.step(done as u64, n as u64)?;
                answer.check()?;
                around.decide(&body, hubs, shared, slots, decider);
            }
            stats.add_ms("hubs", start.elapsed().as_secs_f64() * 1e3);
        }
        Ok(())
    }

    fn end(worker: &mut Worker, _: Self::Answer) {
        worker.decider.end();
    }

    fn counts(worker: &Worker) -> Counts {
        let decider = &worker.decider;
        Counts {
            busy: decider.busy,
            n_candidates: decider.n_candidates,
            n_unsure: decider.n_unsure,
            n_evicted: worker.n_evicted(),
            n_full: decider.n_full,
            n_shortened: 0,
            n_parted: worker.n_parted(),
        }
    }
}

/// A frame to be answered from `traversal` on.
pub(crate) struct Task<'a, W: BatchStages> {
    pub isa: Isa,
    pub job: Job<'a>,
    pub answer: W::Answer,
    pub world: W,
    pub scratches: &'a mut [W::Worker],
    pub settings: &'a Settings,
    /// Bytes held besides the room.
    pub held: usize,
}

/// Memory of the stages from `traversal` on; kept from frame to frame.
#[derive(Default)]
pub(crate) struct BatchScratch {
    top: TopLevel,
    items: Vec<WorkItem>,
    stack: Vec<NodePair>,
    body_stack: Vec<NodePair>,
}

impl BatchScratch {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + size_of::<WorkItem>() * self.items.capacity()
    }

    /// Hands over all pairs that the frame asks for.
    pub fn run<W: BatchStages>(
        &mut self,
        task: Task<'_, W>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Task {
            answer, settings, ..
        } = task;
        let held = (task.held + self.top.bytes()) as u64;
        let most_items = answer.most_items(most_items(settings, held)?);
        let BatchScratch {
            top,
            items,
            stack,
            body_stack,
        } = self;
        items.clear();
        items.shrink_to(most_items);
        answer.share(held + (size_of::<WorkItem>() * most_items) as u64);
        answer.check()?;
        let mut batches = Batches {
            isa: task.isa,
            job: task.job,
            answer,
            world: task.world,
            tuning: &settings.tuning,
            items,
            most_items,
            scratches: task.scratches,
            stats,
            ms: 0.0,
        };
        batches.run(top, stack, body_stack)?;
        for worker in batches.scratches {
            W::end(worker, answer);
        }
        answer.check()
    }
}

struct Batches<'a, W: BatchStages> {
    isa: Isa,
    job: Job<'a>,
    answer: W::Answer,
    world: W,
    tuning: &'a Tuning,
    items: &'a mut Vec<WorkItem>,
    most_items: usize,
    scratches: &'a mut [W::Worker],
    stats: &'a mut Stats,
    /// Time spent on full batches.
    ms: f64,
}

impl<W: BatchStages> Batches<'_, W> {
    /// Finds all pairs that the frame asks for; the last ones stay with the workers.
    fn run(
        &mut self,
        top: &mut TopLevel,
        stack: &mut Vec<NodePair>,
        body_stack: &mut Vec<NodePair>,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let world = self.world;
        let frame = Frame {
            isa: self.isa,
            plan: self.job.plan,
            trees: &world,
            tuning: self.tuning,
        };
        let mut put = |item| self.put(item);
        with_isa!(frame.isa, all, (
            frame: Frame<'_> = frame,
            top: &mut TopLevel = top,
            stack: &mut Vec<NodePair> = stack,
            body_stack: &mut Vec<NodePair> = body_stack,
            put: Put<'_> = &mut put,
        ) -> Result<(), Error>)?;
        self.flush()?;
        let stats = &mut *self.stats;
        let total_ms = start.elapsed().as_secs_f64() * 1e3;
        stats.add_ms("traversal", total_ms - self.ms);
        self.world
            .finish(self.job, self.answer, self.scratches, self.stats)?;
        let stats = &mut *self.stats;
        let mut busy_ms = 0.0;
        for worker in &*self.scratches {
            let counts = W::counts(worker);
            busy_ms += counts.busy.as_secs_f64() * 1e3;
            counts.add_to(stats);
        }
        let narrow_ms = (busy_ms / self.scratches.len() as f64).min(self.ms);
        stats.add_ms("pairing", self.ms - narrow_ms);
        stats.add_ms("narrow", narrow_ms);
        Ok(())
    }

    fn put(&mut self, item: WorkItem) -> Result<(), Error> {
        if self.items.len() == self.most_items {
            self.flush()?;
        }
        if self.items.len() == self.items.capacity() {
            // Doubling must not exceed the limit.
            let (held, left) = (self.items.len(), self.most_items - self.items.len());
            let more = held.max(FEWEST_ITEMS).min(left);
            self.items.reserve_exact(more);
        }
        self.items.push(item);
        Ok(())
    }

    #[inline(never)]
    fn flush(&mut self) -> Result<(), Error> {
        let start = Instant::now();
        let (isa, world) = (self.isa, self.world);
        let (workers, answer) = (self.job.workers, self.answer);
        let items = &self.items[..];
        let n_workers = if items.len() < self.tuning.pairing_parallel_from {
            1
        } else {
            workers.n()
        };
        let task = (items.len() / (TASKS_EACH * n_workers)).clamp(*TASK.start(), *TASK.end());
        let task = workers.task(task);
        let n_tasks = items.len().div_ceil(task);
        let scratches = &mut self.scratches[..n_workers];
        let pieces = Pieces::new(self.job.control, n_tasks);
        workers.for_each(scratches, n_tasks, |worker, ix| {
            let is_over = answer.is_over() || world.is_over();
            if is_over || pieces.take().is_err() {
                return;
            }
            let items = &items[ix * task..items.len().min((ix + 1) * task)];
            with_isa!(isa, pair, <W: BatchStages> (
                world: W = world,
                isa: Isa = isa,
                items: &[WorkItem] = items,
                worker: &mut W::Worker = worker,
            ));
        });
        pieces.end()?;
        answer.check()?;
        self.stats.n_work_items += items.len() as u64;
        self.stats.n_batches += 1;
        self.items.clear();
        self.ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }
}

#[inline(always)]
fn pair<S: Simd, W: BatchStages>(
    simd: S,
    world: W,
    isa: Isa,
    items: &[WorkItem],
    worker: &mut W::Worker,
) {
    world.pair(simd, isa, items, worker);
}

/// What traversal reads. Nothing here knows who pairs, so that it is compiled once for all.
#[derive(Clone, Copy)]
struct Frame<'a> {
    isa: Isa,
    plan: &'a Plan,
    trees: &'a dyn Traversed,
    tuning: &'a Tuning,
}

/// Takes a work item.
type Put<'a> = &'a mut dyn FnMut(WorkItem) -> Result<(), Error>;

/// Runs traversal for every pair of parts and every single part that the frame asks for.
#[inline(always)]
fn all<S: Simd>(
    simd: S,
    frame: Frame<'_>,
    top: &mut TopLevel,
    stack: &mut Vec<NodePair>,
    body_stack: &mut Vec<NodePair>,
    put: Put<'_>,
) -> Result<(), Error> {
    let Frame {
        plan,
        trees,
        tuning,
        ..
    } = frame;
    if plan.between() && plan.parts.len() == 2 {
        let [a, b] = [0, 1].map(PartIx::new);
        if plan.test(a, b).is_some() {
            between_parts(frame, a, b, stack, put)?;
        }
    } else if plan.between() {
        top.refit(plan.parts.len(), tuning, |ix| trees.tree(ix).bounds.root());
        top.pairs(simd, body_stack, |a, b| {
            if plan.test(a, b).is_none() {
                return Ok(());
            }
            between_parts(frame, a, b, stack, put)
        })?;
    }
    for ix in plan.part_ixs() {
        if plan.test(ix, ix).is_some() {
            let (tree, hubs) = (trees.tree(ix), trees.hubs(ix));
            traversal::within(simd, tree, hubs, stack, |leaf_a, leaf_b| {
                // Adjacency masks are stored with the lower cluster.
                put(WorkItem {
                    a: ix,
                    b: ix,
                    cluster_a: ClusterIx::new(leaf_a.min(leaf_b)),
                    cluster_b: ClusterIx::new(leaf_a.max(leaf_b)),
                })
            })?;
        }
    }
    Ok(())
}

/// Compiled once, and separately: inside of closures the instruction set would be lost.
#[inline(never)]
fn between_parts(
    frame: Frame<'_>,
    a: PartIx,
    b: PartIx,
    stack: &mut Vec<NodePair>,
    put: Put<'_>,
) -> Result<(), Error> {
    with_isa!(frame.isa, between, (
        trees: &dyn Traversed = frame.trees,
        a: PartIx = a,
        b: PartIx = b,
        stack: &mut Vec<NodePair> = stack,
        put: Put<'_> = put,
    ) -> Result<(), Error>)
}

#[inline(always)]
fn between<S: Simd>(
    simd: S,
    trees: &dyn Traversed,
    a: PartIx,
    b: PartIx,
    stack: &mut Vec<NodePair>,
    put: Put<'_>,
) -> Result<(), Error> {
    let (tree_a, tree_b) = (trees.tree(a), trees.tree(b));
    traversal::between(simd, tree_a, tree_b, stack, |leaf_a, leaf_b| {
        put(WorkItem {
            a,
            b,
            cluster_a: ClusterIx::new(leaf_a),
            cluster_b: ClusterIx::new(leaf_b),
        })
    })
}
