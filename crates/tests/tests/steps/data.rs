//! Steps of real scenes against answers from elsewhere: every pair that touches, and every time to
//! the last bit. Fails if the data folder (`../shared/data` or `$IMPINGE_DATA`) is absent, unless
//! `IMPINGE_NO_DATA=1` is set.

use std::ops::ControlFlow;

use impinge_core::{
    Backend, Detector, Impact, InstructionSet, PairKind, Precision, Query, Scene, Settings, Start,
};
use impinge_testing::data::test_file;
use impinge_testing::npy;

struct Scenario {
    name: &'static str,
    frames: [&'static str; 2],
}

const SCENARIOS: [Scenario; 2] = [
    Scenario {
        name: "cloth-ball",
        frames: ["cloth_ball92", "cloth_ball93"],
    },
    Scenario {
        name: "cloth-funnel",
        frames: ["227", "228"],
    },
];

/// The scenarios with their scenes; none if the data may be absent and is.
fn scenarios() -> impl Iterator<Item = (Scenario, Scene)> {
    let scenarios = SCENARIOS.into_iter();
    scenarios.filter_map(|scenario| scenario.scene().map(|scene| (scenario, scene)))
}

impl Scenario {
    fn scene(&self) -> Option<Scene> {
        let read = |frame| {
            let path = test_file(&format!("ccd/{}/frames/{frame}.ply", self.name))?;
            Some(impinge_io::read(&path, &impinge_io::ReadOptions::as_they_are()).expect("a mesh"))
        };
        let [start, end] = self.frames;
        let (start, end) = (read(start)?, read(end)?);
        let impinge_io::Elements::Triangles(faces) = start.elements else {
            panic!("a surface");
        };
        let mut scene = Scene::new();
        match (start.positions, end.positions) {
            (impinge_io::Positions::F32(start), impinge_io::Positions::F32(end)) => {
                let body = scene.add((faces, start)).expect("good");
                scene.set_end_positions(body, &end).expect("good");
            }
            (impinge_io::Positions::F64(start), impinge_io::Positions::F64(end)) => {
                let body = scene.add((faces, start)).expect("good");
                scene.set_end_positions(body, &end).expect("good");
            }
            _ => panic!("one precision"),
        }
        Some(scene)
    }

    /// Pairs and times of one kind.
    fn expected(&self, kind: PairKind, toi: Precision) -> Vec<(u32, u32, f64)> {
        let file = |what: &str| {
            let path = format!("ccd/{}/{}_{what}.npy", self.name, kind.name());
            std::fs::read(test_file(&path).expect("beside the frames")).expect("readable")
        };
        let pairs = npy::rows(&file("contacts"), "<u4", u32::from_le_bytes);
        let times = match toi {
            Precision::F32 => npy::rows(&file("toi_f32"), "<f4", |b| f32::from_le_bytes(b).into()),
            Precision::F64 => npy::rows(&file("toi_f64"), "<f8", f64::from_le_bytes),
        };
        let rows = pairs.into_iter().zip(times);
        rows.map(|([a, b], [time])| (a, b, time)).collect()
    }
}

fn rows(impacts: &[Impact]) -> Vec<(u32, u32, f64)> {
    let rows = impacts.iter();
    rows.map(|i| (i.a.element, i.b.element, i.toi)).collect()
}

fn detector(threads: usize, instruction_set: InstructionSet, budget: Option<u64>) -> Detector {
    let settings = Settings::new()
        .backend(Backend::Cpu)
        .threads(threads)
        .instruction_set(instruction_set)
        .memory_budget(budget);
    Detector::new(settings).expect("settings")
}

#[test]
fn every_pair_and_every_time_is_that_of_the_exact_prototype() {
    for (scenario, scene) in scenarios() {
        for toi in [Precision::F32, Precision::F64] {
            let mut detector = detector(2, InstructionSet::default(), None);
            let step = Query::all().precision(toi);
            let impacts = detector.impacts(&scene, &step).expect("good").clone();
            for kind in [PairKind::VertexFace, PairKind::EdgeEdge] {
                let (found, expected) = (rows(impacts.of(kind)), scenario.expected(kind, toi));
                assert_eq!(
                    found.len(),
                    expected.len(),
                    "{} {}",
                    scenario.name,
                    kind.name()
                );
                for (found, expected) in found.iter().zip(&expected) {
                    assert_eq!(found, expected, "{} {} {toi:?}", scenario.name, kind.name());
                }
            }
            let both =
                impacts.of(PairKind::VertexFace).len() + impacts.of(PairKind::EdgeEdge).len();
            assert_eq!(both, impacts.len(), "a surface has no bare edges or points");
            let earliest = detector.earliest(&scene, &step).expect("good");
            assert_eq!(earliest, impacts.earliest(), "{} {toi:?}", scenario.name);
            assert!(!detector.is_free(&scene, &step).expect("good"));
        }
    }
}

/// Fails where no adapter is found. A software driver is enough, but takes seconds for the larger
/// step, so there is enough room at once.
#[cfg(feature = "gpu")]
#[test]
fn a_device_leaves_every_pair_that_touches() {
    let mut room = impinge_core::Capacities::default();
    (room.items, room.candidates) = (1 << 16, 1 << 21);
    (room.pairs, room.unsure) = (1 << 19, 1 << 18);
    let settings = Settings::new().backend(Backend::Gpu);
    let device = Detector::with_capacities(settings, room);
    let mut device = device.expect("a GPU or a software driver");
    for (scenario, scene) in scenarios() {
        let step = Query::all();
        let impacts = device.impacts(&scene, &step).expect("good").clone();
        let stats = impacts.stats();
        assert_ne!(stats.backend, "cpu");
        let (n, n_left) = (stats.n_candidates, stats.n_unsure);
        println!("{}: {n_left} of {n} are left", scenario.name);
        // Hardly more than touch; in a small step of cloth at rest on cloth, a few hundred more.
        let n_most = impacts.len() as u64 * 101 / 100 + 600;
        assert!(n_left < n_most, "{}: {n_left} of {n}", scenario.name);
        for kind in [PairKind::VertexFace, PairKind::EdgeEdge] {
            let (found, expected) = (
                rows(impacts.of(kind)),
                scenario.expected(kind, Precision::F32),
            );
            assert_eq!(found.len(), expected.len(), "{}", scenario.name);
            for (found, expected) in found.iter().zip(&expected) {
                assert_eq!(found, expected, "{} {}", scenario.name, kind.name());
            }
        }
        let earliest = device.earliest(&scene, &step).expect("good");
        assert_eq!(earliest, impacts.earliest());
        // Other pairs touch later than one that certainly touches. How many are dropped before that
        // is known depends on the device's threads: of few, perhaps none.
        let n_earliest = device.stats().n_unsure;
        println!("{}: {n_earliest} may be the earliest", scenario.name);
        let n_most = n_left.min(1000);
        assert!(
            n_earliest <= n_most,
            "{}: {n_earliest} of {n}",
            scenario.name
        );
        assert!(!device.is_free(&scene, &step).expect("good"));
        if scenario.name == "cloth-funnel" {
            let exact = device
                .impacts(&scene, &step.precision(Precision::F64))
                .expect("good");
            let found = rows(exact.of(PairKind::EdgeEdge));
            assert_eq!(found, scenario.expected(PairKind::EdgeEdge, Precision::F64));
        }
    }
}

#[test]
fn bytes_are_the_same_for_all_instruction_sets_threads_and_budgets() {
    for (_, scene) in scenarios() {
        let step = Query::all();
        let all = detector(2, InstructionSet::default(), None)
            .impacts(&scene, &step)
            .expect("good")
            .clone();
        for (threads, set, budget) in [
            (1, InstructionSet::Portable, None),
            (3, InstructionSet::Avx2, None),
            (1, InstructionSet::Avx512, Some(80_000_000)),
        ] {
            let mut other = detector(threads, set, budget);
            let impacts = other.impacts(&scene, &step).expect("good");
            assert!(impacts.iter().eq(&all), "{threads} {set:?} {budget:?}");
            let earliest = other.earliest(&scene, &step).expect("good");
            assert_eq!(earliest, all.earliest(), "{threads} {set:?} {budget:?}");
        }
    }
}

#[test]
fn boxes_overlap_as_often_as_others_counted() {
    let Some(counts) = test_file("expected/swept_box_pairs.json") else {
        return;
    };
    let counts = std::fs::File::open(counts).expect("readable");
    let counts: serde_json::Value = serde_json::from_reader(counts).expect("JSON");
    for (scenario, scene) in scenarios() {
        let mut detector = detector(2, InstructionSet::default(), None);
        let query = Query::all();
        let candidates = detector.candidates(&scene, 0.0, &query).expect("good");
        for kind in [PairKind::VertexFace, PairKind::EdgeEdge] {
            let expected = counts[scenario.name]["recomputed_f64"][kind.name()].as_u64();
            assert_eq!(
                Some(candidates.of(kind).len() as u64),
                expected,
                "{}",
                scenario.name
            );
        }
        let rows: Vec<_> = candidates.rows_of(PairKind::EdgeEdge).collect();
        assert!(rows.is_sorted_by(|a, b| a < b), "sorted, each once");
        // Run by run, within a budget that does not hold all of them.
        let all: Vec<_> = candidates.iter().collect();
        let mut detector = self::detector(2, InstructionSet::default(), Some(30_000_000));
        let (mut rest, mut n_runs) = (&all[..], 0);
        let found = detector.candidates_in_runs(&scene, 0.0, &query, all.len() as u64 / 3, |run| {
            let (own, others) = rest.split_at(run.len());
            assert!(run.iter().eq(own.iter().copied()), "{}", scenario.name);
            (rest, n_runs) = (others, n_runs + 1);
            ControlFlow::<()>::Continue(())
        });
        assert_eq!(found, Ok(ControlFlow::Continue(all.len() as u64)));
        assert!(n_runs > 3 && rest.is_empty(), "{n_runs} runs");
    }
}

#[test]
fn a_step_of_cloth_can_be_taken_up_to_its_first_contact() {
    for (scenario, mut scene) in scenarios() {
        let mut detector = detector(2, InstructionSet::default(), None);
        let step = Query::all().start(Start::Skip);
        let first = detector
            .earliest(&scene, &step.clone().precision(Precision::F64))
            .expect("good");
        let advance = detector.advance(&scene, &step).expect("good");
        assert_eq!(advance.first, first);
        let first = first.expect("contacts").toi;
        println!(
            "{}: {} of {first}, {} tried",
            scenario.name, advance.fraction, advance.n_tried
        );
        assert!(advance.fraction <= first && advance.fraction > 0.5 * first);
        for (body, positions) in advance.iter() {
            scene.set_end_positions(body, positions).expect("good");
        }
        assert!(detector.is_free(&scene, &step).expect("good"));
    }
}
