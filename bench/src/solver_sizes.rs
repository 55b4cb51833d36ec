//! What a penetration-free solver asks, against the size: safe distances, truncation and lists of
//! neighbours of cloth of 10^3 to 10^6 faces.
//!
//! The scenes are those of [`step_sizes`](crate::step_sizes): two layers of waving cloth, most of an
//! edge length apart. Pairs within a ring of the surface are left out. What is allowed is asked
//! about, too: the way to truncated positions is free, and as many pairs are listed as are near.

use impinge::{Detector, Exclusion, Positions, Query, Settings};
use serde_json::json;

use crate::report::{Report, figures, grouped};
use crate::step_sizes::{Layers, SIZES, best};
use crate::{Failure, Options};

/// The most that a vertex may move, and half of how far lists reach, in edge lengths.
const MOST: f64 = 0.5;

/// All sizes up to the one that the options name.
pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let mut header =
        "| faces | near pairs | cut vertices | rounds | `near` ms | ns per face |".to_owned();
    for question in ["safe_distances", "neighbours", "impacts", "truncate"] {
        header += &format!(" `{question}` ms | ns per face |");
    }
    header += "\n";
    header += &"|---:".repeat(14);
    report.say(&(header + "|"));
    for n_faces in SIZES {
        if options.size.is_none_or(|largest| n_faces <= largest) {
            measure(Layers::new(n_faces)?, options, report)?;
        }
    }
    report.say("");
    Ok(())
}

fn measure(mut layers: Layers, options: &Options, report: &mut Report) -> Result<(), Failure> {
    let default = (1_000_000 / layers.n_faces).clamp(3, 50);
    let n_frames = options.frames.unwrap_or(default).max(1);
    let settings = Settings::new()
        .threads(options.threads)
        .affinity(options.affinities[0])
        .instruction_set(options.instruction_set)
        .backend(options.backend);
    let detector = || Detector::new(settings.clone());
    let query = Query::all().exclude(Exclusion::rings(1));
    let n_faces = layers.n_faces as f64;
    let most = MOST * layers.edge;

    let mut columns = String::new();
    let mut of_questions = serde_json::Map::new();
    let mut add = |question: &str, ms: f64| {
        columns += &format!(" {} | {:.0} |", figures(ms), 1e6 * ms / n_faces);
        of_questions.insert(question.to_owned(), json!(ms));
    };
    let mut near = detector()?;
    let (ms, n_near) = best(&mut layers, n_frames, |scene| {
        Ok(near.near(scene, 2.0 * most, &query)?.len())
    })?;
    add("near", ms);
    drop(near);
    let mut safe = detector()?;
    let (ms, n_touching) = best(&mut layers, n_frames, |scene| {
        Ok(safe.safe_distances(scene, most, &query)?.touching().len())
    })?;
    add("safe_distances", ms);
    drop(safe);
    let mut lists = detector()?;
    let (ms, n_listed) = best(&mut layers, n_frames, |scene| {
        Ok(lists.neighbours(scene, 2.0 * most, &query)?.len())
    })?;
    add("neighbours", ms);
    drop(lists);
    if n_listed > n_near || n_touching > 0 {
        return Err(format!("{n_faces} faces: {n_listed} listed, {n_near} near").into());
    }
    let mut impacts = detector()?;
    let (ms, _) = best(&mut layers, n_frames, |scene| {
        Ok(impacts.impacts(scene, &query)?.len())
    })?;
    add("impacts", ms);
    drop(impacts);
    let mut stops = detector()?;
    let (ms, truncation) = best(&mut layers, n_frames, |scene| {
        Ok(stops.truncate(scene, &query)?)
    })?;
    add("truncate", ms);
    for (body, at) in truncation.iter() {
        if let Positions::F32(at) = at {
            layers.scene.set_end_positions(body, at)?;
        }
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
