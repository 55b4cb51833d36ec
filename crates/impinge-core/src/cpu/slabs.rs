//! The stages of `Clusters` from `dispatch` on: work items come in slabs, and a full slab is paired and
//! settled before dispatch goes on.

use std::sync::Arc;
use std::time::Duration;

use crate::clock::Instant;
use crate::error::Error;
use crate::grouping::hubs::Hubs;
use crate::index::{ClusterIx, LayerIx};
use crate::query::SharedVertex;
use crate::run::Job;
use crate::settings::Settings;
use crate::sink::{Answer, Ending};
use crate::stats::Statistics;
use crate::tuning::Tuning;

use super::dispatch::{self, NodePair, Tree};
use super::met::WorkItem;
use super::pairing::{self, Worker};
use super::simd::{Isa, Simd, dispatch};
use super::top_level::TopLevel;
use super::world::World;

/// Work items per slab, unless the budget allows fewer.
const MOST_ITEMS: usize = 1 << 20;
/// The fewest work items with which a slab makes sense.
const FEWEST_ITEMS: usize = 256;
/// The fewest and the most work items per task. Neighbours in the slab are neighbours in space, and a
/// worker caches the boxes of the clusters it has just seen: long tasks find more of them cached.
const TASK: std::ops::RangeInclusive<usize> = 16..=512;
/// Tasks per worker, so that no worker waits long for the last task.
const TASKS_EACH: usize = 12;

/// How many work items a slab may hold within the budget, if `held` bytes are held besides. An eighth of the remaining
/// bytes is for work items, the rest for the answer.
fn most_items(settings: &Settings, held: u64) -> Result<usize, Error> {
    let most = settings.tuning.most_slab_items.clamp(1, MOST_ITEMS);
    let Some(budget) = settings.memory_budget else {
        return Ok(most);
    };
    let each = size_of::<WorkItem>() as u64;
    let needed = held + each * FEWEST_ITEMS as u64;
    if needed > budget {
        return Err(Error::MemoryBudget {
            what: "clusters, their boxes and the smallest slab",
            needed,
            budget,
        });
    }
    let more = (budget - needed) / 8 / each;
    Ok((FEWEST_ITEMS as u64 + more).min(most as u64) as usize)
}

/// Provides the trees from which work items come, and settles the work items.
pub(crate) trait SlabStages: Copy + Sync {
    /// The state of one worker.
    type Worker: Send;
    /// Where workers hand over the keys that they find.
    type Answer: Ending;

    /// The tree over the clusters of a layer.
    fn tree(&self, layer: LayerIx) -> Tree<'_>;

    /// Pairs the elements of some work items, and settles the candidates.
    fn pair<S: Simd>(self, simd: S, isa: Isa, items: &[WorkItem], worker: &mut Self::Worker);

    /// Lets a worker hand over the rest of its keys.
    fn end(worker: &mut Self::Worker, answer: Self::Answer);

    /// The counts of a worker.
    fn counts(worker: &Self::Worker) -> Counts;

    /// The hubs of a layer: vertices that very many elements name.
    fn hubs(&self, layer: LayerIx) -> Option<&Hubs>;

    /// Called when all work items are settled, for the rest of the work.
    fn finish(
        &self,
        _: Job<'_>,
        _: Self::Answer,
        _: &mut [Self::Worker],
        _: &mut Statistics,
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
    /// Times that there were enough candidates to settle them.
    pub n_full: u64,
    /// Times that less of a step was examined from then on.
    pub n_shortened: u64,
    /// Candidates that directions of elements told apart before `narrow`.
    pub n_parted: u64,
}

impl<'a> SlabStages for World<'a> {
    type Worker = Worker;
    type Answer = &'a Arc<Answer>;

    #[inline(always)]
    fn tree(&self, layer: LayerIx) -> Tree<'_> {
        self.cache(layer).tree()
    }

    #[inline(always)]
    fn pair<S: Simd>(self, simd: S, isa: Isa, items: &[WorkItem], worker: &mut Worker) {
        pairing::run(simd, isa, self, items, worker);
    }

    #[inline(always)]
    fn hubs(&self, layer: LayerIx) -> Option<&Hubs> {
        self.cache(layer).clustering.hubs()
    }

    /// Settles the pairs that share a hub, which `dispatch` and `pairing` have skipped.
    fn finish(
        &self,
        job: Job<'_>,
        answer: Self::Answer,
        scratches: &mut [Worker],
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        if job.frame.shared_vertex != SharedVertex::Resolve {
            return Ok(());
        }
        for (ix, layer) in job.frame.numbered_layers() {
            let Some(hubs) = SlabStages::hubs(self, ix).filter(|_| layer.within) else {
                continue;
            };
            let start = Instant::now();
            let body = self.body(ix);
            let Worker {
                settler, around, ..
            } = &mut scratches[0];
            let n = hubs.n_to_settle();
            for (done, (shared, places)) in hubs.to_settle().enumerate() {
                job.control.step(done as u64, n as u64)?;
                answer.check()?;
                around.settle(&body, hubs, shared, places, settler);
            }
            stats.add_ms("hubs", start.elapsed().as_secs_f64() * 1e3);
        }
        Ok(())
    }

    fn end(worker: &mut Worker, _: Self::Answer) {
        worker.settler.end();
    }

    fn counts(worker: &Worker) -> Counts {
        let settler = &worker.settler;
        Counts {
            busy: settler.busy,
            n_candidates: settler.n_candidates,
            n_unsure: settler.n_unsure,
            n_evicted: worker.n_evicted(),
            n_full: settler.n_full,
            n_shortened: 0,
            n_parted: worker.n_parted(),
        }
    }
}

/// A frame to be answered from `dispatch` on.
pub(crate) struct Task<'a, W: SlabStages> {
    pub isa: Isa,
    pub job: Job<'a>,
    pub answer: W::Answer,
    pub world: W,
    pub scratches: &'a mut [W::Worker],
    pub settings: &'a Settings,
    /// Bytes held besides the room.
    pub held: usize,
}

/// Memory of the stages from `dispatch` on; kept from frame to frame.
#[derive(Default)]
pub(crate) struct Room {
    top: TopLevel,
    items: Vec<WorkItem>,
    stack: Vec<NodePair>,
    body_stack: Vec<NodePair>,
}

impl Room {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + size_of::<WorkItem>() * self.items.capacity()
    }

    /// Hands over all pairs that the frame asks for.
    pub fn run<W: SlabStages>(
        &mut self,
        task: Task<'_, W>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Task {
            answer, settings, ..
        } = task;
        let held = (task.held + self.top.bytes()) as u64;
        let most_items = answer.most_items(most_items(settings, held)?);
        let Room {
            top,
            items,
            stack,
            body_stack,
        } = self;
        items.clear();
        items.shrink_to(most_items);
        answer.share(held + (size_of::<WorkItem>() * most_items) as u64);
        answer.check()?;
        let mut slabs = Slabs {
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
        slabs.run(top, stack, body_stack)?;
        for worker in slabs.scratches {
            W::end(worker, answer);
        }
        answer.check()
    }
}

struct Slabs<'a, W: SlabStages> {
    isa: Isa,
    job: Job<'a>,
    answer: W::Answer,
    world: W,
    tuning: &'a Tuning,
    items: &'a mut Vec<WorkItem>,
    most_items: usize,
    scratches: &'a mut [W::Worker],
    stats: &'a mut Statistics,
    /// Time spent on full slabs.
    ms: f64,
}

impl<W: SlabStages> Slabs<'_, W> {
    /// Finds all pairs that the frame asks for; the last ones stay with the workers.
    fn run(
        &mut self,
        top: &mut TopLevel,
        stack: &mut Vec<NodePair>,
        body_stack: &mut Vec<NodePair>,
    ) -> Result<(), Error> {
        let start = Instant::now();
        dispatch!(self.isa, all, <W: SlabStages> (
            slabs: &mut Slabs<'_, W> = self,
            top: &mut TopLevel = top,
            stack: &mut Vec<NodePair> = stack,
            body_stack: &mut Vec<NodePair> = body_stack,
        ) -> Result<(), Error>)?;
        self.flush()?;
        let stats = &mut *self.stats;
        let total_ms = start.elapsed().as_secs_f64() * 1e3;
        stats.add_ms("dispatch", total_ms - self.ms);
        self.world
            .finish(self.job, self.answer, self.scratches, self.stats)?;
        let stats = &mut *self.stats;
        let mut busy_ms = 0.0;
        for worker in &*self.scratches {
            let counts = W::counts(worker);
            busy_ms += counts.busy.as_secs_f64() * 1e3;
            stats.n_candidates += counts.n_candidates;
            stats.n_unsure += counts.n_unsure;
            stats.ways.n_evicted += counts.n_evicted;
            stats.ways.n_full += counts.n_full;
            stats.ways.n_shortened += counts.n_shortened;
            stats.ways.n_parted += counts.n_parted;
        }
        let narrow_ms = (busy_ms / self.scratches.len() as f64).min(self.ms);
        stats.add_ms("pairing", self.ms - narrow_ms);
        stats.add_ms("narrow", narrow_ms);
        Ok(())
    }

    #[inline(always)]
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
        let (isa, world, control) = (self.isa, self.world, self.job.control);
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
        workers.for_each(scratches, n_tasks, |worker, ix| {
            let is_over = answer.is_over() || world.is_over();
            if is_over || control.step(ix as u64, n_tasks as u64).is_err() {
                return;
            }
            let items = &items[ix * task..items.len().min((ix + 1) * task)];
            dispatch!(isa, pair, <W: SlabStages> (
                world: W = world,
                isa: Isa = isa,
                items: &[WorkItem] = items,
                worker: &mut W::Worker = worker,
            ));
        });
        control.step(n_tasks as u64, n_tasks as u64)?;
        answer.check()?;
        self.stats.n_work_items += items.len() as u64;
        self.stats.n_slabs += 1;
        self.items.clear();
        self.ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }
}

#[inline(always)]
fn pair<S: Simd, W: SlabStages>(
    simd: S,
    world: W,
    isa: Isa,
    items: &[WorkItem],
    worker: &mut W::Worker,
) {
    world.pair(simd, isa, items, worker);
}

/// Runs dispatch for every pair of layers and every single layer that the frame asks for.
#[inline(always)]
fn all<S: Simd, W: SlabStages>(
    simd: S,
    slabs: &mut Slabs<'_, W>,
    top: &mut TopLevel,
    stack: &mut Vec<NodePair>,
    body_stack: &mut Vec<NodePair>,
) -> Result<(), Error> {
    let (world, frame) = (slabs.world, slabs.job.frame);
    if frame.between() && frame.layers.len() == 2 {
        let [a, b] = [0, 1].map(LayerIx::new);
        if frame.test(a, b).is_some() {
            between(simd, a, b, stack, slabs)?;
        }
    } else if frame.between() {
        top.refit(frame.layers.len(), slabs.tuning, |ix| {
            world.tree(ix).bounds.root()
        });
        top.pairs(simd, body_stack, |a, b| {
            if frame.test(a, b).is_none() {
                return Ok(());
            }
            // Compiled separately: inside this closure the instruction set would be lost.
            dispatch!(slabs.isa, between, <W: SlabStages> (
                a: LayerIx = a,
                b: LayerIx = b,
                stack: &mut Vec<NodePair> = stack,
                slabs: &mut Slabs<'_, W> = slabs,
            ) -> Result<(), Error>)
        })?;
    }
    for ix in frame.layer_ixs() {
        if frame.test(ix, ix).is_some() {
            let (tree, hubs) = (world.tree(ix), world.hubs(ix));
            dispatch::within(simd, tree, hubs, stack, |leaf_a, leaf_b| {
                // Adjacency masks are stored with the lower cluster.
                slabs.put(WorkItem {
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

#[inline(always)]
fn between<S: Simd, W: SlabStages>(
    simd: S,
    a: LayerIx,
    b: LayerIx,
    stack: &mut Vec<NodePair>,
    slabs: &mut Slabs<'_, W>,
) -> Result<(), Error> {
    let world = slabs.world;
    let (tree_a, tree_b) = (world.tree(a), world.tree(b));
    dispatch::between(simd, tree_a, tree_b, stack, |leaf_a, leaf_b| {
        slabs.put(WorkItem {
            a,
            b,
            cluster_a: ClusterIx::new(leaf_a),
            cluster_b: ClusterIx::new(leaf_b),
        })
    })
}
