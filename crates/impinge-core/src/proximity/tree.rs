//! The boxes of a body's clusters, and of the tree nodes above them.
//!
//! The clusters are those that all questions share. Their boxes are found once per pose, from each
//! cluster's vertices; boxes of elements only when a cluster is compared. Cost: `O(n)`.

use std::sync::Arc;

use crate::boxes::{self, Extent};
use crate::bvh::bounds::Aabb;
use crate::bvh::clusters::Clustering;
pub(crate) use crate::bvh::tree::Node;
use crate::clusterings::{Fit, spread};
use crate::scene::Body;
use crate::scene::index::{ClusterIx, ElementIx};
use impinge_exact::Point;

/// A body's clusters and boxes.
#[derive(Debug)]
pub(crate) struct Tree {
    pub clustering: Arc<Clustering>,
    topology_stamp: u64,
    positions_stamp: u64,
    /// The boxes of each level's nodes, from the clusters up.
    levels: Vec<Vec<Aabb>>,
    /// How well the clusters have fitted the body.
    pub fit: Fit,
}

impl Tree {
    /// A tree without boxes yet.
    pub fn new(body: &Body, clustering: Arc<Clustering>) -> Self {
        Tree {
            clustering,
            topology_stamp: body.topology_stamp(),
            positions_stamp: 0,
            levels: Vec::new(),
            fit: Fit::UNKNOWN,
        }
    }

    /// Whether the tree was built for the body's current topology.
    pub fn fits(&self, body: &Body) -> bool {
        self.topology_stamp == body.topology_stamp()
    }

    /// Recomputes the boxes if the body's positions have changed; returns whether they had.
    pub fn refit(&mut self, body: &Body) -> bool {
        if self.positions_stamp == body.positions_stamp() {
            return false;
        }
        self.positions_stamp = body.positions_stamp();
        self.levels.clear();
        let clusters = self.clustering.clusters();
        let of_clusters = clusters
            .map(|cluster| boxes::of_vertices(body.positions(), self.clustering.vertices(cluster)))
            .collect();
        self.levels.push(of_clusters);
        for level in 1..self.clustering.shape.n_levels() {
            let below = &self.levels[level - 1];
            let shape = &self.clustering.shape;
            let nodes = 0..shape.n_nodes(level);
            let boxes = nodes
                .map(|node| {
                    let mut all = Aabb::EMPTY;
                    below[shape.children(level, node)]
                        .iter()
                        .for_each(|one| all.join(one));
                    all
                })
                .collect();
            self.levels.push(boxes);
        }
        true
    }

    /// The boxes of each level's nodes, from the clusters up.
    pub fn levels(&self) -> &[Vec<Aabb>] {
        &self.levels
    }

    /// How well the clusters fit the pose of the boxes.
    pub fn spread(&self) -> f64 {
        let (Some(clusters), Some(root)) = (self.levels.first(), self.root()) else {
            return 1.0;
        };
        let surface = clusters.iter().map(Aabb::half_area).sum();
        spread(surface, self.bounds_f32(root).half_area())
    }

    /// Bytes held beside the clusters.
    pub fn bytes(&self) -> usize {
        let boxes = self.levels.iter().map(|level| size_of_val(&level[..]));
        boxes.sum()
    }

    /// The root; `None` without elements.
    pub fn root(&self) -> Option<Node> {
        let n_levels = self.clustering.shape.n_levels();
        (n_levels > 0).then(|| Node {
            level: n_levels as u32 - 1,
            number: 0,
        })
    }

    pub fn bounds(&self, node: Node) -> Extent {
        Extent::from(&self.bounds_f32(node))
    }

    pub fn bounds_f32(&self, node: Node) -> Aabb {
        self.levels[node.level as usize][node.number as usize]
    }

    /// The children of a node that is not a cluster.
    pub fn children(&self, node: Node) -> impl Iterator<Item = Node> + use<> {
        self.clustering.shape.children_of(node)
    }

    /// The elements of a cluster.
    pub fn elements(&self, node: Node) -> &[ElementIx] {
        self.clustering.elements(ClusterIx::new(node.number))
    }
}

/// The box of an element, in `f64`.
pub(super) fn box_of(body: &Body, element: usize) -> Extent {
    box_along(body, element, |point| point)
}

/// The box of an element whose corners are mapped.
pub(super) fn box_along(body: &Body, element: usize, map: impl Fn(Point) -> Point) -> Extent {
    let corners = body.elements().corners(element).iter();
    Extent::of(corners.map(|&vertex| map(body.positions().point(vertex as usize))))
}

/// The corners of an element; one with fewer than four repeats its last.
pub(super) fn corners(body: &Body, element: ElementIx) -> [Point; 4] {
    let vertices = body.elements().four_corners(element.index());
    vertices.map(|vertex| body.positions().point(vertex as usize))
}
