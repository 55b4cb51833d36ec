//! The smallest distance of two bodies, by branch and bound over their clusters' trees.
//!
//! A queue holds pairs of nodes, nearest boxes first. The nearest pair is taken: if both are
//! clusters, their primitives are compared, else one node is replaced by its children. When the
//! next pair is farther than the best distance found so far, that distance is the answer.
//!
//! A pair of nodes is skipped only if its boxes are farther apart than the best distance by more
//! than the rounding error: those along the coordinate axes, or those along the best pair's
//! shortest way and across it. So no pair of primitives is lost whose computed distance is as small
//! or smaller, and the answer does not depend on the order of the search. The pair that was nearest
//! in the last call is compared first: bodies that move little have a good bound from the start.

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, HashMap};
use std::sync::Arc;

use super::axes::{Axes, View};
use super::features::{Gap, gap};
use super::scale::Scale;
use super::shared::shared_point;
use crate::answers::pairs::Element;
use crate::boxes::Extent;

use super::many::{Allowance, Bodies, are_apart, meet};
use super::tree::{Node, Tree, box_along, corners};
use crate::bvh::bounds::round_up;
use crate::clusterings::{BodyPart, Clusterings};
use crate::plan::Plan;
use crate::query::progress::Control;
use crate::query::settings::Settings;
use crate::scene::elements::{BodyKind, Part};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ElementIx, PartIx};
use crate::scene::positions::{Positions, check_positions};
use crate::scene::{Body, Scene};
use crate::search::narrow::intersect;
use crate::search::stats::Stats;
use crate::search::work::Work;
use impinge_exact::Point;
use impinge_exact::internal::filter::Directions64;
use impinge_exact::internal::filter::number::Portable32;

/// Answers about distances, and what is kept from call to call.
pub(crate) struct Distances {
    of_two: OfTwo,
    /// A tree over the bodies of the last question about many.
    many: Bodies,
    /// The bodies that were nearest to each other in it.
    nearest: Option<[BodyId; 2]>,
    /// Two bodies that met when it was last asked whether any do.
    met: Option<[BodyId; 2]>,
    stack: Vec<[Node; 2]>,
}

/// The trees of bodies, and what was found about pairs of them.
struct OfTwo {
    clusterings: Clusterings,
    /// What was clustered.
    stats: Stats,
    /// By the number of the body and the part of it.
    trees: HashMap<(usize, Part), Tree>,
    /// By the numbers of the bodies.
    known: HashMap<[usize; 2], Known>,
}

/// What was found about two bodies when they were asked about last.
#[derive(Clone, Copy)]
struct Known {
    /// The stamps of their positions.
    stamps: [u64; 2],
    answer: KnownDistance,
    /// The elements that were nearest last.
    likely: Option<[ElementIx; 2]>,
}

#[derive(Clone, Copy)]
enum KnownDistance {
    /// The square of the distance, and who has it.
    Is(f64, Nearest),
    /// The square of the distance is above this.
    Above(f64),
}

/// The nearest pair of elements of two bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Nearest {
    /// Their distance in the unit of the scene. 0 if and only if they share a point, which is
    /// decided exactly. Otherwise rounded: it is computed in `f64` from two points of the
    /// primitives, with an error of a few units in the last place of the largest coordinate.
    pub distance: f64,
    /// The element of the first body: of the first that was asked for, or of the lower of the
    /// nearest two of many.
    pub a: Element,
    /// The element of the second body. Of several pairs at the same computed distance, the lowest
    /// by `a` and then by `b`.
    pub b: Element,
    /// The point of each element that is nearest to the other, rounded. Where they touch, a point
    /// that they share, twice: see [`contact`](crate::contact) for all of them.
    pub points: [[f64; 3]; 2],
}

impl Nearest {
    fn new(
        distance: f64,
        bodies: [BodyId; 2],
        elements: [ElementIx; 2],
        points: [Point; 2],
    ) -> Self {
        let [a, b] = [0, 1].map(|side| Element {
            body: bodies[side],
            element: elements[side].raw(),
        });
        Nearest {
            distance,
            a,
            b,
            points,
        }
    }

    fn bodies(&self) -> [BodyId; 2] {
        [self.a.body, self.b.body]
    }

    fn elements(&self) -> [ElementIx; 2] {
        [self.a, self.b].map(|at| ElementIx::new(at.element))
    }
}

impl Distances {
    /// Nothing is known yet but the clusterings that other questions share.
    pub fn new(settings: &Settings, clusterings: Clusterings) -> Self {
        Distances {
            of_two: OfTwo {
                clusterings,
                stats: Stats::default(),
                trees: HashMap::new(),
                known: HashMap::new(),
            },
            many: Bodies::new(settings),
            nearest: None,
            met: None,
            stack: Vec::new(),
        }
    }

    /// Forgets removed bodies: to be called first in each question about trees.
    pub fn begin(&mut self, scene: &Scene) {
        self.of_two.begin(scene);
    }

    /// The smallest distance of two bodies and the pair of primitives that has it; `None` if one
    /// body has no primitives.
    ///
    /// # Errors
    /// A body that is not in the scene, the same body twice, bad positions that were written in
    /// place; cancellation; errors of `touching`, which is asked for the lowest pair that touches
    /// where boxes of many clusters overlap: it may decide by pairs of clusters what this search
    /// would decide one by one.
    pub fn between(
        &mut self,
        scene: &Scene,
        [a, b]: [BodyId; 2],
        work: Work<'_>,
        touching: impl FnOnce() -> Result<Option<[u32; 2]>, Error>,
    ) -> Result<Option<Nearest>, Error> {
        if a == b {
            return Err(Error::SameBody { body: a });
        }
        let of_two = &mut self.of_two;
        of_two.begin(scene);
        for id in [a, b] {
            work.step()?;
            of_two.know(scene, id, Part::Given, work)?;
        }
        let bodies = [scene.body(a)?, scene.body(b)?];
        let boxed = [a, b].into_iter().map(|id| {
            let tree = &of_two.trees[&(id.index(), Part::Given)];
            tree.root()
                .map_or(0.0, |root| tree.bounds(root).magnitude())
        });
        let exact = || {
            let of_bodies = bodies.map(|body| body.positions().magnitude());
            of_bodies[0].max(of_bodies[1])
        };
        let scale = Scale::of(boxed.fold(0.0, f64::max), exact);
        let most = (scale, f64::INFINITY);
        let found = of_two.search_or_ask(scene, [a, b], most, work.control, touching)?;
        Ok(found.map(|(_, nearest)| nearest))
    }

    /// The two nearest of the bodies of a frame that may meet, and their nearest elements. Of
    /// several pairs at the same computed distance the lowest.
    ///
    /// # Errors
    /// Cancellation; errors of `touching`, which is asked as in [`between`](Distances::between).
    pub fn nearest(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        work: Work<'_>,
        mut touching: impl FnMut([BodyId; 2]) -> Result<Option<[u32; 2]>, Error>,
    ) -> Result<Option<Nearest>, Error> {
        let Distances { of_two, many, .. } = self;
        of_two.begin(scene);
        many.update(scene, plan)?;
        // The bodies that were nearest last are a good bound.
        let likely = self.nearest.map(|ids| ids.map(|id| plan.part_of(id)));
        let scale = Scale::of(many.magnitude(), || {
            let bodies = plan
                .parts
                .iter()
                .filter_map(|part| scene.body(part.id).ok());
            bodies.fold(0.0, |most, body| body.positions().magnitude().max(most))
        });
        // Squares of distances are in this scale.
        let mut best: Option<(f64, Nearest)> = None;
        let error = ROUNDING_TURNED * many.magnitude();
        let mut n_asked = 0;
        let mut ask = |best: &mut Option<(f64, Nearest)>, boxes: &Bodies, [a, b]: [PartIx; 2]| {
            if plan.test(a, b).is_none() {
                return Ok(());
            }
            let ids = [a, b].map(|part| plan.part(part).id);
            let most = best.map_or(f64::INFINITY, |(squared, _)| squared);
            // Nothing is nearer than 0, and no lower pair of bodies is asked later.
            if most == 0.0 && best.is_some_and(|(_, best)| best.bodies() <= ids) {
                return Ok(());
            }
            let pair = [a, b];
            let bodies = pair.map(|part| plan.body(scene, part));
            if scale.is_one() && are_apart(bodies, boxes.boxes(pair), most.sqrt(), error) {
                return Ok(());
            }
            n_asked += 1;
            work.control.step(n_asked, n_asked + 1)?;
            for id in ids {
                of_two.know(scene, id, Part::Given, work)?;
            }
            let ask = || touching(ids);
            let found = of_two.search_or_ask(scene, ids, (scale, most), work.control, ask)?;
            if let Some(found) = found
                && best.is_none_or(|(squared, best)| {
                    found.0 < squared || (found.0 == squared && ids < best.bodies())
                })
            {
                *best = Some(found);
            }
            Ok::<(), Error>(())
        };
        if let Some([Some(a), Some(b)]) = likely {
            ask(&mut best, many, [a, b])?;
        }
        let mut overlapping = Vec::new();
        // If two touch, only lower ones that touch are left to be found.
        let least = touching_ones(best);
        let last = least.and_then(|[a, _]| plan.part_of(a));
        many.overlapping(last, &mut |pair| {
            let is_lower = |least: [BodyId; 2]| pair.map(|part| plan.part(part).id) < least;
            if least.is_none_or(is_lower) {
                overlapping.push(pair);
            }
            Ok(false)
        })?;
        overlapping.sort_unstable();
        for pair in overlapping {
            ask(&mut best, many, pair)?;
        }
        // Bodies whose boxes are apart do not touch.
        if touching_ones(best).is_none() {
            let mut apart = many.apart();
            let most = |best: Option<(f64, Nearest)>| match best {
                None => f64::INFINITY,
                // A square that underflows is far below that of the error.
                Some((squared, _)) => limit(scale.length_back(squared.sqrt()).powi(2), error),
            };
            while let Some(pair) = apart.next(most(best)) {
                ask(&mut best, many, pair)?;
            }
        }
        let nearest = best.map(|(_, nearest)| nearest);
        self.nearest = nearest.map(|nearest| nearest.bodies());
        Ok(nearest)
    }

    /// Whether any elements of bodies of a frame meet, if that is soon known. The frame must be
    /// about pairs of different bodies.
    ///
    /// # Errors
    /// Cancellation.
    pub fn any(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        work: Work<'_>,
    ) -> Result<Option<bool>, Error> {
        let Distances {
            of_two,
            many,
            met,
            stack,
            ..
        } = self;
        of_two.begin(scene);
        many.update(scene, plan)?;
        let mut allowance = Allowance(ALLOWANCE);
        let mut any = Some(false);
        // Bodies that met last may still do so.
        let likely = met.map(|ids| ids.map(|id| plan.part_of(id)));
        let mut ask = |pair: [PartIx; 2]| {
            let [a, b] = pair;
            if plan.test(a, b).is_none() {
                return Ok(false);
            }
            work.step()?;
            let ids = pair.map(|part| plan.part(part).id);
            for id in ids {
                of_two.know(scene, id, Part::Given, work)?;
            }
            let bodies = pair.map(|part| plan.body(scene, part));
            let trees = ids.map(|id| &of_two.trees[&(id.index(), Part::Given)]);
            any = meet(bodies, trees, &mut allowance, stack);
            if any == Some(true) {
                *met = Some(ids);
            }
            Ok(any != Some(false))
        };
        let is_over = match likely {
            Some([Some(a), Some(b)]) => ask([a, b])?,
            _ => false,
        };
        if !is_over {
            many.overlapping(None, &mut ask)?;
        }
        Ok(any)
    }

    /// Says what the last question clustered, and the bytes of the trees.
    pub fn report(&self, stats: &mut Stats) {
        let of_two = &self.of_two;
        (stats.n_clustered, stats.n_reclustered) =
            (of_two.stats.n_clustered, of_two.stats.n_reclustered);
        let beside: usize = of_two.trees.values().map(Tree::bytes).sum();
        stats.bytes_held = (of_two.clusterings.bytes() + beside) as u64;
    }

    /// The tree of a part of a body in its current pose.
    ///
    /// # Errors
    /// A stale id, bad positions that were written in place.
    pub fn tree(
        &mut self,
        scene: &Scene,
        (id, part): (BodyId, Part),
        work: Work<'_>,
    ) -> Result<&Tree, Error> {
        let part = scene.body(id)?.canonical(part);
        let of_two = &mut self.of_two;
        of_two.know(scene, id, part, work)?;
        Ok(&of_two.trees[&(id.index(), part)])
    }
}

impl OfTwo {
    /// Forgets removed bodies: to be called first in each question.
    fn begin(&mut self, scene: &Scene) {
        if self.trees.len() > scene.n_bodies() {
            self.trees.retain(|&(slot, _), _| scene.holds(slot));
        }
        if self.known.len() > MOST_KNOWN * scene.n_bodies().max(MOST_KNOWN) {
            self.known.clear();
        }
        drop(self.clusterings.open(scene));
        self.stats.clear();
    }

    /// As `search`, but where very many boxes overlap `touching` is asked first for the lowest pair
    /// that touches.
    fn search_or_ask(
        &mut self,
        scene: &Scene,
        ids: [BodyId; 2],
        most: (Scale, f64),
        control: &Control,
        touching: impl FnOnce() -> Result<Option<[u32; 2]>, Error>,
    ) -> Result<Found, Error> {
        if let Some(found) = self.search(scene, ids, most, MOST_OVERLAPPING, control)? {
            return Ok(found);
        }
        let Some(primitives) = touching()? else {
            let found = self.search(scene, ids, most, u64::MAX, control)?;
            return Ok(found.flatten());
        };
        let bodies = [scene.body(ids[0])?, scene.body(ids[1])?];
        let elements = primitives.map(ElementIx::new);
        let points = [where_they_touch(bodies, elements); 2];
        let found = Some((0.0, Nearest::new(0.0, ids, elements, points)));
        note(&mut self.known, bodies, f64::INFINITY, (ids, found));
        Ok(found)
    }

    /// The nearest elements of two bodies that are known, and the square of their distance in a
    /// scale, if that is at most `most`. `None` if more pairs of clusters would have to be compared
    /// whose boxes overlap than `most_overlapping`.
    fn search(
        &mut self,
        scene: &Scene,
        ids: [BodyId; 2],
        (scale, most): (Scale, f64),
        most_overlapping: u64,
        control: &Control,
    ) -> Result<Option<Found>, Error> {
        let [a, b] = ids;
        let search = DistanceSearch {
            control,
            ids,
            bodies: [scene.body(a)?, scene.body(b)?],
            trees: ids.map(|id| &self.trees[&(id.index(), Part::Given)]),
            scale,
        };
        let known = self.known.get(&ids.map(BodyId::index));
        if let Some(known) = known
            && scale.is_one()
            && known.stamps == search.bodies.map(Body::positions_stamp)
        {
            match known.answer {
                KnownDistance::Is(squared, nearest) => {
                    return Ok(Some((squared <= most).then_some((squared, nearest))));
                }
                KnownDistance::Above(squared) if most <= squared => return Ok(Some(None)),
                KnownDistance::Above(_) => {}
            }
        }
        let likely = known.and_then(|known| known.likely);
        let bodies = search.bodies;
        let found = search.nearest(likely, most, most_overlapping)?;
        if let Some(found) = found
            && scale.is_one()
        {
            note(&mut self.known, bodies, most, (ids, found));
        }
        Ok(found)
    }

    fn know(&mut self, scene: &Scene, id: BodyId, part: Part, work: Work<'_>) -> Result<(), Error> {
        let body = scene.body(id)?;
        if !body.is_checked() {
            match body.positions() {
                Positions::F32(positions) => check_positions(id, positions)?,
                Positions::F64(positions) => check_positions(id, positions)?,
            }
        }
        let body_part = BodyPart::new(id, body, part);
        let (slot, stats) = (id.index(), &mut self.stats);
        let known = self
            .trees
            .remove(&(slot, part))
            .filter(|tree| tree.fits(body));
        if known.is_none() && part == Part::Given {
            self.known.retain(|numbers, _| !numbers.contains(&slot));
        }
        let own = known.as_ref().map(|tree| &tree.clustering);
        let clustering = self.clusterings.of(body_part, own, work, stats)?;
        let known = known.filter(|tree| Arc::ptr_eq(&tree.clustering, &clustering));
        let mut tree = known.unwrap_or_else(|| Tree::new(body, clustering));
        if tree.refit(body) {
            let (spread, mut all) = (tree.spread(), self.clusterings.lock());
            let renewed = all.renew_if_stale(body_part, (&mut tree.fit, spread), work, stats)?;
            if let Some(clustering) = renewed {
                tree = Tree::new(body, clustering);
                tree.refit(body);
                tree.fit.note(tree.spread());
            }
        }
        self.trees.insert((slot, part), tree);
        Ok(())
    }
}

/// Keeps what was found about two bodies, of all that is at most `most`.
fn note(
    known: &mut HashMap<[usize; 2], Known>,
    bodies: [&Body; 2],
    most: f64,
    (ids, found): ([BodyId; 2], Found),
) {
    let known = known.entry(ids.map(BodyId::index)).or_insert(Known {
        stamps: [0; 2],
        answer: KnownDistance::Above(0.0),
        likely: None,
    });
    known.stamps = bodies.map(Body::positions_stamp);
    known.answer = match found {
        Some((squared, nearest)) => {
            known.likely = Some(nearest.elements());
            KnownDistance::Is(squared, nearest)
        }
        None => KnownDistance::Above(most),
    };
}

/// Two nodes in the queue: nearest first, equally near ones by number.
#[derive(Debug, Clone, Copy, PartialEq)]
struct WaitingNodes {
    squared: f64,
    nodes: [Node; 2],
}

impl Eq for WaitingNodes {}

impl Ord for WaitingNodes {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_distance = self.squared.total_cmp(&other.squared);
        by_distance.then(self.nodes.cmp(&other.nodes))
    }
}

impl PartialOrd for WaitingNodes {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// A primitive of a cluster that is compared.
#[derive(Debug, Clone, Copy)]
struct ComparedPrimitive {
    primitive: ElementIx,
    bounds: Extent,
    /// Along the axes of the view; as `bounds` before there is one.
    turned: Extent,
}

struct DistanceSearch<'a> {
    control: &'a Control,
    ids: [BodyId; 2],
    bodies: [&'a Body; 2],
    trees: [&'a Tree; 2],
    /// All lengths of the search are in this scale.
    scale: Scale,
}

/// The best pair so far.
struct Best {
    squared: f64,
    primitives: [ElementIx; 2],
    points: Option<[Point; 2]>,
}

/// What a search has found, and its memory.
struct FoundDistance {
    best: Best,
    /// The bodies along the best pair's shortest way.
    view: Option<View>,
    /// Whether the best pair is another one than that of the view.
    is_newer: bool,
    /// What rounding may do to distances of boxes: along coordinate axes, and along others.
    errors: [f64; 2],
    lists: [Vec<ComparedPrimitive>; 2],
    directions: Box<[Directions64; 2]>,
}

/// The square of the smallest distance, and who has it; `None` if nothing is as near as was asked
/// for.
type Found = Option<(f64, Nearest)>;

/// Of how many pairs of bodies the answers are kept, for each body.
const MOST_KNOWN: usize = 64;
/// With more pairs of clusters whose boxes overlap, it pays to ask first whether the bodies touch.
const MOST_OVERLAPPING: u64 = 8;
/// From this many pairs of triangles of two clusters on, their normals are tested first.
const DIRECTIONS_FROM: usize = 256;

/// Stands for no element.
const NONE: ElementIx = ElementIx::new(u32::MAX);
/// How much work [`Distances::any`] does before it leaves a scene to the whole machinery: some 50
/// microseconds.
const ALLOWANCE: u32 = 20_000;
/// Pairs of nodes between two looks at the control: a few milliseconds, if all are clusters whose
/// primitives are compared.
const LOOK: u64 = 8;
/// By how much, relative to the largest coordinate, rounding may make a computed distance smaller
/// than the distance of the boxes.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// The same of boxes along other axes, which are rounded themselves.
pub(super) const ROUNDING_TURNED: f64 = 256.0 * f64::EPSILON;

impl FoundDistance {
    /// Squared distances of boxes that may hold a pair as near as the best are at most these: along
    /// coordinate axes, and along others.
    fn limits(&self) -> [f64; 2] {
        self.errors.map(|error| limit(self.best.squared, error))
    }

    fn take(&mut self, best: Best) {
        self.best = best;
        self.is_newer = true;
    }
}

impl DistanceSearch<'_> {
    /// The nearest pair and the square of its distance, if that is at most `most`; `likely` is one
    /// to compare first. `None` if more pairs of clusters would have to be compared whose boxes
    /// overlap than `most_overlapping`.
    ///
    /// # Errors
    /// Cancellation.
    fn nearest(
        &self,
        likely: Option<[ElementIx; 2]>,
        most: f64,
        most_overlapping: u64,
    ) -> Result<Option<Found>, Error> {
        let (Some(a), Some(b)) = (self.trees[0].root(), self.trees[1].root()) else {
            return Ok(Some(None));
        };
        let magnitude = self.bounds(0, a).magnitude();
        let magnitude = magnitude.max(self.bounds(1, b).magnitude());
        let mut found = FoundDistance {
            best: Best {
                squared: most,
                primitives: [NONE; 2],
                points: None,
            },
            view: None,
            is_newer: false,
            errors: [ROUNDING, ROUNDING_TURNED].map(|rounding| rounding * magnitude),
            lists: Default::default(),
            directions: Box::new([const { Directions64::EMPTY }; 2]),
        };
        if let Some(pair) = likely {
            let boxes = [0, 1].map(|side| self.box_of(side, pair[side]));
            self.improve(&mut found, pair, boxes);
            self.look(&mut found);
        }
        let mut waiting = BinaryHeap::from([Reverse(self.waiting([a, b]))]);
        let (mut n_seen, mut n_overlapping) = (0u64, 0u64);
        while let Some(Reverse(next)) = waiting.pop() {
            n_seen += 1;
            if n_seen.is_multiple_of(LOOK) {
                let total = n_seen + waiting.len() as u64;
                self.control.step(n_seen, total)?;
            }
            if next.squared > found.limits()[0] {
                break;
            }
            if self.is_farther(&mut found, next.nodes) {
                continue;
            }
            if next.nodes.iter().all(|node| node.level == 0) {
                n_overlapping += u64::from(next.squared == 0.0);
                if n_overlapping > most_overlapping {
                    return Ok(None);
                }
                self.compare(next.nodes, &mut found);
                self.look(&mut found);
                continue;
            }
            // The node of higher level is opened; at equal levels, the larger one.
            let [x, y] = next.nodes;
            let sizes = [0, 1].map(|side| {
                let bounds = self.bounds(side, next.nodes[side]);
                bounds.squared_diagonal()
            });
            let side = match x.level.cmp(&y.level) {
                Ordering::Greater => 0,
                Ordering::Less => 1,
                Ordering::Equal => usize::from(sizes[1] > sizes[0]),
            };
            let [most, _] = found.limits();
            for child in self.trees[side].children(next.nodes[side]) {
                let nodes = if side == 0 { [child, y] } else { [x, child] };
                let pair = self.waiting(nodes);
                if pair.squared <= most {
                    waiting.push(Reverse(pair));
                }
            }
        }
        let best = found.best;
        if best.primitives == [NONE; 2] {
            return Ok(Some(None));
        }
        let distance = self.scale.length_back(best.squared.sqrt());
        let points = match best.points {
            Some(points) => points.map(|point| self.scale.point_back(point)),
            None => [where_they_touch(self.bodies, best.primitives); 2],
        };
        let nearest = Nearest::new(distance, self.ids, best.primitives, points);
        Ok(Some(Some((best.squared, nearest))))
    }

    /// The box of a node of the first or the second body.
    fn bounds(&self, side: usize, node: Node) -> Extent {
        self.scale.extent(&self.trees[side].bounds(node))
    }

    fn box_of(&self, side: usize, primitive: ElementIx) -> Extent {
        let body = self.bodies[side];
        box_along(body, primitive.index(), |point| self.scale.point(point))
    }

    fn waiting(&self, nodes: [Node; 2]) -> WaitingNodes {
        let [x, y] = [0, 1].map(|side| self.bounds(side, nodes[side]));
        WaitingNodes {
            squared: x.squared_distance(&y),
            nodes,
        }
    }

    /// Turns the view along the shortest way of the best pair, if that is a new one.
    fn look(&self, found: &mut FoundDistance) {
        if !found.is_newer {
            return;
        }
        found.is_newer = false;
        // Bodies that touch have no such way: the last view stays, since any axes are right.
        let Some(axes) = found.best.points.and_then(Axes::along) else {
            return;
        };
        match &mut found.view {
            Some(view) => view.turn_to(axes),
            None => found.view = Some(View::new(axes, self.trees)),
        }
    }

    /// The boxes of two nodes in the view, if there is one.
    fn turned(&self, view: &mut Option<View>, nodes: [Node; 2]) -> Option<[Extent; 2]> {
        let view = view.as_mut()?;
        Some([0, 1].map(|side| {
            let of_node = (self.bodies[side], self.trees[side], nodes[side]);
            view.bounds(side, of_node, self.scale)
        }))
    }

    /// Whether two nodes are seen to be farther apart than the best pair.
    fn is_farther(&self, found: &mut FoundDistance, nodes: [Node; 2]) -> bool {
        let [_, most] = found.limits();
        match self.turned(&mut found.view, nodes) {
            Some([x, y]) => x.squared_distance(&y) > most,
            None => false,
        }
    }

    /// Compares all primitives of two clusters.
    fn compare(&self, nodes: [Node; 2], found: &mut FoundDistance) {
        if found.best.squared == f64::INFINITY {
            self.guess(nodes, found);
            self.look(found);
        }
        let mut lists = std::mem::take(&mut found.lists);
        let whole = [0, 1].map(|side| self.bounds(side, nodes[side]));
        let turned = self.turned(&mut found.view, nodes);
        let limits = found.limits();
        let axes = found.view.as_ref().map(|view| view.axes);
        for side in 0..2 {
            lists[side].clear();
            for &primitive in self.trees[side].primitives(nodes[side]) {
                let bounds = self.box_of(side, primitive);
                if bounds.squared_distance(&whole[1 - side]) > limits[0] {
                    continue;
                }
                let turned = match (&axes, &turned) {
                    (Some(axes), Some(others)) => {
                        let body = self.bodies[side];
                        let turned = box_along(body, primitive.index(), |point| {
                            axes.turn(self.scale.point(point))
                        });
                        if turned.squared_distance(&others[1 - side]) > limits[1] {
                            continue;
                        }
                        turned
                    }
                    _ => bounds,
                };
                lists[side].push(ComparedPrimitive {
                    primitive,
                    bounds,
                    turned,
                });
            }
        }
        // Directions are of coordinates as they are.
        let has_directions =
            self.scale.is_one() && self.put_directions(&lists, &mut found.directions);
        let all = u64::MAX >> 64usize.saturating_sub(lists[1].len()).min(63);
        let mut limits = found.limits();
        for (row, a) in lists[0].iter().enumerate() {
            if a.bounds.squared_distance(&whole[1]) > limits[0] {
                continue;
            }
            let mut far = 0;
            if has_directions {
                let [of_a, of_b] = &*found.directions;
                let distance = round_up(limits[0].sqrt() * (1.0 + f64::EPSILON));
                far = of_b.beyond::<Portable32>(all, (of_a, row), distance);
            }
            for (lane, b) in lists[1].iter().enumerate() {
                if far >> lane & 1 == 1 {
                    continue;
                }
                if a.bounds.squared_distance(&b.bounds) > limits[0]
                    || a.turned.squared_distance(&b.turned) > limits[1]
                {
                    continue;
                }
                let pair = [a.primitive, b.primitive];
                if found.best.squared == 0.0 && pair > found.best.primitives {
                    continue;
                }
                self.improve(found, pair, [a.bounds, b.bounds]);
                limits = found.limits();
            }
        }
        found.lists = lists;
    }

    /// Puts the triangles of two clusters that are left side by side, to be told apart along their
    /// normals, if they are many: boxes of long ones overlap although they are far from each other.
    fn put_directions(
        &self,
        lists: &[Vec<ComparedPrimitive>; 2],
        directions: &mut [Directions64; 2],
    ) -> bool {
        let are_triangles = self
            .bodies
            .iter()
            .all(|body| body.kind() == BodyKind::Triangles);
        if !are_triangles || lists[0].len() * lists[1].len() < DIRECTIONS_FROM {
            return false;
        }
        for side in 0..2 {
            directions[side].begin(3);
            for (lane, compared) in lists[side].iter().enumerate() {
                let [p, q, r, _] = corners(self.bodies[side], compared.primitive);
                directions[side].put(lane, &[p, q, r]);
            }
        }
        directions[0].can_part(&directions[1])
    }

    /// Takes a first pair of two clusters that is likely to be near: what is nearest to a box, to
    /// that, and to that again.
    fn guess(&self, nodes: [Node; 2], found: &mut FoundDistance) {
        let mut boxes = [0, 1].map(|side| self.bounds(side, nodes[side]));
        let mut pair = [ElementIx::new(0); 2];
        for side in [0, 1, 0] {
            let near = |&primitive: &ElementIx| {
                let bounds = self.box_of(side, primitive);
                (bounds.squared_distance(&boxes[1 - side]), primitive, bounds)
            };
            let all = self.trees[side].primitives(nodes[side]).iter().map(near);
            let nearest = all.min_by(|x, y| x.0.total_cmp(&y.0));
            if let Some((_, primitive, bounds)) = nearest {
                (pair[side], boxes[side]) = (primitive, bounds);
            }
        }
        self.improve(found, pair, boxes);
    }

    /// Takes a pair if it is nearer, or as near and lower.
    fn improve(&self, found: &mut FoundDistance, [a, b]: [ElementIx; 2], boxes: [Extent; 2]) {
        let best = &found.best;
        let gap = self.gap(a, b, boxes[0].squared_distance(&boxes[1]));
        let is_less =
            gap.squared < best.squared || (gap.squared == best.squared && [a, b] < best.primitives);
        if is_less {
            found.take(Best {
                squared: gap.squared,
                primitives: [a, b],
                points: (gap.squared > 0.0).then_some(gap.points),
            });
        }
    }

    /// The distance of two primitives: 0 if and only if they meet.
    fn gap(&self, a: ElementIx, b: ElementIx, apart: f64) -> Gap {
        let [body_a, body_b] = self.bodies;
        let (a, b) = (corners(body_a, a), corners(body_b, b));
        // Primitives in boxes that are apart do not meet. But the distance of such boxes may
        // underflow to 0.
        if apart == 0.0 && intersect(body_a.kind(), &a, body_b.kind(), &b) {
            return Gap {
                squared: 0.0,
                points: [a[0], b[0]],
            };
        }
        let [a, b] = [a, b].map(|corners| corners.map(|point| self.scale.point(point)));
        // Points and edges are triangles that repeat their last corner.
        let [n_a, n_b] = [body_a, body_b].map(|body| body.kind().n_corners().max(3));
        let found = gap(&a[..n_a], &b[..n_b]);
        Gap {
            squared: found.squared.max(f64::MIN_POSITIVE),
            ..found
        }
    }
}

/// The two nearest bodies, if they touch.
fn touching_ones(best: Option<(f64, Nearest)>) -> Option<[BodyId; 2]> {
    let touches = best.filter(|(squared, _)| *squared == 0.0);
    touches.map(|(_, nearest)| nearest.bodies())
}

/// A point that two elements share.
fn where_they_touch(bodies: [&Body; 2], elements: [ElementIx; 2]) -> Point {
    let [a, b] = [0, 1].map(|side| corners(bodies[side], elements[side]));
    shared_point(bodies.map(Body::kind), [&a, &b])
}

/// The largest squared distance of boxes that may hold a pair as near as the best.
fn limit(best_squared: f64, error: f64) -> f64 {
    let distance = best_squared.sqrt() + error;
    distance * distance * (1.0 + 8.0 * f64::EPSILON)
}
