//! The launches of a pass, in order.
//!
//! ```text
//! bounds     boxes of bodies · reach · primitives within reach             impinge's own
//! grid       resolution, eq. (1) · ranges, eq. (3) · shift                 impinge's own
//! fill       count · exclusive sum · entries
//! sort       for each digit of 8 bits: count · sums · scatter
//! compact    cells with primitives of both bodies
//! pairing    all pairs of a cell: boxes
//! narrow     the filter                                                    impinge's own
//! ```
//!
//! A pass processes a given range of cells. It counts the items that do not fit; then the engine grows its buffers and
//! runs the pass again, as for impinge's own methods.

use std::fmt;
use std::sync::Arc;

use impinge_core::Error;
use impinge_core::gpu::Gpu;
use impinge_core::gpu::buffers::Storage;
use impinge_core::gpu::cells::{CellRange, InCells, Told};
use impinge_core::gpu::layout::{N_ENTRIES, N_ITEMS, Params, ROUNDS};
use impinge_core::gpu::narrow::{Settling, prepare};
use impinge_core::gpu::pipeline::{Bound, Workgroups};
use impinge_core::gpu::reaching::{KEPT, Reaching, ReachingSteps};
use impinge_core::gpu::room::Room;
use impinge_core::gpu::steps::{Stages, Steps};
use impinge_core::gpu::world::World;

use super::kernels::{
    Compact, DigitCount, DigitTotal, Entry, FillCount, FillEntries, FillScan, First, Kernels,
    Pairing, SortCount, SortScan, SortScatter, Sum,
};

const STAGES: &[&str] = &[
    "bounds", "grid", "fill", "sort", "compact", "pairing", "narrow",
];

/// Slots of indirect arguments: blocks of a sort, workgroups over entries. The slots of pairing and narrow are impinge's.
const BLOCKS: u32 = 2;
const ENTRIES: u32 = 3;

/// Entries that a workgroup sorts; `entries.wgsl` has the same.
const BLOCK: u32 = 4096;
/// The number of values, and of bits, of a digit.
const DIGITS: u64 = 256;
const DIGIT_BITS: u32 = 8;
/// Primitives per sum, and entries per workgroup of `compact`.
const SUM: u64 = 64;
const COMPACT: u32 = 256;

/// Kernels bound to their buffers; made again when a buffer changes.
struct Launches {
    reaching: Reaching,
    prepare: Bound,
    fill_count: Bound,
    fill_scan: Bound,
    fill_entries: Bound,
    /// From the first buffer of entries to the second, and back.
    sort_count: [Bound; 2],
    sort_scan: Bound,
    sort_scatter: [Bound; 2],
    compact: Bound,
    pairing: Bound,
    settling: Settling,
}

/// Buffers that impinge's own methods do not have.
struct Buffers {
    firsts: Storage<First>,
    sums: Storage<Sum>,
    entries: [Storage<Entry>; 2],
    counts: Storage<DigitCount>,
    totals: Storage<DigitTotal>,
}

/// The launches of a pass.
pub(crate) struct Plan {
    kernels: Arc<Kernels>,
    owner_rule: bool,
    buffers: Buffers,
    steps: Steps,
    launches: Option<Launches>,
    reaching: ReachingSteps,
    fill_scan: u32,
    prepare_blocks: u32,
    /// One per digit, the lowest first.
    digits: Vec<u32>,
    prepare_compact: u32,
    /// Parameters of compact and pairing.
    work: u32,
    prepare_pairing: u32,
    narrow: u32,
}

impl fmt::Debug for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Plan")
            .field("owner_rule", &self.owner_rule)
            .field("n_digits", &self.digits.len())
            .finish_non_exhaustive()
    }
}

impl Plan {
    pub fn new(kernels: Arc<Kernels>, owner_rule: bool) -> Self {
        Plan {
            kernels,
            owner_rule,
            buffers: Buffers {
                firsts: Storage::plain("firsts"),
                sums: Storage::plain("sums"),
                entries: ["entries a", "entries b"].map(Storage::plain),
                counts: Storage::plain("digit counts"),
                totals: Storage::plain("digit totals"),
            },
            steps: Steps::new(),
            launches: None,
            reaching: ReachingSteps::default(),
            fill_scan: 0,
            prepare_blocks: 0,
            digits: Vec::new(),
            prepare_compact: 0,
            work: 0,
            prepare_pairing: 0,
            narrow: 0,
        }
    }
}

impl Buffers {
    /// Resizes the buffers to the engine's capacities. Returns whether any buffer is new.
    fn resize(&mut self, gpu: &Gpu, room: &Room) -> Result<bool, Error> {
        let capacities = room.capacities();
        let n_blocks = capacities.entries.div_ceil(u64::from(BLOCK));
        let [a, b] = &mut self.entries;
        Ok(self.firsts.resize(gpu, capacities.kept)?
            | self.sums.resize(gpu, capacities.kept.div_ceil(SUM))?
            | a.resize(gpu, capacities.entries)?
            | b.resize(gpu, capacities.entries)?
            | self.counts.resize(gpu, DIGITS * n_blocks)?
            | self.totals.resize(gpu, DIGITS)?)
    }
}

impl InCells for Plan {
    fn stages(&self) -> &'static [&'static str] {
        STAGES
    }

    fn anew(&self) -> Box<dyn InCells> {
        Box::new(Plan::new(Arc::clone(&self.kernels), self.owner_rule))
    }

    fn unbind(&mut self) {
        self.launches = None;
    }

    fn make(
        &mut self,
        gpu: &Gpu,
        world: &World,
        room: &Room,
        told: Told,
        part: CellRange,
    ) -> Result<(), Error> {
        if self.buffers.resize(gpu, room)? {
            self.launches = None;
        }
        // Capacities fit in 32 bits.
        let capacities = room.capacities();
        let n_entries = capacities.entries as u32;
        let steps = &mut self.steps;
        steps.clear();
        self.reaching.plan(world, room, told.lambda, steps);
        self.fill_scan = steps.push(Params {
            capacity: capacities.kept as u32,
            ..Params::default()
        });
        let over_entries = |per_group, slot| Params {
            counter: N_ENTRIES,
            per_group,
            capacity: n_entries,
            slot,
            ..Params::default()
        };
        self.prepare_blocks = steps.push(over_entries(BLOCK, BLOCKS));
        self.prepare_compact = steps.push(over_entries(COMPACT, ENTRIES));
        // A key consists of a cell and one bit for the body.
        let key_bits = u64::BITS - (2 * room.cells.len() - 1).leading_zeros();
        self.digits.clear();
        self.digits
            .extend((0..key_bits).step_by(DIGIT_BITS as usize).map(|first| {
                steps.push(Params {
                    first,
                    capacity: n_entries,
                    ..Params::default()
                })
            }));
        self.work = steps.push(Params {
            first: part.first,
            count: part.count,
            owner_rule: u32::from(self.owner_rule),
            ..Params::default()
        });
        self.prepare_pairing = steps.push(Params {
            counter: N_ITEMS,
            per_group: 1,
            capacity: capacities.items as u32,
            slot: ROUNDS,
            ..Params::default()
        });
        self.narrow = Settling::plan(steps, room);
        if steps.send(gpu)? || self.launches.is_none() {
            let sorted = self.digits.len() % 2;
            self.launches = Some(Launches::new(
                gpu,
                &self.kernels,
                world,
                room,
                &self.buffers,
                &self.steps,
                sorted,
            ));
        }
        Ok(())
    }

    fn encode(&self, stages: &mut Stages<'_>, world: &World, room: &Room) {
        let launches = self.launches.as_ref().expect("made before it is encoded");
        let arguments = room.arguments.buffer();
        let one = || Workgroups::Known(1);
        let indirect = |slot| Workgroups::Indirect(arguments, slot);
        Reaching::clear(stages.encoder, room);
        stages.stage(|pass| launches.reaching.run_bounds(pass, world, &self.reaching));
        stages.stage(|pass| launches.reaching.run_grid(pass, room, &self.reaching));
        stages.stage(|pass| {
            launches.fill_count.run(pass, 0, indirect(KEPT));
            launches.fill_scan.run(pass, self.fill_scan, one());
            launches.fill_entries.run(pass, 0, indirect(KEPT));
        });
        stages.stage(|pass| {
            launches.prepare.run(pass, self.prepare_blocks, one());
            for (round, &step) in self.digits.iter().enumerate() {
                launches.sort_count[round % 2].run(pass, step, indirect(BLOCKS));
                launches
                    .sort_scan
                    .run(pass, step, Workgroups::Known(DIGITS));
                launches.sort_scatter[round % 2].run(pass, step, indirect(BLOCKS));
            }
        });
        stages.stage(|pass| {
            launches.prepare.run(pass, self.prepare_compact, one());
            launches.compact.run(pass, self.work, indirect(ENTRIES));
        });
        stages.stage(|pass| {
            launches.prepare.run(pass, self.prepare_pairing, one());
            launches.pairing.run(pass, self.work, indirect(ROUNDS));
        });
        stages.stage(|pass| launches.settling.run(pass, room, self.narrow));
    }
}

impl Launches {
    /// `sorted`: which buffer of entries the sort ends in.
    fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        world: &World,
        room: &Room,
        buffers: &Buffers,
        steps: &Steps,
        sorted: usize,
    ) -> Self {
        let params = || steps.params();
        let counters = || room.counters.write_to();
        let entries = &buffers.entries;
        Launches {
            reaching: Reaching::new(gpu, world, room, steps),
            prepare: prepare(gpu, room, steps),
            fill_count: kernels.fill_count.bind(
                gpu,
                &FillCount {
                    grid: room.grid.read(),
                    kept: room.kept.write_to(),
                    firsts: buffers.firsts.write_to(),
                    sums: buffers.sums.write_to(),
                    counters: counters(),
                },
            ),
            fill_scan: kernels.fill_scan.bind(
                gpu,
                &FillScan {
                    sums: buffers.sums.write_to(),
                    counters: counters(),
                    params: params(),
                },
            ),
            fill_entries: kernels.fill_entries.bind(
                gpu,
                &FillEntries {
                    grid: room.grid.read(),
                    kept: room.kept.read(),
                    firsts: buffers.firsts.read(),
                    sums: buffers.sums.read(),
                    entries: entries[0].write_to(),
                    counters: counters(),
                },
            ),
            sort_count: [0, 1].map(|from| {
                kernels.sort_count.bind(
                    gpu,
                    &SortCount {
                        entries: entries[from].read(),
                        counts: buffers.counts.write_to(),
                        counters: counters(),
                        params: params(),
                    },
                )
            }),
            sort_scan: kernels.sort_scan.bind(
                gpu,
                &SortScan {
                    counts: buffers.counts.write_to(),
                    totals: buffers.totals.write_to(),
                    counters: counters(),
                    params: params(),
                },
            ),
            sort_scatter: [0, 1].map(|from| {
                kernels.sort_scatter.bind(
                    gpu,
                    &SortScatter {
                        entries: entries[from].read(),
                        counts: buffers.counts.read(),
                        totals: buffers.totals.read(),
                        sorted: entries[1 - from].write_to(),
                        counters: counters(),
                        params: params(),
                    },
                )
            }),
            compact: kernels.compact.bind(
                gpu,
                &Compact {
                    entries: entries[sorted].read(),
                    items: room.cell_items.write_to(),
                    counters: counters(),
                    params: params(),
                },
            ),
            pairing: kernels.pairing.bind(
                gpu,
                &Pairing {
                    grid: room.grid.read(),
                    kept: room.kept.read(),
                    entries: entries[sorted].read(),
                    items: room.cell_items.read(),
                    candidates: room.candidates.write_to(),
                    counters: counters(),
                    params: params(),
                },
            ),
            settling: Settling::new(gpu, world, room, steps),
        }
    }
}
