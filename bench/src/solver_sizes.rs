//! What a penetration-free solver asks, against the size: safe distances, truncation and lists of
//! neighbours of cloth of 10^3 to 10^6 faces.
//!
//! The scenes are those of [`step_sizes`](crate::step_sizes): two layers of waving cloth, most of an
//! edge length apart. Pairs within a ring of the surface are left out. What is allowed is asked
//! about, too: the way to truncated positions is free, and as many pairs are listed as are near.

use impinge::{Detector, Exclusion, Method, Query, Scene};
use serde_json::json;

use crate::report::{Report, figures, grouped};
use crate::step_sizes::{Layers, best, each_size};
use crate::{Failure, Options};

/// The most that a vertex may move, and half of how far lists reach, in edge lengths.
const MOST: f64 = 0.5;

pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let mut header =
        "| faces | near pairs | cut vertices | rounds | `near` ms | ns per face |".to_owned();
    for question in ["safe_distances", "neighbours", "impacts", "truncate"] {
        header += &format!(" `{question}` ms | ns per face |");
    }
    each_size(header, options, report, measure)
}

fn measure(mut layers: Layers, options: &Options, report: &mut Report) -> Result<(), Failure> {
    let default = (1_000_000 / layers.n_faces).clamp(3, 50);
    let n_frames = options.frames.unwrap_or(default).max(1);
    let query = Query::all().exclude(Exclusion::rings(1));
    let n_faces = layers.n_faces as f64;
    let most = MOST * layers.edge;

    let mut columns = String::new();
    let mut of_questions = serde_json::Map::new();
    let mut add = |question: &str, ms: f64| {
        columns += &format!(" {} | {:.0} |", figures(ms), 1e6 * ms / n_faces);
        of_questions.insert(question.to_owned(), json!(ms));
    };
    // How many pairs are near, touch, are listed, and meet.
    type Count = fn(&mut Detector, &Scene, f64, &Query) -> Result<usize, impinge::Error>;
    let counts: [(&str, Count); 4] = [
        ("near", |by, scene, most, query| {
            Ok(by.near(scene, 2.0 * most, query)?.len())
        }),
        ("safe_distances", |by, scene, most, query| {
            Ok(by.safe_distances(scene, most, query)?.touching().len())
        }),
        ("neighbours", |by, scene, most, query| {
            Ok(by.neighbours(scene, 2.0 * most, query)?.len())
        }),
        ("impacts", |by, scene, _, query| {
            Ok(by.impacts(scene, query)?.len())
        }),
    ];
    let mut found = [0; 4];
    for (found, (question, count)) in found.iter_mut().zip(counts) {
        let mut by = Detector::new(options.settings(Method::Auto))?;
        let ms;
        (ms, *found) = best(&mut layers, n_frames, |scene| {
            Ok(count(&mut by, scene, most, &query)?)
        })?;
        add(question, ms);
    }
    let [n_near, n_touching, n_listed, _] = found;
    if n_listed > n_near || n_touching > 0 {
        return Err(format!("{n_faces} faces: {n_listed} listed, {n_near} near").into());
    }
    let mut stops = Detector::new(options.settings(Method::Auto))?;
    let (ms, truncation) = best(&mut layers, n_frames, |scene| {
        Ok(stops.truncate(scene, &query)?)
    })?;
    add("truncate", ms);
    for (body, at) in truncation.iter() {
        layers.scene.set_end_positions(body, at)?;
    }
    if !stops.is_free(&layers.scene, &query)? {
        return Err(format!("{n_faces} faces: the truncated step is not free").into());
    }
    report.say(&format!(
        "| {} | {} | {} | {} |{columns}",
        grouped(layers.n_faces as u64),
        grouped(n_near as u64),
        grouped(truncation.n_cut()),
        truncation.rounds(),
    ));
    report.keep_json(json!({
        "faces": layers.n_faces,
        "frames": n_frames,
        "near": n_near,
        "cut": truncation.n_cut(),
        "rounds": truncation.rounds(),
        "min_ms": of_questions,
    }));
    Ok(())
}
