//! Two bodies seen along the shortest way between them that has been found so far.
//!
//! Where round bodies face each other, boxes along the coordinate axes of many clusters are nearer
//! than the bodies. Along the shortest way they are not: what does not reach as far as its ends is
//! farther away. So boxes are taken along three directions at right angles of which the first is
//! that way.
//!
//! Cost: nine products for each vertex of a cluster that is asked for, once; clusters that are
//! never near are never turned.
//!
//! Invariant: a distance of such boxes is never larger than that of what they hold by more than
//! rounding (`docs/exactness.md`, "The smallest distance of two bodies").

use crate::boxes::Extent;
use crate::scene::vector::dot;

use super::tree::{Node, Tree};
use crate::boxes::scale::Scale;
use crate::scene::Body;
use crate::scene::index::ClusterIx;
use impinge_exact::Point;

/// Three directions at right angles and of length 1, but for rounding.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axes([Point; 3]);

/// Squares of lengths below this are not divided by.
const SMALLEST: f64 = 1e-200;

impl Axes {
    /// The first points from one point to another; `None` if they are too near or too far to say.
    pub fn along([from, to]: [Point; 2]) -> Option<Self> {
        let first = unit([0, 1, 2].map(|k| to[k] - from[k]))?;
        // The coordinate axis that is farthest from the first, less its part along the first.
        let axis = (0..3).fold(0, |least, k| {
            if first[k].abs() < first[least].abs() {
                k
            } else {
                least
            }
        });
        let part = first[axis];
        let second = unit([0, 1, 2].map(|k| f64::from(u8::from(k == axis)) - part * first[k]))?;
        let third =
            [(1, 2), (2, 0), (0, 1)].map(|(i, j)| first[i] * second[j] - first[j] * second[i]);
        Some(Axes([first, second, third]))
    }

    /// The first direction.
    pub fn way(&self) -> Point {
        self.0[0]
    }

    pub fn turn(&self, point: Point) -> Point {
        self.0.map(|axis| dot(axis, point))
    }

    /// A box that holds a turned box.
    fn turn_box(&self, bounds: &Extent) -> Extent {
        let (low, high) = (bounds.min, bounds.max);
        let center = self.turn([0, 1, 2].map(|k| 0.5 * low[k] + 0.5 * high[k]));
        let half = [0, 1, 2].map(|k| 0.5 * high[k] - 0.5 * low[k]);
        let reach = self.0.map(|axis| dot(axis.map(f64::abs), half));
        Extent {
            min: [0, 1, 2].map(|k| center[k] - reach[k]),
            max: [0, 1, 2].map(|k| center[k] + reach[k]),
        }
    }
}

fn unit(p: Point) -> Option<Point> {
    let squared = dot(p, p);
    let length = squared.sqrt();
    (squared > SMALLEST && squared < f64::INFINITY).then(|| p.map(|x| x / length))
}

/// The boxes of two bodies' nodes along some axes.
#[derive(Debug)]
pub(super) struct TurnedBoxes {
    pub axes: Axes,
    /// Which of the boxes is that of each cluster, for either body; [`UNKNOWN`] before it is asked
    /// for.
    box_ixs: [Vec<u32>; 2],
    boxes: Vec<Extent>,
}

const UNKNOWN: u32 = u32::MAX;

impl TurnedBoxes {
    pub fn new(axes: Axes, trees: [&Tree; 2]) -> Self {
        TurnedBoxes {
            axes,
            box_ixs: trees.map(|tree| vec![UNKNOWN; tree.clustering.n_clusters()]),
            boxes: Vec::new(),
        }
    }

    /// Looks along other axes; the memory is kept.
    pub fn turn_to(&mut self, axes: Axes) {
        self.axes = axes;
        self.box_ixs.iter_mut().for_each(|ixs| ixs.fill(UNKNOWN));
        self.boxes.clear();
    }

    /// The box of a node of the first or the second body: of a cluster from its vertices, of others
    /// from their boxes.
    pub fn bounds(
        &mut self,
        side: usize,
        (body, tree, node): (&Body, &Tree, Node),
        scale: Scale,
    ) -> Extent {
        if node.level > 0 {
            return self.axes.turn_box(&scale.extent(&tree.bounds(node)));
        }
        let ix = &mut self.box_ixs[side][node.number as usize];
        if *ix == UNKNOWN {
            *ix = self.boxes.len() as u32;
            let vertices = tree.clustering.vertices(ClusterIx::new(node.number)).iter();
            let points = vertices.map(|&vertex| body.positions().point(vertex as usize));
            let turned = points.map(|point| self.axes.turn(scale.point(point)));
            self.boxes.push(Extent::of(turned));
        }
        self.boxes[*ix as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_testing::random::Random;

    fn squared(p: Point, q: Point) -> f64 {
        let d = [0, 1, 2].map(|k| p[k] - q[k]);
        dot(d, d)
    }

    #[test]
    fn turning_keeps_distances() {
        let mut random = Random::new(8);
        let mut point = || random.point(-1.0, 1.0).map(f64::from);
        let axes_of_cube = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1e-9]];
        for trial in 0..1000 {
            let way = axes_of_cube.get(trial).copied().unwrap_or_else(&mut point);
            let axes = Axes::along([[0.0; 3], way]).expect("it has a length");
            let (p, q) = (point(), point());
            let (turned, expected) = (squared(axes.turn(p), axes.turn(q)), squared(p, q));
            // The largest coordinate is 1, so rounding is below the bound that the search takes.
            let error = super::super::best_first::ROUNDING_TURNED;
            assert!((turned.sqrt() - expected.sqrt()).abs() < error);
            // Along the way, all of its length is the first coordinate.
            let [first, ..] = axes.turn(way);
            assert!((first - dot(way, way).sqrt()).abs() < error);
        }
    }

    #[test]
    fn turned_boxes_hold_what_the_boxes_hold() {
        let mut random = Random::new(9);
        let mut point = || random.point(-1.0, 1.0).map(f64::from);
        for _ in 0..300 {
            let axes = Axes::along([point(), point()]).expect("they differ");
            let points = [point(), point(), point()];
            let bounds = Extent::of(points.into_iter());
            let turned = axes.turn_box(&bounds);
            for p in points.map(|p| axes.turn(p)) {
                assert!((0..3).all(|k| turned.min[k] - 1e-15 < p[k]));
                assert!((0..3).all(|k| p[k] < turned.max[k] + 1e-15));
            }
        }
    }

    #[test]
    fn equal_points_and_huge_ways_have_no_axes() {
        assert!(Axes::along([[1.0; 3]; 2]).is_none());
        assert!(Axes::along([[0.0; 3], [1e-120, 0.0, 0.0]]).is_none());
        assert!(Axes::along([[-1e200; 3], [1e200; 3]]).is_none());
    }
}
