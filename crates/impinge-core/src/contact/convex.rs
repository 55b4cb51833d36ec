//! How deep two convex bodies are in each other: the shortest way that takes them apart.
//!
//! The differences of a point of the first body and a point of the second form a convex body too,
//! which holds the origin if the two have a point in common (Minkowski). The shortest way out of it
//! is the shortest way apart. A polyhedron inside it grows towards the nearest face until that face
//! cannot move (van den Bergen, *Proximity queries and penetration depth computation on 3D game
//! objects*, 2001). Faces that do not have the origin beneath them count as nearer than all others,
//! so the polyhedron need not hold the origin at first.
//!
//! Differences are rounded, and so are normals and heights, in one fixed order. Which faces a new
//! vertex sees is decided exactly, so the polyhedron stays convex, whatever was rounded. The height
//! of the answer is that of the two bodies along its normal, so that way takes them apart. Cost:
//! `O(n)` per vertex that the polyhedron takes.

use super::double;
use crate::boxes::scale::Scale;
use crate::scene::vector::{cross, dot, scaled, sub};
use impinge_exact::internal::collinear;
use impinge_exact::{Point, Sign, orient3d};

/// The shortest way that takes two convex bodies apart.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ConvexOverlap {
    /// Its length, in the unit of the points; 0 if they do not overlap.
    pub depth: f64,
    /// Its direction, of length 1: the second body goes this way, or the first one the other way.
    pub normal: [f64; 3],
    /// The vertex of the first body that is farthest along the normal; of several the lowest.
    pub vertex: usize,
}

/// The convex hull of some differences.
struct Polyhedron {
    points: Vec<Point>,
    faces: Vec<Face>,
}

impl Polyhedron {
    /// The hull of a tetrahedron that turns outwards.
    fn new(corners: [Point; 4]) -> Self {
        let faces = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        Polyhedron {
            points: corners.to_vec(),
            faces: faces.map(|of| face(&corners, of)).to_vec(),
        }
    }

    /// Whether a point is beyond a face.
    fn is_seen(&self, face: &Face, point: &Point) -> bool {
        let [p, q, r] = face.corners.map(|ix| self.points[ix]);
        orient3d(&p, &q, &r, point) == Sign::Negative
    }

    /// Grows to a point: the faces that it sees give way to one for each side of their border.
    fn add(&mut self, point: Point) {
        let faces = std::mem::take(&mut self.faces).into_iter();
        let (seen, kept): (Vec<Face>, _) = faces.partition(|face| self.is_seen(face, &point));
        self.faces = kept;
        let sides = |face: &Face| {
            let [p, q, r] = face.corners;
            [[p, q], [q, r], [r, p]]
        };
        let inner: Vec<[usize; 2]> = seen.iter().flat_map(sides).collect();
        let new = self.points.len();
        self.points.push(point);
        for &[p, q] in &inner {
            // Else both faces of the side are seen.
            if !inner.contains(&[q, p]) {
                self.faces.push(face(&self.points, [p, q, new]));
            }
        }
    }
}

/// A face of the polyhedron, seen from outside counter-clockwise.
#[derive(Clone, Copy)]
struct Face {
    corners: [usize; 3],
    normal: Point,
    height: f64,
}

/// Polyhedra with more vertices are not grown further: the way found so far is at most a little too
/// long.
const MOST: usize = 400;
/// Differences of heights below this part of the size are rounding.
const ROUNDING: f64 = 1e-12;

/// The shortest way that takes the convex hulls of two sets of points apart; `None` if these are
/// flat in sum, so that their differences, as rounded, lie in one plane, or if one is empty.
///
/// Its length is right to about 1e-12 of the size of both: bodies that are a 10^12th as thin as
/// they are long are too thin for it.
pub fn convex_overlap(a: &[[f64; 3]], b: &[[f64; 3]]) -> Option<ConvexOverlap> {
    let origin = *b.first()?;
    let scale = Scale::of_points(a.iter().chain(b).map(|&point| sub(point, origin)));
    let read = |points: &[Point]| points.iter().map(|&point| scale.point(point)).collect();
    let [a, b]: [Vec<Point>; 2] = [read(a), read(b)];
    let support = |way: Point| -> Option<Point> {
        let (i, j) = (farthest(&a, way)?, farthest(&b, scaled(way, -1.0))?);
        Some(sub(a[i], b[j]))
    };
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut ends = [[0.0; 3]; 6];
    for (k, axis) in axes.into_iter().enumerate() {
        ends[2 * k] = support(axis)?;
        ends[2 * k + 1] = support(scaled(axis, -1.0))?;
    }
    let size = ends
        .as_flattened()
        .iter()
        .fold(0.0f64, |most, x| most.max(x.abs()));
    let noise = ROUNDING * size;
    let mut polyhedron = Polyhedron::new(first_corners(&a, &b, &ends)?);
    let mut best: Option<(f64, Point)> = None;
    // Faces that were found to be faces of the whole.
    let mut is_final: Vec<[usize; 3]> = Vec::new();
    loop {
        let open = polyhedron.faces.iter();
        let open = open.filter(|face| !is_final.contains(&face.corners));
        let Some(&nearest) = open.min_by(|x, y| x.height.total_cmp(&y.height)) else {
            break;
        };
        // Faces at the same height may have another normal; of these the lowest is taken.
        if best.is_some_and(|(height, _)| nearest.height > height + noise) {
            break;
        }
        let point = support(nearest.normal)?;
        let reached = dot(point, nearest.normal);
        // The normal of a narrow face may be so wrong that it does not see its own farthest point.
        let is_near = reached - nearest.height <= noise;
        if is_near || polyhedron.points.len() >= MOST || !polyhedron.is_seen(&nearest, &point) {
            let is_lower = |(height, normal): (f64, Point)| {
                reached < height - noise
                    || (reached <= height + noise && rounded(nearest.normal) < rounded(normal))
            };
            if best.is_none_or(is_lower) {
                best = Some((reached, nearest.normal));
            }
            is_final.push(nearest.corners);
            continue;
        }
        polyhedron.add(point);
    }
    let (height, normal) = best.filter(|&(_, normal)| normal != [0.0; 3])?;
    Some(ConvexOverlap {
        depth: scale.length_back(height).max(0.0),
        normal,
        vertex: farthest_of_tied(&a, normal, noise)?,
    })
}

/// The first of the points that are farthest along a way.
fn farthest(points: &[Point], way: Point) -> Option<usize> {
    let (mut best, mut most) = (None, f64::NEG_INFINITY);
    for (ix, &point) in points.iter().enumerate() {
        let height = dot(point, way);
        if height > most {
            (best, most) = (Some(ix), height);
        }
    }
    best
}

/// The lowest of the points that are farthest along a way, but for rounding.
fn farthest_of_tied(points: &[Point], way: Point, noise: f64) -> Option<usize> {
    let heights = || points.iter().map(|&point| dot(point, way));
    let most = heights().reduce(f64::max)?;
    heights().position(|height| height >= most - noise)
}

/// Without the noise that would decide which of two equal normals is lower.
fn rounded(normal: Point) -> [i64; 3] {
    normal.map(|x| (x * 1e9).round() as i64)
}

/// A tetrahedron of far differences that turns outwards; `None` if all lie in one plane.
///
/// Between all differences from one point of a body, and all from one of the other, lies what is
/// between any two differences. So if these are in one plane, then all are. They are looked at only
/// where the ends along the axes are in one plane.
fn first_corners(a: &[Point], b: &[Point], ends: &[Point; 6]) -> Option<[Point; 4]> {
    let (first_a, first_b) = (*a.first()?, *b.first()?);
    corners_among(|| ends.iter().copied()).or_else(|| {
        corners_among(|| {
            let of_a = a.iter().map(|&point| sub(point, first_b));
            let of_b = b.iter().map(|&point| sub(first_a, point));
            ends.iter().copied().chain(of_a).chain(of_b)
        })
    })
}

/// A tetrahedron of far points that turns outwards; `None` if all lie in one plane. Which are
/// farthest is rounded; that they are off the line and off the plane is decided exactly.
fn corners_among<I: Iterator<Item = Point>>(points: impl Fn() -> I) -> Option<[Point; 4]> {
    let farthest = |far: &dyn Fn(Point) -> f64, is_off: &dyn Fn(&Point) -> bool| {
        let all = points().filter(is_off).map(|point| (far(point), point));
        all.reduce(|most, next| if next.0 > most.0 { next } else { most })
            .map(|(_, point)| point)
    };
    let squared = |p: Point| dot(p, p);
    let p = points().next()?;
    let q = farthest(&|x| squared(sub(x, p)), &|&x| x != p)?;
    let along = sub(q, p);
    let away = |x| squared(cross(along, sub(x, p)));
    let r = farthest(&away, &|x| !collinear(&p, &q, x))?;
    let normal = cross(along, sub(r, p));
    let above = |x| dot(normal, sub(x, p)).abs();
    let s = farthest(&above, &|x| !orient3d(&p, &q, &r, x).is_zero())?;
    match orient3d(&p, &q, &r, &s) {
        Sign::Negative => Some([p, r, q, s]),
        _ => Some([p, q, r, s]),
    }
}

/// A face without a normal, being too narrow, is at no height, but there: the polyhedron is closed.
fn face(points: &[Point], corners: [usize; 3]) -> Face {
    let [p, q, r] = corners.map(|ix| points[ix]);
    let normal = product(sub(q, p), sub(r, p));
    // Squares of a short one would underflow.
    let normal = Scale::of_points([normal]).point(normal);
    let length = dot(normal, normal).sqrt();
    if length.is_nan() || length <= 0.0 {
        return Face {
            corners,
            normal: [0.0; 3],
            height: f64::INFINITY,
        };
    }
    let normal = scaled(normal, 1.0 / length);
    Face {
        corners,
        normal,
        height: dot(normal, p),
    }
}

/// The product of two vectors, which may be nearly parallel: in twice the precision, rounded in the
/// end. Of long narrow faces one rounding of each product would turn the normal.
fn product(u: Point, v: Point) -> Point {
    [(1, 2), (2, 0), (0, 1)]
        .map(|(i, j)| (double::product(u[i], v[j]) - double::product(u[j], v[i])).high)
}
