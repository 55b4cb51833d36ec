//! Peers at their best: every setting is tried on the problem itself, the fastest is kept.

use crate::Failure;
use crate::problem::Problem;
use crate::runner::Runner;

/// Frames before the clock counts, and frames that count.
const N_WARM: usize = 3;
const N_TIMED: usize = 7;

/// Builds a contestant for each setting, runs a few frames, and returns the one with the lowest
/// median. With a single setting nothing is measured.
pub fn fastest<S: Copy>(
    problem: &Problem,
    settings: &[S],
    build: impl Fn(&S) -> Result<Box<dyn Runner>, Failure>,
) -> Result<(Box<dyn Runner>, S), Failure> {
    if let [setting] = settings {
        return Ok((build(setting)?, *setting));
    }
    let mut best: Option<(f64, S)> = None;
    for setting in settings {
        let mut runner = build(setting)?;
        let mut times = Vec::with_capacity(N_TIMED);
        for frame in 0..N_WARM + N_TIMED {
            runner.load(problem, frame % 2)?;
            let answer = runner.frame(false)?;
            if frame >= N_WARM {
                times.push(answer.ms);
            }
        }
        times.sort_by(f64::total_cmp);
        let median = times[N_TIMED / 2];
        if best.is_none_or(|(ms, _)| median < ms) {
            best = Some((median, *setting));
        }
    }
    let (_, setting) = best.ok_or("no settings to try")?;
    Ok((build(&setting)?, setting))
}
