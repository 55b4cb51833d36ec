//! What a question leaves out because of its elements is left out on the device, too: pinned
//! vertices, groups, rings, lists of vertices, pairs of a rest pose.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::collections::BTreeSet;

use crate::caller::Caller;
use crate::lists::frame;
use crate::resident_steps::{assert_between, listed};
use crate::safe::{check_asked, safe_of};

use impinge_core::{
    Backend, BodyId, Detector, Elements, Exclusion, PairKind, Query, Scene, Settings,
};
use impinge_scenes::{Random, solids, surfaces};

/// Two balls that run into each other, one of them folded so that it meets itself, and a solid of
/// tetrahedra; some vertices are pinned, all are in groups.
fn scene() -> (Scene, Vec<BodyId>) {
    let ball = surfaces::ball(300);
    let folded = ball.mapped(|[x, y, z]| [x.abs() - 0.02 * x, y, z]);
    let solid = solids::block(3, 3, 3, 0.3).mapped(|[x, y, z]| [x - 0.2, y, z]);
    let mut scene = Scene::new();
    let mut bodies = Vec::new();
    for model in [&ball.translated([0.9, 0.0, 0.1]), &folded, &solid] {
        let body = model.add_to(&mut scene).expect("good");
        let end = model.mapped(|[x, y, z]| [0.3 * x, y + 0.1 * z, 0.2 * y - 0.5 * z]);
        scene.set_end_positions(body, &end.positions).expect("good");
        let sides = model.positions.iter();
        let side = |[x, y, _]: &[f32; 3]| 7 + u32::from(*x > 0.1) + 2 * u32::from(*y > 0.0);
        let groups: Vec<u32> = sides.map(side).collect();
        scene.set_groups(body, &groups).expect("good");
        bodies.push(body);
    }
    (scene, bodies)
}

/// Lists of vertices of one body, for each vertex of another.
fn lists(random: &mut Random, scene: &Scene, a: BodyId, b: BodyId) -> Exclusion {
    let [of_a, of_b] = [a, b].map(|body| scene.body(body).expect("held").n_vertices() as u32);
    let (mut offsets, mut vertices) = (vec![0], Vec::new());
    for _ in 0..of_a {
        vertices.extend((0..random.below(9)).map(|_| random.below(of_b)));
        offsets.push(vertices.len() as u64);
    }
    Exclusion::vertices(a, b, offsets, vertices)
}

/// Queries that leave out pairs of elements, each with whether it may be asked about intersections.
fn queries(
    random: &mut Random,
    scene: &Scene,
    bodies: &[BodyId],
) -> Vec<(&'static str, Query, bool)> {
    let all = Query::all;
    let groups = all()
        .exclude(Exclusion::groups(7, 8))
        .exclude(Exclusion::groups(8, 8))
        .exclude(Exclusion::groups(9, 7));
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let near = cpu.near(scene, 0.01, &all()).expect("good");
    let between = lists(random, scene, bodies[1], bodies[0]);
    let own = lists(random, scene, bodies[1], bodies[1]);
    let everything = groups
        .clone()
        .exclude(Exclusion::rings(2))
        .exclude(between.clone())
        .exclude(own.clone());
    vec![
        ("groups", groups, true),
        ("rings", all().exclude(Exclusion::rings(0)), true),
        ("more rings", all().exclude(Exclusion::rings(3)), true),
        ("lists", all().exclude(between).exclude(own), true),
        ("pairs at rest", all().exclude(&near), false),
        ("everything", everything.clone(), true),
        ("everything by name", everything.exclude(&near), false),
    ]
}

#[test]
fn steps_and_safe_distances_on_the_device_leave_out_what_the_question_does() {
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let mut random = Random::new(91);
    let (mut scene, bodies) = scene();
    let mut n_some = 0;
    for is_pinned in [false, true] {
        if is_pinned {
            for &body in &bodies {
                let n = scene.body(body).expect("held").n_vertices();
                let pinned: Vec<bool> = (0..n).map(|_| random.below(4) > 0).collect();
                scene.set_pinned(body, &pinned).expect("good");
            }
        }
        let mut asked = queries(&mut random, &scene, &bodies);
        if is_pinned {
            asked.push(("pins alone", Query::all(), true));
        }
        let whole = cpu.impacts(&scene, &Query::all()).expect("good").len();
        for (name, query, _) in asked {
            let name = &format!("{name}, pinned {is_pinned}");
            let (found, pairs, _) = listed(&caller, &mut detector, &scene, &query, [&[], &[]]);
            let n = assert_between(name, &found, &pairs, &scene, &query, &query);
            assert!(n <= whole, "{name}: {n} of {whole}");
            n_some += usize::from(0 < n && n < whole);
            // The host hands over what the device has found, and left out.
            let by_device = detector.impacts(&scene, &query).expect("good").clone();
            assert_ne!(by_device.stats().backend, "cpu", "{name}");
            assert_eq!(by_device.stats().n_unsure, pairs.len() as u64, "{name}");
            let by_host = cpu.impacts(&scene, &query).expect("good");
            assert_eq!(
                (by_device.len(), by_device.hash()),
                (by_host.len(), by_host.hash()),
                "{name}"
            );
            let first = cpu.earliest(&scene, &query).expect("good");
            assert_eq!(
                detector.earliest(&scene, &query).expect("good"),
                first,
                "{name}"
            );

            let safe = safe_of(&caller, &mut detector, &scene, 0.1, &query, &[]);
            let [_, n_bounded] = check_asked(name, &scene, &safe, (0.1, &[]), query.clone());
            assert!(n_bounded > 0, "{name}");
        }
    }
    assert!(n_some >= 12, "{n_some}");

    // The same query after a body was re-meshed: rings are of other elements.
    let query = Query::all().exclude(Exclusion::rings(1));
    for step in 0..2 {
        let (found, pairs, _) = listed(&caller, &mut detector, &scene, &query, [&[], &[]]);
        assert_between("re-meshed", &found, &pairs, &scene, &query, &query);
        let body = scene.body(bodies[0]).expect("held");
        let ends = body.end_positions().expect("it moves").clone();
        let Elements::Triangles(faces) = body.elements() else {
            panic!("a surface");
        };
        let faces: Vec<[u32; 3]> = faces.iter().copied().step_by(2 + step).collect();
        let mesh = (Elements::from(faces), body.positions().clone());
        scene.remesh(bodies[0], mesh).expect("good");
        scene.set_end_positions(bodies[0], ends).expect("good");
    }
    let (found, pairs, _) = listed(&caller, &mut detector, &scene, &query, [&[], &[]]);
    assert_between("re-meshed", &found, &pairs, &scene, &query, &query);
}

/// Wrong lines of the kernel that leaves pairs out: of each question about groups, pins, rings, lists
/// or names some answer is wrong.
#[test]
fn damaged_filters_are_noticed() {
    let caller = Caller::new();
    let mut random = Random::new(93);
    let (free, bodies) = scene();
    let mut pinned = free.clone();
    for &body in &bodies {
        let n = pinned.body(body).expect("held").n_vertices();
        let pins: Vec<bool> = (0..n).map(|_| random.below(4) > 0).collect();
        pinned.set_pinned(body, &pins).expect("good");
    }
    let asked = queries(&mut random, &free, &bodies);
    let mut cases = Vec::from_iter(
        asked
            .iter()
            .map(|(name, query, _)| (*name, &free, query.clone())),
    );
    cases.push(("pins alone", &pinned, Query::all()));
    let holds = |detector: &mut Detector| {
        cases.iter().all(|(name, scene, query)| {
            let asks = || {
                let (found, pairs, _) = listed(&caller, detector, scene, query, [&[], &[]]);
                assert_between(name, &found, &pairs, scene, query, query);
            };
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(asks)).is_ok()
        })
    };
    assert!(holds(&mut caller.detector(Settings::default())));
    let mut unnoticed = Vec::new();
    for (line, wrong) in [
        // Pinned vertices.
        (
            "(are_pinned(a) && are_pinned(b))",
            "(are_pinned(a) || are_pinned(b))",
        ),
        ("(are_pinned(a) && are_pinned(b))", "false"),
        // Groups.
        ("mark(of_b[j]) & ~PINNED", "mark(of_b[i]) & ~PINNED"),
        (
            "if !has_pair(groups, n, pair) {",
            "if has_pair(groups, n, pair) {",
        ),
        ("|| are_apart(a, b)", ""),
        (
            "let n = rules[RULES_N_GROUPS];",
            "let n = rules[RULES_N_GROUPS] - 1u;",
        ),
        // Lists, by which rings are left out, too.
        ("|| are_listed(a, b)", ""),
        (" || has_in_list(lists, of_b[j], of_a[i])", ""),
        (
            "var high = rules[lists + vertex + 1u];",
            "var high = rules[lists + vertex];",
        ),
        // Pairs by name.
        ("|| are_named(candidate)", ""),
        (
            "let n = rules[RULES_N_PAIRS];",
            "let n = rules[RULES_N_PAIRS] / 2u;",
        ),
        (
            "vec2<u32>(min(numbers.x, numbers.y), max(numbers.x, numbers.y));",
            "vec2<u32>(max(numbers.x, numbers.y), min(numbers.x, numbers.y));",
        ),
        // Of all.
        ("if ix >= n {", "if ix >= n / 2u {"),
        (
            "candidates[ix] = Candidate(NOTHING, NOTHING);",
            "candidates[ix ^ 1u] = Candidate(NOTHING, NOTHING);",
        ),
    ] {
        let damage = ("left_out", line, wrong);
        if holds(&mut caller.damaged(Settings::default(), damage)) {
            unnoticed.push((line, wrong));
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}

#[test]
fn frames_on_the_device_leave_out_what_the_question_does() {
    let caller = Caller::new();
    let mut random = Random::new(92);
    let (mut scene, bodies) = scene();
    let free = scene.clone();
    for &body in &bodies[..2] {
        let pinned = vec![true; scene.body(body).expect("held").n_vertices()];
        scene.set_pinned(body, &pinned).expect("good");
    }
    for method in [impinge_core::Method::Auto, impinge_core::Method::Cells] {
        let mut detector = caller.detector(Settings::default().method(method));
        let mut cpu = Detector::new(Backend::Cpu).expect("settings");
        for (name, query, has_intersections) in queries(&mut random, &scene, &bodies) {
            if !has_intersections {
                continue;
            }
            let [certain, unsure] = loop {
                let (lists, is_complete) = frame(&caller, &mut detector, &scene, &query);
                if is_complete {
                    break lists.map(|list| BTreeSet::from_iter(list.expect("complete")));
                }
            };
            // Numbers of elements, body after body.
            let mut first = 0;
            let firsts: Vec<u32> = scene
                .bodies()
                .map(|(_, body)| {
                    let own = first;
                    first += body.elements().len() as u32;
                    own
                })
                .collect();
            let mut numbers = |scene: &Scene, query: &Query| -> BTreeSet<[u32; 2]> {
                let pairs = cpu.detect(scene, query).expect("good");
                let rows = pairs.rows();
                rows.map(|[a, i, b, j]| [firsts[a as usize] + i, firsts[b as usize] + j])
                    .collect()
            };
            let (held, all) = (numbers(&scene, &query), numbers(&free, &Query::all()));
            assert!(!held.is_empty() && held.len() < all.len(), "{name}");
            assert!(certain.is_subset(&held), "{name}");
            let listed: BTreeSet<[u32; 2]> = certain.union(&unsure).copied().collect();
            assert!(held.is_subset(&listed), "{name}");
            assert!(
                all.difference(&held).all(|pair| !listed.contains(pair)),
                "{name}"
            );
        }
    }
}

#[test]
fn steps_and_safe_distances_on_the_device_are_about_the_kinds_that_are_named() {
    use PairKind::{EdgeEdge, EdgeVertex, VertexFace, VertexVertex};
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut cpu = Detector::new(Backend::Cpu).expect("settings");
    let (mut scene, _) = scene();
    let mut random = Random::new(5);
    let mut points = |n: usize| Vec::from_iter((0..n).map(|_| random.point(-1.0, 1.0)));
    let edges = Vec::from_iter((0..60).map(|edge| [edge, edge + 1]));
    let bodies = [
        scene.add_edges(&edges, &points(61)).expect("good"),
        scene.add_points(&points(50)).expect("good"),
    ];
    for body in bodies {
        let n = scene.body(body).expect("held").n_vertices();
        scene.set_end_positions(body, points(n)).expect("good");
    }
    let mut counts = Vec::new();
    for kinds in [
        &[VertexFace][..],
        &[EdgeEdge],
        &[EdgeVertex],
        &[VertexVertex],
        &[VertexFace, EdgeEdge],
        &[EdgeVertex, VertexVertex],
        &[VertexFace, EdgeEdge, EdgeVertex, VertexVertex],
    ] {
        let name = &format!("{kinds:?}");
        // Points seldom meet points, but come near.
        let query = Query::all().kinds(kinds.iter().copied()).separation(0.02);
        let by_host = cpu.impacts(&scene, &query).expect("good").clone();
        let by_device = detector.impacts(&scene, &query).expect("good");
        assert_ne!(by_device.stats().backend, "cpu", "{name}");
        assert_eq!(
            (by_device.len(), by_device.hash()),
            (by_host.len(), by_host.hash()),
            "{name}"
        );
        counts.push(by_host.len());
        let query = query.separation(0.0);
        let (found, pairs, _) = listed(&caller, &mut detector, &scene, &query, [&[], &[]]);
        assert_between(name, &found, &pairs, &scene, &query, &query);
        let candidates = cpu.candidates(&scene, 0.0, &query).expect("good").len();
        assert!(pairs.len() <= candidates, "{name}: of another kind");
        let safe = safe_of(&caller, &mut detector, &scene, 0.1, &query, &[]);
        let [_, n_bounded] = check_asked(name, &scene, &safe, (0.1, &[]), query);
        assert!(n_bounded > 0, "{name}");
    }
    assert!(counts.iter().all(|&n| n > 0), "{counts:?}");
    let [vf, ee, ev, vv, both, bare, all] = counts[..] else {
        panic!("seven");
    };
    assert_eq!((vf + ee, ev + vv), (both, bare));
    assert_eq!(both + bare, all);
    let none = Query::all().kinds([]);
    let [by_host, by_device] = [&mut cpu, &mut detector]
        .map(|detector| detector.impacts(&scene, &none).map(|impacts| impacts.len()));
    assert_eq!(by_host.ok(), by_device.ok());
}
