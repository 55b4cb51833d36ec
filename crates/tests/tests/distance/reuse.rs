//! Near pairs from a list that was made with a margin: the same bytes as from nothing.

use std::sync::Arc;

use impinge_core::{
    Backend, BodyId, Bounds, Detector, Error, Exclusion, InstructionSet, Method, NearPair,
    NearPairs, Neighbours, PairKind, Positions, Query, SafeDistances, Scene, Settings, Thickness,
};
use impinge_scenes::{Random, soup, surfaces};
use impinge_tests::detector;

/// A detector that lists near pairs.
fn listing(margin: f64, threads: usize, instruction_set: InstructionSet) -> Detector {
    let settings = Settings::new()
        .backend(Backend::Cpu)
        .threads(threads)
        .instruction_set(instruction_set)
        .reuse_margin(margin);
    Detector::new(settings).expect("settings")
}

fn listings(margin: f64) -> [Detector; 3] {
    [
        listing(margin, 1, InstructionSet::Portable),
        listing(margin, 2, InstructionSet::Avx2),
        listing(margin, 5, InstructionSet::Avx512),
    ]
}

/// All bits of an answer.
fn near_bits(near: &NearPairs) -> Vec<u64> {
    let of_pair = |pair: NearPair| {
        let closest = pair.closest.expect("it was asked for");
        let points = closest.points.as_flattened().iter().map(|x| x.to_bits());
        let row = pair.row().map(u64::from);
        let first = [pair.kind as u64, closest.distance.to_bits()];
        first
            .into_iter()
            .chain(row)
            .chain(points)
            .collect::<Vec<_>>()
    };
    // The hash has the features.
    let mut bits: Vec<u64> = near.iter().flat_map(of_pair).collect();
    bits.push(near.hash());
    bits
}

fn safe_bits(scene: &Scene, safe: &SafeDistances) -> Vec<u64> {
    let bodies = scene.bodies().map(|(id, _)| id);
    let mut bits: Vec<u64> = bodies
        .flat_map(|id| match safe.of(id).expect("a body") {
            Bounds::F32(own) => own.iter().map(|x| u64::from(x.to_bits())).collect(),
            Bounds::F64(own) => own.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
        })
        .collect();
    bits.push(safe.touching().hash());
    bits
}

fn neighbour_bits(near: &Neighbours) -> Vec<u64> {
    let mut bits = Vec::new();
    for lists in [near.vf(), near.fv(), near.ee()] {
        bits.extend(&lists.offsets);
        bits.extend(lists.indices.iter().map(|&ix| u64::from(ix)));
        bits.extend(lists.distances.iter().map(|x| x.to_bits()));
    }
    bits
}

/// Whether a list never holds, as squares of the margin are lost.
fn never_holds(detector: &Detector) -> bool {
    detector.settings().reuse_margin < 1e-140
}

/// Asks all questions that are answered from lists. Returns how often something was listed.
fn assert_same(
    what: &str,
    scene: &Scene,
    query: &Query,
    distance: f64,
    (fresh, listing): (&mut Detector, &mut [Detector]),
) -> Vec<u64> {
    let asked = query.clone().closest_points();
    let near = fresh.near(scene, distance, &asked).unwrap();
    let expected = near_bits(&near);
    let neighbours = fresh.neighbours(scene, distance, query).unwrap();
    let expected_neighbours = neighbour_bits(&neighbours);
    let safe = fresh.safe_distances(scene, distance / 2.0, query).unwrap();
    let expected_safe = safe_bits(scene, &safe);
    let mut n_listed = Vec::new();
    for (ix, detector) in listing.iter_mut().enumerate() {
        let near = detector.near(scene, distance, &asked).unwrap();
        assert!(near_bits(&near) == expected, "{what}, {ix}");
        n_listed.push(near.stats().ways.n_listed);
        let neighbours = detector.neighbours(scene, distance, query).unwrap();
        let found = neighbour_bits(&neighbours);
        assert!(found == expected_neighbours, "{what}, {ix}");
        let safe = detector.safe_distances(scene, distance / 2.0, query);
        let safe = safe.unwrap();
        assert_eq!(safe_bits(scene, &safe), expected_safe, "{what}, {ix}");
        // The same question: it was listed already.
        assert!(
            never_holds(detector) || safe.stats().ways.n_listed == 0,
            "{what}, {ix}"
        );
    }
    n_listed
}

/// Moves each vertex by at most `most` along each axis.
fn tremble(scene: &mut Scene, body: BodyId, most: f32, random: &mut Random) {
    let held = scene.body(body).unwrap().positions();
    let moved: Vec<[f64; 3]> = (0..held.len())
        .map(|vertex| {
            held.point(vertex)
                .map(|x| x + f64::from(random.range(-most, most)))
        })
        .collect();
    match held {
        Positions::F64(_) => scene.set_positions(body, moved).unwrap(),
        Positions::F32(_) => {
            let narrow: Vec<_> = moved.iter().map(|p| p.map(|x| x as f32)).collect();
            scene.set_positions(body, narrow).unwrap();
        }
    }
}

/// A cloth in `f32`, a ball in `f64`, a web, points and edges.
fn mixed() -> (Scene, Vec<BodyId>) {
    let mut scene = Scene::new();
    let cloth = surfaces::cloth(9, 9, 0.15);
    let mut bodies = vec![cloth.add_to(&mut scene).unwrap()];
    let ball = surfaces::ball(100).scaled(0.4).translated([0.6, 0.1, 0.5]);
    let ball = (ball.elements.clone(), ball.positions_f64());
    bodies.push(scene.add(ball).unwrap());
    let web = soup::lattice_web(30, 3, 4).scaled(0.3);
    bodies.push(web.add_to(&mut scene).unwrap());
    let points: Vec<[f32; 3]> = (0..40)
        .map(|ix| [0.03 * ix as f32, 0.05, 0.01 * (ix % 7) as f32])
        .collect();
    bodies.push(scene.add_points(&points).unwrap());
    let ends: Vec<[u32; 2]> = (0..20).map(|ix| [2 * ix, 2 * ix + 1]).collect();
    bodies.push(scene.add_edges(&ends, &points).unwrap());
    (scene, bodies)
}

#[test]
fn a_thousand_frames_have_the_same_bytes() {
    let (mut scene, bodies) = mixed();
    let mut random = Random::new(7);
    let (query, distance, margin) = (Query::all(), 0.05, 0.02);
    let mut fresh = detector(Method::Clusters, 1);
    let mut listing = listings(margin);
    let mut n_listed = 0;
    let mut n_pairs = 0;
    for frame in 0..1000 {
        for &body in &bodies {
            tremble(&mut scene, body, 0.0015, &mut random);
        }
        // One of them sees the frame, all of them some.
        let of_frame = &mut listing[frame % 3..=frame % 3];
        let what = format!("frame {frame}");
        let listed = assert_same(&what, &scene, &query, distance, (&mut fresh, of_frame));
        n_listed += listed[0];
        n_pairs += fresh.stats().n_candidates;
    }
    assert!(n_pairs > 100_000, "{n_pairs}");
    assert!((50..400).contains(&n_listed), "{n_listed}");
}

/// Of two points that approach each other: how far they were apart, how far each moves, whether they
/// are near then, and whether all were looked at again.
#[test]
fn a_list_holds_until_half_of_the_margin() {
    let (distance, margin) = (1.0, 0.25);
    let short = 0.125 - 2f64.powi(-10);
    for (apart, way, is_near, is_searched) in [
        // Exactly within the distance.
        (distance + 2.0 * short, short, true, false),
        (distance + margin, short, false, false),
        // It was not listed.
        (distance + 1.25 * margin, 0.75 * margin, true, true),
    ] {
        let mut scene = Scene::new();
        let far = [9.0, 9.0, 9.0];
        let a = scene.add_points(&[[0.0, 0.0, 0.0]]).unwrap();
        let b = scene.add_points(&[[apart, 0.0, 0.0], far]).unwrap();
        let mut detector = listing(margin, 1, InstructionSet::Avx512);
        let near = detector.near(&scene, distance, &Query::all()).unwrap();
        assert_eq!((near.len(), near.stats().ways.n_listed), (0, 1));
        let moved = [[way, 0.0, 0.0]];
        scene.set_positions(a, &moved).unwrap();
        let moved = [[apart - way, 0.0, 0.0], far];
        scene.set_positions(b, &moved).unwrap();
        let near = detector.near(&scene, distance, &Query::all()).unwrap();
        let found = (near.len() == 1, near.stats().n_work_items > 0);
        assert_eq!(found, (is_near, is_searched), "{apart}, {way}");
    }
}

/// How often something was listed in some frames, with a margin of 0.02. Vertices move by up to 0.5
/// (true) or 0.001 along each axis before each.
fn listed_in(frames: impl IntoIterator<Item = bool>) -> Vec<u64> {
    let (mut scene, bodies) = mixed();
    let mut random = Random::new(11);
    let mut fresh = detector(Method::Clusters, 1);
    let mut listing = listing(0.02, 2, InstructionSet::Avx512);
    let query = Query::all().closest_points();
    let frames = frames.into_iter().map(|jumps| {
        for &body in &bodies {
            let most = if jumps { 0.5 } else { 0.001 };
            tremble(&mut scene, body, most, &mut random);
        }
        let expected = near_bits(&fresh.near(&scene, 0.05, &query).unwrap());
        let near = listing.near(&scene, 0.05, &query).unwrap();
        assert!(near_bits(&near) == expected);
        near.stats().ways.n_listed
    });
    frames.collect()
}

#[test]
fn what_jumps_is_not_listed_again_and_again() {
    let (jump, tremble) = (true, false);
    assert_eq!(listed_in([jump; 5]), [1, 0, 0, 0, 0]);
    // Listed where positions are near those of the question before, and after a list that was used.
    let frames = [
        jump, jump, tremble, tremble, tremble, jump, jump, tremble, jump,
    ];
    assert_eq!(listed_in(frames), [1, 0, 1, 0, 0, 1, 0, 1, 0]);
}

/// They are asked whether they meet, so distance tells nothing of those that do not.
#[test]
fn an_edge_that_comes_through_a_face_is_found() {
    let mut scene = Scene::new();
    let face = |z: f32| [[0.0, 0.0, z], [4.0, 0.0, z], [0.0, 4.0, z]];
    let edge = |z: f32| [[1.0, 1.0, z], [1.0, 1.0, z + 1.0]];
    let a = scene.add_triangles(&[[0, 1, 2]], &face(0.0)).unwrap();
    let b = scene.add_edges(&[[0, 1]], &edge(0.2)).unwrap();
    let query = Query::all().kinds([PairKind::EdgeFace]);
    for distance in [0.0, 0.01, 1.0] {
        scene.set_positions(a, &face(0.0)).unwrap();
        scene.set_positions(b, &edge(0.2)).unwrap();
        let mut detector = listing(0.25, 1, InstructionSet::Avx512);
        assert!(detector.near(&scene, distance, &query).unwrap().is_empty());
        scene.set_positions(a, &face(0.12)).unwrap();
        scene.set_positions(b, &edge(0.1)).unwrap();
        let near = detector.near(&scene, distance, &query).unwrap();
        assert_eq!((near.len(), near.stats().ways.n_listed), (1, 0));
    }
}

#[test]
fn what_changes_besides_positions_is_listed_again() {
    let (mut scene, bodies) = mixed();
    let mut fresh = detector(Method::Clusters, 1);
    let mut listing = listings(0.02);
    let mut query = Query::all();
    let mut ask = |what: &str, scene: &Scene, query: &Query, is_new: bool| {
        let listed = assert_same(what, scene, query, 0.05, (&mut fresh, &mut listing));
        assert_eq!(listed, [u64::from(is_new); 3], "{what}");
        // After a list that is used, the next one is made at once.
        assert_same(what, scene, query, 0.05, (&mut fresh, &mut listing));
    };
    ask("first", &scene, &query, true);
    ask("again", &scene, &query, false);
    let n = scene.body(bodies[0]).unwrap().faces().len();
    let each: Vec<f64> = (0..n).map(|ix| 0.001 * (ix % 20) as f64).collect();
    let thickness = Thickness::faces(each);
    scene.set_thickness(bodies[0], thickness).unwrap();
    ask("thickness", &scene, &query, true);
    scene.set_thickness(bodies[1], 0.01).unwrap();
    ask("thickness of all", &scene, &query, true);
    query = query.exclude(Exclusion::rings(1));
    ask("rings", &scene, &query, true);
    scene.remove(bodies[2]).unwrap();
    ask("removed", &scene, &query, true);
    let again = soup::lattice_web(30, 3, 4).scaled(0.3);
    again.add_to(&mut scene).unwrap();
    ask("added", &scene, &query, true);
    let ball = surfaces::ball(100).scaled(0.41).translated([0.6, 0.1, 0.5]);
    scene.set_positions(bodies[1], &ball.positions).unwrap();
    ask("in f32, and farther", &scene, &query, true);
    // The first questions are still known, but not their bodies.
    ask("without rings", &scene, &Query::all(), true);
    ask("two questions in turn", &scene, &query, false);
}

/// Bodies that have flowed far from their clusters get new ones, whatever the margin allows.
#[test]
fn new_clusters_are_listed_again() {
    let soup = soup::triangles(130, 0.1, 5);
    let mut scene = Scene::new();
    let body = soup.add_to(&mut scene).unwrap();
    let mut fresh = detector(Method::Clusters, 1);
    let mut detectors = [listing(4.0, 2, InstructionSet::Avx512)];
    let mut random = Random::new(6);
    let mut n_reclustered = 0;
    for frame in 0..4 {
        let what = format!("frame {frame}");
        assert_same(
            &what,
            &scene,
            &Query::all(),
            0.03,
            (&mut fresh, &mut detectors),
        );
        let near = detectors[0].near(&scene, 0.03, &Query::all()).unwrap();
        n_reclustered += near.stats().n_reclustered;
        // Each triangle goes somewhere.
        let moved = soup.positions.chunks(3).flat_map(|corners| {
            let way = random.point(-0.5, 0.5);
            let moved = |p: &[f32; 3]| std::array::from_fn(|axis| p[axis] + way[axis]);
            corners.iter().map(moved).collect::<Vec<[f32; 3]>>()
        });
        let moved: Vec<_> = moved.collect();
        scene.set_positions(body, moved).unwrap();
        let near = detectors[0].near(&scene, 0.03, &Query::all()).unwrap();
        n_reclustered += near.stats().n_reclustered;
    }
    assert!(n_reclustered > 0);
}

/// Their owner may write where they are.
#[test]
fn shared_positions_are_copied() {
    let ball = surfaces::ball(500);
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    ball.translated([2.1, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let rows = Arc::new(ball.positions.clone());
    scene.set_positions(a, rows).unwrap();
    let mut fresh = detector(Method::Clusters, 1);
    let mut listing = listings(0.05);
    for frame in 0..20 {
        let listed = assert_same(
            "shared",
            &scene,
            &Query::all(),
            0.1,
            (&mut fresh, &mut listing),
        );
        assert_eq!(listed, [u64::from(frame % 3 == 0); 3], "{frame}");
        // Half of the margin is 0.025.
        for p in scene.positions_mut::<f32>(a).unwrap() {
            p[0] += 0.01;
        }
    }
}

#[test]
fn odd_margins_give_the_same_answers() {
    let (mut scene, bodies) = mixed();
    let mut random = Random::new(8);
    let mut fresh = detector(Method::Clusters, 1);
    for margin in [f64::MIN_POSITIVE, 1e-12, 3.0, f64::MAX] {
        let mut listing = [listing(margin, 2, InstructionSet::Avx512)];
        for _ in 0..2 {
            tremble(&mut scene, bodies[3], 0.01, &mut random);
            let what = format!("{margin:e}");
            assert_same(
                &what,
                &scene,
                &Query::all(),
                0.05,
                (&mut fresh, &mut listing),
            );
        }
    }
    for margin in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = Detector::new(Settings::new().backend(Backend::Cpu).reuse_margin(margin));
        let is_named = |error: &Error| error.to_string().contains("reuse_margin");
        assert!(refused.err().as_ref().is_some_and(is_named));
    }
}
