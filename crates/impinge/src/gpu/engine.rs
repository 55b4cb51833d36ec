//! The frame on the device: passes, growing, splitting.
//!
//! A pass takes pairs of tree nodes, its seeds, through all stages in one submission. If a buffer was
//! too small, the counters say how large it must be: it grows and the pass runs again. If it may not
//! grow, by the device's limit or the memory budget, the seeds are split and each half is a pass: in
//! the end a seed is one pair of clusters, for which [`Capacities::LEAST`] is always enough.

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::collect::{Collected, Collector};
use super::device::{Gpu, Scopes};
use super::layout::{Counter, N_COUNTERS, NodePair};
use super::plan::{Launches, Plan, STAGES};
use super::room::{Capacities, Room, Verdict};
use super::world::World;
use crate::error::Error;
use crate::frame::{Frame, pair_key};
use crate::narrow::settle;
use crate::progress::Control;
use crate::query::SharedVertex;
use crate::scene::Scene;
use crate::stats::Statistics;

/// Seeds up to which the host descends before the first launch: each step down saves two launches.
const SEEDS: usize = 512;
/// Unsure pairs from which on threads share them.
const PARALLEL_FROM: usize = 512;

/// The GPU backend of one detector.
#[derive(Debug)]
pub(crate) struct Engine {
    gpu: Arc<Gpu>,
    world: World,
    room: Room,
    plan: Plan,
    collector: Collector,
    launches: Option<Launches>,
    first: Capacities,
}

impl Engine {
    pub fn new(gpu: Arc<Gpu>, first: Capacities) -> Self {
        Engine {
            gpu,
            world: World::new(),
            room: Room::new(),
            plan: Plan::new(),
            collector: Collector::default(),
            launches: None,
            first,
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
        memory_budget: Option<u64>,
        control: &Control<'_>,
        keys: &mut Vec<u64>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let result = self
            .passes(scene, frame, memory_budget, control, keys, stats)
            .await;
        if let Err(Error::Gpu { .. }) = result {
            // Whatever state the buffers are in, the next frame must not build on it.
            *self = Engine::new(Arc::clone(&self.gpu), self.first);
        }
        result
    }

    async fn passes(
        &mut self,
        scene: &Scene,
        frame: &Frame,
        memory_budget: Option<u64>,
        control: &Control<'_>,
        keys: &mut Vec<u64>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        self.gpu.check_lost()?;
        let start = Instant::now();
        let scopes = Scopes::open(&self.gpu.device);
        let updated = self.world.update(&self.gpu, scene, frame, stats);
        let closed = scopes.close();
        if updated? {
            self.launches = None;
        }
        closed.await?;
        stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
        let mut capacities = self.first_room(memory_budget)?;
        let mut waiting = vec![self.descend(frame)];
        while let Some(seeds) = waiting.pop() {
            if seeds.is_empty() {
                continue;
            }
            control.step(stats.n_slabs, stats.n_slabs + waiting.len() as u64 + 1)?;
            let collected = self.pass(frame, &seeds, capacities, stats).await?;
            let bytes = memory_budget.map(|budget| budget.saturating_sub(self.world.bytes()));
            match collected.counts.judge(&self.gpu, capacities, bytes) {
                Verdict::Complete => {
                    stats.n_slabs += 1;
                    stats.n_work_items += collected.counts.needed.items;
                    stats.n_candidates += collected.counts.needed.candidates;
                    stats.n_unsure += collected.counts.needed.unsure;
                    stats.time("settle", |_| settle_all(scene, frame, &collected, keys));
                }
                Verdict::Grow(larger) => {
                    stats.n_reruns += 1;
                    capacities = larger;
                    waiting.push(seeds);
                }
                Verdict::Split => {
                    stats.n_reruns += 1;
                    waiting.extend(self.split(frame, &seeds)?);
                }
            }
        }
        stats.bytes_held = self.world.bytes() + self.room.capacities().bytes();
        Ok(())
    }

    /// Room for the first pass: what there is, unless the budget says less.
    fn first_room(&self, memory_budget: Option<u64>) -> Result<Capacities, Error> {
        let wanted = match &self.launches {
            Some(_) => self.room.capacities(),
            None => self.first.max(self.room.capacities()),
        };
        let Some(budget) = memory_budget else {
            return Ok(wanted);
        };
        let world = self.world.bytes();
        if world + wanted.bytes() <= budget {
            return Ok(wanted);
        }
        let least = Capacities::LEAST;
        let needed = world + least.bytes();
        if needed > budget {
            return Err(Error::MemoryBudget {
                what: "positions, clusters and the smallest pass on the GPU",
                needed,
                budget,
            });
        }
        Ok(least)
    }

    /// Seeds, as far down as the host goes.
    fn descend(&self, frame: &Frame) -> Vec<NodePair> {
        let mut seeds = self.world.seeds(frame);
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

    /// Half of the seeds each, or the children of a single one.
    fn split(&self, frame: &Frame, seeds: &[NodePair]) -> Result<Vec<Vec<NodePair>>, Error> {
        if seeds.len() > 1 {
            let (low, high) = seeds.split_at(seeds.len() / 2);
            return Ok(vec![low.to_vec(), high.to_vec()]);
        }
        let mut below = Vec::new();
        for &seed in seeds {
            if !self.world.expand(frame, seed, &mut below) {
                return Err(Error::Gpu {
                    what: "two clusters do not fit the smallest pass".to_owned(),
                });
            }
        }
        Ok(vec![below])
    }

    /// One submission and its results.
    async fn pass(
        &mut self,
        frame: &Frame,
        seeds: &[NodePair],
        capacities: Capacities,
        stats: &mut Statistics,
    ) -> Result<Collected, Error> {
        let scopes = Scopes::open(&self.gpu.device);
        let submitted = self.submit(frame, seeds, capacities);
        let closed = scopes.close();
        let guess = submitted?;
        closed.await?;
        let collected = self.collector.take(&self.gpu, &self.room, guess).await?;
        if let Some(stage_ms) = collected.stage_ms {
            for (name, ms) in STAGES.into_iter().zip(stage_ms) {
                stats.add_ms(name, ms);
            }
        }
        self.world.is_moved = false;
        Ok(collected)
    }

    fn submit(
        &mut self,
        frame: &Frame,
        seeds: &[NodePair],
        capacities: Capacities,
    ) -> Result<super::collect::Guess, Error> {
        let (gpu, world) = (&*self.gpu, &self.world);
        let n_seeds = super::buffers::count(seeds.len());
        let mut capacities = capacities;
        capacities.queue = capacities.queue.max(n_seeds);
        let mut grew = self.room.resize(gpu, &capacities);
        let resolve = frame.shared_vertex == SharedVertex::Resolve;
        let n_rounds = world.forest().rounds(seeds);
        grew |= self.plan.make(gpu, world, &self.room, n_rounds, resolve)?;
        let fits = self.launches.as_ref().is_some_and(|made| made.fit(world));
        if grew || !fits {
            self.launches = Some(Launches::new(gpu, world, &self.room, &self.plan));
        }
        let launches = self.launches.as_ref().expect("just made");
        let mut counters = [Counter::default(); N_COUNTERS as usize];
        counters[0].n = n_seeds as u32;
        self.room.counters.write(gpu, 0, &counters);
        self.room.queues[0].write(gpu, 0, seeds);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("impinge"),
            });
        let times = self.collector.times(gpu);
        self.plan
            .encode(&mut encoder, launches, world, &self.room, n_seeds, times);
        let guess = self.collector.encode(gpu, &mut encoder, &self.room);
        gpu.queue.submit([encoder.finish()]);
        Ok(guess)
    }
}

/// Takes the certain pairs and settles the others exactly.
fn settle_all(scene: &Scene, frame: &Frame, collected: &Collected, keys: &mut Vec<u64>) {
    keys.extend(
        collected
            .pairs
            .iter()
            .map(|pair| pair_key(pair.low, pair.high)),
    );
    let settled = |pair: &super::layout::UnsureKey| {
        settle(scene, frame, pair.low, pair.high).then(|| pair_key(pair.low, pair.high))
    };
    if collected.unsure.len() < PARALLEL_FROM {
        keys.extend(collected.unsure.iter().filter_map(settled));
    } else {
        keys.par_extend(collected.unsure.par_iter().filter_map(settled));
    }
}
