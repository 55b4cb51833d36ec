//! The boxes of a body's clusters, and of the tree nodes above them.
//!
//! Clusters are found once per topology, in the current pose; boxes once per pose. Cost: `O(n log n)` and `O(n)`.

use crate::exact::Point;
use crate::grouping::GROUP;
use crate::grouping::bounds::{Bounds, round_down, round_up};
use crate::grouping::clusters::Clustering;
use crate::scene::Body;

/// A box in `f64`: coordinates are taken as they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Box64 {
    pub min: Point,
    pub max: Point,
}

impl Box64 {
    const EMPTY: Self = Box64 {
        min: [f64::INFINITY; 3],
        max: [f64::NEG_INFINITY; 3],
    };

    fn cover(&mut self, point: Point) {
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
    levels: Vec<Vec<Box64>>,
    /// The boxes of the primitives in the clusters' order.
    primitives: Vec<Box64>,
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
            primitives: Vec::new(),
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
        self.primitives.clear();
        let order = self.clustering.order.iter();
        self.primitives
            .extend(order.map(|&primitive| box_of(body, primitive as usize)));
        let join = |boxes: &[Box64]| {
            let mut all = Box64::EMPTY;
            boxes.iter().for_each(|one| all.join(one));
            all
        };
        self.levels.clear();
        self.levels
            .push(self.primitives.chunks(GROUP).map(join).collect());
        for level in 1..self.clustering.shape.n_levels() {
            let below = &self.levels[level - 1];
            let shape = &self.clustering.shape;
            let nodes = 0..shape.n_nodes(level);
            let boxes = nodes
                .map(|node| join(&below[shape.children(level, node)]))
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

    pub fn bounds(&self, node: Node) -> &Box64 {
        &self.levels[node.level as usize][node.number as usize]
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

    /// The numbers of a cluster's primitives, and their boxes.
    pub fn primitives(&self, node: Node) -> impl Iterator<Item = (u32, &Box64)> {
        let first = node.number as usize * GROUP;
        let places = first..first + self.clustering.size(node.number as usize);
        places.map(|place| (self.clustering.order[place], &self.primitives[place]))
    }
}

/// A node of a tree; level 0 holds the clusters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Node {
    pub level: u32,
    pub number: u32,
}

fn box_of(body: &Body, primitive: usize) -> Box64 {
    let mut found = Box64::EMPTY;
    for &vertex in body.elements().corners(primitive) {
        found.cover(body.positions().point(vertex as usize));
    }
    found
}
