//! A device of the caller's that is lost: every question is an error, and none ends the program.
//!
//! These tests fail where no adapter is found; a software driver is enough.

use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, Waker};

use crate::caller::Caller;

use impinge_core::{Backend, Detector, Error, Query, Scene, Settings, wgpu};

/// Two triangles that intersect, the second of which moves.
fn crossed() -> (Scene, [[f32; 3]; 3]) {
    let mut scene = Scene::new();
    let at = [[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    scene.add_triangles(&[[0, 1, 2]], &at).expect("good");
    let across = at.map(|[x, y, z]| [x, z + 0.25, y - 0.25]);
    let moving = scene.add_triangles(&[[0, 1, 2]], &across).expect("good");
    let end = across.map(|[x, y, z]| [x, y + 0.125, z]);
    scene.set_end_positions(moving, &end).expect("good");
    (scene, at)
}

fn is_refused<T: std::fmt::Debug>(question: &str, answer: Result<T, Error>) {
    assert!(
        matches!(answer, Err(Error::Gpu { .. })),
        "{question}: {answer:?}"
    );
}

#[test]
fn every_question_about_a_lost_device_is_an_error() {
    let (mut scene, at) = crossed();
    let body = scene.bodies().map(|(id, _)| id).next().expect("two");
    let query = Query::all();
    for is_polled in [false, true] {
        let caller = Caller::new();
        // The callback of the caller's stays the caller's.
        let is_told = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&is_told);
        caller
            .device
            .set_device_lost_callback(move |_, _| told.store(true, Ordering::Relaxed));
        let [mut fresh, mut detector] = [(); 2].map(|()| caller.detector(Settings::default()));
        let [start, end] = [(); 2].map(|()| caller.upload(&at));
        let (starts, ends) = ([(body, &start)], [(body, &end)]);
        let mut encoder = caller.encoder();
        let mut gpu = detector.gpu().expect("a device");
        let safe = gpu.encode_safe_distances(&scene, 1.0, &query, &starts, &mut encoder);
        let safe = safe.expect("good");
        gpu.encode(&scene, &query, &starts, &mut encoder)
            .expect("good");
        caller.queue.submit([encoder.finish()]);
        let mut encoder = caller.encoder();
        caller.device.destroy();
        if is_polled {
            let _ = caller.device.poll(wgpu::PollType::wait_indefinitely());
        }
        for detector in [&mut detector, &mut fresh] {
            // The first question finds out, whichever it is.
            let mut gpu = detector.gpu().expect("a device");
            is_refused("grow", gpu.grow());
            is_refused("encode", gpu.encode(&scene, &query, &[], &mut encoder));
            let step = gpu.encode_step(&scene, &query, &starts, &[], &mut encoder);
            is_refused("encode_step", step);
            let distances = gpu.encode_safe_distances(&scene, 1.0, &query, &[], &mut encoder);
            is_refused("encode_safe_distances", distances);
            let truncated = gpu.encode_truncate(&scene, &safe, &starts, &ends, &mut encoder);
            is_refused("encode_truncate", truncated);
            let [x, y, z] = at[0];
            scene
                .set_positions(body, &[[x, y, z], at[1], at[2]])
                .expect("good");
            is_refused("detect", detector.detect(&scene, &query).map(drop));
            is_refused("any", detector.any(&scene, &query));
            is_refused("impacts", detector.impacts(&scene, &query).map(drop));
            is_refused("is_free", detector.is_free(&scene, &query));
        }
        if is_polled {
            assert!(is_told.load(Ordering::Relaxed), "the caller is told");
        }
    }
}

/// Each question by itself, of a detector that has been asked before and does not know yet.
#[test]
fn a_lost_device_is_found_out_by_any_question() {
    let (scene, at) = crossed();
    let body = scene.bodies().map(|(id, _)| id).next().expect("two");
    let query = &Query::all();
    type Ask = fn(&mut Detector, &Scene, &Query, &mut wgpu::CommandEncoder) -> Result<(), Error>;
    let questions: [(&str, Ask); 7] = [
        ("grow", |detector, _, _, _| {
            detector.gpu().expect("a device").grow().map(drop)
        }),
        ("encode", |detector, scene, query, encoder| {
            let mut gpu = detector.gpu().expect("a device");
            gpu.encode(scene, query, &[], encoder).map(drop)
        }),
        ("encode_step", |detector, scene, query, encoder| {
            let mut gpu = detector.gpu().expect("a device");
            gpu.encode_step(scene, query, &[], &[], encoder).map(drop)
        }),
        (
            "encode_safe_distances",
            |detector, scene, query, encoder| {
                let mut gpu = detector.gpu().expect("a device");
                let safe = gpu.encode_safe_distances(scene, 0.5, query, &[], encoder);
                safe.map(drop)
            },
        ),
        ("detect", |detector, scene, query, _| {
            detector.detect(scene, query).map(drop)
        }),
        ("any", |detector, scene, query, _| {
            detector.any(scene, query).map(drop)
        }),
        ("impacts", |detector, scene, query, _| {
            detector.impacts(scene, query).map(drop)
        }),
    ];
    for (question, ask) in questions {
        let caller = Caller::new();
        let mut detector = caller.detector(Settings::default());
        let mut encoder = caller.encoder();
        let mut gpu = detector.gpu().expect("a device");
        gpu.encode(&scene, query, &[], &mut encoder).expect("good");
        caller.queue.submit([encoder.finish()]);
        assert!(detector.detect(&scene, query).is_ok());
        assert!(detector.impacts(&scene, query).is_ok());
        let mut encoder = caller.encoder();
        caller.device.destroy();
        let _ = caller.device.poll(wgpu::PollType::Poll);
        is_refused(question, ask(&mut detector, &scene, query, &mut encoder));
    }
    // Truncations begin nothing else.
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let [start, end] = [(); 2].map(|()| caller.upload(&at));
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    let safe = gpu.encode_safe_distances(&scene, 1.0, query, &[(body, &start)], &mut encoder);
    caller.queue.submit([encoder.finish()]);
    let mut encoder = caller.encoder();
    caller.device.destroy();
    let (starts, ends) = ([(body, &start)], [(body, &end)]);
    let truncated = gpu.encode_truncate(&scene, &safe.expect("good"), &starts, &ends, &mut encoder);
    is_refused("encode_truncate", truncated);
}

#[test]
fn the_cpu_takes_over_from_a_lost_device() {
    let (scene, _) = crossed();
    let query = Query::all();
    let caller = Caller::new();
    let settings = Settings::new().on_device(caller.device.clone(), caller.queue.clone());
    let settings = settings.backend(Backend::Auto);
    let [mut frames, mut steps] =
        [(); 2].map(|()| Detector::new(settings.clone()).expect("settings"));
    for detector in [&mut frames, &mut steps] {
        assert!(detector.impacts(&scene, &query).is_ok());
    }
    caller.device.destroy();
    let pairs = frames.detect(&scene, &query).expect("the CPU answers");
    assert_eq!((pairs.len(), &*pairs.stats().backend), (1, "cpu"));
    let impacts = steps.impacts(&scene, &query).expect("the CPU answers");
    assert_eq!(impacts.stats().backend, "cpu");
}

/// As where another thread destroys the device while the first one waits for it.
#[test]
fn a_device_that_is_lost_during_a_question_is_named() {
    let (scene, _) = crossed();
    let caller = Caller::new();
    let mut detector = caller.detector(Settings::default());
    let mut encoder = caller.encoder();
    let mut gpu = detector.gpu().expect("a device");
    gpu.encode(&scene, &Query::all(), &[], &mut encoder)
        .expect("good");
    caller.queue.submit([encoder.finish()]);
    let mut grown = pin!(gpu.grow_async());
    let mut context = Context::from_waker(Waker::noop());
    assert!(grown.as_mut().poll(&mut context).is_pending());
    caller.device.destroy();
    let _ = caller.device.poll(wgpu::PollType::wait_indefinitely());
    let Poll::Ready(Err(error)) = grown.as_mut().poll(&mut context) else {
        panic!("an error");
    };
    assert!(error.to_string().contains("device lost"), "{error}");
}

/// Nobody else can make encoders and buffers on a device that a detector has opened.
#[test]
fn nothing_is_encoded_on_a_device_of_the_detectors_own() {
    let (scene, at) = crossed();
    let body = scene.bodies().map(|(id, _)| id).next().expect("two");
    let query = Query::all();
    let caller = Caller::new();
    let mut safe = caller.detector(Settings::default());
    let mut encoder = caller.encoder();
    let mut gpu = safe.gpu().expect("a device");
    let safe = gpu.encode_safe_distances(&scene, 1.0, &query, &[], &mut encoder);
    let safe = safe.expect("good");
    let [start, end] = [(); 2].map(|()| caller.upload(&at));
    let (starts, ends) = ([(body, &start)], [(body, &end)]);
    let mut detector = Detector::new(Backend::Gpu).expect("a device");
    let mut gpu = detector.gpu().expect("a device");
    for refused in [
        gpu.encode(&scene, &query, &starts, &mut encoder).map(drop),
        gpu.encode_step(&scene, &query, &starts, &ends, &mut encoder)
            .map(drop),
        gpu.encode_safe_distances(&scene, 1.0, &query, &starts, &mut encoder)
            .map(drop),
        gpu.encode_truncate(&scene, &safe, &starts, &ends, &mut encoder),
    ] {
        let text = refused.expect_err("refused").to_string();
        assert!(text.contains("Settings::on_device"), "{text}");
    }
    assert!(gpu.grow().expect("nothing was encoded"));
    assert_eq!(detector.detect(&scene, &query).expect("good").len(), 1);
}
