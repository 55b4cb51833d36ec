//! Stage `bounds` of `Clusters`: boxes of the clusters of bodies that moved, and of the trees above them.
//!
//! ```text
//! read    all boxes of a body whose clusters are not sorted; else its positions in memory order, and the boxes of
//!         clusters in no group
//! prove   whether its groups are beside all bodies that it could meet (see `remote`)
//! back    if not, also the boxes of clusters that have come back
//! above   nodes; bodies that have flowed away from their clusters are clustered again; clusters are sorted
//! ```

use std::sync::{Mutex, PoisonError};

use crate::clusterings::make_anew;
use crate::error::Error;
use crate::frame::Frame;
use crate::grouping::bounds::{Bounds, BoundsArray, RawBoundsArray};
use crate::positions::Positions;
use crate::scene::Body;
use crate::settings::{Recluster, Settings};
use crate::stats::Statistics;

use super::bounds::{self, Summary};
use super::extents::{Extents, Sides};
use super::pairing::Worker;
use super::remote::Children;
use super::simd::{Isa, Simd, dispatch};
use super::world::{BodyCache, Caches, World};
use crate::run::Job;

/// Nodes per task, of up to eight clusters each.
const NODES: usize = 32;
/// Runs of vertices per task: 48 KiB of positions.
const RUNS: usize = 256;
/// With fewer primitives of all bodies together, one thread computes the boxes. Positions have just been written,
/// mostly by one thread. If they fit in its cache, this thread reads them faster than another could fetch them.
const PARALLEL_FROM: u64 = 120_000;
/// The clusters of a body are sorted if it has at least this many primitives.
pub(super) const SORTED_FROM: usize = 2_048;
/// Clusters are sorted in frames of at most this many bodies: more bodies are everywhere.
const SORTED_TO: usize = 8;

/// Tasks and results of the stage; kept from frame to frame.
#[derive(Default)]
pub(super) struct Refit {
    tasks: Vec<Task>,
    /// The result of each task.
    found: Vec<Mutex<Found>>,
}

/// What a task does with its range `first..end`.
#[derive(Debug, Clone, Copy)]
enum What {
    /// Reads runs of vertices.
    Read,
    /// Computes the boxes of nodes of level 1 and of all their clusters; only the cluster's box if there is just one.
    All,
    /// The same for the clusters that are near, node by node.
    Near,
}

#[derive(Debug, Clone, Copy)]
struct Task {
    participant: u32,
    what: What,
    first: u32,
    end: u32,
    /// Where the body's boxes are written; valid within the frame that made the task.
    leaves: RawBoundsArray,
    parents: Option<RawBoundsArray>,
}

#[derive(Debug, Clone, Copy)]
struct Found {
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
        caches: &mut Caches,
        scratches: &mut [Worker],
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job { scene, frame, .. } = job;
        let sorts = isa.reads_runs()
            && frame.between()
            && frame.layers.len() <= SORTED_TO
            && settings.memory_budget.is_none();
        self.tasks.clear();
        for (ix, participant) in frame.layers.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = caches.at_mut(participant);
            let n_vertices = body.n_vertices();
            if participant.within || !sorts {
                cache.interrupt();
            } else if !cache
                .sorted()
                .is_some_and(|sorted| sorted.is_fit_for(n_vertices))
            {
                cache.unsort();
            }
            if cache.positions_stamp == body.positions_stamp() {
                continue;
            }
            // If this frame ends early, for whatever reason, the boxes belong to no pose.
            cache.positions_stamp = 0;
            if !can_be_read(cache, body) {
                frame.check_one(scene, ix)?;
            }
            cache.whole = Bounds::EMPTY;
            if let Some(remote) = &mut cache.remote {
                remote.begin();
            }
            let Some(sorted) = cache.sorted() else {
                self.push_all(ix, cache);
                continue;
            };
            // Order tasks so that one thread tends to read a body and compute its boxes: `work` reverses this list, so
            // the caller starts at its end and helpers at its front.
            let (n_runs, n_near) = (sorted.n_runs(), sorted.near().len());
            if 2 * ix < frame.layers.len() {
                self.push(ix, cache, What::Read, n_runs);
                self.push(ix, cache, What::Near, n_near);
            } else {
                self.push(ix, cache, What::Near, n_near);
                self.push(ix, cache, What::Read, n_runs);
            }
        }
        if !self.work(isa, job, caches, scratches) {
            frame.check(scene)?;
        }
        if sorts {
            self.prove(job, caches, stats);
            self.work(isa, job, caches, scratches);
        }
        self.above(isa, job, settings, caches, stats)?;
        if sorts {
            sort(job, caches, scratches);
        }
        Ok(())
    }

    /// Makes tasks for bodies of which groups have come back: for the boxes of all clusters that are near now, or for all
    /// boxes if groups come back too often.
    fn prove(&mut self, job: Job<'_>, caches: &mut Caches, stats: &mut Statistics) {
        let Job { scene, frame, .. } = job;
        self.tasks.clear();
        for (ix, participant) in frame.layers.iter().enumerate() {
            let world = World {
                scene,
                frame,
                caches: Some(caches),
            };
            let Some(back) = back(world, ix) else {
                continue;
            };
            let cache = caches.at_mut(participant);
            let Some(remote) = &mut cache.remote else {
                continue;
            };
            if !back.is_empty() {
                cache.positions_stamp = 0;
                if !remote.come_back(back, &cache.clustering) {
                    cache.unsort();
                    self.push_all(ix, cache);
                    continue;
                }
                let n_near = remote.near().len();
                self.push(ix, cache, What::Near, n_near);
            }
            if let Some(sorted) = cache.sorted() {
                stats.n_remote += (cache.clustering.n_clusters() - sorted.n_near()) as u64;
            }
        }
    }

    /// Makes tasks for all boxes of a body.
    fn push_all(&mut self, participant_ix: usize, cache: &mut BodyCache) {
        let n_nodes = cache.bounds.levels.get(1).map_or(1, BoundsArray::len);
        self.push(participant_ix, cache, What::All, n_nodes);
    }

    /// Makes tasks for `n` runs or nodes of a body.
    fn push(&mut self, participant_ix: usize, cache: &mut BodyCache, what: What, n: usize) {
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
        let tasks = (0..n).step_by(step).map(|first| Task {
            participant: participant_ix as u32,
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
        caches: &mut Caches,
        scratches: &mut [Worker],
    ) -> bool {
        let Job {
            scene,
            frame,
            workers,
            ..
        } = job;
        // Positions are mostly written in order: the last ones are in the caller's cache.
        self.tasks.reverse();
        let n_tasks = self.tasks.len();
        if self.found.len() < n_tasks {
            self.found
                .resize_with(n_tasks, || Mutex::new(Found::NOTHING));
        }
        let (tasks, found) = (&self.tasks, &self.found);
        let world = World {
            scene,
            frame,
            caches: Some(caches),
        };
        let work = |_: &mut Worker, ix: usize| {
            let result = dispatch!(isa, work, (
                world: World<'_> = world,
                task: Task = tasks[ix],
            ) -> Found);
            *found[ix].lock().unwrap_or_else(PoisonError::into_inner) = result;
        };
        workers.for_each(for_boxes(job, scratches), n_tasks, work);
        let mut all_finite = true;
        for (task, found) in self.tasks.iter().zip(&mut self.found) {
            let found = found.get_mut().unwrap_or_else(PoisonError::into_inner);
            all_finite &= found.extents.all_finite;
            let cache = caches.at_mut(&frame.layers[task.participant as usize]);
            cache.surface += f64::from(found.surface);
            cache.whole.join(&found.extents.whole);
            if let (What::Read, Some(remote)) = (task.what, &mut cache.remote) {
                remote.add(&found.extents);
            }
        }
        all_finite
    }

    /// Computes the boxes of nodes above level 1; clusters bodies again that have flowed away from their clusters.
    fn above(
        &mut self,
        isa: Isa,
        job: Job<'_>,
        settings: &Settings,
        caches: &mut Caches,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job {
            scene,
            frame,
            workers,
            ..
        } = job;
        for (ix, participant) in frame.layers.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = caches.at_mut(participant);
            if cache.positions_stamp == body.positions_stamp() {
                continue;
            }
            cache.positions_stamp = body.positions_stamp();
            cache.bounds.refit_above(1, &cache.clustering.shape);
            if cache.sorted().is_some() {
                continue;
            }
            let is_stale = cache.fit.is_stale(cache.spread());
            if is_stale && settings.recluster == Recluster::Auto {
                let n = body.n_primitives();
                *cache = make_anew(workers, n, stats, || BodyCache::new(body, isa))?;
                if participant.within {
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
fn for_boxes<'a>(job: Job<'_>, scratches: &'a mut [Worker]) -> &'a mut [Worker] {
    let parallel = job.frame.n_primitives() >= PARALLEL_FROM;
    let n_workers = if parallel { job.workers.n() } else { 1 };
    &mut scratches[..n_workers]
}

/// Whether a body's clusters may be sorted: its positions are in single precision, and its primitives name every vertex.
fn can_be_read(cache: &BodyCache, body: &Body) -> bool {
    let is_single = matches!(body.positions(), Positions::F32(_));
    is_single && cache.clustering.n_vertices_covered == Some(body.n_vertices())
}

/// The participants that a participant could meet.
fn met(frame: &Frame, ix: usize) -> impl Iterator<Item = usize> {
    (0..frame.layers.len()).filter(move |&other| other != ix && frame.test(ix, other).is_some())
}

/// The groups of a participant that are not beside all bodies that it could meet; `None` if its clusters are not sorted.
fn back(world: World<'_>, ix: usize) -> Option<Sides> {
    let sorted = world.cache(ix as u32).sorted()?;
    let groups = met(world.frame, ix).map(|other| sorted.back_at(&world.cache(other as u32).whole));
    Some(groups.fold(Sides::default(), Sides::union))
}

/// A body whose clusters are to be sorted, and the joint box of all bodies that it could meet.
struct Due<'a> {
    n_vertices: usize,
    cache: &'a mut BodyCache,
    others: Bounds,
}

/// Sorts the clusters of participants for which that is due.
fn sort(job: Job<'_>, caches: &mut Caches, scratches: &mut [Worker]) {
    let Job {
        scene,
        frame,
        workers,
        ..
    } = job;
    let world = World {
        scene,
        frame,
        caches: Some(caches),
    };
    let mut others = [Bounds::EMPTY; SORTED_TO];
    for (ix, others) in others[..frame.layers.len()].iter_mut().enumerate() {
        for other in met(frame, ix) {
            others.join(&world.cache(other as u32).whole);
        }
    }
    let mut due: [Mutex<Option<Due<'_>>>; SORTED_TO] = Default::default();
    let mut n_due = 0;
    let mut caches = caches.iter_mut();
    for (ix, participant) in frame.layers.iter().enumerate() {
        let slot = participant.id.index();
        // Participants come in the order of their slots.
        let cache = caches.find(|(other, _)| *other == slot);
        let Some((_, cache)) = cache else {
            continue;
        };
        let body = frame.body(scene, ix);
        let could = !participant.within && can_be_read(cache, body);
        let is_due = cache.remote.as_ref().is_some_and(|remote| remote.is_due());
        if could && is_due {
            due[n_due] = Mutex::new(Some(Due {
                n_vertices: body.n_vertices(),
                cache,
                others: others[ix],
            }));
            n_due += 1;
        }
    }
    workers.for_each(for_boxes(job, scratches), n_due, |_, ix| {
        let mut due = due[ix].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(due) = &mut *due {
            due.sort();
        }
    });
}

impl Due<'_> {
    fn sort(&mut self) {
        let BodyCache {
            clustering,
            bounds,
            whole,
            remote,
            ..
        } = &mut *self.cache;
        let Some(remote) = remote else {
            return;
        };
        if !remote.sort(clustering, self.n_vertices, bounds, whole, &self.others) {
            self.cache.unsort();
        }
    }
}

impl Found {
    const NOTHING: Found = Found {
        extents: Extents::EMPTY,
        surface: 0.0,
    };
}

/// Does one task.
#[inline(always)]
fn work<S: Simd>(simd: S, world: World<'_>, task: Task) -> Found {
    let positions = world.body(task.participant).positions;
    let cache = world.cache(task.participant);
    let (clustering, run) = (&cache.clustering, task.first as usize..task.end as usize);
    let mut summary = Summary::EMPTY;
    let near = match (task.what, cache.sorted(), positions) {
        (What::Read, Some(sorted), Positions::F32(positions)) => {
            return Found {
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
        // SAFETY: no two tasks name the same node of the same body, and no thread reads boxes before all
        // tasks are done.
        unsafe {
            let of_node = bounds::of_clusters(simd, positions, clustering, clusters, task.leaves);
            if let Some(parents) = task.parents {
                parents.put(node, &of_node.bounds);
            }
            summary.join(&of_node);
        }
    }
    Found {
        extents: Extents {
            whole: summary.bounds,
            all_finite: summary.all_finite,
            ..Extents::EMPTY
        },
        surface: summary.surface,
    }
}
