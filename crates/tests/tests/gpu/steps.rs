//! Steps on the GPU backend against the CPU: every pair, every time to the last bit.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::sync::{Mutex, OnceLock};

use crate::caller::Caller;

use impinge_core::{
    Backend, BodyId, CancelToken, Capacities, Clearance, Control, Detector, Error, Impact, Method,
    PairKind, Precision, Query, Real, Recluster, Scene, Settings, Start,
};
use impinge_scenes::{Random, solids, soup, surfaces};

fn gpu() -> Settings {
    static OPEN: OnceLock<Mutex<Detector>> = OnceLock::new();
    OPEN.get_or_init(|| {
        let open = Detector::new(Backend::Gpu);
        Mutex::new(open.expect("these tests need a GPU or a software driver"))
    });
    Settings::new().backend(Backend::Gpu)
}

fn on_gpu() -> Detector {
    Detector::new(gpu()).expect("settings")
}

fn on_cpu() -> Detector {
    Detector::new(Backend::Cpu).expect("settings")
}

/// Asserts that both answer a step alike, the first one on its device. Returns the number of
/// impacts.
pub fn assert_alike(name: &str, device: &mut Detector, scene: &Scene, step: &Query) -> usize {
    let mut cpu = on_cpu();
    let expected = cpu.impacts(scene, step).expect(name).clone();
    let impacts = device.impacts(scene, step).expect(name);
    let stats = impacts.stats();
    assert_ne!(stats.backend, "cpu", "{name}");
    assert_eq!(stats.method, "clusters", "{name}");
    for (found, expected) in impacts.iter().zip(&expected) {
        assert_eq!(found, expected, "{name}");
    }
    assert_eq!(impacts.len(), expected.len(), "{name}");
    assert_eq!(impacts.hash(), expected.hash(), "{name}");
    let earliest = device.earliest(scene, step).expect(name);
    assert_eq!(earliest, expected.earliest(), "{name}");
    assert_ne!(device.stats().backend, "cpu", "{name}");
    let is_free = device.is_free(scene, step).expect(name);
    assert_eq!(is_free, expected.is_empty(), "{name}");
    assert_ne!(device.stats().backend, "cpu", "{name}");
    expected.len()
}

/// Points of a lattice of n^3 cells.
pub fn lattice<R: From<f32>>(random: &mut Random, n_points: usize, n: u32) -> Vec<[R; 3]> {
    let mut at = || R::from(random.below(n + 1) as f32);
    (0..n_points).map(|_| [at(), at(), at()]).collect()
}

/// Triangles that share some of their vertices.
pub fn faces(n_points: usize) -> Vec<[u32; 3]> {
    let n = n_points as u32;
    (0..n / 3)
        .map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % n])
        .collect()
}

/// Adds a body of random triangles on a lattice, which moves to other points of it.
pub fn add_web<R: Real + From<f32>>(
    scene: &mut Scene,
    random: &mut Random,
    n: usize,
    side: u32,
) -> BodyId
where
    impinge_core::Positions: From<Vec<[R; 3]>>,
{
    let start: Vec<[R; 3]> = lattice(random, n, side);
    let body = scene.add((faces(n), start)).expect("good");
    let end: Vec<[R; 3]> = lattice(random, n, side);
    scene.set_end_positions(body, &end).expect("good");
    body
}

#[test]
fn lattices_where_much_is_degenerate_are_answered_alike() {
    let mut device = on_gpu();
    let mut n_found = 0;
    for seed in 0..8 {
        let mut random = Random::new(seed);
        // One cluster each, and several.
        for (n, side) in [(24, 4), (240, 12)] {
            let mut scene = Scene::new();
            match seed % 2 {
                0 => add_web::<f32>(&mut scene, &mut random, n, side),
                _ => add_web::<f64>(&mut scene, &mut random, n, side),
            };
            let name = format!("lattice {seed} of {n}");
            for step in [
                Query::all(),
                Query::all().start(Start::Skip).precision(Precision::F64),
            ] {
                n_found += assert_alike(&name, &mut device, &scene, &step);
            }
        }
    }
    assert!(n_found > 1000);
}

#[test]
fn whatever_moves_in_a_plane_or_not_at_all_is_answered_alike() {
    let mut device = on_gpu();
    for seed in 0..6 {
        let mut random = Random::new(100 + seed);
        let n = 60;
        let [start, end] = [(); 2].map(|()| lattice::<f32>(&mut random, n, 6));
        let flat = |points: &[[f32; 3]]| Vec::from_iter(points.iter().map(|p| [p[0], p[1], 1.0]));
        let moved = Vec::from_iter(start.iter().map(|p| [p[0] + 3.0, p[1] - 1.0, p[2]]));
        for (start, end) in [
            (flat(&start), flat(&end)),
            (start.clone(), start.clone()),
            (start.clone(), moved),
            (flat(&start), end),
        ] {
            let mut scene = Scene::new();
            let body = scene.add((faces(n), start)).expect("good");
            scene.set_end_positions(body, &end).expect("good");
            let name = format!("flat {seed}");
            assert_alike(&name, &mut device, &scene, &Query::all());
        }
    }
}

/// Five bodies, two of them in f64, one of them without end positions.
fn five_bodies() -> (Scene, Vec<BodyId>) {
    let mut scene = Scene::new();
    let mut random = Random::new(7);
    let mut bodies = Vec::new();
    for ix in 0..4 {
        bodies.push(match ix % 2 {
            0 => add_web::<f32>(&mut scene, &mut random, 60, 8),
            _ => add_web::<f64>(&mut scene, &mut random, 45, 8),
        });
    }
    let still = lattice::<f32>(&mut random, 30, 8);
    bodies.push(scene.add((faces(30), still)).expect("good"));
    (scene, bodies)
}

#[test]
fn several_bodies_meet_as_the_query_and_their_filters_say() {
    let (mut scene, bodies) = five_bodies();
    let [a, b, c, ..] = bodies[..] else {
        panic!("five");
    };
    let queries = [
        Query::all(),
        Query::between_all(),
        Query::self_all(),
        Query::self_of(b),
        Query::between(c, a),
        Query::all().exclude((a, b)).exclude((c, c)),
        Query::between_all().exclude((b, c)),
    ];
    let mut device = on_gpu();
    let mut counts = Vec::new();
    for filtered in [false, true] {
        if filtered {
            let filter = |category, mask| impinge_core::Filter { category, mask };
            scene.set_filter(a, filter(2, 1)).expect("known");
            scene.set_filter(b, filter(1 << 40, 3)).expect("known");
            scene.set_filter(c, filter(1, 1 << 40 | 2)).expect("known");
        }
        for query in &queries {
            let name = format!("{query:?} {filtered}");
            let step = query.clone();
            counts.push(assert_alike(&name, &mut device, &scene, &step));
        }
    }
    counts.dedup();
    assert!(counts.len() > 9, "the questions differ: {counts:?}");
}

/// Adds points and edges of a tiny lattice, so that they meet.
fn add_points_and_edges<R: Real + From<f32>>(scene: &mut Scene, random: &mut Random) {
    let edges = Vec::from_iter((0..39).step_by(2).map(|v| [v, (v + 3) % 40]));
    let mut points = || lattice::<R>(random, 40, 3);
    let body = scene.add_points(&points()).expect("good");
    scene.set_end_positions(body, points()).expect("good");
    let body = scene.add_edges(&edges, &points()).expect("good");
    scene.set_end_positions(body, points()).expect("good");
}

#[test]
fn edges_and_points_are_answered_alike() {
    let mut device = on_gpu();
    let mut kinds = [0; 6];
    for seed in 0..6 {
        let mut random = Random::new(200 + seed);
        let mut scene = Scene::new();
        add_points_and_edges::<f32>(&mut scene, &mut random);
        add_points_and_edges::<f64>(&mut scene, &mut random);
        add_web::<f32>(&mut scene, &mut random, 30, 3);
        for query in [Query::all(), Query::between_all(), Query::self_all()] {
            let name = format!("bare {seed} {query:?}");
            assert_alike(&name, &mut device, &scene, &query);
        }
        let impacts = device.impacts(&scene, &Query::all()).expect("good");
        for impact in &impacts {
            kinds[impact.kind as usize] += 1;
        }
    }
    for kind in [
        PairKind::VertexFace,
        PairKind::EdgeEdge,
        PairKind::EdgeVertex,
        PairKind::VertexVertex,
    ] {
        assert!(kinds[kind as usize] > 10, "{kinds:?}");
    }
}

/// Two balls that run into each other, of so many triangles together.
pub fn balls(n: usize) -> Scene {
    let mut scene = Scene::new();
    let ball = surfaces::ball(n / 2);
    let (low, high) = ball.bounds().expect("not empty");
    let width = high[2] - low[2];
    let other = ball.translated([0.0, 0.1 * width, 1.02 * width]);
    let a = ball.add_to(&mut scene).expect("good");
    let b = other.add_to(&mut scene).expect("good");
    let end_a = ball.mapped(|[x, y, z]| [1.01 * x, y, z + 0.05 * x]);
    let end_b = other.mapped(|[x, y, z]| [x, y, z - 0.2 * width + 0.01 * y]);
    scene.set_end_positions(a, &end_a.positions).expect("good");
    scene.set_end_positions(b, &end_b.positions).expect("good");
    scene
}

#[test]
fn surfaces_of_many_clusters_are_answered_alike() {
    let mut device = on_gpu();
    let scene = balls(3000);
    for step in [Query::all(), Query::between_all().precision(Precision::F64)] {
        assert!(assert_alike("balls", &mut device, &scene, &step) > 100);
    }
    let impacts = device.impacts(&scene, &Query::all()).expect("good");
    let on_device = impacts.stats().clone();
    let mut cpu = on_cpu();
    let impacts = cpu.impacts(&scene, &Query::all()).expect("good");
    let stats = impacts.stats();
    assert_eq!(
        on_device.n_candidates, stats.n_candidates,
        "boxes decide exactly"
    );
    assert_eq!(on_device.n_clusters, stats.n_clusters);
    let (n, n_left) = (on_device.n_candidates, on_device.n_unsure);
    assert!(n_left < n / 2, "{n_left} of {n} are left to the CPU");
    // Most pairs touch later than one that certainly touches, or do not matter once one does.
    let earliest = device.earliest(&scene, &Query::all()).expect("good");
    assert!(earliest.is_some());
    let n_first = device.stats().n_unsure;
    assert!(n_first < n_left / 10, "{n_first} of {n_left} may be first");
    assert!(!device.is_free(&scene, &Query::all()).expect("good"));
    let n_any = device.stats().n_unsure;
    assert!(n_any < n_left / 2, "{n_any} of {n_left} for any");
    for stage in ["clustering", "upload", "decide", "collect"] {
        assert!(
            on_device.stages.iter().any(|held| held.name == stage),
            "{stage}"
        );
    }
}

#[test]
fn tetrahedra_take_part_with_their_surface() {
    let mut device = on_gpu();
    let mut scene = Scene::new();
    let cube = solids::solid_cube(600);
    let a = cube.add_to(&mut scene).expect("good");
    let soup = soup::lattice_tetrahedra(40, 6, 5).scaled(0.25);
    let b = soup.add_to(&mut scene).expect("good");
    for (body, model) in [(a, &cube), (b, &soup)] {
        let end = model
            .mapped(|[x, y, z]| [y - 0.3, x + 0.1, z * 0.8])
            .positions;
        scene.set_end_positions(body, &end).expect("good");
    }
    assert!(assert_alike("tetrahedra", &mut device, &scene, &Query::all()) > 10);
}

/// Boxes that run into each other; some stand still.
fn many_bodies() -> (Scene, Vec<BodyId>) {
    let mut scene = Scene::new();
    let mut random = Random::new(11);
    let mut bodies = Vec::new();
    for ix in 0..60u32 {
        let at = random.point(0.0, 8.0);
        let model = surfaces::cube(at, 1.0);
        let body = model.add_to(&mut scene).expect("good");
        let by = random.point(-2.0, 2.0);
        let end = model.translated(by).positions;
        if ix % 7 != 0 {
            scene.set_end_positions(body, &end).expect("good");
        }
        bodies.push(body);
    }
    (scene, bodies)
}

#[test]
fn many_bodies_are_found_by_the_tree_over_them() {
    let mut device = on_gpu();
    let (scene, bodies) = many_bodies();
    let all = Query::between_all();
    let pairs = bodies.iter().zip(&bodies[1..]);
    let some = pairs.fold(all.clone(), |query, (&a, &b)| query.exclude((a, b)));
    let counts = [Query::all(), all, some].map(|query| {
        let step = query;
        assert_alike("boxes", &mut device, &scene, &step)
    });
    assert!(
        counts[0] == counts[1] && counts[1] > counts[2] && counts[2] > 100,
        "{counts:?}"
    );
    let within = Query::self_all();
    let nothing = assert_alike("boxes", &mut device, &scene, &within);
    assert_eq!(nothing, 0, "a box that moves as a whole never meets itself");
}

/// Coordinates that are very large, very small, or far from their differences.
#[test]
fn numbers_of_all_sizes_are_answered_alike() {
    let mut device = on_gpu();
    for exponent in [-140, -100, -40, 0, 30, 39, 60, 100, 110] {
        let mut random = Random::new(31);
        let scale = 2f32.powi(exponent);
        for shift in [0.0, 4096.0] {
            let n = 60;
            let mut points = || -> Vec<[f32; 3]> {
                let points = (0..n).map(|_| random.point(-1.0, 1.0));
                Vec::from_iter(points.map(|p| p.map(|x| (x + shift) * scale)))
            };
            let (start, end) = (points(), points());
            let mut scene = Scene::new();
            let body = scene.add((faces(n), start)).expect("good");
            scene.set_end_positions(body, &end).expect("good");
            let name = format!("2^{exponent} + {shift}");
            assert_alike(&name, &mut device, &scene, &Query::all());
        }
        // The same in f64, farther away from the origin.
        for shift in [0.0, 1e6] {
            let scale = 2f64.powi(exponent);
            let n = 60;
            let mut points = || -> Vec<[f64; 3]> {
                let points = (0..n).map(|_| random.point(-1.0, 1.0));
                Vec::from_iter(points.map(|p| p.map(|x| (f64::from(x) * 1.1 + shift) * scale)))
            };
            let (start, end) = (points(), points());
            let mut scene = Scene::new();
            let body = scene.add((faces(n), start)).expect("good");
            scene.set_end_positions(body, &end).expect("good");
            let name = format!("f64 2^{exponent} + {shift}");
            assert_alike(&name, &mut device, &scene, &Query::all());
        }
    }
}

#[test]
fn one_detector_answers_step_after_step() {
    let mut device = on_gpu();
    let (mut scene, bodies) = five_bodies();
    let others = balls(400);
    let mut random = Random::new(3);
    let step = Query::all();
    assert_alike("first", &mut device, &scene, &step);
    let end: Vec<[f32; 3]> = lattice(&mut random, 60, 8);
    scene.set_end_positions(bodies[2], &end).expect("good");
    assert_alike("another end", &mut device, &scene, &step);
    assert_alike("another scene", &mut device, &others, &step);
    scene.set_positions(bodies[0], &end).expect("good");
    assert_alike("at rest", &mut device, &scene, &step);
    scene.clear_end_positions(bodies[3]).expect("known");
    assert_alike("one that stays", &mut device, &scene, &step);
    scene
        .remesh(bodies[2], (faces(45), end[..45].to_vec()))
        .expect("good");
    assert_alike("re-meshed", &mut device, &scene, &step);
    scene.remove(bodies[1]).expect("known");
    assert_alike("removed", &mut device, &scene, &step);
    // Intersections use other buffers of the same device.
    let pairs = device.detect(&scene, &Query::all()).expect("good").clone();
    let expected = on_cpu().detect(&scene, &Query::all()).expect("good").hash();
    assert_eq!(pairs.hash(), expected);
    assert_alike("after pairs", &mut device, &scene, &step);
    let empty = Scene::new();
    assert!(device.is_free(&empty, &step).expect("good"));
    assert_alike("after nothing", &mut device, &scene, &step);
}

#[test]
fn rooms_that_are_too_small_grow() {
    let scene = balls(1500);
    let step = Query::all();
    let expected = on_cpu().impacts(&scene, &step).expect("good").clone();
    let (earliest, expected) = (expected.earliest(), expected.hash());
    type Shrink = fn(&mut Capacities);
    let shrunk: [(&str, Shrink); 5] = [
        ("queue", |room| room.queue = 512),
        ("items", |room| room.items = 3),
        ("candidates", |room| room.candidates = 5),
        ("pairs", |room| room.pairs = 9),
        ("unsure", |room| room.unsure = 7),
    ];
    let mut rooms = vec![("least", Capacities::LEAST)];
    for (name, shrink) in shrunk {
        let mut room = Capacities::default();
        shrink(&mut room);
        rooms.push((name, room));
    }
    for (name, capacities) in rooms {
        let mut device = Detector::with_capacities(gpu(), capacities).expect("settings");
        let impacts = device.impacts(&scene, &step).expect("good");
        assert_eq!(impacts.hash(), expected, "{name}");
        let n_reruns = impacts.stats().n_reruns;
        assert!(n_reruns > 0 || name == "queue", "{name}: {n_reruns}");
        let mut other = Detector::with_capacities(gpu(), capacities).expect("settings");
        assert!(!other.is_free(&scene, &step).expect("good"), "{name}");
        let mut other = Detector::with_capacities(gpu(), capacities).expect("settings");
        let found = other.earliest(&scene, &step).expect("good");
        assert_eq!(found, earliest, "{name}");
        let impacts = device.impacts(&scene, &step).expect("good");
        assert_eq!(impacts.hash(), expected, "{name}");
        assert_eq!(impacts.stats().n_reruns, 0, "{name} has grown");
    }
}

/// The scene with the positions to which it can be moved without contact: nearly to the first one.
fn moved_until_contact(scene: &Scene, step: &Query) -> Scene {
    let advance = on_cpu().advance(scene, step).expect("good");
    let mut scene = scene.clone();
    for (body, positions) in advance.iter() {
        scene.set_end_positions(body, positions).expect("known");
    }
    scene
}

#[test]
fn certain_contacts_are_the_only_ones() {
    let mut device = on_gpu();
    let step = Query::all();
    for scene in [passing_points(99), turning_edge()] {
        assert_eq!(assert_alike("passing", &mut device, &scene, &step), 0);
    }
    let n = assert_alike("three times", &mut device, &three_contacts(), &step);
    assert_eq!(n, 1, "the first of three");
    for scene in [balls(400), balls(3000)] {
        let free = moved_until_contact(&scene, &step);
        assert_eq!(assert_alike("free", &mut device, &free, &step), 0);
        assert!(device.stats().n_candidates > 10, "they come near");
    }
}

/// A large triangle and points that move, half of them down and half of them up. `way` gives the
/// height of each above the triangle, and how far the point is inside of an edge, at the start and
/// at the end.
fn triangle_and_points(n: usize, way: impl Fn(f32) -> [[f32; 2]; 2]) -> Scene {
    let mut scene = Scene::new();
    let triangle = [[0.0f32, 0.0, 0.0], [64.0, 0.0, 0.0], [0.0, 64.0, 0.0]];
    scene.add_triangles(&[[0, 1, 2]], &triangle).expect("good");
    let at = |end: usize| -> Vec<[f32; 3]> {
        let each = (0..n).zip([1.0, -1.0].into_iter().cycle());
        let points = each.map(|(ix, side)| {
            let [z, y] = way(ix as f32 / n as f32)[end];
            [0.125 * (ix + 1) as f32, y, side * z]
        });
        points.collect()
    };
    let points = scene.add_points(&at(0)).expect("good");
    scene.set_end_positions(points, at(1)).expect("good");
    scene
}

/// Points that lie on a triangle, and leave it on either side.
fn leaving_points(n: usize) -> Scene {
    triangle_and_points(n, |_| [[0.0, 4.0], [8.0, 4.0]])
}

/// Points that come from above a triangle and pass its plane at many times, always a little outside
/// of an edge.
fn passing_points(n: usize) -> Scene {
    triangle_and_points(n, |part| {
        let time = 0.25 + 0.7 * part;
        [[4.0, 4.0], [4.0 - 4.0 / time, 4.0 - 4.1 / time]]
    })
}

/// A point that passes the plane of a triangle while it is outside of an edge that turns: at a
/// quarter of the step. At the start and in the middle of the step it is inside of all edges.
fn turning_edge() -> Scene {
    let mut scene = Scene::new();
    let start = [[-1.0f32, -1.0, 0.0], [10.0, 5.0, 0.0], [0.0, 1000.0, 0.0]];
    let end = [[-19.0f32, 11.0, 0.0], [-8.0, -7.0, 0.0], [0.0, 1000.0, 0.0]];
    let triangle = scene.add_triangles(&[[0, 1, 2]], &start).expect("good");
    scene.set_end_positions(triangle, &end).expect("good");
    let point = scene.add_points(&[[0.0f32, 0.0, 1.0]]).expect("good");
    let end = [[0.0f32, 0.0, -3.0]];
    scene.set_end_positions(point, &end).expect("good");
    scene
}

/// A triangle that passes over a point three times in the first half of the step. Found by trying
/// random ones.
fn three_contacts() -> Scene {
    let mut scene = Scene::new();
    let start = [[14.0f32, 3.0, -6.0], [-10.0, 10.0, -2.0], [-9.0, -6.0, 6.0]];
    let end = [[6.0f32, -5.0, 16.0], [4.0, 10.0, -2.0], [1.0, -14.0, -10.0]];
    let triangle = scene.add_triangles(&[[0, 1, 2]], &start).expect("good");
    scene.set_end_positions(triangle, &end).expect("good");
    scene.add_points(&[[0.0f32; 3]]).expect("good");
    scene
}

/// A pair that touches at the start has no time under `Start::Skip`, whatever it does later.
#[test]
fn pairs_that_touch_at_the_start_bound_no_time() {
    let mut device = on_gpu();
    let mut scene = leaving_points(200);
    let skip = Query::all().start(Start::Skip);
    assert_alike("reported", &mut device, &scene, &Query::all());
    assert_eq!(assert_alike("skipped", &mut device, &scene, &skip), 0);
    // One that does not touch at the start crosses the triangle late.
    let late = scene.add_points(&[[20.0f32, 20.0, 7.0]]).expect("good");
    let end = [[20.0f32, 20.0, -0.01]];
    scene.set_end_positions(late, &end).expect("good");
    assert_eq!(assert_alike("late", &mut device, &scene, &skip), 1);
}

/// A device does not know which cell owns a pair, so a pair that certainly touches says nothing
/// about another cell.
#[test]
fn cells_are_answered_alike() {
    let scene = balls(800);
    let mut cpu = on_cpu();
    let mut device = on_gpu();
    let all = Query::between_all();
    let expected = cpu.impacts(&scene, &all).expect("good").clone();
    let first = expected.earliest().expect("they touch");
    let (mut n, mut n_later, mut n_free) = (0, 0, 0);
    let cuts = [-10.0, -0.2, -0.1, 0.0, 0.1, 0.2, 10.0];
    for x in cuts.windows(2) {
        for y in cuts.windows(2) {
            let (low, high) = ([x[0], y[0], -10.0], [x[1], y[1], 10.0]);
            let step = Query::between_all().owned_by(low, high);
            let name = format!("{low:?} {high:?}");
            n += assert_alike(&name, &mut device, &scene, &step);
            match device.earliest(&scene, &step).expect("good") {
                Some(earliest) => n_later += u32::from(earliest != first),
                None => n_free += 1,
            }
        }
    }
    assert_eq!(n, expected.len());
    assert!(n_later > 2 && n_free > 2, "{n_later} {n_free}");
}

#[test]
fn a_memory_budget_is_kept_in_batches_or_by_the_cpu() {
    // Large triangles in a small room.
    let mut random = Random::new(5);
    let n = 900;
    let start = Vec::from_iter((0..n).map(|_| random.point(0.0, 1.0)));
    let end = start.iter().map(|p| p.map(|x| x + random.range(0.0, 0.01)));
    let end = Vec::from_iter(end);
    let mut scene = Scene::new();
    let body = scene.add((faces(n), start)).expect("good");
    scene.set_end_positions(body, &end).expect("good");
    let step = Query::all();
    let expected = on_cpu().impacts(&scene, &step).expect("good").clone();
    let (earliest, expected) = (expected.earliest(), expected.hash());
    let mut backends = Vec::new();
    for budget in (4..80).step_by(3).map(|n| n * 100_000) {
        let settings = gpu().memory_budget(Some(budget)).threads(1);
        let mut device = Detector::new(settings).expect("settings");
        match device.impacts(&scene, &step) {
            Ok(impacts) => {
                assert_eq!(impacts.hash(), expected, "{budget}");
                let stats = impacts.stats();
                backends.push((budget, stats.backend != "cpu", stats.n_batches));
                // Times that one part has proven hold for all.
                let found = device.earliest(&scene, &step).expect("as before");
                assert_eq!(found, earliest, "{budget}");
                assert!(!device.is_free(&scene, &step).expect("as before"));
            }
            Err(Error::MemoryBudget { .. }) => assert!(budget < 2_500_000, "{budget}"),
            Err(error) => panic!("{error}"),
        }
    }
    assert!(
        backends
            .iter()
            .any(|&(_, on_device, n_batches)| on_device && n_batches > 1),
        "{backends:?}"
    );
    assert!(
        backends
            .iter()
            .any(|&(_, on_device, n_batches)| on_device && n_batches == 1),
        "{backends:?}"
    );
}

#[test]
fn what_the_device_cannot_hold_or_answer_the_cpu_does() {
    let scene = balls(1500);
    let expected = on_cpu()
        .impacts(&scene, &Query::all())
        .expect("good")
        .hash();
    let mut device = Detector::with_most_bound(gpu(), 20_000).expect("settings");
    let impacts = device.impacts(&scene, &Query::all()).expect("good");
    assert_eq!(
        (impacts.hash(), &*impacts.stats().backend),
        (expected, "cpu")
    );
    let mut thick = scene.clone();
    for (body, _) in scene.bodies() {
        thick.set_thickness(body, 2f64.powi(101)).expect("good");
    }
    let mut device = on_gpu();
    let clearance = Clearance::new(0.001);
    for (scene, query) in [
        (&scene, Query::all().clearance(clearance)),
        (&scene, Query::all().separation(2f64.powi(102))),
        (&thick, Query::all()),
    ] {
        let expected = on_cpu().impacts(scene, &query).expect("good").hash();
        let impacts = device.impacts(scene, &query).expect("good");
        assert_eq!(
            (impacts.hash(), &*impacts.stats().backend),
            (expected, "cpu")
        );
    }
}

#[test]
fn a_body_that_flows_away_from_its_clusters_is_clustered_again() {
    let mut scene = Scene::new();
    let cloth = surfaces::cloth(40, 40, 1.0);
    let body = cloth.add_to(&mut scene).expect("good");
    let mut devices = [Recluster::Auto, Recluster::Never]
        .map(|recluster| Detector::new(gpu().recluster(recluster)).expect("settings"));
    let step = Query::all();
    for device in &mut devices {
        assert_alike("as it was", device, &scene, &step);
    }
    let mut random = Random::new(9);
    let far: Vec<[f32; 3]> = (0..cloth.n_vertices())
        .map(|_| random.point(0.0, 40.0))
        .collect();
    scene.set_positions(body, &far).expect("good");
    let n = devices.each_mut().map(|device| {
        let impacts = device.impacts(&scene, &step).expect("good");
        (impacts.hash(), impacts.stats().n_reclustered)
    });
    assert_eq!(n[0].0, n[1].0);
    assert!(n[0].1 > 0 && n[1].1 == 0, "{n:?}");
}

#[test]
fn steps_advance_as_on_the_cpu() {
    let scene = balls(400);
    for separation in [0.0, 0.003] {
        let step = Query::all().start(Start::Skip).separation(separation);
        let expected = on_cpu().advance(&scene, &step).expect("good");
        let found = on_gpu().advance(&scene, &step).expect("good");
        assert_eq!(
            (found.fraction, found.first),
            (expected.fraction, expected.first)
        );
        assert!(found.fraction < 1.0);
        assert!(found.iter().eq(expected.iter()));
    }
}

#[test]
fn limits_and_cancellation_end_a_step() {
    let scene = balls(400);
    let settings = gpu().max_pairs(Some(10));
    let mut device = Detector::new(settings).expect("settings");
    let refused = device.impacts(&scene, &Query::all()).err();
    assert!(
        matches!(refused, Some(Error::TooManyPairs { limit: 10, .. })),
        "{refused:?}"
    );
    let token = CancelToken::new();
    token.cancel();
    let control = Control::new().cancel(&token);
    let mut device = on_gpu();
    device.set_control(control);
    let stopped = device.impacts(&scene, &Query::all()).err();
    assert_eq!(stopped, Some(Error::Cancelled));
    device.set_control(Control::new());
    assert_alike("after that", &mut device, &scene, &Query::all());
}

/// Every instruction set and number of threads decides the same.
#[test]
fn threads_and_methods_do_not_matter() {
    let scene = balls(800);
    let expected = on_cpu()
        .impacts(&scene, &Query::all())
        .expect("good")
        .hash();
    for (threads, method) in [(1, Method::Auto), (3, Method::Cells), (2, Method::Clusters)] {
        let settings = gpu().threads(threads).method(method);
        let mut device = Detector::new(settings).expect("settings");
        let impacts = device.impacts(&scene, &Query::all()).expect("good");
        assert_eq!(impacts.hash(), expected);
        assert_eq!(impacts.stats().n_threads, threads);
    }
}

/// The hash of a step's impacts, the earliest one, and whether there is none.
type Answers = Result<(u64, Option<Impact>, bool), Error>;

/// Whether a device, one line of whose kernels is replaced, answers about some step wrongly.
fn is_noticed(steps: &[(Scene, Query, Answers)], damage: (&str, &str, &str)) -> bool {
    let mut device = Caller::new().damaged(Settings::default(), damage);
    let mut steps = steps.iter();
    steps.any(|(scene, step, truth)| answers(&mut device, scene, step) != *truth)
}

fn answers(detector: &mut Detector, scene: &Scene, step: &Query) -> Answers {
    let hash = detector.impacts(scene, step)?.hash();
    let earliest = detector.earliest(scene, step)?;
    Ok((hash, earliest, detector.is_free(scene, step)?))
}

#[test]
fn damaged_kernels_are_noticed() {
    let (boxes, ids) = many_bodies();
    let pairs = ids.iter().zip(&ids[1..]);
    let some = pairs.fold(Query::between_all(), |query, (&a, &b)| {
        query.exclude((a, b))
    });
    // Small ones first.
    let scenes = [
        (turning_edge(), Query::all()),
        (three_contacts(), Query::all()),
        (leaving_points(100), Query::all().start(Start::Skip)),
        (passing_points(100), Query::all()),
        (five_bodies().0, Query::all()),
        (many_edges(), Query::all()),
        (boxes, some),
        (
            moved_until_contact(&balls(3000), &Query::all()),
            Query::all(),
        ),
        (balls(6000), Query::all()),
    ];
    let scenes = scenes.map(|(scene, step)| {
        let truth = answers(&mut on_cpu(), &scene, &step).expect("good");
        (scene, step, Ok(truth))
    });
    for harmless in [
        ("traversal_moving", "let a_first =", "let  a_first ="),
        // A device that drops nothing is slow, not wrong.
        (
            "narrow_moving",
            "return decide(pair.polygon, pair.sizes, pair.are_edges) != FREE;",
            "return true;",
        ),
        ("narrow_search", "n < N_INTERVALS;", "n < 0u;"),
        // So is one that is certain of no contact, or that does not use what it is certain of.
        (
            "narrow_search",
            "return select(UNCLEAR, TOUCHES, touches);",
            "return UNCLEAR;",
        ),
        (
            "narrow_search",
            "if params.sought == SEEK_ALL && params.by_number == 0u {",
            "if false {",
        ),
    ] {
        assert!(!is_noticed(&scenes, harmless), "{harmless:?}");
    }
    for damage in [
        (
            "bounds_clusters_moving",
            "let end = ix / n_clusters;",
            "let end = 0u;",
        ),
        ("bounds_top_moving", "end < ENDS; end++", "end < 1u; end++"),
        (
            "traversal_moving",
            "return !any(a_first | b_first);",
            "return !any(a_first | b_first | (a.start.high < b.start.low));",
        ),
        (
            "traversal_moving",
            "(part_a == EDGES && is_kind_asked(KIND_EDGE_EDGE, true))",
            "false",
        ),
        (
            "traversal_moving",
            "|| is_ignored(min(body_a, body_b), max(body_a, body_b))",
            "",
        ),
        (
            "pairing_moving",
            "lows[entry + 128u] = extent.end.low;",
            "lows[entry + 128u] = extent.end.high;",
        ),
        (
            "pairing_moving",
            "(bodies[a.body].part & PART) == EDGES",
            "false",
        ),
        (
            "pairing_moving",
            "if is_same_body && shares_vertex(own_ids, ids[partner]) {",
            "if false {",
        ),
        ("pairing_moving", "walked &= after;", ""),
        (
            "narrow_moving",
            "let at_end = vertex + arrayLength(&positions) / 6u;",
            "let at_end = vertex;",
        ),
        (
            "narrow_moving",
            "return least(min(at_start, at_end)) > bound ||",
            "return least(min(at_start, at_end)) > -1.0 ||",
        ),
        (
            "narrow_moving",
            "if min(f_0, f_3) > bound && min(f_1, f_2) > inner {",
            "if f_0 > bound {",
        ),
        (
            "narrow_moving",
            "between(p, q), between(s, r)),",
            "between(p, q), between(r, s)),",
        ),
        (
            "narrow_moving",
            "first_slot = reserve(counter, atomicLoad(&n_entries));",
            "first_slot = reserve(counter, atomicLoad(&n_entries) / 2u);",
        ),
        (
            "narrow_search",
            "scaled_four(d.start, time_of(TICKS - time))",
            "scaled_four(d.end, time_of(TICKS - time))",
        ),
        (
            "narrow_search",
            "MovingFour(at(d, low), at(d, high))",
            "MovingFour(at(d, high), at(d, high))",
        ),
        (
            "narrow_search",
            "if high == end {",
            "if high >= TICKS / 2u {",
        ),
        (
            "narrow_search",
            "found.free_until = high;",
            "found.free_until = high + length;",
        ),
        (
            "narrow_search",
            "if bracket.is_left && slot",
            "if bracket.is_left && lane != 7u && slot",
        ),
        (
            "narrow_search",
            "PairTimes(time_of(bracket.free_until),",
            "PairTimes(time_of(bracket.free_until + TICKS / 2u),",
        ),
        (
            "narrow_search",
            "first_slot = reserve(counter, atomicLoad(&n_entries));",
            "first_slot = reserve(counter, atomicLoad(&n_entries) / 2u);",
        ),
        // What is certain of contact: the sign of f changes, and all edges are passed on the inner
        // side.
        (
            "narrow_search",
            "let touches = (falls || rises) &&",
            "let touches =",
        ),
        (
            "narrow_search",
            "let rises = f_0 < -bound &&",
            "let rises = f_0 <= 0.0 &&",
        ),
        (
            "narrow_search",
            "&& f_3 < -bound && (f_1 > inner || f_2 < -inner);",
            "&& f_3 < -bound;",
        ),
        (
            "narrow_search",
            "&& all(sides.are_inside);",
            "&& !any(sides.are_outside);",
        ),
        (
            "narrow_search",
            "let are_inside = (min(w_0, w_4) > bound)",
            "let are_inside = (max(w_0, w_4) > bound)",
        ),
        (
            "narrow_search",
            "> bound) & (min(w_1, w_3) > next) & (w_2 > middle);",
            "> bound);",
        ),
        // What follows from it.
        (
            "narrow_search",
            "bitcast<u32>(time_of(high))",
            "bitcast<u32>(time_of(low))",
        ),
        (
            "narrow_search",
            "select(found.touches_by, first, params.sought == SEEK_EARLIEST)",
            "first",
        ),
        (
            "narrow_search",
            "if params.sought == SEEK_ANY && first != NONE {",
            "if first != NONE {",
        ),
        (
            "narrow_search",
            "if params.sought == SEEK_ANY && first != NONE {",
            "if params.sought == SEEK_ANY {",
        ),
        (
            "narrow_search",
            "let a = pair.low & ~FLAG;",
            "let a = pair.low;",
        ),
    ] {
        assert!(is_noticed(&scenes, damage), "{damage:?}");
    }
}

/// Edges without faces, with much contact.
fn many_edges() -> Scene {
    let mut random = Random::new(77);
    let mut scene = Scene::new();
    let edges: Vec<[u32; 2]> = (0..150).map(|v| [v, (v + 3) % 150]).collect();
    let hair = scene
        .add_edges(&edges, &lattice::<f32>(&mut random, 150, 5))
        .expect("good");
    let end = lattice::<f32>(&mut random, 150, 5);
    scene.set_end_positions(hair, &end).expect("good");
    scene
}
