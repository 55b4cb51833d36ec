//! Every threshold of the CPU backend at 0 and at infinity: the same answers, and the code behind
//! each one is really entered.

use std::time::Duration;

use impinge_core::{
    BodyId, Detector, Element, Impact, Method, NearPair, PairKind, Pairs, Positions, Query, Scene,
    SharedVertex, Stats, Tuning,
};
use impinge_scenes::{Model, Random, solids, soup, surfaces};
use impinge_tests::{agree, cases, check, cpu, landing, leaves_out, naive, rows};

const ZERO: usize = 0;
const INFINITY: usize = 1;

fn detector(method: Method, threads: usize, tuning: Tuning) -> Detector {
    Detector::new(cpu(method, threads).tuning(tuning)).unwrap()
}

/// All thresholds where most of the code behind them is entered.
fn eager() -> Tuning {
    let late = [
        "culled_one_in",
        "culled_lasts",
        "most_maps",
        "auto_most_crowded",
    ];
    let start = Tuning::ENDS[ZERO];
    late.iter().fold(start, |tuning, name| {
        tuning.with(name, &Tuning::ENDS[INFINITY])
    })
}

/// Thresholds, and the methods for which they matter.
struct Tuned {
    name: String,
    tuning: Tuning,
    methods: &'static [Method],
}

impl Tuned {
    fn new(name: &str, tuning: Tuning, methods: &'static [Method]) -> Tuned {
        let name = name.to_owned();
        Tuned {
            name,
            tuning,
            methods,
        }
    }
}

/// All thresholds at either end, and [`eager`].
fn extremes() -> Vec<Tuned> {
    let methods = &[Method::Clusters, Method::Cells, Method::Auto];
    vec![
        Tuned::new("all at 0", Tuning::ENDS[ZERO], methods),
        Tuned::new("all at infinity", Tuning::ENDS[INFINITY], methods),
        Tuned::new("eager", eager(), methods),
    ]
}

/// A tuning, each of whose thresholds is put to either end.
fn each_of(name: &str, tuning: Tuning) -> Vec<Tuned> {
    let ends = |threshold: &&str| {
        let methods: &[Method] = match *threshold {
            "cull_parallel_from" | "most_maps" | "map_cell" | "most_marked" => &[Method::Cells],
            "wake_from" | "most_per_task" | "most_batch_items" | "decide_from" => {
                &[Method::Clusters, Method::Cells]
            }
            auto if auto.starts_with("auto") => &[Method::Auto],
            _ => &[Method::Clusters],
        };
        [("0", ZERO), ("infinity", INFINITY)].map(|(end, ix)| {
            let tuning = tuning.with(threshold, &Tuning::ENDS[ix]);
            Tuned::new(&format!("{name}, {threshold} at {end}"), tuning, methods)
        })
    };
    let all = Tuning::NAMES.iter().flat_map(ends);
    all.filter(|tuned| tuned.tuning != tuning).collect()
}

#[test]
fn no_threshold_changes_the_answer_to_a_case() {
    let mut tunings = each_of("default", Tuning::default());
    tunings.retain(|tuned| !tuned.name.contains("step_") && !tuned.name.contains("sort_"));
    let extremes = extremes();
    for (case_ix, case) in cases().into_iter().enumerate() {
        let expected = naive(&case);
        // Every threshold in each sixth case, in turn, and all of them together in each third one.
        let chosen = tunings.iter().skip(case_ix % 6).step_by(6);
        let together = extremes.iter().skip(case_ix % 3).step_by(3);
        for tuned in chosen.chain(together) {
            for &method in tuned.methods {
                check(&case, &expected, cpu(method, 2).tuning(tuned.tuning));
            }
        }
    }
}

/// Bodies that are given new positions frame by frame.
struct Film {
    name: &'static str,
    bodies: Vec<Model>,
    /// Whether the first body is in double precision.
    double: bool,
    query: fn(&[BodyId]) -> Query,
    /// Where a point of a body is in a frame.
    motion: fn(usize, usize, [f32; 3]) -> [f32; 3],
}

const N_FRAMES: usize = 9;

impl Film {
    fn scene(&self) -> (Scene, Vec<BodyId>) {
        let mut scene = Scene::new();
        let bodies = self.bodies.iter().enumerate();
        let add = bodies.map(|(ix, body)| match self.double && ix == 0 {
            true => scene
                .add((body.elements.clone(), body.positions_f64()))
                .unwrap(),
            false => body.add_to(&mut scene).unwrap(),
        });
        let bodies = add.collect();
        (scene, bodies)
    }

    /// The positions of all bodies in a frame, in single precision.
    fn pose(&self, frame: usize) -> Vec<Vec<[f32; 3]>> {
        let bodies = self.bodies.iter().enumerate();
        bodies
            .map(|(ix, body)| {
                body.mapped(|point| (self.motion)(ix, frame, point))
                    .positions
            })
            .collect()
    }

    fn show(&self, scene: &mut Scene, bodies: &[BodyId], frame: usize) {
        for (ix, (&body, positions)) in bodies.iter().zip(self.pose(frame)).enumerate() {
            match self.double && ix == 0 {
                true => scene.set_positions(body, wide(&positions)).unwrap(),
                false => scene.set_positions(body, &positions).unwrap(),
            }
        }
    }

    /// Shows the frames one after the other, the scene being the same.
    fn for_frames(&self, mut call: impl FnMut(usize, &Scene, &Query)) {
        let (mut scene, bodies) = self.scene();
        let query = (self.query)(&bodies);
        for frame in 0..N_FRAMES {
            self.show(&mut scene, &bodies, frame);
            call(frame, &scene, &query);
        }
    }
}

/// Moved off the lattice of `f32`, so that the boxes of bodies in double precision are rounded.
fn wide(positions: &[[f32; 3]]) -> Vec<[f64; 3]> {
    let wide = |x: f32| f64::from(x) * (1.0 + 1e-9);
    positions.iter().map(|point| point.map(wide)).collect()
}

/// A ball of several hundred triangles: clusters in two levels.
fn ball() -> Model {
    surfaces::bumpy_ball(1_300, 0.2)
}

/// Drifts through, with a jump in the end.
fn drift(body: usize, frame: usize, [x, y, z]: [f32; 3]) -> [f32; 3] {
    let t = frame as f32;
    match body {
        0 => [x + 0.01 * (t * y).sin(), y, z],
        1 if frame == 6 => [x, y - 0.9, z],
        k => [x + 0.9 - 0.03 * t, y + 0.1, z + 0.8 * (k - 1) as f32],
    }
}

fn twist(body: usize, frame: usize, [x, y, z]: [f32; 3]) -> [f32; 3] {
    let (sin, cos) = (0.5 * frame as f32 * z).sin_cos();
    let offset = 0.3 * body as f32;
    [cos * x - sin * y + offset, sin * x + cos * y, z]
}

/// Whole steps, so that points of a lattice stay on it.
fn hop(body: usize, frame: usize, [x, y, z]: [f32; 3]) -> [f32; 3] {
    match body {
        0 => [x, y, z],
        _ => [x + (frame % 3) as f32, y, z - (frame % 2) as f32],
    }
}

fn films() -> Vec<Film> {
    let between: fn(&[BodyId]) -> Query = |bodies| Query::between(bodies[0], bodies[1]);
    let resolved: fn(&[BodyId]) -> Query = |_| Query::all().shared_vertex(SharedVertex::Resolve);
    let mut films = Vec::new();
    for double in [false, true] {
        let film = |name, bodies: [Model; 2], query, motion| Film {
            name,
            bodies: bodies.into(),
            double,
            query,
            motion,
        };
        let tetrahedra = solids::block(6, 6, 5, 0.2);
        films.extend([
            film("balls that drift", [ball(), ball()], between, drift),
            film("balls that twist", [ball(), ball()], resolved, twist),
            film(
                "tetrahedra that drift",
                [tetrahedra.clone(), tetrahedra.clone()],
                between,
                drift,
            ),
            film(
                "tetrahedra that twist",
                [tetrahedra, soup::tetrahedra(200, 0.4, 3)],
                resolved,
                twist,
            ),
            film(
                "lattices that hop",
                [
                    soup::lattice_triangles(260, 5, 1),
                    soup::lattice_tetrahedra(130, 5, 2),
                ],
                between,
                hop,
            ),
            film(
                "webs that hop",
                [
                    soup::lattice_web(200, 3, 1),
                    soup::lattice_web_tetrahedra(130, 3, 2),
                ],
                resolved,
                hop,
            ),
        ]);
        films.push(Film {
            name: "many that drift",
            bodies: vec![ball(), ball(), soup::tetrahedra(300, 0.3, 1), ball()],
            double,
            query: |_| Query::between_all(),
            motion: drift,
        });
    }
    films
}

/// The boxes of positions in double precision are rounded outward to `f32`, so more of them
/// overlap.
fn is_single(scene: &Scene) -> bool {
    let mut bodies = scene.bodies();
    bodies.all(|(_, body)| matches!(body.positions(), Positions::F32(_)))
}

#[test]
fn no_threshold_changes_the_answer_to_a_frame() {
    let (extremes, tunings) = (extremes(), each_of("eager", eager()));
    for (film_ix, film) in films().into_iter().enumerate() {
        let mut expected = Vec::new();
        let mut oracle = detector(Method::Naive, 1, Tuning::default());
        film.for_frames(|_, scene, query| {
            let pairs = oracle.detect(scene, query).unwrap();
            expected.push((rows(&pairs), pairs.stats().n_candidates));
        });
        assert!(expected.iter().any(|(rows, _)| !rows.is_empty()));
        // Every threshold in each fourth film, in turn: in three or four of them. All of them
        // together in every second one.
        let chosen = tunings.iter().skip(film_ix % 4).step_by(4);
        let together = extremes.iter().skip(film_ix % 2).step_by(2);
        for tuned in chosen.chain(together) {
            for &method in tuned.methods {
                let mut detector = detector(method, 2, tuned.tuning);
                film.for_frames(|frame, scene, query| {
                    let what = || format!("{} {frame}, {}, {method:?}", film.name, tuned.name);
                    let (expected, n_candidates) = &expected[frame];
                    let pairs: &Pairs = &detector.detect(scene, query).unwrap();
                    if let Err(error) = agree(expected, &rows(pairs), pairs.hash()) {
                        panic!("{}: {error}", what());
                    }
                    let found = pairs.stats().n_candidates;
                    let is_right = match is_single(scene) {
                        true => found == *n_candidates,
                        false => found >= *n_candidates,
                    };
                    assert!(is_right, "{}: {found} of {n_candidates}", what());
                });
            }
        }
    }
}

/// The answers to a step.
#[derive(Debug, PartialEq)]
struct Answers {
    impacts: Vec<Impact>,
    earliest: Option<Impact>,
    candidates: Vec<(PairKind, Element, Element)>,
    near: Vec<NearPair>,
}

fn answers(detector: &mut Detector, scene: &Scene, query: &Query) -> Answers {
    let step = query.clone();
    let near = query.clone();
    let candidates = query.clone();
    Answers {
        impacts: (detector.impacts(scene, &step).unwrap().iter().copied()).collect(),
        earliest: detector.earliest(scene, &step).unwrap(),
        candidates: (detector
            .candidates(scene, 0.02, &candidates)
            .unwrap()
            .iter())
        .collect(),
        near: (detector.near(scene, 0.02, &near).unwrap().iter()).collect(),
    }
}

#[test]
fn no_threshold_changes_the_answer_to_a_step() {
    let mut tunings = extremes();
    tunings.extend(each_of("default", Tuning::default()));
    tunings.extend(each_of("eager", eager()));
    let film = |double, query| Film {
        name: "steps",
        bodies: vec![surfaces::bumpy_ball(300, 0.2), solids::block(3, 3, 2, 0.4)],
        double,
        query,
        motion: twist,
    };
    for film in [
        film(false, |bodies| Query::between(bodies[0], bodies[1])),
        film(true, |_| Query::all()),
    ] {
        let (mut scene, bodies) = film.scene();
        let query = (film.query)(&bodies);
        let mut oracle = detector(Method::Naive, 2, Tuning::default());
        let mut detectors: Vec<_> = tunings
            .iter()
            .map(|tuned| (&tuned.name, detector(Method::Clusters, 2, tuned.tuning)))
            .collect();
        for frame in 5..7 {
            film.show(&mut scene, &bodies, frame);
            for (ix, (&body, positions)) in bodies.iter().zip(film.pose(frame + 1)).enumerate() {
                match film.double && ix == 0 {
                    true => scene.set_end_positions(body, wide(&positions)).unwrap(),
                    false => scene.set_end_positions(body, &positions).unwrap(),
                }
            }
            let expected = answers(&mut oracle, &scene, &query);
            let counts = (expected.impacts.len(), expected.near.len());
            assert!(counts.0 >= 8 && counts.1 >= 8, "{counts:?}");
            for (name, detector) in &mut detectors {
                let found = answers(detector, &scene, &query);
                assert!(found == expected, "frame {frame}, {name}");
            }
        }
    }
}

/// What a threshold governs, seen in the statistics of a few frames: one number with the threshold
/// at 0, and one at infinity.
struct Watched {
    method: Method,
    /// Thresholds that must be at 0 for this one to matter; all others are at infinity.
    at_zero: &'static [&'static str],
    count: fn(&Stats) -> u64,
    expected: fn(u64, u64) -> bool,
}

impl Watched {
    fn new(
        method: Method,
        at_zero: &'static [&'static str],
        count: fn(&Stats) -> u64,
        expected: fn(u64, u64) -> bool,
    ) -> Watched {
        Watched {
            method,
            at_zero,
            count,
            expected,
        }
    }

    /// How a threshold shows in the frames of a film. `None` for those of steps.
    fn of(threshold: &str) -> Option<Watched> {
        let only_at_zero: fn(u64, u64) -> bool = |zero, infinity| zero > 0 && infinity == 0;
        let more_at_zero: fn(u64, u64) -> bool = |zero, infinity| zero > infinity;
        let only_at_infinity: fn(u64, u64) -> bool = |zero, infinity| zero == 0 && infinity > 0;
        let n_shared: fn(&Stats) -> u64 = |stats| stats.ways.n_shared;
        let n_culled: fn(&Stats) -> u64 = |stats| stats.n_culled;
        let in_grid: fn(&Stats) -> u64 = |stats| u64::from(stats.method == "cells");
        let (clusters, cells, auto) = (Method::Clusters, Method::Cells, Method::Auto);
        let new = Watched::new;
        Some(match threshold {
            "call_from" => new(clusters, &[], |stats| stats.ways.n_called, only_at_zero),
            // Helpers may be woken for other reasons too.
            "wake_from" => new(
                clusters,
                &[],
                |stats| stats.ways.wakes.into(),
                |zero, _| zero == N_FRAMES as u64,
            ),
            "pool_from" => new(clusters, &[], |stats| stats.ways.n_pooled, only_at_zero),
            "most_per_task" => new(clusters, &[], |stats| stats.ways.n_tasks, more_at_zero),
            "bounds_parallel_from" => new(clusters, &[], n_shared, only_at_zero),
            "stale_from" => new(clusters, &[], |stats| stats.n_reclustered, only_at_zero),
            "culled_from" => new(clusters, &[], n_culled, only_at_zero),
            "culled_one_in" => new(clusters, &["culled_from"], n_culled, only_at_infinity),
            "culled_cost" => new(
                clusters,
                &["culled_from"],
                |stats| stats.ways.n_came_back,
                more_at_zero,
            ),
            "culled_lasts" => new(clusters, &["culled_from"], n_culled, only_at_infinity),
            "cull_parallel_from" => new(cells, &[], n_shared, more_at_zero),
            "most_maps" => new(cells, &[], |stats| stats.ways.n_mapped, only_at_infinity),
            // A finer map drops more elements.
            "map_cell" => new(
                cells,
                &[],
                |stats| stats.n_entries,
                |zero, infinity| zero < infinity,
            ),
            "most_marked" => new(cells, &[], |stats| stats.ways.n_everywhere, only_at_zero),
            "most_batch_items" => new(
                clusters,
                &[],
                |stats| stats.n_batches,
                |zero, infinity| zero > 2 * infinity,
            ),
            "pairing_parallel_from" => new(clusters, &[], n_shared, only_at_zero),
            "most_cached" => new(clusters, &[], |stats| stats.ways.n_evicted, more_at_zero),
            "directions_from" => new(clusters, &[], |stats| stats.ways.n_parted, only_at_zero),
            "decide_from" => new(cells, &[], |stats| stats.ways.n_full, only_at_zero),
            "auto_from" => new(auto, &["auto_body_from"], in_grid, only_at_zero),
            "auto_body_from" => new(auto, &["auto_from"], in_grid, only_at_zero),
            "auto_most_crowded" => new(
                auto,
                &["auto_from", "auto_body_from"],
                in_grid,
                only_at_infinity,
            ),
            "step_bounds_parallel_from" | "step_shorter_from" | "sort_from" => return None,
            other => panic!("nothing shows that the code behind {other} is entered"),
        })
    }
}

#[test]
fn the_code_behind_each_threshold_is_entered() {
    let film = Film {
        name: "balls",
        bodies: vec![ball(), ball()],
        double: false,
        query: |bodies| Query::between(bodies[0], bodies[1]),
        motion: drift,
    };
    for threshold in Tuning::NAMES {
        let Some(watched) = Watched::of(threshold) else {
            continue;
        };
        let counts = Tuning::ENDS.map(|end| {
            let zero = Tuning::ENDS[ZERO];
            let infinity = Tuning::ENDS[INFINITY];
            let set = |tuning: Tuning, name: &&str| tuning.with(name, &zero);
            let tuning = watched.at_zero.iter().fold(infinity, set);
            let mut detector = detector(watched.method, 2, tuning.with(threshold, &end));
            let mut count = 0;
            film.for_frames(|_, scene, query| {
                // So long that helpers sleep.
                std::thread::sleep(Duration::from_millis(3));
                let pairs = detector.detect(scene, query).unwrap();
                count += (watched.count)(pairs.stats());
            });
            count
        });
        let [zero, infinity] = counts;
        let is_culled = threshold.starts_with("culled");
        if is_culled && !leaves_out() {
            assert_eq!(counts, [0, 0]);
            continue;
        }
        assert!(
            (watched.expected)(zero, infinity),
            "{threshold}: {zero} at 0, {infinity} at infinity"
        );
    }
}

#[test]
fn the_code_behind_thresholds_of_steps_is_entered() {
    let mut scene = Scene::new();
    let ball = ball();
    ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.2, 0.1, 0.0]).add_to(&mut scene).unwrap();
    let to = ball.translated([0.1, 0.1, 0.0]);
    scene.set_end_positions(b, &to.positions).unwrap();
    let query = Query::between_all();
    let counts = |threshold: &str, count: fn(&Stats) -> u64| {
        Tuning::ENDS.map(|end| {
            let tuning = Tuning::ENDS[INFINITY].with(threshold, &end);
            let mut detector = detector(Method::Clusters, 2, tuning);
            count(detector.candidates(&scene, 0.1, &query).unwrap().stats())
        })
    };
    let [zero, infinity] = counts("step_bounds_parallel_from", |stats| stats.ways.n_shared);
    assert!(zero > 0 && infinity == 0, "{zero}, {infinity}");
    let [zero, infinity] = counts("sort_from", |stats| stats.ways.n_counted);
    assert!(zero > 0 && infinity == 0, "{zero}, {infinity}");
    let tuned = |end: usize| {
        let tuning = Tuning::ENDS[INFINITY].with("decide_from", &Tuning::ENDS[end]);
        let mut detector = detector(Method::Clusters, 2, tuning);
        let step = Query::between_all();
        detector.impacts(&scene, &step).unwrap().stats().ways.n_full
    };
    assert!(tuned(ZERO) > 0 && tuned(INFINITY) == 0);
    let shortened = |end: usize| {
        let zero = Tuning::ENDS[ZERO];
        let tuning = Tuning::ENDS[INFINITY].with("most_per_task", &zero);
        let tuning = tuning.with("step_shorter_from", &Tuning::ENDS[end]);
        let mut detector = detector(Method::Clusters, 2, tuning);
        let step = Query::between_all();
        detector.earliest(&scene, &step).unwrap().expect("contacts");
        detector.stats().ways.n_shortened
    };
    assert!(shortened(ZERO) == 0 && shortened(INFINITY) > 0);
}

/// Bodies that are apart at first. Every thread begins with the whole step and goes on with less of
/// it, task by task.
#[test]
fn the_earliest_contact_is_found_however_early_boxes_end() {
    let zero = Tuning::ENDS[ZERO];
    let tuning = Tuning::ENDS[INFINITY].with("most_per_task", &zero);
    let ball = surfaces::bumpy_ball(300, 0.2);
    for ix in 0..24 {
        let double = ix % 2 == 1;
        let film = Film {
            name: "approach",
            bodies: vec![ball.clone(), ball.clone()],
            double,
            query: |bodies| Query::between(bodies[0], bodies[1]),
            motion: twist,
        };
        let (mut scene, bodies) = film.scene();
        // Contacts begin late, early, or in between.
        let speed = [2.5, 8.0, 40.0][ix / 2 % 3];
        let turn = 0.3 * ix as f32;
        let aside = [0.1 * turn.sin(), 0.1 * turn.cos()];
        let put = |body: usize, x: f32| -> Vec<[f32; 3]> {
            let by = [x + 2.6 * body as f32, body as f32 * aside[0], aside[1]];
            ball.translated(by).positions
        };
        for (body_ix, &body) in bodies.iter().enumerate() {
            let ends = [put(body_ix, 0.0), put(body_ix, -speed * body_ix as f32)];
            if double && body_ix == 0 {
                scene.set_positions(body, wide(&ends[0])).unwrap();
                scene.set_end_positions(body, wide(&ends[1])).unwrap();
            } else {
                scene.set_positions(body, &ends[0]).unwrap();
                scene.set_end_positions(body, &ends[1]).unwrap();
            }
        }
        let step = (film.query)(&bodies);
        let mut first = None;
        for threads in 1..3 {
            let mut detector = detector(Method::Clusters, threads, tuning);
            let expected = detector.impacts(&scene, &step).unwrap().earliest();
            assert!(expected.is_some_and(|first| first.toi > 0.0), "scene {ix}");
            assert_eq!(
                detector.earliest(&scene, &step).unwrap(),
                expected,
                "scene {ix}"
            );
            if threads == 1 {
                assert!(detector.stats().ways.n_shortened > 1, "scene {ix}");
            }
            assert_eq!(*first.get_or_insert(expected), expected);
        }
    }
}

/// Triangles that land nearly at once, where rounding makes others touch than the first: all close
/// pairs are found however early boxes end.
#[test]
fn a_step_is_advanced_freely_however_early_boxes_end() {
    let zero = Tuning::ENDS[ZERO];
    let tuning = Tuning::ENDS[INFINITY].with("most_per_task", &zero);
    let mut n_backed_off = 0;
    for seed in 0..40 {
        let mut random = Random::new(seed);
        let (faces, [start, end]) = landing(&mut random, 400, 40.0, 3000.0);
        let mut scene = Scene::new();
        let body = scene.add_triangles(&faces, &start).unwrap();
        scene.set_end_positions(body, &end).unwrap();
        let step = Query::all();
        let mut detector = detector(Method::Clusters, 1, tuning);
        let advance = detector.advance(&scene, &step).unwrap();
        assert!(advance.fraction > 0.0);
        assert!(
            detector.stats().ways.n_shortened > 1,
            "seed {seed}: {advance:?}"
        );
        n_backed_off += u32::from(advance.n_tried > 2);
        for (body, positions) in advance.iter() {
            let Positions::F32(positions) = positions else {
                panic!("double precision")
            };
            scene.set_end_positions(body, positions).unwrap();
        }
        assert!(detector.is_free(&scene, &step).unwrap(), "seed {seed}");
    }
    assert!(n_backed_off > 5, "{n_backed_off}");
}
