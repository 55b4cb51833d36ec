//! Properties that curves must have for all bodies.

use impinge_core::contact::{Contacts, Curves, Feature, Shape};
use impinge_core::{Backend, Detector, Query, Scene, Settings, SharedVertex};
use impinge_scenes::{Model, surfaces};

use super::{contacts_of, detect};

fn crossing(a: &Model, b: &Model) -> (Contacts, Curves) {
    let mut scene = Scene::new();
    let ids = [a, b].map(|model| model.add_to(&mut scene).unwrap());
    let pairs = detect(&scene, &Query::between(ids[0], ids[1]));
    let contacts = contacts_of(&scene, &pairs);
    let curves = contacts.curves().unwrap();
    (contacts, curves)
}

/// Every segment is in exactly one curve.
fn check_cover(contacts: &Contacts, curves: &Curves) {
    let mut expected: Vec<[u32; 2]> = (0..contacts.len())
        .filter(|&ix| contacts.shape(ix) == Shape::Segment)
        .map(|ix| {
            let corners = contacts.corners(ix);
            [corners[0].min(corners[1]), corners[0].max(corners[1])]
        })
        .collect();
    expected.sort_unstable();
    expected.dedup();
    let mut found = Vec::new();
    for curve in 0..curves.len() {
        let points = curves.points(curve);
        let n = points.len() - usize::from(!curves.is_closed(curve));
        for ix in 0..n {
            let (p, q) = (points[ix], points[(ix + 1) % points.len()]);
            found.push([p.min(q), p.max(q)]);
        }
    }
    found.sort_unstable();
    assert_eq!(found, expected);
}

#[test]
fn closed_surfaces_cross_in_loops() {
    let ball = surfaces::bumpy_ball(3_000, 0.2);
    for (b, offset) in [
        (surfaces::torus(60, 30, 1.0, 0.4), [0.3, 0.1, 0.2]),
        (surfaces::bumpy_ball(2_000, 0.3), [0.7, 0.123, 0.321]),
    ] {
        let b = b.translated(offset);
        let (contacts, curves) = crossing(&ball, &b);
        assert!(contacts.len() > 100);
        assert!(curves.n_closed() > 0);
        assert_eq!(curves.n_closed(), curves.len());
        assert!((0..curves.len()).all(|curve| curves.is_directed(curve)));
        assert!(curves.isolated().is_empty());
        check_cover(&contacts, &curves);
        // With the bodies swapped, the curves are the same but run the other way.
        let (_, swapped) = crossing(&b, &ball);
        assert_eq!(swapped.len(), curves.len());
        assert!((swapped.total_length() - curves.total_length()).abs() < 1e-9);
    }
}

/// Two balls of radius 1/2 at distance 1/2 cross in a circle of radius √3/4.
#[test]
fn a_known_circle() {
    let ball = surfaces::icosphere(5);
    let (_, curves) = crossing(&ball, &ball.translated([0.5, 0.003, 0.007]));
    assert_eq!((curves.len(), curves.n_closed()), (1, 1));
    let expected = std::f64::consts::PI * 3f64.sqrt() / 2.0;
    assert!(
        (curves.length(0) / expected - 1.0).abs() < 5e-3,
        "{}",
        curves.length(0)
    );
}

/// Seen from outside the first body, its part beneath the second body's surface lies to the left.
#[test]
fn a_curve_runs_around_what_is_inside() {
    // A floor that faces up, and a cube whose lower half is beneath it.
    let floor = Model {
        positions: vec![[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]],
        elements: vec![[0, 1, 2]].into(),
    };
    let cube = surfaces::cube([0.1, 0.2, 0.0], 1.0);
    let area = |contacts: &Contacts, curves: &Curves| {
        let points = curves.points(0);
        let at = |k: usize| contacts.points()[points[k % points.len()] as usize];
        (0..points.len())
            .map(|k| 0.5 * (at(k)[0] * at(k + 1)[1] - at(k)[1] * at(k + 1)[0]))
            .sum::<f64>()
    };
    // The floor's square inside the cube is to the left: counter-clockwise from above.
    let (contacts, curves) = crossing(&floor, &cube);
    assert_eq!(
        (curves.len(), curves.is_closed(0), curves.is_directed(0)),
        (1, true, true)
    );
    assert!((area(&contacts, &curves) - 1.0).abs() < 1e-6);
    assert!((curves.length(0) - 4.0).abs() < 1e-6);
    // The cube's lower half is to the left: clockwise from above.
    let (contacts, curves) = crossing(&cube, &floor);
    assert!((area(&contacts, &curves) + 1.0).abs() < 1e-6);
}

#[test]
fn touching_is_told_from_crossing() {
    // A vertex on a face: a point and no curve.
    let floor = surfaces::cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]);
    let tip = Model {
        positions: vec![
            [0.5, 0.25, 0.0],
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 1.0],
            [-1.0, -1.0, 1.5],
        ],
        elements: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]].into(),
    };
    let (contacts, curves) = crossing(&floor, &tip);
    assert!(curves.is_empty());
    assert_eq!(curves.isolated().len(), 1);
    let name = contacts.names()[curves.isolated()[0] as usize];
    assert!(matches!(
        name.features,
        [Feature::Face(_), Feature::Vertex(0)]
    ));
    assert_eq!(contacts.points()[0], [0.5, 0.25, 0.0]);

    // An edge on a face: one open curve, though four pairs have the segment.
    let roof = Model {
        positions: vec![
            [0.0, 0.25, 0.0],
            [1.0, 0.25, 0.0],
            [0.5, 1.0, 1.0],
            [0.5, -1.0, 1.0],
        ],
        elements: vec![[0, 1, 2], [1, 0, 3], [0, 2, 3], [1, 3, 2]].into(),
    };
    let (contacts, curves) = crossing(&floor, &roof);
    assert_eq!((curves.len(), curves.n_closed()), (1, 0));
    assert_eq!(curves.length(0), 1.0);
    check_cover(&contacts, &curves);

    // A box on a box: polygons, and the border of the patch is a loop.
    let on_top = surfaces::cuboid([-1.0, -1.0, 0.0], [1.0, 2.0, 3.0]);
    let (contacts, curves) = crossing(&floor, &on_top);
    assert!(contacts.shapes().contains(&Shape::Polygon));
    assert_eq!((curves.len(), curves.n_closed()), (1, 1));
    assert!((curves.length(0) - 10.0).abs() < 1e-12);
    assert!(curves.isolated().is_empty());
    check_cover(&contacts, &curves);
}

/// A mesh that repeats its vertices for every face has the curves of the mesh that does not.
#[test]
fn repeated_vertices_do_not_break_curves() {
    let ball = surfaces::bumpy_ball(1_000, 0.2);
    let other = ball.translated([0.5, 0.01, 0.02]);
    let (_, curves) = crossing(&ball, &other);
    let soup = |model: &Model| {
        let corners: Vec<u32> = (0..model.elements.len())
            .flat_map(|face| model.elements.corners(face).to_vec())
            .collect();
        let faces: Vec<[u32; 3]> = (0u32..corners.len() as u32 / 3)
            .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
            .collect();
        Model {
            positions: corners
                .iter()
                .map(|&v| model.positions[v as usize])
                .collect(),
            elements: faces.into(),
        }
    };
    let (contacts, again) = crossing(&soup(&ball), &soup(&other));
    assert_eq!(again.len(), curves.len());
    assert_eq!(again.n_closed(), again.len());
    assert_eq!(again.all_points().len(), curves.all_points().len());
    check_cover(&contacts, &again);
}

/// Two sheets of one body: its self-collision has open curves and loops.
#[test]
fn a_body_that_runs_into_itself() {
    let ball = surfaces::ball(600);
    let mut positions = ball.positions.clone();
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for copy in 0..2u32 {
        let n = ball.positions.len() as u32;
        if copy == 1 {
            positions.extend(ball.translated([0.4, 0.05, 0.03]).positions);
        }
        for face in 0..ball.elements.len() {
            let corners = ball.elements.corners(face);
            faces.push([0, 1, 2].map(|k| corners[k] + copy * n));
        }
    }
    let mut scene = Scene::new();
    let id = scene.add_triangles(&faces, &positions).unwrap();
    for rule in [SharedVertex::Skip, SharedVertex::Resolve] {
        let pairs = detect(&scene, &Query::self_of(id).shared_vertex(rule));
        let contacts = contacts_of(&scene, &pairs);
        let curves = contacts.curves().unwrap();
        assert!(!curves.is_empty());
        assert_eq!(curves.n_closed(), curves.len());
        check_cover(&contacts, &curves);
    }
}

#[test]
fn threads_change_nothing() {
    let a = surfaces::bumpy_ball(4_000, 0.3);
    let b = a.translated([0.3, 0.2, 0.1]);
    let mut scene = Scene::new();
    let ids = [&a, &b].map(|model| model.add_to(&mut scene).unwrap());
    let pairs = detect(&scene, &Query::between(ids[0], ids[1]));
    let run = |n_threads: usize| {
        let mut detector =
            Detector::new(Settings::new().backend(Backend::Cpu).threads(n_threads)).unwrap();
        let contacts = detector.contacts(&scene, &pairs).unwrap();
        let bits: Vec<[u64; 3]> = contacts
            .points()
            .iter()
            .map(|p| p.map(f64::to_bits))
            .collect();
        let curves = contacts.curves().unwrap();
        (
            bits,
            contacts.all_corners().to_vec(),
            contacts.names().to_vec(),
            curves.all_points().to_vec(),
        )
    };
    let one = run(1);
    assert!(one.0.len() > 500);
    for n_threads in [2, 3, 7] {
        assert!(run(n_threads) == one, "{n_threads} threads");
    }
}

#[test]
fn pairs_of_another_scene_are_refused_by_name() {
    let ball = surfaces::ball(500);
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.5, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let pairs = detect(&scene, &Query::between(a, b));
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    // Also if there are as many elements as before.
    let triangle = (vec![[0u32, 1, 2]].into(), vec![[0.0f32; 3]; 3]);
    for mesh in [triangle, (ball.elements.clone(), ball.positions.clone())] {
        let mut scene = scene.clone();
        scene.remesh(b, mesh).unwrap();
        let error = detector.contacts(&scene, &pairs).unwrap_err().to_string();
        assert!(
            error.starts_with("body 1: the pairs were found before it was re-meshed"),
            "{error}"
        );
    }
    // After the scene has changed, pairs may no longer meet.
    scene
        .set_positions(b, vec![[50.0f32; 3]; ball.positions.len()])
        .unwrap();
    let contacts = contacts_of(&scene, &pairs);
    assert!(contacts.shapes().iter().all(|&shape| shape == Shape::Apart));
    assert!(contacts.points().is_empty() && contacts.curves().unwrap().is_empty());
}

/// A sum of nothing is 0, which nobody should read as -0.
#[test]
fn what_does_not_meet_has_length_and_volume_0() {
    let ball = surfaces::ball(80);
    let apart = ball.translated([5.0, 0.0, 0.0]);
    let (contacts, curves) = crossing(&ball, &apart);
    assert!(contacts.is_empty() && curves.is_empty());
    assert_eq!(curves.total_length().to_bits(), 0);
    let volume = impinge_core::contact::Penetration::default().volume();
    assert_eq!(volume.map(f64::to_bits), Some(0));
}

/// Points are one if their names are: a face that is there twice has points of its own.
#[test]
fn a_face_that_is_there_twice_doubles_points_and_curves() {
    let mut scene = Scene::new();
    let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let blade = [[1.0f32, 1.0, -1.0], [2.0, 1.0, -1.0], [1.0, 1.0, 1.0]];
    let a = scene
        .add_triangles(&[[0, 1, 2], [2, 1, 0]], &floor)
        .unwrap();
    let b = scene.add_triangles(&[[0, 1, 2]], &blade).unwrap();
    let contacts = contacts_of(&scene, &detect(&scene, &Query::between(a, b)));
    assert_eq!(contacts.points().len(), 4);
    assert_eq!(contacts.points()[..2], contacts.points()[2..]);
    assert_eq!(contacts.curves().unwrap().len(), 2);
    assert_eq!(contacts.regions().unwrap().len(), 2);
}
