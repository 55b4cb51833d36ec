//! The nearest elements of two bodies, by branch and bound over their clusters' trees.
//!
//! A queue holds pairs of nodes, nearest boxes first. The nearest pair is taken: if both are
//! clusters, their elements are compared, else one node is replaced by its children. When the
//! next pair is farther than the best distance found so far, that distance is the answer.
//!
//! A pair of nodes is skipped only if its boxes are farther apart than the best distance by more
//! than the rounding error: those along the coordinate axes, or those along the best pair's
//! shortest way and across it. Distances in `f64` lead the search. Pairs that bounds in `f64`
//! cannot tell from the nearest are settled at the end by their exact distances, rounded down. So
//! no pair of elements is lost whose distance is as small or smaller, and the answer does not
//! depend on the order of the search.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use super::axes::{Axes, TurnedBoxes};
use super::features::{Gap, gap};
use super::nearest::Nearest;
use super::shared::{exact_distance, shared_point};
use super::tree::{Node, Tree, box_along, corners};
use crate::boxes::Extent;
use crate::boxes::scale::Scale;
use crate::bvh::bounds::round_up;
use crate::query::progress::Control;
use crate::scene::Body;
use crate::scene::elements::BodyKind;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::ElementIx;
use crate::search::narrow::intersect;
use impinge_exact::Point;
use impinge_exact::internal::filter::Directions64;
use impinge_exact::internal::filter::number::Portable32;
use impinge_exact::internal::two_sum;

/// The square of the smallest distance as computed in `f64`, and who has it, with the exact one
/// rounded down; `None` if nothing is as near as was asked for.
pub(super) type FoundNearest = Option<(f64, Nearest)>;

/// From this many pairs of triangles of two clusters on, their normals are tested first.
const DIRECTIONS_FROM: usize = 256;

/// Stands for no element.
const NONE: ElementIx = ElementIx::new(u32::MAX);
/// Pairs of nodes between two looks at the control: a few milliseconds, if all are clusters whose
/// elements are compared.
const LOOK: u64 = 8;
/// By how much, relative to the largest coordinate, rounding may make a computed distance smaller
/// than the distance of the boxes.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// The same of boxes along other axes, which are rounded themselves.
pub(super) const ROUNDING_TURNED: f64 = 256.0 * f64::EPSILON;

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

/// An element of a cluster that is compared.
#[derive(Debug, Clone, Copy)]
struct ComparedElement {
    element: ElementIx,
    bounds: Extent,
    /// Along the axes of the view; as `bounds` before there is one.
    turned: Extent,
}

/// A search for the nearest elements of two bodies.
pub(super) struct DistanceSearch<'a> {
    pub control: &'a Control,
    pub ids: [BodyId; 2],
    pub bodies: [&'a Body; 2],
    pub trees: [&'a Tree; 2],
    /// All lengths of the search are in this scale.
    pub scale: Scale,
}

/// From this many pairs on that may be nearest, they are settled before the search goes on.
const MOST_CLOSE: usize = 4096;

/// A pair that may be nearest.
#[derive(Debug, Clone, Copy)]
struct ClosePair {
    elements: [ElementIx; 2],
    /// Its distance is certainly not below this; in the search's scale.
    low: f64,
}

/// The best pair so far.
struct Best {
    squared: f64,
    elements: [ElementIx; 2],
    points: Option<[Point; 2]>,
}

/// What a search has found, and its memory.
struct FoundDistance {
    best: Best,
    /// Pairs that may be as near as the best.
    close: Vec<ClosePair>,
    /// The smallest exact distance of those that are settled, rounded down, and the lowest pair
    /// that has it.
    nearest: Option<(f64, [ElementIx; 2])>,
    /// The bodies along the best pair's shortest way.
    view: Option<TurnedBoxes>,
    /// Whether the best pair is another one than that of the view.
    is_newer: bool,
    /// What rounding may do to distances of boxes: along coordinate axes, and along others.
    errors: [f64; 2],
    lists: [Vec<ComparedElement>; 2],
    directions: Box<[Directions64; 2]>,
}

impl FoundDistance {
    /// Squared distances of boxes that may hold a pair as near as the best are at most these: along
    /// coordinate axes, and along others.
    fn limits(&self) -> [f64; 2] {
        self.errors.map(|error| limit(self.best.squared, error))
    }

    /// The best pair is certainly not farther apart than this.
    fn high(&self) -> f64 {
        self.best.squared.sqrt() + self.errors[0]
    }

    fn take(&mut self, best: Best) {
        self.best = best;
        self.is_newer = true;
    }
}

impl DistanceSearch<'_> {
    /// The nearest pair and the square of its distance, if that is at most `most`, or above it by
    /// no more than rounding; `likely` is one to compare first. `None` if more pairs of clusters
    /// would have to be compared whose boxes overlap than `most_overlapping`.
    ///
    /// # Errors
    /// Cancellation.
    pub(super) fn nearest(
        &self,
        likely: Option<[ElementIx; 2]>,
        most: f64,
        most_overlapping: u64,
    ) -> Result<Option<FoundNearest>, Error> {
        let (Some(a), Some(b)) = (self.trees[0].root(), self.trees[1].root()) else {
            return Ok(Some(None));
        };
        let magnitude = self.bounds(0, a).magnitude();
        let magnitude = magnitude.max(self.bounds(1, b).magnitude());
        let mut found = FoundDistance {
            best: Best {
                squared: most,
                elements: [NONE; 2],
                points: None,
            },
            close: Vec::new(),
            nearest: None,
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
            let [most, _] = found.limits();
            self.open(next.nodes, most, &mut waiting);
        }
        Ok(Some(self.answer(&mut found)))
    }

    /// Puts a node and the children of the other into the queue, if their boxes are near enough.
    /// The node of higher level is opened; at equal levels, the larger one.
    fn open(&self, nodes: [Node; 2], most: f64, waiting: &mut BinaryHeap<Reverse<WaitingNodes>>) {
        let [x, y] = nodes;
        let sizes = [0, 1].map(|side| self.bounds(side, nodes[side]).squared_diagonal());
        let side = match x.level.cmp(&y.level) {
            Ordering::Greater => 0,
            Ordering::Less => 1,
            Ordering::Equal => usize::from(sizes[1] > sizes[0]),
        };
        for child in self.trees[side].children(nodes[side]) {
            let nodes = if side == 0 { [child, y] } else { [x, child] };
            let pair = self.waiting(nodes);
            if pair.squared <= most {
                waiting.push(Reverse(pair));
            }
        }
    }

    fn answer(&self, found: &mut FoundDistance) -> FoundNearest {
        let touching = found.best.elements;
        if found.best.squared == 0.0 && touching != [NONE; 2] {
            let points = [where_they_touch(self.bodies, touching); 2];
            return Some((0.0, Nearest::new(0.0, self.ids, touching, points)));
        }
        self.settle(found);
        let (distance, elements) = found.nearest?;
        let [a, b] = elements;
        let boxes = [0, 1].map(|side| self.box_of(side, elements[side]));
        let gap = self.gap(a, b, boxes[0].squared_distance(&boxes[1]));
        let points = gap.points.map(|point| self.scale.point_back(point));
        let nearest = Nearest::new(distance, self.ids, elements, points);
        Some((gap.squared, nearest))
    }

    /// Finds which of the pairs that may be nearest is. In ascending order: those after the first
    /// of several at one distance need not be measured, but only be proven no nearer.
    fn settle(&self, found: &mut FoundDistance) {
        let high = found.high();
        found.close.retain(|pair| pair.low <= high);
        found.close.sort_unstable_by_key(|pair| pair.elements);
        found.close.dedup_by_key(|pair| pair.elements);
        let kinds = self.bodies.map(Body::kind);
        for ClosePair { elements, low } in found.close.drain(..) {
            // Floats from here on are too far away.
            let limit = match found.nearest {
                None => f64::INFINITY,
                Some((distance, best)) if best <= elements => distance,
                Some((distance, _)) => distance.next_up(),
            };
            if self.scale.is_one() && low >= limit {
                continue;
            }
            let [a, b] = [0, 1].map(|side| corners(self.bodies[side], elements[side]));
            let [n_a, n_b] = kinds.map(BodyKind::n_corners);
            // Beyond the largest float, all are as far apart.
            if limit < f64::INFINITY && apart_along_axes(&a[..n_a], &b[..n_b]) >= limit {
                continue;
            }
            if let Some(distance) = exact_distance(kinds, [&a, &b], limit) {
                found.nearest = Some((distance, elements));
            }
        }
    }

    /// The box of a node of the first or the second body.
    fn bounds(&self, side: usize, node: Node) -> Extent {
        self.scale.extent(&self.trees[side].bounds(node))
    }

    fn box_of(&self, side: usize, element: ElementIx) -> Extent {
        let body = self.bodies[side];
        box_along(body, element.index(), |point| self.scale.point(point))
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
            None => found.view = Some(TurnedBoxes::new(axes, self.trees)),
        }
    }

    /// The boxes of two nodes in the view, if there is one.
    fn turned(&self, view: &mut Option<TurnedBoxes>, nodes: [Node; 2]) -> Option<[Extent; 2]> {
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

    /// Compares all elements of two clusters.
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
            for &element in self.trees[side].elements(nodes[side]) {
                let bounds = self.box_of(side, element);
                if bounds.squared_distance(&whole[1 - side]) > limits[0] {
                    continue;
                }
                let turned = match (&axes, &turned) {
                    (Some(axes), Some(others)) => {
                        let body = self.bodies[side];
                        let turned = box_along(body, element.index(), |point| {
                            axes.turn(self.scale.point(point))
                        });
                        if turned.squared_distance(&others[1 - side]) > limits[1] {
                            continue;
                        }
                        turned
                    }
                    _ => bounds,
                };
                lists[side].push(ComparedElement {
                    element,
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
                let pair = [a.element, b.element];
                if found.best.squared == 0.0 && pair > found.best.elements {
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
        lists: &[Vec<ComparedElement>; 2],
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
                let [p, q, r, _] = corners(self.bodies[side], compared.element);
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
            let near = |&element: &ElementIx| {
                let bounds = self.box_of(side, element);
                (bounds.squared_distance(&boxes[1 - side]), element, bounds)
            };
            let all = self.trees[side].elements(nodes[side]).iter().map(near);
            let nearest = all.min_by(|x, y| x.0.total_cmp(&y.0));
            if let Some((_, element, bounds)) = nearest {
                (pair[side], boxes[side]) = (element, bounds);
            }
        }
        self.improve(found, pair, boxes);
    }

    /// Takes a pair if it is nearer, or as near and lower, and notes it if it may be.
    fn improve(&self, found: &mut FoundDistance, [a, b]: [ElementIx; 2], boxes: [Extent; 2]) {
        let best = &found.best;
        let gap = self.gap(a, b, boxes[0].squared_distance(&boxes[1]));
        let is_less =
            gap.squared < best.squared || (gap.squared == best.squared && [a, b] < best.elements);
        if is_less {
            found.take(Best {
                squared: gap.squared,
                elements: [a, b],
                points: (gap.squared > 0.0).then_some(gap.points),
            });
        }
        if gap.squared > 0.0 && gap.low <= found.high() {
            found.close.push(ClosePair {
                elements: [a, b],
                low: gap.low,
            });
            if found.close.len() >= MOST_CLOSE {
                self.settle(found);
            }
        }
    }

    /// The distance of two elements: 0 if they meet.
    fn gap(&self, a: ElementIx, b: ElementIx, apart: f64) -> Gap {
        let [body_a, body_b] = self.bodies;
        let (a, b) = (corners(body_a, a), corners(body_b, b));
        // Elements in boxes that are apart do not meet. But the distance of such boxes may
        // underflow to 0.
        if apart == 0.0 && intersect(body_a.kind(), &a, body_b.kind(), &b) {
            return Gap {
                squared: 0.0,
                points: [a[0], b[0]],
                low: 0.0,
            };
        }
        let [a, b] = [a, b].map(|corners| corners.map(|point| self.scale.point(point)));
        // Points and edges are triangles that repeat their last corner.
        let [n_a, n_b] = [body_a, body_b].map(|body| body.kind().n_corners().max(3));
        let (a, b) = (&a[..n_a], &b[..n_b]);
        let found = gap(a, b);
        Gap {
            squared: found.squared.max(f64::MIN_POSITIVE),
            low: found.at_least(a, b),
            ..found
        }
    }
}

/// The largest float that is at most the gap of two elements along some coordinate axis.
fn apart_along_axes(a: &[Point], b: &[Point]) -> f64 {
    let [a, b] = [a, b].map(|corners| Extent::of(corners.iter().copied()));
    let gap = |high: f64, low: f64| match two_sum(high, -low) {
        [gap, rest] if rest < 0.0 => gap.next_down(),
        [gap, _] => gap,
    };
    (0..3).fold(0.0, |most: f64, k| {
        most.max(gap(b.min[k], a.max[k]))
            .max(gap(a.min[k], b.max[k]))
    })
}

/// A point that two elements share.
pub(super) fn where_they_touch(bodies: [&Body; 2], elements: [ElementIx; 2]) -> Point {
    let [a, b] = [0, 1].map(|side| corners(bodies[side], elements[side]));
    shared_point(bodies.map(Body::kind), [&a, &b])
}

/// The largest squared distance of boxes that may hold a pair as near as the best.
pub(super) fn limit(best_squared: f64, error: f64) -> f64 {
    let distance = best_squared.sqrt() + error;
    distance * distance * (1.0 + 8.0 * f64::EPSILON)
}
