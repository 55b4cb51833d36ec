//! Contact: forces balance, bodies do not pass through each other, the ground holds, every run
//! gives the same bits.

mod common;

use common::{cpu, cross, distance, no_gravity, still, sum};
use impinge::{Detector, Method};
use impinge_fem::scenes::{SceneName, block, drop_scene};
use impinge_fem::{Damping, Error, Ground, Material, Settings, Simulation, Solid};

const MATERIAL: Material = Material {
    young: 1e5,
    poisson: 0.3,
    density: 1e3,
};

const FLOOR: Ground = Ground {
    normal: [0.0, 2.0, 0.0],
    height: 0.0,
};

/// A block of 1 m, turned about the vertical axis and moved.
fn turned_block(angle: f64, offset: [f64; 3]) -> Solid {
    let (s, c) = angle.sin_cos();
    block(3, 3, 3, 1.0 / 3.0, MATERIAL).posed(|[x, y, z]| {
        let (x, z) = (x - 0.5, z - 0.5);
        [
            c * x + s * z + offset[0],
            y + offset[1],
            c * z - s * x + offset[2],
        ]
    })
}

#[test]
fn contact_forces_are_opposite_and_twist_nothing() {
    let lower = turned_block(0.0, [0.0; 3]);
    let upper = turned_block(0.4, [0.1, 0.93, -0.05]);
    let settings = no_gravity();
    let simulation = Simulation::new(&[lower, upper], settings.clone()).unwrap();
    let mut detector = cpu();
    let pairs = simulation.detect(&mut detector).unwrap();
    let forces = simulation.contact_forces(&pairs).unwrap();
    let positions = simulation.positions();
    let n = forces.len() / 2;
    let (below, above) = (sum(forces[..n].to_vec()), sum(forces[n..].to_vec()));
    // The overlap is 0.07 m deep over the common area of two squares, turned and moved. It pushes
    // straight up except at the rim, where normals lean outwards.
    let pressure = settings.contact_stiffness * 1e5 * 0.07 / mean_edge();
    let area = above[1] / pressure;
    assert!((0.7..0.95).contains(&area), "{area}");
    assert!(above[0].hypot(above[2]) < 0.1 * above[1], "{above:?}");
    assert!(distance(below, above.map(|x| -x)) < 1e-9 * above[1]);
    let torque = sum(positions.iter().zip(&forces).map(|(x, f)| cross(*x, *f)));
    assert!(distance(torque, [0.0; 3]) < 1e-9 * above[1], "{torque:?}");
    // The forces do not depend on the order of the bodies.
    let swapped = Simulation::new(
        &[
            turned_block(0.4, [0.1, 0.93, -0.05]),
            turned_block(0.0, [0.0; 3]),
        ],
        settings,
    )
    .unwrap();
    let pairs = swapped.detect(&mut detector).unwrap();
    let again = swapped.contact_forces(&pairs).unwrap();
    for (a, b) in forces.iter().zip(again[n..].iter().chain(&again[..n])) {
        assert!(distance(*a, *b) < 1e-9 * above[1]);
    }
}

/// Mean edge of a block's surface: two sides of a square to one diagonal, shared by two triangles.
fn mean_edge() -> f64 {
    (2.0 + 2f64.sqrt()) / 9.0
}

#[test]
fn a_collision_keeps_momentum_and_gains_no_energy() {
    let left = turned_block(0.2, [0.0; 3]).moving([2.0, 0.1, 0.0]);
    let right = turned_block(0.0, [1.3, 0.2, 0.1]).moving([-1.0, 0.0, 0.3]);
    let settings = Settings {
        dt: 2e-3,
        tolerance: 1e-12,
        friction: 0.2,
        ..no_gravity()
    };
    let n_left = left.rest.len();
    let mut simulation = Simulation::new(&[left, right], settings).unwrap();
    let momentum = simulation.momentum();
    let start = simulation.energy().total();
    let mut detector = cpu();
    let (mut n_contacts, mut most) = (0, 0.0f64);
    for _ in 0..500 {
        let report = simulation.step(&mut detector).unwrap();
        assert!(distance(simulation.momentum(), momentum) < 1e-6);
        n_contacts += report.n_contacts;
        most = most.max(simulation.energy().total());
    }
    assert!(n_contacts > 100);
    assert!(most <= start * (1.0 + 1e-9), "{start} {most}");
    // They met and separated: now the left one is slower than the right one.
    let (masses, velocities) = (simulation.masses(), simulation.velocities());
    let mean = |range: std::ops::Range<usize>| {
        let mass: f64 = masses[range.clone()].iter().sum();
        range.map(|v| masses[v] * velocities[v][0]).sum::<f64>() / mass
    };
    let (left, right) = (mean(0..n_left), mean(n_left..masses.len()));
    assert!(left < right + 1e-3, "{left} {right}");
}

fn two_blocks(settings: Settings) -> Simulation {
    let lower = turned_block(0.0, [0.0; 3]);
    let upper = turned_block(0.5, [0.02, 1.1, 0.01]).moving([0.0, -2.0, 0.0]);
    let settings = Settings {
        ground: Some(FLOOR),
        damping: Damping {
            mass: 3.0,
            stiffness: 5e-3,
        },
        friction: 0.6,
        ..settings
    };
    Simulation::new(&[lower, upper], settings).unwrap()
}

/// Heights of the centroids of two solids of equal size.
fn heights(simulation: &Simulation) -> [f64; 2] {
    let positions = simulation.positions();
    let n = positions.len() / 2;
    [&positions[..n], &positions[n..]].map(|p| p.iter().map(|p| p[1]).sum::<f64>() / n as f64)
}

#[test]
fn blocks_that_are_dropped_do_not_pass_through_each_other() {
    let mut simulation = two_blocks(still());
    let mut detector = cpu();
    let mut deepest = f64::INFINITY;
    let mut last = None;
    for _ in 0..400 {
        let report = simulation.step(&mut detector).unwrap();
        assert!(report.residual <= simulation.settings().tolerance);
        let [lower, upper] = heights(&simulation);
        assert!(lower > 0.25, "{lower}");
        deepest = deepest.min(upper - lower);
        last = Some(report);
    }
    // One rests on the other: centroids about a metre apart, in contact, nothing below the floor.
    assert!(deepest > 0.6, "{deepest}");
    let [lower, upper] = heights(&simulation);
    assert!(
        (0.3..0.55).contains(&lower) && (0.8..1.05).contains(&(upper - lower)),
        "{lower} {upper}"
    );
    let report = last.unwrap();
    assert!(report.n_contacts > 20 && report.n_contacts <= report.n_pairs);
    assert_eq!(report.n_colliding.len(), 2);
    assert!(report.n_colliding.iter().all(|n| *n > 5));
    let lowest = simulation
        .positions()
        .iter()
        .fold(f64::INFINITY, |m, p| m.min(p[1]));
    assert!((-0.05..0.0).contains(&lowest), "{lowest}");
    let speed = simulation.energy().kinetic;
    // It came down with about 9 kJ; almost nothing of that is left.
    assert!(speed < 20.0, "{speed} J");
}

#[test]
fn without_contact_they_would_pass() {
    // The same fall with empty answers of the detector: shows that the test above can fail.
    let mut simulation = two_blocks(still());
    let mut detector = cpu();
    let mut apart = Simulation::new(
        &[
            turned_block(0.0, [0.0; 3]),
            turned_block(0.0, [9.0, 9.0, 9.0]),
        ],
        still(),
    )
    .unwrap();
    apart.step(&mut detector).unwrap();
    let nothing = apart.detect(&mut detector).unwrap();
    assert!(nothing.is_empty());
    let mut nearest = f64::INFINITY;
    for _ in 0..100 {
        simulation.advance(&nothing).unwrap();
        let [lower, upper] = heights(&simulation);
        nearest = nearest.min(upper - lower);
    }
    assert!(nearest < 0.1, "{nearest}");
}

#[test]
fn friction_holds_on_a_slope_and_without_it_slides() {
    let slide = |friction: f64| {
        // Gravity is tilted by 0.2 rad: a slope of tan 0.2 = 0.2027.
        let settings = Settings {
            gravity: [9.81 * 0.2f64.sin(), -9.81 * 0.2f64.cos(), 0.0],
            ground: Some(FLOOR),
            friction,
            ..still()
        };
        let mut simulation = Simulation::new(&[turned_block(0.0, [0.0; 3])], settings).unwrap();
        for _ in 0..200 {
            simulation.step(&mut cpu()).unwrap();
        }
        let n = simulation.masses().len() as f64;
        simulation.positions().iter().map(|p| p[0]).sum::<f64>() / n
    };
    // The path in one second of free sliding: g sin 0.2 / 2; with friction of 0.1, g (sin 0.2 - 0.1
    // cos 0.2) / 2.
    assert!((slide(0.0) - 0.974).abs() < 0.08, "{}", slide(0.0));
    assert!((slide(0.1) - 0.494).abs() < 0.08, "{}", slide(0.1));
    assert!(slide(0.5) < 0.1, "{}", slide(0.5));
}

#[test]
fn a_body_pushes_itself_where_asked_to() {
    // A strip bent into a ring whose ends run into each other.
    let ring = |self_contact| {
        let strip = block(24, 2, 2, 0.1, MATERIAL).posed(|[x, y, z]| {
            let angle = x / 2.4 * 2.05 * std::f64::consts::PI;
            let radius = 0.45 - (y - 0.1);
            [radius * angle.sin(), -radius * angle.cos(), z]
        });
        let settings = Settings {
            self_contact,
            ..no_gravity()
        };
        let mut simulation = Simulation::new(&[strip], settings).unwrap();
        simulation.step(&mut cpu()).unwrap()
    };
    let report = ring(true);
    assert!(report.n_pairs > 10 && report.n_contacts > 0, "{report:?}");
    assert_eq!(ring(false).n_pairs, 0);
}

/// Positions and velocities after 60 steps of the falling blocks.
fn blocks_state(threads: usize, method: Method) -> [Vec<[f64; 3]>; 2] {
    let scene = drop_scene(SceneName::Blocks).unwrap();
    let settings = Settings {
        threads,
        ..scene.settings
    };
    let mut simulation = Simulation::new(&scene.solids, settings).unwrap();
    let mut detector =
        Detector::new(impinge::Settings::new().method(method).threads(threads)).unwrap();
    let mut n_contacts = 0;
    for _ in 0..60 {
        n_contacts += simulation.step(&mut detector).unwrap().n_contacts;
    }
    assert!(n_contacts > 1_000, "{n_contacts}");
    state(&simulation)
}

fn state(simulation: &Simulation) -> [Vec<[f64; 3]>; 2] {
    [simulation.positions(), simulation.velocities()]
}

/// Equal bits, not equal numbers.
fn bits(state: &[Vec<[f64; 3]>; 2]) -> Vec<u64> {
    let numbers = state.iter().flatten().flatten();
    numbers.map(|x| x.to_bits()).collect()
}

#[test]
fn threads_and_methods_do_not_change_a_bit() {
    let expected = bits(&blocks_state(1, Method::Clusters));
    for (threads, method) in [
        (2, Method::Cells),
        (3, Method::Clusters),
        (8, Method::Clusters),
    ] {
        assert!(
            bits(&blocks_state(threads, method)) == expected,
            "{threads} threads, {method:?}"
        );
    }
}

#[test]
fn pairs_of_another_scene_are_refused() {
    let mut simulation = Simulation::new(&[turned_block(0.0, [0.0; 3])], still()).unwrap();
    let other = Simulation::new(
        &[turned_block(0.0, [0.0; 3]), turned_block(0.5, [0.0; 3])],
        still(),
    )
    .unwrap();
    let mut detector = cpu();
    let pairs = other.detect(&mut detector).unwrap();
    let before = state(&simulation);
    assert!(matches!(
        simulation.advance(&pairs),
        Err(Error::ForeignPair { .. })
    ));
    assert!(state(&simulation) == before);
}
