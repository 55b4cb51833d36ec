//! Steps in which elements must keep a distance, or a clearance: against every pair by the exact
//! test, and what must hold of any answer.

use std::collections::BTreeMap;

use impinge_core::exact::{Contact, ElementPair, Point, are_within, closest_points, first_within};
use impinge_core::{
    Backend, BodyId, Clearance, Detector, Error, Impact, InstructionSet, Method, PairFilter,
    PairKind, Part, Positions, Precision, Query, Scene, Settings, Start,
};
use impinge_scenes::Random;
use impinge_tests::{detector, detectors};

pub fn impacts(detector: &mut Detector, scene: &Scene, step: &Query) -> Vec<Impact> {
    let impacts = detector.impacts(scene, step).expect("good");
    impacts.iter().copied().collect()
}

/// A body of triangles on a lattice that goes anywhere, bare edges, and points.
pub fn lattice(seed: u64) -> Scene {
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
    scene.set_end_positions(body, points(15)).expect("good");
    let body = scene
        .add_edges(&[[0, 1], [1, 2]], &points(3))
        .expect("good");
    scene.set_end_positions(body, points(3)).expect("good");
    let body = scene.add_points(&points(3)).expect("good");
    scene.set_end_positions(body, points(3)).expect("good");
    scene.add_points(&points(2)).expect("good");
    scene
}

/// A pair as its kind and row, with its time and whether it is so from the start.
pub type Row = (PairKind, [u32; 4], f64, bool);

pub fn rows(impacts: &[Impact]) -> Vec<Row> {
    impacts
        .iter()
        .map(|i| (i.kind, i.row(), i.toi, i.at_start))
        .collect()
}

/// Pair by pair: the kinds of a step, with all bodies.
fn expected(scene: &Scene, separation: f64) -> Vec<Row> {
    contacts(scene, |pair, _, [start, end]| {
        first_within(pair, start, end, separation)
    })
}

/// When a pair is first as near as a clearance lets it come. For separations that a float with few
/// bits holds.
pub fn first_kept(
    pair: ElementPair,
    [start, end]: [&[Point; 4]; 2],
    separation: f64,
    (clearance, share): (f64, f64),
) -> Option<Contact> {
    if are_within(pair, start, separation) {
        return first_within(pair, start, end, separation);
    }
    // The least number of 24 bits that is not less than what the pair is apart. A computed distance
    // is wrong by less than 1e-12.
    let apart = closest_points(pair, start).distance - separation;
    let step = 2f64.powi(apart.log2().floor() as i32 - 23);
    let short = (0..3)
        .map(|k| ((apart * (1.0 - 1e-10) / step).floor() + f64::from(k)) * step)
        .find(|&short| are_within(pair, start, separation + short))
        .expect("one of three");
    // The sum is rounded down, and the difference has no rounding here.
    let beyond = f64::min(clearance, share * short);
    let sum = separation + beyond;
    let is_above = sum - separation > beyond;
    first_within(
        pair,
        start,
        end,
        if is_above { sum.next_down() } else { sum },
    )
}

/// The elements of a pair: their bodies, parts and numbers.
pub type Elements = [(BodyId, Part, u32); 2];

/// Pair by pair: the kinds of a step, with all bodies.
pub fn contacts(
    scene: &Scene,
    first: impl Fn(ElementPair, Elements, [&[Point; 4]; 2]) -> Option<Contact>,
) -> Vec<Row> {
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
                        let elements = [(*id_a, parts[0], row[1]), (*id_b, parts[1], row[3])];
                        if let Some(contact) = first(pair, elements, ends.each_ref()) {
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
            let step = Query::all()
                .separation(separation)
                .precision(Precision::F64);
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

/// A separation of 0 changes nothing; a larger one finds all pairs of a smaller one, none of them
/// later.
#[test]
fn more_separation_is_never_later() {
    for seed in 10..14 {
        let scene = lattice(seed);
        let mut detector = detector(Method::Clusters, 2);
        let step = Query::all().precision(Precision::F64);
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

#[test]
fn a_clearance_is_kept_pair_by_pair() {
    for seed in 0..3 {
        let scene = lattice(seed);
        for (separation, clearance, share) in [
            (0.0, 0.25, 0.2),
            (0.0, 0.1, 0.5),
            (0.0, 3.0, 0.9),
            (0.5, 0.1, 0.2),
            (0.5, 1.0, 0.75),
        ] {
            let expected = contacts(&scene, |pair, _, ends| {
                first_kept(pair, ends, separation, (clearance, share))
            });
            let step = Query::all()
                .separation(separation)
                .clearance(Clearance::new(clearance).share(share))
                .precision(Precision::F64);
            for mut detector in detectors() {
                let found = impacts(&mut detector, &scene, &step);
                assert_eq!(
                    rows(&found),
                    expected,
                    "seed {seed}, {separation} {clearance}"
                );
                let first = detector.earliest(&scene, &step).expect("good");
                let least = found.iter().map(|i| i.toi).reduce(f64::min);
                assert_eq!(first.map(|i| i.toi), least);
                assert!(!detector.is_free(&scene, &step).expect("good"));
                let skip = step.clone().start(Start::Skip);
                let later: Vec<Impact> = found.iter().filter(|i| !i.at_start).copied().collect();
                assert_eq!(impacts(&mut detector, &scene, &skip), later);
            }
        }
    }
}

/// Without a clearance, or with a share of 0, nothing changes; a larger one is never later.
#[test]
fn more_clearance_is_never_later() {
    for seed in 10..13 {
        let scene = lattice(seed);
        let mut detector = detector(Method::Clusters, 2);
        let step = Query::all().separation(0.25).precision(Precision::F64);
        let without = rows(&impacts(&mut detector, &scene, &step));
        let mut last: BTreeMap<(PairKind, [u32; 4]), f64> = BTreeMap::new();
        for (clearance, share) in [(0.0, 0.2), (1.0, 0.0), (1e-12, 0.2), (0.3, 0.2), (0.3, 0.5)] {
            let step = (step.clone()).clearance(Clearance::new(clearance).share(share));
            let found = rows(&impacts(&mut detector, &scene, &step));
            if clearance * share == 0.0 {
                assert_eq!(found, without);
            }
            let now: BTreeMap<_, _> = found.iter().map(|row| ((row.0, row.1), row.2)).collect();
            for (pair, toi) in &last {
                assert!(now[pair] <= *toi, "{pair:?} at {clearance}");
            }
            last = now;
        }
    }
}

/// Two soups of triangles that move apart from each other's places and into new ones.
pub fn two_soups(is_double: bool) -> (Scene, [BodyId; 2]) {
    let mut scene = Scene::new();
    let bodies = [1, 3].map(|seed| {
        let [start, end] = [0, 1].map(|k| impinge_scenes::soup::triangles(24, 0.2, seed + k));
        if is_double {
            let widened = |rows: &[[f32; 3]]| -> Vec<[f64; 3]> {
                rows.iter()
                    .map(|row| row.map(|x| f64::from(x) / 3.0))
                    .collect()
            };
            let body = scene.add_triangles(&start_faces(&start), &widened(&start.positions));
            let body = body.expect("good");
            let end = widened(&end.positions);
            scene.set_end_positions(body, &end).expect("good");
            body
        } else {
            let body = start.add_to(&mut scene).expect("good");
            scene.set_end_positions(body, &end.positions).expect("good");
            body
        }
    });
    (scene, bodies)
}

fn start_faces(mesh: &impinge_scenes::Model) -> Vec<[u32; 3]> {
    match &mesh.elements {
        impinge_core::Elements::Triangles(faces) => faces.to_vec(),
        _ => panic!("triangles"),
    }
}

/// Every position that a solver computes on the way, by either formula and for any smaller part, is
/// reached on a straight line on which all pairs keep the clearance. A chain of steps goes on,
/// however near elements are.
#[test]
fn every_part_of_an_advanced_step_keeps_the_clearance() {
    for is_double in [false, true] {
        let (mut scene, bodies) = two_soups(is_double);
        let mut random = Random::new(5);
        let mut detector = detector(Method::Clusters, 2);
        // What intersects at the start is none of this test's business.
        let step = Query::all().clearance(1e-2).start(Start::Skip);
        let mut fractions = Vec::new();
        for _ in 0..8 {
            let advance = detector.advance(&scene, &step).expect("good");
            let first = advance.first.expect("they meet");
            assert_eq!((advance.fraction, advance.n_tried), (first.toi, 1));
            assert_eq!(f64::from(first.toi as f32), first.toi);
            fractions.push(advance.fraction);
            let mut trial = scene.clone();
            let mut any = || f64::from(random.unit());
            for part in [1.0, any(), any() / 16.0, 1e-6, 1e-12] {
                let a = part * advance.fraction;
                for adds in [false, true] {
                    for &body in &bodies {
                        let ends = scene.body(body).expect("there");
                        let end = ends.end_positions().expect("it moves");
                        match (ends.positions(), end) {
                            (Positions::F32(start), Positions::F32(end)) => {
                                let a = a as f32;
                                let at = |(x, y): (&[f32; 3], &[f32; 3])| {
                                    std::array::from_fn(|k| match adds {
                                        false => x[k] + a * (y[k] - x[k]),
                                        true => x[k] + a * added(x[k], y[k]),
                                    })
                                };
                                let at: Vec<[f32; 3]> =
                                    start.iter().zip(end.iter()).map(at).collect();
                                trial.set_end_positions(body, &at).expect("good");
                            }
                            (Positions::F64(start), Positions::F64(end)) => {
                                let at = |(x, y): (&[f64; 3], &[f64; 3])| {
                                    std::array::from_fn(|k| x[k] + a * (y[k] - x[k]))
                                };
                                let at: Vec<[f64; 3]> =
                                    start.iter().zip(end.iter()).map(at).collect();
                                trial.set_end_positions(body, &at).expect("good");
                            }
                            _ => panic!("mixed"),
                        }
                    }
                    assert!(detector.is_free(&trial, &step).expect("good"), "{part}");
                }
            }
            advance.apply(&mut scene).expect("good");
            for (seed, &body) in bodies.iter().enumerate() {
                let end = impinge_scenes::soup::triangles(24, 0.2, 2 + 2 * seed as u64);
                let third = |rows: &[[f32; 3]]| -> Vec<[f64; 3]> {
                    rows.iter()
                        .map(|row| row.map(|x| f64::from(x) / 3.0))
                        .collect()
                };
                match is_double {
                    true => scene.set_end_positions(body, third(&end.positions)),
                    false => scene.set_end_positions(body, &end.positions),
                }
                .expect("good");
            }
        }
        assert!(
            fractions.iter().all(|&fraction| fraction > 0.0),
            "{fractions:?}"
        );
    }
}

/// A number whose rounded sum with x is y, if there is one near their difference.
fn added(x: f32, y: f32) -> f32 {
    let difference = y - x;
    let near = [difference, difference.next_up(), difference.next_down()];
    near.into_iter()
        .rev()
        .find(|dx| x + dx == y)
        .unwrap_or(difference)
}

/// Elements that are nearer than rounding can move them allow no step, however short, but only if
/// they move.
#[test]
fn elements_nearer_than_rounding_allow_no_step() {
    for (gap, is_free) in [(2f64.powi(-22), false), (2f64.powi(-8), true)] {
        let at = |z: f32| [[1.0f32, 0.0, z], [5.0, 0.0, z], [1.0, 4.0, z]];
        let mut scene = Scene::new();
        scene.add_triangles(&[[0, 1, 2]], &at(0.0)).expect("good");
        let upper = scene
            .add_triangles(&[[0, 1, 2]], &at(gap as f32))
            .expect("good");
        let step = Query::all().clearance(1e-4);
        for mut detector in detectors() {
            assert_eq!(detector.advance(&scene, &step).expect("good").fraction, 1.0);
            scene.set_end_positions(upper, &at(1.0)).expect("good");
            let fraction = detector.advance(&scene, &step).expect("good").fraction;
            assert_eq!(fraction, f64::from(u8::from(is_free)));
            // The way itself is free.
            assert!(detector.is_free(&scene, &step).expect("good"));
            scene.clear_end_positions(upper).expect("good");
        }
    }
}

#[test]
fn a_filter_leaves_out_pairs() {
    // By vertices of both elements and their bodies: about half of all pairs.
    let filter = PairFilter::new(|[(a, of_a), (b, of_b)]| {
        let sum: u32 = of_a.iter().chain(of_b).sum();
        !(sum + (a.index() + b.index()) as u32).is_multiple_of(2)
    });
    assert_eq!(filter, filter.clone());
    for seed in 0..3 {
        let scene = lattice(seed);
        for clearance in [0.0, 0.25] {
            let step = Query::all().clearance(clearance).precision(Precision::F64);
            let filtered = step.clone().filter(match clearance > 0.0 || seed == 0 {
                true => filter.clone().early(),
                false => filter.clone(),
            });
            let mut found = Vec::new();
            for mut detector in detectors() {
                let all = impacts(&mut detector, &scene, &step).len();
                let some = impacts(&mut detector, &scene, &filtered);
                assert!(some.len() < all && !some.is_empty());
                let least = some.iter().map(|i| i.toi).reduce(f64::min);
                let first = detector.earliest(&scene, &filtered).expect("good");
                assert_eq!(first.map(|i| i.toi), least);
                assert!(!detector.is_free(&scene, &filtered).expect("good"));
                found.push(rows(&some));
                let none = step.clone().filter(PairFilter::new(|_| false));
                assert!(detector.is_free(&scene, &none).expect("good"));
                let advance = detector.advance(&scene, &none).expect("good");
                assert_eq!(advance.fraction, 1.0);
            }
            assert_eq!([&found[1], &found[2]], [&found[0]; 2]);
        }
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
        let step = |separation: f64| {
            Query::all()
                .separation(separation)
                .precision(Precision::F64)
        };
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

/// The rounded positions keep the distance on the whole way, and the step is nearly as long as it
/// can be.
#[test]
fn a_step_that_is_advanced_keeps_the_distance() {
    for mut detector in detectors() {
        let mut scene = falling(-2.0);
        let step = Query::all().separation(0.1);
        let advance = detector.advance(&scene, &step).expect("good");
        // From 4 down to 0.1, of 6.
        let most = 3.9 / 6.0;
        assert!(
            advance.fraction < most && advance.fraction > most - 1e-6,
            "{advance:?}"
        );
        advance.apply(&mut scene).expect("same bodies");
        let near = Query::all();
        assert!(detector.near(&scene, 0.1, &near).expect("good").is_empty());
        let near = detector.near(&scene, 0.1001, &near).expect("good");
        assert!(!near.is_empty());
    }
}

/// A point beside a plane, on a way beside it: where it is computed in floats on the way it may
/// lie on the plane.
#[test]
fn rounding_is_kept_with_a_share_of_nothing_too() {
    let mut scene = Scene::new();
    let plane = [
        [0.0, -9.0, 0.0],
        [4.0, -9.0, 4.0],
        [0.0, 9.0, 0.0],
        [4.0, 9.0, 4.0],
    ];
    scene
        .add_triangles(&[[0, 1, 2], [1, 3, 2]], &plane)
        .expect("good");
    let start = [1.630_592_070_448_239_7, 0.5, 1.630_592_070_448_24];
    let end = [1.267_088_846_626_231_6, 0.7, 1.267_088_846_626_231_8];
    let point = scene.add_points(&[start]).expect("good");
    scene.set_end_positions(point, &[end]).expect("good");
    let a = 0.485_835_358_831_789_1;
    let at: [f64; 3] = std::array::from_fn(|k| start[k] + a * (end[k] - start[k]));
    assert_eq!(at[0], at[2], "on the plane");
    let fraction = |clearance: f64, share| {
        let step = Query::all().clearance(Clearance::new(clearance).share(share));
        let advance = detector(Method::Clusters, 2).advance(&scene, &step);
        advance.expect("good").fraction
    };
    for share in [0.0, 5e-324, 1e-9, 0.2] {
        assert!(fraction(1e-4, share) < a, "{share}");
    }
    // The way itself is free, and this is a question about the way.
    let step = Query::all().clearance(Clearance::new(1e-4).share(0.0));
    assert!(
        detector(Method::Clusters, 2)
            .is_free(&scene, &step)
            .expect("good")
    );
}

#[test]
fn the_answer_depends_on_the_input_alone() {
    let mut scene = lattice(20);
    let [a, b] = [1, 2].map(|seed| impinge_scenes::soup::triangles(24, 0.3, seed));
    let body = a.add_to(&mut scene).expect("good");
    scene.set_end_positions(body, &b.positions).expect("good");
    for step in [Query::all().separation(0.02), Query::all().clearance(0.02)] {
        is_the_same_everywhere(&scene, &step);
    }
}

pub fn is_the_same_everywhere(scene: &Scene, step: &Query) {
    let expected = rows(&impacts(&mut detector(Method::Naive, 2), scene, step));
    assert!(expected.len() > 50, "{}", expected.len());
    for (threads, instruction_set, memory_budget) in [
        (1, InstructionSet::Portable, None),
        (2, InstructionSet::Avx2, Some(3_000_000)),
        (7, InstructionSet::Avx512, None),
    ] {
        let mut detector = Detector::new(
            Settings::new()
                .backend(Backend::Cpu)
                .threads(threads)
                .instruction_set(instruction_set)
                .memory_budget(memory_budget),
        )
        .expect("settings");
        for _ in 0..2 {
            assert_eq!(rows(&impacts(&mut detector, scene, step)), expected);
            let all = impacts(&mut detector, scene, step);
            let first = detector.earliest(scene, step).expect("good");
            let least = all.iter().map(|i| i.toi).reduce(f64::min);
            assert_eq!(first.map(|i| i.toi), least);
        }
    }
}

#[test]
fn bad_clearances_are_refused_by_name() {
    let mut detector = detector(Method::Clusters, 2);
    let scene = falling(0.0);
    let mut refused = |clearance: Clearance| match detector
        .impacts(&scene, &Query::all().clearance(clearance))
        .err()
    {
        Some(Error::Setting { setting, .. }) => Some(setting),
        _ => None,
    };
    for bad in [-0.5, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(Clearance::new(bad)), Some("clearance"));
        assert_eq!(
            refused(Clearance::new(0.1).share(bad)),
            Some("clearance_share")
        );
    }
    assert_eq!(
        refused(Clearance::new(0.1).share(1.0)),
        Some("clearance_share")
    );
    assert_eq!(refused(Clearance::new(0.1).share(1.0f64.next_down())), None);
}

#[test]
fn bad_separations_are_refused_by_name() {
    for mut detector in detectors() {
        let scene = falling(0.0);
        for bad in [-0.5, f64::NAN, f64::INFINITY] {
            let step = Query::all().separation(bad);
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

#[test]
fn questions_that_ask_no_filter_refuse_one() {
    let scene = falling(-1.0);
    let step = Query::all().filter(PairFilter::new(|_| false));
    let mut detector = detector(Method::Auto, 2);
    let answers = [
        detector.detect(&scene, &step).map(|_| ()),
        detector.count(&scene, &step).map(|_| ()),
        detector.any(&scene, &step).map(|_| ()),
        detector.near(&scene, 0.1, &step).map(|_| ()),
        detector.nearest(&scene, &step).map(|_| ()),
        detector.candidates(&scene, 0.1, &step).map(|_| ()),
    ];
    for (ix, answer) in answers.into_iter().enumerate() {
        let error = answer.expect_err("a filter is refused");
        let is_named = matches!(
            error,
            Error::Setting {
                setting: "filter",
                ..
            }
        );
        assert!(is_named, "{ix}: {error}");
    }
    // Those about contacts take it, and their look at the start does.
    let step = step.start(Start::Verify);
    assert!(detector.impacts(&scene, &step).expect("good").is_empty());
    assert!(detector.is_free(&scene, &step).expect("good"));
}
