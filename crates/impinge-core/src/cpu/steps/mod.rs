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
#[cfg(feature = "gpu")]
mod left;
mod narrow;
mod pairing;
mod unsure;
mod world;

use std::sync::Arc;

use crate::clusterings::Clusterings;
use crate::error::Error;
use crate::found::StepAnswer;
#[cfg(feature = "gpu")]
use crate::grouping::clusters::Clustering;
use crate::grouping::hubs::Hubs;
use crate::index::LayerIx;
use crate::pair_kind::PairKind;
use crate::settings::InstructionSet;
use crate::stats::Statistics;
#[cfg(feature = "gpu")]
use crate::undecided::Left;

use super::dispatch::Tree;
use super::met::WorkItem;
use super::simd::{Isa, Simd};
use super::slabs::{self, Counts, Room, SlabStages};
use crate::run::Job;
use crate::settings::Settings;
#[cfg(feature = "gpu")]
use crate::sink::Ending;

use cache::{Caches, LayerCache};
use pairing::Worker;
use world::{Known, World};

impl<'a> SlabStages for World<'a> {
    type Worker = Worker;
    type Answer = StepAnswer<'a>;

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

    fn finish(
        &self,
        job: Job<'_>,
        _: StepAnswer<'a>,
        workers: &mut [Worker],
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        // Stages are listed in the order of their first times.
        stats.add_ms("pairing", 0.0);
        stats.time("narrow", |_| unsure::settle(job, *self, workers));
        Ok(())
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

/// How a step was answered on a device.
#[cfg_attr(not(feature = "gpu"), expect(dead_code))]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ByDevice {
    /// The device cannot hold it.
    Not,
    Done,
    /// Any contact is sought, and there is one, whether it has a name or not.
    Touches,
}

/// Caches and scratch of the method; kept from step to step.
pub(crate) struct StepClusters {
    isa: Isa,
    clusterings: Clusterings,
    caches: Caches,
    scratches: Vec<Worker>,
    room: Room,
}

impl StepClusters {
    pub fn new(allowed: InstructionSet, clusterings: Clusterings) -> Self {
        StepClusters {
            isa: Isa::detect(allowed),
            clusterings,
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
        answer: StepAnswer<'_>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        self.scratches.resize_with(job.workers.n(), Worker::default);
        stats.n_clusters = 0;
        stats.time("clustering", |stats| self.cluster(job, stats))?;
        stats.time("bounds", |stats| self.refit(job, settings, stats))?;
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, job.frame, settings);
        }
        let held = self.bytes_besides_room();
        let known = Known::new(job.control);
        let task = slabs::Task {
            isa: self.isa,
            job,
            answer,
            world: World {
                isa: self.isa,
                scene: job.scene,
                frame: job.frame,
                pose: job.frame.sweep(),
                boxes: job.frame.sweep(),
                answer,
                known: &known,
                caches: &self.caches,
            },
            scratches: &mut self.scratches,
            settings,
            held,
        };
        self.room.run(task, stats)?;
        stats.bytes_held = (self.bytes_besides_room() + self.room.bytes()) as u64;
        Ok(())
    }

    /// The pairs that rounded positions may make touch, up to the earliest contact, of the last [`run`](Self::run), which looked for that
    /// under a plan [with rounding](crate::plan::Plan::is_rounded): by kind and key, in any order. `None` if there are too many.
    pub fn close(&mut self) -> Option<Vec<(PairKind, u64)>> {
        let mut close = Vec::new();
        for worker in &mut self.scratches {
            close.extend_from_slice(worker.contacts().close()?);
        }
        Some(close)
    }

    /// As [`run`](Self::run), where a device finds the candidates: `find` gets the clusters of all layers and hands over the
    /// places of pairs that may touch.
    #[cfg(feature = "gpu")]
    pub fn run_on_device(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        answer: StepAnswer<'_>,
        stats: &mut Statistics,
        find: impl FnOnce(
            &[Arc<Clustering>],
            &mut dyn FnMut(Left<'_>) -> Result<bool, Error>,
            &mut Statistics,
        ) -> Result<bool, Error>,
    ) -> Result<ByDevice, Error> {
        stats.n_clusters = 0;
        let clusterings = stats.time("clustering", |stats| {
            let all = self.clusterings.of_frame(job, |_| true, stats);
            self.cluster(job, stats)?;
            all
        })?;
        let mut first_places = vec![0];
        for clustering in &clusterings {
            // All elements of a frame are numbered in 32 bits.
            first_places.push(first_places[first_places.len() - 1] + clustering.order.len() as u32);
        }
        self.scratches.resize_with(job.workers.n(), Worker::default);
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, job.frame, settings);
        }
        answer.share(self.bytes_besides_room() as u64);
        let known = Known::new(job.control);
        let mut settling = left::Settling {
            job,
            world: World {
                isa: self.isa,
                scene: job.scene,
                frame: job.frame,
                pose: job.frame.sweep(),
                boxes: job.frame.sweep(),
                answer,
                known: &known,
                caches: &self.caches,
            },
            answer,
            workers: &mut self.scratches,
            first_places,
        };
        let is_done = find(&clusterings, &mut |left| settling.settle(left), stats)?;
        settling.end()?;
        stats.bytes_held += self.bytes_besides_room() as u64;
        Ok(match is_done {
            false => ByDevice::Not,
            true if known.is_over() => ByDevice::Touches,
            true => ByDevice::Done,
        })
    }

    fn bytes_besides_room(&self) -> usize {
        let caches: usize = self.caches.iter().map(LayerCache::bytes).sum();
        let scratches: usize = self.scratches.iter().map(Worker::bytes).sum();
        self.clusterings.bytes() + caches + scratches
    }

    /// Clusters layers that are new or were re-meshed; forgets layers of removed bodies.
    fn cluster(&mut self, job: Job<'_>, stats: &mut Statistics) -> Result<(), Error> {
        let shared = (&self.clusterings, false);
        self.caches.update(job, shared, stats, |body, clustering| {
            LayerCache::new(body, Arc::clone(clustering))
        })
    }

    /// Computes the boxes of layers that have moved.
    fn refit(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        cache::refit(
            self.isa,
            job,
            settings,
            job.frame.sweep(),
            (&self.clusterings, &mut self.caches),
            &mut self.scratches,
            stats,
        )
    }
}
