//! Pairs that share a hub, under `SharedVertex::Resolve`: found by the directions of their
//! elements.
//!
//! In: the hubs and axes of a body, and its positions. Out: pairs for the exact test.
//!
//! The boxes of all elements around a hub v overlap there, so boxes in space separate nothing.
//! Seen from v, each element is a cone of directions, and two elements that meet in a point
//! other than v share the direction of that point. So each cone gets a box on the surface of the
//! cube of all directions, and a tree over these boxes finds those that overlap:
//!
//! ```text
//!    +-------*--*---+      * directions of a triangle's two other vertices:
//!    |        \ |   |        its cone meets the cube between them
//!    |         \|   *
//!    |          v---|*     boxes of cones that do not overlap: the triangles
//!    |              |      meet in v alone
//!    +--------------+
//! ```
//!
//! Elements that share an axis uv also share the direction of its other vertex. They are found by
//! half-planes around the axis: the half-plane of a point p is given by the direction of (v - u) x
//! (p - u).
//!
//! Elements with the same vertices have the same answers, so one test speaks for all of them.
//!
//! Cost: `O(n log n)` per hub for n elements, and one exact test per pair whose cones' boxes
//! overlap. Reason for each discard: cones without a common direction. `docs/exactness.md`, "Hubs",
//! has the proof and the bound.

use crate::bvh::bounds::{Aabb, round_down, round_up};
use crate::bvh::hubs::{HubSet, Hubs};
use crate::scene::index::Slot;
use crate::scene::vector::cross;
use impinge_exact::Point;
use impinge_exact::internal::{collinear, strictly_between};

use super::narrow::Decider;
use super::world::BodyRef;

/// Entries per leaf.
const LEAF: usize = 4;
/// The rounding error of a direction's coordinate: 2^-24.
const ERROR: f64 = f64::from_bits((1023 - 24) << 52);
/// A normal shorter than this share of the product of its factors' sizes has no certain direction:
/// 2^-23.
const SHORTEST: f64 = f64::from_bits((1023 - 23) << 52);

/// All directions.
const EVERYWHERE: Aabb = Aabb {
    min: [-1.0; 3],
    max: [1.0; 3],
};

/// Scratch; kept from frame to frame.
#[derive(Debug, Default)]
pub(super) struct HubScratch {
    /// Slots of elements; those with the same vertices follow each other.
    slots: Vec<Slot>,
    entries: Vec<ConeEntry>,
    nodes: Vec<ConeNode>,
    stack: Vec<ConePair>,
    /// Triangles on the axis' line that extend beyond its first hub, and beyond its second.
    beyond: [Vec<Alike>; 2],
}

/// Elements with the same vertices: the range of their places in `HubScratch::slots`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Alike {
    start: u32,
    end: u32,
}

impl Alike {
    fn of(self, slots: &[Slot]) -> &[Slot] {
        &slots[self.start as usize..self.end as usize]
    }
}

#[derive(Debug, Clone, Copy)]
struct ConeEntry {
    cone: Aabb,
    alike: Alike,
    /// The hubs of the element with which the current hub forms an axis.
    partners: HubSet,
}

#[derive(Debug, Clone, Copy)]
struct ConeNode {
    cone: Aabb,
    partners: HubSet,
}

/// Two nodes of one depth.
#[derive(Debug, Clone, Copy)]
struct ConePair {
    depth: u32,
    a: usize,
    b: usize,
}

/// Where an element lies as seen from the shared hub or axis.
enum SeenFrom {
    Cone(Aabb),
    Nowhere,
    Beyond(usize),
}

impl HubScratch {
    pub fn bytes(&self) -> usize {
        size_of::<Slot>() * self.slots.capacity()
            + size_of::<ConeEntry>() * self.entries.capacity()
            + size_of::<ConeNode>() * self.nodes.capacity()
            + size_of::<ConePair>() * self.stack.capacity()
            + size_of::<Alike>() * (self.beyond[0].capacity() + self.beyond[1].capacity())
    }

    /// Decides the pairs that share a hub, or an axis.
    pub fn decide(
        &mut self,
        body: &BodyRef<'_>,
        hubs: &Hubs,
        shared: &[u32],
        slots: &[Slot],
        decider: &mut Decider,
    ) {
        self.entries.clear();
        self.beyond.iter_mut().for_each(Vec::clear);
        self.slots.clear();
        self.slots.extend_from_slice(slots);
        (self.slots).sort_unstable_by_key(|&slot| (sorted_ids(body.corners(slot)), slot));
        let same =
            |&a: &Slot, &b: &Slot| sorted_ids(body.corners(a)) == sorted_ids(body.corners(b));
        let mut start = 0;
        for slots in self.slots.chunk_by(same) {
            let end = start + slots.len() as u32;
            let alike = Alike { start, end };
            start = end;
            let corners = body.corners(slots[0]);
            if hubs.owns(shared, corners, corners) {
                decider.decide_alike(body, slots);
            }
            match seen(body, shared, slots[0]) {
                // By the rule, such an element meets only elements with the same vertices.
                SeenFrom::Nowhere => {}
                SeenFrom::Beyond(end) => self.beyond[end].push(alike),
                SeenFrom::Cone(cone) => self.entries.push(ConeEntry {
                    cone,
                    alike,
                    partners: match shared {
                        &[hub] => hubs.partners(hub, corners),
                        _ => HubSet::EMPTY,
                    },
                }),
            }
        }
        let slots = std::mem::take(&mut self.slots);
        let mut decide = |a: Alike, b: Alike| {
            let (a, b) = (a.of(&slots), b.of(&slots));
            if hubs.owns(shared, body.corners(a[0]), body.corners(b[0])) {
                decider.decide_shared_by_all(body, a, b);
            }
        };
        // All of these meet beyond the shared axis.
        for on_line in &self.beyond {
            each_pair(on_line, &mut decide);
        }
        self.meet(&mut decide);
        self.slots = slots;
    }

    /// Calls `emit` for all pairs of entries whose cones' boxes overlap and that have no common
    /// partner.
    fn meet(&mut self, emit: &mut impl FnMut(Alike, Alike)) {
        let n = self.entries.len();
        if n < 2 {
            return;
        }
        let depth = n.div_ceil(LEAF).next_power_of_two().ilog2();
        let nothing = ConeNode {
            cone: Aabb::EMPTY,
            partners: HubSet::EMPTY,
        };
        self.nodes.clear();
        self.nodes.resize(2 << depth, nothing);
        ConeTree {
            entries: &mut self.entries,
            nodes: &mut self.nodes,
            depth,
        }
        .build(0, 0);
        self.stack.clear();
        let root = ConePair {
            depth: 0,
            a: 0,
            b: 0,
        };
        self.stack.push(root);
        while let Some(ConePair { depth: at, a, b }) = self.stack.pop() {
            let first = 1 << at;
            let (node_a, node_b) = (&self.nodes[first + a], &self.nodes[first + b]);
            if !node_a.cone.overlaps(&node_b.cone) || node_a.partners.meets(&node_b.partners) {
                continue;
            }
            if at < depth {
                let (low, high) = (2 * a, 2 * a + 1);
                for (a, b) in [
                    (low, 2 * b),
                    (low, 2 * b + 1),
                    (high, 2 * b),
                    (high, 2 * b + 1),
                ] {
                    if a <= b {
                        self.stack.push(ConePair {
                            depth: at + 1,
                            a,
                            b,
                        });
                    }
                }
                continue;
            }
            for (ix, entry) in self.entries[range(n, at, a)].iter().enumerate() {
                let skipped = if a == b { ix + 1 } else { 0 };
                for other in &self.entries[range(n, at, b)][skipped..] {
                    if entry.cone.overlaps(&other.cone) && !entry.partners.meets(&other.partners) {
                        emit(entry.alike, other.alike);
                    }
                }
            }
        }
    }
}

fn each_pair(list: &[Alike], emit: &mut impl FnMut(Alike, Alike)) {
    for (ix, &a) in list.iter().enumerate() {
        for &b in &list[ix + 1..] {
            emit(a, b);
        }
    }
}

/// The entries of a node.
fn range(n: usize, depth: u32, node: usize) -> std::ops::Range<usize> {
    let start = |node: usize| ((node as u64 * n as u64) >> depth) as usize;
    start(node)..start(node + 1)
}

/// The entries of a hub as a binary tree whose nodes are numbered like those of a heap.
struct ConeTree<'a> {
    entries: &'a mut [ConeEntry],
    nodes: &'a mut [ConeNode],
    depth: u32,
}

impl ConeTree<'_> {
    /// Sorts the entries of a node, by partners and then by cones, and fills the nodes below.
    fn build(&mut self, at: u32, node: usize) -> ConeNode {
        let n = self.entries.len();
        let entries = &mut self.entries[range(n, at, node)];
        let mut all = ConeNode {
            cone: Aabb::EMPTY,
            partners: entries[0].partners,
        };
        for entry in &*entries {
            all.cone.join(&entry.cone);
            all.partners = all.partners.and(&entry.partners);
        }
        self.nodes[(1 << at) + node] = all;
        if at < self.depth {
            let extent = |axis: usize| all.cone.max[axis] - all.cone.min[axis];
            let axis = (0..3).fold(0, |best, k| if extent(k) > extent(best) { k } else { best });
            let center = |entry: &ConeEntry| entry.cone.min[axis] + entry.cone.max[axis];
            let cut = range(n, at + 1, 2 * node).len();
            entries.select_nth_unstable_by(cut, |a, b| {
                (a.partners.cmp(&b.partners))
                    .then(center(a).total_cmp(&center(b)))
                    .then(a.alike.cmp(&b.alike))
            });
            self.build(at + 1, 2 * node);
            self.build(at + 1, 2 * node + 1);
        }
        all
    }
}

/// An element's vertices, each once, ascending, filled up with the largest number.
fn sorted_ids(corners: &[u32]) -> [u32; 4] {
    let mut ids = [u32::MAX; 4];
    for (ix, &id) in corners.iter().enumerate() {
        if !corners[..ix].contains(&id) {
            ids[ix] = id;
        }
    }
    ids.sort_unstable();
    ids
}

/// Where an element lies as seen from a hub or from an axis.
fn seen(body: &BodyRef<'_>, shared: &[u32], slot: Slot) -> SeenFrom {
    let corners = body.corners(slot);
    let point = |id: u32| body.positions.point(id as usize);
    let rest = corners
        .iter()
        .filter(|id| !shared.contains(id))
        .map(|&id| point(id));
    let u = point(shared[0]);
    let axis = shared.get(1).map(|&id| point(id)).filter(|v| *v != u);
    let mut cone = Cone::default();
    for p in rest {
        let Some(v) = axis else {
            cone.add(difference(&p, &u));
            continue;
        };
        let (along, to) = (
            of_length_one(difference(&v, &u)),
            of_length_one(difference(&p, &u)),
        );
        let normal = cross(along, to);
        if size(&normal) > SHORTEST * (size(&along) * size(&to)) {
            cone.add(normal);
        } else if corners.len() > 3 || !collinear(&u, &v, &p) {
            return SeenFrom::Cone(EVERYWHERE);
        } else if strictly_between(&u, &v, &p) {
            return SeenFrom::Beyond(0);
        } else if strictly_between(&v, &u, &p) {
            return SeenFrom::Beyond(1);
        }
    }
    cone.bounds().map_or(SeenFrom::Nowhere, SeenFrom::Cone)
}

/// The directions of some points: their box on the surface of the cube.
#[derive(Default)]
struct Cone {
    min: [f64; 3],
    max: [f64; 3],
    n: u32,
}

impl Cone {
    /// Adds a direction; the zero vector is ignored.
    fn add(&mut self, direction: Point) {
        let size = size(&direction);
        if size == 0.0 {
            return;
        }
        for (axis, x) in direction.iter().enumerate() {
            let at = x / size;
            if self.n == 0 {
                (self.min[axis], self.max[axis]) = (at, at);
            }
            self.min[axis] = self.min[axis].min(at);
            self.max[axis] = self.max[axis].max(at);
        }
        self.n += 1;
    }

    /// The box of all directions between those added.
    fn bounds(&self) -> Option<Aabb> {
        if self.n == 0 {
            return None;
        }
        let min = self.min.map(|x| x - ERROR);
        let max = self.max.map(|x| x + ERROR);
        // A point between directions on the cube lies within their box, so its largest coordinate
        // is at least `least`. Projected outward onto the cube, it grows at most by the factor
        // `most`.
        let least = (0..3).fold(0.0, |least: f64, k| least.max(min[k]).max(-max[k]));
        let most = 1.0 / least;
        let out = |x: f64| {
            if least > 0.0 {
                x * most
            } else {
                x * f64::INFINITY
            }
        };
        let low = |x: f64| {
            if x < 0.0 {
                (out(x) - ERROR).max(-1.0)
            } else {
                x
            }
        };
        let high = |x: f64| {
            if x > 0.0 {
                (out(x) + ERROR).min(1.0)
            } else {
                x
            }
        };
        Some(Aabb {
            min: min.map(|x| round_down(low(x))),
            max: max.map(|x| round_up(high(x))),
        })
    }
}

/// Half of the difference where the difference overflows: only its direction matters.
fn difference(p: &Point, q: &Point) -> Point {
    let whole: Point = std::array::from_fn(|k| p[k] - q[k]);
    if whole.iter().all(|x| x.is_finite()) {
        return whole;
    }
    std::array::from_fn(|k| 0.5 * p[k] - 0.5 * q[k])
}

/// A vector divided by its size, so that products neither overflow nor underflow; zero stays zero.
fn of_length_one(d: Point) -> Point {
    match size(&d) {
        0.0 => d,
        size => d.map(|x| x / size),
    }
}

/// The largest magnitude of a coordinate.
fn size(d: &Point) -> f64 {
    d.iter().fold(0.0, |size: f64, x| size.max(x.abs()))
}
