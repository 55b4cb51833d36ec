//! The places where bodies meet: connected pairs, with a position and a size.

use std::collections::HashMap;

use impinge::{Body, BodyId, Pairs, Scene};

use crate::error::Error;

/// The most pairs for which regions are computed: beyond, they take seconds and are hardly useful.
const MOST_PAIRS: usize = 2_000_000;

/// Pairs of two bodies, or of one body with itself, that are connected by shared primitives or vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The numbers of the bodies, the lower one first; the same number twice for self-collision.
    pub bodies: [usize; 2],
    /// How many pairs the region has.
    pub n_pairs: usize,
    /// The first pair of the region: one primitive of each body.
    pub first: [u32; 2],
    /// The box around the overlaps of the two primitives' boxes, over all pairs.
    low: [f64; 3],
    high: [f64; 3],
}

impl Region {
    /// The middle of the box.
    pub fn center(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.low[axis] / 2.0 + self.high[axis] / 2.0)
    }

    /// The longest side of the box.
    pub fn size(&self) -> f64 {
        (0..3)
            .map(|axis| self.high[axis] - self.low[axis])
            .fold(0.0, f64::max)
    }
}

/// The regions of an answer, those with the most pairs first; `None` if there are too many pairs.
pub fn regions(
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
) -> Result<Option<Vec<Region>>, Error> {
    if pairs.len() > MOST_PAIRS {
        return Ok(None);
    }
    let numbers: HashMap<BodyId, usize> = bodies
        .iter()
        .enumerate()
        .map(|(ix, &(id, _))| (id, ix))
        .collect();
    let read: Vec<&Body> = bodies
        .iter()
        .map(|&(id, _)| scene.body(id))
        .collect::<Result<_, _>>()?;
    // One node per vertex of a colliding primitive, separately for each pair of bodies: (body, other body, vertex).
    let mut sets = Sets::default();
    let mut nodes: HashMap<[u32; 3], u32> = HashMap::new();
    let mut of_pairs = Vec::with_capacity(pairs.len());
    for (a, b) in pairs.iter() {
        let [a_ix, b_ix] = [numbers[&a.body], numbers[&b.body]];
        let mut last: Option<u32> = None;
        for (own, other, primitive) in [(a_ix, b_ix, a.primitive), (b_ix, a_ix, b.primitive)] {
            for &vertex in read[own].elements().corners(primitive as usize) {
                let key = [own as u32, other as u32, vertex];
                let node = *nodes.entry(key).or_insert_with(|| sets.add());
                if let Some(last) = last {
                    sets.join(last, node);
                }
                last = Some(node);
            }
        }
        of_pairs.push(last.unwrap_or_default());
    }
    let mut regions: Vec<Region> = Vec::new();
    let mut of_roots: HashMap<u32, usize> = HashMap::new();
    for ((a, b), node) in pairs.iter().zip(of_pairs) {
        let bodies = [numbers[&a.body], numbers[&b.body]];
        let (a_box, b_box) = (
            extent(read[bodies[0]], a.primitive),
            extent(read[bodies[1]], b.primitive),
        );
        let region = *of_roots.entry(sets.root(node)).or_insert_with(|| {
            regions.push(Region {
                bodies,
                n_pairs: 0,
                first: [a.primitive, b.primitive],
                low: [f64::INFINITY; 3],
                high: [f64::NEG_INFINITY; 3],
            });
            regions.len() - 1
        });
        let region = &mut regions[region];
        region.n_pairs += 1;
        for axis in 0..3 {
            region.low[axis] = region.low[axis].min(a_box.0[axis].max(b_box.0[axis]));
            region.high[axis] = region.high[axis].max(a_box.1[axis].min(b_box.1[axis]));
        }
    }
    // The sort is stable: regions with equally many pairs stay in the order of their first pair.
    regions.sort_by_key(|region| std::cmp::Reverse(region.n_pairs));
    Ok(Some(regions))
}

/// The box of a primitive.
fn extent(body: &Body, primitive: u32) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for &vertex in body.elements().corners(primitive as usize) {
        let point = body.positions().point(vertex as usize);
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    (low, high)
}

/// Disjoint sets (Tarjan 1975, with path halving).
#[derive(Default)]
struct Sets {
    parents: Vec<u32>,
}

impl Sets {
    /// Adds a set of one node and returns the node.
    fn add(&mut self) -> u32 {
        // At most eight nodes per pair, of which there are two million.
        let node = self.parents.len() as u32;
        self.parents.push(node);
        node
    }

    fn root(&mut self, mut node: u32) -> u32 {
        while self.parents[node as usize] != node {
            let above = self.parents[self.parents[node as usize] as usize];
            self.parents[node as usize] = above;
            node = above;
        }
        node
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use impinge::{Backend, Detector, Query};

    use super::*;

    /// A horizontal sheet of two triangles without shared vertices. Two upright triangles pierce it far apart; so does
    /// a third triangle of another body.
    #[test]
    fn pairs_that_hang_together_are_one_region() {
        let sheet = [[0u32, 1, 2], [3, 4, 5]];
        let corners = [
            [0f32, 0.0, 0.0],
            [9.0, 0.0, 0.0],
            [0.0, 9.0, 0.0],
            [0.0, 9.0, 0.0],
            [9.0, 0.0, 0.0],
            [9.0, 9.0, 0.0],
        ];
        let upright = |x: f32, y: f32| [[x, y, -1.0], [x + 0.25, y, 1.0], [x, y + 0.25, 1.0]];
        let mut scene = Scene::new();
        let a = scene.add_triangles(&sheet, &corners).unwrap();
        let spikes = [upright(1.0, 1.0), upright(8.0, 8.0)].concat();
        let b = scene
            .add_triangles(&[[0, 1, 2], [3, 4, 5]], &spikes)
            .unwrap();
        let c = scene
            .add_triangles(&[[0, 1, 2]], &upright(4.5, 4.375))
            .unwrap();
        let mut detector = Detector::new(Backend::Cpu).unwrap();
        let pairs = detector.detect(&scene, &Query::all()).unwrap();
        let bodies = [(a, "a"), (b, "b"), (c, "c")];
        let regions = regions(&scene, &bodies, pairs).unwrap().unwrap();
        let found: Vec<_> = regions
            .iter()
            .map(|r| (r.bodies, r.n_pairs, r.first))
            .collect();
        // The last one touches both triangles of the sheet.
        assert_eq!(
            found,
            [
                ([0, 2], 2, [0, 0]),
                ([0, 1], 1, [0, 0]),
                ([0, 1], 1, [1, 1])
            ]
        );
        let center = regions[1].center();
        assert!(
            (center[0] - 1.125).abs() < 0.01 && center[2] == 0.0,
            "{center:?}"
        );
        assert_eq!(regions[1].size(), 0.25);
    }
}
