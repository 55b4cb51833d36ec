//! The method `Cells`, the paper's two levels: its launches, in order.
//!
//! ```text
//! bounds     as in Clusters, for the boxes of bodies · reach · primitives within reach
//! grid       resolution, eq. (1) · ranges, eq. (3) · shift · count
//! dispatch   room for lists and work items, eq. (4) · scatter
//! pairing    prepare · level 2
//! narrow     prepare · narrow
//! ```
//!
//! A cell too crowded for one pass takes several: one fills its list, then each of the others pairs
//! one tile of the product of its groups, dispatch · pairing · narrow.

use std::fmt;

use super::kernels::{DispatchCells, DispatchScatter, DispatchTile, GridCount, PairingCells};
use super::layout::{N_ITEMS, Params, ROUNDS};
use super::narrow::{Settling, prepare};
use super::open::Gpu;
use super::pipeline::{Bound, Workgroups};
use super::reaching::{CELLS, KEPT, Reaching, ReachingSteps};
use super::room::Room;
use super::steps::{Stages, Steps};
use super::world::World;
use crate::error::Error;

/// The stages on the device, in order, by their timing labels.
const STAGES: &[&str] = &["bounds", "grid", "dispatch", "pairing", "narrow"];

/// The method's parameters for a pass.
#[derive(Debug, Clone, Copy)]
pub struct Told {
    pub lambda: f64,
    pub group_size: u32,
    pub resolve: bool,
    pub share: Share,
}

/// The share of the work in its cells that a pass does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Share {
    /// All of it.
    All,
    /// Fills the lists, for later passes.
    Lists,
    /// Pairs one tile of the product of the groups of a list that an earlier pass has filled.
    Tile(Tile),
}

/// A square of the product of the groups of one cell with themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tile {
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
            // Places have 31 bits, so this power of two fits.
            side: n_groups.next_power_of_two(),
        }
    }

    /// Its quarters, except those with nothing on or above the diagonal; `None` for a single pair of groups.
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

/// A plan of passes that work in cells: this method's, or that of another crate.
pub trait InCells: fmt::Debug + Send + Sync {
    /// The stages on the device, in order, by their timing labels.
    fn stages(&self) -> &'static [&'static str];

    /// A new plan of the same kind that is bound to no buffers.
    fn anew(&self) -> Box<dyn InCells>;

    /// Drops its kernel bindings: the buffers have changed.
    fn unbind(&mut self);

    /// Whether the work of a single cell can be split over several passes: whether the plan follows [`Told::share`].
    fn splits_cells(&self) -> bool {
        false
    }

    /// Plans a pass.
    ///
    /// # Errors
    /// As [`Steps::send`]; the plan's own buffers cannot be allocated.
    fn make(
        &mut self,
        gpu: &Gpu,
        world: &World,
        room: &Room,
        told: Told,
        part: CellRange,
    ) -> Result<(), Error>;

    /// Encodes all stages.
    fn encode(&self, stages: &mut Stages<'_>, world: &World, room: &Room);
}

/// The part of the work that a pass does: a range of cells. To split a single cell over several passes takes
/// a [`Share`]: every pass that fills lists does so in the order in which threads happen to come, so tiles of the
/// product of the groups would not hold the same primitives from pass to pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellRange {
    /// The first cell.
    pub first: u32,
    /// The number of cells.
    pub count: u32,
}

impl CellRange {
    /// All cells.
    pub const ALL: CellRange = CellRange {
        first: 0,
        count: u32::MAX,
    };

    /// Two halves of the cells; `None` for a single cell. `n_cells`: the number of cells of the grid.
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

/// Kernels with their buffers; bound again when a buffer is replaced.
#[derive(Debug)]
struct Launches {
    reaching: Reaching,
    count: Bound,
    dispatch: Bound,
    tile: Bound,
    scatter: Bound,
    prepare: Bound,
    pairing: Bound,
    settling: Settling,
}

/// All launches of a pass.
#[derive(Debug)]
pub struct CellsPlan {
    steps: Steps,
    launches: Option<Launches>,
    reaching: ReachingSteps,
    share: Share,
    /// The step of dispatch and pairing.
    work: u32,
    prepare_pairing: u32,
    narrow: u32,
}

impl CellsPlan {
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        CellsPlan {
            steps: Steps::new(),
            launches: None,
            reaching: ReachingSteps::default(),
            share: Share::All,
            work: 0,
            prepare_pairing: 0,
            narrow: 0,
        }
    }
}

impl InCells for CellsPlan {
    fn stages(&self) -> &'static [&'static str] {
        STAGES
    }

    fn anew(&self) -> Box<dyn InCells> {
        Box::new(CellsPlan::new())
    }

    fn unbind(&mut self) {
        self.launches = None;
    }

    fn splits_cells(&self) -> bool {
        true
    }

    fn make(
        &mut self,
        gpu: &Gpu,
        world: &World,
        room: &Room,
        told: Told,
        part: CellRange,
    ) -> Result<(), Error> {
        let steps = &mut self.steps;
        steps.clear();
        self.reaching.plan(world, room, told.lambda, steps);
        self.share = told.share;
        let work = Params {
            first: part.first,
            count: part.count,
            n_ignored: world.n_ignored(),
            resolve: u32::from(told.resolve),
            group_size: told.group_size,
            ..Params::default()
        };
        self.work = steps.push(match told.share {
            Share::All => work,
            Share::Lists => Params {
                lists_only: 1,
                ..work
            },
            Share::Tile(tile) => Params {
                n_entries: tile.n_entries,
                tile_row: tile.row,
                tile_column: tile.column,
                tile_side: tile.side,
                ..work
            },
        });
        self.prepare_pairing = steps.push(Params {
            counter: N_ITEMS,
            per_group: 1,
            // Capacities fit 32 bits.
            capacity: room.capacities().items as u32,
            slot: ROUNDS,
            ..Params::default()
        });
        self.narrow = Settling::plan(steps, room);
        if steps.send(gpu)? || self.launches.is_none() {
            self.launches = Some(Launches::new(gpu, world, room, &self.steps));
        }
        Ok(())
    }

    fn encode(&self, stages: &mut Stages<'_>, world: &World, room: &Room) {
        let launches = self.launches.as_ref().expect("made before it is encoded");
        let arguments = room.arguments.buffer();
        let kept = || Workgroups::Indirect(arguments, KEPT);
        if let Share::Tile(tile) = self.share {
            // Boxes, grid and the list exist already: their stages are empty.
            stages.stage(|_| ());
            stages.stage(|_| ());
            stages.stage(|pass| {
                let groups = (u64::from(tile.side) * u64::from(tile.side)).div_ceil(64);
                launches
                    .tile
                    .run(pass, self.work, Workgroups::Known(groups));
            });
        } else {
            stages.encoder.clear_buffer(room.cells.buffer(), 0, None);
            Reaching::clear(stages.encoder, room);
            stages.stage(|pass| launches.reaching.run_bounds(pass, world, &self.reaching));
            stages.stage(|pass| {
                launches.reaching.run_grid(pass, room, &self.reaching);
                launches.count.run(pass, 0, kept());
            });
            stages.stage(|pass| {
                let groups = Workgroups::Indirect(arguments, CELLS);
                launches.dispatch.run(pass, self.work, groups);
                launches.scatter.run(pass, 0, kept());
            });
        }
        stages.stage(|pass| {
            let step = self.prepare_pairing;
            launches.prepare.run(pass, step, Workgroups::Known(1));
            let groups = Workgroups::Indirect(arguments, ROUNDS);
            launches.pairing.run(pass, self.work, groups);
        });
        stages.stage(|pass| launches.settling.run(pass, room, self.narrow));
    }
}

impl Launches {
    fn new(gpu: &Gpu, world: &World, room: &Room, steps: &Steps) -> Self {
        let kernels = &gpu.kernels;
        let params = || steps.params();
        let counters = || room.counters.write_to();
        Launches {
            reaching: Reaching::new(gpu, world, room, steps),
            count: kernels.grid_count.bind(
                gpu,
                &GridCount {
                    grid: room.grid.read(),
                    kept: room.kept.write_to(),
                    counters: counters(),
                    cells: room.cells.write_to(),
                },
            ),
            dispatch: kernels.dispatch_cells.bind(
                gpu,
                &DispatchCells {
                    grid: room.grid.read(),
                    bodies: world.bodies.read(),
                    cells: room.cells.write_to(),
                    starts: room.starts.write_to(),
                    items: room.cell_items.write_to(),
                    counters: counters(),
                    params: params(),
                },
            ),
            tile: kernels.dispatch_tile.bind(
                gpu,
                &DispatchTile {
                    grid: room.grid.read(),
                    items: room.cell_items.write_to(),
                    counters: counters(),
                    params: params(),
                },
            ),
            scatter: kernels.dispatch_scatter.bind(
                gpu,
                &DispatchScatter {
                    grid: room.grid.read(),
                    kept: room.kept.read(),
                    starts: room.starts.read(),
                    cells: room.cells.write_to(),
                    entries: room.entries.write_to(),
                    counters: counters(),
                },
            ),
            prepare: prepare(gpu, room, steps),
            pairing: kernels.pairing_cells.bind(
                gpu,
                &PairingCells {
                    bodies: world.bodies.read(),
                    ignored: world.ignored.read(),
                    corners: world.corners.read(),
                    kept: room.kept.read(),
                    entries: room.entries.read(),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_split_down_to_single_cells() {
        let n_cells = 5;
        let mut waiting = vec![CellRange::ALL];
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
