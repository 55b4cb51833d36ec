//! Bad input, memory budgets, cancellation.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use impinge_core::{
    BodyId, CancelToken, Control, Detector, Error, Method, Query, Scene, Settings, SharedVertex,
};
use impinge_scenes::{adversarial, surfaces};
use impinge_tests::{Case, agree, check, cpu, detector, naive, rows};

const TRIANGLE: [[f32; 3]; 3] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn bad_bodies_are_refused_by_name() {
    let mut scene = Scene::new();
    let good = scene.add_triangles(&[[0, 1, 2]], &TRIANGLE).unwrap();
    let error = scene
        .add_triangles(&[[0, 1, 2], [0, 7, 2]], &TRIANGLE)
        .unwrap_err();
    assert!(matches!(
        error,
        Error::VertexIndexOutOfRange {
            element: 1,
            index: 7,
            n_vertices: 3,
            ..
        }
    ));
    assert_eq!(
        error.to_string(),
        "body 1: element 1 names vertex 7, but there are 3 vertices"
    );
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut positions = TRIANGLE;
        positions[2][1] = bad;
        let error = scene.add_triangles(&[[0, 1, 2]], &positions).unwrap_err();
        assert!(
            matches!(error, Error::NonFinitePosition { vertex: 2, .. }),
            "{error}"
        );
        let error = scene.set_positions(good, &positions).unwrap_err();
        assert!(
            matches!(error, Error::NonFinitePosition { vertex: 2, .. }),
            "{error}"
        );
    }
    let not_a_number = TRIANGLE.map(|p| p.map(|x| f64::from(x) / 0.0));
    let error = scene
        .add_triangles(&[[0, 1, 2]], &not_a_number)
        .unwrap_err();
    assert!(
        matches!(error, Error::NonFinitePosition { vertex: 0, .. }),
        "{error}"
    );
    let error = scene.set_positions(good, &TRIANGLE[..2]).unwrap_err();
    assert!(matches!(
        error,
        Error::WrongNumberOfPositions {
            given: 2,
            expected: 3,
            ..
        }
    ));
    assert!(matches!(
        scene.positions_mut::<f64>(good).unwrap_err(),
        Error::WrongPrecision {
            stored: "f32",
            asked: "f64",
            ..
        }
    ));
    // None of these bodies was added.
    assert_eq!(scene.n_bodies(), 1);
    let mut detector = detector(Method::Clusters, 2);
    // One text for pairs and for distances.
    let same = [
        detector.detect(&scene, &Query::between(good, good)).err(),
        detector.distance(&scene, good, good).err(),
    ];
    for error in same {
        assert!(matches!(error, Some(Error::SameBody { body }) if body == good));
        assert_eq!(
            error.map(|error| error.to_string()),
            Some(format!(
                "body {good} is named twice, where two different bodies are needed: self-collision is a query of its own"
            ))
        );
    }
    scene.remove(good).unwrap();
    assert!(matches!(
        detector.detect(&scene, &Query::self_of(good)),
        Err(Error::UnknownBody { .. })
    ));
    assert!(detector.detect(&scene, &Query::all()).unwrap().is_empty());
}

#[test]
fn bodies_of_other_scenes_are_refused() {
    let [mut ours, mut theirs] = [Scene::new(), Scene::new()];
    let a = ours.add_triangles(&[[0, 1, 2]], &TRIANGLE).unwrap();
    let other = theirs.add_triangles(&[[0, 1, 2]], &TRIANGLE).unwrap();
    let is_refused = |result: Result<(), Error>| {
        let error = result.unwrap_err();
        assert!(
            matches!(error, Error::UnknownBody { body, n_bodies: 1 } if body == other),
            "{error}"
        );
    };
    is_refused(ours.set_positions(other, &TRIANGLE));
    is_refused(ours.remove(other));
    is_refused(ours.body(other).map(|_| ()));
    let mut detector = detector(Method::Clusters, 2);
    for query in [Query::self_of(other), Query::between(a, other)] {
        is_refused(detector.detect(&ours, &query).map(|_| ()));
    }
    // A clone has the same bodies, but bodies added to it later are its own.
    let mut clone = ours.clone();
    clone.set_positions(a, &TRIANGLE).unwrap();
    let b = ours.add_triangles(&[[0, 1, 2]], &TRIANGLE).unwrap();
    let c = clone.add_triangles(&[[0, 1, 2]], &TRIANGLE).unwrap();
    assert_eq!(b.index(), c.index());
    assert!(ours.body(c).is_err() && clone.body(b).is_err());
    // An old id does not name the body that took its slot.
    ours.remove(b).unwrap();
    let d = ours.add_triangles(&[[0, 1, 2]], &TRIANGLE).unwrap();
    assert!(d.index() == b.index() && ours.body(b).is_err() && ours.body(d).is_ok());
}

#[test]
fn positions_written_in_place_are_checked_wherever_the_vertex_is() {
    let ball = surfaces::ball(3000);
    for method in [Method::Clusters, Method::Cells, Method::Naive] {
        for with_lone_vertex in [false, true] {
            let mut scene = Scene::new();
            let mut model = ball.clone();
            if with_lone_vertex {
                model.positions.push([0.0; 3]);
            }
            let last = model.positions.len() - 1;
            let a = model.add_to(&mut scene).unwrap();
            let mut detector = detector(method, 2);
            let query = Query::self_of(a);
            let n_pairs = detector.detect(&scene, &query).unwrap().len();
            for vertex in [0, 77, last] {
                for bad in [f32::NAN, f32::INFINITY] {
                    scene.positions_mut(a).unwrap()[vertex] = [0.0, bad, 1.0];
                    match detector.detect(&scene, &query) {
                        Err(Error::NonFinitePosition { vertex: named, .. }) => {
                            assert_eq!(named, vertex, "{method:?}");
                        }
                        other => panic!("{method:?} vertex {vertex}: {other:?}"),
                    }
                }
                scene.positions_mut(a).unwrap()[vertex] = model.positions[vertex];
            }
            assert_eq!(detector.detect(&scene, &query).unwrap().len(), n_pairs);
        }
    }
}

#[test]
fn the_first_bad_position_of_a_large_body_is_named() {
    let ball = surfaces::ball(160_000);
    let mut scene = Scene::new();
    let body = ball.add_to(&mut scene).unwrap();
    let mut detector = detector(Method::Cells, 3);
    let query = Query::self_of(body);
    let last = ball.positions.len() - 1;
    assert!(last > 2 << 15, "for several threads: {last}");
    for bad in [vec![last], vec![40_000, 70_000], vec![0, last]] {
        for &vertex in &bad {
            scene.positions_mut::<f32>(body).unwrap()[vertex][2] = f32::NAN;
        }
        match detector.detect(&scene, &query) {
            Err(Error::NonFinitePosition { vertex, .. }) => assert_eq!(vertex, bad[0]),
            other => panic!("{bad:?}: {other:?}"),
        }
        for &vertex in &bad {
            scene.positions_mut::<f32>(body).unwrap()[vertex] = ball.positions[vertex];
        }
        detector.detect(&scene, &query).unwrap();
    }
}

/// Asks, and drops the answer.
type Ask = fn(&mut Detector, &Scene, [BodyId; 2]) -> Result<(), Error>;

#[test]
fn many_positions_that_are_not_copied_are_checked_by_the_next_question() {
    let asks: [(&str, Ask); 16] = [
        ("detect", |d, s, _| d.detect(s, &Query::all()).map(drop)),
        ("count", |d, s, _| d.count(s, &Query::all()).map(drop)),
        ("any", |d, s, _| d.any(s, &Query::all()).map(drop)),
        ("near", |d, s, _| d.near(s, 0.01, &Query::all()).map(drop)),
        ("neighbours", |d, s, _| {
            d.neighbours(s, 0.01, &Query::all()).map(drop)
        }),
        ("safe", |d, s, _| {
            d.safe_distances(s, 0.01, &Query::all()).map(drop)
        }),
        ("distance", |d, s, [a, b]| d.distance(s, a, b).map(drop)),
        ("nearest", |d, s, _| {
            d.nearest(s, &Query::between_all()).map(drop)
        }),
        ("contains", |d, s, [a, _]| {
            d.contains(s, a, &[[0.0; 3]]).map(drop)
        }),
        ("closest", |d, s, _| {
            d.closest(s, &[[0.0; 3]], 9.0, &Query::all()).map(drop)
        }),
        ("cast", |d, s, _| {
            d.cast(s, &[[0.0; 3]], &[[1.0; 3]], 9.0, &Query::all())
                .map(drop)
        }),
        ("impacts", |d, s, _| d.impacts(s, &Query::all()).map(drop)),
        ("is_free", |d, s, _| d.is_free(s, &Query::all()).map(drop)),
        ("advance", |d, s, _| d.advance(s, &Query::all()).map(drop)),
        ("truncate", |d, s, _| d.truncate(s, &Query::all()).map(drop)),
        ("candidates", |d, s, _| {
            d.candidates(s, 0.0, &Query::all()).map(drop)
        }),
    ];
    let ball = surfaces::ball(70_000);
    let aside = ball.clone().translated([0.0, 0.0, 3.0]);
    let mut scene = Scene::new();
    let [a, b] = [&ball, &aside].map(|model| model.add_to(&mut scene).unwrap());
    let mut bad = aside.positions.clone();
    let last = bad.len() - 1;
    assert!(last > 1 << 15);
    bad[last][1] = f32::NAN;
    for threads in [1, 2] {
        let mut detector = detector(Method::Auto, threads);
        for (name, ask) in &asks {
            for shared in [false, true] {
                match shared {
                    true => scene.set_positions(b, Arc::new(bad.clone())).unwrap(),
                    false => scene.set_positions(b, bad.clone()).unwrap(),
                }
                for _ in 0..2 {
                    match ask(&mut detector, &scene, [b, a]) {
                        Err(Error::NonFinitePosition { body, vertex, .. }) => {
                            assert_eq!((body, vertex), (b, last), "{name}");
                        }
                        other => panic!("{name}: {other:?}"),
                    }
                }
                scene.set_positions(b, aside.positions.clone()).unwrap();
                for _ in 0..2 {
                    ask(&mut detector, &scene, [b, a]).unwrap();
                }
            }
        }
    }
    // What is copied is refused at once, and so are few positions: nothing has changed then.
    assert!(scene.set_positions(b, &bad).is_err());
    assert_eq!(
        scene.body(b).unwrap().positions().point(last)[1],
        f64::from(aside.positions[last][1])
    );
    let few = scene.add_triangles(&[[0, 1, 2]], &TRIANGLE).unwrap();
    let nowhere = vec![[f32::NAN; 3]; 3];
    assert!(matches!(
        scene.set_positions(few, nowhere),
        Err(Error::NonFinitePosition { vertex: 0, .. })
    ));
    assert!(matches!(
        scene.set_positions(b, vec![[0.0f32; 3]; last]),
        Err(Error::WrongNumberOfPositions { .. })
    ));
    // Ends are checked when they are given; transforms look at what they move.
    assert!(scene.set_end_positions(b, bad.clone()).is_err());
    scene.set_positions(b, bad).unwrap();
    let still = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    assert!(scene.set_transform(b, &still).is_err() && scene.set_end_transform(b, &still).is_err());
}

#[test]
fn the_largest_and_smallest_coordinates_are_answered() {
    let mut scene = Scene::new();
    for scale in [f32::MAX, f32::MIN_POSITIVE, 1e-44] {
        let a = TRIANGLE.map(|p| p.map(|x| x * scale));
        let b = TRIANGLE.map(|[x, y, z]| [z * scale, (y - 0.5) * scale, x * scale]);
        scene.add_triangles(&[[0, 1, 2]], &a).unwrap();
        scene.add_triangles(&[[0, 1, 2]], &b).unwrap();
    }
    // Sums of such numbers overflow: the check of positions written in place must not mistake that
    // for infinity.
    let first = scene.bodies().next().unwrap().0;
    scene.positions_mut::<f32>(first).unwrap();
    let case = Case {
        name: "range".into(),
        scene,
        query: Query::all(),
    };
    let expected = naive(&case);
    assert!(expected.len() >= 3);
    for method in [Method::Clusters, Method::Cells] {
        check(&case, &expected, cpu(method, 2));
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    for settings in [
        Settings::new().density(0.0),
        Settings::new().density(f64::NAN),
        Settings::new().group_size(0),
        Settings::new().group_size(65),
        Settings::new().threads(1 << 20),
    ] {
        assert!(matches!(
            Detector::new(settings),
            Err(Error::Setting { .. })
        ));
    }
}

#[test]
fn budgets_are_kept_by_batches() {
    let built = adversarial::coincident(30_000).unwrap();
    let query = Query::all().shared_vertex(SharedVertex::Skip);
    for method in [Method::Clusters, Method::Cells] {
        let mut free = detector(method, 2);
        let pairs = free.detect(&built.scene, &query).unwrap();
        let expected = rows(&pairs);
        // While it is found, the answer takes twice its size, and a part of a chunk more. The grid
        // may take half of a budget.
        let of_answer = 2 * (2 * 8 * pairs.len() as u64 + (1 << 20));
        // Counting holds no answer: what is left is all of the method.
        assert_eq!(
            free.count(&built.scene, &query).unwrap(),
            expected.len() as u64
        );
        let held = free.stats().bytes_held;
        // Bisect between a budget that is refused and one that is enough, to the least sufficient
        // budget.
        let (mut refused, mut enough) = (1_000, held);
        let mut most_batches = 0;
        while enough - refused > held / 200 {
            let budget = (refused + enough) / 2;
            let settings = cpu(method, 2).memory_budget(Some(budget));
            let mut detector = Detector::new(settings).unwrap();
            match detector.count(&built.scene, &query) {
                Ok(n) => {
                    assert_eq!(n, expected.len() as u64);
                    let stats = detector.stats();
                    let held = stats.bytes_held;
                    assert!(held <= budget, "{method:?}: {held} held, {budget} allowed");
                    most_batches = most_batches.max(stats.n_batches);
                    let budget_of_pairs = budget + of_answer;
                    let mut detector =
                        Detector::new(cpu(method, 2).memory_budget(Some(budget_of_pairs))).unwrap();
                    let pairs = detector.detect(&built.scene, &query).unwrap();
                    agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
                    assert!(pairs.stats().bytes_held <= budget_of_pairs);
                    enough = budget;
                }
                Err(Error::MemoryBudget {
                    needed,
                    budget: told,
                    ..
                }) => {
                    assert!(needed > told && told == budget);
                    refused = budget;
                }
                Err(error) => panic!("{error}"),
            }
        }
        assert!(refused > 1_000, "a kilobyte is never enough");
        assert!(enough < held, "{method:?}: {enough} of {held} needed");
        assert!(most_batches > 1, "{method:?}: {most_batches} batches");
    }
}

/// Memory is bounded by input and output, even on scenes made to break that.
#[test]
fn adversarial_scenes_hold_memory_in_proportion() {
    for built in [
        adversarial::plain(20_000),
        adversarial::huge_over_small(20_000),
        adversarial::stadium(20_000),
        adversarial::one_cell(4_000),
        adversarial::flat_cloth(20_000),
        adversarial::needle_row(20_000),
        adversarial::coincident(10_000),
        adversarial::outliers(20_000),
        adversarial::boxes(1_500, 1),
        adversarial::mixed_sizes(20_000),
        adversarial::slivers(2_000),
        adversarial::machine_parts(20_000),
        adversarial::stacked_cubes(1_000),
    ] {
        let built = built.unwrap();
        for (method, most_each) in [(Method::Clusters, 400), (Method::Cells, 400)] {
            let mut detector = detector(method, 2);
            let pairs = detector.detect(&built.scene, &built.query).unwrap();
            let (n, n_bodies) = (built.n_elements() as u64, built.bodies.len() as u64);
            let most = most_each * n + 2_000 * n_bodies + (16 << 20);
            let held = pairs.stats().bytes_held;
            assert!(
                held <= most,
                "{} {method:?}: {held} bytes, {most} allowed",
                built.name
            );
        }
    }
}

/// Boxes of long elements hold far more than these. Directions tell many of their pairs apart.
#[test]
fn directions_tell_long_elements_apart() {
    let built = adversarial::machine_parts(20_000).unwrap();
    let mut detector = detector(Method::Clusters, 2);
    let pairs = detector.detect(&built.scene, &built.query).unwrap();
    let (n, n_parted) = (pairs.stats().n_candidates, pairs.stats().ways.n_parted);
    assert!(4 * n_parted > n, "{n_parted} of {n} candidates");
}

/// Threads take tasks in any order, but what is done is counted.
#[test]
fn progress_counts_what_is_done() {
    const THREADS: usize = 4;
    let built = adversarial::plain(20_000).unwrap();
    let mut detector = detector(Method::Clusters, THREADS);
    let seen = Arc::new(Mutex::new(Vec::new()));
    let all = Arc::clone(&seen);
    let see = move |progress: impinge_core::Progress| all.lock().unwrap().push(progress);
    detector.set_control(Control::new().progress(see));
    detector.detect(&built.scene, &built.query).unwrap();
    let seen = seen.lock().unwrap();
    assert!(
        seen.iter()
            .any(|progress| progress.total > 2 * THREADS as u64)
    );
    for (ix, progress) in seen.iter().enumerate() {
        assert!(progress.total > 0 && progress.done <= progress.total);
        // A report may be late, by as many as there are other threads.
        let before = progress.done.saturating_sub(THREADS as u64);
        let is_before =
            |other: &impinge_core::Progress| (other.done, other.total) == (before, progress.total);
        let has_begun = progress.done < THREADS as u64;
        assert!(
            has_begun || seen[..ix].iter().any(is_before),
            "{ix}: {progress:?}"
        );
    }
}

#[test]
fn runs_can_be_watched_and_cancelled() {
    for (method, n) in [
        (Method::Clusters, 20_000),
        (Method::Cells, 20_000),
        (Method::Naive, 2_000),
    ] {
        let built = adversarial::plain(n).unwrap();
        let mut detector = detector(method, 2);
        let (calls, token) = (Arc::new(AtomicU64::new(0)), CancelToken::new());
        let counted = Arc::clone(&calls);
        let count = move |progress: impinge_core::Progress| {
            assert!(progress.done <= progress.total);
            counted.fetch_add(1, Ordering::Relaxed);
        };
        detector.set_control(Control::new().cancel(&token).progress(count));
        let n_pairs = detector.detect(&built.scene, &built.query).unwrap().len();
        assert!(calls.load(Ordering::Relaxed) > 1);
        let stopping = token.clone();
        let stop = move |_: impinge_core::Progress| stopping.cancel();
        detector.set_control(Control::new().cancel(&token).progress(stop));
        let result = detector.detect(&built.scene, &built.query);
        assert!(matches!(result, Err(Error::Cancelled)), "{method:?}");
        detector.set_control(Control::new());
        // After a cancellation, the detector works as before.
        assert_eq!(
            detector.detect(&built.scene, &built.query).unwrap().len(),
            n_pairs
        );
    }
}
