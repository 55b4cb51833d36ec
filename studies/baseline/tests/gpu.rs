//! The GPU baseline compared with the oracle and with its CPU version. Without an adapter these
//! tests fail.

mod common;

use common::{Case, cases, oracle};
use impinge_baseline::gpu::{Settings, UniformGrid};
use impinge_core::Capacities;
use impinge_scenes::{BuiltScene, surfaces};

fn rows(grid: &mut UniformGrid, case: &Case) -> Vec<[u32; 4]> {
    let outcome = grid.detect(&case.scene, case.a, case.b).unwrap();
    outcome.pairs.rows().collect()
}

#[test]
fn finds_what_the_oracle_finds() {
    let cases = cases();
    let expected: Vec<_> = cases.iter().map(oracle).collect();
    for (lambda, owner_rule) in [(5.0, false), (5.0, true), (0.3, true), (60.0, false)] {
        let settings = Settings {
            lambda,
            owner_rule,
            device: None,
        };
        let mut grid = UniformGrid::new(settings.clone()).unwrap();
        for (case, expected) in cases.iter().zip(&expected) {
            // Run twice: the second frame reuses the memory of the first.
            for _ in 0..2 {
                let found = rows(&mut grid, case);
                assert_eq!(&found, expected, "{} with {settings:?}", case.name);
            }
        }
    }
}

/// The smallest capacities.
fn least() -> Capacities {
    let mut least = Capacities::default();
    (least.items, least.kept, least.entries) = (1, 1, 1);
    (least.candidates, least.pairs, least.unsure) = (1, 1, 1);
    least
}

#[test]
fn works_in_parts_where_room_is_short() {
    let ball = surfaces::bumpy_ball(3_000, 0.2);
    let case = Case::new("balls", &ball, &ball.translated([0.05, 0.02, 0.01]), false);
    let expected = oracle(&case);
    let mut most_parts = 0;
    for budget in [150_000, 450_000, 1_050_000, 1_200_000, 1_500_000, 1_950_000] {
        let settings = Settings::default();
        let mut grid = UniformGrid::with_capacities(settings, least(), Some(budget)).unwrap();
        match grid.detect(&case.scene, case.a, case.b) {
            Ok(outcome) => {
                assert!(
                    outcome.pairs.rows().eq(expected.iter().copied()),
                    "{budget}"
                );
                most_parts = most_parts.max(outcome.pairs.stats().n_batches);
            }
            Err(error) => {
                let is_short = matches!(error, impinge_core::Error::MemoryBudget { .. });
                assert!(is_short, "{budget}: {error}");
            }
        }
    }
    assert!(most_parts > 3, "{most_parts} parts at most");
}

#[test]
fn a_cell_too_crowded_is_refused() {
    // More than 32,768 pairs of groups in one cell.
    let soup = impinge_scenes::soup::triangles(12_000, 0.01, 3);
    let case = Case::new("crowd", &soup, &soup, false);
    let settings = Settings {
        lambda: 1e-9,
        ..Settings::default()
    };
    let mut grid = UniformGrid::new(settings).unwrap();
    let refused = grid.detect(&case.scene, case.a, case.b).err();
    assert!(matches!(refused, Some(impinge_core::Error::Gpu { .. })));
    // The grid stays usable.
    let ball = surfaces::ball(500);
    let case = Case::new("balls", &ball, &ball, false);
    assert_eq!(rows(&mut grid, &case), oracle(&case));
}

#[test]
fn grows_from_next_to_nothing() {
    let ball = surfaces::bumpy_ball(3_000, 0.2);
    let case = Case::new("balls", &ball, &ball.translated([0.3, 0.2, 0.1]), false);
    let mut grid = UniformGrid::with_capacities(Settings::default(), least(), None).unwrap();
    let expected = oracle(&case);
    assert!(expected.len() > 100);
    assert_eq!(rows(&mut grid, &case), expected);
    let outcome = grid.detect(&case.scene, case.a, case.b).unwrap();
    assert_eq!(outcome.pairs.stats().n_reruns, 0);
}

#[test]
fn sorts_many_blocks_and_counts_as_the_cpu_does() {
    // Some hundred thousand entries: dozens of blocks, three digits.
    let ball = surfaces::ball(60_000);
    let balls = BuiltScene::two_body("balls", &ball, [0.02, 0.01, 0.01]).unwrap();
    let (a, b) = (balls.bodies[0], balls.bodies[1]);
    let mut on_cpu = impinge_baseline::UniformGrid::new(impinge_baseline::Settings {
        owner_rule: true,
        ..impinge_baseline::Settings::default()
    })
    .unwrap();
    let mut on_gpu = UniformGrid::new(Settings {
        owner_rule: true,
        ..Settings::default()
    })
    .unwrap();
    let cpu = on_cpu.detect(&balls.scene, a, b).unwrap();
    let gpu = on_gpu.detect(&balls.scene, a, b).unwrap();
    assert!(gpu.pairs.rows().eq(cpu.pairs.rows()));
    assert!(gpu.counts.n_entries > 200_000);
    // With the owner rule a test is a pair of boxes that overlap, on both backends.
    assert_eq!(gpu.counts.n_tests, cpu.counts.n_tests);
    assert_eq!(gpu.counts.n_reaching, cpu.counts.n_reaching);
    // Ranges on a GPU are slightly wider, so counts are slightly larger.
    let near = |gpu: u64, cpu: u64| gpu >= cpu && gpu < 2 * cpu;
    assert!(near(gpu.counts.n_entries, cpu.counts.n_entries));
    assert!(near(gpu.counts.n_box_tests, cpu.counts.n_box_tests));
    assert!(gpu.counts.n_mixed_cells > 0);
}

#[test]
fn repeats_tests_without_the_owner_rule() {
    let ball = surfaces::ball(4_000);
    let balls = BuiltScene::two_body("balls", &ball, [0.5, 0.2, 0.1]).unwrap();
    let n_tests = |owner_rule| {
        let settings = Settings {
            owner_rule,
            ..Settings::default()
        };
        let mut grid = UniformGrid::new(settings).unwrap();
        let outcome = grid.detect(&balls.scene, balls.bodies[0], balls.bodies[1]);
        outcome.unwrap().counts.n_tests
    };
    assert!(n_tests(true) < n_tests(false));
}

#[test]
fn refuses_what_it_cannot_use() {
    let no_lambda = Settings {
        lambda: 0.0,
        ..Settings::default()
    };
    assert!(UniformGrid::new(no_lambda).is_err());
    let nobody = Settings {
        device: Some("no adapter has this name".to_owned()),
        ..Settings::default()
    };
    let refused = UniformGrid::new(nobody).err();
    assert!(matches!(
        refused,
        Some(impinge_core::Error::NoAdapter { .. })
    ));
}
