//! Polygons as triangles.

mod inner;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use inner::{InnerCorners, turn};

/// Polygons with more corners than this are cut by [`clip_many_ears`], and smaller ones as they
/// always were.
const FEW: usize = 256;

/// Replaces the fan of a polygon around its first corner by other triangles of the same corners, as
/// many, as seen along the polygon's normal (Newell's). Ears are clipped one after the other
/// (Meisters 1975). A polygon that runs out of ears, because it crosses itself, stays a fan.
///
/// A small polygon is cut only if a triangle of the fan is turned over. That happens only where the
/// polygon is concave, and the fan then overlaps itself. A large one is always cut: the triangles
/// of its fan would be long and all meet at one corner, so their boxes overlap.
pub(crate) fn mend(fan: &mut [[u32; 3]], position: impl Fn(u32) -> [f64; 3]) {
    if fan.len() < 2 {
        return;
    }
    let rest = fan.iter().map(|triangle| triangle[2]);
    let corners: Vec<u32> = fan[0][..2].iter().copied().chain(rest).collect();
    let points = flatten(&corners, position);
    let mut triangles = Vec::with_capacity(fan.len());
    let is_cut = if corners.len() > FEW {
        clip_many_ears(&points, &mut triangles).is_some()
    } else {
        let is_turned = |edge: &[[f64; 2]]| turn(points[0], edge[0], edge[1]) < 0.0;
        points[1..].windows(2).any(is_turned) && clip_ears(&points, &mut triangles)
    };
    if is_cut {
        for (to, triangle) in fan.iter_mut().zip(triangles) {
            *to = triangle.map(|corner| corners[corner]);
        }
    }
}

/// The corners as seen along the polygon's normal: anticlockwise, without the coordinate that the
/// normal has most of.
fn flatten(corners: &[u32], position: impl Fn(u32) -> [f64; 3]) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 3]> = corners.iter().map(|&corner| position(corner)).collect();
    let next = points.iter().cycle().skip(1);
    let mut normal = [0.0_f64; 3];
    for (p, q) in points.iter().zip(next) {
        for (axis, sum) in normal.iter_mut().enumerate() {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            *sum += (p[u] - q[u]) * (p[v] + q[v]);
        }
    }
    let most = (0..3).fold(0, |best, axis| {
        if normal[axis].abs() > normal[best].abs() {
            axis
        } else {
            best
        }
    });
    let (u, v) = match normal[most] < 0.0 {
        true => ((most + 2) % 3, (most + 1) % 3),
        false => ((most + 1) % 3, (most + 2) % 3),
    };
    points.iter().map(|p| [p[u], p[v]]).collect()
}

/// Clips the first ear again and again: as many looks as the square of the number of corners.
/// Returns false if some corner is left without an ear.
fn clip_ears(points: &[[f64; 2]], triangles: &mut Vec<[usize; 3]>) -> bool {
    let mut left: Vec<usize> = (0..points.len()).collect();
    while left.len() > 3 {
        let n = left.len();
        let ear = |ix: usize| [left[(ix + n - 1) % n], left[ix], left[(ix + 1) % n]];
        let is_ear = |&ix: &usize| {
            let [a, b, c] = ear(ix).map(|corner| points[corner]);
            let is_inside =
                |p: [f64; 2]| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            let mut others = left.iter().filter(|&&other| !ear(ix).contains(&other));
            turn(a, b, c) > 0.0 && !others.any(|&other| is_inside(points[other]))
        };
        let Some(ix) = (0..n).find(is_ear) else {
            return false;
        };
        triangles.push(ear(ix));
        left.remove(ix);
    }
    triangles.push([left[0], left[1], left[2]]);
    turn(points[left[0]], points[left[1]], points[left[2]]) > 0.0
}

/// The same for many corners. The ear whose cut is shortest goes first, so triangles stay small:
/// cuts along a run of corners halve it again and again, and cuts between two sides go from one to
/// the other. A corner whose ear is not free waits for the corner that lies in it. Returns how many
/// nodes and corners it looked at; `None` if some corner is left without an ear, or after far more
/// looks than a polygon needs that does not cross itself.
fn clip_many_ears(points: &[[f64; 2]], triangles: &mut Vec<[usize; 3]>) -> Option<u64> {
    let n = points.len();
    let mut ring = Ring::new(points);
    let inner = (0..n).filter(|&corner| !ring.is_convex(corner));
    let mut inner = InnerCorners::new(points, inner.map(|corner| corner as u32).collect());
    let mut waiting: Vec<Vec<usize>> = vec![Vec::new(); n];
    let mut queue: BinaryHeap<_> = (0..n).map(|corner| ring.cut(corner)).collect();
    let most = LOOKS * n as u64 * u64::from(n.ilog2() + 1);
    let mut n_left = n;
    let mut last = 0;
    while n_left > 3 {
        inner.n_looks += 1;
        if inner.n_looks > most {
            return None;
        }
        let Reverse((_, ear)) = queue.pop()?;
        let [from, clipped, to] = ear;
        let is_old = !ring.is_left(clipped) || ear != ring.around(clipped);
        if is_old || !ring.is_convex(clipped) {
            continue;
        }
        if let Some(blocking) = inner.find_in(points, ear) {
            waiting[blocking].push(clipped);
            continue;
        }
        triangles.push(ear);
        ring.remove(clipped);
        n_left -= 1;
        for corner in [clipped, from, to] {
            let is_left = corner == from || corner == to;
            if is_left {
                queue.push(ring.cut(corner));
            }
            if !is_left || ring.is_convex(corner) {
                inner.remove(corner);
                for other in std::mem::take(&mut waiting[corner]) {
                    if ring.is_left(other) {
                        queue.push(ring.cut(other));
                    }
                }
            }
        }
        last = from;
    }
    let last = ring.around(last);
    triangles.push(last);
    (turn_of(points, last) > 0.0).then_some(inner.n_looks)
}

fn turn_of(points: &[[f64; 2]], [a, b, c]: [usize; 3]) -> f64 {
    turn(points[a], points[b], points[c])
}

/// The corners that are left, in a circle.
struct Ring<'a> {
    points: &'a [[f64; 2]],
    next: Vec<usize>,
    before: Vec<usize>,
}

impl<'a> Ring<'a> {
    fn new(points: &'a [[f64; 2]]) -> Self {
        let n = points.len();
        Ring {
            points,
            next: (1..n).chain([0]).collect(),
            before: [n - 1].into_iter().chain(0..n - 1).collect(),
        }
    }

    /// A corner between its neighbours.
    fn around(&self, corner: usize) -> [usize; 3] {
        [self.before[corner], corner, self.next[corner]]
    }

    /// Whether the polygon bends outward at a corner. False where that can't be said.
    fn is_convex(&self, corner: usize) -> bool {
        turn_of(self.points, self.around(corner)) > 0.0
    }

    /// The ear of a corner, by the length of the cut that clips it. The heap has the shortest
    /// first, then the lowest corner.
    fn cut(&self, corner: usize) -> Reverse<(u64, [usize; 3])> {
        let ear = self.around(corner);
        let [from, to] = [ear[0], ear[2]].map(|corner| self.points[corner]);
        let length = (from[0] - to[0]).hypot(from[1] - to[1]);
        // Floats of at least 0 are in the order of their bits.
        Reverse((length.abs().to_bits(), ear))
    }

    fn is_left(&self, corner: usize) -> bool {
        self.next[self.before[corner]] == corner
    }

    fn remove(&mut self, corner: usize) {
        let [before, _, next] = self.around(corner);
        (self.next[before], self.before[next]) = (next, before);
    }
}

/// So many looks per corner, and per halving of their number, are allowed.
const LOOKS: u64 = 64;

#[cfg(test)]
mod tests {
    use super::*;

    /// The triangles of a polygon in the plane z = x + 2 y.
    fn cut(polygon: &[[f64; 2]]) -> Vec<[u32; 3]> {
        let corners: Vec<u32> = (0..polygon.len() as u32).collect();
        let position = |corner: u32| {
            let [x, y] = polygon[corner as usize];
            [x, y, x + 2.0 * y]
        };
        let rest = corners[1..].windows(2);
        let mut triangles: Vec<[u32; 3]> = rest.map(|edge| [0, edge[0], edge[1]]).collect();
        mend(&mut triangles, position);
        triangles
    }

    fn areas(polygon: &[[f64; 2]], triangles: &[[u32; 3]]) -> Vec<f64> {
        let of = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| polygon[corner as usize]);
            turn(a, b, c)
        };
        triangles.iter().map(of).collect()
    }

    fn area(polygon: &[[f64; 2]]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        polygon
            .iter()
            .zip(next)
            .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
            .sum()
    }

    /// Triangles with the orientation and the area of the polygon cannot overlap.
    fn is_covered(polygon: &[[f64; 2]]) {
        let areas = areas(polygon, &cut(polygon));
        let sign = area(polygon).signum();
        assert!(areas.iter().all(|area| area * sign > 0.0), "{areas:?}");
        assert_eq!(areas.iter().sum::<f64>(), area(polygon));
    }

    const DART: [[f64; 2]; 4] = [[0.0, 0.0], [4.0, 0.0], [0.5, 0.5], [0.0, 4.0]];
    const COMB: [[f64; 2]; 9] = [
        [0.0, 0.0],
        [8.0, 0.0],
        [8.0, 4.0],
        [6.0, 1.0],
        [5.0, 4.0],
        [4.0, 1.0],
        [3.0, 4.0],
        [2.0, 1.0],
        [0.0, 4.0],
    ];

    #[test]
    fn concave_polygons_are_covered_whichever_corner_comes_first() {
        for polygon in [&DART[..], &COMB[..]] {
            let mut polygon = polygon.to_vec();
            for _ in 0..2 * polygon.len() {
                is_covered(&polygon);
                polygon.rotate_left(1);
            }
            polygon.reverse();
            for _ in 0..polygon.len() {
                is_covered(&polygon);
                polygon.rotate_left(1);
            }
        }
    }

    #[test]
    fn convex_polygons_stay_fans() {
        // Also with three corners on a line, with a corner twice, and where nothing has an area.
        let convex = [[0.0, 0.0], [2.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        let twice = [[0.0, 0.0], [2.0, 0.0], [2.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        let line = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [2.0, 0.0], [1.0, 0.0]];
        for polygon in [convex, twice, line] {
            assert_eq!(cut(&polygon), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        }
    }

    #[test]
    fn polygons_that_cannot_be_cut_are_fanned() {
        let bow = [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 3.0]];
        assert_eq!(cut(&bow), [[0, 1, 2], [0, 2, 3]]);
        // Rows of a grid, one after the other: the way back crosses them.
        let rows: Vec<[f64; 2]> = (0..900)
            .map(|ix| [f64::from(ix % 30), f64::from(ix / 30)])
            .collect();
        assert_eq!(cut(&rows)[..2], [[0, 1, 2], [0, 2, 3]]);
        let huge = [[0.0, 0.0], [1e300, 0.0], [1e299, 1e299], [0.0, 1e300]];
        assert_eq!(cut(&huge)[0], [0, 1, 2]);
    }

    /// A polygon with a name, and its area.
    fn large(n: u32) -> [(&'static str, Vec<[f64; 2]>); 7] {
        let full = f64::from(n);
        let at = |radius: f64, share: f64| {
            let angle = share * std::f64::consts::TAU;
            [radius * angle.cos(), radius * angle.sin()]
        };
        let corners = |f: &dyn Fn(f64) -> [f64; 2]| (0..n).map(|ix| f(f64::from(ix))).collect();
        // There along the floor, back over the teeth.
        let zigzag = corners(&|ix| match ix {
            0.0 => [0.0, -1.0],
            1.0 => [full, -1.0],
            _ => [full - ix, if ix % 2.0 == 0.0 { 0.0 } else { 1.0 }],
        });
        // Teeth on both sides of a band.
        let ribbon = corners(&|ix| match ix < full / 2.0 {
            true => [ix, if ix % 2.0 == 0.0 { -1.0 } else { -0.5 }],
            false => [full - 1.0 - ix, if ix % 2.0 == 0.0 { 0.0 } else { 1.0 }],
        });
        // A band that winds outward 32 times: out along its outer side, back along the inner one.
        let half = full / 2.0;
        let spiral = corners(&|ix| {
            let (share, width) = if ix < half {
                (ix / half, 0.5)
            } else {
                ((full - 1.0 - ix) / half, 0.0)
            };
            at(1.0 + width + 32.0 * share, 32.0 * share)
        });
        // Sides with corners along them.
        let square = corners(&|ix| {
            let (side, along) = ((4.0 * ix / full).floor(), (4.0 * ix % full) / full);
            match side {
                0.0 => [along, 0.0],
                1.0 => [1.0, along],
                2.0 => [1.0 - along, 1.0],
                _ => [0.0, 1.0 - along],
            }
        });
        [
            ("circle", corners(&|ix| at(1.0, ix / full))),
            ("star", corners(&|ix| at(1.0 + ix % 2.0, ix / full))),
            // Teeth that nearly meet in the middle.
            ("wheel", corners(&|ix| at(0.001 + ix % 2.0, ix / full))),
            ("zigzag", zigzag),
            ("ribbon", ribbon),
            ("spiral", spiral),
            ("square", square),
        ]
    }

    #[test]
    fn large_polygons_are_covered() {
        for (name, polygon) in large(2_048) {
            for polygon in [polygon.clone(), polygon.into_iter().rev().collect()] {
                let areas = areas(&polygon, &cut(&polygon));
                let whole = area(&polygon);
                assert!(areas.iter().all(|area| area * whole > 0.0), "{name}");
                let sum: f64 = areas.iter().sum();
                assert!((sum - whole).abs() < 1e-9 * whole.abs(), "{name}");
            }
        }
    }

    /// Work, not time: so many looks per corner.
    #[test]
    fn a_million_corners_take_about_as_much_work_each_as_a_thousand() {
        for ix in 0..large(8).len() {
            let of = |n: u32| large(n)[ix].clone();
            let (name, small) = of(1 << 10);
            // All kinds, but only two of them with a million: the test is not optimised.
            let is_largest = ["circle", "zigzag"].contains(&name);
            let (_, polygon) = of(if is_largest { 1 << 20 } else { 1 << 16 });
            let [looks, of_small] = [&polygon, &small].map(|polygon| {
                let mut triangles = Vec::new();
                let n_looks = clip_many_ears(polygon, &mut triangles).expect(name);
                assert_eq!(triangles.len(), polygon.len() - 2);
                n_looks as f64 / polygon.len() as f64
            });
            assert!(looks < 100.0 + 3.0 * of_small, "{name}: {looks} {of_small}");
        }
    }

    /// Large polygons are cut into small triangles, so that their boxes overlap little. In a circle
    /// half of all edges are those of the polygon, and each halving of the corners left makes edges
    /// twice as long. In a ribbon an edge goes to the next corners, or across.
    #[test]
    fn large_circles_and_ribbons_have_short_edges() {
        let polygons = large(1 << 14);
        for (name, most) in [("circle", 250.0), ("ribbon", 3.0 * f64::from(3 << 14))] {
            let (_, polygon) = polygons.iter().find(|(other, _)| *other == name).unwrap();
            let length: f64 = (cut(polygon).iter())
                .map(|triangle| {
                    let [a, b, c] = triangle.map(|corner| polygon[corner as usize]);
                    [[a, b], [b, c], [c, a]]
                        .map(|[p, q]| (p[0] - q[0]).hypot(p[1] - q[1]))
                        .iter()
                        .sum::<f64>()
                })
                .sum();
            // A fan of the circle would have 16384 times 2 or so.
            assert!(length < most, "{name}: {length}");
        }
    }
}
