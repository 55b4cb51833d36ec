//! Elements of structured grids.

use impinge_exact::ElementPair;

use crate::generators::Random;
use crate::moving::Point;

/// Structured grids, as cloth is laid out: one over another, aligned or shifted by half a step.
/// Features tie, edges are parallel, and faces coplanar.
#[derive(Clone, Copy, Debug)]
pub enum Grid {
    /// A step of 1/64.
    Dyadic,
    /// 0.1 k as `f32`, and as `f64`: steps that differ in the last bits.
    Tenths32,
    Tenths64,
    /// The same, 1,000 units away.
    Far32,
    Far64,
    /// Rings of a tube, `f32`.
    Tube32,
}

impl Grid {
    pub const ALL: [Self; 6] = [
        Self::Dyadic,
        Self::Tenths32,
        Self::Tenths64,
        Self::Far32,
        Self::Far64,
        Self::Tube32,
    ];

    /// A vertex of a layer, in half steps. The gap between layers is a quarter of a step.
    pub fn vertex(self, [i, j]: [u64; 2], layer: u64) -> Point {
        let single = |p: Point| p.map(|x| f64::from(x as f32));
        let (x, y, z) = (i as f64 / 2.0, j as f64 / 2.0, layer as f64 / 4.0);
        match self {
            Self::Dyadic => [x, y, z].map(|x| x / 64.0),
            Self::Tenths32 => single([0.1 * x, 0.1 * y, 0.1 * z]),
            Self::Tenths64 => [0.1 * x, 0.1 * y, 0.1 * z],
            Self::Far32 => single([0.1 * x + 1e3, 0.1 * y - 1e3, 0.1 * z]),
            Self::Far64 => [0.1 * x + 1e3, 0.1 * y - 1e3, 0.1 * z],
            Self::Tube32 => {
                let angle = x * std::f64::consts::TAU / 16.0;
                let radius = 1.0 + 0.1 * z;
                single([radius * angle.cos(), radius * angle.sin(), 0.1 * y])
            }
        }
    }

    /// A vertex, an edge or a face of one layer and one of the other; a third have equal corners.
    pub fn points(self, pair: ElementPair, random: &mut Random) -> [Point; 4] {
        let layers = [random.below(3), random.below(3)];
        let shift = random.below(2);
        let first = random.below(100);
        let mut corner = |which: usize| {
            let mut at = || 2 * random.below(4) + first + if which == 1 { shift } else { 0 };
            [at(), at()]
        };
        let (a, b) = (corner(0), corner(1));
        let ways = [[2, 0], [0, 2], [2, 2], [0, 0]];
        let mut way = || {
            ways[if random.below(6) == 0 {
                3
            } else {
                random.below(3) as usize
            }]
        };
        let on = |[i, j]: [u64; 2], [k, l]: [u64; 2], layer| self.vertex([i + k, j + l], layer);
        let [p, q] = [way(), way()];
        match pair {
            ElementPair::EdgeEdge => [
                on(a, [0, 0], layers[0]),
                on(a, p, layers[0]),
                on(b, [0, 0], layers[1]),
                on(b, q, layers[1]),
            ],
            _ => [
                on(a, [0, 0], layers[0]),
                on(b, [0, 0], layers[1]),
                on(b, p, layers[1]),
                on(b, q, layers[1]),
            ],
        }
    }
}
