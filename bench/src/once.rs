//! One question, once: how long the first frame of a new detector takes, by each method. Detectors
//! are made off the clock.

use std::time::Instant;

use impinge::{Detector, Method};
use impinge_scenes::{adversarial, surfaces};
use serde_json::json;

use crate::gpu::median;
use crate::problem::{Ask, Problem, models, posed};
use crate::report::{Report, figures, grouped};
use crate::{Failure, Options, files};

/// In the order of the table.
const METHODS: [Method; 3] = [Method::Auto, Method::Clusters, Method::Cells];

/// The scenes of `two-body` and `self`, many bodies, and scenes that crowd the cells of a grid.
pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let meshes = ["ball", "bunny", "buddha", "dragon"];
    let meshes: Vec<&str> = match &options.scene {
        Some(scene) => vec![scene],
        None => meshes.to_vec(),
    };
    report.say(
        "Medians of first frames: each is of a new detector.\n\n\
         | scene | elements | pairs | auto ms | answered by | clusters ms | cells ms | clusters / auto |\n\
         |---|---:|---:|---:|---|---:|---:|---:|",
    );
    for scene in &meshes {
        measure(&files::two_body(scene)?, options, report)?;
    }
    for scene in &meshes {
        let mut problem = files::within(scene)?;
        problem.name += ", self";
        measure(&problem, options, report)?;
    }
    if options.scene.is_some() {
        return Ok(());
    }
    for n_bodies in [1_000, 100_000] {
        let name = format!("{} bodies", grouped(n_bodies as u64));
        let cubes = models(adversarial::boxes(n_bodies, 1)?)?;
        measure(&Problem::mirrored(&name, cubes, Ask::All), options, report)?;
    }
    let balls = (0..100).map(|ix| {
        let [x, y] = [ix % 10, ix / 10].map(|at| 0.85 * at as f32);
        surfaces::ball(10_000).translated([x, y, 0.0])
    });
    let balls = Problem::mirrored("100 balls", balls.collect(), Ask::All);
    measure(&balls, options, report)?;
    let size = options.size.unwrap_or(200_000);
    for entry in adversarial::SCENES {
        let built = (entry.build)(size.min(entry.max_n))?;
        measure(&posed(built, entry.probes)?, options, report)?;
    }
    Ok(())
}

fn measure(problem: &Problem, options: &Options, report: &mut Report) -> Result<(), Failure> {
    let (scene, _, query) = problem.scene()?;
    let n_frames = options.frames.unwrap_or(7).max(1);
    let mut ms = METHODS.map(|_| Vec::new());
    let mut answers = Vec::new();
    let mut answered_by = "";
    for _ in 0..n_frames {
        for (method, ms) in METHODS.into_iter().zip(&mut ms) {
            let mut detector = Detector::new(options.settings(method))?;
            let start = Instant::now();
            let pairs = detector.detect(&scene, &query)?;
            ms.push(start.elapsed().as_secs_f64() * 1e3);
            answers.push((pairs.len() as u64, pairs.hash()));
            if method == Method::Auto {
                answered_by = pairs.stats().method;
            }
        }
    }
    let (n_pairs, _) = answers[0];
    if answers.iter().any(|answer| *answer != answers[0]) {
        return Err(format!("{}: the methods disagree: {answers:?}", problem.name).into());
    }
    if problem.expected.is_some_and(|expected| expected != n_pairs) {
        return Err(format!(
            "{}: {n_pairs} pairs, {:?} expected",
            problem.name, problem.expected
        )
        .into());
    }
    let [auto, clusters, cells] = ms.map(|ms: Vec<f64>| median(ms.into_iter()));
    report.say(&format!(
        "| {} | {} | {} | {} | {answered_by} | {} | {} | {:.1} |",
        problem.name,
        grouped(problem.n_elements() as u64),
        grouped(n_pairs),
        figures(auto),
        figures(clusters),
        figures(cells),
        clusters / auto,
    ));
    report.keep_json(json!({
        "scene": problem.name,
        "elements": problem.n_elements(),
        "pairs": n_pairs,
        "frames": n_frames,
        "answered_by": answered_by,
        "auto_ms": auto,
        "clusters_ms": clusters,
        "cells_ms": cells,
    }));
    Ok(())
}
