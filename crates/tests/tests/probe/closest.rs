//! `closest`: which element is nearest, where, and how far.

use crate::elements;
use crate::oracle::{self, Fraction, Vector};
use impinge_core::exact::Feature;
use impinge_core::{
    Backend, CancelToken, Closest, Control, Detector, Elements, Error, Exclusion, PairFilter,
    Query, Scene,
};
use impinge_scenes::{Model, Random, solids, soup, surfaces};

/// Holds an answer against exact distances from all elements.
fn check(scene: &Scene, points: &[[f64; 3]], most: f64, closest: &Closest) {
    let elements = elements(scene);
    let exact: Vec<Vec<Vector>> = elements
        .iter()
        .map(|(.., corners)| corners.iter().map(|&point| oracle::vector(point)).collect())
        .collect();
    assert_eq!(closest.len(), points.len());
    for (point, found) in points.iter().zip(closest) {
        let whole = oracle::vector(*point);
        let mut least: Option<(Fraction, usize)> = None;
        for (ix, corners) in exact.iter().enumerate() {
            let square = oracle::squared_distance(&whole, corners);
            if least
                .as_ref()
                .is_none_or(|(best, _)| square.compare(best).is_lt())
            {
                least = Some((square, ix));
            }
        }
        let least =
            least.filter(|(square, _)| most == f64::INFINITY || square.compare_root(most).is_le());
        let Some((square, ix)) = least else {
            assert_eq!(found, None, "{point:?}");
            continue;
        };
        let found = found.unwrap_or_else(|| panic!("nothing is near {point:?}"));
        let (body, element, corners) = &elements[ix];
        assert_eq!(
            (found.element.body, found.element.element),
            (*body, *element),
            "{point:?}"
        );
        // Rounded down to the next float.
        let (below, above) = (found.distance, found.distance.next_up());
        if below == 0.0 {
            assert_eq!(square.0, 0.into(), "{point:?} {found:?}");
        } else {
            assert!(square.compare_root(below).is_ge(), "{point:?} {found:?}");
            assert!(square.compare_root(above).is_lt(), "{point:?} {found:?}");
        }
        let gap = [0, 1, 2].map(|k| found.point[k] - point[k]);
        let size = point
            .iter()
            .chain(corners.iter().flatten())
            .fold(1.0, |x: f64, y| x.max(y.abs()));
        let length = gap.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(
            (length - found.distance).abs() < 1e-14 * size,
            "{point:?} {found:?}"
        );
        // The feature holds the nearest point, and no smaller one does.
        let feature: Vec<Vector> = match found.feature {
            Feature::Vertex(k) => vec![exact[ix][usize::from(k)].clone()],
            Feature::Edge(k) => {
                let k = usize::from(k);
                vec![
                    exact[ix][k].clone(),
                    exact[ix][(k + 1) % corners.len()].clone(),
                ]
            }
            Feature::Face => exact[ix].clone(),
        };
        assert!(
            oracle::squared_distance(&whole, &feature)
                .compare(&square)
                .is_eq()
        );
        for left_out in 0..feature.len() {
            let mut smaller = feature.clone();
            smaller.remove(left_out);
            if !smaller.is_empty() {
                let other = oracle::squared_distance(&whole, &smaller);
                assert!(other.compare(&square).is_gt(), "{point:?} {found:?}");
            }
        }
    }
}

/// Holds the several nearest elements of each point against exact distances from all elements.
fn check_many(scene: &Scene, points: &[[f64; 3]], most: f64, closest: &Closest) {
    let elements = elements(scene);
    let exact: Vec<Vec<Vector>> = elements
        .iter()
        .map(|(.., corners)| corners.iter().map(|&point| oracle::vector(point)).collect())
        .collect();
    let n_nearest = closest.n_nearest();
    assert_eq!(closest.len(), points.len());
    assert_eq!(closest.rows().len(), points.len() * n_nearest);
    for (ix, point) in points.iter().enumerate() {
        let whole = oracle::vector(*point);
        let mut all: Vec<(Fraction, usize)> = exact
            .iter()
            .map(|corners| oracle::squared_distance(&whole, corners))
            .zip(0..)
            .filter(|(square, _)| most == f64::INFINITY || square.compare_root(most).is_le())
            .collect();
        // Equally near ones stay in their order.
        all.sort_by(|x, y| x.0.compare(&y.0));
        all.truncate(n_nearest);
        let found: Vec<_> = closest.of(ix).collect();
        let names = found.iter().map(|at| (at.element.body, at.element.element));
        let names: Vec<_> = names.collect();
        let expected = all.iter().map(|&(_, ix)| (elements[ix].0, elements[ix].1));
        let expected: Vec<_> = expected.collect();
        assert_eq!(names, expected, "{point:?}, the nearest {n_nearest}");
        for (at, (square, _)) in found.iter().zip(&all) {
            if at.distance == 0.0 {
                assert_eq!(square.0, 0.into(), "{point:?} {at:?}");
            } else {
                assert!(square.compare_root(at.distance).is_ge());
                assert!(square.compare_root(at.distance.next_up()).is_lt());
            }
        }
        let rows = || closest.iter().skip(ix * n_nearest).take(n_nearest);
        assert_eq!(closest.get(ix), found.first().copied());
        assert!(rows().flatten().eq(found.iter().copied()));
        assert!(rows().skip(found.len()).all(|row| row.is_none()));
    }
    assert_eq!(closest.of(points.len()).count(), 0);
}

fn lattice(n: i32) -> Vec<[f64; 3]> {
    let line = move || (-1..=2 * n + 1).map(|x| f64::from(x) / 2.0);
    let mut points = Vec::new();
    for x in line() {
        for y in line() {
            points.extend(line().map(|z| [x, y, z]));
        }
    }
    points
}

fn cpu() -> Detector {
    Detector::new(Backend::Cpu).unwrap()
}

/// On a lattice most points have several nearest elements, and many elements are segments or
/// points.
#[test]
fn lattices() {
    for seed in 0..4 {
        let mut scene = Scene::new();
        soup::lattice_triangles(25, 2, seed)
            .add_to(&mut scene)
            .unwrap();
        soup::lattice_triangles(25, 2, seed + 10)
            .add_to(&mut scene)
            .unwrap();
        let points = lattice(2);
        for most in [f64::INFINITY, 0.5, 0.0] {
            let closest = cpu().closest(&scene, &points, most, &Query::all()).unwrap();
            check(&scene, &points, most, &closest);
        }
    }
}

/// Where single precision moves corners or points farther than elements are apart.
#[test]
fn far_from_the_origin() {
    let mut random = Random::new(16);
    let around = [1e4 + 1.0 / 3.0, -2e4 - 1.0 / 7.0, 3e4 + 0.1];
    for (size, double) in [(1e-3, true), (1.0, false)] {
        let mut place = |[x, y, z]: [f64; 3]| {
            [
                around[0] + size * x,
                around[1] + size * y,
                around[2] + size * z,
            ]
        };
        let faces: Vec<[u32; 3]> = (0..150)
            .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
            .collect();
        let corners: Vec<[f64; 3]> = soup::triangles(150, 0.3, 17)
            .positions_f64()
            .into_iter()
            .map(&mut place)
            .collect();
        let mut scene = Scene::new();
        match double {
            true => scene.add_triangles(&faces, &corners).unwrap(),
            false => {
                let corners: Vec<_> = corners.iter().map(|x| x.map(|x| x as f32)).collect();
                scene.add_triangles(&faces, &corners).unwrap()
            }
        };
        let mut points: Vec<[f64; 3]> = (0..80)
            .map(|_| place(random.point(0.0, 1.0).map(f64::from)))
            .collect();
        // Some that are not moved, where corners are.
        points.extend(
            points
                .clone()
                .iter()
                .map(|x| x.map(|x| f64::from(x as f32))),
        );
        let closest = cpu()
            .closest(&scene, &points, f64::INFINITY, &Query::all())
            .unwrap();
        check(&scene, &points, f64::INFINITY, &closest);
    }
}

/// Where most points have several elements at one distance, and few have as many as are asked for.
#[test]
fn several_nearest_on_lattices() {
    for seed in 0..2 {
        let mut scene = Scene::new();
        for seed in [seed, seed + 10] {
            soup::lattice_triangles(25, 2, seed)
                .add_to(&mut scene)
                .unwrap();
        }
        let points = lattice(2);
        let mut detector = cpu();
        for (n_nearest, most) in [
            (2, f64::INFINITY),
            (7, f64::INFINITY),
            (7, 0.5),
            (3, 0.0),
            (49, f64::INFINITY),
            (60, f64::INFINITY),
            (60, 1.0),
        ] {
            let query = Query::all().n_nearest(n_nearest);
            let closest = detector.closest(&scene, &points, most, &query).unwrap();
            check_many(&scene, &points, most, &closest);
        }
    }
}

/// Clusters that are passed over, and bodies of other kinds.
#[test]
fn several_nearest_of_meshes_and_soups() {
    let mut random = Random::new(15);
    let mut scene = Scene::new();
    surfaces::icosphere(2).add_to(&mut scene).unwrap();
    soup::triangles(200, 0.3, 7)
        .translated([1.5, 0.0, 0.0])
        .add_to(&mut scene)
        .unwrap();
    solids::block(2, 2, 2, 0.5).add_to(&mut scene).unwrap();
    let dots: Vec<[f64; 3]> = (0..30)
        .map(|_| random.point(-1.0, 2.0).map(f64::from))
        .collect();
    scene.add_points(&dots).unwrap();
    let mut points: Vec<[f64; 3]> = (0..60)
        .map(|_| random.point(-2.0, 3.0).map(f64::from))
        .collect();
    // All faces are about as far from the middle; several share a vertex.
    points.extend([[0.0; 3], [1e-9, 0.0, 0.0], [1e6, 2.0, 3.0]]);
    points.extend(surfaces::icosphere(0).positions_f64());
    let mut detector = cpu();
    for (n_nearest, most) in [
        (2, f64::INFINITY),
        (9, f64::INFINITY),
        (40, 0.5),
        (300, 2.0),
    ] {
        let query = Query::all().n_nearest(n_nearest);
        let closest = detector.closest(&scene, &points, most, &query).unwrap();
        check_many(&scene, &points, most, &closest);
    }
    // The first of several is the nearest, and one is asked for if nothing is said.
    let one = detector
        .closest(&scene, &points, f64::INFINITY, &Query::all())
        .unwrap();
    let query = Query::all().n_nearest(5);
    let five = detector
        .closest(&scene, &points, f64::INFINITY, &query)
        .unwrap();
    assert_eq!((one.n_nearest(), five.n_nearest()), (1, 5));
    assert_ne!(query, Query::all());
    for ix in 0..points.len() {
        assert_eq!(one.get(ix), five.get(ix));
        assert!(one.of(ix).eq(five.of(ix).take(1)));
    }
}

/// The same bytes for every instruction set, number of threads and order of the points.
#[test]
fn several_nearest_are_the_same_in_every_way() {
    let mut random = Random::new(19);
    let mut scene = Scene::new();
    surfaces::torus_knot(5000, surfaces::Knot::default())
        .add_to(&mut scene)
        .unwrap();
    let points: Vec<[f32; 3]> = (0..1000).map(|_| random.point(-0.5, 0.5)).collect();
    let reversed: Vec<[f32; 3]> = points.iter().rev().copied().collect();
    let query = Query::all().n_nearest(6);
    let mut first: Option<Closest> = None;
    for (_, mut detector) in crate::detectors() {
        let mut ask = |points: &[[f32; 3]]| {
            detector
                .closest(&scene, points, f64::INFINITY, &query)
                .unwrap()
        };
        let closest = ask(&points);
        let backwards = ask(&reversed);
        let last = points.len() - 1;
        assert!((0..=last).all(|ix| closest.of(ix).eq(backwards.of(last - ix))));
        let first = first.get_or_insert_with(|| closest.clone());
        assert!(first.iter().eq(closest.iter()));
        assert_eq!(first.hash(), closest.hash());
    }
}

/// How far away an element may be is compared exactly: the diagonal of a square is longer than the
/// float below it.
#[test]
fn the_largest_distance_is_exact() {
    let mut scene = Scene::new();
    scene.add_points(&[[0.0f64; 3]]).unwrap();
    let below = 2f64.sqrt().next_down();
    assert!(below * below < 2.0);
    for (most, is_found) in [(below, false), (below.next_up(), true), (1.0, false)] {
        let found = cpu().closest(&scene, &[[1.0, 1.0, 0.0]], most, &Query::all());
        assert_eq!(
            found.unwrap().iter().next().unwrap().is_some(),
            is_found,
            "{most}"
        );
    }
}

#[test]
fn meshes_and_soups() {
    let mut random = Random::new(5);
    let mut scene = Scene::new();
    surfaces::icosphere(2).add_to(&mut scene).unwrap();
    soup::triangles(200, 0.3, 7)
        .translated([1.5, 0.0, 0.0])
        .add_to(&mut scene)
        .unwrap();
    let mut points: Vec<[f64; 3]> = (0..150)
        .map(|_| random.point(-2.0, 3.0).map(f64::from))
        .collect();
    // All faces are about as far from the middle; and vertices are at distance 0.
    points.extend([[0.0; 3], [1e-9, 0.0, 0.0], [1e6, 2.0, 3.0]]);
    points.extend(surfaces::icosphere(1).positions_f64());
    let closest = cpu()
        .closest(&scene, &points, f64::INFINITY, &Query::all())
        .unwrap();
    check(&scene, &points, f64::INFINITY, &closest);
    let closest = cpu().closest(&scene, &points, 0.25, &Query::all()).unwrap();
    check(&scene, &points, 0.25, &closest);
}

/// Bodies without faces have edges or points; tetrahedra have a surface.
#[test]
fn other_kinds() {
    let mut random = Random::new(6);
    let mut scene = Scene::new();
    let block = solids::block(2, 2, 2, 0.5).add_to(&mut scene).unwrap();
    let ends: Vec<[f32; 3]> = (0..40).map(|_| random.point(-1.0, 2.0)).collect();
    let edges: Vec<[u32; 2]> = (0..39).map(|ix| [ix, ix + 1]).collect();
    let rod = scene.add_edges(&edges, &ends).unwrap();
    let dots: Vec<[f64; 3]> = (0..30)
        .map(|_| random.point(-1.0, 2.0).map(f64::from))
        .collect();
    let cloud = scene.add_points(&dots).unwrap();
    let mut points: Vec<[f64; 3]> = (0..150)
        .map(|_| random.point(-2.0, 3.0).map(f64::from))
        .collect();
    points.extend(&dots);
    points.extend((0..60).map(|_| random.point(-0.6, 1.1).map(f64::from)));
    let mut detector = cpu();
    let closest = detector
        .closest(&scene, &points, f64::INFINITY, &Query::all())
        .unwrap();
    check(&scene, &points, f64::INFINITY, &closest);
    for body in [block, rod, cloud] {
        let n = closest
            .iter()
            .flatten()
            .filter(|at| at.element.body == body)
            .count();
        assert!(n > 5, "{n} of body {body}");
        let of_one = detector
            .closest(&scene, &points, f64::INFINITY, &Query::of(body))
            .unwrap();
        assert!(of_one.iter().flatten().all(|at| at.element.body == body));
        for (all, one) in closest.iter().zip(&of_one) {
            let (all, one) = (all.unwrap(), one.unwrap());
            assert!(all.distance <= one.distance);
            assert!(all.element.body != body || all == one);
        }
    }
}

/// The same bytes for every instruction set, number of threads, precision and order of the points,
/// and for bodies that move.
#[test]
fn every_way_gives_the_same_answer() {
    let mut random = Random::new(9);
    let model: Model = surfaces::torus_knot(20_000, surfaces::Knot::default());
    let points: Vec<[f32; 3]> = (0..3000).map(|_| random.point(-0.5, 0.5)).collect();
    let wide: Vec<[f64; 3]> = points.iter().map(|point| point.map(f64::from)).collect();
    let reversed: Vec<[f32; 3]> = points.iter().rev().copied().collect();
    let mut scene = Scene::new();
    let body = model.add_to(&mut scene).unwrap();
    let moved: Vec<[f32; 3]> = model.positions.iter().map(|&[x, y, z]| [y, z, x]).collect();
    let mut first: Option<Closest> = None;
    for (threads, mut detector) in crate::detectors() {
        let query = Query::all();
        let mut ask = |scene: &Scene, points: &[[f32; 3]]| {
            detector
                .closest(scene, points, f64::INFINITY, &query)
                .unwrap()
        };
        let mut moving = scene.clone();
        let closest = ask(&moving, &points);
        assert_eq!(closest.stats().n_threads, threads);
        let backwards = ask(&moving, &reversed);
        assert!(backwards.iter().rev().eq(closest.iter()));
        moving.set_positions(body, &moved).unwrap();
        let turned: Vec<[f32; 3]> = points.iter().map(|&[x, y, z]| [y, z, x]).collect();
        let turned = ask(&moving, &turned);
        assert!(turned.rows().eq(closest.rows()));
        let of_wide = detector
            .closest(&scene, &wide, f64::INFINITY, &query)
            .unwrap();
        assert!(of_wide.iter().eq(closest.iter()));
        let first = first.get_or_insert_with(|| closest.clone());
        assert!(first.iter().eq(closest.iter()));
        assert_eq!(first.hash(), closest.hash());
    }
}

/// The greatest and the smallest numbers.
#[test]
fn numbers_of_any_size() {
    for size in [1e-300, 1e-30, 1e30, 1e150, 1e300] {
        let cube = surfaces::cube([0.0; 3], 2.0);
        let Elements::Triangles(faces) = &cube.elements else {
            panic!("triangles")
        };
        let positions: Vec<[f64; 3]> = cube
            .positions_f64()
            .iter()
            .map(|point| point.map(|x| x * size))
            .collect();
        let mut scene = Scene::new();
        scene.add_triangles(faces, &positions).unwrap();
        let points = [3.0 * size, 1.0 * size, 0.75 * size].map(|x| [x, 0.25 * size, 0.0]);
        let closest = cpu()
            .closest(&scene, &points, f64::INFINITY, &Query::all())
            .unwrap();
        let distances = closest.iter().map(|at| at.unwrap().distance);
        for (distance, expected) in distances.zip([2.0, 0.0, 0.25]) {
            let error = (distance - expected * size).abs();
            assert!(error <= 1e-15 * size, "{distance:e}, {expected} {size:e}");
        }
    }
}

#[test]
fn what_is_refused() {
    let mut detector = cpu();
    let mut scene = Scene::new();
    let a = surfaces::cube([0.0; 3], 1.0).add_to(&mut scene).unwrap();
    let b = surfaces::cube([3.0; 3], 1.0).add_to(&mut scene).unwrap();
    let point = [[0.0f32; 3]];
    let at_rest = detector.near(&scene, 1.5, &Query::all()).unwrap();
    for query in [
        Query::between(a, b),
        Query::self_all(),
        Query::all().exclude((a, b)),
        Query::all().exclude(Exclusion::rings(1)),
        Query::all().exclude(Exclusion::groups(1, 2)),
        Query::all().exclude(&at_rest),
        Query::all().filter(PairFilter::new(|_| false)),
        Query::all().owned_by([0.0; 3], [1.0; 3]),
        Query::all().kinds([impinge_core::PairKind::EdgeEdge]),
        Query::all().shared_vertex(impinge_core::SharedVertex::Skip),
    ] {
        let refused = detector.closest(&scene, &point, 1.0, &query);
        assert!(matches!(refused, Err(Error::Setting { .. })), "{query:?}");
    }
    for most in [-1.0, f64::NAN] {
        let error = detector
            .closest(&scene, &point, most, &Query::all())
            .unwrap_err();
        assert!(matches!(
            error,
            Error::Setting {
                setting: "most",
                ..
            }
        ));
    }
    let none = detector.closest(&scene, &point, 1.0, &Query::all().n_nearest(0));
    let none = none.unwrap_err().to_string();
    assert!(none.contains("n_nearest") && none.contains('0'), "{none}");
    // More than there is memory for.
    let points = vec![[0.0f32; 3]; 1 << 20];
    let many = detector.closest(&scene, &points, 1.0, &Query::all().n_nearest(u32::MAX));
    assert!(matches!(many, Err(Error::OutOfMemory { .. })));
    let error = detector
        .closest(&scene, &[[f32::INFINITY; 3]], 1.0, &Query::all())
        .unwrap_err();
    assert!(matches!(
        error,
        Error::NonFinitePoint {
            what: "points",
            row: 0,
            ..
        }
    ));
    let token = CancelToken::new();
    token.cancel();
    detector.set_control(Control::new().cancel(&token));
    let stopped = detector.closest(&scene, &point, 1.0, &Query::all());
    assert!(matches!(stopped, Err(Error::Cancelled)));
    detector.set_control(Control::new());
    scene.remove(a).unwrap();
    let closest = detector
        .closest(&scene, &point, 9.0, &Query::all())
        .unwrap();
    assert_eq!(closest.get(0).unwrap().element.body, b);
    assert_eq!(closest.get(1), None);
    let none: [[f32; 3]; 0] = [];
    assert!(
        detector
            .closest(&scene, &none, 9.0, &Query::all())
            .unwrap()
            .is_empty()
    );
    let stale = detector.closest(&scene, &point, 9.0, &Query::of(a));
    assert!(matches!(stale, Err(Error::UnknownBody { .. })));
    scene.remove(b).unwrap();
    let closest = detector
        .closest(&scene, &point, f64::INFINITY, &Query::all())
        .unwrap();
    assert_eq!(closest.iter().collect::<Vec<_>>(), [None]);
    assert_eq!(closest.rows().collect::<Vec<_>>(), [[u32::MAX; 2]]);
}
