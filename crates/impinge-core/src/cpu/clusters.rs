//! The method `Clusters` on the CPU: groups are fixed by topology, only their boxes move.
//!
//! ```text
//! bounds      boxes of the clusters of bodies that moved, and of the trees above them
//! dispatch    bodies whose boxes meet (more than two: a tree over bodies), then tree against tree
//! folds       under `SharedVertex::Resolve`: triangles that may meet a neighbour
//! pairing     boxes of the primitives of clusters that take part; candidates per work item
//! narrow      filters, then exact arithmetic
//! ```
//!
//! This file keeps the caches; `slabs` runs the stages from `dispatch` on.
//!
//! Memory: a cache per body, and a slab of work items. A full slab is paired and settled, then dispatch
//! goes on.

use std::sync::Arc;

use crate::clusterings::{Clusterings, Fit, spread};
use crate::elements::Kind;
use crate::error::Error;
use crate::grouping::bounds::Bounds;
use crate::grouping::clusters::Clustering;
use crate::hull;
use crate::positions::Positions;
use crate::scene::{Body, Scene};
use crate::settings::{InstructionSet, Settings};
use crate::stats::Statistics;
use crate::tuning::Tuning;

use super::bounds::TreeBounds;
use super::pairing::Worker;
use super::refit::Refit;
use super::remote::body::Remote;
use super::simd::Isa;
use super::slabs::{self, Room};
use super::world::{BodyCache, Caches, World};
use crate::run::Job;
use crate::sink::Answer;
use crate::workers::Workers;

/// Caches and scratch of the method; kept from frame to frame.
pub(crate) struct Clusters {
    isa: Isa,
    clusterings: Clusterings,
    caches: Caches,
    refit: Refit,
    scratches: Vec<Worker>,
    room: Room,
}

impl Clusters {
    pub fn new(allowed: InstructionSet, clusterings: Clusterings) -> Self {
        Clusters {
            isa: Isa::detect(allowed),
            clusterings,
            caches: Caches::default(),
            refit: Refit::default(),
            scratches: Vec::new(),
            room: Room::default(),
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
        stats.time("clustering", |stats| {
            self.cluster(job, &settings.tuning, stats)
        })?;
        if job.frame.n_primitives() >= settings.tuning.call_from {
            job.workers.call_all();
        }
        stats.time("bounds", |stats| {
            let (caches, scratches) = (&mut self.caches, &mut self.scratches);
            let clustered = (&self.clusterings, caches);
            self.refit
                .run(self.isa, job, settings, clustered, scratches, stats)
        })?;
        if job.frame.resolves() && settings.memory_budget.is_none() {
            stats.time("folds", |_| self.find_folds(job))?;
        }
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, settings, answer);
        }
        let held = self.bytes_besides_room();
        let Clusters {
            caches,
            room,
            scratches,
            ..
        } = self;
        let task = slabs::Task {
            isa: self.isa,
            job,
            answer,
            world: World {
                scene: job.scene,
                frame: job.frame,
                caches: Some(caches),
            },
            scratches,
            settings,
            held,
        };
        room.run(task, stats)?;
        stats.bytes_held = self.bytes();
        Ok(())
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (self.bytes_besides_room() + self.room.bytes()) as u64
    }

    fn bytes_besides_room(&self) -> usize {
        let caches: usize = self
            .caches
            .iter()
            .map(|cache| {
                let remote = cache.remote.as_ref().map_or(0, |remote| remote.bytes());
                let folds = cache.folds.as_ref().map_or(0, |folds| folds.bytes());
                size_of::<BodyCache>() + cache.bounds.bytes() + remote + folds
            })
            .sum();
        let scratches: usize = self.scratches.iter().map(Worker::bytes).sum();
        self.clusterings.bytes() + caches + scratches
    }

    /// Forgets bodies that are gone or were re-meshed.
    pub fn forget_outdated(&mut self, scene: &Scene) {
        self.caches.forget_outdated(scene);
        self.clusterings.lock().forget_outdated(scene);
    }

    /// Clusters bodies that are new or were re-meshed; forgets removed bodies.
    fn cluster(
        &mut self,
        job: Job<'_>,
        tuning: &Tuning,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let shared = (&self.clusterings, self.isa.looks_corners_up());
        self.caches.update(job, shared, stats, |body, clustering| {
            BodyCache::new(body, Arc::clone(clustering), tuning)
        })?;
        let layers = job.frame.layers.iter();
        for layer in layers.filter(|layer| layer.within) {
            self.caches.at(layer).find_adjacency(job.workers)?;
        }
        Ok(())
    }
}

impl Clusters {
    /// Finds the triangles that may meet a neighbour, in bodies that are tested against themselves.
    fn find_folds(&mut self, job: Job<'_>) -> Result<(), Error> {
        for (ix, layer) in job.frame.numbered_layers() {
            if layer.within {
                let body = job.frame.body(job.scene, ix);
                let isa = self.isa;
                self.caches
                    .at_mut(layer)
                    .find_folds(isa, body, job.workers)?;
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
            whole: Bounds::EMPTY,
            folds: None,
            remote: (body.n_primitives() >= tuning.remote_from)
                .then(|| Box::new(Remote::new(tuning))),
            surface: 0.0,
            fit: Fit::UNKNOWN,
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

    /// Finds the triangles that may meet a neighbour in the body's current pose.
    fn find_folds(&mut self, isa: Isa, body: &Body, workers: &Workers) -> Result<(), Error> {
        if body.kind() != Kind::Triangles {
            return Ok(());
        }
        let clustering = &self.clustering;
        if clustering.rings().is_none() {
            workers.install(clustering.order.len(), || clustering.find_rings())?;
        }
        let pose = (body.positions(), body.positions_stamp());
        let folds = self.folds.get_or_insert_default();
        folds.find(isa, workers, clustering, pose);
        Ok(())
    }

    /// Computes all boxes on this thread, for new clusters: their spread is the best so far.
    pub(super) fn refit_all(&mut self, body: &Body) {
        self.surface = 0.0;
        for cluster in self.clustering.clusters() {
            let vertices = self.clustering.vertices(cluster);
            let bounds = hull::of_vertices(body.positions(), vertices);
            self.surface += bounds.half_area();
            self.bounds.levels[0].put(cluster.index(), &bounds);
        }
        self.bounds.refit_above(0, &self.clustering.shape);
        self.whole = self.bounds.root();
        self.fit.note(self.spread());
    }

    /// The remote clusters, if the clusters are sorted.
    #[inline(always)]
    pub(super) fn sorted(&self) -> Option<&Remote> {
        self.remote.as_deref().filter(|remote| remote.is_sorted())
    }

    /// Whether the positions can be read in memory order: they are in single precision, and the primitives name every
    /// vertex.
    pub(super) fn can_be_read(&self, body: &Body) -> bool {
        let is_single = matches!(body.positions(), Positions::F32(_));
        is_single && self.clustering.n_vertices_covered == Some(body.n_vertices())
    }

    /// From now on, the boxes belong to no pose.
    pub(super) fn forget_boxes(&mut self) {
        self.positions_stamp = 0;
    }

    /// The clusters' summed surface divided by the body's: how well the clusters fit the current pose.
    pub(super) fn spread(&self) -> f64 {
        spread(self.surface, &self.bounds.root())
    }
}
