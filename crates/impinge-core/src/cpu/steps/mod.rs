//! `Clusters` for steps: vertices, edges and faces that move from a start to an end, and pairs of them.
//!
//! ```text
//! clustering  the vertices, edges and faces of each body, once per topology
//! bounds      two boxes per cluster, at the start and at the end; the tree above holds both
//! dispatch    layers whose boxes meet, then tree against tree: as for intersections
//! pairing     boxes of elements at both ends; candidates per work item
//! narrow      filters, then exact arithmetic
//! ```
//!
//! Reason for each discard: an element that moves linearly is, at any time, in the interpolation of its boxes at both ends.
//! If one element is beside the other on the same side of an axis at both ends, they never touch.

mod cache;
mod group;
mod hull;
mod narrow;
mod near;
mod pairing;
mod world;

use crate::error::Error;
use crate::frame::Layer;
use crate::grouping::hubs::Hubs;
use crate::impacts::StepAnswer;
use crate::scene::Body;
use crate::settings::InstructionSet;
use crate::stats::Statistics;

use super::dispatch::Tree;
use super::met::WorkItem;
use super::simd::{Isa, Simd};
use super::slabs::{self, Counts, Room, Stage};
use crate::run::Job;
use crate::settings::Settings;

use cache::{Caches, LayerCache};
pub(crate) use hull::Pose;
use pairing::Worker;
pub(crate) use world::{Asked, Sought};
use world::{Known, World};

impl<'a> Stage for World<'a> {
    type Worker = Worker;
    type Answer = StepAnswer<'a>;

    #[inline(always)]
    fn tree(&self, layer: u32) -> Tree<'_> {
        self.cache(layer).tree()
    }

    #[inline(always)]
    fn pair<S: Simd>(self, simd: S, isa: Isa, items: &[WorkItem], worker: &mut Worker) {
        pairing::run(simd, isa, self, items, worker);
    }

    #[inline(always)]
    fn hubs(&self, layer: u32) -> Option<&Hubs> {
        self.cache(layer).clustering.hubs()
    }

    fn end(worker: &mut Worker, answer: StepAnswer<'a>) {
        worker.end(answer);
    }

    fn counts(worker: &Worker) -> Counts {
        worker.counts()
    }

    fn is_over(&self) -> bool {
        self.known.is_over()
    }
}

/// Caches and scratch of the method; kept from step to step.
pub(crate) struct StepClusters {
    isa: Isa,
    caches: Caches,
    scratches: Vec<Worker>,
    room: Room,
}

impl StepClusters {
    pub fn new(allowed: InstructionSet) -> Self {
        StepClusters {
            isa: Isa::detect(allowed),
            caches: Caches::default(),
            scratches: Vec::new(),
            room: Room::default(),
        }
    }

    /// Hands over the contacts or candidates that are sought.
    pub fn run(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        asked: Asked,
        answer: StepAnswer<'_>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        self.scratches.resize_with(job.workers.n(), Worker::default);
        stats.n_clusters = 0;
        stats.time("clustering", |stats| self.cluster(job, stats))?;
        stats.time("bounds", |stats| {
            self.refit(job, settings, asked.pose, stats)
        })?;
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, settings.memory_budget.is_some());
        }
        let held = self.bytes_besides_room();
        let known = Known::new(asked.latest);
        let task = slabs::Task {
            isa: self.isa,
            job,
            answer,
            world: World {
                scene: job.scene,
                frame: job.frame,
                asked,
                answer,
                known: &known,
                caches: &self.caches,
            },
            scratches: &mut self.scratches,
            budget: settings.memory_budget,
            held,
        };
        self.room.run(task, stats)?;
        stats.bytes_held = (self.bytes_besides_room() + self.room.bytes()) as u64;
        Ok(())
    }

    fn bytes_besides_room(&self) -> usize {
        let caches: usize = self.caches.iter().map(LayerCache::bytes).sum();
        let scratches: usize = self.scratches.iter().map(Worker::bytes).sum();
        caches + scratches
    }

    /// Clusters layers that are new or were re-meshed; forgets layers of removed bodies.
    fn cluster(&mut self, job: Job<'_>, stats: &mut Statistics) -> Result<(), Error> {
        let fits = |_: &mut LayerCache, _: &Layer, _: &Body| false;
        let make = |body: &Body, layer: &Layer| LayerCache::new(body, layer.part);
        self.caches.update(job, stats, fits, make)
    }

    /// Computes the boxes of layers that have moved.
    fn refit(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        pose: Pose,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        cache::refit(
            self.isa,
            job,
            settings,
            pose,
            &mut self.caches,
            &mut self.scratches,
            stats,
        )
    }
}
