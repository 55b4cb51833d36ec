//! Which bodies' boxes meet, for frames of more than two bodies.

use crate::bvh::bounds::Aabb;
use crate::bvh::tree::{Node, TreeEntry, TreeShape, order};
use crate::clusterings::Fit;
use crate::scene::index::PartIx;
use crate::workers::tuning::Tuning;

use super::bounds::TreeBounds;
use super::traversal::{self, BodyTree, NodePair};
use crate::simd::Simd;

/// A tree over the parts' boxes, for frames of more than two bodies. Its order is kept from
/// frame to frame and made again when bodies have moved away from their neighbours in it.
#[derive(Default)]
pub(crate) struct TopLevel {
    shape: TreeShape,
    order: Vec<PartIx>,
    bounds: TreeBounds,
    entries: Vec<TreeEntry>,
    fit: Fit,
}

impl TopLevel {
    /// Calls `emit(a, b)`, `a < b`, once for each pair of parts whose boxes overlap.
    #[inline(always)]
    pub fn pairs<S: Simd, E>(
        &self,
        simd: S,
        stack: &mut Vec<NodePair>,
        mut emit: impl FnMut(PartIx, PartIx) -> Result<(), E>,
    ) -> Result<(), E> {
        traversal::within(simd, self.tree(), None, stack, |i, j| {
            let (a, b) = (self.order[i as usize], self.order[j as usize]);
            if a == b {
                return Ok(());
            }
            emit(a.min(b), a.max(b))
        })
    }

    /// Calls `emit` for each part whose box overlaps a box.
    #[inline(always)]
    pub fn meeting<S: Simd, E>(
        &self,
        simd: S,
        query: &Aabb,
        stack: &mut Vec<NodePair>,
        mut emit: impl FnMut(PartIx) -> Result<(), E>,
    ) -> Result<(), E> {
        traversal::meeting(simd, self.tree(), query, stack, |leaf| {
            emit(self.order[leaf as usize])
        })
    }

    #[inline(always)]
    fn tree(&self) -> BodyTree<'_> {
        BodyTree {
            shape: &self.shape,
            bounds: &self.bounds,
        }
    }

    /// The root, if there are any parts.
    pub fn root_node(&self) -> Option<Node> {
        let level = self.bounds.levels.len().checked_sub(1)?;
        Some(Node {
            level: level as u32,
            number: 0,
        })
    }

    /// The box of all parts.
    pub fn root(&self) -> Aabb {
        self.bounds.root()
    }

    /// The box of a node.
    pub fn bounds(&self, node: Node) -> Aabb {
        self.bounds.levels[node.level as usize].at(node.number as usize)
    }

    /// The children of a node that is not a leaf.
    pub fn children(&self, node: Node) -> impl Iterator<Item = Node> + use<> {
        self.shape.children_of(node)
    }

    /// The leaves of some parts, which are in order.
    pub fn leaves(&self, parts: &[PartIx]) -> Vec<Node> {
        let leaves = (0..).zip(&self.order);
        let found = leaves.filter(|(_, part)| parts.binary_search(part).is_ok());
        found.map(|(number, _)| Node { level: 0, number }).collect()
    }

    /// The part of a leaf.
    pub fn part(&self, leaf: Node) -> PartIx {
        self.order[leaf.number as usize]
    }

    pub fn bytes(&self) -> usize {
        self.shape.bytes()
            + size_of_val(&self.order[..])
            + size_of::<TreeEntry>() * self.entries.capacity()
            + self.bounds.bytes()
    }

    /// Updates the tree to the current boxes of `n` parts.
    pub fn refit(&mut self, n: usize, tuning: &Tuning, root: impl Fn(PartIx) -> Aabb) {
        let is_new = self.order.len() != n;
        if is_new {
            self.shape = TreeShape::new(n);
            self.bounds.resize(&self.shape);
            self.order = PartIx::up_to(n).collect();
        }
        self.refit_boxes(&root);
        if self.fit.is_stale(self.spread(), tuning) || is_new {
            self.entries.clear();
            self.entries.extend(
                PartIx::up_to(n).map(|part| TreeEntry::new(root(part).center(), part.raw())),
            );
            order(&self.shape, 1, None, &mut self.entries);
            for (part, entry) in self.order.iter_mut().zip(&self.entries) {
                *part = PartIx::new(entry.number);
            }
            self.refit_boxes(&root);
            self.fit = Fit::UNKNOWN;
            self.fit.note(self.spread());
        }
    }

    fn refit_boxes(&mut self, root: &impl Fn(PartIx) -> Aabb) {
        for (leaf, &part) in self.order.iter().enumerate() {
            self.bounds.levels[0].put(leaf, &root(part));
        }
        self.bounds.refit_above(0, &self.shape);
    }

    /// The summed surface of the nodes above the leaves, divided by that of the whole.
    fn spread(&self) -> f64 {
        let Some(parents) = self.bounds.levels.get(1) else {
            return 0.0;
        };
        let areas = (0..parents.len()).map(|ix| area(&parents.at(ix)));
        let whole = area(&self.bounds.root());
        if whole > 0.0 {
            areas.sum::<f64>() / whole
        } else {
            0.0
        }
    }
}

fn area(bounds: &Aabb) -> f64 {
    let area = bounds.half_area();
    if area.is_finite() { area } else { 0.0 }
}
