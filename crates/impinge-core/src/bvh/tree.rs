//! The shape of a wide tree over leaves in some order, and that order.
//!
//! Level 0 holds the leaves. A node of level `l` has up to eight children, which are consecutive in
//! level `l - 1`. The top level holds the root. All leaves are equally deep and children share the
//! leaves evenly, so the shape follows from the number of leaves alone:
//!
//! ```text
//! level 2                 [ root ]
//! level 1      [ 0..5 ]            [ 5..10 ]
//! level 0   0  1  2  3  4       5  6  7  8  9
//! ```
//!
//! The order comes from splitting at medians of the box centres along the axis on which they vary
//! most, at the boundaries that the shape prescribes (a balanced k-d order; median splits made 5
//! times fewer cluster pairs than blocks along a Morton curve on the dragon, see
//! `docs/lab/intersections.md`).
//!
//! Cost: `O(n log n)` once per topology. Invariant: an order is a permutation, whatever the input.

use std::ops::Range;

use super::parallel::join;

/// The most children of a node.
pub(crate) const FANOUT: usize = 8;

/// The tree's shape: for each level above the leaves, where each node's children start.
#[derive(Debug, Clone, Default)]
pub(crate) struct TreeShape {
    n_leaves: usize,
    /// `child_starts[l]` has one entry per node of level `l + 1`, and one more for the end of the
    /// last.
    child_starts: Vec<Vec<u32>>,
}

impl TreeShape {
    /// The shape over `n_leaves` leaves; without leaves it has no levels.
    pub fn new(n_leaves: usize) -> Self {
        // How many leaves each node of the level holds, from the root down.
        let mut leaf_starts: Vec<Vec<usize>> = Vec::new();
        if n_leaves > 0 {
            leaf_starts.push(vec![0, n_leaves]);
        }
        let mut capacity = 1;
        while capacity < n_leaves {
            capacity *= FANOUT;
        }
        let mut child_starts = Vec::new();
        while capacity > 1 {
            capacity /= FANOUT;
            let parents = leaf_starts.last().expect("has a root");
            let mut starts = vec![0];
            let mut children = vec![0u32];
            for parent in parents.windows(2) {
                let held = parent[1] - parent[0];
                let n_children = held.div_ceil(capacity);
                starts.extend((1..=n_children).map(|k| parent[0] + held * k / n_children));
                children.push(starts.len() as u32 - 1);
            }
            leaf_starts.push(starts);
            child_starts.push(children);
        }
        child_starts.reverse();
        TreeShape {
            n_leaves,
            child_starts,
        }
    }

    /// The number of levels, those of the leaves and the root included.
    pub fn n_levels(&self) -> usize {
        match self.n_leaves {
            0 => 0,
            _ => self.child_starts.len() + 1,
        }
    }

    /// The number of nodes of a level.
    pub fn n_nodes(&self, level: usize) -> usize {
        match level {
            0 => self.n_leaves,
            _ => self.child_starts[level - 1].len() - 1,
        }
    }

    /// The children of a node of a level above 0, as a range of the level below.
    #[inline(always)]
    pub fn children(&self, level: usize, node: usize) -> Range<usize> {
        let starts = &self.child_starts[level - 1];
        starts[node] as usize..starts[node + 1] as usize
    }

    /// The children of a node that is not a leaf.
    pub fn children_of(&self, node: Node) -> impl Iterator<Item = Node> + use<> {
        let children = self.children(node.level as usize, node.number as usize);
        children.map(move |number| Node {
            level: node.level - 1,
            number: number as u32,
        })
    }

    pub fn bytes(&self) -> usize {
        self.child_starts
            .iter()
            .map(|starts| size_of_val(&starts[..]))
            .sum()
    }
}

/// A node of a tree; level 0 holds the leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Node {
    pub level: u32,
    pub number: u32,
}

/// An entry to be ordered: a centre, and the number of what it stands for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TreeEntry {
    /// The coordinates as integers in the same order, so that comparing needs no branch.
    keys: [u32; 3],
    pub number: u32,
}

impl TreeEntry {
    #[inline(always)]
    pub fn new(center: [f32; 3], number: u32) -> Self {
        // The order of `f32::total_cmp`: negative numbers are reversed and placed below all others.
        let key = |x: f32| x.to_bits() ^ (((x.to_bits() as i32) >> 31) as u32 | 1 << 31);
        TreeEntry {
            keys: center.map(key),
            number,
        }
    }

    #[inline(always)]
    pub fn center(&self) -> [f32; 3] {
        self.keys
            .map(|key| f32::from_bits(key ^ (!((key as i32) >> 31) as u32 | 1 << 31)))
    }
}

/// A piece with fewer entries is not worth another thread.
const PARALLEL_FROM: usize = 8 * 1024;

/// The most entries of a node that are looked at to choose the axis.
const SAMPLE: usize = 32;

/// Puts entries in the order of the shape. Its leaves hold `leaf_size` entries each, the last leaf
/// the rest. If entries have classes, by number, those of one class follow each other, whatever
/// their centers.
pub(crate) fn order(
    shape: &TreeShape,
    leaf_size: usize,
    classes: Option<&[Option<u32>]>,
    entries: &mut [TreeEntry],
) {
    order_while(&|| true, shape, leaf_size, classes, entries);
}

/// The same, as long as `go_on` says so; it is asked before each large piece of work.
pub(crate) fn order_while(
    go_on: &GoOn<'_>,
    shape: &TreeShape,
    leaf_size: usize,
    classes: Option<&[Option<u32>]>,
    entries: &mut [TreeEntry],
) {
    debug_assert_eq!(shape.n_leaves, entries.len().div_ceil(leaf_size));
    if shape.n_levels() > 0 {
        let split = Split {
            go_on,
            shape,
            leaf_size,
            classes,
        };
        split.nodes(shape.n_levels() - 1, 0..1, 0, entries);
    }
}

/// Whether to go on: false once a question is cancelled.
pub(crate) type GoOn<'a> = dyn Fn() -> bool + Sync + 'a;

struct Split<'a> {
    go_on: &'a GoOn<'a>,
    shape: &'a TreeShape,
    leaf_size: usize,
    classes: Option<&'a [Option<u32>]>,
}

impl Split<'_> {
    /// Splits the entries of a run of consecutive nodes; `first_leaf` is the run's first leaf.
    fn nodes(
        &self,
        level: usize,
        nodes: Range<usize>,
        first_leaf: usize,
        entries: &mut [TreeEntry],
    ) {
        if nodes.len() == 1 {
            if level > 0 {
                let children = self.shape.children(level, nodes.start);
                self.nodes(level - 1, children, first_leaf, entries);
            }
            return;
        }
        let parallel = entries.len() >= PARALLEL_FROM;
        if parallel && !(self.go_on)() {
            return;
        }
        let middle = nodes.start + nodes.len() / 2;
        let middle_leaf = self.first_leaf(level, middle);
        let cut = (middle_leaf - first_leaf) * self.leaf_size;
        split_at(entries, cut, self.classes);
        let (low, high) = entries.split_at_mut(cut);
        let mut low = || self.nodes(level, nodes.start..middle, first_leaf, low);
        let mut high = || self.nodes(level, middle..nodes.end, middle_leaf, high);
        if parallel {
            join(low, high);
        } else {
            low();
            high();
        }
    }

    fn first_leaf(&self, level: usize, node: usize) -> usize {
        (1..=level)
            .rev()
            .fold(node, |node, level| self.shape.children(level, node).start)
    }
}

/// Moves the `cut` entries that are lowest along the widest axis to the front; lower classes come
/// before higher ones. The two sets depend only on the input.
fn split_at(entries: &mut [TreeEntry], cut: usize, classes: Option<&[Option<u32>]>) {
    if cut == 0 || cut >= entries.len() {
        return;
    }
    // One copy of the code per axis: where a key lies is then known.
    match widest_axis(entries) {
        0 => split_along::<0>(entries, cut, classes),
        1 => split_along::<1>(entries, cut, classes),
        _ => split_along::<2>(entries, cut, classes),
    }
}

fn split_along<const AXIS: usize>(
    entries: &mut [TreeEntry],
    cut: usize,
    classes: Option<&[Option<u32>]>,
) {
    match classes {
        None => entries.select_nth_unstable_by_key(cut, |entry| entry.keys[AXIS]),
        Some(classes) => entries.select_nth_unstable_by_key(cut, |entry| {
            (classes[entry.number as usize], entry.keys[AXIS])
        }),
    };
}

/// The axis on which a sample of the entries has the largest variance. The extent of all entries
/// gives 3 % more pairs of clusters on scans, for a few outliers decide it, and takes four times as
/// long.
fn widest_axis(entries: &[TreeEntry]) -> usize {
    let from = entries[0].center();
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    let sample = entries.iter().step_by(entries.len().div_ceil(SAMPLE));
    let n = sample.len() as f64;
    for entry in sample {
        let center = entry.center();
        for axis in 0..3 {
            let offset = f64::from(center[axis]) - f64::from(from[axis]);
            sum[axis] += offset;
            squares[axis] += offset * offset;
        }
    }
    let spread: [f64; 3] = std::array::from_fn(|k| squares[k] - sum[k] * sum[k] / n);
    (0..3).fold(0, |best, k| if spread[k] > spread[best] { k } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_partition_their_leaves() {
        for n_leaves in (0..600).chain([4095, 4096, 4097, 6250, 100_000]) {
            let shape = TreeShape::new(n_leaves);
            for level in 1..shape.n_levels() {
                let mut next = 0;
                for node in 0..shape.n_nodes(level) {
                    let children = shape.children(level, node);
                    assert_eq!(children.start, next);
                    assert!((1..=FANOUT).contains(&children.len()), "{n_leaves} leaves");
                    next = children.end;
                }
                assert_eq!(next, shape.n_nodes(level - 1));
            }
            if n_leaves > 0 {
                assert_eq!(shape.n_nodes(shape.n_levels() - 1), 1);
                assert_eq!(shape.n_nodes(0), n_leaves);
            }
        }
    }

    #[test]
    fn orders_are_permutations_even_of_equal_centers() {
        for n in [1usize, 63, 64, 65, 1000, 20_000] {
            let leaves = TreeShape::new(n.div_ceil(64));
            let mut entries: Vec<TreeEntry> = (0..n as u32)
                .map(|number| {
                    let center = [(number % 7) as f32, 0.0, f32::from(number % 3 == 0)];
                    TreeEntry::new(center, number)
                })
                .collect();
            order(&leaves, 64, None, &mut entries);
            let mut numbers: Vec<u32> = entries.iter().map(|entry| entry.number).collect();
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..n as u32));
        }
    }
}
