//! Runs a method of another crate on the GPU: such a method records passes that work in cells.

use std::sync::Arc;

use crate::answers::pairs::Pairs;
use crate::gpu::cells::Guest;
use crate::gpu::pass_buffers::{Capacities, PassCounts};
use crate::gpu::{Engine, GpuContext, WantedAdapter};
use crate::plan::Plan;
use crate::query::Query;
use crate::query::goal::{Goal, Limits};
use crate::query::progress::Control;
use crate::query::settings::{Backend, Method, Settings};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::words::debug_by_name;
use crate::search::runner::{Finder, Job, Runner};
use crate::search::sink::Answer;
use crate::search::stats::Stats;

debug_by_name!(GpuHost => "GpuHost");

/// The frame loop around a method of another crate.
pub struct GpuHost {
    runner: Runner,
    pairs: Pairs,
    engine: Engine,
}

impl GpuHost {
    /// Opens the adapter whose name contains `device`, or the best one. `lambda` is the density of
    /// cells, and `first` the initial room. The engine's own buffers take at most `memory_budget`
    /// bytes; if that is not enough, the work is done in parts.
    ///
    /// # Errors
    /// No adapter fits; the driver refuses.
    pub fn new(
        device: Option<&str>,
        lambda: f64,
        first: Option<Capacities>,
        memory_budget: Option<u64>,
        guest: Guest,
    ) -> Result<Self, Error> {
        let gpu = GpuContext::open(device.map_or(WantedAdapter::Any, WantedAdapter::Named))?;
        let settings = Settings {
            method: Method::Cells,
            backend: Backend::Gpu,
            density: lambda,
            memory_budget,
            ..Settings::default()
        };
        let first = first.unwrap_or_default();
        Ok(GpuHost {
            runner: Runner::new(&settings),
            pairs: Pairs::default(),
            engine: Engine::with_guest(gpu, settings, first, Some(guest)),
        })
    }

    /// One frame, with repetitions dropped; and the counts of each pass.
    ///
    /// # Errors
    /// A stale id, refused positions, device errors.
    pub fn detect(
        &mut self,
        scene: &Scene,
        query: &Query,
        name: &'static str,
    ) -> Result<(&Pairs, &[PassCounts]), Error> {
        let gpu = Arc::clone(self.engine.gpu());
        let engine = &mut self.engine;
        let mut guest = GpuGuest { name, engine };
        let plan = Plan::intersections(scene, query, Goal::All, Limits::default())?;
        let (runner, pairs, control) = (&self.runner, &mut self.pairs, Control::new());
        gpu.block_on(runner.run(scene, &plan, &control, &mut guest, pairs))?;
        Ok((&self.pairs, &self.engine.complete))
    }
}

struct GpuGuest<'a> {
    name: &'static str,
    engine: &'a mut Engine,
}

impl Finder for GpuGuest<'_> {
    fn method(&self) -> &'static str {
        self.name
    }

    fn backend(&self) -> &str {
        self.engine.backend()
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
        self.engine.find(job, answer, stats).await
    }
}
