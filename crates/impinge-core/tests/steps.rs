//! Steps: what touches while bodies move, when first, and how far a step can be taken.

use impinge_core::exact::{ElementPair, first_contact};
use impinge_core::{
    Backend, BodyId, CancelToken, CandidateQuery, Control, Detector, Error, Method, PairKind, Part,
    Query, Scene, Settings, Start, Step, Toi,
};

const FACE: [[u32; 3]; 1] = [[0, 1, 2]];
const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

fn detectors() -> Vec<Detector> {
    let settings = [Method::Clusters, Method::Naive].map(|method| Settings {
        method,
        backend: Backend::Cpu,
        ..Settings::default()
    });
    settings
        .map(|settings| Detector::with_settings(settings).expect("settings"))
        .into()
}

fn lifted(z: f32) -> [[f32; 3]; 3] {
    CORNERS.map(|[x, y, _]| [x + 1.0, y + 1.0, z])
}

/// A triangle that falls through another; both end far below.
fn falling() -> (Scene, BodyId, BodyId) {
    let mut scene = Scene::new();
    let floor = scene.add_triangles(&FACE, &CORNERS).expect("good");
    let other = scene.add_triangles(&FACE, &lifted(1.0)).expect("good");
    scene.set_end_positions(other, &lifted(-3.0)).expect("good");
    (scene, floor, other)
}

#[test]
fn a_triangle_that_falls_through_another_touches_it_at_a_quarter() {
    for mut detector in detectors() {
        let (scene, floor, other) = falling();
        let impacts = detector.impacts(&scene, &Step::default()).expect("good");
        assert!(
            impacts
                .iter()
                .all(|impact| impact.toi == 0.25 && !impact.at_start)
        );
        // One vertex lands inside the floor; its two edges meet the floor's long edge.
        let rows: Vec<_> = impacts.iter().map(|i| (i.kind, i.a, i.b)).collect();
        let vf = impacts.of(PairKind::VertexFace);
        assert_eq!(vf.len(), 1, "{rows:?}");
        assert_eq!(
            (vf[0].a.body, vf[0].a.primitive, vf[0].b.body),
            (other, 0, floor)
        );
        assert_eq!(impacts.of(PairKind::EdgeEdge).len(), 2, "{rows:?}");
        let hash = impacts.hash();
        let earliest = detector.earliest(&scene, &Step::default()).expect("good");
        assert_eq!(
            earliest.map(|impact| impact.kind),
            Some(PairKind::VertexFace)
        );
        assert!(!detector.is_free(&scene, &Step::default()).expect("good"));
        let between = Step::new(Query::between(other, floor)).toi(Toi::F64);
        let impacts = detector.impacts(&scene, &between).expect("good");
        assert_eq!(impacts.hash(), hash, "1/4 is the same in both precisions");
    }
}

#[test]
fn a_body_without_end_positions_stands_still() {
    for mut detector in detectors() {
        let (mut scene, _, other) = falling();
        scene.clear_end_positions(other).expect("known");
        assert!(detector.is_free(&scene, &Step::default()).expect("good"));
        scene.set_end_positions(other, &lifted(-3.0)).expect("good");
        assert!(!detector.is_free(&scene, &Step::default()).expect("good"));
        scene.set_positions(other, &lifted(1.0)).expect("good");
        assert!(scene.body(other).expect("known").end_positions().is_none());
        assert!(detector.is_free(&scene, &Step::default()).expect("good"));
    }
}

#[test]
fn what_touches_at_the_start_is_reported_at_zero_or_left_out() {
    for mut detector in detectors() {
        let (mut scene, _, other) = falling();
        scene.set_positions(other, &lifted(0.0)).expect("good");
        scene.set_end_positions(other, &lifted(1.0)).expect("good");
        let impacts = detector.impacts(&scene, &Step::default()).expect("good");
        assert_eq!(impacts.touching_at_start(), impacts.len());
        assert_eq!(impacts.len(), 3);
        assert!(impacts.iter().all(|impact| impact.toi == 0.0));
        let skip = Step::default().start(Start::Skip);
        assert!(detector.is_free(&scene, &skip).expect("good"));
    }
}

#[test]
fn points_and_edges_meet_each_other_and_surfaces() {
    for mut detector in detectors() {
        let mut scene = Scene::new();
        let point = scene.add_points(&[[0.0f64, 0.0, 1.0]]).expect("good");
        scene
            .set_end_positions(point, &[[0.0f64, 0.0, -1.0]])
            .expect("good");
        let edge = [[-1.0f64, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let edge = scene.add_edges(&[[0, 1]], &edge).expect("good");
        let resting = scene.add_points(&[[0.0f64, 0.0, -0.5]]).expect("good");
        let impacts = detector.impacts(&scene, &Step::default()).expect("good");
        let rows: Vec<_> = impacts
            .iter()
            .map(|i| (i.kind, i.a.body, i.b.body, i.toi))
            .collect();
        let expected = [
            (PairKind::EdgeVertex, edge, point, 0.5),
            (PairKind::VertexVertex, point, resting, 0.75),
        ];
        assert_eq!(rows, expected);
    }
}

#[test]
fn a_step_that_is_advanced_is_free_to_its_rounded_end() {
    for mut detector in detectors() {
        let (mut scene, _, other) = falling();
        let advance = detector.advance(&scene, &Step::default()).expect("good");
        assert!(
            advance.fraction > 0.249_999 && advance.fraction < 0.25,
            "{advance:?}"
        );
        advance.apply(&mut scene).expect("same bodies");
        assert!(
            detector
                .detect(&scene, &Query::all())
                .expect("good")
                .is_empty()
        );
        // The body goes on from there, but never passes through.
        scene.set_end_positions(other, &lifted(-3.0)).expect("good");
        let next = detector.advance(&scene, &Step::default()).expect("good");
        assert!(next.fraction < 1e-6, "{next:?}");
        // Upwards the whole step is free.
        scene.set_end_positions(other, &lifted(2.0)).expect("good");
        let up = detector.advance(&scene, &Step::default()).expect("good");
        assert_eq!((up.fraction, up.first), (1.0, None));
        up.apply(&mut scene).expect("same bodies");
        assert_eq!(
            scene.body(other).expect("known").positions(),
            &lifted(2.0).to_vec().into()
        );
    }
}

#[test]
fn bad_end_positions_are_refused_by_name() {
    let (mut scene, _, other) = falling();
    let few = scene.set_end_positions(other, &CORNERS[..2]);
    let wrong = Error::WrongNumberOfPositions {
        body: other,
        given: 2,
        expected: 3,
    };
    assert_eq!(few, Err(wrong));
    let bad = scene.set_end_positions(other, &[[0.0; 3], [0.0, f32::NAN, 0.0], [0.0; 3]]);
    assert!(matches!(
        bad,
        Err(Error::NonFinitePosition { vertex: 1, .. })
    ));
    let kept = scene.body(other).expect("known").end_positions();
    assert_eq!(kept, Some(&lifted(-3.0).to_vec().into()));
    let distance = CandidateQuery::new(Query::all()).distance(-1.0);
    for mut detector in detectors() {
        let refused = detector.candidates(&scene, &distance);
        assert!(matches!(
            refused,
            Err(Error::Setting {
                setting: "distance",
                ..
            })
        ));
    }
}

#[test]
fn candidates_are_boxes_that_overlap_within_twice_the_distance() {
    for mut detector in detectors() {
        let mut scene = Scene::new();
        scene.add_points(&[[0.0f32, 0.0, 0.0]]).expect("good");
        let far = scene.add_points(&[[3.0f32, 0.0, 0.0]]).expect("good");
        let query = CandidateQuery::new(Query::everything()).kinds([PairKind::VertexVertex]);
        let mut count = |scene: &Scene, distance: f64| {
            let query = query.clone().distance(distance);
            detector.candidates(scene, &query).expect("good").len()
        };
        assert_eq!(
            [0.0, 1.0, 1.5_f64.next_down(), 1.5].map(|d| count(&scene, d)),
            [0, 0, 0, 1]
        );
        scene
            .set_end_positions(far, &[[1.0f32, 0.0, 0.0]])
            .expect("good");
        assert_eq!([0.49, 0.5].map(|d| count(&scene, d)), [0, 1]);
    }
}

#[test]
fn a_cancelled_question_about_a_step_ends_and_the_detector_goes_on() {
    let token = CancelToken::new();
    token.cancel();
    let control = Control::new().cancel(&token);
    let step = Step::default();
    for mut detector in detectors() {
        let (scene, _, _) = falling();
        let impacts = detector.impacts_with(&scene, &step, &control).err();
        assert_eq!(impacts, Some(Error::Cancelled));
        let earliest = detector.earliest_with(&scene, &step, &control).err();
        assert_eq!(earliest, Some(Error::Cancelled));
        let is_free = detector.is_free_with(&scene, &step, &control).err();
        assert_eq!(is_free, Some(Error::Cancelled));
        let advance = detector.advance_with(&scene, &step, &control).err();
        assert_eq!(advance, Some(Error::Cancelled));
        let query = CandidateQuery::new(Query::everything());
        let candidates = detector.candidates_with(&scene, &query, &control).err();
        assert_eq!(candidates, Some(Error::Cancelled));
        assert_eq!(detector.is_free(&scene, &step), Ok(false));
    }
}

/// Lattice coordinates make a third of the cases degenerate.
#[test]
fn lattices_are_answered_as_pair_by_pair() {
    for seed in 0..12 {
        let mut random = impinge_scenes::Random::new(seed);
        let mut lattice = |n: usize| -> Vec<[f32; 3]> {
            let mut at = || random.below(5) as f32;
            (0..n).map(|_| [at(), at(), at()]).collect()
        };
        let n = 24;
        let (start, end) = (lattice(n), lattice(n));
        let faces: Vec<[u32; 3]> = (0..n as u32 / 3)
            .map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % 24])
            .collect();
        let mut scene = Scene::new();
        let body = scene.add(faces.clone(), start.clone()).expect("good");
        scene.set_end_positions(body, &end).expect("good");
        let edges = scene.body(body).expect("known").part(Part::Edges).clone();
        let wide = |p: [f32; 3]| p.map(f64::from);
        let mut expected = Vec::new();
        let mut try_pair = |pair, kind, a: u32, b: u32, ids: [u32; 4], shares: bool| {
            let [start, end] = [&start, &end].map(|p| ids.map(|id| wide(p[id as usize])));
            if !shares && let Some(contact) = first_contact(pair, &start, &end) {
                expected.push((kind, a, b, f64::from(contact.time_f32()), contact.at_start));
            }
        };
        for v in 0..n as u32 {
            if !faces.as_flattened().contains(&v) {
                continue;
            }
            for (f, &[p, q, r]) in (0..).zip(&faces) {
                let shares = [p, q, r].contains(&v);
                try_pair(
                    ElementPair::VertexFace,
                    PairKind::VertexFace,
                    v,
                    f,
                    [v, p, q, r],
                    shares,
                );
            }
        }
        for e in 0..edges.len() {
            for g in e + 1..edges.len() {
                let (a, b) = (edges.corners(e), edges.corners(g));
                let shares = a.iter().any(|v| b.contains(v));
                let ids = [a[0], a[1], b[0], b[1]];
                try_pair(
                    ElementPair::EdgeEdge,
                    PairKind::EdgeEdge,
                    e as u32,
                    g as u32,
                    ids,
                    shares,
                );
            }
        }
        expected.sort_by_key(|row| (row.0, row.1, row.2));
        for mut detector in detectors() {
            let impacts = detector.impacts(&scene, &Step::default()).expect("good");
            let found: Vec<_> = impacts
                .iter()
                .map(|i| (i.kind, i.a.primitive, i.b.primitive, i.toi, i.at_start))
                .collect();
            assert_eq!(found, expected, "seed {seed}");
            let all = impacts.earliest();
            assert_eq!(
                detector.earliest(&scene, &Step::default()).expect("good"),
                all
            );
            let is_free = detector.is_free(&scene, &Step::default()).expect("good");
            assert_eq!(is_free, expected.is_empty());
        }
    }
}

/// Two bodies of random triangles on a lattice of even numbers, at the start and at the end of a step.
struct Twins {
    faces: [Vec<[u32; 3]>; 2],
    start: [Vec<[f32; 3]>; 2],
    end: [Vec<[f32; 3]>; 2],
}

type Row = (PairKind, (bool, u32), (bool, u32), u64, bool);

impl Twins {
    fn new(seed: u64) -> Self {
        let mut random = impinge_scenes::Random::new(seed);
        let n = 30;
        let mut lattice = || -> Vec<[f32; 3]> {
            let mut at = || 2.0 * random.below(6) as f32;
            (0..n).map(|_| [at(), at(), at()]).collect()
        };
        let positions: Vec<Vec<[f32; 3]>> = (0..4).map(|_| lattice()).collect();
        let faces = (0..n as u32 / 3).map(|f| [3 * f, 3 * f + 1, (3 * f + 5) % n as u32]);
        let faces: Vec<[u32; 3]> = faces.collect();
        Twins {
            faces: [faces.clone(), faces],
            start: [positions[0].clone(), positions[1].clone()],
            end: [positions[2].clone(), positions[3].clone()],
        }
    }

    /// Sorted rows of impacts. An element is named by whether it belongs to the second body, and its number.
    fn rows(&self, swapped: bool, detector: &mut Detector) -> Vec<Row> {
        let mut scene = Scene::new();
        let order = if swapped { [1, 0] } else { [0, 1] };
        let mut first = None;
        for ix in order {
            let body = scene
                .add(self.faces[ix].clone(), self.start[ix].clone())
                .expect("good");
            scene.set_end_positions(body, &self.end[ix]).expect("good");
            first = first.or(Some(body));
        }
        let impacts = detector.impacts(&scene, &Step::default()).expect("good");
        let side = |body: BodyId| (Some(body) == first) == swapped;
        let mut rows: Vec<Row> = impacts
            .iter()
            .map(|i| {
                let mut a = (side(i.a.body), i.a.primitive);
                let mut b = (side(i.b.body), i.b.primitive);
                if i.kind == PairKind::EdgeEdge && b < a {
                    (a, b) = (b, a);
                }
                (i.kind, a, b, i.toi.to_bits(), i.at_start)
            })
            .collect();
        rows.sort_unstable();
        rows
    }

    fn map(&self, f: impl Fn([f32; 3]) -> [f32; 3] + Copy) -> Twins {
        let all = |bodies: &[Vec<[f32; 3]>; 2]| {
            bodies
                .clone()
                .map(|positions| positions.into_iter().map(f).collect())
        };
        Twins {
            faces: self.faces.clone(),
            start: all(&self.start),
            end: all(&self.end),
        }
    }
}

#[test]
fn twins_have_the_same_impacts() {
    for seed in 0..6 {
        let mut detector = detectors().remove(0);
        let twins = Twins::new(seed);
        let rows = twins.rows(false, &mut detector);
        assert!(!rows.is_empty());
        assert_eq!(twins.rows(true, &mut detector), rows, "bodies swapped");
        let moved = twins.map(|[x, y, z]| [x + 1024.0, y - 4096.0, z]);
        assert_eq!(moved.rows(false, &mut detector), rows, "translated");
        let turned = twins.map(|[x, y, z]| [z, -x, y]);
        assert_eq!(
            turned.rows(false, &mut detector),
            rows,
            "axes permuted, one mirrored"
        );
        let scaled = twins.map(|p| p.map(|x| x * 2f32.powi(-40)));
        assert_eq!(scaled.rows(false, &mut detector), rows, "scaled");
        let mut reversed = twins.map(|p| p);
        std::mem::swap(&mut reversed.start, &mut reversed.end);
        let pairs = |rows: &[Row]| {
            rows.iter()
                .map(|row| (row.0, row.1, row.2))
                .collect::<Vec<_>>()
        };
        let backwards = reversed.rows(false, &mut detector);
        assert_eq!(
            pairs(&backwards),
            pairs(&rows),
            "backwards the same pairs touch"
        );
    }
}

#[test]
fn a_step_is_its_two_halves() {
    for seed in 0..6 {
        let mut detector = detectors().remove(0);
        let twins = Twins::new(seed);
        // The mean of two even numbers is an integer.
        let middle: [Vec<[f32; 3]>; 2] = std::array::from_fn(|body| {
            let ends = twins.start[body].iter().zip(&twins.end[body]);
            let mean = |(x, y): (&[f32; 3], &[f32; 3])| {
                std::array::from_fn(|axis| (x[axis] + y[axis]) / 2.0)
            };
            ends.map(mean).collect()
        });
        let (mut first, mut second) = (twins.map(|p| p), twins.map(|p| p));
        first.end = middle.clone();
        second.start = middle;
        let mut expected = std::collections::BTreeMap::new();
        for (half, twins) in [(0.5, &second), (0.0, &first)] {
            for (kind, a, b, toi, at_start) in twins.rows(false, &mut detector) {
                let toi = half + f64::from_bits(toi) / 2.0;
                let rounded = {
                    let nearest = toi as f32;
                    if f64::from(nearest) > toi {
                        nearest.next_down()
                    } else {
                        nearest
                    }
                };
                let row = (f64::from(rounded).to_bits(), at_start && half == 0.0);
                expected.insert((kind, a, b), row);
            }
        }
        let whole = twins.rows(false, &mut detector);
        let expected: Vec<Row> = expected
            .into_iter()
            .map(|((kind, a, b), (toi, at_start))| (kind, a, b, toi, at_start))
            .collect();
        assert_eq!(whole, expected, "seed {seed}");
    }
}
