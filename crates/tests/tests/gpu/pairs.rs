//! The GPU backend against the oracle and the CPU: whole sorted sets and their hash.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::future::Future;
use std::sync::{Mutex, OnceLock};

use crate::caller::Caller;
use crate::stages::{STAGES, Shrink};
use impinge_core::{
    Backend, Capacities, Detector, Error, Method, Query, Recluster, Scene, Settings, SharedVertex,
    Stats, devices, wgpu,
};
use impinge_scenes::deform::{self, Deform};
use impinge_scenes::{Random, regular, soup, surfaces};
use impinge_tests::{Case, agree, cases, check, naive, rows};

/// Settings for the GPU. The first call opens a device and keeps it open, so that all tests share
/// the device and its compiled kernels.
fn gpu(method: Method) -> Settings {
    static OPEN: OnceLock<Mutex<Detector>> = OnceLock::new();
    OPEN.get_or_init(|| {
        let open = Detector::new(Backend::Gpu);
        Mutex::new(open.expect("these tests need a GPU or a software driver"))
    });
    Settings::new().method(method).backend(Backend::Gpu)
}

fn cpu(method: Method) -> Settings {
    Settings::new().method(method).backend(Backend::Cpu)
}

fn assert_agree(name: &str, expected: &[[u32; 4]], detector: &mut Detector, case: &Case) {
    let pairs = detector.detect(&case.scene, &case.query).unwrap();
    if let Err(error) = agree(expected, &rows(&pairs), pairs.hash()) {
        panic!("{name}, {}: {error}", case.name);
    }
}

#[test]
fn clusters_agree_with_the_oracle() {
    for case in cases() {
        check(&case, &naive(&case), gpu(Method::Clusters));
    }
}

#[test]
fn cells_agree_with_the_oracle() {
    for (ix, case) in cases().into_iter().enumerate() {
        let default = gpu(Method::Cells);
        let by_default = (default.density, default.group_size);
        let (lambda, group_size) = [by_default, (0.01, 20), (20.0, 64), (1e6, 7)][ix % 4];
        let settings = default.density(lambda).group_size(group_size);
        check(&case, &naive(&case), settings);
    }
}

/// The buffers of one scene are reused for the next, which may need larger or smaller ones, and
/// other kernels.
#[test]
fn one_detector_answers_scene_after_scene() {
    let cases = cases();
    let expected: Vec<_> = cases.iter().map(naive).collect();
    for method in [Method::Clusters, Method::Cells] {
        let mut detector = Detector::new(gpu(method)).unwrap();
        // Forth, and back by other steps.
        let order = (0..cases.len()).chain((0..cases.len()).rev().step_by(3));
        for ix in order {
            assert_agree(
                "scene after scene",
                &expected[ix],
                &mut detector,
                &cases[ix],
            );
        }
    }
}

/// Settings of `Cells` that put everything into one cell, in small groups.
fn one_cell(group_size: u32) -> Settings {
    gpu(Method::Cells).density(1e-9).group_size(group_size)
}

#[test]
fn a_crowded_cell_is_worked_in_tiles() {
    // Groups of one element: more pairs of groups than one pass lists for one cell.
    let soup = soup::triangles(300, 0.4, 11);
    let web = soup::lattice_web(60, 4, 9);
    let mut scene = Scene::new();
    let id = soup.add_to(&mut scene).unwrap();
    let within = Query::self_of(id).shared_vertex(SharedVertex::Skip);
    let mut both = scene.clone();
    web.add_to(&mut both).unwrap();
    let everything = Query::all();
    for (scene, query) in [
        (&scene, within),
        (&both, everything.clone()),
        (&both, Query::between_all()),
    ] {
        let case = Case {
            name: format!("crowded {query:?}"),
            scene: scene.clone(),
            query,
        };
        let expected = naive(&case);
        let mut detector = Detector::new(one_cell(1)).unwrap();
        for _ in 0..2 {
            assert_agree("tiles", &expected, &mut detector, &case);
        }
        let (stats, n) = (detector.stats(), detector.stats().n_entries);
        assert_eq!((stats.method, stats.grid), ("cells", Some([1; 3])));
        assert!(n >= 300, "{stats:?}");
        assert_eq!(stats.n_work_items, n * (n + 1) / 2);
        assert!(stats.n_batches > 1, "{stats:?}");
    }
    // Buffers that grow between tiles must not change the list.
    let mut tiny = Capacities::default();
    (tiny.items, tiny.candidates, tiny.pairs, tiny.unsure) = (1, 1, 1, 1);
    (tiny.kept, tiny.entries) = (1, 1);
    let case = Case {
        name: "crowded".into(),
        scene: both,
        query: everything,
    };
    let expected = naive(&case);
    let mut detector = Detector::with_capacities(one_cell(1), tiny).unwrap();
    for _ in 0..2 {
        assert_agree("tiny", &expected, &mut detector, &case);
    }
}

#[test]
fn a_crowded_cell_keeps_to_the_budget_or_is_left_to_clusters() {
    let case = large();
    let mut cpu = Detector::new(cpu(Method::Clusters)).unwrap();
    let expected = rows(&cpu.detect(&case.scene, &case.query).unwrap());
    for (budget, method) in [
        (None, "cells"),
        (Some(1_000_000), "cells"),
        (Some(700_000), "clusters"),
    ] {
        let settings = one_cell(20).memory_budget(budget);
        let mut detector = Detector::new(settings).unwrap();
        let pairs = detector.detect(&case.scene, &case.query).unwrap();
        agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
        let stats = pairs.stats();
        assert_eq!(stats.method, method, "{budget:?} {stats:?}");
        assert!(is_kept(budget, stats, expected.len()), "{stats:?}");
        assert!(stats.n_batches > 1, "{stats:?}");
        // A smaller frame uses the requested method again.
        let mut small = Scene::new();
        let id = soup::triangles(50, 0.4, 1).add_to(&mut small).unwrap();
        let pairs = detector.detect(&small, &Query::self_of(id)).unwrap();
        assert_eq!(pairs.stats().method, "cells");
    }
}

/// Whether the device holds no more than the budget, beside an answer on the host that takes at
/// most twice the bytes of its pairs.
fn is_kept(budget: Option<u64>, stats: &Stats, n_pairs: usize) -> bool {
    let answer = 2 * size_of::<u64>() as u64 * n_pairs as u64;
    budget.is_none_or(|budget| stats.bytes_held <= budget + answer)
}

/// 2,000 elements per body, enough for several rounds and thousands of pairs.
fn large() -> Case {
    let mut scene = Scene::new();
    let knot = surfaces::torus_knot(4000, Default::default());
    let ball = surfaces::bumpy_ball(2000, 0.3);
    let soup = soup::tetrahedra(1000, 0.25, 3);
    knot.add_to(&mut scene).unwrap();
    ball.add_to(&mut scene).unwrap();
    soup.add_to(&mut scene).unwrap();
    // Triangles that overlap in one plane, of which every filter is unsure.
    let faces: Vec<[u32; 3]> = (0..8).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]).collect();
    let corners = (0..8).flat_map(|ix| {
        let x = 0.125 * ix as f32;
        [[x, 0.0, 0.0], [x + 2.0, 0.0, 0.0], [x, 2.0, 0.0]]
    });
    scene
        .add_triangles(&faces, &corners.collect::<Vec<_>>())
        .unwrap();
    Case {
        name: "large".into(),
        scene,
        query: Query::all().shared_vertex(SharedVertex::Resolve),
    }
}

#[test]
fn buffers_that_overflow_grow_and_nothing_is_lost() {
    let case = large();
    let mut cpu = Detector::new(cpu(Method::Clusters)).unwrap();
    let expected = rows(&cpu.detect(&case.scene, &case.query).unwrap());
    assert!(expected.len() > 1000);
    let ample = || {
        let mut capacities = Capacities::default();
        (capacities.candidates, capacities.unsure) = (1 << 19, 1 << 17);
        capacities
    };
    for method in [Method::Clusters, Method::Cells] {
        let settings = gpu(method);
        let none: (&str, Shrink) = ("none", |_| ());
        for (stage, shrink) in [none].into_iter().chain(STAGES) {
            let mut capacities = ample();
            shrink(&mut capacities);
            let mut detector = Detector::with_capacities(settings.clone(), capacities).unwrap();
            assert_agree(stage, &expected, &mut detector, &case);
            let reruns = |detector: &mut Detector| {
                let pairs = detector.detect(&case.scene, &case.query).unwrap();
                pairs.stats().n_reruns
            };
            // A grown buffer stays grown. The first frame had to grow it, if the method has this
            // stage.
            assert_eq!(reruns(&mut detector), 0, "{method:?} {stage}");
            let mut again = Detector::with_capacities(settings.clone(), capacities).unwrap();
            let is_there = match stage {
                "none" => false,
                "queue" => method == Method::Clusters,
                "kept" | "entries" => method == Method::Cells,
                _ => true,
            };
            assert_eq!(reruns(&mut again) > 0, is_there, "{method:?} {stage}");
        }
        let mut tiny = Capacities::default();
        for field in [
            &mut tiny.queue,
            &mut tiny.items,
            &mut tiny.kept,
            &mut tiny.entries,
            &mut tiny.candidates,
            &mut tiny.pairs,
            &mut tiny.unsure,
        ] {
            *field = 1;
        }
        let mut detector = Detector::with_capacities(settings, tiny).unwrap();
        assert_agree("all at once", &expected, &mut detector, &case);
    }
}

#[test]
fn a_memory_budget_is_kept_by_working_in_batches() {
    let case = large();
    let mut cpu = Detector::new(cpu(Method::Clusters)).unwrap();
    let expected = rows(&cpu.detect(&case.scene, &case.query).unwrap());
    let mut free = Detector::new(gpu(Method::Clusters)).unwrap();
    assert_agree("free", &expected, &mut free, &case);
    for method in [Method::Clusters, Method::Cells] {
        let mut seen_batches = false;
        for budget in [1_000_000, 300_000] {
            let mut detector = Detector::new(gpu(method).memory_budget(Some(budget))).unwrap();
            assert_agree("budget", &expected, &mut detector, &case);
            let pairs = detector.detect(&case.scene, &case.query).unwrap();
            let stats = pairs.stats();
            assert!(is_kept(Some(budget), stats, expected.len()), "{stats:?}");
            seen_batches |= stats.n_batches > 1 && stats.n_pieces == 0;
            assert_eq!(stats.n_pieces > 0, budget == 300_000, "{stats:?}");
        }
        assert!(seen_batches, "{method:?}");
        let mut detector = Detector::new(gpu(method).memory_budget(Some(100_000))).unwrap();
        assert!(matches!(
            detector.detect(&case.scene, &case.query),
            Err(Error::MemoryBudget { .. })
        ));
    }
}

#[test]
fn what_is_more_than_the_device_binds_is_answered_in_pieces() {
    let mut n_many = 0;
    for (ix, case) in cases().into_iter().enumerate() {
        let expected = naive(&case);
        let method = [Method::Clusters, Method::Cells][ix % 2];
        // The positions of one cluster take up to 3 KiB.
        let most_bound = [1, 8 << 10, 20 << 10][ix / 2 % 3];
        let mut detector = Detector::with_most_bound(gpu(method), most_bound).unwrap();
        assert_agree("in pieces", &expected, &mut detector, &case);
        n_many += u64::from(detector.stats().n_pieces > 3);
    }
    assert!(n_many > 20, "{n_many}");
}

#[test]
fn auto_takes_the_cpu_where_the_gpu_would_need_pieces() {
    let (scene, query) = much_to_test();
    let case = Case {
        name: "much to test".into(),
        scene,
        query,
    };
    let expected = naive(&case);
    let answer = |most_bound| {
        let mut detector = Detector::with_most_bound(on_any_device(), most_bound).unwrap();
        // The first frame is the CPU's.
        for _ in 0..3 {
            assert_agree("auto", &expected, &mut detector, &case);
        }
        detector.stats().backend.clone()
    };
    assert_eq!(answer(8 << 10), "cpu");
    assert_ne!(answer(u64::MAX), "cpu");
}

#[test]
fn pieces_keep_to_filters_ignored_pairs_and_frames() {
    let mut scene = Scene::new();
    let knot = surfaces::torus_knot(1500, Default::default());
    let web = soup::lattice_web_tetrahedra(300, 4, 3);
    let a = knot.add_to(&mut scene).unwrap();
    let b = knot.translated([0.1, 0.2, 0.3]);
    let b = scene
        .add((b.elements.clone(), b.positions_f64()))
        .expect("valid");
    let c = web.add_to(&mut scene).unwrap();
    let d = soup::triangles(400, 0.4, 7).add_to(&mut scene).unwrap();
    let filter = |category, mask| impinge_core::Filter { category, mask };
    scene.set_filter(c, filter(2, 1)).unwrap();
    scene.set_filter(d, filter(4, 5)).unwrap();
    let queries = [
        Query::between_all(),
        Query::between_all().exclude((a, b)),
        Query::all().shared_vertex(SharedVertex::Resolve),
        Query::all()
            .exclude((c, c))
            .exclude((b, a))
            .shared_vertex(SharedVertex::Skip),
        Query::between(c, d),
        Query::self_of(c).shared_vertex(SharedVertex::Resolve),
    ];
    let budget = |memory_budget| gpu(Method::Clusters).memory_budget(memory_budget);
    let mut detectors = [
        Detector::with_most_bound(budget(None), 16 << 10).unwrap(),
        // Each answer takes its room beside that of the largest one before.
        Detector::with_most_bound(budget(Some(1_000_000)), 16 << 10).unwrap(),
        Detector::with_most_bound(budget(Some(2_000_000)), 16 << 10).unwrap(),
    ];
    let mut sizes = std::collections::BTreeSet::new();
    for frame in 0..2 {
        for query in &queries {
            let case = Case {
                name: format!("{query:?} in frame {frame}"),
                scene: scene.clone(),
                query: query.clone(),
            };
            let expected = naive(&case);
            sizes.insert(expected.len());
            for detector in &mut detectors {
                let pairs = detector.detect(&case.scene, &case.query).unwrap();
                if let Err(error) = agree(&expected, &rows(&pairs), pairs.hash()) {
                    panic!("{}: {error}", case.name);
                }
                let stats = pairs.stats().clone();
                let budget = detector.settings().memory_budget;
                let largest = sizes.last().copied().unwrap_or(0);
                assert!(is_kept(budget, &stats, largest), "{stats:?}");
                if *query == queries[0] {
                    assert!(stats.n_pieces > 3, "{stats:?}");
                }
            }
        }
        let moved = knot.translated([0.3, 0.0, 0.1]);
        scene.set_positions(a, &moved.positions).unwrap();
    }
    assert!(sizes.len() > 6, "{sizes:?}");
    // A scene that fits is again answered in one piece, and one that does not is again answered in
    // several.
    let small = cases().swap_remove(4);
    let expected = naive(&small);
    for detector in &mut detectors {
        for _ in 0..2 {
            assert_agree("at once", &expected, detector, &small);
            let pairs = detector.detect(&small.scene, &small.query).unwrap();
            assert_eq!(pairs.stats().n_pieces, 0, "{:?}", pairs.stats());
            let pairs = detector.detect(&scene, &queries[0]).unwrap();
            assert!(pairs.stats().n_pieces > 3);
        }
    }
}

#[test]
fn twenty_runs_give_the_same_bytes() {
    let case = large();
    let mut first = None;
    for run in 0..20 {
        let method = [Method::Clusters, Method::Cells][run % 2];
        let mut detector = Detector::new(gpu(method)).unwrap();
        let pairs = detector.detect(&case.scene, &case.query).unwrap();
        let answer = rows(&pairs);
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
    let mut detector = Detector::new(gpu(Method::Clusters)).unwrap();
    let pairs = detector.detect(&scene, &Query::between(a, b)).unwrap();
    let stats = pairs.stats();
    assert!(stats.n_candidates > 500, "{stats:?}");
    assert!(100 * stats.n_unsure < stats.n_candidates, "{stats:?}");
    assert!(!stats.backend.is_empty() && stats.backend != "cpu");
}

/// Triangles over a few vertices: nearly all share one vertex with many others, and some share two
/// or three.
fn web(n: u32, n_vertices: u32, seed: u64) -> impinge_scenes::Model {
    let mut random = Random::new(seed);
    let mut next = |below| random.below(below);
    let mut model = soup::triangles(n_vertices as usize / 3, 1.0, seed);
    let faces: Vec<[u32; 3]> = (0..n)
        .map(|_| {
            let a = next(n_vertices);
            let b = (a + 1 + next(n_vertices - 2)) % n_vertices;
            let c = (0..).map(|_| next(n_vertices)).find(|&c| c != a && c != b);
            [a, b, c.unwrap()]
        })
        .collect();
    model.elements = faces.into();
    model
}

#[test]
fn neighbours_are_decided_on_the_device() {
    let model = web(500, 60, 5);
    let folded = soup::lattice_web(400, 3, 2);
    // Nearly coplanar, nearly touching.
    let nearly = web(400, 60, 6).mapped(|p| p.map(|x| (2.0 * x).round() + 1e-6 * x));
    let closed = surfaces::bumpy_ball(3000, 0.3);
    for (name, model, most_unsure) in [
        ("web", &model, 0.02),
        ("lattice", &folded, 1.0),
        ("nearly degenerate", &nearly, 1.0),
        ("closed surface", &closed, 0.01),
    ] {
        for double in [false, true] {
            let mut scene = Scene::new();
            let id = match double {
                false => model.add_to(&mut scene),
                true => {
                    let positions = model.positions_f64().into_iter();
                    let moved = positions.map(|p| p.map(|x| x * (1.0 + 1e-9)));
                    scene.add((model.elements.clone(), moved.collect::<Vec<_>>()))
                }
            };
            let case = Case {
                name: format!("{name}, f64: {double}"),
                scene,
                query: Query::self_of(id.unwrap()).shared_vertex(SharedVertex::Resolve),
            };
            let expected = naive(&case);
            for method in [Method::Clusters, Method::Cells] {
                let mut detector = Detector::new(gpu(method)).unwrap();
                assert_agree("neighbours", &expected, &mut detector, &case);
                let pairs = detector.detect(&case.scene, &case.query).unwrap();
                let stats = pairs.stats();
                let share = stats.n_unsure as f64 / stats.n_candidates as f64;
                assert!(share <= most_unsure, "{}: {stats:?}", case.name);
            }
        }
    }
}

#[test]
fn regular_meshes_are_decided_on_the_device() {
    let mut detectors =
        [Method::Clusters, Method::Cells].map(|method| Detector::new(gpu(method)).unwrap());
    for surface in regular::ALL {
        let model = (surface.build)(1_000);
        let mut scene = Scene::new();
        let body = model.add_to(&mut scene).unwrap();
        for rule in [SharedVertex::Skip, SharedVertex::Resolve] {
            let query = Query::self_of(body).shared_vertex(rule);
            for detector in &mut detectors {
                let pairs = detector.detect(&scene, &query).unwrap();
                let stats = pairs.stats();
                let name = format!("{} {rule:?}: {stats:?}", surface.name);
                assert!(pairs.is_empty(), "{name}");
                // What is left are pairs across the edges of a box.
                assert!(20 * stats.n_unsure <= stats.n_candidates, "{name}");
            }
        }
    }
}

#[test]
fn adapters_are_listed_and_chosen_by_name() {
    let settings = gpu(Method::Clusters);
    let all = devices();
    assert!(!all.is_empty(), "these tests need an adapter");
    for device in &all {
        let part = device.name.split(' ').next().unwrap().to_uppercase();
        let named = settings.clone().device(Some(part));
        assert!(Detector::new(named).is_ok(), "{device}");
    }
    let nobody = settings.device(Some("no such adapter".into()));
    let error = Detector::new(nobody.clone()).err().unwrap();
    assert!(matches!(error, Error::NoAdapter { .. }), "{error}");
    assert!(error.to_string().contains(&all[0].name), "{error}");
    // A name that fits nothing is a mistake for Auto, too.
    let auto = nobody.backend(Backend::Auto);
    let error = Detector::new(auto).err().unwrap();
    assert!(matches!(error, Error::NoAdapter { .. }), "{error}");
}

#[test]
fn frames_follow_positions_bodies_and_precision() {
    let mut scene = Scene::new();
    let ball = surfaces::ball(600);
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.4, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let mut detectors =
        [Method::Clusters, Method::Cells].map(|method| Detector::new(gpu(method)).unwrap());
    let mut compare = |scene: &Scene, query: Query| {
        let case = Case {
            name: "changes".into(),
            scene: scene.clone(),
            query,
        };
        let expected = naive(&case);
        for detector in &mut detectors {
            assert_agree("frames", &expected, detector, &case);
        }
        expected.len()
    };
    let first = compare(&scene, Query::between_all());
    assert!(first > 0);
    scene
        .set_positions(b, &ball.translated([0.7, 0.1, 0.0]).positions)
        .unwrap();
    assert_ne!(compare(&scene, Query::between_all()), first);
    // Positions that only f64 can hold: touching, and apart or overlapping by less than f32
    // resolves.
    let apart = |gap: f64| {
        let (_, max) = ball.bounds().unwrap();
        let shift = 2.0 * f64::from(max[0]) + gap;
        let moved = ball.positions_f64().into_iter();
        moved.map(|[x, y, z]| [x + shift, y, z]).collect::<Vec<_>>()
    };
    for gap in [0.0, 1e-12, -1e-12] {
        scene.set_positions(b, apart(gap)).unwrap();
        compare(&scene, Query::between_all());
    }
    let c = soup::tetrahedra(100, 0.3, 1).add_to(&mut scene).unwrap();
    assert!(compare(&scene, Query::all()) > 0);
    compare(&scene, Query::between_all().exclude((a, c)));
    scene.remove(b).unwrap();
    assert!(compare(&scene, Query::between(a, c)) > 0);
    scene.remove(a).unwrap();
    compare(&scene, Query::between_all());
}

#[test]
fn topology_that_changes_within_its_room_is_bound_anew() {
    for method in [Method::Clusters, Method::Cells] {
        let mut detector = Detector::new(gpu(method)).unwrap();
        let mut scene = Scene::new();
        let a = surfaces::ball(100).add_to(&mut scene).unwrap();
        let b = surfaces::ball(100).add_to(&mut scene).unwrap();
        // Larger; much larger; slightly larger, within the spare quarter of the buffers; smaller
        // and solid.
        let solids = soup::tetrahedra(500, 0.3, 1);
        for model in [
            surfaces::ball(1000),
            surfaces::ball(2000),
            surfaces::ball(2300),
            solids,
        ] {
            let (elements, positions) = (&model.elements, &model.positions);
            for id in [a, b] {
                scene
                    .remesh(id, (elements.clone(), positions.clone()))
                    .unwrap();
            }
            let shifted = model.translated([0.1, 0.03, 0.2]);
            scene.set_positions(b, &shifted.positions).unwrap();
            let case = Case {
                name: format!("{method:?} of {}", model.n_elements()),
                scene: scene.clone(),
                query: Query::all(),
            };
            assert_agree("remeshed", &naive(&case), &mut detector, &case);
        }
    }
}

#[test]
fn bodies_that_flow_away_are_clustered_again() {
    let rest = surfaces::ball(20_000);
    let other = rest.translated([0.4, 0.0, 0.0]);
    let mut scene = Scene::new();
    let a = rest.add_to(&mut scene).unwrap();
    // One body in each precision.
    let b = scene.add((other.elements.clone(), other.positions_f64()));
    let query = Query::between(a, b.unwrap());
    let mut auto = Detector::new(gpu(Method::Clusters)).unwrap();
    let mut never = Detector::new(gpu(Method::Clusters).recluster(Recluster::Never)).unwrap();
    let mut oracle = Detector::new(cpu(Method::Clusters)).unwrap();
    assert_eq!(auto.detect(&scene, &query).unwrap().stats().n_clustered, 2);
    never.detect(&scene, &query).unwrap();
    // A body that moves and bends a little keeps its clusters.
    scene
        .set_positions(
            a,
            &rest
                .mapped(|[x, y, z]| [x + 0.1, y + 0.1 * x * x, z])
                .positions,
        )
        .unwrap();
    let slightly = auto.detect(&scene, &query).unwrap();
    assert_eq!(slightly.stats().n_clustered, 0);
    let mut flowed = rest.positions.clone();
    deform::Flow::default().apply(&rest.positions, 40.0, &mut flowed);
    scene.set_positions(a, &flowed).unwrap();
    let by_auto = auto.detect(&scene, &query).unwrap();
    let by_never = never.detect(&scene, &query).unwrap();
    assert!(
        by_auto
            .rows()
            .eq(oracle.detect(&scene, &query).unwrap().rows())
    );
    assert!(by_auto.rows().eq(by_never.rows()) && !by_auto.is_empty());
    assert_eq!(by_auto.stats().n_clustered, 1);
    assert_eq!(by_auto.stats().n_reclustered, 1);
    assert_eq!(by_never.stats().n_reclustered, 0);
    assert!(by_auto.stats().n_work_items < by_never.stats().n_work_items);
    // The next frame has nothing left to recluster.
    scene.set_positions(a, &flowed).unwrap();
    let after = auto.detect(&scene, &query).unwrap();
    assert_eq!(after.stats().n_reclustered, 0);
    assert!(
        after
            .rows()
            .eq(oracle.detect(&scene, &query).unwrap().rows())
    );
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
        query: Query::all(),
    };
    let expected = naive(&case);
    assert!(expected.len() > 5000);
    check(&case, &expected, gpu(Method::Clusters));
    check(&case, &expected, gpu(Method::Cells));
}

#[test]
fn resident_frames_take_positions_and_leave_pairs_on_the_device() {
    let caller = Caller::new();
    let ball = surfaces::bumpy_ball(1500, 0.2);
    let moved = ball.translated([0.3, 0.1, 0.0]);
    // The scene has the rest pose; only the device has the second ball's real positions.
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.add_to(&mut scene).unwrap();
    let query = Query::between(a, b);
    let mut truth = scene.clone();
    truth.set_positions(b, &moved.positions).unwrap();
    let mut oracle = Detector::new(cpu(Method::Clusters)).unwrap();
    let expected: Vec<[u32; 2]> = oracle
        .detect(&truth, &query)
        .unwrap()
        .between(a, b)
        .map(|[i, j]| [i, j + 1500])
        .collect();
    assert!(expected.len() > 100);
    let bytes: Vec<u8> = moved
        .positions
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    let positions = caller.buffer(bytes.len() as u64, usage);
    caller.queue.write_buffer(&positions, 0, &bytes);
    for method in [Method::Clusters, Method::Cells] {
        let mut detector = caller.detector(gpu(method));
        let mut n_tries = 0;
        let found = loop {
            let mut encoder = caller.encoder();
            let resident = [(b, &positions)];
            let found =
                detector
                    .gpu()
                    .expect("a device")
                    .encode(&scene, &query, &resident, &mut encoder);
            caller.queue.submit([encoder.finish()]);
            n_tries += 1;
            if detector.gpu().expect("a device").grow().unwrap() {
                break found.unwrap();
            }
            assert!(n_tries < 9);
        };
        let counts = caller.read(&found.counts);
        let keys = |buffer: &wgpu::Buffer, offset: u64| -> Vec<[u32; 2]> {
            let n = counts[offset as usize / 4] as usize;
            let words = caller.read(buffer);
            words.as_chunks::<2>().0[..n].to_vec()
        };
        let mut pairs = keys(&found.pairs, found.n_pairs_offset);
        let unsure = keys(&found.unsure, found.n_unsure_offset);
        assert!(unsure.len() * 20 < pairs.len());
        // Unsure pairs may or may not intersect; all other pairs must be right.
        pairs.extend(unsure.iter().filter(|&pair| expected.contains(pair)));
        pairs.sort_unstable();
        assert!(pairs == expected, "{method:?}");
        // Called by `detect`, the same detector answers from the scene's own positions.
        let pairs = detector.detect(&truth, &query).unwrap();
        assert_eq!(pairs.len(), expected.len());
        // Where they can be drawn from, until the body moves.
        for (id, model) in [(a, &ball), (b, &moved)] {
            let (buffer, offset) = detector.gpu().unwrap().positions(&truth, id).unwrap();
            let words = caller.read(&buffer);
            let (first, n) = (offset as usize / 4, 3 * model.positions.len());
            let there: Vec<f32> = words[first..first + n]
                .iter()
                .map(|&x| f32::from_bits(x))
                .collect();
            assert_eq!(there, model.positions.as_flattened());
        }
        assert!(detector.gpu().unwrap().positions(&scene, b).is_none());
        assert!(oracle.gpu().is_none());
        let small = caller.buffer(12, wgpu::BufferUsages::COPY_SRC);
        let mut encoder = caller.encoder();
        let refused =
            detector
                .gpu()
                .expect("a device")
                .encode(&scene, &query, &[(b, &small)], &mut encoder);
        assert!(matches!(refused, Err(Error::Gpu { .. })));
    }
}

#[test]
fn a_lost_device_is_an_error_and_a_new_detector_works() {
    let Caller { device, queue } = Caller::new();
    let case = cases().swap_remove(0);
    let settings = gpu(Method::Clusters);
    let on_device = settings.clone().on_device(device.clone(), queue);
    let mut on_cpu = Detector::new(on_device.clone().backend(Backend::Cpu)).unwrap();
    assert!(on_cpu.gpu().is_none());
    let mut detector = Detector::new(on_device).unwrap();
    assert!(detector.detect(&case.scene, &case.query).is_ok());
    device.destroy();
    for _ in 0..2 {
        let lost = detector.detect(&case.scene, &case.query);
        assert!(matches!(lost, Err(Error::Gpu { .. })), "{lost:?}");
    }
    check(&case, &naive(&case), settings);
}

#[test]
fn frames_can_be_awaited() {
    let case = cases().swap_remove(0);
    let mut detector = Detector::new(gpu(Method::Clusters)).unwrap();
    let expected = naive(&case);
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    let mut n_pending = 0;
    let answer = {
        let mut device = detector.gpu().expect("a device");
        let mut frame = std::pin::pin!(device.detect_async(&case.scene, &case.query));
        loop {
            match frame.as_mut().poll(&mut context) {
                std::task::Poll::Ready(pairs) => break rows(&pairs.unwrap()),
                std::task::Poll::Pending => n_pending += 1,
            }
            // Other detectors of this process poll the device they share with this one.
            let mut other = Detector::new(gpu(Method::Clusters)).unwrap();
            other.detect(&case.scene, &case.query).unwrap();
        }
    };
    assert!(answer == expected);
    assert!(n_pending > 0, "the device was waited for");
}

/// Several threads write them; bodies begin and end within the share of a thread.
#[test]
fn large_bodies_of_both_precisions_are_sent_whole() {
    let (ball, small) = (surfaces::ball(60_000), surfaces::ball(300));
    let mut scene = Scene::new();
    let mut ids = Vec::new();
    for _ in 0..2 {
        ids.push(ball.add_to(&mut scene).unwrap());
        ids.push(small.add_to(&mut scene).unwrap());
        let double = (ball.elements.clone(), ball.positions_f64());
        ids.push(scene.add(double).unwrap());
    }
    assert!(ball.positions.len() > 1 << 14, "for several threads");
    let mut on_gpu = Detector::new(gpu(Method::Clusters).threads(3)).unwrap();
    let mut on_cpu = Detector::new(cpu(Method::Clusters)).unwrap();
    for frame in 0..3 {
        for (ix, &id) in ids.iter().enumerate() {
            // They move one after the other, so runs of bodies that have moved differ.
            if frame > 0 && ix % 3 == frame {
                continue;
            }
            let x = (ix * ix % 7 + frame) as f32 * 0.37;
            let positions = match ix % 3 {
                1 => &small.positions,
                _ => &ball.positions,
            };
            let moved = positions.iter().map(|p| [p[0] + x, p[1], p[2]]);
            match ix % 3 {
                2 => {
                    let wide: Vec<[f64; 3]> = moved.map(|p| p.map(f64::from)).collect();
                    scene.set_positions(id, &wide).unwrap();
                }
                _ => scene.set_positions(id, moved.collect::<Vec<_>>()).unwrap(),
            }
        }
        let pairs = on_gpu.detect(&scene, &Query::all()).unwrap();
        let expected = on_cpu.detect(&scene, &Query::all()).unwrap();
        assert!(expected.len() > 1000, "{}", expected.len());
        assert_eq!(pairs.hash(), expected.hash(), "frame {frame}");
    }
}

#[test]
fn sizes_to_a_hundred_thousand_and_a_thousand_bodies() {
    let mut detectors =
        [Method::Clusters, Method::Cells].map(|method| Detector::new(gpu(method)).unwrap());
    let mut compare = |name: String, scene: Scene, query: Query| {
        let mut cpu = Detector::new(cpu(Method::Clusters)).unwrap();
        let expected = rows(&cpu.detect(&scene, &query).unwrap());
        let case = Case { name, scene, query };
        for detector in &mut detectors {
            assert_agree("sizes", &expected, detector, &case);
        }
        expected.len()
    };
    for n in [1, 10, 100, 1_000, 10_000, 100_000] {
        let body = soup::triangles(n, 2.0 / (n as f32).cbrt(), 5);
        let other = soup::triangles(n, 2.0 / (n as f32).cbrt(), 6);
        let mut scene = Scene::new();
        let a = body.add_to(&mut scene).unwrap();
        let b = other.add_to(&mut scene).unwrap();
        let found = compare(format!("{n} triangles"), scene, Query::between(a, b));
        assert!(n < 100 || found > n / 20, "{n}: {found}");
    }
    for n in [2, 10, 100, 1_000] {
        let built = impinge_scenes::adversarial::boxes(n, 3).unwrap();
        compare(format!("{n} bodies"), built.scene, Query::all());
    }
}

/// All choices left to the detector, on the device that tests use: by itself, `Auto` takes only
/// hardware.
fn on_any_device() -> Settings {
    gpu(Method::Auto)
        .backend(Backend::Auto)
        .device(Some(devices()[0].name.clone()))
}

/// A soup with 100,000 candidates.
fn much_to_test() -> (Scene, Query) {
    let mut scene = Scene::new();
    soup::triangles(700, 1.5, 3).add_to(&mut scene).unwrap();
    (scene, Query::all())
}

#[test]
fn auto_takes_the_device_where_the_last_frame_had_much_to_test() {
    let mut auto = Detector::new(on_any_device()).unwrap();
    let mut clusters = Detector::new(cpu(Method::Clusters)).unwrap();
    let mut ask = |scene: &Scene, query: &Query| {
        let pairs = auto.detect(scene, query).unwrap();
        let expected = clusters.detect(scene, query).unwrap();
        assert!(!expected.is_empty() && pairs.rows().eq(expected.rows()));
        let stats = pairs.stats();
        (
            stats.backend != "cpu",
            stats.method,
            stats.n_candidates >= 50_000,
        )
    };
    // Two balls that meet in one place.
    let mut scene = Scene::new();
    let ball = surfaces::ball(12_000);
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.5, 0.1, 0.0]).add_to(&mut scene).unwrap();
    let few = Query::between(a, b);
    assert_eq!(ask(&scene, &few), (false, "cells", false));
    assert_eq!(ask(&scene, &few), (false, "clusters", false));
    let (crowd, all) = much_to_test();
    assert_eq!(ask(&crowd, &all), (false, "clusters", true));
    assert_eq!(ask(&crowd, &all), (true, "clusters", true));
    assert_eq!(ask(&scene, &few), (true, "clusters", false));
    assert_eq!(ask(&scene, &few), (false, "clusters", false));
    // Also through what holds no pairs.
    let n = clusters.count(&crowd, &all).unwrap();
    for on_device in [false, true] {
        assert_eq!(auto.count(&crowd, &all).unwrap(), n);
        assert_eq!(auto.stats().backend != "cpu", on_device);
    }
    // A device that is asked for has the first frame too, and so has one under a budget.
    let budget = on_any_device().memory_budget(Some(1 << 28));
    for settings in [gpu(Method::Auto), budget] {
        let mut asked = Detector::new(settings).unwrap();
        assert_eq!(
            asked.count(&scene, &few).unwrap(),
            clusters.count(&scene, &few).unwrap()
        );
        assert_ne!(asked.stats().backend, "cpu");
    }
    // What the grid does not look at is refused all the same.
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    scene.positions_mut::<f32>(a).unwrap()[7] = [f32::NAN; 3];
    let error = Detector::new(on_any_device())
        .unwrap()
        .detect(&scene, &Query::self_of(a));
    let error = error.unwrap_err();
    assert!(error.to_string().contains("vertex 7"), "{error}");
}
