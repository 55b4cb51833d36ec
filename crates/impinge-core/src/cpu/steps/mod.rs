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
mod pairing;
mod world;

use crate::error::Error;
use crate::grouping::hubs::Hubs;
use crate::impacts::StepAnswer;
use crate::settings::InstructionSet;
use crate::sink::Ending;
use crate::stats::Statistics;

use super::dispatch::{NodePair, Tree};
use super::met::WorkItem;
use super::simd::{Isa, Simd};
use super::slabs::{self, Counts, Slabs, Stage};
use super::top_level::TopLevel;
use crate::run::Job;
use crate::settings::Settings;

use cache::{Caches, LayerCache, part_ix};
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
    top: TopLevel,
    items: Vec<WorkItem>,
    scratches: Vec<Worker>,
    stack: Vec<NodePair>,
    layer_stack: Vec<NodePair>,
}

impl StepClusters {
    pub fn new(allowed: InstructionSet) -> Self {
        StepClusters {
            isa: Isa::detect(allowed),
            caches: Vec::new(),
            top: TopLevel::default(),
            items: Vec::new(),
            scratches: Vec::new(),
            stack: Vec::new(),
            layer_stack: Vec::new(),
        }
    }

    /// Hands over what is sought.
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
        let held = self.bytes() as u64;
        let most_items = slabs::most_items(settings.memory_budget, held)?;
        self.items.clear();
        self.items.shrink_to(most_items);
        answer.share(held + slabs::bytes(most_items));
        answer.check()?;
        let known = Known::new(asked.latest);
        let mut slabs = Slabs {
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
            items: &mut self.items,
            most_items,
            scratches: &mut self.scratches,
            stats,
            ms: 0.0,
        };
        slabs.run(&mut self.top, &mut self.stack, &mut self.layer_stack)?;
        for worker in &mut self.scratches {
            worker.end(answer);
        }
        answer.check()?;
        stats.bytes_held = (self.bytes() + size_of::<WorkItem>() * self.items.capacity()) as u64;
        Ok(())
    }

    fn bytes(&self) -> usize {
        let caches = self.caches.iter().flatten().flatten();
        let caches: usize = caches.map(|cache| cache.bytes()).sum();
        let scratches: usize = self.scratches.iter().map(Worker::bytes).sum();
        caches + scratches + self.top.bytes()
    }

    /// Clusters layers that are new or were re-meshed; forgets layers of removed bodies.
    fn cluster(&mut self, job: Job<'_>, stats: &mut Statistics) -> Result<(), Error> {
        let Job {
            scene,
            frame,
            workers,
            control,
        } = job;
        let slots = frame.layers.iter().map(|layer| layer.id.index() + 1);
        let n_slots = slots.max().unwrap_or(0);
        if self.caches.len() < n_slots {
            self.caches.resize_with(n_slots, Default::default);
        }
        for (slot, caches) in self.caches.iter_mut().enumerate() {
            if !scene.holds(slot) {
                *caches = Default::default();
            }
        }
        for (ix, layer) in frame.layers.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = &mut self.caches[layer.id.index()][part_ix(layer.part)];
            let known = cache
                .as_ref()
                .is_some_and(|cache| cache.topology_stamp == body.topology_stamp());
            if !known {
                control.step(ix as u64, frame.layers.len() as u64)?;
                let n_elements = body.part(layer.part).len();
                let new = workers.install(n_elements, || LayerCache::new(body, layer.part))?;
                *cache = Some(Box::new(new));
                stats.n_clustered += 1;
            }
            let cache = cache.as_ref().expect("just clustered");
            stats.n_clusters += cache.clustering.n_clusters() as u64;
        }
        Ok(())
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
