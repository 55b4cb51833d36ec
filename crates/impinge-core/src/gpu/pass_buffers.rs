//! Buffers for the results of a pass: queues, work items, candidates, pairs, unsure pairs.
//!
//! Their sizes are not known in advance. Kernels count what they need, even if it does not fit.
//! Buffers that were too small grow, and the pass runs again. If the device or the memory budget
//! allows no more, the engine splits the pass instead.

use std::sync::Arc;

use super::buffers::{Slice, Storage, count};
use super::layout::{
    Arguments, Candidate, Cell, CellItem, Counter, Grid, Kept, ListEntry, N_BOX_TESTS,
    N_BOX_TESTS_HIGH, N_CANDIDATES, N_COUNTERS, N_ENTRIES, N_ITEMS, N_KEPT, N_PAIRS, N_SUBDIVIDED,
    N_TALLIES, N_UNSURE, NEVER, NodePair, PairKey, PairTimes, ROUNDS, Reach, Rule, Share, Start,
    TOO_MUCH, TOUCHES_BY, Tally, UnsureKey, WorkItem, time_by,
};
use super::open::GpuContext;
use crate::plan::LeftOut;
use crate::query::goal::Goal;
use crate::query::settings::Method;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;

/// The number of elements that each buffer has room for. The answer never depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Capacities {
    /// Pairs of tree nodes waiting in one round.
    pub queue: u64,
    /// Work items.
    pub items: u64,
    /// `Cells`: elements within reach of another body.
    pub kept: u64,
    /// `Cells`: entries of the cell lists.
    pub entries: u64,
    /// Candidates.
    pub candidates: u64,
    /// Pairs that certainly intersect. In a step, pairs that tests of the whole step leave.
    pub pairs: u64,
    /// Pairs left to exact arithmetic. In a step, all that the device leaves.
    pub unsure: u64,
}

impl Default for Capacities {
    fn default() -> Self {
        Capacities {
            queue: 1 << 15,
            items: 1 << 15,
            kept: 1 << 15,
            entries: 1 << 16,
            candidates: 1 << 18,
            pairs: 1 << 16,
            unsure: 1 << 14,
        }
    }
}

/// Candidates of two full clusters: the least that a pass must be able to hold.
const ONE_ITEM: u64 = 64 * 64;

impl Capacities {
    /// Enough for a pass of one pair of clusters.
    pub const LEAST: Capacities = Capacities {
        queue: 512,
        items: 64,
        kept: 64,
        entries: 64,
        candidates: ONE_ITEM,
        pairs: ONE_ITEM,
        unsure: ONE_ITEM,
    };

    /// No room at all: there are no buffers yet.
    pub const NONE: Capacities = Capacities {
        queue: 0,
        items: 0,
        kept: 0,
        entries: 0,
        candidates: 0,
        pairs: 0,
        unsure: 0,
    };

    /// Without the room that only the other method needs.
    pub fn of(self, method: Method) -> Self {
        match method {
            Method::Cells => Capacities { queue: 1, ..self },
            _ => Capacities {
                kept: 1,
                entries: 1,
                ..self
            },
        }
    }

    /// Bytes on the device, read-back included.
    pub fn bytes(&self) -> u64 {
        let item = size_of::<WorkItem>().max(size_of::<CellItem>());
        2 * self.queue * size_of::<NodePair>() as u64
            + self.items * item as u64
            + self.kept * size_of::<Kept>() as u64
            + self.entries * size_of::<ListEntry>() as u64
            + self.candidates * size_of::<Candidate>() as u64
            + 2 * self.pairs * size_of::<PairKey>() as u64
            + 2 * self.unsure * (size_of::<UnsureKey>() + size_of::<PairTimes>()) as u64
    }

    fn zip(self, other: Self, pick: impl Fn(u64, u64) -> u64) -> Self {
        Capacities {
            queue: pick(self.queue, other.queue),
            items: pick(self.items, other.items),
            kept: pick(self.kept, other.kept),
            entries: pick(self.entries, other.entries),
            candidates: pick(self.candidates, other.candidates),
            pairs: pick(self.pairs, other.pairs),
            unsure: pick(self.unsure, other.unsure),
        }
    }

    /// The larger of both, each buffer for itself.
    pub fn max(self, other: Self) -> Self {
        self.zip(other, u64::max)
    }

    fn fits(self, pass_buffers: Self) -> bool {
        self.max(pass_buffers) == pass_buffers
    }

    /// Whether the device can bind this much.
    pub fn fit(self, gpu: &GpuContext) -> bool {
        self.fits(Capacities::limit(gpu))
    }

    /// As much of it as the device can bind.
    pub(super) fn within(self, gpu: &GpuContext) -> Self {
        self.zip(Capacities::limit(gpu), u64::min)
    }

    /// The most that one binding of the device may hold.
    fn limit(gpu: &GpuContext) -> Self {
        Capacities {
            queue: Storage::<NodePair>::limit(gpu),
            items: Storage::<CellItem>::limit(gpu),
            kept: Storage::<Kept>::limit(gpu),
            entries: Storage::<ListEntry>::limit(gpu),
            candidates: Storage::<Candidate>::limit(gpu),
            pairs: Storage::<PairKey>::limit(gpu),
            unsure: Storage::<UnsureKey>::limit(gpu),
        }
    }
}

/// The buffers. Those that only the other method needs have one element each.
#[derive(Debug)]
pub struct PassBuffers {
    /// Pairs of nodes of this round and of the next, in turns.
    pub queues: [Storage<NodePair>; 2],
    /// Pairs of clusters; only `Clusters`.
    pub items: Storage<WorkItem>,
    /// Pairs of elements whose boxes overlap.
    pub candidates: Storage<Candidate>,
    /// Pairs that certainly intersect.
    pub pairs: Storage<PairKey>,
    /// Pairs left to exact arithmetic.
    pub unsure: Storage<UnsureKey>,
    /// In a step: between which times each unsure pair first touches.
    pub times: Storage<PairTimes>,
    /// Safe distances: the most that each vertex may move, 0 if it is fixed.
    pub limits: Storage<Share>,
    /// Of which bodies these are.
    pub limits_of: Vec<LimitsOf>,
    /// How thick each vertex is, with half of the separation of a step; one 0 if none is.
    pub thickness: Storage<Share>,
    /// Of which separation and bodies these are.
    pub thickness_of: Option<(u64, Vec<ThicknessOf>)>,
    /// Safe distances: how far each vertex may move.
    pub shares: Storage<Share>,
    /// What the question leaves out, see `left_out`.
    pub rules: Storage<Rule>,
    /// Of which question these are.
    pub rules_of: Option<RulesOf>,
    /// What stages counted, at the indices of `layout`.
    pub counters: Storage<Counter>,
    /// Workgroups of indirect launches: of each round, then of the stages after them.
    pub arguments: Storage<Arguments>,
    /// Pairs of groups of one cell; only `Cells`, as all below.
    pub cell_items: Storage<CellItem>,
    /// Elements within reach of another body.
    pub kept: Storage<Kept>,
    /// The lists of all cells, one after the other.
    pub entries: Storage<ListEntry>,
    /// One record per cell.
    pub cells: Storage<Cell>,
    /// Where the list of each cell starts in the entries.
    pub starts: Storage<Start>,
    /// The box of each body in which it may meet others.
    pub reaches: Storage<Reach>,
    /// The bounds of the region of the grid, then the number of entries per shift.
    pub tallies: Storage<Tally>,
    /// The grid: one element.
    pub grid: Storage<Grid>,
    /// The initial counters and queue of a pass, copied by its encoder.
    start_counters: Storage<Counter>,
    start_queue: Storage<NodePair>,
    started: Option<(Vec<NodePair>, Option<f32>)>,
    sizes: Option<(Capacities, CellsWanted)>,
}

/// Room that `Cells` needs besides the buffers that grow; zero for `Clusters`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CellsWanted {
    /// The number of cells of the grid, at most.
    pub n_cells: u64,
    /// The number of parts of bodies on the device.
    pub n_bodies: u64,
}

impl CellsWanted {
    /// Bytes per cell, the start of its list included.
    pub const CELL: u64 = (size_of::<Cell>() + size_of::<Start>()) as u64;

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.n_cells * Self::CELL + self.n_bodies * size_of::<Reach>() as u64
    }
}

/// What the rules about what is left out belong to.
#[derive(Debug)]
pub struct RulesOf {
    /// What is left out.
    pub(super) left_out: Arc<LeftOut>,
    /// The bodies in the order of the device, with the number of vertices of each.
    pub(super) bodies: Vec<(BodyId, u64)>,
}

/// What the limits of a body's vertices belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LimitsOf {
    /// The body.
    pub body: BodyId,
    /// How many vertices it has.
    pub len: u32,
    /// The bits of the most that they may move.
    pub most: u32,
}

/// What the thickness of a body's vertices belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ThicknessOf {
    /// The body.
    pub body: BodyId,
    /// How many vertices it has.
    pub len: u64,
    /// The bits of how thick the body is, with what each vertex keeps besides.
    pub thickness: u64,
    /// The stamp of the thickness of its elements, where they have their own.
    pub each: Option<u64>,
}

impl PassBuffers {
    pub(crate) fn new() -> Self {
        let indirect = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        PassBuffers {
            queues: ["queue a", "queue b"].map(Storage::plain),
            items: Storage::plain("work items"),
            candidates: Storage::plain("candidates"),
            pairs: Storage::plain("pairs"),
            unsure: Storage::plain("unsure"),
            times: Storage::plain("times of pairs"),
            limits: Storage::plain("limits"),
            limits_of: Vec::new(),
            thickness: Storage::plain("thickness"),
            thickness_of: None,
            shares: Storage::plain("safe distances"),
            rules: Storage::plain("rules"),
            rules_of: None,
            counters: Storage::plain("counters"),
            arguments: Storage::new("arguments", indirect),
            cell_items: Storage::plain("work items of cells"),
            kept: Storage::plain("kept"),
            entries: Storage::plain("entries"),
            cells: Storage::plain("cells"),
            starts: Storage::plain("starts"),
            reaches: Storage::plain("reaches"),
            tallies: Storage::plain("tallies"),
            grid: Storage::plain("grid"),
            start_counters: Storage::plain("first counters"),
            start_queue: Storage::plain("first queue"),
            started: None,
            sizes: None,
        }
    }

    /// Makes exactly this much room.
    pub fn resize(&mut self, gpu: &GpuContext, wanted: &Capacities, cells: Option<CellsWanted>) {
        let is_cells = cells.is_some();
        let cells = cells.unwrap_or_default();
        let sizes = Some((*wanted, cells));
        if self.sizes == sizes {
            return;
        }
        self.sizes = sizes;
        let (of_clusters, of_cells) = match is_cells {
            true => (1, wanted.items),
            false => (wanted.items, 1),
        };
        let [a, b] = &mut self.queues;
        a.resize_exactly(gpu, wanted.queue);
        b.resize_exactly(gpu, wanted.queue);
        self.items.resize_exactly(gpu, of_clusters);
        self.candidates.resize_exactly(gpu, wanted.candidates);
        self.pairs.resize_exactly(gpu, wanted.pairs);
        self.unsure.resize_exactly(gpu, wanted.unsure);
        self.times.resize_exactly(gpu, wanted.unsure);
        self.counters.resize_exactly(gpu, u64::from(N_COUNTERS));
        self.arguments.resize_exactly(gpu, u64::from(ROUNDS) + 3);
        self.cell_items.resize_exactly(gpu, of_cells);
        self.kept.resize_exactly(gpu, wanted.kept);
        self.entries.resize_exactly(gpu, wanted.entries);
        self.cells.resize_exactly(gpu, cells.n_cells);
        self.starts.resize_exactly(gpu, cells.n_cells);
        self.reaches.resize_exactly(gpu, cells.n_bodies);
        self.tallies.resize_exactly(gpu, u64::from(N_TALLIES));
        self.grid.resize_exactly(gpu, 1);
    }

    /// The copies that start a pass: the seeds, which must fit the queue, and counters at zero
    /// except the number of seeds and the time by which some pair certainly touches, if there is
    /// one.
    ///
    /// # Errors
    /// As [`Storage::resize`].
    pub fn start(
        &mut self,
        gpu: &GpuContext,
        seeds: &[NodePair],
        touches_by: Option<f32>,
    ) -> Result<[(Slice, Slice); 2], Error> {
        let is_started = |(held, time): &(Vec<NodePair>, _)| held == seeds && *time == touches_by;
        if !self.started.as_ref().is_some_and(is_started) {
            let mut counters = [Counter::default(); N_COUNTERS as usize];
            // Seeds fit a queue, which 32 bits can number.
            counters[0].n = seeds.len() as u32;
            counters[TOUCHES_BY as usize].n = touches_by.unwrap_or(NEVER).to_bits();
            self.start_counters.upload(gpu, &counters)?;
            self.start_queue.upload(gpu, seeds)?;
            self.started = Some((seeds.to_vec(), touches_by));
        }
        let seeds = self.start_queue.first(count(seeds.len()));
        Ok([
            (self.start_counters.all(), self.counters.all()),
            (seeds, self.queues[0].all()),
        ])
    }

    /// Bytes of the buffers that do not grow: those of [`CellsWanted`].
    pub fn bytes_of_cells(&self) -> u64 {
        self.sizes.map_or(0, |(_, cells)| cells.bytes())
    }

    /// The room that there is.
    pub fn capacities(&self) -> Capacities {
        self.sizes.map_or(Capacities::NONE, |(wanted, _)| wanted)
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.sizes
            .map_or(0, |(wanted, cells)| wanted.bytes() + cells.bytes())
            + self.bytes_of_elements()
    }

    /// Bytes of what is known of each vertex, and of what is left out.
    pub fn bytes_of_elements(&self) -> u64 {
        let of_vertices = self.limits.bytes() + self.thickness.bytes() + self.shares.bytes();
        of_vertices + self.rules.bytes()
    }
}

/// The counts of a pass.
#[derive(Debug, Clone, Copy)]
pub struct PassCounts {
    /// The capacities that would have been enough; a lower bound for stages after one that
    /// overflowed.
    pub needed: Capacities,
    /// Cells that went through the second level.
    pub n_subdivided: u64,
    /// Box tests; only some methods count them.
    pub n_box_tests: u64,
    /// The least time by which some pair of a step certainly touches, after the start.
    pub touches_by: Option<f32>,
    too_much: bool,
}

/// What to do after a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NextPass {
    /// Everything fitted.
    Complete,
    /// Run again with this much room.
    Grow(Capacities),
    /// No more room is available: split the work.
    Split,
}

impl PassCounts {
    /// Reads the counters of a pass.
    pub fn new(counters: &[Counter]) -> Self {
        let at = |ix: u32| u64::from(counters[ix as usize].n);
        PassCounts {
            needed: Capacities {
                queue: (0..ROUNDS).map(at).max().unwrap_or(0),
                items: at(N_ITEMS),
                kept: at(N_KEPT),
                entries: at(N_ENTRIES),
                candidates: at(N_CANDIDATES),
                pairs: at(N_PAIRS),
                unsure: at(N_UNSURE),
            },
            n_subdivided: at(N_SUBDIVIDED),
            n_box_tests: at(N_BOX_TESTS_HIGH) << 32 | at(N_BOX_TESTS),
            touches_by: time_by(counters[TOUCHES_BY as usize].n),
            too_much: at(TOO_MUCH) != 0,
        }
    }

    /// Whether a pass ends a step, however much room it had: any contact is sought, and there is
    /// one.
    pub(super) fn answer(&self, sought: Goal) -> bool {
        sought == Goal::Any && self.touches_by.is_some()
    }

    /// The room that the pass should have had, as far as the device can bind it. Buffers that were
    /// too small get a quarter more than needed: the next frame may need a little more.
    pub fn larger(&self, gpu: &GpuContext, pass_buffers: Capacities) -> Capacities {
        let larger = self.needed.zip(pass_buffers, |needed, pass_buffers| {
            if needed > pass_buffers {
                needed + needed / 4
            } else {
                pass_buffers
            }
        });
        larger.within(gpu)
    }

    /// Compares the counts with the room that the pass had. `bytes`: the most that these buffers
    /// may take together.
    pub fn judge(
        &self,
        gpu: &GpuContext,
        pass_buffers: Capacities,
        bytes: Option<u64>,
    ) -> NextPass {
        if self.too_much {
            return NextPass::Split;
        }
        if self.needed.fits(pass_buffers) {
            return NextPass::Complete;
        }
        let larger = self.larger(gpu, pass_buffers);
        let is_allowed = bytes.is_none_or(|bytes| larger.bytes() <= bytes);
        if self.needed.fits(larger) && is_allowed {
            NextPass::Grow(larger)
        } else {
            NextPass::Split
        }
    }
}
