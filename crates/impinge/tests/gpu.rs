//! The GPU backend against the oracle and the CPU: whole sorted sets and their hash.
//!
//! These tests fail where no adapter is found; a software driver is enough.
#![cfg(feature = "gpu")]

mod common;

use std::sync::{Mutex, OnceLock};

use common::{Case, agree, cases, check, naive, rows};
use impinge::{
    Backend, Capacities, Detector, Error, Method, Query, Scene, Settings, SharedVertex, devices,
};
use impinge_scenes::{soup, surfaces};

/// Settings for the GPU. The first call opens a device and keeps it open, so that all tests share
/// it and its compiled kernels.
fn gpu(method: Method) -> Settings {
    static OPEN: OnceLock<Mutex<Detector>> = OnceLock::new();
    OPEN.get_or_init(|| {
        let open = Detector::new(Backend::Gpu);
        Mutex::new(open.expect("these tests need a GPU or a software driver"))
    });
    Settings {
        method,
        backend: Backend::Gpu,
        ..Settings::default()
    }
}

fn cpu(method: Method) -> Settings {
    Settings {
        method,
        backend: Backend::Cpu,
        ..Settings::default()
    }
}

fn assert_agree(name: &str, expected: &[[u32; 4]], detector: &mut Detector, case: &Case) {
    let pairs = detector.detect(&case.scene, &case.query).unwrap();
    if let Err(error) = agree(expected, &rows(pairs), pairs.hash()) {
        panic!("{name}, {}: {error}", case.name);
    }
}

#[test]
fn clusters_agree_with_the_oracle() {
    for case in cases() {
        check(&case, &naive(&case), gpu(Method::Clusters));
    }
}

/// 2,000 primitives a body, enough for several rounds and thousands of pairs.
fn large() -> Case {
    let mut scene = Scene::new();
    let knot = surfaces::torus_knot(4000, Default::default());
    let ball = surfaces::bumpy_ball(2000, 0.3);
    let soup = soup::tetrahedra(1000, 0.25, 3);
    knot.add_to(&mut scene).unwrap();
    ball.add_to(&mut scene).unwrap();
    soup.add_to(&mut scene).unwrap();
    Case {
        name: "large".into(),
        scene,
        query: Query::everything().shared_vertex(SharedVertex::Resolve),
    }
}

#[test]
fn buffers_that_overflow_grow_and_nothing_is_lost() {
    let case = large();
    let settings = gpu(Method::Clusters);
    let mut cpu = Detector::with_settings(cpu(Method::Clusters)).unwrap();
    let expected = rows(cpu.detect(&case.scene, &case.query).unwrap());
    assert!(expected.len() > 1000);
    let small = |stage: &str| {
        let mut capacities = Capacities::default();
        capacities.unsure = 1 << 17;
        match stage {
            "queue" => capacities.queue = 3,
            "items" => capacities.items = 2,
            "candidates" => capacities.candidates = 5,
            "pairs" => capacities.pairs = 1,
            "unsure" => capacities.unsure = 1,
            _ => (),
        }
        capacities
    };
    for stage in ["queue", "items", "candidates", "pairs", "unsure", "none"] {
        let mut detector = Detector::with_capacities(settings.clone(), small(stage)).unwrap();
        assert_agree(stage, &expected, &mut detector, &case);
        let reruns = |detector: &mut Detector| {
            let pairs = detector.detect(&case.scene, &case.query).unwrap();
            pairs.stats().n_reruns
        };
        // Once grown it stays so, and the first frame had to.
        assert_eq!(reruns(&mut detector), 0, "{stage}");
        let mut again = Detector::with_capacities(settings.clone(), small(stage)).unwrap();
        assert_eq!(reruns(&mut again) > 0, stage != "none", "{stage}");
    }
    let mut tiny = Capacities::default();
    for field in [
        &mut tiny.queue,
        &mut tiny.items,
        &mut tiny.candidates,
        &mut tiny.pairs,
        &mut tiny.unsure,
    ] {
        *field = 1;
    }
    let mut detector = Detector::with_capacities(settings, tiny).unwrap();
    assert_agree("all at once", &expected, &mut detector, &case);
}

#[test]
fn a_memory_budget_is_kept_by_working_in_slabs() {
    let case = large();
    let mut cpu = Detector::with_settings(cpu(Method::Clusters)).unwrap();
    let expected = rows(cpu.detect(&case.scene, &case.query).unwrap());
    let mut free = Detector::with_settings(gpu(Method::Clusters)).unwrap();
    assert_agree("free", &expected, &mut free, &case);
    let mut seen_slabs = false;
    for budget in [1_500_000, 900_000, 700_000] {
        let mut detector = Detector::with_settings(Settings {
            memory_budget: Some(budget),
            ..gpu(Method::Clusters)
        })
        .unwrap();
        assert_agree("budget", &expected, &mut detector, &case);
        let pairs = detector.detect(&case.scene, &case.query).unwrap();
        assert!(pairs.stats().bytes_held <= budget, "{:?}", pairs.stats());
        seen_slabs |= pairs.stats().n_slabs > 1;
    }
    assert!(seen_slabs);
    let mut detector = Detector::with_settings(Settings {
        memory_budget: Some(100_000),
        ..gpu(Method::Clusters)
    })
    .unwrap();
    assert!(matches!(
        detector.detect(&case.scene, &case.query),
        Err(Error::MemoryBudget { .. })
    ));
}

#[test]
fn twenty_runs_give_the_same_bytes() {
    let case = large();
    let mut first = None;
    for run in 0..20 {
        let mut detector = Detector::with_settings(gpu(Method::Clusters)).unwrap();
        let pairs = detector.detect(&case.scene, &case.query).unwrap();
        let answer = rows(pairs);
        let first = first.get_or_insert_with(|| answer.clone());
        assert!(*first == answer, "run {run} differs");
    }
}

#[test]
fn few_pairs_are_left_to_exact_arithmetic() {
    let mut scene = Scene::new();
    let ball = surfaces::bumpy_ball(8000, 0.2);
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball
        .translated([0.31, 0.17, 0.05])
        .add_to(&mut scene)
        .unwrap();
    let mut detector = Detector::with_settings(gpu(Method::Clusters)).unwrap();
    let pairs = detector.detect(&scene, &Query::between(a, b)).unwrap();
    let stats = pairs.stats();
    assert!(stats.n_candidates > 500, "{stats:?}");
    assert!(100 * stats.n_unsure < stats.n_candidates, "{stats:?}");
    assert!(!stats.backend.is_empty() && stats.backend != "cpu");
}

#[test]
fn adapters_are_listed_and_chosen_by_name() {
    let settings = gpu(Method::Clusters);
    let all = devices();
    assert!(!all.is_empty(), "these tests need an adapter");
    for device in &all {
        let part = device.name.split(' ').next().unwrap().to_uppercase();
        let named = Settings {
            device: Some(part),
            ..settings.clone()
        };
        assert!(Detector::with_settings(named).is_ok(), "{device}");
    }
    let nobody = Settings {
        device: Some("no such adapter".into()),
        ..settings
    };
    let error = Detector::with_settings(nobody.clone()).err().unwrap();
    assert!(matches!(error, Error::NoAdapter { .. }), "{error}");
    assert!(error.to_string().contains(&all[0].name), "{error}");
    // Auto is quiet about it and takes the CPU.
    let mut auto = Detector::with_settings(Settings {
        backend: Backend::Auto,
        ..nobody
    })
    .unwrap();
    let pairs = auto.detect(&Scene::new(), &Query::all()).unwrap();
    assert_eq!(pairs.stats().backend, "cpu");
}

#[test]
fn frames_follow_positions_bodies_and_precision() {
    let mut scene = Scene::new();
    let ball = surfaces::ball(600);
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.4, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let mut detector = Detector::with_settings(gpu(Method::Clusters)).unwrap();
    let mut compare = |scene: &Scene, query: Query| {
        let case = Case {
            name: "changes".into(),
            scene: scene.clone(),
            query,
        };
        let expected = naive(&case);
        assert_agree("frames", &expected, &mut detector, &case);
        expected.len()
    };
    let first = compare(&scene, Query::all());
    assert!(first > 0);
    scene
        .set_positions(b, &ball.translated([0.7, 0.1, 0.0]).positions)
        .unwrap();
    assert_ne!(compare(&scene, Query::all()), first);
    // Positions that only f64 can hold: touching, and apart by less than f32 can tell.
    let apart = |gap: f64| {
        let (_, max) = ball.bounds().unwrap();
        let shift = 2.0 * f64::from(max[0]) + gap;
        let moved = ball.positions_f64().into_iter();
        moved.map(|[x, y, z]| [x + shift, y, z]).collect::<Vec<_>>()
    };
    for gap in [0.0, 1e-12, -1e-12] {
        scene.set_positions(b, &apart(gap)).unwrap();
        compare(&scene, Query::all());
    }
    let c = soup::tetrahedra(100, 0.3, 1).add_to(&mut scene).unwrap();
    assert!(compare(&scene, Query::everything()) > 0);
    compare(&scene, Query::all().ignore(a, c));
    scene.remove(b).unwrap();
    assert!(compare(&scene, Query::between(a, c)) > 0);
    scene.remove(a).unwrap();
    compare(&scene, Query::all());
}

#[test]
fn many_small_bodies_meet_through_the_tree_over_bodies() {
    let mut scene = Scene::new();
    for ix in 0..300u32 {
        let corner = [ix % 7, ix / 7 % 7, ix / 49].map(|k| 0.8 * k as f32);
        surfaces::cube(corner, 1.0).add_to(&mut scene).unwrap();
    }
    let case = Case {
        name: "cubes".into(),
        scene,
        query: Query::everything(),
    };
    let expected = naive(&case);
    assert!(expected.len() > 5000);
    check(&case, &expected, gpu(Method::Clusters));
}
