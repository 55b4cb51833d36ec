//! The method `Cells`, the paper's two levels: its launches, in order.
//!
//! ```text
//! bounds     as in Clusters, for the boxes of bodies · reach · primitives within reach
//! grid       resolution, eq. (1) · ranges, eq. (3) · shift · count
//! dispatch   room for lists and work items, eq. (4) · scatter
//! pairing    prepare · level 2
//! narrow     prepare · narrow
//! ```

use super::bounds::{Bounds, BoundsSteps};
use super::device::Gpu;
use super::kernels::{
    BoundsKeep, BoundsReach, DispatchCells, DispatchScatter, GridCount, GridRanges, GridResolution,
    GridShift, PairingCells,
};
use super::layout::{N_ITEMS, NO_ROOT, Params, ROUNDS};
use super::narrow::{Settling, prepare};
use super::pipeline::{Bound, Groups};
use super::room::Room;
use super::steps::{Stages, Steps};
use super::world::World;
use crate::error::Error;

/// The stages on the device, in order: the names of their times.
pub(crate) const STAGES: &[&str] = &["bounds", "grid", "dispatch", "pairing", "narrow"];

/// Slots of indirect arguments; those of pairing and narrow are as in `Clusters`.
const KEPT: u32 = 0;
const CELLS: u32 = 1;

/// What the method is told.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Told {
    pub lambda: f64,
    pub group_size: u32,
    pub resolve: bool,
}

/// The part of the work that a pass does: some cells. A single cell is not split further: each pass fills
/// the lists anew, in whatever order threads come, so rows of the product of its groups would not
/// be the same primitives from pass to pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Part {
    first: u32,
    count: u32,
}

impl Part {
    /// Everything.
    pub const ALL: Part = Part {
        first: 0,
        count: u32::MAX,
    };

    /// Two halves of the cells; none when there is but one. `n_cells` is at least what there is.
    pub fn split(self, n_cells: u32) -> Option<[Part; 2]> {
        let count = self.count.min(n_cells.saturating_sub(self.first));
        let low = Part {
            count: count / 2,
            ..self
        };
        let high = Part {
            first: self.first + low.count,
            count: count - low.count,
        };
        (count > 1).then_some([low, high])
    }
}

/// Kernels with their buffers; made anew when a buffer is.
#[derive(Debug)]
struct Launches {
    bounds: Bounds,
    reach: Bound,
    keep: Bound,
    resolution: Bound,
    ranges: Bound,
    shift: Bound,
    count: Bound,
    dispatch: Bound,
    scatter: Bound,
    prepare: Bound,
    pairing: Bound,
    settling: Settling,
}

/// Everything that is launched in a pass.
#[derive(Debug)]
pub(crate) struct Plan {
    steps: Steps,
    launches: Option<Launches>,
    bounds: BoundsSteps,
    reach: u32,
    resolution: u32,
    shift: u32,
    /// Dispatch and pairing.
    work: u32,
    prepare_pairing: u32,
    narrow: u32,
}

impl Plan {
    pub fn new() -> Self {
        Plan {
            steps: Steps::new(),
            launches: None,
            bounds: BoundsSteps::default(),
            reach: 0,
            resolution: 0,
            shift: 0,
            work: 0,
            prepare_pairing: 0,
            narrow: 0,
        }
    }

    /// Forgets which buffers it was made for.
    pub fn unbind(&mut self) {
        self.launches = None;
    }

    /// Plans a pass.
    ///
    /// # Errors
    /// As [`Steps::send`].
    pub fn make(
        &mut self,
        gpu: &Gpu,
        world: &World,
        room: &Room,
        told: Told,
        part: Part,
    ) -> Result<(), Error> {
        let steps = &mut self.steps;
        steps.clear();
        self.bounds.plan(world, steps);
        // Capacities and counts are at most what 32 bits can number.
        let capacities = room.capacities();
        self.reach = steps.push(Params {
            first: world.forest().top().unwrap_or(NO_ROOT),
            count: world.bodies.len() as u32,
            n_ignored: world.n_ignored(),
            ..Params::default()
        });
        let over_kept = Params {
            capacity: capacities.kept as u32,
            lambda: (told.lambda as f32)
                .clamp(f32::MIN_POSITIVE, f32::MAX)
                .to_bits(),
            most_cells: room.cells.len() as u32,
            ..Params::default()
        };
        self.resolution = steps.push(Params {
            slot: KEPT,
            ..over_kept
        });
        self.shift = steps.push(Params {
            slot: CELLS,
            ..over_kept
        });
        self.work = steps.push(Params {
            first: part.first,
            count: part.count,
            n_ignored: world.n_ignored(),
            resolve: u32::from(told.resolve),
            group_size: told.group_size,
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
            self.launches = Some(Launches::new(gpu, world, room, &self.steps));
        }
        Ok(())
    }

    /// Encodes all stages.
    pub fn encode(&self, stages: &mut Stages<'_>, world: &World, room: &Room) {
        let launches = self.launches.as_ref().expect("made before it is encoded");
        let arguments = room.arguments.buffer();
        stages.encoder.clear_buffer(room.cells.buffer(), 0, None);
        stages.encoder.clear_buffer(room.tallies.buffer(), 0, None);
        stages.stage(|pass| {
            launches.bounds.run(pass, world, &self.bounds);
            let groups = Groups::Known(world.bodies.len().div_ceil(64));
            launches.reach.run(pass, self.reach, groups);
            let groups = Groups::Known(world.forest().n_clusters());
            launches.keep.run(pass, 0, groups);
        });
        stages.stage(|pass| {
            let one = || Groups::Known(1);
            let kept = || Groups::Indirect(arguments, KEPT);
            launches.resolution.run(pass, self.resolution, one());
            launches.ranges.run(pass, 0, kept());
            launches.shift.run(pass, self.shift, one());
            launches.count.run(pass, 0, kept());
        });
        stages.stage(|pass| {
            let groups = Groups::Indirect(arguments, CELLS);
            launches.dispatch.run(pass, self.work, groups);
            let groups = Groups::Indirect(arguments, KEPT);
            launches.scatter.run(pass, 0, groups);
        });
        stages.stage(|pass| {
            let step = self.prepare_pairing;
            launches.prepare.run(pass, step, Groups::Known(1));
            let groups = Groups::Indirect(arguments, ROUNDS);
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
            bounds: Bounds::new(gpu, world, steps),
            reach: kernels.bounds_reach.bind(
                gpu,
                &BoundsReach {
                    nodes: world.nodes.read(),
                    bodies: world.bodies.read(),
                    ignored: world.ignored.read(),
                    reaches: room.reaches.write_to(),
                    tallies: room.tallies.write_to(),
                    params: params(),
                },
            ),
            keep: kernels.bounds_keep.bind(
                gpu,
                &BoundsKeep {
                    nodes: world.nodes.read(),
                    clusters: world.clusters.read(),
                    bodies: world.bodies.read(),
                    corners: world.corners.read(),
                    positions: world.positions.read(),
                    reaches: room.reaches.read(),
                    kept: room.kept.write_to(),
                    counters: counters(),
                },
            ),
            resolution: kernels.grid_resolution.bind(
                gpu,
                &GridResolution {
                    counters: counters(),
                    tallies: room.tallies.write_to(),
                    grid: room.grid.write_to(),
                    arguments: room.arguments.write_to(),
                    params: params(),
                },
            ),
            ranges: kernels.grid_ranges.bind(
                gpu,
                &GridRanges {
                    grid: room.grid.read(),
                    kept: room.kept.write_to(),
                    counters: counters(),
                    tallies: room.tallies.write_to(),
                },
            ),
            shift: kernels.grid_shift.bind(
                gpu,
                &GridShift {
                    counters: counters(),
                    tallies: room.tallies.write_to(),
                    grid: room.grid.write_to(),
                    arguments: room.arguments.write_to(),
                    params: params(),
                },
            ),
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
        let mut waiting = vec![Part::ALL];
        let mut seen = std::collections::BTreeSet::new();
        while let Some(part) = waiting.pop() {
            match part.split(n_cells) {
                Some(halves) => waiting.extend(halves),
                None => assert!(seen.insert(part.first), "cell {} twice", part.first),
            }
        }
        assert_eq!(seen.len(), 5);
    }
}
