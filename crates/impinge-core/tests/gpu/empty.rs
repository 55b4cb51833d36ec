//! Bodies without vertices or elements, and scenes without bodies: the device answers as the host.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use crate::caller::Caller;
use crate::safe::{check_asked, safe_of};
use impinge_core::{Backend, BodyId, Detector, Query, Scene, Settings};
use impinge_scenes::Random;

/// No positions at all.
const NONE: [[f32; 3]; 0] = [];

/// Adds a body without vertices: of points, edges, triangles or tetrahedra.
fn add_empty(scene: &mut Scene, kind: usize) -> BodyId {
    let added = match kind {
        0 => scene.add_points(&NONE),
        1 => scene.add_edges(&[], &NONE),
        2 => scene.add_triangles(&[], &NONE),
        _ => scene.add_tetrahedra(&[], &NONE),
    };
    added.expect("good")
}

/// Triangles that cross each other often: every other one is flat.
fn place(random: &mut Random, scene: &mut Scene, bodies: &[BodyId]) {
    let tilted = [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]];
    let flat = [[-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [-1.0, 2.0, 0.0]];
    for (ix, &body) in bodies.iter().enumerate() {
        let mut placed = || {
            let by = random.point(-0.5, 0.5);
            [tilted, flat][ix % 2].map(|at: [f32; 3]| [0, 1, 2].map(|k| at[k] + by[k]))
        };
        let [start, end] = [placed(), placed()];
        scene.set_positions(body, &start).expect("good");
        scene.set_end_positions(body, &end).expect("good");
    }
}

/// Asks a frame, a step and safe distances, in an order of its own; all against the CPU. Returns
/// how many pairs and contacts there are.
fn ask(
    (caller, detector): (&Caller, &mut Detector),
    scene: &Scene,
    first: usize,
    name: &str,
) -> [usize; 2] {
    let query = Query::all();
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let mut n = [0; 2];
    for ix in first..first + 3 {
        match ix % 3 {
            0 => {
                let found = detector.detect(scene, &query).expect("good");
                let expected = cpu.detect(scene, &query).expect("good");
                assert!(found.rows().eq(expected.rows()), "{name}: a frame");
                n[0] = expected.len();
            }
            1 => {
                let found = detector.impacts(scene, &query).expect("good");
                let expected = cpu.impacts(scene, &query).expect("good");
                assert!(found.iter().eq(expected.iter()), "{name}: a step");
                n[1] = expected.len();
            }
            _ => {
                let safe = safe_of(caller, detector, scene, 0.3, &query, &[]);
                check_asked(name, scene, &safe, (0.3, &[]), query.clone());
            }
        }
    }
    n
}

#[test]
fn bodies_without_vertices_do_not_keep_others_from_being_sent() {
    let caller = Caller::new();
    let face = [[0.0f32; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let mut n = [0; 2];
    for kind in 0..4 {
        for at in 0..4 {
            let mut random = Random::new(kind as u64);
            let mut detector = caller.detector(Settings::default());
            let (mut scene, mut bodies) = (Scene::new(), Vec::new());
            let mut empty = None;
            for ix in 0..4 {
                if ix == at {
                    empty = Some(add_empty(&mut scene, kind));
                }
                if ix < 3 {
                    bodies.push(scene.add_triangles(&[[0, 1, 2]], &face).expect("good"));
                }
            }
            let empty = empty.expect("added");
            for round in 0..4 {
                // All are sent, or the last ones alone.
                let moved = if round % 2 == 0 {
                    &bodies
                } else {
                    &bodies[1..]
                };
                place(&mut random, &mut scene, moved);
                scene.set_positions(empty, &NONE).expect("good");
                let name = format!("kind {kind} at {at} in round {round}");
                let own = ask((&caller, &mut detector), &scene, at + round, &name);
                n = [n[0] + own[0], n[1] + own[1]];
            }
        }
    }
    assert!(n[0] > 30 && n[1] > 60, "{n:?}");
}

/// Positions are sent by tasks: bodies without vertices where one ends.
#[test]
fn bodies_without_vertices_lie_between_tasks() {
    let caller = Caller::new();
    let mut random = Random::new(3);
    let mut scene = Scene::new();
    let points = Vec::from_iter((0..1 << 14).map(|_| random.point(-9.0, 9.0)));
    scene.add_points(&points).expect("good");
    let mut bodies = Vec::new();
    for kind in 0..4 {
        add_empty(&mut scene, kind);
        let face = [[0.0f32; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        bodies.push(scene.add_triangles(&[[0, 1, 2]], &face).expect("good"));
        add_empty(&mut scene, kind);
    }
    let mut detector = caller.detector(Settings::default());
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    for _ in 0..3 {
        place(&mut random, &mut scene, &bodies);
        let found = detector.detect(&scene, &Query::all()).expect("good");
        let expected = cpu.detect(&scene, &Query::all()).expect("good");
        assert!(found.rows().eq(expected.rows()) && !expected.is_empty());
    }
}
