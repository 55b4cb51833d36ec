//! `contains`: inside, on the surface, outside; `signed_distance`: how far; and `locate`: in which
//! tetrahedron.

use std::collections::HashMap;

use crate::oracle::{self, Vector, Whole};
use impinge_core::{
    Backend, CancelToken, Control, Detector, Elements, Error, Query, Scene, Settings,
};
use impinge_scenes::{Model, Random, solids, soup, surfaces};

/// Faces and positions.
type Surface = (Vec<[u32; 3]>, Vec<[f64; 3]>);

/// Boundaries of tetrahedra with corners on a lattice, each turned outward or inward: closed
/// surfaces that overlap, coincide, touch in faces, edges and vertices, with some that are flat.
fn shells(n: usize, k: u32, seed: u64) -> Surface {
    let mut random = Random::new(seed);
    let mut faces: Vec<[u32; 3]> = Vec::new();
    let mut positions = Vec::new();
    for _ in 0..n {
        let first = positions.len() as u32;
        positions.extend([(); 4].map(|()| [(); 3].map(|()| f64::from(random.below(k + 1)))));
        let of_one = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        faces.extend(of_one.map(|face| face.map(|corner: u32| first + corner)));
    }
    (faces, positions)
}

/// All points of a lattice of halves around a box, and of quarters in a small one.
fn lattice(k: u32) -> Vec<[f64; 3]> {
    let parts = if k < 3 { 4 } else { 2 };
    let line = || (-1..=parts * k as i32 + 1).map(|x| f64::from(x) / f64::from(parts));
    let mut points = Vec::new();
    for x in line() {
        for y in line() {
            points.extend(line().map(|z| [x, y, z]));
        }
    }
    points
}

/// The winding number of each point; none on the surface.
fn windings(faces: &[[u32; 3]], positions: &[[f64; 3]], points: &[[f64; 3]]) -> Vec<Option<i32>> {
    windings_in(oracle::vector, faces, positions, points)
}

/// With coordinates that are whole numbers of some unit.
fn windings_in<N: Whole>(
    vector: impl Fn([f64; 3]) -> Vector<N>,
    faces: &[[u32; 3]],
    positions: &[[f64; 3]],
    points: &[[f64; 3]],
) -> Vec<Option<i32>> {
    let mut random = Random::new(77);
    let faces: Vec<[Vector<N>; 3]> = faces
        .iter()
        .map(|face| face.map(|vertex| vector(positions[vertex as usize])))
        .collect();
    let winding = |point: &[f64; 3]| {
        let point = vector(*point);
        let is_on = faces.iter().any(|face| oracle::is_on(&point, face));
        // A flat face is on both sides of a segment at once, or on none.
        (!is_on).then(|| oracle::winding(&point, &faces, &mut random))
    };
    points.iter().map(winding).collect()
}

/// Where the points are.
fn places(windings: &[Option<i32>]) -> Vec<i8> {
    let place = |winding: &Option<i32>| winding.map_or(0, |n| if n == 0 { -1 } else { 1 });
    windings.iter().map(place).collect()
}

fn expected(faces: &[[u32; 3]], positions: &[[f64; 3]], points: &[[f64; 3]]) -> Vec<i8> {
    places(&windings(faces, positions, points))
}

fn found(
    faces: &[[u32; 3]],
    positions: &[[f64; 3]],
    points: &[[f64; 3]],
    settings: impl Into<Settings>,
) -> Vec<i8> {
    let mut scene = Scene::new();
    let body = scene.add_triangles(faces, positions).unwrap();
    let mut detector = Detector::new(settings).unwrap();
    detector.contains(&scene, body, points).unwrap()
}

fn count(places: &[i8]) -> [usize; 3] {
    [-1, 0, 1].map(|place| places.iter().filter(|&&x| x == place).count())
}

#[test]
fn lattices_of_shells_are_decided_exactly() {
    let (mut all, mut several) = ([0; 3], 0);
    for (n, k, seed) in [
        (1, 1, 1),
        (1, 2, 2),
        (3, 2, 3),
        (8, 2, 4),
        (12, 3, 5),
        (40, 4, 6),
        (30, 2, 7),
        (150, 3, 8),
    ] {
        let (faces, positions) = shells(n, k, seed);
        let points = lattice(k);
        let windings = windings(&faces, &positions, &points);
        let expected = places(&windings);
        let mut scene = Scene::new();
        let body = scene.add_triangles(&faces, &positions).unwrap();
        let mut detector = Detector::new(Backend::Cpu).unwrap();
        let around = detector.winding_numbers(&scene, body, &points).unwrap();
        let wrong = around.iter().zip(&windings).position(|(x, y)| x != y);
        assert_eq!(wrong.map(|ix| (points[ix], around[ix], windings[ix])), None);
        several += around.iter().flatten().filter(|n| n.abs() > 1).count();
        let found = detector.contains(&scene, body, &points).unwrap();
        let wrong = found.iter().zip(&expected).position(|(x, y)| x != y);
        if let Some(ix) = wrong {
            panic!(
                "{n} shells, point {:?}: {} found, {} expected",
                points[ix], found[ix], expected[ix]
            );
        }
        all = [0, 1, 2].map(|k| all[k] + count(&expected)[k]);
    }
    assert!(
        all.iter().all(|&n| n > 100) && several > 10,
        "{all:?} {several}"
    );
}

/// Closed surfaces on lattices with every degeneracy: shells that overlap, coincide, touch and are
/// flat, turned either way; and round bodies whose vertices are put on a lattice, so that faces
/// fold, become flat and coincide.
fn catalogue(round: u64) -> Vec<Surface> {
    let mut all: Vec<_> = [(1, 1), (2, 2), (6, 2), (20, 3), (60, 4), (40, 8), (150, 3)]
        .into_iter()
        .zip(10 * round..)
        .map(|((n, k), seed)| shells(n, k, seed))
        .collect();
    let turn = 0.7 * round as f32;
    for model in [
        surfaces::icosphere(2),
        surfaces::bumpy_ball(300, 0.4),
        surfaces::torus(16, 8, 1.0, 0.4),
        surfaces::torus_knot(400, surfaces::Knot::default()),
    ] {
        let model = surfaces::unit_diagonal(model).mapped(|[x, y, z]| {
            let (sin, cos) = turn.sin_cos();
            [cos * x - sin * y, sin * x + cos * y, z]
        });
        let Elements::Triangles(faces) = &model.elements else {
            panic!("triangles")
        };
        for k in [4.0, 12.0] {
            let (low, _) = model.bounds().unwrap();
            let on_lattice = |point: &[f32; 3]| {
                [0, 1, 2].map(|axis| f64::from(((point[axis] - low[axis]) * k).round()))
            };
            let positions = model.positions.iter().map(on_lattice).collect();
            all.push((faces.clone(), positions));
        }
    }
    all
}

/// Points of a lattice of quarters, many of which lie on vertices, edges and faces and in their
/// planes, around all of the catalogue: none is wrong. 15,000 of them in each round.
fn are_decided_exactly(n_rounds: u64) {
    const PARTS: f64 = 4.0;
    let vector = |point: [f64; 3]| point.map(|x| (PARTS * x) as i64);
    let (mut n, mut all, mut random) = (0, [0; 3], Random::new(5));
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    for round in 1..=n_rounds {
        for (ix, (faces, positions)) in catalogue(round).into_iter().enumerate() {
            let most = positions.iter().flatten().copied().fold(0.0, f64::max);
            let n_along = ((most + 1.0) * PARTS) as u32;
            let mut coordinate = |()| f64::from(random.below(n_along)) / PARTS - 0.5;
            let points: Vec<[f64; 3]> = (0..1000).map(|_| [(); 3].map(&mut coordinate)).collect();
            let expected = windings_in(vector, &faces, &positions, &points);
            let mut scene = Scene::new();
            let body = scene.add_triangles(&faces, &positions).unwrap();
            let around = detector.winding_numbers(&scene, body, &points).unwrap();
            let inside = detector.contains(&scene, body, &points).unwrap();
            let expected_inside = places(&expected);
            for (point, (found, expected)) in points.iter().zip(around.iter().zip(&expected)) {
                assert_eq!(found, expected, "round {round}, mesh {ix}, {point:?}");
            }
            assert!(inside == expected_inside, "round {round}, mesh {ix}");
            all = [0, 1, 2].map(|k| all[k] + count(&expected_inside)[k]);
            n += points.len();
        }
    }
    println!("{n} points: {all:?} outside, on the surface, inside");
    assert!(all.iter().all(|&some| some > n / 50), "{all:?}");
}

#[test]
fn points_around_a_catalogue_of_degeneracies() {
    are_decided_exactly(1);
}

#[test]
#[ignore = "takes a minute"]
fn a_million_points_around_a_catalogue_of_degeneracies() {
    are_decided_exactly(67);
}

/// The sign is that of the oracle, the magnitude the distance of this body alone, whatever else is
/// nearer; and other answers do not depend on it.
#[test]
fn distances_have_the_sign_of_the_side() {
    let mut all = [0; 3];
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    for (n, k, seed) in [(1, 2, 2), (8, 2, 4), (30, 4, 6)] {
        let (faces, positions) = shells(n, k, seed);
        let points = lattice(k);
        let mut scene = Scene::new();
        scene.add_points(&points).unwrap();
        let body = scene.add_triangles(&faces, &positions).unwrap();
        let expected = expected(&faces, &positions, &points);
        let signed = detector.signed_distance(&scene, body, &points).unwrap();
        assert!(detector.stats().bytes_held > 0 && detector.stats().method == "clusters");
        let most = f64::INFINITY;
        let closest = detector.closest(&scene, &points, most, &Query::of(body));
        let closest = closest.unwrap();
        assert_eq!(signed.len(), points.len());
        for ((signed, side), found) in signed.iter().zip(&expected).zip(&closest) {
            assert_eq!(signed.abs(), found.unwrap().distance);
            assert_eq!(signed.partial_cmp(&0.0), side.partial_cmp(&0));
        }
        all = [0, 1, 2].map(|k| all[k] + count(&expected)[k]);
    }
    assert!(all.iter().all(|&n| n > 20), "{all:?}");
    let mut scene = Scene::new();
    let none = scene.add_triangles::<f32>(&[], &[]).unwrap();
    let signed = detector.signed_distance(&scene, none, &[[0.0f32; 3]]);
    assert_eq!(signed.unwrap(), [f64::NEG_INFINITY]);
    let open = scene
        .add_triangles(&[[0, 1, 2]], &[[0.0f32; 3]; 3])
        .unwrap();
    let refused = detector.signed_distance(&scene, open, &[[f32::NAN; 3]]);
    assert!(matches!(refused, Err(Error::NonFinitePoint { .. })));
}

/// Points on vertices and near the middles of edges and faces, whose coordinates are rounded: on
/// either side by the last bit.
#[test]
fn points_at_the_surface_of_round_bodies() {
    let model = surfaces::icosphere(1).mapped(|[x, y, z]| [x + 0.1 * y, y - 0.3 * z, z + 0.7]);
    let Elements::Triangles(faces) = &model.elements else {
        panic!("triangles")
    };
    let positions = model.positions_f64();
    let mut points = positions.clone();
    for face in faces {
        let [a, b, c] = face.map(|vertex| positions[vertex as usize]);
        points.push([0, 1, 2].map(|k| (a[k] + b[k]) / 2.0));
        points.push([0, 1, 2].map(|k| 0.3 * a[k] + 0.7 * b[k]));
        points.push([0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0));
        // Straight above a vertex along an axis, so that rays pass through it.
        points.push([a[0] - 0.5, a[1], a[2]]);
        points.push([a[0], a[1], a[2] + 0.25]);
    }
    let expected = expected(faces, &positions, &points);
    assert!(
        count(&expected).iter().all(|&n| n > 20),
        "{:?}",
        count(&expected)
    );
    assert_eq!(found(faces, &positions, &points, Backend::Cpu), expected);
}

/// A hollow is outside, whichever way both shells are turned; a shell alone may be turned either
/// way.
#[test]
fn nested_and_inverted_shells() {
    let cube = |size: f32, is_inverted: bool| {
        let mut cube = surfaces::cube([0.0; 3], size);
        if let Elements::Triangles(faces) = &mut cube.elements
            && is_inverted
        {
            faces.iter_mut().for_each(|face| face.swap(0, 1));
        }
        cube
    };
    let points: Vec<[f64; 3]> = (-5..=5).map(|x| [f64::from(x), 0.0, 0.0]).collect();
    for (turns, expected) in [
        ([false, false], [-1, 0, 1, 0, 1, 1, 1, 0, 1, 0, -1]),
        ([false, true], [-1, 0, 1, 0, -1, -1, -1, 0, 1, 0, -1]),
        ([true, false], [-1, 0, 1, 0, -1, -1, -1, 0, 1, 0, -1]),
        ([true, true], [-1, 0, 1, 0, 1, 1, 1, 0, 1, 0, -1]),
    ] {
        let models = [cube(8.0, turns[0]), cube(4.0, turns[1])];
        let (faces, positions) = joined(&models);
        assert_eq!(found(&faces, &positions, &points, Backend::Cpu), expected);
    }
}

fn joined(models: &[Model]) -> Surface {
    let (mut faces, mut positions) = (Vec::new(), Vec::new());
    for model in models {
        let first = positions.len() as u32;
        if let Elements::Triangles(of_one) = &model.elements {
            faces.extend(of_one.iter().map(|face| face.map(|vertex| first + vertex)));
        }
        positions.extend(model.positions_f64());
    }
    (faces, positions)
}

/// The same answer for every instruction set, number of threads and precision, and for bodies that
/// move.
#[test]
fn every_way_gives_the_same_answer() {
    let mut random = Random::new(9);
    let model = surfaces::torus_knot(20_000, surfaces::Knot::default());
    let (low, high) = model.bounds().unwrap();
    let points: Vec<[f32; 3]> = (0..5000)
        .map(|_| [0, 1, 2].map(|k| random.range(low[k], high[k])))
        .collect();
    let wide: Vec<[f64; 3]> = points.iter().map(|point| point.map(f64::from)).collect();
    let mut scene = Scene::new();
    let body = model.add_to(&mut scene).unwrap();
    let moved: Vec<[f32; 3]> = model.positions.iter().map(|&[x, y, z]| [y, z, x]).collect();
    let mut answers = Vec::new();
    for (threads, mut detector) in crate::detectors() {
        let mut moving = scene.clone();
        let first = detector.contains(&moving, body, &points).unwrap();
        assert_eq!(first, detector.contains(&moving, body, &wide).unwrap());
        moving.set_positions(body, &moved).unwrap();
        let turned: Vec<[f32; 3]> = points.iter().map(|&[x, y, z]| [y, z, x]).collect();
        assert_eq!(first, detector.contains(&moving, body, &turned).unwrap());
        assert_eq!(detector.stats().n_threads, threads);
        answers.push(first);
    }
    assert!(answers.iter().all(|answer| *answer == answers[0]));
    assert!(count(&answers[0])[2] > 100);
}

/// A block is a box, whatever its tetrahedra; and a body that is bent has the inside of its border.
#[test]
fn tetrahedra() {
    let block = solids::block(3, 2, 2, 1.0);
    let (low, high) = block.bounds().unwrap();
    let mut scene = Scene::new();
    let body = block.add_to(&mut scene).unwrap();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let quarter = |k: usize| {
        let n = ((high[k] - low[k]) * 4.0) as i32;
        (-1..=n + 1).map(move |x| f64::from(low[k]) + f64::from(x) / 4.0)
    };
    let mut points = Vec::new();
    for x in quarter(0) {
        for y in quarter(1) {
            points.extend(quarter(2).map(|z| [x, y, z]));
        }
    }
    let of_box = |point: &[f64; 3]| {
        let inner = (0..3).all(|k| f64::from(low[k]) < point[k] && point[k] < f64::from(high[k]));
        let held = (0..3).all(|k| f64::from(low[k]) <= point[k] && point[k] <= f64::from(high[k]));
        if inner { 1 } else { i8::from(held) - 1 }
    };
    let expected: Vec<i8> = points.iter().map(of_box).collect();
    assert_eq!(detector.contains(&scene, body, &points).unwrap(), expected);

    let bent = |[x, y, z]: [f32; 3]| [x + 0.3 * y * y, y + 0.2 * z, z - 0.1 * x];
    let block = solids::block(4, 3, 3, 1.0).mapped(bent);
    let body = block.add_to(&mut scene).unwrap();
    let positions = block.positions_f64();
    let Elements::Tetrahedra(tetrahedra) = &block.elements else {
        panic!("tetrahedra")
    };
    let mut faces: HashMap<[u32; 3], Vec<[u32; 3]>> = HashMap::new();
    let point = |vertex: u32| oracle::vector(positions[vertex as usize]);
    for &[a, b, c, d] in tetrahedra {
        let is_positive = oracle::volume(&point(a), &point(b), &point(c), &point(d)) > 0;
        for mut face in [[a, c, b], [a, b, d], [b, c, d], [c, a, d]] {
            if !is_positive {
                face.swap(0, 1);
            }
            let mut name = face;
            name.sort_unstable();
            faces.entry(name).or_default().push(face);
        }
    }
    let border: Vec<[u32; 3]> = faces
        .into_values()
        .filter(|same| same.len() == 1)
        .flatten()
        .collect();
    let mut random = Random::new(3);
    let (low, high) = block.bounds().unwrap();
    let mut points = positions.clone();
    points.extend((0..3000).map(|_| [0, 1, 2].map(|k| f64::from(random.range(low[k], high[k])))));
    for tetrahedron in tetrahedra {
        let [a, b, c, _] = tetrahedron.map(|vertex| positions[vertex as usize]);
        points.push([0, 1, 2].map(|k| (a[k] + b[k]) / 2.0));
        points.push([0, 1, 2].map(|k| (a[k] + b[k]) / 4.0 + c[k] / 2.0));
    }
    let expected = found(&border, &positions, &points, Backend::Cpu);
    assert!(
        count(&expected).iter().all(|&n| n > 50),
        "{:?}",
        count(&expected)
    );
    assert_eq!(detector.contains(&scene, body, &points).unwrap(), expected);
}

/// What is on the surface is at the distance 0 from it, also of tetrahedra that are listed twice.
#[test]
fn repeated_tetrahedra_have_one_surface() {
    let positions = [
        [0.0f64; 3],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
        [0.0, 0.0, 4.0],
        [0.0, 0.0, -4.0],
        [4.0, 4.0, 4.0],
    ];
    // On the face of the first three corners, on another one, and inside the first.
    let points = [[1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.5, 1.0, 0.25]];
    let (one, below, beyond) = ([0, 1, 2, 3], [0, 2, 1, 4], [0, 1, 2, 5]);
    let bodies: [(&[[u32; 4]], [i8; 3]); 7] = [
        (&[one], [0, 0, 1]),
        (&[one, below], [1, 0, 1]),
        (&[one, one], [0, 0, 1]),
        (&[one, [1, 0, 2, 3]], [0, 0, 1]),
        (&[one, one, below], [0, 0, 1]),
        (&[one, below, one], [0, 0, 1]),
        (&[one, below, beyond], [0, 0, 1]),
    ];
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    for (tetrahedra, expected) in bodies {
        let mut scene = Scene::new();
        let body = scene.add_tetrahedra(tetrahedra, &positions).unwrap();
        let places = detector.contains(&scene, body, &points).unwrap();
        assert_eq!(places, expected, "{tetrahedra:?}");
        let distances = detector.signed_distance(&scene, body, &points).unwrap();
        for (place, distance) in places.iter().zip(distances) {
            assert_eq!(*place == 0, distance == 0.0, "{tetrahedra:?}: {distance}");
        }
    }
}

/// A corner of the second is strictly inside the first: inside, and on the surface of `closest`.
#[test]
fn surfaces_inside_other_tetrahedra_are_inside_and_at_distance_0() {
    let positions = [
        [0.0f64; 3],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
        [0.0, 0.0, 4.0],
        [0.5, 0.5, 0.5],
        [9.0, 1.0, 1.0],
        [1.0, 9.0, 1.0],
        [1.0, 1.0, 9.0],
    ];
    let mut scene = Scene::new();
    let body = scene
        .add_tetrahedra(&[[0, 1, 2, 3], [4, 5, 6, 7]], &positions)
        .unwrap();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let points = [[0.5, 0.5, 0.5]];
    assert_eq!(detector.contains(&scene, body, &points).unwrap(), [1]);
    let distances = detector.signed_distance(&scene, body, &points).unwrap();
    assert_eq!(distances, [0.0]);
}

/// The border of a flat tetrahedron that lies on a face of another one, and tetrahedra that
/// overlap, in either order.
#[test]
fn flat_and_overlapping_tetrahedra() {
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut places = |tetrahedra: &[[u32; 4]], positions: &[[f64; 3]], points: &[[f64; 3]]| {
        let mut scene = Scene::new();
        let body = scene.add_tetrahedra(tetrahedra, positions).unwrap();
        detector.contains(&scene, body, points).unwrap()
    };
    let positions = [
        [0.0, 0.0, -3.0],
        [0.0; 3],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
        [4.0, 4.0, 0.0],
    ];
    // Of the flat one, the face opposite its first corner is that of the other.
    let points = [
        [1.0, 1.0, 0.0],
        [3.5, 3.5, 0.0],
        [1.0, 1.0, -0.25],
        [1.0, 1.0, 0.25],
    ];
    for flat in [[4, 1, 2, 3], [1, 4, 2, 3], [2, 3, 1, 4]] {
        let found = places(&[[0, 1, 2, 3], flat], &positions, &points);
        assert_eq!(found, [0, 0, 1, -1], "{flat:?}");
    }
    // The point is inside the first and on a face of the second.
    let mut positions = vec![
        [-8.0, -8.0, -8.0],
        [8.0, -8.0, -8.0],
        [0.0, 8.0, -8.0],
        [0.0, 0.0, 8.0],
    ];
    positions.extend([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    for tetrahedra in [[[0, 1, 2, 3], [4, 5, 6, 7]], [[4, 5, 6, 7], [0, 1, 2, 3]]] {
        let points = [
            [0.25, 0.25, 0.0],
            [0.125; 3],
            [-1.0, 0.0, 0.0],
            [0.0, 0.0, 8.0],
        ];
        let found = places(&tetrahedra, &positions, &points);
        assert_eq!(found, [1, 1, 1, 0], "{tetrahedra:?}");
    }
}

/// Whether a tetrahedron, which may be flat, contains a point.
fn holds(corners: &[Vector; 4], point: &Vector) -> bool {
    let [a, b, c, d] = corners;
    let faces = [[b, c, d], [a, c, d], [a, b, d], [a, b, c]];
    if faces
        .iter()
        .any(|face| oracle::is_on(point, &face.map(Clone::clone)))
    {
        return true;
    }
    let whole = oracle::volume(a, b, c, d);
    let parts = [
        oracle::volume(point, b, c, d),
        oracle::volume(a, point, c, d),
        oracle::volume(a, b, point, d),
        oracle::volume(a, b, c, point),
    ];
    whole != 0 && parts.iter().all(|&part| part == whole)
}

/// The lowest that contains each point, of those that share faces, edges and vertices, overlap or
/// are flat.
#[test]
fn the_tetrahedron_of_a_point() {
    let mut random = Random::new(31);
    let mut counts = [0; 3];
    let mut ask = |tetrahedra: &[[u32; 4]], positions: &[[f64; 3]], points: &[[f64; 3]]| {
        let mut scene = Scene::new();
        let body = scene.add_tetrahedra(tetrahedra, positions).unwrap();
        let exact: Vec<Vector> = positions.iter().map(|&p| oracle::vector(p)).collect();
        let corners: Vec<[Vector; 4]> = tetrahedra
            .iter()
            .map(|corners| corners.map(|vertex| exact[vertex as usize].clone()))
            .collect();
        let all_holding = |point: &[f64; 3]| {
            let point = oracle::vector(*point);
            let numbered = (0u32..).zip(&corners);
            let holding = numbered.filter(|(_, corners)| holds(corners, &point));
            holding.map(|(number, _)| number).collect::<Vec<_>>()
        };
        let all: Vec<Vec<u32>> = points.iter().map(all_holding).collect();
        for holding in &all {
            counts[holding.len().min(2)] += 1;
        }
        let expected: Vec<Option<u32>> = all.iter().map(|of| of.first().copied()).collect();
        for (_, mut detector) in crate::detectors() {
            let found = detector.locate(&scene, body, points).unwrap();
            assert_eq!(found, expected);
            // Inside and on the surface is in one, and outside in none.
            let places = detector.contains(&scene, body, points).unwrap();
            assert!(
                places
                    .iter()
                    .map(|&x| x >= 0)
                    .eq(found.iter().map(Option::is_some))
            );
        }
    };
    for (n, k) in [(1, 1), (20, 2), (60, 3)] {
        let mut lattice_point = || [(); 3].map(|()| f64::from(random.below(k + 1)));
        let positions: Vec<[f64; 3]> = (0..4 * n).map(|_| lattice_point()).collect();
        let tetrahedra: Vec<[u32; 4]> = (0..n).map(|ix| [0, 1, 2, 3].map(|c| 4 * ix + c)).collect();
        ask(&tetrahedra, &positions, &lattice(k));
    }
    let block = solids::block(4, 3, 3, 1.0).mapped(|[x, y, z]| [x + 0.3 * y * y, y + 0.2 * z, z]);
    let Elements::Tetrahedra(tetrahedra) = &block.elements else {
        panic!("tetrahedra")
    };
    let positions = block.positions_f64();
    let mut points = positions.clone();
    points.extend((0..300).map(|_| random.point(-1.0, 4.0).map(f64::from)));
    for corners in tetrahedra {
        let [a, b, c, _] = corners.map(|vertex| positions[vertex as usize]);
        points.push([0, 1, 2].map(|k| (a[k] + b[k]) / 2.0));
        points.push([0, 1, 2].map(|k| (a[k] + b[k]) / 4.0 + c[k] / 2.0));
    }
    ask(tetrahedra, &positions, &points);
    assert!(counts.iter().all(|&n| n > 100), "{counts:?}");
}

/// A body that moves takes its tetrahedra along; one of another kind has none.
#[test]
fn tetrahedra_that_move_and_what_has_none() {
    let mut scene = Scene::new();
    let corners = [
        [0.0f32; 3],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
        [0.0, 0.0, 4.0],
    ];
    let body = scene.add_tetrahedra(&[[0u32, 1, 2, 3]], &corners).unwrap();
    let cube = surfaces::cube([0.0; 3], 1.0).add_to(&mut scene).unwrap();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let points = [[1.0f32; 3], [11.0, 1.0, 1.0]];
    assert_eq!(
        detector.locate(&scene, body, &points).unwrap(),
        [Some(0), None]
    );
    let moved = corners.map(|[x, y, z]| [x + 10.0, y, z]);
    scene.set_positions(body, &moved).unwrap();
    assert_eq!(
        detector.locate(&scene, body, &points).unwrap(),
        [None, Some(0)]
    );
    let kind = detector.winding_numbers(&scene, body, &points);
    assert!(matches!(
        kind,
        Err(Error::WrongKind {
            kind: "tetrahedra",
            expected: "triangles",
            ..
        })
    ));
    let kind = detector.locate(&scene, cube, &points).unwrap_err();
    assert!(
        matches!(kind, Error::WrongKind { body, kind: "triangles", expected: "tetrahedra" } if body == cube)
    );
    let error = detector.locate(&scene, body, &[[0.0, f64::NAN, 1.0]]);
    assert!(matches!(error, Err(Error::NonFinitePoint { row: 0, .. })));
    scene.remove(body).unwrap();
    let stale = detector.locate(&scene, body, &points);
    assert!(matches!(stale, Err(Error::UnknownBody { .. })));
}

/// The next body in the place of one that is gone has a border of its own.
#[test]
fn a_body_in_the_place_of_another() {
    let mut scene = Scene::new();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut positions = vec![[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
    positions.push([0.0, 0.0, -4.0]);
    let far: Vec<[f64; 3]> = positions[..4].iter().map(|p| p.map(|x| x + 9.0)).collect();
    positions.extend(far);
    let [apart, joined] = [[5, 6, 7, 8], [0, 1, 2, 4]];
    for (second, place) in [(apart, 0), (joined, 1), (apart, 0)] {
        let tetrahedra = [[0, 1, 2, 3], second];
        let body = scene.add_tetrahedra(&tetrahedra, &positions).unwrap();
        let point = [[1.0, 1.0, 0.0]];
        let found = detector.contains(&scene, body, &point).unwrap();
        assert_eq!(found, [place], "{second:?}");
        scene.remove(body).unwrap();
    }
}

/// Coordinates beyond those of single precision, and points far out.
/// The border of tetrahedra that are gone says nothing about a surface in their place.
#[test]
fn a_surface_in_the_place_of_tetrahedra() {
    let corners = [
        [0.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
        [0.0, 0.0, 4.0],
    ];
    let points = [[1.0, 1.0, 1.0], [0.0, 1.0, 1.0], [3.0, 3.0, 3.0]];
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut scene = Scene::new();
    let solid = scene.add_tetrahedra(&[[0, 1, 2, 3]], &corners).unwrap();
    assert_eq!(
        detector.contains(&scene, solid, &points).unwrap(),
        [1, 0, -1]
    );
    scene.remove(solid).unwrap();
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let surface = scene.add_triangles(&faces, &corners).unwrap();
    assert_eq!(surface.index(), solid.index());
    assert_eq!(
        detector.contains(&scene, surface, &points).unwrap(),
        [1, 0, -1]
    );
}

#[test]
fn numbers_of_any_size() {
    let cube = surfaces::cube([0.0; 3], 2.0);
    let Elements::Triangles(faces) = &cube.elements else {
        panic!("triangles")
    };
    for size in [1e-300, 1e-30, 1.0, 1e30, 1e300] {
        let positions: Vec<[f64; 3]> = cube
            .positions_f64()
            .iter()
            .map(|point| point.map(|x| x * size))
            .collect();
        let points = [0.0, 0.5, 1.0, 1.0f64.next_up(), -1.0, -1.5, 1e7].map(|x| {
            let scaled = [x, 0.25, 0.0].map(|x| x * size);
            [scaled[0], scaled[1], scaled[2]]
        });
        let found = found(faces, &positions, &points, Backend::Cpu);
        assert_eq!(found, [1, 1, 0, -1, 0, -1, -1], "{size:e}");
    }
}

#[test]
fn what_is_refused() {
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut scene = Scene::new();
    let cloth = surfaces::cloth(3, 3, 1.0).add_to(&mut scene).unwrap();
    let cube = surfaces::cube([0.0; 3], 1.0).add_to(&mut scene).unwrap();
    let dots = scene.add_points(&[[0.0f32; 3]]).unwrap();
    let none: Vec<[f32; 3]> = Vec::new();
    assert!(detector.contains(&scene, cube, &none).unwrap().is_empty());
    let open = detector
        .contains(&scene, cloth, &[[0.0f32; 3]])
        .unwrap_err();
    assert!(
        matches!(open, Error::NotClosed { body, n_forward: 1, n_backward: 0, .. }
        | Error::NotClosed { body, n_forward: 0, n_backward: 1, .. } if body == cloth)
    );
    let kind = detector.contains(&scene, dots, &[[0.0f32; 3]]).unwrap_err();
    assert!(matches!(kind, Error::WrongKind { kind: "points", .. }));
    let points = [[0.0, 0.0, 0.0], [0.0, f64::NAN, 1.0]];
    let error = detector.contains(&scene, cube, &points).unwrap_err();
    assert_eq!(error.to_string(), "points: row 1 is not finite (0, NaN, 1)");
    assert_eq!(error.code(), "invalid");
    let token = CancelToken::new();
    token.cancel();
    detector.set_control(Control::new().cancel(&token));
    let stopped = detector.contains(&scene, cube, &[[0.0f32; 3]]);
    assert!(matches!(stopped, Err(Error::Cancelled)));
    detector.set_control(Control::new());
    assert_eq!(
        detector.contains(&scene, cube, &[[0.0f32; 3]]).unwrap(),
        [1]
    );
    scene.remove(cube).unwrap();
    let stale = detector.contains(&scene, cube, &[[0.0f32; 3]]);
    assert!(matches!(stale, Err(Error::UnknownBody { .. })));
}

/// Soups of triangles are not closed, and a body without faces has no inside.
#[test]
fn soups_and_empty_bodies() {
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut scene = Scene::new();
    let soup = soup::triangles(30, 0.3, 1).add_to(&mut scene).unwrap();
    let empty = scene.add_triangles::<f32>(&[], &[]).unwrap();
    assert!(detector.contains(&scene, soup, &[[0.0f32; 3]]).is_err());
    assert_eq!(
        detector.contains(&scene, empty, &[[0.0f32; 3]]).unwrap(),
        [-1]
    );
}
