//! Runs frames of all contestants in turns, so that all meet the same conditions.
//!
//! A turn is a few frames of one contestant. With one frame per turn, each contestant starts with
//! cold caches and sleeping threads. With ten, nine frames run under the conditions of a program
//! that uses only this contestant.

use std::time::Duration;

use serde_json::json;

use crate::Failure;
use crate::problem::Problem;
use crate::runner::{Answer, Runner};

/// Untimed frames before the timed ones; more if there are more poses, because answers are verified
/// in these frames.
const N_WARM: usize = 4;

/// The pause between two turns.
const PAUSE: Duration = Duration::from_millis(2);

/// One contestant's figures on one problem.
#[derive(Debug, Clone)]
pub struct Row {
    /// The contestant.
    pub name: String,
    /// Its settings.
    pub setting: String,
    /// Median over frames, milliseconds.
    pub median_ms: f64,
    /// Mean over frames, milliseconds.
    pub mean_ms: f64,
    /// Fastest frame, milliseconds.
    pub min_ms: f64,
    /// The very first frame, which builds what later frames reuse.
    pub first_ms: f64,
    /// Pairs found in the first pose.
    pub n_pairs: u64,
    /// Counts, bytes, stages.
    pub details: serde_json::Value,
}

/// All figures on one problem. The other rows are compared with the first one.
#[derive(Debug, Clone)]
pub struct Table {
    /// The problem's name.
    pub name: String,
    /// A description.
    pub about: String,
    /// The number of elements in all bodies.
    pub n_elements: usize,
    /// The number of bodies.
    pub n_bodies: usize,
    /// The number of timed frames.
    pub n_frames: usize,
    /// The number of frames per turn.
    pub turn: usize,
    /// One row per contestant.
    pub rows: Vec<Row>,
}

impl Table {
    /// The table as JSON.
    pub fn json(&self) -> serde_json::Value {
        let rows: Vec<_> = self
            .rows
            .iter()
            .map(|row| {
                json!({
                    "name": row.name,
                    "setting": row.setting,
                    "median_ms": row.median_ms,
                    "mean_ms": row.mean_ms,
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
            "elements": self.n_elements,
            "bodies": self.n_bodies,
            "frames": self.n_frames,
            "turn": self.turn,
            "rows": rows,
        })
    }
}

/// Runs `n_frames` timed frames of every contestant, `turn` of them in a row.
///
/// # Errors
/// A contestant fails; an exact contestant does not find the expected number of pairs, finds
/// another number in another frame of the same pose, or finds other pairs than another exact
/// contestant.
pub fn run(
    problem: &Problem,
    mut runners: Vec<Box<dyn Runner>>,
    n_frames: usize,
    turn: usize,
) -> Result<Table, Failure> {
    let (n_frames, turn) = (n_frames.max(1), turn.max(1));
    let n_poses = problem.n_poses();
    let n_warm = N_WARM.max(n_poses);
    let mut records: Vec<Record> = runners.iter().map(|_| Record::new(n_poses)).collect();
    let mut hashes = vec![None; n_poses];
    let timed = (0..n_frames).step_by(turn).map(|from| {
        let to = (from + turn).min(n_frames);
        n_warm + from..n_warm + to
    });
    for frames in std::iter::once(0..n_warm).chain(timed) {
        for (runner, record) in runners.iter_mut().zip(&mut records) {
            // Idle workers of the previous contestant spin for a while: let them fall asleep.
            std::thread::sleep(PAUSE);
            for frame in frames.clone() {
                let (pose, is_warm) = (frame % n_poses, frame < n_warm);
                runner.load(problem, pose)?;
                let answer = runner.frame(is_warm)?;
                record.add(frame, pose, !is_warm, &answer);
                let seen = record.n_pairs[pose];
                check(
                    problem,
                    &runner.name(),
                    frame,
                    &answer,
                    seen,
                    &mut hashes[pose],
                )?;
            }
        }
    }
    let rows = runners
        .iter()
        .zip(records)
        .map(|(runner, mut record)| {
            record.times.sort_by(f64::total_cmp);
            Row {
                name: runner.name(),
                setting: runner.setting(),
                median_ms: record.times[record.times.len() / 2],
                mean_ms: record.times.iter().sum::<f64>() / record.times.len() as f64,
                min_ms: record.times[0],
                first_ms: record.first_ms,
                n_pairs: record.n_pairs[0].unwrap_or(0),
                details: runner.details(),
            }
        })
        .collect();
    Ok(Table {
        name: problem.name.clone(),
        about: problem.about.clone(),
        n_elements: problem.n_elements(),
        n_bodies: problem.bodies.len(),
        n_frames,
        turn,
        rows,
    })
}

/// The results of one contestant so far.
#[derive(Debug)]
struct Record {
    times: Vec<f64>,
    first_ms: f64,
    /// The number of pairs in each pose; `None` for a pose that has not been run.
    n_pairs: Vec<Option<u64>>,
}

impl Record {
    fn new(n_poses: usize) -> Record {
        Record {
            times: Vec::new(),
            first_ms: 0.0,
            n_pairs: vec![None; n_poses],
        }
    }

    fn add(&mut self, frame: usize, pose: usize, is_timed: bool, answer: &Answer) {
        if frame == 0 {
            self.first_ms = answer.ms;
        }
        if is_timed {
            self.times.push(answer.ms);
        }
        self.n_pairs[pose].get_or_insert(answer.n_pairs);
    }
}

/// Checks an answer against what is known about its pose: the number of pairs that the contestant
/// has found before, and the agreed hash with the contestant that gave it first.
fn check(
    problem: &Problem,
    name: &str,
    frame: usize,
    answer: &Answer,
    seen: Option<u64>,
    agreed: &mut Option<(u64, String)>,
) -> Result<(), Failure> {
    if let Some(seen) = seen.filter(|&seen| seen != answer.n_pairs) {
        return Err(format!(
            "{}: {name} found {} pairs in frame {frame} and {seen} in the same pose before",
            problem.name, answer.n_pairs
        )
        .into());
    }
    let Some(hash) = answer.hash else {
        return Ok(());
    };
    // Later frames are compared with these by the number of pairs.
    if let Some(expected) = problem.expected.filter(|&n| n != answer.n_pairs) {
        return Err(format!(
            "{}: {name} found {} pairs, {expected} expected",
            problem.name, answer.n_pairs
        )
        .into());
    }
    match agreed {
        Some((other, whose)) if *other != hash => {
            Err(format!("{}: {name} and {whose} differ in their pairs", problem.name).into())
        }
        Some(_) => Ok(()),
        None => {
            *agreed = Some((hash, name.to_owned()));
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ours::{Feed, Ours};
    use crate::problem::Ask;
    use impinge::{Backend, Method, Settings};
    use impinge_scenes::{Model, adversarial, solids, surfaces};

    fn ours(problem: &Problem, method: Method, feed: Feed) -> Box<dyn Runner> {
        let settings = Settings::new().method(method).backend(Backend::Cpu);
        Box::new(Ours::new(problem, settings, feed).expect("a valid problem"))
    }

    /// Problems of all kinds, small enough for the oracle, in general position.
    fn problems() -> Vec<Problem> {
        let pair = |model: Model, offset| {
            let moved = model.translated(offset);
            vec![model, moved]
        };
        let balls = pair(surfaces::ball(2_000), [0.7, 0.01, 0.02]);
        let solids = pair(solids::solid_ball(1_000), [0.6, 0.011, 0.017]);
        let cubes = crate::problem::models(adversarial::boxes(100, 1).expect("valid"));
        // A wave that moves vertices along its own travel folds the knot into itself.
        let fold = impinge_scenes::deform::Wave {
            amplitude: 0.1,
            displacement: [0.8, 0.6, 0.0],
            ..Default::default()
        };
        let knot = vec![surfaces::stand_in(2_000)];
        vec![
            Problem::mirrored("balls", balls, Ask::Between),
            Problem::mirrored("solids", solids, Ask::Between),
            Problem::mirrored("cubes", cubes.expect("valid"), Ask::All),
            Problem::moving("knot", knot, Ask::Within, &fold, [1.0, 1.1]),
        ]
    }

    #[test]
    fn all_contestants_find_the_pairs_of_the_oracle() {
        for problem in problems() {
            let mut runners = vec![
                ours(&problem, Method::Naive, Feed::InPlace),
                ours(&problem, Method::Clusters, Feed::InPlace),
                ours(&problem, Method::Clusters, Feed::Copied),
                ours(&problem, Method::Cells, Feed::InPlace),
            ];
            #[cfg(feature = "embree")]
            runners.push(crate::embree::tuned(&problem, None).expect("Embree runs").0);
            #[cfg(feature = "parry")]
            runners.push(crate::parry::tuned(&problem, None).expect("parry runs").0);
            // `run` compares the library's own methods with each other; peers are compared here.
            let table = run(&problem, std::mem::take(&mut runners), 2, 1).expect("they agree");
            let oracle = &table.rows[0];
            assert!(oracle.n_pairs > 50, "{}: {}", problem.name, oracle.n_pairs);
            for row in &table.rows {
                assert_eq!(
                    row.n_pairs, oracle.n_pairs,
                    "{}: {}",
                    problem.name, row.name
                );
            }
        }
    }

    /// A contestant that answers well and then changes its answer.
    struct Liar {
        honest: Box<dyn Runner>,
        change: fn(&mut Answer),
    }

    impl Runner for Liar {
        fn name(&self) -> String {
            "liar".to_owned()
        }
        fn setting(&self) -> String {
            String::new()
        }
        fn load(&mut self, problem: &Problem, pose: usize) -> Result<(), Failure> {
            self.honest.load(problem, pose)
        }
        fn frame(&mut self, verify: bool) -> Result<Answer, Failure> {
            let mut answer = self.honest.frame(verify)?;
            (self.change)(&mut answer);
            Ok(answer)
        }
    }

    #[test]
    fn lies_are_caught() {
        let problem = problems().swap_remove(0);
        let table = run(
            &problem,
            vec![ours(&problem, Method::Naive, Feed::InPlace)],
            1,
            1,
        );
        let n_pairs = table.expect("the oracle answers").rows[0].n_pairs;
        let problem = problem.expecting(Some(n_pairs));
        let contest = |change: fn(&mut Answer)| {
            let liar = Liar {
                honest: ours(&problem, Method::Clusters, Feed::InPlace),
                change,
            };
            let honest = ours(&problem, Method::Clusters, Feed::InPlace);
            run(&problem, vec![honest, Box::new(liar)], 2, 1).map(|_| ())
        };
        assert!(contest(|_| {}).is_ok());
        let drops = contest(|answer| answer.n_pairs -= 1).map_err(|error| error.to_string());
        assert!(drops.is_err_and(|error| error.contains(" expected")));
        let swaps = contest(|answer| answer.hash = answer.hash.map(|hash| hash ^ 1));
        assert!(swaps.is_err_and(|error| error.to_string().contains("differ in their pairs")));
    }

    #[test]
    fn a_wrong_number_is_caught_in_timed_frames_too() {
        let problem = problems().swap_remove(0);
        // The liar answers correctly in untimed frames, where the hash is checked.
        let liar = Liar {
            honest: ours(&problem, Method::Clusters, Feed::InPlace),
            change: |answer| answer.n_pairs += u64::from(answer.hash.is_none()),
        };
        let outcome = run(&problem, vec![Box::new(liar)], 2, 2).map(|_| ());
        assert!(outcome.is_err_and(|error| error.to_string().contains("in the same pose before")));
    }
}
