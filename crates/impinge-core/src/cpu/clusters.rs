//! The method `Clusters` on the CPU: groups are fixed by topology, only their boxes move.
//!
//! ```text
//! bounds      boxes of the clusters of bodies that moved, and of the trees above them
//! dispatch    bodies whose boxes meet (more than two: a tree over bodies), then tree against tree
//! pairing     boxes of the primitives of clusters that take part; candidates per work item
//! narrow      filters, then exact arithmetic
//! ```
//!
//! This file keeps the caches; `slabs` runs the stages from `dispatch` on.
//!
//! Memory: a cache per body, and a slab of work items. A full slab is paired and settled, then dispatch
//! goes on.

use std::sync::Arc;

use crate::error::Error;
use crate::grouping::bounds::Bounds;
use crate::grouping::clusters::Clustering;
use crate::scene::Body;
use crate::settings::{InstructionSet, Settings};
use crate::stats::Statistics;

use super::bounds::{self, TreeBounds};
use super::dispatch::NodePair;
use super::met::WorkItem;
use super::pairing::Worker;
use super::refit::{Refit, SORTED_FROM};
use super::remote::Remote;
use super::simd::Isa;
use super::slabs::{self, Slabs};
use super::top_level::TopLevel;
use super::world::{BodyCache, Caches, World};
use crate::run::Job;
use crate::sink::Answer;
use crate::workers::Workers;

/// From this many primitives of all bodies on, helpers are woken at the beginning of a frame.
const CALL_FROM: u64 = 30_000;

/// Caches and scratch of the method; kept from frame to frame.
pub(crate) struct Clusters {
    isa: Isa,
    caches: Caches,
    top: TopLevel,
    refit: Refit,
    items: Vec<WorkItem>,
    scratches: Vec<Worker>,
    stack: Vec<NodePair>,
    body_stack: Vec<NodePair>,
}

impl Clusters {
    pub fn new(allowed: InstructionSet) -> Self {
        Clusters {
            isa: Isa::detect(allowed),
            caches: Vec::new(),
            top: TopLevel::default(),
            refit: Refit::default(),
            items: Vec::new(),
            scratches: Vec::new(),
            stack: Vec::new(),
            body_stack: Vec::new(),
        }
    }

    /// Hands over the keys of all pairs that the frame asks for.
    pub fn run(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        settings: &Settings,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        self.scratches.resize_with(job.workers.n(), Worker::default);
        stats.time("clustering", |stats| self.cluster(job, stats))?;
        if job.frame.n_primitives() >= CALL_FROM {
            job.workers.call_all();
        }
        stats.time("bounds", |stats| {
            let (caches, scratches) = (&mut self.caches, &mut self.scratches);
            self.refit
                .run(self.isa, job, settings, caches, scratches, stats)
        })?;
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, settings.memory_budget.is_some(), answer);
        }
        let held = self.bytes() as u64;
        let most_items = answer.most_items(slabs::most_items(settings.memory_budget, held)?);
        self.items.clear();
        self.items.shrink_to(most_items);
        answer.share(held + slabs::bytes(most_items));
        answer.check()?;
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
            answer,
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
        for worker in scratches.iter_mut() {
            worker.settler.end();
        }
        answer.check()?;
        stats.bytes_held = (self.bytes() + size_of::<WorkItem>() * self.items.capacity()) as u64;
        Ok(())
    }

    fn bytes(&self) -> usize {
        let caches: usize = self
            .caches
            .iter()
            .flatten()
            .map(|cache| {
                let remote = cache.remote.as_ref().map_or(0, |remote| remote.bytes());
                size_of::<BodyCache>() + cache.clustering.bytes() + cache.bounds.bytes() + remote
            })
            .sum();
        let scratches: usize = self.scratches.iter().map(Worker::bytes).sum();
        caches + scratches + self.top.bytes()
    }

    /// Clusters bodies that are new or were re-meshed; forgets removed bodies.
    fn cluster(&mut self, job: Job<'_>, stats: &mut Statistics) -> Result<(), Error> {
        let Job {
            scene,
            frame,
            workers,
            control,
        } = job;
        let n_slots = frame.layers.last().map_or(0, |last| last.id.index() + 1);
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
        for (ix, participant) in frame.layers.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = &mut self.caches[participant.id.index()];
            let known = cache
                .as_ref()
                .is_some_and(|cache| cache.topology_stamp == body.topology_stamp());
            if !known {
                control.step(ix as u64, frame.layers.len() as u64)?;
                let found = workers.install(body.n_primitives(), || BodyCache::new(body, isa))?;
                *cache = Some(Box::new(found));
                stats.n_clustered += 1;
            }
            let cache = cache.as_ref().expect("just clustered");
            stats.n_clusters += cache.clustering.n_clusters() as u64;
            if participant.within {
                cache.find_adjacency(workers)?;
            }
        }
        Ok(())
    }
}

impl BodyCache {
    /// Clusters a body in its current pose.
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
            whole: Bounds::EMPTY,
            remote: (body.n_primitives() >= SORTED_FROM).then(Box::default),
            surface: 0.0,
            best_spread: f64::INFINITY,
        }
    }

    /// Finds which primitives share vertices, before workers need it. Going to the pool costs 0.1 ms, so it is avoided
    /// when the adjacency is known.
    pub(super) fn find_adjacency(&self, workers: &Workers) -> Result<(), Error> {
        if !self.clustering.knows_adjacency() {
            let n_primitives = self.clustering.order.len();
            let find = || {
                self.clustering.adjacency();
            };
            workers.install(n_primitives, find)?;
        }
        Ok(())
    }

    /// Computes all boxes on this thread, for new clusters: their spread is the best so far.
    pub(super) fn refit_all(&mut self, body: &Body) {
        self.surface = 0.0;
        for cluster in 0..self.clustering.n_clusters() {
            let vertices = self.clustering.vertices(cluster);
            let bounds = bounds::of_vertices(body.positions(), vertices);
            self.surface += bounds.half_area();
            self.bounds.levels[0].put(cluster, &bounds);
        }
        self.bounds.refit_above(0, &self.clustering.shape);
        self.whole = self.bounds.root();
        self.best_spread = self.spread();
    }

    /// The remote clusters, if the clusters are sorted.
    #[inline(always)]
    pub(super) fn sorted(&self) -> Option<&Remote> {
        self.remote.as_deref().filter(|remote| remote.is_sorted())
    }

    /// [`unsort`](Self::unsort), because a frame needs boxes that were left out.
    pub(super) fn interrupt(&mut self) {
        if let Some(remote) = &mut self.remote {
            remote.interrupt();
        }
        self.unsort();
    }

    /// Ends the sorting; all boxes must be found again.
    pub(super) fn unsort(&mut self) {
        if self.remote.as_mut().is_some_and(|remote| remote.end()) {
            self.positions_stamp = 0;
        }
    }

    /// The clusters' summed surface divided by the body's: how well the clusters fit the current pose.
    pub(super) fn spread(&self) -> f64 {
        let whole = self.bounds.root().half_area();
        if whole > 0.0 && self.surface.is_finite() {
            self.surface / whole
        } else {
            1.0
        }
    }
}
