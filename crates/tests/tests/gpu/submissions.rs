//! Several questions in one submission, and questions between encoding and submission: against the
//! same questions each in a submission of its own, and against the CPU.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::collections::BTreeSet;

use crate::caller::Caller;
use impinge_core::{
    Backend, BodyId, Detector, Query, ResidentPairs, ResidentSafe, ResidentStep, Scene, Settings,
    wgpu,
};
use impinge_scenes::Random;

/// Bodies whose positions are in buffers.
type Given<'a> = Vec<(BodyId, &'a wgpu::Buffer)>;

/// Pairs of a list, as far as there are.
fn rows(caller: &Caller, list: &wgpu::Buffer, n: u32) -> BTreeSet<[u32; 2]> {
    let words = caller.read(list);
    words.as_chunks::<2>().0[..n as usize]
        .iter()
        .copied()
        .collect()
}

/// The certain pairs and the unsure ones.
fn of_frame(caller: &Caller, found: &ResidentPairs) -> [BTreeSet<[u32; 2]>; 2] {
    let counts = caller.read(&found.counts);
    let of = |list, offset: u64| rows(caller, list, counts[offset as usize / 4]);
    [
        of(&found.pairs, found.n_pairs_offset),
        of(&found.unsure, found.n_unsure_offset),
    ]
}

fn of_step(caller: &Caller, found: &ResidentStep) -> BTreeSet<[u32; 2]> {
    let counts = caller.read(&found.counts);
    let n = counts[found.n_pairs_offset as usize / 4];
    rows(caller, &found.pairs, n)
}

fn of_vertices(caller: &Caller, found: &ResidentSafe) -> Vec<u32> {
    let n: u32 = found.bodies.iter().map(|of| of.len).sum();
    caller.read(&found.distances)[..n as usize].to_vec()
}

/// A question, with where bodies are on the device.
enum Asked<'a> {
    Frame(Given<'a>),
    Step(Given<'a>, Given<'a>),
    Safe(Given<'a>),
}

/// What an encoded question leaves.
enum Left {
    Pairs(ResidentPairs),
    Step(ResidentStep),
    Safe(ResidentSafe),
}

impl Asked<'_> {
    fn encode(
        &self,
        detector: &mut Detector,
        scene: &Scene,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Left {
        let mut gpu = detector.gpu().expect("a device");
        let all = &Query::all();
        match self {
            Asked::Frame(at) => Left::Pairs(gpu.encode(scene, all, at, encoder).expect("good")),
            Asked::Step(starts, ends) => {
                let found = gpu.encode_step(scene, all, starts, ends, encoder);
                Left::Step(found.expect("good"))
            }
            Asked::Safe(at) => {
                let found = gpu.encode_safe_distances(scene, 0.3, all, at, encoder);
                Left::Safe(found.expect("good"))
            }
        }
    }

    /// The answer from a submission of its own.
    fn alone(&self, caller: &Caller, detector: &mut Detector, scene: &Scene) -> Answer {
        let mut encoder = caller.encoder();
        let left = self.encode(detector, scene, &mut encoder);
        caller.queue.submit([encoder.finish()]);
        left.read(caller)
    }
}

#[derive(Debug, PartialEq, Eq)]
enum Answer {
    Pairs([BTreeSet<[u32; 2]>; 2]),
    Step(BTreeSet<[u32; 2]>),
    Safe(Vec<u32>),
}

impl Left {
    fn read(&self, caller: &Caller) -> Answer {
        match self {
            Left::Pairs(found) => Answer::Pairs(of_frame(caller, found)),
            Left::Step(found) => Answer::Step(of_step(caller, found)),
            Left::Safe(found) => Answer::Safe(of_vertices(caller, found)),
        }
    }
}

/// Three small bodies at random; all of them again and again on the device.
struct World {
    scene: Scene,
    ids: Vec<BodyId>,
    buffers: Vec<Vec<wgpu::Buffer>>,
}

fn world(caller: &Caller, random: &mut Random) -> World {
    let faces = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [0, 4, 8]];
    let mut points = || Vec::from_iter((0..9).map(|_| random.point(-1.0, 1.0)));
    let mut scene = Scene::new();
    let mut ids = Vec::new();
    for ix in 0..3 {
        let [start, end] = [points(), points()];
        let wide =
            |at: &[[f32; 3]]| Vec::from_iter(at.iter().map(|p| p.map(|x| f64::from(x) / 3.0)));
        let id = match ix {
            // Of positions in double precision the device has rounded ones, with larger boxes.
            2 => scene.add_triangles(&faces, &wide(&start)),
            _ => scene.add_triangles(&faces, &start),
        };
        let id = id.expect("good");
        match ix {
            0 => scene.set_end_positions(id, &end).expect("good"),
            1 => {}
            _ => scene.set_end_positions(id, wide(&end)).expect("good"),
        }
        ids.push(id);
    }
    let mut upload = || ids.iter().map(|_| caller.upload(&points())).collect();
    let buffers = (0..3).map(|_| upload()).collect();
    World {
        scene,
        ids,
        buffers,
    }
}

impl World {
    /// Some of the bodies, each where a set of buffers has it.
    fn some(&self, set: usize, random: &mut Random) -> Given<'_> {
        let all = self.ids.iter().copied().zip(&self.buffers[set]);
        all.filter(|_| random.below(2) == 0).collect()
    }

    fn step_or_safe(&self, random: &mut Random) -> Asked<'_> {
        match random.below(2) {
            0 => Asked::Step(self.some(1, random), self.some(2, random)),
            _ => Asked::Safe(self.some(1, random)),
        }
    }
}

#[test]
fn two_questions_of_one_submission_are_as_in_two() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut alone = caller.detector(Settings::default());
    let mut random = Random::new(11);
    for round in 0..40 {
        let world = world(&caller, &mut random);
        let scene = &world.scene;
        for again in 0..2 {
            let frame = Asked::Frame(world.some(0, &mut random));
            let mut both = [frame, world.step_or_safe(&mut random)];
            if random.below(2) == 0 {
                both.reverse();
            }
            let mut encoder = caller.encoder();
            let left = both
                .each_ref()
                .map(|asked| asked.encode(&mut detector, scene, &mut encoder));
            caller.queue.submit([encoder.finish()]);
            for (ix, (asked, left)) in both.iter().zip(&left).enumerate() {
                let expected = asked.alone(&caller, &mut alone, scene);
                assert_eq!(left.read(&caller), expected, "{round} {again} {ix}");
            }
        }
    }
}

/// Submissions that nobody waits for, each with the scene's positions after a body was elsewhere.
#[test]
fn submissions_in_flight_do_not_mix() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut alone = caller.detector(Settings::default());
    let mut random = Random::new(12);
    let mut world = world(&caller, &mut random);
    let (mut kept, mut expected) = (Vec::new(), Vec::new());
    let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    for frame in 0..12 {
        if frame % 4 == 3 {
            let points = Vec::from_iter((0..9).map(|_| random.point(-1.0, 1.0)));
            let body = world.ids[1];
            world.scene.set_positions(body, &points).expect("good");
        }
        let at = if frame % 3 == 0 {
            world.some(0, &mut random)
        } else {
            Given::new()
        };
        let asked = Asked::Frame(at);
        let mut encoder = caller.encoder();
        let Left::Pairs(found) = asked.encode(&mut detector, &world.scene, &mut encoder) else {
            panic!("a frame was asked for");
        };
        let own = caller.buffer(8, usage);
        encoder.copy_buffer_to_buffer(&found.counts, found.n_pairs_offset, &own, 0, 4);
        encoder.copy_buffer_to_buffer(&found.counts, found.n_unsure_offset, &own, 4, 4);
        caller.queue.submit([encoder.finish()]);
        kept.push(own);
        let Answer::Pairs(pairs) = asked.alone(&caller, &mut alone, &world.scene) else {
            panic!("a frame was asked for");
        };
        expected.push(pairs.map(|pairs| pairs.len() as u32).to_vec());
    }
    let found = Vec::from_iter(kept.iter().map(|own| caller.read(own)));
    assert_eq!(found, expected);
}

/// What the CPU says of a scene: its pairs, its impacts.
fn truth(scene: &Scene) -> [u64; 2] {
    answers(&mut Detector::new(Backend::Cpu).expect("settings"), scene)
}

fn answers(detector: &mut Detector, scene: &Scene) -> [u64; 2] {
    let all = &Query::all();
    let pairs = detector.detect(scene, all).expect("good");
    let impacts = detector.impacts(scene, all).expect("good");
    [pairs.hash(), impacts.hash()]
}

/// Asks the host between encoding and submission, or drops what was encoded: later answers are
/// right.
#[test]
fn what_is_asked_before_a_submission_spoils_no_later_answer() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut alone = caller.detector(Settings::default());
    let mut random = Random::new(13);
    for round in 0..40 {
        let world = world(&caller, &mut random);
        let scene = &world.scene;
        let expected = truth(scene);
        let mut encoders = Vec::new();
        for _ in 0..=random.below(2) {
            let asked = match random.below(2) {
                0 => Asked::Frame(world.some(0, &mut random)),
                _ => world.step_or_safe(&mut random),
            };
            let mut encoder = caller.encoder();
            asked.encode(&mut detector, scene, &mut encoder);
            encoders.push(encoder);
        }
        // A frame alone does not refit the boxes of steps, and another query has other parameters.
        match random.below(3) {
            0 => {
                let pairs = detector.detect(scene, &Query::all()).expect("good");
                assert_eq!(pairs.hash(), expected[0], "{round}");
            }
            1 => {
                let two = Query::between(world.ids[0], world.ids[1]);
                detector.detect(scene, &two).expect("good");
                detector.impacts(scene, &two).expect("good");
            }
            _ => assert_eq!(answers(&mut detector, scene), expected, "{round}"),
        }
        for encoder in encoders {
            if random.below(4) > 0 {
                caller.queue.submit([encoder.finish()]);
            }
        }
        for again in 0..3 {
            let next = match random.below(3) {
                0 => Asked::Frame(Given::new()),
                1 => Asked::Step(Given::new(), Given::new()),
                _ => Asked::Safe(Given::new()),
            };
            let found = next.alone(&caller, &mut detector, scene);
            let right = next.alone(&caller, &mut alone, scene);
            assert_eq!(found, right, "{round} {again}");
            assert_eq!(answers(&mut detector, scene), expected, "{round} {again}");
        }
    }
}
