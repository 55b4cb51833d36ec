//! Steps whose positions and pairs stay on the device, against the CPU.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::collections::{BTreeMap, BTreeSet};

use crate::caller::Caller;
use crate::steps::{faces, lattice};

use impinge_core::{
    Backend, BodyId, Candidates, Detector, Element, Error, Exclusion, PairKind, Part, Query,
    ResidentStep, Scene, Settings, wgpu,
};
use impinge_scenes::{Random, surfaces};

/// Pairs, until when each certainly does not touch, and by when it certainly does.
pub type Listed = BTreeMap<[u32; 2], [f32; 2]>;

/// Encodes a step until there is room for its pairs, and reads them. Also returns how often the
/// step was encoded.
pub fn listed(
    caller: &Caller,
    detector: &mut Detector,
    scene: &Scene,
    step: &Query,
    [starts, ends]: [&[(BodyId, &wgpu::Buffer)]; 2],
) -> (ResidentStep, Listed, u32) {
    for n_tries in 1..9 {
        let mut encoder = caller.encoder();
        let found =
            detector
                .gpu()
                .expect("a device")
                .encode_step(scene, step, starts, ends, &mut encoder);
        let found = found.expect("good buffers");
        caller.queue.submit([encoder.finish()]);
        if !detector.gpu().expect("a device").grow().expect("room") {
            continue;
        }
        let n = caller.read(&found.counts)[found.n_pairs_offset as usize / 4] as usize;
        assert!(n as u64 <= found.pairs_capacity);
        let pairs = caller.read(&found.pairs);
        let times = caller.read(&found.times);
        let times = times.as_chunks::<2>().0.iter();
        let times = times.map(|times| times.map(f32::from_bits));
        let each = pairs.as_chunks::<2>().0[..n].iter().copied();
        let pairs = Listed::from_iter(each.zip(times));
        assert_eq!(pairs.len(), n, "each pair is listed once");
        let least = caller.read(&found.counts)[found.touches_by_offset as usize / 4];
        let times = pairs.values().map(|[_, touches_by]| *touches_by);
        assert_eq!(f32::from_bits(least), times.fold(2.0, f32::min));
        return (found, pairs, n_tries);
    }
    panic!("there never is enough room");
}

/// The numbers of a pair in the list.
pub fn numbers(found: &ResidentStep, kind: PairKind, elements: [(BodyId, u32); 2]) -> [u32; 2] {
    let mut numbers = [0; 2];
    for ((part, (body, element)), number) in
        kind.parts().into_iter().zip(elements).zip(&mut numbers)
    {
        let mut parts = found.parts.iter();
        let part = parts.find(|each| each.part == part && each.body == body);
        let part = part.expect("a part of each part that takes part");
        assert!(element < part.len);
        *number = part.first + element;
    }
    numbers
}

/// The numbers of candidates in the list.
pub fn numbers_of(found: &ResidentStep, candidates: &Candidates) -> BTreeSet<[u32; 2]> {
    let of = |(kind, a, b): (PairKind, Element, Element)| {
        numbers(found, kind, [a, b].map(|at| (at.body, at.element)))
    };
    candidates.iter().map(of).collect()
}

/// The kind of a pair in the list, as a shader finds it.
fn kind(found: &ResidentStep, [low, high]: [u32; 2]) -> PairKind {
    assert!(low < high);
    if high < found.first_vertex {
        PairKind::EdgeEdge
    } else if low < found.first_vertex {
        PairKind::EdgeVertex
    } else if high < found.first_face {
        PairKind::VertexVertex
    } else {
        PairKind::VertexFace
    }
}

const KINDS: [PairKind; 4] = [
    PairKind::VertexFace,
    PairKind::EdgeEdge,
    PairKind::EdgeVertex,
    PairKind::VertexVertex,
];

/// Asserts that the list has all impacts of a scene and only candidates of it. Returns the number
/// of impacts.
pub fn assert_between(
    name: &str,
    found: &ResidentStep,
    pairs: &Listed,
    truth: &Scene,
    step: &Query,
    query: &Query,
) -> usize {
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let impacts = cpu.impacts(truth, step).expect(name).clone();
    let mut n_certain = 0;
    for impact in &impacts {
        let elements = [impact.a, impact.b].map(|at| (at.body, at.element));
        let pair = numbers(found, impact.kind, elements);
        let times = pairs.get(&pair);
        let [until, by] = *times.unwrap_or_else(|| panic!("{name}: {impact:?} is missing"));
        let is_between = f64::from(until) <= impact.toi && impact.toi < f64::from(by);
        assert!(is_between, "{name}: {until} {by} {impact:?}");
        let is_later = until > 0.0 || by < 2.0;
        assert!(!is_later || !impact.at_start, "{name}: {until} {impact:?}");
        n_certain += usize::from(by <= 1.0);
        assert_eq!(kind(found, pair), impact.kind, "{name}");
    }
    let mut certain = pairs.values().filter(|[_, by]| *by < 2.0);
    assert!(
        certain.all(|[until, by]| until < by && *by <= 1.0),
        "{name}"
    );
    let n_listed = pairs.values().filter(|[_, by]| *by < 2.0).count();
    assert_eq!(
        n_listed, n_certain,
        "{name}: only pairs that touch are certain to"
    );
    let asked = query.clone().kinds(KINDS);
    let candidates = cpu.candidates(truth, 0.0, &asked).expect(name);
    let candidates = numbers_of(found, &candidates);
    let are_candidates = pairs.keys().all(|pair| candidates.contains(pair));
    assert!(are_candidates, "{name}");
    let (n, n_candidates) = (pairs.len(), candidates.len());
    assert!(n < n_candidates, "{name}: {n} of {n_candidates} are left");
    impacts.len()
}

/// A body, and where it is at both ends.
type Moving = (BodyId, [Vec<[f32; 3]>; 2]);

/// Two balls that run into each other: the truth, and the same scene as the host knows it, where
/// nothing moves.
fn balls(n: usize) -> (Scene, Scene, Vec<Moving>) {
    let ball = surfaces::ball(n / 2);
    let (low, high) = ball.bounds().expect("not empty");
    let width = high[2] - low[2];
    let other = ball.translated([0.0, 0.1 * width, 1.02 * width]);
    let end_a = ball.mapped(|[x, y, z]| [1.01 * x, y, z + 0.05 * x]);
    let end_b = other.mapped(|[x, y, z]| [x, y, z - 0.2 * width + 0.01 * y]);
    let mut known = Scene::new();
    let a = ball.add_to(&mut known).expect("good");
    // Of the second ball the host knows another pose.
    let b = ball.add_to(&mut known).expect("good");
    let mut truth = known.clone();
    truth.set_positions(b, &other.positions).expect("good");
    for (body, end) in [(a, &end_a), (b, &end_b)] {
        truth.set_end_positions(body, &end.positions).expect("good");
    }
    let moving = vec![
        (a, [ball.positions, end_a.positions]),
        (b, [other.positions, end_b.positions]),
    ];
    (truth, known, moving)
}

#[test]
fn pairs_that_may_touch_stay_on_the_device() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let (truth, known, moving) = balls(3000);
    let buffers = Vec::from_iter(moving.iter().map(|(body, ends)| {
        let [start, end] = ends.each_ref().map(|end| caller.upload(end));
        (*body, start, end)
    }));
    let starts = Vec::from_iter(buffers.iter().map(|(body, start, _)| (*body, start)));
    let ends = Vec::from_iter(buffers.iter().map(|(body, _, end)| (*body, end)));
    let mut counts = Vec::new();
    for query in [
        Query::all(),
        Query::between_all(),
        Query::self_of(moving[0].0),
    ] {
        let name = format!("{query:?}");
        let step = query.clone();
        let (found, pairs, _) = listed(&caller, &mut detector, &known, &step, [&starts, &ends]);
        let n = assert_between(&name, &found, &pairs, &truth, &step, &query);
        // The same as from the host's positions, and as many as the host would be handed over.
        let (_, by_host, _) = listed(&caller, &mut detector, &truth, &step, [&[], &[]]);
        assert!(pairs == by_host, "{name}");
        let impacts = detector.impacts(&truth, &step).expect("good");
        assert_eq!(impacts.len(), n, "{name}");
        let stats = impacts.stats();
        assert_ne!(stats.backend, "cpu");
        assert_eq!(stats.n_unsure, pairs.len() as u64, "{name}");
        let n_certain = pairs.values().filter(|[_, by]| *by < 2.0).count();
        assert!(n_certain >= n * 3 / 4, "{name}: {n_certain} of {n}");
        counts.push(n);
        // Some positions from the device and some from the host.
        let mut half = known.clone();
        half.set_end_positions(moving[0].0, &moving[0].1[1])
            .expect("good");
        half.set_positions(moving[1].0, &moving[1].1[0])
            .expect("good");
        let (_, mixed, _) = listed(
            &caller,
            &mut detector,
            &half,
            &step,
            [&starts[..1], &ends[1..]],
        );
        assert!(pairs == mixed, "{name}");
    }
    assert!(counts[0] > 100 && counts[2] == 0, "{counts:?}");
    // Without positions at the end, bodies stay where the device has them.
    let mut still = truth.clone();
    still
        .set_positions(moving[0].0, &moving[0].1[1])
        .expect("good");
    still
        .set_positions(moving[1].0, &moving[1].1[1])
        .expect("good");
    for (body, _) in &moving {
        still.clear_end_positions(*body).expect("known");
    }
    let step = Query::all();
    let (_, pairs, _) = listed(&caller, &mut detector, &known, &step, [&ends, &[]]);
    let (found, by_host, _) = listed(&caller, &mut detector, &still, &step, [&[], &[]]);
    assert!(pairs == by_host);
    let query = Query::all();
    assert_between("still", &found, &pairs, &still, &step, &query);
}

#[test]
fn numbers_name_elements_of_every_kind_of_body() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    for seed in 0..3 {
        let mut random = Random::new(300 + seed);
        let edges: Vec<[u32; 2]> = (0..39).step_by(2).map(|v| [v, (v + 3) % 40]).collect();
        let mut ends = || [(); 2].map(|()| lattice(&mut random, 40, 4));
        let moving: [[Vec<[f32; 3]>; 2]; 6] = std::array::from_fn(|_| ends());
        let mut truth = Scene::new();
        // Bodies in `f64`: of these the device has positions that nobody has rounded.
        let mut known = Scene::new();
        let mut bodies = Vec::new();
        for (ix, [start, end]) in moving.iter().enumerate() {
            let wide = Vec::from_iter(start.iter().map(|p| p.map(f64::from)));
            let [body, same] = match ix / 2 {
                0 => [truth.add_points(start), known.add_points(&wide)],
                1 => [
                    truth.add_edges(&edges, start),
                    known.add_edges(&edges, &wide),
                ],
                _ => [
                    truth.add_triangles(&faces(40), start),
                    known.add_triangles(&faces(40), &wide),
                ],
            };
            let body = body.expect("good");
            truth.set_end_positions(body, end).expect("good");
            bodies.push((body, same.expect("good")));
        }
        let buffers = moving
            .each_ref()
            .map(|ends| ends.each_ref().map(|at| caller.upload(at)));
        let at = |end: usize| {
            let each = bodies.iter().zip(&buffers);
            Vec::from_iter(each.map(|(&(_, body), ends)| (body, &ends[end])))
        };
        let step = Query::all();
        let (_, pairs, _) = listed(&caller, &mut detector, &known, &step, [&at(0), &at(1)]);
        // Numbers do not depend on the scene's precision.
        let (found, by_host, _) = listed(&caller, &mut detector, &truth, &step, [&[], &[]]);
        assert!(pairs == by_host, "{seed}");
        let name = format!("bare {seed}");
        assert!(assert_between(&name, &found, &pairs, &truth, &step, &Query::all()) > 100);
        for kind_of in KINDS {
            let n = pairs
                .keys()
                .filter(|&&pair| kind(&found, pair) == kind_of)
                .count();
            assert!(n > 10, "{kind_of:?}: {n}");
        }
        let parts = found.parts.iter().map(|part| part.part);
        let parts = Vec::from_iter(parts);
        assert!(parts.is_sorted_by_key(|part| match part {
            Part::Edges => 0,
            Part::Vertices => 1,
            _ => 2,
        }));
        // Positions that the host has rounded leave more pairs.
        for ((_, body), [_, end]) in bodies.iter().zip(&moving) {
            let wide = Vec::from_iter(end.iter().map(|p| p.map(f64::from)));
            known.set_end_positions(*body, &wide).expect("good");
        }
        let (_, rounded, _) = listed(&caller, &mut detector, &known, &step, [&at(0), &[]]);
        assert!(pairs.keys().all(|pair| rounded.contains_key(pair)));
    }
}

#[test]
fn lists_that_are_too_small_grow() {
    let caller = Caller::new();
    let mut random = Random::new(5);
    let n = 600;
    let mut scene = Scene::new();
    let body = scene
        .add((faces(n), lattice::<f32>(&mut random, n, 9)))
        .expect("good");
    let end = lattice::<f32>(&mut random, n, 9);
    scene.set_end_positions(body, &end).expect("good");
    let (step, none): (_, [&[_]; 2]) = (Query::all(), [&[], &[]]);
    let mut detector = caller.detector(Settings::default());
    assert!(
        detector
            .gpu()
            .expect("a device")
            .grow()
            .expect("nothing was encoded")
    );
    let (found, pairs, n_tries) = listed(&caller, &mut detector, &scene, &step, none);
    assert!(
        n_tries > 1 && pairs.len() > 1 << 14,
        "{n_tries} {}",
        pairs.len()
    );
    let query = Query::all();
    assert_between("web", &found, &pairs, &scene, &step, &query);
    let (_, again, n_tries) = listed(&caller, &mut detector, &scene, &step, none);
    assert_eq!(n_tries, 1, "it has grown");
    assert!(again == pairs);
    // A frame and a step in one submission.
    let mut encoder = caller.encoder();
    let frame = detector
        .gpu()
        .expect("a device")
        .encode(&scene, &query, &[], &mut encoder);
    let found =
        detector
            .gpu()
            .expect("a device")
            .encode_step(&scene, &step, &[], &[], &mut encoder);
    caller.queue.submit([encoder.finish()]);
    assert!(detector.gpu().expect("a device").grow().expect("room"));
    let (frame, found) = (frame.expect("good"), found.expect("good"));
    let n = caller.read(&found.counts)[found.n_pairs_offset as usize / 4] as usize;
    assert_eq!(n, pairs.len());
    let n = caller.read(&frame.counts)[frame.n_pairs_offset as usize / 4];
    assert!(n > 100);
    let small = Settings::new().memory_budget(Some(100_000));
    let mut detector = caller.detector(small);
    let mut encoder = caller.encoder();
    let refused =
        detector
            .gpu()
            .expect("a device")
            .encode_step(&scene, &step, &[], &[], &mut encoder);
    assert!(
        matches!(refused, Err(Error::MemoryBudget { .. })),
        "{refused:?}"
    );
}

/// A budget as large as an error says is enough, for encoding and then for making room.
#[test]
fn errors_name_a_budget_that_is_enough() {
    let caller = Caller::new();
    let (mut scene, query) = (Scene::new(), Query::all());
    let ball = surfaces::ball(3000);
    ball.add_to(&mut scene).expect("good");
    ball.translated([0.02, 0.0, 0.0])
        .add_to(&mut scene)
        .expect("good");
    type Encode = fn(&mut Detector, &Scene, &Query, &mut wgpu::CommandEncoder) -> Result<(), Error>;
    let questions: [(&str, Encode); 3] = [
        ("frame", |detector, scene, query, encoder| {
            let mut gpu = detector.gpu().expect("a device");
            gpu.encode(scene, query, &[], encoder).map(drop)
        }),
        ("step", |detector, scene, query, encoder| {
            let mut gpu = detector.gpu().expect("a device");
            gpu.encode_step(scene, query, &[], &[], encoder).map(drop)
        }),
        ("safe distances", |detector, scene, query, encoder| {
            let mut gpu = detector.gpu().expect("a device");
            gpu.encode_safe_distances(scene, 0.05, query, &[], encoder)
                .map(drop)
        }),
    ];
    for (question, encode) in questions {
        let mut memory_budget = 400_000;
        let mut n_refused = [0; 2];
        let enough = |error: Error, memory_budget: u64| match error {
            Error::MemoryBudget { needed, budget, .. } => {
                assert_eq!(budget, memory_budget);
                assert!(needed > budget, "{question}: {needed} {budget}");
                needed
            }
            error => panic!("{question}: {error}"),
        };
        'raised: loop {
            let settings = Settings::new().memory_budget(Some(memory_budget));
            let mut detector = caller.detector(settings);
            loop {
                let mut encoder = caller.encoder();
                if let Err(error) = encode(&mut detector, &scene, &query, &mut encoder) {
                    memory_budget = enough(error, memory_budget);
                    n_refused[0] += 1;
                    continue 'raised;
                }
                caller.queue.submit([encoder.finish()]);
                match detector.gpu().expect("a device").grow() {
                    Ok(true) => break 'raised,
                    Ok(false) => {}
                    Err(error) => {
                        memory_budget = enough(error, memory_budget);
                        n_refused[1] += 1;
                        break;
                    }
                }
            }
        }
        // Once for what is sent; then once for each stage, the last of which is known once there
        // is room for those before.
        assert!(
            n_refused[0] == 1 && n_refused[1] <= 4,
            "{question}: {n_refused:?}"
        );
    }
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    use wgpu::BufferUsages as Usage;
    let caller = Caller::new();
    let mut scene = Scene::new();
    let triangle = [[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let body = scene.add_triangles(&[[0, 1, 2]], &triangle).expect("good");
    let gone = scene.add_triangles(&[[0, 1, 2]], &triangle).expect("good");
    scene.remove(gone).expect("known");
    let good = caller.upload(&triangle);
    let small = caller.buffer(32, Usage::COPY_SRC);
    let useless = caller.buffer(36, Usage::COPY_DST);
    let mut detector = caller.detector(Settings::default());
    let mut refused = |step: &Query, starts: &[_], ends: &[_]| {
        let mut encoder = caller.encoder();
        let refused =
            detector
                .gpu()
                .expect("a device")
                .encode_step(&scene, step, starts, ends, &mut encoder);
        refused.expect_err("refused").to_string()
    };
    let step = Query::all();
    for (starts, ends, texts) in [
        (
            [(body, &small)],
            [(body, &good)],
            [
                "its positions take 36 bytes, the buffer has 32",
                &*body.to_string(),
            ],
        ),
        (
            [(body, &good)],
            [(body, &small)],
            [
                "its end positions take 36 bytes, the buffer has 32",
                &body.to_string(),
            ],
        ),
        (
            [(body, &useless)],
            [(body, &good)],
            [
                "the buffer of its positions lacks the usage COPY_SRC",
                &body.to_string(),
            ],
        ),
        (
            [(body, &good)],
            [(body, &useless)],
            [
                "the buffer of its end positions lacks the usage COPY_SRC",
                &body.to_string(),
            ],
        ),
        ([(body, &good)], [(gone, &good)], [&*gone.to_string(), ""]),
    ] {
        let error = refused(&step, &starts, &ends);
        assert!(texts.iter().all(|text| error.contains(text)), "{error}");
    }
    let twice = [(body, &good), (body, &good)];
    for (starts, ends, words) in [
        (&twice[..], &[][..], "its positions are given twice"),
        (&[], &twice, "its end positions are given twice"),
    ] {
        let error = refused(&step, starts, ends);
        assert!(
            error.contains(words) && error.contains(&body.to_string()),
            "{error}"
        );
    }
    let rings = step.clone().exclude(Exclusion::rings(17));
    let error = refused(&rings, &[], &[]);
    assert!(error.contains("rings: 17"), "{error}");
    let apart = step.clone().separation(1e31);
    let error = refused(&apart, &[], &[]);
    assert!(error.contains("separation: 1e31"), "{error}");
    let cell = Query::all().owned_by([0.0; 3], [1.0; 3]);
    let error = refused(&cell, &[], &[]);
    assert!(error.contains("owned_by"), "{error}");
    let mut thick = scene.clone();
    thick.set_thickness(body, 1e31).expect("good");
    let mut encoder = caller.encoder();
    let mut device = detector.gpu().expect("a device");
    let refused = device.encode_step(&thick, &step, &[], &[], &mut encoder);
    let error = refused.expect_err("refused").to_string();
    assert!(error.contains("thickness: 1e31 of body"), "{error}");
    let none = &mut encoder;
    let twice = [(body, &good), (body, &good)];
    let refused = [
        device.encode(&scene, &step, &twice, none).map(|_| ()),
        device
            .encode_safe_distances(&scene, 0.5, &step, &twice, none)
            .map(|_| ()),
    ];
    for refused in refused {
        let error = refused.expect_err("refused").to_string();
        let words = format!("body {body}: its positions are given twice");
        assert!(error.contains(&words), "{error}");
    }
    let refused = device.encode(&scene, &cell, &[], none);
    let error = refused.expect_err("refused").to_string();
    assert!(error.contains("a cell in a frame"), "{error}");
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    assert!(cpu.gpu().is_none());
}

#[test]
fn damaged_names_are_noticed() {
    let caller = Caller::new();
    let (truth, _, _) = balls(600);
    let step = Query::all();
    let mut sound = caller.detector(Settings::default());
    let (_, expected, _) = listed(&caller, &mut sound, &truth, &step, [&[], &[]]);
    assert!(!expected.is_empty());
    for (line, damaged) in [
        ("if params.by_number == 0u {", "if params.by_number != 0u {"),
        (
            "UnsureKey(min(number_a, number_b),",
            "UnsureKey(min(a, number_b),",
        ),
        ("max(number_a, number_b));", "number_a);"),
        ("found.touches_by = high;", "found.touches_by = low;"),
        ("time_of(bracket.touches_by)", "2.0"),
        ("time_of(bracket.free_until)", "0.0"),
    ] {
        let damage = ("narrow_search", line, damaged);
        let mut encoder = caller.encoder();
        let mut detector = caller.damaged(Settings::default(), damage);
        let found =
            detector
                .gpu()
                .expect("a device")
                .encode_step(&truth, &step, &[], &[], &mut encoder);
        caller.queue.submit([encoder.finish()]);
        let found = found.expect("good");
        let n = caller.read(&found.counts)[found.n_pairs_offset as usize / 4] as usize;
        let [words, times] = [&found.pairs, &found.times].map(|list| caller.read(list));
        let times = times.as_chunks::<2>().0.iter();
        let times = times.map(|times| times.map(f32::from_bits));
        let each = words.as_chunks::<2>().0[..n].iter().copied();
        assert!(Listed::from_iter(each.zip(times)) != expected, "{damage:?}");
    }
}
