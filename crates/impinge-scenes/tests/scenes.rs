//! Scenes have the structure that they promise, checked with the oracle.

use impinge::{Detector, Method, Settings};
use impinge_scenes::{BuiltScene, adversarial, solids, surfaces};

fn n_pairs(built: &BuiltScene) -> usize {
    let mut detector =
        Detector::new(Settings::new().method(Method::Naive)).expect("the oracle needs nothing");
    detector
        .detect(&built.scene, &built.query)
        .expect("scenes are valid")
        .len()
}

#[test]
fn every_adversarial_scene_has_about_its_size() {
    for entry in adversarial::SCENES {
        for n in [600, 6_000] {
            let built = (entry.build)(n).expect(entry.name);
            let n_built = built.n_elements();
            assert_eq!(built.name, entry.name);
            assert!(
                (n / 2..=n + n / 4).contains(&n_built),
                "{}: {n_built} for {n}",
                entry.name
            );
            assert_eq!(built.bodies.len(), built.scene.n_bodies());
        }
    }
}

#[test]
fn adversarial_scenes_of_no_size_are_built_too() {
    for entry in adversarial::SCENES {
        for n in [0, 1, 13] {
            let built = (entry.build)(n).expect(entry.name);
            n_pairs(&built);
        }
    }
}

#[test]
fn known_pair_counts_hold() {
    let count = |build: fn(usize) -> Result<BuiltScene, impinge::Error>, n| {
        n_pairs(&build(n).expect("valid"))
    };
    assert_eq!(count(adversarial::one_cell, 1_000), 0);
    assert_eq!(count(adversarial::one_point, 200), 100 * 100);
    assert_eq!(count(adversarial::needle_row, 1_000), 500);
    assert!(count(adversarial::slivers, 400) >= 200);
}

#[test]
fn scenes_that_should_meet_do() {
    for (build, least) in [
        (adversarial::plain as fn(usize) -> _, 20),
        (adversarial::huge_over_small, 20),
        (adversarial::stadium, 60),
        (adversarial::flat_cloth, 4_000),
        (adversarial::coincident, 10_000),
        (adversarial::outliers, 20),
        (adversarial::mixed_sizes, 50),
        (adversarial::stacked_cubes, 2_000),
        (adversarial::chessboard, 2_000),
    ] {
        let built = build(2_000).expect("valid");
        let n = n_pairs(&built);
        assert!(n >= least, "{}: {n}", built.name);
        // The answer is proportional to the input: none of these grows quadratically.
        assert!(n <= 40 * built.n_elements(), "{}: {n}", built.name);
    }
}

#[test]
fn boxes_meet_about_one_other_each() {
    let built = adversarial::boxes(300, 1).expect("valid");
    assert_eq!(built.n_elements(), 3_600);
    assert_eq!(built.bodies.len(), 300);
    let n = n_pairs(&built);
    assert!((300..6_000).contains(&n), "{n}");
}

#[test]
fn a_stand_in_does_not_meet_itself() {
    let built = BuiltScene::within("knot", surfaces::stand_in(4_000)).expect("valid");
    assert_eq!(n_pairs(&built), 0);
    let built = BuiltScene::within("bumpy", surfaces::bumpy_ball(3_000, 0.3)).expect("valid");
    assert_eq!(n_pairs(&built), 0);
}

#[test]
fn tetrahedra_of_two_overlapping_balls_meet() {
    let ball = solids::solid_ball(750);
    let built = BuiltScene::two_body("solid balls", &ball, [0.5, 0.01, 0.02]).expect("valid");
    assert!(n_pairs(&built) > 500);
    let built = BuiltScene::two_body("apart", &ball, [1.1, 0.0, 0.0]).expect("valid");
    assert_eq!(n_pairs(&built), 0);
}
