//! Distances of bodies: compared with every pair of elements, and their properties.

use impinge_core::proximity::Nearest;
use impinge_core::{Backend, BodyId, Detector, Filter, PairKind, Query, Scene, Settings};
use impinge_scenes::{Model, Random, adversarial, solids, soup, surfaces};
use impinge_tests::times_power;

fn scene(a: &Model, b: &Model) -> (Scene, [BodyId; 2]) {
    let mut scene = Scene::new();
    let ids = [a, b].map(|model| model.add_to(&mut scene).unwrap());
    (scene, ids)
}

fn cpu() -> Detector {
    Detector::new(Backend::Cpu).unwrap()
}

fn elements_of(nearest: &Nearest) -> [u32; 2] {
    [nearest.a.element, nearest.b.element]
}

fn nearest(a: &Model, b: &Model) -> Nearest {
    let (scene, [a, b]) = scene(a, b);
    cpu().distance(&scene, a, b).unwrap().unwrap()
}

/// One element of a model as a model.
fn alone(model: &Model, element: usize) -> Model {
    let corners = model.elements.corners(element);
    let positions = corners
        .iter()
        .map(|&v| model.positions[v as usize])
        .collect();
    Model {
        positions,
        elements: match corners.len() {
            3 => vec![[0u32, 1, 2]].into(),
            _ => vec![[0u32, 1, 2, 3]].into(),
        },
    }
}

/// The search finds the same as comparing all pairs one by one: the same distance to the last bit,
/// and the lowest pair that has it.
#[test]
fn the_search_loses_nothing() {
    let far = [2.0, 0.3, 0.1];
    for (a, b) in [
        (
            soup::triangles(30, 0.3, 1),
            soup::triangles(40, 0.3, 2).translated([1.5, 0.2, 0.1]),
        ),
        // A lattice has many pairs at the least distance.
        (
            soup::lattice_triangles(30, 2, 1),
            soup::lattice_triangles(30, 2, 2).translated([4.0, 0.0, 0.0]),
        ),
        (
            soup::tetrahedra(20, 0.3, 3),
            soup::triangles(30, 0.3, 4).translated(far),
        ),
        (
            surfaces::cube([0.0; 3], 1.0),
            surfaces::cube([2.0, 0.0, 0.0], 1.0),
        ),
        (soup::triangles(30, 0.5, 5), soup::triangles(30, 0.5, 6)),
    ] {
        let found = nearest(&a, &b);
        let mut least = (f64::INFINITY, [0, 0]);
        for i in 0..a.elements.len() {
            for j in 0..b.elements.len() {
                let pair = nearest(&alone(&a, i), &alone(&b, j)).distance;
                if pair < least.0 {
                    least = (pair, [i as u32, j as u32]);
                }
            }
        }
        assert_eq!((found.distance, elements_of(&found)), least);
    }
}

/// Two sheets of triangles over a square, one over the other, turned about an axis that is no
/// coordinate axis and stored in `f64`: hundreds of pairs whose distances differ by rounding alone.
fn turned_sheets(n: u32, turned: bool) -> (Scene, [BodyId; 2]) {
    let faces: Vec<[u32; 3]> = (0..n * n)
        .flat_map(|cell| {
            let at = cell / n * (n + 1) + cell % n;
            [[at, at + 1, at + n + 1], [at + 1, at + n + 2, at + n + 1]]
        })
        .collect();
    let (sin, cos) = if turned {
        0.7_f64.sin_cos()
    } else {
        (0.0, 1.0)
    };
    let mut scene = Scene::new();
    let ids = [0.0, 0.3].map(|height| {
        let points: Vec<[f64; 3]> = (0..(n + 1) * (n + 1))
            .map(|ix| {
                let [x, y] = [ix % (n + 1), ix / (n + 1)].map(|k| f64::from(k) * 0.1);
                let (x, z) = (cos * x - sin * height, sin * x + cos * height);
                [x, cos * y - sin * z, sin * y + cos * z]
            })
            .collect();
        scene.add_triangles(&faces, &points).unwrap()
    });
    (scene, ids)
}

/// The distance is the least of those that `near` gives to pairs of faces, to the last bit, and
/// the pair is the lowest that has it. Those of `near` are the largest floats that are not above
/// the true distances: `impinge-exact` tests that against fractions.
#[test]
fn distances_are_those_of_near() {
    let needles = |seed| {
        let mut model = soup::triangles(30, 0.3, seed);
        for corners in model.positions.chunks_exact_mut(3) {
            corners[2] = std::array::from_fn(|k| 0.999 * corners[0][k] + 0.001 * corners[1][k]);
        }
        model
    };
    let models = |a: Model, b: Model| scene(&a, &b);
    let aside = [1.5, 0.2, 0.1];
    let mut n_tied = 0;
    for (scene, [a, b]) in [
        turned_sheets(9, true),
        turned_sheets(9, false),
        models(needles(3), needles(4).translated(aside)),
        models(
            soup::triangles(40, 0.3, 1),
            soup::triangles(40, 0.3, 2).translated(aside),
        ),
        models(
            soup::lattice_triangles(30, 2, 1),
            soup::lattice_triangles(30, 2, 2).translated([4.0, 1.0, 0.0]),
        ),
        models(
            surfaces::bumpy_ball(800, 0.2),
            surfaces::ball(600).translated([-1.7, 1.8, 0.9]),
        ),
    ] {
        for threads in [1, 2] {
            let settings = Settings::new().backend(Backend::Cpu).threads(threads);
            let mut detector = Detector::new(settings).unwrap();
            let nearest = detector.distance(&scene, a, b).unwrap().unwrap();
            assert!(nearest.distance > 0.0);
            let query = Query::between(a, b).kinds([PairKind::FaceFace]).distances();
            let most = nearest.distance * (1.0 + 1e-9);
            let near = detector.near(&scene, most, &query).unwrap();
            let mut least = (f64::INFINITY, [0, 0]);
            for pair in &near {
                let distance = pair.distance.unwrap();
                n_tied += usize::from(distance == nearest.distance);
                let found = (distance, [pair.a.element, pair.b.element]);
                if found.0 < least.0 || (found.0 == least.0 && found.1 < least.1) {
                    least = found;
                }
            }
            assert_eq!((nearest.distance, elements_of(&nearest)), least);
            // Of many bodies the same.
            let of_many = detector.nearest(&scene, &Query::between_all()).unwrap();
            assert_eq!(of_many, Some(nearest));
        }
    }
    assert!(n_tied > 100, "{n_tied}");
}

/// Bodies of any size: the distance scales with them, and is never 0 between bodies that do not
/// meet.
#[test]
fn distances_of_numbers_of_any_size() {
    let of = |a: &Model, b: &Model, exponents: [i32; 3]| {
        let mut scene = Scene::new();
        let ids = [a, b].map(|model| {
            let points = model.positions.iter().map(|point| {
                let point = point.map(|x| f64::from((x * 1024.0).round()));
                std::array::from_fn(|k| times_power(point[k], exponents[k]))
            });
            let points: Vec<[f64; 3]> = points.collect();
            scene.add((model.elements.clone(), points)).unwrap()
        });
        cpu().distance(&scene, ids[0], ids[1]).unwrap().unwrap()
    };
    let a = soup::triangles(30, 0.3, 1);
    for b in [
        soup::triangles(40, 0.3, 2).translated([1.5, 0.2, 0.1]),
        soup::triangles(40, 0.3, 2),
    ] {
        let plain = of(&a, &b, [0; 3]);
        for exponent in [-1074, -600, -130, 120, 500, 1000] {
            let scaled = of(&a, &b, [exponent; 3]);
            assert_eq!(elements_of(&scaled), elements_of(&plain), "{exponent}");
            let expected = match exponent {
                // A multiple of the smallest number, rounded down.
                -1074 => f64::from_bits(plain.distance as u64),
                _ => times_power(plain.distance, exponent),
            };
            assert_eq!(scaled.distance, expected, "{exponent}");
        }
        // Along x, everything is as good as at one place.
        let flat = of(&a, &b, [-1074, 0, 0]);
        let huge = of(&a, &b, [0, 0, 1000]);
        assert_eq!(flat.distance > 0.0, flat.points[0] != flat.points[1]);
        assert!(huge.distance.is_finite());
    }
    // Two points that are as near as numbers can tell, beside others far away.
    let mut scene = Scene::new();
    let least = f64::from_bits(1);
    let ids = [0.0, least].map(|x| {
        scene
            .add_triangles(
                &[[0, 1, 2]],
                &[[x, 0.0, 0.0], [x, 1e300, 0.0], [x, 0.0, 1e300]],
            )
            .unwrap()
    });
    let nearest = cpu().distance(&scene, ids[0], ids[1]).unwrap();
    let distance = nearest.unwrap().distance;
    assert!(distance > 0.0 && distance < 1e290, "{distance:e}");
}

/// The box of each element.
fn boxes(model: &Model) -> Vec<[[f32; 3]; 2]> {
    let elements = 0..model.elements.len();
    elements
        .map(|element| {
            let corners = model.elements.corners(element);
            let along = |k: usize| corners.iter().map(move |&v| model.positions[v as usize][k]);
            [
                [0, 1, 2].map(|k| along(k).fold(f32::INFINITY, f32::min)),
                [0, 1, 2].map(|k| along(k).fold(f32::NEG_INFINITY, f32::max)),
            ]
        })
        .collect()
}

/// The same of bodies of many clusters that face each other askew, so that most are discarded along
/// the shortest way. All pairs are compared whose boxes are not farther apart than the answer.
#[test]
fn the_search_through_many_clusters_loses_nothing() {
    let wall = surfaces::cloth(12, 12, 0.125);
    // The same wall farther away, askew: equal numbers in all rows, so many pairs are at the same
    // distance.
    let askew = |model: &Model, by: f32| Model {
        positions: model
            .positions
            .iter()
            .map(|&[x, y, z]| [x, y, z + 0.5 * x + 0.25 * y + by])
            .collect(),
        elements: model.elements.clone(),
    };
    for (a, b) in [
        (
            surfaces::ball(700),
            surfaces::ball(900).translated([1.4, 1.3, 1.1]),
        ),
        (
            surfaces::bumpy_ball(800, 0.2),
            surfaces::ball(600).translated([-1.7, 1.8, 0.9]),
        ),
        (askew(&wall, 0.0), askew(&wall, 0.5)),
        (
            askew(&wall, 0.0),
            surfaces::ball(500).translated([0.4, 0.6, 2.0]),
        ),
        (
            soup::tetrahedra(200, 0.2, 7),
            soup::triangles(300, 0.2, 8).translated([1.5, 1.4, 1.1]),
        ),
    ] {
        let found = nearest(&a, &b);
        assert!(found.distance > 0.0, "{found:?}");
        let boxes = [boxes(&a), boxes(&b)];
        let (mut least, mut n_compared) = ((f64::INFINITY, [0, 0]), 0);
        for (i, [low, high]) in boxes[0].iter().enumerate() {
            for (j, [other_low, other_high]) in boxes[1].iter().enumerate() {
                let squared: f64 = (0..3)
                    .map(|k| {
                        f64::from(
                            (other_low[k] - high[k])
                                .max(low[k] - other_high[k])
                                .max(0.0),
                        )
                    })
                    .map(|gap| gap * gap)
                    .sum();
                if squared.sqrt() > found.distance + 1e-5 {
                    continue;
                }
                n_compared += 1;
                let pair = nearest(&alone(&a, i), &alone(&b, j)).distance;
                if pair < least.0 {
                    least = (pair, [i as u32, j as u32]);
                }
            }
        }
        assert_eq!((found.distance, elements_of(&found)), least);
        assert!(n_compared > 1);
    }
}

#[test]
fn known_distances() {
    let ball = surfaces::icosphere(4);
    let found = nearest(&ball, &ball.translated([3.0, 0.0, 0.0]));
    assert!((found.distance - 2.0).abs() < 5e-3, "{found:?}");
    let [p, q] = found.points;
    assert!((q[0] - p[0] - found.distance).abs() < 1e-3);
    // A body inside a solid has distance 0 from it, but not from a surface.
    let small = surfaces::ball(100).scaled(0.1);
    assert_eq!(
        nearest(
            &solids::solid_cube(500),
            &small.translated([0.01, 0.02, 0.03])
        )
        .distance,
        0.0
    );
    let inside = nearest(&surfaces::cube([0.0; 3], 1.0), &small);
    assert!((inside.distance - 0.45).abs() < 1e-2, "{inside:?}");
    // With the bodies swapped.
    let back = nearest(&ball.translated([3.0, 0.0, 0.0]), &ball);
    assert!((back.distance - found.distance).abs() < 1e-12);
}

/// Whether a point is on elements of bodies, but for rounding.
fn is_on(point: [f64; 3], scene: &Scene, elements: [(BodyId, u32); 2]) -> bool {
    elements.iter().all(|&(id, element)| {
        let body = scene.body(id).unwrap();
        let vertices = body.elements().corners(element as usize);
        let at = |&vertex: &u32| body.positions().point(vertex as usize);
        let corners: Vec<[f64; 3]> = vertices.iter().map(at).collect();
        let mut alone = Scene::new();
        let element = match corners.len() {
            4 => alone.add_tetrahedra(&[[0, 1, 2, 3]], &corners).unwrap(),
            _ => alone.add_triangles(&[[0, 1, 2]], &corners).unwrap(),
        };
        let point = alone.add_points(&[point]).unwrap();
        let nearest = cpu().distance(&alone, element, point).unwrap().unwrap();
        nearest.distance < 1e-5
    })
}

/// The distance is zero if and only if the detector finds a pair; the pair is then one of the
/// detector's.
#[test]
fn zero_means_that_they_touch() {
    let a = surfaces::bumpy_ball(1_500, 0.2);
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut distances = cpu();
    let (mut scene, [x, y]) = scene(&a, &a);
    let (mut n_touching, mut n_apart, mut n_shared) = (0, 0, 0);
    for step in 0..40 {
        let moved = a.translated([0.8 + 0.01 * step as f32, 0.03, 0.01]);
        scene.set_positions(y, &moved.positions).unwrap();
        let first = detector
            .detect(&scene, &Query::between(x, y))
            .unwrap()
            .rows()
            .next();
        let found = distances.distance(&scene, x, y).unwrap().unwrap();
        match first {
            Some([_, a, _, b]) => {
                assert_eq!((found.distance, elements_of(&found)), (0.0, [a, b]));
                assert_eq!(found.points[0], found.points[1]);
                n_shared += usize::from(is_on(found.points[0], &scene, [(x, a), (y, b)]));
                n_touching += 1;
            }
            None => {
                assert!(found.distance > 0.0 && found.points[0] != found.points[1]);
                n_apart += 1;
            }
        }
    }
    assert!(n_touching > 5 && n_apart > 5, "{n_touching} {n_apart}");
    assert_eq!(n_shared, n_touching);
    // Apart by the smallest possible gap.
    let cube = surfaces::cube([0.0; 3], 1.0);
    let beside = cube.mapped(|[x, y, z]| [x + 1.0, y, z]);
    assert_eq!(nearest(&cube, &beside).distance, 0.0);
    let apart = beside.mapped(|[x, y, z]| [x.next_up(), y, z]);
    assert_eq!(
        nearest(&cube, &apart).distance,
        f64::from(0.5f32.next_up()) - 0.5
    );
}

#[test]
fn bodies_without_elements_and_wrong_questions() {
    let mut scene = Scene::new();
    let empty = scene.add_triangles::<f32>(&[], &[]).unwrap();
    let ball = surfaces::ball(20).add_to(&mut scene).unwrap();
    let mut distances = cpu();
    assert_eq!(distances.distance(&scene, empty, ball).unwrap(), None);
    assert!(distances.distance(&scene, ball, ball).is_err());
    scene.positions_mut::<f32>(ball).unwrap()[3] = [f32::NAN; 3];
    let error = distances
        .distance(&scene, ball, empty)
        .unwrap_err()
        .to_string();
    assert!(error.starts_with("body 1: vertex 3"), "{error}");
    scene.remove(ball).unwrap();
    assert!(distances.distance(&scene, ball, empty).is_err());
}

/// A detector that has answered before says the same as one that has not, whatever has happened to
/// the scene meanwhile.
#[test]
fn earlier_calls_change_nothing() {
    let ball = surfaces::bumpy_ball(3_000, 0.2);
    let (mut scene, [a, mut b]) = scene(&ball, &surfaces::bumpy_ball(2_000, 0.1));
    let mut kept = Detector::new(Backend::Cpu).unwrap();
    let (mut n_touching, mut n_pairs) = (0, std::collections::BTreeSet::new());
    for step in 0..60 {
        let turn = 0.1 * step as f32;
        let (sin, cos) = turn.sin_cos();
        let away = 0.95 + 0.35 * (3.0 * turn).sin();
        let moved = ball.mapped(|[x, y, z]| {
            let wave = 1.0 + 0.05 * (5.0 * y + turn).sin();
            [away * sin + wave * x, away * cos + 0.8 * z, wave * y]
        });
        scene.set_positions(a, &moved.positions).unwrap();
        if step == 20 {
            // Another body in the same slot, with fewer triangles.
            scene.remove(b).unwrap();
            b = surfaces::ball(100).add_to(&mut scene).unwrap();
        }
        for (x, y) in [(a, b), (b, a)] {
            let found = kept.distance(&scene, x, y).unwrap().unwrap();
            let anew = cpu().distance(&scene, x, y).unwrap().unwrap();
            assert_eq!(found, anew, "step {step}");
            n_touching += u32::from(found.distance == 0.0);
            n_pairs.insert(elements_of(&found));
        }
    }
    assert!(
        n_touching > 5 && n_touching < 110 && n_pairs.len() > 20,
        "{n_touching}"
    );
    assert!(kept.distance(&scene, a, a).is_err());
}

/// Positions in `f64` whose differences are lost in `f32`: boxes are rounded, distances are not.
#[test]
fn far_from_the_origin_in_double_precision() {
    let ball = surfaces::ball(500);
    let faces: Vec<[u32; 3]> = (0..ball.elements.len())
        .map(|ix| ball.elements.corners(ix).try_into().unwrap())
        .collect();
    let at = |shift: f64, far: f64| -> Vec<[f64; 3]> {
        let points = ball.positions.iter().map(|p| p.map(f64::from));
        points.map(|[x, y, z]| [x + shift + far, y, z]).collect()
    };
    let found = [0.0, 1e8].map(|far| {
        let mut scene = Scene::new();
        let a = scene.add_triangles(&faces, &at(0.0, far)).unwrap();
        let b = scene.add_triangles(&faces, &at(1.25, far)).unwrap();
        cpu().distance(&scene, a, b).unwrap().unwrap()
    });
    assert!(found[0].distance > 0.1);
    assert!(
        (found[0].distance - found[1].distance).abs() < 1e-7,
        "{found:?}"
    );
}

/// Bodies that touch have the lowest pair that does, by the first body's elements and then by the
/// second's, whichever body was added first and however many threads search.
#[test]
fn touching_bodies_have_their_lowest_pair() {
    let parts = adversarial::machine_parts(6_000).unwrap();
    let [a, b] = [0, 1].map(|ix| parts.bodies[ix]);
    let ball = surfaces::ball(3_000);
    let mut scenes = vec![(parts.scene, [a, b])];
    for (a, b) in [
        (ball.clone(), ball.translated([0.3, 0.2, 0.1])),
        (soup::triangles(500, 0.3, 5), soup::triangles(400, 0.3, 6)),
        (
            soup::lattice_triangles(300, 3, 1),
            soup::lattice_triangles(300, 3, 2),
        ),
        (solids::solid_cube(1_000), soup::triangles(300, 0.5, 7)),
    ] {
        let (scene, bodies) = scene(&a, &b);
        scenes.push((scene, bodies));
    }
    for (scene, [a, b]) in scenes {
        for threads in [1, 2] {
            let mut detector =
                Detector::new(Settings::new().backend(Backend::Cpu).threads(threads)).unwrap();
            for [first, second] in [[a, b], [b, a]] {
                let pairs = detector.detect(&scene, &Query::between(a, b)).unwrap();
                let lowest = pairs.between(first, second).min().expect("they meet");
                let nearest = detector.distance(&scene, first, second).unwrap().unwrap();
                assert_eq!(nearest.distance, 0.0);
                assert_eq!(elements_of(&nearest), lowest);
                assert_eq!(nearest.points[0], nearest.points[1]);
                let elements = [(first, lowest[0]), (second, lowest[1])];
                assert!(is_on(nearest.points[0], &scene, elements), "{nearest:?}");
                // The nearest two of many search as two do.
                let query = Query::between(first, second);
                let of_many = detector.nearest(&scene, &query).unwrap().unwrap();
                let ordered = detector.distance(&scene, of_many.a.body, of_many.b.body);
                assert_eq!(Some(of_many), ordered.unwrap());
            }
        }
    }
}

/// A distance above the largest float is that, rounded down; of several, the lowest pair's.
#[test]
fn distances_above_the_largest_float() {
    for x in [8e307, 9e307, 1e308, f64::MAX] {
        let mut scene = Scene::new();
        let points = [[x, 0.0, 0.0], [x, x, 0.0]];
        let a = scene.add_points(&points).unwrap();
        let b = scene
            .add_points(&points.map(|point| point.map(|x| -x)))
            .unwrap();
        let mut detector = Detector::new(Backend::Cpu).unwrap();
        let found = detector
            .distance(&scene, a, b)
            .unwrap()
            .expect("a distance");
        let (distance, pair) = match x {
            8e307 => (1.6e308, [0, 0]),
            _ => (f64::MAX, [0, 0]),
        };
        assert_eq!(
            (found.distance, elements_of(&found)),
            (distance, pair),
            "{x}"
        );
        let nearest = detector.nearest(&scene, &Query::between_all()).unwrap();
        assert_eq!(nearest, Some(found), "{x}");
    }
}

/// Of a hundred bodies, where few are named or the filters of few say so: as asked one by one.
#[test]
fn nearest_of_few_named_bodies_as_asked_one_by_one() {
    let mut random = Random::new(5);
    let mut scene = Scene::new();
    let face = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut at = || [(); 3].map(|()| random.below(24) as f32 / 2.0);
    let placed = |at: [f32; 3]| face.map(|point| [0, 1, 2].map(|k| point[k] + at[k]));
    let ids: Vec<BodyId> = (0..100)
        .map(|_| scene.add_triangles(&[[0, 1, 2]], &placed(at())).unwrap())
        .collect();
    let mut detector = cpu();
    for round in 0..30 {
        let named = [
            vec![ids[3]],
            vec![ids[50], ids[7]],
            vec![ids[99], ids[0], ids[41]],
        ];
        let named = &named[round % 3];
        let is_named = |id: BodyId| named.contains(&id);
        for &id in named {
            scene.set_positions(id, placed(at()).to_vec()).unwrap();
        }
        let (category, mask) = (2, 1);
        for &id in &ids {
            let filter = match is_named(id) {
                true => Filter { category, mask },
                false => Filter {
                    category: 1,
                    mask: 2,
                },
            };
            scene.set_filter(id, filter).unwrap();
        }
        let pairs = ids.iter().enumerate().flat_map(|(ix, &a)| {
            let later = ids[ix + 1..].iter();
            later.map(move |&b| [a, b])
        });
        let wanted = pairs.filter(|pair| is_named(pair[0]) != is_named(pair[1]));
        let (mut least, mut expected) = (f64::INFINITY, None);
        for [a, b] in wanted {
            let found = detector.distance(&scene, a, b).unwrap().unwrap();
            if found.distance < least {
                (least, expected) = (found.distance, Some(found));
            }
        }
        for query in [Query::across(named.iter().copied()), Query::between_all()] {
            assert_eq!(
                detector.nearest(&scene, &query).unwrap(),
                expected,
                "{round}"
            );
            assert_eq!(
                detector.any(&scene, &query).unwrap(),
                least == 0.0,
                "{round}"
            );
        }
    }
}
