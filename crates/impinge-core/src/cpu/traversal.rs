//! Stage `traversal`: pairs of clusters whose boxes meet, tree against tree or a tree against
//! itself.
//!
//! In: two trees of boxes. Out: pairs of leaves, each once. Eight boxes are tested at a time; the
//! stack holds pairs of nodes whose boxes are known to overlap. Cost: proportional to the node
//! pairs that overlap. Reason for each discard: boxes that do not overlap hold elements that
//! cannot meet.

use crate::bvh::bounds::Aabb;
use crate::bvh::hubs::Hubs;
use crate::bvh::tree::TreeShape;

use super::bounds::TreeBounds;
use crate::simd::Simd;

/// A tree: its shape and its current boxes.
#[derive(Clone, Copy)]
pub(crate) struct BodyTree<'a> {
    pub shape: &'a TreeShape,
    pub bounds: &'a TreeBounds,
}

impl BodyTree<'_> {
    fn top(&self) -> Option<u32> {
        self.bounds
            .levels
            .len()
            .checked_sub(1)
            .map(|top| top as u32)
    }

    #[inline(always)]
    fn at(&self, level: u32, node: u32) -> Aabb {
        self.bounds.levels[level as usize].at(node as usize)
    }

    /// The children of a node that overlap a box: the first child, and one bit per child.
    #[inline(always)]
    fn children_meeting<S: Simd>(
        &self,
        simd: S,
        level: u32,
        node: u32,
        query: &Aabb,
    ) -> MeetingChildren {
        let children = self.shape.children(level as usize, node as usize);
        let boxes = &self.bounds.levels[level as usize - 1];
        let mask = simd.overlaps_8(boxes, children.start, query) & ((1 << children.len()) - 1);
        MeetingChildren {
            first: children.start as u32,
            mask,
        }
    }
}

#[derive(Clone, Copy)]
struct MeetingChildren {
    first: u32,
    mask: u32,
}

impl Iterator for MeetingChildren {
    type Item = u32;

    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        (self.mask != 0).then(|| {
            let bit = self.mask.trailing_zeros();
            self.mask &= self.mask - 1;
            self.first + bit
        })
    }
}

/// Two nodes whose boxes overlap; when a tree meets itself, also a node with itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodePair {
    level_a: u32,
    a: u32,
    level_b: u32,
    b: u32,
}

/// Calls `emit(leaf_a, leaf_b)` for every pair of leaves of two trees whose boxes overlap.
#[inline(always)]
pub(crate) fn between<S: Simd, E>(
    simd: S,
    a: BodyTree<'_>,
    b: BodyTree<'_>,
    stack: &mut Vec<NodePair>,
    mut emit: impl FnMut(u32, u32) -> Result<(), E>,
) -> Result<(), E> {
    let (Some(level_a), Some(level_b)) = (a.top(), b.top()) else {
        return Ok(());
    };
    if !a.at(level_a, 0).overlaps(&b.at(level_b, 0)) {
        return Ok(());
    }
    stack.clear();
    stack.push(NodePair {
        level_a,
        a: 0,
        level_b,
        b: 0,
    });
    while let Some(pair) = stack.pop() {
        descend(simd, a, b, pair, stack, &mut emit)?;
    }
    Ok(())
}

/// Calls `emit(leaf)` for every leaf of a tree whose box overlaps a box.
#[inline(always)]
pub(crate) fn meeting<S: Simd, E>(
    simd: S,
    tree: BodyTree<'_>,
    query: &Aabb,
    stack: &mut Vec<NodePair>,
    mut emit: impl FnMut(u32) -> Result<(), E>,
) -> Result<(), E> {
    let Some(top) = tree.top() else {
        return Ok(());
    };
    let alone = |level_a: u32, a: u32| NodePair {
        level_a,
        a,
        level_b: 0,
        b: 0,
    };
    stack.clear();
    if tree.at(top, 0).overlaps(query) {
        stack.push(alone(top, 0));
    }
    while let Some(NodePair { level_a, a, .. }) = stack.pop() {
        if level_a == 0 {
            emit(a)?;
            continue;
        }
        for child in tree.children_meeting(simd, level_a, a, query) {
            stack.push(alone(level_a - 1, child));
        }
    }
    Ok(())
}

/// Calls `emit(leaf, other)`, `leaf <= other`, for every leaf with itself and every pair of
/// different leaves of one tree whose boxes overlap, except below pairs of nodes whose elements
/// all name a common hub.
#[inline(always)]
pub(crate) fn within<S: Simd, E>(
    simd: S,
    tree: BodyTree<'_>,
    hubs: Option<&Hubs>,
    stack: &mut Vec<NodePair>,
    mut emit: impl FnMut(u32, u32) -> Result<(), E>,
) -> Result<(), E> {
    let share_hub = |a: (u32, u32), b: (u32, u32)| hubs.is_some_and(|hubs| hubs.hold_all(a, b));
    let mut emit = |a: u32, b: u32| match share_hub((0, a), (0, b)) {
        true => Ok(()),
        false => emit(a, b),
    };
    let Some(level) = tree.top() else {
        return Ok(());
    };
    stack.clear();
    stack.push(NodePair {
        level_a: level,
        a: 0,
        level_b: level,
        b: 0,
    });
    while let Some(pair) = stack.pop() {
        if share_hub((pair.level_a, pair.a), (pair.level_b, pair.b)) {
            continue;
        }
        if pair.level_a != pair.level_b || pair.a != pair.b {
            descend(simd, tree, tree, pair, stack, &mut emit)?;
            continue;
        }
        let (level, node) = (pair.level_a, pair.a);
        if level == 0 {
            emit(node, node)?;
            continue;
        }
        for child in tree.shape.children(level as usize, node as usize) {
            let child = child as u32;
            let query = tree.at(level - 1, child);
            let mut meeting = tree.children_meeting(simd, level, node, &query);
            // Every pair once; a child with itself whatever its box.
            meeting.mask &= u32::MAX << (child - meeting.first) << 1;
            for other in std::iter::once(child).chain(meeting) {
                if level == 1 {
                    emit(child, other)?;
                } else {
                    stack.push(NodePair {
                        level_a: level - 1,
                        a: child,
                        level_b: level - 1,
                        b: other,
                    });
                }
            }
        }
    }
    Ok(())
}

/// Replaces a pair of different nodes by the pairs of their children that overlap: the children of
/// the higher node, or of both.
#[inline(always)]
fn descend<S: Simd, E>(
    simd: S,
    a: BodyTree<'_>,
    b: BodyTree<'_>,
    pair: NodePair,
    stack: &mut Vec<NodePair>,
    emit: &mut impl FnMut(u32, u32) -> Result<(), E>,
) -> Result<(), E> {
    let NodePair {
        level_a,
        a: node_a,
        level_b,
        b: node_b,
    } = pair;
    if level_a == 0 && level_b == 0 {
        return emit(node_a, node_b);
    }
    let mut put = |level_a: u32, a: u32, level_b: u32, b: u32| {
        if level_a == 0 && level_b == 0 {
            return emit(a, b);
        }
        stack.push(NodePair {
            level_a,
            a,
            level_b,
            b,
        });
        Ok(())
    };
    if level_a > level_b {
        let query = b.at(level_b, node_b);
        for child in a.children_meeting(simd, level_a, node_a, &query) {
            put(level_a - 1, child, level_b, node_b)?;
        }
    } else if level_b > level_a {
        let query = a.at(level_a, node_a);
        for child in b.children_meeting(simd, level_b, node_b, &query) {
            put(level_a, node_a, level_b - 1, child)?;
        }
    } else {
        let query = b.at(level_b, node_b);
        for child_a in a.children_meeting(simd, level_a, node_a, &query) {
            let query = a.at(level_a - 1, child_a);
            for child_b in b.children_meeting(simd, level_b, node_b, &query) {
                put(level_a - 1, child_a, level_b - 1, child_b)?;
            }
        }
    }
    Ok(())
}
