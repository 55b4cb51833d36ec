//! Frames of all contestants, interleaved, so that each meets the same weather.

use serde_json::json;

use crate::Failure;
use crate::problem::Problem;
use crate::runner::Runner;

/// Frames that are run before the clock counts, of either pose half of them.
const N_WARM: usize = 4;

/// One contestant's figures on one problem.
#[derive(Debug, Clone)]
pub struct Row {
    /// The contestant.
    pub name: String,
    /// Its settings.
    pub setting: String,
    /// Median over frames, milliseconds.
    pub median_ms: f64,
    /// Fastest frame, milliseconds.
    pub min_ms: f64,
    /// The very first frame, which builds what later frames reuse.
    pub first_ms: f64,
    /// Pairs found in the first pose.
    pub n_pairs: u64,
    /// Counts, bytes, stages.
    pub details: serde_json::Value,
}

/// All figures on one problem. The first row is the one that others are compared with.
#[derive(Debug, Clone)]
pub struct Table {
    /// The problem's name.
    pub name: String,
    /// What it is.
    pub about: String,
    /// Primitives of all bodies.
    pub n_primitives: usize,
    /// Bodies.
    pub n_bodies: usize,
    /// Timed frames.
    pub n_frames: usize,
    /// One row a contestant.
    pub rows: Vec<Row>,
}

impl Table {
    /// For machines.
    pub fn json(&self) -> serde_json::Value {
        let rows: Vec<_> = self
            .rows
            .iter()
            .map(|row| {
                json!({
                    "name": row.name,
                    "setting": row.setting,
                    "median_ms": row.median_ms,
                    "min_ms": row.min_ms,
                    "first_ms": row.first_ms,
                    "ratio": row.median_ms / self.rows[0].median_ms,
                    "pairs": row.n_pairs,
                    "details": row.details,
                })
            })
            .collect();
        json!({
            "name": self.name,
            "about": self.about,
            "primitives": self.n_primitives,
            "bodies": self.n_bodies,
            "frames": self.n_frames,
            "rows": rows,
        })
    }
}

/// Runs `n_frames` timed frames of every contestant, turn by turn.
///
/// # Errors
/// A contestant fails; an exact one does not find the expected number of pairs, another number in another
/// frame of the same pose, or other pairs than another exact one.
pub fn run(
    problem: &Problem,
    mut runners: Vec<Box<dyn Runner>>,
    n_frames: usize,
) -> Result<Table, Failure> {
    let mut times = vec![Vec::with_capacity(n_frames); runners.len()];
    let mut first_ms = vec![0.0; runners.len()];
    let mut n_pairs = vec![[None::<u64>; 2]; runners.len()];
    let mut hashes: [Option<(u64, String)>; 2] = [None, None];
    for frame in 0..N_WARM + n_frames.max(1) {
        let pose = frame % 2;
        for (ix, runner) in runners.iter_mut().enumerate() {
            runner.load(problem, pose)?;
            let answer = runner.frame(frame < N_WARM)?;
            if frame == 0 {
                first_ms[ix] = answer.ms;
            }
            if frame >= N_WARM {
                times[ix].push(answer.ms);
            }
            let seen = n_pairs[ix][pose].get_or_insert(answer.n_pairs);
            let name = runner.name();
            if *seen != answer.n_pairs {
                return Err(format!(
                    "{}: {name} found {} pairs in frame {frame} and {seen} in the same pose before",
                    problem.name, answer.n_pairs
                )
                .into());
            }
            let Some(hash) = answer.hash else { continue };
            if let Some(expected) = problem.expected.filter(|&n| n != answer.n_pairs) {
                return Err(format!(
                    "{}: {name} found {} pairs, {expected} are right",
                    problem.name, answer.n_pairs
                )
                .into());
            }
            match &hashes[pose] {
                Some((other, whose)) if *other != hash => {
                    return Err(format!(
                        "{}: {name} and {whose} differ in their pairs",
                        problem.name
                    )
                    .into());
                }
                Some(_) => {}
                None => hashes[pose] = Some((hash, name)),
            }
        }
    }
    let rows = runners
        .iter()
        .zip(times)
        .enumerate()
        .map(|(ix, (runner, mut times))| {
            times.sort_by(f64::total_cmp);
            Row {
                name: runner.name(),
                setting: runner.setting(),
                median_ms: times[times.len() / 2],
                min_ms: times[0],
                first_ms: first_ms[ix],
                n_pairs: n_pairs[ix][0].unwrap_or(0),
                details: runner.details(),
            }
        })
        .collect();
    Ok(Table {
        name: problem.name.clone(),
        about: problem.about.clone(),
        n_primitives: problem.n_primitives(),
        n_bodies: problem.bodies.len(),
        n_frames: n_frames.max(1),
        rows,
    })
}
