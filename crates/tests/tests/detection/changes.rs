//! What has changed from one answer to the next, held against differences of sets.

use std::collections::HashSet;
use std::fmt::Debug;
use std::hash::Hash;

use impinge_core::{
    Backend, BodyId, Changes, Detector, Error, Method, PairKind, Query, Scene, Settings,
};
use impinge_scenes::Random;

/// `n` triangles here and there in a cube, each with vertices of its own.
fn soup(n: usize, random: &mut Random) -> (Vec<[u32; 3]>, Vec<[f32; 3]>) {
    let mut positions = Vec::new();
    for _ in 0..n {
        let center: [f32; 3] = std::array::from_fn(|_| random.range(-1.0, 1.0));
        for _ in 0..3 {
            positions.push(center.map(|x| x + random.range(-0.2, 0.2)));
        }
    }
    let faces = (0..n as u32).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]);
    (faces.collect(), positions)
}

fn shaken(positions: &mut [[f32; 3]], random: &mut Random) {
    for x in positions.iter_mut().flatten() {
        *x += random.range(-0.04, 0.04);
    }
}

/// Every index is where a set says that it belongs, in order, and none is missing.
fn check<K: Eq + Hash + Copy + Debug>(old: &[K], new: &[K], changes: &Changes) {
    let [before, after] = [old, new].map(|all| all.iter().copied().collect::<HashSet<K>>());
    let kept: Vec<[usize; 2]> = (new.iter().enumerate())
        .filter_map(|(ix, key)| Some([old.iter().position(|other| other == key)?, ix]))
        .collect();
    assert_eq!(changes.kept, kept);
    assert!(kept.is_sorted_by_key(|pair| pair[0]));
    let but = |all: &[K], others: &HashSet<K>| -> Vec<usize> {
        let numbered = all.iter().enumerate();
        let missing = numbered.filter(|(_, key)| !others.contains(key));
        missing.map(|(ix, _)| ix).collect()
    };
    assert_eq!(changes.new, but(new, &before));
    assert_eq!(changes.gone, but(old, &after));
    assert_eq!(changes.kept.len() + changes.new.len(), new.len());
    assert_eq!(changes.kept.len() + changes.gone.len(), old.len());
    assert_eq!(changes.is_empty(), before == after);
}

/// Two bodies that are shaken: pairs, impacts and near pairs of each frame beside the last one.
#[test]
fn changes_are_differences_of_sets() {
    for method in [Method::Clusters, Method::Naive] {
        let settings = Settings::new().method(method).backend(Backend::Cpu);
        let mut detector = Detector::new(settings).expect("good");
        let mut random = Random::new(7);
        let mut scene = Scene::new();
        let mut soups = [240, 160].map(|n| soup(n, &mut random));
        let ids: Vec<BodyId> = soups
            .iter()
            .map(|(faces, positions)| scene.add_triangles(faces, positions).expect("good"))
            .collect();
        let query = Query::all();
        let mut ask = |scene: &Scene| {
            let pairs = detector.detect(scene, &query).expect("good");
            let impacts = detector.impacts(scene, &query).expect("good");
            let near = detector.near(scene, 0.1, &query).expect("good");
            (pairs, impacts, near)
        };
        let mut last = None;
        let mut n = [0; 3];
        for _ in 0..6 {
            for ((_, positions), &id) in soups.iter_mut().zip(&ids) {
                shaken(positions, &mut random);
                scene.set_positions(id, &*positions).expect("finite");
                let mut end = positions.clone();
                shaken(&mut end, &mut random);
                scene.set_end_positions(id, end).expect("finite");
            }
            let now = ask(&scene);
            if let Some((pairs, impacts, near)) = &last {
                let changes = now.0.changes(pairs).expect("one scene");
                let keys = [pairs, &now.0].map(|pairs| pairs.iter().collect::<Vec<_>>());
                check(&keys[0], &keys[1], &changes);
                n[0] += changes.kept.len();
                n[1] += changes.new.len();
                n[2] += changes.gone.len();
                let changes = now.1.changes(impacts).expect("one scene");
                let keys = [impacts, &now.1].map(|impacts| {
                    let all = impacts.iter();
                    all.map(|of| (of.kind, of.a, of.b)).collect::<Vec<_>>()
                });
                check(&keys[0], &keys[1], &changes);
                let changes = now.2.changes(near).expect("one scene");
                let keys = [near, &now.2].map(|near| {
                    let all = near.iter();
                    all.map(|of| (of.kind, of.a, of.b)).collect::<Vec<_>>()
                });
                check(&keys[0], &keys[1], &changes);
            }
            assert!(now.0.changes(&now.0).expect("one scene").is_empty());
            assert!(now.1.changes(&now.1).expect("one scene").is_empty());
            assert!(now.2.changes(&now.2).expect("one scene").is_empty());
            last = Some(now);
        }
        assert!(n.iter().all(|&n| n > 50), "{n:?}");
    }
}

/// A slot that is used again names another body; a clone of the scene names the same ones.
#[test]
fn bodies_are_told_apart() {
    let mut random = Random::new(9);
    let mut scene = Scene::new();
    let (faces, positions) = soup(60, &mut random);
    let bodies = [0, 1, 2].map(|_| scene.add_triangles(&faces, &positions).expect("good"));
    let mut detector = Detector::new(Backend::Cpu).expect("good");
    let query = Query::between_all();
    let old = detector.detect(&scene, &query).expect("good");
    let of_clone = detector.detect(&scene.clone(), &query).expect("good");
    let changes = of_clone.changes(&old).expect("a clone");
    assert!(changes.is_empty());
    scene.remove(bodies[1]).expect("known");
    let without = detector.detect(&scene, &query).expect("good");
    let keys = [&old, &without].map(|pairs| pairs.iter().collect::<Vec<_>>());
    let changes = without.changes(&old).expect("one scene");
    check(&keys[0], &keys[1], &changes);
    assert!(changes.new.is_empty() && !changes.kept.is_empty() && !changes.gone.is_empty());
    // The same rows, of another body.
    scene.add_triangles(&faces, &positions).expect("good");
    let again = detector.detect(&scene, &query).expect("good");
    assert!(again.rows().eq(old.rows()));
    let keys = [&old, &again].map(|pairs| pairs.iter().collect::<Vec<_>>());
    let changes = again.changes(&old).expect("one scene");
    check(&keys[0], &keys[1], &changes);
    assert_eq!(changes.kept.len(), without.len());
    assert!(!changes.new.is_empty());
    // Answers about two scenes are not compared, but for one without bodies.
    let mut other = Scene::new();
    let nothing = detector.detect(&other, &query).expect("good");
    for _ in 0..3 {
        other.add_triangles(&faces, &positions).expect("good");
    }
    let others = detector.detect(&other, &query).expect("good");
    let refused = others.changes(&old).expect_err("another scene");
    assert!(refused.to_string().contains("another scene"), "{refused}");
    let changes = others.changes(&nothing).expect("of no scene");
    assert_eq!(changes.new.len(), others.len());
}

/// Pairs with elements that have other numbers now are refused; all others are compared.
#[test]
fn elements_with_other_numbers_are_refused() {
    let mut detector = Detector::new(Backend::Cpu).expect("good");
    let mut scene = Scene::new();
    let triangle = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let a = scene.add_triangles(&[[0, 1, 2]], &triangle).expect("good");
    let rod = [[1.0f32, -0.1, -1.0], [1.0, -0.1, 1.0]];
    let rods = scene.add_edges(&[[0, 1]], &rod).expect("good");
    let point = scene.add_points(&[[1.0f32, 1.0, 0.1]]).expect("good");
    let of = |kinds: &[PairKind]| Query::all().kinds(kinds.iter().copied());
    let [edges, points] = [of(&[PairKind::EdgeEdge]), of(&[PairKind::VertexFace])];
    let old = detector.near(&scene, 0.2, &edges).expect("good");
    let old_points = detector.near(&scene, 0.2, &points).expect("good");
    assert!(!old.is_empty() && !old_points.is_empty());

    // The same edges again have the same numbers.
    scene
        .set_edges(a, &[[0, 1], [0, 2], [1, 2]])
        .expect("its edges");
    let same = detector.near(&scene, 0.2, &edges).expect("good");
    assert_eq!(same.changes(&old).expect("the same").kept, [[0, 0]]);
    scene
        .set_edges(a, &[[0, 2], [0, 1], [1, 2]])
        .expect("its edges");
    let new = detector.near(&scene, 0.2, &edges).expect("good");
    let remeshed = Err(Error::Remeshed { body: a });
    assert_eq!(new.changes(&old), remeshed);
    assert_eq!(old.changes(&new), remeshed);
    // Pairs that name no edge are the same, whatever is asked besides.
    let new_points = detector.near(&scene, 0.2, &points).expect("good");
    assert_eq!(
        new_points.changes(&old_points).expect("no edges").kept,
        [[0, 0]]
    );
    let all = detector
        .near(
            &scene,
            0.2,
            &of(&[PairKind::VertexFace, PairKind::EdgeEdge]),
        )
        .expect("good");
    assert_eq!(all.changes(&old_points).expect("no edges").kept.len(), 1);
    assert_eq!(all.check_comparable(&all, None), Ok(()));
    // Nothing of an answer about other bodies.
    let others = detector
        .near(&scene, 0.2, &Query::between(rods, point))
        .expect("good");
    let changes = others.changes(&old).expect("not of the body");
    assert_eq!((changes.kept.len(), changes.gone.len()), (0, old.len()));

    // Re-meshed, all elements are others.
    scene
        .remesh(a, ([[0, 1, 2]].to_vec(), triangle.to_vec()))
        .expect("good");
    let new = detector.near(&scene, 0.2, &points).expect("good");
    assert_eq!(new.changes(&new_points), remeshed);
    scene.remove(a).expect("known");
    let without = detector.near(&scene, 0.2, &points).expect("good");
    let changes = without.changes(&new_points).expect("it is gone");
    assert_eq!((changes.new.len(), changes.gone.len()), (without.len(), 1));
}

/// Of pairs that intersect, and of impacts.
#[test]
fn pairs_and_impacts_of_another_mesh_are_refused() {
    let mut random = Random::new(11);
    let mut scene = Scene::new();
    let (faces, positions) = soup(60, &mut random);
    let bodies = [0, 1, 2].map(|_| scene.add_triangles(&faces, &positions).expect("good"));
    let mut detector = Detector::new(Backend::Cpu).expect("good");
    let query = Query::between_all();
    let mut ask = |scene: &Scene| {
        let pairs = detector.detect(scene, &query).expect("good");
        (pairs, detector.impacts(scene, &query).expect("good"))
    };
    let old = ask(&scene);
    let end: Vec<[f32; 3]> = positions.iter().map(|at| at.map(|x| x + 0.01)).collect();
    scene.set_end_positions(bodies[0], end).expect("finite");
    let moving = ask(&scene);
    assert!(!moving.1.is_empty());
    scene
        .remesh(bodies[1], (faces.clone(), positions.clone()))
        .expect("good");
    let new = ask(&scene);
    let remeshed = Err(Error::Remeshed { body: bodies[1] });
    assert_eq!(new.0.changes(&old.0), remeshed);
    assert_eq!(new.1.changes(&moving.1), remeshed);
    // Without the pairs of that body, the others can be compared.
    let mut others = old.0.clone();
    others.retain(|a, b| a.body != bodies[1] && b.body != bodies[1]);
    let changes = new.0.changes(&others).expect("not of that body");
    assert_eq!(changes.kept.len(), others.len());
}
