//! A detector's answers about intersections: which pairs, how many, whether any.

use super::Detector;
use crate::answers::pairs::Pairs;
use crate::plan::Plan;
use crate::query::goal::Goal;
use crate::query::progress::Control;
#[cfg(feature = "gpu")]
use crate::query::settings::Backend;
use crate::query::settings::{Method, Settings};
use crate::query::{Query, Scope};
use crate::scene::Scene;
use crate::scene::error::Error;
#[cfg(feature = "gpu")]
use crate::search::runner::Outcome;
use crate::search::runner::ready;
use crate::search::work::Work;

/// The plan of a question, and what it depends on.
#[derive(Debug)]
pub(super) struct KeptPlan {
    arrangement: u64,
    query: Query,
    plan: Plan,
}

impl Detector {
    /// All pairs that the query asks for, in the current state of the scene.
    ///
    /// # Errors
    /// A stale id, refused positions, more pairs than allowed, no memory for the answer, a memory
    /// budget too small for one batch and the answer, a GPU failure.
    pub fn detect(&mut self, scene: &Scene, query: &Query) -> Result<Pairs, Error> {
        let control = &self.control.clone();
        let plan = Plan::intersections(scene, query, Goal::All, self.settings.limits())?;
        let mut pairs = self.homes.pairs.take();
        self.wait_for(scene, &plan, control, &mut pairs)?;
        Ok(pairs)
    }

    /// How many pairs [`detect`](Detector::detect) would find. None of them is held, so there may
    /// be more than memory has room for.
    ///
    /// # Errors
    /// As `detect`.
    pub fn count(&mut self, scene: &Scene, query: &Query) -> Result<u64, Error> {
        let control = &self.control.clone();
        let plan = Plan::intersections(scene, query, Goal::Count, self.settings.limits())?;
        let mut pairs = self.homes.pairs.take();
        self.wait_for(scene, &plan, control, &mut pairs)
    }

    /// Whether [`detect`](Detector::detect) would find any pair. The search ends with the first one
    /// that is certain.
    ///
    /// That pair is not given: which one comes first depends on the threads. For one that is the
    /// same on every run take the first of all pairs.
    ///
    /// # Errors
    /// As `detect`; but any number of pairs is allowed.
    pub fn any(&mut self, scene: &Scene, query: &Query) -> Result<bool, Error> {
        let control = &self.control.clone();
        let plan = self.plan_of_any(scene, query)?;
        let any = match self.any_soon(scene, query, &plan, control)? {
            Some(any) => any,
            None => {
                let mut pairs = self.homes.pairs.take();
                self.wait_for(scene, &plan, control, &mut pairs)? > 0
            }
        };
        self.keep(scene, query, plan);
        Ok(any)
    }

    /// The question whether any elements meet, which is also that for the nearest bodies. Of many
    /// bodies it takes longer to list them than to answer: it is kept until bodies are added or
    /// changed other than in their positions.
    pub(super) fn plan_of_any(&mut self, scene: &Scene, query: &Query) -> Result<Plan, Error> {
        match self.any.take() {
            Some(kept) if kept.arrangement == scene.arrangement() && kept.query == *query => {
                Ok(kept.plan.asked_now())
            }
            _ => Plan::intersections(scene, query, Goal::Any, self.settings.limits()),
        }
    }

    /// Keeps a plan for the same question.
    pub(super) fn keep(&mut self, scene: &Scene, query: &Query, plan: Plan) {
        self.any = Some(KeptPlan {
            arrangement: scene.arrangement(),
            query: query.clone(),
            plan,
        });
    }

    /// Whether any of many bodies meet, on the CPU, if that is soon known.
    fn any_soon(
        &mut self,
        scene: &Scene,
        query: &Query,
        plan: &Plan,
        control: &Control,
    ) -> Result<Option<bool>, Error> {
        if plan.parts.len() <= 2 || !self.may_know_soon(query, plan) {
            return Ok(None);
        }
        control.step(0, 1)?;
        let workers = self.runner.workers();
        let any = self.distances.any(scene, plan, Work { workers, control })?;
        if any.is_some() {
            // One thread has found it, without the loop.
            self.stats.clear();
            self.stats.found_by(Method::Clusters.name(), "cpu", 1);
            self.stats.total_ms = plan.since.elapsed().as_secs_f64() * 1e3;
        }
        Ok(any)
    }

    fn may_know_soon(&self, query: &Query, plan: &Plan) -> bool {
        let Settings {
            method,
            memory_budget,
            ..
        } = self.settings;
        let is_about_many = matches!(
            query.scope,
            Scope::Across { within: false }
                | Scope::All {
                    between: true,
                    within: false
                }
        );
        let may_choose = matches!(method, Method::Auto | Method::Clusters);
        #[cfg(feature = "gpu")]
        let is_on_device = self.gpu.is_some();
        #[cfg(not(feature = "gpu"))]
        let is_on_device = false;
        is_about_many
            && !plan.counts_late()
            && may_choose
            && memory_budget.is_none()
            && !is_on_device
    }

    fn wait_for(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        control: &Control,
        pairs: &mut Pairs,
    ) -> Result<u64, Error> {
        #[cfg(feature = "gpu")]
        if super::gpu::pays(&self.settings, self.n_candidates) {
            self.open_gpu();
        }
        #[cfg(feature = "gpu")]
        if let Some(gpu) = self.gpu_in_use() {
            return gpu.block_on(self.answer(scene, plan, control, pairs));
        }
        ready(self.answer(scene, plan, control, pairs))
    }

    /// One frame. With `Backend::Auto`, the GPU answers where the last frame had much to test, and
    /// the CPU takes over for good if it fails or cannot hold the scene.
    pub(super) async fn answer(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        control: &Control,
        pairs: &mut Pairs,
    ) -> Result<u64, Error> {
        let n = self.find_pairs(scene, plan, control, pairs).await;
        self.stats.clone_from(pairs.stats());
        #[cfg(feature = "gpu")]
        {
            self.n_candidates = self.stats.n_candidates;
        }
        n
    }

    async fn find_pairs(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        control: &Control,
        pairs: &mut Pairs,
    ) -> Result<u64, Error> {
        let Detector { runner, cpu, .. } = self;
        #[cfg(feature = "gpu")]
        if let Some(engine) = &mut self.gpu {
            let may_choose = self.settings.backend == Backend::Auto;
            if !may_choose || super::gpu::pays(&self.settings, self.n_candidates) {
                let found = runner.run(scene, plan, control, engine, pairs);
                match found.await {
                    Err(Error::Gpu { .. }) if may_choose => self.gpu = None,
                    result => return result,
                }
            }
        }
        let found = runner.run(scene, plan, control, cpu, pairs).await;
        #[cfg(feature = "gpu")]
        if let Some(engine) = &self.gpu {
            pairs.stats_mut().bytes_held += engine.bytes();
        }
        found
    }
}
