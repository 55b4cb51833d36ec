//! Steps on the GPU backend against the CPU: every pair, every time to the last bit.
//!
//! These tests fail where no adapter is found; a software driver is enough.
#![cfg(feature = "gpu")]

use std::sync::{Mutex, OnceLock};

use impinge_core::{
    Backend, BodyId, CancelToken, Capacities, Control, Detector, Error, Impact, Method, PairKind,
    Query, Real, Recluster, Scene, Settings, Start, Step, Toi, wgpu,
};
use impinge_scenes::{Random, solids, soup, surfaces};

fn gpu() -> Settings {
    static OPEN: OnceLock<Mutex<Detector>> = OnceLock::new();
    OPEN.get_or_init(|| {
        let open = Detector::new(Backend::Gpu);
        Mutex::new(open.expect("these tests need a GPU or a software driver"))
    });
    Settings {
        backend: Backend::Gpu,
        ..Settings::default()
    }
}

fn on_gpu() -> Detector {
    Detector::with_settings(gpu()).expect("settings")
}

fn on_cpu() -> Detector {
    Detector::new(Backend::Cpu).expect("settings")
}

/// Asserts that both answer a step alike, the first one on its device. Returns the number of impacts.
fn assert_alike(name: &str, device: &mut Detector, scene: &Scene, step: &Step) -> usize {
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
    assert_ne!(device.step_stats().backend, "cpu", "{name}");
    let is_free = device.is_free(scene, step).expect(name);
    assert_eq!(is_free, expected.is_empty(), "{name}");
    expected.len()
}

/// Points of a lattice of n^3 cells.
fn lattice<R: From<f32>>(random: &mut Random, n_points: usize, n: u32) -> Vec<[R; 3]> {
    let mut at = || R::from(random.below(n + 1) as f32);
    (0..n_points).map(|_| [at(), at(), at()]).collect()
}

/// Triangles that share some of their vertices.
fn faces(n_points: usize) -> Vec<[u32; 3]> {
    let n = n_points as u32;
    (0..n / 3)
        .map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % n])
        .collect()
}

/// Adds a body of random triangles on a lattice, which moves to other points of it.
fn add_web<R: Real + From<f32>>(
    scene: &mut Scene,
    random: &mut Random,
    n: usize,
    side: u32,
) -> BodyId
where
    impinge_core::Positions: From<Vec<[R; 3]>>,
{
    let start: Vec<[R; 3]> = lattice(random, n, side);
    let body = scene.add(faces(n), start).expect("good");
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
                Step::default(),
                Step::default().start(Start::Skip).toi(Toi::F64),
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
            let body = scene.add(faces(n), start).expect("good");
            scene.set_end_positions(body, &end).expect("good");
            let name = format!("flat {seed}");
            assert_alike(&name, &mut device, &scene, &Step::default());
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
    bodies.push(scene.add(faces(30), still).expect("good"));
    (scene, bodies)
}

#[test]
fn several_bodies_meet_as_the_query_and_their_filters_say() {
    let (mut scene, bodies) = five_bodies();
    let [a, b, c, ..] = bodies[..] else {
        panic!("five");
    };
    let queries = [
        Query::everything(),
        Query::all(),
        Query::all_within(),
        Query::within(b),
        Query::between(c, a),
        Query::everything().ignore(a, b).ignore(c, c),
        Query::all().ignore(b, c),
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
            let step = Step::new(query.clone());
            counts.push(assert_alike(&name, &mut device, &scene, &step));
        }
    }
    counts.dedup();
    assert!(counts.len() > 9, "the questions differ: {counts:?}");
}

#[test]
fn edges_and_points_are_answered_alike() {
    let mut device = on_gpu();
    let mut kinds = [0; 6];
    for seed in 0..6 {
        let mut random = Random::new(200 + seed);
        let mut scene = Scene::new();
        // Points and edges of a tiny lattice, so that they meet.
        for is_double in [false, true] {
            let n = 40;
            let edges: Vec<[u32; 2]> = (0..n - 1).step_by(2).map(|v| [v, (v + 3) % n]).collect();
            let n = n as usize;
            if is_double {
                let points = scene
                    .add_points(&lattice::<f64>(&mut random, n, 3))
                    .expect("good");
                let end = lattice::<f64>(&mut random, n, 3);
                scene.set_end_positions(points, &end).expect("good");
                let hair = scene.add_edges(&edges, &lattice::<f64>(&mut random, n, 3));
                let end = lattice::<f64>(&mut random, n, 3);
                scene
                    .set_end_positions(hair.expect("good"), &end)
                    .expect("good");
            } else {
                let points = scene
                    .add_points(&lattice::<f32>(&mut random, n, 3))
                    .expect("good");
                let end = lattice::<f32>(&mut random, n, 3);
                scene.set_end_positions(points, &end).expect("good");
                let hair = scene.add_edges(&edges, &lattice::<f32>(&mut random, n, 3));
                let end = lattice::<f32>(&mut random, n, 3);
                scene
                    .set_end_positions(hair.expect("good"), &end)
                    .expect("good");
            }
        }
        add_web::<f32>(&mut scene, &mut random, 30, 3);
        for query in [Query::everything(), Query::all(), Query::all_within()] {
            let name = format!("bare {seed} {query:?}");
            assert_alike(&name, &mut device, &scene, &Step::new(query));
        }
        let impacts = device.impacts(&scene, &Step::default()).expect("good");
        for impact in impacts {
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
fn balls(n: usize) -> Scene {
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
    for step in [Step::default(), Step::new(Query::all()).toi(Toi::F64)] {
        assert!(assert_alike("balls", &mut device, &scene, &step) > 100);
    }
    let impacts = device.impacts(&scene, &Step::default()).expect("good");
    let on_device = impacts.stats().clone();
    let mut cpu = on_cpu();
    let impacts = cpu.impacts(&scene, &Step::default()).expect("good");
    let stats = impacts.stats();
    assert_eq!(
        on_device.n_candidates, stats.n_candidates,
        "boxes decide exactly"
    );
    assert_eq!(on_device.n_clusters, stats.n_clusters);
    let (n, n_left) = (on_device.n_candidates, on_device.n_unsure);
    assert!(n_left < n / 2, "{n_left} of {n} are left to the CPU");
    for stage in ["clustering", "upload", "settle", "collect"] {
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
    assert!(assert_alike("tetrahedra", &mut device, &scene, &Step::default()) > 10);
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
    let all = Query::all();
    let pairs = bodies.iter().zip(&bodies[1..]);
    let some = pairs.fold(all.clone(), |query, (&a, &b)| query.ignore(a, b));
    let counts = [Query::everything(), all, some].map(|query| {
        let step = Step::new(query);
        assert_alike("boxes", &mut device, &scene, &step)
    });
    assert!(
        counts[0] == counts[1] && counts[1] > counts[2] && counts[2] > 100,
        "{counts:?}"
    );
    let within = Step::new(Query::all_within());
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
            let body = scene.add(faces(n), start).expect("good");
            scene.set_end_positions(body, &end).expect("good");
            let name = format!("2^{exponent} + {shift}");
            assert_alike(&name, &mut device, &scene, &Step::default());
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
            let body = scene.add(faces(n), start).expect("good");
            scene.set_end_positions(body, &end).expect("good");
            let name = format!("f64 2^{exponent} + {shift}");
            assert_alike(&name, &mut device, &scene, &Step::default());
        }
    }
}

#[test]
fn one_detector_answers_step_after_step() {
    let mut device = on_gpu();
    let (mut scene, bodies) = five_bodies();
    let others = balls(400);
    let mut random = Random::new(3);
    let step = Step::default();
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
        .remesh(bodies[2], faces(45), end[..45].to_vec())
        .expect("good");
    assert_alike("re-meshed", &mut device, &scene, &step);
    scene.remove(bodies[1]).expect("known");
    assert_alike("removed", &mut device, &scene, &step);
    // Intersections use other buffers of the same device.
    let pairs = device
        .detect(&scene, &Query::everything())
        .expect("good")
        .clone();
    let expected = on_cpu()
        .detect(&scene, &Query::everything())
        .expect("good")
        .hash();
    assert_eq!(pairs.hash(), expected);
    assert_alike("after pairs", &mut device, &scene, &step);
    let empty = Scene::new();
    assert!(device.is_free(&empty, &step).expect("good"));
    assert_alike("after nothing", &mut device, &scene, &step);
}

#[test]
fn rooms_that_are_too_small_grow() {
    let scene = balls(1500);
    let step = Step::default();
    let expected = on_cpu().impacts(&scene, &step).expect("good").hash();
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
        let impacts = device.impacts(&scene, &step).expect("good");
        assert_eq!(impacts.hash(), expected, "{name}");
        assert_eq!(impacts.stats().n_reruns, 0, "{name} has grown");
    }
}

#[test]
fn a_memory_budget_is_kept_in_slabs_or_by_the_cpu() {
    // Large triangles in a small room.
    let mut random = Random::new(5);
    let n = 900;
    let start = Vec::from_iter((0..n).map(|_| random.point(0.0, 1.0)));
    let end = start.iter().map(|p| p.map(|x| x + random.range(0.0, 0.01)));
    let end = Vec::from_iter(end);
    let mut scene = Scene::new();
    let body = scene.add(faces(n), start).expect("good");
    scene.set_end_positions(body, &end).expect("good");
    let step = Step::default();
    let expected = on_cpu().impacts(&scene, &step).expect("good").hash();
    let mut backends = Vec::new();
    for budget in (4..80).step_by(3).map(|n| n * 100_000) {
        let settings = Settings {
            memory_budget: Some(budget),
            threads: 1,
            ..gpu()
        };
        let mut device = Detector::with_settings(settings).expect("settings");
        match device.impacts(&scene, &step) {
            Ok(impacts) => {
                assert_eq!(impacts.hash(), expected, "{budget}");
                let stats = impacts.stats();
                backends.push((budget, stats.backend != "cpu", stats.n_slabs));
            }
            Err(Error::MemoryBudget { .. }) => assert!(budget < 2_500_000, "{budget}"),
            Err(error) => panic!("{error}"),
        }
    }
    assert!(
        backends
            .iter()
            .any(|&(_, on_device, n_slabs)| on_device && n_slabs > 1),
        "{backends:?}"
    );
    assert!(
        backends
            .iter()
            .any(|&(_, on_device, n_slabs)| on_device && n_slabs == 1),
        "{backends:?}"
    );
}

#[test]
fn what_the_device_cannot_hold_or_answer_the_cpu_does() {
    let scene = balls(1500);
    let expected = on_cpu()
        .impacts(&scene, &Step::default())
        .expect("good")
        .hash();
    let mut device = Detector::with_most_bound(gpu(), 20_000).expect("settings");
    let impacts = device.impacts(&scene, &Step::default()).expect("good");
    assert_eq!(
        (impacts.hash(), &*impacts.stats().backend),
        (expected, "cpu")
    );
    let apart = Step::default().separation(0.001);
    let expected = on_cpu().impacts(&scene, &apart).expect("good").hash();
    let mut device = on_gpu();
    let impacts = device.impacts(&scene, &apart).expect("good");
    assert_eq!(
        (impacts.hash(), &*impacts.stats().backend),
        (expected, "cpu")
    );
}

#[test]
fn a_body_that_flows_away_from_its_clusters_is_clustered_again() {
    let mut scene = Scene::new();
    let cloth = surfaces::cloth(40, 40, 1.0);
    let body = cloth.add_to(&mut scene).expect("good");
    let mut devices = [Recluster::Auto, Recluster::Never].map(|recluster| {
        Detector::with_settings(Settings { recluster, ..gpu() }).expect("settings")
    });
    let step = Step::default();
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
    let step = Step::default().start(Start::Skip);
    let expected = on_cpu().advance(&scene, &step).expect("good");
    let found = on_gpu().advance(&scene, &step).expect("good");
    assert_eq!(
        (found.fraction, found.first),
        (expected.fraction, expected.first)
    );
    assert_eq!(found.positions, expected.positions);
}

#[test]
fn limits_and_cancellation_end_a_step() {
    let scene = balls(400);
    let settings = Settings {
        max_pairs: Some(10),
        ..gpu()
    };
    let mut device = Detector::with_settings(settings).expect("settings");
    let refused = device.impacts(&scene, &Step::default()).err();
    assert!(
        matches!(refused, Some(Error::TooManyPairs { limit: 10, .. })),
        "{refused:?}"
    );
    let token = CancelToken::new();
    token.cancel();
    let control = Control::new().cancel(&token);
    let mut device = on_gpu();
    let stopped = device
        .impacts_with(&scene, &Step::default(), &control)
        .err();
    assert_eq!(stopped, Some(Error::Cancelled));
    assert_alike("after that", &mut device, &scene, &Step::default());
}

/// Every instruction set and number of threads settles the same.
#[test]
fn threads_and_methods_do_not_matter() {
    let scene = balls(800);
    let expected = on_cpu()
        .impacts(&scene, &Step::default())
        .expect("good")
        .hash();
    for (threads, method) in [(1, Method::Auto), (3, Method::Cells), (2, Method::Clusters)] {
        let settings = Settings {
            threads,
            method,
            ..gpu()
        };
        let mut device = Detector::with_settings(settings).expect("settings");
        let impacts = device.impacts(&scene, &Step::default()).expect("good");
        assert_eq!(impacts.hash(), expected);
        assert_eq!(impacts.stats().n_threads, threads);
    }
}

fn device() -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::default();
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()));
    let adapter = adapter.expect("these tests need an adapter");
    pollster::block_on(adapter.request_device(&Default::default())).expect("a device")
}

/// The hash of a step's impacts, and the earliest one.
type Answers = Result<(u64, Option<Impact>), Error>;

/// The answers about some steps, on a device one of whose kernels has one line replaced.
fn damaged(steps: &[(Scene, Step)], damage: (&str, &str, &str)) -> Vec<Answers> {
    let (open, queue) = device();
    let device = Detector::with_damage(open, queue, Settings::default(), damage);
    let mut device = device.expect("a line");
    let ask = |(scene, step): &(Scene, Step)| answers(&mut device, scene, step);
    steps.iter().map(ask).collect()
}

fn answers(detector: &mut Detector, scene: &Scene, step: &Step) -> Answers {
    let hash = detector.impacts(scene, step)?.hash();
    Ok((hash, detector.earliest(scene, step)?))
}

#[test]
fn damaged_kernels_are_noticed() {
    let (boxes, ids) = many_bodies();
    let pairs = ids.iter().zip(&ids[1..]);
    let some = pairs.fold(Query::all(), |query, (&a, &b)| query.ignore(a, b));
    let scenes = [
        (balls(6000), Step::default()),
        (five_bodies().0, Step::default()),
        (many_edges(), Step::default()),
        (boxes, Step::new(some)),
    ];
    let truth = scenes
        .each_ref()
        .map(|(scene, step)| Ok(answers(&mut on_cpu(), scene, step).expect("good")));
    for harmless in [
        ("dispatch_moving", "let a_first =", "let  a_first ="),
        // A device that drops nothing is slow, not wrong.
        (
            "narrow_moving",
            "return !never_touch(&polygon, &sizes, pair.are_edges);",
            "return true;",
        ),
        ("narrow_search", "n < N_INTERVALS;", "n < 0u;"),
    ] {
        assert_eq!(damaged(&scenes, harmless), truth, "{harmless:?}");
    }
    for damage in [
        (
            "bounds_clusters_moving",
            "let end = ix / n_clusters;",
            "let end = 0u;",
        ),
        ("bounds_top_moving", "end < ENDS; end++", "end < 1u; end++"),
        (
            "dispatch_moving",
            "return !any(a_first | b_first);",
            "return !any(a_first | b_first | (a.start.high < b.start.low));",
        ),
        ("dispatch_moving", "return part_a == EDGES ||", "return"),
        (
            "dispatch_moving",
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
            "(bodies[a.body].layer & PART) == EDGES",
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
            "return least > bound || most < -bound;",
            "return least > -1.0 || most < -bound;",
        ),
        (
            "narrow_moving",
            "if min(f_0, f_3) > bound && min(f_1, f_2) > inner {",
            "if f_0 > bound {",
        ),
        (
            "narrow_moving",
            "opposite(second), w_bound);",
            "second, w_bound);",
        ),
        (
            "narrow_moving",
            "first_left = reserve(N_PAIRS, atomicLoad(&n_left));",
            "first_left = reserve(N_PAIRS, atomicLoad(&n_left) / 2u);",
        ),
        (
            "narrow_search",
            "d.start * (1.0 - time)",
            "d.end * (1.0 - time)",
        ),
        (
            "narrow_search",
            "Moving(at(d, low), at(d, high))",
            "Moving(at(d, high), at(d, high))",
        ),
        ("narrow_search", "if high == 1.0 {", "if high >= 0.5 {"),
        ("narrow_search", "low = high;", "low = high + length;"),
        (
            "narrow_search",
            "let is_left = time <= 1.0;",
            "let is_left = time <= 0.25;",
        ),
        (
            "narrow_search",
            "times[place] = time;",
            "times[place] = time + 0.5;",
        ),
        (
            "narrow_search",
            "first_unsure = reserve(N_UNSURE, atomicLoad(&n_unsure));",
            "first_unsure = reserve(N_UNSURE, atomicLoad(&n_unsure) / 2u);",
        ),
        (
            "narrow_search",
            "let a = pair.low & ~FLAG;",
            "let a = pair.low;",
        ),
    ] {
        assert_ne!(damaged(&scenes, damage), truth, "{damage:?}");
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
