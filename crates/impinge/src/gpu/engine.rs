//! The frame on the device: passes, growing, splitting.
//!
//! A pass takes its share of the work through all stages in one submission. If a buffer was too small,
//! the counters say how large it must be: it grows and the pass runs again. If it may not grow, by the
//! device's limit or the memory budget, the work is split and each half is a pass. What is split:
//!
//! * `Clusters`: pairs of tree nodes, the seeds of the traversal, down to one pair of clusters;
//! * `Cells`: cells.
//!
//! In the end a pass has one work item, for which [`Capacities::LEAST`] is enough.

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::buffers::{Storage, count};
use super::cells::{self, InCells, Part, Told};
use super::clusters;
use super::collect::{Collected, Collector, Guess};
use super::device::{Gpu, Scopes};
use super::layout::{Cell, NodePair};
use super::room::{Capacities, CellsWanted, Counts, Room, Verdict};
use super::steps::Stages;
use super::world::World;
use crate::detector::Method;
use crate::error::Error;
use crate::frame::{Frame, pair_key};
use crate::narrow::settle;
use crate::progress::Control;
use crate::query::SharedVertex;
use crate::scene::{BodyId, Scene};
use crate::stats::Statistics;

/// Seeds up to which the host descends before the first launch: each step down saves two launches.
const SEEDS: usize = 512;
/// Unsure pairs from which on threads share them.
const PARALLEL_FROM: usize = 512;
/// Cells at most, whatever lambda says.
const MOST_CELLS: u64 = 1 << 25;
/// The share of a memory budget that cells may have.
const SHARE_OF_CELLS: u64 = 8;

/// What the backend is told.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The method; for one from outside, the one whose room it works in.
    pub method: Method,
    /// Cells a primitive, the paper's λ.
    pub lambda: f64,
    /// Primitives a group, at most.
    pub group_size: u32,
    /// `Clusters`: whether bodies that have flowed away from their clusters are clustered again.
    pub recluster: bool,
    /// Bytes on the device, at most.
    pub memory_budget: Option<u64>,
}

/// The GPU backend of one detector.
#[derive(Debug)]
pub struct Engine {
    gpu: Arc<Gpu>,
    options: Options,
    first: Capacities,
    pub(super) world: World,
    pub(super) room: Room,
    plan: Plan,
    /// What each complete pass of the last frame counted.
    pub complete: Vec<Counts>,
    collector: Collector,
}

#[derive(Debug)]
enum Plan {
    Clusters(clusters::Plan),
    Cells(Box<dyn InCells>),
}

/// What a pass does.
#[derive(Debug, Clone)]
pub(super) enum Work {
    Seeds(Vec<NodePair>),
    Part(Part),
}

impl Engine {
    pub fn new(gpu: Arc<Gpu>, options: Options, first: Capacities) -> Self {
        let plan = match options.method {
            Method::Cells => Plan::Cells(Box::new(cells::Plan::new())),
            _ => Plan::Clusters(clusters::Plan::new()),
        };
        Engine::with_plan(gpu, options, first, plan)
    }

    /// With a plan from outside.
    pub fn of_guest(
        gpu: Arc<Gpu>,
        options: Options,
        first: Capacities,
        plan: Box<dyn InCells>,
    ) -> Self {
        Engine::with_plan(gpu, options, first.of(options.method), Plan::Cells(plan))
    }

    fn with_plan(gpu: Arc<Gpu>, options: Options, first: Capacities, plan: Plan) -> Self {
        Engine {
            gpu,
            options,
            first: first.of(options.method),
            world: World::new(),
            room: Room::new(),
            plan,
            complete: Vec::new(),
            collector: Collector::default(),
        }
    }

    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Appends the keys of all pairs that the frame asks for, unsorted.
    ///
    /// # Errors
    /// The device's own, a budget too small for the smallest pass, cancellation.
    pub async fn run(
        &mut self,
        scene: &Scene,
        frame: &Frame,
        control: &Control<'_>,
        keys: &mut Vec<u64>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let result = self.passes(scene, frame, control, keys, stats).await;
        if let Err(Error::Gpu { .. }) = result {
            // Whatever state the buffers are in, the next frame must not build on it.
            let plan = match &self.plan {
                Plan::Clusters(_) => Plan::Clusters(clusters::Plan::new()),
                Plan::Cells(plan) => Plan::Cells(plan.anew()),
            };
            *self = Engine::with_plan(Arc::clone(&self.gpu), self.options, self.first, plan);
        }
        result
    }

    async fn passes(
        &mut self,
        scene: &Scene,
        frame: &Frame,
        control: &Control<'_>,
        keys: &mut Vec<u64>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        self.gpu.check_lost()?;
        self.complete.clear();
        let start = Instant::now();
        let scopes = Scopes::open(&self.gpu.device);
        let updated = self.update(scene, frame, &[], stats);
        let closed = scopes.close();
        updated?;
        closed.await?;
        stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
        let cells = self.cells_wanted(frame);
        let mut capacities = self.first_room(cells)?;
        let mut waiting = Vec::from_iter(self.whole(frame));
        while let Some(work) = waiting.pop() {
            let done = stats.n_slabs;
            control.step(done, done + count(waiting.len()) + 1)?;
            let collected = self.pass(frame, &work, capacities, cells, stats).await?;
            let room = self.budget_for_room();
            match collected.counts.judge(&self.gpu, capacities, room) {
                Verdict::Complete => {
                    book(&collected, self.options.method, stats);
                    self.complete.push(collected.counts);
                    stats.time("settle", |_| settle_all(scene, frame, &collected, keys));
                }
                Verdict::Grow(larger) => {
                    stats.n_reruns += 1;
                    capacities = larger;
                    waiting.push(work);
                }
                Verdict::Split => {
                    stats.n_reruns += 1;
                    match self.split(frame, &work, &collected)? {
                        Some(parts) => waiting.extend(parts),
                        None => {
                            capacities = self.lean(&collected, capacities, room)?;
                            waiting.push(work);
                        }
                    }
                }
            }
        }
        stats.bytes_held = self.world.bytes() + self.room.bytes();
        Ok(())
    }

    /// Brings the device up to the frame, but for positions that are on the device already.
    pub(super) fn update(
        &mut self,
        scene: &Scene,
        frame: &Frame,
        resident: &[BodyId],
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        // In `Cells` clusters only tell what is out of reach.
        let recluster = self.options.recluster && self.options.method == Method::Clusters;
        if self
            .world
            .update(&self.gpu, scene, frame, resident, recluster, stats)?
        {
            self.unbind();
        }
        Ok(())
    }

    /// What the budget leaves for buffers that grow by themselves.
    pub(super) fn budget_for_room(&self) -> Option<u64> {
        let fixed = self.world.bytes() + self.room.bytes_of_cells();
        let budget = self.options.memory_budget;
        budget.map(|budget| budget.saturating_sub(fixed))
    }

    /// Room from the next frame on.
    pub(super) fn grow_to(&mut self, capacities: Capacities) {
        self.first = capacities;
    }

    fn unbind(&mut self) {
        match &mut self.plan {
            Plan::Clusters(plan) => plan.unbind(),
            Plan::Cells(plan) => plan.unbind(),
        }
    }

    /// Room for the grid: as many cells as equation (1) can ask for.
    pub(super) fn cells_wanted(&self, frame: &Frame) -> Option<CellsWanted> {
        if self.options.method != Method::Cells {
            return None;
        }
        let most = MOST_CELLS.min(Storage::<Cell>::limit(&self.gpu));
        let most = self.options.memory_budget.map_or(most, |budget| {
            most.min(budget / SHARE_OF_CELLS / CellsWanted::CELL)
        });
        // Below 2^25, so the cast back is exact enough.
        let asked = (frame.n_primitives() as f64 * self.options.lambda).min(MOST_CELLS as f64);
        Some(CellsWanted {
            n_cells: (asked.ceil() as u64).min(most).max(1),
            n_bodies: count(frame.participants.len()),
        })
    }

    /// Room for the first pass: what there is, unless the budget says less.
    pub(super) fn first_room(&self, cells: Option<CellsWanted>) -> Result<Capacities, Error> {
        let wanted = self.first.max(self.room.capacities());
        let Some(budget) = self.options.memory_budget else {
            return Ok(wanted);
        };
        let fixed = self.world.bytes() + cells.map_or(0, |cells| cells.bytes());
        let held = self.room.capacities();
        for wanted in [wanted, held.max(Capacities::LEAST)] {
            if fixed + wanted.bytes() <= budget {
                return Ok(wanted);
            }
        }
        let least = Capacities::LEAST.of(self.options.method);
        let needed = fixed + least.bytes();
        if needed > budget {
            return Err(Error::MemoryBudget {
                what: "positions, clusters and the smallest pass on the GPU",
                needed,
                budget,
            });
        }
        Ok(least)
    }

    /// All of the work, if there is any.
    pub(super) fn whole(&self, frame: &Frame) -> Option<Work> {
        let seeds = self.world.seeds(frame);
        if seeds.is_empty() {
            return None;
        }
        Some(match self.plan {
            Plan::Clusters(_) => Work::Seeds(self.descend(frame, seeds)),
            Plan::Cells(_) => Work::Part(Part::ALL),
        })
    }

    /// Seeds, as far down as the host goes.
    fn descend(&self, frame: &Frame, mut seeds: Vec<NodePair>) -> Vec<NodePair> {
        let mut below = Vec::new();
        loop {
            below.clear();
            for &seed in &seeds {
                if !self.world.expand(frame, seed, &mut below) {
                    below.push(seed);
                }
            }
            if below.len() > SEEDS || below == seeds {
                return seeds;
            }
            std::mem::swap(&mut seeds, &mut below);
        }
    }

    /// Two halves, or the children of a single pair of nodes; none when that is no help.
    fn split(
        &self,
        frame: &Frame,
        work: &Work,
        collected: &Collected,
    ) -> Result<Option<Vec<Work>>, Error> {
        let seeds = match work {
            Work::Seeds(seeds) => seeds,
            Work::Part(part) => return Ok(self.split_part(*part, collected)),
        };
        if seeds.len() > 1 {
            let (low, high) = seeds.split_at(seeds.len() / 2);
            return Ok(Some(
                [low, high].map(|half| Work::Seeds(half.to_vec())).into(),
            ));
        }
        let mut below = Vec::new();
        for &seed in seeds {
            if !self.world.expand(frame, seed, &mut below) {
                return Err(self.too_small("two clusters", Capacities::LEAST));
            }
        }
        Ok(Some(match below.is_empty() {
            true => Vec::new(),
            false => vec![Work::Seeds(below)],
        }))
    }

    fn split_part(&self, part: Part, collected: &Collected) -> Option<Vec<Work>> {
        // What is kept does not depend on the part.
        let needed = &collected.counts.needed;
        if needed.kept > self.room.capacities().kept {
            return None;
        }
        let halves = part.split(collected.grid.n_cells)?;
        Some(halves.map(Work::Part).into())
    }

    /// Room for what cannot be split, at the cost of all that can.
    fn lean(
        &self,
        collected: &Collected,
        now: Capacities,
        room: Option<u64>,
    ) -> Result<Capacities, Error> {
        let needed = &collected.counts.needed;
        let least = Capacities::LEAST.of(self.options.method);
        let lean = Capacities {
            kept: needed.kept.max(least.kept),
            entries: match needed.kept > now.kept {
                true => least.entries,
                false => needed.entries.max(least.entries),
            },
            ..least
        };
        let is_allowed = room.is_none_or(|room| lean.bytes() <= room);
        if lean == now || !is_allowed || !lean.fit(&self.gpu) {
            return Err(self.too_small("the primitives of one cell", lean));
        }
        Ok(lean)
    }

    pub(super) fn too_small(&self, what: &'static str, needed: Capacities) -> Error {
        match self.options.memory_budget {
            Some(budget) => Error::MemoryBudget {
                what,
                needed: self.world.bytes() + needed.bytes(),
                budget,
            },
            None => Error::Gpu {
                what: format!("{} cannot hold {what}", self.gpu.name()),
            },
        }
    }

    /// One submission and its results.
    async fn pass(
        &mut self,
        frame: &Frame,
        work: &Work,
        capacities: Capacities,
        cells: Option<CellsWanted>,
        stats: &mut Statistics,
    ) -> Result<Collected, Error> {
        let scopes = Scopes::open(&self.gpu.device);
        let submitted = self.submit(frame, work, capacities, cells);
        let closed = scopes.close();
        let guess = submitted?;
        closed.await?;
        let names = self.stages();
        let collected = self
            .collector
            .take(&self.gpu, &self.room, names.len(), guess)
            .await?;
        for (&name, &ms) in names.iter().zip(collected.stage_ms.iter().flatten()) {
            stats.add_ms(name, ms);
        }
        self.world.is_moved = false;
        Ok(collected)
    }

    fn stages(&self) -> &'static [&'static str] {
        match &self.plan {
            Plan::Clusters(_) => clusters::STAGES,
            Plan::Cells(plan) => plan.stages(),
        }
    }

    fn submit(
        &mut self,
        frame: &Frame,
        work: &Work,
        capacities: Capacities,
        cells: Option<CellsWanted>,
    ) -> Result<Guess, Error> {
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("impinge"),
            });
        let times = self.collector.times(&self.gpu).cloned();
        let times = times.as_ref();
        self.encode_pass(frame, Some(work), capacities, cells, times, &mut encoder)?;
        let (gpu, n_stages) = (&*self.gpu, self.stages().len() as u32);
        let guess = self
            .collector
            .encode(gpu, &mut encoder, &self.room, n_stages);
        gpu.queue.submit([encoder.finish()]);
        Ok(guess)
    }

    /// Encodes all stages; without work, counters that say so.
    pub(super) fn encode_pass(
        &mut self,
        frame: &Frame,
        work: Option<&Work>,
        mut capacities: Capacities,
        cells: Option<CellsWanted>,
        times: Option<&wgpu::QuerySet>,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), Error> {
        let seeds: &[NodePair] = match work {
            Some(Work::Seeds(seeds)) => seeds,
            _ => &[],
        };
        capacities.queue = capacities.queue.max(count(seeds.len()));
        if self.room.resize(&self.gpu, &capacities, cells) {
            self.unbind();
        }
        let names = self.stages();
        let gpu = &*self.gpu;
        self.room.encode_start(gpu, seeds, encoder)?;
        let (world, room) = (&self.world, &self.room);
        let resolve = frame.shared_vertex == SharedVertex::Resolve;
        let mut stages = Stages {
            names,
            encoder,
            times,
            next: 0,
        };
        match (&mut self.plan, work) {
            (Plan::Clusters(plan), Some(Work::Seeds(seeds))) => {
                plan.make(gpu, world, room, world.forest().rounds(seeds), resolve)?;
                plan.encode(&mut stages, world, room, count(seeds.len()));
            }
            (Plan::Cells(plan), Some(Work::Part(part))) => {
                let told = Told {
                    lambda: self.options.lambda,
                    group_size: self.options.group_size,
                    resolve,
                };
                plan.make(gpu, world, room, told, *part)?;
                plan.encode(&mut stages, world, room);
            }
            (_, None) => (),
            _ => unreachable!("work is made for the plan"),
        }
        Ok(())
    }
}

/// Counts of a pass that is complete.
fn book(collected: &Collected, method: Method, stats: &mut Statistics) {
    let needed = &collected.counts.needed;
    stats.n_slabs += 1;
    stats.n_work_items += needed.items;
    stats.n_candidates += needed.candidates;
    stats.n_unsure += needed.unsure;
    if method == Method::Cells {
        stats.n_entries += needed.entries;
        stats.n_subdivided += collected.counts.n_subdivided;
        stats.grid = Some(collected.grid.resolution);
    }
}

/// Takes the certain pairs and settles the others exactly.
fn settle_all(scene: &Scene, frame: &Frame, collected: &Collected, keys: &mut Vec<u64>) {
    let certain = collected.pairs.iter();
    keys.extend(certain.map(|pair| pair_key(pair.low, pair.high)));
    let settled = |pair: &super::layout::UnsureKey| {
        settle(scene, frame, pair.low, pair.high).then(|| pair_key(pair.low, pair.high))
    };
    if collected.unsure.len() < PARALLEL_FROM {
        keys.extend(collected.unsure.iter().filter_map(settled));
    } else {
        keys.par_extend(collected.unsure.par_iter().filter_map(settled));
    }
}
