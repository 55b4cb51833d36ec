//! Passes as data: printed, and run launch by launch, which finds the kernel that goes wrong.
#![cfg(feature = "gpu")]

use impinge_core::gpu::recording::Ran;
use impinge_core::{Backend, Detector, Method, Query, Scene, Settings, Step, wgpu};
use impinge_scenes::surfaces;

fn device() -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::default();
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()));
    let adapter = adapter.expect("these tests need an adapter");
    pollster::block_on(adapter.request_device(&Default::default())).expect("a device")
}

/// Two balls that overlap, of which one moves.
fn balls() -> Scene {
    let mut scene = Scene::new();
    let ball = surfaces::ball(3000);
    let other = ball.translated([0.9, 0.0, 0.0]);
    ball.add_to(&mut scene).expect("good");
    let moving = other.add_to(&mut scene).expect("good");
    let end = other.translated([0.1, 0.2, 0.0]).positions;
    scene.set_end_positions(moving, &end).expect("as many");
    scene
}

/// A question about two balls.
type Ask = fn(&mut Detector, &Scene);

const PAIRS: Ask = |detector, scene| {
    // A damaged kernel may make any error.
    let _ = detector.detect(scene, &Query::all());
};

const IMPACTS: Ask = |detector, scene| {
    let _ = detector.impacts(scene, &Step::default());
};

/// The first launch that writes something else than it does with good kernels.
fn first_wrong(settings: &Settings, ask: Ask, damage: (&str, &str, &str)) -> Option<String> {
    let scene = balls();
    let harmless = (damage.0, damage.1, damage.1);
    let [good, bad] = [harmless, damage].map(|damage| {
        let (device, queue) = device();
        let mut detector = Detector::with_damage(device, queue, settings.clone(), damage)
            .expect("the kernel has this line");
        detector.trace(true);
        ask(&mut detector, &scene);
        detector
    });
    let [mut good, mut bad] = [good, bad];
    let [good, bad] = [&mut good, &mut bad].map(|detector| {
        let [still, moving] = detector.ran().expect("a device");
        if still.is_empty() { moving } else { still }
    });
    assert_eq!(names(good), names(bad));
    assert!(!good.is_empty());
    let mut launches = good.iter().zip(bad);
    let wrong = launches.find(|(good, bad)| good.written != bad.written);
    wrong.map(|(good, _)| good.kernel.to_owned())
}

fn names(ran: &[Ran]) -> Vec<&'static str> {
    ran.iter().map(|launch| launch.kernel).collect()
}

#[test]
fn the_launch_that_goes_wrong_is_found() {
    let still = [
        (
            "bounds_clusters",
            "high = max(high, highs[ix]);",
            "high = highs[ix];",
        ),
        (
            "bounds_top",
            "high = max(high, nodes[child].high);",
            "high = nodes[child].high;",
        ),
        (
            "dispatch",
            "if !extents_meet(node_extent(pair.a), node_extent(pair.b)) {",
            "if extents_meet(node_extent(pair.a), node_extent(pair.b)) {",
        ),
        (
            "narrow",
            "atomicAdd(&counters[counter], n);",
            "atomicAdd(&counters[counter], n - 1u);",
        ),
        (
            "prepare",
            "n / per_group + select(0u, 1u, n % per_group != 0u);",
            "n / per_group;",
        ),
    ];
    let settings = Settings::default();
    for damage in still {
        let found = first_wrong(&settings, PAIRS, damage);
        assert_eq!(found.as_deref(), Some(damage.0));
        let harmless = (damage.0, damage.1, damage.1);
        assert_eq!(first_wrong(&settings, PAIRS, harmless), None);
    }
    for damage in [
        (
            "narrow_moving",
            "return decide(&polygon, &sizes, pair.are_edges) != FREE;",
            "return true;",
        ),
        (
            "narrow_search",
            "found.touches_by = high;",
            "found.touches_by = low;",
        ),
    ] {
        let found = first_wrong(&settings, IMPACTS, damage);
        assert_eq!(found.as_deref(), Some(damage.0));
    }
}

#[test]
fn recordings_are_printed_one_line_per_launch() {
    let scene = balls();
    for method in [Method::Clusters, Method::Cells] {
        let settings = Settings {
            method,
            backend: Backend::Gpu,
            ..Settings::default()
        };
        let mut detector = Detector::with_settings(settings).expect("an adapter");
        detector.detect(&scene, &Query::all()).expect("good");
        detector.impacts(&scene, &Step::default()).expect("good");
        let recordings = detector.recordings().expect("a device");
        let [still, moving] = recordings.map(ToString::to_string);
        let kernels = |text: &str| -> Vec<String> {
            let lines = text.lines().filter(|line| line.contains(" x "));
            lines
                .map(|line| line.split_whitespace().nth(1).unwrap_or("").to_owned())
                .collect()
        };
        let of_method: &[&str] = match method {
            Method::Clusters => &[
                "bounds_clusters",
                "dispatch",
                "prepare",
                "pairing",
                "narrow",
            ],
            _ => &[
                "bounds_keep",
                "grid_count",
                "dispatch_scatter",
                "pairing_cells",
            ],
        };
        for kernel in of_method {
            assert!(kernels(&still).iter().any(|name| name == kernel), "{still}");
        }
        let last = kernels(&moving).pop();
        assert_eq!(last.as_deref(), Some("narrow_search"), "{moving}");
        for (text, reads) in [
            (&still, "counters, grid, pairs, unsure"),
            (&moving, "times of pairs"),
        ] {
            let last = text.lines().last().unwrap_or("");
            assert!(last.contains("read") && last.contains(reads), "{text}");
        }
    }
}
