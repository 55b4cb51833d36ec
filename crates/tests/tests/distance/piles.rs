//! Piles, in which each layer stops the next: rounds end, and where they do, the step is free.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use impinge_core::{
    Backend, BodyId, CancelToken, Control, Detector, Element, Error, Exclusion, Method, PairFilter,
    PairKind, Positions, Query, Real, Scene, Settings, Start, Truncation,
};
use impinge_tests::{detector, detectors};

/// The most rounds, as the documentation has it.
const MOST_ROUNDS: u32 = 256;
/// How far a brick is from the next one.
const GAP: f64 = 0.002;
/// How far all of them want to sink.
const SINK: f64 = 0.9;

/// A translation.
fn by(z: f64) -> [[f64; 4]; 4] {
    [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, z],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// A triangle at a height.
fn triangle(z: f64) -> [[f64; 3]; 3] {
    [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]]
}

/// Bricks over each other, of a lower and an upper triangle: rigid, so each stops the next one
/// though that is farther from the first than it goes.
fn pile<R: Real>(n: usize, round: impl Fn(f64) -> R + Copy) -> (Scene, Vec<BodyId>) {
    let mut scene = Scene::new();
    let mut bodies = Vec::new();
    for layer in 0..n {
        let height = layer as f64 * (1.0 + GAP);
        let corners = [triangle(height), triangle(height + 1.0)].concat();
        let held = Vec::from_iter(corners.iter().map(|p| p.map(round)));
        let body = scene
            .add_triangles(&[[0, 1, 2], [3, 4, 5]], &held)
            .expect("good");
        if layer > 0 {
            scene.set_end_transform(body, &by(-SINK)).expect("good");
        }
        bodies.push(body);
    }
    (scene, bodies)
}

/// The same scene, whose bodies end where they were stopped.
fn stopped(scene: &Scene, truncation: &Truncation) -> Scene {
    let mut scene = scene.clone();
    for (id, at) in truncation.iter() {
        scene.set_end_positions(id, at).expect("good");
    }
    scene
}

/// Asks with each instruction set, one thread and several, and tests that the step is free.
fn checked(scene: &Scene, query: &Query) -> Truncation {
    // The oracle would look at each pair of layers.
    let [with_each @ .., _] = detectors();
    let [truncation, others @ ..] =
        with_each.map(|mut detector| detector.truncate(scene, query).expect("an answer"));
    assert!(others.iter().all(|other| *other == truncation));
    let free = detector(Method::Clusters, 1).is_free(&stopped(scene, &truncation), query);
    assert!(free.expect("an answer"), "{truncation:?}");
    assert!(truncation.rounds() <= MOST_ROUNDS, "{truncation:?}");
    truncation
}

/// How far the vertices of a body sink, at least and at most.
fn ways(scene: &Scene, truncation: &Truncation, body: BodyId) -> [f64; 2] {
    let start = scene.body(body).expect("held").positions();
    let at = truncation.positions(body).expect("it moves");
    let ways = (0..start.len()).map(|ix| start.point(ix)[2] - at.point(ix)[2]);
    ways.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], way| {
        [least.min(way), most.max(way)]
    })
}

#[test]
fn each_layer_of_a_low_pile_stops_the_next() {
    let (scene, bodies) = pile(40, |x| x);
    let truncation = checked(&scene, &Query::all());
    let mut naive = detector(Method::Naive, 1);
    assert_eq!(
        truncation,
        naive.truncate(&scene, &Query::all()).expect("good")
    );
    // One round per layer.
    assert!((39..60).contains(&truncation.rounds()), "{truncation:?}");
    let pairs = truncation.pairs();
    for (below, own) in bodies.windows(2).enumerate() {
        // Each comes down to the one below.
        let [least, most] = ways(&scene, &truncation, own[1]);
        let room = (below + 1) as f64 * GAP;
        assert!(least > 0.9 * room && most < room, "{below}: {least} {most}");
        let has_own = |(_, a, b): (PairKind, Element, Element)| own == [a.body, b.body];
        assert!(pairs.iter().any(has_own), "{below}");
    }
    assert!(pairs.iter().all(|(_, a, b)| a.body != b.body));
}

/// What so many rounds do not end, planes that rest do.
#[test]
fn a_high_pile_is_stopped_at_once() {
    for is_single in [false, true] {
        let (mut scene, bodies) = match is_single {
            true => pile(300, |x| x as f32),
            false => pile(300, |x| x),
        };
        // Loose triangles in some gaps, and a pair aside, which is not joined with the pile.
        let mut add = |at: [f64; 2], height: f64| {
            let there = |z| triangle(z).map(|[x, y, z]| [x + at[0], y + at[1], z]);
            let body = scene
                .add_triangles(&[[0, 1, 2]], &there(height))
                .expect("good");
            scene
                .set_end_positions(body, &there(height - SINK))
                .expect("good");
            (body, there(height - SINK))
        };
        let height = |layer: usize| layer as f64 * (1.0 + GAP) - 0.5 * GAP;
        let loose = [100, 200, 290].map(|layer| add([0.1, 0.2], height(layer)).0);
        let aside = [1.0, 1.5].map(|height| add([9.0, 0.0], height));
        let truncation = checked(&scene, &Query::all());
        assert_eq!(
            (truncation.rounds(), truncation.n_touching()),
            (MOST_ROUNDS, 0)
        );
        for &body in bodies[2..].iter().chain(&loose) {
            let [least, most] = ways(&scene, &truncation, body);
            assert!(
                least > 0.2 * GAP && most < 2.0 * GAP,
                "{body:?}: {least} {most}"
            );
        }
        for (body, end) in &aside {
            assert_eq!(
                truncation.positions(*body),
                Some(&Positions::from(end.to_vec()))
            );
        }
        let named = truncation.pairs();
        assert!(
            named
                .iter()
                .all(|(_, a, b)| aside.iter().all(|(of, _)| ![a.body, b.body].contains(of)))
        );
    }
}

/// A separation is kept, layers without room stay, and pairs that touch at the start are left out
/// if they are skipped.
#[test]
fn rules_of_other_rounds_hold_in_the_last_one() {
    let (mut scene, bodies) = pile(300, |x| x);
    let keeping = checked(&scene, &Query::all().separation(0.5 * GAP));
    assert_eq!(keeping.rounds(), MOST_ROUNDS);
    for &body in &bodies[2..] {
        let [least, most] = ways(&scene, &keeping, body);
        assert!(least > 0.1 * GAP && most < GAP, "{least} {most}");
    }
    // A corner at the corner of another brick, and one a bit over it.
    let corner = |layer: usize| {
        scene
            .body(bodies[layer])
            .expect("held")
            .positions()
            .point(3)
    };
    let (a, [x, y, z]) = (corner(280), corner(270));
    let b = [x + 0.5, y + 0.1, z.next_up()];
    let points = scene.add_points(&[a, b]).expect("good");
    let ends = [a, b].map(|[x, y, z]| [x, y, z - SINK]);
    scene.set_end_positions(points, &ends).expect("good");
    let truncation = checked(&scene, &Query::all().start(Start::Skip));
    assert_eq!(
        (truncation.rounds(), truncation.n_touching()),
        (MOST_ROUNDS, 0)
    );
    let at = truncation.positions(points).expect("it moves");
    assert!(a[2] - at.point(0)[2] > 0.2 * GAP, "{:?}", at.point(0));
    assert_eq!(at.point(1), b);
    let [least, most] = ways(&scene, &truncation, bodies[270]);
    assert_eq!([least, most], [0.0; 2]);
    let touching = checked_touching(&scene);
    assert_eq!(touching.n_touching(), 1);
    assert_eq!(touching.positions(points).expect("it moves").point(0), a);
}

/// A step with a pair that touches at its start: without that, it is free.
fn checked_touching(scene: &Scene) -> Truncation {
    let truncation = detector(Method::Clusters, 2).truncate(scene, &Query::all());
    let truncation = truncation.expect("an answer");
    let query = Query::all().start(Start::Skip);
    let free = detector(Method::Clusters, 1).is_free(&stopped(scene, &truncation), &query);
    assert!(free.expect("an answer"), "{truncation:?}");
    truncation
}

/// Bricks are as thick as their gaps allow, and pairs that do not meet do not stop each other in the
/// last round, either: of pinned bricks, of groups, of vertices that are listed.
#[test]
fn what_is_thick_or_left_out_is_so_in_the_last_round() {
    const N: usize = 330;
    // This brick does not meet the one below it.
    const APART: usize = 300;
    let (scene, bodies) = pile(N, |x| x);
    let mut thick = scene.clone();
    for &body in &bodies {
        thick.set_thickness(body, 0.25 * GAP).expect("good");
    }
    let keeping = checked(&thick, &Query::all());
    assert_eq!((keeping.rounds(), keeping.n_touching()), (MOST_ROUNDS, 0));
    for &body in &bodies[2..] {
        let [least, most] = ways(&thick, &keeping, body);
        assert!(least > 0.1 * GAP && most < GAP, "{least} {most}");
    }
    let two = [bodies[APART - 1], bodies[APART]];
    let mut pinned = scene.clone();
    let mut grouped = scene.clone();
    for (ix, &body) in two.iter().enumerate() {
        pinned.set_pinned(body, &[true; 6]).expect("good");
        grouped.set_groups(body, &[1 + ix as u32; 6]).expect("good");
    }
    let every: Vec<u64> = (0..=6).map(|vertex| 6 * vertex).collect();
    let listed = Exclusion::vertices(two[0], two[1], every, [0u32, 1, 2, 3, 4, 5].repeat(6));
    let filter = move |[(a, _), (b, _)]: [(BodyId, &[u32]); 2]| [a, b] != two && [b, a] != two;
    let all = Query::all;
    for (scene, query) in [
        (&scene, all().filter(PairFilter::new(filter))),
        (&scene, all().filter(PairFilter::new(filter).early())),
        (&pinned, all()),
        (&grouped, all().exclude(Exclusion::groups(1, 2))),
        (&scene, all().exclude(listed)),
        (&scene, all().exclude((two[0], two[1]))),
    ] {
        let truncation = checked(scene, &query);
        assert_eq!(truncation.rounds(), MOST_ROUNDS);
        for (layer, &body) in bodies.iter().enumerate().skip(2) {
            let [least, most] = ways(scene, &truncation, body);
            // Those above it sink with it: nothing is below them as far as they go.
            let (low, high) = match layer < APART {
                true => (0.2 * GAP, 2.0 * GAP),
                false => (0.99 * SINK, 1.01 * SINK),
            };
            assert!(least > low && most < high, "{layer}: {least} {most}");
        }
        let named = truncation.pairs();
        assert!(
            named
                .iter()
                .all(|(_, a, b)| [a.body, b.body] != two && [b.body, a.body] != two)
        );
    }
}

/// With little memory, the last round looks at pairs in more runs; it stops when it is told to, and
/// the next answer is whole.
#[test]
fn the_last_round_takes_budgets_and_cancellation() {
    let (scene, _) = pile(300, |x| x);
    let query = Query::all();
    let expected = checked(&scene, &query);
    let settings = || Settings::new().threads(2).backend(Backend::Cpu);
    let budgeted = |bytes: u64| {
        let mut detector = Detector::new(settings().memory_budget(bytes)).expect("settings");
        detector.truncate(&scene, &query)
    };
    let fits = (10..40)
        .map(|power| budgeted(1 << power))
        .find(Result::is_ok);
    assert_eq!(
        fits.expect("enough in the end").expect("an answer"),
        expected
    );
    let looks = |most: u32| {
        let (token, n) = (CancelToken::new(), Arc::new(AtomicU32::new(0)));
        let (canceller, count) = (token.clone(), Arc::clone(&n));
        let mut detector = detector(Method::Clusters, 1);
        detector.set_control(Control::new().cancel(&token).progress(move |_| {
            if count.fetch_add(1, Ordering::Relaxed) + 1 == most {
                canceller.cancel();
            }
        }));
        let found = detector.truncate(&scene, &query);
        detector.set_control(Control::new());
        (found, detector, n.load(Ordering::Relaxed))
    };
    let (whole, _, n) = looks(u32::MAX);
    assert_eq!(whole.expect("an answer"), expected);
    // The looks of the last round are the last ones.
    for before in [1, 2, 3, 5, 8] {
        let (cancelled, mut detector, seen) = looks(n - before);
        assert!(
            matches!(cancelled, Err(Error::Cancelled)),
            "{before} before the end"
        );
        assert!(seen < n);
        assert_eq!(
            detector.truncate(&scene, &query).expect("an answer"),
            expected
        );
    }
}
