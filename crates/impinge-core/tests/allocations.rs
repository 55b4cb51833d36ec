//! A steady frame allocates only its plan and its answer's lock, however large it is.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

use impinge_core::{Backend, Detector, Method, Query, Scene, Settings};
use impinge_scenes::surfaces;

struct Counting;

static N_ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: all calls go on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        N_ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        N_ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
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
        let mut detector = Detector::new(Settings {
            method,
            threads: 1,
            backend: Backend::Cpu,
            ..Settings::default()
        })
        .unwrap();
        for query in [Query::between(a, b), Query::all()] {
            let mut n_pairs = 0;
            for frame in 0..6 {
                let pose = &poses[frame % 2];
                scene.positions_mut(a).unwrap().copy_from_slice(pose);
                let before = N_ALLOCATIONS.load(Ordering::Relaxed);
                n_pairs = detector.detect(&scene, &query).unwrap().len();
                let allocated = N_ALLOCATIONS.load(Ordering::Relaxed) - before;
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
