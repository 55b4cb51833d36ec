//! Steps: what touches while bodies move, when first, and how far a step can be taken.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use impinge_core::exact::{ElementPair, first_contact};
use impinge_core::{
    Backend, BodyId, CancelToken, Candidates, Control, Detector, Element, Elements, Error, Method,
    PairFilter, PairKind, Part, Positions, Precision, Query, Scene, Settings, Start,
};
use impinge_scenes::Random;
use impinge_tests::{Size, cpu, detector, detectors, landing, times_power};

const FACE: [[u32; 3]; 1] = [[0, 1, 2]];
const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

fn lifted(z: f32) -> [[f32; 3]; 3] {
    CORNERS.map(|[x, y, _]| [x + 1.0, y + 1.0, z])
}

/// A triangle that falls through another; both end far below.
fn falling() -> (Scene, BodyId, BodyId) {
    let mut scene = Scene::new();
    let floor = scene.add_triangles(&FACE, &CORNERS).expect("good");
    let other = scene.add_triangles(&FACE, &lifted(1.0)).expect("good");
    scene.set_end_positions(other, &lifted(-3.0)).expect("good");
    (scene, floor, other)
}

#[test]
fn a_triangle_that_falls_through_another_touches_it_at_a_quarter() {
    for mut detector in detectors() {
        let (scene, floor, other) = falling();
        let impacts = detector.impacts(&scene, &Query::all()).expect("good");
        assert!(
            impacts
                .iter()
                .all(|impact| impact.toi == 0.25 && !impact.at_start)
        );
        // One vertex lands inside the floor; its two edges meet the floor's long edge.
        let rows: Vec<_> = impacts.iter().map(|i| (i.kind, i.a, i.b)).collect();
        let vf = impacts.of(PairKind::VertexFace);
        assert_eq!(vf.len(), 1, "{rows:?}");
        assert_eq!(
            (vf[0].a.body, vf[0].a.element, vf[0].b.body),
            (other, 0, floor)
        );
        assert_eq!(impacts.of(PairKind::EdgeEdge).len(), 2, "{rows:?}");
        let hash = impacts.hash();
        let earliest = detector.earliest(&scene, &Query::all()).expect("good");
        assert_eq!(
            earliest.map(|impact| impact.kind),
            Some(PairKind::VertexFace)
        );
        assert!(!detector.is_free(&scene, &Query::all()).expect("good"));
        let between = Query::between(other, floor).precision(Precision::F64);
        let impacts = detector.impacts(&scene, &between).expect("good");
        assert_eq!(impacts.hash(), hash, "1/4 is the same in both precisions");
    }
}

#[test]
fn a_body_without_end_positions_stands_still() {
    for mut detector in detectors() {
        let (mut scene, _, other) = falling();
        scene.clear_end_positions(other).expect("known");
        assert!(detector.is_free(&scene, &Query::all()).expect("good"));
        scene.set_end_positions(other, &lifted(-3.0)).expect("good");
        assert!(!detector.is_free(&scene, &Query::all()).expect("good"));
        scene.set_positions(other, &lifted(1.0)).expect("good");
        assert!(scene.body(other).expect("known").end_positions().is_none());
        assert!(detector.is_free(&scene, &Query::all()).expect("good"));
    }
}

#[test]
fn what_touches_at_the_start_is_reported_at_zero_or_left_out() {
    for mut detector in detectors() {
        let (mut scene, _, other) = falling();
        scene.set_positions(other, &lifted(0.0)).expect("good");
        scene.set_end_positions(other, &lifted(1.0)).expect("good");
        let impacts = detector.impacts(&scene, &Query::all()).expect("good");
        assert_eq!(
            impacts.iter().filter(|impact| impact.at_start).count(),
            impacts.len()
        );
        assert_eq!(impacts.len(), 3);
        assert!(impacts.iter().all(|impact| impact.toi == 0.0));
        let skip = Query::all().start(Start::Skip);
        assert!(detector.is_free(&scene, &skip).expect("good"));
    }
}

#[test]
fn points_and_edges_meet_each_other_and_surfaces() {
    for mut detector in detectors() {
        let mut scene = Scene::new();
        let point = scene.add_points(&[[0.0f64, 0.0, 1.0]]).expect("good");
        scene
            .set_end_positions(point, &[[0.0f64, 0.0, -1.0]])
            .expect("good");
        let edge = [[-1.0f64, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let edge = scene.add_edges(&[[0, 1]], &edge).expect("good");
        let resting = scene.add_points(&[[0.0f64, 0.0, -0.5]]).expect("good");
        let impacts = detector.impacts(&scene, &Query::all()).expect("good");
        let rows: Vec<_> = impacts
            .iter()
            .map(|i| (i.kind, i.a.body, i.b.body, i.toi))
            .collect();
        let expected = [
            (PairKind::EdgeVertex, edge, point, 0.5),
            (PairKind::VertexVertex, point, resting, 0.75),
        ];
        assert_eq!(rows, expected);
    }
}

#[test]
fn a_step_that_is_advanced_is_free_to_its_rounded_end() {
    for mut detector in detectors() {
        let (mut scene, _, other) = falling();
        let advance = detector.advance(&scene, &Query::all()).expect("good");
        assert!(
            advance.fraction > 0.249_999 && advance.fraction < 0.25,
            "{advance:?}"
        );
        advance.apply(&mut scene).expect("same bodies");
        assert!(
            detector
                .detect(&scene, &Query::between_all())
                .expect("good")
                .is_empty()
        );
        // The body goes on from there, but never passes through.
        scene.set_end_positions(other, &lifted(-3.0)).expect("good");
        let next = detector.advance(&scene, &Query::all()).expect("good");
        assert!(next.fraction < 1e-6, "{next:?}");
        // Upwards the whole step is free.
        scene.set_end_positions(other, &lifted(2.0)).expect("good");
        let up = detector.advance(&scene, &Query::all()).expect("good");
        assert_eq!((up.fraction, up.first), (1.0, None));
        up.apply(&mut scene).expect("same bodies");
        assert_eq!(
            scene.body(other).expect("known").positions(),
            &lifted(2.0).to_vec().into()
        );
    }
}

type Take<'a> = &'a dyn Fn(&mut Scene) -> Result<(), Error>;

/// Nothing is known of a step once any body is somewhere else.
#[test]
fn a_step_is_taken_from_where_it_was_found_only() {
    let mut detector = Detector::new(Backend::Cpu).expect("a CPU");
    let (scene, ground, other) = falling();
    let advance = detector.advance(&scene, &Query::all()).expect("good");
    let truncation = detector.truncate(&scene, &Query::all()).expect("good");
    let takes: [Take<'_>; 2] = [&|scene| advance.apply(scene), &|scene| {
        truncation.apply(scene)
    }];
    for take in takes {
        let refused = |scene: &Scene, body: BodyId, text: &str| {
            let mut now = scene.clone();
            let positions = |scene: &Scene| scene.body(other).map(|body| body.positions().clone());
            let error = take(&mut now).expect_err("somewhere else").to_string();
            assert!(
                error.starts_with(&format!("body {body}: {text}")),
                "{error}"
            );
            assert_eq!(positions(&now).ok(), positions(scene).ok());
        };
        let elsewhere = "this was found for other positions than it has now";
        // A clone does as well, but only once; where it goes to next does not matter.
        let mut taken = scene.clone();
        taken.set_end_positions(other, &lifted(5.0)).expect("good");
        take(&mut taken).expect("the same positions");
        refused(&taken, other, elsewhere);
        // A body that does not move.
        let mut moved = scene.clone();
        let positions = moved.body(ground).expect("known").positions().clone();
        moved.set_positions(ground, positions).expect("good");
        refused(&moved, ground, elsewhere);
        let mut more = scene.clone();
        let new = more.add_points(&[[9.0f32; 3]]).expect("good");
        refused(&more, new, "it was added after this was found");
        // What is gone is met by nothing.
        let mut fewer = scene.clone();
        fewer.remove(ground).expect("known");
        take(&mut fewer).expect("the others are the same");
        fewer.remove(other).expect("known");
        assert!(matches!(take(&mut fewer), Err(Error::UnknownBody { .. })));
    }
}

/// Only the end of a step says whether the next transform begins at rest or where the step led.
#[test]
fn a_step_to_positions_ends_where_transforms_begin() {
    let mut detector = Detector::new(Backend::Cpu).expect("a CPU");
    let raised = |z: f64| {
        let mut matrix = [[0.0; 4]; 4];
        (0..4).for_each(|ix| matrix[ix][ix] = 1.0);
        matrix[2][3] = z;
        matrix
    };
    let rest = |scene: &Scene, body| scene.body(body).expect("known").rest_positions().point(0)[2];
    let (mut scene, _, other) = falling();
    scene.set_positions(other, &lifted(1.0)).expect("good");
    scene.set_transform(other, &raised(1.0)).expect("good");
    scene.set_end_positions(other, &lifted(3.0)).expect("good");
    let bent = detector.advance(&scene, &Query::all()).expect("good");
    bent.apply(&mut scene).expect("the same positions");
    assert_eq!(rest(&scene, other), 3.0);
    scene.set_end_transform(other, &raised(1.0)).expect("good");
    let raised_by_one = detector.truncate(&scene, &Query::all()).expect("good");
    // Where it is to go afterwards does not matter.
    scene.clear_end_positions(other).expect("known");
    raised_by_one.apply(&mut scene).expect("the same positions");
    let body = scene.body(other).expect("known");
    assert_eq!(body.positions().point(0)[2], 4.0);
    assert_eq!(rest(&scene, other), 3.0);
}

/// Transforms are those of the rest positions, also after a step was taken.
#[test]
fn transforms_do_not_accumulate_over_steps() {
    let at = |z: f64| {
        [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    };
    for begins_with_one in [false, true] {
        let mut detector = Detector::new(Backend::Cpu).expect("a CPU");
        let (mut scene, _, other) = falling();
        scene.set_positions(other, &lifted(1.0)).expect("good");
        if begins_with_one {
            scene.set_transform(other, &at(0.0)).expect("good");
        }
        for height in [1.0, 2.0, 3.0] {
            scene.set_end_transform(other, &at(height)).expect("good");
            if height == 2.0 {
                let truncation = detector.truncate(&scene, &Query::all()).expect("good");
                truncation.apply(&mut scene).expect("the same positions");
            } else {
                let advance = detector.advance(&scene, &Query::all()).expect("good");
                advance.apply(&mut scene).expect("the same positions");
            }
            let body = scene.body(other).expect("known");
            let expected = lifted(1.0 + height as f32).to_vec().into();
            assert_eq!(body.positions(), &expected);
            assert_eq!(body.rest_positions(), &lifted(1.0).to_vec().into());
            assert_eq!(body.transform(), None);
        }
        // A refused one changes nothing.
        let scaled = [[1e38, 1e38, 0.0, 1e38], at(0.0)[1], at(0.0)[2], at(0.0)[3]];
        scene
            .set_transform(other, &scaled.map(|row| row.map(|x| x * 1e10)))
            .expect_err("no floats");
        let body = scene.body(other).expect("known");
        assert_eq!(body.positions(), &lifted(4.0).to_vec().into());
        scene.set_transform(other, &at(0.5)).expect("good");
        let body = scene.body(other).expect("known");
        assert_eq!(body.positions(), &lifted(1.5).to_vec().into());
        // What is given is where the next begins.
        scene.set_positions(other, &lifted(2.0)).expect("good");
        scene.set_end_transform(other, &at(1.0)).expect("good");
        let body = scene.body(other).expect("known");
        assert_eq!(body.end_positions(), Some(&lifted(3.0).to_vec().into()));
    }
}

/// Triangles that land on a slope nearly at once: rounding makes others touch than the first. The
/// naive method searches all pairs for every fraction.
#[test]
fn a_step_is_advanced_as_far_as_by_testing_all_pairs() {
    let mut n_backed_off = 0;
    for seed in 0..600 {
        let mut random = impinge_scenes::Random::new(seed);
        let (far, n) = ([3000.0, 40_000.0, 7.0][seed as usize % 3], 24);
        let (faces, [start, end]) = landing(&mut random, n, 2.0, far);
        let step = Query::all().start(Start::Skip);
        for is_single in [true, false] {
            let mut scene = Scene::new();
            if is_single {
                let body = scene.add_triangles(&faces, &start).expect("good");
                scene.set_end_positions(body, &end).expect("good");
            } else {
                // Thirds, so that nothing is a short number.
                let [start, end] = [&start, &end].map(|points| {
                    let thirds = points.iter().map(|p| p.map(|x| f64::from(x) / 3.0));
                    thirds.collect::<Vec<[f64; 3]>>()
                });
                let body = scene.add_triangles(&faces, &start).expect("good");
                scene.set_end_positions(body, &end).expect("good");
            }
            let [expected, others @ ..] =
                detectors().map(|mut detector| detector.advance(&scene, &step).expect("good"));
            for other in &others {
                assert_eq!(*other, expected, "{seed}");
            }
            n_backed_off += usize::from(expected.n_tried > 2);
        }
    }
    assert!(n_backed_off > 20, "{n_backed_off}");
}

/// Thousands of triangles that land within a last bit: too many pairs are close for the list of one
/// thread.
#[test]
fn a_step_is_advanced_freely_where_very_many_pairs_are_close() {
    let mut n_backed_off = 0;
    for seed in 0..8 {
        let mut random = impinge_scenes::Random::new(seed);
        let (faces, [start, end]) = landing(&mut random, 30_000, 400.0, 40_000.0);
        let mut scene = Scene::new();
        let body = scene.add_triangles(&faces, &start).expect("good");
        scene.set_end_positions(body, &end).expect("good");
        let step = Query::all().start(Start::Skip);
        let advances = [1, 4].map(|threads| {
            let settings = Settings::new().backend(Backend::Cpu).threads(threads);
            let mut detector = Detector::new(settings).expect("settings");
            detector.advance(&scene, &step).expect("good")
        });
        assert_eq!(advances[0], advances[1], "{seed}");
        let advance = &advances[0];
        n_backed_off += u32::from(advance.n_tried > 2);
        for (body, positions) in advance.iter() {
            let Positions::F32(positions) = positions else {
                panic!("double precision")
            };
            scene.set_end_positions(body, positions).expect("good");
        }
        let mut detector = Detector::new(Backend::Cpu).expect("settings");
        assert!(detector.is_free(&scene, &step).expect("good"), "{seed}");
    }
    assert!(n_backed_off > 1, "{n_backed_off}");
}

/// Elements that are nearer to a tie than single precision can tell: about half of them touch, or
/// are within a distance, or have boxes that do.
#[test]
fn elements_in_double_precision_are_answered_as_pair_by_pair() {
    let mut n_found = [0; 3];
    let mut n_candidates = 0;
    for seed in 0..40 {
        let mut random = impinge_scenes::Random::new(seed);
        let far = [3000.0, 40_000.0][seed as usize % 2];
        let (faces, [start, end]) = landing(&mut random, 60, 3.0, far);
        let tie = 1e-7 * f64::from(far);
        // All land between 0.5 and 0.5 + 2 `tie`, and the step ends in the middle.
        let at = |time: f64| {
            let pairs = start.iter().zip(&end);
            let points = pairs.map(|(x, y)| {
                let way = |k: usize| (f64::from(y[k]) - f64::from(x[k])) * time;
                std::array::from_fn(|k| (f64::from(x[k]) + way(k)) / 3.0)
            });
            points.collect::<Vec<[f64; 3]>>()
        };
        let mut scene = Scene::new();
        let body = scene.add_triangles(&faces, &at(0.0)).expect("good");
        scene.set_end_positions(body, at(0.5 + tie)).expect("good");
        let mut still = Scene::new();
        still
            .add_triangles(&faces, &at(0.5 - 2.0 * tie))
            .expect("good");
        let kinds = [PairKind::VertexFace, PairKind::EdgeEdge];
        let near = Query::all().kinds(kinds);
        let candidates = Query::all();
        let answers = detectors().map(|mut detector| {
            let impacts = detector.impacts(&scene, &Query::all()).expect("good");
            let impacts = (impacts.len(), impacts.hash());
            let near = detector.near(&still, 0.2 * tie, &near).expect("good");
            let near = (near.len(), near.hash());
            let keep = (Query::all()).separation(0.1 * tie);
            let kept = detector.impacts(&scene, &keep).expect("good");
            let kept = (kept.len(), kept.hash());
            let candidates = detector
                .candidates(&scene, 0.01, &candidates)
                .expect("good");
            let candidates = (candidates.len(), candidates.hash());
            [impacts, near, kept, candidates]
        });
        assert_eq!(answers, [answers[0]; 4], "{seed}");
        for (n, (found, _)) in n_found.iter_mut().zip(&answers[0]) {
            *n += found;
        }
        n_candidates += answers[0][3].0;
    }
    assert!(
        n_found.iter().all(|&n| n > 100) && n_candidates > 1000,
        "{n_found:?} {n_candidates}"
    );
}

/// A vertex meets a face between corners on both sides of it; at the start, one corner is farther
/// away than single precision can tell.
#[test]
fn differences_that_overflow_hide_no_contact() {
    let vertex = [[-3e38f32, 1.0, 1.0], [0.0, 1.0, 1.0]];
    let faces = [
        [[3e38f32, 0.0, 0.0], [3e37, 8.0, 0.0], [3e37, 0.0, 8.0]],
        [[-5.0, 0.0, 0.0], [10.0, 8.0, 0.0], [10.0, 0.0, 8.0]],
    ];
    // The other two corners of its triangle are aside.
    let with_vertex = vertex.map(|[x, y, z]| [[x, y, z], [x, 1e6, 1e6], [x, 1e6, 2e6]]);
    let mut scene = Scene::new();
    for [start, end] in [with_vertex, faces] {
        let body = scene.add_triangles(&FACE, &start).expect("good");
        scene.set_end_positions(body, &end).expect("good");
    }
    let step = Query::all();
    let found = detectors().map(|mut detector| {
        let impacts = detector.impacts(&scene, &step).expect("good");
        (impacts.len(), impacts.hash())
    });
    assert_eq!(found, [found[0]; 4]);
    assert!(found[0].0 > 0);
}

/// Steps, distances and boxes of numbers from one end of the range to the other.
#[test]
fn numbers_of_any_size_are_answered_as_pair_by_pair() {
    let mut n_found = [0; 4];
    for (seed, size) in (1..).zip(Size::ALL) {
        let mut random = impinge_scenes::Random::new(seed);
        let mut points = |n: u32| {
            let points = (0..n).map(|_| [(); 3].map(|()| random.below(5) as f32));
            points.collect::<Vec<_>>()
        };
        let faces: Vec<[u32; 3]> = (0..3)
            .map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % 9])
            .collect();
        let mut scene = Scene::new();
        let body = scene
            .add_triangles(&faces, &size.points(&points(9), seed))
            .expect("good");
        let end = size.points(&points(9), seed + 10);
        scene.set_end_positions(body, &end).expect("good");
        let edges = size.points(&points(4), seed + 20);
        let body = scene.add_edges(&[[0, 1], [2, 3]], &edges).expect("good");
        let end = size.points(&points(4), seed + 30);
        scene.set_end_positions(body, &end).expect("good");
        let unit = match size {
            Size::Axes([exponent, ..]) => times_power(1.0, exponent),
            _ => 1.0,
        };
        let step = Query::all();
        let answers = detectors().map(|mut detector| {
            let impacts = detector.impacts(&scene, &step).expect("good");
            let impacts = (impacts.len(), impacts.hash());
            let query = Query::all().kinds(PairKind::ALL).closest_points();
            let near = detector.near(&scene, unit, &query).expect("good");
            for pair in near.iter() {
                let closest = pair.closest.expect("asked for");
                assert!(closest.points.as_flattened().iter().all(|x| x.is_finite()));
            }
            let near = (near.len(), near.hash());
            let keep = Query::all().separation(unit);
            let kept = detector.impacts(&scene, &keep).expect("good");
            let kept = (kept.len(), kept.hash());
            let query = Query::all();
            let candidates = detector.candidates(&scene, unit, &query).expect("good");
            let candidates = (candidates.len(), candidates.hash());
            let earliest = detector.earliest(&scene, &step).expect("good");
            let skip = Query::all().start(Start::Skip);
            let is_free = detector.is_free(&scene, &skip).expect("good");
            // What is left of the way is free, to the rounded positions.
            let advance = detector.advance(&scene, &skip).expect("good");
            let mut advanced = scene.clone();
            for (body, positions) in advance.iter() {
                assert!(
                    (0..positions.len())
                        .all(|ix| positions.point(ix).iter().all(|x| x.is_finite()))
                );
                match positions {
                    Positions::F64(rows) => advanced.set_end_positions(body, rows).expect("good"),
                    Positions::F32(_) => unreachable!("given as f64"),
                }
            }
            assert!(
                detector.is_free(&advanced, &skip).expect("good"),
                "{size:?}"
            );
            let reached = advance.iter().map(|(body, at)| (body, at.clone()));
            let rest = (
                earliest,
                is_free,
                advance.fraction,
                reached.collect::<Vec<_>>(),
            );
            ([impacts, near, kept, candidates], rest)
        });
        assert_eq!(
            [&answers[1], &answers[2]],
            [&answers[0]; 2],
            "{size:?} {seed}"
        );
        for (n, (found, _)) in n_found.iter_mut().zip(&answers[0].0) {
            *n += found;
        }
    }
    assert!(n_found.iter().all(|&n| n > 100), "{n_found:?}");
}

/// A damped motion: every coordinate of one body shrinks in each frame, to the smallest numbers
/// that there are.
#[test]
fn a_motion_that_dies_away_goes_on() {
    let mut random = impinge_scenes::Random::new(5);
    let mut points = |n: usize| -> Vec<[f64; 3]> {
        let mut x = || f64::from(random.range(-1.0, 1.0));
        (0..n).map(|_| [x(), x(), x()]).collect()
    };
    let faces: Vec<[u32; 3]> = (0..8).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let (mut shrinking, still) = (points(24), points(24));
    let mut scene = Scene::new();
    let body = scene.add_triangles(&faces, &shrinking).expect("good");
    scene.add_triangles(&faces, &still).expect("good");
    let [mut detector, .., mut naive] = detectors();
    let mut hashes = std::collections::BTreeSet::new();
    for frame in 0..10_000 {
        shrinking
            .as_flattened_mut()
            .iter_mut()
            .for_each(|x| *x *= 0.9);
        scene
            .set_positions(body, &shrinking)
            .expect("every finite number is taken");
        let hash = detector.detect(&scene, &Query::all()).expect("good").hash();
        hashes.insert(hash);
        if frame % 500 == 0 || frame == 1_622 {
            let expected = naive.detect(&scene, &Query::all()).expect("good").hash();
            assert_eq!(hash, expected, "{frame}");
        }
    }
    assert!(hashes.len() > 3);
}

#[test]
fn bad_end_positions_are_refused_by_name() {
    let (mut scene, _, other) = falling();
    let few = scene.set_end_positions(other, &CORNERS[..2]);
    let wrong = Error::WrongNumberOfPositions {
        body: other,
        given: 2,
        expected: 3,
    };
    assert_eq!(few, Err(wrong));
    let bad = scene.set_end_positions(other, &[[0.0; 3], [0.0, f32::NAN, 0.0], [0.0; 3]]);
    assert!(matches!(
        bad,
        Err(Error::NonFinitePosition { vertex: 1, .. })
    ));
    let kept = scene.body(other).expect("known").end_positions();
    assert_eq!(kept, Some(&lifted(-3.0).to_vec().into()));
    let distance = Query::between_all();
    for mut detector in detectors() {
        let refused = detector.candidates(&scene, -1.0, &distance);
        assert!(matches!(
            refused,
            Err(Error::Setting {
                setting: "inflation",
                ..
            })
        ));
    }
}

#[test]
fn candidates_are_boxes_that_overlap_within_twice_the_distance() {
    for mut detector in detectors() {
        let mut scene = Scene::new();
        scene.add_points(&[[0.0f32, 0.0, 0.0]]).expect("good");
        let far = scene.add_points(&[[3.0f32, 0.0, 0.0]]).expect("good");
        let query = Query::all().kinds([PairKind::VertexVertex]);
        let mut count = |scene: &Scene, distance: f64| {
            detector
                .candidates(scene, distance, &query)
                .expect("good")
                .len()
        };
        assert_eq!(
            [0.0, 1.0, 1.5_f64.next_down(), 1.5].map(|d| count(&scene, d)),
            [0, 0, 0, 1]
        );
        scene
            .set_end_positions(far, &[[1.0f32, 0.0, 0.0]])
            .expect("good");
        assert_eq!([0.49, 0.5].map(|d| count(&scene, d)), [0, 1]);
    }
}

/// A surface, edges and points that move at random: all six kinds of pairs, between bodies and
/// within them.
fn crowd(is_double: bool) -> Scene {
    let mut random = impinge_scenes::Random::new(5);
    let mut points = |n: u32, size: f32| -> Vec<[f32; 3]> {
        let mut at = || random.below(1 << 12) as f32 / 1024.0 * size;
        (0..n).map(|_| [at(), at(), at()]).collect()
    };
    let wide = |points: &[[f32; 3]]| -> Vec<[f64; 3]> {
        points.iter().map(|point| point.map(f64::from)).collect()
    };
    let triangles = (0..32).map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % 96]);
    let mut scene = Scene::new();
    for (elements, n) in [
        (Elements::Triangles(triangles.collect()), 96),
        (Elements::Edges((0..79).map(|e| [e, e + 1]).collect()), 80),
        (Elements::Points((0..70).map(|point| [point]).collect()), 70),
    ] {
        let (start, way) = (points(n, 1.0), points(n, 0.125));
        let moved = start.iter().zip(&way);
        let moved = moved.map(|(p, q)| std::array::from_fn(|axis| p[axis] + q[axis]));
        let end: Vec<[f32; 3]> = moved.collect();
        if is_double {
            let body = scene.add((elements, wide(&start))).expect("good");
            scene.set_end_positions(body, wide(&end)).expect("good");
        } else {
            let body = scene.add((elements, start)).expect("good");
            scene.set_end_positions(body, &end).expect("good");
        }
    }
    scene
}

type Candidate = (PairKind, Element, Element);

/// All candidates run by run, and the lengths of the runs.
fn in_runs(
    detector: &mut Detector,
    scene: &Scene,
    inflation: f64,
    query: &Query,
    most: u64,
) -> (Vec<Candidate>, Vec<usize>) {
    let (mut all, mut lengths) = (Vec::new(), Vec::new());
    let mut each = |run: Candidates| {
        all.extend(run.iter());
        lengths.push(run.len());
        ControlFlow::<()>::Continue(())
    };
    let n = detector.candidates_in_runs(scene, inflation, query, most, &mut each);
    assert_eq!(n, Ok(ControlFlow::Continue(all.len() as u64)));
    (all, lengths)
}

#[test]
fn candidates_in_runs_are_all_candidates_in_their_order() {
    for is_double in [false, true] {
        let scene = crowd(is_double);
        for kinds in [
            &PairKind::ALL[..],
            &[PairKind::FaceFace, PairKind::VertexVertex],
        ] {
            let query = Query::all().kinds(kinds.iter().copied());
            let mut expected = None;
            for (method, threads) in [
                (Method::Naive, 1),
                (Method::Clusters, 1),
                (Method::Clusters, 3),
            ] {
                let mut detector = Detector::new(
                    Settings::new()
                        .method(method)
                        .threads(threads)
                        .backend(Backend::Cpu),
                )
                .expect("settings");
                let whole = detector.candidates(&scene, 0.0625, &query).expect("good");
                let hash = whole.hash();
                let whole: Vec<Candidate> = whole.iter().collect();
                let expected = &*expected.get_or_insert_with(|| whole.clone());
                assert_eq!(whole, *expected);
                let n = whole.len();
                for kind in kinds {
                    assert!(whole.iter().any(|row| row.0 == *kind), "{kind:?}");
                }
                for most in [n as u64 / 60, n as u64 - 1, n as u64, u64::MAX] {
                    let most = most.max(1);
                    let (all, lengths) = in_runs(&mut detector, &scene, 0.0625, &query, most);
                    assert!(
                        all == whole,
                        "{method:?}, {threads} threads, {most} per run"
                    );
                    assert!(lengths.iter().all(|&n| n > 0 && n as u64 <= most));
                    assert_eq!(lengths.len() == 1, most >= n as u64);
                }
                let mut sum = 0u64;
                let all =
                    detector.candidates_in_runs(&scene, 0.0625, &query, 1 + n as u64 / 5, |run| {
                        sum = sum.wrapping_add(run.hash());
                        assert!(run.stats().total_ms > 0.0 && run.stats().n_threads == threads);
                        ControlFlow::<()>::Continue(())
                    });
                assert_eq!((all, sum), (Ok(ControlFlow::Continue(n as u64)), hash));
            }
        }
    }
}

/// The same step backwards.
fn reversed(scene: &Scene) -> Scene {
    let mut reversed = scene.clone();
    for (id, body) in scene.bodies() {
        let end = body.end_positions().expect("all move");
        reversed.set_positions(id, end).expect("good");
        reversed
            .set_end_positions(id, body.positions())
            .expect("good");
    }
    reversed
}

/// The octants around a point, as half-open cells.
fn octants(middle: [f64; 3]) -> impl Iterator<Item = [[f64; 3]; 2]> {
    (0..8).map(move |octant| {
        let side = |low: f64, high: f64| {
            std::array::from_fn(|axis| match octant >> axis & 1 {
                0 => low,
                _ => high,
            })
        };
        let [low, high] = [side(f64::NEG_INFINITY, 0.0), side(0.0, f64::INFINITY)];
        let cut = |end: [f64; 3]| {
            std::array::from_fn(|axis| {
                if end[axis] == 0.0 {
                    middle[axis]
                } else {
                    end[axis]
                }
            })
        };
        [cut(low), cut(high)]
    })
}

/// Whether the box of an element over a step, inflated, has points in a cell.
fn touches_cell(
    scene: &Scene,
    (part, element): (Part, Element),
    margin: f64,
    [low, high]: [[f64; 3]; 2],
) -> bool {
    let body = scene.body(element.body).expect("known");
    let corners = match part {
        Part::Vertices => vec![element.element],
        _ => body.part(part).corners(element.element as usize).to_vec(),
    };
    let end = body.end_positions().expect("all move");
    (0..3).all(|axis| {
        let of_axis = |p: &Positions, v: u32| p.point(v as usize)[axis];
        let ends = corners
            .iter()
            .flat_map(|&v| [of_axis(body.positions(), v), of_axis(end, v)]);
        let (min, max) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), x| {
            (x.min(min), x.max(max))
        });
        min - margin < high[axis] && low[axis] <= max + margin
    })
}

fn parts(kind: PairKind) -> [Part; 2] {
    match kind {
        PairKind::VertexFace => [Part::Vertices, Part::Faces],
        PairKind::EdgeEdge => [Part::Edges, Part::Edges],
        PairKind::EdgeVertex => [Part::Edges, Part::Vertices],
        PairKind::VertexVertex => [Part::Vertices, Part::Vertices],
        PairKind::EdgeFace => [Part::Edges, Part::Faces],
        PairKind::FaceFace => [Part::Faces, Part::Faces],
    }
}

/// Each pair belongs to one cell, and a process that has what touches the cell has both of its
/// elements.
#[test]
fn pairs_of_all_cells_are_the_pairs_of_the_whole() {
    // Coordinates are multiples of 2^-10 or less: boxes end at the cut.
    let middle = [2.0, 1.5, 1.75];
    for (is_double, separation) in [(false, 0.0), (true, 0.0), (false, 0.0625), (true, 0.0625)] {
        // Backwards: boxes over the step begin where elements end.
        let scene = reversed(&crowd(is_double));
        let whole = Query::all().separation(separation);
        for mut detector in detectors() {
            let expected = detector.impacts(&scene, &whole).expect("good");
            let (n, hash) = (expected.len(), expected.hash());
            assert!(n > 100, "{n}");
            let first = detector.earliest(&scene, &whole).expect("good");
            let everything = Query::all().kinds(PairKind::ALL);
            let pairs = detector.near(&scene, separation, &everything);
            let of_near = pairs.expect("good").hash();
            let of_boxes = detector.candidates(&scene, 0.0625, &everything);
            let of_boxes = of_boxes.expect("good").hash();
            let (mut sums, mut n_found, mut firsts) = ([0u64; 3], 0, Vec::new());
            for cell @ [low, high] in octants(middle) {
                let query = Query::all().owned_by(low, high);
                let kinds = query.clone().kinds(PairKind::ALL);
                let step = query.separation(separation);
                let found = detector.impacts(&scene, &step).expect("good");
                n_found += found.len();
                let (is_empty, hash) = (found.is_empty(), found.hash());
                for impact in found.iter() {
                    let [a, b] = parts(impact.kind);
                    assert!(
                        touches_cell(&scene, (a, impact.a), separation, cell),
                        "{impact:?}"
                    );
                    assert!(
                        touches_cell(&scene, (b, impact.b), separation, cell),
                        "{impact:?}"
                    );
                }
                assert_eq!(detector.is_free(&scene, &step).expect("good"), is_empty);
                firsts.extend(detector.earliest(&scene, &step).expect("good"));
                let pairs = detector.near(&scene, separation, &kinds);
                let of_near = pairs.expect("good").hash();
                let found = detector.candidates(&scene, 0.0625, &kinds).expect("good");
                for (kind, a, b) in found.iter() {
                    let [of_a, of_b] = parts(kind);
                    assert!(touches_cell(&scene, (of_a, a), 0.125, cell));
                    assert!(touches_cell(&scene, (of_b, b), 0.125, cell));
                }
                let of_boxes = found.hash();
                let found: Vec<Candidate> = found.iter().collect();
                let (runs, _) = in_runs(&mut detector, &scene, 0.0625, &kinds, 97);
                assert_eq!(runs, found);
                for (sum, hash) in sums.iter_mut().zip([hash, of_near, of_boxes]) {
                    *sum = sum.wrapping_add(hash);
                }
            }
            assert_eq!((n_found, sums), (n, [hash, of_near, of_boxes]));
            let key =
                |impact: &impinge_core::Impact| (impact.toi.to_bits(), impact.kind, impact.row());
            assert_eq!(firsts.into_iter().min_by_key(key), first);
        }
    }
}

#[test]
fn the_way_that_a_step_can_be_taken_has_no_cell() {
    let (scene, ..) = falling();
    let step = Query::between_all().owned_by([0.0; 3], [1.0; 3]);
    for mut detector in detectors() {
        let error = detector.advance(&scene, &step).unwrap_err().to_string();
        assert!(error.starts_with("owned_by: "), "{error}");
    }
}

/// All candidates have the same lower number, so that runs must be divided by the higher one.
#[test]
fn one_element_with_many_candidates_is_divided_too() {
    let mut scene = Scene::new();
    scene.add_points(&[[0.0f32; 3]]).expect("good");
    let many: Vec<[f32; 3]> = (0..1000).map(|i| [i as f32 / 1000.0, 0.0, 0.0]).collect();
    scene.add_points(&many).expect("good");
    let query = Query::between_all().kinds([PairKind::VertexVertex]);
    for mut detector in detectors() {
        let (all, lengths) = in_runs(&mut detector, &scene, 1.0, &query, 7);
        assert!(lengths.iter().all(|n| (1..=7).contains(n)));
        let others = all.iter().map(|row| row.2.element);
        assert!(others.eq(0..1000));
    }
}

#[test]
fn runs_of_candidates_end_when_they_are_told_to() {
    let scene = crowd(false);
    let query = Query::all();
    for mut detector in detectors() {
        let whole = detector
            .candidates(&scene, 0.0, &query)
            .expect("good")
            .len() as u64;
        let mut n_runs = 0;
        let mut third = |run: Candidates| {
            n_runs += 1;
            match n_runs {
                3 => ControlFlow::Break(run.len()),
                _ => ControlFlow::Continue(()),
            }
        };
        let found = detector.candidates_in_runs(&scene, 0.0, &query, 20, &mut third);
        assert!(matches!(found, Ok(ControlFlow::Break(1..=20))), "{found:?}");
        assert_eq!(n_runs, 3);

        let token = CancelToken::new();
        detector.set_control(Control::new().cancel(&token));
        let mut n_runs = 0;
        let cancel = |_| {
            n_runs += 1;
            token.cancel();
            ControlFlow::<()>::Continue(())
        };
        let found = detector.candidates_in_runs(&scene, 0.0, &query, 20, cancel);
        assert_eq!((found, n_runs), (Err(Error::Cancelled), 1));
        detector.set_control(Control::new());

        let nothing = |_| -> ControlFlow<()> { panic!("no run") };
        let refused = detector.candidates_in_runs(&scene, 0.0, &query, 0, nothing);
        assert!(matches!(
            refused,
            Err(Error::Setting {
                setting: "most",
                ..
            })
        ));
        let apart = Query::all().kinds([]);
        let none = detector.candidates_in_runs(&scene, 0.0, &apart, 20, nothing);
        assert_eq!(none, Ok(ControlFlow::Continue(0)));

        // The limit of pairs is for all runs together.
        for (limit, most) in [(whole - 1, 20), (whole - 1, whole), (10, 20), (whole, 20)] {
            let mut limited = Detector::new(detector.settings().clone().max_pairs(Some(limit)))
                .expect("settings");
            let mut n = 0;
            let found = limited.candidates_in_runs(&scene, 0.0, &query, most, |run| {
                n += run.len() as u64;
                ControlFlow::<()>::Continue(())
            });
            match found {
                Err(Error::TooManyPairs { limit: told, .. }) => {
                    assert!(limit < whole && told == limit && n == 0);
                }
                found => assert_eq!((found, n), (Ok(ControlFlow::Continue(whole)), limit)),
            }
        }
        // The detector goes on.
        assert_eq!(
            in_runs(&mut detector, &scene, 0.0, &query, 50).0.len() as u64,
            whole
        );
    }
}

#[test]
fn a_cancelled_question_about_a_step_ends_and_the_detector_goes_on() {
    let token = CancelToken::new();
    token.cancel();
    let control = Control::new().cancel(&token);
    let step = Query::all();
    for mut detector in detectors() {
        let (scene, _, _) = falling();
        detector.set_control(control.clone());
        let impacts = detector.impacts(&scene, &step).err();
        assert_eq!(impacts, Some(Error::Cancelled));
        let earliest = detector.earliest(&scene, &step).err();
        assert_eq!(earliest, Some(Error::Cancelled));
        let is_free = detector.is_free(&scene, &step).err();
        assert_eq!(is_free, Some(Error::Cancelled));
        let advance = detector.advance(&scene, &step).err();
        assert_eq!(advance, Some(Error::Cancelled));
        let query = Query::all();
        let candidates = detector.candidates(&scene, 0.0, &query).err();
        assert_eq!(candidates, Some(Error::Cancelled));
        detector.set_control(Control::new());
        assert_eq!(detector.is_free(&scene, &step), Ok(false));
    }
}

/// Each pair of these takes exact arithmetic hundreds of milliseconds: the filter, which is asked
/// before, counts them and lets none pass.
#[test]
fn no_pair_is_decided_exactly_after_a_cancellation() {
    let start = [
        [-8e-220, 3e-185, 3e41],
        [2e-202, -3e260, -2e-36],
        [-2e239, -2e109, -2e-23],
        [2e107, 1e-212, -1e-296],
    ];
    let end = [
        [-3e-152, -2e-220, -2e-160],
        [4e-284, 4e39, -4e96],
        [-2e66, 1e-9, 3e120],
        [1e-80, 8e33, -5e-200],
    ];
    let mut scene = Scene::new();
    for _ in 0..2 {
        let body = scene.add_triangles(&[[0, 1, 2], [1, 2, 3]], &start);
        (scene.set_end_positions(body.expect("good"), &end)).expect("good");
    }
    for separation in [0.0, 0.5] {
        let asked = |token: Option<CancelToken>| {
            let n_asked = Arc::new(AtomicU64::new(0));
            let (counter, own) = (Arc::clone(&n_asked), token.clone());
            let filter = PairFilter::new(move |_| {
                counter.fetch_add(1, Ordering::Relaxed);
                own.iter().for_each(CancelToken::cancel);
                false
            });
            let settings = Settings::new().backend(Backend::Cpu).threads(1);
            let mut detector = Detector::new(settings).expect("settings");
            detector.set_control(token.iter().fold(Control::new(), Control::cancel));
            let query = Query::between_all().separation(separation).filter(filter);
            let n = detector.impacts(&scene, &query).map(|found| found.len());
            (n, n_asked.load(Ordering::Relaxed))
        };
        let (n, n_asked) = asked(None);
        assert!(n == Ok(0) && n_asked > 4, "{n:?}, {n_asked} pairs");
        let token = Some(CancelToken::new());
        assert_eq!(asked(token), (Err(Error::Cancelled), 1), "{separation}");
    }
}

/// Lattice coordinates make a third of the cases degenerate.
#[test]
fn lattices_are_answered_as_pair_by_pair() {
    for seed in 0..12 {
        let mut random = impinge_scenes::Random::new(seed);
        let mut lattice = |n: usize| -> Vec<[f32; 3]> {
            let mut at = || random.below(5) as f32;
            (0..n).map(|_| [at(), at(), at()]).collect()
        };
        let n = 24;
        let (start, end) = (lattice(n), lattice(n));
        let faces: Vec<[u32; 3]> = (0..n as u32 / 3)
            .map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % 24])
            .collect();
        let mut scene = Scene::new();
        let body = scene.add((faces.clone(), start.clone())).expect("good");
        scene.set_end_positions(body, &end).expect("good");
        let edges = scene.body(body).expect("known").part(Part::Edges).clone();
        let wide = |p: [f32; 3]| p.map(f64::from);
        let mut expected = Vec::new();
        let mut try_pair = |pair, kind, a: u32, b: u32, ids: [u32; 4], shares: bool| {
            let [start, end] = [&start, &end].map(|p| ids.map(|id| wide(p[id as usize])));
            if !shares && let Some(contact) = first_contact(pair, &start, &end) {
                expected.push((kind, a, b, f64::from(contact.time_f32()), contact.at_start));
            }
        };
        for v in 0..n as u32 {
            if !faces.as_flattened().contains(&v) {
                continue;
            }
            for (f, &[p, q, r]) in (0..).zip(&faces) {
                let shares = [p, q, r].contains(&v);
                try_pair(
                    ElementPair::VertexFace,
                    PairKind::VertexFace,
                    v,
                    f,
                    [v, p, q, r],
                    shares,
                );
            }
        }
        for e in 0..edges.len() {
            for g in e + 1..edges.len() {
                let (a, b) = (edges.corners(e), edges.corners(g));
                let shares = a.iter().any(|v| b.contains(v));
                let ids = [a[0], a[1], b[0], b[1]];
                try_pair(
                    ElementPair::EdgeEdge,
                    PairKind::EdgeEdge,
                    e as u32,
                    g as u32,
                    ids,
                    shares,
                );
            }
        }
        expected.sort_by_key(|row| (row.0, row.1, row.2));
        for mut detector in detectors() {
            let impacts = detector.impacts(&scene, &Query::all()).expect("good");
            let found: Vec<_> = impacts
                .iter()
                .map(|i| (i.kind, i.a.element, i.b.element, i.toi, i.at_start))
                .collect();
            assert_eq!(found, expected, "seed {seed}");
            let all = impacts.earliest();
            assert_eq!(detector.earliest(&scene, &Query::all()).expect("good"), all);
            let is_free = detector.is_free(&scene, &Query::all()).expect("good");
            assert_eq!(is_free, expected.is_empty());
        }
    }
}

/// Two bodies of random triangles on a lattice of even numbers, at the start and at the end of a
/// step.
struct Twins {
    faces: [Vec<[u32; 3]>; 2],
    start: [Vec<[f32; 3]>; 2],
    end: [Vec<[f32; 3]>; 2],
}

type Row = (PairKind, (bool, u32), (bool, u32), u64, bool);

impl Twins {
    fn new(seed: u64) -> Self {
        let mut random = impinge_scenes::Random::new(seed);
        let n = 30;
        let mut lattice = || -> Vec<[f32; 3]> {
            let mut at = || 2.0 * random.below(6) as f32;
            (0..n).map(|_| [at(), at(), at()]).collect()
        };
        let positions: Vec<Vec<[f32; 3]>> = (0..4).map(|_| lattice()).collect();
        let faces = (0..n as u32 / 3).map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % n as u32]);
        let faces: Vec<[u32; 3]> = faces.collect();
        Twins {
            faces: [faces.clone(), faces],
            start: [positions[0].clone(), positions[1].clone()],
            end: [positions[2].clone(), positions[3].clone()],
        }
    }

    /// Sorted rows of impacts. An element is named by whether it belongs to the second body, and
    /// its number.
    fn rows(&self, swapped: bool, detector: &mut Detector) -> Vec<Row> {
        let mut scene = Scene::new();
        let order = if swapped { [1, 0] } else { [0, 1] };
        let mut first = None;
        for ix in order {
            let body = scene
                .add((self.faces[ix].clone(), self.start[ix].clone()))
                .expect("good");
            scene.set_end_positions(body, &self.end[ix]).expect("good");
            first = first.or(Some(body));
        }
        let impacts = detector.impacts(&scene, &Query::all()).expect("good");
        let side = |body: BodyId| (Some(body) == first) == swapped;
        let mut rows: Vec<Row> = impacts
            .iter()
            .map(|i| {
                let mut a = (side(i.a.body), i.a.element);
                let mut b = (side(i.b.body), i.b.element);
                if i.kind == PairKind::EdgeEdge && b < a {
                    (a, b) = (b, a);
                }
                (i.kind, a, b, i.toi.to_bits(), i.at_start)
            })
            .collect();
        rows.sort_unstable();
        rows
    }

    fn map(&self, f: impl Fn([f32; 3]) -> [f32; 3] + Copy) -> Twins {
        let all = |bodies: &[Vec<[f32; 3]>; 2]| {
            bodies
                .clone()
                .map(|positions| positions.into_iter().map(f).collect())
        };
        Twins {
            faces: self.faces.clone(),
            start: all(&self.start),
            end: all(&self.end),
        }
    }
}

#[test]
fn twins_have_the_same_impacts() {
    for seed in 0..6 {
        let mut detector = detector(Method::Clusters, 3);
        let twins = Twins::new(seed);
        let rows = twins.rows(false, &mut detector);
        assert!(!rows.is_empty());
        assert_eq!(twins.rows(true, &mut detector), rows, "bodies swapped");
        let moved = twins.map(|[x, y, z]| [x + 1024.0, y - 4096.0, z]);
        assert_eq!(moved.rows(false, &mut detector), rows, "translated");
        let turned = twins.map(|[x, y, z]| [z, -x, y]);
        assert_eq!(
            turned.rows(false, &mut detector),
            rows,
            "axes permuted, one mirrored"
        );
        let scaled = twins.map(|p| p.map(|x| x * 2f32.powi(-40)));
        assert_eq!(scaled.rows(false, &mut detector), rows, "scaled");
        let mut reversed = twins.map(|p| p);
        std::mem::swap(&mut reversed.start, &mut reversed.end);
        let pairs = |rows: &[Row]| {
            rows.iter()
                .map(|row| (row.0, row.1, row.2))
                .collect::<Vec<_>>()
        };
        let backwards = reversed.rows(false, &mut detector);
        assert_eq!(
            pairs(&backwards),
            pairs(&rows),
            "backwards the same pairs touch"
        );
    }
}

#[test]
fn a_step_is_its_two_halves() {
    for seed in 0..6 {
        let mut detector = detector(Method::Clusters, 3);
        let twins = Twins::new(seed);
        // The mean of two even numbers is an integer.
        let middle: [Vec<[f32; 3]>; 2] = std::array::from_fn(|body| {
            let ends = twins.start[body].iter().zip(&twins.end[body]);
            let mean = |(x, y): (&[f32; 3], &[f32; 3])| {
                std::array::from_fn(|axis| (x[axis] + y[axis]) / 2.0)
            };
            ends.map(mean).collect()
        });
        let (mut first, mut second) = (twins.map(|p| p), twins.map(|p| p));
        first.end = middle.clone();
        second.start = middle;
        let mut expected = std::collections::BTreeMap::new();
        for (half, twins) in [(0.5, &second), (0.0, &first)] {
            for (kind, a, b, toi, at_start) in twins.rows(false, &mut detector) {
                let toi = half + f64::from_bits(toi) / 2.0;
                let rounded = {
                    let nearest = toi as f32;
                    if f64::from(nearest) > toi {
                        nearest.next_down()
                    } else {
                        nearest
                    }
                };
                let row = (f64::from(rounded).to_bits(), at_start && half == 0.0);
                expected.insert((kind, a, b), row);
            }
        }
        let whole = twins.rows(false, &mut detector);
        let expected: Vec<Row> = expected
            .into_iter()
            .map(|((kind, a, b), (toi, at_start))| (kind, a, b, toi, at_start))
            .collect();
        assert_eq!(whole, expected, "seed {seed}");
    }
}

/// What a refused or cancelled question has left undecided is not decided by the next one.
#[test]
fn a_refused_question_leaves_nothing_to_the_next() {
    let soup = |random: &mut Random, scene: &mut Scene| {
        let mut at = || random.below(13) as f32 / 4.0;
        let points = Vec::from_iter((0..40).map(|_| [at(), at(), at()]));
        let mut faces: Vec<[u32; 3]> = Vec::new();
        while faces.len() < 60 {
            let face = [0; 3].map(|_| random.below(40));
            if face[0] != face[1] && face[1] != face[2] && face[2] != face[0] {
                faces.push(face);
            }
        }
        scene.add_triangles(&faces, &points).expect("good")
    };
    let (mut n_refused, mut n_answered) = (0, 0);
    for seed in 0..8 {
        let (mut random, mut scene) = (Random::new(seed), Scene::new());
        let bodies = [0; 2].map(|_| soup(&mut random, &mut scene));
        for threads in [1, 3] {
            let settings = cpu(Method::Auto, threads).max_pairs(Some(1000));
            let mut detector = Detector::new(settings.clone()).expect("settings");
            let refuse = |detector: &mut Detector| {
                let wide = Query::all().separation(0.25);
                let refused = detector.impacts(&scene, &wide);
                u32::from(matches!(refused, Err(Error::TooManyPairs { .. })))
            };
            let own = Query::self_of(bodies[0]);
            let near = own.clone().kinds([PairKind::VertexFace]);
            let mut fresh = Detector::new(settings).expect("settings");
            let hash = |detector: &mut Detector| {
                let near = detector.near(&scene, 0.0, &near).map(|near| near.hash());
                near.map_err(|error| error.to_string())
            };
            n_refused += refuse(&mut detector);
            let found = hash(&mut detector);
            n_answered += u32::from(found.is_ok());
            assert_eq!(found, hash(&mut fresh));
            n_refused += refuse(&mut detector);
            let lists = |detector: &mut Detector| {
                let lists = detector.neighbours(&scene, 0.0, &near);
                lists
                    .map(|lists| lists.vf().clone())
                    .map_err(|error| error.to_string())
            };
            assert_eq!(lists(&mut detector), lists(&mut fresh));
            n_refused += refuse(&mut detector);
            let safe = |detector: &mut Detector| {
                let safe = detector.safe_distances(&scene, 0.1, &near);
                safe.map(|safe| format!("{:?}", safe.of(bodies[0])))
                    .map_err(|error| error.to_string())
            };
            assert_eq!(safe(&mut detector), safe(&mut fresh));
        }
    }
    assert_eq!((n_refused, n_answered), (48, 16));
}
