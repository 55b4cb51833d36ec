//! Safe distances that stay on the device, held by exact tests against every pair that is near.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::collections::BTreeMap;

use crate::caller::Caller;
use impinge_core::exact::{ElementPair, Point, are_within};
use impinge_core::{
    Backend, BodyId, Detector, Element, Error, PairKind, Part, Query, Scene, Settings, Thickness,
    wgpu,
};
use impinge_scenes::{Model, Random, soup, surfaces};
use impinge_testing::data::test_file;
use impinge_tests::thickness_of;

/// The bounds of each body.
pub type Safe = BTreeMap<BodyId, Vec<f32>>;

/// Encodes safe distances, and reads them. Also returns whether there was room.
fn encoded(
    caller: &Caller,
    detector: &mut Detector,
    scene: &Scene,
    most: f64,
    query: &Query,
    positions: &[(BodyId, &wgpu::Buffer)],
) -> (Safe, bool) {
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    let found = gpu.encode_safe_distances(scene, most, query, positions, &mut encoder);
    let found = found.expect("good buffers");
    caller.queue.submit([encoder.finish()]);
    let words = caller.read(&found.distances);
    let own = |at: &impinge_core::ResidentVertices| {
        let words = &words[at.first as usize..][..at.len as usize];
        (at.body, words.iter().map(|&x| f32::from_bits(x)).collect())
    };
    let safe = found.bodies.iter().map(own).collect();
    let has_room = detector.gpu().expect("a device").grow().expect("room");
    (safe, has_room)
}

/// Encodes them until there is room.
pub fn safe_of(
    caller: &Caller,
    detector: &mut Detector,
    scene: &Scene,
    most: f64,
    query: &Query,
    positions: &[(BodyId, &wgpu::Buffer)],
) -> Safe {
    for _ in 0..9 {
        let (safe, has_room) = encoded(caller, detector, scene, most, query, positions);
        if has_room {
            return safe;
        }
        assert!(safe.values().flatten().all(|&bound| bound == 0.0));
    }
    panic!("there never is enough room");
}

/// The corners of an element, and where they are.
fn corners(scene: &Scene, kind: PairKind, side: usize, of: Element) -> (Vec<u32>, Vec<Point>) {
    let body = scene.body(of.body).expect("held");
    let corners = match kind.parts()[side] {
        Part::Vertices => vec![of.element],
        part => body.part(part).corners(of.element as usize).to_vec(),
    };
    let point = |&corner: &u32| body.positions().point(corner as usize);
    let points = corners.iter().map(point).collect();
    (corners, points)
}

/// How thick the device takes an element to be: as its thickest vertex, and a vertex as the thickest
/// element beside it.
fn thickness_of_vertices(scene: &Scene, body: BodyId, corners: &[u32]) -> f64 {
    let of = |&vertex: &u32| thickness_of(scene, body, Part::Vertices, vertex);
    corners.iter().map(of).fold(0.0, f64::max)
}

/// Holds the bounds against every pair that is near: together, two elements certainly move less
/// than they are apart, and how thick they are, and no bound is much smaller than it must be. Returns how many pairs
/// touch, and how many vertices have a bound that is neither 0 nor `most`.
fn check(name: &str, scene: &Scene, safe: &Safe, most: f64, fixed: &[BodyId]) -> [usize; 2] {
    check_asked(name, scene, safe, (most, fixed), Query::all())
}

/// [`check`] of a query.
pub fn check_asked(
    name: &str,
    scene: &Scene,
    safe: &Safe,
    (most, fixed): (f64, &[BodyId]),
    query: Query,
) -> [usize; 2] {
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let near = cpu.near(scene, 2.0 * most, &query.distances());
    let near = near.expect("good");
    let mut least: BTreeMap<(BodyId, u32), f64> = BTreeMap::new();
    let mut width = 0.0f64;
    let mut n_touching = 0;
    for pair in near.iter() {
        let test = match pair.kind {
            PairKind::VertexFace => ElementPair::VertexFace,
            PairKind::EdgeEdge => ElementPair::EdgeEdge,
            PairKind::EdgeVertex => ElementPair::VertexEdge,
            PairKind::VertexVertex => ElementPair::VertexVertex,
            // Their edges and vertices are looked at.
            _ => continue,
        };
        let elements = [pair.a, pair.b];
        let sides = [0, 1].map(|side| corners(scene, pair.kind, side, elements[side]));
        let moves = [0, 1].map(|side| {
            let bounds = &safe[&elements[side].body];
            let own = sides[side].0.iter().map(|&corner| bounds[corner as usize]);
            f64::from(own.fold(0.0, f32::max))
        });
        let mut order = [0, 1];
        if pair.kind == PairKind::EdgeVertex {
            order.reverse();
        }
        let mut four = [[0.0; 3]; 4];
        let all = order.iter().flat_map(|&side| &sides[side].1);
        for (to, from) in four.iter_mut().zip(all) {
            *to = *from;
        }
        let parts = pair.kind.parts();
        let [thick, as_vertices] = [false, true].map(|is_by_vertices| {
            let of = [0, 1].map(|side| {
                let (body, corners) = (elements[side].body, &sides[side].0);
                match is_by_vertices {
                    false => thickness_of(scene, body, parts[side], elements[side].element),
                    true => thickness_of_vertices(scene, body, corners),
                }
            });
            of[0] + of[1]
        });
        // Both are floats in single precision: their sum is exact, but for very different ones.
        let sum = (moves[0] + moves[1]).next_up() + thick;
        if are_within(test, &four, if moves == [0.0; 2] { thick } else { sum }) {
            assert_eq!(moves, [0.0; 2], "{name}: {pair:?}");
            n_touching += 1;
        }
        let distance = (pair.distance.expect("asked for") - as_vertices).max(0.0);
        let are_fixed = elements.map(|of| fixed.contains(&of.body));
        for side in 0..2 {
            let share = match are_fixed {
                [false, false] => distance / 2.0,
                _ => distance,
            };
            for &corner in &sides[side].0 {
                let least = least.entry((elements[side].body, corner)).or_insert(most);
                *least = least.min(share);
            }
            for (p, q) in sides[0]
                .1
                .iter()
                .flat_map(|p| sides[1].1.iter().map(move |q| (p, q)))
            {
                for k in 0..3 {
                    width = width.max((p[k] - q[k]).abs());
                }
            }
        }
    }
    let mut n_bounded = 0;
    for (&body, bounds) in safe {
        let is_fixed = fixed.contains(&body);
        for (vertex, &bound) in (0..).zip(bounds) {
            let bound = f64::from(bound);
            if is_fixed {
                assert_eq!(bound, 0.0, "{name}");
                continue;
            }
            let least = least.get(&(body, vertex)).copied().unwrap_or(most);
            assert!(bound <= most, "{name}");
            let slack = width * 2f64.powi(-16) + most * 2f64.powi(-23);
            assert!(
                bound >= least * (1.0 - 1.0 / 64.0) - slack,
                "{name}: {body} {vertex}: {bound} {least}"
            );
            n_bounded += usize::from(bound > 0.0 && bound < most * 0.999);
        }
    }
    [n_touching, n_bounded]
}

/// Numbers that are exact in single precision.
fn singles(points: &[[f64; 3]]) -> Vec<[f32; 3]> {
    points.iter().map(|p| p.map(|x| x as f32)).collect()
}

/// A body and its positions.
type Placed = (BodyId, Vec<[f32; 3]>);

/// Small bodies of every kind: on a lattice, where many elements touch, are parallel or degenerate,
/// or at random; with their positions in single precision.
fn small(seed: u64, is_lattice: bool) -> (Scene, Vec<Placed>) {
    let mut random = Random::new(seed);
    let mut points = |n: usize| -> Vec<[f64; 3]> {
        let point = |_| match is_lattice {
            true => [0; 3].map(|_| f64::from(random.below(5))),
            false => random.point(-1.0, 1.0).map(f64::from),
        };
        (0..n).map(point).collect()
    };
    let all = [points(9), points(5), points(6), points(5)];
    let mut scene = Scene::new();
    // In double precision: of these the device has positions that nobody has rounded.
    let bodies = [
        scene.add_triangles(&[[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 5]], &all[0]),
        scene.add_tetrahedra(&[[0, 1, 2, 3]], &all[1]),
        scene.add_edges(&[[0, 1], [1, 2], [3, 4], [5, 5]], &all[2]),
        scene.add_points(&all[3]),
    ];
    let bodies = bodies.map(|body| body.expect("good"));
    let held = bodies.into_iter().zip(all.iter().map(|at| singles(at)));
    (scene, held.collect())
}

#[test]
fn together_two_elements_move_less_than_they_are_apart() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (mut n_touching, mut n_bounded) = (0, 0);
    for seed in 0..24 {
        let (scene, bodies) = small(seed, seed % 2 == 0);
        let fixed = match seed % 3 {
            0 => vec![],
            1 => vec![bodies[0].0],
            _ => vec![bodies[1].0, bodies[3].0],
        };
        let most = [0.05, 0.3, 2.0][seed as usize / 2 % 3];
        let query = Query::all().fixed(fixed.iter().copied());
        let buffers = Vec::from_iter(bodies.iter().map(|(_, at)| caller.upload(at)));
        let ids = bodies.iter().map(|(body, _)| *body);
        let positions = Vec::from_iter(ids.zip(&buffers));
        let mut truth = scene.clone();
        for (body, at) in &bodies {
            truth.set_positions(*body, at).expect("good");
        }
        // Of the bodies on the device the host knows another pose.
        let mut known = scene.clone();
        for (body, at) in &bodies {
            let moved = Vec::from_iter(at.iter().map(|p| p.map(|x| f64::from(x) + 0.25)));
            known.set_positions(*body, &moved).expect("good");
        }
        let of_device = safe_of(&caller, &mut detector, &known, most, &query, &positions);
        let of_host = safe_of(&caller, &mut detector, &truth, most, &query, &[]);
        assert_eq!(of_device, of_host, "{seed}");
        let own = check(&format!("{seed}"), &truth, &of_host, most, &fixed);
        (n_touching, n_bounded) = (n_touching + own[0], n_bounded + own[1]);
        // Positions that the host has rounded.
        let rounded = safe_of(
            &caller,
            &mut detector,
            &scene,
            most,
            &query,
            &positions[..1],
        );
        let mut half = scene.clone();
        half.set_positions(bodies[0].0, &bodies[0].1).expect("good");
        check(&format!("rounded {seed}"), &half, &rounded, most, &fixed);
    }
    assert!(
        n_touching > 100 && n_bounded > 150,
        "{n_touching} {n_bounded}"
    );
}

/// Bodies with a thickness each, or of each vertex, edge or face, one after the other on one detector.
#[test]
fn how_thick_elements_are_is_taken_from_their_distance() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (mut n_touching, mut n_bounded) = (0, 0);
    for seed in 0..36 {
        let (scene, bodies) = small(seed, seed % 2 == 0);
        let mut truth = scene.clone();
        let mut random = Random::new(seed);
        for (ix, (body, at)) in bodies.iter().enumerate() {
            truth.set_positions(*body, at).expect("good");
            let mut any = || 0.1 * f64::from(random.unit());
            let held = truth.body(*body).expect("held");
            let (n_edges, n_faces) = (held.edges().len(), held.faces().len());
            let mut each = |n: usize| Vec::from_iter((0..n).map(|_| any()));
            let thickness = match (ix as u64 + seed / 2) % 6 {
                0 => 0.0.into(),
                1 => each(1)[0].into(),
                2 | 3 => Thickness::vertices(each(at.len())),
                4 => Thickness::edges(each(n_edges)),
                _ => Thickness::faces(each(n_faces)),
            };
            truth.set_thickness(*body, thickness).expect("good");
        }
        let query = Query::all().fixed((seed % 3 == 0).then_some(bodies[2].0));
        let fixed = Vec::from_iter((seed % 3 == 0).then_some(bodies[2].0));
        let most = [0.05, 0.3][seed as usize / 2 % 2];
        let safe = safe_of(&caller, &mut detector, &truth, most, &query, &[]);
        let own = check(&format!("thick {seed}"), &truth, &safe, most, &fixed);
        (n_touching, n_bounded) = (n_touching + own[0], n_bounded + own[1]);
    }
    assert!(
        n_touching > 200 && n_bounded > 100,
        "{n_touching} {n_bounded}"
    );
    // A thickness of each face is that of its vertices, and nothing is thick afterwards.
    let mut scene = alone(&surfaces::ball(300));
    let (body, held) = scene.bodies().next().expect("one");
    let faces = vec![0.02; held.part(Part::Faces).len()];
    let mut ask = |scene: &Scene| safe_of(&caller, &mut detector, scene, 0.1, &Query::all(), &[]);
    let thin = ask(&scene);
    scene.set_thickness(body, 0.02).expect("good");
    let thick = ask(&scene);
    assert_ne!(thin, thick);
    scene
        .set_thickness(body, Thickness::faces(faces))
        .expect("good");
    assert_eq!(ask(&scene), thick);
    scene.set_thickness(body, 0.0).expect("good");
    assert_eq!(ask(&scene), thin);
}

/// A scene of one body.
fn alone(model: &Model) -> Scene {
    let mut scene = Scene::new();
    model.add_to(&mut scene).expect("good");
    scene
}

#[test]
fn bounds_of_larger_scenes_hold() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let ball = surfaces::ball(1500);
    let mut near = alone(&ball);
    let (low, high) = ball.bounds().expect("not empty");
    let above = ball.translated([0.0, 0.0, (high[2] - low[2]) * 1.002]);
    above.add_to(&mut near).expect("good");
    for (name, scene, most) in [
        ("balls", near.clone(), 0.06),
        // The same boxes were widened by another length, and then by none.
        ("balls", near.clone(), 0.15),
        // Now there is room, so nothing else sends them again.
        ("balls again", near, 0.15),
        ("soup", alone(&soup::triangles(300, 0.1, 4)), 0.03),
        ("lattice", alone(&soup::lattice_triangles(120, 9, 4)), 0.8),
        ("web", alone(&soup::lattice_web(150, 6, 4)), 0.8),
    ] {
        let safe = safe_of(&caller, &mut detector, &scene, most, &Query::all(), &[]);
        let [n_touching, n_bounded] = check(name, &scene, &safe, most, &[]);
        assert!(
            n_bounded > 20 || n_touching > 20,
            "{name}: {n_bounded} {n_touching}"
        );
        // Boxes of a step are not widened.
        let step = detector.impacts(&scene, &Query::all());
        assert!(step.expect("good").stats().backend != "cpu");
    }
}

#[test]
fn bounds_of_real_frames_hold() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    for (name, frame, share) in [
        ("cloth-ball", "cloth_ball92", 1e-3),
        ("cloth-funnel", "227", 1e-3),
    ] {
        let Some(path) = test_file(&format!("ccd/{name}/frames/{frame}.ply")) else {
            continue;
        };
        let options = impinge_io::ReadOptions::as_they_are();
        let mesh = impinge_io::read(&path, &options).expect("a mesh");
        let impinge_io::Elements::Triangles(faces) = mesh.elements else {
            panic!("a surface");
        };
        let at = match mesh.positions {
            impinge_io::Positions::F32(at) => at,
            impinge_io::Positions::F64(at) => singles(&at),
        };
        let size = |k: usize| {
            let all = || at.iter().map(|p| f64::from(p[k]));
            all().fold(f64::MIN, f64::max) - all().fold(f64::MAX, f64::min)
        };
        let most = share * size(0).max(size(1)).max(size(2));
        let mut scene = Scene::new();
        let body = scene.add((faces, at.clone())).expect("good");
        let buffer = caller.upload(&at);
        let positions = [(body, &buffer)];
        let safe = safe_of(
            &caller,
            &mut detector,
            &scene,
            most,
            &Query::all(),
            &positions,
        );
        let [_, n_bounded] = check(name, &scene, &safe, most, &[]);
        assert!(n_bounded > 100, "{name}: {n_bounded}");
    }
}

#[test]
fn without_room_nothing_may_move() {
    let caller = Caller::new();
    let scene = alone(&soup::triangles(300, 0.1, 7));
    let most = 3.0;
    let query = Query::all();
    let mut detector = caller.detector(Settings::default());
    let (safe, has_room) = encoded(&caller, &mut detector, &scene, most, &query, &[]);
    assert!(!has_room, "more candidates than there is room for");
    assert!(safe.values().flatten().all(|&bound| bound == 0.0));
    let safe = safe_of(&caller, &mut detector, &scene, most, &query, &[]);
    let [_, n_bounded] = check("soup", &scene, &safe, most, &[]);
    assert!(n_bounded > 100, "{n_bounded}");
}

#[test]
fn what_the_device_does_not_know_is_refused_by_name() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut scene = Scene::new();
    let triangle = [[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let body = scene.add_triangles(&[[0, 1, 2]], &triangle).expect("good");
    let gone = scene.add_triangles(&[[0, 1, 2]], &triangle).expect("good");
    scene.remove(gone).expect("known");
    let mut refused = |scene: &Scene, most: f64, query: &Query| -> Error {
        let mut encoder = caller.encoder();
        let mut gpu = detector.gpu().expect("a device");
        let refused = gpu.encode_safe_distances(scene, most, query, &[], &mut encoder);
        refused.expect_err("refused")
    };
    for most in [-1.0, f64::NAN, f64::INFINITY, 1e31] {
        let text = refused(&scene, most, &Query::all()).to_string();
        assert!(text.contains("most"), "{text}");
    }
    let text = refused(&scene, 1.0, &Query::all().fixed([gone])).to_string();
    assert!(text.contains(&gone.to_string()), "{text}");
    scene.set_thickness(body, 1e31).expect("good");
    let text = refused(&scene, 1.0, &Query::all()).to_string();
    assert!(text.starts_with("thickness: 1e31 of body"), "{text}");
}

#[test]
fn what_safe_distances_have_no_use_for_is_ignored() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (scene, bodies) = small(5, false);
    let query = Query::all();
    let mut ask =
        |scene: &Scene, query: &Query| safe_of(&caller, &mut detector, scene, 0.3, query, &[]);
    let plain = ask(&scene, &query);
    let nonsense = query.clone().separation(f64::NAN).clearance(-1.0);
    for query in [
        query.clone().separation(0.1),
        query.clone().clearance(0.1),
        nonsense,
    ] {
        assert_eq!(ask(&scene, &query), plain, "{query:?}");
    }
    // An edge and a face are as near as a vertex and a face, or two edges.
    let looked_at = [PairKind::VertexFace, PairKind::EdgeEdge];
    let looked_at = ask(&scene, &query.clone().kinds(looked_at));
    assert_ne!(looked_at, plain);
    for kind in [PairKind::EdgeFace, PairKind::FaceFace] {
        let named = query.clone().kinds([kind]);
        assert_eq!(ask(&scene, &named), looked_at, "{kind:?}");
        let both = named.kinds([kind, PairKind::EdgeVertex, PairKind::VertexVertex]);
        let all = PairKind::ALL.into_iter();
        let all = all.filter(|kind| !matches!(kind, PairKind::EdgeFace | PairKind::FaceFace));
        let all = query.clone().kinds(all);
        assert_eq!(ask(&scene, &both), ask(&scene, &all), "{kind:?}");
    }
    // A body that the query is not about may be as thick as the host allows.
    let mut thick = scene.clone();
    thick.set_thickness(bodies[3].0, 1e40).expect("good");
    let pair = Query::between(bodies[0].0, bodies[1].0);
    assert_eq!(ask(&thick, &pair), ask(&scene, &pair));
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    gpu.encode_step(&thick, &pair, &[], &[], &mut encoder)
        .expect("good");
}

/// Large triangles, and points that are very near each: where rounding is as large as distances.
fn thin(seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let (mut corners, mut faces, mut points) = (Vec::new(), Vec::new(), Vec::new());
    for n in 0..60u32 {
        let far = 100.0 * n as f32;
        let at = |p: [f32; 3]| [p[0] + far, p[1], p[2]];
        let [a, b, c] = [0; 3].map(|_| at(random.point(-9.0, 9.0)));
        let (s, t) = (0.5 * random.unit(), 0.5 * random.unit());
        let inside = [0, 1, 2].map(|k| a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]));
        let off = random
            .point(-1.0, 1.0)
            .map(|x| x * 10f32.powi(-(n as i32 % 7)));
        points.push([0, 1, 2].map(|k| inside[k] + off[k]));
        corners.extend([a, b, c]);
        faces.push([3 * n, 3 * n + 1, 3 * n + 2]);
    }
    let mut scene = Scene::new();
    scene.add_triangles(&faces, &corners).expect("good");
    scene.add_points(&points).expect("good");
    scene
}

#[test]
fn bounds_hold_where_rounding_is_as_large_as_distances() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut n_all = 0;
    for seed in 0..8 {
        let scene = thin(seed);
        let safe = safe_of(&caller, &mut detector, &scene, 2.0, &Query::all(), &[]);
        let [_, n_bounded] = check("thin", &scene, &safe, 2.0, &[]);
        n_all += n_bounded;
    }
    assert!(n_all > 500, "{n_all}");
}

/// Two faces whose boxes are apart.
fn apart() -> Scene {
    let mut scene = Scene::new();
    let face = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    for z in [0.0, 0.5] {
        scene.add_triangles(&[[0, 1, 2]], &face(z)).expect("good");
    }
    scene
}

#[test]
fn damaged_kernels_are_noticed() {
    let caller = Caller::new();
    // With a small budget there is no room for the pairs of the last one.
    let small = Settings::new().memory_budget(Some(3 << 20));
    let mut thick = alone(&soup::triangles(60, 0.1, 9));
    let (body, _) = thick.bodies().next().expect("one");
    let each = Vec::from_iter((0..180).map(|ix| [0.0, 0.02, 0.05][ix % 3]));
    let each = Thickness::vertices(each);
    thick.set_thickness(body, each).expect("good");
    let scenes = [
        (thin(3), 2.0, Settings::default()),
        (apart(), 1.0, Settings::default()),
        (
            alone(&soup::lattice_triangles(90, 9, 4)),
            0.8,
            Settings::default(),
        ),
        (alone(&soup::triangles(100, 0.1, 7)), 3.0, small),
        (thick, 0.1, Settings::default()),
    ];
    let holds = |detector: &dyn Fn(&Settings) -> Detector| {
        scenes.iter().all(|(scene, most, settings)| {
            let asks = || {
                let mut detector = detector(settings);
                let all = Query::all();
                let (safe, _) = encoded(&caller, &mut detector, scene, *most, &all, &[]);
                // Numbers of 0 are safe, and say nothing.
                if safe.values().flatten().any(|&bound| bound > 0.0) {
                    check("damaged", scene, &safe, *most, &[]);
                }
            };
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(asks)).is_ok()
        })
    };
    assert!(holds(&|settings| caller.detector(settings.clone())));
    let mut unnoticed = Vec::new();
    for damage in [
        (
            "bounds_clusters_moving",
            "widened(Box(low - slack, high + slack), params.reach)",
            "widened(Box(low - slack, high + slack), 0u)",
        ),
        ("narrow_safe", "low = min(low,", "low = max(-1.0,"),
        (
            "narrow_safe",
            "(thickness_of(a) + thickness_of(b))",
            "(thickness_of(a) + thickness_of(a))",
        ),
        (
            "narrow_safe",
            "thickness[corner.y]), thickness[corner.z]",
            "0.0), thickness[corner.x]",
        ),
        (
            "narrow_safe",
            "opposite = min(opposite,",
            "opposite = max(-1.0,",
        ),
        (
            "narrow_safe",
            "select(distance, 0.5 * distance,",
            "select(distance, distance,",
        ),
        (
            "narrow_safe",
            "if corner.z != corner.y {",
            "if corner.z == corner.y {",
        ),
        (
            "narrow_safe",
            "if corner.y != corner.x {",
            "if corner.y == corner.x {",
        ),
        (
            "narrow_safe",
            "cross3(polygon.edges[0], polygon.edges[1])",
            "polygon.edges[0]",
        ),
        (
            "narrow_safe",
            "found * BELOW, is_below)",
            "found * 1.125, is_below)",
        ),
        ("safe_end", "shares[vertex] = 0u;", ""),
        (
            "safe_end",
            "atomicLoad(&counters[N_CANDIDATES]) > params.capacity",
            "atomicLoad(&counters[N_CANDIDATES]) < params.capacity",
        ),
    ] {
        if holds(&|settings| caller.damaged(settings.clone(), damage)) {
            unnoticed.push(damage);
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}

/// Positions on the host, and where the device has moved them towards wished ones, within its own
/// safe distances, in one submission: each half of the bodies by a truncation of its own.
struct Truncated {
    safe: Safe,
    starts: Vec<Placed>,
    wished: Vec<Vec<[f32; 3]>>,
    reached: Vec<Vec<[f32; 3]>>,
}

fn truncated(
    caller: &Caller,
    detector: &mut Detector,
    (scene, starts): (&Scene, Vec<Placed>),
    most: f64,
    query: &Query,
    wished: Vec<Vec<[f32; 3]>>,
) -> Truncated {
    let buffers = Vec::from_iter(starts.iter().map(|(_, at)| caller.upload(at)));
    let ids = || starts.iter().map(|(body, _)| *body);
    let positions = Vec::from_iter(ids().zip(&buffers));
    // As much room as is needed.
    safe_of(caller, detector, scene, most, query, &positions);
    let goals = Vec::from_iter(wished.iter().map(|at| caller.upload(at)));
    let ends = Vec::from_iter(ids().zip(&goals));
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    let found = gpu.encode_safe_distances(scene, most, query, &positions, &mut encoder);
    let found = found.expect("good buffers");
    let middle = ends.len() / 2;
    for half in [0..middle, middle..ends.len()] {
        gpu.encode_truncate(
            scene,
            &found,
            &positions[half.clone()],
            &ends[half],
            &mut encoder,
        )
        .expect("good buffers");
    }
    caller.queue.submit([encoder.finish()]);
    let words = caller.read(&found.distances);
    let own = |at: &impinge_core::ResidentVertices| {
        let words = &words[at.first as usize..][..at.len as usize];
        (at.body, words.iter().map(|&x| f32::from_bits(x)).collect())
    };
    let points = |buffer: &wgpu::Buffer| {
        let words = caller.read(buffer);
        let rows = words.as_chunks::<3>().0.iter();
        Vec::from_iter(rows.map(|row| row.map(f32::from_bits)))
    };
    Truncated {
        safe: found.bodies.iter().map(own).collect(),
        reached: goals.iter().map(points).collect(),
        starts,
        wished,
    }
}

/// The length of a way, in double precision: wrong by a few parts in 2^52.
fn length(from: [f32; 3], to: [f32; 3]) -> f64 {
    let way = [0, 1, 2].map(|k| f64::from(to[k]) - f64::from(from[k]));
    way.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Holds each position against how far its vertex may move. Returns how many vertices are where
/// they were wished to be, how many on the way, and how many stay though they were to move.
fn check_reached(of: &Truncated) -> [usize; 3] {
    let mut n = [0; 3];
    for (ix, (body, starts)) in of.starts.iter().enumerate() {
        for (vertex, &start) in starts.iter().enumerate() {
            let room = f64::from(of.safe[body][vertex]);
            let (wish, to) = (of.wished[ix][vertex], of.reached[ix][vertex]);
            let (wanted, moved) = (length(start, wish), length(start, to));
            assert!(moved <= room, "{start:?} {to:?}: {moved} {room}");
            let size = start
                .iter()
                .fold(0.0f64, |most, &x| most.max(x.abs().into()));
            if to.map(f32::to_bits) == wish.map(f32::to_bits) {
                n[0] += 1;
                continue;
            }
            // What is near enough, but for the error of the check, is reached.
            let is_near = wanted < room * (1.0 - 2f64.powi(-17));
            assert!(!is_near, "{start:?} {wish:?} {room}");
            if moved == 0.0 {
                n[2] += 1;
                let rounding = 2f64.powi(-19) * size.max(wanted);
                assert!(
                    !wanted.is_finite() || wanted > 1e12 || room < rounding,
                    "{room}"
                );
                continue;
            }
            n[1] += 1;
            let slack = 2f64.powi(-19) * size.max(wanted) + 2f64.powi(-14) * room;
            assert!(moved > room - slack, "{start:?} {to:?}: {moved} {room}");
            let part = moved / wanted;
            for k in 0..3 {
                let on = f64::from(start[k]) + part * (f64::from(wish[k]) - f64::from(start[k]));
                assert!(
                    (f64::from(to[k]) - on).abs() < slack,
                    "{start:?} {wish:?} {to:?}"
                );
            }
        }
    }
    n
}

/// Positions that are wished for: some as they are, some near, some far, some no numbers.
fn wishes(random: &mut Random, starts: &[Placed], most: f32) -> Vec<Vec<[f32; 3]>> {
    let mut wish = |&at: &[f32; 3]| {
        let reach = match random.below(16) {
            0 => 0.0,
            1 => return [f32::NAN, at[1], f32::INFINITY],
            2 => return [at[0], f32::MAX, at[2]],
            3 => 1e9,
            4..=7 => 0.2 * most,
            8..=10 => most,
            _ => 3.0 * most,
        };
        let by = random.point(-1.0, 1.0);
        // A little farther than vertices may go that have nothing near them.
        let length = by.iter().map(|x| x * x).sum::<f32>().sqrt();
        let reach = if reach == most {
            1.05 * most / length
        } else {
            reach
        };
        [0, 1, 2].map(|k| at[k] + reach * by[k])
    };
    let own = |(_, at): &Placed| at.iter().map(&mut wish).collect();
    starts.iter().map(own).collect()
}

#[test]
fn no_vertex_goes_farther_than_it_may() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut random = Random::new(7);
    let mut n = [0; 3];
    for seed in 0..16 {
        let (scene, bodies) = small(seed, seed % 2 == 0);
        // Far from the origin positions are rounded, and near it they are tiny.
        let factor = [1.0, 1e-12, 1.0, 64.0][seed as usize % 4];
        let far = [0.0, 0.0, 1000.0, 0.0][seed as usize / 2 % 4];
        let scaled =
            |at: &Vec<[f32; 3]>| Vec::from_iter(at.iter().map(|p| p.map(|x| factor * x + far)));
        let bodies = Vec::from_iter(bodies.iter().map(|(body, at)| (*body, scaled(at))));
        let most = 0.3 * factor;
        let query = Query::all().fixed((seed % 3 == 0).then_some(bodies[0].0));
        let wished = wishes(&mut random, &bodies, most);
        let all = (&scene, bodies);
        let found = truncated(&caller, &mut detector, all, f64::from(most), &query, wished);
        let own = check_reached(&found);
        n = [0, 1, 2].map(|k| n[k] + own[k]);
    }
    assert!(n.iter().all(|&n| n > 30), "{n:?}");
}

/// Two balls one above the other, and wishes that bring them together.
fn meeting() -> (Scene, Vec<Placed>, Vec<Vec<[f32; 3]>>) {
    let ball = surfaces::ball(600);
    let (low, high) = ball.bounds().expect("not empty");
    let above = ball.translated([0.0, 0.0, (high[2] - low[2]) * 1.01]);
    let mut scene = Scene::new();
    let (mut starts, mut wished) = (Vec::new(), Vec::new());
    for (model, down) in [(ball, 0.0), (above, 0.2)] {
        let body = model.add_to(&mut scene).expect("good");
        let at = Vec::from_iter(
            (0..scene.body(body).expect("held").n_vertices()).map(|vertex| {
                let point = scene.body(body).expect("held").positions().point(vertex);
                point.map(|x| x as f32)
            }),
        );
        wished.push(Vec::from_iter(at.iter().map(|&[x, y, z]| [x, y, z - down])));
        starts.push((body, at));
    }
    (scene, starts, wished)
}

/// Whether nothing touches on the way from where bodies are to some positions.
fn is_free(scene: &Scene, starts: &[Placed], ends: &[Vec<[f32; 3]>]) -> bool {
    let mut scene = scene.clone();
    for ((body, at), end) in starts.iter().zip(ends) {
        scene.set_positions(*body, at).expect("good");
        scene.set_end_positions(*body, end).expect("good");
    }
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    cpu.is_free(&scene, &Query::all()).expect("good")
}

#[test]
fn nothing_touches_on_the_way_to_what_is_reached() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (scene, mut starts, mut wished) = meeting();
    assert!(
        !is_free(&scene, &starts, &wished),
        "the wishes bring them together"
    );
    let mut nearest = f64::INFINITY;
    for _ in 0..6 {
        let all = (&scene, starts);
        let query = Query::all();
        let found = truncated(&caller, &mut detector, all, 0.05, &query, wished);
        let [n_there, n_on_the_way, _] = check_reached(&found);
        assert!(
            n_there > 100 && n_on_the_way > 10,
            "{n_there} {n_on_the_way}"
        );
        assert!(is_free(&scene, &found.starts, &found.reached));
        let room = found.safe.values().flatten();
        nearest = room.fold(nearest, |least, &room| least.min(room.into()));
        // The next step begins where this one ends.
        let ids = found.starts.iter().map(|(body, _)| *body);
        starts = ids.zip(found.reached).collect();
        wished = found.wished;
    }
    assert!(nearest < 1e-3, "they come near each other: {nearest}");
}

#[test]
fn buffers_of_a_truncation_are_refused_by_name() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (scene, starts, wished) = meeting();
    let [(a, at), (b, _)] = &starts[..] else {
        panic!("two bodies");
    };
    let (start, end) = (caller.upload(at), caller.upload(&wished[0]));
    let short = caller.upload(&at[1..]);
    let plain = caller.buffer(start.size(), wgpu::BufferUsages::COPY_DST);
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    let safe = gpu.encode_safe_distances(&scene, 0.1, &Query::of(*a), &[], &mut encoder);
    let mut safe = safe.expect("good buffers");
    safe.bodies.retain(|own| own.body == *a);
    for (body, start, end, words) in [
        (*b, &start, &end, "it has no safe distances"),
        (*a, &short, &end, "positions take"),
        (*a, &start, &short, "end positions take"),
        (*a, &start, &plain, "end positions lacks the usage STORAGE"),
        (*a, &start, &start, "in the buffer of its positions"),
    ] {
        let (starts, ends) = ([(body, start)], [(body, end)]);
        let refused = gpu.encode_truncate(&scene, &safe, &starts, &ends, &mut encoder);
        let text = refused.expect_err("refused").to_string();
        assert!(
            text.contains(words) && text.contains(&body.to_string()),
            "{text}"
        );
    }
    let refused = gpu.encode_truncate(&scene, &safe, &[], &[(*a, &end)], &mut encoder);
    let text = refused.expect_err("refused").to_string();
    assert!(text.contains("end positions alone"), "{text}");
}

#[test]
fn bodies_whose_truncation_would_write_into_one_buffer_are_refused() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (scene, starts, wished) = meeting();
    let [(a, at_a), (b, at_b)] = &starts[..] else {
        panic!("two bodies");
    };
    let [start_a, start_b] = [at_a, at_b].map(|at| caller.upload(at));
    let [end_a, end_b] = [0, 1].map(|ix| caller.upload(&wished[ix]));
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    let safe = gpu.encode_safe_distances(&scene, 0.1, &Query::all(), &[], &mut encoder);
    let safe = safe.expect("good");
    let from = [(*a, &start_a), (*b, &start_b)];
    for (starts, ends, words) in [
        (
            from,
            [(*a, &end_a), (*b, &end_a)],
            "its end positions are in the buffer of the end positions of body",
        ),
        (
            from,
            [(*a, &start_b), (*b, &end_b)],
            "its end positions are in the buffer of the positions of body",
        ),
        (
            from,
            [(*a, &end_a), (*b, &start_a)],
            "its end positions are in the buffer of the positions of body",
        ),
    ] {
        let refused = gpu.encode_truncate(&scene, &safe, &starts, &ends, &mut encoder);
        let text = refused.expect_err("refused").to_string();
        let names = [a, b].map(|body| format!("body {body}"));
        let has_names = names.iter().all(|name| text.contains(name));
        assert!(text.contains(words) && has_names, "{text}");
    }
    // What is read may be shared.
    let (starts, ends) = (
        [(*a, &start_a), (*b, &start_a)],
        [(*a, &end_a), (*b, &end_b)],
    );
    gpu.encode_truncate(&scene, &safe, &starts, &ends, &mut encoder)
        .expect("good");
}

#[test]
fn safe_distances_that_are_no_longer_good_are_refused() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (mut scene, starts, wished) = meeting();
    let (a, at) = &starts[0];
    let (start, end) = (caller.upload(at), caller.upload(&wished[0]));
    let (from, to) = ([(*a, &start)], [(*a, &end)]);
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    let mut encode = |gpu: &mut impinge_core::Gpu<'_>, scene: &Scene, query: &Query| {
        let safe = gpu.encode_safe_distances(scene, 0.1, query, &[], &mut encoder);
        safe.expect("good")
    };
    let old = encode(&mut gpu, &scene, &Query::all());
    let other = encode(&mut gpu, &scene, &Query::self_of(starts[1].0));
    let last = encode(&mut gpu, &scene, &Query::all());
    let mut second = caller.detector(Settings::default());
    let mut of_second = second.gpu().expect("a device");
    let foreign = encode(&mut of_second, &scene, &Query::all());
    let mut encoder = caller.encoder();
    for safe in [&old, &other, &foreign] {
        let refused = gpu.encode_truncate(&scene, safe, &from, &to, &mut encoder);
        let text = refused.expect_err("refused").to_string();
        assert!(text.contains("not the last ones"), "{text}");
    }
    gpu.encode_truncate(&scene, &last.clone(), &from, &to, &mut encoder)
        .expect("the last ones");
    for (starts, ends, words) in [
        (
            &[from[0], from[0]][..],
            &to[..],
            "its positions are given twice",
        ),
        (&from, &[to[0], to[0]], "its end positions are given twice"),
    ] {
        let refused = gpu.encode_truncate(&scene, &last, starts, ends, &mut encoder);
        let text = refused.expect_err("refused").to_string();
        assert!(
            text.contains(words) && text.contains(&a.to_string()),
            "{text}"
        );
    }
    // It may move, but neither be another mesh nor be gone.
    scene.set_positions(*a, &wished[0]).expect("good");
    gpu.encode_truncate(&scene, &last, &from, &to, &mut encoder)
        .expect("the same mesh");
    let faces = vec![[0, 1, 2]];
    scene.remesh(*a, (faces, at.clone())).expect("good");
    let refused = gpu.encode_truncate(&scene, &last, &from, &to, &mut encoder);
    let text = refused.expect_err("refused").to_string();
    assert!(
        text.contains("re-meshed") && text.contains(&a.to_string()),
        "{text}"
    );
    scene.remove(*a).expect("held");
    let refused = gpu.encode_truncate(&scene, &last, &from, &to, &mut encoder);
    let text = refused.expect_err("refused").to_string();
    assert!(text.contains(&a.to_string()), "{text}");
}

#[test]
fn many_bodies_are_truncated_each_by_its_own_distances() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (mut scene, mut bodies) = (Scene::new(), Vec::new());
    // Points in pairs, each pair farther apart than the one before.
    for ix in 0..300u32 {
        let x = 100.0 * (ix / 2) as f32;
        let apart = (ix % 2) as f32 * (1.0 + (ix / 2) as f32 / 256.0);
        let at = vec![[x, apart, 0.0]];
        bodies.push((scene.add_points(&at).expect("good"), at));
    }
    let wished = bodies
        .iter()
        .map(|(_, at)| vec![[at[0][0], at[0][1], 50.0]]);
    let wished = Vec::from_iter(wished);
    let all = (&scene, bodies.clone());
    let query = Query::all();
    let found = truncated(&caller, &mut detector, all, 5.0, &query, wished.clone());
    assert_eq!(check_reached(&found), [0, 300, 0]);
    for (ix, (body, _)) in bodies.iter().enumerate() {
        let half = 0.5 + (ix / 2) as f32 / 512.0;
        let room = found.safe[body][0];
        assert!(room <= half && room > 0.98 * half, "{ix}: {room} {half}");
    }
}

#[test]
fn damaged_truncations_are_noticed() {
    let caller = Caller::new();
    let (scene, bodies) = small(3, false);
    let holds = |mut detector: Detector| {
        let asks = || {
            let mut random = Random::new(5);
            for _ in 0..6 {
                let wished = wishes(&mut random, &bodies, 0.3);
                let all = (&scene, bodies.clone());
                let found = truncated(&caller, &mut detector, all, 0.3, &Query::all(), wished);
                check_reached(&found);
            }
        };
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(asks)).is_ok()
    };
    assert!(holds(caller.detector(Settings::default())));
    let mut unnoticed = Vec::new();
    for damage in [
        (
            "truncate",
            "(1.0 + OF_PRODUCT) <= r * r",
            "(1.0 + OF_PRODUCT) <= 1.25 * r * r",
        ),
        (
            "truncate",
            "let aim = room * (1.0",
            "let aim = 0.5 * room * (1.0",
        ),
        ("truncate", "<= LARGEST_BITS", "> LARGEST_BITS"),
        (
            "truncate",
            "shares[params.first + vertex]",
            "shares[vertex]",
        ),
    ] {
        if holds(caller.damaged(Settings::default(), damage)) {
            unnoticed.push(damage);
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}
