//! All trees of a frame, or of a piece of one, in one array of nodes: see [`world`](super::world).

use crate::bvh::bounds::Aabb;
use crate::bvh::tree::{FANOUT, TreeEntry, TreeShape, order};

use super::layout::{Level, NO_ROOT, Node, NodePair};

/// Bodies, empty ones included, that need no tree over bodies if at most two are filled.
const FEW_BODIES: usize = 1024;
/// How far bodies may move away from their neighbours in the tree over bodies before it is rebuilt.
const STALE: f64 = 1.5;

/// All trees in one array.
#[derive(Debug, Default)]
pub struct Trees {
    pub nodes: Vec<Node>,
    /// Root of each tree; meaningless for an empty one.
    pub roots: Vec<u32>,
    /// At each height: the nodes of each tree.
    spans: Vec<Vec<Level>>,
}

/// A tree over some trees, whose leaves are gates.
#[derive(Debug, Default)]
pub struct Top {
    pub root: u32,
    /// The nodes of each height, the gates first.
    pub levels: Vec<Level>,
    pub first_gate: u32,
    n_gates: u32,
    shape: TreeShape,
    best_spread: f64,
    entries: Vec<TreeEntry>,
}

impl Trees {
    /// The trees, without a tree over them.
    pub(crate) fn of_trees(shapes: &[&TreeShape]) -> Self {
        let mut trees = Trees {
            roots: vec![NO_ROOT; shapes.len()],
            ..Trees::default()
        };
        let n_heights = shapes.iter().map(|shape| shape.n_levels()).max();
        // For each body, its first node at the height below.
        let mut below = vec![0u32; shapes.len()];
        for height in 0..n_heights.unwrap_or(0) {
            let mut next_cluster = 0u32;
            let mut spans = Vec::with_capacity(shapes.len());
            for (ix, shape) in shapes.iter().enumerate() {
                let first_here = trees.nodes.len() as u32;
                if height >= shape.n_levels() {
                    spans.push(Level::default());
                    continue;
                }
                for node in 0..shape.n_nodes(height) {
                    trees.nodes.push(if height == 0 {
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
                spans.push(Level {
                    first: first_here,
                    count: trees.nodes.len() as u32 - first_here,
                });
                if height + 1 == shape.n_levels() {
                    trees.roots[ix] = first_here;
                }
            }
            trees.spans.push(spans);
        }
        trees
    }

    /// At each height, the nodes of some trees, or of all, and those between them.
    pub fn levels(&self, trees: Option<&[u32]>) -> Vec<Level> {
        let over = |spans: &Vec<Level>| {
            let all = 0..spans.len() as u32;
            let spans = |tree: u32| spans[tree as usize];
            match trees {
                Some(trees) => cover(trees.iter().copied().map(spans)),
                None => cover(all.map(spans)),
            }
        };
        self.spans.iter().map(over).collect()
    }

    /// Appends a tree over some trees, if there are more than a few, built from one point of each.
    pub(crate) fn push_top(
        &mut self,
        trees: &[u32],
        sample: impl Fn(u32) -> [f32; 3],
    ) -> Option<Top> {
        let is_filled = |tree: &u32| self.roots[*tree as usize] != NO_ROOT;
        let filled: Vec<u32> = trees.iter().copied().filter(is_filled).collect();
        // Without a tree, kernels loop over all bodies, empty ones too.
        let is_needed = filled.len() > 2 || (trees.len() > FEW_BODIES && !filled.is_empty());
        if !is_needed {
            return None;
        }
        let height = self.spans.len() as u32;
        let mut top = Top {
            first_gate: self.nodes.len() as u32,
            n_gates: filled.len() as u32,
            shape: TreeShape::new(filled.len()),
            ..Top::default()
        };
        let gates = filled.iter().map(|&tree| Node::new(tree, 1, height, true));
        self.nodes.extend(gates);
        let mut below = top.first_gate;
        top.levels.push(self.since(below));
        for level in 1..top.shape.n_levels() {
            let first = self.nodes.len() as u32;
            for node in 0..top.shape.n_nodes(level) {
                let children = top.shape.children(level, node);
                self.nodes.push(Node::new(
                    below + children.start as u32,
                    children.len() as u32,
                    height + level as u32,
                    false,
                ));
            }
            below = first;
            top.levels.push(self.since(first));
        }
        top.root = self.nodes.len() as u32 - 1;
        top.reorder(&mut self.nodes, sample);
        Some(top)
    }

    fn since(&self, first: u32) -> Level {
        let count = self.nodes.len() as u32 - first;
        Level { first, count }
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

/// The nodes of some runs and those between them.
fn cover(spans: impl Iterator<Item = Level>) -> Level {
    let filled = spans.filter(|span| span.count > 0);
    let both = filled.fold(None, |so_far: Option<(u32, u32)>, span| {
        let (first, end) = (span.first, span.first + span.count);
        Some(match so_far {
            Some((low, high)) => (low.min(first), high.max(end)),
            None => (first, end),
        })
    });
    let (first, end) = both.unwrap_or_default();
    Level {
        first,
        count: end - first,
    }
}

impl Top {
    fn range(&self) -> std::ops::Range<usize> {
        let first = self.first_gate as usize;
        first..first + self.n_gates as usize
    }

    pub fn gates<'a>(&self, nodes: &'a [Node]) -> &'a [Node] {
        &nodes[self.range()]
    }

    /// Reorders the gates if bodies have moved away from their neighbours. Returns whether it did.
    pub fn reorder(&mut self, nodes: &mut [Node], sample: impl Fn(u32) -> [f32; 3]) -> bool {
        self.entries.clear();
        let gates = &mut nodes[self.range()];
        for gate in &*gates {
            let number = gate.first_child;
            self.entries.push(TreeEntry::new(sample(number), number));
        }
        let spread = self.spread();
        let is_new = self.best_spread == 0.0;
        if !is_new && spread <= STALE * self.best_spread {
            self.best_spread = self.best_spread.min(spread);
            return false;
        }
        order(&self.shape, 1, None, &mut self.entries);
        for (gate, entry) in gates.iter_mut().zip(&self.entries) {
            gate.first_child = entry.number;
        }
        // Never 0: that stands for "not found yet".
        self.best_spread = self.spread().max(f64::MIN_POSITIVE);
        true
    }

    /// The summed surface of the boxes around runs of neighbouring entries: how well the order
    /// fits.
    fn spread(&self) -> f64 {
        let boxes = self.entries.chunks(FANOUT);
        boxes
            .map(|entries| {
                let mut bounds = Aabb::EMPTY;
                for entry in entries {
                    bounds.join(&Aabb {
                        min: entry.center(),
                        max: entry.center(),
                    });
                }
                bounds.half_area()
            })
            .filter(|area| area.is_finite())
            .sum()
    }
}
