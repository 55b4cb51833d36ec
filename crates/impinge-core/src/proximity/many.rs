//! Many bodies: which two are nearest, and whether any two meet.
//!
//! A tree over the bodies' boxes says which pairs of bodies are worth a look. Trees of single bodies are made when they are first
//! needed, so bodies that are far from all others cost their box alone.
//!
//! * **Nearest**: pairs of tree nodes wait in a queue, nearest boxes first. When the next pair is farther than the best
//!   distance so far, no other pair of bodies can be nearer: the rest is never asked.
//! * **Any**: pairs of bodies whose boxes meet are compared one by one, up to the first two elements that meet. A scene in which
//!   that takes long is left to the whole machinery, which is faster per pair and slower to start.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::boxes::{self, Extent};
use crate::bvh::bounds::Bounds;
use crate::bvh::tree::{Entry, TreeShape, order};
use crate::plan::Plan;
use crate::scene::index::PartIx;
use crate::scene::{Body, Scene};
use crate::search::narrow::intersect;

use super::axes::Axes;
use super::features::dot;
use super::tree::{Node, Tree, box_of, corners};

/// A tree over the boxes of the bodies of a frame.
#[derive(Debug, Default)]
pub(super) struct Bodies {
    /// The stamp of the scene.
    scene: u64,
    /// The slot and the stamp of the positions of each part's body.
    stamps: Vec<(u32, u64)>,
    boxes: Vec<Bounds>,
    shape: TreeShape,
    /// The part at each leaf.
    order: Vec<PartIx>,
    /// The boxes of each level's nodes, from the leaves up.
    levels: Vec<Vec<Bounds>>,
    /// The summed surface of the nodes above the leaves when the order was made.
    surface: f64,
    stack: Vec<[Node; 2]>,
}

/// An order whose nodes have grown by this factor is made again.
const STALE: f64 = 1.5;

impl Bodies {
    /// Brings boxes and tree up to the scene; the boxes of bodies that have not moved are kept.
    pub fn update(&mut self, scene: &Scene, plan: &Plan) {
        let n = plan.parts.len();
        let slots = plan.parts.iter().map(|part| part.id.slot());
        if self.scene == scene.stamp() && slots.eq(self.stamps.iter().map(|&(slot, _)| slot)) {
            return;
        }
        self.scene = scene.stamp();
        let mut is_new = self.stamps.len() != n;
        let mut has_moved = is_new;
        self.stamps.resize(n, (u32::MAX, 0));
        self.boxes.resize(n, Bounds::EMPTY);
        for (ix, part) in plan.numbered_parts() {
            let body = plan.body(scene, ix);
            let stamp = (part.id.slot(), body.positions_stamp());
            let known = &mut self.stamps[ix.index()];
            if *known != stamp {
                is_new |= known.0 != stamp.0;
                has_moved = true;
                *known = stamp;
                self.boxes[ix.index()] = boxes::of_run(body.positions(), 0..body.n_vertices());
            }
        }
        if is_new {
            self.shape = TreeShape::new(n);
            self.order.clear();
            self.order.extend(PartIx::up_to(n));
            let n_levels = self.shape.n_levels();
            self.levels.resize_with(n_levels, Vec::new);
            for (level, boxes) in self.levels.iter_mut().enumerate() {
                boxes.resize(self.shape.n_nodes(level), Bounds::EMPTY);
            }
        }
        if has_moved {
            self.refit();
        }
        if is_new || self.surface_now() > STALE * self.surface {
            let entry = |part: PartIx| Entry::new(self.boxes[part.index()].center(), part.raw());
            let mut entries: Vec<Entry> = PartIx::up_to(n).map(entry).collect();
            order(&self.shape, 1, None, &mut entries);
            for (part, entry) in self.order.iter_mut().zip(&entries) {
                *part = PartIx::new(entry.number);
            }
            self.refit();
            self.surface = self.surface_now();
        }
    }

    fn refit(&mut self) {
        let Some(leaves) = self.levels.first_mut() else {
            return;
        };
        for (leaf, part) in leaves.iter_mut().zip(&self.order) {
            *leaf = self.boxes[part.index()];
        }
        for level in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(level);
            for (node, bounds) in above[0].iter_mut().enumerate() {
                *bounds = Bounds::EMPTY;
                for child in &below[level - 1][self.shape.children(level, node)] {
                    bounds.join(child);
                }
            }
        }
    }

    fn surface_now(&self) -> f64 {
        let above = self.levels.iter().skip(1).flatten();
        above.map(Bounds::half_area).filter(|x| x.is_finite()).sum()
    }

    fn root(&self) -> Option<Node> {
        let level = self.levels.len().checked_sub(1)?;
        Some(Node {
            level: level as u32,
            number: 0,
        })
    }

    fn bounds(&self, node: Node) -> &Bounds {
        &self.levels[node.level as usize][node.number as usize]
    }

    fn children(&self, node: Node) -> impl Iterator<Item = Node> + use<> {
        let level = node.level as usize;
        let children = self.shape.children(level, node.number as usize);
        children.map(move |number| Node {
            level: level as u32 - 1,
            number: number as u32,
        })
    }

    /// The parts of two leaves, the lower one first.
    fn parts(&self, [a, b]: [Node; 2]) -> [PartIx; 2] {
        let [a, b] = [a, b].map(|leaf| self.order[leaf.number as usize]);
        [a.min(b), a.max(b)]
    }

    /// The boxes of two parts' bodies.
    pub fn boxes(&self, parts: [PartIx; 2]) -> [&Bounds; 2] {
        parts.map(|part| &self.boxes[part.index()])
    }

    /// The largest magnitude of a coordinate.
    pub fn magnitude(&self) -> f64 {
        let root = self.root().map(|root| Extent::from(self.bounds(root)));
        root.map_or(0.0, |root| root.magnitude())
    }

    /// Calls `each` for the pairs of parts whose boxes have a point in common, until it returns true.
    pub fn overlapping<E>(
        &mut self,
        mut each: impl FnMut([PartIx; 2]) -> Result<bool, E>,
    ) -> Result<(), E> {
        let mut stack = std::mem::take(&mut self.stack);
        stack.clear();
        stack.extend(self.root().map(|root| [root; 2]));
        let mut found = Ok(false);
        while let Some([x, y]) = stack.pop() {
            if x.level == 0 {
                if x != y {
                    found = each(self.parts([x, y]));
                    if !matches!(found, Ok(false)) {
                        break;
                    }
                }
                continue;
            }
            self.open([x, y], |pair| {
                let [x, y] = pair.map(|node| self.bounds(node));
                if x.overlaps(y) {
                    stack.push(pair);
                }
            });
        }
        self.stack = stack;
        found.map(|_| ())
    }

    /// The pairs of children of two nodes of one level, each pair once.
    fn open(&self, [x, y]: [Node; 2], mut each: impl FnMut([Node; 2])) {
        for i in self.children(x) {
            for j in self.children(y) {
                if x != y || i <= j {
                    each([i, j]);
                }
            }
        }
    }

    /// Pairs of parts whose boxes are apart, nearest boxes first.
    pub fn apart(&self) -> Apart<'_> {
        let mut apart = Apart {
            bodies: self,
            waiting: BinaryHeap::new(),
        };
        if let Some(root) = self.root() {
            apart.push([root; 2]);
        }
        apart
    }
}

/// Pairs of nodes that wait, by the squared distances of their boxes.
pub(super) struct Apart<'a> {
    bodies: &'a Bodies,
    waiting: BinaryHeap<Reverse<(u64, [Node; 2])>>,
}

impl Apart<'_> {
    fn push(&mut self, nodes: [Node; 2]) {
        let [x, y] = nodes.map(|node| Extent::from(self.bodies.bounds(node)));
        // Bits of numbers that are not negative have their order.
        let squared = x.squared_distance(&y).to_bits();
        self.waiting.push(Reverse((squared, nodes)));
    }

    /// The next pair, if the squared distance of its boxes is at most `most`.
    pub fn next(&mut self, most: f64) -> Option<[PartIx; 2]> {
        while let Some(Reverse((squared, nodes))) = self.waiting.pop() {
            let squared = f64::from_bits(squared);
            if squared > most {
                return None;
            }
            if nodes[0].level > 0 {
                let bodies = self.bodies;
                bodies.open(nodes, |pair| self.push(pair));
            } else if nodes[0] != nodes[1] {
                let [x, y] = nodes.map(|node| self.bodies.bounds(node));
                if !x.overlaps(y) {
                    return Some(self.bodies.parts(nodes));
                }
            }
        }
        None
    }
}

/// Bodies with more vertices are not looked at as a whole.
const MOST_VERTICES: usize = 1024;

/// Whether two bodies are farther apart than a distance, seen along the way between the middles of their boxes: all vertices
/// of one are beyond all of the other's by more. Of many round bodies, most whose boxes are near are told apart so.
///
/// `error` is what rounding may do to heights along that way, and to a distance that is computed.
pub(super) fn are_apart(
    bodies: [&Body; 2],
    boxes: [&Bounds; 2],
    distance: f64,
    error: f64,
) -> bool {
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
    common: Bounds,
    allowance: &mut Allowance,
) -> Option<bool> {
    let common = Extent::from(&common);
    let within = |side: usize| {
        let elements = trees[side].primitives(nodes[side]).iter();
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
