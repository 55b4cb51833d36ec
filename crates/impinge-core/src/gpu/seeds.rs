//! Where traversals start: pairs of nodes, and their children where a pass is split.

use crate::plan::Plan;
use crate::scene::index::PartIx;

use super::layout::{NO_ROOT, Node, NodePair};
use super::view::Motion;
use super::world::DeviceWorld;

impl DeviceWorld {
    fn root(&self, part: u32) -> u32 {
        self.trees.roots[part as usize]
    }

    /// The seeds of a traversal: pairs of nodes, whose boxes need not overlap.
    pub fn seeds(&self, plan: &Plan, motion: Motion) -> Vec<NodePair> {
        let view = self.view(motion);
        let root = |query_part: PartIx| self.root(view.parts[query_part.index()]);
        let is_filled = |query_part: &PartIx| root(*query_part) != NO_ROOT;
        let mut seeds = Vec::new();
        if let Some(top) = view.top()
            && plan.between()
        {
            return vec![NodePair { a: top, b: top }];
        }
        if plan.between() {
            let filled: Vec<PartIx> = plan.part_ixs().filter(is_filled).collect();
            if let [a, b] = filled[..]
                && plan.test(a, b).is_some()
            {
                seeds.push(NodePair {
                    a: root(a),
                    b: root(b),
                });
            }
        }
        for (ix, query_part) in plan.numbered_parts() {
            let is_asked = query_part.within && plan.test(ix, ix).is_some();
            if is_asked && is_filled(&ix) {
                seeds.push(NodePair {
                    a: root(ix),
                    b: root(ix),
                });
            }
        }
        seeds
    }

    /// The seeds of a piece, from pairs of its runs by their numbers.
    pub fn seeds_of_runs(&self, pairs: &[[u32; 2]]) -> Vec<NodePair> {
        let seed = |&[a, b]: &[u32; 2]| NodePair {
            a: self.root(a),
            b: self.root(b),
        };
        pairs.iter().map(seed).collect()
    }

    /// Appends the pairs of children of two nodes, whether their boxes overlap or not. Returns
    /// false, and appends nothing, for two clusters. The same steps as `traversal.wgsl`.
    pub fn expand(
        &self,
        plan: &Plan,
        motion: Motion,
        pair: NodePair,
        into: &mut Vec<NodePair>,
    ) -> bool {
        let nodes = &self.trees.nodes;
        let (a, b) = (&nodes[pair.a as usize], &nodes[pair.b as usize]);
        if a.height() == 0 && b.height() == 0 {
            return false;
        }
        if a.is_gate() && b.is_gate() {
            let parts = [a, b].map(|gate| gate.first_child);
            let query_parts = parts.map(|part| self.view(motion).query_parts[part as usize]);
            let [part_a, part_b] = query_parts.map(PartIx::new);
            if plan.test(part_a, part_b).is_some() {
                let [a, b] = parts.map(|part| self.root(part));
                into.push(NodePair { a, b });
            }
            return true;
        }
        let children = |node: &Node| node.first_child..node.first_child + node.n_children();
        if pair.a == pair.b {
            for i in children(a) {
                into.extend((i..children(a).end).map(|j| NodePair { a: i, b: j }));
            }
        } else if a.height() > b.height() {
            into.extend(children(a).map(|i| NodePair { a: i, b: pair.b }));
        } else if b.height() > a.height() {
            into.extend(children(b).map(|j| NodePair { a: pair.a, b: j }));
        } else {
            for i in children(a) {
                into.extend(children(b).map(|j| NodePair { a: i, b: j }));
            }
        }
        true
    }

    /// The number of rounds that a traversal from these pairs takes.
    pub fn rounds(&self, seeds: &[NodePair]) -> u32 {
        self.trees.rounds(seeds)
    }
}
