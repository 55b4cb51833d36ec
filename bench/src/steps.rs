//! Steps: bodies that move from a start to an end. All contacts, the earliest one, whether there is
//! any, how far the step can be taken, and pairs of boxes, each stage by stage.
//!
//! Positions at both ends are rewritten before each frame. Every answer is held against what is
//! known of the scene: how many pairs touch, the hash of all of them with their times, the earliest
//! time.

use std::time::Instant;

use impinge::{BodyId, Detector, Positions, Query, Scene, Settings, Stats};
use serde_json::json;

use crate::report::{Report, figures, grouped};
use crate::{Failure, Options, surfaces};

/// A step from the shared data, and what is known of it.
struct Known {
    name: &'static str,
    frames: [&'static str; 2],
    n_impacts: usize,
    /// Of [`impinge::Impacts::hash`], times in `f32`.
    hash: u64,
    earliest: f64,
    n_candidates: usize,
}

const KNOWN: [Known; 2] = [
    Known {
        name: "cloth-ball",
        frames: ["cloth_ball92", "cloth_ball93"],
        n_impacts: 113_854,
        hash: 8_445_013_246_137_089_572,
        earliest: 7.492_069_016_734_604e-6,
        n_candidates: 6_852_873,
    },
    Known {
        name: "cloth-funnel",
        frames: ["227", "228"],
        n_impacts: 134,
        hash: 15_560_230_167_593_112_837,
        earliest: 0.045_232_217_758_893_97,
        n_candidates: 41_089,
    },
];

/// Questions about a step.
const QUESTIONS: [&str; 5] = ["impacts", "earliest", "is_free", "advance", "candidates"];

/// Frames before the clock counts.
const N_WARM: usize = 2;

/// The scenes that the options name.
pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let name = |known: &Known| known.name;
    surfaces::measure_each(&KNOWN, name, options, |known| {
        measure(known, options, report)
    })
}

/// A body, and where it is at both ends.
struct Moving {
    scene: Scene,
    body: BodyId,
    ends: [Positions; 2],
}

impl Moving {
    fn load(known: &Known) -> Result<Self, Failure> {
        let read = |frame| surfaces::read(&format!("ccd/{}/frames/{frame}.ply", known.name));
        let [(faces, start), (_, end)] = [read(known.frames[0])?, read(known.frames[1])?];
        let mut scene = Scene::new();
        let (body, ends) = match (start, end) {
            (impinge_io::Positions::F32(start), impinge_io::Positions::F32(end)) => {
                let body = scene.add((faces, start.clone()))?;
                (body, [start.into(), end.into()])
            }
            (impinge_io::Positions::F64(start), impinge_io::Positions::F64(end)) => {
                let body = scene.add((faces, start.clone()))?;
                (body, [start.into(), end.into()])
            }
            _ => return Err(format!("{}: two precisions", known.name).into()),
        };
        Ok(Moving { scene, body, ends })
    }

    /// Writes the positions at both ends.
    fn rewrite(&mut self) -> Result<(), Failure> {
        let [start, end] = &self.ends;
        self.scene.set_positions(self.body, start)?;
        self.scene.set_end_positions(self.body, end)?;
        Ok(())
    }
}

/// One frame's figures.
#[derive(Clone)]
struct Frame {
    ms: f64,
    /// Time on the processor, where the system says and one thread worked: other programs do not
    /// disturb it.
    cpu_ms: Option<f64>,
    stats: Stats,
    said: String,
}

fn measure(known: &Known, options: &Options, report: &mut Report) -> Result<(), Failure> {
    let mut moving = Moving::load(known)?;
    report.say(&format!(
        "### {}: {} impacts, the earliest at {}\n",
        known.name,
        grouped(known.n_impacts as u64),
        known.earliest
    ));
    report.say(
        "| question | threads | best ms | median ms | best ms on the processor | stages of the best, ms | candidates | exact | answer |\n\
         |---|---:|---:|---:|---:|---|---:|---:|---|",
    );
    let n_frames = options.frames.unwrap_or(10).max(1);
    let threads = match options.threads {
        0 => vec![1, 0],
        n => vec![n],
    };
    for question in QUESTIONS {
        for &n_threads in &threads {
            let mut detector = Detector::new(
                Settings::new()
                    .threads(n_threads)
                    .affinity(options.affinities[0])
                    .instruction_set(options.instruction_set)
                    .backend(options.backend),
            )?;
            let mut frames = Vec::new();
            for frame in 0..N_WARM + n_frames {
                moving.rewrite()?;
                let answer = ask(known, question, &mut detector, &moving.scene)?;
                if frame >= N_WARM {
                    frames.push(answer);
                }
            }
            frames.sort_by(|a, b| a.ms.total_cmp(&b.ms));
            let (best, median) = (&frames[0], frames[frames.len() / 2].ms);
            let cpu_ms = frames.iter().filter_map(|frame| frame.cpu_ms);
            let cpu_ms = cpu_ms.reduce(f64::min).filter(|_| n_threads == 1);
            let stages = best.stats.stages.iter().filter(|stage| stage.ms >= 0.01);
            let stages: Vec<_> = stages
                .map(|stage| format!("{} {}", stage.name, figures(stage.ms)))
                .collect();
            report.say(&format!(
                "| `{question}` | {} | {} | {} | {} | {} | {} | {} | {} |",
                best.stats.n_threads,
                figures(best.ms),
                figures(median),
                cpu_ms.map_or(String::new(), figures),
                stages.join(", "),
                grouped(best.stats.n_candidates),
                grouped(best.stats.n_unsure),
                best.said
            ));
            report.keep_json(json!({
                "scene": known.name,
                "question": question,
                "threads": best.stats.n_threads,
                "frames": n_frames,
                "min_ms": best.ms,
                "median_ms": median,
                "min_cpu_ms": cpu_ms,
                "stages": best.stats.stages.iter()
                    .map(|stage| (stage.name.to_string(), json!(stage.ms)))
                    .collect::<serde_json::Map<_, _>>(),
                "candidates": best.stats.n_candidates,
                "unsure": best.stats.n_unsure,
                "bytes_held": best.stats.bytes_held,
            }));
        }
    }
    report.say("");
    Ok(())
}

/// Asks once; an answer that is not the known one is an error.
fn ask(
    known: &Known,
    question: &str,
    detector: &mut Detector,
    scene: &Scene,
) -> Result<Frame, Failure> {
    let query = Query::all();
    let (start, cpu_start) = (Instant::now(), on_processor_ms());
    let (said, is_right) = match question {
        "impacts" => {
            let impacts = detector.impacts(scene, &query)?;
            let (ms, cpu) = (start.elapsed(), cpu_start);
            let cpu_ms = on_processor_ms().zip(cpu).map(|(end, start)| end - start);
            // The hash is not on the clock.
            let is_right = impacts.len() == known.n_impacts && impacts.hash() == known.hash;
            if !is_right {
                return Err(wrong(known, question, &impacts.len().to_string()));
            }
            return Ok(Frame {
                ms: ms.as_secs_f64() * 1e3,
                cpu_ms,
                stats: impacts.stats().clone(),
                said: format!("{} impacts", grouped(impacts.len() as u64)),
            });
        }
        "earliest" => {
            let toi = detector.earliest(scene, &query)?.map(|impact| impact.toi);
            let said = toi.map_or("none".to_owned(), |toi| format!("{toi:e}"));
            (said, toi == Some(known.earliest))
        }
        "is_free" => {
            let is_free = detector.is_free(scene, &query)?;
            (is_free.to_string(), !is_free)
        }
        "advance" => {
            let advance = detector.advance(scene, &query)?;
            let said = format!(
                "{:e} of the step, {} tried",
                advance.fraction, advance.n_tried
            );
            let first = advance.first.map_or(1.0, |first| first.toi);
            let is_right = advance.fraction > 0.9 * first && advance.fraction <= first;
            (said, is_right)
        }
        _ => {
            let candidates = detector.candidates(scene, 0.0, &query)?;
            let n = candidates.len();
            (grouped(n as u64), n == known.n_candidates)
        }
    };
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let cpu_ms = on_processor_ms()
        .zip(cpu_start)
        .map(|(end, start)| end - start);
    if !is_right {
        return Err(wrong(known, question, &said));
    }
    Ok(Frame {
        ms,
        cpu_ms,
        stats: detector.stats().clone(),
        said,
    })
}

fn wrong(known: &Known, question: &str, said: &str) -> Failure {
    format!("{}: {question} says {said}, which is wrong", known.name).into()
}

/// How long this thread has been on a processor.
fn on_processor_ms() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-6)
}
