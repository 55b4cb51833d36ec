//! Clusters that are proven culled are left out of a frame. Whatever moves and whatever the query,
//! no pair may be lost.

use impinge_core::{
    Backend, BodyId, Detector, Error, Filter, InstructionSet, Method, Query, Scene, Settings,
};
use impinge_scenes::deform::{self, Deform};
use impinge_scenes::{Model, surfaces};
use impinge_tests::leaves_out;

fn settings(method: Method, threads: usize, instruction_set: InstructionSet) -> Settings {
    Settings::new()
        .method(method)
        .threads(threads)
        .instruction_set(instruction_set)
        .backend(Backend::Cpu)
}

/// Detectors that keep state between frames, and an oracle that keeps none.
struct Contest {
    detectors: Vec<Detector>,
    /// How many clusters each detector left out in its last frame.
    n_culled: Vec<u64>,
    oracle: Detector,
    /// Frames in which clusters were left out, in which none were, and in which there were pairs.
    n_frames_with: usize,
    n_frames_without: usize,
    n_frames_with_pairs: usize,
}

impl Contest {
    fn new() -> Contest {
        let clusters = [
            (1, InstructionSet::Avx512),
            (2, InstructionSet::Avx512),
            (1, InstructionSet::Avx2),
            (2, InstructionSet::Portable),
        ];
        Contest {
            detectors: clusters
                .map(|(threads, set)| settings(Method::Clusters, threads, set))
                .into_iter()
                .map(|settings| Detector::new(settings).unwrap())
                .collect(),
            n_culled: vec![0; clusters.len()],
            oracle: Detector::new(settings(Method::Naive, 2, InstructionSet::Avx512)).unwrap(),
            n_frames_with: 0,
            n_frames_without: 0,
            n_frames_with_pairs: 0,
        }
    }

    fn frame(&mut self, scene: &Scene, query: &Query, what: &str) {
        let expected = self.oracle.detect(scene, query).unwrap();
        self.n_frames_with_pairs += usize::from(!expected.is_empty());
        for (detector, n_culled) in self.detectors.iter_mut().zip(&mut self.n_culled) {
            let pairs = detector.detect(scene, query).unwrap();
            assert!(
                pairs.rows().eq(expected.rows()),
                "{what}: {} pairs, {} expected",
                pairs.len(),
                expected.len()
            );
            *n_culled = pairs.stats().n_culled;
        }
        self.n_frames_with += usize::from(self.n_culled[0] > 0);
        self.n_frames_without += usize::from(self.n_culled[0] == 0);
    }

    /// Whether more than `n_frames` frames left clusters out; true if this processor never does.
    fn left_out_in_more_than(&self, n_frames: usize) -> bool {
        self.n_frames_with > n_frames || !leaves_out()
    }

    /// Whether the last frame left clusters out; true if this processor never does.
    fn has_left_out(&self) -> bool {
        self.n_culled[0] > 0 || !leaves_out()
    }
}

/// A motion of a body.
type Motion = fn([f32; 3], f32) -> [f32; 3];

fn place(scene: &mut Scene, body: BodyId, rest: &Model, motion: Motion, t: f32) {
    for (to, &from) in scene
        .positions_mut::<f32>(body)
        .unwrap()
        .iter_mut()
        .zip(&rest.positions)
    {
        *to = motion(from, t);
    }
}

fn pair() -> (Model, Scene, BodyId, BodyId) {
    let ball = surfaces::bumpy_ball(2_100, 0.2);
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.8, 0.1, 0.0]).add_to(&mut scene).unwrap();
    (ball, scene, a, b)
}

#[test]
fn no_motion_loses_a_pair() {
    let motions: [(&str, Motion); 8] = [
        ("drifts through", |[x, y, z], t| [x + 1.6 - 2.4 * t, y, z]),
        ("trembles", |[x, y, z], t| {
            [x + 0.8 + 0.01 * (40.0 * t).sin(), y, z]
        }),
        ("is mirrored", |[x, y, z], t| match (40.0 * t) as u32 % 2 {
            0 => [x + 0.8, y, z],
            _ => [-x - 0.8, y, z],
        }),
        ("jumps", |[x, y, z], t| match (5.0 * t) as u32 {
            0 => [x + 0.8, y, z],
            1 => [x - 0.8, y, z],
            2 => [x, y + 0.8, z],
            3 => [x, y, z - 5.0],
            _ => [x, y, z + 0.8],
        }),
        ("turns", |[x, y, z], t| {
            let (sin, cos) = (6.3 * t).sin_cos();
            [x * cos - y * sin + 0.8, x * sin + y * cos, z]
        }),
        ("goes round", |[x, y, z], t| {
            let (sin, cos) = (6.3 * t).sin_cos();
            [x + 0.8 * cos, y + 0.8 * sin, z]
        }),
        ("grows", |[x, y, z], t| {
            let scale = 0.2 + 2.0 * t;
            [x * scale + 1.0, y * scale, z * scale]
        }),
        // A single spike on the far side reaches round the other body.
        ("stretches", |[x, y, z], t| match x > 0.4 {
            true => [x + 0.8 - 3.0 * t, y, z],
            false => [x + 0.8, y, z],
        }),
    ];
    for (what, motion) in motions {
        let still: Motion = |point, _| point;
        // Which of the two moves. 2: only the first moves, but the positions of both are written.
        for mover in 0..3 {
            let (ball, mut scene, a, b) = pair();
            let mut contest = Contest::new();
            for frame in 0..20 {
                let t = frame as f32 / 20.0;
                for (ix, body) in [a, b].into_iter().enumerate() {
                    let motion = if ix == mover % 2 { motion } else { still };
                    if ix == mover || mover == 2 || frame < 5 {
                        place(&mut scene, body, &ball, motion, t);
                    }
                }
                contest.frame(
                    &scene,
                    &Query::between(a, b),
                    &format!("{what}, {mover} moves, frame {frame}"),
                );
            }
            assert!(contest.left_out_in_more_than(3), "{what}, {mover}");
            assert!(contest.n_frames_with_pairs > 3, "{what}, {mover}");
        }
    }
}

#[test]
fn steady_frames_leave_clusters_out_until_they_are_renewed() {
    let (ball, mut scene, a, b) = pair();
    let mut contest = Contest::new();
    for frame in 0..140 {
        for body in [a, b] {
            let still: Motion = if body == a {
                |x, _| x
            } else {
                |[x, y, z], _| [x + 0.8, y + 0.1, z]
            };
            place(&mut scene, body, &ball, still, 0.0);
        }
        contest.frame(&scene, &Query::between(a, b), &format!("frame {frame}"));
    }
    if !leaves_out() {
        return;
    }
    assert!((130..139).contains(&contest.n_frames_with));
    assert!(contest.n_frames_without >= 4);
    let n_clusters = 2 * ball.n_elements().div_ceil(64) as u64;
    assert!(contest.n_culled[0] > n_clusters / 3);
    // The same for every thread count and vector instruction set; the portable set leaves none out.
    assert_eq!(
        contest.n_culled,
        [
            contest.n_culled[0],
            contest.n_culled[0],
            contest.n_culled[0],
            0
        ]
    );
}

#[test]
fn whoever_asks_for_all_boxes_gets_them() {
    let (ball, mut scene, a, b) = pair();
    // Meets the far side of the first body, which the second body does not reach.
    let c = ball
        .translated([-0.8, 0.0, 0.1])
        .add_to(&mut scene)
        .unwrap();
    let mut folded = ball.clone();
    for [x, _, _] in &mut folded.positions {
        *x = -x.abs();
    }
    scene.set_positions(a, &folded.positions).unwrap();
    let alone = Filter {
        category: 2,
        mask: 2,
    };
    let queries = [
        Query::between(a, b),
        Query::self_of(a),
        Query::between(a, c),
        Query::all(),
        Query::between(c, b),
        Query::between_all(),
        Query::between_all().exclude((a, c)),
    ];
    let mut contest = Contest::new();
    for moves in [true, false] {
        for (ix, query) in queries.iter().enumerate() {
            for frame in 0..4 {
                if moves {
                    scene.set_positions(a, &folded.positions).unwrap();
                }
                contest.frame(
                    &scene,
                    &Query::between(a, b),
                    &format!("frame {frame} before {ix}"),
                );
            }
            contest.frame(&scene, query, &format!("query {ix}"));
            contest.frame(&scene, query, &format!("query {ix} again"));
        }
    }
    assert!(contest.left_out_in_more_than(10));
    for _ in 0..20 {
        scene.set_positions(a, &folded.positions).unwrap();
        scene.set_filter(c, alone).unwrap();
        contest.frame(&scene, &Query::between_all(), "c meets nobody");
    }
    assert!(contest.has_left_out());
    scene.set_filter(c, Filter::default()).unwrap();
    contest.frame(&scene, &Query::between_all(), "c meets all");
}

#[test]
fn a_bad_position_in_a_remote_cluster_is_refused() {
    let (ball, mut scene, a, b) = pair();
    let query = Query::between(a, b);
    let mut contest = Contest::new();
    let farthest = |model: &Model| {
        let lowest = |(ix, x): (usize, f32), (other_ix, other): (usize, &[f32; 3])| {
            if other[0] < x {
                (other_ix, other[0])
            } else {
                (ix, x)
            }
        };
        let all = model.positions.iter().enumerate();
        all.fold((0, f32::INFINITY), lowest).0
    };
    let vertex = farthest(&ball);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            for frame in 0..6 {
                scene.set_positions(a, &ball.positions).unwrap();
                contest.frame(
                    &scene,
                    &query,
                    &format!("{bad} along {axis}, frame {frame}"),
                );
            }
            assert!(contest.has_left_out());
            scene.positions_mut::<f32>(a).unwrap()[vertex][axis] = bad;
            for detector in &mut contest.detectors {
                let error = detector.detect(&scene, &query).map(|_| ()).unwrap_err();
                let is_right = matches!(
                    error,
                    Error::NonFinitePosition { body, vertex: found, .. } if body == a && found == vertex
                );
                assert!(is_right, "{error}");
            }
        }
    }
    // Finite positions whose sums overflow.
    let mut far = ball.positions.clone();
    far.iter_mut()
        .for_each(|[_, y, _]| *y = y.signum() * f32::MAX);
    scene.set_positions(a, &far).unwrap();
    contest.frame(&scene, &query, "far");
}

#[test]
fn meshes_change_while_clusters_are_left_out() {
    let (ball, mut scene, a, b) = pair();
    let query = Query::between(a, b);
    let mut contest = Contest::new();
    let other = surfaces::bumpy_ball(4_500, 0.1);
    for round in 0..4 {
        let mut model = if round % 2 == 0 {
            ball.clone()
        } else {
            other.clone()
        };
        if round >= 2 {
            // Vertices that no triangle has, on the other body's far side.
            model.positions.extend([[30.0, 0.0, 0.0]; 5]);
        }
        scene
            .remesh(a, (model.elements, model.positions.clone()))
            .unwrap();
        for frame in 0..6 {
            scene.set_positions(a, &model.positions).unwrap();
            contest.frame(&scene, &query, &format!("round {round}, frame {frame}"));
        }
        // A body with vertices that no triangle names has no culled clusters.
        assert!(round >= 2 || contest.has_left_out(), "round {round}");
    }
    scene.remove(b).unwrap();
    let b = ball
        .translated([-0.8, 0.0, 0.0])
        .add_to(&mut scene)
        .unwrap();
    contest.frame(&scene, &Query::between(a, b), "another on the other side");
}

#[test]
fn bodies_that_come_to_touch_meet() {
    let sheet = surfaces::cloth(40, 40, 1.0);
    let mut scene = Scene::new();
    let a = sheet.add_to(&mut scene).unwrap();
    let b = sheet.add_to(&mut scene).unwrap();
    let (low, high) = sheet.bounds().unwrap();
    // Along each axis in which the sheet has an extent, from either side: first beside it, then
    // edge to edge.
    for axis in [0, 1, 2].into_iter().filter(|&axis| low[axis] < high[axis]) {
        for width in [low[axis] - high[axis], high[axis] - low[axis]] {
            let mut contest = Contest::new();
            for gap in [3.0, 3.0, 3.0, 3.0, 0.0, 3.0, 3.0, 0.0] {
                let mut offset = [0.0; 3];
                offset[axis] = width + width.signum() * gap;
                scene.set_positions(a, &sheet.positions).unwrap();
                scene
                    .set_positions(b, &sheet.translated(offset).positions)
                    .unwrap();
                let n_frames_with_pairs = contest.n_frames_with_pairs;
                contest.frame(&scene, &Query::between(a, b), &format!("{offset:?}"));
                let met = contest.n_frames_with_pairs > n_frames_with_pairs;
                assert_eq!(met, gap == 0.0, "{offset:?}");
            }
            assert!(contest.left_out_in_more_than(3));
        }
    }
}

/// A model whose vertices are numbered along x, so that each run of vertices covers only part of
/// its extent.
fn from_low_to_high(model: Model) -> Model {
    let mut order: Vec<u32> = (0..model.positions.len() as u32).collect();
    let x = |vertex: u32| model.positions[vertex as usize][0];
    order.sort_by(|&a, &b| x(a).total_cmp(&x(b)));
    let mut numbers = vec![0; order.len()];
    for (number, &vertex) in (0..).zip(&order) {
        numbers[vertex as usize] = number;
    }
    let mut sorted = model.clone();
    sorted.positions = order
        .iter()
        .map(|&vertex| model.positions[vertex as usize])
        .collect();
    if let impinge_core::Elements::Triangles(faces) = &mut sorted.elements {
        for vertex in faces.as_flattened_mut() {
            *vertex = numbers[*vertex as usize];
        }
    }
    sorted
}

#[test]
fn bodies_that_several_tasks_read_lose_no_pair() {
    // From 120,000 elements on, two threads compute boxes; one task reads 4,096 vertices.
    let ball = from_low_to_high(surfaces::bumpy_ball(64_000, 0.2));
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.8, 0.1, 0.0]).add_to(&mut scene).unwrap();
    let query = Query::between(a, b);
    let detector = |method, threads, set| Detector::new(settings(method, threads, set)).unwrap();
    let mut detectors = [
        detector(Method::Clusters, 2, InstructionSet::Avx512),
        detector(Method::Clusters, 3, InstructionSet::Avx2),
    ];
    let mut other_method = detector(Method::Cells, 2, InstructionSet::Avx512);
    let mut n_frames_with = 0;
    for frame in 0..30 {
        // The second body trembles, then circles the first; towards the end the first moves too.
        let angle = 0.3 * (frame as f32 - 8.0).max(0.0);
        let radius = if frame % 2 == 0 { 0.9 } else { 0.89 };
        place(&mut scene, b, &ball, |point, _| point, 0.0);
        for [x, y, _] in scene.positions_mut::<f32>(b).unwrap() {
            *x += radius * angle.cos();
            *y += radius * angle.sin();
        }
        if !(4..16).contains(&frame) {
            place(
                &mut scene,
                a,
                &ball,
                |[x, y, z], t| [x, y, z + t],
                0.002 * frame as f32,
            );
        }
        let expected = other_method.detect(&scene, &query).unwrap();
        assert!(!expected.is_empty());
        for detector in &mut detectors {
            let pairs = detector.detect(&scene, &query).unwrap();
            assert!(pairs.rows().eq(expected.rows()), "frame {frame}");
            n_frames_with += usize::from(pairs.stats().n_culled > 0);
        }
    }
    assert!(n_frames_with > 20 || !leaves_out());
}

#[test]
fn detectors_with_a_past_answer_as_new_ones() {
    let (ball, scene, a, b) = pair();
    let query = Query::between(a, b);
    let mut contest = Contest::new();
    let decide = |contest: &mut Contest, scene: &mut Scene| {
        for _ in 0..70 {
            place(scene, a, &ball, |point, _| point, 0.0);
            place(scene, b, &ball, |[x, y, z], _| [x + 0.8, y, z], 0.0);
            contest.frame(scene, &query, "deciding");
            if contest.n_culled[0] > 0 {
                break;
            }
        }
        assert!(contest.has_left_out());
    };
    // A clone of the scene whose positions have changed since, while the saved clone kept its
    // stamps.
    let mut one = scene.clone();
    decide(&mut contest, &mut one);
    let saved = one.clone();
    place(&mut one, b, &ball, |[x, y, z], _| [x - 0.8, y, z], 0.0);
    contest.frame(&one, &query, "on the other side");
    contest.frame(&saved, &query, "back");
    let mut one = saved.clone();
    place(&mut one, b, &ball, |[x, y, z], _| [x, y + 0.8, z], 0.0);
    contest.frame(&one, &query, "above");
    // More bodies than culled clusters are used with, then two again.
    let mut many = saved.clone();
    decide(&mut contest, &mut many);
    for k in 0..10 {
        let place = [-0.8, 0.1 * k as f32, 0.0];
        ball.translated(place).add_to(&mut many).unwrap();
    }
    contest.frame(&many, &Query::between_all(), "many");
    contest.frame(&many, &query, "two of many");
    // A body that flows so far that it is clustered again while it has culled clusters.
    let mut one = saved.clone();
    decide(&mut contest, &mut one);
    let flow = deform::Flow::default();
    for step in 0..70 {
        let mut flowed = ball.positions.clone();
        flow.apply(&ball.positions, 0.5 * step as f32, &mut flowed);
        one.set_positions(a, &flowed).unwrap();
        contest.frame(&one, &query, &format!("flows, step {step}"));
    }
    // The body is replaced by one in double precision.
    let mut one = saved;
    decide(&mut contest, &mut one);
    one.remesh(a, (ball.elements.clone(), ball.positions_f64()))
        .unwrap();
    contest.frame(&one, &query, "double");
}
