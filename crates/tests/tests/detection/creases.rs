//! Triangles around a vertex, under `SharedVertex::Resolve`: where the vertex says that none of
//! them meet, none do.

use impinge_core::{Method, Query, Scene, SharedVertex};
use impinge_scenes::Random;
use impinge_tests::{Case, check, cpu, detector, naive, rows};

/// Several fans around vertices of their own, open or closed, some of which share vertices.
fn fans(
    random: &mut Random,
    coordinate: &mut dyn FnMut(&mut Random) -> f64,
) -> (Vec<[u32; 3]>, Vec<[f64; 3]>) {
    let mut faces = Vec::new();
    let n_vertices = 4 + random.below(12);
    for _ in 0..1 + random.below(3) {
        let n = 2 + random.below(8);
        let center = random.below(n_vertices);
        let first = random.below(n_vertices);
        let closed = random.below(2) == 0;
        let rim = |ix: u32| (first + if closed && ix == n { 0 } else { ix }) % n_vertices;
        for ix in 0..n {
            let mut face = [center, rim(ix), rim(ix + 1)];
            if random.below(4) == 0 {
                face.swap(1, 2);
            }
            face.rotate_left(random.below(3) as usize);
            faces.push(face);
        }
    }
    let positions = (0..n_vertices).map(|_| std::array::from_fn(|_| coordinate(random)));
    (faces, positions.collect())
}

#[test]
fn random_fans_are_answered_as_the_oracle_does() {
    let mut random = Random::new(7);
    let (mut n_with, mut n_without) = (0, 0);
    for round in 0..3_000u32 {
        let lattice = 2 + round % 4;
        let mut coordinate: Box<dyn FnMut(&mut Random) -> f64> = match round % 3 {
            0 => Box::new(move |random| f64::from(random.below(lattice))),
            1 => Box::new(|random| f64::from(random.unit())),
            // Nearly flat.
            _ => {
                let mut n = 0;
                Box::new(move |random| {
                    n += 1;
                    f64::from(random.unit()) * if n % 3 == 0 { 1e-9 } else { 1.0 }
                })
            }
        };
        let (faces, positions) = fans(&mut random, &mut coordinate);
        for double in [false, true] {
            let mut scene = Scene::new();
            let body = if double {
                scene.add((faces.clone(), positions.clone()))
            } else {
                let narrow = positions.iter().map(|p| p.map(|x| x as f32));
                scene.add((faces.clone(), narrow.collect::<Vec<_>>()))
            };
            let case = Case {
                name: format!("round {round}, f64 {double}: {faces:?} {positions:?}"),
                scene,
                query: Query::self_of(body.unwrap()).shared_vertex(SharedVertex::Resolve),
            };
            let expected = naive(&case);
            match expected.is_empty() {
                true => n_without += 1,
                false => n_with += 1,
            }
            check(&case, &expected, cpu(Method::Clusters, 1));
        }
    }
    assert!(n_with > 500 && n_without > 500, "{n_with} and {n_without}");
}

/// What is found in one pose says nothing of the next.
#[test]
fn creases_follow_the_positions() {
    let n = 40u32;
    let faces: Vec<[u32; 3]> = (0..n)
        .flat_map(|ix| {
            [
                [2 * ix, 2 * ix + 1, 2 * ix + 2],
                [2 * ix + 1, 2 * ix + 3, 2 * ix + 2],
            ]
        })
        .collect();
    let strip = |turn: f32| -> Vec<[f32; 3]> {
        (0..=n)
            .flat_map(|ix| {
                let along = if ix > 20 {
                    20.0 - turn * (ix - 20) as f32
                } else {
                    ix as f32
                };
                [[along, 0.0, 0.0], [along, 1.0, 0.0]]
            })
            .collect()
    };
    let mut scene = Scene::new();
    let body = scene.add((faces, strip(-1.0))).unwrap();
    for threads in [1, 2] {
        let mut detector = detector(Method::Clusters, threads);
        for (turn, meets) in [(-1.0, false), (1.0, true), (-0.5, false), (0.5, true)] {
            scene.set_positions(body, strip(turn)).unwrap();
            for rule in [SharedVertex::Skip, SharedVertex::Resolve] {
                let query = Query::self_of(body).shared_vertex(rule);
                let case = Case {
                    name: format!("{turn} {rule:?}"),
                    scene: scene.clone(),
                    query: query.clone(),
                };
                let expected = naive(&case);
                let pairs = detector.detect(&scene, &query).unwrap();
                assert_eq!(rows(&pairs), expected, "{}", case.name);
                assert_eq!(!expected.is_empty(), meets, "{}", case.name);
            }
        }
    }
}
