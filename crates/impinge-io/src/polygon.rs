//! Polygons as triangles.

/// Polygons with more corners than this stay fans whatever their shape: clipping ears takes the square of their number.
const MOST_CLIPPED: usize = 256;

/// Replaces the fan of a polygon around its first corner by other triangles of the same corners, as many, if a triangle of the
/// fan is turned over, as seen along the polygon's normal (Newell's). That happens only where the polygon is concave, and the
/// fan then overlaps itself. Ears are clipped one after the other (Meisters 1975). A polygon that runs out of ears,
/// because it crosses itself, stays a fan.
pub(crate) fn mend(fan: &mut [[u32; 3]], position: impl Fn(u32) -> [f64; 3]) {
    if !(2..=MOST_CLIPPED - 2).contains(&fan.len()) {
        return;
    }
    let rest = fan.iter().map(|triangle| triangle[2]);
    let corners: Vec<u32> = fan[0][..2].iter().copied().chain(rest).collect();
    let points = flatten(&corners, position);
    let is_turned = |edge: &[[f64; 2]]| turn(points[0], edge[0], edge[1]) < 0.0;
    let mut triangles = Vec::with_capacity(fan.len());
    if points[1..].windows(2).any(is_turned) && clip_ears(&corners, &points, &mut triangles) {
        fan.copy_from_slice(&triangles);
    }
}

/// The corners as seen along the polygon's normal: anticlockwise, without the coordinate that the normal has most of.
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

/// Twice the area of a triangle; positive if it is anticlockwise.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Returns false if some corner is left without an ear.
fn clip_ears(corners: &[u32], points: &[[f64; 2]], triangles: &mut Vec<[u32; 3]>) -> bool {
    let mut left: Vec<usize> = (0..corners.len()).collect();
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
        triangles.push(ear(ix).map(|corner| corners[corner]));
        left.remove(ix);
    }
    triangles.push([left[0], left[1], left[2]].map(|corner| corners[corner]));
    turn(points[left[0]], points[left[1]], points[left[2]]) > 0.0
}

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
        let star: Vec<[f64; 2]> = (0..2 * MOST_CLIPPED)
            .map(|ix| {
                let angle = ix as f64 * std::f64::consts::PI / MOST_CLIPPED as f64;
                let radius = if ix % 2 == 0 { 2.0 } else { 1.0 };
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        assert_eq!(cut(&star)[0], [0, 1, 2]);
        let huge = [[0.0, 0.0], [1e300, 0.0], [1e299, 1e299], [0.0, 1e300]];
        assert_eq!(cut(&huge)[0], [0, 1, 2]);
    }
}
