//! The method `Cells`, the paper's two levels, as a recording.
//!
//! ```text
//! bounds     as in Clusters, for the boxes of bodies · reach · elements within reach
//! grid       resolution, eq. (1) · ranges, eq. (3) · shift · count
//! traversal   room for lists and work items, eq. (4) · scatter
//! pairing    prepare · level 2
//! narrow     prepare · narrow
//! ```
//!
//! A cell too crowded for one pass takes several: one fills its list, then each of the others pairs
//! one tile of the product of its groups, traversal · pairing · narrow.

use std::fmt;

use super::buffers::Uniform;
use super::collect::Collected;
use super::kernels::{
    BoundsKeep, BoundsReach, GridCount, GridRanges, GridResolution, GridShift, PairingCells,
    TraversalCells, TraversalScatter, TraversalTile,
};
use super::layout::{NO_ROOT, Params};
use super::pass_buffers::Capacities;
use super::recording::{Recorder, Workgroups};
use crate::scene::error::Error;

/// Slot of the arguments for launches over kept elements, 64 per workgroup.
const KEPT: u32 = 0;
/// Slot of the arguments for launches over cells, 64 per workgroup.
const CELLS: u32 = 1;

/// The work of a pass in cells. To split a single cell over several passes takes tiles: every pass
/// that fills lists does so in the order in which threads happen to come, so tiles would not hold
/// the same elements from pass to pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CellWork {
    /// All of some cells.
    All(CellRange),
    /// Fills the list of one cell, for later passes.
    List(CellRange),
    /// Pairs one tile of the product of the groups of a list that an earlier pass has filled.
    Tile(CellRange, Tile),
}

impl CellWork {
    /// The work of a whole frame.
    pub const WHOLE: CellWork = CellWork::All(CellRange {
        first: 0,
        count: u32::MAX,
    });

    /// Its cells.
    pub fn cells(self) -> CellRange {
        match self {
            CellWork::All(cells) | CellWork::List(cells) | CellWork::Tile(cells, _) => cells,
        }
    }

    /// The work to do instead if even an empty pass would be too large; `None` for any other.
    pub fn parts(self) -> Option<Vec<CellWork>> {
        match self {
            CellWork::Tile(cells, tile) if tile.side > Tile::MOST => Some(quarters(cells, tile)),
            _ => None,
        }
    }

    /// Smaller parts; `None` if splitting does not help. `kept`: for how many kept elements there
    /// was room.
    pub fn split(self, collected: &Collected, kept: u64) -> Option<Vec<CellWork>> {
        match self {
            // The kept elements do not depend on the cells.
            CellWork::All(_) if collected.counts.needed.kept > kept => None,
            CellWork::All(cells) => Some(match cells.split(collected.grid.n_cells) {
                Some(halves) => halves.map(CellWork::All).into(),
                None => vec![CellWork::List(cells)],
            }),
            CellWork::List(_) => None,
            CellWork::Tile(cells, tile) => (tile.side > 1).then(|| quarters(cells, tile)),
        }
    }

    /// The work that follows it. No other pass changes the list of a cell before the last of its
    /// tiles is done.
    pub fn next(self, collected: &Collected, group_size: u32) -> Option<CellWork> {
        let n_entries = collected.counts.needed.entries as u32;
        match self {
            CellWork::List(cells) if n_entries > 0 => {
                Some(CellWork::Tile(cells, Tile::all(n_entries, group_size)))
            }
            _ => None,
        }
    }

    /// Room for work that cannot be split: the buffers that it needs grow, and all others shrink.
    pub fn lean(self, needed: &Capacities, now: Capacities, least: Capacities) -> Capacities {
        match self {
            // The filled list must stay.
            CellWork::Tile(..) => Capacities {
                kept: now.kept,
                entries: now.entries,
                ..least
            },
            CellWork::All(_) | CellWork::List(_) => Capacities {
                kept: needed.kept.max(least.kept),
                entries: match needed.kept > now.kept {
                    true => least.entries,
                    false => needed.entries.max(least.entries),
                },
                ..least
            },
        }
    }
}

/// The quarters of a tile that have any work.
fn quarters(cells: CellRange, tile: Tile) -> Vec<CellWork> {
    let quarters = tile.split().unwrap_or_default().into_iter();
    quarters
        .map(|quarter| CellWork::Tile(cells, quarter))
        .collect()
}

/// Some cells of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellRange {
    /// The first cell.
    pub first: u32,
    /// The number of cells.
    pub count: u32,
}

impl CellRange {
    /// Two halves of the cells; `None` for a single cell. `n_cells`: the number of cells of the
    /// grid.
    pub fn split(self, n_cells: u32) -> Option<[CellRange; 2]> {
        let count = self.count.min(n_cells.saturating_sub(self.first));
        let low = CellRange {
            count: count / 2,
            ..self
        };
        let high = CellRange {
            first: self.first + low.count,
            count: count - low.count,
        };
        (count > 1).then_some([low, high])
    }
}

/// A square of the product of the groups of one cell with themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tile {
    /// The number of entries of the cell's list.
    pub n_entries: u32,
    /// The number of groups of the cell's list.
    pub n_groups: u32,
    /// The first group of the rows.
    pub row: u32,
    /// The first group of the columns.
    pub column: u32,
    /// Groups along a side, a power of two.
    pub side: u32,
}

impl Tile {
    /// The most groups along a side that one pass does: a megabyte of work items.
    pub const MOST: u32 = 256;

    /// The tile of a whole list.
    pub fn all(n_entries: u32, group_size: u32) -> Self {
        let n_groups = n_entries.div_ceil(group_size);
        Tile {
            n_entries,
            n_groups,
            row: 0,
            column: 0,
            // Slots have 31 bits, so this power of two fits.
            side: n_groups.next_power_of_two(),
        }
    }

    /// Its quarters, except those with nothing on or above the diagonal; `None` for a single pair
    /// of groups.
    pub fn split(self) -> Option<Vec<Tile>> {
        if self.side < 2 {
            return None;
        }
        let half = self.side / 2;
        let mut quarters = Vec::with_capacity(4);
        for (down, right) in [(0, 0), (0, half), (half, 0), (half, half)] {
            let (row, column) = (self.row + down, self.column + right);
            let is_inside = row.max(column) < self.n_groups;
            if is_inside && column + (half - 1) >= row {
                quarters.push(Tile {
                    row,
                    column,
                    side: half,
                    ..self
                });
            }
        }
        Some(quarters)
    }
}

/// The method's parameters for a pass.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellPass {
    pub lambda: f64,
    pub group_size: u32,
    pub resolve: bool,
    pub work: CellWork,
}

/// Records the passes of a method of another crate.
type Record = dyn FnMut(&mut Recorder<'_>, f64, CellRange) -> Result<(), Error> + Send + Sync;

/// A method of another crate that works in cells.
pub struct Guest {
    make: Box<dyn Fn() -> Box<Record> + Send + Sync>,
    record: Box<Record>,
}

impl fmt::Debug for Guest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Guest")
    }
}

impl Guest {
    /// A guest whose recorder is made by `make`: with no buffers at first, and anew after a device
    /// error. It records a pass for some cells, with the density of cells.
    pub fn new(make: impl Fn() -> Box<Record> + Send + Sync + 'static) -> Self {
        let record = make();
        let make = Box::new(make);
        Guest { make, record }
    }

    /// The same without its buffers.
    pub(super) fn anew(self) -> Self {
        let record = (self.make)();
        Guest { record, ..self }
    }

    pub(super) fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        lambda: f64,
        cells: CellRange,
    ) -> Result<(), Error> {
        (self.record)(recorder, lambda, cells)
    }
}

impl Recorder<'_> {
    /// All stages.
    pub(super) fn cells(&mut self, of_pass: CellPass) {
        let cells = of_pass.work.cells();
        let params = Params {
            first: cells.first,
            count: cells.count,
            group_size: of_pass.group_size,
            ..Params::default()
        };
        match of_pass.work {
            CellWork::Tile(_, tile) => self.tile(tile, params),
            CellWork::All(_) | CellWork::List(_) => {
                self.recording.clear(self.pass_buffers.cells.all());
                self.bounds_within_reach();
                self.grid(of_pass.lambda);
                let lists_only = u32::from(matches!(of_pass.work, CellWork::List(_)));
                self.lists(Params {
                    lists_only,
                    ..params
                });
            }
        }
        self.recording.stage("pairing");
        let (world, view, pass_buffers) = (self.world, self.view, self.pass_buffers);
        let groups = self.counted_items();
        let pairing = PairingCells {
            bodies: view.bodies.read(),
            ignored: view.ignored.read(),
            corners: world.corners.read(),
            kept: pass_buffers.kept.read(),
            entries: pass_buffers.entries.read(),
            items: pass_buffers.cell_items.read(),
            candidates: pass_buffers.candidates.write_to(),
            counters: pass_buffers.counters.write_to(),
            params: Uniform(Params {
                n_ignored: view.n_ignored(),
                resolve: u32::from(of_pass.resolve),
                ..Params::default()
            }),
        };
        self.recording
            .launch(&self.gpu.kernels.pairing_cells, &pairing, groups);
        self.recording.stage("narrow");
        self.narrow();
    }

    /// The work items of one tile. Boxes, grid and the list exist already: their stages are empty.
    fn tile(&mut self, tile: Tile, params: Params) {
        for stage in ["bounds", "grid", "traversal"] {
            self.recording.stage(stage);
        }
        let pass_buffers = self.pass_buffers;
        let bindings = TraversalTile {
            grid: pass_buffers.grid.read(),
            items: pass_buffers.cell_items.write_to(),
            counters: pass_buffers.counters.write_to(),
            params: Uniform(Params {
                n_entries: tile.n_entries,
                tile_row: tile.row,
                tile_column: tile.column,
                tile_side: tile.side,
                ..params
            }),
        };
        let groups = (u64::from(tile.side) * u64::from(tile.side)).div_ceil(64);
        let groups = Workgroups::Known(groups);
        self.recording
            .launch(&self.gpu.kernels.traversal_tile, &bindings, groups);
    }

    /// The lists of cells, and their work items: the end of stage `grid`, and `traversal`.
    fn lists(&mut self, params: Params) {
        let (view, pass_buffers) = (self.view, self.pass_buffers);
        let kernels = &self.gpu.kernels;
        let counters = || pass_buffers.counters.write_to();
        let count = GridCount {
            grid: pass_buffers.grid.read(),
            kept: pass_buffers.kept.write_to(),
            counters: counters(),
            cells: pass_buffers.cells.write_to(),
        };
        let kept = self.over_kept();
        self.recording.launch(&kernels.grid_count, &count, kept);
        self.recording.stage("traversal");
        let traversal = TraversalCells {
            grid: pass_buffers.grid.read(),
            bodies: view.bodies.read(),
            cells: pass_buffers.cells.write_to(),
            starts: pass_buffers.starts.write_to(),
            items: pass_buffers.cell_items.write_to(),
            counters: counters(),
            params: Uniform(params),
        };
        let groups = self.indirect(CELLS);
        self.recording
            .launch(&kernels.traversal_cells, &traversal, groups);
        let scatter = TraversalScatter {
            grid: pass_buffers.grid.read(),
            kept: pass_buffers.kept.read(),
            starts: pass_buffers.starts.read(),
            cells: pass_buffers.cells.write_to(),
            entries: pass_buffers.entries.write_to(),
            counters: counters(),
        };
        let kept = self.over_kept();
        self.recording
            .launch(&kernels.traversal_scatter, &scatter, kept);
    }

    /// The workgroups of launches over kept elements.
    pub fn over_kept(&self) -> Workgroups {
        self.indirect(KEPT)
    }

    /// Stage `bounds` of methods that work in a grid: the boxes of bodies, their reach, and the
    /// elements within reach.
    pub fn bounds_within_reach(&mut self) {
        let (gpu, world, view, pass_buffers) = (self.gpu, self.world, self.view, self.pass_buffers);
        self.recording.clear(pass_buffers.tallies.all());
        self.bounds();
        let reach = BoundsReach {
            nodes: world.nodes.read(),
            bodies: view.bodies.read(),
            ignored: view.ignored.read(),
            reaches: pass_buffers.reaches.write_to(),
            tallies: pass_buffers.tallies.write_to(),
            // Counts fit 32 bits.
            params: Uniform(Params {
                first: view.top().unwrap_or(NO_ROOT),
                count: view.bodies.len() as u32,
                n_ignored: view.n_ignored(),
                ..Params::default()
            }),
        };
        let groups = Workgroups::Known(view.bodies.len().div_ceil(64));
        self.recording
            .launch(&gpu.kernels.bounds_reach, &reach, groups);
        let keep = BoundsKeep {
            nodes: world.nodes.read(),
            clusters: world.clusters.read(),
            bodies: view.bodies.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            reaches: pass_buffers.reaches.read(),
            kept: pass_buffers.kept.write_to(),
            counters: pass_buffers.counters.write_to(),
        };
        let groups = Workgroups::Known(world.clusters.len());
        self.recording
            .launch(&gpu.kernels.bounds_keep, &keep, groups);
    }

    /// Stage `grid`, up to the ranges of kept elements and their shift, with cells as dense as
    /// `lambda`.
    pub fn grid(&mut self, lambda: f64) {
        self.recording.stage("grid");
        let (gpu, pass_buffers) = (self.gpu, self.pass_buffers);
        let over_kept = Params {
            // Capacities and counts fit 32 bits.
            capacity: pass_buffers.capacities().kept as u32,
            lambda: (lambda as f32).clamp(f32::MIN_POSITIVE, f32::MAX).to_bits(),
            most_cells: pass_buffers.cells.len() as u32,
            ..Params::default()
        };
        let resolution = GridResolution {
            counters: pass_buffers.counters.write_to(),
            tallies: pass_buffers.tallies.write_to(),
            grid: pass_buffers.grid.write_to(),
            arguments: pass_buffers.arguments.write_to(),
            params: Uniform(Params {
                slot: KEPT,
                ..over_kept
            }),
        };
        let one = Workgroups::Known(1);
        self.recording
            .launch(&gpu.kernels.grid_resolution, &resolution, one);
        let ranges = GridRanges {
            grid: pass_buffers.grid.read(),
            kept: pass_buffers.kept.write_to(),
            counters: pass_buffers.counters.write_to(),
            tallies: pass_buffers.tallies.write_to(),
        };
        let kept = self.over_kept();
        self.recording
            .launch(&gpu.kernels.grid_ranges, &ranges, kept);
        let shift = GridShift {
            counters: pass_buffers.counters.write_to(),
            tallies: pass_buffers.tallies.write_to(),
            grid: pass_buffers.grid.write_to(),
            arguments: pass_buffers.arguments.write_to(),
            params: Uniform(Params {
                slot: CELLS,
                ..over_kept
            }),
        };
        let one = Workgroups::Known(1);
        self.recording.launch(&gpu.kernels.grid_shift, &shift, one);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_split_down_to_single_cells() {
        let n_cells = 5;
        let mut waiting = vec![CellWork::WHOLE.cells()];
        let mut seen = std::collections::BTreeSet::new();
        while let Some(part) = waiting.pop() {
            match part.split(n_cells) {
                Some(halves) => waiting.extend(halves),
                None => assert!(seen.insert(part.first), "cell {} twice", part.first),
            }
        }
        assert_eq!(seen.len(), 5);
    }
    #[test]
    fn tiles_cover_every_pair_of_groups_once() {
        for (n_entries, group_size) in [(1u32, 64), (64, 64), (65, 64), (7, 1), (33, 1), (130, 7)] {
            let n_groups = n_entries.div_ceil(group_size);
            let mut waiting = vec![Tile::all(n_entries, group_size)];
            let mut seen = std::collections::BTreeSet::new();
            while let Some(tile) = waiting.pop() {
                match tile.split() {
                    Some(quarters) => waiting.extend(quarters),
                    None => {
                        assert!(tile.row <= tile.column && tile.column < n_groups);
                        assert!(seen.insert((tile.row, tile.column)), "{tile:?} twice");
                    }
                }
            }
            assert_eq!(seen.len() as u32, n_groups * (n_groups + 1) / 2);
        }
    }
}
