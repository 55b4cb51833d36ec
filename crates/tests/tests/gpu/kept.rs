//! Steps whose elements keep a distance, on the device: a separation, and their thickness.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use crate::caller::Caller;
use crate::resident_steps::{Listed, listed, numbers, numbers_of};
use crate::steps::{add_web, assert_alike, balls};

use impinge_core::{Backend, Detector, Precision, Query, Scene, Settings, Start, Thickness};
use impinge_scenes::{Random, surfaces};

/// How far the elements of a step may be from each other for it to matter.
fn inflation(scene: &Scene, separation: f64) -> f64 {
    let thickest = scene.bodies().map(|(_, body)| body.thickness());
    separation / 2.0 + thickest.fold(0.0, f64::max)
}

/// Asserts that a list has every impact of a step, not before it may happen, and nothing that is
/// always far away. Returns the numbers of impacts, of pairs in the list, and of impacts whose time
/// is known to a 256th of the step.
fn assert_kept(
    name: &str,
    (scene, query, separation): (&Scene, &Query, f64),
    (found, pairs): (&impinge_core::ResidentStep, &Listed),
) -> [usize; 3] {
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let impacts = cpu.impacts(scene, query).expect(name).clone();
    let mut n_near = 0;
    for impact in &impacts {
        let elements = [impact.a, impact.b].map(|at| (at.body, at.element));
        let times = pairs.get(&numbers(found, impact.kind, elements));
        let [until, by] = *times.unwrap_or_else(|| panic!("{name}: {impact:?} is missing"));
        assert!(f64::from(until) <= impact.toi, "{name}: {until} {impact:?}");
        assert!(
            until == 0.0 || !impact.at_start,
            "{name}: {until} {impact:?}"
        );
        assert_eq!(by, 2.0, "{name}: no contact is certain");
        n_near += usize::from(impact.toi - f64::from(until) < 1.0 / 256.0);
    }
    let thin = query.clone().separation(0.0);
    // Boxes reach a little farther, beyond what is flushed, and as far as positions were rounded.
    let positions = scene.bodies().map(|(_, body)| body.positions());
    let coordinates = positions.flat_map(|all| (0..all.len()).flat_map(|ix| all.point(ix)));
    let largest = coordinates.fold(0.0f64, |most, x| most.max(x.abs()));
    let inflation =
        1.001 * inflation(scene, separation) + largest * 2f64.powi(-20) + 2f64.powi(-99);
    let candidates = cpu.candidates(scene, inflation, &thin).expect(name);
    let candidates = numbers_of(found, &candidates);
    let are_candidates = pairs.keys().all(|pair| candidates.contains(pair));
    assert!(are_candidates, "{name}");
    [impacts.len(), pairs.len(), n_near]
}

/// Gives the bodies of a scene a thickness each, or of each vertex, edge or face, or none; which of
/// these is told by a number. Returns whether any is thick.
fn thicken(scene: &mut Scene, random: &mut Random, most: f64, by: usize) -> bool {
    let bodies = Vec::from_iter(scene.bodies().map(|(body, held)| {
        let n = [held.n_vertices(), held.edges().len(), held.faces().len()];
        (body, n)
    }));
    for (body, n) in bodies {
        let mut each = |n: usize| {
            let any = || most * f64::from(random.unit());
            Vec::from_iter(std::iter::repeat_with(any).take(n))
        };
        let thickness = match ((n[0] + by) % 3, by % 3) {
            (0, _) => each(1)[0].into(),
            (1, 0) => Thickness::vertices(each(n[0])),
            (1, 1) => Thickness::edges(each(n[1])),
            (1, _) => Thickness::faces(each(n[2])),
            _ => 0.0.into(),
        };
        scene.set_thickness(body, thickness).expect("good");
    }
    scene.bodies().any(|(_, body)| body.thickness() > 0.0)
}

/// Small bodies of every kind that move: on a lattice, where much is degenerate, or at random.
fn small(seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let mut points = |n: usize| -> Vec<[f64; 3]> {
        let point = |_| match seed % 2 {
            0 => [0; 3].map(|_| f64::from(random.below(4))),
            _ => random.point(-1.0, 1.0).map(f64::from),
        };
        (0..n).map(point).collect()
    };
    let n_points = [9, 5, 7, 6];
    let starts = n_points.map(&mut points);
    let ends = n_points.map(&mut points);
    let mut scene = Scene::new();
    let bodies = [
        scene.add_triangles(&[[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 5]], &starts[0]),
        scene.add_tetrahedra(&[[0, 1, 2, 3]], &starts[1]),
        scene.add_edges(&[[0, 1], [1, 2], [3, 4], [5, 5]], &starts[2]),
        scene.add_points(&starts[3]),
    ];
    for (ix, (body, ends)) in bodies.into_iter().zip(&ends).enumerate() {
        if (seed + ix as u64) % 4 != 3 {
            let body = body.expect("good");
            scene.set_end_positions(body, ends).expect("good");
        }
    }
    scene
}

#[test]
fn steps_whose_elements_keep_a_distance_are_answered_alike() {
    let caller = Caller::new();
    let mut device = caller.detector(Settings::default());
    let (mut totals, mut n_steps) = ([0; 3], 0);
    let mut check = |name: &str, scene: &Scene, separation: f64| {
        let query = Query::all().separation(separation);
        let (found, pairs, _) = listed(&caller, &mut device, scene, &query, [&[], &[]]);
        let own = assert_kept(name, (scene, &query, separation), (&found, &pairs));
        for (total, own) in totals.iter_mut().zip(own) {
            *total += own;
        }
        assert_eq!(assert_alike(name, &mut device, scene, &query), own[0]);
        let later = query.start(Start::Skip).precision(Precision::F64);
        assert_alike(name, &mut device, scene, &later);
        // Another question between two of them, with narrower boxes.
        if n_steps % 4 == 0 {
            assert_alike(name, &mut device, scene, &Query::all());
        }
        n_steps += 1;
        own
    };
    for seed in 0..12 {
        let mut random = Random::new(seed + 100);
        let mut scene = small(seed);
        let separation = [0.0, 0.25, 1.0][seed as usize % 3];
        let by = seed as usize + seed as usize / 3;
        if separation == 0.0 || seed % 2 == 0 {
            thicken(&mut scene, &mut random, 0.2, by);
        }
        check(&format!("small {seed}"), &scene, separation);
        let mut scene = Scene::new();
        match seed % 2 {
            0 => add_web::<f32>(&mut scene, &mut random, 60, 7),
            _ => add_web::<f64>(&mut scene, &mut random, 60, 7),
        };
        if separation == 0.0 {
            let is_thick = (by..by + 9).any(|by| thicken(&mut scene, &mut random, 0.5, by));
            assert!(is_thick);
        }
        check(&format!("web {seed}"), &scene, separation);
    }
    let scene = balls(1500);
    let thin = check("balls", &scene, 0.01);
    let mut thick = scene.clone();
    for (body, _) in scene.bodies() {
        thick.set_thickness(body, 0.005).expect("good");
    }
    assert_eq!(check("thick balls", &thick, 0.0)[0], thin[0]);
    let [n_impacts, n_left, n_near] = thin;
    assert!(n_impacts > 200, "{n_impacts}");
    assert!(
        n_left < n_impacts + n_impacts / 4,
        "{n_left} of {n_impacts}"
    );
    assert!(n_near > n_impacts * 3 / 4, "{n_near} of {n_impacts}");
    assert!(totals[0] > 3000, "{totals:?}");
}

/// Frames and steps share nodes: boxes that one has widened are not those of the other.
#[test]
fn frames_between_steps_that_keep_a_distance_change_nothing() {
    let caller = Caller::new();
    let mut device = caller.detector(Settings::default());
    let mut scene = Scene::new();
    let low = surfaces::cloth(20, 20, 1.0);
    low.add_to(&mut scene).expect("good");
    let high = low.mapped(|[x, y, z]| [x, y, z + 0.1]);
    let body = high.add_to(&mut scene).expect("good");
    let end = high.mapped(|[x, y, z]| [x, y, z + 1.0]);
    scene.set_end_positions(body, &end.positions).expect("good");
    let kept = Query::all().separation(0.15);
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let mut expected = |query: &Query| cpu.impacts(&scene, query).expect("good").hash();
    let of_kept = (expected(&kept), expected(&Query::all()));
    for round in 0..3 {
        assert!(!device.any(&scene, &Query::all()).expect("good"));
        let (found, pairs, _) = listed(&caller, &mut device, &scene, &kept, [&[], &[]]);
        assert_kept("after a frame", (&scene, &kept, 0.15), (&found, &pairs));
        assert!(!device.any(&scene, &Query::all()).expect("good"));
        for query in [&kept, &Query::all(), &kept] {
            let impacts = device.impacts(&scene, query).expect("good");
            assert_ne!(impacts.stats().backend, "cpu");
            let is_kept = *query == kept;
            let expected = if is_kept { of_kept.0 } else { of_kept.1 };
            assert_eq!(impacts.hash(), expected, "{round} {is_kept}");
        }
        assert!(!device.any(&scene, &Query::all()).expect("good"));
        assert_eq!(
            device.impacts(&scene, &kept).expect("good").hash(),
            of_kept.0
        );
        assert!(!device.is_free(&scene, &kept).expect("good"));
    }
}

#[test]
fn distances_near_the_limits_of_numbers_are_kept() {
    let caller = Caller::new();
    let mut device = caller.detector(Settings::default());
    let mut n_impacts = 0;
    for (scale, offset, separation) in [
        (1.0, 0.0, 1e-300),
        (1.0, 0.0, 1e-30),
        (1.0, 0.0, 1e-7),
        (1.0, 0.0, 1e9),
        // Rounding to single precision is as large as what is kept, or larger.
        (1.0, 1e6 + 0.123, 0.06),
        (0.37, 3e7, 0.01),
        (2f64.powi(-100), 0.0, 2f64.powi(-103)),
        (2f64.powi(39), 0.0, 2f64.powi(36)),
        (2f64.powi(60), 0.0, 2f64.powi(57)),
        (2f64.powi(110), 0.0, 2f64.powi(90)),
    ] {
        for seed in 0..3 {
            let mut scene = small(seed);
            let bodies = Vec::from_iter(scene.bodies().map(|(body, _)| body));
            for body in bodies {
                let held = scene.body(body).expect("held");
                let of = |at: &impinge_core::Positions| -> Vec<[f64; 3]> {
                    (0..at.len())
                        .map(|ix| at.point(ix).map(|x| x * scale + offset))
                        .collect()
                };
                let (start, end) = (of(held.positions()), held.end_positions().map(of));
                scene.set_positions(body, &start).expect("good");
                if let Some(end) = end {
                    scene.set_end_positions(body, &end).expect("good");
                }
            }
            let name = format!("{scale} {offset} {separation} {seed}");
            let query = Query::all().separation(separation);
            let (found, pairs, _) = listed(&caller, &mut device, &scene, &query, [&[], &[]]);
            let own = assert_kept(&name, (&scene, &query, separation), (&found, &pairs));
            n_impacts += own[0];
            assert_alike(&name, &mut device, &scene, &query);
        }
    }
    assert!(n_impacts > 800, "{n_impacts}");
}

#[test]
fn damaged_kernels_of_distances_that_are_kept_are_noticed() {
    let caller = Caller::new();
    let mut cases = Vec::new();
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let mut scene = small(seed);
        thicken(&mut scene, &mut random, 0.3, 0);
        cases.push((scene, [0.0, 0.5][seed as usize % 2]));
    }
    let mut cloth = Scene::new();
    let at = surfaces::cloth(14, 14, 1.0);
    let body = at.add_to(&mut cloth).expect("good");
    let end = at.mapped(|[x, y, z]| [x, if x > 0.0 { -y } else { y }, z + 0.2 * x]);
    cloth.set_end_positions(body, &end.positions).expect("good");
    cases.push((cloth, 0.02));
    cases.push((balls(200), 0.02));
    // Boxes of plates that come near never meet.
    let mut plates = Scene::new();
    let fixed = surfaces::cloth(12, 12, 1.0);
    fixed.add_to(&mut plates).expect("good");
    let moved = fixed.mapped(|[x, y, z]| [x + 0.03, y + 0.02, z + 0.3]);
    let body = moved.add_to(&mut plates).expect("good");
    let end = moved.mapped(|[x, y, z]| [x + 0.05, y, z - 0.29]);
    plates
        .set_end_positions(body, &end.positions)
        .expect("good");
    cases.push((plates, 0.02));
    let holds = |make: &dyn Fn() -> Detector| {
        cases.iter().all(|(scene, separation)| {
            let asks = || {
                let mut detector = make();
                let query = Query::all().separation(*separation);
                let (found, pairs, _) = listed(&caller, &mut detector, scene, &query, [&[], &[]]);
                let of = (scene, &query, *separation);
                let [n_impacts, n_left, n_near] = assert_kept("damaged", of, (&found, &pairs));
                // What is right may be useless.
                assert!(n_left <= 2 * n_impacts && n_near >= n_impacts * 3 / 4);
            };
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(asks)).is_ok()
        })
    };
    assert!(holds(&|| caller.detector(Settings::default())));
    let damaged = |damage| caller.damaged(Settings::default(), damage);
    // A guess that goes too far is no harm: it is checked.
    let too_far = (
        "narrow_keep",
        "const GOES: f32 = 0.998;",
        "const GOES: f32 = 1.3;",
    );
    let (scene, separation) = &cases[cases.len() - 1];
    let query = Query::all().separation(*separation);
    let (found, pairs, _) = listed(&caller, &mut damaged(too_far), scene, &query, [&[], &[]]);
    assert_kept("too far", (scene, &query, *separation), (&found, &pairs));
    let mut unnoticed = Vec::new();
    for damage in [
        (
            "bounds_clusters_moving",
            "widened(Box(low - slack, high + slack), params.reach)",
            "widened(Box(low - slack, high + slack), 0u)",
        ),
        (
            "narrow_keep",
            "return time + length;",
            "return time + 2u * length;",
        ),
        (
            "narrow_keep",
            "is_left = latest < TICKS;",
            "is_left = latest < TICKS / 2u;",
        ),
        ("narrow_keep", "goes_on = is_left &&", "goes_on = false &&"),
        (
            "narrow_keep",
            "select(across, -across,",
            "select(-across, across,",
        ),
        (
            "narrow_keep",
            "scaled(towards(corner(points, k), corner(edges, k)))",
            "vec3<f32>(1.0, 0.0, 0.0)",
        ),
        (
            "narrow_keep",
            "return least(dot_four(",
            "return most(dot_four(",
        ),
        (
            "narrow_keep",
            "* scale_of((*pair).sizes.scale)",
            "* (*pair).sizes.scale",
        ),
        (
            "narrow_keep",
            "PairTimes(time_of(time),",
            "PairTimes(time_of(TICKS / 2u),",
        ),
        (
            "narrow_keep",
            "let slot = slot_in(N_PAIRS, is_left, lane);",
            "let slot = slot_in(N_PAIRS, is_left && lane != 5u, lane);",
        ),
        (
            "narrow_keep",
            "(thickness_of(a) + thickness_of(b))",
            "(thickness_of(a) + thickness_of(a))",
        ),
        (
            "narrow_names",
            "unsure[ix] = name_of(pairs[ix]);",
            "unsure[ix] = name_of(pairs[ix / 2u]);",
        ),
        (
            "narrow_names",
            "atomicStore(&counters[N_UNSURE], n);",
            "atomicStore(&counters[N_UNSURE], n / 2u);",
        ),
    ] {
        if holds(&|| damaged(damage)) {
            unnoticed.push(damage);
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}
