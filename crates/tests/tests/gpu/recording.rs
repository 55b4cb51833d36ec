//! Passes as data: printed, and run launch by launch, which finds the kernel that goes wrong.

use crate::caller::Caller;

use impinge_core::gpu::recording::Ran;
use impinge_core::{Backend, BodyId, Detector, Method, Positions, Query, Scene, Settings};
use impinge_scenes::{Random, soup, surfaces};

/// Two balls that overlap, of which one moves.
fn balls() -> Scene {
    let mut scene = Scene::new();
    let ball = surfaces::ball(3000);
    let other = ball.translated([0.9, 0.0, 0.0]);
    ball.add_to(&mut scene).expect("good");
    let moving = other.add_to(&mut scene).expect("good");
    let end = other.translated([0.1, 0.2, 0.0]).positions;
    scene.set_end_positions(moving, &end).expect("as many");
    scene
}

/// A question about two balls.
type Ask = fn(&mut Detector, &Scene);

const PAIRS: Ask = |detector, scene| {
    // A damaged kernel may make any error.
    let _ = detector.detect(scene, &Query::between_all());
};

const IMPACTS: Ask = |detector, scene| {
    let _ = detector.impacts(scene, &Query::all());
};

/// The first launch that writes something else than it does with good kernels.
fn first_wrong(settings: &Settings, ask: Ask, damage: (&str, &str, &str)) -> Option<String> {
    let scene = balls();
    let harmless = (damage.0, damage.1, damage.1);
    let [good, bad] = [harmless, damage].map(|damage| {
        let mut detector = Caller::new().damaged(settings.clone(), damage);
        detector.trace(true);
        ask(&mut detector, &scene);
        detector
    });
    let [good, bad] = [good.ran(), bad.ran()];
    assert_eq!(names(good), names(bad));
    assert!(!good.is_empty());
    let mut launches = good.iter().zip(bad);
    let wrong = launches.find(|(good, bad)| good.written != bad.written);
    wrong.map(|(good, _)| good.kernel.to_owned())
}

fn names(ran: &[Ran]) -> Vec<&'static str> {
    ran.iter().map(|launch| launch.kernel).collect()
}

#[test]
fn the_launch_that_goes_wrong_is_found() {
    let still = [
        (
            "bounds_clusters",
            "high = max(high, highs[ix]);",
            "high = highs[ix];",
        ),
        (
            "bounds_top",
            "high = max(high, nodes[child].high);",
            "high = nodes[child].high;",
        ),
        (
            "traversal",
            "if !extents_meet(node_extent(pair.a), node_extent(pair.b)) {",
            "if extents_meet(node_extent(pair.a), node_extent(pair.b)) {",
        ),
        (
            "narrow",
            "atomicAdd(&counters[counter], n);",
            "atomicAdd(&counters[counter], n - 1u);",
        ),
        (
            "prepare",
            "n / per_group + select(0u, 1u, n % per_group != 0u);",
            "n / per_group;",
        ),
    ];
    let settings = Settings::default();
    for damage in still {
        let found = first_wrong(&settings, PAIRS, damage);
        assert_eq!(found.as_deref(), Some(damage.0));
        let harmless = (damage.0, damage.1, damage.1);
        assert_eq!(first_wrong(&settings, PAIRS, harmless), None);
    }
    for damage in [
        (
            "narrow_moving",
            "return decide(pair.polygon, pair.sizes, pair.are_edges) != FREE;",
            "return true;",
        ),
        (
            "narrow_search",
            "found.touches_by = high;",
            "found.touches_by = low;",
        ),
    ] {
        let found = first_wrong(&settings, IMPACTS, damage);
        assert_eq!(found.as_deref(), Some(damage.0));
    }
}

#[test]
fn recordings_are_printed_one_line_per_launch() {
    let scene = balls();
    for method in [Method::Clusters, Method::Cells] {
        let settings = Settings::new().method(method).backend(Backend::Gpu);
        let mut detector = Detector::new(settings).expect("an adapter");
        let asks: [Ask; 2] = [PAIRS, IMPACTS];
        let [still, moving] = asks.map(|ask| {
            ask(&mut detector, &scene);
            detector.recording().expect("a device").to_string()
        });
        let kernels = |text: &str| -> Vec<String> {
            let lines = text.lines().filter(|line| line.contains(" x "));
            lines
                .map(|line| line.split_whitespace().nth(1).unwrap_or("").to_owned())
                .collect()
        };
        let of_method: &[&str] = match method {
            Method::Clusters => &[
                "bounds_clusters",
                "traversal",
                "prepare",
                "pairing",
                "narrow",
            ],
            _ => &[
                "bounds_keep",
                "grid_count",
                "traversal_scatter",
                "pairing_cells",
            ],
        };
        for kernel in of_method {
            assert!(kernels(&still).iter().any(|name| name == kernel), "{still}");
        }
        let last = kernels(&moving).pop();
        assert_eq!(last.as_deref(), Some("narrow_search"), "{moving}");
        for (text, reads) in [
            (&still, "counters, grid, pairs, unsure"),
            (&moving, "times of pairs"),
        ] {
            let last = text.lines().last().unwrap_or("");
            assert!(last.contains("read") && last.contains(reads), "{text}");
        }
    }
}

#[test]
fn parts_and_positions_are_on_the_device_once() {
    let scene = balls();
    let held = |asks: &[Ask]| {
        let settings = Settings::new().backend(Backend::Gpu);
        let mut detector = Detector::new(settings).expect("an adapter");
        for ask in asks {
            ask(&mut detector, &scene);
        }
        detector.bytes_on_device()
    };
    let [still, moving] = [held(&[PAIRS]), held(&[IMPACTS])];
    for asks in [
        &[PAIRS, IMPACTS][..],
        &[IMPACTS, PAIRS],
        &[PAIRS, IMPACTS, PAIRS],
    ] {
        let both = held(asks);
        // A frame adds its records: a step has all else.
        assert!(
            both >= moving && both < moving + still / 50,
            "{both}, {moving} for a step, {still} for a frame"
        );
    }
}

/// Tetrahedra, triangles in f64, and boxes: so many bodies that there is a tree over them, some of
/// which move.
fn mixed() -> (Scene, Vec<BodyId>) {
    let mut scene = Scene::new();
    let mut random = Random::new(5);
    let mut bodies = Vec::new();
    let soup = soup::lattice_tetrahedra(40, 6, 5).scaled(0.4);
    bodies.push(soup.add_to(&mut scene).expect("good"));
    let ball = surfaces::ball(1200).scaled(2.0);
    let positions: Vec<[f64; 3]> = ball
        .positions
        .iter()
        .map(|at| at.map(|x| f64::from(x) + 1.0 / 3.0))
        .collect();
    let faces: Vec<[u32; 3]> = (0..ball.n_elements())
        .map(|ix| {
            let corners = ball.elements.corners(ix);
            [corners[0], corners[1], corners[2]]
        })
        .collect();
    bodies.push(scene.add_triangles(&faces, &positions).expect("good"));
    for ix in 0..20 {
        let model = surfaces::cube(random.point(-1.0, 2.0), 0.5);
        let body = model.add_to(&mut scene).expect("good");
        if ix % 3 != 0 {
            let end = model.translated(random.point(-1.0, 1.0)).positions;
            scene.set_end_positions(body, &end).expect("good");
        }
        bodies.push(body);
    }
    (scene, bodies)
}

#[test]
fn frames_and_steps_take_turns() {
    for method in [Method::Clusters, Method::Cells] {
        let [mut device, mut host] = [Backend::Gpu, Backend::Cpu].map(|backend| {
            let settings = Settings::new().method(method).backend(backend);
            Detector::new(settings).expect("an adapter")
        });
        let (mut scene, bodies) = mixed();
        let some = Query::between_all().exclude((bodies[2], bodies[3]));
        let two = Query::between(bodies[0], bodies[1]);
        let mut n = [0; 2];
        for turn in 0..8 {
            let query = match turn % 4 {
                0 => Query::all(),
                1 => Query::between_all(),
                2 => some.clone(),
                _ => two.clone(),
            };
            if turn != 3 {
                let [found, expected] = [&mut device, &mut host].map(|detector| {
                    let pairs = detector.detect(&scene, &query).expect("good");
                    (pairs.len(), pairs.hash())
                });
                assert_eq!(found, expected, "{method:?}, turn {turn}");
                n[0] += found.0;
            }
            if turn != 4 {
                let step = query;
                let [found, expected] = [&mut device, &mut host].map(|detector| {
                    let impacts = detector.impacts(&scene, &step).expect("good");
                    (impacts.len(), impacts.hash())
                });
                assert_eq!(found, expected, "{method:?}, turn {turn}");
                n[1] += found.0;
            }
            if turn % 2 == 0 {
                // Every box moves a little, some back to where they were.
                for &body in &bodies[2..] {
                    let at = scene.body(body).expect("there").positions().clone();
                    let by = [0.1, -0.05, 0.2][turn / 2 % 3];
                    let Positions::F32(at) = at else {
                        panic!("boxes are f32");
                    };
                    let moved: Vec<_> = at.iter().map(|&[x, y, z]| [x + by, y, z]).collect();
                    scene.set_positions(body, &moved).expect("as many");
                }
            }
        }
        assert!(n[0] > 100 && n[1] > 100, "{n:?}");
    }
}
