//! Culled clusters: proven, without their boxes, to be beside all other bodies.
//!
//! Computing a cluster's box reads vertices from all over memory; reading vertices in memory order
//! costs a fraction of that. Bodies that meet mostly do so with only a part of them, and clusters
//! that lie beside the other body mostly stay there for many frames. So clusters are *sorted*:
//! those that lie beside all bodies that their body could meet go into one of six groups, below or
//! above them along x, y or z.
//!
//! ```text
//!            below, x |  near   | above, x
//!   body    .c..c..c..|c.c.c..cc|..c...
//!   others            [.........]
//! ```
//!
//! Each frame reads all positions in order and finds the interval that each group spans along its
//! axis, and the box of the whole body. A group whose interval touches no other body's box is
//! proven *culled*, however bodies have moved: none of its elements can be in a pair, and its
//! clusters keep empty boxes. A group that touches another box has come back: its clusters are near
//! in this frame and are sorted again at its end, with more slack between them and the others if
//! the group came back soon.
//!
//! In: boxes of clusters, then positions frame by frame. Out: which clusters' boxes a frame needs.
//!
//! The stage `bounds` asks three questions per frame: [`plan`], before it reads positions, which
//! boxes a body needs; [`prove`], once positions are read, which it needs besides; [`learn`], once
//! all boxes are known, sorts clusters for the next frame.

pub(super) mod body;
pub(super) mod extents;
mod outlook;

use std::sync::{Mutex, PoisonError};

use crate::bvh::bounds::Aabb;
use crate::plan::Plan;
use crate::query::settings::Settings;
use crate::scene::Body;
use crate::scene::index::PartIx;
use crate::search::runner::Job;
use crate::search::stats::Stats;

use super::pairing::Worker;
use super::world::{BodyCache, Caches, World};
use crate::simd::Isa;
use extents::FreeSides;

/// Clusters are sorted in frames of at most this many bodies: more bodies are everywhere.
const MOST_BODIES: usize = 8;

/// The boxes of a body that a frame needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Needed {
    /// No more than are known.
    None,
    /// Boxes of near clusters only, in `n_nodes` nodes of the tree. All positions are still read
    /// once, in `n_runs` runs.
    Near { n_nodes: usize, n_runs: usize },
    /// Those of all clusters.
    All,
}

/// Whether clusters may be left out of a frame.
pub(super) fn is_allowed(isa: Isa, plan: &Plan, settings: &Settings) -> bool {
    isa.reads_runs()
        && plan.between()
        && plan.parts.len() <= MOST_BODIES
        && settings.memory_budget.is_none()
}

/// The boxes that a body needs in its new pose. Known boxes become outdated if they are those of
/// near clusters only and the frame needs more.
pub(super) fn plan(cache: &mut BodyCache, body: &Body, is_allowed: bool) -> Needed {
    if !is_allowed {
        // The next frames may need all boxes too.
        if let Some(culled) = &mut cache.culled {
            culled.interrupt();
        }
        unsort(cache);
    } else if !cache
        .sorted()
        .is_some_and(|sorted| sorted.is_fit_for(body.n_vertices()))
    {
        unsort(cache);
    }
    if cache.positions_stamp == body.positions_stamp() {
        return Needed::None;
    }
    if let Some(culled) = &mut cache.culled {
        culled.begin();
    }
    cache.sorted().map_or(Needed::All, |sorted| Needed::Near {
        n_nodes: sorted.near().len(),
        n_runs: sorted.n_runs(),
    })
}

/// Proves that the groups of a body are beside all bodies that it could meet. Returns the boxes
/// that it needs besides: of the clusters that are near now, if groups have come back; of all, if
/// groups come back too often.
pub(super) fn prove(job: Job<'_>, caches: &mut Caches, part: PartIx, stats: &mut Stats) -> Needed {
    let Job { scene, plan, .. } = job;
    let world = World {
        scene,
        plan,
        caches: Some(caches),
    };
    let Some(back) = back(world, part) else {
        return Needed::None;
    };
    let cache = caches.at_mut(plan.part(part));
    let Some(culled) = &mut cache.culled else {
        return Needed::None;
    };
    let mut needed = Needed::None;
    if !back.is_empty() {
        if !culled.come_back(back, &cache.clustering) {
            unsort(cache);
            return Needed::All;
        }
        stats.ways.n_came_back += back.sides().count() as u64;
        needed = Needed::Near {
            n_nodes: culled.near().len(),
            n_runs: 0,
        };
    }
    stats.n_culled += (cache.clustering.n_clusters() - culled.n_near()) as u64;
    needed
}

/// Sorts the clusters of all bodies for which that is due.
pub(super) fn learn(job: Job<'_>, caches: &mut Caches, scratches: &mut [Worker]) {
    let Job {
        scene,
        plan,
        workers,
        ..
    } = job;
    let world = World {
        scene,
        plan,
        caches: Some(caches),
    };
    let mut others = [Aabb::EMPTY; MOST_BODIES];
    for (part, others) in plan.part_ixs().zip(&mut others) {
        for other in lane_pairs(plan, part) {
            others.join(&world.cache(other).whole);
        }
    }
    let mut due: [Mutex<Option<Due<'_>>>; MOST_BODIES] = Default::default();
    let mut n_due = 0;
    let mut caches = caches.iter_mut();
    for (ix, part) in plan.numbered_parts() {
        let slot = part.id.index();
        // Parts come in the order of their slots.
        let cache = caches.find(|(other, _)| *other == slot);
        let Some((_, cache)) = cache else {
            continue;
        };
        let body = plan.body(scene, ix);
        let could = !part.within && cache.can_be_read(body);
        let is_due = cache.culled.as_ref().is_some_and(|culled| culled.is_due());
        if could && is_due {
            due[n_due] = Mutex::new(Some(Due {
                n_vertices: body.n_vertices(),
                cache,
                others: others[ix.index()],
            }));
            n_due += 1;
        }
    }
    workers.for_each(scratches, n_due, |_, ix| {
        let mut due = due[ix].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(due) = &mut *due {
            due.sort();
        }
    });
}

/// The parts that a part could meet.
fn lane_pairs(plan: &Plan, part: PartIx) -> impl Iterator<Item = PartIx> {
    let others = plan.part_ixs().filter(move |&other| other != part);
    others.filter(move |&other| plan.test(part, other).is_some())
}

/// The groups of a part that are not beside all bodies that it could meet; `None` if its clusters
/// are not sorted.
fn back(world: World<'_>, part: PartIx) -> Option<FreeSides> {
    let sorted = world.cache(part).sorted()?;
    let groups =
        lane_pairs(world.plan, part).map(|other| sorted.back_at(&world.cache(other).whole));
    Some(groups.fold(FreeSides::default(), FreeSides::union))
}

/// Ends the sorting of a body; all its boxes must be found again.
fn unsort(cache: &mut BodyCache) {
    if cache.culled.as_mut().is_some_and(|culled| culled.end()) {
        cache.forget_boxes();
    }
}

/// A body whose clusters are to be sorted, and the joint box of all bodies that it could meet.
struct Due<'a> {
    n_vertices: usize,
    cache: &'a mut BodyCache,
    others: Aabb,
}

impl Due<'_> {
    fn sort(&mut self) {
        let BodyCache {
            clustering,
            bounds,
            whole,
            culled,
            ..
        } = &mut *self.cache;
        let Some(culled) = culled else {
            return;
        };
        if !culled.sort(clustering, self.n_vertices, bounds, whole, &self.others) {
            unsort(self.cache);
        }
    }
}
