//! `Clusters` for steps: vertices, edges and faces that move from a start to an end, and pairs of
//! them.
//!
//! ```text
//! clustering  the vertices, edges and faces of each body, once per topology
//! bounds      two boxes per cluster, at the start and at the end; the tree above holds both
//! excluded    of each body, the pairs that share a vertex or are left out, once per topology and
//!             query
//! traversal   parts whose boxes meet, then tree against tree: as for intersections
//! pairing     boxes of elements at both ends; candidates per work item
//! narrow      filters, then exact arithmetic
//! ```
//!
//! Reason for each discard: an element that moves linearly is, at any time, in the interpolation of
//! its boxes at both ends. If one element is beside the other on the same side of an axis at both
//! ends, they never touch.

mod cache;
mod excluded;
mod group;
mod narrow;
mod pairing;
#[cfg(feature = "gpu")]
mod undecided;
mod unsure;
mod verlet;
mod world;

use std::sync::Arc;

#[cfg(feature = "gpu")]
use crate::bvh::clusters::Clustering;
use crate::bvh::hubs::Hubs;
use crate::clusterings::Clusterings;
use crate::query::pair_kind::PairKind;
use crate::query::settings::InstructionSet;
use crate::scene::error::Error;
use crate::scene::index::PartIx;
use crate::search::found::StepAnswer;
use crate::search::moved::Moved;
use crate::search::stats::Stats;
#[cfg(feature = "gpu")]
use crate::search::undecided::Undecided;

use super::batches::{self, BatchScratch, BatchStages, Counts, Traversed};
use super::lane_pairs::WorkItem;
use super::traversal::BodyTree;
use crate::query::settings::Settings;
use crate::search::runner::Job;
#[cfg(feature = "gpu")]
use crate::search::sink::Ending;
use crate::simd::{Isa, Simd};

use cache::{PartCache, StepCaches};
use pairing::StepWorker;
pub(crate) use verlet::VerletList;
use world::{MovedLanes, SharedBound, StepWorld};

impl Traversed for StepWorld<'_> {
    fn tree(&self, part: PartIx) -> BodyTree<'_> {
        self.cache(part).tree()
    }

    fn hubs(&self, part: PartIx) -> Option<&Hubs> {
        self.cache(part).clustering.hubs()
    }
}

impl<'a> BatchStages for StepWorld<'a> {
    type Worker = StepWorker;
    type Answer = StepAnswer<'a>;

    #[inline(always)]
    fn pair<S: Simd>(self, simd: S, isa: Isa, items: &[WorkItem], worker: &mut StepWorker) {
        pairing::run(simd, isa, self, items, worker);
    }

    fn finish(
        &self,
        job: Job<'_>,
        _: StepAnswer<'a>,
        workers: &mut [StepWorker],
        stats: &mut Stats,
    ) -> Result<(), Error> {
        // Stages are listed in the order of their first times.
        stats.add_ms("pairing", 0.0);
        stats.time("narrow", |_| unsure::decide(job, *self, workers))
    }

    fn end(worker: &mut StepWorker, answer: StepAnswer<'a>) {
        worker.end(answer);
    }

    fn counts(worker: &StepWorker) -> Counts {
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
    caches: StepCaches,
    scratches: Vec<StepWorker>,
    scratch: BatchScratch,
}

impl StepClusters {
    pub fn new(allowed: InstructionSet, clusterings: Clusterings) -> Self {
        StepClusters {
            isa: Isa::detect(allowed),
            clusterings,
            caches: StepCaches::default(),
            scratches: Vec::new(),
            scratch: BatchScratch::default(),
        }
    }

    /// Hands over the contacts or candidates that are sought. Where `moved` is given, those of
    /// pairs with a vertex that has moved, and perhaps others.
    pub fn run(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        answer: StepAnswer<'_>,
        moved: Option<Moved<'_>>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.prepare(job, settings, stats)?;
        self.search(job, settings, answer, moved, stats)
    }

    /// Makes clusters and boxes.
    fn prepare(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.scratches
            .resize_with(job.workers.n(), StepWorker::default);
        stats.n_clusters = 0;
        stats.time("clustering", |stats| self.cluster(job, stats))?;
        stats.time("bounds", |stats| self.refit(job, settings, stats))?;
        stats.time("clustering", |_| {
            cache::exclude(job, settings, &mut self.caches)
        })
    }

    /// Does the rest of [`run`](Self::run).
    fn search(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        answer: StepAnswer<'_>,
        moved: Option<Moved<'_>>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, job.plan, settings);
        }
        let held = self.bytes_besides_scratch();
        let known = SharedBound::new(job.control);
        let lanes = |moved: Moved<'_>| {
            let parts = job.plan.numbered_parts();
            let lanes = parts.map(|(ix, part)| moved.lanes(ix, &self.caches.at(part).clustering));
            lanes.collect::<MovedLanes>()
        };
        let moved = moved.map(lanes);
        let task = batches::Task {
            isa: self.isa,
            job,
            answer,
            world: StepWorld {
                moved: moved.as_ref(),
                ..StepWorld::new(self.isa, job, answer, &known, &self.caches)
            },
            scratches: &mut self.scratches,
            settings,
            held,
        };
        self.scratch.run(task, stats)?;
        stats.bytes_held = (self.bytes_besides_scratch() + self.scratch.bytes()) as u64;
        Ok(())
    }

    /// The pairs that rounded positions may make touch, up to the earliest contact, of the last
    /// [`run`](Self::run), which looked for that under a plan [with
    /// rounding](crate::plan::Plan::is_rounded): by kind and key, in any order. `None` if there are
    /// too many.
    pub fn close(&mut self) -> Option<Vec<(PairKind, u64)>> {
        let mut close = Vec::new();
        for worker in &mut self.scratches {
            close.extend_from_slice(worker.contacts().close()?);
        }
        Some(close)
    }

    /// As [`run`](Self::run), where a device finds the candidates: `find` gets the clusters of all
    /// parts and hands over the slots of pairs that may touch.
    #[cfg(feature = "gpu")]
    pub fn run_on_device(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        answer: StepAnswer<'_>,
        stats: &mut Stats,
        find: impl FnOnce(
            &[Arc<Clustering>],
            &mut dyn FnMut(Undecided<'_>) -> Result<bool, Error>,
            &mut Stats,
        ) -> Result<bool, Error>,
    ) -> Result<ByDevice, Error> {
        stats.n_clusters = 0;
        let clusterings = stats.time("clustering", |stats| {
            let all = self.clusterings.of_frame(job, |_| true, stats);
            self.cluster(job, stats)?;
            all
        })?;
        let mut first_slots = vec![0];
        for clustering in &clusterings {
            // All elements of a frame are numbered in 32 bits.
            first_slots.push(first_slots[first_slots.len() - 1] + clustering.order.len() as u32);
        }
        self.scratches
            .resize_with(job.workers.n(), StepWorker::default);
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, job.plan, settings);
        }
        answer.share(self.bytes_besides_scratch() as u64);
        let known = SharedBound::new(job.control);
        let mut deciding = undecided::Deciding {
            job,
            world: StepWorld::new(self.isa, job, answer, &known, &self.caches),
            answer,
            workers: &mut self.scratches,
            first_slots,
        };
        let is_done = find(
            &clusterings,
            &mut |undecided| deciding.decide(undecided),
            stats,
        )?;
        deciding.end()?;
        stats.bytes_held += self.bytes_besides_scratch() as u64;
        Ok(match is_done {
            false => ByDevice::Not,
            true if known.is_over() => ByDevice::Touches,
            true => ByDevice::Done,
        })
    }

    fn bytes_besides_scratch(&self) -> usize {
        let scratches: usize = self.scratches.iter().map(StepWorker::bytes).sum();
        self.clusterings.bytes() + self.caches.bytes() + scratches
    }

    /// Clusters parts that are new or were re-meshed; forgets parts of removed bodies.
    fn cluster(&mut self, job: Job<'_>, stats: &mut Stats) -> Result<(), Error> {
        let shared = (&self.clusterings, false);
        self.caches.update(job, shared, stats, |body, clustering| {
            PartCache::new(body, Arc::clone(clustering))
        })
    }

    /// Computes the boxes of parts that have moved.
    fn refit(&mut self, job: Job<'_>, settings: &Settings, stats: &mut Stats) -> Result<(), Error> {
        cache::refit(
            self.isa,
            job,
            settings,
            job.plan.sweep(),
            (&self.clusterings, &mut self.caches),
            &mut self.scratches,
            stats,
        )
    }
}
