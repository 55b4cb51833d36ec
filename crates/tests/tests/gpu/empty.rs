//! Bodies without vertices or elements, and scenes without bodies: the device answers as the host.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use crate::caller::Caller;
use crate::safe::{Safe, check_asked, safe_of};
use impinge_core::{Backend, BodyId, Bounds, Detector, Query, Scene, Settings};
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

/// The safe distances of a scene on the host, of bodies of which some take part.
fn of_host(scene: &Scene, query: &Query) -> Safe {
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let found = cpu.safe_distances(scene, 0.1, query).expect("good");
    let bounds = |body| match found.of(body).expect("held") {
        Bounds::F32(own) => (body, own.to_vec()),
        Bounds::F64(_) => panic!("they have positions in single precision"),
    };
    found.bodies().map(bounds).collect()
}

#[test]
fn safe_distances_of_what_has_no_elements_are_those_of_the_host() {
    let caller = Caller::new();
    let nothing = Scene::new();
    let mut scenes = vec![("no bodies", nothing.clone())];
    for kind in 0..4 {
        let mut scene = nothing.clone();
        add_empty(&mut scene, kind);
        scenes.push(("a body without vertices", scene));
    }
    let mut unused = nothing.clone();
    let lone = [[0.0f32; 3], [1.0, 0.0, 0.0]];
    let body = unused.add_triangles(&[], &lone).expect("good");
    scenes.push(("vertices without elements", unused.clone()));
    for (name, scene) in &scenes {
        let mut detector = caller.detector(Settings::default());
        let safe = safe_of(&caller, &mut detector, scene, 0.1, &Query::all(), &[]);
        assert_eq!(safe, of_host(scene, &Query::all()), "{name}");
    }
    // Beside others, first and last, in any order of questions.
    let face = [[0.0f32, 0.0, 9.0], [4.0, 0.0, 9.0], [0.0, 4.0, 9.0]];
    unused.add_triangles(&[[0, 1, 2]], &face).expect("good");
    add_empty(&mut unused, 1);
    let last = unused.add_edges(&[], &lone).expect("good");
    let mut detector = caller.detector(Settings::default());
    for query in [Query::all(), Query::all().fixed([body])] {
        let safe = safe_of(&caller, &mut detector, &unused, 0.1, &query, &[]);
        assert_eq!(safe, of_host(&unused, &query));
        let none = safe_of(&caller, &mut detector, &nothing, 0.1, &Query::all(), &[]);
        assert!(none.is_empty());
    }
    // They may be truncated, too.
    let [at, wish] = [lone, lone.map(|[x, y, z]| [x, y, z + 7.0])];
    let (start, end) = (caller.upload(&at), caller.upload(&wish));
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    let query = Query::all();
    let given = [(last, &start)];
    let safe = gpu.encode_safe_distances(&unused, 0.1, &query, &given, &mut encoder);
    let safe = safe.expect("good");
    gpu.encode_truncate(&unused, &safe, &given, &[(last, &end)], &mut encoder)
        .expect("good");
    caller.queue.submit([encoder.finish()]);
    let reached = caller.read(&end);
    let z = f32::from_bits(reached[2]);
    assert!(z > 0.0999 && z <= 0.1, "{z}");
}
