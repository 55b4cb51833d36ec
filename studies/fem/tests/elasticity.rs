//! The elastic part alone: exact cases, conservation, a beam against its formula, inversion.

mod common;

use common::{cpu, distance, no_gravity, still, sum};
use impinge_fem::{Damping, Error, Material, Settings, Simulation, Solid, scenes};
use impinge_scenes::Random;

const MATERIAL: Material = Material {
    young: 2e5,
    poisson: 0.3,
    density: 1e3,
};

/// A block of 4 by 3 by 3 cubes of 0.25 m with randomly moved inner vertices, so that no two
/// elements are alike.
fn shaken_block() -> Solid {
    let mut solid = scenes::block(4, 3, 3, 0.25, MATERIAL);
    let mut random = Random::new(5);
    for p in &mut solid.rest {
        let shake = random.point(-0.05, 0.05);
        if is_inside(*p) {
            *p = std::array::from_fn(|k| p[k] + f64::from(shake[k]));
        }
    }
    Solid::new(solid.tets, solid.rest, MATERIAL)
}

fn is_inside(p: [f64; 3]) -> bool {
    let inside = |x: f64, end: f64| x > 1e-9 && x < end - 1e-9;
    inside(p[0], 1.0) && inside(p[1], 0.75) && inside(p[2], 0.75)
}

/// A symmetric stretch, so that its rotation is the identity.
fn stretched([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        1.02 * x + 0.01 * y - 0.005 * z,
        0.01 * x + 0.97 * y + 0.02 * z + 0.3,
        -0.005 * x + 0.02 * y + 1.01 * z,
    ]
}

#[test]
fn patch_test_a_uniform_stretch_leaves_inner_vertices_without_force() {
    let solid = shaken_block().posed(stretched);
    let rest = solid.rest.clone();
    let simulation = Simulation::new(&[solid], no_gravity()).unwrap();
    let forces = simulation.elastic_forces();
    let largest = forces
        .iter()
        .fold(0.0, |m: f64, f| m.max(distance(*f, [0.0; 3])));
    assert!(largest > 10.0, "the surface is pulled: {largest}");
    let mut n_inside = 0;
    for (p, f) in rest.iter().zip(&forces) {
        if is_inside(*p) {
            n_inside += 1;
            assert!(distance(*f, [0.0; 3]) < 1e-10 * largest, "{p:?} {f:?}");
        }
    }
    assert_eq!(n_inside, 3 * 2 * 2);
    // The face x = 1 is pulled back by stress times area. Its border vertices also carry parts of
    // the sides' tractions, which cancel between opposite sides, because these have the same mesh.
    let (lambda, mu) = MATERIAL.lame();
    let [xx, yy, zz, xy, xz] = [0.02, -0.03, 0.01, 0.01, -0.005];
    let normal_stress = lambda * (xx + yy + zz) + 2.0 * mu * xx;
    let expected =
        [normal_stress, 2.0 * mu * xy, 2.0 * mu * xz].map(|stress| -stress * 0.75 * 0.75);
    let on_face = rest.iter().zip(&forces).filter(|(p, _)| p[0] > 1.0 - 1e-9);
    let found = sum(on_face.map(|(_, f)| *f));
    assert!(
        distance(found, expected) < 1e-9 * largest,
        "{found:?} {expected:?}"
    );
}

#[test]
fn patch_test_inner_vertices_find_their_place() {
    let solid = shaken_block();
    let goal: Vec<[f64; 3]> = solid.rest.iter().map(|&p| stretched(p)).collect();
    // The surface is fixed in the stretched pose; inner vertices start near their places.
    let mut random = Random::new(6);
    let mut solid = solid.posed(stretched).fixed_where(|p| !is_inside(p));
    for (p, rest) in solid.positions.iter_mut().zip(&solid.rest) {
        if is_inside(*rest) {
            let shake = random.point(-0.02, 0.02);
            *p = std::array::from_fn(|k| p[k] + f64::from(shake[k]));
        }
    }
    let settings = Settings {
        dt: 0.1,
        tolerance: 1e-10,
        ..no_gravity()
    };
    let mut simulation = Simulation::new(&[solid], settings).unwrap();
    for _ in 0..60 {
        simulation.step(&mut cpu()).unwrap();
    }
    for (x, goal) in simulation.positions().iter().zip(&goal) {
        assert!(distance(*x, *goal) < 1e-7, "{x:?} {goal:?}");
    }
}

#[test]
fn a_rigid_motion_costs_no_force() {
    let turn = |[x, y, z]: [f64; 3]| {
        let (s, c) = 2.1f64.sin_cos();
        let [x, y] = [c * x - s * y, s * x + c * y];
        let (s, c) = (-0.7f64).sin_cos();
        [x + 3.0, c * y - s * z - 1.0, s * y + c * z + 0.5]
    };
    let turned = Simulation::new(&[shaken_block().posed(turn)], no_gravity()).unwrap();
    let bent = Simulation::new(
        &[shaken_block().posed(|[x, y, z]| [x, y + 0.1 * x * x, z])],
        no_gravity(),
    )
    .unwrap();
    let largest = |simulation: &Simulation| {
        let forces = simulation.elastic_forces();
        forces
            .iter()
            .fold(0.0, |m: f64, f| m.max(distance(*f, [0.0; 3])))
    };
    assert!(largest(&bent) > 100.0, "{}", largest(&bent));
    assert!(largest(&turned) < 1e-8, "{}", largest(&turned));
    assert!(turned.energy().elastic < 1e-15 * bent.energy().elastic);
}

#[test]
fn free_vibration_never_gains_energy_and_keeps_momentum() {
    let solid = shaken_block()
        .posed(|[x, y, z]| [1.3 * x, y + 0.2 * x * x, z + 0.3 * x * y])
        .moving([0.4, -0.2, 1.0]);
    let settings = Settings {
        dt: 2e-3,
        tolerance: 1e-12,
        ..no_gravity()
    };
    let mut simulation = Simulation::new(&[solid], settings).unwrap();
    let momentum = simulation.momentum();
    let start = simulation.energy().total();
    let mut last = start;
    for step in 0..300 {
        simulation.step(&mut cpu()).unwrap();
        let now = simulation.energy().total();
        assert!(now <= last + 1e-9 * start, "step {step}: {last} -> {now}");
        last = now;
        assert!(distance(simulation.momentum(), momentum) < 1e-8);
    }
    // It vibrates, so the scheme loses some energy, but the motion of the centre continues.
    let flight =
        0.5 * (0.4f64.powi(2) + 0.2f64.powi(2) + 1.0) * simulation.masses().iter().sum::<f64>();
    assert!(
        last < 0.9 * start && last > 0.99 * flight,
        "{start} {last} {flight}"
    );
}

#[test]
fn damping_takes_energy_away() {
    let left = |damping| {
        let solid = shaken_block().posed(|[x, y, z]| [1.2 * x, y, z]);
        let settings = Settings {
            dt: 1e-3,
            damping,
            ..no_gravity()
        };
        let mut simulation = Simulation::new(&[solid], settings).unwrap();
        for _ in 0..50 {
            simulation.step(&mut cpu()).unwrap();
        }
        simulation.energy().total()
    };
    let free = left(Damping::default());
    for damping in [
        Damping {
            mass: 20.0,
            stiffness: 0.0,
        },
        Damping {
            mass: 0.0,
            stiffness: 5e-3,
        },
    ] {
        assert!(left(damping) < 0.5 * free, "{damping:?}");
    }
}

/// Tip deflection of a beam of length 1 m, square with side `side`, under its own weight.
fn cantilever(n_across: usize) -> f64 {
    const SIDE: f64 = 0.2;
    let spacing = SIDE / n_across as f64;
    let material = Material {
        young: 1e7,
        poisson: 0.0,
        density: 1e3,
    };
    let solid = scenes::block(5 * n_across, n_across, n_across, spacing, material)
        .fixed_where(|p| p[0] < 1e-9);
    let tip: Vec<usize> = (0..solid.rest.len())
        .filter(|&v| solid.rest[v][0] > 1.0 - 1e-9)
        .collect();
    // Steps far longer than the beam's period lead directly to rest.
    let settings = Settings {
        dt: 10.0,
        tolerance: 1e-8,
        max_iterations: 10_000,
        ..still()
    };
    let mut simulation = Simulation::new(std::slice::from_ref(&solid), settings).unwrap();
    for _ in 0..4 {
        simulation.step(&mut cpu()).unwrap();
    }
    let positions = simulation.positions();
    let drop: f64 = tip
        .iter()
        .map(|&v| solid.rest[v][1] - positions[v][1])
        .sum();
    drop / tip.len() as f64
}

#[test]
fn a_cantilever_bends_as_the_beam_formula_says() {
    // Timoshenko: w L⁴ / 8 E I + w L² / 2 k G A with k = 5/6; w is the weight per length.
    let (length, side, young) = (1.0f64, 0.2f64, 1e7);
    let weight = 1e3 * 9.81 * side * side;
    let inertia = side.powi(4) / 12.0;
    let shear = 5.0 / 6.0 * young / 2.0 * side * side;
    let expected =
        weight * length.powi(4) / (8.0 * young * inertia) + weight * length.powi(2) / (2.0 * shear);
    let coarse = cantilever(3) / expected;
    let fine = cantilever(6) / expected;
    // Linear tetrahedra are too stiff in bending, less so on finer meshes: the error falls with the
    // square of the size. The extrapolated value agrees with the formula within 3 %.
    assert!(coarse < fine && fine < 1.0, "{coarse} {fine}");
    assert!(fine > 0.88, "{fine}");
    let extrapolated = fine + (fine - coarse) / 3.0;
    assert!((extrapolated - 1.0).abs() < 0.03, "{extrapolated}");
}

#[test]
fn inverted_elements_recover() {
    // A corner pushed right through the opposite face, and a whole block turned inside out.
    let corner = Solid::new(
        vec![[0, 1, 2, 3]],
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        MATERIAL,
    )
    .posed(|[x, y, z]| if z > 0.5 { [0.3, 0.3, -0.8] } else { [x, y, z] });
    let mirrored = shaken_block().posed(|[x, y, z]| [x, y, -0.4 * z]);
    let flat = shaken_block().posed(|[x, y, _]| [x, y, 0.0]);
    let point = shaken_block().posed(|_| [0.0; 3]);
    for (what, solid) in [
        ("corner", corner),
        ("mirrored", mirrored),
        ("flat", flat),
        ("point", point),
    ] {
        let settings = Settings {
            dt: 1e-2,
            damping: Damping {
                mass: 5.0,
                stiffness: 0.0,
            },
            ..no_gravity()
        };
        let mut simulation = Simulation::new(std::slice::from_ref(&solid), settings).unwrap();
        let start = simulation.energy().elastic;
        assert!(start > 100.0, "{what}: {start}");
        for _ in 0..600 {
            simulation.step(&mut cpu()).unwrap();
        }
        let end = simulation.energy().elastic;
        if what == "point" {
            // The direction in which a point unfolds is not defined, but it must not stay a point,
            // nor fly apart.
            assert!(end < 0.5 * start, "{what}: {start} -> {end}");
            continue;
        }
        assert!(end < 1e-6 * start, "{what}: {start} -> {end}");
        let positions = simulation.positions();
        for tet in &solid.tets {
            let volume = |x: &[[f64; 3]]| {
                let [a, b, c, d] = tet.map(|v| x[v as usize]);
                let [p, q, r] = [b, c, d].map(|e| [e[0] - a[0], e[1] - a[1], e[2] - a[2]]);
                p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0])
                    + p[2] * (q[0] * r[1] - q[1] * r[0])
            };
            let ratio = volume(&positions) / volume(&solid.rest);
            assert!((ratio - 1.0).abs() < 1e-2, "{what}: {ratio}");
        }
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    let good = || scenes::block(1, 1, 1, 1.0, MATERIAL);
    let refused = |change: &dyn Fn(&mut Solid)| {
        let mut bad = good();
        change(&mut bad);
        let error = Simulation::new(&[good(), bad], still()).err().unwrap();
        error.to_string()
    };
    let said = [
        refused(&|s| s.tets[3][2] = 8),
        refused(&|s| s.rest[7] = s.rest[6]),
        refused(&|s| s.positions[5][1] = f64::NAN),
        refused(&|s| s.positions[5][1] = 1e300),
        refused(&|s| s.fixed.push(8)),
        refused(&|s| s.velocities.truncate(7)),
        refused(&|s| s.rest.push([0.0; 3])),
        refused(&|s| s.material.poisson = 0.5),
        refused(&|s| s.material.young = f64::INFINITY),
        refused(&|s| {
            for list in [&mut s.rest, &mut s.positions, &mut s.velocities] {
                list.push([0.0; 3]);
            }
        }),
    ];
    for (said, words) in said.iter().zip([
        "solid 1: tetrahedron 3 names vertex 8, but there are 8 vertices",
        "solid 1: tetrahedron 1 is flat at rest (volume 0e0)",
        "solid 1: vertex 5: position (1, NaN, 1) is not finite",
        "body 1: vertex 5 has a non-finite position",
        "solid 1: vertex 8 is to be fixed, but there are 8 vertices",
        "solid 1: 7 velocities given, but it has 8 vertices",
        "positions given, but it has 9 vertices",
        "Poisson's ratio: 0.5 given",
        "Young's modulus: inf given",
        "solid 1: vertex 8 belongs to no tetrahedron",
    ]) {
        assert!(said.contains(words), "{words}: {said}");
    }
    let settings = |change: &dyn Fn(&mut Settings)| {
        let mut settings = still();
        change(&mut settings);
        Simulation::new(&[good()], settings)
            .err()
            .unwrap()
            .to_string()
    };
    assert!(settings(&|s| s.dt = 0.0).contains("time step: 0 given"));
    assert!(settings(&|s| s.friction = -1.0).contains("friction: -1 given"));
    assert!(settings(&|s| s.max_iterations = 0).contains("solver iterations: 0 given"));
    // A simulation without solids is not an error.
    let mut empty = Simulation::new(&[], still()).unwrap();
    assert_eq!(empty.step(&mut cpu()).unwrap().n_pairs, 0);
}

#[test]
fn a_step_that_fails_changes_nothing() {
    let solid = scenes::block(1, 1, 1, 1.0, MATERIAL).moving([1e38, 0.0, 0.0]);
    let settings = Settings {
        dt: 10.0,
        ..no_gravity()
    };
    let mut simulation = Simulation::new(&[solid], settings).unwrap();
    let before = [simulation.positions(), simulation.velocities()];
    let error = simulation.step(&mut cpu()).unwrap_err();
    assert!(
        matches!(
            error,
            Error::NotFinite {
                solid: 0,
                what: "position",
                ..
            }
        ),
        "{error}"
    );
    assert_eq!([simulation.positions(), simulation.velocities()], before);
}
