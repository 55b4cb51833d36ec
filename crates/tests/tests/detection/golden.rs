//! Pinned answers: the same hash for every method and for 1 to 16 threads, on every machine. The
//! scene's coordinates come from integers and sums alone, so they have the same bits everywhere.

use impinge_core::{Backend, Detector, Method, Query, Scene, Settings, SharedVertex};
use impinge_scenes::soup;

/// The number of pairs, and their hash. If these numbers change, the answer has changed.
const GOLDEN: [(&str, usize, u64); 5] = [
    ("triangles", 67_174, 0xbfa1_3f0d_7168_8c03),
    ("lattice", 51_993, 0x088f_ae75_8617_32b1),
    ("tetrahedra", 6_893, 0x3233_729b_12be_a55a),
    ("web", 135_895, 0x021a_11b4_ba4f_ac47),
    ("web, neighbours skipped", 135_804, 0xe44d_a430_ae2e_a55c),
];

fn scene(name: &str) -> Scene {
    let (a, b) = match name {
        "triangles" => (
            soup::triangles(60_000, 0.04, 1),
            soup::triangles(60_000, 0.04, 2),
        ),
        "lattice" => (
            soup::lattice_triangles(300, 40, 3),
            soup::lattice_triangles(300, 40, 4),
        ),
        "web" | "web, neighbours skipped" => (
            soup::lattice_web(400, 20, 7),
            soup::lattice_web_tetrahedra(400, 20, 8),
        ),
        _ => (
            soup::tetrahedra(8_000, 0.06, 5),
            soup::triangles(8_000, 0.06, 6),
        ),
    };
    let mut scene = Scene::new();
    a.add_to(&mut scene).unwrap();
    b.add_to(&mut scene).unwrap();
    scene
}

/// Compares the answers of all methods and numbers of threads with the pinned one.
fn is_the_same_for_1_to_16_threads(name: &str) {
    let golden = GOLDEN.iter().find(|golden| golden.0 == name);
    let &(_, n_pairs, hash) = golden.expect("a pinned scene");
    let mut scene = scene(name);
    let query = match name {
        "web, neighbours skipped" => Query::all().shared_vertex(SharedVertex::Skip),
        _ => Query::all(),
    };
    for method in [Method::Clusters, Method::Cells] {
        for threads in 1..=16 {
            let mut detector = Detector::new(
                Settings::new()
                    .backend(Backend::Cpu)
                    .method(method)
                    .threads(threads),
            )
            .unwrap();
            // The second frame finds caches filled and helpers awake; positions are written again
            // before it.
            for frame in 0..2 {
                let pairs = detector.detect(&scene, &query).unwrap();
                assert_eq!(
                    (pairs.len(), format!("{:016x}", pairs.hash())),
                    (n_pairs, format!("{hash:016x}")),
                    "{name}, {method:?}, {threads} threads, frame {frame}"
                );
                let bodies: Vec<_> = scene
                    .bodies()
                    .map(|(id, body)| (id, body.positions().clone()))
                    .collect();
                for (id, positions) in bodies {
                    let impinge_core::Positions::F32(positions) = positions else {
                        panic!("single precision");
                    };
                    scene.set_positions(id, &positions).unwrap();
                }
            }
        }
    }
}

#[test]
fn triangles() {
    is_the_same_for_1_to_16_threads("triangles");
}

#[test]
fn lattice() {
    is_the_same_for_1_to_16_threads("lattice");
}

#[test]
fn tetrahedra() {
    is_the_same_for_1_to_16_threads("tetrahedra");
}

#[test]
fn neighbours() {
    is_the_same_for_1_to_16_threads("web");
    is_the_same_for_1_to_16_threads("web, neighbours skipped");
}
