//! Bodies that are moved by a matrix, added by the thousand, and pairs that are filtered.

use impinge_core::{
    Backend, BodyId, Detector, Elements, Error, Method, Positions, Query, Scene, Settings,
};
use impinge_scenes::Random;

const FACE: [[u32; 3]; 1] = [[0, 1, 2]];
const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const IDENTITY: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

fn lifted(z: f64) -> [[f64; 4]; 4] {
    let mut matrix = IDENTITY;
    matrix[2][3] = z;
    matrix
}

/// A turn about a skew axis, and a shift.
fn turn(angle: f64) -> [[f64; 4]; 4] {
    let (sin, cos) = angle.sin_cos();
    let [x, y, z] = [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0];
    let t = 1.0 - cos;
    [
        [
            t * x * x + cos,
            t * x * y - sin * z,
            t * x * z + sin * y,
            0.1,
        ],
        [
            t * x * y + sin * z,
            t * y * y + cos,
            t * y * z - sin * x,
            -0.2,
        ],
        [
            t * x * z - sin * y,
            t * y * z + sin * x,
            t * z * z + cos,
            0.3,
        ],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// The rule as it is documented, operation by operation.
fn by_hand(matrix: &[[f64; 4]; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| {
        let [a, b, c, d] = matrix[row];
        let (ax, by, cz) = (a * x, b * y, c * z);
        let sum = ax + by;
        let sum = sum + cz;
        sum + d
    })
}

fn cloud(n: usize) -> Vec<[f64; 3]> {
    let mut random = Random::new(5);
    (0..n)
        .map(|_| std::array::from_fn(|_| f64::from(random.range(-2.0, 2.0)) / 3.0))
        .collect()
}

fn points(scene: &Scene, body: BodyId) -> Vec<[f64; 3]> {
    let positions = scene.body(body).expect("known").positions();
    (0..positions.len()).map(|ix| positions.point(ix)).collect()
}

#[test]
fn moved_positions_are_rounded_as_documented() {
    let double = cloud(999);
    let single: Vec<[f32; 3]> = double.iter().map(|p| p.map(|x| x as f32)).collect();
    let faces: Vec<[u32; 3]> = (0..333)
        .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
        .collect();
    let mut scene = Scene::new();
    let wide = scene.add_triangles(&faces, &double).expect("good");
    let narrow = scene.add_triangles(&faces, &single).expect("good");
    for frame in 0..5 {
        let matrix = turn(0.37 * f64::from(frame));
        scene.set_transform(wide, &matrix).expect("good");
        scene.set_transform(narrow, &matrix).expect("good");
        let expected: Vec<_> = double.iter().map(|&p| by_hand(&matrix, p)).collect();
        assert_eq!(points(&scene, wide), expected);
        let rounded: Vec<_> = single
            .iter()
            .map(|&p| by_hand(&matrix, p.map(f64::from)).map(|x| f64::from(x as f32)))
            .collect();
        assert_eq!(points(&scene, narrow), rounded);
        assert_eq!(scene.body(wide).expect("known").transform(), Some(matrix));
        let rest = scene.body(narrow).expect("known").rest_positions();
        assert_eq!(*rest, Positions::F32(single.clone().into()));
    }
    // A transform starts from rest each time, and the unit matrix leads back there.
    scene.set_transform(wide, &IDENTITY).expect("good");
    assert_eq!(points(&scene, wide), double);
}

#[test]
fn answers_are_those_of_the_moved_vertices() {
    let double = cloud(600);
    let faces: Vec<[u32; 3]> = (0..200)
        .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
        .collect();
    let mut moved = Scene::new();
    let mut given = Scene::new();
    for scene in [&mut moved, &mut given] {
        for _ in 0..2 {
            scene.add_triangles(&faces, &double).expect("good");
        }
    }
    let (body, same) = (
        moved.bodies().nth(1).expect("two").0,
        given.bodies().nth(1).expect("two").0,
    );
    for method in [Method::Clusters, Method::Cells] {
        let settings = Settings::new().method(method).backend(Backend::Cpu);
        let mut detector = Detector::new(settings).expect("good");
        let mut hashes = Vec::new();
        for frame in 0..4 {
            moved
                .set_transform(body, &turn(f64::from(frame)))
                .expect("good");
            given
                .set_positions(same, points(&moved, body))
                .expect("good");
            let ours = detector.detect(&moved, &Query::all()).expect("good").hash();
            let theirs = detector.detect(&given, &Query::all()).expect("good").hash();
            assert_eq!(ours, theirs);
            hashes.push(ours);
        }
        hashes.dedup();
        assert_eq!(hashes.len(), 4, "the body did move");
    }
}

#[test]
fn a_refused_transform_changes_nothing() {
    let mut scene = Scene::new();
    let body = scene.add_triangles(&FACE, &TRIANGLE).expect("good");
    let mut bad = IDENTITY;
    bad[3] = [0.0, 0.0, 0.5, 1.0];
    let error = scene.set_transform(body, &bad).expect_err("projective");
    assert_eq!(
        error.to_string(),
        "transform: a last row of [0.0, 0.0, 0.5, 1.0] given, [0, 0, 0, 1] allowed"
    );
    let mut bad = IDENTITY;
    bad[1][2] = f64::NAN;
    let error = scene.set_transform(body, &bad).expect_err("NaN");
    assert_eq!(
        error.to_string(),
        "transform: NaN in row 1, column 2 given, finite numbers allowed"
    );
    // Beyond f32: as at first, and after a transform that was good.
    for before in [None, Some(lifted(2.0))] {
        if let Some(matrix) = &before {
            scene.set_transform(body, matrix).expect("good");
        }
        let held = points(&scene, body);
        let mut far = IDENTITY;
        far[0][0] = 1e39;
        let error = scene.set_transform(body, &far).expect_err("infinite");
        assert!(
            matches!(error, Error::NonFinitePosition { vertex: 1, .. }),
            "{error}"
        );
        assert_eq!(points(&scene, body), held);
        assert_eq!(scene.body(body).expect("known").transform(), before);
        // Positions that were widened with their end stay wide.
        let wide = TRIANGLE.map(|p| p.map(f64::from));
        scene.set_end_positions(body, &wide).expect("good");
        let mut far = IDENTITY;
        far[0][0] = 1e300;
        far[0][3] = f64::MAX;
        scene.set_transform(body, &far).expect_err("infinite");
        let held = scene.body(body).expect("known");
        assert!(matches!(held.positions(), Positions::F64(_)));
        assert_eq!(held.end_positions(), Some(&wide.to_vec().into()));
        scene.set_positions(body, &TRIANGLE).expect("good");
    }
    scene.remove(body).expect("known");
    assert!(matches!(
        scene.set_transform(body, &IDENTITY),
        Err(Error::UnknownBody { .. })
    ));
}

#[test]
fn positions_that_are_given_end_a_transform() {
    let mut scene = Scene::new();
    let body = scene.add_triangles(&FACE, &TRIANGLE).expect("good");
    scene.set_end_positions(body, &TRIANGLE).expect("good");
    scene.set_transform(body, &lifted(1.0)).expect("good");
    assert_eq!(scene.body(body).expect("known").end_positions(), None);
    let other = TRIANGLE.map(|[x, y, z]| [x, y, z + 5.0]);
    scene.set_positions(body, &other).expect("good");
    assert_eq!(scene.body(body).expect("known").transform(), None);
    scene.set_transform(body, &lifted(1.0)).expect("good");
    assert_eq!(points(&scene, body)[0], [0.0, 0.0, 6.0]);
    // Written in place: these are the rest positions, and bad ones are refused.
    scene.positions_mut::<f32>(body).expect("f32")[1][1] = f32::NAN;
    let error = scene.set_transform(body, &IDENTITY).expect_err("NaN");
    assert!(
        matches!(error, Error::NonFinitePosition { vertex: 1, .. }),
        "{error}"
    );
    scene.positions_mut::<f32>(body).expect("f32")[1][1] = 3.0;
    scene.set_transform(body, &IDENTITY).expect("good");
    assert_eq!(points(&scene, body)[1], [1.0, 3.0, 6.0]);
}

/// Two clouds of triangles of which the first turns: by matrices, and by positions that are given.
#[test]
fn an_end_transform_is_the_end_positions_that_it_gives() {
    let double = cloud(300);
    let single: Vec<[f32; 3]> = double.iter().map(|p| p.map(|x| x as f32)).collect();
    let faces: Vec<[u32; 3]> = (0..100)
        .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
        .collect();
    let mut detector = Detector::new(Backend::Cpu).expect("good");
    let mut hashes = Vec::new();
    for wide in [false, true] {
        let rest: Positions = match wide {
            true => double.clone().into(),
            false => single.clone().into(),
        };
        let scene = || {
            let mut scene = Scene::new();
            let ids = [0.0, 0.3].map(|shift| {
                let body = scene.add((faces.clone(), rest.clone())).expect("good");
                scene
                    .set_transform(body, &lifted(3.0 * shift))
                    .expect("good");
                body
            });
            (scene, ids[0])
        };
        let ((mut turned, body), (mut given, same)) = (scene(), scene());
        for frame in 0..4 {
            let [start, end] = [0, 1].map(|ix| turn(0.3 * f64::from(frame + ix)));
            turned.set_transform(body, &start).expect("good");
            turned.set_end_transform(body, &end).expect("good");
            // Twice, and after another one: they do not accumulate.
            turned.set_end_transform(body, &lifted(9.0)).expect("good");
            turned.set_end_transform(body, &end).expect("good");
            let by_hand: Vec<[f64; 3]> = (0..rest.len())
                .map(|ix| by_hand(&end, rest.point(ix)))
                .collect();
            given.set_transform(same, &start).expect("good");
            match wide {
                true => given.set_end_positions(same, &by_hand).expect("good"),
                false => {
                    let rounded: Vec<[f32; 3]> =
                        by_hand.iter().map(|p| p.map(|x| x as f32)).collect();
                    given.set_end_positions(same, &rounded).expect("good");
                }
            }
            let [ours, theirs] = [(&turned, body), (&given, same)]
                .map(|(scene, body)| scene.body(body).expect("known"));
            assert_eq!(ours.end_positions(), theirs.end_positions());
            assert_eq!(ours.positions(), theirs.positions());
            assert_eq!(ours.transform(), Some(start), "it is that of the start");
            assert_eq!(*ours.rest_positions(), rest);
            let [ours, theirs] = [&turned, &given].map(|scene| {
                let impacts = detector.impacts(scene, &Query::all()).expect("good");
                impacts.hash()
            });
            assert_eq!(ours, theirs);
            hashes.push(ours);
            // The next step starts where this one ended, bit by bit.
            let end_of_step = turned.body(body).expect("known").end_positions().cloned();
            turned.set_transform(body, &end).expect("good");
            let start = turned.body(body).expect("known").positions();
            assert_eq!(end_of_step.as_ref(), Some(start));
        }
    }
    hashes.dedup();
    assert_eq!(hashes.len(), 8, "the body did move");
}

#[test]
fn an_end_transform_moves_the_positions_given_last() {
    let mut scene = Scene::new();
    let body = scene.add_triangles(&FACE, &TRIANGLE).expect("good");
    let end = |scene: &Scene| {
        let end = scene.body(body).expect("known").end_positions();
        end.map(|end| end.point(1))
    };
    // Without a transform, from where the body is.
    scene.set_end_transform(body, &lifted(2.0)).expect("good");
    assert_eq!(end(&scene), Some([1.0, 0.0, 2.0]));
    scene.set_transform(body, &lifted(5.0)).expect("good");
    assert_eq!(end(&scene), None, "a new start has no end yet");
    scene.set_end_transform(body, &lifted(2.0)).expect("good");
    assert_eq!(end(&scene), Some([1.0, 0.0, 2.0]), "from rest");
    scene.clear_end_positions(body).expect("known");
    assert_eq!(end(&scene), None);
    // Written in place: these are the rest positions, and bad ones are refused.
    scene.positions_mut::<f32>(body).expect("f32")[1][1] = f32::NAN;
    let error = scene.set_end_transform(body, &IDENTITY).expect_err("NaN");
    assert!(
        matches!(error, Error::NonFinitePosition { vertex: 1, .. }),
        "{error}"
    );
    scene.positions_mut::<f32>(body).expect("f32")[1][1] = 3.0;
    scene.set_end_transform(body, &lifted(1.0)).expect("good");
    assert_eq!(end(&scene), Some([1.0, 3.0, 6.0]));
    // Start and end in two precisions: the narrower one is widened.
    let wide = TRIANGLE.map(|p| p.map(f64::from));
    scene.set_end_positions(body, &wide).expect("good");
    scene.set_end_transform(body, &lifted(1.0)).expect("good");
    let held = scene.body(body).expect("known");
    assert!(matches!(held.positions(), Positions::F64(_)));
    assert!(matches!(held.end_positions(), Some(Positions::F64(_))));
}

#[test]
fn a_refused_end_transform_keeps_the_end_positions() {
    let mut scene = Scene::new();
    let body = scene.add_triangles(&FACE, &TRIANGLE).expect("good");
    let mut projective = IDENTITY;
    projective[3] = [0.0, 0.0, 0.5, 1.0];
    let mut infinite = IDENTITY;
    infinite[2][0] = f64::INFINITY;
    let mut far = IDENTITY;
    far[0][0] = 1e39;
    for before in [None, Some(lifted(2.0))] {
        if let Some(matrix) = &before {
            scene.set_end_transform(body, matrix).expect("good");
        }
        let held = scene.body(body).expect("known").end_positions().cloned();
        assert_eq!(held.is_some(), before.is_some());
        for (matrix, message) in [
            (
                &projective,
                "transform: a last row of [0.0, 0.0, 0.5, 1.0] given, [0, 0, 0, 1] allowed",
            ),
            (
                &infinite,
                "transform: inf in row 2, column 0 given, finite numbers allowed",
            ),
            (
                &far,
                "body 0: vertex 1 has a non-finite position (inf, 0, 0)",
            ),
        ] {
            let error = scene.set_end_transform(body, matrix).expect_err("bad");
            assert_eq!(error.to_string(), message);
            assert_eq!(
                scene.body(body).expect("known").end_positions(),
                held.as_ref()
            );
        }
    }
    scene.remove(body).expect("known");
    assert!(matches!(
        scene.set_end_transform(body, &IDENTITY),
        Err(Error::UnknownBody { .. })
    ));
}

/// How far the documents say that a step may leave the arc, and that the least number of pieces
/// which keeps to a deviation does.
#[test]
fn a_step_leaves_the_arc_of_a_turn_by_no_more_than_is_said() {
    let mut scene = Scene::new();
    let rest = cloud(60);
    let body = scene.add_points(&rest).expect("good");
    let axis = [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0];
    let radius = |p: &[f64; 3]| {
        let along: f64 = p.iter().zip(axis).map(|(x, y)| x * y).sum();
        let off: [f64; 3] = std::array::from_fn(|k| p[k] - along * axis[k]);
        off.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let farthest = rest.iter().map(radius).fold(0.0, f64::max);
    for (angle, deviation) in [(3.0, 0.1), (0.9, 0.01), (6.2, 0.002)] {
        let n = (angle * f64::sqrt(farthest / (8.0 * deviation))).ceil();
        let step = angle / n;
        scene.set_transform(body, &turn(0.4)).expect("good");
        scene
            .set_end_transform(body, &turn(0.4 + step))
            .expect("good");
        let held = scene.body(body).expect("known");
        let end = held.end_positions().expect("set");
        let mut most = 0.0f64;
        for moment in 0..=100 {
            let t = f64::from(moment) / 100.0;
            let arc = turn(0.4 + t * step);
            for (ix, &p) in rest.iter().enumerate() {
                let (x, y) = (held.positions().point(ix), end.point(ix));
                let there = by_hand(&arc, p);
                let off = (0..3).map(|k| (x[k] + t * (y[k] - x[k]) - there[k]).powi(2));
                let off = off.sum::<f64>().sqrt();
                assert!(off <= radius(&p) * step * step / 8.0 + 1e-14);
                most = most.max(off);
            }
        }
        assert!(most <= deviation + 1e-14);
        // One piece less would leave it by more: the rule wastes none, for small turns.
        let coarse = farthest * (1.0 - (angle / (n - 1.0) / 2.0).cos());
        assert!(step > 0.5 || coarse > deviation, "{coarse} of {deviation}");
    }
}

/// `n` triangles as parts with vertices of their own.
fn parts(n: usize) -> (Elements, Vec<usize>, Vec<[f32; 3]>, Vec<usize>) {
    let positions = (0..n).flat_map(|ix| {
        let shift = 0.5 * (ix % 100) as f32;
        let row = (ix / 100) as f32;
        TRIANGLE.map(|[x, y, z]| [x + shift, y + 2.0 * row, z])
    });
    (
        Elements::Triangles(vec![[0, 1, 2]; n]),
        (0..=n).collect(),
        positions.collect(),
        (0..=n).map(|ix| 3 * ix).collect(),
    )
}

#[test]
fn many_bodies_are_those_that_are_added_one_by_one() {
    let (elements, element_offsets, positions, vertex_offsets) = parts(1000);
    let mut many = Scene::new();
    let ids = many
        .add_many(&elements, &element_offsets, &positions, &vertex_offsets)
        .expect("good");
    assert_eq!(ids.len(), 1000);
    let mut single = Scene::new();
    for part in positions.chunks(3) {
        single.add_triangles(&FACE, part).expect("good");
    }
    let mut detector = Detector::new(Backend::Cpu).expect("good");
    let rows = |detector: &mut Detector, scene: &Scene| -> Vec<[u32; 4]> {
        let pairs = detector.detect(scene, &Query::between_all()).expect("good");
        pairs.rows().collect()
    };
    let ours = rows(&mut detector, &many);
    assert!(ours.len() > 900);
    assert_eq!(ours, rows(&mut detector, &single));
    // Parts may be empty, and need not be equal.
    let elements = Elements::Triangles(vec![[0, 1, 2], [1, 2, 3]]);
    let four = [TRIANGLE[0], TRIANGLE[1], TRIANGLE[2], [1.0, 1.0, 0.0]];
    let ids = many
        .add_many(&elements, &[0, 2, 2], &four, &[0, 4, 4])
        .expect("good");
    let counts = ids
        .iter()
        .map(|&id| many.body(id).expect("known").n_elements());
    assert_eq!(counts.collect::<Vec<_>>(), [2, 0]);
}

#[test]
fn many_bodies_are_added_all_or_none() {
    let mut scene = Scene::new();
    let first = scene.add_triangles(&FACE, &TRIANGLE).expect("good");
    let gone = scene.add_triangles(&FACE, &TRIANGLE).expect("good");
    scene.remove(gone).expect("known");
    let (elements, element_offsets, mut positions, vertex_offsets) = parts(10);
    positions[3 * 7 + 1][2] = f32::INFINITY;
    let error = scene
        .add_many(&elements, &element_offsets, &positions, &vertex_offsets)
        .expect_err("infinite");
    let Error::NonFinitePosition { body, vertex, .. } = error else {
        panic!("{error}");
    };
    // The eighth part would have had the slot 8: the first one took the free slot 1.
    assert_eq!((body.index(), vertex), (8, 1));
    assert_eq!(scene.n_bodies(), 1);
    let bad = Elements::Triangles(vec![[0, 1, 3]]);
    let error = scene
        .add_many(&bad, &[0, 1], &TRIANGLE, &[0, 3])
        .expect_err("index 3 of 3");
    assert!(
        matches!(error, Error::VertexIndexOutOfRange { index: 3, .. }),
        "{error}"
    );
    let next = scene.add_triangles(&FACE, &TRIANGLE).expect("good");
    assert_eq!((first.index(), next.index(), scene.n_bodies()), (0, 1, 2));
    for (element_offsets, vertex_offsets, message) in [
        (&[][..], &[0, 3][..], "element_offsets: none given"),
        (&[1, 1], &[0, 3], "element_offsets: 1 as the first given"),
        (
            &[0, 2],
            &[0, 3],
            "element_offsets: 2 as the last of 1 given",
        ),
        (&[0, 1], &[0, 2], "vertex_offsets: 2 as the last of 3 given"),
        (
            &[0, 1],
            &[0, 2, 1, 3],
            "vertex_offsets: 1 after 2 at 2 given",
        ),
        (&[0, 1], &[0, 2, 3], "vertex_offsets: 3 numbers given"),
    ] {
        let error = scene
            .add_many(
                &Elements::from(vec![[0, 1, 2]]),
                element_offsets,
                &TRIANGLE,
                vertex_offsets,
            )
            .expect_err("bad offsets");
        assert!(error.to_string().starts_with(message), "{error}");
    }
    assert_eq!(scene.n_bodies(), 2);
}

#[test]
fn a_filter_of_the_callers_own_is_asked_once_per_pair_in_order() {
    let (elements, element_offsets, positions, vertex_offsets) = parts(300);
    let mut scene = Scene::new();
    scene
        .add_many(&elements, &element_offsets, &positions, &vertex_offsets)
        .expect("good");
    let mut detector = Detector::new(Backend::Cpu).expect("good");
    let pairs = detector
        .detect(&scene, &Query::between_all())
        .expect("good")
        .clone();
    let mut asked = Vec::new();
    let mut kept = pairs.clone();
    kept.retain(|a, b| {
        asked.push([
            a.body.index() as u32,
            a.element,
            b.body.index() as u32,
            b.element,
        ]);
        (a.body.index() + b.body.index()).is_multiple_of(3)
    });
    assert_eq!(asked, pairs.rows().collect::<Vec<_>>());
    let expected: Vec<_> = pairs
        .rows()
        .filter(|row| (row[0] + row[2]) % 3 == 0)
        .collect();
    assert!(!expected.is_empty() && expected.len() < pairs.len());
    assert_eq!(kept.rows().collect::<Vec<_>>(), expected);
}

#[test]
fn the_colliding_elements_of_all_bodies_are_found_in_one_pass() {
    let (elements, element_offsets, positions, vertex_offsets) = parts(250);
    let mut scene = Scene::new();
    let ids = scene
        .add_many(&elements, &element_offsets, &positions, &vertex_offsets)
        .expect("good");
    let lonely = TRIANGLE.map(|[x, y, z]| [x, y, z + 9.0]);
    scene.add_triangles(&FACE, &lonely).expect("good");
    let mut detector = Detector::new(Backend::Cpu).expect("good");
    let pairs = detector
        .detect(&scene, &Query::between_all())
        .expect("good");
    let all = pairs.all_colliding();
    assert_eq!(all.len(), 250);
    for (id, (body, colliding)) in ids.iter().zip(&all) {
        assert_eq!(id, body);
        assert_eq!(*colliding, pairs.colliding(*body));
        assert_eq!(*colliding, [0]);
    }
}
