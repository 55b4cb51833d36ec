//! The method `Clusters` on the CPU: groups fixed by topology, only their boxes move.
//!
//! ```text
//! bounds      boxes of the clusters of bodies that moved, and of the trees above them
//! dispatch    bodies whose boxes meet (more than two: a tree over bodies), then tree against tree
//! pairing     boxes of the primitives of clusters that take part; candidates a work item
//! narrow      filters, then exact arithmetic
//! ```
//!
//! This file keeps the caches; `slabs` runs the stages from `dispatch` on.
//!
//! Memory: what is cached a body, and a slab of work items. When that is full it is paired and settled,
//! and dispatch goes on.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use crate::error::Error;
use crate::grouping::bounds::RawBoundsArray;
use crate::grouping::clusters::Clustering;
use crate::scene::{Body, Positions};
use crate::settings::{InstructionSet, Recluster};
use crate::stats::Statistics;

use super::Job;
use super::bounds::{self, Summary, TreeBounds};
use super::dispatch::NodePair;
use super::pairing::{WorkItem, Worker};
use super::simd::{Isa, Simd, dispatch};
use super::slabs::{self, Slabs};
use super::top_level::TopLevel;
use super::workers::Workers;
use super::world::{BodyCache, Caches, STALE, World};

/// Nodes a task refits, of up to eight clusters each.
const REFIT_TASK: usize = 32;
/// Primitives of all bodies together from which on helpers are woken at a frame's begin.
const CALL_FROM: u64 = 30_000;
/// Primitives of all bodies together below which one thread finds the boxes. Positions have just been written,
/// mostly by one thread, and what fits in its cache another fetches from there more slowly than it reads it.
const PARALLEL_FROM: u64 = 120_000;

/// Caches and scratch of the method; kept from frame to frame.
pub(crate) struct Clusters {
    isa: Isa,
    caches: Caches,
    top: TopLevel,
    tasks: Vec<RefitTask>,
    /// What each task has found.
    found: Vec<Mutex<Summary>>,
    items: Vec<WorkItem>,
    scratches: Vec<Worker>,
    stack: Vec<NodePair>,
    body_stack: Vec<NodePair>,
}

#[derive(Debug, Clone, Copy)]
struct RefitTask {
    participant: u32,
    /// Nodes of level 1 with their clusters; clusters where there is one only.
    first: u32,
    end: u32,
    /// Where the body's boxes go; valid within the frame that made the task.
    leaves: RawBoundsArray,
    parents: Option<RawBoundsArray>,
}

impl Clusters {
    pub fn new(allowed: InstructionSet) -> Self {
        Clusters {
            isa: Isa::detect(allowed),
            caches: Vec::new(),
            top: TopLevel::default(),
            tasks: Vec::new(),
            found: Vec::new(),
            items: Vec::new(),
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
        self.scratches.resize_with(job.workers.n(), Worker::default);
        stats.time("clustering", |stats| self.cluster(job, stats))?;
        if job.frame.n_primitives() >= CALL_FROM {
            job.workers.call_all();
        }
        stats.time("bounds", |stats| self.refit(job, options, stats))?;
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, options.memory_budget.is_some());
        }
        let most_items = slabs::most_items(options.memory_budget, self.bytes() as u64)?;
        self.items.clear();
        self.items.shrink_to(most_items);
        let Clusters {
            isa,
            caches,
            top,
            items,
            scratches,
            stack,
            body_stack,
            ..
        } = self;
        let mut slabs = Slabs {
            isa: *isa,
            job,
            world: World {
                scene: job.scene,
                frame: job.frame,
                caches: Some(caches),
            },
            items,
            most_items,
            scratches,
            stats,
            ms: 0.0,
        };
        slabs.run(top, stack, body_stack)?;
        for worker in scratches.iter() {
            keys.extend_from_slice(&worker.settler.keys);
        }
        stats.bytes_held = (self.bytes() + size_of::<WorkItem>() * self.items.capacity()) as u64;
        Ok(())
    }

    fn bytes(&self) -> usize {
        let caches: usize = self
            .caches
            .iter()
            .flatten()
            .map(|cache| size_of::<BodyCache>() + cache.clustering.bytes() + cache.bounds.bytes())
            .sum();
        let scratches: usize = self.scratches.iter().map(Worker::bytes).sum();
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
        let isa = self.isa;
        for (ix, participant) in frame.participants.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = &mut self.caches[participant.id.index()];
            let known = cache
                .as_ref()
                .is_some_and(|cache| cache.topology_stamp == body.topology_stamp());
            if !known {
                control.step(ix as u64, frame.participants.len() as u64)?;
                let found = workers.install(body.n_primitives(), || BodyCache::new(body, isa));
                *cache = Some(Box::new(found));
                stats.n_clustered += 1;
            }
            let cache = cache.as_ref().expect("just clustered");
            stats.n_clusters += cache.clustering.n_clusters() as u64;
            if participant.within {
                cache.find_adjacency(workers);
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
            let covered = cache.clustering.n_vertices_covered == Some(body.n_vertices());
            if cache.positions_stamp == stamp {
                continue;
            }
            if !(covered && matches!(body.positions(), Positions::F32(_))) {
                frame.check_one(scene, ix)?;
            }
            let (n, leaves, parents) = match &mut cache.bounds.levels[..] {
                [] => continue,
                [leaves] => (1, leaves.raw(), None),
                [leaves, parents, ..] => (parents.len() as u32, leaves.raw(), Some(parents.raw())),
            };
            cache.surface = 0.0;
            let tasks = (0..n).step_by(REFIT_TASK).map(|first| RefitTask {
                participant: ix as u32,
                first,
                end: n.min(first + REFIT_TASK as u32),
                leaves,
                parents,
            });
            self.tasks.extend(tasks);
        }
        // Positions are mostly written in order: the last ones are in the nearest cache.
        self.tasks.reverse();
        self.refit_leaves(job);
        let mut all_finite = true;
        for (task, found) in self.tasks.iter().zip(&mut self.found) {
            let found = found.get_mut().unwrap_or_else(PoisonError::into_inner);
            all_finite &= found.all_finite;
            let slot = frame.participants[task.participant as usize].id.index();
            let cache = self.caches[slot].as_mut().expect("clustered");
            cache.surface += f64::from(found.surface);
        }
        if !all_finite {
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
            cache.bounds.refit_above(1, &cache.clustering.shape);
            let spread = cache.spread();
            if options.recluster == Recluster::Auto && spread > STALE * cache.best_spread {
                let (start, isa) = (Instant::now(), self.isa);
                **cache = workers.install(body.n_primitives(), || BodyCache::new(body, isa));
                if participant.within {
                    cache.find_adjacency(workers);
                }
                cache.refit_all(body);
                cache.positions_stamp = body.positions_stamp();
                stats.n_clustered += 1;
                stats.n_reclustered += 1;
                stats.add_ms("clustering", start.elapsed().as_secs_f64() * 1e3);
            } else {
                cache.best_spread = cache.best_spread.min(spread);
            }
        }
        Ok(())
    }

    /// Boxes of clusters and of the nodes above them.
    fn refit_leaves(&mut self, job: Job<'_>) {
        let Job {
            scene,
            frame,
            workers,
            ..
        } = job;
        let n_tasks = self.tasks.len();
        self.found
            .resize_with(n_tasks, || Mutex::new(Summary::EMPTY));
        let (isa, tasks, found) = (self.isa, &self.tasks, &self.found);
        let world = World {
            scene,
            frame,
            caches: Some(&self.caches),
        };
        let refit = |_: &mut Worker, ix: usize| {
            let summary = dispatch!(isa, leaves, (
                world: World<'_> = world,
                task: RefitTask = tasks[ix],
            ) -> Summary);
            *found[ix].lock().unwrap_or_else(PoisonError::into_inner) = summary;
        };
        let parallel = frame.n_primitives() >= PARALLEL_FROM;
        let n_workers = if parallel { workers.n() } else { 1 };
        workers.for_each(&mut self.scratches[..n_workers], n_tasks, refit);
    }
}

/// The boxes of one task's clusters and of the nodes above them.
#[inline(always)]
fn leaves<S: Simd>(simd: S, world: World<'_>, task: RefitTask) -> Summary {
    let positions = world.body(task.participant).positions;
    let clustering = &world.cache(task.participant).clustering;
    let mut summary = Summary::EMPTY;
    for node in task.first as usize..task.end as usize {
        let clusters = match task.parents {
            Some(_) => clustering.shape.children(1, node),
            None => node..node + 1,
        };
        // SAFETY: no two tasks name the same node of the same body, and nobody reads boxes before all
        // tasks are done.
        unsafe {
            let of_node = bounds::of_clusters(simd, positions, clustering, clusters, task.leaves);
            if let Some(parents) = task.parents {
                parents.put(node, &of_node.bounds);
            }
            summary.join(&of_node);
        }
    }
    summary
}

/// What the method is told.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Options {
    pub recluster: Recluster,
    pub memory_budget: Option<u64>,
}

impl BodyCache {
    /// Clusters a body in the pose at hand.
    pub fn new(body: &Body, isa: Isa) -> Self {
        let (elements, positions) = (body.elements(), body.positions());
        let clustering = Clustering::new(elements, |primitive| {
            bounds::of_vertices(positions, elements.corners(primitive))
        });
        if isa.looks_corners_up() {
            clustering.find_local_faces();
        }
        let mut bounds = TreeBounds::default();
        bounds.resize(&clustering.shape);
        BodyCache {
            topology_stamp: body.topology_stamp(),
            positions_stamp: 0,
            clustering,
            bounds,
            surface: 0.0,
            best_spread: f64::INFINITY,
        }
    }

    /// Who shares vertices with whom, found before workers ask for it. Going to the pool costs 0.1 ms, so not
    /// when it is known.
    fn find_adjacency(&self, workers: &Workers) {
        if !self.clustering.knows_adjacency() {
            let n_primitives = self.clustering.order.len();
            workers.install(n_primitives, || self.clustering.adjacency());
        }
    }

    /// All boxes, on this thread: those of clusters made anew are the best so far.
    fn refit_all(&mut self, body: &Body) {
        self.surface = 0.0;
        for cluster in 0..self.clustering.n_clusters() {
            let vertices = self.clustering.vertices(cluster);
            let bounds = bounds::of_vertices(body.positions(), vertices);
            self.surface += bounds.half_area();
            self.bounds.levels[0].put(cluster, &bounds);
        }
        self.bounds.refit_above(0, &self.clustering.shape);
        self.best_spread = self.spread();
    }

    /// The clusters' summed surface over the body's: how well the clusters fit the pose at hand.
    fn spread(&self) -> f64 {
        let whole = self.bounds.root().half_area();
        if whole > 0.0 && self.surface.is_finite() {
            self.surface / whole
        } else {
            1.0
        }
    }
}
