//! The method `Cells` on the CPU: the paper's two levels.
//!
//! ```text
//! bounds      box of each body; where bodies overlap; elements that reach there and have elements
//!             of another body near them, and their boxes
//! grid        eq. (1) resolution, eq. (3) ranges; count, prefix sum, scatter into cell lists
//! traversal   cells with elements of bodies that meet; lists cut into groups of at most 64;
//!             Cartesian product of groups, eq. (4): work items
//! pairing     4x4x4 sub-cells, axis by axis; owner rule; boxes
//! narrow      filters, then exact arithmetic
//! ```
//!
//! Source: "Real-time Collision Detection with Two-level Spatial Hashing on GPU", section 3. Where
//! we deviate: the owner rule replaces the hash table (nothing is lost or tested twice), and cell
//! lists are bounded by the number of elements: a huge element would touch every cell, so the
//! grid is made coarser until the lists hold at most [`MOST_ENTRIES_EACH`] entries per element.
//! That keeps memory bounded; the price is more pairs per cell, which `n_reruns` and `grid` in the
//! statistics show.

use std::sync::Arc;

use crate::scene::words::debug_by_name;
use crate::workers::clock::Instant;

use crate::bvh::bounds::Aabb;
pub use crate::bvh::grid::MOST_ENTRIES_EACH;
use crate::bvh::grid::{FineRange, Grid};
use crate::query::SharedVertex;
use crate::query::progress::Control;
use crate::query::settings::Settings;
use crate::scene::error::Error;
use crate::scene::index::PartIx;
use crate::search::stats::Stats;

use super::cull_map::{InRegion, KeptList};
use super::narrow::{Candidate, Decider};
use super::subcells::{GroupPair, Lanes64, SubcellQuery};
use super::world::World;
use crate::search::runner::Job;
use crate::search::sink::Answer;
use crate::simd::Isa;
use crate::simd::Lanes;

/// Work items per batch, and per task.
const BATCH_ITEMS: usize = 1 << 18;
const PAIRING_TASK: usize = 32;

/// Decides about two elements of one cell that touch a common sub-cell.
///
/// The method is compiled once per rule. Every detector uses [`Owner`]; other rules are for studies
/// of what the owner rule replaces.
pub trait Rule: Sync {
    /// The pairs that the rule is asked about.
    fn query(&self) -> SubcellQuery;

    /// Whether such a pair is a candidate here. Keys that the rule appends to `keys` become part of
    /// the answer.
    fn admits(&self, a: &InRegion, b: &InRegion, keys: &mut Vec<u64>) -> bool;
}

/// Boxes overlap, and the cell owns the pair: each candidate comes once.
#[derive(Debug, Clone, Copy)]
pub struct Owner;

impl Rule for Owner {
    #[inline(always)]
    fn query(&self) -> SubcellQuery {
        SubcellQuery {
            boxes: true,
            owned: true,
            adjacent: false,
        }
    }

    #[inline(always)]
    fn admits(&self, _: &InRegion, _: &InRegion, _: &mut Vec<u64>) -> bool {
        true
    }
}

/// Two groups of one cell: runs of the cell lists.
#[derive(Debug, Clone, Copy)]
struct CellItem {
    cell: [u32; 3],
    first_a: u32,
    first_b: u32,
    n_a: u8,
    n_b: u8,
}

debug_by_name!(Cells => "Cells");

/// Scratch of the method; kept from frame to frame.
pub struct Cells {
    isa: Isa,
    reaching: KeptList,
    /// Where each cell's list starts, and one past the last.
    starts: Vec<u32>,
    /// The cell lists: indices in `kept`, ascending within a cell, so that those of one body are
    /// together.
    entries: Vec<u32>,
    items: Vec<CellItem>,
    scratches: Vec<Decider>,
}

impl Cells {
    /// Uses the best instruction set that is allowed and available.
    pub fn new(settings: &Settings) -> Self {
        let isa = Isa::detect(settings.instruction_set);
        Cells {
            isa,
            reaching: KeptList::new(isa, settings.tuning),
            starts: Vec::new(),
            entries: Vec::new(),
            items: Vec::new(),
            scratches: Vec::new(),
        }
    }

    /// Hands over the keys of all pairs that the frame asks for and the rule admits.
    ///
    /// # Errors
    /// A memory budget too small for a batch; cancellation.
    pub fn run<R: Rule>(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        settings: &Settings,
        rule: &R,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        match self.divide(job, answer, settings, stats)? {
            Some(grid) => self.decide(job, answer, settings, rule, grid, stats),
            None => Ok(()),
        }
    }

    /// Sorts the elements into the cells of a grid; `None` if no body reaches another, and the
    /// answer is complete.
    pub(super) fn divide(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        settings: &Settings,
        stats: &mut Stats,
    ) -> Result<Option<Grid>, Error> {
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        self.scratches.resize_with(workers.n(), Decider::default);
        for scratch in &mut self.scratches {
            scratch.begin(answer, &settings.tuning);
        }
        self.items.clear();
        let world = World::new(scene, plan);
        let Cells {
            reaching,
            scratches,
            ..
        } = self;
        let n_near = stats.time("bounds", |_| {
            reaching.find_sharing(world, workers, scratches)
        });
        self.reaching.report(&mut stats.ways);
        let Some(region) = self.reaching.region() else {
            stats.n_batches = 1;
            return Ok(None);
        };
        let grid = stats.time("grid", |stats| {
            self.scatter(&region, n_near as u64, settings, control, stats)
        })?;
        stats.grid = Some(grid.resolution);
        Ok(Some(grid))
    }

    /// The number of elements in the cell of an entry, on average over all entries of the lists.
    pub(super) fn crowding(&self) -> u64 {
        let pairs = |ends: &[u32]| u64::from(ends[1] - ends[0]).pow(2);
        let n_pairs: u64 = self.starts.windows(2).map(pairs).sum();
        n_pairs / self.entries.len().max(1) as u64
    }

    /// Pairs the elements of each cell, and hands over the keys.
    pub(super) fn decide<R: Rule>(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        settings: &Settings,
        rule: &R,
        grid: Grid,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let items = size_of::<CellItem>() * self.items.capacity();
        answer.share(self.bytes() - items as u64 + batch_bytes(settings));
        answer.check()?;
        let task = CellsTask {
            job,
            answer,
            world: World::new(job.scene, job.plan),
            rule,
        };
        self.traverse_items(task, grid, settings, stats)?;
        for scratch in &mut self.scratches {
            scratch.end();
            stats.n_candidates += scratch.n_candidates;
            stats.n_unsure += scratch.n_unsure;
            stats.ways.n_full += scratch.n_full;
        }
        answer.check()?;
        stats.n_entries = self.entries.len() as u64;
        stats.bytes_held = self.bytes();
        Ok(())
    }

    fn bytes(&self) -> u64 {
        let bytes = self.reaching.bytes()
            + size_of::<u32>() * (self.starts.capacity() + self.entries.capacity())
            + size_of::<CellItem>() * self.items.capacity()
            + self.scratches.iter().map(Decider::bytes).sum::<usize>();
        bytes as u64
    }

    /// Finds the grid, counts, and scatters elements into cell lists.
    fn scatter(
        &mut self,
        region: &Aabb,
        n_near: u64,
        settings: &Settings,
        control: &Control,
        stats: &mut Stats,
    ) -> Result<Grid, Error> {
        let n = self.reaching.kept.len() as u64;
        let mut grid = Grid::new(region, n_near, settings.density);
        let mut most_entries = n.saturating_mul(MOST_ENTRIES_EACH).min(u64::from(u32::MAX));
        let mut most_cells = u64::MAX;
        if let Some(budget) = settings.memory_budget {
            // Bytes held by now, mainly the boxes of elements, without the lists that are sized
            // below.
            let sized_later = size_of::<u32>() * (self.starts.capacity() + self.entries.capacity())
                + size_of::<CellItem>() * self.items.capacity();
            let fixed = self.bytes() - sized_later as u64 + batch_bytes(settings) + 8;
            let needed = fixed + 4 * n + 12;
            if needed > budget {
                return Err(Error::MemoryBudget {
                    what: "elements' boxes, cell lists and a batch of work items",
                    needed,
                    budget,
                });
            }
            // Half of the remaining bytes is left for the answer.
            let room = n + 3 + (budget - needed) / 2 / 4;
            most_entries = most_entries.min((room / 2).max(n));
            most_cells = room - (room / 2).max(n);
        }
        loop {
            control.step(0, 1)?;
            let mut n_entries = 0;
            for kept in &mut self.reaching.kept {
                kept.range = grid.range(&kept.bounds);
                n_entries += kept.range.n_coarse();
            }
            if n_entries <= most_entries && grid.n_cells() <= most_cells {
                break;
            }
            let Some(coarser) = grid.coarser() else { break };
            grid = coarser;
            stats.n_reruns += 1;
        }
        // Counts go two entries past the cell's own: the prefix sum moves them back by one, and so
        // does the scatter.
        let n_starts = grid.n_cells() as usize + 2;
        self.starts.clear();
        self.starts.reserve_exact(n_starts);
        self.starts.resize(n_starts, 0);
        for kept in &self.reaching.kept {
            for_indices(&grid, &kept.range, |cell| self.starts[cell + 2] += 1);
        }
        let mut n_entries = 0;
        for start in &mut self.starts {
            n_entries += *start;
            *start = n_entries;
        }
        self.entries.clear();
        self.entries.reserve_exact(n_entries as usize);
        self.entries.resize(n_entries as usize, 0);
        for (ix, kept) in (0u32..).zip(&self.reaching.kept) {
            for_indices(&grid, &kept.range, |cell| {
                let next = &mut self.starts[cell + 1];
                self.entries[*next as usize] = ix;
                *next += 1;
            });
        }
        Ok(grid)
    }

    /// Makes the work items of all cells, one batch at a time.
    fn traverse_items<R: Rule>(
        &mut self,
        task: CellsTask<'_, R>,
        grid: Grid,
        settings: &Settings,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let mut paired_ms = 0.0;
        let most_items = task.answer.most_items(batch_items(settings));
        if settings.memory_budget.is_some() {
            self.items.reserve_exact(most_items);
        }
        let Cells {
            isa,
            reaching,
            starts,
            entries,
            items,
            scratches,
            ..
        } = self;
        let lists = Lists {
            world: task.world,
            kept: &reaching.kept,
            entries,
        };
        let n_cells = grid.n_cells() as usize;
        for (ix, ends) in starts.windows(2).take(n_cells).enumerate() {
            // Most cells are empty.
            if ends[1] < ends[0] + 2 {
                continue;
            }
            let cell = grid.cell(ix);
            let list = ends[0] as usize..ends[1] as usize;
            let before = stats.n_work_items + items.len() as u64;
            lists.product(list, settings.group_size as usize, |a, b| {
                if items.len() == most_items {
                    let at = (ix as u64, n_cells as u64);
                    paired_ms += pair(*isa, lists, items, scratches, task, at)?;
                    stats.n_work_items += items.len() as u64;
                    stats.n_batches += 1;
                    items.clear();
                }
                items.push(CellItem {
                    cell,
                    first_a: a.start as u32,
                    first_b: b.start as u32,
                    n_a: a.len() as u8,
                    n_b: b.len() as u8,
                });
                Ok(())
            })?;
            stats.n_subdivided += u64::from(stats.n_work_items + items.len() as u64 > before);
        }
        let at = (n_cells as u64, n_cells as u64);
        paired_ms += pair(*isa, lists, items, scratches, task, at)?;
        stats.n_work_items += items.len() as u64;
        stats.n_batches += 1;
        items.clear();
        let busy: f64 = scratches.iter().map(|s| s.busy.as_secs_f64() * 1e3).sum();
        let narrow_ms = (busy / task.job.workers.n() as f64).min(paired_ms);
        stats.add_ms("traversal", start.elapsed().as_secs_f64() * 1e3 - paired_ms);
        stats.add_ms("pairing", paired_ms - narrow_ms);
        stats.add_ms("narrow", narrow_ms);
        Ok(())
    }
}

fn batch_items(settings: &Settings) -> usize {
    let most = match settings.memory_budget {
        None => BATCH_ITEMS,
        // A small share of the budget; the rest is for boxes and lists.
        Some(budget) => {
            (budget as usize / 16 / size_of::<CellItem>()).clamp(PAIRING_TASK, BATCH_ITEMS)
        }
    };
    most.min(settings.tuning.most_batch_items).max(1)
}

fn batch_bytes(settings: &Settings) -> u64 {
    (batch_items(settings) * size_of::<CellItem>()) as u64
}

/// A frame and the rule for its pairs.
struct CellsTask<'a, R> {
    job: Job<'a>,
    answer: &'a Answer,
    world: World<'a>,
    rule: &'a R,
}

impl<R> Clone for CellsTask<'_, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R> Copy for CellsTask<'_, R> {}

/// Calls back for each coarse cell of a range.
#[inline(always)]
pub fn for_cells(range: &FineRange, mut call: impl FnMut([u32; 3])) {
    let (lo, hi) = range.coarse();
    for z in lo[2]..=hi[2] {
        for y in lo[1]..=hi[1] {
            for x in lo[0]..=hi[0] {
                call([x, y, z]);
            }
        }
    }
}

/// As [`for_cells`], with the cells' indices in the linear array.
#[inline(always)]
fn for_indices(grid: &Grid, range: &FineRange, mut call: impl FnMut(usize)) {
    let (lo, hi) = range.coarse();
    for z in lo[2]..=hi[2] {
        for y in lo[1]..=hi[1] {
            let first = grid.index([lo[0], y, z]);
            for cell in first..first + (hi[0] - lo[0]) as usize + 1 {
                call(cell);
            }
        }
    }
}

/// The cell lists and the elements that they name.
#[derive(Clone, Copy)]
struct Lists<'a> {
    world: World<'a>,
    kept: &'a [InRegion],
    entries: &'a [u32],
}

impl Lists<'_> {
    /// Equation (4) for one cell: for all bodies that meet, all pairs of their groups.
    fn product(
        &self,
        list: std::ops::Range<usize>,
        group_size: usize,
        mut emit: impl FnMut(std::ops::Range<usize>, std::ops::Range<usize>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let plan = self.world.plan;
        let mut a = list.start;
        while a < list.end {
            let (part_a, run_a) = self.run(a, list.end);
            if plan.part(part_a).within && run_a.len() > 1 {
                for group_a in groups(run_a.clone(), group_size) {
                    for group_b in groups(group_a.start..run_a.end, group_size) {
                        emit(group_a.clone(), group_b)?;
                    }
                }
            }
            let mut b = run_a.end;
            while b < list.end && plan.between() {
                let (part_b, run_b) = self.run(b, list.end);
                if plan.test(part_a, part_b).is_some() {
                    for group_a in groups(run_a.clone(), group_size) {
                        for group_b in groups(run_b.clone(), group_size) {
                            emit(group_a.clone(), group_b)?;
                        }
                    }
                }
                b = run_b.end;
            }
            a = run_a.end;
        }
        Ok(())
    }

    /// The part of an entry of a list, and the run of its entries from there on.
    fn run(&self, start: usize, end: usize) -> (PartIx, std::ops::Range<usize>) {
        let owner = |entry: u32| self.kept[entry as usize].part;
        let part = owner(self.entries[start]);
        if owner(self.entries[end - 1]) == part {
            return (part, start..end);
        }
        let len = self.entries[start..end].partition_point(|&entry| owner(entry) == part);
        (part, start..start + len)
    }
}

fn groups(
    run: std::ops::Range<usize>,
    group_size: usize,
) -> impl Iterator<Item = std::ops::Range<usize>> {
    run.clone()
        .step_by(group_size)
        .map(move |start| start..run.end.min(start + group_size))
}

/// Pairs and decides a batch of work items; returns the milliseconds it took.
fn pair<R: Rule>(
    isa: Isa,
    lists: Lists<'_>,
    items: &[CellItem],
    scratches: &mut [Decider],
    task: CellsTask<'_, R>,
    (done, total): (u64, u64),
) -> Result<f64, Error> {
    let start = Instant::now();
    let CellsTask {
        job, answer, rule, ..
    } = task;
    let Job {
        workers, control, ..
    } = job;
    let n_each = workers.task(PAIRING_TASK);
    let n_tasks = items.len().div_ceil(n_each);
    workers.for_each(scratches, n_tasks, |decider, ix| {
        if answer.is_over() || control.step(done, total).is_err() {
            return;
        }
        let first = ix * n_each;
        let items = &items[first..items.len().min(first + n_each)];
        pair_items(isa, lists, items, rule, decider);
    });
    control.step(done, total)?;
    answer.check()?;
    Ok(start.elapsed().as_secs_f64() * 1e3)
}

fn pair_items<R: Rule>(
    isa: Isa,
    lists: Lists<'_>,
    items: &[CellItem],
    rule: &R,
    decider: &mut Decider,
) {
    let mut lanes = Lanes64::default();
    for item in items {
        if decider.is_over() {
            break;
        }
        pair_item(isa, lists, item, rule, &mut lanes, decider);
        decider.decide_when_full(isa, lists.world);
    }
    decider.decide(isa, lists.world);
}

/// The second level of one work item.
#[inline(always)]
fn pair_item<R: Rule>(
    isa: Isa,
    lists: Lists<'_>,
    item: &CellItem,
    rule: &R,
    lanes: &mut Lanes64,
    decider: &mut Decider,
) {
    let (first_a, first_b) = (item.first_a as usize, item.first_b as usize);
    let kept = |entry: u32| &lists.kept[entry as usize];
    let group_a = &lists.entries[first_a..first_a + usize::from(item.n_a)];
    let group_b = &lists.entries[first_b..first_b + usize::from(item.n_b)];
    // A group's elements are of one body.
    let owner = kept(group_a[0]).part;
    let one_body = owner == kept(group_b[0]).part;
    let groups = GroupPair {
        kept: lists.kept,
        a: group_a,
        b: group_b,
        cell: item.cell,
        same: first_a == first_b,
        body: one_body.then(|| lists.world.body(owner)),
    };
    let query = rule.query();
    lanes.find(isa, groups, query);
    let resolve = lists.world.plan.shared_vertex == SharedVertex::Resolve;
    for (i, &entry_a) in group_a.iter().enumerate() {
        let a = kept(entry_a);
        for j in Lanes(lanes.partners[i] & !lanes.adjacent[i]) {
            let b = kept(group_b[j]);
            if rule.admits(a, b, &mut decider.keys) {
                decider.push(Candidate {
                    a: a.part,
                    b: b.part,
                    slot_a: a.slot(),
                    slot_b: b.slot(),
                });
            }
        }
        let Some(body) = groups.body.filter(|_| resolve || query.adjacent) else {
            continue;
        };
        for j in Lanes(lanes.adjacent[i]) {
            let b = kept(group_b[j]);
            if rule.admits(a, b, &mut decider.keys) && resolve {
                decider.decide_shared(&body, a.slot(), b.slot());
            }
        }
    }
}
