//! Corners where a polygon bends inward, in a tree: whether one of them lies in a triangle.
//!
//! Only such corners can lie in an ear of a polygon that does not cross itself. Cost: `O(n log n)`
//! to build, `O(log n)` to remove one, and usually `O(log n)` to ask.

type Point = [f64; 2];

/// Twice the area of a triangle; positive if it is anticlockwise.
pub(super) fn turn(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Corners per leaf.
const LEAF: usize = 8;

struct Node {
    low: Point,
    high: Point,
    /// Corners that have not been removed.
    n: u32,
}

/// The tree. Its nodes halve the list of corners, and are numbered like those of a heap.
pub(super) struct InnerCorners {
    corners: Vec<u32>,
    /// The place of each corner of the polygon in the list; [`NOWHERE`] for others.
    place: Vec<u32>,
    nodes: Vec<Node>,
    depth: u32,
    /// Nodes and corners that were looked at.
    pub n_looks: u64,
}

const NOWHERE: u32 = u32::MAX;

impl InnerCorners {
    /// Some corners of a polygon.
    pub fn new(points: &[Point], corners: Vec<u32>) -> Self {
        let depth = (corners.len().div_ceil(LEAF)).next_power_of_two().ilog2();
        let mut tree = InnerCorners {
            place: vec![NOWHERE; points.len()],
            nodes: Vec::new(),
            corners,
            depth,
            n_looks: 0,
        };
        let empty = || Node {
            low: [f64::INFINITY; 2],
            high: [f64::NEG_INFINITY; 2],
            n: 0,
        };
        tree.nodes.resize_with(2 << depth, empty);
        tree.build(points, 0, 0);
        for (place, &corner) in (0..).zip(&tree.corners) {
            tree.place[corner as usize] = place;
        }
        tree
    }

    fn range(&self, depth: u32, number: usize) -> std::ops::Range<usize> {
        let n = self.corners.len() as u64;
        let start = |number: usize| ((number as u64 * n) >> depth) as usize;
        start(number)..start(number + 1)
    }

    fn build(&mut self, points: &[Point], depth: u32, number: usize) {
        let range = self.range(depth, number);
        let node = &mut self.nodes[(1 << depth) + number];
        for &corner in &self.corners[range.clone()] {
            let point = points[corner as usize];
            for (k, x) in point.into_iter().enumerate() {
                node.low[k] = node.low[k].min(x);
                node.high[k] = node.high[k].max(x);
            }
            node.n += 1;
        }
        if depth == self.depth {
            return;
        }
        let wide = |k: usize| node.high[k] - node.low[k];
        let axis = usize::from(wide(1) > wide(0));
        let middle = self.range(depth + 1, 2 * number).len();
        let at = |corner: &u32| points[*corner as usize][axis];
        if middle < range.len() {
            self.corners[range]
                .select_nth_unstable_by(middle, |a, b| at(a).total_cmp(&at(b)).then(a.cmp(b)));
        }
        self.build(points, depth + 1, 2 * number);
        self.build(points, depth + 1, 2 * number + 1);
    }

    /// Removes a corner, if it is there.
    pub fn remove(&mut self, corner: usize) {
        let place = std::mem::replace(&mut self.place[corner], NOWHERE) as usize;
        if place == NOWHERE as usize {
            return;
        }
        let mut number = 0;
        for depth in 0..=self.depth {
            self.nodes[(1 << depth) + number].n -= 1;
            if depth < self.depth {
                number =
                    2 * number + usize::from(!self.range(depth + 1, 2 * number).contains(&place));
            }
        }
    }

    /// A corner other than those of the triangle that lies in it or on its border. The triangle is
    /// anticlockwise.
    pub fn find_in(&mut self, points: &[Point], triangle: [usize; 3]) -> Option<usize> {
        let [a, b, c] = triangle.map(|corner| points[corner]);
        let low: Point = std::array::from_fn(|k| a[k].min(b[k]).min(c[k]));
        let high: Point = std::array::from_fn(|k| a[k].max(b[k]).max(c[k]));
        let is_inside =
            |p: Point| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
        let mut waiting = vec![(0, 0)];
        while let Some((depth, number)) = waiting.pop() {
            self.n_looks += 1;
            let node = &self.nodes[(1 << depth) + number];
            let is_apart = (0..2).any(|k| node.high[k] < low[k] || high[k] < node.low[k]);
            if node.n == 0 || is_apart {
                continue;
            }
            // The box lies beyond an edge if all of its corners do.
            let boxed = [
                node.low,
                [node.high[0], node.low[1]],
                node.high,
                [node.low[0], node.high[1]],
            ];
            let edges = [[a, b], [b, c], [c, a]];
            let is_beyond =
                |&[from, to]: &[Point; 2]| boxed.iter().all(|&corner| turn(from, to, corner) < 0.0);
            if edges.iter().any(is_beyond) {
                continue;
            }
            if depth < self.depth {
                waiting.extend([(depth + 1, 2 * number), (depth + 1, 2 * number + 1)]);
                continue;
            }
            for &corner in &self.corners[self.range(depth, number)] {
                let corner = corner as usize;
                self.n_looks += 1;
                let is_there = self.place[corner] != NOWHERE && !triangle.contains(&corner);
                if is_there && is_inside(points[corner]) {
                    return Some(corner);
                }
            }
        }
        None
    }
}
