//! Steps in which elements must keep a distance: against every pair by the exact test, and what must hold of any answer.

use std::collections::BTreeMap;

use impinge_core::exact::{ElementPair, first_within};
use impinge_core::{
    Backend, Detector, Error, Impact, InstructionSet, Method, PairKind, Part, Query, Scene,
    Settings, Start, Step, Toi,
};
use impinge_scenes::Random;

fn detector(method: Method) -> Detector {
    Detector::with_settings(Settings {
        method,
        backend: Backend::Cpu,
        ..Settings::default()
    })
    .expect("settings")
}

fn detectors() -> [Detector; 2] {
    [Method::Clusters, Method::Naive].map(detector)
}

fn impacts(detector: &mut Detector, scene: &Scene, step: &Step) -> Vec<Impact> {
    let impacts = detector.impacts(scene, step).expect("good");
    impacts.as_slice().to_vec()
}

/// A body of triangles on a lattice that goes anywhere, bare edges, and points.
fn lattice(seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let mut points = |n: usize| -> Vec<[f32; 3]> {
        let mut at = || random.below(6) as f32;
        (0..n).map(|_| [at(), at(), at()]).collect()
    };
    let faces: Vec<[u32; 3]> = (0..5)
        .map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % 15])
        .collect();
    let mut scene = Scene::new();
    let body = scene.add_triangles(&faces, &points(15)).expect("good");
    scene.set_end_positions(body, &points(15)).expect("good");
    let body = scene
        .add_edges(&[[0, 1], [1, 2]], &points(3))
        .expect("good");
    scene.set_end_positions(body, &points(3)).expect("good");
    let body = scene.add_points(&points(3)).expect("good");
    scene.set_end_positions(body, &points(3)).expect("good");
    scene.add_points(&points(2)).expect("good");
    scene
}

/// A pair as its kind and row, with its time and whether it is so from the start.
type Row = (PairKind, [u32; 4], f64, bool);

fn rows(impacts: &[Impact]) -> Vec<Row> {
    impacts
        .iter()
        .map(|i| (i.kind, i.row(), i.toi, i.at_start))
        .collect()
}

/// Pair by pair: the kinds of a step, with all bodies.
fn expected(scene: &Scene, separation: f64) -> Vec<Row> {
    use Part::{Edges, Faces, Vertices};
    let bodies: Vec<_> = scene.bodies().collect();
    let mut expected = Vec::new();
    for (kind, pair, parts) in [
        (
            PairKind::VertexFace,
            ElementPair::VertexFace,
            [Vertices, Faces],
        ),
        (PairKind::EdgeEdge, ElementPair::EdgeEdge, [Edges, Edges]),
        (
            PairKind::EdgeVertex,
            ElementPair::VertexEdge,
            [Edges, Vertices],
        ),
        (
            PairKind::VertexVertex,
            ElementPair::VertexVertex,
            [Vertices, Vertices],
        ),
    ] {
        for (id_a, body_a) in &bodies {
            for (id_b, body_b) in &bodies {
                let has_faces = |body: &impinge_core::Body| !body.part(Faces).is_empty();
                let has_edges = |body: &impinge_core::Body| !body.part(Edges).is_empty();
                let is_asked = match kind {
                    PairKind::EdgeVertex => !has_faces(body_a) && !has_faces(body_b),
                    PairKind::VertexVertex => !has_edges(body_a) && !has_edges(body_b),
                    _ => true,
                };
                let (of_a, of_b) = (body_a.part(parts[0]), body_b.part(parts[1]));
                for ix_a in 0..if is_asked { of_a.len() } else { 0 } {
                    for ix_b in 0..of_b.len() {
                        let (a, b) = (of_a.corners(ix_a), of_b.corners(ix_b));
                        let number = |part, ix: usize, corners: &[u32]| match part {
                            Vertices => corners[0],
                            _ => ix as u32,
                        };
                        let row = [
                            id_a.index() as u32,
                            number(parts[0], ix_a, a),
                            id_b.index() as u32,
                            number(parts[1], ix_b, b),
                        ];
                        let is_twice = parts[0] == parts[1] && row[..2] >= row[2..];
                        let shares = id_a == id_b && a.iter().any(|id| b.contains(id));
                        if is_twice || shares {
                            continue;
                        }
                        let mut ends = [[[0.0; 3]; 4]; 2];
                        let mut sides = [(body_a, a), (body_b, b)];
                        if kind == PairKind::EdgeVertex {
                            sides.reverse();
                        }
                        for (end, points) in ends.iter_mut().enumerate() {
                            let corners = sides.iter().flat_map(|(body, ids)| {
                                let start = body.positions();
                                let positions = match end {
                                    0 => start,
                                    _ => body.end_positions().unwrap_or(start),
                                };
                                ids.iter().map(move |&id| positions.point(id as usize))
                            });
                            for (to, from) in points.iter_mut().zip(corners) {
                                *to = from;
                            }
                        }
                        let [start, end] = &ends;
                        if let Some(contact) = first_within(pair, start, end, separation) {
                            expected.push((kind, row, contact.time, contact.at_start));
                        }
                    }
                }
            }
        }
    }
    expected.sort_by_key(|&(kind, row, ..)| (kind, row));
    expected
}

#[test]
fn lattices_are_answered_as_pair_by_pair() {
    for seed in 0..4 {
        let scene = lattice(seed);
        for separation in [0.0, 0.5, 1.0, 2.0_f64.sqrt()] {
            let expected = expected(&scene, separation);
            assert!(!expected.is_empty());
            let step = Step::default().separation(separation).toi(Toi::F64);
            for mut detector in detectors() {
                let found = impacts(&mut detector, &scene, &step);
                assert_eq!(rows(&found), expected, "seed {seed}, {separation}");
                let first = detector.earliest(&scene, &step).expect("good");
                let least = found.iter().map(|i| i.toi).reduce(f64::min);
                assert_eq!(first.map(|i| i.toi), least);
                assert!(found.contains(&first.expect("some")));
                assert!(!detector.is_free(&scene, &step).expect("good"));
            }
        }
    }
}

/// A separation of 0 changes nothing; a larger one finds all pairs of a smaller one, none of them later.
#[test]
fn more_separation_is_never_later() {
    for seed in 10..14 {
        let scene = lattice(seed);
        let mut detector = detector(Method::Clusters);
        let step = Step::default().toi(Toi::F64);
        let without = impacts(&mut detector, &scene, &step);
        let mut last: BTreeMap<(PairKind, [u32; 4]), f64> = BTreeMap::new();
        for separation in [0.0, 1e-12, 0.01, 0.3, 1.0, 3.0] {
            let step = step.clone().separation(separation);
            let found = impacts(&mut detector, &scene, &step);
            if separation == 0.0 {
                assert_eq!(rows(&found), rows(&without));
            }
            let now: BTreeMap<_, _> = found.iter().map(|i| ((i.kind, i.row()), i.toi)).collect();
            for (pair, toi) in &last {
                assert!(now[pair] <= *toi, "{pair:?} at {separation}");
            }
            last = now;
        }
        assert!(last.len() > without.len());
    }
}

/// A triangle that comes down on another one, and stops at a third.
fn falling(end: f32) -> Scene {
    let at = |z: f32| [[0.0f32, 0.0, z], [4.0, 0.0, z], [0.0, 4.0, z]];
    let mut scene = Scene::new();
    scene.add_triangles(&[[0, 1, 2]], &at(0.0)).expect("good");
    let other = at(4.0).map(|[x, y, z]| [x + 0.5, y + 0.5, z]);
    let other = scene.add_triangles(&[[0, 1, 2]], &other).expect("good");
    let moved = at(end).map(|[x, y, z]| [x + 0.5, y + 0.5, z]);
    scene.set_end_positions(other, &moved).expect("good");
    scene
}

#[test]
fn a_triangle_that_comes_near_is_told_when() {
    for mut detector in detectors() {
        let scene = falling(0.5);
        let step = |separation: f64| Step::default().separation(separation).toi(Toi::F64);
        assert!(detector.is_free(&scene, &step(0.0)).expect("good"));
        assert!(
            detector
                .is_free(&scene, &step(0.5_f64.next_down()))
                .expect("good")
        );
        let first = detector.earliest(&scene, &step(0.5)).expect("good");
        assert_eq!(first.map(|i| (i.toi, i.at_start)), Some((1.0, false)));
        // From 4 to 0.5: at 2.25 half the way is done.
        let first = detector.earliest(&scene, &step(2.25)).expect("good");
        assert_eq!(first.map(|i| i.toi), Some(0.5));
        // The other triangle starts 4 above: some pairs are that near at the start, others later.
        let near = impacts(&mut detector, &scene, &step(4.0));
        let (at_start, later): (Vec<Impact>, Vec<Impact>) =
            near.iter().partition(|impact| impact.at_start);
        assert!(!at_start.is_empty() && at_start.iter().all(|i| i.toi == 0.0));
        assert!(!later.is_empty() && later.iter().all(|i| i.toi > 0.0));
        let skip = step(4.0).start(Start::Skip);
        assert_eq!(impacts(&mut detector, &scene, &skip), later);
    }
}

/// The rounded positions keep the distance on the whole way, and the step is nearly as long as it can be.
#[test]
fn a_step_that_is_advanced_keeps_the_distance() {
    for mut detector in detectors() {
        let mut scene = falling(-2.0);
        let step = Step::default().separation(0.1);
        let advance = detector.advance(&scene, &step).expect("good");
        // From 4 down to 0.1, of 6.
        let most = 3.9 / 6.0;
        assert!(
            advance.fraction < most && advance.fraction > most - 1e-6,
            "{advance:?}"
        );
        advance.apply(&mut scene).expect("same bodies");
        let near = impinge_core::NearQuery::new(Query::everything()).distance(0.1);
        assert!(
            detector
                .within_distance(&scene, &near)
                .expect("good")
                .is_empty()
        );
        let near = near.distance(0.1001);
        assert!(
            !detector
                .within_distance(&scene, &near)
                .expect("good")
                .is_empty()
        );
    }
}

#[test]
fn the_answer_depends_on_the_input_alone() {
    let mut scene = lattice(20);
    let [a, b] = [1, 2].map(|seed| impinge_scenes::soup::triangles(24, 0.3, seed));
    let body = a.add_to(&mut scene).expect("good");
    scene.set_end_positions(body, &b.positions).expect("good");
    let step = Step::default().separation(0.02);
    let expected = rows(&impacts(&mut detector(Method::Naive), &scene, &step));
    assert!(expected.len() > 50, "{}", expected.len());
    for (threads, instruction_set, memory_budget) in [
        (1, InstructionSet::Portable, None),
        (2, InstructionSet::Avx2, Some(3_000_000)),
        (7, InstructionSet::Avx512, None),
    ] {
        let mut detector = Detector::with_settings(Settings {
            backend: Backend::Cpu,
            threads,
            instruction_set,
            memory_budget,
            ..Settings::default()
        })
        .expect("settings");
        for _ in 0..2 {
            assert_eq!(rows(&impacts(&mut detector, &scene, &step)), expected);
            let all = impacts(&mut detector, &scene, &step);
            let first = detector.earliest(&scene, &step).expect("good");
            let least = all.iter().map(|i| i.toi).reduce(f64::min);
            assert_eq!(first.map(|i| i.toi), least);
        }
    }
}

#[test]
fn bad_separations_are_refused_by_name() {
    for mut detector in detectors() {
        let scene = falling(0.0);
        for bad in [-0.5, f64::NAN, f64::INFINITY] {
            let step = Step::default().separation(bad);
            let setting = "separation";
            let is_refused = |error: Option<Error>| match error {
                Some(Error::Setting {
                    setting: name,
                    given,
                    ..
                }) => name == setting && given == bad.to_string(),
                _ => false,
            };
            assert!(is_refused(detector.impacts(&scene, &step).err()));
            assert!(is_refused(detector.is_free(&scene, &step).err()));
            assert!(is_refused(detector.earliest(&scene, &step).err()));
            assert!(is_refused(detector.advance(&scene, &step).err()));
        }
    }
}
