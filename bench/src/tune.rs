//! Finds the best setting of a peer: tries every setting on the problem itself and keeps the
//! fastest.

use crate::Failure;
use crate::problem::Problem;
use crate::runner::Runner;

/// Untimed and timed frames.
const N_WARM: usize = 3;
const N_TIMED: usize = 8;

/// Builds a contestant for each setting, runs a few frames, and returns the contestant with the
/// fastest frame: on a shared machine, the fastest of several frames says most about a setting. A
/// setting whose first frames take twice as long as the best so far is abandoned. With a single
/// setting nothing is measured.
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
        let mut fastest = f64::INFINITY;
        for frame in 0..N_WARM + N_TIMED {
            runner.load(problem, frame % 2)?;
            let answer = runner.frame(false)?;
            if frame > 0 {
                fastest = fastest.min(answer.ms);
            }
            if frame >= N_WARM && best.is_some_and(|(ms, _)| fastest > 2.0 * ms) {
                break;
            }
        }
        if best.is_none_or(|(ms, _)| fastest < ms) {
            best = Some((fastest, *setting));
        }
    }
    let (_, setting) = best.ok_or("no settings to try")?;
    Ok((build(&setting)?, setting))
}
