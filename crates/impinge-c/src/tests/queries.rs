//! Every option of a query, about every scene of the catalogue: what C answers is what Rust answers,
//! bit by bit, and what Rust refuses is refused with the same message.

use std::ffi::CStr;
use std::ptr::null_mut;

use impinge::{
    Backend, BodyId, Bounds, Clearance, Csr, Detector, Error, Exclusion, Filter, NearPairs,
    PairKind, Part, Positions, Precision, Query, Scene, SharedVertex, Start, Thickness,
};

use super::{Built, catalogue, numbers, through_c};
use crate::answers::*;
use crate::arrays::{no_rows, positions_view, view, view_of};
use crate::motion::*;
use crate::neighbours::*;
use crate::questions::*;
use crate::safe::*;
use crate::scene::*;
use crate::status::{Failure, impinge_error_message};
use crate::types::*;

/// What Rust answers, if it does: C has answered too then, and refuses in the same words else.
#[track_caller]
fn answered<T>(status: Status, expected: Result<T, Error>) -> Option<T> {
    // SAFETY: the message lives until this thread's next failure.
    let message = unsafe { CStr::from_ptr(impinge_error_message()) };
    let message = message.to_str().expect("UTF-8");
    match expected {
        Ok(expected) => {
            assert_eq!(status, OK, "{message}");
            Some(expected)
        }
        Err(error) => {
            let expected = Failure::from(error);
            assert_eq!((status, message), (expected.status, &*expected.message));
            None
        }
    }
}

fn bits(of: &[f64]) -> Vec<u64> {
    of.iter().map(|x| x.to_bits()).collect()
}

/// Compares the lists of one kind, seen from one side.
///
/// # Safety
/// As in `through_c`.
unsafe fn check_lists(of: *mut impinge_neighbours, kind: PairKind, reversed: u32, expected: &Csr) {
    let [mut offsets, mut indices, mut distances] = [no_rows(U8); 3];
    // SAFETY: the caller's promise.
    unsafe {
        let status = impinge_neighbours_lists(
            of,
            bit(kind),
            reversed,
            &mut offsets,
            &mut indices,
            &mut distances,
        );
        assert_eq!(status, OK);
        assert_eq!(numbers::<u64>(&offsets), expected.offsets);
        assert_eq!(numbers::<u32>(&indices), expected.indices);
        assert_eq!(numbers::<u64>(&distances), bits(&expected.distances));
    }
}

/// One scene in both languages.
struct Both<'a> {
    scene: &'a Scene,
    built: &'a Built,
    detector: Detector,
}

impl Both<'_> {
    /// Where the vertices are after a step.
    ///
    /// # Safety
    /// The motion is one of this scene.
    unsafe fn check_positions<'p>(
        &self,
        motion: *const impinge_motion,
        expected: impl Fn(BodyId) -> Option<&'p Positions>,
    ) {
        for (id, _) in self.scene.bodies() {
            let mut reached = no_rows(U8);
            // SAFETY: the caller's promise.
            let status =
                unsafe { impinge_motion_positions(motion, id.index() as u32, &mut reached) };
            assert_eq!(status, OK);
            let own = expected(id).map_or(no_rows(F64), positions_view);
            assert_eq!((reached.rows, reached.r#type), (own.rows, own.r#type));
            // SAFETY: both are views of packed positions of one type.
            unsafe {
                match own.r#type {
                    F32 => assert_eq!(numbers::<[u32; 3]>(&reached), numbers::<[u32; 3]>(&own)),
                    _ => assert_eq!(numbers::<[u64; 3]>(&reached), numbers::<[u64; 3]>(&own)),
                }
            }
        }
    }

    /// Asks all questions that take a query, which comes with the nearest points of near pairs.
    fn ask(&mut self, query: &impinge_query, own: &Query) {
        let (on, of) = (self.built.detector, self.built.scene.cast_const());
        let scene = self.scene;
        // SAFETY: as in `through_c`.
        unsafe {
            let mut pairs = null_mut();
            let status = impinge_detect(on, of, query, &mut pairs);
            if let Some(expected) = answered(status, self.detector.detect(scene, own)) {
                assert_eq!(impinge_pairs_hash(pairs), expected.hash());
                assert_eq!(impinge_pairs_count(pairs), expected.len());
            }
            impinge_pairs_destroy(pairs);
            let mut n = u64::MAX;
            let status = impinge_count(on, of, query, &mut n);
            if let Some(expected) = answered(status, self.detector.count(scene, own)) {
                assert_eq!(n, expected);
            }

            let mut impacts = null_mut();
            let status = impinge_find_impacts(on, of, query, &mut impacts);
            if let Some(expected) = answered(status, self.detector.impacts(scene, own)) {
                assert_eq!(impinge_impacts_hash(impacts), expected.hash());
                assert_eq!(impinge_impacts_count(impacts), expected.len());
                let start = expected.start_intersects().map_or(-1, i32::from);
                assert_eq!(impinge_impacts_start_intersects(impacts), start);
            }
            impinge_impacts_destroy(impacts);

            let mut candidates = null_mut();
            let status = impinge_find_candidates(on, of, 0.01, query, &mut candidates);
            let expected = self.detector.candidates(scene, 0.01, own);
            if let Some(expected) = answered(status, expected) {
                assert_eq!(impinge_candidates_hash(candidates), expected.hash());
                assert_eq!(impinge_candidates_count(candidates), expected.len());
            }
            impinge_candidates_destroy(candidates);

            self.ask_near(query, own);
            self.ask_safe_distances(query, own);
            self.ask_neighbours(query, own);

            let (mut fraction, mut motion) = (-1.0, null_mut());
            let status = impinge_advance(on, of, query, &mut fraction, &mut motion);
            if let Some(expected) = answered(status, self.detector.advance(scene, own)) {
                assert_eq!(fraction.to_bits(), expected.fraction.to_bits());
                assert_eq!(impinge_motion_fraction(motion), fraction);
                let (mut impact, mut found) = (std::mem::zeroed(), -1);
                let status = impinge_motion_first(motion, &mut impact, &mut found);
                assert_eq!(status, OK);
                let first = expected.first.as_ref().map(impact_row);
                assert_eq!((found == 1).then_some(impact), first);
                self.check_positions(motion, |id| expected.positions(id));
            }
            impinge_motion_destroy(motion);
            self.ask_truncation(query, own);
        }
    }

    fn ask_near(&mut self, query: &impinge_query, own: &Query) {
        let (on, of) = (self.built.detector, self.built.scene.cast_const());
        // SAFETY: as in `through_c`.
        unsafe {
            let mut near = null_mut();
            let status = impinge_find_near(on, of, 0.02, query, &mut near);
            let expected = self.detector.near(self.scene, 0.02, own);
            if let Some(expected) = answered(status, expected) {
                assert_eq!(impinge_near_hash(near), expected.hash());
                let [mut distances, mut points] = [no_rows(U8); 2];
                let status = impinge_near_column(near, COLUMN_DISTANCE, &mut distances);
                assert_eq!(status, OK);
                assert_eq!(impinge_near_column(near, COLUMN_POINTS, &mut points), OK);
                let closest = expected.iter().map(|pair| pair.closest.expect("asked for"));
                let (own_distances, own_points): (Vec<_>, Vec<_>) = closest
                    .map(|of| (of.distance, of.points.map(|p| p.map(f64::to_bits))))
                    .unzip();
                assert_eq!(numbers::<u64>(&distances), bits(&own_distances));
                assert_eq!(numbers::<[[u64; 3]; 2]>(&points), own_points);
            }
            impinge_near_destroy(near);
        }
    }

    fn ask_safe_distances(&mut self, query: &impinge_query, own: &Query) {
        let (on, of) = (self.built.detector, self.built.scene.cast_const());
        // SAFETY: as in `through_c`.
        unsafe {
            let mut safe = null_mut();
            let status = impinge_find_safe_distances(on, of, 0.02, query, &mut safe);
            let expected = self.detector.safe_distances(self.scene, 0.02, own);
            if let Some(expected) = answered(status, expected) {
                for (id, _) in self.scene.bodies() {
                    let mut bounds = no_rows(U8);
                    let status = impinge_safe_distances_of(safe, id.index() as u32, &mut bounds);
                    assert_eq!(status, OK);
                    match expected.of(id).expect("a body") {
                        Bounds::F32(own) => assert_eq!(numbers::<f32>(&bounds), own),
                        Bounds::F64(own) => assert_eq!(numbers::<f64>(&bounds), own),
                    }
                }
                let touching = impinge_safe_distances_touching(safe);
                assert_eq!(impinge_near_hash(touching), expected.touching().hash());
            }
            impinge_safe_distances_destroy(safe);
        }
    }

    fn ask_neighbours(&mut self, query: &impinge_query, own: &Query) {
        let (on, of) = (self.built.detector, self.built.scene.cast_const());
        // SAFETY: as in `through_c`.
        unsafe {
            let mut near = null_mut();
            let status = impinge_find_neighbours(on, of, 0.02, query, &mut near);
            let expected = self.detector.neighbours(self.scene, 0.02, own);
            if let Some(expected) = answered(status, expected) {
                assert_eq!(impinge_neighbours_count(near), expected.len());
                for kind in PairKind::ALL {
                    check_lists(near, kind, 0, expected.of(kind));
                    check_lists(near, kind, 1, expected.reversed(kind));
                }
                for (id, _) in self.scene.bodies() {
                    let mut first = [0; 3];
                    let status = impinge_neighbours_first(near, id.index() as u32, &mut first);
                    let parts = [Part::Vertices, Part::Edges, Part::Faces];
                    let own = parts.map(|part| expected.first(id, part).expect("a body"));
                    assert_eq!((status, first), (OK, own));
                }
            }
            impinge_neighbours_destroy(near);
        }
    }

    fn ask_truncation(&mut self, query: &impinge_query, own: &Query) {
        let (on, of) = (self.built.detector, self.built.scene.cast_const());
        // SAFETY: as in `through_c`.
        unsafe {
            let mut motion = null_mut();
            let status = impinge_truncate(on, of, query, &mut motion);
            let expected = self.detector.truncate(self.scene, own);
            if let Some(expected) = answered(status, expected) {
                let counts = (
                    impinge_motion_n_cut(motion),
                    impinge_motion_n_touching(motion),
                    impinge_motion_rounds(motion),
                );
                let own = (expected.n_cut(), expected.n_touching(), expected.rounds());
                assert_eq!(counts, own);
                assert!(impinge_motion_fraction(motion).is_nan());
                let (mut impact, mut found) = (std::mem::zeroed(), -1);
                let status = impinge_motion_first(motion, &mut impact, &mut found);
                assert_eq!((status, found), (INVALID, -1));
                self.check_positions(motion, |id| expected.positions(id));
                let mut pairs = null_mut();
                assert_eq!(impinge_motion_pairs(motion, &mut pairs), OK);
                let own = expected.pairs();
                let hash = impinge_candidates_hash(pairs);
                assert_eq!(
                    (hash, impinge_candidates_count(pairs)),
                    (own.hash(), own.len())
                );
                impinge_candidates_destroy(pairs);
            }
            impinge_motion_destroy(motion);
        }
    }
}

/// Hands out queries with every option, each in both languages.
fn each_query(
    scene: &Scene,
    (rest, own_rest): (*const impinge_near, &NearPairs),
    mut ask: impl FnMut(&str, &impinge_query, &Query),
) {
    let bodies: Vec<_> = scene.bodies().collect();
    let [(a, of_a), (b, of_b)] = [bodies[0], bodies[bodies.len() - 1]];
    let [first, last] = [a, b].map(|id| id.index() as u32);
    let [n_a, n_b] = [of_a, of_b].map(|body| body.positions().len() as u32);
    let offsets: Vec<u64> = (0..=u64::from(n_a)).collect();
    let vertices: Vec<u32> = (0..n_a).map(|v| v % n_b).collect();
    let excluded = |kind, a, b, n| impinge_exclusion {
        kind,
        a,
        b,
        n,
        offsets: view_of(&offsets),
        vertices: view_of(&vertices),
    };
    let exclusions = [
        excluded(EXCLUDE_RINGS, 0, 0, 1),
        excluded(EXCLUDE_GROUPS, 0, 1, 0),
        excluded(EXCLUDE_BODIES, first, last, 0),
        excluded(EXCLUDE_VERTICES, first, last, 0),
    ];
    let lists = Exclusion::vertices(a, b, offsets.clone(), vertices.clone());
    let own_exclusions: [(&str, Exclusion); 4] = [
        ("rings", Exclusion::rings(1)),
        ("groups", Exclusion::groups(0, 1)),
        ("two bodies", (a, b).into()),
        ("vertices", lists),
    ];
    let rest = [rest.cast()];

    let query = || impinge_query {
        flags: CLOSEST_POINTS,
        ..impinge_query::default()
    };
    let mut ask = |name: &str, c: impinge_query, own: Query| ask(name, &c, &own.closest_points());
    let scoped = |between, own, a, b| impinge_query {
        between,
        own,
        a,
        b,
        ..query()
    };
    ask("all", query(), Query::all());
    let any = ANY_BODY;
    let between_all = scoped(1, 0, any, any);
    ask("different bodies", between_all, Query::between_all());
    ask("self", scoped(0, 1, any, any), Query::self_all());
    let between = scoped(1, 1, first, last);
    ask("between two", between, Query::between(a, b));
    ask("self of one", scoped(0, 1, first, any), Query::self_of(a));
    ask("of one", scoped(1, 1, first, any), Query::of(a));
    ask("across", scoped(1, 0, first, any), Query::across([a]));
    for (ix, (name, own)) in own_exclusions.into_iter().enumerate() {
        let c = impinge_query {
            exclusions: &raw const exclusions[ix],
            n_exclusions: 1,
            ..query()
        };
        ask(name, c, Query::all().exclude(own));
    }
    let c = impinge_query {
        rest_pairs: rest.as_ptr(),
        n_rest_pairs: 1,
        ..query()
    };
    ask("rest pairs", c, Query::all().exclude(own_rest));
    let c = impinge_query {
        shared_vertex: SKIP,
        ..query()
    };
    let own = Query::all().shared_vertex(SharedVertex::Skip);
    ask("shared vertices", c, own);
    let c = impinge_query {
        kinds: bit(PairKind::EdgeEdge) | bit(PairKind::EdgeVertex),
        ..query()
    };
    let own = Query::all().kinds([PairKind::EdgeEdge, PairKind::EdgeVertex]);
    ask("kinds", c, own);
    let (low, high) = ([-0.5; 3], [0.25, 0.5, f64::INFINITY]);
    let c = impinge_query {
        flags: CLOSEST_POINTS | CELL,
        cell_low: low,
        cell_high: high,
        ..query()
    };
    ask("a cell", c, Query::all().owned_by(low, high));
    let c = impinge_query {
        fixed: &raw const first,
        n_fixed: 1,
        start: START_VERIFY,
        ..query()
    };
    let own = Query::all().fixed([a]).start(Start::Verify);
    ask("fixed, start verified", c, own);
    let c = impinge_query {
        start: START_SKIP,
        precision: F64,
        separation: 0.005,
        clearance: 0.001,
        clearance_share: 0.5,
        ..query()
    };
    let own = Query::all()
        .start(Start::Skip)
        .precision(Precision::F64)
        .separation(0.005)
        .clearance(Clearance::new(0.001).share(0.5));
    ask("separation, clearance", c, own);
}

/// Groups, pins, thickness, a filter and transforms, in both languages.
fn dress(scene: &mut Scene, built: &Built) {
    let ids: Vec<_> = scene.bodies().map(|(id, _)| id).collect();
    let matrix = |turn: f64, along: f64| {
        let (sin, cos) = turn.sin_cos();
        let [x, y] = [[cos, -sin, 0.0, along], [sin, cos, 0.0, 0.0]];
        [x, y, [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    };
    let [now, end] = [matrix(0.05, 0.01), matrix(0.1, -0.1)];
    for &id in &ids {
        let (to, body) = (built.scene, id.index() as u32);
        let n = scene.body(id).expect("a body").positions().len() as u32;
        let groups: Vec<u32> = (0..n).map(|v| v % 3).collect();
        let pinned: Vec<bool> = (0..n).map(|v| v % 4 == 0).collect();
        let flags: Vec<u8> = pinned.iter().map(|&flag| flag.into()).collect();
        let thick: Vec<f64> = (0..n).map(|v| 0.001 * f64::from(v % 5)).collect();
        scene.set_groups(id, &groups).expect("one per vertex");
        scene.set_pinned(id, &pinned).expect("one per vertex");
        let each = Thickness::vertices(&thick[..]);
        scene.set_thickness(id, each).expect("one per vertex");
        // SAFETY: as in `through_c`.
        unsafe {
            assert_eq!(impinge_scene_set_groups(to, body, view_of(&groups)), OK);
            assert_eq!(impinge_scene_set_pinned(to, body, view_of(&flags)), OK);
            let thick = view_of(&thick);
            let status = impinge_scene_set_element_thickness(to, body, POINTS, thick);
            assert_eq!(status, OK);
        }
    }
    let [first, last] = [ids[0], ids[ids.len() - 1]];
    let filter = Filter {
        category: 2,
        mask: 1,
    };
    scene.set_filter(first, filter).expect("a body");
    scene.set_thickness(last, 0.003).expect("a length");
    scene.set_transform(last, &now).expect("finite");
    scene.set_end_transform(last, &end).expect("finite");
    let [first, last] = [first, last].map(|id| id.index() as u32);
    // SAFETY: as in `through_c`.
    unsafe {
        let to = built.scene;
        assert_eq!(impinge_scene_set_filter(to, first, 2, 1), OK);
        assert_eq!(impinge_scene_set_thickness(to, last, 0.003), OK);
        assert_eq!(impinge_scene_set_transform(to, last, view(&now)), OK);
        assert_eq!(impinge_scene_set_end_transform(to, last, view(&end)), OK);
    }
}

#[test]
fn queries_with_every_option_are_answered_as_in_rust() {
    let near = |scene: &Scene, built: &Built| {
        let mut detector = Detector::new(Backend::Cpu).expect("the CPU");
        let own = detector.near(scene, 0.01, &Query::all());
        let mut rest = null_mut();
        // SAFETY: as in `through_c`.
        let status = unsafe {
            let (on, of) = (built.detector, built.scene);
            impinge_find_near(on, of, 0.01, std::ptr::null(), &mut rest)
        };
        assert_eq!(status, OK);
        (rest, own.expect("near pairs"))
    };
    for (name, mut scene) in catalogue() {
        let built = through_c(&scene);
        for is_dressed in [false, true] {
            let (rest, own_rest) = near(&scene, &built);
            if is_dressed {
                dress(&mut scene, &built);
            }
            let mut both = Both {
                scene: &scene,
                built: &built,
                detector: Detector::new(Backend::Cpu).expect("the CPU"),
            };
            each_query(&scene, (rest.cast_const(), &own_rest), |query, c, own| {
                // Of scenes as they are, `assert_hashes` compares the default query, too.
                if !is_dressed && !matches!(query, "all" | "fixed, start verified") {
                    return;
                }
                // What fails says which.
                println!("{name}, dressed: {is_dressed}, {query}");
                both.ask(c, own);
            });
            // SAFETY: as in `through_c`.
            unsafe { impinge_near_destroy(rest) };
        }
        // SAFETY: as in `through_c`.
        unsafe {
            let (mut motion, on, of) = (null_mut(), built.detector, built.scene);
            if impinge_truncate(on, of, std::ptr::null(), &mut motion) == OK {
                assert_eq!(impinge_motion_apply(motion, of), OK, "{name}");
            }
            impinge_motion_destroy(motion);
        }
    }
}
