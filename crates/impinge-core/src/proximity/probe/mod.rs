//! Probes: where points lie, and what is nearest to them.
//!
//! What it does: says of points whether they are inside a body, on its surface or outside, in which
//! tetrahedron they are, and which elements of some bodies are nearest to each of them.
//!
//! How: a probe is a box of its own. It goes down the tree of the body's clusters, which all
//! questions share, past the boxes of 64 elements at a time, to the elements that it may meet.
//! These are decided one by one with exact signs.
//!
//! In: bodies, whose clusters are refitted when they have moved, and points in either precision.
//! Out: one answer per point.
//!
//! Cost: the trees as for distances of bodies; 24 bytes per element of the clusters that probes
//! come to, and 36 for the corners of faces where nearest ones are sought; then per point a way
//! down the tree. Points are shared among the workers; each point's answer depends on nothing but
//! the point and the bodies.

mod border;
mod boxes;
mod cast;
mod closest;
mod inside;
mod order;

use std::collections::HashMap;
use std::sync::Arc;

use crate::answers::closest::ClosestElement;
use crate::answers::hits::{Hits, RayHit};
use crate::contact::Topologies;
use crate::proximity::Distances;
use crate::query::{Query, Scope, SharedVertex};
use crate::scene::by_body::ByBody;
use crate::scene::elements::{BodyKind, Part};
use crate::scene::error::{Error, shown};
use crate::scene::ids::BodyId;
use crate::scene::positions::Real;
use crate::scene::{Body, Scene};
use crate::search::sink::{filled, grow, reserve, with_capacity};
use crate::search::work::Work;
use crate::simd::Isa;

use border::Border;
use boxes::Boxes;
use impinge_exact::Point;
use impinge_exact::internal::Ray;

/// What is kept of the bodies that were probed, from call to call.
#[derive(Debug)]
pub(crate) struct Probes {
    isa: Isa,
    /// By the number of the body and the part of it.
    boxes: HashMap<(usize, Part), Boxes>,
    /// By the number of the body.
    borders: ByBody<Border>,
}

/// A body that is probed.
#[derive(Clone, Copy)]
struct Target<'a> {
    body: &'a Body,
    boxes: &'a Boxes,
}

/// What a detector keeps for other questions too.
pub(crate) struct Shared<'a> {
    pub distances: &'a mut Distances,
    pub topologies: &'a mut Topologies,
}

/// Points per task.
const TASK: usize = 256;
/// What memory is for.
const WHAT: &str = "elements nearest to points";
const HITS: &str = "hits of rays";
/// Points that are put in order at once: some 30 milliseconds.
const BLOCK: usize = 1 << 19;

impl Probes {
    /// Nothing is known yet.
    pub fn new(isa: Isa) -> Self {
        Probes {
            isa,
            boxes: HashMap::new(),
            borders: ByBody::default(),
        }
    }

    /// Bytes held beside the clusters and their trees.
    pub fn bytes(&self) -> u64 {
        let boxes: usize = self.boxes.values().map(Boxes::bytes).sum();
        let borders: usize = self.borders.values().map(Border::bytes).sum();
        (boxes + borders) as u64
    }

    /// Whether each point is inside a body (1), on its surface (0) or outside (-1).
    ///
    /// # Errors
    /// A stale id, a body of another kind than triangles and tetrahedra, a surface that is not
    /// closed, positions or points that are not finite, cancellation.
    pub fn contains<R: Real>(
        &mut self,
        scene: &Scene,
        id: BodyId,
        points: &[[R; 3]],
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<Vec<i8>, Error> {
        check_points("points", points)?;
        let body = scene.body(id)?;
        match body.kind() {
            BodyKind::Triangles => shared.topologies.know(scene, id, work)?,
            BodyKind::Tetrahedra => self.know_border(id, body, work)?,
            kind => {
                return Err(Error::WrongKind {
                    body: id,
                    kind: kind.name(),
                    expected: "triangles or tetrahedra",
                });
            }
        }
        self.know(scene, &[(id, Part::Given)], shared, work)?;
        let target = self.target(scene, id)?;
        match body.kind() {
            BodyKind::Tetrahedra => {
                let border = self.borders.get(id).expect("known now");
                self.ask(inside::InTetrahedra { border }, target, points, work)
            }
            _ => self.ask(inside::InSurface, target, points, work),
        }
    }

    /// How often a closed surface winds around each point; none on the surface.
    ///
    /// # Errors
    /// As [`contains`](Self::contains), and a body of tetrahedra.
    pub fn winding_numbers<R: Real>(
        &mut self,
        scene: &Scene,
        id: BodyId,
        points: &[[R; 3]],
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<Vec<Option<i32>>, Error> {
        check_points("points", points)?;
        check_kind(scene, id, BodyKind::Triangles)?;
        shared.topologies.know(scene, id, work)?;
        self.know(scene, &[(id, Part::Given)], shared, work)?;
        self.ask(inside::Around, self.target(scene, id)?, points, work)
    }

    /// The lowest tetrahedron of a body that contains each point.
    ///
    /// # Errors
    /// A stale id, a body of another kind than tetrahedra, positions or points that are not finite,
    /// cancellation.
    pub fn locate<R: Real>(
        &mut self,
        scene: &Scene,
        id: BodyId,
        points: &[[R; 3]],
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<Vec<Option<u32>>, Error> {
        check_points("points", points)?;
        check_kind(scene, id, BodyKind::Tetrahedra)?;
        self.know(scene, &[(id, Part::Given)], shared, work)?;
        self.ask(inside::Lowest, self.target(scene, id)?, points, work)
    }

    /// A body whose boxes are known.
    fn target<'a>(&'a self, scene: &'a Scene, id: BodyId) -> Result<Target<'a>, Error> {
        Ok(Target {
            body: scene.body(id)?,
            boxes: &self.boxes[&(id.index(), Part::Given)],
        })
    }

    /// The answer about each point of a body.
    ///
    /// # Errors
    /// Cancellation.
    fn ask<R: Real, Q: inside::PointTest>(
        &self,
        question: Q,
        target: Target<'_>,
        points: &[[R; 3]],
        work: Work<'_>,
    ) -> Result<Vec<Q::Answer>, Error> {
        let mut answers = filled(Q::OUTSIDE, points.len(), "answers about points")?;
        let size = work.workers.task(TASK);
        let mut tasks: Vec<_> = points.chunks(size).zip(answers.chunks_mut(size)).collect();
        work.each(&mut tasks, |_, (points, answers)| {
            let mut widened: Vec<Point> = with_capacity(points.len(), "points")?;
            widened.extend(points.iter().map(|point| point.map(R::widen)));
            inside::ask(self.isa, question, target, &widened, answers, work)
        })?;
        Ok(answers)
    }

    /// The nearest elements of some bodies to each point that are at most a distance away: faces,
    /// or of bodies without faces edges or points. As many entries per point as the query says.
    ///
    /// # Errors
    /// A query that is not about whole bodies, a distance that is none, positions or points that
    /// are not finite, cancellation.
    pub fn closest<R: Real>(
        &mut self,
        scene: &Scene,
        (query, most): (&Query, f64),
        points: &[[R; 3]],
        found: &mut Vec<Option<ClosestElement>>,
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<(), Error> {
        check_most(most, "a length of at least 0, or infinity")?;
        check_points("points", points)?;
        if query.n_nearest == 0 {
            return Err(Error::Setting {
                setting: "n_nearest",
                given: "0".to_owned(),
                allowed: "a number of at least 1",
            });
        }
        let n_nearest = query.n_nearest as usize;
        let parts = surfaces(scene, query)?;
        self.know(scene, &parts, shared, work)?;
        let bodies = self.targets(scene, &parts)?;
        found.clear();
        let n_rows = points.len().saturating_mul(n_nearest);
        reserve(found, n_rows, WHAT)?;
        found.resize(n_rows, None);
        let block = BLOCK.saturating_mul(n_nearest);
        // While they are found, no more are held than there are.
        let n_elements = bodies
            .iter()
            .map(|(_, target)| target.boxes.clustering.order.len());
        let n_held = n_nearest.min(n_elements.sum()).max(1);
        for (points, found) in points.chunks(BLOCK).zip(found.chunks_mut(block)) {
            // Neighbours one after the other: the element found last is a good first bound, and
            // memory is in the caches.
            let order = order::along_curve(points, WHAT)?;
            let size = work.workers.task(TASK);
            let mut tasks: Vec<(&[u32], Vec<_>)> =
                order.chunks(size).map(|some| (some, Vec::new())).collect();
            work.each(&mut tasks, |_, (some, found)| {
                let mut some_points = with_capacity(some.len(), WHAT)?;
                some_points.extend(some.iter().map(|&ix| points[ix as usize].map(R::widen)));
                *found = filled(None, some_points.len() * n_held, WHAT)?;
                closest::closest(self.isa, &bodies, &some_points, (most, n_held), found, work)
            })?;
            for (some, of_some) in tasks {
                for (&ix, rows) in some.iter().zip(of_some.chunks_exact(n_held)) {
                    found[ix as usize * n_nearest..][..n_held].copy_from_slice(rows);
                }
            }
        }
        Ok(())
    }

    /// What rays hit, of the elements of some bodies.
    ///
    /// # Errors
    /// A query that is not about whole bodies, a largest parameter that is none, another number of
    /// directions than of origins, positions or rays that are not finite, cancellation.
    pub fn cast<R: Real>(
        &mut self,
        scene: &Scene,
        (query, most): (&Query, f64),
        [origins, directions]: [&[[R; 3]]; 2],
        into: &mut Hits,
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<(), Error> {
        check_most(most, "a number of at least 0, or infinity")?;
        if origins.len() != directions.len() {
            return Err(Error::Setting {
                setting: "directions",
                given: format!(
                    "{} origins and {} directions",
                    origins.len(),
                    directions.len()
                ),
                allowed: "as many directions as origins",
            });
        }
        check_points("origins", origins)?;
        check_points("directions", directions)?;
        let parts = surfaces(scene, query)?;
        self.know(scene, &parts, shared, work)?;
        let bodies = self.targets(scene, &parts)?;
        into.found.clear();
        into.offsets.clear();
        into.is_hit.clear();
        reserve(&mut into.offsets, origins.len() + 1, HITS)?;
        reserve(&mut into.is_hit, origins.len(), HITS)?;
        into.offsets.push(0);
        for (origins, directions) in origins.chunks(BLOCK).zip(directions.chunks(BLOCK)) {
            // Rays that start near each other, one after the other, find memory in the caches.
            let order = order::along_curve(origins, HITS)?;
            let size = work.workers.task(TASK);
            let mut tasks: Vec<(&[u32], cast::HitLists)> = order
                .chunks(size)
                .map(|some| (some, Default::default()))
                .collect();
            work.each(&mut tasks, |_, (some, found)| {
                let ray = |&ix: &u32| Ray {
                    origin: origins[ix as usize].map(R::widen),
                    direction: directions[ix as usize].map(R::widen),
                    most,
                };
                let mut rays: Vec<Ray> = with_capacity(some.len(), HITS)?;
                rays.extend(some.iter().map(ray));
                reserve(&mut found.1, some.len(), HITS)?;
                cast::cast(self.isa, &bodies, &rays, query.hits, found, work)
            })?;
            // The list of each ray, and whether it hits anything.
            let none: (&[RayHit], bool) = (&[], false);
            let mut lists = filled(none, origins.len(), HITS)?;
            for (some, (found, ends)) in &tasks {
                let mut from = 0;
                for (&ix, &(to, is_hit)) in some.iter().zip(ends) {
                    lists[ix as usize] = (&found[from..to], is_hit);
                    from = to;
                }
            }
            for (list, is_hit) in lists {
                grow(&mut into.found, list.len(), HITS)?;
                into.found.extend_from_slice(list);
                into.offsets.push(into.found.len());
                into.is_hit.push(is_hit);
            }
        }
        Ok(())
    }

    /// Some parts of bodies, whose boxes are known.
    fn targets<'a>(
        &'a self,
        scene: &'a Scene,
        parts: &[(BodyId, Part)],
    ) -> Result<Vec<(BodyId, Target<'a>)>, Error> {
        let target = |&(id, part): &(BodyId, Part)| {
            let target = Target {
                body: scene.body(id)?,
                boxes: &self.boxes[&(id.index(), part)],
            };
            Ok((id, target))
        };
        let targets = parts.iter().map(target);
        // No box holds anything of a body without elements.
        let is_any = |found: &Result<(_, Target<'a>), _>| !matches!(found, Ok((_, target)) if target.boxes.clustering.n_clusters() == 0);
        targets.filter(is_any).collect()
    }

    /// Refits the boxes of some parts of bodies, and forgets removed bodies.
    fn know(
        &mut self,
        scene: &Scene,
        parts: &[(BodyId, Part)],
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<(), Error> {
        self.boxes.retain(|&(slot, _), _| scene.holds(slot));
        self.borders.forget_removed(scene);
        shared.distances.begin(scene);
        for &(id, part) in parts {
            work.step()?;
            let tree = shared.distances.tree(scene, (id, part), work)?;
            let new = || Boxes::new(Arc::clone(&tree.clustering));
            let boxes = self.boxes.entry((id.index(), part)).or_insert_with(new);
            if !boxes.fits(&tree.clustering) {
                *boxes = new();
            }
            boxes.take(scene.body(id)?, tree.levels());
        }
        Ok(())
    }

    /// Caches which faces of tetrahedra are the border of the body.
    fn know_border(&mut self, id: BodyId, body: &Body, work: Work<'_>) -> Result<(), Error> {
        let known = self.borders.entry(id);
        if !known.as_ref().is_some_and(|border| border.fits(body)) {
            *known = Some(Border::new(body, work)?);
        }
        Ok(())
    }
}

/// The elements that a query is about: the faces of bodies of triangles and tetrahedra, and all of
/// other bodies.
fn surfaces(scene: &Scene, query: &Query) -> Result<Vec<(BodyId, Part)>, Error> {
    let part = |id: BodyId| {
        Ok(match scene.body(id)?.kind() {
            BodyKind::Tetrahedra => (id, Part::Faces),
            _ => (id, Part::Given),
        })
    };
    targets(scene, query)?.into_iter().map(part).collect()
}

/// The bodies that a query is about: all, or those that it names with [`Query::of`] and
/// [`Query::across`].
fn targets(scene: &Scene, query: &Query) -> Result<Vec<BodyId>, Error> {
    let refused = |setting, given: &str| {
        Err(Error::Setting {
            setting,
            given: given.to_owned(),
            allowed: "all bodies, or those that are named by `of` or `across`",
        })
    };
    if query.cell.is_some() {
        return refused("owned_by", "a cell");
    }
    if query.kinds.is_some() {
        return refused("kinds", "kinds of pairs");
    }
    if !query.excluded.is_empty() {
        return refused("exclude", "pairs of bodies");
    }
    if let Some(given) = query.leaves_out_elements() {
        return refused("exclude", given);
    }
    query.check_without_filter()?;
    if query.shared_vertex != SharedVertex::default() {
        return refused("shared_vertex", query.shared_vertex.name());
    }
    match query.scope {
        Scope::All { between: true, .. } => Ok(scene.bodies().map(|(id, _)| id).collect()),
        Scope::Across { .. } => Ok(query.across.iter().copied().collect()),
        _ => refused("query", "pairs of two bodies, or self-collision"),
    }
}

fn check_most(most: f64, allowed: &'static str) -> Result<(), Error> {
    if most >= 0.0 {
        return Ok(());
    }
    Err(Error::Setting {
        setting: "most",
        given: shown(most),
        allowed,
    })
}

/// Refuses a body of another kind.
fn check_kind(scene: &Scene, id: BodyId, expected: BodyKind) -> Result<(), Error> {
    let given = scene.body(id)?.kind();
    if given == expected {
        return Ok(());
    }
    Err(Error::WrongKind {
        body: id,
        kind: given.name(),
        expected: expected.name(),
    })
}

/// Nodes, or exact decisions, between two looks at the control.
const LOOK: u32 = 1 << 10;

/// Of the candidates from one on keeps those of which this is true, in any order.
#[inline(always)]
fn keep_from<T>(candidates: &mut Vec<T>, first: usize, keep: impl Fn(&T) -> bool) {
    let mut kept = first;
    for ix in first..candidates.len() {
        if keep(&candidates[ix]) {
            candidates.swap(kept, ix);
            kept += 1;
        }
    }
    candidates.truncate(kept);
}

/// Looks at the control from time to time.
struct Looks<'a> {
    work: Work<'a>,
    n_seen: u32,
}

impl<'a> Looks<'a> {
    fn new(work: Work<'a>) -> Self {
        Looks { work, n_seen: 0 }
    }

    /// To be called for each.
    ///
    /// # Errors
    /// Cancellation.
    #[inline(always)]
    fn step(&mut self) -> Result<(), Error> {
        self.n_seen += 1;
        if self.n_seen == LOOK {
            self.n_seen = 0;
            self.work.step()?;
        }
        Ok(())
    }
}

/// Refuses the first row that is not finite.
fn check_points<R: Real>(what: &'static str, points: &[[R; 3]]) -> Result<(), Error> {
    if R::all_finite(points.as_flattened()) {
        return Ok(());
    }
    let mut rows = points.iter().map(|point| point.map(R::widen)).enumerate();
    match rows.find(|(_, value)| value.iter().any(|x| !x.is_finite())) {
        Some((row, value)) => Err(Error::NonFinitePoint { what, row, value }),
        None => Ok(()),
    }
}
