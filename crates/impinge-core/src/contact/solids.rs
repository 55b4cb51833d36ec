//! The common part of two tetrahedra: a convex polyhedron, cut out piece by piece.
//!
//! Cost: about a microsecond per pair; no memory is allocated after the first pairs. Coordinates
//! are rounded in `f64`, in one fixed order.

use crate::scene::vector::{add, cross, dot, scaled, sub};
use impinge_exact::Point;

/// The faces' corners, and the corner on the other side.
const FACES: [([usize; 3], usize); 4] = [
    ([1, 2, 3], 0),
    ([0, 2, 3], 1),
    ([0, 1, 3], 2),
    ([0, 1, 2], 3),
];

/// Cuts one tetrahedron by another; reuses its memory. For penalty forces between solids.
///
/// Each cut by a face leaves a piece as it is, drops it or splits it into at most three tetrahedra,
/// so there are never more than 81 pieces, and mostly about ten.
///
/// ```
/// use impinge::contact::SolidOverlap;
/// let a = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let b = a.map(|point| point.map(|x| x + 0.2));
/// let mut overlap = SolidOverlap::new();
/// overlap.cut(&a, &b);
/// let (volume, centroid) = overlap.volume().expect("they overlap");
/// assert!((volume - 0.4f64.powi(3) / 6.0).abs() < 1e-15 && (centroid[0] - 0.3).abs() < 1e-14);
/// assert!((overlap.extent(&[1.0, 0.0, 0.0]) - 0.4).abs() < 1e-15);
/// ```
#[derive(Debug, Default)]
pub struct SolidOverlap {
    pieces: Vec<[Point; 4]>,
    cut: Vec<[Point; 4]>,
}

impl SolidOverlap {
    /// Holds nothing yet.
    pub fn new() -> Self {
        SolidOverlap::default()
    }

    /// Cuts `a` by `b`, of any orientation, four corners each. The remaining pieces fill the common
    /// part.
    pub fn cut(&mut self, a: &[Point; 4], b: &[Point; 4]) {
        self.pieces.clear();
        self.pieces.push(*a);
        for (face, apex) in FACES {
            let [p, q, r] = face.map(|k| b[k]);
            let normal = cross(sub(q, p), sub(r, p));
            let inside = dot(normal, sub(b[apex], p));
            if inside == 0.0 {
                self.pieces.clear();
                return;
            }
            let normal = scaled(normal, inside.signum());
            self.cut.clear();
            for piece in &self.pieces {
                let heights = piece.map(|x| dot(normal, sub(x, p)));
                cut(piece, heights, &mut self.cut);
            }
            std::mem::swap(&mut self.pieces, &mut self.cut);
            if self.pieces.is_empty() {
                return;
            }
        }
    }

    /// Volume and centroid of the common part; `None` if it has no volume.
    pub fn volume(&self) -> Option<(f64, Point)> {
        let (mut volume, mut moment) = (0.0, [0.0; 3]);
        for &[a, b, c, d] in &self.pieces {
            let of = dot(cross(sub(b, a), sub(c, a)), sub(d, a)).abs() / 6.0;
            volume += of;
            moment = add(moment, scaled(add(add(add(a, b), c), d), of / 4.0));
        }
        (volume > 0.0).then(|| (volume, moment.map(|x| x / volume)))
    }

    /// The extent of the common part along a unit vector; minus infinity if there is none.
    pub fn extent(&self, along: &[f64; 3]) -> f64 {
        let heights = self.pieces.iter().flatten().map(|&x| dot(*along, x));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (low.min(h), high.max(h))
        });
        high - low
    }
}

/// Adds to `out` the part of a piece with height 0 or more, given the heights of its corners over a
/// plane.
fn cut(piece: &[Point; 4], heights: [f64; 4], out: &mut Vec<[Point; 4]>) {
    // Corners above first.
    let mut order = [0, 1, 2, 3];
    let mut n_above = 0;
    for (k, height) in heights.iter().enumerate() {
        if *height >= 0.0 {
            order.swap(n_above, k);
            n_above += 1;
        }
    }
    let corner = |k: usize| piece[order[k]];
    let crossing = |above: usize, below: usize| {
        let (high, low) = (heights[order[above]], heights[order[below]]);
        let way = sub(corner(below), corner(above));
        add(corner(above), scaled(way, high / (high - low)))
    };
    match n_above {
        0 => {}
        4 => out.push(*piece),
        1 => out.push([corner(0), crossing(0, 1), crossing(0, 2), crossing(0, 3)]),
        2 => prism(
            [corner(0), crossing(0, 2), crossing(0, 3)],
            [corner(1), crossing(1, 2), crossing(1, 3)],
            out,
        ),
        _ => prism(
            [corner(0), corner(1), corner(2)],
            [crossing(0, 3), crossing(1, 3), crossing(2, 3)],
            out,
        ),
    }
}

/// Three tetrahedra that fill the prism between two triangles.
fn prism(low: [Point; 3], high: [Point; 3], out: &mut Vec<[Point; 4]>) {
    out.push([low[0], low[1], low[2], high[0]]);
    out.push([low[1], low[2], high[0], high[1]]);
    out.push([low[2], high[0], high[1], high[2]]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_testing::random::Random;

    const CORNER: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn overlap(a: &[Point; 4], b: &[Point; 4]) -> Option<(f64, Point)> {
        let mut overlap = SolidOverlap::new();
        overlap.cut(a, b);
        overlap.volume()
    }

    #[test]
    fn known_overlaps() {
        let a = CORNER;
        let moved = |by: Point| a.map(|x| add(x, by));
        let flat = a.map(|[x, y, _]| [x, y, 0.1]);
        let (volume, centroid) = overlap(&a, &a).unwrap();
        assert!((volume - 1.0 / 6.0).abs() < 1e-15);
        assert!(centroid.iter().all(|x| (x - 0.25).abs() < 1e-15));
        // Moved along the diagonal, the common part is the same shape, smaller.
        let b = moved([0.2; 3]);
        let (volume, centroid) = overlap(&a, &b).unwrap();
        assert!((volume - 0.4f64.powi(3) / 6.0).abs() < 1e-15);
        assert!(centroid.iter().all(|x| (x - 0.3).abs() < 1e-14));
        let mut both = SolidOverlap::new();
        both.cut(&a, &b);
        assert!((both.extent(&[1.0, 0.0, 0.0]) - 0.4).abs() < 1e-15);
        // Touching in a face, apart, flat: nothing.
        assert_eq!(overlap(&a, &moved([-1.0, 0.0, 0.0])), None);
        assert_eq!(overlap(&a, &moved([5.0; 3])), None);
        assert_eq!(overlap(&a, &flat), None);
        assert_eq!(overlap(&flat, &a), None);
    }

    #[test]
    fn the_overlap_is_that_of_random_points() {
        let mut random = Random::new(3);
        let point = |random: &mut Random| random.point(0.0, 1.0).map(f64::from);
        let inside = |tet: &[Point; 4], x: &Point| {
            FACES.iter().all(|&(face, apex)| {
                let [p, q, r] = face.map(|k| tet[k]);
                let normal = cross(sub(q, p), sub(r, p));
                dot(normal, sub(tet[apex], p)) * dot(normal, sub(*x, p)) >= 0.0
            })
        };
        let mut n_overlaps = 0;
        for _ in 0..40 {
            let [a, b] = [0; 2].map(|_| [0; 4].map(|_| point(&mut random)));
            let n_samples = 20_000;
            let hits = (0..n_samples)
                .map(|_| point(&mut random))
                .filter(|x| inside(&a, x) && inside(&b, x))
                .count();
            let share = hits as f64 / f64::from(n_samples);
            let volume = overlap(&a, &b).map_or(0.0, |(volume, _)| volume);
            let other = overlap(&b, &a).map_or(0.0, |(volume, _)| volume);
            // Five standard deviations of the sampling, and one sample.
            let tolerance =
                5.0 * (volume / f64::from(n_samples)).sqrt() + 1.0 / f64::from(n_samples);
            assert!((share - volume).abs() < tolerance, "{share} {volume}");
            assert!((volume - other).abs() < 1e-12);
            n_overlaps += u32::from(volume > 1e-4);
        }
        assert!(n_overlaps > 10, "{n_overlaps}");
    }
}
