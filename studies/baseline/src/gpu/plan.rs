//! The launches of a pass, in order, as a recording.
//!
//! ```text
//! bounds     boxes of bodies · reach · elements within reach             impinge's own
//! grid       resolution, eq. (1) · ranges, eq. (3) · shift                 impinge's own
//! fill       count · exclusive sum · entries
//! sort       for each digit of 8 bits: count · sums · scatter
//! compact    cells with elements of both bodies
//! pairing    all pairs of a cell: boxes
//! narrow     the filter                                                    impinge's own
//! ```
//!
//! A pass processes a given range of cells. It counts the items that do not fit; then the engine
//! grows its buffers and runs the pass again, as for impinge's own methods.

use impinge_core::Error;
use impinge_core::gpu::GpuContext;
use impinge_core::gpu::buffers::{Storage, Uniform};
use impinge_core::gpu::cells::CellRange;
use impinge_core::gpu::clusters::Counted;
use impinge_core::gpu::layout::{N_ENTRIES, Params};
use impinge_core::gpu::pass_buffers::PassBuffers;
use impinge_core::gpu::recording::{Recorder, Workgroups};

use super::kernels::{
    Compact, DigitCount, DigitTotal, Entry, FillCount, FillEntries, FillScan, First, Kernels,
    Pairing, SortCount, SortScan, SortScatter, Sum,
};

/// Slots of indirect arguments: blocks of a sort, workgroups over entries. The slots of pairing and
/// narrow are impinge's.
const BLOCKS: u32 = 2;
const ENTRIES: u32 = 3;

/// Entries that a workgroup sorts; `entries.wgsl` has the same.
const BLOCK: u32 = 4096;
/// The number of values, and of bits, of a digit.
const DIGITS: u64 = 256;
const DIGIT_BITS: u32 = 8;
/// Elements per sum, and entries per workgroup of `compact`.
const SUM: u64 = 64;
const COMPACT: u32 = 256;

/// Buffers that impinge's own methods do not have.
pub(crate) struct Buffers {
    firsts: Storage<First>,
    sums: Storage<Sum>,
    entries: [Storage<Entry>; 2],
    counts: Storage<DigitCount>,
    totals: Storage<DigitTotal>,
}

impl Buffers {
    pub fn new() -> Self {
        Buffers {
            firsts: Storage::plain("firsts"),
            sums: Storage::plain("sums"),
            entries: ["entries a", "entries b"].map(Storage::plain),
            counts: Storage::plain("digit counts"),
            totals: Storage::plain("digit totals"),
        }
    }

    /// Resizes the buffers to the engine's capacities.
    fn resize(&mut self, gpu: &GpuContext, pass_buffers: &PassBuffers) -> Result<(), Error> {
        let capacities = pass_buffers.capacities();
        let n_blocks = capacities.entries.div_ceil(u64::from(BLOCK));
        self.firsts.resize(gpu, capacities.kept)?;
        self.sums.resize(gpu, capacities.kept.div_ceil(SUM))?;
        for entries in &mut self.entries {
            entries.resize(gpu, capacities.entries)?;
        }
        self.counts.resize(gpu, DIGITS * n_blocks)?;
        self.totals.resize(gpu, DIGITS)
    }

    /// Records a pass for some cells, which are as dense as `lambda`.
    pub fn record(
        &mut self,
        kernels: &Kernels,
        owner_rule: bool,
        recorder: &mut Recorder<'_>,
        lambda: f64,
        cells: CellRange,
    ) -> Result<(), Error> {
        let pass_buffers = recorder.pass_buffers;
        self.resize(recorder.gpu, pass_buffers)?;
        recorder.bounds_within_reach();
        recorder.grid(lambda);
        self.fill(kernels, recorder);
        let sorted = self.sort(kernels, recorder);
        let entries = &self.entries[sorted];
        recorder.recording.stage("compact");
        let work = || {
            Uniform(Params {
                first: cells.first,
                count: cells.count,
                owner_rule: u32::from(owner_rule),
                ..Params::default()
            })
        };
        let over_entries = recorder.counted(over_entries(pass_buffers, COMPACT, ENTRIES));
        let compact = Compact {
            entries: entries.read(),
            items: pass_buffers.cell_items.write_to(),
            counters: pass_buffers.counters.write_to(),
            params: work(),
        };
        let recording = &mut recorder.recording;
        recording.launch(&kernels.compact, &compact, over_entries);
        recording.stage("pairing");
        let over_items = recorder.counted_items();
        let pairing = Pairing {
            grid: pass_buffers.grid.read(),
            kept: pass_buffers.kept.read(),
            entries: entries.read(),
            items: pass_buffers.cell_items.read(),
            candidates: pass_buffers.candidates.write_to(),
            counters: pass_buffers.counters.write_to(),
            params: work(),
        };
        let recording = &mut recorder.recording;
        recording.launch(&kernels.pairing, &pairing, over_items);
        recording.stage("narrow");
        recorder.narrow();
        Ok(())
    }

    fn fill(&self, kernels: &Kernels, recorder: &mut Recorder<'_>) {
        let pass_buffers = recorder.pass_buffers;
        let counters = || pass_buffers.counters.write_to();
        let over_kept = [(); 2].map(|()| recorder.over_kept());
        let [counted, filled] = over_kept;
        let recording = &mut recorder.recording;
        recording.stage("fill");
        let count = FillCount {
            grid: pass_buffers.grid.read(),
            kept: pass_buffers.kept.write_to(),
            firsts: self.firsts.write_to(),
            sums: self.sums.write_to(),
            counters: counters(),
        };
        recording.launch(&kernels.fill_count, &count, counted);
        let scan = FillScan {
            sums: self.sums.write_to(),
            counters: counters(),
            params: Uniform(Params {
                // Capacities fit in 32 bits.
                capacity: pass_buffers.capacities().kept as u32,
                ..Params::default()
            }),
        };
        recording.launch(&kernels.fill_scan, &scan, Workgroups::Known(1));
        let fill = FillEntries {
            grid: pass_buffers.grid.read(),
            kept: pass_buffers.kept.read(),
            firsts: self.firsts.read(),
            sums: self.sums.read(),
            entries: self.entries[0].write_to(),
            counters: counters(),
        };
        recording.launch(&kernels.fill_entries, &fill, filled);
    }

    /// Sorts the entries digit by digit, the lowest first. Returns in which buffer they end.
    fn sort(&self, kernels: &Kernels, recorder: &mut Recorder<'_>) -> usize {
        let pass_buffers = recorder.pass_buffers;
        let counters = || pass_buffers.counters.write_to();
        recorder.recording.stage("sort");
        let over_blocks = recorder.counted(over_entries(pass_buffers, BLOCK, BLOCKS));
        let recording = &mut recorder.recording;
        // A key consists of a cell and one bit for the body.
        let key_bits = u64::BITS - (2 * pass_buffers.cells.len() - 1).leading_zeros();
        let mut from = 0;
        for first in (0..key_bits).step_by(DIGIT_BITS as usize) {
            let params = || {
                Uniform(Params {
                    first,
                    // Capacities fit in 32 bits.
                    capacity: pass_buffers.capacities().entries as u32,
                    ..Params::default()
                })
            };
            let count = SortCount {
                entries: self.entries[from].read(),
                counts: self.counts.write_to(),
                counters: counters(),
                params: params(),
            };
            recording.launch(&kernels.sort_count, &count, over_blocks.clone());
            let scan = SortScan {
                counts: self.counts.write_to(),
                totals: self.totals.write_to(),
                counters: counters(),
                params: params(),
            };
            recording.launch(&kernels.sort_scan, &scan, Workgroups::Known(DIGITS));
            let scatter = SortScatter {
                entries: self.entries[from].read(),
                counts: self.counts.read(),
                totals: self.totals.read(),
                sorted: self.entries[1 - from].write_to(),
                counters: counters(),
                params: params(),
            };
            recording.launch(&kernels.sort_scatter, &scatter, over_blocks.clone());
            from = 1 - from;
        }
        from
    }
}

fn over_entries(pass_buffers: &PassBuffers, per_group: u32, slot: u32) -> Counted {
    Counted {
        counter: N_ENTRIES,
        per_group,
        capacity: pass_buffers.capacities().entries,
        slot,
    }
}
