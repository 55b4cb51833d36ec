//! Candidates, all at once or in runs.
//!
//! In runs: candidates are counted first, part by part (`key_ranges`). Then each run is searched
//! for alone, in the order of the answer, and only pairs of elements that may belong to it are
//! tested. So an answer of `k` runs takes `k + 1` searches, and memory for one run.

use std::ops::ControlFlow;

use super::Detector;
use super::in_step::{InStep, Keys, Seen};
use crate::answers::candidates::Candidates;
use crate::answers::home::Home;
use crate::plan::Plan;
use crate::query::Query;
use crate::query::goal::Limits;
use crate::query::pair_kind::PairKinds;
use crate::query::progress::Control;
#[cfg(doc)]
use crate::query::settings::Settings;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::search::found::KeysByKind;
use crate::search::key_ranges::{KeyRanges, Run, Tally};
use crate::search::runner::{Runner, ready};
use crate::search::sink::{self, BLOCK};
use crate::search::stats::Stats;
use crate::search::work::Work;

/// Pairs per run of a step that is taken apart.
const RUN: u64 = 1 << 22;

/// A search for candidates, run by run.
struct RunSearch<'a> {
    scene: &'a Scene,
    /// The whole question.
    plan: &'a Plan,
    control: &'a Control,
    runner: &'a Runner,
    finder: InStep<'a>,
    /// Of the last run: the runs have their own.
    stats: &'a mut Stats,
    /// Where the buffers of runs that are dropped go.
    home: &'a Home<Candidates>,
}

impl Detector {
    /// Pairs of elements whose boxes overlap during a step, each box inflated by a distance and by
    /// how [thick](Scene::set_thickness) its element is: for callers with their own test. Sorted
    /// and complete. Vertices of no element take no part. Always found on the CPU.
    /// [`candidates_in_runs`](Detector::candidates_in_runs) gives them piece by piece, for answers
    /// larger than memory.
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts), and a distance that is negative or not finite.
    pub fn candidates(
        &mut self,
        scene: &Scene,
        inflation: f64,
        query: &Query,
    ) -> Result<Candidates, Error> {
        let control = &self.control.clone();
        let plan = Plan::candidates(scene, inflation, query, self.settings.limits())?;
        let mut candidates = self.homes.candidates.take();
        let mut search = self.search(scene, &plan, control);
        let found = search.find(&plan, Keys::All, &mut candidates);
        self.stats.clone_from(candidates.stats());
        found.map(|_| candidates)
    }

    /// All [`candidates`](Detector::candidates) of a query in sorted runs of at most `most`
    /// candidates, one after the other, so that never more than one run is held. Returns how many
    /// candidates there are.
    ///
    /// Run after run, the candidates are exactly those of `candidates`, each once and in the same
    /// order, whatever `most`, the memory budget and the number of threads. A run may hold several
    /// kinds of pairs and ends anywhere between two candidates. No run is empty.
    ///
    /// A run takes 8 bytes per candidate, and 4 bytes more where there is no memory budget. A
    /// [memory budget](Settings::memory_budget) makes runs as short as it needs; `most` can then be
    /// `u64::MAX`. Each run is searched for alone, and all candidates are counted before, so short
    /// runs cost time. An answer of at most `most` candidates is found at once, as by `candidates`.
    ///
    /// `each` gets the runs and may keep them; [`ControlFlow::Break`] ends the search.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use impinge::{Backend, Detector, PairKind, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let points: Vec<[f32; 3]> = (0..10).map(|i| [i as f32, 0.0, 0.0]).collect();
    /// scene.add_points(&points)?;
    /// scene.add_points(&points)?;
    /// let query = Query::between_all().kinds([PairKind::VertexVertex]);
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let mut lengths = Vec::new();
    /// let all = detector.candidates_in_runs(&scene, 0.0, &query, 4, |run| {
    ///     lengths.push(run.len());
    ///     ControlFlow::<()>::Continue(())
    /// })?;
    /// assert_eq!((all, lengths), (ControlFlow::Continue(10), vec![4, 4, 2]));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`candidates`](Detector::candidates), except that a memory budget need not hold the whole
    /// answer; a `most` of 0.
    pub fn candidates_in_runs<B>(
        &mut self,
        scene: &Scene,
        inflation: f64,
        query: &Query,
        most: u64,
        mut each: impl FnMut(Candidates) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B, u64>, Error> {
        let control = &self.control.clone();
        check_most(most)?;
        let limits = self.settings.limits();
        let plan = Plan::candidates(scene, inflation, query, limits_at_once(limits, most))?;
        let mut search = self.search(scene, &plan, control);
        search.find_all((limits, most), &mut each)
    }

    /// Calls a function with runs of pairs whose boxes overlap, about which a plan asks; however
    /// many there are.
    pub(super) fn each_overlap(
        &mut self,
        (scene, plan): (&Scene, &Plan),
        mut each: impl FnMut(Candidates, Work<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let control = &self.control.clone();
        let limits = self.limits_of_steps();
        let plan = plan.overlapping(scene, limits_at_once(limits, RUN));
        let mut search = self.search(scene, &plan, control);
        let workers = search.runner.workers();
        let work = Work { workers, control };
        let mut hand_over = |run| match each(run, work) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => ControlFlow::Break(error),
        };
        match search.find_all((limits, RUN), &mut hand_over)? {
            ControlFlow::Continue(_) => Ok(()),
            ControlFlow::Break(error) => Err(error),
        }
    }

    fn search<'a>(
        &'a mut self,
        scene: &'a Scene,
        plan: &'a Plan,
        control: &'a Control,
    ) -> RunSearch<'a> {
        RunSearch {
            scene,
            plan,
            control,
            runner: &self.runner,
            stats: &mut self.stats,
            home: &self.homes.candidates,
            finder: InStep {
                clusters: &mut self.steps.clusters,
                settings: &self.settings,
                #[cfg(feature = "gpu")]
                gpu: &mut self.gpu,
                keys: Keys::All,
                list: None,
                seen: Seen::default(),
            },
        }
    }
}

/// The limits of an answer that is found at once, if it is no longer than a run.
fn limits_at_once(limits: Limits, most: u64) -> Limits {
    Limits {
        max_pairs: Some(most.min(limits.max_pairs.unwrap_or(most))),
        ..limits
    }
}

impl RunSearch<'_> {
    /// Finds all candidates, at once or in runs of at most so many.
    fn find_all<B>(
        &mut self,
        (limits, most): (Limits, u64),
        each: &mut impl FnMut(Candidates) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B, u64>, Error> {
        let candidates = &mut self.home.take();
        match self.find_at_once(candidates, limits, each)? {
            Some(flow) => Ok(flow),
            None => self.find_in_runs(candidates, self.plan.kinds_asked(), (limits, most), each),
        }
    }

    /// Finds some of the candidates, or counts them. Returns how many were found.
    fn find<'b>(
        &'b mut self,
        plan: &Plan,
        keys: Keys<'b>,
        candidates: &mut Candidates,
    ) -> Result<u64, Error> {
        let mut finder = InStep {
            clusters: &mut *self.finder.clusters,
            settings: self.finder.settings,
            #[cfg(feature = "gpu")]
            gpu: &mut *self.finder.gpu,
            keys,
            list: None,
            seen: Seen::default(),
        };
        ready(
            self.runner
                .run(self.scene, plan, self.control, &mut finder, candidates),
        )
    }

    /// Finds all candidates, if they are no more than a run may have.
    fn find_at_once<B>(
        &mut self,
        candidates: &mut Candidates,
        limits: Limits,
        each: &mut impl FnMut(Candidates) -> ControlFlow<B>,
    ) -> Result<Option<ControlFlow<B, u64>>, Error> {
        match self.find(self.plan, Keys::All, candidates) {
            Ok(0) => {
                self.stats.clone_from(candidates.stats());
                Ok(Some(ControlFlow::Continue(0)))
            }
            Ok(n) => Ok(Some(self.hand_out(candidates, each).map_continue(|()| n))),
            Err(Error::TooManyPairs { limit, .. }) if limits.max_pairs != Some(limit) => Ok(None),
            // There may be room for parts of the answer.
            Err(Error::MemoryBudget { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Counts all candidates, then finds them run by run.
    fn find_in_runs<B>(
        &mut self,
        candidates: &mut Candidates,
        kinds: PairKinds,
        (limits, most): (Limits, u64),
        each: &mut impl FnMut(Candidates) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B, u64>, Error> {
        let tally = self.count(candidates, KeyRanges::new(self.plan, kinds))?;
        let n = tally.total();
        if let Some(limit) = limits.max_pairs
            && n > limit
        {
            return Err(Error::TooManyPairs { found: n, limit });
        }
        let most = self.most_within_budget(candidates, most)?;
        let flow = self.hand_over(candidates, &tally, most, each)?;
        Ok(flow.map_continue(|()| n))
    }

    /// Hands out a run, and keeps its statistics.
    fn hand_out<B>(
        &mut self,
        candidates: &mut Candidates,
        each: &mut impl FnMut(Candidates) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.stats.clone_from(candidates.stats());
        each(std::mem::take(candidates))
    }

    /// Counts the candidates in some ranges.
    fn count(&mut self, candidates: &mut Candidates, ranges: KeyRanges) -> Result<Tally, Error> {
        let plan = self.plan.of_kinds(ranges.kinds());
        let tally = Tally::new(ranges)?;
        self.find(&plan, Keys::Counted(&tally), candidates)?;
        Ok(tally)
    }

    /// How long a run may be, after candidates were counted.
    fn most_within_budget(&self, candidates: &Candidates, most: u64) -> Result<u64, Error> {
        let Some(budget) = self.finder.settings.memory_budget else {
            return Ok(most);
        };
        let each = size_of::<u64>() as u64;
        let held = candidates.stats().bytes_held + Tally::MOST_BYTES * Tally::MOST_DEPTH;
        let needed = held + each * most.min(BLOCK as u64);
        if needed > budget {
            return Err(Error::MemoryBudget {
                what: "clusters, their boxes, the smallest batch and the shortest run",
                needed,
                budget,
            });
        }
        Ok(most.min((budget - held) / each))
    }

    /// Finds the candidates that were counted, run by run. Returns whether `each` has not ended the
    /// search.
    fn hand_over<B>(
        &mut self,
        candidates: &mut Candidates,
        tally: &Tally,
        most: u64,
        each: &mut impl FnMut(Candidates) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B>, Error> {
        for run in tally.divide(most) {
            let flow = if run.n() > most {
                let tally = self.count(candidates, run.ranges)?;
                self.hand_over(candidates, &tally, most, each)?
            } else {
                self.find_run(candidates, &run)?;
                self.hand_out(candidates, each)
            };
            if flow.is_break() {
                return Ok(flow);
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Finds the candidates of one run, whose numbers are known.
    fn find_run(&mut self, candidates: &mut Candidates, run: &Run) -> Result<(), Error> {
        // They fit into the memory budget.
        let plan = self.plan.of_kinds(run.ranges.kinds());
        *candidates = self.home.take();
        if !self.home.keeps() {
            let mut buffers = KeysByKind::default();
            for (buffer, &n) in buffers.iter_mut().zip(&run.counts) {
                *buffer = sink::with_capacity(n as usize, "candidates")?;
            }
            candidates.put_buffers(buffers);
        }
        self.find(&plan, Keys::In(&run.ranges), candidates)?;
        Ok(())
    }
}

fn check_most(most: u64) -> Result<(), Error> {
    match most {
        0 => Err(Error::Setting {
            setting: "most",
            given: most.to_string(),
            allowed: "at least 1 candidate per run",
        }),
        _ => Ok(()),
    }
}
