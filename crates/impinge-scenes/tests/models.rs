//! Generators keep their promises: counts, closed surfaces, positive volumes, repeatable results.

use std::collections::HashMap;

use impinge::Elements;
use impinge_scenes::deform::{Deform, Drift, Flow, Twist, Wave};
use impinge_scenes::surfaces::Knot;
use impinge_scenes::{Model, Random, solids, soup, surfaces};

fn faces(model: &Model) -> &[[u32; 3]] {
    match &model.elements {
        Elements::Triangles(faces) => faces,
        _ => panic!("a surface was expected"),
    }
}

fn tets(model: &Model) -> &[[u32; 4]] {
    match &model.elements {
        Elements::Tetrahedra(tets) => tets,
        _ => panic!("a solid was expected"),
    }
}

/// Directed edges of a surface and how often each is used.
fn directed_edges(faces: &[[u32; 3]]) -> HashMap<(u32, u32), u32> {
    let mut edges = HashMap::new();
    for &[a, b, c] in faces {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_insert(0) += 1;
        }
    }
    edges
}

/// Closed and consistently oriented: every directed edge once, its opposite once.
fn is_closed(faces: &[[u32; 3]]) -> bool {
    let edges = directed_edges(faces);
    edges
        .iter()
        .all(|(&(a, b), &uses)| uses == 1 && edges.get(&(b, a)) == Some(&1))
}

/// V - E + F: 2 for a sphere, 0 for a torus.
fn euler_number(model: &Model) -> i64 {
    let n_edges = directed_edges(faces(model)).len() / 2;
    let count = |n: usize| i64::try_from(n).expect("small");
    count(model.n_vertices()) - count(n_edges) + count(model.n_elements())
}

fn corners<const K: usize>(model: &Model, element: [u32; K]) -> [[f64; 3]; K] {
    element.map(|corner| model.positions[corner as usize].map(f64::from))
}

fn determinant(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// The volume that a closed surface encloses, positive when it faces outward.
fn enclosed_volume(model: &Model) -> f64 {
    let six_fold: f64 = faces(model)
        .iter()
        .map(|&face| {
            let [a, b, c] = corners(model, face);
            determinant(a, b, c)
        })
        .sum();
    six_fold / 6.0
}

fn tet_volume(model: &Model, tet: [u32; 4]) -> f64 {
    let [a, b, c, d] = corners(model, tet);
    let from_a = |p: [f64; 3]| std::array::from_fn(|k| p[k] - a[k]);
    determinant(from_a(b), from_a(c), from_a(d)) / 6.0
}

#[test]
fn closed_surfaces_are_closed_face_outward_and_have_their_euler_number() {
    let sphere_volume = std::f64::consts::PI / 6.0;
    let cases = [
        (
            "icosphere",
            surfaces::icosphere(3),
            20 * 64,
            2,
            sphere_volume,
        ),
        ("ball", surfaces::ball(15_000), 15_000, 2, sphere_volume),
        ("small ball", surfaces::ball(78), 78, 2, sphere_volume),
        (
            "bumpy ball",
            surfaces::bumpy_ball(5_000, 0.2),
            5_000,
            2,
            sphere_volume,
        ),
        (
            "torus",
            surfaces::torus(60, 30, 1.0, 0.25),
            3_600,
            0,
            2.0 * std::f64::consts::PI.powi(2) * 0.0625,
        ),
        (
            "box",
            surfaces::cuboid([1.0; 3], [2.0, 3.0, 4.0]),
            12,
            2,
            6.0,
        ),
        ("cube", surfaces::cube([1.0, 2.0, 3.0], 0.5), 12, 2, 0.125),
    ];
    for (name, model, n_triangles, euler, volume) in cases {
        assert_eq!(model.n_elements(), n_triangles, "{name}");
        assert!(is_closed(faces(&model)), "{name}");
        assert_eq!(euler_number(&model), euler, "{name}");
        let relative = enclosed_volume(&model) / volume;
        assert!((0.7..1.02).contains(&relative), "{name}: {relative}");
    }
}

#[test]
fn stand_ins_have_exactly_the_triangles_asked_for() {
    for n in [96, 98, 1_000, 69_450, 100_000] {
        let model = surfaces::stand_in(n);
        assert_eq!(model.n_elements(), n);
        assert!(is_closed(faces(&model)), "{n}");
        assert_eq!(euler_number(&model), 0, "{n}");
        assert!(enclosed_volume(&model) > 0.0, "{n}");
    }
    assert_eq!(surfaces::stand_in(69_451).n_elements(), 69_450);
    assert_eq!(surfaces::ball(15_001).n_elements(), 15_000);
    assert_eq!(surfaces::ball(0).n_elements(), 20);
}

#[test]
fn a_stand_in_has_a_unit_box_diagonal_and_no_very_thin_triangles() {
    let model = surfaces::stand_in(20_000);
    let (min, max) = model.bounds().expect("it has vertices");
    let diagonal: f32 = (0..3).map(|k| (max[k] - min[k]).powi(2)).sum();
    assert!((diagonal - 1.0).abs() < 1e-4, "{diagonal}");
    for &face in faces(&model) {
        let [a, b, c] = corners(&model, face);
        let length =
            |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
        let sides = [length(a, b), length(b, c), length(c, a)];
        let longest = sides.iter().fold(0f64, |m, &x| m.max(x));
        let shortest = sides.iter().fold(f64::INFINITY, |m, &x| m.min(x));
        assert!(shortest > 0.1 * longest, "{sides:?}");
    }
}

#[test]
fn a_knot_of_another_kind_closes_too() {
    let knot = Knot {
        p: 3,
        q: 5,
        tube_radius: 0.1,
        ..Knot::default()
    };
    let model = surfaces::torus_knot(12_000, knot);
    assert!(is_closed(faces(&model)));
    assert_eq!(euler_number(&model), 0);
}

#[test]
fn a_cloth_has_a_border_and_exact_coordinates() {
    let model = surfaces::cloth(7, 5, 0.25);
    assert_eq!(model.n_elements(), 70);
    assert_eq!(model.n_vertices(), 48);
    let edges = directed_edges(faces(&model));
    let n_border = edges
        .keys()
        .filter(|&&(a, b)| !edges.contains_key(&(b, a)))
        .count();
    assert_eq!(n_border, 2 * (7 + 5));
    assert_eq!(model.bounds(), Some(([0.0; 3], [1.75, 1.25, 0.0])));
}

#[test]
fn solids_fill_their_volume_with_positive_tetrahedra() {
    let cases = [
        ("block", solids::block(3, 4, 5, 0.5), 6 * 60, 7.5, 1e-9),
        ("cube", solids::solid_cube(6_000), 6_000, 1.0, 1e-6),
        // A polyhedron inscribed in the ball: somewhat less than pi / 6.
        (
            "ball",
            solids::solid_ball(20_000),
            6 * 15 * 15 * 15,
            std::f64::consts::FRAC_PI_6,
            0.01,
        ),
    ];
    for (name, model, n_tets, volume, tolerance) in cases {
        assert_eq!(model.n_elements(), n_tets, "{name}");
        let volumes: Vec<f64> = tets(&model)
            .iter()
            .map(|&tet| tet_volume(&model, tet))
            .collect();
        assert!(volumes.iter().all(|&v| v > 0.0), "{name}");
        let total: f64 = volumes.iter().sum();
        assert!(
            (total - volume).abs() <= tolerance * volume,
            "{name}: {total}"
        );
    }
}

#[test]
fn faces_of_a_block_fit_together() {
    // A face inside belongs to two tetrahedra, one on the hull to one.
    let model = solids::block(3, 2, 4, 1.0);
    let mut uses: HashMap<[u32; 3], u32> = HashMap::new();
    for &[a, b, c, d] in tets(&model) {
        for mut face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
            face.sort_unstable();
            *uses.entry(face).or_insert(0) += 1;
        }
    }
    assert!(uses.values().all(|&n| n == 1 || n == 2));
    let n_hull = uses.values().filter(|&&n| n == 1).count();
    assert_eq!(n_hull, 2 * 2 * (3 * 2 + 3 * 4 + 2 * 4));
}

#[test]
fn soups_repeat_and_lattice_points_are_integers() {
    assert_eq!(soup::triangles(100, 0.1, 5), soup::triangles(100, 0.1, 5));
    assert_ne!(soup::triangles(100, 0.1, 5), soup::triangles(100, 0.1, 6));
    for (model, k) in [
        (soup::lattice_triangles(500, 3, 1), 3.0),
        (soup::lattice_tetrahedra(500, 2, 2), 2.0),
        (soup::lattice_web(500, 3, 3), 3.0),
        (soup::lattice_web_tetrahedra(500, 1, 4), 1.0),
    ] {
        assert_eq!(model.n_elements(), 500);
        let coordinates: Vec<f32> = model.positions.iter().flatten().copied().collect();
        assert!(
            coordinates
                .iter()
                .all(|&x| x == x.floor() && (0.0..=k).contains(&x))
        );
        assert!(coordinates.contains(&0.0) && coordinates.contains(&k));
    }
    // A lattice exists to produce degenerate elements: there must be some.
    let web = soup::lattice_web(500, 1, 3);
    assert!(
        faces(&web)
            .iter()
            .any(|[a, b, c]| a == b || b == c || a == c)
    );
    assert_eq!(soup::tetrahedra(10, 0.2, 1).n_vertices(), 40);
}

#[test]
fn random_numbers_repeat_and_fill_their_range() {
    let mut random = Random::new(42);
    let numbers: Vec<f32> = (0..10_000).map(|_| random.unit()).collect();
    assert!(numbers.iter().all(|x| (0.0..1.0).contains(x)));
    let mean = numbers.iter().sum::<f32>() / 10_000.0;
    assert!((mean - 0.5).abs() < 0.02, "{mean}");
    let mut random = Random::new(42);
    assert_eq!(numbers[0], random.unit());
    let mut seen = [0u32; 6];
    for _ in 0..6_000 {
        seen[random.below(6) as usize] += 1;
    }
    assert!(seen.iter().all(|n| (850..1_150).contains(n)), "{seen:?}");
    // The first output of SplitMix64 for seed 0, as published with the generator.
    assert_eq!(Random::new(0).bits(), 0xe220_a839_7b1d_cdaf);
}

#[test]
fn deformations_are_their_formulas() {
    let wave = Wave {
        amplitude: 0.5,
        wave_length: 4.0,
        speed: 1.0,
        travel: [1.0, 0.0, 0.0],
        displacement: [0.0, 0.0, 1.0],
    };
    // A quarter of a wave ahead is the crest; it travels at its speed.
    for t in [0.0, 1.0, 2.5] {
        let crest = wave.at([1.0 + t, 3.0, 2.0], t);
        assert!(
            (crest[2] - 2.5).abs() < 1e-5 && crest[1] == 3.0,
            "{crest:?}"
        );
    }
    let twist = Twist {
        axis: 2,
        rate: std::f32::consts::FRAC_PI_2,
    };
    let turned = twist.at([1.0, 0.0, 1.0], 1.0);
    assert!(turned[0].abs() < 1e-6 && (turned[1] - 1.0).abs() < 1e-6 && turned[2] == 1.0);
    assert_eq!(twist.at([1.0, 2.0, 3.0], 0.0), [1.0, 2.0, 3.0]);
    let drift = Drift {
        velocity: [1.0, -2.0, 0.5],
    };
    assert_eq!((drift, drift).at([0.0; 3], 2.0), [4.0, -8.0, 2.0]);
    assert_eq!(Flow::default().at([0.1, 0.2, 0.3], 0.0), [0.1, 0.2, 0.3]);
}

#[test]
fn flow_parts_neighbours_and_wave_does_not() {
    let model = surfaces::ball(8_000);
    let mut now = model.positions.clone();
    let mean_edge = |positions: &[[f32; 3]]| {
        let total: f32 = faces(&model)
            .iter()
            .map(|&[a, b, _]| {
                let (p, q) = (positions[a as usize], positions[b as usize]);
                (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f32>().sqrt()
            })
            .sum();
        total / 8_000.0
    };
    let rest = mean_edge(&model.positions);
    Wave::default().apply(&model.positions, 3.0, &mut now);
    assert!(mean_edge(&now) < 1.5 * rest);
    Flow::default().apply(&model.positions, 3.0, &mut now);
    let stirred = mean_edge(&now);
    assert!(stirred > 10.0 * rest, "{stirred} from {rest}");
}
