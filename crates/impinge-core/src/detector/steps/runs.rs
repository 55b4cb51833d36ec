//! Candidates, all at once or in runs.
//!
//! In runs: candidates are counted first, part by part (`key_ranges`). Then each run is searched for alone, in the order of the
//! answer, and only pairs of elements that may belong to it are tested. So an answer of `k` runs takes `k + 1` searches, and
//! memory for one run.

use std::ops::ControlFlow;

use crate::clock::Instant;
use crate::cpu::steps::{StepClusters, StepTest};
use crate::detector::Detector;
use crate::error::Error;
use crate::frame::{Ask, Frame, TestId};
use crate::hull::Pose;
use crate::impacts::{Candidates, KeyAnswer, StepAnswer};
use crate::key_ranges::{KeyRanges, Run, Tally};
use crate::naive;
use crate::narrow::BoxOverlap;
use crate::progress::Control;
use crate::run::Job;
use crate::scene::Scene;
use crate::settings::{Method, Settings};
use crate::sink::{self, BLOCK, Ending, Limits, Wanted};
use crate::sort::Sorter;
use crate::stats::Statistics;
use crate::step::CandidateQuery;
use crate::workers::Workers;

use super::{StepMemory, begin};

/// The question about candidates.
#[derive(Clone, Copy)]
struct Question<'a> {
    settings: &'a Settings,
    scene: &'a Scene,
    distance: f64,
    control: &'a Control<'a>,
    workers: &'a Workers,
}

/// A question, and what the search for its candidates needs.
pub(super) struct RunSearch<'a> {
    question: Question<'a>,
    frame: &'a mut Frame,
    clusters: &'a mut StepClusters,
    answer: &'a mut KeyAnswer,
    sorter: &'a mut Sorter,
    /// When the search for the current candidates began.
    start: Instant,
}

impl Detector {
    /// All [`candidates`](Detector::candidates) of a query in sorted runs of at most `most` candidates, one after the other, so that
    /// never more than one run is held. Returns how many candidates there are.
    ///
    /// Run after run, the candidates are exactly those of `candidates`, each once and in the same order, whatever `most`, the
    /// memory budget and the number of threads. A run may hold several kinds of pairs and ends anywhere between two candidates.
    /// No run is empty.
    ///
    /// A run takes 8 bytes per candidate, and 4 bytes more where there is no memory budget. A
    /// [memory budget](Settings::memory_budget) makes runs as short as it needs; `most` can then be `u64::MAX`. Each run is
    /// searched for alone, and all candidates are counted before, so short runs cost time. An answer of at most `most` candidates
    /// is found at once, as by `candidates`.
    ///
    /// `each` gets the runs and may keep them; [`ControlFlow::Break`] ends the search.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use impinge::{Backend, CandidateQuery, Detector, PairKind, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let points: Vec<[f32; 3]> = (0..10).map(|i| [i as f32, 0.0, 0.0]).collect();
    /// scene.add_points(&points)?;
    /// scene.add_points(&points)?;
    /// let query = CandidateQuery::new(Query::all()).kinds([PairKind::VertexVertex]);
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let mut lengths = Vec::new();
    /// let all = detector.candidates_in_runs(&scene, &query, 4, |run| {
    ///     lengths.push(run.len());
    ///     ControlFlow::<()>::Continue(())
    /// })?;
    /// assert_eq!((all, lengths), (ControlFlow::Continue(10), vec![4, 4, 2]));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`candidates`](Detector::candidates), except that a memory budget need not hold the whole answer; a `most` of 0.
    pub fn candidates_in_runs<B>(
        &mut self,
        scene: &Scene,
        query: &CandidateQuery,
        most: u64,
        each: impl FnMut(Candidates) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B, u64>, Error> {
        self.candidates_in_runs_with(scene, query, most, each, &Control::new())
    }

    /// [`candidates_in_runs`](Detector::candidates_in_runs) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `candidates_in_runs`, and [`Error::Cancelled`].
    pub fn candidates_in_runs_with<B>(
        &mut self,
        scene: &Scene,
        query: &CandidateQuery,
        most: u64,
        mut each: impl FnMut(Candidates) -> ControlFlow<B>,
        control: &Control<'_>,
    ) -> Result<ControlFlow<B, u64>, Error> {
        if most == 0 {
            return Err(Error::Setting {
                setting: "most",
                given: most.to_string(),
                allowed: "at least 1 candidate per run",
            });
        }
        let limits = self.settings.limits();
        let (mut search, candidates) = self.search(scene, query, control)?;
        let at_once = Limits {
            max_pairs: Some(most.min(limits.max_pairs.unwrap_or(most))),
            ..limits
        };
        match search.find_all(candidates, at_once) {
            Ok(0) => return Ok(ControlFlow::Continue(0)),
            Ok(n) => return Ok(each(std::mem::take(candidates)).map_continue(|()| n)),
            Err(Error::TooManyPairs { limit, .. }) if limits.max_pairs != Some(limit) => {}
            // There may be room for parts of the answer.
            Err(Error::MemoryBudget { .. }) => {}
            Err(error) => return Err(error),
        }
        let whole = KeyRanges::new(search.frame, query.kinds);
        let tally = search.count(candidates, whole)?;
        let n = tally.total();
        if let Some(limit) = limits.max_pairs
            && n > limit
        {
            return Err(Error::TooManyPairs { found: n, limit });
        }
        let most = search.most_within_budget(candidates, most)?;
        Ok(search
            .hand_over(candidates, &tally, most, &mut each)?
            .map_continue(|()| n))
    }

    /// Resolves a question about candidates.
    pub(super) fn search<'a>(
        &'a mut self,
        scene: &'a Scene,
        query: &CandidateQuery,
        control: &'a Control<'a>,
    ) -> Result<(RunSearch<'a>, &'a mut Candidates), Error> {
        let start = Instant::now();
        query.check()?;
        let StepMemory {
            frame,
            candidates,
            clusters,
            keys,
            sorter,
            ..
        } = &mut self.steps;
        frame.resolve_for(scene, &query.query, Ask::Candidates(query.kinds))?;
        candidates.begin(frame);
        frame.check(scene)?;
        let search = RunSearch {
            question: Question {
                settings: &self.settings,
                scene,
                distance: query.distance,
                control,
                workers: self.frames.workers(),
            },
            frame,
            clusters,
            answer: keys,
            sorter,
            start,
        };
        Ok((search, candidates))
    }
}

impl RunSearch<'_> {
    /// Finds all candidates within some limits. Returns how many there are.
    pub fn find_all(&mut self, candidates: &mut Candidates, limits: Limits) -> Result<u64, Error> {
        let (keys, stats) = candidates.parts_mut();
        self.answer
            .begin(limits, Wanted::Pairs, std::mem::take(keys));
        let handed_over = StepAnswer::Keys(self.answer);
        self.question
            .run(self.frame, self.clusters, handed_over, stats)?;
        self.finish(candidates)
    }

    /// Counts the candidates in some ranges.
    fn count(&mut self, candidates: &mut Candidates, ranges: KeyRanges) -> Result<Tally, Error> {
        candidates.begin(self.frame);
        self.frame.ask_for(ranges.kinds());
        let tally = Tally::new(ranges)?;
        let (_, stats) = candidates.parts_mut();
        let counted = StepAnswer::Counts(&tally);
        self.question
            .run(self.frame, self.clusters, counted, stats)?;
        Ok(tally)
    }

    /// How long a run may be, after candidates were counted.
    fn most_within_budget(&self, candidates: &Candidates, most: u64) -> Result<u64, Error> {
        let Some(budget) = self.question.settings.memory_budget else {
            return Ok(most);
        };
        let each = size_of::<u64>() as u64;
        let held = candidates.stats().bytes_held + Tally::MOST_BYTES * Tally::MOST_DEPTH;
        let needed = held + each * most.min(BLOCK as u64);
        if needed > budget {
            return Err(Error::MemoryBudget {
                what: "clusters, their boxes, the smallest slab and the shortest run",
                needed,
                budget,
            });
        }
        Ok(most.min((budget - held) / each))
    }

    /// Finds the candidates that were counted, run by run. Returns whether `each` has not ended the search.
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
                self.find(candidates, &run)?;
                let flow = each(std::mem::take(candidates));
                self.start = Instant::now();
                flow
            };
            if flow.is_break() {
                return Ok(flow);
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Finds the candidates of one run, whose numbers are known.
    fn find(&mut self, candidates: &mut Candidates, run: &Run) -> Result<(), Error> {
        candidates.begin(self.frame);
        self.frame.ask_for(run.ranges.kinds());
        let (keys, stats) = candidates.parts_mut();
        for (keys, &n) in keys.iter_mut().zip(&run.counts) {
            *keys = sink::room(n as usize, "candidates")?;
        }
        // They fit into the memory budget.
        self.answer
            .begin(Limits::default(), Wanted::Pairs, std::mem::take(keys));
        let handed_over = StepAnswer::KeysIn(self.answer, &run.ranges);
        self.question
            .run(self.frame, self.clusters, handed_over, stats)?;
        self.finish(candidates)?;
        Ok(())
    }

    /// Takes over what was found, and sorts it. Returns how many candidates there are.
    fn finish(&mut self, candidates: &mut Candidates) -> Result<u64, Error> {
        let (keys, _) = candidates.parts_mut();
        let n;
        (*keys, n) = self.answer.finish()?;
        let collect = Instant::now();
        let workers = self.question.workers;
        let n_counted = self.sorter.sort_kinds(keys, self.frame, workers);
        let ms = collect.elapsed().as_secs_f64() * 1e3;
        let bytes = candidates.bytes() + self.sorter.bytes();
        let (_, stats) = candidates.parts_mut();
        stats.add_ms("collect", ms);
        stats.ways.n_counted = n_counted;
        workers.report(&mut stats.ways);
        stats.bytes_held += bytes;
        stats.total_ms = self.start.elapsed().as_secs_f64() * 1e3;
        Ok(n)
    }
}

impl Question<'_> {
    /// Hands over the keys of all candidates that the frame asks for.
    fn run(
        &self,
        frame: &Frame,
        clusters: &mut StepClusters,
        answer: StepAnswer<'_>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Question {
            settings,
            scene,
            distance,
            control,
            workers,
        } = *self;
        begin(stats, settings, workers.n());
        let _shift = workers.shift(frame.n_primitives());
        if settings.method == Method::Naive {
            let mut block = Vec::new();
            return naive::run(
                &BoxOverlap { distance },
                scene,
                frame,
                control,
                stats,
                |test, key, ()| {
                    if let TestId::Elements(kind) = test
                        && frame.is_owned(scene, key)
                    {
                        block.push(key);
                        answer.take_keys(kind, &mut block);
                    }
                    answer.check()
                },
            );
        }
        let job = Job {
            scene,
            frame,
            workers,
            control,
        };
        let pose = Pose {
            until: 1.0,
            margin: distance,
            is_swept: true,
        };
        let asked = (StepTest::Overlap { distance }, pose);
        clusters.run(job, settings, asked, answer, stats)
    }
}
