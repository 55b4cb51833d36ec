//! The boxes of a body as instruction sets read them, and the way down the tree past them.
//!
//! ```text
//! top         [ root ]                one box
//! level 2     [ eight boxes ]         of the children of a node, read at once
//! level 1     [ eight clusters ]  …
//! elements    [ 64 boxes ]     …      found when a probe first comes to the cluster
//! faces       [ 64 faces ]     …      as are their corners, side by side
//! ```
//!
//! Cost: a copy of the boxes of clusters and nodes per pose, and the boxes and corners of elements
//! where they are needed.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use crate::boxes;
use crate::bvh::GROUP;
use crate::bvh::bounds::Aabb;
use crate::bvh::clusters::Clustering;
use crate::scene::Body;
use crate::scene::elements::Elements;
use crate::scene::index::ClusterIx;
use crate::scene::positions::{Positions, Real};
use crate::simd::{LaneBounds, Lanes, Simd};
use impinge_exact::internal::filter::Triangles64;
use impinge_exact::internal::filter::number::Lookup;

/// The boxes of one pose.
#[derive(Debug)]
pub(super) struct Boxes {
    pub clustering: Arc<Clustering>,
    positions_stamp: Option<u64>,
    /// The box of the whole body; none without elements.
    top: Siblings,
    /// The children of each level's nodes, from those whose children are clusters up.
    levels: Vec<Vec<Siblings>>,
    /// Of the elements of each cluster.
    elements: Vec<OnceLock<LaneBounds>>,
    /// The corners of each cluster's faces, rounded to nearest; none for other elements.
    faces: Vec<OnceLock<Triangles64>>,
    /// More than a corner may be moved by rounding.
    rounding: f64,
}

impl Boxes {
    /// Of no pose yet.
    pub fn new(clustering: Arc<Clustering>) -> Self {
        let n = clustering.n_clusters();
        let n_of_faces = match clustering.corners {
            Elements::Triangles(_) => n,
            _ => 0,
        };
        Boxes {
            clustering,
            positions_stamp: None,
            top: Siblings::EMPTY,
            levels: Vec::new(),
            elements: (0..n).map(|_| OnceLock::new()).collect(),
            faces: (0..n_of_faces).map(|_| OnceLock::new()).collect(),
            rounding: 0.0,
        }
    }

    /// Takes the boxes of the body's pose, if they are of another one.
    pub fn take(&mut self, body: &Body, of_levels: &[Vec<Aabb>]) {
        let stamp = Some(body.positions_stamp());
        if self.positions_stamp == stamp {
            return;
        }
        self.positions_stamp = stamp;
        self.top = match of_levels.last() {
            Some(top) => Siblings::new(top, 0..top.len()),
            None => Siblings::EMPTY,
        };
        let shape = &self.clustering.shape;
        let n_above = of_levels.len().saturating_sub(1);
        self.levels.resize_with(n_above, Default::default);
        for (below, siblings) in self.levels.iter_mut().enumerate() {
            siblings.clear();
            siblings.extend(
                (0..shape.n_nodes(below + 1))
                    .map(|node| Siblings::new(&of_levels[below], shape.children(below + 1, node))),
            );
        }
        for lanes in &mut self.elements {
            lanes.take();
        }
        for faces in &mut self.faces {
            faces.take();
        }
        self.rounding = match body.positions() {
            Positions::F32(_) => 0.0,
            Positions::F64(_) => {
                let Aabb { min, max } = self.root();
                rounding_of(min).max(rounding_of(max))
            }
        };
    }

    /// Whether they are of these clusters.
    pub fn fits(&self, clustering: &Arc<Clustering>) -> bool {
        Arc::ptr_eq(&self.clustering, clustering)
    }

    pub fn bytes(&self) -> usize {
        let levels: usize = self
            .levels
            .iter()
            .map(|nodes| size_of_val(&nodes[..]))
            .sum();
        levels + size_of_val(&self.elements[..]) + size_of_val(&self.faces[..])
    }

    /// More than the corners of [`faces`](Boxes::faces) may be moved by rounding.
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// The corners of a cluster's faces, rounded to nearest; none if elements are no triangles.
    #[inline(always)]
    pub fn faces(&self, body: &Body, cluster: ClusterIx) -> Option<&Triangles64> {
        let faces = self.faces.get(cluster.index())?;
        Some(match faces.get() {
            Some(faces) => faces,
            None => self.find_faces(body, cluster, faces),
        })
    }

    #[cold]
    #[inline(never)]
    fn find_faces<'a>(
        &self,
        body: &Body,
        cluster: ClusterIx,
        into: &'a OnceLock<Triangles64>,
    ) -> &'a Triangles64 {
        into.get_or_init(|| {
            let mut faces = [[[0.0; GROUP]; 3]; 3];
            for (lane, slot) in self.clustering.slots(cluster).enumerate() {
                let vertices = self.clustering.corners.corners(slot);
                for (rows, &vertex) in faces.iter_mut().zip(vertices) {
                    let point = body.positions().point(vertex as usize);
                    for (row, x) in rows.iter_mut().zip(point) {
                        row[lane] = <f32 as Real>::round(x);
                    }
                }
            }
            faces
        })
    }

    /// The box of the whole body; the empty box without elements.
    pub fn root(&self) -> Aabb {
        self.top.at(0)
    }

    /// The box of the whole body as the children of nodes are: where the way down starts. What is
    /// above clusters only has a level of 0.
    pub fn top(&self) -> (&Siblings, u32) {
        (&self.top, self.levels.len() as u32)
    }

    /// The children of a node of a level above 0, which are of the level below.
    #[inline(always)]
    pub fn children(&self, level: u32, node: u32) -> &Siblings {
        &self.levels[level as usize - 1][node as usize]
    }

    /// The boxes of a cluster's elements.
    #[inline(always)]
    pub fn elements(&self, body: &Body, cluster: ClusterIx) -> &LaneBounds {
        let lanes = &self.elements[cluster.index()];
        match lanes.get() {
            Some(lanes) => lanes,
            None => self.find_elements(body, cluster),
        }
    }

    #[cold]
    #[inline(never)]
    fn find_elements(&self, body: &Body, cluster: ClusterIx) -> &LaneBounds {
        self.elements[cluster.index()].get_or_init(|| {
            let mut lanes = LaneBounds::EMPTY;
            boxes::fill(body.positions(), &self.clustering, cluster, &mut lanes);
            lanes
        })
    }
}

/// Up to eight consecutive boxes of a level, side by side.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct Siblings {
    /// Rows of eight: low ends by axis, then high ends. Registers may read past a row, and past the
    /// last.
    ends: [f32; 7 * EIGHT],
    /// The number of the first in its level.
    pub first: u32,
    n: u32,
}

/// Boxes side by side.
const EIGHT: usize = 8;

impl Siblings {
    const EMPTY: Siblings = {
        let mut ends = [f32::NEG_INFINITY; 7 * EIGHT];
        let mut k = 0;
        while k < 3 * EIGHT {
            ends[k] = f32::INFINITY;
            k += 1;
        }
        Siblings {
            ends,
            first: 0,
            n: 0,
        }
    };

    fn new(level: &[Aabb], siblings: Range<usize>) -> Self {
        let mut boxes = Siblings {
            first: siblings.start as u32,
            n: siblings.len() as u32,
            ..Siblings::EMPTY
        };
        for (k, bounds) in level[siblings].iter().enumerate() {
            for axis in 0..3 {
                boxes.ends[EIGHT * axis + k] = bounds.min[axis];
                boxes.ends[EIGHT * (3 + axis) + k] = bounds.max[axis];
            }
        }
        boxes
    }

    fn at(&self, k: usize) -> Aabb {
        let ends = |row: usize| [0, 1, 2].map(|axis| self.ends[EIGHT * (row + axis) + k]);
        Aabb {
            min: ends(0),
            max: ends(3),
        }
    }

    /// Bit k for each of the boxes.
    #[inline(always)]
    pub fn all(&self) -> u64 {
        (1 << self.n) - 1
    }
}

/// Boxes side by side, in rows of `READ` numbers.
pub(super) trait SideBySide<const READ: usize> {
    /// How many boxes there are, at most.
    const N: usize;

    /// The low ends of the boxes along an axis, or the high ones; what follows them is arbitrary.
    fn row(&self, is_high: bool, axis: usize) -> &[f32; READ];
}

impl SideBySide<{ 2 * EIGHT }> for Siblings {
    const N: usize = EIGHT;

    #[inline(always)]
    fn row(&self, is_high: bool, axis: usize) -> &[f32; 2 * EIGHT] {
        let first = EIGHT * (3 * usize::from(is_high) + axis);
        self.ends[first..].first_chunk().expect("two rows")
    }
}

impl SideBySide<GROUP> for LaneBounds {
    const N: usize = GROUP;

    #[inline(always)]
    fn row(&self, is_high: bool, axis: usize) -> &[f32; GROUP] {
        let ends = if is_high { &self.max } else { &self.min };
        &ends[axis]
    }
}

/// 1 and more than the relative error of a few operations in `f32`.
pub(super) const GROWN: f32 = 1.0 + 16.0 * f32::EPSILON;

/// A node that waits to be opened: how far it is, its level and its number there.
pub(super) type Waiting = (f32, u32, u32);

/// Has some siblings of a level wait, the nearest of which is opened first.
#[inline(always)]
pub(super) fn wait_in_order(
    waiting: &mut Vec<Waiting>,
    (siblings, level): (&Siblings, u32),
    mask: u64,
    nears: &[f32; GROUP],
) {
    let first = waiting.len();
    for lane in Lanes(mask & siblings.all()) {
        let mut place = waiting.len();
        waiting.push((nears[lane], level, siblings.first + lane as u32));
        while place > first && waiting[place - 1].0 < waiting[place].0 {
            waiting.swap(place - 1, place);
            place -= 1;
        }
    }
}

/// More than the length by which a point with some coordinates is moved where each is rounded to
/// single precision.
#[inline(always)]
pub(super) fn rounding_of([x, y, z]: [f32; 3]) -> f64 {
    let largest = x.abs().max(y.abs()).max(z.abs());
    // Half a unit in the last place of each of three, and what is lost below the smallest float.
    f64::from(largest) * f64::from(f32::EPSILON) + f64::from(f32::MIN_POSITIVE)
}

/// The way down a tree: the siblings that wait on each level.
#[derive(Debug, Default)]
pub(super) struct Descent {
    stack: Vec<Unvisited>,
}

/// Consecutive nodes of one level: those whose boxes meet the query and that were not visited.
#[derive(Debug)]
struct Unvisited {
    level: u32,
    first: u32,
    mask: u64,
}

impl Descent {
    /// Starts at the root, whose box must meet the query.
    pub fn start(&mut self, boxes: &Boxes) {
        self.stack.clear();
        let (top, level) = boxes.top();
        self.stack.push(Unvisited {
            level,
            first: top.first,
            mask: top.all(),
        });
    }

    /// The next cluster whose box meets the query.
    #[inline(always)]
    pub fn next<S: Simd>(&mut self, _: S, boxes: &Boxes, query: &Aabb) -> Option<ClusterIx> {
        loop {
            let top = self.stack.last_mut()?;
            if top.mask == 0 {
                self.stack.pop();
                continue;
            }
            let node = top.first + top.mask.trailing_zeros();
            top.mask &= top.mask - 1;
            let level = top.level;
            if level == 0 {
                return Some(ClusterIx::new(node));
            }
            let children = boxes.children(level, node);
            let mask = overlapping::<S::F32, _, _>(children, query) & children.all();
            self.stack.push(Unvisited {
                level: level - 1,
                first: children.first,
                mask,
            });
        }
    }
}

/// Bit k: box k overlaps a query.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
fn overlapping<V: Lookup, B: SideBySide<READ>, const READ: usize>(boxes: &B, query: &Aabb) -> u64 {
    let [min, max] = [query.min, query.max].map(|end| end.map(|x| V::splat(f64::from(x))));
    let is_apart = |axis: usize, first: usize| {
        let low = V::row(boxes.row(false, axis), first);
        let high = V::row(boxes.row(true, axis), first);
        low.gt(max[axis]) | min[axis].gt(high)
    };
    let mut mask = 0;
    for first in (0..B::N).step_by(V::N) {
        let is_apart = is_apart(0, first) | is_apart(1, first) | is_apart(2, first);
        mask |= u64::from(V::bits(!is_apart)) << first;
    }
    mask
}
