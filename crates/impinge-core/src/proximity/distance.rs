//! The smallest distance of two bodies, by branch and bound over their clusters' trees.
//!
//! A queue holds pairs of nodes, nearest boxes first. The nearest pair is taken: if both are clusters, their
//! primitives are compared, else one node is replaced by its children. When the next pair is farther than the
//! best distance found so far, that distance is the answer.
//!
//! A pair of nodes is skipped only if its boxes are farther apart than the best distance by more than
//! the rounding error. So no pair of primitives is lost whose computed distance is as small or smaller, and the
//! answer does not depend on the order of the search. The pair that was nearest in the last call is compared first: bodies that
//! move little have a good bound from the start.

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, HashMap};

use super::features::{Gap, gap};
use super::tree::{Box64, Node, Tree, box_of};
use crate::error::Error;
use crate::exact::Point;
use crate::ids::BodyId;
use crate::narrow::intersect;
use crate::positions::{Positions, check_positions};
use crate::scene::{Body, Scene};

/// Finds distances; keeps the bodies' trees from call to call.
///
/// ```
/// use impinge_core::Scene;
/// use impinge_core::proximity::Distances;
/// # fn main() -> Result<(), impinge_core::Error> {
/// let mut scene = Scene::new();
/// let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let a = scene.add_triangles(&[[0, 1, 2]], &triangle)?;
/// let b = scene.add_triangles(&[[0, 1, 2]], &triangle.map(|[x, y, z]| [x + 0.25, y + 0.25, z + 3.0]))?;
/// let nearest = Distances::new().between(&scene, a, b)?.expect("both have primitives");
/// assert_eq!(nearest.distance, 3.0);
/// assert_eq!(nearest.primitives, [0, 0]);
/// # Ok(()) }
/// ```
#[derive(Debug, Default)]
pub struct Distances {
    /// By the number of the body.
    trees: HashMap<usize, Tree>,
    /// The pair found last, by the numbers of the bodies.
    last: HashMap<[usize; 2], [u32; 2]>,
}

/// The nearest pair of primitives of two bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Nearest {
    /// Their distance in the unit of the scene. 0 if and only if they share a point, which is decided exactly.
    /// Otherwise rounded: it is computed in `f64` from two points of the primitives, with an error of a few units
    /// in the last place of the largest coordinate.
    pub distance: f64,
    /// The primitive of the first body, and of the second. Of several pairs at the same computed distance, the
    /// lowest by the first body's primitive and then by the second's.
    pub primitives: [u32; 2],
    /// The point of each primitive that is nearest to the other, rounded. `None` if they share points: see
    /// [`contact`](crate::contact) for that.
    pub points: Option<[[f64; 3]; 2]>,
}

impl Distances {
    /// Starts with an empty cache.
    pub fn new() -> Self {
        Distances::default()
    }

    /// The smallest distance of two bodies and the pair of primitives that has it; `None` if one body has
    /// no primitives. Tetrahedra are solid: a body inside one has distance 0.
    ///
    /// # Errors
    /// A body that is not in the scene, the same body twice, bad positions that were written in place.
    pub fn between(
        &mut self,
        scene: &Scene,
        a: BodyId,
        b: BodyId,
    ) -> Result<Option<Nearest>, Error> {
        if a == b {
            return Err(Error::SameBody { body: a });
        }
        self.trees.retain(|&slot, _| scene.holds(slot));
        for id in [a, b] {
            self.know(scene, id)?;
        }
        let search = Search {
            bodies: [scene.body(a)?, scene.body(b)?],
            trees: [a, b].map(|id| &self.trees[&id.index()]),
        };
        let numbers = [a.index(), b.index()];
        let nearest = search.nearest(self.last.get(&numbers).copied());
        if let Some(nearest) = &nearest {
            self.last.insert(numbers, nearest.primitives);
        }
        Ok(nearest)
    }

    fn know(&mut self, scene: &Scene, id: BodyId) -> Result<(), Error> {
        let body = scene.body(id)?;
        if !body.is_checked() {
            match body.positions() {
                Positions::F32(positions) => check_positions(id, positions)?,
                Positions::F64(positions) => check_positions(id, positions)?,
            }
        }
        match self.trees.get_mut(&id.index()) {
            Some(tree) if tree.fits(body) => tree.refit(body),
            _ => {
                self.last
                    .retain(|numbers, _| !numbers.contains(&id.index()));
                self.trees.insert(id.index(), Tree::new(body));
            }
        }
        Ok(())
    }
}

/// Two nodes in the queue: nearest first, equally near ones by number.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Waiting {
    squared: f64,
    nodes: [Node; 2],
}

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_distance = self.squared.total_cmp(&other.squared);
        by_distance.then(self.nodes.cmp(&other.nodes))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The primitives of two clusters that are compared; the memory is reused.
#[derive(Default)]
struct Lists([Vec<(u32, Box64)>; 2]);

struct Search<'a> {
    bodies: [&'a Body; 2],
    trees: [&'a Tree; 2],
}

/// The best pair so far.
struct Best {
    squared: f64,
    primitives: [u32; 2],
    points: Option<[Point; 2]>,
}

/// By how much, relative to the largest coordinate, rounding may make a computed distance smaller than the
/// distance of the boxes.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

impl Search<'_> {
    /// The nearest pair; `likely` is one to compare first.
    fn nearest(&self, likely: Option<[u32; 2]>) -> Option<Nearest> {
        let (Some(a), Some(b)) = (self.trees[0].root(), self.trees[1].root()) else {
            return None;
        };
        let magnitude = self.trees[0].bounds(a).magnitude();
        let error = ROUNDING * magnitude.max(self.trees[1].bounds(b).magnitude());
        let mut best = Best {
            squared: f64::INFINITY,
            primitives: [u32::MAX; 2],
            points: None,
        };
        if let Some([x, y]) = likely {
            self.improve(
                &mut best,
                [x, y],
                [0, 1].map(|side| box_of(self.bodies[side], [x, y][side] as usize)),
            );
        }
        let mut lists = Lists::default();
        let mut waiting = BinaryHeap::from([Reverse(self.waiting([a, b]))]);
        while let Some(Reverse(next)) = waiting.pop() {
            if next.squared > limit(best.squared, error) {
                break;
            }
            if next.nodes.iter().all(|node| node.level == 0) {
                self.compare(next.nodes, error, &mut best, &mut lists);
                continue;
            }
            // The node of higher level is opened; at equal levels, the larger one.
            let [x, y] = next.nodes;
            let sizes = [0, 1].map(|side| {
                let bounds = self.trees[side].bounds(next.nodes[side]);
                bounds.squared_diagonal()
            });
            let side = match x.level.cmp(&y.level) {
                Ordering::Greater => 0,
                Ordering::Less => 1,
                Ordering::Equal => usize::from(sizes[1] > sizes[0]),
            };
            for child in self.trees[side].children(next.nodes[side]) {
                let nodes = if side == 0 { [child, y] } else { [x, child] };
                let pair = self.waiting(nodes);
                if pair.squared <= limit(best.squared, error) {
                    waiting.push(Reverse(pair));
                }
            }
        }
        Some(Nearest {
            distance: best.squared.sqrt(),
            primitives: best.primitives,
            points: best.points,
        })
    }

    fn waiting(&self, nodes: [Node; 2]) -> Waiting {
        let [x, y] = [0, 1].map(|side| self.trees[side].bounds(nodes[side]));
        Waiting {
            squared: x.squared_distance(&y),
            nodes,
        }
    }

    /// Compares all primitives of two clusters.
    fn compare(&self, nodes: [Node; 2], error: f64, best: &mut Best, lists: &mut Lists) {
        let [there, here] = [1, 0].map(|side| self.trees[side].bounds(nodes[side]));
        let most = limit(best.squared, error);
        let Lists([list_a, list_b]) = lists;
        self.trees[0].list_near(self.bodies[0], nodes[0], &there, most, list_a);
        self.trees[1].list_near(self.bodies[1], nodes[1], &here, most, list_b);
        for (a, of_a) in &*list_a {
            if of_a.squared_distance(&there) > limit(best.squared, error) {
                continue;
            }
            for (b, of_b) in &*list_b {
                if of_a.squared_distance(of_b) > limit(best.squared, error) {
                    continue;
                }
                if best.squared == 0.0 && [*a, *b] > best.primitives {
                    continue;
                }
                self.improve(best, [*a, *b], [*of_a, *of_b]);
            }
        }
    }

    /// Takes a pair if it is nearer, or as near and lower.
    fn improve(&self, best: &mut Best, [a, b]: [u32; 2], boxes: [Box64; 2]) {
        let found = self.gap(a, b, boxes[0].squared_distance(&boxes[1]));
        let is_less = found.squared < best.squared
            || (found.squared == best.squared && [a, b] < best.primitives);
        if is_less {
            *best = Best {
                squared: found.squared,
                primitives: [a, b],
                points: (found.squared > 0.0).then_some(found.points),
            };
        }
    }

    /// The distance of two primitives: 0 if and only if they meet.
    fn gap(&self, a: u32, b: u32, apart: f64) -> Gap {
        let [body_a, body_b] = self.bodies;
        let (a, b) = (corners(body_a, a), corners(body_b, b));
        // Primitives in boxes that are apart do not meet. But the distance of such boxes may underflow to 0.
        if apart == 0.0 && intersect(body_a.kind(), &a, body_b.kind(), &b) {
            return Gap {
                squared: 0.0,
                points: [a[0], b[0]],
            };
        }
        // Points and edges are triangles that repeat their last corner.
        let [n_a, n_b] = [body_a, body_b].map(|body| body.kind().n_corners().max(3));
        let found = gap(&a[..n_a], &b[..n_b]);
        Gap {
            squared: found.squared.max(f64::MIN_POSITIVE),
            ..found
        }
    }
}

/// The corners of a primitive; one with fewer than four repeats its last.
fn corners(body: &Body, primitive: u32) -> [Point; 4] {
    let vertices = body.elements().four_corners(primitive as usize);
    vertices.map(|vertex| body.positions().point(vertex as usize))
}

/// The largest squared distance of boxes that may hold a pair as near as the best.
fn limit(best_squared: f64, error: f64) -> f64 {
    let distance = best_squared.sqrt() + error;
    distance * distance * (1.0 + 8.0 * f64::EPSILON)
}
