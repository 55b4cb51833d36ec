//! The method `Clusters` on the CPU: groups are fixed by topology, only their boxes move.
//!
//! ```text
//! bounds      boxes of the clusters of bodies that moved, and of the trees above them
//! traversal    bodies whose boxes meet (more than two: a tree over bodies), then tree against tree
//! creases       under `SharedVertex::Resolve`: triangles that may meet a neighbour
//! pairing     boxes of the elements of clusters that take part; candidates per work item
//! narrow      filters, then exact arithmetic
//! ```
//!
//! This file keeps the caches; `batches` runs the stages from `traversal` on.
//!
//! Memory: a cache per body, and a batch of work items. A full batch is paired and decided, then
//! traversal goes on.

use std::sync::Arc;

use crate::boxes;
use crate::bvh::bounds::Aabb;
use crate::bvh::clusters::Clustering;
use crate::clusterings::{Clusterings, Fit, spread};
use crate::query::settings::{InstructionSet, Settings};
use crate::scene::elements::BodyKind;
use crate::scene::error::Error;
use crate::scene::positions::Positions;
use crate::scene::{Body, Scene};
use crate::search::stats::Stats;
use crate::workers::tuning::Tuning;

use super::batches::{self, BatchScratch};
use super::bounds::TreeBounds;
use super::culled::body::Culled;
use super::pairing::Worker;
use super::refit::Refit;
use super::world::{BodyCache, Caches, World};
use crate::search::runner::Job;
use crate::search::sink::Answer;
use crate::simd::Isa;
use crate::workers::Workers;

/// Caches and scratch of the method; kept from frame to frame.
pub(crate) struct Clusters {
    isa: Isa,
    clusterings: Clusterings,
    caches: Caches,
    refit: Refit,
    scratches: Vec<Worker>,
    scratch: BatchScratch,
}

impl Clusters {
    pub fn new(allowed: InstructionSet, clusterings: Clusterings) -> Self {
        Clusters {
            isa: Isa::detect(allowed),
            clusterings,
            caches: Caches::default(),
            refit: Refit::default(),
            scratches: Vec::new(),
            scratch: BatchScratch::default(),
        }
    }

    /// Hands over the keys of all pairs that the frame asks for.
    pub fn run(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        settings: &Settings,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.scratches.resize_with(job.workers.n(), Worker::default);
        stats.time("clustering", |stats| {
            self.cluster(job, &settings.tuning, stats)
        })?;
        if job.plan.n_elements() >= settings.tuning.call_from {
            job.workers.call_all();
        }
        stats.time("bounds", |stats| {
            let (caches, scratches) = (&mut self.caches, &mut self.scratches);
            let clustered = (&self.clusterings, caches);
            self.refit
                .run(self.isa, job, settings, clustered, scratches, stats)
        })?;
        if job.plan.resolves() && settings.memory_budget.is_none() {
            stats.time("creases", |_| self.find_creases(job))?;
        }
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, settings, answer);
        }
        let held = self.bytes_besides_scratch();
        let Clusters {
            caches,
            scratch,
            scratches,
            ..
        } = self;
        let task = batches::Task {
            isa: self.isa,
            job,
            answer,
            world: World {
                scene: job.scene,
                plan: job.plan,
                caches: Some(caches),
            },
            scratches,
            settings,
            held,
        };
        scratch.run(task, stats)?;
        stats.bytes_held = self.bytes();
        Ok(())
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (self.bytes_besides_scratch() + self.scratch.bytes()) as u64
    }

    fn bytes_besides_scratch(&self) -> usize {
        let scratches: usize = self.scratches.iter().map(Worker::bytes).sum();
        self.clusterings.bytes() + self.caches.bytes() + scratches
    }

    /// Forgets bodies that are gone or were re-meshed.
    pub fn forget_outdated(&mut self, scene: &Scene) {
        self.caches.forget_outdated(scene);
        self.clusterings.lock().forget_outdated(scene);
    }

    /// Clusters bodies that are new or were re-meshed; forgets removed bodies.
    fn cluster(&mut self, job: Job<'_>, tuning: &Tuning, stats: &mut Stats) -> Result<(), Error> {
        let shared = (&self.clusterings, self.isa.looks_corners_up());
        self.caches.update(job, shared, stats, |body, clustering| {
            BodyCache::new(body, Arc::clone(clustering), tuning)
        })?;
        let parts = job.plan.parts.iter();
        for part in parts.filter(|part| part.within) {
            self.caches.at(part).find_adjacency(job.workers)?;
        }
        Ok(())
    }
}

impl Clusters {
    /// Finds the triangles that may meet a neighbour, in bodies that are tested against themselves.
    fn find_creases(&mut self, job: Job<'_>) -> Result<(), Error> {
        for (ix, part) in job.plan.numbered_parts() {
            if part.within {
                let body = job.plan.body(job.scene, ix);
                let isa = self.isa;
                self.caches
                    .at_mut(part)
                    .find_creases(isa, body, job.workers)?;
            }
        }
        Ok(())
    }
}

impl BodyCache {
    /// What is kept beside the clusters of a body; no boxes yet.
    pub fn new(body: &Body, clustering: Arc<Clustering>, tuning: &Tuning) -> Self {
        let mut bounds = TreeBounds::default();
        bounds.resize(&clustering.shape);
        BodyCache {
            topology_stamp: body.topology_stamp(),
            positions_stamp: 0,
            clustering,
            bounds,
            whole: Aabb::EMPTY,
            creases: None,
            culled: (body.n_elements() >= tuning.culled_from)
                .then(|| Box::new(Culled::new(tuning))),
            surface: 0.0,
            fit: Fit::UNKNOWN,
        }
    }

    /// Finds which elements share vertices, before workers need it. Going to the pool costs 0.1
    /// ms, so it is avoided when the adjacency is known.
    pub(super) fn find_adjacency(&self, workers: &Workers) -> Result<(), Error> {
        if !self.clustering.knows_adjacency() {
            let n_elements = self.clustering.order.len();
            let find = || {
                self.clustering.adjacency();
            };
            workers.install(n_elements, find)?;
        }
        Ok(())
    }

    /// Finds the triangles that may meet a neighbour in the body's current pose.
    fn find_creases(&mut self, isa: Isa, body: &Body, workers: &Workers) -> Result<(), Error> {
        if body.kind() != BodyKind::Triangles {
            return Ok(());
        }
        let clustering = &self.clustering;
        if clustering.rings().is_none() {
            workers.install(clustering.order.len(), || clustering.find_rings())?;
        }
        let sweep = (body.positions(), body.positions_stamp());
        let creases = self.creases.get_or_insert_default();
        creases.find(isa, workers, clustering, sweep);
        Ok(())
    }

    /// Computes all boxes on this thread, for new clusters: their spread is the best so far.
    pub(super) fn refit_all(&mut self, body: &Body) {
        self.surface = 0.0;
        for cluster in self.clustering.clusters() {
            let vertices = self.clustering.vertices(cluster);
            let bounds = boxes::of_vertices(body.positions(), vertices);
            self.surface += bounds.half_area();
            self.bounds.levels[0].put(cluster.index(), &bounds);
        }
        self.bounds.refit_above(0, &self.clustering.shape);
        self.whole = self.bounds.root();
        self.fit.note(self.spread());
    }

    /// The culled clusters, if the clusters are sorted.
    #[inline(always)]
    pub(super) fn sorted(&self) -> Option<&Culled> {
        self.culled.as_deref().filter(|culled| culled.is_sorted())
    }

    /// Whether the positions can be read in memory order: they are in single precision, and the
    /// elements name every vertex.
    pub(super) fn can_be_read(&self, body: &Body) -> bool {
        let is_single = matches!(body.positions(), Positions::F32(_));
        is_single && self.clustering.n_vertices_covered == Some(body.n_vertices())
    }

    /// From now on, the boxes belong to no pose.
    pub(super) fn forget_boxes(&mut self) {
        self.positions_stamp = 0;
    }

    /// The clusters' summed surface divided by the body's: how well the clusters fit the current
    /// pose.
    pub(super) fn spread(&self) -> f64 {
        spread(self.surface, self.bounds.root().half_area())
    }
}
