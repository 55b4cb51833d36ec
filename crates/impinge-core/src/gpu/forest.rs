//! All trees of a frame, or of a piece of one, in one array of nodes: see [`world`](super::world).

use crate::grouping::bounds::Bounds;
use crate::grouping::hierarchy::{Entry, FANOUT, TreeShape, order};

use crate::index::LayerIx;

use super::layout::{Level, NO_ROOT, Node, NodePair};

/// Bodies, empty ones included, that need no tree over bodies if at most two are filled.
const FEW_BODIES: usize = 1024;
/// How far bodies may move away from their neighbours in the tree over bodies before it is rebuilt.
const STALE: f64 = 1.5;

/// All trees in one array.
#[derive(Debug, Default)]
pub struct Forest {
    pub nodes: Vec<Node>,
    pub levels: Vec<Level>,
    /// Root of each layer, or of each run of clusters of a piece; meaningless for an empty one.
    pub roots: Vec<u32>,
    n_clusters: u64,
    pub first_gate: u32,
    n_gates: u32,
    has_top: bool,
    top_shape: TreeShape,
    best_spread: f64,
    entries: Vec<Entry>,
}

impl Forest {
    /// One tree per body and, if there are more than a few, a tree over the bodies, built from one point of each.
    pub(crate) fn new(shapes: &[&TreeShape], sample: impl Fn(LayerIx) -> [f32; 3]) -> Self {
        let mut forest = Forest::of_trees(shapes);
        let filled: Vec<LayerIx> = LayerIx::up_to(shapes.len())
            .filter(|&layer| forest.is_filled(layer))
            .collect();
        // Without a tree, kernels loop over all bodies, empty ones too.
        if filled.len() > 2 || (shapes.len() > FEW_BODIES && !filled.is_empty()) {
            forest.has_top = true;
            forest.push_top(&filled);
            forest.reorder(sample);
        }
        forest
    }

    /// The trees of the bodies, without a tree over them.
    pub(crate) fn of_trees(shapes: &[&TreeShape]) -> Self {
        let mut forest = Forest {
            roots: vec![NO_ROOT; shapes.len()],
            ..Forest::default()
        };
        let n_heights = shapes.iter().map(|shape| shape.n_levels()).max();
        // For each body, its first node at the height below.
        let mut below = vec![0u32; shapes.len()];
        for height in 0..n_heights.unwrap_or(0) {
            let first = forest.nodes.len() as u32;
            let mut next_cluster = 0u32;
            for (ix, shape) in shapes.iter().enumerate() {
                if height >= shape.n_levels() {
                    continue;
                }
                let first_here = forest.nodes.len() as u32;
                for node in 0..shape.n_nodes(height) {
                    forest.nodes.push(if height == 0 {
                        next_cluster += 1;
                        Node::new(next_cluster - 1, 0, 0, false)
                    } else {
                        let children = shape.children(height, node);
                        Node::new(
                            below[ix] + children.start as u32,
                            children.len() as u32,
                            height as u32,
                            false,
                        )
                    });
                }
                below[ix] = first_here;
                if height + 1 == shape.n_levels() {
                    forest.roots[ix] = first_here;
                }
            }
            forest.push_level(first);
        }
        forest.n_clusters = forest.levels.first().map_or(0, |level| level.count.into());
        forest
    }

    fn push_level(&mut self, first: u32) {
        self.levels.push(Level {
            first,
            count: self.nodes.len() as u32 - first,
        });
    }

    /// Appends gates and the tree over them.
    fn push_top(&mut self, filled: &[LayerIx]) {
        self.first_gate = self.nodes.len() as u32;
        self.n_gates = filled.len() as u32;
        let gate_height = self.levels.len() as u32;
        let gates = filled
            .iter()
            .map(|layer| Node::new(layer.raw(), 1, gate_height, true));
        self.nodes.extend(gates);
        self.push_level(self.first_gate);
        self.top_shape = TreeShape::new(filled.len());
        let mut below = self.first_gate;
        for level in 1..self.top_shape.n_levels() {
            let first = self.nodes.len() as u32;
            for node in 0..self.top_shape.n_nodes(level) {
                let children = self.top_shape.children(level, node);
                self.nodes.push(Node::new(
                    below + children.start as u32,
                    children.len() as u32,
                    gate_height + level as u32,
                    false,
                ));
            }
            below = first;
            self.push_level(first);
        }
    }

    /// The root of the tree over bodies.
    pub fn top(&self) -> Option<u32> {
        self.has_top.then(|| self.nodes.len() as u32 - 1)
    }

    /// The root of a layer.
    pub fn root(&self, layer: LayerIx) -> u32 {
        self.roots[layer.index()]
    }

    pub fn is_filled(&self, layer: LayerIx) -> bool {
        self.root(layer) != NO_ROOT
    }

    pub fn n_clusters(&self) -> u64 {
        self.n_clusters
    }

    pub fn gates(&self) -> &[Node] {
        let first = self.first_gate as usize;
        &self.nodes[first..first + self.n_gates as usize]
    }

    /// Reorders the gates if bodies have moved away from their neighbours. Returns whether it did.
    pub fn reorder(&mut self, sample: impl Fn(LayerIx) -> [f32; 3]) -> bool {
        if !self.has_top {
            return false;
        }
        self.entries.clear();
        let first = self.first_gate as usize;
        for gate in first..first + self.n_gates as usize {
            let number = self.nodes[gate].first_child;
            let center = sample(LayerIx::new(number));
            self.entries.push(Entry::new(center, number));
        }
        let spread = self.spread();
        let is_new = self.best_spread == 0.0;
        if !is_new && spread <= STALE * self.best_spread {
            self.best_spread = self.best_spread.min(spread);
            return false;
        }
        order(&self.top_shape, 1, None, &mut self.entries);
        for (gate, entry) in self.entries.iter().enumerate() {
            self.nodes[first + gate].first_child = entry.number;
        }
        // Never 0: that stands for "not found yet".
        self.best_spread = self.spread().max(f64::MIN_POSITIVE);
        true
    }

    /// The summed surface of the boxes around runs of neighbouring entries: how well the order fits.
    fn spread(&self) -> f64 {
        let boxes = self.entries.chunks(FANOUT);
        boxes
            .map(|entries| {
                let mut bounds = Bounds::EMPTY;
                for entry in entries {
                    bounds.join(&Bounds {
                        min: entry.center(),
                        max: entry.center(),
                    });
                }
                bounds.half_area()
            })
            .filter(|area| area.is_finite())
            .sum()
    }

    /// The number of rounds that a traversal from these pairs takes.
    pub fn rounds(&self, seeds: &[NodePair]) -> u32 {
        seeds
            .iter()
            .flat_map(|pair| [pair.a, pair.b])
            .map(|node| self.nodes[node as usize].height())
            .max()
            .map_or(0, |height| height.max(1))
    }
}
