//! The frame on the device: passes, growing, splitting.
//!
//! A pass takes its share of the work through all stages in one submission. If a buffer was too
//! small, the counters say how large it must be: it grows and the pass runs again. If the device's
//! limit or the memory budget forbids that, the work is split and each part becomes a pass:
//!
//! * `Clusters`: the seeds of the traversal, which are pairs of tree nodes, down to one pair of
//!   clusters;
//! * `Cells`: ranges of cells, then the product of one cell's groups, in tiles, over a list that
//!   does not change.
//!
//! The smallest pass has one work item, for which [`Capacities::LEAST`] is enough.

use std::sync::Arc;

use super::buffers::count;
use super::cells::{self, CellWork};
use super::clusters;
use super::collect::{Collected, Guess};
use super::device::Scopes;
use super::engine::{Engine, PassSink, PassesEnd};
use super::layout::{KINDS_NAMED, NodePair};
use super::pass_buffers::{Capacities, CellsWanted, NextPass, PassBuffers};
use super::recording::{Recorder, Recording};
use super::view::{Motion, StepTest};
use crate::plan::{Plan, pair_key};
use crate::query::SharedVertex;
use crate::query::goal::Goal;
use crate::query::settings::Method;
use crate::scene::error::Error;
use crate::scene::index::Number;
use crate::search::narrow::decide;
use crate::search::runner::Job;
use crate::search::sink::{Answer, BLOCK};
use crate::search::stats::Stats;
use crate::search::undecided::Undecided;

/// The host descends before the first launch while there are at most this many seeds: each step
/// saves two launches.
const SEEDS: usize = 512;
/// From this many unsure pairs on, several threads decide them.
const PARALLEL_FROM: usize = 512;
/// Unsure pairs per task.
const DECIDED_BY_A_TASK: usize = 64;

/// The work of a pass.
#[derive(Debug, Clone)]
pub(super) enum PassWork {
    Seeds(Vec<NodePair>),
    Cells(CellWork),
}

impl Engine {
    /// Does all of the work. When it is too much, some of the keys have been handed over already.
    pub(super) async fn work_off(
        &mut self,
        job: Job<'_>,
        mut sink: PassSink<'_, '_>,
        mut waiting: Vec<PassWork>,
        stats: &mut Stats,
    ) -> Result<PassesEnd, Error> {
        let Job { plan, control, .. } = job;
        let cells = self.cells_wanted(plan);
        let mut capacities = self.first_capacities(cells)?;
        while let Some(work) = waiting.pop() {
            if let PassWork::Cells(cells) = work
                && let Some(parts) = cells.parts()
            {
                waiting.extend(parts.into_iter().map(PassWork::Cells));
                continue;
            }
            let done = stats.n_batches;
            control.step(done, done + count(waiting.len()) + 1)?;
            let mut collected = self.pass(plan, &work, capacities, cells, stats).await?;
            if let PassSink::Answer(answer) = &sink {
                // Even where a buffer was too small for them, certain pairs are pairs.
                answer.foresee(collected.counts.needed.pairs)?;
            }
            let pass_buffers = self.budget_for_buffers();
            // Times are proven, whether all pairs had room or not.
            self.touches_by = match self.sought {
                Goal::Earliest | Goal::Any => collected.counts.touches_by,
                _ => None,
            };
            let next = match collected.counts.answer(self.sought) {
                true => NextPass::Complete,
                false => collected.counts.judge(&self.gpu, capacities, pass_buffers),
            };
            match next {
                NextPass::Complete => {
                    book(&collected, self.lane.method, stats);
                    self.complete.push(collected.counts);
                    let decided = &mut self.decided;
                    let goes_on = stats.time("decide", |_| match &mut sink {
                        PassSink::Answer(answer) => {
                            decide_all(job, answer, &collected, decided).map(|()| true)
                        }
                        PassSink::Undecided(take) => take(Undecided {
                            pairs: &mut collected.undecided,
                            touches_by: self.touches_by,
                        }),
                    })?;
                    if !goes_on {
                        return Ok(PassesEnd::Complete);
                    }
                    if let PassWork::Cells(cells) = work {
                        let next = cells.next(&collected, self.settings.group_size);
                        waiting.extend(next.map(PassWork::Cells));
                    }
                }
                NextPass::Grow(larger) => {
                    stats.n_reruns += 1;
                    capacities = larger;
                    waiting.push(work);
                }
                NextPass::Split => {
                    stats.n_reruns += 1;
                    if let Some(parts) = self.split(plan, &work, &collected)? {
                        waiting.extend(parts);
                        continue;
                    }
                    match self.lean(&work, &collected, capacities, pass_buffers) {
                        Ok(lean) => capacities = lean,
                        Err(error) => return Ok(PassesEnd::Crowded(error)),
                    }
                    waiting.push(work);
                }
            }
        }
        Ok(PassesEnd::Complete)
    }

    /// The whole work of a frame, if there is any.
    pub(super) fn whole(&self, plan: &Plan) -> Option<PassWork> {
        let seeds = self.world.seeds(plan, self.lane.motion);
        if seeds.is_empty() {
            return None;
        }
        Some(match self.lane.method {
            Method::Cells => PassWork::Cells(CellWork::WHOLE),
            _ => PassWork::Seeds(self.descend(plan, seeds)),
        })
    }

    /// The work of a piece: pairs of its runs, in batches that a queue can hold.
    pub(super) fn seeds_in_batches(&self, plan: &Plan, pairs: &[[u32; 2]]) -> Vec<PassWork> {
        let most = (self.lane.pass_buffers.capacities().queue as usize).max(SEEDS);
        let batches = pairs.chunks(most);
        batches
            .map(|batch| PassWork::Seeds(self.descend(plan, self.world.seeds_of_runs(batch))))
            .collect()
    }

    /// Replaces seeds by their children's pairs, for as long as there are at most [`SEEDS`].
    fn descend(&self, plan: &Plan, mut seeds: Vec<NodePair>) -> Vec<NodePair> {
        let mut below = Vec::new();
        loop {
            below.clear();
            for &seed in &seeds {
                if !self.world.expand(plan, self.lane.motion, seed, &mut below) {
                    below.push(seed);
                }
            }
            if below.len() > SEEDS || below == seeds {
                return seeds;
            }
            std::mem::swap(&mut seeds, &mut below);
        }
    }

    /// Smaller parts, or the children of a single pair of nodes; `None` if splitting does not help.
    fn split(
        &self,
        plan: &Plan,
        work: &PassWork,
        collected: &Collected,
    ) -> Result<Option<Vec<PassWork>>, Error> {
        let seeds = match work {
            PassWork::Seeds(seeds) => seeds,
            &PassWork::Cells(cells) => {
                let parts = cells.split(collected, self.lane.pass_buffers.capacities().kept);
                // Lists and tiles are our own: a method of another crate has no parts of a cell.
                let is_list = |parts: &[CellWork]| matches!(parts, [CellWork::List(_)]);
                let parts = parts.filter(|parts| self.guest.is_none() || !is_list(parts));
                return Ok(parts.map(|parts| parts.into_iter().map(PassWork::Cells).collect()));
            }
        };
        if seeds.len() > 1 {
            let (low, high) = seeds.split_at(seeds.len() / 2);
            return Ok(Some(
                [low, high]
                    .map(|half| PassWork::Seeds(half.to_vec()))
                    .into(),
            ));
        }
        let mut below = Vec::new();
        for &seed in seeds {
            if !self.world.expand(plan, self.lane.motion, seed, &mut below) {
                let room = self.lane.pass_buffers.capacities();
                let larger = collected.counts.larger(&self.gpu, room);
                return Err(self.too_small("two clusters", larger));
            }
        }
        Ok(Some(match below.is_empty() {
            true => Vec::new(),
            false => vec![PassWork::Seeds(below)],
        }))
    }

    /// Room for work that cannot be split: the buffers that it needs grow, and all others shrink.
    fn lean(
        &self,
        work: &PassWork,
        collected: &Collected,
        now: Capacities,
        pass_buffers: Option<u64>,
    ) -> Result<Capacities, Error> {
        let needed = &collected.counts.needed;
        let least = Capacities::LEAST.of(self.lane.method);
        let lean = match work {
            PassWork::Cells(cells) => cells.lean(needed, now, least),
            PassWork::Seeds(_) => CellWork::WHOLE.lean(needed, now, least),
        };
        let is_allowed = pass_buffers.is_none_or(|pass_buffers| lean.bytes() <= pass_buffers);
        if lean == now || !is_allowed || !lean.fit(&self.gpu) {
            return Err(self.too_small("the elements of one cell", lean));
        }
        Ok(lean)
    }

    /// One submission and its results.
    async fn pass(
        &mut self,
        plan: &Plan,
        work: &PassWork,
        capacities: Capacities,
        cells: Option<CellsWanted>,
        stats: &mut Stats,
    ) -> Result<Collected, Error> {
        self.lane.is_encoded = false;
        let gpu = Arc::clone(&self.gpu);
        if self.is_traced {
            // The same before, launch by launch.
            let recording = self.record(plan, Some(work), capacities, cells)?;
            self.lane.ran = self.lane.launcher.run_each(&gpu, &recording).await?;
        }
        let scopes = Scopes::open(&gpu.device);
        let submitted = self.submit(plan, work, capacities, cells);
        let closed = scopes.close();
        let (recording, guess) = submitted?;
        closed.await?;
        let names = recording.stages();
        let collected = self
            .lane
            .collector
            .take(&gpu, &self.lane.pass_buffers, names.len(), guess)
            .await?;
        for (&name, &ms) in names.iter().zip(collected.stage_ms.iter().flatten()) {
            stats.add_ms(name, ms);
        }
        self.world.is_refitted(self.lane.motion);
        self.lane.recording = recording;
        Ok(collected)
    }

    fn submit(
        &mut self,
        plan: &Plan,
        work: &PassWork,
        capacities: Capacities,
        cells: Option<CellsWanted>,
    ) -> Result<(Recording, Guess), Error> {
        let mut recording = self.record(plan, Some(work), capacities, cells)?;
        let (gpu, lane) = (&*self.gpu, &mut self.lane);
        let seeks = (lane.motion == Motion::Moving).then_some(self.sought);
        let guess = lane
            .collector
            .record(&lane.pass_buffers, seeks, &mut recording);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("impinge"),
            });
        let times = lane.collector.times(gpu);
        lane.launcher.encode(gpu, &recording, times, &mut encoder)?;
        lane.collector.encode(gpu, &mut encoder, &recording);
        gpu.queue.submit([encoder.finish()]);
        Ok((recording, guess))
    }

    /// Records all stages; without work, only counters of zero.
    pub(super) fn record(
        &mut self,
        plan: &Plan,
        work: Option<&PassWork>,
        mut capacities: Capacities,
        cells: Option<CellsWanted>,
    ) -> Result<Recording, Error> {
        let seeds: &[NodePair] = match work {
            Some(PassWork::Seeds(seeds)) => seeds,
            _ => &[],
        };
        capacities.queue = capacities.queue.max(count(seeds.len()));
        // Buffers that are replaced should be free.
        self.lane.recording = Recording::default();
        self.lane.pass_buffers.resize(&self.gpu, &capacities, cells);
        let leaves_out = self.has_rules(plan);
        let asks = self.asks;
        self.world.widen(asks.reach);
        let mut recording = Recording::default();
        // The caller's step begins with nothing known.
        let sought = (!self.lane.is_encoded).then_some(self.sought);
        let touches_by = sought.and(self.touches_by);
        let start = self.lane.pass_buffers.start(&self.gpu, seeds, touches_by)?;
        for (from, to) in start {
            recording.copy(from, to);
        }
        if asks.test == StepTest::Safe {
            let PassBuffers { limits, shares, .. } = &self.lane.pass_buffers;
            recording.copy(limits.all(), shares.all());
        }
        let mut recorder = Recorder {
            gpu: &self.gpu,
            world: &self.world,
            view: self.world.view(self.lane.motion),
            motion: self.lane.motion,
            pass_buffers: &self.lane.pass_buffers,
            leaves_out,
            recording,
        };
        let (lambda, group_size) = (self.settings.density, self.settings.group_size);
        let has_lists = self.lane.is_encoded && asks.test != StepTest::Safe;
        let resolve = plan.shared_vertex == SharedVertex::Resolve;
        match (work, &mut self.guest) {
            (None, _) => {}
            (Some(PassWork::Seeds(seeds)), _) => recorder.clusters(clusters::ClusterPass {
                n_seeds: count(seeds.len()),
                n_rounds: self.world.rounds(seeds),
                resolve: resolve && asks.test != StepTest::Safe,
                asks,
                kinds: (plan.kinds_named()).map_or(0, |kinds| KINDS_NAMED | kinds.bits()),
                sought,
            }),
            (Some(PassWork::Cells(work)), Some(guest)) => {
                guest.record(&mut recorder, lambda, work.cells())?;
            }
            (Some(&PassWork::Cells(work)), None) => recorder.cells(cells::CellPass {
                lambda,
                group_size,
                resolve,
                work,
            }),
        }
        // Without work, all counters are 0.
        if has_lists && work.is_some() {
            recorder.lists_end();
        }
        Ok(recorder.recording)
    }
}

/// Adds the counts of a complete pass to the statistics.
fn book(collected: &Collected, method: Method, stats: &mut Stats) {
    let needed = &collected.counts.needed;
    stats.n_batches += 1;
    stats.n_work_items += needed.items;
    stats.n_candidates += needed.candidates;
    stats.n_unsure += needed.unsure;
    if method == Method::Cells {
        stats.n_entries += needed.entries;
        stats.n_subdivided += collected.counts.n_subdivided;
        stats.grid = Some(collected.grid.resolution);
    }
}

/// Hands over the certain pairs, and those of the others that exact arithmetic says to intersect.
fn decide_all(
    job: Job<'_>,
    answer: &Answer,
    collected: &Collected,
    decided: &mut Vec<Vec<u64>>,
) -> Result<(), Error> {
    let Job {
        scene,
        plan,
        workers,
        ..
    } = job;
    decided.resize_with(workers.n(), Vec::new);
    let key = |a: u32, b: u32| pair_key(Number::new(a), Number::new(b));
    for certain in collected.pairs.chunks(BLOCK) {
        let keys = &mut decided[0];
        keys.extend(certain.iter().map(|pair| key(pair.low, pair.high)));
        answer.take(keys);
    }
    let unsure = &collected.unsure[..];
    let n_workers = match unsure.len() < PARALLEL_FROM {
        true => 1,
        false => decided.len(),
    };
    let n_tasks = unsure.len().div_ceil(DECIDED_BY_A_TASK);
    workers.for_each(&mut decided[..n_workers], n_tasks, |keys, ix| {
        let first = ix * DECIDED_BY_A_TASK;
        for pair in &unsure[first..unsure.len().min(first + DECIDED_BY_A_TASK)] {
            let key = key(pair.low, pair.high);
            if decide(scene, plan, key) {
                keys.push(key);
            }
        }
        if keys.len() >= BLOCK {
            answer.take(keys);
        }
    });
    for keys in decided {
        answer.take(keys);
    }
    answer.check()
}
