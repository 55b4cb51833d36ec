//! What grows with the answer: limits, counts, and memory that is not there.
//!
//! All tests of this file share one allocator, which counts and may refuse; so they run one at a
//! time.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use impinge_core::{BodyId, Candidates, Detector, Error, Method, PairKind, Query, Scene};
use impinge_tests::{agree, cases, cpu, detector, naive, rows};

/// Counts the bytes that are held, and refuses large requests beyond a limit, as a system does.
struct Limited;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static LIMIT: AtomicUsize = AtomicUsize::new(usize::MAX);
/// Smaller requests are always granted, as they mostly are where a process has used up its address
/// space.
const SMALL: usize = 1 << 14;

fn add(size: usize) -> bool {
    let held = HELD.fetch_add(size, Ordering::Relaxed) + size;
    if size >= SMALL && held > LIMIT.load(Ordering::Relaxed) {
        HELD.fetch_sub(size, Ordering::Relaxed);
        return false;
    }
    PEAK.fetch_max(held, Ordering::Relaxed);
    true
}

// SAFETY: what is granted is passed on to the system's allocator.
unsafe impl GlobalAlloc for Limited {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !add(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // For a while both are there.
        if !add(new_size) {
            return std::ptr::null_mut();
        }
        // SAFETY: passed on.
        let new = unsafe { System.realloc(pointer, layout, new_size) };
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        new
    }
}

#[global_allocator]
static ALLOCATOR: Limited = Limited;

fn alone() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The most bytes held while something ran, beyond those before.
fn peak<T>(run: impl FnOnce() -> T) -> (T, usize) {
    let before = HELD.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let result = run();
    (result, PEAK.load(Ordering::Relaxed) - before)
}

/// Runs with so many bytes more, and no others.
fn within_bytes<T>(more: usize, run: impl FnOnce() -> T) -> T {
    LIMIT.store(HELD.load(Ordering::Relaxed) + more, Ordering::Relaxed);
    let result = run();
    LIMIT.store(usize::MAX, Ordering::Relaxed);
    result
}

const METHODS: [Method; 3] = [Method::Clusters, Method::Cells, Method::Naive];

/// A body of `n` triangles, turned around one axis that passes through all of them: they share no
/// vertex, and each meets each.
fn pile(n: u32) -> (Scene, BodyId) {
    let faces: Vec<[u32; 3]> = (0..n).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let positions: Vec<[f32; 3]> = (0..n)
        .flat_map(|k| {
            let (sin, cos) = (k as f32 / n as f32 * 3.0).sin_cos();
            [
                [-cos, -sin, -1.0],
                [cos, sin, -1.0],
                [0.1 * cos, 0.1 * sin, 1.0],
            ]
        })
        .collect();
    let mut scene = Scene::new();
    let body = scene.add_triangles(&faces, &positions).unwrap();
    (scene, body)
}

fn n_pairs_of_pile(n: u32) -> u64 {
    u64::from(n) * u64::from(n - 1) / 2
}

/// Two bodies of points on one spot, one of which moves away: `n` times `n` impacts of two
/// vertices.
fn swarm(n: usize) -> Scene {
    let mut scene = Scene::new();
    scene.add_points(&vec![[0.0f32; 3]; n]).unwrap();
    let moving = scene.add_points(&vec![[0.0f32; 3]; n]).unwrap();
    scene
        .set_end_positions(moving, vec![[1.0f32, 0.0, 0.0]; n])
        .unwrap();
    scene
}

fn step() -> Query {
    Query::between_all()
}

fn swarm_candidates() -> Query {
    Query::between_all().kinds([PairKind::VertexVertex])
}

#[test]
fn an_answer_takes_twice_its_size_at_most() {
    let _alone = alone();
    for (method, n) in [
        (Method::Clusters, 3_000),
        (Method::Cells, 3_000),
        (Method::Naive, 1_500),
    ] {
        let (scene, body) = pile(n);
        let mut detector = detector(method, 2);
        let before = HELD.load(Ordering::Relaxed);
        let (bytes_held, peak) = peak(|| {
            let pairs = detector.detect(&scene, &Query::self_of(body)).unwrap();
            assert_eq!(pairs.len() as u64, n_pairs_of_pile(n));
            pairs.stats().bytes_held as usize
        });
        let answer = 8 * n_pairs_of_pile(n) as usize;
        let held = HELD.load(Ordering::Relaxed) - before;
        // What is said is what is held, but for the input's share of what nobody counts.
        let uncounted = 300 * n as usize + (1 << 19);
        assert!(bytes_held >= answer, "{method:?}: {bytes_held} of {answer}");
        assert!(
            held.abs_diff(bytes_held) < uncounted,
            "{method:?}: {held} held, {bytes_held} said"
        );
        let scratch = bytes_held - answer;
        // One chunk that is not full, and the list of chunks.
        let most = 2 * answer + scratch + uncounted + (5 << 18);
        assert!(
            peak <= most,
            "{method:?}: {peak} for {answer}, {most} allowed"
        );
    }
}

#[test]
fn more_pairs_than_allowed_are_refused_before_they_are_held() {
    let _alone = alone();
    for (method, n) in [
        (Method::Clusters, 3_000),
        (Method::Cells, 3_000),
        (Method::Naive, 1_000),
    ] {
        let (scene, body) = pile(n);
        let query = Query::self_of(body);
        let all = n_pairs_of_pile(n);
        for limit in [0, 1, 1_000, all - 1] {
            let mut limited = Detector::new(cpu(method, 2).max_pairs(Some(limit))).unwrap();
            let (result, peak) = peak(|| limited.detect(&scene, &query).map(|_| ()));
            match result {
                Err(Error::TooManyPairs { found, limit: told }) => {
                    assert!(
                        found > limit && told == limit,
                        "{method:?}: {found}, {limit}"
                    );
                    // It stopped there.
                    assert!(found <= limit + 20_000, "{method:?}: {found}, {limit}");
                }
                other => panic!("{method:?}, {limit}: {other:?}"),
            }
            if limit <= 1_000 {
                assert!(peak < 8 << 20, "{method:?}: {peak} bytes");
            }
        }
        let mut limited = Detector::new(cpu(method, 2).max_pairs(Some(all))).unwrap();
        assert_eq!(limited.detect(&scene, &query).unwrap().len() as u64, all);
        assert_eq!(limited.count(&scene, &query).unwrap(), all);
        let error = Detector::new(cpu(method, 2).max_pairs(Some(7)))
            .unwrap()
            .count(&scene, &query);
        let text = error.unwrap_err().to_string();
        assert!(text.contains("at most 7"), "{text}");
    }
}

#[test]
fn counting_holds_no_pairs() {
    let _alone = alone();
    let n = 4_000;
    let (scene, body) = pile(n);
    for method in [Method::Clusters, Method::Cells] {
        let mut counting = detector(method, 2);
        let (count, peak) = peak(|| counting.count(&scene, &Query::self_of(body)));
        assert_eq!(count.unwrap(), n_pairs_of_pile(n));
        assert!(peak < 8 << 20, "{method:?}: {peak} bytes");
        let stats = counting.stats();
        assert_eq!(stats.method, method.name());
        assert!(stats.n_work_items > 0 && stats.bytes_held < 8 << 20);
    }
}

#[test]
fn counts_and_whether_there_is_any_agree_with_the_pairs() {
    let _alone = alone();
    for case in cases() {
        let expected = naive(&case);
        for method in [Method::Clusters, Method::Cells] {
            let mut detector = detector(method, 2);
            let count = detector.count(&case.scene, &case.query).unwrap();
            assert_eq!(count, expected.len() as u64, "{}, {method:?}", case.name);
            let any = detector.any(&case.scene, &case.query).unwrap();
            assert_eq!(any, !expected.is_empty(), "{}, {method:?}", case.name);
            let pairs = detector.detect(&case.scene, &case.query).unwrap();
            agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
        }
    }
}

#[test]
fn any_ends_with_the_first_pair() {
    let _alone = alone();
    let (scene, body) = pile(6_000);
    for method in METHODS {
        // However many there are, one is enough.
        let mut detector = Detector::new(cpu(method, 2).max_pairs(Some(0))).unwrap();
        let (any, peak) = peak(|| detector.any(&scene, &Query::self_of(body)));
        assert!(any.unwrap());
        assert!(peak < 16 << 20, "{method:?}: {peak} bytes");
        let candidates = detector.stats().n_candidates;
        assert!(candidates < 100_000, "{method:?}: {candidates}");
    }
}

#[test]
fn no_memory_is_an_error_and_the_detector_goes_on() {
    let _alone = alone();
    let n = 2_500;
    let (scene, body) = pile(n);
    let query = Query::self_of(body);
    let answer = 8 * n_pairs_of_pile(n) as usize;
    for method in METHODS {
        let mut detector = detector(method, 2);
        // Chunks do not fit; they do, but not what joins them.
        for part in [answer / 2, answer * 3 / 2] {
            // All but the answer is there.
            let count = detector.count(&scene, &query).unwrap();
            assert_eq!(count, n_pairs_of_pile(n));
            match within_bytes(part, || detector.detect(&scene, &query).map(|_| ())) {
                Err(Error::OutOfMemory { n, needed, .. }) => {
                    assert!(n > 0 && needed > 0, "{method:?}: {n}, {needed}");
                }
                other => panic!("{method:?}, {part}: {other:?}"),
            }
        }
        let pairs = detector.detect(&scene, &query).unwrap();
        assert_eq!(pairs.len() as u64, n_pairs_of_pile(n), "{method:?}");
        let held = HELD.load(Ordering::Relaxed);
        drop(detector);
        assert!(HELD.load(Ordering::Relaxed) < held, "no copy");
        assert_eq!(pairs.len() as u64, n_pairs_of_pile(n));
    }
}

#[test]
fn budgets_count_the_answer() {
    let _alone = alone();
    let n = 2_500;
    let (scene, body) = pile(n);
    let query = Query::self_of(body);
    let answer = 8 * n_pairs_of_pile(n);
    for method in METHODS {
        let mut free = detector(method, 2);
        let pairs = free.detect(&scene, &query).unwrap();
        let hash = pairs.hash();
        let scratch = pairs.stats().bytes_held - answer;
        for (budget, fits) in [
            (answer / 2, false),
            (answer, false),
            // A part of what is to spare goes to work items.
            ((2 * answer + 2 * scratch + (3 << 20)) / 4 * 5, true),
        ] {
            let mut detector = Detector::new(cpu(method, 2).memory_budget(Some(budget))).unwrap();
            let before = HELD.load(Ordering::Relaxed);
            for frame in 0..2 {
                let (result, peak) =
                    peak(|| detector.detect(&scene, &query).map(|pairs| pairs.hash()));
                match result {
                    Ok(found) => assert!(fits && found == hash, "{method:?}, {frame}"),
                    Err(Error::MemoryBudget {
                        needed,
                        budget: told,
                        ..
                    }) => {
                        assert!(
                            !fits && needed > budget && told == budget,
                            "{method:?}: {needed}"
                        );
                    }
                    Err(error) => panic!("{method:?}: {error}"),
                }
                let most = budget as usize + 300 * n as usize + (1 << 20);
                assert!(peak < most, "{method:?}: {peak} for {budget}");
            }
            // Whether it fits or not, no more is held than was said.
            let held = HELD.load(Ordering::Relaxed) - before;
            assert!(
                held < budget as usize + 300 * n as usize + (1 << 20),
                "{held}"
            );
            assert_eq!(detector.count(&scene, &query).unwrap(), n_pairs_of_pile(n));
        }
    }
}

#[test]
fn steps_keep_the_same_limits() {
    let _alone = alone();
    let n = 1_000;
    let all = (n * n) as u64;
    let scene = swarm(n);
    for method in [Method::Clusters, Method::Naive] {
        let mut free = detector(method, 2);
        assert_eq!(free.impacts(&scene, &step()).unwrap().len() as u64, all);
        let candidates = free.candidates(&scene, 0.0, &swarm_candidates()).unwrap();
        assert_eq!(candidates.of(PairKind::VertexVertex).len() as u64, all);

        let limited = |max_pairs| Detector::new(cpu(method, 2).max_pairs(Some(max_pairs))).unwrap();
        let refused = |result: Result<(), Error>, limit: u64| match result {
            Err(Error::TooManyPairs { found, limit: told }) => {
                assert!(found > limit && told == limit && found <= limit + 20_000);
            }
            other => panic!("{method:?}: {other:?}"),
        };
        let mut few = limited(5_000);
        refused(few.impacts(&scene, &step()).map(|_| ()), 5_000);
        refused(
            few.candidates(&scene, 0.0, &swarm_candidates()).map(|_| ()),
            5_000,
        );
        // One contact is wanted, however many there are.
        assert!(!few.is_free(&scene, &step()).unwrap());
        assert!(few.earliest(&scene, &step()).unwrap().is_some());
        let mut enough = limited(all);
        assert_eq!(enough.impacts(&scene, &step()).unwrap().len() as u64, all);
        let candidates = enough.candidates(&scene, 0.0, &swarm_candidates()).unwrap();
        assert_eq!(candidates.len() as u64, all);

        // 64 bytes per impact, 8 per candidate; the caches are there.
        for part in [4 << 20, 30 << 20, 50 << 20] {
            match within_bytes(part, || few_bytes(method, &scene).map(|_| ())) {
                Err(Error::OutOfMemory { .. }) => {}
                other => panic!("{method:?}, {part}: {other:?}"),
            }
        }
        let mut detector = detector(method, 2);
        let part = 5 << 20;
        match within_bytes(part, || {
            detector
                .candidates(&scene, 0.0, &swarm_candidates())
                .map(|_| ())
        }) {
            Err(Error::OutOfMemory { .. }) => {}
            other => panic!("{method:?}: {other:?}"),
        }
        let candidates = detector
            .candidates(&scene, 0.0, &swarm_candidates())
            .unwrap();
        assert_eq!(candidates.len() as u64, all);

        let budgeted = |budget| {
            let mut detector = Detector::new(cpu(method, 2).memory_budget(Some(budget))).unwrap();
            let impacts = detector
                .impacts(&scene, &step())
                .map(|impacts| impacts.len());
            let candidates = detector.candidates(&scene, 0.0, &swarm_candidates());
            (impacts, candidates.map(|candidates| candidates.len()))
        };
        let (impacts, candidates) = budgeted(160 << 20);
        assert_eq!(
            (impacts.unwrap() as u64, candidates.unwrap() as u64),
            (all, all)
        );
        let (impacts, candidates) = budgeted(6 << 20);
        for result in [impacts, candidates] {
            match result {
                Err(Error::MemoryBudget { needed, budget, .. }) => {
                    assert!(needed > budget && budget == 6 << 20);
                }
                other => panic!("{method:?}: {other:?}"),
            }
        }
    }
}

/// Candidates that the memory budget cannot hold all at once come in runs that it can hold.
#[test]
fn runs_of_candidates_keep_the_budget() {
    let _alone = alone();
    let n = 1_000;
    let scene = swarm(n);
    for (method, budgets) in [
        (Method::Clusters, [4 << 20, 7 << 20]),
        (Method::Naive, [1 << 20, 4 << 20]),
    ] {
        let mut before = usize::MAX;
        for budget in budgets {
            let mut detector = Detector::new(cpu(method, 2).memory_budget(Some(budget))).unwrap();
            match detector.candidates(&scene, 0.0, &swarm_candidates()) {
                Err(Error::MemoryBudget { .. }) => {}
                other => panic!("{method:?}, {budget}: {:?}", other.map(|all| all.len())),
            }
            let (mut next, mut n_runs) = (0, 0);
            let mut each = |run: Candidates| {
                assert!(run.stats().bytes_held <= budget, "{:?}", run.stats());
                for (_, a, b) in run.iter() {
                    assert_eq!((a.element, b.element), (next / n as u32, next % n as u32));
                    next += 1;
                }
                n_runs += 1;
                ControlFlow::<()>::Continue(())
            };
            let (all, held) = peak(|| {
                detector.candidates_in_runs(&scene, 0.0, &swarm_candidates(), u64::MAX, &mut each)
            });
            assert_eq!(all, Ok(ControlFlow::Continue((n * n) as u64)));
            assert_eq!(next as usize, n * n);
            // The scene's parts and the threads' stacks of the search are not counted.
            assert!(
                held as u64 <= budget + (1 << 20),
                "{method:?}: {held} of {budget}"
            );
            assert!((2..before).contains(&n_runs), "{method:?}: {n_runs} runs");
            before = n_runs;
        }
        let mut detector = Detector::new(cpu(method, 2).memory_budget(Some(100_000))).unwrap();
        let nothing = |_| -> ControlFlow<()> { panic!("no run") };
        match detector.candidates_in_runs(&scene, 0.0, &swarm_candidates(), u64::MAX, nothing) {
            Err(Error::MemoryBudget { needed, budget, .. }) => {
                assert!(needed > budget && budget == 100_000);
            }
            other => panic!("{method:?}: {other:?}"),
        }
    }
}

fn few_bytes(method: Method, scene: &Scene) -> Result<usize, Error> {
    let mut detector = detector(method, 2);
    Ok(detector.impacts(scene, &step())?.len())
}

#[test]
fn impacts_take_twice_their_size_at_most() {
    let _alone = alone();
    let n = 1_000;
    let scene = swarm(n);
    for method in [Method::Clusters, Method::Naive] {
        let mut detector = detector(method, 2);
        let answer = 64 * n * n;
        let (bytes_held, of_impacts) = peak(|| {
            let impacts = detector.impacts(&scene, &step()).unwrap();
            assert_eq!(size_of_val(impacts.iter().as_slice()), answer);
            impacts.stats().bytes_held as usize
        });
        assert!(of_impacts < 2 * answer, "{method:?}: {of_impacts}");
        assert!(bytes_held >= answer, "{method:?}: {bytes_held}");
        let mut detector = impinge_tests::detector(method, 2);
        let (bytes_held, of_candidates) = peak(|| {
            let candidates = detector
                .candidates(&scene, 0.0, &swarm_candidates())
                .unwrap();
            candidates.stats().bytes_held as usize
        });
        let answer = 8 * n * n;
        assert!(
            of_candidates < 2 * answer + (4 << 20),
            "{method:?}: {of_candidates}"
        );
        assert!(bytes_held >= answer, "{method:?}: {bytes_held}");
    }
}

#[test]
fn contacts_without_memory_are_an_error() {
    let _alone = alone();
    let (scene, body) = pile(700);
    let mut detector = detector(Method::Clusters, 2);
    let pairs = detector
        .detect(&scene, &Query::self_of(body))
        .unwrap()
        .clone();
    let mut detector = impinge_tests::detector(Method::Clusters, 1);
    let (contacts, peak) = peak(|| detector.contacts(&scene, &pairs).unwrap());
    assert_eq!(contacts.len() as u64, n_pairs_of_pile(700));
    drop(contacts);
    for parts in 1..8 {
        match within_bytes(peak * parts / 8, || {
            detector.contacts(&scene, &pairs).map(|_| ())
        }) {
            Err(Error::OutOfMemory { what, needed, .. }) => {
                assert!(what.contains("contact") && needed > 0, "{what}");
            }
            other => panic!("{parts}: {other:?}"),
        }
    }
}
