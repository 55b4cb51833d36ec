//! Lists that stay on the device say whether they are complete, whichever buffer before them was
//! too small.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::collections::{BTreeMap, BTreeSet};

use crate::caller::Caller;
use crate::stages::STAGES;

use impinge_core::{Backend, Capacities, Detector, Method, Part, Query, Scene, Settings, wgpu};
use impinge_scenes::{Random, surfaces};

/// A list as a shader of the caller's finds it: the numbers of its pairs, or none if its count is
/// above its room.
pub type Listed = Option<Vec<[u32; 2]>>;

fn listed(caller: &Caller, list: &wgpu::Buffer, n: u32, room: u64) -> Listed {
    if u64::from(n) > room {
        return None;
    }
    let words = caller.read(list);
    let mut pairs = words.as_chunks::<2>().0[..n as usize].to_vec();
    pairs.sort_unstable();
    Some(pairs)
}

/// Encodes a frame once: its pairs and its unsure pairs, and whether the host finds them complete.
pub fn frame(
    caller: &Caller,
    detector: &mut Detector,
    scene: &Scene,
    query: &Query,
) -> ([Listed; 2], bool) {
    let mut gpu = detector.gpu().expect("a device");
    let mut encoder = caller.encoder();
    let found = gpu.encode(scene, query, &[], &mut encoder).expect("good");
    caller.queue.submit([encoder.finish()]);
    let counts = caller.read(&found.counts);
    let n = |offset: u64| counts[offset as usize / 4];
    let lists = [
        (&found.pairs, n(found.n_pairs_offset), found.pairs_capacity),
        (
            &found.unsure,
            n(found.n_unsure_offset),
            found.unsure_capacity,
        ),
    ];
    let lists = lists.map(|(list, n, room)| listed(caller, list, n, room));
    (lists, gpu.grow().expect("room"))
}

/// The pairs of a step, each with the time until which it certainly does not touch.
type Times = BTreeMap<[u32; 2], u32>;

/// Encodes a step once: its pairs, or none if the count is above the room, where all first times
/// must be 0; and whether the host finds them complete.
fn step(caller: &Caller, detector: &mut Detector, scene: &Scene) -> (Option<Times>, bool) {
    let mut gpu = detector.gpu().expect("a device");
    let mut encoder = caller.encoder();
    let found = gpu.encode_step(scene, &Query::all(), &[], &[], &mut encoder);
    let found = found.expect("good");
    caller.queue.submit([encoder.finish()]);
    let n = caller.read(&found.counts)[found.n_pairs_offset as usize / 4];
    let (pairs, times) = (caller.read(&found.pairs), caller.read(&found.times));
    let first = times.as_chunks::<2>().0.iter().map(|times| times[0]);
    let pairs = if u64::from(n) > found.pairs_capacity {
        let room = found.pairs_capacity as usize;
        assert!(first.take(room).all(|time| time == 0), "nothing may move");
        None
    } else {
        let pairs = pairs.as_chunks::<2>().0[..n as usize].iter().copied();
        Some(Times::from_iter(pairs.zip(first)))
    };
    (pairs, gpu.grow().expect("room"))
}

fn with_room(caller: &Caller, settings: &Settings, room: Capacities) -> Detector {
    let (device, queue) = (caller.device.clone(), caller.queue.clone());
    let settings = settings.clone().on_device(device, queue);
    Detector::with_capacities(settings, room).expect("settings")
}

fn ample() -> Capacities {
    let mut room = Capacities::default();
    (room.queue, room.items) = (1 << 17, 1 << 17);
    (room.candidates, room.pairs, room.unsure) = (1 << 20, 1 << 18, 1 << 17);
    room
}

/// Triangles of a lattice, each a body: the traversal has far more pairs than it begins with.
/// Between the two ends of a step every third one moves.
fn many(n_bodies: usize) -> Scene {
    let mut random = Random::new(5);
    let mut scene = Scene::new();
    for ix in 0..n_bodies {
        let [start, end] = [(); 2].map(|()| {
            let mut at = || [(); 3].map(|()| random.below(10) as f32);
            [at(), at(), at()]
        });
        let body = scene.add_triangles(&[[0, 1, 2]], &start).expect("good");
        if ix % 3 == 0 {
            scene.set_end_positions(body, &end).expect("good");
        }
    }
    scene
}

/// Two bodies of slivers whose boxes all meet, though few slivers do: of the buffers with the room
/// that they have at first, only that of candidates is too small.
fn slivers() -> (Scene, Query) {
    let mut random = Random::new(1);
    let n = 700;
    let mut body = |shift: f32| {
        Vec::from_iter((0..n).flat_map(|_| {
            let [u, v, _] = random.point(0.0, 0.2);
            let u = u + shift;
            [[u, v, 0.0], [u + 1.0, v + 1.0, 1.0], [u + 1e-4, v, 0.0]]
        }))
    };
    let a = body(0.0);
    let mut b = body(0.3);
    for ix in 0..40 {
        for corner in 0..3 {
            b[3 * 17 * ix + corner] = a[3 * 13 * ix + corner];
        }
    }
    let faces = Vec::from_iter((0..n).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]));
    let mut scene = Scene::new();
    let [a, b] = [a, b].map(|at| scene.add_triangles(&faces, &at).expect("good"));
    (scene, Query::between(a, b))
}

#[test]
fn counts_of_frames_say_what_is_missing() {
    let caller = Caller::new();
    let (scene, query) = (many(300), Query::all());
    for method in [Method::Clusters, Method::Cells] {
        let settings = Settings::new().method(method);
        let mut detector = with_room(&caller, &settings, ample());
        let (truth, is_complete) = frame(&caller, &mut detector, &scene, &query);
        assert!(is_complete);
        let n = truth
            .each_ref()
            .map(|list| list.as_ref().map_or(0, Vec::len));
        assert!(n[0] > 1000 && n[1] > 10, "{n:?}");
        for (stage, shrink) in STAGES {
            let mut room = ample();
            shrink(&mut room);
            let mut detector = with_room(&caller, &settings, room);
            let (lists, is_complete) = frame(&caller, &mut detector, &scene, &query);
            // Whether the method has this stage, and which lists it is before.
            let are_short = match (stage, method) {
                ("queue", Method::Cells) | ("kept" | "entries", Method::Clusters) => [false; 2],
                ("pairs", _) => [true, false],
                ("unsure", _) => [false, true],
                _ => [true; 2],
            };
            let name = format!("{method:?} {stage}");
            assert_eq!(is_complete, are_short == [false; 2], "{name}");
            for ((list, truth), is_short) in lists.iter().zip(&truth).zip(are_short) {
                assert_eq!(list.is_none(), is_short, "{name}");
                assert!(is_short || list == truth, "{name}");
            }
        }
    }
}

#[test]
fn counts_of_steps_say_what_is_missing() {
    let caller = Caller::new();
    let scene = many(120);
    let settings = Settings::default();
    let mut detector = with_room(&caller, &settings, ample());
    let (truth, is_complete) = step(&caller, &mut detector, &scene);
    assert!(is_complete && truth.as_ref().is_some_and(|pairs| pairs.len() > 100));
    for (stage, shrink) in STAGES {
        let mut room = ample();
        shrink(&mut room);
        let mut detector = with_room(&caller, &settings, room);
        let (pairs, is_complete) = step(&caller, &mut detector, &scene);
        let is_there = !matches!(stage, "kept" | "entries");
        assert_eq!(is_complete, !is_there, "{stage}");
        assert_eq!(pairs.is_none(), is_there, "{stage}");
        assert!(is_there || pairs == truth, "{stage}");
    }
}

/// Points fall through the boxes of triangles that all lie on each other, and four of them through
/// the triangles: few pairs touch, among more candidates than there is room for at first.
#[test]
fn points_that_fall_onto_triangles_are_not_lost_silently() {
    let caller = Caller::new();
    let mut scene = Scene::new();
    let n = 900;
    let faces = Vec::from_iter((0..n).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]));
    let corners = [[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let corners = Vec::from_iter((0..n).flat_map(|_| corners));
    scene.add_triangles(&faces, &corners).expect("good");
    let at = |ix: u32, z: f32| match ix + 4 < n {
        true => [0.75 + 0.0001 * ix as f32, 0.75, z],
        false => [0.25, 0.25, z],
    };
    let above = Vec::from_iter((0..n).map(|ix| at(ix, 0.5)));
    let below = Vec::from_iter((0..n).map(|ix| at(ix, -0.5)));
    let points = scene.add_points(&above).expect("good");
    scene.set_end_positions(points, &below).expect("good");
    let mut detector = caller.detector(Settings::default());
    let (pairs, is_complete) = step(&caller, &mut detector, &scene);
    assert!(pairs.is_none() && !is_complete);
    let mut tries = (0..3).map(|_| step(&caller, &mut detector, &scene));
    let complete = tries.find_map(|(pairs, is_complete)| pairs.filter(|_| is_complete));
    assert!(complete.is_some_and(|pairs| pairs.len() >= 4 * n as usize));
}

#[test]
fn small_bindings_are_no_room() {
    let mut caller = Caller::new();
    let (scene, query) = (many(300), Query::all());
    let mut detector = with_room(&caller, &Settings::default(), ample());
    let (truth, is_complete) = frame(&caller, &mut detector, &scene, &query);
    assert!(is_complete);
    caller = Caller::with(wgpu::Limits {
        max_storage_buffer_binding_size: 1 << 18,
        ..wgpu::Limits::default()
    });
    let mut detector = caller.detector(Settings::default());
    let mut gpu = detector.gpu().expect("a device");
    let mut encoder = caller.encoder();
    let found = gpu.encode(&scene, &query, &[], &mut encoder);
    let found = found.expect("good");
    caller.queue.submit([encoder.finish()]);
    let n = caller.read(&found.counts)[found.n_pairs_offset as usize / 4];
    let pairs = listed(&caller, &found.pairs, n, found.pairs_capacity);
    assert!(pairs.is_none() || pairs == truth[0]);
    assert!(
        pairs.is_some() || gpu.grow().is_err(),
        "no room can be made"
    );
}

#[test]
fn damaged_ends_are_noticed() {
    let caller = Caller::new();
    let (scene, query) = slivers();
    let mut detector = with_room(&caller, &Settings::default(), ample());
    let (truth, _) = frame(&caller, &mut detector, &scene, &query);
    // A web of which the default room does not hold all pairs.
    let mut random = Random::new(5);
    let n: u32 = 600;
    let mut at = || [(); 3].map(|()| random.below(10) as f32);
    let [start, end] = [(); 2].map(|()| Vec::from_iter((0..n).map(|_| at())));
    let faces = (0..n / 3).map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % n]);
    let mut web = Scene::new();
    let body = web.add_triangles(&Vec::from_iter(faces), &start);
    web.set_end_positions(body.expect("good"), &end)
        .expect("good");
    let holds = |mut detector: Detector| {
        let asks = || {
            let (lists, _) = frame(&caller, &mut detector, &scene, &query);
            for (list, truth) in lists.iter().zip(&truth) {
                assert!(list.is_none() || list == truth);
            }
            let (pairs, is_complete) = step(&caller, &mut detector, &web);
            assert_eq!(pairs.is_some(), is_complete);
        };
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(asks)).is_ok()
    };
    assert!(holds(caller.detector(Settings::default())));
    let mut unnoticed = Vec::new();
    for (line, damaged) in [
        ("select(n, max(n, room + 1u), are_missing)", "n"),
        (
            "atomicLoad(&counters[N_CANDIDATES]) > params.capacity",
            "false",
        ),
        ("times[ix].free_until = 0.0;", ""),
        ("if n_unsure > room {", "if n_unsure > room + room {"),
    ] {
        let damage = ("lists_end", line, damaged);
        if holds(caller.damaged(Settings::default(), damage)) {
            unnoticed.push(damage);
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}

#[test]
fn parts_of_a_frame_tell_bodies_apart() {
    let caller = Caller::new();
    let mut scene = Scene::new();
    // Bodies of different sizes that all overlap.
    let bodies = [300, 500, 400, 600].map(|n| {
        let ball = surfaces::bumpy_ball(n, 0.3);
        let ball = ball.translated([0.0007 * n as f32, 0.0, 0.1]);
        ball.add_to(&mut scene).expect("good")
    });
    scene.remove(bodies[0]).expect("known");
    let [_, a, b, c] = bodies;
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    for (query, n_parts) in [
        (Query::all(), 3),
        (Query::between(b, c), 2),
        (Query::between(c, a), 2),
        (Query::across([b]), 3),
        (Query::between_all().exclude((a, b)), 3),
        (Query::self_of(c), 1),
    ] {
        let mut detector = caller.detector(Settings::default());
        let mut gpu = detector.gpu().expect("a device");
        let mut encoder = caller.encoder();
        let found = gpu.encode(&scene, &query, &[], &mut encoder);
        let found = found.expect("good");
        caller.queue.submit([encoder.finish()]);
        assert!(gpu.grow().expect("room"));
        assert_eq!(found.parts.len(), n_parts, "{query:?}");
        let mut next = 0;
        for part in &found.parts {
            assert_eq!((part.part, part.first), (Part::Given, next));
            let n = scene.body(part.body).expect("takes part").n_elements();
            assert_eq!(part.len as usize, n);
            next += part.len;
        }
        let named = |number: u32| {
            let mut parts = found.parts.iter();
            let part = parts.find(|part| (part.first..part.first + part.len).contains(&number));
            let part = part.expect("a part has each number");
            (part.body, number - part.first)
        };
        let counts = caller.read(&found.counts);
        let pairs = |list, offset: u64, room| {
            let listed = listed(&caller, list, counts[offset as usize / 4], room);
            let pairs = listed.expect("complete").into_iter();
            BTreeSet::from_iter(pairs.map(|pair| pair.map(named)))
        };
        let certain = pairs(&found.pairs, found.n_pairs_offset, found.pairs_capacity);
        let unsure = pairs(&found.unsure, found.n_unsure_offset, found.unsure_capacity);
        let truth = cpu.detect(&scene, &query).expect("good");
        let truth = truth
            .iter()
            .map(|(a, b)| [(a.body, a.element), (b.body, b.element)]);
        let truth = BTreeSet::from_iter(truth);
        assert!(certain.is_subset(&truth), "{query:?}");
        assert!(
            truth
                .iter()
                .all(|pair| certain.contains(pair) || unsure.contains(pair))
        );
        assert!(n_parts == 1 || truth.len() > 20, "{query:?}");
    }
}
