//! Runs a detector with the options of the command line, and collects its times over many frames.

use std::num::NonZeroUsize;

use impinge::{
    Affinity, Backend, BodyId, Detector, Exclusion, PairKind, Pairs, Positions, Query, Scene,
    Settings, Stats,
};

use crate::args::{AskArgs, DetectorArgs, ExcludeArgs};
use crate::asked::{Asked, Question, body};
use crate::error::Error;

/// A detector with the options of the command line.
pub fn detector(args: &DetectorArgs) -> Result<Detector, Error> {
    Ok(Detector::new(settings(args))?)
}

/// The settings of a detector.
pub fn settings(args: &DetectorArgs) -> Settings {
    Settings::new()
        .method(args.method)
        .backend(backend(args))
        .threads(args.threads.map_or(0, Into::into))
        .density(args.lambda)
        .group_size(args.group_size)
        .memory_budget(args.memory_budget)
        .max_pairs(args.max_pairs)
        .device(args.device.clone())
        // All threads of this process are its own.
        .affinity(Affinity::Auto)
}

/// The settings of a question that only the CPU answers.
pub fn on_cpu(threads: Option<NonZeroUsize>) -> Settings {
    Settings::new()
        .backend(Backend::Cpu)
        .threads(threads.map_or(0, Into::into))
        // All threads of this process are its own.
        .affinity(Affinity::Auto)
}

/// The backend to use.
fn backend(args: &DetectorArgs) -> Backend {
    match (args.backend, &args.device) {
        // A named device must exist, so its absence is an error.
        (Backend::Auto, Some(_)) => Backend::Gpu,
        (Backend::Auto, None) if !may_have_gpu() => Backend::Cpu,
        (backend, _) => backend,
    }
}

/// Whether this machine may have a hardware GPU. Searching for one loads every driver, and some
/// software drivers then write to standard error. On Linux a GPU has a file in `/dev`, made by the
/// kernel's graphics drivers, by NVIDIA's driver, by WSL or by a phone's driver.
pub fn may_have_gpu() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    let has = |folder: &str, start: &str| {
        std::fs::read_dir(folder).is_ok_and(|mut entries| {
            entries.any(|entry| {
                entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with(start))
            })
        })
    };
    has("/dev/dri", "render")
        || ["nvidia", "dxg", "kgsl", "mali"]
            .iter()
            .any(|start| has("/dev", start))
}

/// What is asked of the pairs between bodies and within each.
pub fn asked((between, within): (bool, bool), args: &AskArgs) -> Asked {
    Asked {
        between,
        within,
        only: None,
        shared_vertex: args.shared_vertex,
        question: Question::Pairs,
        has_self: true,
        excludes: !args.exclude.bodies.is_empty(),
        rings: args.exclude.rings,
        rest: None,
        has_kinds: false,
    }
}

/// The query without the pairs of bodies that `--exclude` names, and those of `--exclude-rings`.
pub fn query(asked: Asked, excluded: &ExcludeArgs, bodies: &[BodyId]) -> Result<Query, Error> {
    let query = asked.query(bodies)?;
    let query = match excluded.rings {
        Some(n) => query.exclude(Exclusion::rings(n)),
        None => query,
    };
    without(query, &excluded.bodies, bodies)
}

/// The query without the pairs of bodies that `--exclude` names.
pub fn without(
    query: Query,
    excluded: &[(usize, usize)],
    bodies: &[BodyId],
) -> Result<Query, Error> {
    let body = |number| body("--exclude", bodies, number);
    excluded.iter().try_fold(query, |query, &(a, b)| {
        Ok(query.exclude((body(a)?, body(b)?)))
    })
}

/// The query with the kinds of pairs that `--kinds` names.
pub fn of_kinds(query: Query, kinds: &[PairKind]) -> Query {
    match kinds.is_empty() {
        true => query,
        false => query.kinds(kinds.iter().copied()),
    }
}

/// Fails if anything was found and `--fail-on-hit` was given.
pub fn hit(fail_on_hit: bool, is_found: bool) -> Result<(), Error> {
    match fail_on_hit && is_found {
        true => Err(Error::Hit),
        false => Ok(()),
    }
}

/// Runs the same frame `n_frames` times. All positions are rewritten before each run, so that no
/// result of the frame before can be reused.
pub fn repeat(
    detector: &mut Detector,
    scene: &mut Scene,
    query: &Query,
    n_frames: usize,
) -> Result<(Pairs, Times), Error> {
    let mut times = Times::default();
    if n_frames > 1 {
        let rest: Vec<(BodyId, Positions)> = scene
            .bodies()
            .map(|(id, body)| (id, body.positions().clone()))
            .collect();
        for _ in 1..n_frames {
            let pairs = detector.detect(scene, query)?;
            times.add(pairs.stats());
            for (id, positions) in &rest {
                scene.set_positions(*id, positions)?;
            }
        }
    }
    let pairs = detector.detect(scene, query)?;
    times.add(pairs.stats());
    Ok((pairs, times))
}

/// Wall times of frames in milliseconds, in total and by stage.
#[derive(Debug, Clone, Default)]
pub struct Times {
    total: Vec<f64>,
    /// A stage that a frame did not run counts as 0 there.
    stages: Vec<(&'static str, Vec<f64>)>,
}

impl Times {
    /// Adds the times of a frame.
    pub fn add(&mut self, stats: &Stats) {
        for stage in &stats.stages {
            if !self.stages.iter().any(|(name, _)| *name == stage.name) {
                self.stages.push((stage.name, vec![0.0; self.total.len()]));
            }
        }
        for (name, ms) in &mut self.stages {
            ms.push(stats.stage_ms(name));
        }
        self.total.push(stats.total_ms);
    }

    /// The same and one more.
    pub fn and(mut self, stats: &Stats) -> Self {
        self.add(stats);
        self
    }

    /// The total time of all frames together.
    pub fn sum_ms(&self) -> f64 {
        self.total.iter().sum()
    }

    /// How many frames there were.
    pub fn n_frames(&self) -> usize {
        self.total.len()
    }

    /// A percentile of the total time: `percent` % of the frames took at most this long.
    pub fn total_ms(&self, percent: u32) -> f64 {
        percentile(&self.total, percent)
    }

    /// The median of each stage, in the order in which they ran.
    pub fn stages_ms(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        self.stages
            .iter()
            .map(|(name, ms)| (*name, percentile(ms, 50)))
    }
}

/// The percentile, by linear interpolation between the two nearest ranks; 0 if there are no values.
fn percentile(values: &[f64], percent: u32) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return 0.0;
    };
    let hundredths = last * percent.min(100) as usize;
    let (low, part) = (hundredths / 100, hundredths % 100);
    let high = (low + 1).min(last);
    sorted[low] + (sorted[high] - sorted[low]) * part as f64 / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles() {
        assert_eq!(percentile(&[], 50), 0.0);
        assert_eq!(percentile(&[3.0], 95), 3.0);
        assert_eq!(percentile(&[4.0, 1.0, 2.0], 50), 2.0);
        assert_eq!(percentile(&[4.0, 1.0, 2.0, 3.0], 50), 2.5);
        assert_eq!(percentile(&[4.0, 1.0, 2.0, 3.0], 100), 4.0);
        assert_eq!(percentile(&[4.0, 1.0, 2.0, 3.0], 0), 1.0);
    }
}
