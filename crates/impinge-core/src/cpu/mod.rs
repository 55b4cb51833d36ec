//! The CPU backend. Most stages have a file of their name; SIMD is chosen at run time.

mod auto;
pub(crate) mod batches;
pub(crate) mod bounds;
pub mod cells;
pub(crate) mod clusters;
mod creases;
pub(crate) mod cull;
pub mod cull_map;
mod culled;
mod directions;
mod group_cache;
mod hubs;
pub(crate) mod lane_pairs;
pub mod narrow;
pub(crate) mod pairing;
mod refit;
pub(crate) mod steps;
pub mod subcells;
pub(crate) mod top_level;
pub(crate) mod traversal;
pub mod world;

use std::sync::Arc;

use crate::clusterings::Clusterings;
use crate::query::settings::{Method, Settings};
use crate::scene::error::Error;
use crate::search::naive;
use crate::search::narrow::Intersection;
use crate::search::runner::{Finder, Job};
use crate::search::sink::{Answer, BLOCK};
use crate::search::stats::Stats;

use auto::Acquaintances;
use cells::Cells;
use clusters::Clusters;

/// The CPU backend of one detector: every method, and the memory kept from frame to frame.
pub(crate) struct Cpu {
    settings: Settings,
    clusterings: Clusterings,
    clusters: Clusters,
    cells: Cells,
    acquaintances: Acquaintances,
}

impl Cpu {
    pub fn new(settings: &Settings, clusterings: &Clusterings) -> Self {
        Cpu {
            clusterings: clusterings.clone(),
            clusters: Clusters::new(settings.instruction_set, clusterings.clone()),
            cells: Cells::new(settings),
            acquaintances: Acquaintances::default(),
            settings: settings.clone(),
        }
    }

    /// The clusters, for questions that need them whatever the method is.
    pub fn clusters(&mut self) -> &mut Clusters {
        &mut self.clusters
    }

    /// Of `Auto`: answers the frame in the grid if most bodies are new and it is not crowded;
    /// otherwise returns false, and clusters are to answer it.
    fn find_as_new(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Stats,
    ) -> Result<bool, Error> {
        let tuning = &self.settings.tuning;
        if self.settings.method != Method::Auto {
            return Ok(false);
        }
        let prefers_grid =
            self.acquaintances
                .prefer_grid(job.scene, job.plan, tuning, &self.clusterings);
        let has_room = self.settings.memory_budget.is_none();
        if prefers_grid && has_room && self.find_in_grid(job, answer, stats)? {
            stats.method = Method::Cells.name();
            self.clusters.forget_outdated(job.scene);
            stats.bytes_held = self.clusters.bytes();
            return Ok(true);
        }
        (stats.grid, stats.n_reruns) = (None, 0);
        stats.method = Method::Clusters.name();
        Ok(false)
    }

    /// Answers through a grid whose memory is freed after the frame; false if the grid is too
    /// crowded.
    fn find_in_grid(
        &self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Stats,
    ) -> Result<bool, Error> {
        job.plan.check(job.scene, job.workers)?;
        let settings = &self.settings;
        let mut cells = Cells::new(settings);
        let Some(grid) = cells.divide(job, answer, settings, stats)? else {
            return Ok(true);
        };
        if cells.crowding() > settings.tuning.auto_most_crowded {
            return Ok(false);
        }
        cells.decide(job, answer, settings, &cells::Owner, grid, stats)?;
        Ok(true)
    }
}

impl Finder for Cpu {
    fn method(&self) -> &'static str {
        self.settings.method.name()
    }

    fn backend(&self) -> &str {
        "cpu"
    }

    /// `Clusters` checks positions while it reads them.
    fn checks_positions(&self) -> bool {
        matches!(self.settings.method, Method::Auto | Method::Clusters)
    }

    async fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        if self.find_as_new(job, answer, stats)? {
            return Ok(());
        }
        let settings = &self.settings;
        match settings.method {
            Method::Naive => stats.time("naive", |stats| run_naive(job, answer, stats)),
            Method::Cells => self.cells.run(job, answer, settings, &cells::Owner, stats),
            Method::Auto | Method::Clusters => self.clusters.run(job, answer, settings, stats),
        }
    }
}

/// The oracle's pairs, handed over as those of the other methods are.
fn run_naive(job: Job<'_>, answer: &Answer, stats: &mut Stats) -> Result<(), Error> {
    let Job {
        scene,
        plan,
        control,
        ..
    } = job;
    let mut keys = Vec::with_capacity(BLOCK);
    naive::run(&Intersection, scene, plan, control, stats, |_, key, ()| {
        keys.push(key);
        if keys.len() < BLOCK {
            return Ok(());
        }
        answer.take(&mut keys);
        answer.check()
    })?;
    answer.take(&mut keys);
    answer.check()
}
