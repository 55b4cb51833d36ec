//! Runs a method of another crate in the frame loop of this one.

#[cfg(feature = "gpu")]
pub mod gpu;

use std::sync::Arc;

use crate::answers::pairs::Pairs;
use crate::plan::Plan;
use crate::query::Query;
use crate::query::goal::{Goal, Limits};
use crate::query::progress::Control;
use crate::query::settings::Settings;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::words::debug_by_name;
use crate::search::runner::{Finder, Job, Runner, ready};
use crate::search::sink::Answer;
use crate::search::stats::Stats;

debug_by_name!(Host => "Host");

/// The frame loop around a method of another crate, on the CPU.
pub struct Host {
    runner: Runner,
    pairs: Pairs,
}

impl Host {
    /// Creates a host with `threads` workers; 0 for one per core.
    pub fn new(threads: usize) -> Self {
        let settings = Settings {
            threads,
            ..Settings::default()
        };
        Host {
            runner: Runner::new(&settings),
            pairs: Pairs::default(),
        }
    }

    /// One frame: resolves and checks the query, has `method` hand over the keys of all pairs, in
    /// any order, sorts them and drops repetitions.
    ///
    /// # Errors
    /// A stale id, refused positions, errors of the method.
    pub fn detect(
        &mut self,
        scene: &Scene,
        query: &Query,
        name: &'static str,
        method: impl FnMut(Job<'_>, &Arc<Answer>, &mut Stats) -> Result<(), Error>,
    ) -> Result<&Pairs, Error> {
        let plan = Plan::intersections(scene, query, Goal::All, Limits::default())?;
        let (mut guest, control) = (CpuGuest { name, method }, Control::new());
        let Host { runner, pairs } = self;
        ready(runner.run(scene, &plan, &control, &mut guest, pairs))?;
        Ok(&self.pairs)
    }
}

struct CpuGuest<F> {
    name: &'static str,
    method: F,
}

impl<F> Finder for CpuGuest<F>
where
    F: FnMut(Job<'_>, &Arc<Answer>, &mut Stats) -> Result<(), Error>,
{
    fn method(&self) -> &'static str {
        self.name
    }

    fn repeats(&self) -> bool {
        true
    }

    async fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        (self.method)(job, answer, stats)
    }
}
