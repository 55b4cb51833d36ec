//! The last round: planes that rest, for all that may still meet.
//!
//! ```text
//! overlaps     pairs whose boxes overlap on the ways to where the vertices are now
//! they part    the vertices that cross planes between the two stop before them
//! groups       vertices that such pairs join, directly or through others
//! ```
//!
//! Planes at rest part two elements wherever their vertices stop, so no pair needs to be looked at
//! again: a vertex that is taken back stays on its side, and what had no box in common has none
//! later. They stop more than they must, as where a sheet flies within its own plane. So only
//! groups in which a pair still meets get them; all other vertices are not taken back.
//!
//! Cost: two searches for overlapping boxes, one for the groups and one for those that meet.
//! Memory: a run of pairs, a number per vertex, and the pairs that stop vertices.
//!
//! Source: "Divide and Truncate" has planes for all pairs, in its only round.

use super::{Detector, Pair, PairPoints, TASK, Vertices, located};
use crate::answers::candidates::Candidates;
use crate::plan::{Plan, TestId};
use crate::query::step::Start;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::search::found::PairList;
use crate::search::narrow::exact_kind;
use crate::search::sink::{filled, grow, reserve};
use crate::search::work::Work;
use impinge_exact::are_within;
use impinge_exact::internal::shares_at_rest;
use std::sync::atomic::{AtomicUsize, Ordering};

impl Detector {
    /// Stops the vertices of all groups in which a pair touches, so that none does any more.
    /// Returns the pairs that stopped vertices.
    ///
    /// # Errors
    /// Cancellation; no memory.
    pub(super) fn part(
        &mut self,
        vertices: &Vertices,
        scene: &Scene,
        (now, plan): (&Scene, &Plan),
    ) -> Result<PairList, Error> {
        const WHAT: &str = "pairs that stopped vertices";
        let groups = Groups::new(vertices.all.len(), scene)?;
        let mut rounded = plan.clone();
        rounded.round(now);
        let plan = &rounded;
        self.each_overlap((now, plan), |run, work| {
            those_of(&run, work, |pair| {
                if let Some((points, _)) = vertices.at_rest(pair, (now, plan)) {
                    let mut movers = points.movers();
                    if let Some(first) = movers.next() {
                        movers.for_each(|vertex| groups.join(first, vertex));
                    }
                }
                false
            })?;
            Ok(())
        })?;
        let mut meet = filled(false, vertices.all.len(), "vertices")?;
        for (kind, found) in self.steps.contacts.found() {
            let Some(pair) = exact_kind(TestId::Elements(kind)) else {
                continue;
            };
            let points = vertices.points(&located(plan, pair, found.key), (now, plan));
            if let Some(vertex) = points.movers().next() {
                meet[groups.of(vertex)] = true;
            }
        }
        let mut stopped = PairList::new();
        self.each_overlap((now, plan), |run, work| {
            let own = those_of(&run, work, |pair| {
                let Some((points, shares)) = vertices.at_rest(pair, (now, plan)) else {
                    return false;
                };
                let mut movers = points.movers();
                let meets = movers.next().is_some_and(|vertex| meet[groups.of(vertex)]);
                meets && vertices.stop_by(&points, &shares)
            })?;
            grow(&mut stopped, own.len(), WHAT)?;
            stopped.extend(own);
            Ok(())
        })?;
        Ok(stopped)
    }
}

/// The pairs of a run of which something holds.
fn those_of(
    run: &Candidates,
    work: Work<'_>,
    holds: impl Fn(Pair) -> bool + Sync,
) -> Result<PairList, Error> {
    let mut all = PairList::new();
    for (kind, keys) in run.keys() {
        let Some(pair) = exact_kind(TestId::Elements(kind)) else {
            continue;
        };
        let chunks = keys.chunks(work.workers.task(TASK));
        let mut tasks: Vec<_> = chunks.map(|keys| (keys, Vec::new())).collect();
        work.each(&mut tasks, |_, (keys, own)| {
            own.extend(keys.iter().copied().filter(|&key| holds((pair, key))));
            Ok(())
        })?;
        let found = tasks.into_iter().flat_map(|(_, own)| own);
        all.extend(found.map(|key| (kind, key)));
    }
    Ok(all)
}

impl Vertices {
    /// The points of a pair whose boxes overlap, and the shares of their ways before planes that
    /// rest. `None` if nothing of it moves, or it does not count.
    fn at_rest(
        &self,
        (pair, key): Pair,
        (now, plan): (&Scene, &Plan),
    ) -> Option<(PairPoints, [f64; 4])> {
        let located = located(plan, pair, key);
        let points = self.points(&located, (now, plan));
        if points.moving().next().is_none() || !plan.counts(now, key) {
            return None;
        }
        let kept = plan.kept(now, located, pair, [&points.start, &points.end]);
        let [(a, _), (b, _)] = located;
        let shares = shares_at_rest(pair, points.times(), kept, plan.rounded(a, b));
        let skips = plan.start == Start::Skip;
        if shares.is_none() && skips && are_within(pair, &points.start, kept) {
            return None;
        }
        // Without so much room they stay where they start.
        Some((points, shares.unwrap_or([0.0; 4])))
    }
}

/// Which vertices are joined: each has a parent with a lower number, but for the first of a group.
struct Groups {
    parents: Vec<AtomicUsize>,
}

impl Groups {
    /// A group of each vertex, and of each body that stops as a whole.
    ///
    /// # Errors
    /// There is no memory for them.
    fn new(n: usize, scene: &Scene) -> Result<Self, Error> {
        let mut parents = Vec::new();
        reserve(&mut parents, n, "vertices")?;
        parents.extend((0..n).map(AtomicUsize::new));
        let groups = Groups { parents };
        let mut first = 0;
        for (_, body) in scene.bodies() {
            let own = first..first + body.n_vertices();
            if body.has_end_by_transform() {
                own.clone().for_each(|vertex| groups.join(first, vertex));
            }
            first = own.end;
        }
        Ok(groups)
    }

    /// The first vertex of a vertex's group.
    fn of(&self, mut vertex: usize) -> usize {
        loop {
            let parent = self.parents[vertex].load(Ordering::Relaxed);
            if parent == vertex {
                return vertex;
            }
            // Shortens the way for the next one; no more than that is lost to other threads.
            let next = self.parents[parent].load(Ordering::Relaxed);
            self.parents[vertex].store(next, Ordering::Relaxed);
            vertex = next;
        }
    }

    /// Makes two groups one.
    fn join(&self, a: usize, b: usize) {
        loop {
            let [a, b] = [self.of(a), self.of(b)];
            let (low, high) = (a.min(b), a.max(b));
            let parent = &self.parents[high];
            // Others may have joined it in between.
            let joined = parent.compare_exchange(high, low, Ordering::Relaxed, Ordering::Relaxed);
            if joined.is_ok() {
                return;
            }
        }
    }
}
