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
//! later. They stop more than they must, as where a sheet flies within its own plane. So only groups
//! in which a pair still meets get them; all other vertices are not taken back.
//!
//! Cost: a search for overlapping boxes. Memory: a run of pairs, a number per vertex.
//!
//! Source: "Divide and Truncate" has planes for all pairs, in its only round.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::{Detector, Pair, TASK, Vertices, WHOLE, located};
use crate::plan::{Plan, TestId};
use crate::query::step::Start;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::search::found::PairList;
use crate::search::narrow::exact_kind;
use crate::search::sink::{filled, grow, reserve};
use impinge_exact::are_within;
use impinge_exact::internal::shares_at_rest;

impl Detector {
    /// Stops the vertices of all groups in which a pair touches, so that none does any more.
    /// Returns the pairs that stopped vertices.
    ///
    /// # Errors
    /// Cancellation; no memory.
    pub(super) fn part(
        &mut self,
        vertices: &mut Vertices,
        scene: &Scene,
        (now, plan): (&Scene, &Plan),
    ) -> Result<PairList, Error> {
        const WHAT: &str = "pairs that stopped vertices";
        let groups = Groups::new(vertices.all.len(), scene)?;
        let mut rounded = plan.clone();
        rounded.round(now);
        let plan = &rounded;
        let held: &Vertices = vertices;
        let mut stopped = PairList::new();
        self.each_overlap((now, plan), |run, work| {
            let all = Mutex::new(&mut stopped);
            for (kind, keys) in run.keys() {
                let Some(pair) = exact_kind(TestId::Elements(kind)) else {
                    continue;
                };
                let mut tasks: Vec<&[u64]> = keys.chunks(work.workers.task(TASK)).collect();
                work.each(&mut tasks, |_, keys| {
                    let parts = |key: &u64| held.part((pair, *key), (now, plan), &groups);
                    let own = Vec::from_iter(keys.iter().copied().filter(parts));
                    let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
                    grow(&mut all, own.len(), WHAT)?;
                    all.extend(own.into_iter().map(|key| (kind, key)));
                    Ok(())
                })?;
            }
            Ok(())
        })?;
        let mut meet = filled(false, held.all.len(), "vertices")?;
        let mover = |(kind, key)| {
            let pair = exact_kind(TestId::Elements(kind))?;
            let points = held.points(&located(plan, pair, key), (now, plan));
            points.moving().next().map(|ix| groups.of(points.own[ix]))
        };
        for (kind, found) in self.steps.contacts.found() {
            if let Some(group) = mover((kind, found.key)) {
                meet[group] = true;
            }
        }
        stopped.retain(|&pair| mover(pair).is_some_and(|group| meet[group]));
        for (vertex, most) in vertices.most.iter_mut().enumerate() {
            if !meet[groups.of(vertex)] {
                *most.get_mut() = WHOLE;
            }
        }
        Ok(stopped)
    }
}

impl Vertices {
    /// Parts a pair whose boxes overlap by planes that rest. Returns whether this stops a vertex.
    fn part(&self, (pair, key): Pair, (now, plan): (&Scene, &Plan), groups: &Groups) -> bool {
        let located = located(plan, pair, key);
        let points = self.points(&located, (now, plan));
        let mut moving = points.moving().map(|ix| points.own[ix]);
        let Some(first) = moving.next() else {
            return false;
        };
        if !plan.counts(now, key) {
            return false;
        }
        let kept = plan.kept(now, located, pair, [&points.start, &points.end]);
        let [(a, _), (b, _)] = located;
        let shares = shares_at_rest(pair, points.times(), kept, plan.rounded(a, b));
        let skips = plan.start == Start::Skip;
        if shares.is_none() && skips && are_within(pair, &points.start, kept) {
            return false;
        }
        moving.for_each(|vertex| groups.join(first, vertex));
        // Without so much room they stay where they start.
        self.stop_by(&points, &shares.unwrap_or([0.0; 4]))
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
            // Shortens the way for the next one; what is lost to other threads is no more than that.
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
