use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Weak};

use super::{BodyPart, Clusterings, PARTS};
use crate::boxes;
use crate::bvh::clusters::Clustering;
use crate::detector::Detector;
use crate::query::Query;
use crate::query::progress::Control;
use crate::query::settings::{Backend, InstructionSet, Method, Settings};
use crate::scene::Scene;
use crate::scene::elements::{Elements, Part};
use crate::scene::ids::BodyId;

/// A sheet of `2 n n` triangles with waves.
fn sheet(n: u32, height: f32) -> (Elements, Vec<[f32; 3]>) {
    let at = |x: u32, y: u32| y * (n + 1) + x;
    let squares = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
    let faces = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        [[a, b, c], [a, c, d]]
    });
    let points = (0..=n).flat_map(|y| (0..=n).map(move |x| (x as f32, y as f32)));
    let wave = |x: f32, y: f32| (0.7 * x).sin() + (0.9 * y).cos();
    let positions = points.map(|(x, y)| [x, y, height + wave(x, y)]);
    (Elements::Triangles(faces.collect()), positions.collect())
}

fn two_sheets() -> (Scene, [BodyId; 2]) {
    let mut scene = Scene::new();
    let ids = [0.0, 0.3].map(|height| {
        let (elements, positions) = sheet(40, height);
        scene.add((elements, positions)).unwrap()
    });
    (scene, ids)
}

fn settings() -> Settings {
    Settings {
        backend: Backend::Cpu,
        method: Method::Clusters,
        threads: 2,
        ..Settings::default()
    }
}

/// The clusterings of a body, by part: as given, vertices, edges, faces.
fn of(clusterings: &Clusterings, id: BodyId) -> [Option<Arc<Clustering>>; PARTS] {
    let known = clusterings.lock();
    let of_body = known.slots.get(id.index());
    of_body.map_or([const { None }; PARTS], |of_body| of_body.parts.clone())
}

fn n_known(clusterings: &Clusterings) -> usize {
    let known = clusterings.lock();
    known
        .slots
        .iter()
        .flat_map(|of_body| &of_body.parts)
        .flatten()
        .count()
}

fn given(clusterings: &Clusterings, id: BodyId) -> Arc<Clustering> {
    let [given, ..] = of(clusterings, id);
    given.expect("it was body_part for")
}

/// All questions that need clusters, of two bodies; which of these each of them made.
fn ask(detector: &mut Detector, scene: &Scene, [a, b]: [BodyId; 2]) -> [u64; 3] {
    let query = Query::between(a, b);
    let n_detect = detector.detect(scene, &query).unwrap().stats().n_clustered;
    let n_impacts = detector.impacts(scene, &query).unwrap().stats().n_clustered;
    detector.distance(scene, a, b).unwrap();
    detector.nearest(scene, &query).unwrap();
    let n_near = detector
        .near(scene, 0.01, &query)
        .unwrap()
        .stats()
        .n_clustered;
    [n_detect, n_impacts, n_near]
}

#[test]
fn all_questions_share_one_clustering_of_the_faces() {
    let (mut scene, ids) = two_sheets();
    let (_, ends) = sheet(40, -1.0);
    scene.set_end_positions(ids[1], &ends).unwrap();
    let mut detector = Detector::new(settings()).unwrap();
    // The faces of both; then their vertices and edges; then nothing.
    assert_eq!(ask(&mut detector, &scene, ids), [2, 4, 0]);
    let clusterings = detector.clusterings.clone();
    assert_eq!(n_known(&clusterings), 6);
    let mut once = 0;
    for id in ids {
        let [given, vertices, edges, faces] = of(&clusterings, id);
        let (given, vertices, edges) = (given.unwrap(), vertices.unwrap(), edges.unwrap());
        assert!(faces.is_none(), "the faces of triangles are what was given");
        // This test, the store, intersections, steps, distances.
        assert_eq!(Arc::strong_count(&given), 5);
        assert_eq!(Arc::strong_count(&vertices), 3);
        assert_eq!(Arc::strong_count(&edges), 3);
        once += given.bytes() + vertices.bytes() + edges.bytes();
    }
    let held = clusterings.bytes();
    assert!(once < held && held < once + 1024, "{held} of {once}");
    assert_eq!(ask(&mut detector, &scene, ids), [0, 0, 0]);
}

#[test]
fn bytes_held_count_a_shared_clustering_once() {
    let (scene, ids) = two_sheets();
    // Which lists of several workers grow is left to chance.
    let mut detector = Detector::new(Settings {
        threads: 1,
        ..settings()
    })
    .unwrap();
    let query = Query::between(ids[0], ids[1]);
    let held = |detector: &mut Detector| {
        // Lists have grown to their size after some times.
        for _ in 0..4 {
            detector.detect(&scene, &query).unwrap();
        }
        let pairs = detector.detect(&scene, &query).unwrap();
        pairs.stats().bytes_held as usize
    };
    let alone = held(&mut detector);
    let faces = detector.clusterings.bytes();
    detector.impacts(&scene, &Query::all()).unwrap();
    let more = detector.clusterings.bytes() - faces;
    let [_, vertices, edges, _] = of(&detector.clusterings, ids[0]);
    assert_eq!(
        more,
        2 * (vertices.unwrap().bytes() + edges.unwrap().bytes())
    );
    let both = held(&mut detector);
    assert!(
        both.abs_diff(alone + more) < more / 4,
        "{both}, {alone} + {more}"
    );
}

#[test]
fn clusterings_go_with_their_topology() {
    let (mut scene, [a, b]) = two_sheets();
    let mut detector = Detector::new(settings()).unwrap();
    ask(&mut detector, &scene, [a, b]);
    let weak = |detector: &Detector, id: BodyId| -> Vec<Weak<Clustering>> {
        let parts = of(&detector.clusterings, id);
        parts.iter().flatten().map(Arc::downgrade).collect()
    };
    let old = weak(&detector, a);
    let (elements, positions) = sheet(30, 0.1);
    scene.remesh(a, (elements, positions)).unwrap();
    // One question is enough for the store, and another one for what each of them keeps.
    detector.distance(&scene, a, b).unwrap();
    assert_eq!(n_known(&detector.clusterings), 4);
    assert_eq!(ask(&mut detector, &scene, [a, b]), [0, 2, 0]);
    assert!(old.iter().all(|old| old.upgrade().is_none()));
    let old = weak(&detector, b);
    scene.remove(b).unwrap();
    let (elements, positions) = sheet(30, 0.2);
    let c = scene.add((elements, positions)).unwrap();
    detector.distance(&scene, a, c).unwrap();
    assert_eq!(n_known(&detector.clusterings), 4);
    ask(&mut detector, &scene, [a, c]);
    assert!(old.iter().all(|old| old.upgrade().is_none()));
    scene.remove(c).unwrap();
    detector.detect(&scene, &Query::self_of(a)).unwrap();
    assert_eq!(n_known(&detector.clusterings), 3);
}

#[test]
fn a_body_that_flowed_away_is_clustered_again_once_for_all() {
    let (mut scene, [a, b]) = two_sheets();
    let query = Query::between(a, b);
    let turned = |positions: &[[f32; 3]]| -> Vec<[f32; 3]> {
        let n = positions.len();
        // Another slot for each vertex: neighbours lie far apart.
        (0..n).map(|ix| positions[ix * 97 % n]).collect()
    };
    let (_, positions) = sheet(40, 0.3);
    for first_is_distance in [false, true] {
        scene.set_positions(b, &positions).unwrap();
        let mut detector = Detector::new(settings()).unwrap();
        ask(&mut detector, &scene, [a, b]);
        let before = given(&detector.clusterings, b);
        scene.set_positions(b, turned(&positions)).unwrap();
        if first_is_distance {
            detector.distance(&scene, a, b).unwrap();
        } else {
            let pairs = detector.detect(&scene, &query).unwrap();
            assert_eq!(pairs.stats().n_reclustered, 1);
        }
        let after = given(&detector.clusterings, b);
        assert!(!Arc::ptr_eq(&before, &after));
        detector.detect(&scene, &query).unwrap();
        let stats = detector.stats();
        assert_eq!((stats.n_clustered, stats.n_reclustered), (0, 0));
        detector.distance(&scene, a, b).unwrap();
        assert!(Arc::ptr_eq(&after, &given(&detector.clusterings, b)));
        // This test, the store, intersections, distances; steps have not been asked since.
        assert_eq!(Arc::strong_count(&after), 4);
        assert_eq!(Arc::strong_count(&before), 2);
    }
}

#[test]
fn questions_of_two_scenes_take_turns() {
    let (scene, ids) = two_sheets();
    let mut other = Scene::new();
    // Far apart, so that no intersections are sought.
    let others = [0.0, 50.0].map(|height| {
        let (elements, positions) = sheet(20, height);
        other.add((elements, positions)).unwrap()
    });
    let mut detector = Detector::new(settings()).unwrap();
    let query = Query::between(ids[0], ids[1]);
    for turn in 0..3 {
        let pairs = detector.detect(&scene, &query).unwrap();
        assert_eq!(pairs.stats().n_clustered, if turn == 0 { 2 } else { 0 });
        let [a, b] = others;
        detector.distance(&other, a, b).unwrap();
        let is_known = others.map(|id| detector.clusterings.has(id, other.body(id).unwrap()));
        assert_eq!(is_known, [true; 2]);
    }
}

#[test]
fn local_faces_are_the_same_whether_found_at_once_or_later() {
    let (scene, [a, _]) = two_sheets();
    let body_part = BodyPart::new(a, scene.body(a).unwrap(), Part::Faces);
    let at_once = body_part
        .with_local_faces(true)
        .cluster(&Control::new())
        .unwrap();
    let later = body_part.cluster(&Control::new()).unwrap();
    assert!(at_once.knows_local_faces() && !later.knows_local_faces());
    later.find_local_faces();
    assert_eq!(at_once.bytes(), later.bytes());
    for cluster in at_once.clusters() {
        assert!(at_once.local_faces(cluster).is_some());
        assert_eq!(at_once.local_faces(cluster), later.local_faces(cluster));
        assert_eq!(at_once.vertices(cluster), later.vertices(cluster));
    }
}

#[test]
fn clusters_that_distance_made_serve_intersections() {
    let (scene, [a, b]) = two_sheets();
    let query = Query::between(a, b);
    for instruction_set in [InstructionSet::Portable, InstructionSet::Avx512] {
        for method in [Method::Clusters, Method::Auto] {
            let new = || {
                Detector::new(Settings {
                    instruction_set,
                    method,
                    tuning: crate::workers::tuning::Tuning {
                        auto_from: 0,
                        ..Default::default()
                    },
                    ..settings()
                })
                .unwrap()
            };
            let (mut alone, mut both) = (new(), new());
            both.distance(&scene, a, b).unwrap();
            let pairs = both.detect(&scene, &query).unwrap();
            assert_eq!(
                (pairs.stats().method, pairs.stats().n_clustered),
                ("clusters", 0)
            );
            assert!(
                pairs
                    .rows()
                    .eq(alone.detect(&scene, &query).unwrap().rows())
            );
        }
    }
}

/// A question that is cancelled while a large body is clustered does not wait for the rest.
#[test]
fn clustering_stops_wherever_it_is_told_to() {
    let (elements, positions) = sheet(200, 0.0);
    let positions = positions.into();
    // What is made after `n` questions whether to go on, and how often it was asked.
    let cluster = |n: usize| {
        let n_asked = AtomicUsize::new(0);
        let go_on = || n_asked.fetch_add(1, Ordering::Relaxed) < n;
        let centers = boxes::centers(&elements, &positions);
        let made = Clustering::new(&elements, centers, true, &go_on);
        (made.is_some(), n_asked.into_inner())
    };
    let (is_made, n_asked) = cluster(usize::MAX);
    assert!(is_made);
    // 80,000 triangles: at least one question for every 8,000.
    assert!(n_asked >= 10, "{n_asked}");
    for n in 0..n_asked {
        assert!(!cluster(n).0, "after {n} questions");
    }
}
