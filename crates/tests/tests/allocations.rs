//! A steady frame allocates only its plan and its answer's lock, however large it is.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use impinge_core::contact::Contacts;
use impinge_core::{
    Backend, Candidates, Detector, Impacts, Method, NearPairs, Neighbours, PairKind, Query, Scene,
    Settings, Stencils,
};
use impinge_scenes::surfaces;

struct Counting;

thread_local! {
    /// Of one thread: the thread that runs the tests allocates when another test ends.
    static N_ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

fn n_allocations() -> u64 {
    N_ALLOCATIONS.get()
}

fn count() {
    N_ALLOCATIONS.set(n_allocations() + 1);
}

// SAFETY: all calls go on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count();
        // SAFETY: passed on.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn steady_frames_allocate_a_plan_and_no_lists() {
    let ball = surfaces::bumpy_ball(5000, 0.3);
    for method in [Method::Clusters, Method::Cells] {
        let mut scene = Scene::new();
        let a = ball.add_to(&mut scene).unwrap();
        let b = ball.translated([0.7, 0.1, 0.0]).add_to(&mut scene).unwrap();
        ball.translated([0.0, 0.9, 0.2]).add_to(&mut scene).unwrap();
        let poses = [
            ball.positions.clone(),
            ball.translated([0.0, 0.0, 0.125]).positions,
        ];
        let mut detector = Detector::new(
            Settings::new()
                .method(method)
                .threads(1)
                .backend(Backend::Cpu),
        )
        .unwrap();
        for query in [Query::between(a, b), Query::all()] {
            let mut n_pairs = 0;
            for frame in 0..6 {
                let pose = &poses[frame % 2];
                scene.positions_mut(a).unwrap().copy_from_slice(pose);
                let before = n_allocations();
                n_pairs = detector.detect(&scene, &query).unwrap().len();
                let allocated = n_allocations() - before;
                // Two poses alternate: after one frame in each, all buffers have their final size.
                // What is left is the plan's list of bodies, and what the threads share.
                assert!(
                    frame < 3 || allocated <= 2,
                    "{method:?} frame {frame}: {allocated}"
                );
            }
            assert!(n_pairs > 100);
        }
    }
}

/// Counts the allocations of one question, whose answer is dropped.
fn counted(ask: impl FnOnce() -> usize) -> (u64, usize) {
    let before = n_allocations();
    let n = ask();
    (n_allocations() - before, n)
}

/// The most allocations of a steady frame: impacts, candidates, near, its stencils, neighbours,
/// distance, contacts. The first three need a plan, what the threads share and a list of boxes to find,
/// however large their answers are. `distance` and `contacts` keep no answer's memory. Measured: X.
const MOST: [u64; 7] = [3, 3, 5, 10, 6, 50, 80];

#[test]
fn other_questions_allocate_little_in_steady_frames() {
    for n in [1000, 4000] {
        let ball = surfaces::bumpy_ball(n, 0.3);
        let mut scene = Scene::new();
        let a = ball.add_to(&mut scene).unwrap();
        let b = ball.translated([0.7, 0.1, 0.0]).add_to(&mut scene).unwrap();
        // Off the lattice of the other ball: numbers of exact arithmetic may need memory.
        let places = [[0.013, 0.007, 0.003], [0.013, 0.017, 0.121]];
        let poses = places.map(|by| ball.translated(by).positions);
        let settings = Settings::new().backend(Backend::Cpu).threads(1);
        let mut detector = Detector::new(settings).unwrap();
        let query = Query::between(a, b);
        let near_query = query
            .clone()
            .kinds([PairKind::VertexFace, PairKind::EdgeEdge]);
        let (mut most, mut n_found) = ([0; 7], [0; 7]);
        for frame in 0..8 {
            let [pose, next] = [0, 1].map(|later| &poses[(frame + later) % 2]);
            scene.set_positions(a, pose).unwrap();
            scene.set_end_positions(a, next).unwrap();
            let pairs = detector.detect(&scene, &query).unwrap();
            let mut n_reclustered = 0;
            macro_rules! counted {
                ($($ask:expr => $n:expr),+) => {
                    [$(counted(|| {
                        let answer = $ask.unwrap();
                        n_reclustered += detector.stats().n_reclustered;
                        ($n)(&answer)
                    })),+]
                };
            }
            let asked = counted!(
                detector.impacts(&scene, &query) => Impacts::len,
                detector.candidates(&scene, 0.01, &query) => Candidates::len,
                detector.near(&scene, 0.01, &query) => NearPairs::len,
                detector.near(&scene, 0.01, &near_query).unwrap().stencils(&scene, None) => Stencils::len,
                detector.neighbours(&scene, 0.01, &query) => Neighbours::len,
                detector.distance(&scene, a, b) => |_: &_| pairs.len(),
                detector.contacts(&scene, &pairs) => Contacts::len
            );
            if frame >= 4 {
                most = std::array::from_fn(|ix| most[ix].max(asked[ix].0));
                n_found = asked.map(|(_, n)| n);
                // Boxes are larger for some of them, and clusters no worse.
                assert_eq!(n_reclustered, 0, "{n} triangles, frame {frame}");
            }
        }
        let is_little = most.iter().zip(MOST).all(|(&n, limit)| n <= limit);
        assert!(is_little, "{n} triangles: {most:?}, at most {MOST:?}");
        assert!(n_found.iter().all(|&n| n > 10), "{n_found:?}");
    }
}
