//! Many bodies: which two are nearest, and whether any two meet.
//!
//! A tree over the bodies' boxes says which pairs of bodies are worth a look. Trees of single
//! bodies are made when they are first needed, so bodies that are far from all others cost their
//! box alone.
//!
//! * **Nearest**: pairs of tree nodes wait in a queue, nearest boxes first. When the next pair is
//!   farther than the best distance so far, no other pair of bodies can be nearer: the rest is
//!   never asked.
//! * **Any**: pairs of bodies whose boxes meet are compared one by one, up to the first two
//!   elements that meet. A scene in which that takes long is left to the whole machinery, which is
//!   faster per pair and slower to start.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::boxes::{self, Extent};
use crate::bvh::bounds::Aabb;
use crate::cpu::top_level::TopLevel;
use crate::cpu::traversal::NodePair;
use crate::plan::Plan;
use crate::query::settings::Settings;
use crate::scene::error::Error;
use crate::scene::index::PartIx;
use crate::scene::vector::dot;
use crate::scene::{Body, Scene};
use crate::search::narrow::intersect;
use crate::simd::{Isa, Simd, with_isa};
use crate::workers::tuning::Tuning;

use super::axes::Axes;
use super::tree::{Node, Tree, box_of, corners};

/// A tree over the boxes of the bodies of a frame.
pub(super) struct Bodies {
    isa: Isa,
    tuning: Tuning,
    /// The stamp of the scene.
    scene: u64,
    /// The slot and the stamp of the positions of each part's body.
    stamps: Vec<(u32, u64)>,
    boxes: Vec<Aabb>,
    tree: TopLevel,
    stack: Vec<NodePair>,
}

/// If only pairs with fewer than one part in so many are wanted, the tree is asked about each of
/// these.
const FEW: usize = 16;

/// Takes a pair of parts, the lower one first; whether no more are wanted.
type Each<'a> = dyn FnMut([PartIx; 2]) -> Result<bool, Error> + 'a;

impl Bodies {
    pub fn new(settings: &Settings) -> Self {
        Bodies {
            isa: Isa::detect(settings.instruction_set),
            tuning: settings.tuning,
            scene: 0,
            stamps: Vec::new(),
            boxes: Vec::new(),
            tree: TopLevel::default(),
            stack: Vec::new(),
        }
    }

    /// Brings boxes and tree up to the scene; the boxes of bodies that have not moved are kept.
    ///
    /// # Errors
    /// Bad positions that were written in place.
    pub fn update(&mut self, scene: &Scene, plan: &Plan) -> Result<(), Error> {
        let n = plan.parts.len();
        let slots = plan.parts.iter().map(|part| part.id.slot());
        if self.scene == scene.stamp() && slots.eq(self.stamps.iter().map(|&(slot, _)| slot)) {
            return Ok(());
        }
        self.scene = 0;
        self.stamps.resize(n, (u32::MAX, 0));
        self.boxes.resize(n, Aabb::EMPTY);
        for (ix, part) in plan.numbered_parts() {
            let body = plan.body(scene, ix);
            let stamp = (part.id.slot(), body.positions_stamp());
            let known = &mut self.stamps[ix.index()];
            if *known != stamp {
                plan.check_one(scene, ix)?;
                *known = stamp;
                self.boxes[ix.index()] = boxes::of_run(body.positions(), 0..body.n_vertices());
            }
        }
        let boxes = &self.boxes;
        self.tree.refit(n, &self.tuning, |part| boxes[part.index()]);
        self.scene = scene.stamp();
        Ok(())
    }

    /// The boxes of two parts' bodies.
    pub fn boxes(&self, parts: [PartIx; 2]) -> [&Aabb; 2] {
        parts.map(|part| &self.boxes[part.index()])
    }

    /// The largest magnitude of a coordinate.
    pub fn magnitude(&self) -> f64 {
        match self.boxes.is_empty() {
            true => 0.0,
            false => Extent::from(&self.tree.root()).magnitude(),
        }
    }

    /// The parts of which every wanted pair has one, if they are few: those that a plan
    /// [names](Plan::named_parts), or all up to `last`.
    pub fn few(&self, plan: &Plan, last: Option<PartIx>) -> Option<Vec<PartIx>> {
        let most = self.boxes.len() / FEW;
        let last = last.filter(|last| last.index() < most);
        plan.named_parts(most)
            .or_else(|| Some(PartIx::up_to(last?.index() + 1).collect()))
    }

    /// Calls `each` for the pairs of parts whose boxes have a point in common, until it returns
    /// true; with `few` only for pairs with one of these, which are in order.
    ///
    /// # Errors
    /// Those of `each`.
    pub fn overlapping(
        &mut self,
        few: Option<&[PartIx]>,
        each: &mut Each<'_>,
    ) -> Result<(), Error> {
        let found = with_isa!(self.isa, overlapping, (
            tree: &TopLevel = &self.tree,
            boxes: &[Aabb] = &self.boxes,
            few: Option<&[PartIx]> = few,
            stack: &mut Vec<NodePair> = &mut self.stack,
            each: &mut Each<'_> = each,
        ) -> Result<(), Option<Error>>);
        found.or_else(|stopped| stopped.map_or(Ok(()), Err))
    }

    /// Pairs of parts whose boxes are apart, nearest boxes first; with `few` only pairs with one of
    /// these, which are in order.
    pub fn apart<'a>(&'a self, few: Option<&'a [PartIx]>) -> Apart<'a> {
        let tree = &self.tree;
        let root = tree.root_node();
        let first = match few {
            None => root.into_iter().collect(),
            Some(few) => tree.leaves(few),
        };
        let pairs = first
            .into_iter()
            .zip(root.into_iter().cycle())
            .map(|nodes| Reverse((0, <[Node; 2]>::from(nodes))));
        Apart {
            tree,
            few,
            waiting: pairs.collect(),
        }
    }
}

/// The pairs of all parts, or of a few with all others.
#[inline(always)]
fn overlapping<S: Simd>(
    simd: S,
    tree: &TopLevel,
    boxes: &[Aabb],
    few: Option<&[PartIx]>,
    stack: &mut Vec<NodePair>,
    each: &mut Each<'_>,
) -> Result<(), Option<Error>> {
    let mut each = |pair| match each(pair) {
        Ok(false) => Ok(()),
        Ok(true) => Err(None),
        Err(error) => Err(Some(error)),
    };
    let Some(few) = few else {
        return tree.pairs(simd, stack, |a, b| each([a, b]));
    };
    for &a in few {
        tree.meeting(simd, &boxes[a.index()], stack, |b| {
            if is_second(a, b, few) {
                return Ok(());
            }
            each([a.min(b), a.max(b)])
        })?;
    }
    Ok(())
}

/// Whether a pair of one of a few parts and another one is no pair, or was seen from the other one.
fn is_second(a: PartIx, b: PartIx, few: &[PartIx]) -> bool {
    a == b || (b < a && few.binary_search(&b).is_ok())
}

/// Pairs of nodes that wait, by the squared distances of their boxes.
pub(super) struct Apart<'a> {
    tree: &'a TopLevel,
    /// The parts of which the first one of each pair is, if not all are.
    few: Option<&'a [PartIx]>,
    waiting: BinaryHeap<Reverse<(u64, [Node; 2])>>,
}

impl Apart<'_> {
    /// The next pair, if the squared distance of its boxes is at most `most`, which never grows.
    pub fn next(&mut self, most: f64) -> Option<[PartIx; 2]> {
        while let Some(Reverse((squared, nodes))) = self.waiting.pop() {
            let squared = f64::from_bits(squared);
            if squared > most {
                return None;
            }
            if nodes[1].level > 0 {
                match self.few {
                    None => self.open(nodes, most),
                    Some(_) => self.open_second(nodes, most),
                }
                continue;
            }
            let [x, y] = nodes.map(|node| self.tree.bounds(node));
            let [a, b] = nodes.map(|node| self.tree.part(node));
            let is_seen = match self.few {
                None => a == b,
                Some(few) => is_second(a, b, few),
            };
            if !is_seen && !x.overlaps(&y) {
                return Some([a.min(b), a.max(b)]);
            }
        }
        None
    }

    /// Puts the pairs of a leaf and the children of another node into the queue.
    fn open_second(&mut self, [x, y]: [Node; 2], most: f64) {
        let bounds = Extent::from(&self.tree.bounds(x));
        for child in self.tree.children(y) {
            let squared = Extent::from(&self.tree.bounds(child)).squared_distance(&bounds);
            if squared <= most {
                self.waiting.push(Reverse((squared.to_bits(), [x, child])));
            }
        }
    }

    /// Puts the pairs of children of two nodes of one level into the queue, each pair once.
    fn open(&mut self, [x, y]: [Node; 2], most: f64) {
        let tree = self.tree;
        let within = |node: Node, other: Node| {
            let other = Extent::from(&tree.bounds(other));
            let children = tree
                .children(node)
                .map(|child| (child, Extent::from(&tree.bounds(child))));
            children.filter(move |(_, bounds)| bounds.squared_distance(&other) <= most)
        };
        for (i, x_bounds) in within(x, y) {
            for (j, y_bounds) in within(y, x) {
                let squared = x_bounds.squared_distance(&y_bounds);
                if (x != y || i <= j) && squared <= most {
                    // Bits of numbers that are not negative have their order.
                    self.waiting.push(Reverse((squared.to_bits(), [i, j])));
                }
            }
        }
    }
}

/// Bodies with more vertices are not looked at as a whole.
const MOST_VERTICES: usize = 1024;

/// Whether two bodies are farther apart than a distance, seen along the way between the middles of
/// their boxes: all vertices of one are beyond all of the other's by more. Of many round bodies,
/// most whose boxes are near are told apart so.
///
/// `error` is what rounding may do to heights along that way, and to a distance that is computed.
pub(super) fn are_apart(bodies: [&Body; 2], boxes: [&Aabb; 2], distance: f64, error: f64) -> bool {
    if bodies.iter().any(|body| body.n_vertices() > MOST_VERTICES) {
        return false;
    }
    let Some(axes) = Axes::along(boxes.map(|bounds| bounds.center().map(f64::from))) else {
        return false;
    };
    let way = axes.way();
    let heights = |side: usize| {
        let body: &Body = bodies[side];
        (0..body.n_vertices()).map(move |vertex| dot(way, body.positions().point(vertex)))
    };
    let (low, high) = (
        heights(0).fold(f64::NEG_INFINITY, f64::max),
        heights(1).fold(f64::INFINITY, f64::min),
    );
    high - low > distance + error
}

/// How much work a look at single elements may be, in tests of two boxes.
#[derive(Debug)]
pub(super) struct Allowance(pub u32);

impl Allowance {
    /// Takes some of it; false if it is used up.
    fn take(&mut self, n: usize) -> bool {
        let left = (self.0 as usize).checked_sub(n);
        self.0 = left.unwrap_or(0) as u32;
        left.is_some()
    }
}

/// Whether any elements of two bodies meet; `None` if the allowance does not suffice to say.
pub(super) fn meet(
    bodies: [&Body; 2],
    trees: [&Tree; 2],
    allowance: &mut Allowance,
    stack: &mut Vec<[Node; 2]>,
) -> Option<bool> {
    stack.clear();
    if let (Some(a), Some(b)) = (trees[0].root(), trees[1].root()) {
        stack.push([a, b]);
    }
    while let Some(nodes) = stack.pop() {
        if !allowance.take(1) {
            return None;
        }
        let [x, y] = [0, 1].map(|side| trees[side].bounds_f32(nodes[side]));
        if !x.overlaps(&y) {
            continue;
        }
        let side = usize::from(nodes[1].level > nodes[0].level);
        if nodes[side].level > 0 {
            for child in trees[side].children(nodes[side]) {
                let mut pair = nodes;
                pair[side] = child;
                stack.push(pair);
            }
        } else if compare(bodies, trees, nodes, x.intersection(&y), allowance)? {
            return Some(true);
        }
    }
    Some(false)
}

/// Whether any elements of two clusters meet, which can only be where their boxes overlap.
fn compare(
    bodies: [&Body; 2],
    trees: [&Tree; 2],
    nodes: [Node; 2],
    common: Aabb,
    allowance: &mut Allowance,
) -> Option<bool> {
    let common = Extent::from(&common);
    let within = |side: usize| {
        let elements = trees[side].elements(nodes[side]).iter();
        let boxed = elements.map(move |&element| (element, box_of(bodies[side], element.index())));
        boxed.filter(move |(_, bounds)| bounds.overlaps(&common))
    };
    let mut room = [const { None }; 64];
    let mut n = 0;
    for held in within(1) {
        room[n] = Some(held);
        n += 1;
    }
    if !allowance.take(128) {
        return None;
    }
    if n == 0 {
        return Some(false);
    }
    for (a, box_a) in within(0) {
        if !allowance.take(n) {
            return None;
        }
        for (b, box_b) in room[..n].iter().flatten() {
            if !box_a.overlaps(box_b) {
                continue;
            }
            // A test of two elements takes about as long as eight of two boxes.
            if !allowance.take(8) {
                return None;
            }
            let (a, b) = (corners(bodies[0], a), corners(bodies[1], *b));
            if intersect(bodies[0].kind(), &a, bodies[1].kind(), &b) {
                return Some(true);
            }
        }
    }
    Some(false)
}
