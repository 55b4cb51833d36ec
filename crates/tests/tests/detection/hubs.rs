//! Hubs, vertices that very many elements name: the oracle's answers, with work bounded by input
//! plus output.

use impinge_core::{
    Detector, Elements, Error, Method, Query, Scene, Settings, SharedVertex, Stats,
};
use impinge_scenes::Random;
use impinge_tests::{Case, check, cpu, detector, naive};

const RULES: [SharedVertex; 2] = [SharedVertex::Skip, SharedVertex::Resolve];

fn case(name: &str, elements: Elements, positions: &[[f64; 3]], rule: SharedVertex) -> Case {
    let mut scene = Scene::new();
    let body = scene.add((elements, positions.to_vec())).unwrap();
    Case {
        name: format!("{name}, {rule:?}"),
        scene,
        query: Query::self_of(body).shared_vertex(rule),
    }
}

fn check_both(name: &str, elements: &Elements, positions: &[[f64; 3]]) {
    for rule in RULES {
        let case = case(name, elements.clone(), positions, rule);
        check(&case, &naive(&case), cpu(Method::Clusters, 2));
    }
}

/// A number from 0 to 1, 1 excluded, of 53 bits.
fn unit(random: &mut Random) -> f64 {
    (random.bits() >> 11) as f64 / (1u64 << 53) as f64
}

/// A fan around vertex 0 whose rim winds around it `turns` times; not closed.
fn fan(n: u32, turns: f64, height: impl Fn(f64) -> f64) -> (Vec<[u32; 3]>, Vec<[f64; 3]>) {
    let faces = (0..n).map(|k| [0, k + 1, k + 2]).collect();
    let rim = (0..=n).map(|k| {
        let angle = std::f64::consts::TAU * turns * f64::from(k) / f64::from(n);
        [angle.cos(), angle.sin(), height(angle)]
    });
    (faces, std::iter::once([0.0; 3]).chain(rim).collect())
}

/// Elements over a few vertices on a small lattice; some vertices are named very often.
fn lattice<const N: usize>(
    n: usize,
    n_hubs: u32,
    side: u32,
    seed: u32,
) -> (Vec<[u32; N]>, Vec<[f64; 3]>) {
    let mut random = Random::new(seed.into());
    let positions: Vec<[f64; 3]> = (0..60)
        .map(|_| std::array::from_fn(|_| random.below(side).into()))
        .collect();
    let elements = (0..n)
        .map(|_| {
            std::array::from_fn(|_| match random.below(2) {
                0 => random.below(n_hubs),
                _ => random.below(positions.len() as u32),
            })
        })
        .collect();
    (elements, positions)
}

#[test]
fn fans_are_answered_as_by_the_oracle() {
    for (turns, bend) in [(1.0, 0.0), (0.9, 0.3), (2.5, 0.0), (2.5, 0.2), (0.3, 1.0)] {
        let (faces, positions) = fan(300, turns, |angle| bend * (3.0 * angle).sin());
        check_both("fan", &faces.into(), &positions);
    }
    // Triangles in random directions, two hubs, some vertices at the position of a hub.
    let mut random = Random::new(7);
    for spread in [0.05, 0.3, 1.0] {
        let mut positions = vec![[0.0; 3], [0.0, 0.0, 0.5]];
        let mut faces = Vec::new();
        for k in 0..320u32 {
            let at: [f64; 3] = std::array::from_fn(|_| unit(&mut random) - 0.5);
            for _ in 0..2 {
                positions.push(at.map(|x| x + spread * (unit(&mut random) - 0.5)));
            }
            let first = positions.len() as u32 - 2;
            if k % 40 == 0 {
                positions[first as usize] = positions[k as usize % 2];
            }
            faces.push([first, k % 2, first + 1]);
        }
        check_both("anywhere", &faces.into(), &positions);
    }
}

#[test]
fn books_are_answered_as_by_the_oracle() {
    let mut random = Random::new(3);
    for quarter_turns in [true, false] {
        let mut positions = vec![[0.25, -0.5, 0.125], [0.25, 1.5, 0.125]];
        for k in 0..300 {
            let angle = match quarter_turns {
                true => std::f64::consts::FRAC_PI_2 * f64::from(random.below(4)),
                false => std::f64::consts::TAU * unit(&mut random),
            };
            let along = 4.0 * unit(&mut random) - 1.5;
            // Some vertices lie on the spine's line: before the spine, on it and behind it.
            let out = if k % 5 == 0 { 0.0 } else { unit(&mut random) };
            let (x, z) = (out * angle.cos(), out * angle.sin());
            positions.push([0.25 + x, along, 0.125 + z]);
        }
        let pages: Vec<[u32; 3]> = (2..302).map(|page| [page, 0, 1]).collect();
        check_both("book", &pages.into(), &positions);
        let pages: Vec<[u32; 4]> = (2..301).map(|page| [page, 1, page + 1, 0]).collect();
        check_both("book of tetrahedra", &pages.into(), &positions);
        // A spine of zero length.
        positions[1] = positions[0];
        let pages: Vec<[u32; 3]> = (2..302).map(|page| [page, 0, 1]).collect();
        check_both("book without a spine", &pages.into(), &positions);
    }
}

#[test]
fn lattices_with_hubs_are_answered_as_by_the_oracle() {
    for seed in 0..12 {
        let (n_hubs, side) = (1 + seed % 4, 2 + seed % 3);
        let (faces, positions) = lattice::<3>(350, n_hubs, side, seed);
        check_both(&format!("lattice {seed}"), &faces.into(), &positions);
        let (tets, positions) = lattice::<4>(220, n_hubs, side, seed);
        check_both(
            &format!("lattice of tetrahedra {seed}"),
            &tets.into(),
            &positions,
        );
        // The same under a linear map: off the axes, with rounded coordinates.
        let (faces, positions) = lattice::<3>(350, n_hubs, side + 2, seed);
        let turned: Vec<[f64; 3]> = (positions.iter())
            .map(|[x, y, z]| [0.1 * x + 0.7 * y, 0.3 * y - 0.2 * z, 0.9 * z + 0.4 * x])
            .collect();
        check_both(&format!("turned lattice {seed}"), &faces.into(), &turned);
    }
}

fn statistics(elements: Elements, positions: &[[f64; 3]], rule: SharedVertex) -> (usize, Stats) {
    let case = case("large", elements, positions, rule);
    let mut detector = detector(Method::Clusters, 2);
    let pairs = detector.detect(&case.scene, &case.query).unwrap();
    (pairs.len(), pairs.stats().clone())
}

#[test]
fn faces_with_the_same_vertices_are_answered_as_by_the_oracle() {
    let turned = |copy: u32, [a, b, c]: [u32; 3]| match copy {
        0 => [a, b, c],
        1 => [b, c, a],
        _ => [c, b, a],
    };
    for turns in [0.9, 2.5] {
        let (faces, mut positions) = fan(40, turns, |angle| 0.2 * (3.0 * angle).sin());
        let mut faces: Vec<[u32; 3]> = (0..3)
            .flat_map(|copy| faces.iter().map(move |&face| turned(copy, face)))
            .collect();
        check_both("three fans", &faces.clone().into(), &positions);
        // More of one face than a block of pairs, of a face without area, and of a point.
        faces.extend((0..50).map(|k| turned(k % 3, [0, 7, 8])));
        faces.extend((0..20).map(|k| turned(k % 3, [0, 7, 7])));
        faces.extend([[0; 3]; 20]);
        check_both("many of one face", &faces.clone().into(), &positions);
        // And all of it on one line.
        positions.iter_mut().for_each(|p| *p = [p[0], 0.0, 0.0]);
        check_both("many of one face on a line", &faces.into(), &positions);
    }
}

/// A million faces with the same vertices are half of 10^12 pairs, which no machine holds: that is
/// foreseen.
#[test]
fn a_million_faces_with_the_same_vertices_cost_nothing() {
    let n_pairs = 499_999_500_000;
    let triangle = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let of_face =
        |face: [u32; 3], rule| case("same", vec![face; 1_000_000].into(), &triangle, rule);
    let mut detector = detector(Method::Clusters, 2);
    for face in [[0; 3], [0, 1, 2]] {
        let skipped = of_face(face, SharedVertex::Skip);
        let pairs = detector.detect(&skipped.scene, &skipped.query).unwrap();
        let stats = pairs.stats();
        assert_eq!(
            (pairs.len(), stats.n_candidates, stats.n_work_items),
            (0, 0, 0)
        );
        let all = of_face(face, SharedVertex::Resolve);
        assert_eq!(detector.count(&all.scene, &all.query).unwrap(), n_pairs);
    }
    let case = of_face([0, 1, 2], SharedVertex::Resolve);
    let refused = |settings: Settings| {
        let mut detector = Detector::new(settings).unwrap();
        detector.detect(&case.scene, &case.query).unwrap_err()
    };
    let memory = refused(cpu(Method::Clusters, 2));
    let bytes = 8 * n_pairs;
    assert!(
        matches!(memory, Error::OutOfMemory { needed, .. } if needed == bytes),
        "{memory}"
    );
    let limit = refused(cpu(Method::Clusters, 2).max_pairs(Some(1_000)));
    assert!(
        matches!(limit, Error::TooManyPairs { found, limit: 1_000 } if found == n_pairs),
        "{limit}"
    );
    let budget = refused(cpu(Method::Clusters, 2).memory_budget(Some(1 << 30)));
    assert!(
        matches!(budget, Error::MemoryBudget { needed, budget, .. } if needed >= bytes && budget == 1 << 30),
        "{budget}"
    );
}

#[test]
fn work_around_a_hub_is_bounded_by_its_elements() {
    let n = 50_000;
    let bound = |name: &str, elements: Elements, positions: &[[f64; 3]], expected: usize| {
        let (n_pairs, stats) = statistics(elements.clone(), positions, SharedVertex::Skip);
        assert_eq!((n_pairs, stats.n_candidates), (0, 0), "{name}");
        assert!(stats.n_work_items < 4_000, "{name}: {}", stats.n_work_items);
        let (n_pairs, stats) = statistics(elements, positions, SharedVertex::Resolve);
        assert_eq!(n_pairs, expected, "{name}");
        let most = 6 * (u64::from(n) + expected as u64);
        assert!(stats.n_candidates < most, "{name}: {}", stats.n_candidates);
        assert!(stats.n_work_items < 4_000, "{name}: {}", stats.n_work_items);
    };
    let (faces, positions) = fan(n, 0.99, |_| 0.0);
    bound("flat fan", faces.into(), &positions, 0);
    let (faces, positions) = fan(n, 0.99, |angle| 0.3 * (5.0 * angle).sin());
    bound("bent fan", faces.into(), &positions, 0);
    // Two caps, one above the other, whose projections overlap.
    let (mut faces, mut positions) = fan(n / 2, 0.99, |_| 0.0);
    let above = positions.len() as u32;
    faces.extend_from_within(..);
    faces[n as usize / 2..]
        .iter_mut()
        .for_each(|face| *face = face.map(|id| id + above));
    positions.extend(positions.clone().iter().map(|[x, y, _]| [*x, *y, 1.0]));
    bound("two caps", faces.into(), &positions, 0);
    // All pages share two hubs; half of the pages lie on the line of the spine.
    let mut positions = vec![[0.0; 3], [0.0, 0.0, 1.0]];
    positions.extend((0..n).map(|k| {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(n);
        let out = f64::from(k % 2);
        [out * angle.cos(), out * angle.sin(), 0.5]
    }));
    let pages: Vec<[u32; 3]> = (0..n).map(|k| [0, 1, k + 2]).collect();
    bound("book", pages.into(), &positions, 0);
    // All vertices at one position, with different numbers.
    let faces: Vec<[u32; 3]> = (0..n).map(|k| [0, 2 * k + 1, 2 * k + 2]).collect();
    bound(
        "points",
        faces.into(),
        &vec![[1.0; 3]; 2 * n as usize + 1],
        0,
    );
    // A fan of tetrahedra around the segment from a hub to a point next to it.
    let (faces, mut positions) = fan(n, 0.99, |_| 0.0);
    let tip = positions.len() as u32;
    positions.push([0.0, 0.0, 1.0]);
    let tets: Vec<[u32; 4]> = faces.iter().map(|&[a, b, c]| [a, b, c, tip]).collect();
    bound("fan of tetrahedra", tets.into(), &positions, 0);
}
