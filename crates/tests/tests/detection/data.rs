//! Real meshes against answers from elsewhere: pair lists of CGAL's exact kernel and published
//! self-intersections; and against the oracle, on frames of a sequence. Without the data folder
//! (`../shared/data` or `$IMPINGE_DATA`) these tests fail, unless `IMPINGE_NO_DATA=1` is set.

use std::collections::HashSet;

use impinge_core::{
    Backend, BodyId, Detector, Filter, Method, Query, Scene, Settings, SharedVertex, hash_rows,
};
use impinge_io::{Mesh, ReadOptions, Sequence};
use impinge_testing::data::test_file;
use impinge_testing::published::{self, Published, rows_of_two_bodies};
use impinge_tests::{Case, agree, naive, rows};

/// One detector per method and backend. Without a GPU adapter this fails.
fn detectors() -> Vec<Detector> {
    let mut detectors = Vec::new();
    for backend in [Backend::Cpu, Backend::Gpu] {
        if backend == Backend::Gpu && !cfg!(feature = "gpu") {
            continue;
        }
        for method in [Method::Clusters, Method::Cells] {
            let settings = Settings::new().method(method).backend(backend).threads(2);
            detectors.push(Detector::new(settings).expect("these tests need an adapter"));
        }
    }
    detectors
}

fn read(path: &str, weld: bool) -> Option<Mesh> {
    let options = ReadOptions {
        weld,
        ..ReadOptions::default()
    };
    test_file(path).map(|path| impinge_io::read(&path, &options).unwrap())
}

fn positions_f32(positions: &impinge_io::Positions) -> Vec<[f32; 3]> {
    match positions {
        impinge_io::Positions::F32(positions) => positions.clone(),
        impinge_io::Positions::F64(_) => panic!("single precision expected"),
    }
}

fn add(scene: &mut Scene, mesh: &Mesh) -> BodyId {
    let elements: impinge_core::Elements = match &mesh.elements {
        impinge_io::Elements::Triangles(faces) => faces.clone().into(),
        impinge_io::Elements::Tetrahedra(tets) => tets.clone().into(),
    };
    match &mesh.positions {
        impinge_io::Positions::F32(positions) => scene.add((elements, positions.clone())),
        impinge_io::Positions::F64(positions) => scene.add((elements, positions.clone())),
    }
    .unwrap()
}

#[test]
fn two_bodies_meet_as_the_exact_kernel_says() {
    let Some(answers) = test_file("expected/two_body.json") else {
        return;
    };
    let answers: serde_json::Value =
        serde_json::from_reader(std::fs::File::open(answers).unwrap()).unwrap();
    for (name, answer) in answers.as_object().unwrap() {
        let offset: Vec<f32> = answer["offset_f32"]
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_f64().unwrap() as f32)
            .collect();
        let Some(mesh) = read(answer["mesh"].as_str().unwrap(), false) else {
            return;
        };
        let Some(list) = test_file(answer["file"].as_str().unwrap()) else {
            return;
        };
        let expected = rows_of_two_bodies(&list);
        assert_eq!(expected.len() as u64, answer["pairs"].as_u64().unwrap());
        let moved: Vec<[f32; 3]> = positions_f32(&mesh.positions)
            .iter()
            .map(|p| std::array::from_fn(|axis| p[axis] + offset[axis]))
            .collect();
        let mut scene = Scene::new();
        let a = add(&mut scene, &mesh);
        let elements = scene.body(a).unwrap().elements().clone();
        let b = scene.add((elements, moved)).unwrap();
        for mut detector in detectors() {
            let pairs = detector.detect(&scene, &Query::between(a, b)).unwrap();
            assert_eq!(pairs.hash(), hash_rows(expected.iter().copied()), "{name}");
            agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
            for (body, count) in [(a, "colliding_triangles_a"), (b, "colliding_triangles_b")] {
                assert_eq!(
                    pairs.colliding(body).len() as u64,
                    answer[count].as_u64().unwrap()
                );
            }
            let stats = pairs.stats();
            assert!(
                100 * stats.n_unsure < stats.n_candidates,
                "{name} {stats:?}"
            );
        }
    }
}

#[test]
fn welded_meshes_intersect_themselves_as_published() {
    for (path, skip, resolve) in [("meshes/cow.off", 73, 83), ("meshes/camelhead.off", 3, 5)] {
        let Some(mesh) = read(path, true) else { return };
        let mut scene = Scene::new();
        let body = add(&mut scene, &mesh);
        for (rule, expected) in [(SharedVertex::Skip, skip), (SharedVertex::Resolve, resolve)] {
            for mut detector in detectors() {
                let query = Query::self_of(body).shared_vertex(rule);
                let pairs = detector.detect(&scene, &query).unwrap();
                let stats = pairs.stats();
                assert_eq!(pairs.len(), expected, "{path} {rule:?} {stats:?}");
            }
        }
    }
}

#[test]
fn a_dancer_is_answered_as_the_oracle_says() {
    let (Some(mesh), Some(frames)) = (
        read("sequences/rumba.ply", false),
        test_file("sequences/rumba.pc2"),
    ) else {
        return;
    };
    let sequence = Sequence::open(&frames).unwrap();
    let mut scene = Scene::new();
    let body = add(&mut scene, &mesh);
    let mut detectors = detectors();
    for frame in [0, 60, 120] {
        let positions = positions_f32(&sequence.frame(frame).unwrap());
        scene.set_positions(body, &positions).unwrap();
        let case = Case {
            name: format!("rumba {frame}"),
            scene: scene.clone(),
            query: Query::self_of(body),
        };
        let expected = naive(&case);
        for detector in &mut detectors {
            let pairs = detector.detect(&scene, &case.query).unwrap();
            agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
        }
    }
}

#[test]
fn tetrahedra_of_real_solids_are_answered_as_the_oracle_says() {
    let Some(mesh) = read("tets/bunny_7k.msh", false) else {
        return;
    };
    let mut scene = Scene::new();
    let a = add(&mut scene, &mesh);
    let b = add(&mut scene, &mesh);
    let shift = |x: f64| x + 0.0625;
    match scene.body(b).unwrap().positions().clone() {
        impinge_core::Positions::F64(positions) => {
            let moved: Vec<_> = positions.iter().map(|p| p.map(shift)).collect();
            scene.set_positions(b, &moved).unwrap();
        }
        impinge_core::Positions::F32(_) => panic!("text is read in double precision"),
    }
    let case = Case {
        name: "bunny 7k".into(),
        scene,
        query: Query::between(a, b),
    };
    let expected = naive(&case);
    assert!(expected.len() > 1000);
    for mut detector in detectors() {
        let pairs = detector.detect(&case.scene, &case.query).unwrap();
        agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
    }
}

#[test]
fn published_triangle_pairs_are_answered_as_bodies() {
    let (Some(mut cases), Some(special)) = (published::random_pairs(), published::special_pairs())
    else {
        return;
    };
    cases.extend(special);
    let mut detectors = detectors();
    for cases in cases.chunks(100) {
        let case = side_by_side(cases);
        let expected = naive(&case);
        let found: HashSet<[u32; 2]> = expected.iter().map(|row| [row[0], row[2]]).collect();
        for (ix, published) in (0..).zip(cases) {
            let is_found = found.contains(&[2 * ix, 2 * ix + 1]);
            assert_eq!(is_found, published.intersect, "{}", published.name);
        }
        for detector in &mut detectors {
            let pairs = detector.detect(&case.scene, &case.query).unwrap();
            agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
        }
    }
}

/// One body per triangle. By the filters, each meets its partner and one in 64 of the other bodies.
fn side_by_side(cases: &[Published]) -> Case {
    let mut scene = Scene::new();
    for (ix, case) in cases.iter().enumerate() {
        for triangle in case.triangles {
            let body = scene.add((vec![[0, 1, 2]], triangle.to_vec())).unwrap();
            let class = 1 << (ix % 64);
            let filter = Filter {
                category: class,
                mask: class,
            };
            scene.set_filter(body, filter).unwrap();
        }
    }
    Case {
        name: "published".into(),
        scene,
        query: Query::between_all(),
    }
}
