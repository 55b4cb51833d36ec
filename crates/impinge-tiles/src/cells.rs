//! Half-open cells that fill space, and which box goes to which cell.
//!
//! A cut at `c` along an axis divides a cell into a low side, `x < c`, and a high side, `x >= c`. A
//! box goes to the low side if `lo < c` and to the high side if `hi >= c`. Its corners are given
//! numbers, so these comparisons are exact.
//!
//! Why every pair is found exactly once: let two boxes meet, and let p be the larger of their lower
//! corners, axis by axis. Then p lies in both boxes. Consider each cut on the way to the cell that
//! holds p. If `p < c`, the lower corner of each box is at most p, so it is below c and the box
//! goes low. If `p >= c`, the upper corner of each box is at least p, so the box goes high. So that
//! cell gets both boxes. Cells are disjoint and fill space, so exactly one cell holds p.
//!
//! Where pairs within a distance d count, the box goes to the high side if `hi + d >= c`. Along an
//! axis, boxes within d have a gap of at most d. There p is the lower corner of one of them, so p
//! is at most the upper corner of either box plus d, as real numbers. Rounding to nearest keeps
//! order and p is a floating-point number, so p is also at most the rounded sum. If `p >= c`, that
//! sum is at least c, and the box goes high. The low side is unchanged: p is at least the lower
//! corner of each box.

use serde_json::{Value, json};

/// The comparisons as a type, so that tests can replace them by wrong ones and check that this is
/// noticed.
pub(crate) trait Rule {
    /// Whether a box with this lower coordinate goes to the low side.
    fn goes_low(lo: f64, cut: f64) -> bool;
    /// Whether a box with this upper coordinate goes to the high side.
    fn goes_high(hi: f64, cut: f64) -> bool;
    /// The largest coordinate of an owner point of a box with this upper coordinate and a box
    /// within the separation.
    fn reach(hi: f64, separation: f64) -> f64 {
        hi + separation
    }
    /// Whether a point with this coordinate lies on the low side.
    fn lies_low(x: f64, cut: f64) -> bool;
}

/// The correct comparisons.
pub(crate) struct HalfOpen;

impl Rule for HalfOpen {
    fn goes_low(lo: f64, cut: f64) -> bool {
        lo < cut
    }

    fn goes_high(hi: f64, cut: f64) -> bool {
        hi >= cut
    }

    fn lies_low(x: f64, cut: f64) -> bool {
        x < cut
    }
}

/// An axis-aligned box: lower and upper corner, given numbers.
pub(crate) type Bounds = ([f64; 3], [f64; 3]);

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Node {
    Cut {
        axis: usize,
        at: f64,
        low: u32,
        high: u32,
    },
    Tile(u32),
}

/// A kd-tree of cells. Tiles are numbered from 0.
///
/// ```
/// use impinge_tiles::Cells;
/// let mut cells = Cells::whole();
/// let high = cells.cut(0, 0, 0.5);
/// assert_eq!((cells.n_tiles(), high), (2, 1));
/// assert_eq!(cells.owner([0.5, 9.0, -9.0]), 1);
/// assert_eq!(cells.touched([0.0; 3], [0.5; 3]), [0, 1]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    pub(crate) nodes: Vec<Node>,
    n_tiles: u32,
}

impl Cells {
    /// The whole space as tile 0.
    pub fn whole() -> Self {
        Cells {
            nodes: vec![Node::Tile(0)],
            n_tiles: 1,
        }
    }

    /// How many tiles there are.
    pub fn n_tiles(&self) -> u32 {
        self.n_tiles
    }

    /// Cuts a tile at a coordinate: its low side keeps its number, the high side gets the returned
    /// one.
    ///
    /// # Panics
    /// No such tile or axis, or a coordinate that is not finite.
    pub fn cut(&mut self, tile: u32, axis: usize, at: f64) -> u32 {
        assert!(axis < 3 && at.is_finite(), "cut along axis {axis} at {at}");
        let leaf = self.nodes.iter().position(|node| *node == Node::Tile(tile));
        let leaf = leaf.unwrap_or_else(|| panic!("no tile {tile} of {}", self.n_tiles));
        let fresh = self.n_tiles;
        let low = self.nodes.len() as u32;
        self.nodes.extend([Node::Tile(tile), Node::Tile(fresh)]);
        self.nodes[leaf] = Node::Cut {
            axis,
            at,
            low,
            high: low + 1,
        };
        self.n_tiles += 1;
        fresh
    }

    /// The tile that holds a point.
    pub fn owner(&self, point: [f64; 3]) -> u32 {
        self.owner_by::<HalfOpen>(point)
    }

    /// The tiles that a box touches.
    pub fn touched(&self, lo: [f64; 3], hi: [f64; 3]) -> Vec<u32> {
        let mut tiles = Vec::new();
        self.route::<HalfOpen>(&(lo, hi), 0.0, |tile| tiles.push(tile));
        tiles.sort_unstable();
        tiles
    }

    pub(crate) fn owner_by<R: Rule>(&self, point: [f64; 3]) -> u32 {
        let mut node = 0;
        loop {
            match self.nodes[node] {
                Node::Tile(tile) => return tile,
                Node::Cut {
                    axis,
                    at,
                    low,
                    high,
                } => {
                    node = if R::lies_low(point[axis], at) {
                        low
                    } else {
                        high
                    } as usize
                }
            }
        }
    }

    /// Calls `found` for each tile that may own a pair of this box and another one within the
    /// separation. With 0 these are the tiles that the box touches.
    pub(crate) fn route<R: Rule>(
        &self,
        bounds: &Bounds,
        separation: f64,
        mut found: impl FnMut(u32),
    ) {
        let reach = (bounds.0, bounds.1.map(|hi| R::reach(hi, separation)));
        self.descend::<R>(0, &reach, &mut found);
    }

    fn descend<R: Rule>(&self, node: u32, bounds: &Bounds, found: &mut impl FnMut(u32)) {
        match self.nodes[node as usize] {
            Node::Tile(tile) => found(tile),
            Node::Cut {
                axis,
                at,
                low,
                high,
            } => {
                if R::goes_low(bounds.0[axis], at) {
                    self.descend::<R>(low, bounds, found);
                }
                if R::goes_high(bounds.1[axis], at) {
                    self.descend::<R>(high, bounds, found);
                }
            }
        }
    }

    /// Nodes as JSON. A cut is also written as the 64 bits of its number, so that it is not
    /// rounded.
    pub(crate) fn to_json(&self) -> Value {
        let node = |node: &Node| match node {
            Node::Tile(tile) => json!({ "tile": tile }),
            Node::Cut {
                axis,
                at,
                low,
                high,
            } => {
                json!({ "axis": axis, "cut": at, "cut_bits": format!("{:016x}", at.to_bits()), "low": low, "high": high })
            }
        };
        Value::Array(self.nodes.iter().map(node).collect())
    }

    /// The cells written by [`to_json`](Self::to_json); `None` if the value is not a tree of tiles.
    pub(crate) fn from_json(value: &Value) -> Option<Self> {
        let node = |value: &Value| {
            let index = |key: &str| u32::try_from(value.get(key)?.as_u64()?).ok();
            if let Some(tile) = index("tile") {
                return Some(Node::Tile(tile));
            }
            let bits = u64::from_str_radix(value.get("cut_bits")?.as_str()?, 16).ok()?;
            Some(Node::Cut {
                axis: index("axis").filter(|&axis| axis < 3)? as usize,
                at: Some(f64::from_bits(bits)).filter(|at| at.is_finite())?,
                low: index("low")?,
                high: index("high")?,
            })
        };
        let nodes: Vec<Node> = value.as_array()?.iter().map(node).collect::<Option<_>>()?;
        let mut tiles = Vec::new();
        for (ix, node) in nodes.iter().enumerate() {
            match *node {
                Node::Tile(tile) => tiles.push(tile),
                // Children come after their parent, so there are no cycles.
                Node::Cut { low, high, .. } => {
                    let is_later =
                        |child: u32| child as usize > ix && (child as usize) < nodes.len();
                    (is_later(low) && is_later(high)).then_some(())?;
                }
            }
        }
        tiles.sort_unstable();
        let is_numbered = tiles.iter().zip(0..).all(|(&tile, ix)| tile == ix);
        (is_numbered && !tiles.is_empty()).then_some(Cells {
            n_tiles: tiles.len() as u32,
            nodes,
        })
    }
}

/// The point that decides to which tile a pair belongs: the larger of the two lower corners, axis
/// by axis.
pub(crate) fn owner_point(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis].max(b[axis]))
}
