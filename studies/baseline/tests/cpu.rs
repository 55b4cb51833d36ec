//! The CPU baselines compared with the oracle and with impinge's own methods.

mod common;

use common::{Case, cases, oracle};
use impinge_baseline::duplicates::{self, Missing, Possible, TwoLevels};
use impinge_baseline::{Error, Settings, UniformGrid};
use impinge_core::{Backend, Detector, InstructionSet, Method};
use impinge_scenes::{BuiltScene, surfaces};

#[test]
fn uniform_grid_finds_what_the_oracle_finds() {
    let sets = [InstructionSet::Portable, InstructionSet::Avx512];
    for (case_ix, case) in cases().iter().enumerate() {
        let expected = oracle(case);
        for (ix, lambda) in [5.0, 1.0, 0.01, 400.0].into_iter().enumerate() {
            for owner_rule in [false, true] {
                let settings = Settings {
                    lambda,
                    owner_rule,
                    coarse_map: (ix + usize::from(owner_rule)) % 2 == 1,
                    threads: 1 + (case_ix + ix) % 2,
                    instruction_set: sets[(case_ix + ix / 2) % 2],
                };
                let mut grid = UniformGrid::new(settings).unwrap();
                // Run twice: the second frame reuses the memory of the first.
                for _ in 0..2 {
                    let outcome = grid.detect(&case.scene, case.a, case.b).unwrap();
                    let found: Vec<_> = outcome.pairs.rows().collect();
                    assert_eq!(found, expected, "{} with {settings:?}", case.name);
                }
            }
        }
    }
}

#[test]
fn uniform_grid_finds_what_impinge_finds() {
    let knot = surfaces::stand_in(6_000);
    let case = Case::new("knots", &knot, &knot.translated([0.1, 0.05, 0.07]), false);
    let mut grid = UniformGrid::new(Settings::default()).unwrap();
    let outcome = grid.detect(&case.scene, case.a, case.b).unwrap();
    assert!(outcome.pairs.len() > 100);
    for method in [Method::Clusters, Method::Cells] {
        let mut detector = Detector::new(
            impinge_core::Settings::new()
                .method(method)
                .backend(Backend::Cpu),
        )
        .unwrap();
        let pairs = detector.detect(&case.scene, &case.query()).unwrap();
        assert!(pairs.rows().eq(outcome.pairs.rows()), "{method:?}");
        assert_eq!(pairs.hash(), outcome.pairs.hash());
    }
}

#[test]
fn owner_rule_tests_each_pair_once() {
    let ball = surfaces::ball(4_000);
    let balls = BuiltScene::two_body("balls", &ball, [0.5, 0.2, 0.1]).unwrap();
    let (a, b) = (balls.bodies[0], balls.bodies[1]);
    let run = |owner_rule| {
        let settings = Settings {
            owner_rule,
            ..Settings::default()
        };
        let mut grid = UniformGrid::new(settings).unwrap();
        let outcome = grid.detect(&balls.scene, a, b).unwrap();
        (outcome.counts, outcome.pairs.hash())
    };
    let ((repeated, with), (once, without)) = (run(false), run(true));
    assert_eq!(with, without);
    assert_eq!(repeated.n_box_tests, once.n_box_tests);
    assert!(once.n_tests < repeated.n_tests);
    // Candidates are pairs of boxes that overlap, for every method.
    let mut cells = Detector::new(
        impinge_core::Settings::new()
            .method(Method::Cells)
            .backend(Backend::Cpu),
    )
    .unwrap();
    let pairs = cells.detect(&balls.scene, &balls.query).unwrap();
    assert_eq!(pairs.stats().n_candidates, once.n_tests);
}

#[test]
fn counts_are_those_of_the_grid() {
    // The boxes of two unit cubes in a grid that can be counted by hand: everything is in one cell.
    let cube = surfaces::cube([0.0; 3], 1.0);
    let case = Case::new("cubes", &cube, &cube, false);
    let settings = Settings {
        lambda: 1e-6,
        ..Settings::default()
    };
    let mut grid = UniformGrid::new(settings).unwrap();
    let counts = grid.detect(&case.scene, case.a, case.b).unwrap().counts;
    assert_eq!(counts.resolution, [1; 3]);
    assert_eq!((counts.n_reaching, counts.n_entries), (24, 24));
    assert_eq!((counts.n_mixed_cells, counts.n_box_tests), (1, 144));
}

#[test]
fn repeated_tests_find_what_the_oracle_finds() {
    for case in cases() {
        let expected = oracle(&case);
        for possible in [Possible::Masks, Possible::Boxes] {
            let settings = duplicates::Settings {
                possible,
                threads: 2,
                ..duplicates::Settings::default()
            };
            let mut two_levels = TwoLevels::new(settings).unwrap();
            let pairs = two_levels.detect(&case.scene, case.a, case.b).unwrap();
            let found: Vec<_> = pairs.rows().collect();
            assert_eq!(found, expected, "{} with {settings:?}", case.name);
        }
    }
}

#[test]
fn checks_are_what_brute_force_counts() {
    let ball = surfaces::bumpy_ball(700, 0.3);
    for (name, offset) in [("near", [0.3, 0.2, 0.1]), ("same", [0.0; 3])] {
        let case = Case::new(name, &ball, &ball.translated(offset), false);
        for (lambda, possible) in [
            (1.0, Possible::Masks),
            (1.0, Possible::Boxes),
            (2.0, Possible::Masks),
            (2.0, Possible::Boxes),
        ] {
            let settings = duplicates::Settings {
                lambda,
                possible,
                threads: 2,
                ..duplicates::Settings::default()
            };
            let mut two_levels = TwoLevels::new(settings).unwrap();
            let checks = two_levels.count(&case.scene, case.a, case.b).unwrap();
            let counted = common::brute_checks(&case, lambda, possible == Possible::Boxes);
            assert_eq!(checks, counted, "{name} with {settings:?}");
            let pairs = two_levels.detect(&case.scene, case.a, case.b).unwrap();
            assert_eq!(pairs.stats().n_candidates, checks.n_tests);
            assert!(checks.average() > 1.0 && checks.repeated_share() < 1.0);
        }
    }
}

#[test]
fn a_table_loses_pairs_and_invents_none() {
    let ball = surfaces::ball(6_000);
    let balls = BuiltScene::two_body("balls", &ball, [0.2, 0.1, 0.05]).unwrap();
    let (a, b) = (balls.bodies[0], balls.bodies[1]);
    let mut rates = Vec::new();
    for threads in [1, 2] {
        let settings = duplicates::Settings {
            threads,
            ..duplicates::Settings::default()
        };
        let mut two_levels = TwoLevels::new(settings).unwrap();
        let all = two_levels.detect(&balls.scene, a, b).unwrap().clone();
        let whole: std::collections::BTreeSet<_> = all.rows().collect();
        for table_size in [1, 64, 1_000, 12_000, 1 << 22] {
            let found = two_levels
                .detect_djb2(&balls.scene, a, b, table_size)
                .unwrap();
            assert!(found.rows().all(|row| whole.contains(&row)));
            assert!(found.stats().n_candidates <= table_size as u64);
            rates.push(Missing::of(&all, found, a, b).pair_rate());
        }
    }
    let (one, two) = rates.split_at(rates.len() / 2);
    assert_eq!(one, two);
    assert!(one.is_sorted_by(|more, less| more > less), "{one:?}");
}

#[test]
fn a_huge_table_loses_nothing() {
    // Numbers below 33, the base of the hash, so that bytes do not carry into each other.
    let a = impinge_scenes::soup::triangles(33, 1.5, 1);
    let b = impinge_scenes::soup::triangles(33, 1.5, 2);
    let case = Case::new("soup", &a, &b, false);
    let mut two_levels = TwoLevels::new(duplicates::Settings::default()).unwrap();
    let found = two_levels
        .detect_djb2(&case.scene, case.a, case.b, 1 << 24)
        .unwrap();
    let found: Vec<_> = found.rows().collect();
    assert!(found.len() > 20);
    assert_eq!(found, oracle(&case));
}

#[test]
fn missing_is_counted_in_elements_and_in_pairs() {
    let ball = surfaces::ball(500);
    let balls = BuiltScene::two_body("balls", &ball, [0.5, 0.0, 0.0]).unwrap();
    let (a, b) = (balls.bodies[0], balls.bodies[1]);
    let mut two_levels = TwoLevels::new(duplicates::Settings::default()).unwrap();
    let all = two_levels.detect(&balls.scene, a, b).unwrap().clone();
    let nothing = Missing::of(&all, &all, a, b);
    assert_eq!((nothing.rate(), nothing.pair_rate()), (0.0, 0.0));
    let one = two_levels.detect_djb2(&balls.scene, a, b, 1).unwrap();
    let missing = Missing::of(&all, one, a, b);
    let colliding = all.colliding(a).len() + all.colliding(b).len();
    assert_eq!(missing.n_colliding, colliding as u64);
    assert_eq!(missing.n_missing_pairs, (all.len() - one.len()) as u64);
    assert_eq!(missing.n_missing, colliding as u64 - 2 * one.len() as u64);
}

#[test]
fn bad_settings_and_queries_are_refused() {
    let grid = |settings| UniformGrid::new(settings).err();
    for lambda in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let settings = Settings {
            lambda,
            ..Settings::default()
        };
        assert!(matches!(grid(settings), Some(Error::Setting { .. })));
        let settings = duplicates::Settings {
            lambda,
            ..duplicates::Settings::default()
        };
        let refused = TwoLevels::new(settings).err();
        assert!(matches!(refused, Some(Error::Setting { .. })));
    }
    let settings = Settings {
        threads: 5_000,
        ..Settings::default()
    };
    assert!(matches!(grid(settings), Some(Error::Setting { .. })));
    let settings = duplicates::Settings {
        group_size: 65,
        ..duplicates::Settings::default()
    };
    assert!(TwoLevels::new(settings).is_err());
    let cube = surfaces::cube([0.0; 3], 1.0);
    let mut case = Case::new("cubes", &cube, &cube, false);
    let mut grid = UniformGrid::new(Settings::default()).unwrap();
    let same = grid.detect(&case.scene, case.a, case.a).err();
    assert!(matches!(same, Some(Error::SameBody { .. })));
    let mut two_levels = TwoLevels::new(duplicates::Settings::default()).unwrap();
    let refused = two_levels.detect_djb2(&case.scene, case.a, case.b, 0).err();
    assert!(matches!(refused, Some(Error::Setting { .. })));
    case.scene.positions_mut::<f32>(case.a).unwrap()[3][1] = f32::NAN;
    let refused = grid.detect(&case.scene, case.a, case.b).err();
    assert!(matches!(refused, Some(Error::NonFinitePosition { .. })));
}
