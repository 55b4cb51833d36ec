//! The distance of two elements that do not meet, in `f64`.
//!
//! It is the least distance of a corner of one to a face of the other, and of an edge of one to an
//! edge of the other (Ericson, *Real-Time Collision Detection*, 2005, 5.1.5 and 5.1.9). Each case
//! finds one point on each element, and the distance is that of the two points. So it is never
//! less than the true distance by more than the rounding of these points, however inaccurate the
//! parameters that led to them. One fixed order of operations, no fused multiply-add: the same bits
//! everywhere.

use crate::scene::vector::{dot, sub};
use impinge_exact::Point;

/// `p + t d`
fn along(p: Point, t: f64, d: Point) -> Point {
    [p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]]
}

/// Two points, one on each element, and the square of their distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gap {
    pub squared: f64,
    pub points: [Point; 2],
    /// A number that is certainly not above the distance of the elements; 0 until that is asked
    /// for ([`Gap::at_least`]).
    pub low: f64,
}

impl Gap {
    fn of(p: Point, q: Point) -> Self {
        let d = sub(q, p);
        Gap {
            squared: dot(d, d),
            points: [p, q],
            low: 0.0,
        }
    }

    fn swapped(self) -> Self {
        let [p, q] = self.points;
        Gap {
            points: [q, p],
            ..self
        }
    }

    /// A number that is certainly not above the distance of two elements: how far apart they are
    /// along the way between these points, less what rounding may do (`docs/exactness.md`, "The
    /// smallest distance of two bodies").
    pub fn at_least(&self, a: &[Point], b: &[Point]) -> f64 {
        let [from, to] = self.points;
        let way = sub(to, from);
        let length = dot(way, way);
        if !(SMALLEST..=LARGEST).contains(&length) {
            return 0.0;
        }
        let mut size = 0.0_f64;
        let mut height = |corner: &Point| {
            let d = sub(*corner, from);
            size = size.max(d[0].abs() + d[1].abs() + d[2].abs());
            dot(way, d)
        };
        let low = a.iter().map(&mut height).fold(f64::NEG_INFINITY, f64::max);
        let high = b.iter().map(&mut height).fold(f64::INFINITY, f64::min);
        let largest = way.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let error = 128.0 * f64::EPSILON * largest * size;
        let apart = (high - low - error) / length.sqrt() * (1.0 - 8.0 * f64::EPSILON);
        apart.max(0.0)
    }

    /// The smaller of two; the first if they are equal.
    fn lesser(self, other: Self) -> Self {
        if other.squared < self.squared {
            other
        } else {
            self
        }
    }
}

/// Squares of lengths between which [`Gap::at_least`] says something: far from the ends of the
/// floats.
const SMALLEST: f64 = 1e-250;
const LARGEST: f64 = 1e250;

/// Clamped to 0 to 1; 0 for NaN.
fn part(x: f64) -> f64 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

/// The nearest point of segment ab.
fn on_segment(p: Point, a: Point, b: Point) -> Point {
    let d = sub(b, a);
    along(a, part(dot(sub(p, a), d) / dot(d, d)), d)
}

/// The nearest points of a point and a triangle.
///
/// The edges are always examined too. So a point of the triangle is found even if rounding
/// misplaces the foot of the perpendicular.
fn point_triangle(p: Point, [a, b, c]: [Point; 3]) -> Gap {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (uu, uv, vv) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
    let (up, vp) = (dot(ab, ap), dot(ac, ap));
    let det = uu * vv - uv * uv;
    let (s, t) = ((vv * up - uv * vp) / det, (uu * vp - uv * up) / det);
    if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
        let foot = [0, 1, 2].map(|k| a[k] + s * ab[k] + t * ac[k]);
        return Gap::of(p, foot);
    }
    [[a, b], [b, c], [c, a]]
        .into_iter()
        .map(|[q, r]| Gap::of(p, on_segment(p, q, r)))
        .reduce(Gap::lesser)
        .unwrap_or(Gap::of(p, a))
}

/// The nearest points of two segments.
fn segments([p, q]: [Point; 2], [r, s]: [Point; 2]) -> Gap {
    let (d, e, w) = (sub(q, p), sub(s, r), sub(p, r));
    let (a, b, c) = (dot(d, d), dot(d, e), dot(e, e));
    let (f, g) = (dot(d, w), dot(e, w));
    let det = a * c - b * b;
    let mut first = if det > 0.0 {
        part((b * g - c * f) / det)
    } else {
        0.0
    };
    let second = part((b * first + g) / c);
    // The second point may have been clamped to an end: find the first one for it.
    first = part((b * second - f) / a);
    Gap::of(along(p, first, d), along(r, second, e))
}

/// The features of a triangle or a tetrahedron, as corner numbers.
struct Features {
    n_corners: usize,
    edges: &'static [[usize; 2]],
    faces: &'static [[usize; 3]],
}

fn features(n_corners: usize) -> Features {
    match n_corners {
        3 => Features {
            n_corners,
            edges: &[[0, 1], [1, 2], [2, 0]],
            faces: &[[0, 1, 2]],
        },
        _ => Features {
            n_corners,
            edges: &[[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]],
            faces: &[[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]],
        },
    }
}

/// The nearest points of two elements of three or four corners each that do not meet.
pub(super) fn gap(a: &[Point], b: &[Point]) -> Gap {
    let (of_a, of_b) = (features(a.len()), features(b.len()));
    let mut least = Gap {
        squared: f64::INFINITY,
        points: [a[0], b[0]],
        low: 0.0,
    };
    for face in of_b.faces {
        let face = face.map(|k| b[k]);
        for &corner in &a[..of_a.n_corners] {
            least = least.lesser(point_triangle(corner, face));
        }
    }
    for face in of_a.faces {
        let face = face.map(|k| a[k]);
        for &corner in &b[..of_b.n_corners] {
            least = least.lesser(point_triangle(corner, face).swapped());
        }
    }
    for edge in of_a.edges {
        for other in of_b.edges {
            least = least.lesser(segments(edge.map(|k| a[k]), other.map(|k| b[k])));
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_testing::random::Random;

    /// The least distance of two triangles by numerical minimisation: never less than the true
    /// distance.
    fn sampled(a: [Point; 3], b: [Point; 3]) -> f64 {
        let blend = |t: &[Point; 3], u: f64, v: f64| {
            [0, 1, 2].map(|k| t[0][k] + u * (t[1][k] - t[0][k]) + v * (t[2][k] - t[0][k]))
        };
        let nearest = |p: Point, t: &[Point; 3]| {
            // Grid search over barycentric coordinates, coarse to fine.
            let (mut best, mut at) = (f64::INFINITY, (0.0, 0.0));
            let mut step = 0.25;
            for _ in 0..14 {
                let centre = at;
                for i in -4..=4 {
                    for j in -4..=4 {
                        let u = (centre.0 + f64::from(i) * step).clamp(0.0, 1.0);
                        let v = (centre.1 + f64::from(j) * step).clamp(0.0, 1.0 - u);
                        let d = sub(blend(t, u, v), p);
                        if dot(d, d) < best {
                            (best, at) = (dot(d, d), (u, v));
                        }
                    }
                }
                step *= 0.5;
            }
            (best, blend(t, at.0, at.1))
        };
        // Alternating projections between two convex sets approach the least distance.
        let mut q = b[0];
        let mut best = f64::INFINITY;
        for _ in 0..200 {
            let (_, p) = nearest(q, &a);
            let (d, next) = nearest(p, &b);
            q = next;
            best = best.min(d);
        }
        best.sqrt()
    }

    #[test]
    fn distances_are_those_of_alternating_projections() {
        let mut random = Random::new(3);
        for _ in 0..60 {
            let mut triangle = |offset: f64| {
                [0; 3].map(|_| {
                    let [x, y, z] = random.point(-1.0, 1.0).map(f64::from);
                    [x + offset, y, z]
                })
            };
            let (a, b) = (triangle(0.0), triangle(2.2));
            let found = gap(&a, &b);
            let expected = sampled(a, b);
            assert!(found.squared.sqrt() <= expected + 1e-9);
            assert!(
                found.squared.sqrt() > expected - 2e-3,
                "{found:?} {expected}"
            );
            // The order of the two does not matter.
            let swapped = gap(&b, &a);
            assert!((swapped.squared - found.squared).abs() <= 1e-13 * found.squared);
        }
    }

    #[test]
    fn degenerate_triangles_are_segments_and_points() {
        let point = [[1.0, 2.0, 3.0]; 3];
        let segment = [[4.0, 0.0, 3.0], [4.0, 9.0, 3.0], [4.0, 5.0, 3.0]];
        assert_eq!(gap(&point, &segment).squared, 9.0);
        assert_eq!(gap(&point, &[[1.0, 2.0, 5.0]; 3]).squared, 4.0);
        let parallel = segment.map(|[x, y, z]| [x + 3.0, y + 4.0, z + 4.0]);
        assert_eq!(gap(&segment, &parallel).squared, 25.0);
        let tetrahedron = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let found = gap(&tetrahedron, &point.map(|_| [0.25, 0.25, -2.0]));
        assert_eq!(
            (found.squared, found.points),
            (4.0, [[0.25, 0.25, 0.0], [0.25, 0.25, -2.0]])
        );
    }
}
