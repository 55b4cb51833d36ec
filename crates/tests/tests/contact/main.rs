//! Contact geometry against an oracle in integers, and properties of curves.

mod convex;
mod curves;
mod oracle;
mod penetration;

use dashu_int::IBig;
use impinge_core::contact::{Contacts, Shape};
use impinge_core::{Backend, BodyId, Detector, Elements, Pairs, Positions, Query, Scene};
use impinge_scenes::{Model, Random, soup};

use oracle::{Rational, Scale};

/// All pairs of a query, on the CPU.
pub fn detect(scene: &Scene, query: &Query) -> Pairs {
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    detector.detect(scene, query).unwrap().clone()
}

/// The contacts of pairs.
pub fn contacts_of(scene: &Scene, pairs: &Pairs) -> Contacts {
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    detector.contacts(scene, pairs).unwrap()
}

fn corners_of(scene: &Scene, bodies: &[BodyId], body: u32, face: u32) -> [[f64; 3]; 3] {
    let body = scene.body(bodies[body as usize]).unwrap();
    let Elements::Triangles(faces) = body.elements() else {
        panic!("triangles only");
    };
    faces[face as usize].map(|vertex| body.positions().point(vertex as usize))
}

/// How many contacts of each shape were compared with the oracle.
#[derive(Debug, Default)]
struct Seen {
    points: usize,
    segments: usize,
    directed: usize,
    polygons: [usize; 7],
}

/// Compares every contact with the oracle: the same corners, each coordinate the nearest number, in
/// the promised order and direction.
fn check(scene: &Scene, pairs: &Pairs, most: usize, seen: &mut Seen) {
    let bodies: Vec<BodyId> = scene.bodies().map(|(id, _)| id).collect();
    let contacts = contacts_of(scene, pairs);
    assert_eq!(contacts.len(), pairs.len());
    let step = pairs.len().div_ceil(most).max(1);
    for (ix, [body_a, a, body_b, b]) in pairs.rows().enumerate().step_by(step) {
        let triangles =
            [(body_a, a), (body_b, b)].map(|(body, face)| corners_of(scene, &bodies, body, face));
        let single = [body_a, body_b].iter().all(|&body| {
            let body = scene.body(bodies[body as usize]).unwrap();
            matches!(body.positions(), Positions::F32(_))
        });
        let scale = Scale::of(triangles.as_flattened().as_flattened().iter().copied());
        let [whole_a, whole_b] = triangles.map(|t| t.map(|point| scale.point(point)));
        let expected = oracle::corners(&whole_a, &whole_b);
        let found: Vec<[f64; 3]> = contacts
            .corners(ix)
            .iter()
            .map(|&point| contacts.points()[point as usize])
            .collect();
        assert_eq!(found.len(), expected.len(), "{triangles:?}: {found:?}");
        let exact: Vec<&Rational> = found
            .iter()
            .map(|point| {
                expected
                    .iter()
                    .find(|corner| {
                        (0..3).all(|k| {
                            let Rational {
                                numerators,
                                denominator,
                            } = corner;
                            oracle::is_nearest(scale, point[k], &numerators[k], denominator, single)
                        })
                    })
                    .unwrap_or_else(|| panic!("{triangles:?}: {point:?} is no corner"))
            })
            .collect();
        let normals = [oracle::normal(&whole_a), oracle::normal(&whole_b)];
        let product = oracle::cross(&normals[0], &normals[1]);
        let zero = |v: &[IBig; 3]| v.iter().all(|x| *x == IBig::ZERO);
        match contacts.shape(ix) {
            Shape::Point => {
                assert_eq!(found.len(), 1);
                seen.points += 1;
            }
            Shape::Segment => {
                assert_eq!(found.len(), 2);
                assert_eq!(contacts.is_directed(ix), !zero(&product), "{triangles:?}");
                seen.segments += 1;
                if contacts.is_directed(ix) && !oracle::equal(exact[0], exact[1]) {
                    let along = oracle::between(exact[0], exact[1]);
                    assert!(oracle::dot(&along, &product) > IBig::ZERO, "{triangles:?}");
                    seen.directed += 1;
                }
            }
            Shape::Polygon => {
                let n = found.len();
                seen.polygons[n] += 1;
                for k in 0..n {
                    let [p, q, r] = [k, (k + 1) % n, (k + 2) % n].map(|k| exact[k]);
                    let turn = oracle::cross(&oracle::between(p, q), &oracle::between(q, r));
                    assert!(
                        oracle::dot(&turn, &normals[0]) > IBig::ZERO,
                        "{triangles:?}"
                    );
                }
            }
            shape => panic!("{triangles:?}: {shape:?}"),
        }
    }
}

fn two(a: &Model, b: &Model, double: bool) -> (Scene, Pairs) {
    let mut scene = Scene::new();
    let ids = [a, b].map(|model| {
        if double {
            let positions: Positions = model.positions_f64().into();
            scene.add((model.elements.clone(), positions)).unwrap()
        } else {
            scene
                .add((model.elements.clone(), model.positions.clone()))
                .unwrap()
        }
    });
    let pairs = detect(&scene, &Query::between(ids[0], ids[1]));
    (scene, pairs)
}

#[test]
fn lattice_triangles_meet_as_the_oracle_says() {
    let mut seen = Seen::default();
    for (k, most) in [(1, 400), (2, 700), (3, 700), (4, 600), (6, 600)] {
        for double in [false, true] {
            let a = soup::lattice_triangles(60, k, 1);
            let b = soup::lattice_triangles(60, k, 2);
            let (scene, pairs) = two(&a, &b, double);
            check(&scene, &pairs, most, &mut seen);
        }
    }
    assert!(
        seen.points > 100 && seen.segments > 100 && seen.directed > 100,
        "{seen:?}"
    );
    assert!(seen.polygons[3..=4].iter().all(|&n| n > 5), "{seen:?}");
}

/// Coplanar triangles in all positions, up to hexagons; the plane is x + y + z = 0 of the lattice.
#[test]
fn triangles_of_one_plane_meet_in_polygons() {
    let mut random = Random::new(5);
    let mut seen = Seen::default();
    let mut soup = || {
        let mut positions = Vec::new();
        for _ in 0..40 * 3 {
            let [x, y, _] = random.point(-20.0, 20.0).map(f32::round);
            positions.push([x, y, -x - y]);
        }
        let faces: Vec<[u32; 3]> = (0..40).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        Model {
            positions,
            elements: faces.into(),
        }
    };
    let (a, b) = (soup(), soup());
    for double in [false, true] {
        let (scene, pairs) = two(&a, &b, double);
        check(&scene, &pairs, 400, &mut seen);
    }
    assert!(seen.polygons[3..].iter().all(|&n| n > 5), "{seen:?}");
}

#[test]
fn random_triangles_meet_as_the_oracle_says() {
    let mut seen = Seen::default();
    for scale in [1.0f32, 1e-30, 1e20] {
        let a = soup::triangles(500, 0.3, 3).scaled(scale);
        let b = soup::triangles(500, 0.3, 4).scaled(scale);
        for double in [false, true] {
            let (scene, pairs) = two(&a, &b, double);
            check(&scene, &pairs, 300, &mut seen);
        }
    }
    assert!(seen.directed > 500, "{seen:?}");
}

/// Coordinates from one end of the range of doubles to the other.
#[test]
fn triangles_of_any_size_meet_as_the_oracle_says() {
    let mut seen = Seen::default();
    for exponents in [[-1074; 3], [-1070, 0, 900], [1000; 3], [-400, 0, 0]] {
        let mut scene = Scene::new();
        let ids = [1, 2].map(|seed| {
            let model = soup::triangles(60, 0.6, seed);
            let positions: Vec<[f64; 3]> = (model.positions.iter())
                .map(|point| {
                    std::array::from_fn(|k| {
                        // Multiples of 2^-5, so that few bits are lost to the lowest power.
                        let x = f64::from((point[k] * 32.0).round());
                        let half = exponents[k] / 2;
                        x * 2f64.powi(half) * 2f64.powi(exponents[k] - half)
                    })
                })
                .collect();
            scene.add((model.elements, positions)).unwrap()
        });
        let pairs = detect(&scene, &Query::between(ids[0], ids[1]));
        check(&scene, &pairs, 100, &mut seen);
    }
    assert!(seen.directed > 100, "{seen:?}");
}

/// Coordinates of very different sizes: results that cancel almost to zero, often beyond both
/// rounding stages.
#[test]
fn coordinates_that_cancel_are_the_nearest_too() {
    let mut random = Random::new(11);
    let mut seen = Seen::default();
    let mut scene = Scene::new();
    let mut point = || {
        [0, 1, 2].map(|k: i32| {
            let [x, size, _] = random.point(-1.0, 1.0).map(f64::from);
            x * 1.3 * 2f64.powi((size * 60.0) as i32 + k)
        })
    };
    let mut ids = Vec::new();
    for _ in 0..2 {
        let positions: Vec<[f64; 3]> = (0..600).map(|_| point()).collect();
        let faces: Vec<[u32; 3]> = (0..200).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        ids.push(scene.add_triangles(&faces, &positions).unwrap());
    }
    let pairs = detect(&scene, &Query::between(ids[0], ids[1]));
    check(&scene, &pairs, 800, &mut seen);
    assert!(seen.directed > 300, "{seen:?}");
}
