//! The GPU backend against the oracle and the CPU: whole sorted sets and their hash.
//!
//! These tests fail where no adapter is found; a software driver is enough.
#![cfg(feature = "gpu")]

use impinge::{Backend, Detector, Elements, Method, Query, Scene, Settings};

fn detector(backend: Backend, method: Method) -> Detector {
    Detector::with_settings(Settings {
        backend,
        method,
        ..Settings::default()
    })
    .expect("a detector")
}

fn soup(n: usize, size: f32, seed: u64) -> (Vec<[f32; 3]>, Elements) {
    let mut state = seed;
    let mut unit = move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = state;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x >> 40) as f32 / (1u32 << 24) as f32
    };
    let mut positions = Vec::new();
    for _ in 0..n {
        let center = [unit(), unit(), unit()];
        for _ in 0..3 {
            positions.push(center.map(|c| c + size * (unit() - 0.5)));
        }
    }
    let faces: Vec<[u32; 3]> = (0..n as u32)
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    (positions, faces.into())
}

#[test]
fn soups_give_the_same_pairs_as_the_oracle() {
    for (n, size) in [(1, 0.9), (64, 0.5), (65, 0.4), (3000, 0.1)] {
        let mut scene = Scene::new();
        let (positions, elements) = soup(n, size, 1);
        let a = scene.add(elements, positions).unwrap();
        let (positions, elements) = soup(n + 7, size, 2);
        let b = scene.add(elements, positions).unwrap();
        for query in [Query::between(a, b), Query::within(a), Query::everything()] {
            let mut naive = detector(Backend::Cpu, Method::Naive);
            let mut gpu = detector(Backend::Gpu, Method::Clusters);
            let want = naive.detect(&scene, &query).unwrap();
            let t = std::time::Instant::now();
            let got = gpu.detect(&scene, &query).unwrap();
            println!("{n} {:?} {} {:?}", t.elapsed(), want.len(), got.stats());
            assert!(
                got.same_as(want),
                "{n} {query:?}: {} {}",
                got.len(),
                want.len()
            );
        }
    }
}
