//! The shortest way that takes two convex bodies apart.

use impinge_core::Elements;
use impinge_core::contact::convex_overlap;
use impinge_scenes::{Model, Random, surfaces};

type Point = [f64; 3];

fn points(model: &Model, by: Point) -> Vec<Point> {
    let moved = model.positions_f64().into_iter();
    moved
        .map(|point| [0, 1, 2].map(|k| point[k] + by[k]))
        .collect()
}

#[test]
fn boxes_and_balls() {
    let cube = surfaces::cube([0.0; 3], 1.0);
    let a = points(&cube, [0.0; 3]);
    for (by, depth, normal) in [
        ([0.75, 0.1, 0.0], 0.25, [1.0, 0.0, 0.0]),
        ([0.1, -0.5, 0.2], 0.5, [0.0, -1.0, 0.0]),
        // All six are as near: the lowest.
        ([0.0; 3], 1.0, [-1.0, 0.0, 0.0]),
        ([1.0, 0.0, 0.0], 0.0, [1.0, 0.0, 0.0]),
    ] {
        let found = convex_overlap(&a, &points(&cube, by)).unwrap();
        assert!((found.depth - depth).abs() < 1e-12, "{by:?}: {found:?}");
        assert!(dot(found.normal, normal) > 1.0 - 1e-9, "{by:?}: {found:?}");
    }
    let ball = surfaces::icosphere(3);
    let found = convex_overlap(&points(&ball, [0.0; 3]), &points(&ball, [0.5, 0.25, 0.1]));
    let radius = dot(points(&ball, [0.0; 3])[0], points(&ball, [0.0; 3])[0]).sqrt();
    let exact = 2.0 * radius - (0.25f64 + 0.0625 + 0.01).sqrt();
    assert!(
        (found.unwrap().depth - exact).abs() < 0.02 * radius,
        "{found:?} {exact}"
    );
    assert_eq!(convex_overlap(&a[..3], &a[..3]), None);
    assert_eq!(convex_overlap(&[], &a), None);
}

/// Moved apart along the normal by the depth, they do not overlap; along no other way is it
/// shorter.
#[test]
fn it_is_the_shortest_way() {
    let mut random = Random::new(5);
    for _ in 0..200 {
        let mut some = |n: u32| -> Vec<Point> {
            (0..n)
                .map(|_| random.point(-1.0, 1.0).map(f64::from))
                .collect()
        };
        let (a, b) = (some(12), some(9));
        let found = convex_overlap(&a, &b).unwrap();
        if found.depth == 0.0 {
            continue;
        }
        let apart = |way: Point| {
            let of = |points: &[Point], way: Point| {
                points.iter().map(|&p| dot(p, way)).fold(f64::MIN, f64::max)
            };
            of(&a, way) + of(&b, scaled(way, -1.0))
        };
        assert!((apart(found.normal) - found.depth).abs() < 1e-9);
        for _ in 0..300 {
            let way = random.point(-1.0, 1.0).map(f64::from);
            let length = dot(way, way).sqrt();
            assert!(apart(scaled(way, 1.0 / length)) > found.depth - 1e-9);
        }
    }
}

/// Regular bodies in regular and in any poses: many differences in one plane, on one line, at
/// one point. The shortest way is across a face of one body, or across an edge of each.
#[test]
fn regular_bodies_have_the_depth_of_their_faces_and_edges() {
    let mut random = Random::new(7);
    let models = [
        surfaces::cube([0.0; 3], 1.0),
        surfaces::icosphere(0),
        surfaces::icosphere(1),
    ];
    let edges = |model: &Model, at: &[Point]| -> Vec<Point> {
        let Elements::Triangles(triangles) = &model.elements else {
            unreachable!()
        };
        let sides = triangles
            .iter()
            .flat_map(|&[p, q, r]| [[p, q], [q, r], [r, p]]);
        let sides = sides.filter(|[p, q]| p < q);
        sides
            .map(|side| side.map(|ix| at[ix as usize]))
            .map(|[p, q]| sub(q, p))
            .collect()
    };
    for case in 0..120 {
        let [one, two] = [case % 3, case / 3 % 3].map(|ix| &models[ix]);
        let quarter = |x: f32| f64::from((4.0 * x).round() / 4.0);
        // Those of the first nine are at one place.
        let by = random
            .point(-1.0, 1.0)
            .map(|x| if case < 9 { 0.0 } else { quarter(x) });
        let turn = random.point(-1.0, 1.0).map(f64::from);
        let a = points(one, [0.0; 3]);
        let mut b = points(two, [0.0; 3]);
        if case % 2 == 1 {
            b = b.into_iter().map(|p| turned(p, turn)).collect();
        }
        // Far larger and far smaller than 1, too.
        let scale = [1.0, 1e-120, 1e120, 2f64.powi(1022)][case / 9 % 4];
        let put = |p: Point, by: Point| [0, 1, 2].map(|k| scale * (p[k] + by[k]));
        let a: Vec<Point> = a.into_iter().map(|p| put(p, [0.0; 3])).collect();
        let b: Vec<Point> = b.into_iter().map(|p| put(p, by)).collect();
        let unscaled = |points: &[Point]| -> Vec<Point> {
            points.iter().map(|&p| scaled(p, 1.0 / scale)).collect()
        };
        let (plain_a, plain_b) = (unscaled(&a), unscaled(&b));
        let apart = |way: Point| {
            let of = |points: &[Point], way: Point| {
                points.iter().map(|&p| dot(p, way)).fold(f64::MIN, f64::max)
            };
            of(&plain_a, way) + of(&plain_b, scaled(way, -1.0))
        };
        let (of_a, of_b) = (edges(one, &plain_a), edges(two, &plain_b));
        let both = [&of_a[..], &of_b[..]].concat();
        let mut least = f64::INFINITY;
        for (ix, &x) in both.iter().enumerate() {
            for &y in &both[..ix] {
                let way = cross(x, y);
                let length = dot(way, way).sqrt();
                if length > 1e-9 {
                    for sign in [1.0, -1.0] {
                        least = least.min(apart(scaled(way, sign / length)));
                    }
                }
            }
        }
        let found = convex_overlap(&a, &b).unwrap();
        let depth = found.depth / scale;
        assert!(
            (depth - least.max(0.0)).abs() < 1e-9,
            "case {case}: {depth} for {least}"
        );
        if depth > 0.0 {
            assert!((apart(found.normal) - depth).abs() < 1e-9, "case {case}");
        }
    }
}

/// Where rounded planes said what is seen, these did not end, or had depths of 0.5 and 0.
#[test]
fn poses_that_turned_polyhedra_inside_out() {
    let cube = |sides: Point| -> Vec<Point> {
        let signs = [0, 1, 2, 3, 4, 5, 6, 7]
            .map(|corner| [0, 1, 2].map(|k| if corner >> k & 1 == 0 { -0.5 } else { 0.5 }));
        signs
            .map(|sign| [0, 1, 2].map(|k| sign[k] * sides[k]))
            .to_vec()
    };
    let posed = |points: &[Point], rows: [[f64; 4]; 3]| -> Vec<Point> {
        let along = |p: &Point| rows.map(|[x, y, z, by]| x * p[0] + y * p[1] + z * p[2] + by);
        points.iter().map(along).collect()
    };
    let at = |[x, y, z]: Point| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z]];
    let turned_cube = [
        [
            0.6737497886926791,
            0.7236843343499139,
            -0.1494730960845206,
            -0.4363406068237569,
        ],
        [
            -0.5004069712977178,
            0.5956550786450805,
            0.6283214864708735,
            0.4412280581417906,
        ],
        [
            0.5437408254979712,
            -0.3485340894386735,
            0.7634591692984894,
            -0.6615455383634828,
        ],
    ];
    // Eight sides, 1 high.
    let turns = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0].map(|k| k * std::f64::consts::FRAC_PI_4);
    let rim = |z: f64| turns.map(|turn: f64| [0.5 * turn.cos(), 0.5 * turn.sin(), z]);
    let cylinder = [rim(-0.5), rim(0.5)].concat();
    let ball = points(&surfaces::icosphere(1), [0.0; 3]);
    let unit = cube([1.0; 3]);
    let slab = posed(&cube([4.0, 1.0, 0.2]), at([0.25, -0.25, 0.0]));
    let width = |points: &[Point]| {
        let found = convex_overlap(points, points).unwrap();
        let most = points
            .iter()
            .map(|&p| dot(p, found.normal))
            .fold(f64::MIN, f64::max);
        (found.depth, 2.0 * most)
    };
    let found = convex_overlap(&unit, &posed(&unit, turned_cube)).unwrap();
    assert!((found.depth - DEPTH_OF_CUBES).abs() < 1e-9, "{found:?}");
    let found = convex_overlap(&cylinder, &slab).unwrap();
    assert!((found.depth - 0.6).abs() < 1e-9, "{found:?}");
    let (depth, most) = width(&ball);
    assert!((depth - most).abs() < 1e-9, "{depth} {most}");
}

/// Whose differences have ends on one line along the axes, or are nearly flat, or both: their
/// shortest way is that of all normals of faces and all products of edges.
#[test]
fn slender_bodies_and_tetrahedra_of_a_lattice() {
    let mut random = Random::new(11);
    let spindle = [[-4, -4, -4], [4, 4, 4], [1, -1, 0], [0, 1, -1], [-1, 0, 1]];
    let spindle = spindle.map(|p| p.map(f64::from)).to_vec();
    let fixed = [[0.0; 3], [0.25; 3], [1.0; 3], [0.5, 0.25, 0.0]];
    let mut n_equal = 0;
    for case in 0..3000 {
        let mut whole =
            |most: u32| [0; 3].map(|_| f64::from(random.below(2 * most + 1)) - f64::from(most));
        // Tetrahedra about a diagonal, with some whole numbers off it.
        let mut some = |(long, wide): (u32, u32)| -> Vec<Point> {
            let way = match case % 3 {
                0 => [1.0; 3],
                1 => [3.0, 5.0, 7.0],
                _ => whole(1),
            };
            (0..4)
                .map(|_| {
                    let (far, by) = (whole(long)[0], whole(wide));
                    [0, 1, 2].map(|k| far * way[k] + by[k])
                })
                .collect()
        };
        let sizes = [(0, 2), (4, 1), (40, 1), (1_000_000, 2), (1_000_000_000, 2)][case / 3 % 5];
        let (a, b) = match fixed.get(case) {
            Some(by) => {
                let moved = |p: &Point| [0, 1, 2].map(|k| p[k] + by[k]);
                (spindle.clone(), spindle.iter().map(moved).collect())
            }
            None if case % 5 < 2 => {
                let a = some(sizes);
                (a.clone(), a)
            }
            None => (some(sizes), some(sizes)),
        };
        let Some(least) = shortest(&a, &b) else {
            continue;
        };
        n_equal += usize::from(a == b);
        let found = convex_overlap(&a, &b);
        let depth = found.map(|found| found.depth);
        let size = f64::from(sizes.0 + sizes.1);
        assert!(
            depth.is_some_and(|depth| (depth - least.max(0.0)).abs() < 1e-11 * size.max(4.0)),
            "case {case}: {found:?} for {least}: {a:?} {b:?}"
        );
    }
    assert!(n_equal > 500, "{n_equal}");
}

/// The shortest way apart, from all differences of two points as edges, and their products; in
/// whole numbers and quarters. `None` where the two bodies are flat in sum.
fn shortest(a: &[Point], b: &[Point]) -> Option<f64> {
    let whole = |points: &[Point]| -> Vec<[i128; 3]> {
        points
            .iter()
            .map(|p| p.map(|x| (4.0 * x) as i128))
            .collect()
    };
    let (a, b) = (whole(a), whole(b));
    let minus = |p: [i128; 3], q: [i128; 3]| [0, 1, 2].map(|k| p[k] - q[k]);
    let height = |p: [i128; 3], q: [i128; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let edges = [&a, &b].map(|points| {
        let all = points.iter().enumerate();
        all.flat_map(|(ix, &p)| points[..ix].iter().map(move |&q| minus(p, q)))
            .collect::<Vec<_>>()
    });
    let edges = edges.concat();
    let (mut least, mut is_flat) = (f64::INFINITY, true);
    for (ix, p) in edges.iter().enumerate() {
        for q in &edges[..ix] {
            let way = [0, 1, 2].map(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                p[i] * q[j] - p[j] * q[i]
            });
            if way == [0; 3] {
                continue;
            }
            is_flat &= edges.iter().all(|&edge| height(way, edge) == 0);
            let squared: f64 = way.iter().map(|&x| (x as f64).powi(2)).sum();
            let length = squared.sqrt();
            let ends = |points: &[[i128; 3]]| {
                let heights = || points.iter().map(|&p| height(way, p));
                (heights().min().unwrap(), heights().max().unwrap())
            };
            let (of_a, of_b) = (ends(&a), ends(&b));
            let over = (of_a.1 - of_b.0).min(of_b.1 - of_a.0);
            least = least.min(over as f64 / length / 4.0);
        }
    }
    (!is_flat).then_some(least)
}

/// From the hull of all differences, by Qhull.
const DEPTH_OF_CUBES: f64 = 0.48446148773807574;

/// Turned about an axis by its length.
fn turned(p: Point, axis: Point) -> Point {
    let angle = dot(axis, axis).sqrt();
    let axis = scaled(axis, 1.0 / angle);
    let (sin, cos) = angle.sin_cos();
    let (across, along) = (cross(axis, p), dot(axis, p));
    [0, 1, 2].map(|k| p[k] * cos + across[k] * sin + axis[k] * along * (1.0 - cos))
}

fn sub(p: Point, q: Point) -> Point {
    [0, 1, 2].map(|k| p[k] - q[k])
}

fn scaled(p: Point, by: f64) -> Point {
    p.map(|x| x * by)
}

fn dot(p: Point, q: Point) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

fn cross(p: Point, q: Point) -> Point {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| p[i] * q[j] - p[j] * q[i])
}
