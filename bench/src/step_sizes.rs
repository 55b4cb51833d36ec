//! Steps of cloth of 10^3 to 10^6 faces: the cost of each question against the size, and the memory
//! that a detector holds.
//!
//! Two layers of waving cloth, most of an edge length apart. Waves run through them in opposite
//! directions, about an edge length in a step, so that impacts, like faces, grow with the square of
//! the resolution. Answers are held against each other: the earliest impact is the first of all
//! impacts, a step with impacts is not free, and all impacts are among the candidates.

use std::time::Instant;

use impinge::{BodyId, Detector, Method, Query, Scene};
use impinge_scenes::deform::{Deform, Wave};
use impinge_scenes::surfaces;
use serde_json::json;

use crate::report::{Report, figures, grouped};
use crate::{Failure, Options};

/// Faces of both layers.
const SIZES: [usize; 7] = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000];
/// Without the candidates, which come last.
const QUESTIONS: [&str; 3] = ["earliest", "is_free", "advance"];
/// Frames before the clock counts.
const N_WARM: usize = 2;

/// Two layers, and where their vertices are at both ends.
pub struct Layers {
    pub scene: Scene,
    bodies: [BodyId; 2],
    ends: [[Vec<[f32; 3]>; 2]; 2],
    pub n_faces: usize,
    n_elements: usize,
    /// The length of an edge at rest.
    pub edge: f64,
}

impl Layers {
    pub fn new(n_faces: usize) -> Result<Self, Failure> {
        // Two layers of squares, each cut into two faces.
        let n = ((n_faces as f64 / 4.0).sqrt().round() as usize).max(1);
        let edge = 1.0 / n as f32;
        let rest = surfaces::cloth(n, n, edge);
        let turn = [0.6, 0.8, 0.0];
        let wave = |speed: f32| Wave {
            amplitude: 0.03,
            wave_length: 0.37,
            speed,
            travel: turn,
            ..Wave::default()
        };
        // Vertices of a wave move by up to 2 pi amplitude / wave_length of what it travels.
        let speeds = [edge, -edge];
        let mut scene = Scene::new();
        let mut bodies = Vec::new();
        let mut ends = Vec::new();
        for (speed, height) in speeds.into_iter().zip([0.0, 0.7 * edge]) {
            let model = rest.translated([0.13 * height, 0.29 * height, height]);
            let mut moved = [model.positions.clone(), model.positions.clone()];
            for (positions, time) in moved.iter_mut().zip([0.0, 1.0]) {
                wave(speed).apply(&model.positions, time, positions);
            }
            bodies.push(model.add_to(&mut scene)?);
            ends.push(moved);
        }
        let [n_vertices, n_edges, n_faces] = [(n + 1) * (n + 1), n * (3 * n + 2), 2 * n * n];
        let (Ok(bodies), Ok(ends)) = (bodies.try_into(), ends.try_into()) else {
            return Err("two layers".into());
        };
        Ok(Layers {
            scene,
            bodies,
            ends,
            n_faces: 2 * n_faces,
            n_elements: 2 * (n_vertices + n_edges + n_faces),
            edge: edge.into(),
        })
    }

    fn rewrite(&mut self) -> Result<(), Failure> {
        for (body, [start, end]) in self.bodies.iter().zip(&self.ends) {
            self.scene.set_positions(*body, start)?;
            self.scene.set_end_positions(*body, end)?;
        }
        Ok(())
    }
}

/// The best of some frames of one question, in milliseconds, and what the last one answered.
pub fn best<T>(
    layers: &mut Layers,
    n_frames: usize,
    mut ask: impl FnMut(&Scene) -> Result<T, Failure>,
) -> Result<(f64, T), Failure> {
    let mut best_ms = f64::INFINITY;
    let mut frame = 0;
    loop {
        layers.rewrite()?;
        let start = Instant::now();
        let answer = ask(&layers.scene)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        frame += 1;
        if frame > N_WARM {
            best_ms = best_ms.min(ms);
        }
        if frame == N_WARM + n_frames {
            return Ok((best_ms, answer));
        }
    }
}

pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let mut header = "| faces | impacts | candidates | `impacts` ms | ns per face |".to_owned();
    for question in QUESTIONS {
        header += &format!(" `{question}` ms | ns per face |");
    }
    header += " `candidates` ms | ns per candidate | bytes per element, `impacts` | without its answer | bytes per element, `candidates` |";
    each_size(header, options, report, measure)
}

/// A table of all sizes up to the one that the options name.
pub fn each_size(
    header: String,
    options: &Options,
    report: &mut Report,
    measure: impl Fn(Layers, &Options, &mut Report) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let n_columns = header.matches('|').count() - 1;
    report.say(&format!("{header}\n{}|", "|---:".repeat(n_columns)));
    for n_faces in SIZES {
        if options.size.is_none_or(|largest| n_faces <= largest) {
            measure(Layers::new(n_faces)?, options, report)?;
        }
    }
    report.say("");
    Ok(())
}

fn measure(mut layers: Layers, options: &Options, report: &mut Report) -> Result<(), Failure> {
    let default = (3_000_000 / layers.n_faces).clamp(5, 100);
    let n_frames = options.frames.unwrap_or(default).max(1);
    let detector = || Detector::new(options.settings(Method::Auto));
    let query = Query::all();
    let n_faces = layers.n_faces as f64;
    let n_elements = layers.n_elements as f64;

    let mut all = detector()?;
    let (impacts_ms, (impacts, first, bytes)) = best(&mut layers, n_frames, |scene| {
        let impacts = all.impacts(scene, &query)?;
        Ok((
            impacts.len(),
            impacts.earliest(),
            impacts.stats().bytes_held,
        ))
    })?;
    let answer_bytes = impacts * size_of::<impinge::Impact>();
    let mut line = format!(
        "| {} | {} |",
        grouped(layers.n_faces as u64),
        grouped(impacts as u64)
    );
    let mut columns = String::new();
    let mut of_questions = serde_json::Map::new();
    let mut add = |question: &str, ms: f64| {
        columns += &format!(" {} | {:.0} |", figures(ms), 1e6 * ms / n_faces);
        of_questions.insert(question.to_owned(), json!(ms));
    };
    add("impacts", impacts_ms);
    drop(all);
    for question in QUESTIONS {
        let mut detector = detector()?;
        let (ms, is_right) = best(&mut layers, n_frames, |scene| {
            Ok(match question {
                "earliest" => detector.earliest(scene, &query)? == first,
                "is_free" => detector.is_free(scene, &query)? == first.is_none(),
                _ => {
                    let fraction = detector.advance(scene, &query)?.fraction;
                    // The time is an f32 rounded down; the fraction is an f64.
                    let most = first.map_or(1.0, |first| (first.toi as f32).next_up().into());
                    fraction <= most
                }
            })
        })?;
        if !is_right {
            return Err(format!("{n_faces} faces: {question} contradicts the impacts").into());
        }
        add(question, ms);
    }

    let mut boxes = detector()?;
    let (ms, (n_candidates, candidate_bytes)) = best(&mut layers, n_frames, |scene| {
        let candidates = boxes.candidates(scene, 0.0, &query)?;
        Ok((candidates.len(), candidates.stats().bytes_held))
    })?;
    if n_candidates < impacts {
        return Err(format!("{n_faces} faces: fewer candidates than impacts").into());
    }
    line += &format!(" {} |", grouped(n_candidates as u64));
    let per_element = [
        bytes as f64,
        bytes.saturating_sub(answer_bytes as u64) as f64,
        candidate_bytes as f64,
    ]
    .map(|bytes| bytes / n_elements);
    line += &columns;
    line += &format!(
        " {} | {:.1} | {:.0} | {:.0} | {:.0} |",
        figures(ms),
        1e6 * ms / (n_candidates as f64).max(1.0),
        per_element[0],
        per_element[1],
        per_element[2]
    );
    report.say(&line);
    of_questions.insert("candidates".to_owned(), json!(ms));
    report.keep_json(json!({
        "faces": layers.n_faces,
        "elements": layers.n_elements,
        "frames": n_frames,
        "impacts": impacts,
        "candidates": n_candidates,
        "min_ms": of_questions,
        "bytes_impacts": bytes,
        "bytes_candidates": candidate_bytes,
    }));
    Ok(())
}
