//! Steps and candidates of bodies that are thick: against every pair by the exact test with the sum
//! of the separation and the thickness of both elements.

use crate::near::{PARTS, thickness, thickness_by};
use crate::separation::{
    Elements, contacts, first_kept, impacts, is_the_same_everywhere, lattice, rows, two_soups,
};
use impinge_core::exact::first_within;
use impinge_core::{
    BodyId, Clearance, Impact, Method, PairKind, Part, Precision, Query, Scene, Start, Thickness,
};
use impinge_scenes::Random;
use impinge_tests::{detector, detectors, thickness_of};

/// A scene in which bodies have a thickness for each vertex, edge or face, or one number.
fn thick(seed: u64) -> Scene {
    let mut scene = lattice(seed);
    let mut random = Random::new(seed);
    let part = PARTS[seed as usize % 3];
    let bodies = Vec::from_iter(scene.bodies().map(|(id, _)| id));
    for (ix, body) in bodies.into_iter().enumerate() {
        let is_by_element = ix % 2 == 0 || seed.is_multiple_of(2);
        let own = is_by_element.then(|| thickness_by(&mut random, &scene, body, part));
        let given = match &own {
            Some(own) => thickness(part, own),
            None => 0.5.into(),
        };
        scene.set_thickness(body, given).expect("good");
    }
    scene
}

/// How thick two elements are together. Sums of these numbers are exact.
fn of_both(scene: &Scene, pair: Elements) -> f64 {
    let [a, b] = pair.map(|(body, part, number)| thickness_of(scene, body, part, number));
    a + b
}

/// Asks all detectors for a step, and compares with what is expected.
fn check(scene: &Scene, step: &Query, expected: &[crate::separation::Row]) {
    for mut detector in detectors() {
        let found = impacts(&mut detector, scene, step);
        assert_eq!(rows(&found), expected);
        let first = detector.earliest(scene, step).expect("good");
        let least = found.iter().map(|i| i.toi).reduce(f64::min);
        assert_eq!(first.map(|i| i.toi), least);
        assert!(!detector.is_free(scene, step).expect("good"));
        let skip = step.clone().start(Start::Skip);
        let later = Vec::from_iter(found.iter().filter(|i| !i.at_start).copied());
        assert_eq!(impacts(&mut detector, scene, &skip), later);
    }
}

#[test]
fn elements_of_a_step_keep_their_thickness_pair_by_pair() {
    let mut n_later = 0;
    for seed in 0..6 {
        let scene = &thick(seed);
        for separation in [0.0, 0.25, 1.0] {
            let expected = contacts(scene, |pair, elements, [start, end]| {
                first_within(pair, start, end, separation + of_both(scene, elements))
            });
            let step = (Query::all().separation(separation)).precision(Precision::F64);
            check(scene, &step, &expected);
            n_later += expected.iter().filter(|row| !row.3).count();
            if seed > 2 {
                continue;
            }
            let expected = contacts(scene, |pair, elements, ends| {
                let kept = separation + of_both(scene, elements);
                first_kept(pair, ends, kept, (0.5, 0.75))
            });
            let clearance = Clearance::new(0.5).share(0.75);
            check(scene, &step.clearance(clearance), &expected);
        }
    }
    assert!(n_later > 1000, "{n_later}");
}

#[test]
fn candidates_are_boxes_that_reach_by_the_thickness_too() {
    let mut n_found = 0;
    for seed in 0..6 {
        let scene = thick(seed);
        for inflation in [0.0, 0.125, 0.5] {
            let expected = contacts(&scene, |pair, elements, [start, end]| {
                // The first corners are those of the element that an exact test names first.
                let n = if pair == impinge_core::exact::ElementPair::EdgeEdge {
                    2
                } else {
                    1
                };
                let ends = |axis: usize, side: usize| {
                    let corners = if side == 0 { 0..n } else { n..pair.n_points() };
                    let both = corners.flat_map(move |ix| [start[ix][axis], end[ix][axis]]);
                    both.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                        [low.min(x), high.max(x)]
                    })
                };
                let most = 2.0 * inflation + of_both(&scene, elements);
                let are_near = (0..3).all(|axis| {
                    let [[a_low, a_high], [b_low, b_high]] = [ends(axis, 0), ends(axis, 1)];
                    a_low - b_high <= most && b_low - a_high <= most
                });
                are_near.then_some(impinge_core::exact::Contact::AT_START)
            });
            let expected = Vec::from_iter(expected.iter().map(|row| (row.0, row.1)));
            n_found += expected.len();
            for mut detector in detectors() {
                let kinds = [
                    PairKind::VertexFace,
                    PairKind::EdgeEdge,
                    PairKind::EdgeVertex,
                    PairKind::VertexVertex,
                ];
                let query = Query::all();
                let found = (detector.candidates(&scene, inflation, &query)).expect("good");
                let found = found.iter().map(|(kind, a, b)| {
                    let index = |body: BodyId| body.index() as u32;
                    (kind, [index(a.body), a.element, index(b.body), b.element])
                });
                let found = Vec::from_iter(found.filter(|(kind, _)| kinds.contains(kind)));
                assert_eq!(found, expected, "{seed} {inflation}");
            }
        }
    }
    assert!(n_found > 1000, "{n_found}");
}

/// A thick body, far away, makes no pair of others: their boxes are tested as if it were not there.
#[test]
fn boxes_of_thin_elements_do_not_reach_farther_beside_thick_ones() {
    let triangle = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
    let mut thin = Scene::new();
    for x in [1.0, 1.0 + f32::EPSILON] {
        thin.add_triangles(&[[0, 1, 2]], &triangle(x))
            .expect("good");
    }
    let far = thin.add_points(&[[900.0f32, 0.0, 0.0]]).expect("good");
    thin.set_thickness(far, 1.0).expect("good");
    let mut points = Scene::new();
    for x in [1.0f64, 1.001] {
        let body = points.add_points(&[[x, 0.0, 0.0]]).expect("good");
        points.set_thickness(body, 1e-9).expect("good");
    }
    let edge = [[1e15f64, 0.0, 0.0], [1e15, 1.0, 0.0]];
    let far = points.add_edges(&[[0, 1]], &edge).expect("good");
    points.set_thickness(far, 1e12).expect("good");
    for scene in [thin, points] {
        for mut detector in detectors() {
            let found = detector.candidates(&scene, 0.0, &Query::all());
            assert_eq!(found.expect("good").len(), 0);
        }
    }
    // Beyond the largest float, nothing is too far away.
    let mut wide = Scene::new();
    for x in [-0.95e308, 0.95e308] {
        wide.add_points(&[[x, 0.0, 0.0]]).expect("good");
    }
    for mut detector in detectors() {
        let found = detector.candidates(&wide, 1e308, &Query::all());
        assert_eq!(found.expect("good").len(), 1);
    }
}

/// Where all elements are equally thick, that is a separation of twice as much.
#[test]
fn one_thickness_for_all_is_a_separation() {
    for is_double in [false, true] {
        let (thin, bodies) = two_soups(is_double);
        let radius = 0.0123;
        let mut thick = thin.clone();
        for body in bodies {
            thick.set_thickness(body, radius).expect("good");
        }
        for method in [Method::Clusters, Method::Naive] {
            let mut detector = detector(method, 2);
            for (separation, clearance) in [(0.0, 0.0), (0.0, 0.01), (0.25, 0.0)] {
                let step = Query::all().clearance(clearance);
                let kept = step.clone().separation(separation + 2.0 * radius);
                let step = step.separation(separation);
                let expected = detector.impacts(&thin, &kept).expect("good");
                assert!(expected.len() > 100);
                let found = detector.impacts(&thick, &step).expect("good");
                assert_eq!(found.hash(), expected.hash());
                assert_eq!(
                    detector.advance(&thick, &step).expect("good"),
                    detector.advance(&thin, &kept).expect("good")
                );
                assert_eq!(
                    detector.truncate(&thick, &step).expect("good"),
                    detector.truncate(&thin, &kept).expect("good")
                );
            }
            let query = Query::all();
            let expected = detector.candidates(&thin, 2.0 * radius, &query);
            let found = detector.candidates(&thick, radius, &query);
            assert_eq!(found.expect("good").hash(), expected.expect("good").hash());
        }
    }
}

/// A vertex, an edge or a face of a body may be thick alone.
#[test]
fn the_answer_with_thick_elements_depends_on_the_input_alone() {
    for (round, is_double) in [(0, false), (1, true), (2, false)] {
        let (mut scene, bodies) = two_soups(is_double);
        let mut random = Random::new(round);
        let part = PARTS[round as usize];
        let n = thickness_by(&mut random, &scene, bodies[0], part).len();
        let each = Vec::from_iter((0..n).map(|ix| match ix % 3 {
            0 => 0.0,
            _ => 0.02 * f64::from(random.unit()),
        }));
        scene
            .set_thickness(bodies[0], thickness(part, &each))
            .expect("good");
        for step in [Query::all(), Query::all().clearance(0.02)] {
            is_the_same_everywhere(&scene, &step);
        }
    }
}

/// 0.1 and 0.2 add up to less than the float 0.1 + 0.2, to which their sum is rounded up.
#[test]
fn sums_are_rounded_up() {
    let mut scene = Scene::new();
    let points = |x: f64| [[0.0, 0.0, 0.0], [x, 0.0, 0.0]];
    let body = scene.add_points(&points(1.0)).expect("good");
    let each = Thickness::vertices(&[0.1, 0.2][..]);
    scene.set_thickness(body, each).expect("good");
    for mut detector in detectors() {
        for (end, n) in [(0.1 + 0.2, 1), ((0.1_f64 + 0.2).next_up(), 0)] {
            scene.set_end_positions(body, &points(end)).expect("good");
            let found = impacts(&mut detector, &scene, &Query::all());
            assert_eq!(found.len(), n);
        }
    }
}

/// Vertices stop before they are nearer than their elements are thick, pair by pair.
#[test]
fn vertices_stop_before_thick_elements() {
    for (round, part) in PARTS.into_iter().cycle().take(6).enumerate() {
        let (mut scene, bodies) = two_soups(round % 2 == 1);
        let held = scene.body(bodies[0]).expect("known");
        let n = match part {
            Part::Vertices => held.n_vertices(),
            _ => held.part(part).len(),
        };
        let each = Vec::from_iter((0..n).map(|ix| [0.0, 0.0078125, 0.03125][ix % 3]));
        scene
            .set_thickness(bodies[0], thickness(part, &each))
            .expect("good");
        let query = Query::between(bodies[0], bodies[1]);
        let mut of_all = detectors().map(|mut detector| {
            let truncation = detector.truncate(&scene, &query);
            truncation.expect("good")
        });
        let [truncation, others @ ..] = &mut of_all;
        assert!(others.iter().all(|other| other == truncation), "{part:?}");
        assert!(truncation.n_cut() > 0);
        for (body, at) in truncation.iter() {
            scene.set_end_positions(body, at).expect("as many");
        }
        let met = contacts(&scene, |pair, elements, [start, end]| {
            let is_asked = elements[0].0 != elements[1].0;
            let kept = of_both(&scene, elements);
            is_asked
                .then(|| first_within(pair, start, end, kept))
                .flatten()
        });
        // What touches at the start stays.
        assert!(met.iter().all(|row| row.3), "{part:?}");
        assert_eq!(met.len() as u64, truncation.n_touching(), "{part:?}");
    }
}

/// The earliest contact is that of the thick vertex, however few are.
#[test]
fn a_thick_vertex_is_met_first() {
    let mut scene = Scene::new();
    let points: Vec<[f32; 3]> = (0..100).map(|ix| [ix as f32, 0.0, 2.0]).collect();
    let body = scene.add_points(&points).expect("good");
    let end: Vec<[f32; 3]> = points.iter().map(|&[x, y, z]| [x, y, z - 4.0]).collect();
    scene.set_end_positions(body, &end).expect("good");
    let floor = [[-1.0f32, -1.0, 0.0], [300.0, -1.0, 0.0], [-1.0, 300.0, 0.0]];
    scene.add_triangles(&[[0, 1, 2]], &floor).expect("good");
    let mut each = vec![0.0; 100];
    each[70] = 1.0;
    scene
        .set_thickness(body, Thickness::vertices(&each[..]))
        .expect("good");
    let query = Query::between_all();
    for mut detector in detectors() {
        let first = detector
            .earliest(&scene, &query)
            .expect("good")
            .expect("one");
        assert_eq!((first.a.element, first.toi), (70, 0.25));
        let found: Vec<Impact> = impacts(&mut detector, &scene, &query);
        assert_eq!(found.len(), 100);
        assert!(
            found
                .iter()
                .all(|i| i.toi == if i.a.element == 70 { 0.25 } else { 0.5 })
        );
    }
}
