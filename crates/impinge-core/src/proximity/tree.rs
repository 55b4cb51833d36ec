//! The boxes of a body's clusters, and of the tree nodes above them.
//!
//! Clusters are found once per topology, in the current pose; their boxes once per pose, from each cluster's vertices; boxes
//! of primitives only when a cluster is compared. Cost: `O(n log n)` and `O(n)`.

use crate::exact::Point;
use crate::grouping::bounds::{Bounds, greater, lesser, round_down, round_up};
use crate::grouping::clusters::Clustering;
use crate::index::{ClusterIx, ElementIx};
use crate::positions::Positions;
use crate::scene::Body;

/// A box in `f64`: of primitives as they are, of clusters rounded outward to `f32`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Box64 {
    pub min: Point,
    pub max: Point,
}

impl From<&Bounds> for Box64 {
    fn from(bounds: &Bounds) -> Self {
        Box64 {
            min: bounds.min.map(f64::from),
            max: bounds.max.map(f64::from),
        }
    }
}

impl Box64 {
    pub const EMPTY: Self = Box64 {
        min: [f64::INFINITY; 3],
        max: [f64::NEG_INFINITY; 3],
    };

    pub fn cover(&mut self, point: Point) {
        self.join(&Box64 {
            min: point,
            max: point,
        });
    }

    fn join(&mut self, other: &Box64) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(other.min[k]);
            self.max[k] = self.max[k].max(other.max[k]);
        }
    }

    /// The square of the distance of two boxes, rounded; 0 where they meet.
    pub fn squared_distance(&self, other: &Box64) -> f64 {
        let mut sum = 0.0;
        for k in 0..3 {
            let gap = (other.min[k] - self.max[k])
                .max(self.min[k] - other.max[k])
                .max(0.0);
            sum += gap * gap;
        }
        sum
    }

    pub fn squared_diagonal(&self) -> f64 {
        (0..3)
            .map(|k| self.max[k] - self.min[k])
            .map(|x| x * x)
            .sum()
    }

    /// The largest magnitude of a coordinate.
    pub fn magnitude(&self) -> f64 {
        let corners = self.min.iter().chain(&self.max);
        corners.fold(0.0, |most: f64, x| most.max(x.abs()))
    }
}

/// A body's clusters and boxes.
#[derive(Debug)]
pub(super) struct Tree {
    pub clustering: Clustering,
    topology_stamp: u64,
    positions_stamp: u64,
    /// The boxes of each level's nodes, from the clusters up.
    levels: Vec<Vec<Bounds>>,
}

impl Tree {
    pub fn new(body: &Body) -> Self {
        let bounds = |primitive: usize| {
            let found = box_of(body, primitive);
            Bounds {
                min: found.min.map(round_down),
                max: found.max.map(round_up),
            }
        };
        let mut tree = Tree {
            clustering: Clustering::new(body.elements(), bounds),
            topology_stamp: body.topology_stamp(),
            positions_stamp: 0,
            levels: Vec::new(),
        };
        tree.refit(body);
        tree
    }

    /// Whether the tree was built for the body's current topology.
    pub fn fits(&self, body: &Body) -> bool {
        self.topology_stamp == body.topology_stamp()
    }

    /// Recomputes the boxes if the body's positions have changed.
    pub fn refit(&mut self, body: &Body) {
        if self.positions_stamp == body.positions_stamp() {
            return;
        }
        self.positions_stamp = body.positions_stamp();
        self.levels.clear();
        let clusters = self.clustering.clusters();
        let of_clusters = clusters
            .map(|cluster| of_vertices(body.positions(), self.clustering.vertices(cluster)))
            .collect();
        self.levels.push(of_clusters);
        for level in 1..self.clustering.shape.n_levels() {
            let below = &self.levels[level - 1];
            let shape = &self.clustering.shape;
            let nodes = 0..shape.n_nodes(level);
            let boxes = nodes
                .map(|node| {
                    let mut all = Bounds::EMPTY;
                    below[shape.children(level, node)]
                        .iter()
                        .for_each(|one| all.join(one));
                    all
                })
                .collect();
            self.levels.push(boxes);
        }
    }

    /// The root; `None` without primitives.
    pub fn root(&self) -> Option<Node> {
        let n_levels = self.clustering.shape.n_levels();
        (n_levels > 0).then(|| Node {
            level: n_levels as u32 - 1,
            number: 0,
        })
    }

    pub fn bounds(&self, node: Node) -> Box64 {
        Box64::from(&self.levels[node.level as usize][node.number as usize])
    }

    /// The children of a node that is not a cluster.
    pub fn children(&self, node: Node) -> impl Iterator<Item = Node> + use<> {
        let children = self
            .clustering
            .shape
            .children(node.level as usize, node.number as usize);
        children.map(move |number| Node {
            level: node.level - 1,
            number: number as u32,
        })
    }

    /// The primitives of a cluster.
    pub fn primitives(&self, node: Node) -> &[ElementIx] {
        self.clustering.primitives(ClusterIx::new(node.number))
    }
}

/// A node of a tree; level 0 holds the clusters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Node {
    pub level: u32,
    pub number: u32,
}

/// The box of a primitive, in `f64`.
pub(super) fn box_of(body: &Body, primitive: usize) -> Box64 {
    box_along(body, primitive, |point| point)
}

/// The box of a primitive whose corners are mapped.
pub(super) fn box_along(body: &Body, primitive: usize, map: impl Fn(Point) -> Point) -> Box64 {
    let mut found = Box64::EMPTY;
    for &vertex in body.elements().corners(primitive) {
        found.cover(map(body.positions().point(vertex as usize)));
    }
    found
}

/// The box of some vertices, rounded outward.
fn of_vertices(positions: &Positions, vertices: &[u32]) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    match positions {
        Positions::F32(positions) => {
            for &vertex in vertices {
                for (k, &x) in positions[vertex as usize].iter().enumerate() {
                    bounds.min[k] = lesser(bounds.min[k], x);
                    bounds.max[k] = greater(bounds.max[k], x);
                }
            }
        }
        Positions::F64(positions) => {
            let mut exact = Box64::EMPTY;
            for &vertex in vertices {
                exact.cover(positions[vertex as usize]);
            }
            bounds.min = exact.min.map(round_down);
            bounds.max = exact.max.map(round_up);
        }
    }
    bounds
}
