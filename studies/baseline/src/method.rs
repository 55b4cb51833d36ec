//! Parallel spatial hashing on the CPU: one uniform grid, sorted.
//!
//! ```text
//! bounds    boxes of the bodies, the region where they overlap, elements that reach it, and their boxes
//! grid      resolution by eq. (1) with λ = 5, ranges of cells by eq. (3), entries counted
//! fill      exclusive sum of the counts; one entry (cell, element) for every cell that a box touches
//! sort      radix sort by cell
//! compact   cells that have elements of both bodies, and the slots of their entries
//! pairing   box tests of all pairs of a cell
//! narrow    the exact test
//! collect   sorted, repetitions dropped
//! ```

use std::sync::{Arc, Mutex};
use std::time::Instant;

use impinge_core::bvh::bounds::Aabb;
use impinge_core::bvh::grid::Grid;
use impinge_core::cpu::cells::{MOST_ENTRIES_EACH, for_cells};
use impinge_core::cpu::cull_map::{InRegion, KeptList};
use impinge_core::cpu::world::World;
use impinge_core::search::runner::Job;
use impinge_core::search::sink::Answer;
use impinge_core::simd::Isa;
use impinge_core::{InstructionSet, Stats};

use crate::pairing::{Lists, Run, Scratch};
use crate::radix::Radix;
use crate::{Counts, Error, Settings};

/// Elements, entries and runs per task.
const ELEMENTS: usize = 4096;
const ENTRIES: usize = 1 << 14;
const RUNS: usize = 64;
/// Elements of body `a` in one run.
const GROUP: u32 = impinge_core::bvh::GROUP as u32;

/// The stages and their memory.
pub(crate) struct Method {
    isa: Isa,
    reaching: KeptList,
    /// The number of entries of each task; after the prefix sum, their beginnings.
    firsts: Vec<Mutex<u64>>,
    /// `cell << 32 | slot in kept`.
    entries: Vec<u64>,
    radix: Radix,
    parts: Vec<Mutex<Part>>,
    runs: Vec<Run>,
    scratches: Vec<Scratch>,
    /// The counts of the last frame.
    pub counts: Counts,
}

/// The result of one task of `compact`.
#[derive(Debug, Default)]
struct Part {
    runs: Vec<Run>,
    n_mixed_cells: u64,
}

impl Method {
    pub fn new(allowed: InstructionSet) -> Self {
        let isa = Isa::detect(allowed);
        Method {
            isa,
            reaching: KeptList::new(isa, impinge_core::Tuning::default()),
            firsts: Vec::new(),
            entries: Vec::new(),
            radix: Radix::default(),
            parts: Vec::new(),
            runs: Vec::new(),
            scratches: Vec::new(),
            counts: Counts::default(),
        }
    }

    /// Hands over the keys of all pairs, with repetitions.
    pub fn run(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        settings: &Settings,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let world = World::new(job.scene, job.plan);
        self.counts = Counts::default();
        self.scratches
            .resize_with(job.workers.n(), Scratch::default);
        for scratch in &mut self.scratches {
            scratch.begin(answer);
        }
        stats.n_batches = 1;
        let Method {
            reaching,
            scratches,
            ..
        } = self;
        let n_near = stats.time("bounds", |_| {
            if settings.coarse_map {
                return reaching.find_sharing(world, job.workers, scratches);
            }
            reaching.find(world, job.workers, scratches);
            reaching.kept.len()
        });
        let Some(region) = reaching.region() else {
            return Ok(());
        };
        let grid = stats.time("grid", |stats| {
            self.grid(job, &region, n_near, settings, stats)
        })?;
        stats.time("fill", |_| self.fill(job, &grid));
        let Method {
            radix,
            entries,
            scratches,
            ..
        } = self;
        stats.time("sort", |_| {
            radix.sort(entries, grid.n_cells(), job.workers, scratches);
        });
        stats.time("compact", |_| self.compact(job));
        self.pair(job, world, &grid, settings, stats);
        for scratch in &mut self.scratches {
            scratch.decider.end();
        }
        answer.check()?;
        self.book(&grid, stats);
        Ok(())
    }

    /// The grid, the cells that each element touches, and how many entries each task makes.
    fn grid(
        &mut self,
        job: Job<'_>,
        region: &Aabb,
        n_near: usize,
        settings: &Settings,
        stats: &mut Stats,
    ) -> Result<Grid, Error> {
        let kept = &mut self.reaching.kept;
        let n_tasks = kept.len().div_ceil(ELEMENTS);
        self.firsts
            .resize_with(n_tasks.max(self.firsts.len()), Mutex::default);
        // As in `Cells`, the number of entries is bounded: a huge element would touch every cell
        // of a fine grid.
        let most = (kept.len() as u64)
            .saturating_mul(MOST_ENTRIES_EACH)
            .min(u64::from(u32::MAX));
        let mut grid = Grid::new(region, n_near as u64, settings.lambda);
        loop {
            let parts: Vec<Mutex<&mut [InRegion]>> =
                kept.chunks_mut(ELEMENTS).map(Mutex::new).collect();
            let firsts = &self.firsts;
            job.workers.for_each(&mut self.scratches, n_tasks, |_, ix| {
                let mut n_entries = 0;
                for kept in parts[ix].lock().expect("no task panics").iter_mut() {
                    kept.range = grid.range(&kept.bounds);
                    n_entries += kept.range.n_coarse();
                }
                *firsts[ix].lock().expect("no task panics") = n_entries;
            });
            let mut n_entries = 0u64;
            for first in &mut self.firsts[..n_tasks] {
                let first = first.get_mut().expect("no task panics");
                n_entries += std::mem::replace(first, n_entries);
            }
            self.counts.n_entries = n_entries;
            if n_entries <= most {
                return Ok(grid);
            }
            let Some(coarser) = grid.coarser() else {
                // Even one cell, where every element has one entry, has too many entries.
                return Err(Error::TooMany {
                    what: "cell-element pairs",
                    given: n_entries,
                    limit: most,
                });
            };
            grid = coarser;
            stats.n_reruns += 1;
        }
    }

    /// The entries, in the order of elements.
    fn fill(&mut self, job: Job<'_>, grid: &Grid) {
        let kept = &self.reaching.kept;
        let n_tasks = kept.len().div_ceil(ELEMENTS);
        // The count was checked to fit in 32 bits.
        self.entries.clear();
        self.entries.resize(self.counts.n_entries as usize, 0);
        let mut slots = Vec::with_capacity(n_tasks);
        let mut rest = &mut self.entries[..];
        let mut first = 0;
        for next in &mut self.firsts[..n_tasks] {
            let next = *next.get_mut().expect("no task panics") as usize;
            let (task, others) = rest.split_at_mut(next - first);
            (rest, first) = (others, next);
            slots.push(Mutex::new(task));
        }
        // The part that was split off belongs to the task before.
        slots.push(Mutex::new(rest));
        job.workers.for_each(&mut self.scratches, n_tasks, |_, ix| {
            let mut slots = slots[ix + 1].lock().expect("no task panics");
            let mut slots = slots.iter_mut();
            let first = ix * ELEMENTS;
            for (slot, kept) in (first as u64..).zip(kept[first..].iter().take(ELEMENTS)) {
                for_cells(&kept.range, |cell| {
                    let entry = slots.next().expect("counted before");
                    *entry = (grid.index(cell) as u64) << 32 | slot;
                });
            }
        });
    }

    /// Cells with elements of both bodies, as runs of the sorted entries.
    fn compact(&mut self, job: Job<'_>) {
        let entries = &self.entries[..];
        let n_tasks = entries.len().div_ceil(ENTRIES);
        self.parts
            .resize_with(n_tasks.max(self.parts.len()), Mutex::default);
        // Kept elements of the first body come first.
        let kept = &self.reaching.kept;
        let first_of_b = kept.partition_point(|kept| kept.part.index() == 0) as u64;
        let parts = &self.parts;
        let cell = |ix: usize| entries[ix] >> 32;
        job.workers
            .for_each(&mut self.scratches, n_tasks, |_, task| {
                let mut part = parts[task].lock().expect("no task panics");
                part.runs.clear();
                part.n_mixed_cells = 0;
                let end = entries.len().min((task + 1) * ENTRIES);
                let mut at = task * ENTRIES;
                // A cell belongs to the task in which it begins.
                while at > 0 && at < end && cell(at) == cell(at - 1) {
                    at += 1;
                }
                while at < end {
                    let here = cell(at);
                    let of_here = entries[at..]
                        .iter()
                        .take_while(|&&entry| entry >> 32 == here);
                    let (mut n, mut n_a) = (0, 0);
                    for &entry in of_here {
                        n += 1;
                        n_a += usize::from(entry & u64::from(u32::MAX) < first_of_b);
                    }
                    if n_a > 0 && n_a < n {
                        part.n_mixed_cells += 1;
                        part.put(here as u32, at as u32, (at + n_a) as u32, (at + n) as u32);
                    }
                    at += n;
                }
            });
        self.runs.clear();
        for part in &mut self.parts[..n_tasks] {
            let part = part.get_mut().expect("no task panics");
            self.runs.extend_from_slice(&part.runs);
            self.counts.n_mixed_cells += part.n_mixed_cells;
        }
    }

    /// All pairs of all cells.
    fn pair(
        &mut self,
        job: Job<'_>,
        world: World<'_>,
        grid: &Grid,
        settings: &Settings,
        stats: &mut Stats,
    ) {
        let start = Instant::now();
        let lists = Lists {
            world,
            grid,
            kept: &self.reaching.kept,
            entries: &self.entries,
            owner_rule: settings.owner_rule,
        };
        let (isa, runs) = (self.isa, &self.runs[..]);
        let n_tasks = runs.len().div_ceil(RUNS);
        job.workers
            .for_each(&mut self.scratches, n_tasks, |scratch, ix| {
                let runs = &runs[ix * RUNS..runs.len().min((ix + 1) * RUNS)];
                scratch.pair(isa, lists, runs);
            });
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let busy = self.scratches.iter().map(|s| s.decider.busy.as_secs_f64());
        let narrow_ms = (busy.sum::<f64>() * 1e3 / job.workers.n() as f64).min(ms);
        stats.add_ms("pairing", ms - narrow_ms);
        stats.add_ms("narrow", narrow_ms);
    }

    fn book(&mut self, grid: &Grid, stats: &mut Stats) {
        let counts = &mut self.counts;
        counts.resolution = grid.resolution;
        counts.n_reaching = self.reaching.kept.len() as u64;
        for scratch in &self.scratches {
            counts.n_box_tests += scratch.n_box_tests;
            counts.n_tests += scratch.decider.n_candidates;
            counts.n_unsure += scratch.decider.n_unsure;
        }
        stats.grid = Some(counts.resolution);
        stats.n_entries = counts.n_entries;
        stats.n_subdivided = counts.n_mixed_cells;
        stats.n_candidates = counts.n_tests;
        stats.n_unsure = counts.n_unsure;
        let bytes = self.reaching.bytes()
            + size_of::<u64>() * self.entries.capacity()
            + self.radix.bytes()
            + 2 * size_of::<Run>() * self.runs.capacity()
            + self.scratches.iter().map(Scratch::bytes).sum::<usize>();
        stats.bytes_held = bytes as u64;
    }
}

impl Part {
    /// Adds the entries of one cell, cut into runs so that large cells can be shared among tasks.
    fn put(&mut self, cell: u32, first: u32, middle: u32, end: u32) {
        let mut first_a = first;
        while first_a < middle {
            let end_a = middle.min(first_a.saturating_add(GROUP));
            self.runs.push(Run {
                cell,
                first_a,
                end_a,
                first_b: middle,
                end_b: end,
            });
            first_a = end_a;
        }
    }
}
