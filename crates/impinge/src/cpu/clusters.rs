//! The method `Clusters` on the CPU: groups fixed by topology, only their boxes move.
//!
//! ```text
//! bounds      boxes of the clusters of bodies that moved, and of the trees above them
//! dispatch    bodies whose boxes meet (more than two: a tree over bodies), then tree against tree
//! pairing     boxes of the primitives of clusters that take part; candidates a work item
//! narrow      filters, then exact arithmetic
//! ```
//!
//! Memory: what is cached a body, a box array a cluster that takes part, and the work items. The latter
//! two come in slabs: when one is full it is paired and settled, and dispatch goes on.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::detector::{InstructionSet, Recluster};
use crate::error::Error;
use crate::frame::Frame;
use crate::grouping::GROUP;
use crate::grouping::bounds::RawBoundsArray;
use crate::grouping::clusters::Clustering;
use crate::progress::Control;
use crate::scene::{Body, Positions};
use crate::stats::Statistics;

use super::Job;
use super::bounds::{self, TreeBounds};
use super::dispatch::{self, NodePair};
use super::narrow::Settler;
use super::pairing::{self, WorkItem};
use super::simd::{Isa, LaneBounds, Simd, dispatch};
use super::top_level::TopLevel;
use super::workers::Workers;
use super::world::{BodyCache, Caches, World};

/// Clusters that take part in one slab, at most, unless the budget says less.
const SLAB_CLUSTERS: usize = 1 << 16;
/// Work items of one slab.
const SLAB_ITEMS: usize = 1 << 20;
/// The least of both with which a slab makes sense.
const SMALLEST_SLAB: usize = 64;
/// Clusters a task refits.
const REFIT_TASK: usize = 256;
/// Clusters whose primitives' boxes a task finds.
const BOXES_TASK: usize = 32;
/// Work items a task pairs.
const PAIRING_TASK: usize = 32;
/// Primitives of all bodies together below which waking threads costs more than it saves.
const PARALLEL_FROM: u64 = 60_000;
/// How much the clusters' surface may grow against the body's before it is clustered again.
pub(super) const STALE: f64 = 1.5;

/// Caches and scratch of the method; kept from frame to frame.
pub(crate) struct Clusters {
    isa: Isa,
    caches: Caches,
    top: TopLevel,
    tasks: Vec<RefitTask>,
    slab: Slab,
    scratches: Vec<Settler>,
    stack: Vec<NodePair>,
    body_stack: Vec<NodePair>,
}

#[derive(Debug, Clone, Copy)]
struct RefitTask {
    participant: u32,
    first: u32,
    end: u32,
    /// Where the body's cluster boxes go; valid within the frame that made the task.
    leaves: RawBoundsArray,
}

impl Clusters {
    pub fn new(allowed: InstructionSet) -> Self {
        Clusters {
            isa: Isa::detect(allowed),
            caches: Vec::new(),
            top: TopLevel::default(),
            tasks: Vec::new(),
            slab: Slab::default(),
            scratches: Vec::new(),
            stack: Vec::new(),
            body_stack: Vec::new(),
        }
    }

    /// Appends the keys of all pairs that the frame asks for, unsorted.
    pub fn run(
        &mut self,
        job: Job<'_>,
        options: &Options,
        keys: &mut Vec<u64>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        self.scratches
            .resize_with(job.workers.n(), Settler::default);
        for scratch in &mut self.scratches {
            scratch.clear();
        }
        stats.time("clustering", |stats| self.cluster(job, stats))?;
        stats.time("bounds", |stats| self.refit(job, options, stats))?;
        self.slab.limit(options, self.bytes(), job.frame)?;
        let isa = self.isa;
        dispatch!(isa, detect, (
            engine: &mut Clusters = self,
            job: Job<'_> = job,
            keys: &mut Vec<u64> = keys,
            stats: &mut Statistics = stats,
        ) -> Result<(), Error>)?;
        stats.bytes_held = (self.bytes() + self.slab.bytes()) as u64;
        Ok(())
    }

    fn bytes(&self) -> usize {
        let caches: usize = self
            .caches
            .iter()
            .flatten()
            .map(|cache| size_of::<BodyCache>() + cache.clustering.bytes() + cache.bounds.bytes())
            .sum();
        let scratches: usize = self.scratches.iter().map(Settler::bytes).sum();
        caches + scratches + self.top.bytes()
    }

    /// Clusters bodies that are new or were re-meshed; forgets those that are gone.
    fn cluster(&mut self, job: Job<'_>, stats: &mut Statistics) -> Result<(), Error> {
        let Job {
            scene,
            frame,
            workers,
            control,
        } = job;
        let n_slots = frame
            .participants
            .last()
            .map_or(0, |last| last.id.index() + 1);
        if self.caches.len() < n_slots {
            self.caches.resize_with(n_slots, || None);
        }
        if self.caches.len() > scene.n_bodies() {
            for (slot, cache) in self.caches.iter_mut().enumerate() {
                let gone = !scene.holds(slot);
                if gone {
                    *cache = None;
                }
            }
        }
        for (ix, participant) in frame.participants.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = &mut self.caches[participant.id.index()];
            let known = cache
                .as_ref()
                .is_some_and(|cache| cache.topology_stamp == body.topology_stamp());
            if !known {
                control.step(ix as u64, frame.participants.len() as u64)?;
                *cache = Some(Box::new(workers.install(|| BodyCache::new(body))));
                stats.n_clustered += 1;
            }
            let cache = cache.as_ref().expect("just clustered");
            stats.n_clusters += cache.clustering.n_clusters() as u64;
            if participant.within {
                workers.install(|| cache.clustering.adjacency());
            }
        }
        Ok(())
    }

    /// Boxes of what has moved; clusters anew what has flowed away from its clusters.
    fn refit(
        &mut self,
        job: Job<'_>,
        options: &Options,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job {
            scene,
            frame,
            workers,
            ..
        } = job;
        self.tasks.clear();
        for (ix, participant) in frame.participants.iter().enumerate() {
            let body = frame.body(scene, ix);
            let stamp = body.positions_stamp();
            let cache = self.caches[participant.id.index()]
                .as_mut()
                .expect("clustered");
            let n = cache.clustering.n_clusters() as u32;
            let covered = cache.clustering.n_vertices_covered == Some(body.n_vertices());
            if cache.positions_stamp == stamp {
                continue;
            }
            if !(covered && matches!(body.positions(), Positions::F32(_))) {
                frame.check_one(scene, ix)?;
            }
            if n > 0 {
                let leaves = cache.bounds.levels[0].raw();
                let tasks = (0..n).step_by(REFIT_TASK).map(|first| RefitTask {
                    participant: ix as u32,
                    first,
                    end: n.min(first + REFIT_TASK as u32),
                    leaves,
                });
                self.tasks.extend(tasks);
            }
        }
        if !self.refit_leaves(job) {
            frame.check(scene)?;
        }
        for (ix, participant) in frame.participants.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = self.caches[participant.id.index()]
                .as_mut()
                .expect("clustered");
            if cache.positions_stamp == body.positions_stamp() {
                continue;
            }
            cache.positions_stamp = body.positions_stamp();
            cache.bounds.refit_above_leaves(&cache.clustering.shape);
            let spread = cache.spread();
            if options.recluster == Recluster::Auto && spread > STALE * cache.best_spread {
                let start = Instant::now();
                **cache = workers.install(|| BodyCache::new(body));
                if participant.within {
                    workers.install(|| cache.clustering.adjacency());
                }
                cache.refit_all(body);
                cache.positions_stamp = body.positions_stamp();
                cache.best_spread = cache.spread();
                stats.n_clustered += 1;
                stats.n_reclustered += 1;
                stats.add_ms("clustering", start.elapsed().as_secs_f64() * 1e3);
            } else {
                cache.best_spread = cache.best_spread.min(spread);
            }
        }
        Ok(())
    }

    /// Boxes of clusters; whether all positions that were looked at are certainly finite.
    fn refit_leaves(&mut self, job: Job<'_>) -> bool {
        let Job {
            scene,
            frame,
            workers,
            ..
        } = job;
        let (tasks, caches) = (&self.tasks, Some(&self.caches));
        let world = World {
            scene,
            frame,
            caches,
        };
        let all_finite = AtomicBool::new(true);
        let refit = |_: &mut Settler, ix: usize| {
            let task = tasks[ix];
            let body = world.body(task.participant);
            let clustering = &world.cache(task.participant).clustering;
            for cluster in task.first..task.end {
                let vertices = clustering.vertices(cluster as usize);
                let (bounds, finite) = match body.positions {
                    Positions::F32(positions) => bounds::of_vertices_f32(positions, vertices),
                    Positions::F64(_) => (bounds::of_vertices(body.positions, vertices), true),
                };
                if !finite {
                    all_finite.store(false, Ordering::Relaxed);
                }
                // SAFETY: no two tasks name the same cluster of the same body, and nobody reads
                // leaf boxes before all tasks are done.
                unsafe { task.leaves.put(cluster as usize, &bounds) };
            }
        };
        let parallel = frame.n_primitives() >= PARALLEL_FROM;
        let n_workers = if parallel { workers.n() } else { 1 };
        workers.for_each(&mut self.scratches[..n_workers], tasks.len(), refit);
        all_finite.into_inner()
    }
}

/// What the method is told.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Options {
    pub recluster: Recluster,
    pub memory_budget: Option<u64>,
}

impl BodyCache {
    /// Clusters a body in the pose at hand.
    pub fn new(body: &Body) -> Self {
        let (elements, positions) = (body.elements(), body.positions());
        let clustering = Clustering::new(elements, |primitive| {
            bounds::of_vertices(positions, elements.corners(primitive))
        });
        let mut bounds = TreeBounds::default();
        bounds.resize(&clustering.shape);
        BodyCache {
            topology_stamp: body.topology_stamp(),
            positions_stamp: 0,
            clustering,
            bounds,
            best_spread: f64::INFINITY,
        }
    }

    fn refit_all(&mut self, body: &Body) {
        for cluster in 0..self.clustering.n_clusters() {
            let vertices = self.clustering.vertices(cluster);
            let bounds = bounds::of_vertices(body.positions(), vertices);
            self.bounds.levels[0].put(cluster, &bounds);
        }
        self.bounds.refit_above_leaves(&self.clustering.shape);
    }

    /// The clusters' summed surface over the body's: how well the clusters fit the pose at hand.
    fn spread(&self) -> f64 {
        let Some(leaves) = self.bounds.levels.first() else {
            return 1.0;
        };
        let sum: f64 = (0..leaves.len()).map(|ix| leaves.at(ix).half_area()).sum();
        let whole = self.bounds.root().half_area();
        if whole > 0.0 && sum.is_finite() {
            sum / whole
        } else {
            1.0
        }
    }
}

/// Clusters that take part and the pairs of them, up to a limit.
#[derive(Default)]
struct Slab {
    items: Vec<WorkItem>,
    /// The box arrays of clusters that take part, and which they are.
    boxes: Vec<LaneBounds>,
    active: Vec<(u32, u32)>,
    /// For each cluster of all participants, its place in `active` plus one.
    slots: Vec<u32>,
    /// Where each participant's clusters start in `slots`.
    firsts: Vec<u32>,
    most_items: usize,
    most_active: usize,
}

impl Slab {
    fn bytes(&self) -> usize {
        size_of::<WorkItem>() * self.items.capacity()
            + size_of::<LaneBounds>() * self.boxes.capacity()
            + size_of::<(u32, u32)>() * self.active.capacity()
            + size_of::<u32>() * (self.slots.capacity() + self.firsts.capacity())
    }

    /// Sets how much a slab may hold so that all stays within the budget.
    fn limit(&mut self, options: &Options, bytes: usize, frame: &Frame) -> Result<(), Error> {
        (self.most_items, self.most_active) = (SLAB_ITEMS, SLAB_CLUSTERS);
        let Some(budget) = options.memory_budget else {
            return Ok(());
        };
        let n_clusters =
            frame.n_primitives().div_ceil(GROUP as u64) + frame.participants.len() as u64;
        let fixed = bytes as u64 + 8 * n_clusters + 4 * frame.participants.len() as u64;
        // What one cluster in a slab costs: its boxes, its place, and eight work items.
        let each = (size_of::<LaneBounds>() + 8 + 8 * size_of::<WorkItem>()) as u64;
        let needed = fixed + each * SMALLEST_SLAB as u64;
        if needed > budget {
            return Err(Error::MemoryBudget {
                what: "clusters, their boxes and the smallest slab",
                needed,
                budget,
            });
        }
        let n = ((budget - fixed) / each).min(SLAB_CLUSTERS as u64) as usize;
        (self.most_items, self.most_active) = (8 * n, n);
        // Larger slabs of earlier frames must not stay.
        if self.bytes() as u64 + bytes as u64 > budget {
            *self = Slab {
                most_items: self.most_items,
                most_active: self.most_active,
                ..Slab::default()
            };
        }
        self.items
            .reserve_exact(self.most_items.saturating_sub(self.items.len()));
        self.active
            .reserve_exact(self.most_active.saturating_sub(self.active.len()));
        Ok(())
    }

    fn begin(&mut self, world: World<'_>) {
        self.firsts.clear();
        let mut next = 0;
        for ix in 0..world.frame.participants.len() {
            self.firsts.push(next);
            next += world.cache(ix as u32).clustering.n_clusters() as u32;
        }
        self.slots.clear();
        self.slots.resize(next as usize, 0);
        self.items.clear();
        self.active.clear();
    }

    fn has_room(&self) -> bool {
        self.items.len() < self.most_items && self.active.len() + 2 <= self.most_active
    }

    #[inline(always)]
    fn slot(&mut self, participant: u32, cluster: u32) -> u32 {
        let ix = (self.firsts[participant as usize] + cluster) as usize;
        if self.slots[ix] == 0 {
            self.active.push((participant, cluster));
            self.slots[ix] = self.active.len() as u32;
        }
        self.slots[ix] - 1
    }

    #[inline(always)]
    fn push(&mut self, a: u32, b: u32, cluster_a: u32, cluster_b: u32) {
        let slot_a = self.slot(a, cluster_a);
        let slot_b = self.slot(b, cluster_b);
        self.items.push(WorkItem {
            a,
            b,
            cluster_a,
            cluster_b,
            slot_a,
            slot_b,
        });
    }

    fn clear(&mut self) {
        for &(participant, cluster) in &self.active {
            self.slots[(self.firsts[participant as usize] + cluster) as usize] = 0;
        }
        self.items.clear();
        self.active.clear();
    }
}

/// Dispatch, pairing and narrow, slab by slab.
#[inline(always)]
fn detect<S: Simd>(
    simd: S,
    engine: &mut Clusters,
    job: Job<'_>,
    keys: &mut Vec<u64>,
    stats: &mut Statistics,
) -> Result<(), Error> {
    let Job {
        scene,
        frame,
        workers,
        control,
    } = job;
    let Clusters {
        isa,
        caches,
        top,
        slab,
        scratches,
        stack,
        body_stack,
        ..
    } = engine;
    let world = World {
        scene,
        frame,
        caches: Some(caches),
    };
    let start = Instant::now();
    slab.begin(world);
    let mut flusher = Flusher {
        isa: *isa,
        world,
        workers,
        control,
        stats,
        slab,
        scratches,
        ms: 0.0,
    };
    if frame.between() {
        if frame.participants.len() == 2 {
            if frame.meets(0, 1) {
                clusters_between(simd, 0, 1, stack, &mut flusher)?;
            }
        } else {
            top.refit(frame.participants.len(), |ix| world.cache(ix).bounds.root());
            top.pairs(simd, body_stack, |a, b| {
                if !frame.meets(a as usize, b as usize) {
                    return Ok(());
                }
                // Compiled on its own: inside this closure the instruction set would be lost.
                dispatch!(flusher.isa, clusters_between, (
                    a: u32 = a,
                    b: u32 = b,
                    stack: &mut Vec<NodePair> = stack,
                    flusher: &mut Flusher<'_, '_> = &mut flusher,
                ) -> Result<(), Error>)
            })?;
        }
    }
    for (ix, participant) in frame.participants.iter().enumerate() {
        if participant.within {
            let ix = ix as u32;
            let tree = world.cache(ix).tree();
            dispatch::within(simd, tree, stack, |cluster_a, cluster_b| {
                // Adjacency masks are kept with the lower cluster.
                flusher.put(ix, ix, cluster_a.min(cluster_b), cluster_a.max(cluster_b))
            })?;
        }
    }
    flusher.flush()?;
    let flushed_ms = flusher.ms;
    let total_ms = start.elapsed().as_secs_f64() * 1e3;
    stats.add_ms("dispatch", total_ms - flushed_ms);
    let busy: f64 = scratches.iter().map(|s| s.busy.as_secs_f64() * 1e3).sum();
    let narrow_ms = (busy / workers.n() as f64).min(flushed_ms);
    stats.add_ms("pairing", flushed_ms - narrow_ms);
    stats.add_ms("narrow", narrow_ms);
    for scratch in scratches.iter() {
        keys.extend_from_slice(&scratch.keys);
        stats.n_candidates += scratch.n_candidates;
        stats.n_unsure += scratch.n_unsure;
    }
    Ok(())
}

#[inline(always)]
fn clusters_between<S: Simd>(
    simd: S,
    a: u32,
    b: u32,
    stack: &mut Vec<NodePair>,
    flusher: &mut Flusher<'_, '_>,
) -> Result<(), Error> {
    let (tree_a, tree_b) = (flusher.world.cache(a).tree(), flusher.world.cache(b).tree());
    dispatch::between(simd, tree_a, tree_b, stack, |cluster_a, cluster_b| {
        flusher.put(a, b, cluster_a, cluster_b)
    })
}

/// Takes work items; pairs and settles them whenever a slab is full.
struct Flusher<'a, 'b> {
    isa: Isa,
    world: World<'a>,
    workers: &'a Workers,
    control: &'a Control<'b>,
    stats: &'a mut Statistics,
    slab: &'a mut Slab,
    scratches: &'a mut [Settler],
    ms: f64,
}

impl Flusher<'_, '_> {
    #[inline(always)]
    fn put(&mut self, a: u32, b: u32, cluster_a: u32, cluster_b: u32) -> Result<(), Error> {
        if !self.slab.has_room() {
            self.flush()?;
        }
        self.slab.push(a, b, cluster_a, cluster_b);
        Ok(())
    }

    #[inline(never)]
    fn flush(&mut self) -> Result<(), Error> {
        let start = Instant::now();
        let (isa, world) = (self.isa, self.world);
        let Slab {
            items,
            boxes,
            active,
            ..
        } = &mut *self.slab;
        if boxes.len() < active.len() {
            boxes.reserve_exact(active.len() - boxes.len());
            boxes.resize(active.len(), LaneBounds::EMPTY);
        }
        let enough = items.len() >= 4 * PAIRING_TASK;
        let n_workers = if enough { self.workers.n() } else { 1 };
        let scratches = &mut self.scratches[..n_workers];
        let shared = SharedBoxes(boxes.as_mut_ptr());
        let n_tasks = active.len().div_ceil(BOXES_TASK);
        self.workers.for_each(scratches, n_tasks, |_, task| {
            let end = active.len().min((task + 1) * BOXES_TASK);
            let slots = task * BOXES_TASK..end;
            for (slot, &(participant, cluster)) in slots.clone().zip(&active[slots]) {
                let body = world.body(participant);
                // SAFETY: each slot below `active.len()` is written by one task.
                let lanes = unsafe { shared.at(slot) };
                let clustering = &world.cache(participant).clustering;
                bounds::of_cluster_primitives(body.positions, clustering, cluster as usize, lanes);
            }
        });
        let control = self.control;
        let (boxes, items) = (&boxes[..], &items[..]);
        let n_tasks = items.len().div_ceil(PAIRING_TASK);
        self.workers.for_each(scratches, n_tasks, |settler, task| {
            if control.step(task as u64, n_tasks as u64).is_err() {
                return;
            }
            let first = task * PAIRING_TASK;
            let items = &items[first..items.len().min(first + PAIRING_TASK)];
            dispatch!(isa, pairing::run, (
                world: World<'_> = world,
                items: &[WorkItem] = items,
                boxes: &[LaneBounds] = boxes,
                settler: &mut Settler = settler,
            ));
        });
        control.step(n_tasks as u64, n_tasks as u64)?;
        self.stats.n_work_items += items.len() as u64;
        self.stats.n_slabs += 1;
        self.slab.clear();
        self.ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }
}

/// Box arrays that several workers write, each its own slots.
struct SharedBoxes(*mut LaneBounds);

// SAFETY: `at` is the only access, and its contract keeps writes apart.
unsafe impl Sync for SharedBoxes {}

impl SharedBoxes {
    /// # Safety
    /// The slot must lie within the array, and nobody else may use it meanwhile.
    #[allow(clippy::mut_from_ref)]
    unsafe fn at(&self, slot: usize) -> &mut LaneBounds {
        // SAFETY: said above.
        unsafe { &mut *self.0.add(slot) }
    }
}
