//! Stage `bounds` of `Clusters`: boxes of the clusters of bodies that moved, and of the trees above
//! them.
//!
//! ```text
//! read    all boxes of a body whose clusters are not sorted; else its positions in memory order,
//!         and the boxes of clusters in no group
//! prove   whether its groups are beside all bodies that it could meet (see `culled`)
//! back    if not, also the boxes of clusters that have come back
//! above   nodes; bodies that have flowed away from their clusters are clustered again
//! learn   clusters are sorted for the next frame (see `culled`)
//! ```

use std::sync::{Mutex, PoisonError};

use crate::bvh::bounds::{Aabb, BoundsArray, RawBoundsArray};
use crate::clusterings::{BodyPart, Clusterings};
use crate::query::settings::Settings;
use crate::scene::error::Error;
use crate::scene::index::PartIx;
use crate::scene::positions::Positions;
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::workers::Workers;
use crate::workers::tuning::Tuning;

use super::bounds::{self, Summary};
use super::culled::body::Children;
use super::culled::extents::Extents;
use super::culled::{self, Needed};
use super::pairing::Worker;
use super::world::{BodyCache, Caches, World};
use crate::search::runner::Job;
use crate::simd::{Isa, Simd, with_isa};

/// Nodes per task, of up to eight clusters each.
const NODES: usize = 32;
/// Runs of vertices per task: 48 KiB of positions.
const RUNS: usize = 256;

/// Tasks and results of the stage; kept from frame to frame.
#[derive(Default)]
pub(super) struct Refit {
    tasks: Vec<RefitTask>,
    /// The result of each task.
    found: Vec<Mutex<FoundBoxes>>,
}

/// What a task does with its range `first..end`.
#[derive(Debug, Clone, Copy)]
enum What {
    /// Reads runs of vertices.
    Read,
    /// Computes the boxes of nodes of level 1 and of all their clusters; only the cluster's box if
    /// there is just one.
    All,
    /// The same for the clusters that are near, node by node.
    Near,
}

#[derive(Debug, Clone, Copy)]
struct RefitTask {
    part: PartIx,
    what: What,
    first: u32,
    end: u32,
    /// Where the body's boxes are written; valid within the frame that made the task.
    leaves: RawBoundsArray,
    parents: Option<RawBoundsArray>,
}

#[derive(Debug, Clone, Copy)]
struct FoundBoxes {
    extents: Extents,
    /// Half the summed surface of the clusters.
    surface: f32,
}

impl Refit {
    /// Computes all boxes that the frame needs.
    pub fn run(
        &mut self,
        isa: Isa,
        job: Job<'_>,
        settings: &Settings,
        (clusterings, caches): (&Clusterings, &mut Caches),
        scratches: &mut [Worker],
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Job {
            scene,
            plan,
            workers,
            ..
        } = job;
        let tuning = &settings.tuning;
        let is_allowed = culled::is_allowed(isa, plan, settings);
        self.tasks.clear();
        for (ix, part) in plan.numbered_parts() {
            let body = plan.body(scene, ix);
            let cache = caches.at_mut(part);
            let needed = culled::plan(cache, body, is_allowed && !part.within);
            if needed == Needed::None {
                continue;
            }
            // If this frame ends early, for whatever reason, the boxes belong to no pose.
            cache.forget_boxes();
            if !cache.can_be_read(body) {
                plan.check_one(scene, ix)?;
            }
            cache.whole = Aabb::EMPTY;
            self.push_needed(workers, ix, plan.parts.len(), cache, needed);
        }
        match self.work(isa, job, tuning, caches, scratches) {
            // All vertices of these bodies were read.
            true => {
                let read = self.tasks.iter().map(|task| plan.body(scene, task.part));
                let unknown = read.filter(|body| !body.is_checked());
                unknown.for_each(|body| body.set_checked());
            }
            false => plan.check(scene, workers)?,
        }
        if is_allowed {
            self.tasks.clear();
            for (ix, part) in plan.numbered_parts() {
                let needed = culled::prove(job, caches, ix, stats);
                if needed != Needed::None {
                    let cache = caches.at_mut(part);
                    cache.forget_boxes();
                    self.push_needed(workers, ix, plan.parts.len(), cache, needed);
                }
            }
            self.work(isa, job, tuning, caches, scratches);
        }
        self.above(isa, job, tuning, (clusterings, caches), stats)?;
        if is_allowed {
            culled::learn(job, caches, for_boxes(job, tuning, scratches));
        }
        Ok(())
    }

    /// Makes tasks for the boxes that a body needs, one of `n_bodies`.
    fn push_needed(
        &mut self,
        workers: &Workers,
        part: PartIx,
        n_bodies: usize,
        cache: &mut BodyCache,
        needed: Needed,
    ) {
        match needed {
            Needed::None => {}
            Needed::All => {
                let n_nodes = cache.bounds.levels.get(1).map_or(1, BoundsArray::len);
                self.push(workers, part, cache, What::All, n_nodes);
            }
            Needed::Near { n_nodes, n_runs } => {
                // Order tasks so that one thread tends to read a body and compute its boxes: `work`
                // reverses this list, so the caller starts at its end and helpers at its front.
                let mut parts = [(What::Read, n_runs), (What::Near, n_nodes)];
                if 2 * part.index() >= n_bodies {
                    parts.reverse();
                }
                for (what, n) in parts {
                    self.push(workers, part, cache, what, n);
                }
            }
        }
    }

    /// Makes tasks for `n` runs or nodes of a body.
    fn push(
        &mut self,
        workers: &Workers,
        part: PartIx,
        cache: &mut BodyCache,
        what: What,
        n: usize,
    ) {
        let (leaves, parents) = match &mut cache.bounds.levels[..] {
            [] => return,
            [leaves] => (leaves.raw(), None),
            [leaves, parents, ..] => (leaves.raw(), Some(parents.raw())),
        };
        let step = match what {
            What::Read => RUNS,
            What::All | What::Near => {
                cache.surface = 0.0;
                NODES
            }
        };
        let step = workers.task(step);
        let tasks = (0..n).step_by(step).map(|first| RefitTask {
            part,
            what,
            first: first as u32,
            end: n.min(first + step) as u32,
            leaves,
            parents,
        });
        self.tasks.extend(tasks);
    }

    /// Does the tasks. Returns whether all positions that they read are certainly finite.
    fn work(
        &mut self,
        isa: Isa,
        job: Job<'_>,
        tuning: &Tuning,
        caches: &mut Caches,
        scratches: &mut [Worker],
    ) -> bool {
        let Job {
            scene,
            plan,
            workers,
            ..
        } = job;
        // Positions are mostly written in order: the last ones are in the caller's cache.
        self.tasks.reverse();
        let n_tasks = self.tasks.len();
        if self.found.len() < n_tasks {
            self.found
                .resize_with(n_tasks, || Mutex::new(FoundBoxes::NOTHING));
        }
        let (tasks, found) = (&self.tasks, &self.found);
        let world = World {
            scene,
            plan,
            caches: Some(caches),
        };
        let work = |_: &mut Worker, ix: usize| {
            let result = with_isa!(isa, work, (
                world: World<'_> = world,
                task: RefitTask = tasks[ix],
            ) -> FoundBoxes);
            *found[ix].lock().unwrap_or_else(PoisonError::into_inner) = result;
        };
        workers.for_each(for_boxes(job, tuning, scratches), n_tasks, work);
        let mut all_finite = true;
        for (task, found) in self.tasks.iter().zip(&mut self.found) {
            let found = found.get_mut().unwrap_or_else(PoisonError::into_inner);
            all_finite &= found.extents.all_finite;
            let cache = caches.at_mut(plan.part(task.part));
            cache.surface += f64::from(found.surface);
            cache.whole.join(&found.extents.whole);
            if let (What::Read, Some(culled)) = (task.what, &mut cache.culled) {
                culled.add(&found.extents);
            }
        }
        all_finite
    }

    /// Computes the boxes of nodes above level 1; clusters bodies again that have flowed away from
    /// their clusters.
    fn above(
        &mut self,
        isa: Isa,
        job: Job<'_>,
        tuning: &Tuning,
        (clusterings, caches): (&Clusterings, &mut Caches),
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        let work = Work { workers, control };
        let mut known = clusterings.lock();
        for (ix, part) in plan.numbered_parts() {
            let body = plan.body(scene, ix);
            let cache = caches.at_mut(part);
            if cache.positions_stamp == body.positions_stamp() {
                continue;
            }
            cache.positions_stamp = body.positions_stamp();
            cache.bounds.refit_above(1, &cache.clustering.shape);
            if cache.sorted().is_some() {
                continue;
            }
            let body_part =
                BodyPart::new(part.id, body, part.part).with_local_faces(isa.looks_corners_up());
            let spread = cache.spread();
            let renewed = known.renew_if_stale(body_part, (&mut cache.fit, spread), work, stats)?;
            if let Some(clustering) = renewed {
                *cache = BodyCache::new(body, clustering, tuning);
                if part.within {
                    cache.find_adjacency(workers)?;
                }
                cache.refit_all(body);
                cache.positions_stamp = body.positions_stamp();
            }
        }
        Ok(())
    }
}

/// The scratches of the workers that compute boxes.
fn for_boxes<'a>(job: Job<'_>, tuning: &Tuning, scratches: &'a mut [Worker]) -> &'a mut [Worker] {
    let parallel = job.plan.n_elements() >= tuning.bounds_parallel_from;
    let n_workers = if parallel { job.workers.n() } else { 1 };
    &mut scratches[..n_workers]
}

impl FoundBoxes {
    const NOTHING: FoundBoxes = FoundBoxes {
        extents: Extents::EMPTY,
        surface: 0.0,
    };
}

/// Does one task.
#[inline(always)]
fn work<S: Simd>(simd: S, world: World<'_>, task: RefitTask) -> FoundBoxes {
    let positions = world.body(task.part).positions;
    let cache = world.cache(task.part);
    let (clustering, run) = (&cache.clustering, task.first as usize..task.end as usize);
    let mut summary = Summary::EMPTY;
    let near = match (task.what, cache.sorted(), positions) {
        (What::Read, Some(sorted), Positions::F32(positions)) => {
            return FoundBoxes {
                extents: sorted.read(simd, positions, run),
                surface: 0.0,
            };
        }
        (What::Near, Some(sorted), _) => Some(sorted.near()),
        _ => None,
    };
    for ix in run {
        let (node, only) = match near {
            Some(near) => (near[ix].node as usize, near[ix].children),
            None => (ix, u8::MAX),
        };
        let clusters = match task.parents {
            Some(_) => Children::new(clustering.shape.children(1, node), only),
            None => Children::new(node..node + 1, only),
        };
        // SAFETY: no two tasks name the same node of the same body, and no thread reads boxes
        // before all tasks are done.
        unsafe {
            let of_node = bounds::of_clusters(simd, positions, clustering, clusters, task.leaves);
            if let Some(parents) = task.parents {
                parents.put(node, &of_node.bounds);
            }
            summary.join(&of_node);
        }
    }
    FoundBoxes {
        extents: Extents::without_groups(summary.bounds, summary.all_finite),
        surface: summary.surface,
    }
}
