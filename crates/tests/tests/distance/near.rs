//! Elements within a distance: against every pair by the exact test, on every method, thread count
//! and budget.

use impinge_core::exact::{
    ElementPair, Feature, are_within, closest_points, edge_face_are_within, faces_are_within,
    nearest_features, touch, triangles_intersect,
};
use impinge_core::{
    Backend, BodyId, BodyKind, Control, Detector, Elements, Error, InstructionSet, Method,
    NearPair, NearPairs, PairKind, Part, Query, Scene, Settings, Thickness,
};
use impinge_scenes::{Random, adversarial, soup, surfaces};
use impinge_tests::{detector, detectors, thickness_of};

type Point = [f64; 3];

/// Detectors of several numbers of threads and all instruction sets, one of them with little
/// memory.
fn with_all_settings(memory_budget: u64) -> impl Iterator<Item = (usize, Detector)> {
    let settings = [
        (1, InstructionSet::Portable, None),
        (2, InstructionSet::Avx2, None),
        (3, InstructionSet::Avx512, Some(memory_budget)),
        (16, InstructionSet::Avx512, None),
    ];
    settings
        .into_iter()
        .map(|(threads, instruction_set, memory_budget)| {
            let settings = Settings::new()
                .backend(Backend::Cpu)
                .threads(threads)
                .instruction_set(instruction_set)
                .memory_budget(memory_budget);
            (threads, Detector::new(settings).expect("settings"))
        })
}

/// What is compared of a pair.
type Row = (PairKind, [u32; 4], [Feature; 2], bool);

fn rows(near: &NearPairs) -> Vec<Row> {
    let row = |pair: NearPair| (pair.kind, pair.row(), pair.features, pair.is_parallel);
    near.iter().map(row).collect()
}

/// An element with its body, its number and its corners.
pub struct Element {
    pub body: BodyId,
    pub number: u32,
    ids: Vec<u32>,
    corners: Vec<Point>,
}

pub fn elements(scene: &Scene, part: Part) -> Vec<Element> {
    let mut all = Vec::new();
    for (id, body) in scene.bodies() {
        let elements: &Elements = body.part(part);
        for ix in 0..elements.len() {
            let ids = elements.corners(ix).to_vec();
            all.push(Element {
                body: id,
                number: if part == Part::Vertices {
                    ids[0]
                } else {
                    ix as u32
                },
                corners: ids
                    .iter()
                    .map(|&id| body.positions().point(id as usize))
                    .collect(),
                ids,
            });
        }
    }
    all
}

fn four(points: &[&[Point]]) -> [Point; 4] {
    let mut four = [[0.0; 3]; 4];
    for (to, from) in four.iter_mut().zip(points.iter().copied().flatten()) {
        *to = *from;
    }
    four
}

/// Whether two elements are near, and the features if one predicate names them.
fn decide(kind: PairKind, a: &[Point], b: &[Point], distance: f64) -> Option<Option<Row>> {
    let simple = |pair, points: [Point; 4], swap: bool| {
        are_within(pair, &points, distance).then(|| {
            let nearest = nearest_features(pair, &points);
            let mut features = [nearest.a, nearest.b];
            if swap {
                features.reverse();
            }
            Some((kind, [0; 4], features, nearest.is_parallel))
        })
    };
    match kind {
        PairKind::VertexFace => simple(ElementPair::VertexFace, four(&[a, b]), false),
        PairKind::EdgeEdge => simple(ElementPair::EdgeEdge, four(&[a, b]), false),
        PairKind::EdgeVertex => simple(ElementPair::VertexEdge, four(&[b, a]), true),
        PairKind::VertexVertex => simple(ElementPair::VertexVertex, four(&[a, b]), false),
        PairKind::EdgeFace => {
            // They meet, whatever the distance.
            edge_face_are_within(&[a[0], a[1]], &[b[0], b[1], b[2]], 0.0).then_some(None)
        }
        PairKind::FaceFace => {
            let [a, b] = [a, b].map(|face| [face[0], face[1], face[2]]);
            faces_are_within(&a, &b, distance).then_some(None)
        }
    }
}

/// Pair by pair: all kinds, everything with everything.
fn expected(scene: &Scene, distance: f64) -> Vec<Row> {
    expected_of(scene, |_, _| distance)
}

/// As [`expected`], where each pair is near within its own distance.
fn expected_of(scene: &Scene, within: impl Fn([&Element; 2], [Part; 2]) -> f64) -> Vec<Row> {
    let mut expected = Vec::new();
    for kind in PairKind::ALL {
        let [of_a, of_b] = kind.parts().map(|part| elements(scene, part));
        for a in &of_a {
            for b in &of_b {
                let is_twice = kind.parts()[0] == kind.parts()[1]
                    && (a.body.index(), a.number) >= (b.body.index(), b.number);
                let shares = a.body == b.body && a.ids.iter().any(|id| b.ids.contains(id));
                if is_twice || shares {
                    continue;
                }
                let row = [
                    a.body.index() as u32,
                    a.number,
                    b.body.index() as u32,
                    b.number,
                ];
                let distance = within([a, b], kind.parts());
                match decide(kind, &a.corners, &b.corners, distance) {
                    Some(Some((kind, _, features, parallel))) => {
                        expected.push((kind, row, features, parallel));
                    }
                    Some(None) => expected.push((kind, row, [Feature::Face; 2], false)),
                    None => {}
                }
            }
        }
    }
    expected.sort_by_key(|&(kind, row, ..)| (kind, row));
    expected
}

/// Features of compound pairs have a test of their own.
fn without_compound_features(rows: Vec<Row>) -> Vec<Row> {
    rows.into_iter()
        .map(|(kind, row, features, parallel)| match kind {
            PairKind::EdgeFace | PairKind::FaceFace => (kind, row, [Feature::Face; 2], false),
            _ => (kind, row, features, parallel),
        })
        .collect()
}

fn all_kinds() -> Query {
    Query::all().kinds(PairKind::ALL)
}

/// Faces on a lattice, bare edges and points; a third of the elements is degenerate.
fn lattice(seed: u64, double: bool) -> Scene {
    let mut random = Random::new(seed);
    let mut points = |n: usize| -> Vec<[f32; 3]> {
        let mut at = || random.below(5) as f32;
        (0..n).map(|_| [at(), at(), at()]).collect()
    };
    let faces: Vec<[u32; 3]> = (0..5)
        .map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % 15])
        .collect();
    let mut scene = Scene::new();
    let of_faces = points(15);
    if double {
        let of_faces: Vec<[f64; 3]> = of_faces.iter().map(|p| p.map(f64::from)).collect();
        scene.add_triangles(&faces, &of_faces).expect("good");
    } else {
        scene.add_triangles(&faces, &of_faces).expect("good");
    }
    scene
        .add_triangles(&[[0, 1, 2], [2, 1, 3]], &points(4))
        .expect("good");
    scene
        .add_edges(&[[0, 1], [1, 2], [3, 3]], &points(4))
        .expect("good");
    scene.add_points(&points(5)).expect("good");
    scene
}

/// Distances that occur on a lattice: exactly, and one unit in the last place beside.
#[test]
fn lattices_are_answered_as_pair_by_pair() {
    let distances = [
        0.0,
        1.0,
        1.0_f64.next_down(),
        1.5,
        2.0,
        2.0_f64.sqrt(),
        2.0_f64.sqrt().next_up(),
        0.5,
    ];
    for seed in 0..8 {
        let scene = lattice(seed, seed % 2 == 1);
        for (ix, distance) in distances.into_iter().enumerate() {
            if (seed as usize + ix) % 2 == 1 {
                continue;
            }
            let expected = expected(&scene, distance);
            for mut detector in detectors() {
                let near = detector.near(&scene, distance, &all_kinds()).expect("good");
                assert_eq!(
                    without_compound_features(rows(&near)),
                    expected,
                    "seed {seed}, {distance}"
                );
            }
        }
    }
}

#[test]
fn a_distance_that_occurs_counts_and_one_below_does_not() {
    let scene = {
        let mut scene = Scene::new();
        let [a, b] = [0.0f32, 3.0].map(|z| [[0.0, 0.0, z], [4.0, 0.0, z], [0.0, 4.0, z]]);
        scene.add_triangles(&[[0, 1, 2]], &a).expect("good");
        scene.add_triangles(&[[0, 1, 2]], &b).expect("good");
        scene
    };
    for mut detector in detectors() {
        let mut count = |distance: f64| {
            let query = Query::between_all().kinds(PairKind::ALL);
            let query = query.closest_points();
            let near = detector.near(&scene, distance, &query).expect("good");
            assert!(near.iter().all(|pair| {
                let closest = pair.closest.expect("asked for");
                closest.distance == 3.0 && closest.points[0][2] != closest.points[1][2]
            }));
            PairKind::ALL.map(|kind| near.of(kind).len())
        };
        assert_eq!(count(3.0_f64.next_down()), [0; 6]);
        // Each vertex is over the other face; each edge is over itself and both neighbours. No edge
        // meets a face.
        assert_eq!(count(3.0), [6, 9, 12, 3, 0, 1]);
    }
}

#[test]
fn what_is_reported_by_default_depends_on_what_bodies_are() {
    let mut scene = Scene::new();
    let at = |z: f32| [[0.0f32, 0.0, z], [4.0, 0.0, z], [0.0, 4.0, z]];
    scene.add_triangles(&[[0, 1, 2]], &at(0.0)).expect("good");
    scene.add_edges(&[[0, 1]], &at(0.5)[..2]).expect("good");
    scene.add_points(&at(1.0)[..1]).expect("good");
    scene.add_points(&at(1.5)[..1]).expect("good");
    let query = Query::all();
    for mut detector in detectors() {
        let near = detector.near(&scene, 2.0, &query).expect("good");
        let kinds = PairKind::ALL.map(|kind| near.of(kind).len());
        // Four vertices over the face; the bare edge and all three edges of the face; the bare edge
        // and both points; those.
        assert_eq!(kinds, [4, 3, 2, 1, 0, 0], "{near:?}");
    }
}

/// 0.1 + 0.2 as real numbers is less than the float 0.1 + 0.2.
#[test]
fn thickness_is_added_as_real_numbers() {
    let mut scene = Scene::new();
    let a = scene.add_points(&[[0.0f64; 3]]).expect("good");
    let b = scene.add_points(&[[0.1 + 0.2, 0.0, 0.0]]).expect("good");
    for mut detector in detectors() {
        let mut count = |r: f64, s: f64, distance: f64| {
            scene.set_thickness(a, r).expect("good");
            scene.set_thickness(b, s).expect("good");
            let near = detector.near(&scene, distance, &Query::between(a, b));
            near.expect("good").len()
        };
        assert_eq!(count(0.1, 0.2, 0.0), 0);
        assert_eq!(count(0.1, 0.2_f64.next_up(), 0.0), 1);
        assert_eq!(count(0.1 + 0.2, 0.0, 0.0), 1);
        assert_eq!(count(0.1, 0.1, 0.1), 0);
        assert_eq!(count(0.1, 0.1, 0.11), 1);
        assert_eq!(
            count(f64::MAX, f64::MAX, 0.0),
            1,
            "the sum overflows a float"
        );
    }
    // Of one body it counts twice.
    let mut scene = Scene::new();
    let body = scene
        .add_points(&[[0.0f32; 3], [1.0, 0.0, 0.0]])
        .expect("good");
    for mut detector in detectors() {
        for (thickness, n) in [(0.5_f64.next_down(), 0), (0.5, 1)] {
            scene.set_thickness(body, thickness).expect("good");
            let near = detector
                .near(&scene, 0.0, &Query::self_of(body))
                .expect("good");
            assert_eq!(near.len(), n);
        }
    }
}

/// A thickness per element of some part of a body, on a lattice so that sums are exact.
pub fn thickness_by(random: &mut Random, scene: &Scene, body: BodyId, part: Part) -> Vec<f64> {
    let body = scene.body(body).expect("known");
    let n = match part {
        Part::Vertices => body.n_vertices(),
        _ => body.part(part).len(),
    };
    (0..n).map(|_| f64::from(random.below(4)) * 0.25).collect()
}

pub fn thickness(part: Part, each: &[f64]) -> Thickness<'_> {
    match part {
        Part::Vertices => Thickness::vertices(each),
        Part::Edges => Thickness::edges(each),
        _ => Thickness::faces(each),
    }
}

pub const PARTS: [Part; 3] = [Part::Vertices, Part::Edges, Part::Faces];

/// One number per vertex, edge or face, each beside bodies with one number: as pair by pair.
#[test]
fn each_element_may_have_its_own_thickness() {
    let mut n_by_part = [0; 3];
    for seed in 0..12 {
        let mut scene = lattice(seed, seed % 2 == 1);
        let bodies: Vec<BodyId> = scene.bodies().map(|(id, _)| id).collect();
        let mut random = Random::new(seed);
        let part = PARTS[seed as usize % 3];
        for (ix, &body) in bodies.iter().enumerate() {
            if ix % 2 == 0 || seed % 4 == 0 {
                let each = thickness_by(&mut random, &scene, body, part);
                scene
                    .set_thickness(body, thickness(part, &each))
                    .expect("good");
                let held = scene.body(body).expect("known");
                assert_eq!(held.thickness_by_element(), Some((part, &each[..])));
            } else {
                scene.set_thickness(body, 0.5).expect("good");
            }
        }
        let own = |of: &Element, by: Part| thickness_of(&scene, of.body, by, of.number);
        for distance in [0.0, 0.25, 1.0] {
            // An edge and a face meet or not.
            let expected = expected_of(&scene, |[a, b], [of_a, of_b]| {
                distance + own(a, of_a) + own(b, of_b)
            });
            n_by_part[seed as usize % 3] += expected.len();
            for mut detector in detectors() {
                let near = detector.near(&scene, distance, &all_kinds()).expect("good");
                assert_eq!(
                    without_compound_features(rows(&near)),
                    without_compound_features(expected.clone()),
                    "seed {seed}, {distance}"
                );
            }
        }
    }
    assert!(n_by_part.iter().all(|&n| n > 1000), "{n_by_part:?}");
}

/// 0.1 + 0.2 as real numbers is less than the float 0.1 + 0.2, for each pair by itself.
#[test]
fn the_thickness_of_each_element_is_added_as_a_real_number() {
    let mut scene = Scene::new();
    let at = [0.0, 0.1 + 0.2, 5.0, 5.25_f64];
    let points = scene.add_points(&at.map(|x| [x, 0.0, 0.0])).expect("good");
    for mut detector in detectors() {
        let mut pairs = |each: &[f64], distance: f64| {
            scene
                .set_thickness(points, Thickness::vertices(each))
                .expect("good");
            let near = detector.near(&scene, distance, &Query::all());
            let near = near.expect("good");
            near.iter()
                .map(|pair| [pair.a.element, pair.b.element])
                .collect::<Vec<_>>()
        };
        assert_eq!(pairs(&[0.1, 0.2, 0.0, 0.0], 0.0), [[0u32; 2]; 0]);
        assert_eq!(pairs(&[0.1, 0.2_f64.next_up(), 0.0, 0.0], 0.0), [[0, 1]]);
        assert_eq!(
            pairs(&[0.0, 0.2, 0.125, 0.0625], 0.0625_f64.next_down()),
            [[0u32; 2]; 0]
        );
        assert_eq!(pairs(&[0.0, 0.2, 0.125, 0.0625], 0.0625), [[2, 3]]);
        assert_eq!(pairs(&[f64::MAX, 0.0, 0.0, f64::MAX], 0.0).len(), 5);
    }
}

/// The same bytes for every thread count, instruction set, budget and precision, as the oracle
/// says; and where all elements have the same, those of one number.
#[test]
fn answers_with_a_thickness_of_each_element_depend_on_the_input_alone() {
    let ball = surfaces::icosphere(3);
    let shell = ball.mapped(|[x, y, z]| [1.05 * x, 1.05 * y, 1.05 * z + 0.01]);
    for (round, is_double) in [(0, false), (1, true), (2, false), (3, true)] {
        let mut scene = Scene::new();
        let mut random = Random::new(round);
        let bodies = [&ball, &shell].map(|model| {
            let added = match is_double {
                true => {
                    // Not rounded to single precision.
                    let at = model
                        .positions
                        .iter()
                        .map(|p| p.map(|x| f64::from(x) / 3.0));
                    scene.add((model.elements.clone(), at.collect::<Vec<_>>()))
                }
                false => model.add_to(&mut scene),
            };
            added.expect("good")
        });
        let scale = if is_double { 1.0 / 3.0 } else { 1.0 };
        let part = PARTS[round as usize % 3];
        let mut each = |body, most: f64| -> Vec<f64> {
            let n = thickness_by(&mut random, &scene, body, part).len();
            (0..n)
                .map(|_| most * scale * f64::from(random.unit()))
                .collect()
        };
        let thick = [each(bodies[0], 0.02), each(bodies[1], 0.01)];
        let n_own = if round == 3 { 1 } else { 2 };
        for (&body, each) in bodies.iter().zip(&thick).take(n_own) {
            scene
                .set_thickness(body, thickness(part, each))
                .expect("good");
        }
        let distance = 0.045 * scale;
        let query = Query::all().closest_points();
        let mut oracle = detector(Method::Naive, 2);
        let naive = oracle.near(&scene, distance, &query).expect("good");
        let lists = oracle.neighbours(&scene, distance, &query).expect("good");
        let safe = oracle
            .safe_distances(&scene, distance, &query)
            .expect("good");
        assert!(naive.len() > 100, "{}", naive.len());
        for (threads, mut detector) in with_all_settings(12_000_000) {
            for frame in 0..2 {
                let near = detector.near(&scene, distance, &query).expect("good");
                assert!(near.iter().eq(naive.iter()), "{threads}, {frame}");
                assert_eq!(near.hash(), naive.hash());
            }
            let near = detector.near(&scene, distance, &Query::all());
            assert!(rows(&near.expect("good")) == rows(&naive), "{threads}");
            let own = detector.neighbours(&scene, distance, &query).expect("good");
            assert_eq!((own.vf(), own.ee()), (lists.vf(), lists.ee()));
            assert!(own.vf().distances.contains(&0.0));
            let own = detector.safe_distances(&scene, distance, &query);
            let own = own.expect("good");
            for body in bodies {
                assert_eq!(own.of(body), safe.of(body));
            }
            assert!(own.touching().iter().eq(safe.touching().iter()));
            assert!(!own.touching().is_empty());
        }
    }
    let mut scene = Scene::new();
    let body = ball.add_to(&mut scene).expect("good");
    let mut detector = detector(Method::Clusters, 2);
    let mut hash = |scene: &Scene| {
        let near = detector.near(scene, 0.1, &Query::all()).expect("good");
        (near.hash(), near.len())
    };
    let thin = hash(&scene);
    scene.set_thickness(body, 0.03).expect("good");
    let one = hash(&scene);
    assert!(thin.1 < one.1);
    for part in PARTS {
        let n = scene.body(body).expect("known").part(part).len();
        // Boxes of before would be too small, and then too large.
        for (most, expected) in [(0.0, thin), (0.03, one)] {
            scene
                .set_thickness(body, thickness(part, &vec![most; n]))
                .expect("good");
            assert_eq!(hash(&scene), expected, "{part:?}");
        }
    }
}

/// One thick vertex does not make all boxes larger.
#[test]
fn boxes_reach_as_far_as_their_own_elements_are_thick() {
    let mut scene = Scene::new();
    let sheet = surfaces::cloth(60, 60, 1.0);
    let body = sheet.add_to(&mut scene).expect("good");
    let mut detector = detector(Method::Clusters, 2);
    let mut count = |scene: &Scene| {
        let near = detector.near(scene, 0.1, &Query::all()).expect("good");
        near.stats().n_candidates
    };
    let thin = count(&scene);
    let mut each = vec![0.0; sheet.positions.len()];
    each[1800] = 5.0;
    scene
        .set_thickness(body, Thickness::vertices(&each[..]))
        .expect("good");
    let one = count(&scene);
    scene.set_thickness(body, 5.0).expect("good");
    let all = count(&scene);
    assert!(thin < one && one < thin + all / 20, "{thin} {one} {all}");
}

#[test]
fn wrong_thicknesses_are_refused_by_name() {
    let mut scene = lattice(1, false);
    let (body, _) = scene.bodies().next().expect("some");
    let message = |scene: &mut Scene, thickness: Thickness<'_>| {
        let error = scene.set_thickness(body, thickness).unwrap_err();
        assert_eq!(error.code(), "invalid");
        error.to_string()
    };
    let n_edges = scene.body(body).expect("known").edges().len();
    let of = |n: usize| vec![0.5; n];
    assert_eq!(
        message(&mut scene, Thickness::vertices(of(14))),
        "body 0: 14 thicknesses given, but there are 15 vertices"
    );
    assert_eq!(
        message(&mut scene, Thickness::edges(of(n_edges + 1))),
        format!(
            "body 0: {} thicknesses given, but there are {n_edges} edges",
            n_edges + 1
        )
    );
    assert_eq!(
        message(&mut scene, Thickness::faces(of(0))),
        "body 0: 0 thicknesses given, but there are 5 faces"
    );
    for bad in [-0.25, f64::NAN, f64::INFINITY] {
        let mut each = of(5);
        each[3] = bad;
        assert_eq!(
            message(&mut scene, Thickness::faces(each)),
            format!(
                "body 0: a thickness of {bad} is given as number 3 of its faces, where a finite number that is not below 0 is allowed"
            )
        );
        assert!(message(&mut scene, bad.into()).starts_with("thickness: "));
    }
    assert_eq!(
        scene.body(body).expect("known").thickness(),
        0.0,
        "unchanged"
    );
    scene
        .set_thickness(body, Thickness::faces(&[0.0, 2.0, 0.0, 1.0, 0.0][..]))
        .expect("good");
    let held = scene.body(body).expect("known");
    let given = held.thickness_by_element().expect("of each face");
    assert_eq!(given, (Part::Faces, &[0.0, 2.0, 0.0, 1.0, 0.0][..]));
    assert_eq!(held.thickness(), 2.0);
    // Other faces: which is how thick is not known.
    let (elements, positions) = (held.elements().clone(), held.positions().clone());
    scene.remesh(body, (elements, positions)).expect("good");
    let held = scene.body(body).expect("known");
    assert_eq!((held.thickness(), held.thickness_by_element()), (0.0, None));
}

/// Faces and edges near faces: the distance is that of the nearest parts, points have it, and
/// features hold the points.
#[test]
fn edges_and_faces_are_as_far_as_their_nearest_parts() {
    let mut n_by_name = std::collections::BTreeMap::new();
    for seed in 0..6 {
        let mut scene = Scene::new();
        let (a, b) = if seed < 3 {
            (
                soup::triangles(12, 0.4, 2 * seed),
                soup::triangles(12, 0.4, 2 * seed + 1),
            )
        } else {
            (
                soup::lattice_triangles(12, 4, 2 * seed),
                soup::lattice_triangles(12, 4, 2 * seed + 1),
            )
        };
        a.add_to(&mut scene).expect("good");
        b.add_to(&mut scene).expect("good");
        let query = Query::between_all()
            .kinds([PairKind::EdgeFace, PairKind::FaceFace])
            .closest_points();
        let mut detector = detector(Method::Clusters, 2);
        let near = detector.near(&scene, 1.0, &query).expect("good");
        for pair in near.iter() {
            let corners = |part, body: BodyId, number: u32| -> Vec<Point> {
                let body = scene.body(body).expect("known");
                let ids = body.part(part).corners(number as usize);
                let ids = ids.iter().map(|&id| body.positions().point(id as usize));
                ids.collect()
            };
            let [of_a, of_b] = pair.kind.parts();
            let a = corners(of_a, pair.a.body, pair.a.element);
            let b = corners(of_b, pair.b.body, pair.b.element);
            let closest = pair.closest.expect("asked for");
            let mut least = f64::INFINITY;
            let mut measure = |pair: ElementPair, points: [Point; 4]| {
                let distance = match touch(pair, &points) {
                    true => 0.0,
                    false => closest_points(pair, &points).distance,
                };
                least = least.min(distance);
            };
            let edges = |of: &[Point]| -> Vec<[Point; 2]> {
                match of {
                    [p, q] => vec![[*p, *q]],
                    _ => vec![[of[0], of[1]], [of[1], of[2]], [of[2], of[0]]],
                }
            };
            for p in &a {
                measure(ElementPair::VertexFace, four(&[&[*p], &b]));
            }
            if a.len() == 3 {
                for p in &b {
                    measure(ElementPair::VertexFace, four(&[&[*p], &a]));
                }
            }
            for p in edges(&a) {
                for q in edges(&b) {
                    measure(ElementPair::EdgeEdge, four(&[&p, &q]));
                }
            }
            let face = |of: &[Point]| [of[0], of[1], of[of.len() - 1]];
            if triangles_intersect(&face(&a), &face(&b)) {
                least = 0.0;
            }
            assert_eq!(closest.distance, least, "{pair:?}");
            let [p, q] = closest.points;
            let gap =
                ((p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2) + (p[2] - q[2]).powi(2)).sqrt();
            assert!((gap - least).abs() < 1e-12, "{pair:?} {gap}");
            for (feature, point, corners) in [(0, p, &a), (1, q, &b)] {
                let held: Vec<Point> = match pair.features[feature] {
                    Feature::Vertex(ix) => vec![corners[usize::from(ix)]],
                    Feature::Edge(ix) => {
                        let ix = usize::from(ix);
                        vec![corners[ix], corners[(ix + 1) % corners.len()]]
                    }
                    Feature::Face => corners.clone(),
                };
                let mut four = [point, point, point, point];
                four[1..=held.len()].copy_from_slice(&held);
                let kind = [
                    ElementPair::VertexVertex,
                    ElementPair::VertexEdge,
                    ElementPair::VertexFace,
                ][held.len() - 1];
                assert!(are_within(kind, &four, 1e-12), "{pair:?}");
            }
            *n_by_name.entry(pair.name()).or_insert(0) += 1;
        }
    }
    let names: Vec<_> = n_by_name.keys().copied().collect();
    assert_eq!(names, ["E_E", "E_T", "P_E", "P_P", "P_T"], "{n_by_name:?}");
}

/// A ball inside a slightly larger one, and a lattice: the same bytes for every thread count,
/// instruction set and budget, as the oracle says.
#[test]
fn the_answer_depends_on_the_input_alone() {
    let ball = surfaces::icosphere(3);
    let shell = ball.mapped(|[x, y, z]| [1.05 * x, 1.05 * y, 1.05 * z + 0.01]);
    let lattice = soup::lattice_triangles(60, 6, 7);
    let scenes = [
        (vec![ball, shell], 0.06),
        (vec![lattice.clone()], 1.0),
        (
            vec![soup::triangles(150, 0.2, 1), soup::triangles(150, 0.2, 2)],
            0.05,
        ),
    ];
    for (models, distance) in scenes {
        let mut scene = Scene::new();
        for model in &models {
            model.add_to(&mut scene).expect("good");
        }
        let plain = Query::all();
        let query = plain.clone().closest_points();
        let naive = detector(Method::Naive, 2)
            .near(&scene, distance, &query)
            .expect("good");
        assert!(naive.len() > 100, "{}", naive.len());
        for (threads, mut detector) in with_all_settings(4_000_000) {
            for frame in 0..2 {
                let near = detector.near(&scene, distance, &query).expect("good");
                assert!(near.iter().eq(naive.iter()), "{threads}, {frame}");
                assert_eq!(near.hash(), naive.hash());
            }
            // Without nearest points, most features are named where pairs are decided.
            let near = detector.near(&scene, distance, &plain).expect("good");
            assert!(rows(&near) == rows(&naive), "{threads}");
            assert!(near.iter().all(|pair| pair.closest.is_none()));
        }
        // One pair more changes the hash.
        let fewer = detector(Method::Clusters, 2)
            .near(&scene, distance / 2.0, &Query::all())
            .expect("good");
        assert!(fewer.len() < naive.len() && fewer.hash() != naive.hash());
    }
}

/// What touches is within 0; what is within d is within more.
#[test]
fn a_distance_of_zero_is_intersection_and_larger_ones_only_add() {
    let mut scene = Scene::new();
    for seed in [3, 4] {
        let model = soup::triangles(80, 0.4, seed);
        model.add_to(&mut scene).expect("good");
    }
    let mut detector = detector(Method::Clusters, 2);
    let pairs = detector
        .detect(&scene, &Query::between_all())
        .expect("good");
    let pairs: Vec<[u32; 2]> = pairs.iter().map(|(a, b)| [a.element, b.element]).collect();
    let faces = Query::between_all().kinds([PairKind::FaceFace]);
    let mut last: Vec<[u32; 2]> = Vec::new();
    for distance in [0.0, 1e-9, 0.01, 0.1, 0.3] {
        let near = detector.near(&scene, distance, &faces).expect("good");
        let now: Vec<[u32; 2]> = near
            .iter()
            .map(|pair| [pair.a.element, pair.b.element])
            .collect();
        if distance == 0.0 {
            assert_eq!(now, pairs);
        }
        assert!(last.iter().all(|row| now.binary_search(row).is_ok()));
        assert!(now.len() >= last.len());
        last = now;
    }
    assert!(last.len() > pairs.len());
}

/// End positions are not looked at, and steps are not disturbed.
#[test]
fn bodies_stand_still() {
    let mut scene = Scene::new();
    scene.add_points(&[[0.0f32; 3]]).expect("good");
    let moving = scene.add_points(&[[5.0f32, 0.0, 0.0]]).expect("good");
    scene
        .set_end_positions(moving, &[[-5.0f32, 0.0, 0.0]])
        .expect("good");
    for mut detector in detectors() {
        for _ in 0..2 {
            let mut count = |d| {
                let near = detector.near(&scene, d, &Query::between_all());
                near.expect("good").len()
            };
            assert_eq!((count(4.9), count(5.0)), (0, 1));
            let step = impinge_core::Query::all();
            assert_eq!(detector.impacts(&scene, &step).expect("good").len(), 1);
        }
    }
}

#[test]
fn bad_distances_are_refused_by_name() {
    let mut scene = Scene::new();
    let body = scene.add_points(&[[0.0f32; 3]]).expect("good");
    let gone = scene.add_points(&[[1.0f32; 3]]).expect("good");
    scene.remove(gone).expect("known");
    assert!(scene.set_thickness(gone, 1.0).is_err());
    let query = Query::all();
    for mut detector in detectors() {
        for (bad, shown) in [
            (-1.0, "-1"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
            (-f64::MIN_POSITIVE, "-2.2250738585072014e-308"),
        ] {
            let near = detector.near(&scene, bad, &query).map(|_| ());
            let thick = scene.set_thickness(body, bad);
            for (refused, name) in [(near, "distance"), (thick, "thickness")] {
                let Err(Error::Setting { setting, given, .. }) = refused else {
                    panic!("{bad} was accepted");
                };
                assert_eq!((setting, &*given), (name, shown));
            }
        }
        let token = impinge_core::CancelToken::new();
        token.cancel();
        detector.set_control(Control::new().cancel(&token));
        let result = detector.near(&scene, 0.0, &query);
        assert!(matches!(result, Err(Error::Cancelled)));
        detector.set_control(Control::new());
        // A huge distance is no error.
        let near = detector.near(&scene, f64::MAX, &query);
        assert!(near.expect("good").is_empty());
    }
}

/// Tetrahedra take part with their surface; coordinates of any size are answered.
#[test]
fn solids_and_numbers_of_any_size() {
    let mut scene = Scene::new();
    let solid = [
        [0.0f64, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
        [0.0, 0.0, 4.0],
    ];
    let solid = scene
        .add((vec![[0u32, 1, 2, 3]], solid.to_vec()))
        .expect("good");
    assert_eq!(
        scene.body(solid).expect("known").kind(),
        BodyKind::Tetrahedra
    );
    let far = scene
        .add_points(&[
            [1e70f64, 1e70, 1e70],
            [1.0, 1.0, -1.0],
            [1e-70, 1e-70, -1e-70],
        ])
        .expect("good");
    for mut detector in detectors() {
        let mut faces = |distance: f64| -> Vec<u32> {
            let query = Query::between(solid, far);
            let near = detector.near(&scene, distance, &query).expect("good");
            let mut vertices: Vec<u32> =
                near.of(PairKind::VertexFace).map(|p| p.a.element).collect();
            vertices.dedup();
            vertices
        };
        assert_eq!(faces(0.0), [] as [u32; 0]);
        assert_eq!(faces(1e-70_f64.next_down()), [] as [u32; 0]);
        assert_eq!(faces(1e-70), [2]);
        assert_eq!(faces(1.0), [1, 2]);
        assert_eq!(faces(1e71), [0, 1, 2]);
    }
}

/// Long elements of machine parts, in both precisions, at distances below and above what single
/// precision tells.
#[test]
fn long_elements_are_near_as_the_oracle_says() {
    let built = adversarial::machine_parts(1_200).unwrap();
    let mut double = Scene::new();
    for (_, body) in built.scene.bodies() {
        let points = (0..body.n_vertices()).map(|ix| body.positions().point(ix));
        let far: Vec<[f64; 3]> = points.map(|p| p.map(|x| x + 20_000.1)).collect();
        double.add((body.elements().clone(), far)).unwrap();
    }
    for scene in [&built.scene, &double] {
        for distance in [0.0, 0.001, 0.05] {
            let query = Query::all();
            let [expected, found] = [Method::Naive, Method::Clusters].map(|method| {
                let mut detector = detector(method, 2);
                rows(&detector.near(scene, distance, &query).unwrap())
            });
            assert_eq!(expected, found, "{distance}");
        }
    }
}
