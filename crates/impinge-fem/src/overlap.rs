//! The intersection of two tetrahedra: a convex polyhedron, cut out piece by piece.

use crate::element::Vec3;

/// The faces' corners, and the corner on the other side.
const FACES: [([usize; 3], usize); 4] = [
    ([1, 2, 3], 0),
    ([0, 2, 3], 1),
    ([0, 1, 3], 2),
    ([0, 1, 2], 3),
];

/// Cuts a tetrahedron by the faces of another one. Each cut leaves a piece as it is, drops it or splits
/// it into at most three tetrahedra, so there are never more than 81 pieces, and mostly about ten.
#[derive(Debug, Default)]
pub(crate) struct Clipper {
    pieces: Vec<[Vec3; 4]>,
    cut: Vec<[Vec3; 4]>,
}

impl Clipper {
    /// Cuts `a` by `b`, of any orientation. The remaining pieces fill the intersection.
    pub fn clip(&mut self, a: &[Vec3; 4], b: &[Vec3; 4]) {
        self.pieces.clear();
        self.pieces.push(*a);
        for (face, apex) in FACES {
            let [p, q, r] = face.map(|k| b[k]);
            let normal = (q - p).cross(&(r - p));
            let inside = normal.dot(&(b[apex] - p));
            if inside == 0.0 {
                self.pieces.clear();
                return;
            }
            let normal = normal * inside.signum();
            self.cut.clear();
            for piece in &self.pieces {
                cut(piece, piece.map(|x| normal.dot(&(x - p))), &mut self.cut);
            }
            std::mem::swap(&mut self.pieces, &mut self.cut);
            if self.pieces.is_empty() {
                return;
            }
        }
    }

    /// Volume and centroid of the intersection; `None` if it has no volume.
    pub fn volume(&self) -> Option<(f64, Vec3)> {
        let (volume, moment) =
            self.pieces
                .iter()
                .fold((0.0, Vec3::zeros()), |(volume, moment), piece| {
                    let [a, b, c, d] = piece;
                    let of = (b - a).cross(&(c - a)).dot(&(d - a)).abs() / 6.0;
                    (volume + of, moment + (a + b + c + d) * (of / 4.0))
                });
        (volume > 0.0).then(|| (volume, moment / volume))
    }

    /// The extent of the intersection along a unit vector.
    pub fn extent(&self, along: &Vec3) -> f64 {
        let heights = self.pieces.iter().flatten().map(|x| along.dot(x));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (low.min(h), high.max(h))
        });
        high - low
    }
}

/// Adds to `out` the part of a piece with height 0 or more, given the heights of its corners over a plane.
fn cut(piece: &[Vec3; 4], heights: [f64; 4], out: &mut Vec<[Vec3; 4]>) {
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
        corner(above) + (corner(below) - corner(above)) * (high / (high - low))
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
fn prism(low: [Vec3; 3], high: [Vec3; 3], out: &mut Vec<[Vec3; 4]>) {
    out.push([low[0], low[1], low[2], high[0]]);
    out.push([low[1], low[2], high[0], high[1]]);
    out.push([low[2], high[0], high[1], high[2]]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_scenes::Random;

    const CORNER: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn overlap(a: &[Vec3; 4], b: &[Vec3; 4]) -> Option<(f64, Vec3)> {
        let mut clipper = Clipper::default();
        clipper.clip(a, b);
        clipper.volume()
    }

    #[test]
    fn known_overlaps() {
        let a = CORNER.map(Vec3::from);
        let (volume, centroid) = overlap(&a, &a).unwrap();
        assert!((volume - 1.0 / 6.0).abs() < 1e-15);
        assert!((centroid - Vec3::repeat(0.25)).norm() < 1e-15);
        // Moved along the diagonal, the common part is the same shape, smaller.
        let b = a.map(|x| x + Vec3::repeat(0.2));
        let (volume, centroid) = overlap(&a, &b).unwrap();
        assert!((volume - 0.4f64.powi(3) / 6.0).abs() < 1e-15);
        assert!((centroid - Vec3::repeat(0.3)).norm() < 1e-14);
        let mut clipper = Clipper::default();
        clipper.clip(&a, &b);
        assert!((clipper.extent(&Vec3::x()) - 0.4).abs() < 1e-15);
        // Touching in a face, apart, flat: nothing.
        assert_eq!(overlap(&a, &a.map(|x| x - Vec3::x())), None);
        assert_eq!(overlap(&a, &a.map(|x| x + Vec3::repeat(5.0))), None);
        assert_eq!(overlap(&a, &a.map(|x| Vec3::new(x.x, x.y, 0.1))), None);
        assert_eq!(overlap(&a.map(|x| Vec3::new(x.x, x.y, 0.1)), &a), None);
    }

    #[test]
    fn the_overlap_is_that_of_random_points() {
        let mut random = Random::new(3);
        let point = |random: &mut Random| Vec3::from(random.point(0.0, 1.0).map(f64::from));
        let inside = |tet: &[Vec3; 4], x: &Vec3| {
            FACES.iter().all(|&(face, apex)| {
                let [p, q, r] = face.map(|k| tet[k]);
                let normal = (q - p).cross(&(r - p));
                normal.dot(&(tet[apex] - p)) * normal.dot(&(x - p)) >= 0.0
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
