//! How far vertices may move, and neighbours by element: against every pair by the exact tests.

use super::near::{PARTS, thickness};
use impinge_core::exact::{ElementPair, Point, are_within, closest_points, edge_face_are_within};
use impinge_core::{
    BodyId, Bounds, Csr, Elements, Error, Exclusion, Method, PairKind, Part, Positions, Query,
    SafeDistances, Scene,
};
use impinge_scenes::{Random, solids, soup, surfaces};
use impinge_tests::{detector, detectors, thickness_of};

/// An element of one body, by its corners.
#[derive(Debug, Clone)]
pub(super) struct Held {
    pub body: BodyId,
    pub part: Part,
    pub element: u32,
    pub corners: Vec<u32>,
}

pub(super) fn elements(scene: &Scene, part: Part) -> Vec<Held> {
    let mut all = Vec::new();
    for (body, held) in scene.bodies() {
        let n = match part {
            Part::Vertices => held.n_vertices(),
            Part::Edges => held.edges().len(),
            _ => held.faces().len(),
        };
        let given = held.elements();
        let used: Vec<u32> = (0..given.len())
            .flat_map(|ix| given.corners(ix).to_vec())
            .collect();
        for element in 0..n {
            let corners = match part {
                Part::Vertices => vec![element as u32],
                Part::Edges => held.edges().corners(element).to_vec(),
                _ => held.faces().corners(element).to_vec(),
            };
            // Vertices of no element do not take part.
            if part != Part::Vertices || used.contains(&corners[0]) {
                all.push(Held {
                    body,
                    part,
                    element: element as u32,
                    corners,
                });
            }
        }
    }
    all
}

pub(super) fn points(scene: &Scene, of: &Held) -> Vec<Point> {
    let positions = scene.body(of.body).expect("held").positions();
    let point = |&corner: &u32| positions.point(corner as usize);
    of.corners.iter().map(point).collect()
}

/// All pairs of elements of the kinds that meet in a test, and their points as the exact tests take
/// them.
pub(super) fn pairs(scene: &Scene) -> Vec<(PairKind, Held, Held, [Point; 4])> {
    let [vertices, edges, faces] =
        [Part::Vertices, Part::Edges, Part::Faces].map(|part| elements(scene, part));
    let mut all = Vec::new();
    let mut add = |kind, a: &Held, b: &Held| {
        let shares = a.body == b.body && a.corners.iter().any(|corner| b.corners.contains(corner));
        if !shares {
            let mut four = [[0.0; 3]; 4];
            let (a_points, b_points) = (points(scene, a), points(scene, b));
            // The exact test of an edge and a vertex takes the vertex first.
            let (first, second) = match kind {
                PairKind::EdgeVertex => (b_points, a_points),
                _ => (a_points, b_points),
            };
            for (to, from) in four.iter_mut().zip(first.iter().chain(&second)) {
                *to = *from;
            }
            all.push((kind, a.clone(), b.clone(), four));
        }
    };
    for v in &vertices {
        for f in &faces {
            add(PairKind::VertexFace, v, f);
        }
    }
    for (ix, e) in edges.iter().enumerate() {
        for f in &edges[ix + 1..] {
            add(PairKind::EdgeEdge, e, f);
        }
        for v in &vertices {
            add(PairKind::EdgeVertex, e, v);
        }
    }
    for (ix, v) in vertices.iter().enumerate() {
        for w in &vertices[ix + 1..] {
            add(PairKind::VertexVertex, v, w);
        }
    }
    all
}

pub(super) fn test_of(kind: PairKind) -> ElementPair {
    match kind {
        PairKind::VertexFace => ElementPair::VertexFace,
        PairKind::EdgeEdge => ElementPair::EdgeEdge,
        PairKind::EdgeVertex => ElementPair::VertexEdge,
        _ => ElementPair::VertexVertex,
    }
}

/// At least the sum, and the sum itself if it is a float.
fn sum_up(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |sum: f64, &x| {
        let found = sum + x;
        let rest = (sum - (found - x)) + (x - (found - (found - x)));
        if rest > 0.0 { found.next_up() } else { found }
    })
}

/// The largest bound of the corners of an element.
fn largest(safe: &SafeDistances, of: &Held) -> f64 {
    let bounds = safe.of(of.body).expect("held");
    let own = of.corners.iter().map(|&corner| bounds.get(corner as usize));
    own.fold(0.0, f64::max)
}

/// Holds the bounds against every pair: together, two elements move less than they are apart, and
/// no bound is much smaller than it must be.
fn check(scene: &Scene, safe: &SafeDistances, most: f64, fixed: &[BodyId]) -> [usize; 2] {
    check_those(scene, safe, (most, fixed), |_, _, _| true)
}

/// The same for those pairs that a function keeps, which the question did not leave out.
pub(super) fn check_those(
    scene: &Scene,
    safe: &SafeDistances,
    (most, fixed): (f64, &[BodyId]),
    keeps: impl Fn(PairKind, &Held, &Held) -> bool,
) -> [usize; 2] {
    let thickness = |of: &Held| thickness_of(scene, of.body, of.part, of.element);
    let mut least = std::collections::BTreeMap::new();
    let (mut n_touching, mut n_bounded) = (0, 0);
    for held in [Part::Vertices, Part::Edges, Part::Faces].map(|part| elements(scene, part)) {
        for of in held {
            for corner in of.corners {
                least.insert(
                    (of.body, corner),
                    if fixed.contains(&of.body) { 0.0 } else { most },
                );
            }
        }
    }
    for (kind, a, b, four) in pairs(scene) {
        if !keeps(kind, &a, &b) {
            continue;
        }
        let thick = [thickness(&a), thickness(&b)];
        let moves = [largest(safe, &a), largest(safe, &b)];
        let sum = sum_up(&[moves[0], moves[1], thick[0], thick[1]]);
        let pair = test_of(kind);
        if are_within(pair, &four, sum) {
            assert_eq!(moves, [0.0; 2], "{kind:?} {a:?} {b:?}");
            n_touching += 1;
        }
        let own = closest_points(pair, &four).distance - thick[0] - thick[1];
        let are_fixed = [&a, &b].map(|of| fixed.contains(&of.body));
        let share = match are_fixed {
            [false, false] => own / 2.0,
            _ => own,
        };
        for of in [&a, &b] {
            for &corner in &of.corners {
                let least = least.entry((of.body, corner)).or_insert(most);
                if !fixed.contains(&of.body) {
                    *least = share.min(*least).max(0.0);
                } else {
                    *least = 0.0;
                }
            }
        }
    }
    // An edge that pierces a face.
    for e in elements(scene, Part::Edges) {
        for f in elements(scene, Part::Faces) {
            let shares = e.body == f.body && e.corners.iter().any(|c| f.corners.contains(c));
            let (ends, face) = (points(scene, &e), points(scene, &f));
            let face = [face[0], face[1], face[2]];
            if shares || !keeps(PairKind::EdgeFace, &e, &f) {
                continue;
            }
            if edge_face_are_within(&[ends[0], ends[1]], &face, 0.0) {
                for of in [&e, &f] {
                    assert_eq!(largest(safe, of), 0.0, "{e:?} {f:?}");
                    for &corner in &of.corners {
                        least.insert((of.body, corner), 0.0);
                    }
                }
            }
        }
    }
    for ((body, corner), least) in least {
        let bound = safe.of(body).expect("held").get(corner as usize);
        assert!(bound <= most);
        assert!(bound == 0.0 || !fixed.contains(&body), "{body:?} {corner}");
        assert!(
            bound >= least * (1.0 - 1.0 / 1024.0) - 1e-300,
            "{body:?} {corner}: {bound} {least}"
        );
        n_bounded += usize::from(bound > 0.0 && bound < most);
    }
    [n_touching, n_bounded]
}

/// A scene of small bodies of every kind: on a lattice, where many elements touch, are parallel,
/// coplanar or degenerate; or at random.
pub(super) fn scene(seed: u64, is_lattice: bool, is_double: bool) -> (Scene, Vec<BodyId>) {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let mut points = |n: usize| -> Vec<[f64; 3]> {
        let lattice = |random: &mut Random| [0; 3].map(|_| f64::from(random.below(5)));
        (0..n)
            .map(|_| match is_lattice {
                true => lattice(&mut random),
                false => random.point(-1.0, 1.0).map(f64::from),
            })
            .collect()
    };
    let faces: Vec<[u32; 3]> = vec![[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 5]];
    let (a, b) = (points(9), points(5));
    let (c, d) = (points(4), points(3));
    let mut bodies = Vec::new();
    if is_double {
        bodies.push(scene.add_triangles(&faces, &a).expect("good"));
    } else {
        let a: Vec<[f32; 3]> = a.iter().map(|p| p.map(|x| x as f32)).collect();
        bodies.push(scene.add_triangles(&faces, &a).expect("good"));
    }
    bodies.push(scene.add_tetrahedra(&[[0, 1, 2, 3]], &b).expect("good"));
    bodies.push(scene.add_edges(&[[0, 1], [1, 2]], &c).expect("good"));
    bodies.push(scene.add_points(&d).expect("good"));
    (scene, bodies)
}

/// Gives each element of a part of a body its own thickness.
pub(super) fn set_each(scene: &mut Scene, body: BodyId, part: Part, of: impl Fn(usize) -> f64) {
    let held = scene.body(body).expect("held");
    let n = match part {
        Part::Vertices => held.n_vertices(),
        _ => held.part(part).len(),
    };
    let each = Vec::from_iter((0..n).map(of));
    let set = scene.set_thickness(body, thickness(part, &each));
    set.expect("good");
}

#[test]
fn together_two_elements_move_less_than_they_are_apart() {
    let (mut n_touching, mut n_bounded) = (0, 0);
    let mut detectors = detectors();
    for seed in 0..40 {
        for (is_lattice, is_double) in [(false, false), (false, true), (true, false), (true, true)]
        {
            let (mut scene, bodies) = scene(seed, is_lattice, is_double);
            let fixed = match seed % 3 {
                0 => vec![],
                1 => vec![bodies[0]],
                _ => vec![bodies[1], bodies[3]],
            };
            if seed % 4 == 3 {
                scene.set_thickness(bodies[0], 0.1).expect("good");
                scene.set_thickness(bodies[2], 0.03).expect("good");
            }
            if seed % 4 == 2 {
                let part = PARTS[seed as usize / 4 % 3];
                set_each(&mut scene, bodies[0], part, |ix| {
                    [0.0, 0.1, 0.02, 0.0, 0.3, 0.0, 0.05, 0.0, 0.0][ix % 9]
                });
                set_each(&mut scene, bodies[1], part, |ix| 0.01 * ix as f64);
                scene.set_thickness(bodies[2], 0.03).expect("good");
            }
            let most = [0.05, 0.3, 2.0][seed as usize % 3];
            let query = Query::all().fixed(fixed.iter().copied());
            let safe: Vec<SafeDistances> = detectors
                .iter_mut()
                .map(|detector| detector.safe_distances(&scene, most, &query).expect("good"))
                .collect();
            for other in &safe[1..] {
                for &body in &bodies {
                    assert_eq!(safe[0].of(body), other.of(body), "{seed}");
                }
                let rows = |of: &SafeDistances| of.touching().iter().collect::<Vec<_>>();
                assert_eq!(rows(&safe[0]), rows(other), "{seed}");
            }
            let [touching, bounded] = check(&scene, &safe[0], most, &fixed);
            n_touching += touching;
            n_bounded += bounded;
            let has_own = safe[0].touching().iter().next().is_some();
            assert!(has_own || touching == 0, "{seed}");
        }
    }
    assert!(
        n_touching > 1000 && n_bounded > 300,
        "{n_touching} {n_bounded}"
    );
}

/// Half of an odd multiple of the smallest number is none, and most distances are no multiple: all
/// are rounded down.
#[test]
fn bounds_of_multiples_of_the_smallest_number() {
    let unit = f64::from_bits(1);
    let multiple = |x: f64| x.to_bits();
    let mut detector = detector(Method::Clusters, 1);
    let steps = || 0..5u64;
    for [x, y, z] in
        steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| [x, y, z])))
    {
        let square = x * x + y * y + z * z;
        let mut scene = Scene::new();
        let bodies = [[0; 3], [x, y, z]].map(|at| {
            let point = at.map(|k| k as f64 * unit);
            scene.add_points(&[point]).expect("good")
        });
        let query = Query::all().kinds([PairKind::VertexVertex]);
        let lists = detector.neighbours(&scene, 1.0, &query).expect("good");
        let (_, distance) = lists.of(PairKind::VertexVertex).of(0).next().expect("near");
        assert!(multiple(distance).pow(2) <= square, "{x} {y} {z}");
        for fixed in [&bodies[..0], &bodies[..1]] {
            let query = Query::all().fixed(fixed.iter().copied());
            let safe = detector.safe_distances(&scene, 1.0, &query).expect("good");
            let [a, b] = bodies.map(|body| multiple(safe.of(body).expect("held").get(0)));
            assert!(
                (a + b).pow(2) < square || a + b == 0,
                "{x} {y} {z}: {a} {b}"
            );
            // Less than what roundings may take away.
            assert!((a + b + 4).pow(2) > square, "{x} {y} {z}: {a} {b}");
        }
    }
}

/// Where elements are large beside their distance, distances are measured exactly, and many are
/// floats: bounds are still less.
#[test]
fn bounds_are_less_than_distances_that_are_floats() {
    let mut detectors = detectors();
    for exponent in 0..48 {
        let (size, gap) = (2f64.powi(exponent), 2f64.powi(exponent % 3 - exponent));
        let faces = [
            vec![[-size, -size, 0.0], [size, -size, 0.0], [0.0, size, 0.0]],
            vec![[0.0, 0.0, gap], [size, 0.0, size], [0.0, size, size]],
        ];
        let edges = [
            vec![[-size, 0.0, 0.0], [size, 0.0, 0.0]],
            vec![[0.0, -size, gap], [0.0, size, gap]],
        ];
        for (is_double, points) in [
            (true, &faces),
            (false, &faces),
            (true, &edges),
            (false, &edges),
        ] {
            let mut scene = Scene::new();
            let bodies = points.each_ref().map(|points| {
                let elements = match points.len() {
                    2 => Elements::Edges(vec![[0, 1]]),
                    _ => Elements::Triangles(vec![[0, 1, 2]]),
                };
                let single: Vec<_> = points.iter().map(|p| p.map(|x| x as f32)).collect();
                let body = match is_double {
                    true => scene.add((elements, points.clone())),
                    false => scene.add((elements, single)),
                };
                body.expect("good")
            });
            for fixed in [&[][..], &bodies[..1]] {
                let most = 2.0 * gap;
                // Those that `check` looks at.
                let kinds = &PairKind::ALL[..4];
                let query = Query::all().kinds(kinds.iter().copied());
                let query = query.fixed(fixed.iter().copied());
                for detector in &mut detectors {
                    let safe = detector.safe_distances(&scene, most, &query).expect("good");
                    let [n_touching, n_bounded] = check(&scene, &safe, most, fixed);
                    assert!(n_touching == 0 && n_bounded > 0, "{size} {gap}");
                }
            }
        }
    }
}

/// How thick a body is: one number, or one for each element of a part.
#[derive(Debug)]
enum Thick {
    Whole(f64),
    Each(Part),
}

/// Pairs that give no vertex less are dropped before they are measured: with many of nearly the
/// same distance, and some that touch, the answer is that of the method which drops none.
#[test]
fn pairs_that_are_dropped_would_not_count() {
    let mut random = Random::new(11);
    let sheet = surfaces::cloth(7, 7, 1.0);
    for (round, is_double) in [(0, false), (1, false), (2, true), (3, true)] {
        let mut scene = Scene::new();
        let lower = sheet.add_to(&mut scene).expect("good");
        // A millionth is less than the filter can tell in single precision.
        let mut height = |[x, y, z]: [f32; 3]| match (x + y) as u32 % 5 {
            0 if round % 2 == 1 => [x, y, z],
            _ => [x, y, z + 0.75 + 1e-6 * random.unit()],
        };
        let at: Vec<[f32; 3]> = sheet.positions.iter().map(|&p| height(p)).collect();
        let upper = if is_double {
            let at: Vec<Point> = at.iter().map(|p| p.map(f64::from)).collect();
            scene.add((sheet.elements.clone(), at)).expect("good")
        } else {
            scene.add((sheet.elements.clone(), at)).expect("good")
        };
        let wholes = [Thick::Whole(0.0), Thick::Whole(0.3)].into_iter();
        for thick in wholes.chain(PARTS.map(Thick::Each)) {
            match thick {
                Thick::Whole(one) => scene.set_thickness(upper, one).expect("good"),
                Thick::Each(part) => {
                    set_each(&mut scene, upper, part, |ix| 0.3 + 1e-7 * (ix % 3) as f64);
                }
            }
            for fixed in [&[][..], &[lower]] {
                let query = Query::all().fixed(fixed.iter().copied());
                let [first, others @ ..] = detectors().map(|mut detector| {
                    detector.safe_distances(&scene, 0.9, &query).expect("good")
                });
                let rows = |of: &SafeDistances| of.touching().iter().collect::<Vec<_>>();
                assert_eq!(rows(&first).is_empty(), round % 2 == 0);
                for other in others {
                    for body in [lower, upper] {
                        assert_eq!(first.of(body), other.of(body), "{round} {thick:?}");
                    }
                    assert_eq!(rows(&first), rows(&other), "{round} {thick:?}");
                }
            }
        }
    }
}

#[test]
fn bounds_hold_on_surfaces() {
    let mut scene = Scene::new();
    let mut bodies = Vec::new();
    for x in [0.0, 2.05] {
        let ball = surfaces::bumpy_ball(300, 0.3).translated([x, 0.0, 0.0]);
        bodies.push(ball.add_to(&mut scene).expect("good"));
    }
    let block = solids::block(2, 2, 1, 0.5).translated([0.0, 1.2, 0.0]);
    bodies.push(block.add_to(&mut scene).expect("good"));
    let mut detector = detector(Method::Clusters, 2);
    let safe = detector
        .safe_distances(&scene, 0.1, &Query::all())
        .expect("good");
    let [_, n_bounded] = check(&scene, &safe, 0.1, &[]);
    assert!(n_bounded > 100, "{n_bounded}");
}

/// Moves every vertex as far as it may in random directions: where it is as it is stored, rounding
/// included, is not farther from its start.
fn moved(scene: &Scene, safe: &SafeDistances, body: BodyId, random: &mut Random) -> Positions {
    let held = scene.body(body).expect("held");
    let bounds = safe.of(body).expect("held");
    let is_single = matches!(held.positions(), Positions::F32(_));
    let round = |x: f64| match is_single {
        true => f64::from(x as f32),
        false => x,
    };
    let ends = Vec::from_iter((0..held.n_vertices()).map(|ix| {
        let by = random.point(-1.0, 1.0).map(f64::from);
        let length = by.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
        let (start, bound) = (held.positions().point(ix), bounds.get(ix));
        let shares = [1.0, 1.0 - 1e-9, 1.0 - 1e-4, 0.99, 0.9, 0.5, 0.0].into_iter();
        let mut ends = shares.map(|share| {
            let scale = share * bound / length;
            [0, 1, 2].map(|axis| round(start[axis] + by[axis] * scale))
        });
        let is_near = |end: &Point| {
            let four = [start, *end, [0.0; 3], [0.0; 3]];
            are_within(ElementPair::VertexVertex, &four, bound)
        };
        ends.find(is_near).expect("its start is near")
    }));
    match is_single {
        true => Vec::from_iter(ends.iter().map(|p| p.map(|x| x as f32))).into(),
        false => ends.into(),
    }
}

#[test]
fn what_moves_within_its_bounds_never_touches() {
    let mut random = Random::new(7);
    let mut scene = Scene::new();
    let model = soup::triangles(120, 0.25, 3);
    let wide = model.positions_f64();
    let body = scene
        .add((model.elements.clone(), wide.clone()))
        .expect("good");
    let mut detector = detector(Method::Clusters, 2);
    // Those that intersect already stand still, and are not asked about.
    let query = Query::all();
    let pairs = detector.detect(&scene, &query).expect("good");
    let colliding = pairs.colliding(body);
    let Elements::Triangles(faces) = model.elements else {
        panic!("a soup of triangles");
    };
    let kept: Vec<[u32; 3]> = (0..faces.len())
        .filter(|&ix| colliding.binary_search(&(ix as u32)).is_err())
        .map(|ix| faces[ix])
        .collect();
    assert!(kept.len() > 30);
    scene.remesh(body, (kept, wide)).expect("good");
    for _ in 0..50 {
        let safe = detector.safe_distances(&scene, 0.05, &query).expect("good");
        assert!(safe.touching().is_empty());
        let end = moved(&scene, &safe, body, &mut random);
        scene.set_end_positions(body, end.clone()).expect("good");
        assert!(detector.is_free(&scene, &query).expect("good"));
        scene.clear_end_positions(body).expect("good");
        scene.set_positions(body, end).expect("good");
        assert!(!detector.any(&scene, &query).expect("good"));
    }
}

/// On any path: from the same start, vertices go from place to place within their bounds, straight
/// and with corners, each time as far as they may. In either precision, with elements that are
/// thick, bodies that are fixed, and groups that do not meet.
#[test]
fn paths_with_corners_within_the_bounds_never_touch() {
    let mut random = Random::new(29);
    let mut detector = detector(Method::Clusters, 2);
    let (mut n_ways, mut n_far, mut n_left_out) = (0, [0; 2], 0);
    for round in 0..12 {
        // Two crumpled layers with a ball between them.
        let mut scene = Scene::new();
        let layers =
            [-0.6, 0.6].map(|height| surfaces::cloth(8, 8, 0.15).translated([-0.6, -0.6, height]));
        let models = layers.into_iter().chain([surfaces::bumpy_ball(200, 0.3)]);
        let are_single = match round % 3 {
            0 => [false; 3],
            1 => [true; 3],
            _ => [true, false, true],
        };
        let mut bodies = Vec::new();
        for ((model, most), is_single) in models.zip([0.05, 0.05, 0.003]).zip(are_single) {
            let crumpled = Vec::from_iter(model.positions.iter().map(|p| {
                let q = random.point(-most, most);
                [0, 1, 2].map(|k: usize| p[k] + q[k])
            }));
            let wide = || Vec::from_iter(crumpled.iter().map(|p| p.map(f64::from)));
            let body = match is_single {
                true => scene.add((model.elements.clone(), crumpled)),
                false => scene.add((model.elements.clone(), wide())),
            };
            bodies.push(body.expect("good"));
        }
        if round % 4 > 0 {
            scene.set_thickness(bodies[2], 0.001).expect("good");
            let part = PARTS[round % 4 - 1];
            set_each(&mut scene, bodies[0], part, |ix| 0.002 * (ix % 3) as f64);
        }
        let fixed = match round % 5 {
            3 => vec![bodies[2]],
            4 => vec![bodies[0], bodies[1]],
            _ => vec![],
        };
        let mut query = Query::all().fixed(fixed);
        if round % 2 == 1 {
            for (ix, &body) in bodies.iter().enumerate() {
                let at = scene.body(body).expect("held").positions();
                // One half of each layer may go through the ball, and through itself.
                let group = |v: usize| {
                    if ix == 2 {
                        2
                    } else {
                        u32::from(at.point(v)[0] > 0.0)
                    }
                };
                let groups = Vec::from_iter((0..at.len()).map(group));
                scene.set_groups(body, &groups).expect("good");
            }
            query = query
                .exclude(Exclusion::groups(1, 2))
                .exclude(Exclusion::groups(1, 1));
        }
        let most = [0.02, 0.1, 1.0][round / 3 % 3];
        let safe = detector.safe_distances(&scene, most, &query).expect("good");
        assert!(safe.touching().is_empty());
        let first = scene.clone();
        for _ in 0..10 {
            for &body in &bodies {
                let end = moved(&first, &safe, body, &mut random);
                let held = scene.body(body).expect("held");
                let (from, is_single) = (held.positions(), matches!(end, Positions::F32(_)));
                n_far[usize::from(is_single)] += (0..end.len())
                    .filter(|&ix| {
                        let bound = safe.of(body).expect("held").get(ix);
                        let way = [0, 1, 2].map(|k: usize| end.point(ix)[k] - from.point(ix)[k]);
                        way.iter().map(|x| x * x).sum::<f64>().sqrt() > 1.5 * bound
                    })
                    .count();
                scene.set_end_positions(body, end).expect("good");
            }
            assert!(detector.is_free(&scene, &query).expect("good"), "{round}");
            let all = detector.is_free(&scene, &Query::all()).expect("good");
            n_left_out += usize::from(!all);
            n_ways += 1;
            for &body in &bodies {
                let end = scene.body(body).expect("held").end_positions().cloned();
                let end = end.expect("it moves");
                scene.set_positions(body, end).expect("good");
                scene.clear_end_positions(body).expect("good");
            }
        }
    }
    // Many go farther at once than from their starts.
    assert!(
        n_ways == 120 && n_far.iter().all(|&n| n > 1000) && n_left_out > 0,
        "{n_far:?} {n_left_out}"
    );
}

/// A list as `(row, column)` pairs.
fn entries(of: &Csr) -> Vec<(u32, u32)> {
    let rows = 0..of.offsets.len().saturating_sub(1);
    rows.flat_map(|row| of.of(row).map(move |(column, _)| (row as u32, column)))
        .collect()
}

#[test]
fn neighbours_are_the_near_pairs_by_element() {
    let kinds = [
        PairKind::VertexFace,
        PairKind::EdgeEdge,
        PairKind::EdgeVertex,
        PairKind::VertexVertex,
        PairKind::EdgeFace,
    ];
    for (seed, is_lattice) in [(1, false), (2, true), (3, true)] {
        let (mut scene, bodies) = scene(seed, is_lattice, true);
        // A body in between that is gone.
        scene.remove(bodies[1]).expect("good");
        let query = Query::all().kinds(kinds);
        let of_all = detectors().map(|mut detector| {
            let near = detector.near(&scene, 1.0, &query).expect("good");
            let lists = detector.neighbours(&scene, 1.0, &query).expect("good");
            (near, lists)
        });
        let (near, lists) = &of_all[0];
        assert!(!near.is_empty());
        assert_eq!(near.len(), lists.len());
        for kind in kinds {
            let [a, b] = kind.parts();
            let number = |part, at: impinge_core::Element| {
                lists.first(at.body, part).expect("held") + at.element
            };
            let mut pairs: Vec<(u32, u32)> = near
                .of(kind)
                .map(|pair| (number(a, pair.a), number(b, pair.b)))
                .collect();
            let mut turned: Vec<(u32, u32)> = pairs.iter().map(|&(a, b)| (b, a)).collect();
            if a == b {
                pairs.extend(turned.iter().copied());
                turned = pairs.clone();
            }
            pairs.sort_unstable();
            turned.sort_unstable();
            assert_eq!(entries(lists.of(kind)), pairs, "{kind:?}");
            assert_eq!(entries(lists.reversed(kind)), turned, "{kind:?}");
        }
        for (kind, a, b, four) in pairs(&scene) {
            let row = lists.first(a.body, a.part).expect("held") + a.element;
            let column = lists.first(b.body, b.part).expect("held") + b.element;
            let found = lists
                .of(kind)
                .of(row as usize)
                .find(|&(at, _)| at == column);
            let pair = test_of(kind);
            assert_eq!(found.is_some(), are_within(pair, &four, 1.0), "{kind:?}");
            if let Some((_, distance)) = found {
                let touches = are_within(pair, &four, 0.0);
                assert_eq!(distance == 0.0, touches);
                assert!(touches || !are_within(pair, &four, distance));
                assert!(are_within(pair, &four, distance * (1.0 + 2f64.powi(-19))));
            }
        }
        for (_, other) in &of_all[1..] {
            for kind in kinds {
                assert_eq!(lists.of(kind), other.of(kind));
                assert_eq!(lists.reversed(kind), other.reversed(kind));
            }
        }
    }
}

/// So many that each thread makes some rows of the lists.
#[test]
fn lists_are_the_same_with_any_number_of_threads() {
    let mut scene = Scene::new();
    surfaces::bumpy_ball(900, 0.3)
        .add_to(&mut scene)
        .expect("good");
    surfaces::cloth(20, 20, 1.0)
        .add_to(&mut scene)
        .expect("good");
    let query = Query::all().kinds([PairKind::VertexFace, PairKind::EdgeEdge]);
    let of = |threads| {
        let mut detector = detector(Method::Clusters, threads);
        detector.neighbours(&scene, 0.3, &query).expect("good")
    };
    let expected = of(1);
    assert!(expected.vf().indices.len() > 1 << 15);
    for threads in [2, 3, 7] {
        let found = of(threads);
        for kind in [PairKind::VertexFace, PairKind::EdgeEdge] {
            assert!(found.of(kind) == expected.of(kind), "{threads}");
            assert!(found.reversed(kind) == expected.reversed(kind), "{threads}");
        }
    }
    // Each pair is in both lists, and rows ascend.
    for (list, turned) in [
        (expected.vf(), expected.fv()),
        (expected.ee(), expected.ee()),
    ] {
        let mut pairs = entries(list);
        assert!(pairs.is_sorted());
        let mut back: Vec<_> = entries(turned).iter().map(|&(a, b)| (b, a)).collect();
        pairs.sort_unstable();
        back.sort_unstable();
        assert!(pairs == back);
    }
}

/// Where squares are no numbers any more, bounds in floats are of no use, and distances are still
/// rounded down.
#[test]
fn distances_of_tiny_and_huge_scenes_are_rounded_down() {
    let mut detector = detector(Method::Clusters, 1);
    for exponent in [-700, -520, 520, 700] {
        let size = 2f64.powi(exponent);
        let mut random = Random::new(7);
        let mut at = || random.point(-1.0, 1.0).map(|x| f64::from(x) * size);
        let corners: Vec<Point> = (0..24).map(|_| at()).collect();
        let mut scene = Scene::new();
        scene.add_points(&corners[..6]).expect("good");
        let pairs_of: Vec<[u32; 2]> = (0..3).map(|ix| [2 * ix, 2 * ix + 1]).collect();
        scene.add_edges(&pairs_of, &corners[6..12]).expect("good");
        let triangles: Vec<[u32; 3]> = (0..4).map(|ix| [0, 1, 2].map(|k| 3 * ix + k)).collect();
        scene
            .add_triangles(&triangles, &corners[12..])
            .expect("good");
        let kinds = [
            PairKind::VertexFace,
            PairKind::EdgeEdge,
            PairKind::EdgeVertex,
            PairKind::VertexVertex,
        ];
        let query = Query::all().kinds(kinds);
        let lists = detector.neighbours(&scene, size, &query).expect("good");
        assert!(lists.len() > 50, "{}", lists.len());
        for (kind, a, b, four) in pairs(&scene) {
            let [row, column] =
                [&a, &b].map(|of| lists.first(of.body, of.part).expect("held") + of.element);
            let mut near = lists.of(kind).of(row as usize);
            if let Some((_, distance)) = near.find(|&(at, _)| at == column) {
                let pair = test_of(kind);
                let touches = are_within(pair, &four, 0.0);
                assert!(
                    touches || !are_within(pair, &four, distance),
                    "{kind:?} {exponent}"
                );
                let above = distance * (1.0 + 2f64.powi(-19));
                assert!(are_within(pair, &four, above), "{kind:?} {exponent}");
            }
        }
    }
}

#[test]
fn bad_lengths_and_bodies_are_refused_by_name() {
    let (mut scene, bodies) = scene(1, false, false);
    let mut detector = detector(Method::Auto, 1);
    for most in [-1.0, f64::NAN, f64::INFINITY, f64::MAX] {
        let error = detector.safe_distances(&scene, most, &Query::all());
        let error = error.expect_err("refused");
        let is_named = matches!(
            &error,
            Error::Setting {
                setting: "most",
                ..
            }
        );
        assert!(is_named, "{most}: {error}");
    }
    let error = detector.safe_distances(&scene, 1e308, &Query::all());
    assert_eq!(
        error.expect_err("twice as much is too much").to_string(),
        "most: 1e308 given, a number whose double is finite allowed"
    );
    scene.remove(bodies[3]).expect("good");
    let query = Query::all().fixed([bodies[3]]);
    let error = detector.safe_distances(&scene, 1.0, &query);
    assert!(matches!(error, Err(Error::UnknownBody { .. })));
    let safe = detector
        .safe_distances(&scene, 1.0, &Query::all())
        .expect("good");
    assert_eq!(safe.of(bodies[3]), None);
    assert!(matches!(safe.of(bodies[0]), Some(Bounds::F32(_))));
    assert!(matches!(safe.of(bodies[1]), Some(Bounds::F64(_))));
    // A vertex of no element may go as far as any.
    assert_eq!(safe.of(bodies[0]).expect("held").get(8), 1.0);
}

/// Points on spheres around others, as far as both are thick together or a few units in the last
/// place farther or nearer.
#[test]
fn distances_of_thick_elements_are_as_exact_as_of_others() {
    let mut random = Random::new(19);
    let mut detectors = detectors();
    let (mut n_touching, mut n_apart) = (0, 0);
    for round in 0..40 {
        let thick = [[0.75, 0.25], [0.1, 0.2], [1.0, 1e-17], [0.3, 0.0]][round % 4];
        let sum = thick[0] + thick[1];
        let mut scene = Scene::new();
        let (mut centres, mut points) = (Vec::new(), Vec::new());
        for ix in 0..40_u32 {
            // Far from each other.
            let centre = [f64::from(ix) * 8.0, 0.0, 0.0];
            let way = match ix % 3 {
                0 => [0.0, 0.0, 1.0],
                1 => [0.0, 0.6, 0.8],
                _ => random.point(-1.0, 1.0).map(f64::from),
            };
            let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
            let steps = [0.0, 1.0, 2.0, 8.0, 1000.0, 1e6, -1.0, -3.0, 1e10][ix as usize % 9];
            let far = sum * (1.0 + steps * f64::EPSILON);
            points.push([0, 1, 2].map(|k: usize| centre[k] + way[k] * far / length));
            centres.push(centre);
        }
        let a = scene.add_points(&centres).expect("good");
        let b = match round / 4 % 2 {
            0 => scene.add_points(&points),
            _ => scene.add_edges(
                &(0..40).map(|ix| [2 * ix, 2 * ix + 1]).collect::<Vec<_>>(),
                &(points.iter())
                    .flat_map(|&[x, y, z]| [[x, y, z], [x, y + 2.0 * y.signum(), z]])
                    .collect::<Vec<_>>(),
            ),
        };
        let b = b.expect("good");
        scene.set_thickness(a, thick[0]).expect("good");
        scene.set_thickness(b, thick[1]).expect("good");
        let kind = match round / 4 % 2 {
            0 => PairKind::VertexVertex,
            _ => PairKind::EdgeVertex,
        };
        let query = Query::between(a, b).kinds([kind]);
        let lists = detectors.each_mut().map(|detector| {
            let found = detector.neighbours(&scene, 1.0, &query).expect("good");
            let lists = found.of(kind);
            (0..lists.offsets.len() - 1)
                .flat_map(|row| {
                    lists
                        .of(row)
                        .map(move |(ix, far)| (row, ix, far.to_bits()))
                        .collect::<Vec<_>>()
                })
                .collect::<Vec<_>>()
        });
        assert!(lists.iter().all(|list| *list == lists[0]));
        let touching = detectors[0].near(&scene, 0.0, &query).expect("good").len();
        let zeros = lists[0].iter().filter(|(_, _, far)| *far == 0).count();
        // Lists of two vertices name each pair twice.
        let n_each = if kind == PairKind::VertexVertex { 2 } else { 1 };
        assert_eq!(zeros, n_each * touching, "{round}");
        n_touching += touching;
        // Within a distance plus the thickness is decided exactly.
        for &(_, _, bits) in &lists[0] {
            let far = f64::from_bits(bits);
            if far == 0.0 {
                continue;
            }
            n_apart += 1;
            let mut n_within = |far: f64| {
                let found = detectors[0].near(&scene, far, &query).expect("good");
                found.len()
            };
            let n_nearer = lists[0].iter().filter(|(.., other)| *other < bits).count() / n_each;
            assert!(n_within(far.next_down()) <= n_nearer, "{far:e}");
            assert!(n_within(far * (1.0 + 2f64.powi(-20))) > n_nearer, "{far:e}");
        }
        let safe = detectors.each_mut().map(|detector| {
            let safe = detector.safe_distances(&scene, 0.5, &query).expect("good");
            let rows = safe.touching().iter().collect::<Vec<_>>();
            assert_eq!(rows.len(), touching);
            let all = [a, b].map(|body| match safe.of(body) {
                Some(Bounds::F64(bounds)) => bounds.to_vec(),
                _ => panic!("double precision"),
            });
            (rows, all)
        });
        assert!(safe.iter().all(|other| *other == safe[0]));
        for &(row, column, bits) in &lists[0] {
            // Of each centre, which is near one element.
            let centre = if kind == PairKind::VertexVertex {
                row
            } else {
                column as usize
            };
            if let Some(&bound) = safe[0].1[0].get(centre) {
                let half = f64::from_bits(bits) / 2.0;
                assert!(
                    bound <= half && bound >= half * (1.0 - 1.0 / 1024.0),
                    "{bound:e} {half:e}"
                );
            }
        }
    }
    assert!(n_touching > 100 && n_apart > 500, "{n_touching} {n_apart}");
}
