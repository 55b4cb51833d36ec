//! Stages `bounds` and `grid` of methods that work in a grid: kept primitives and their ranges.
//!
//! ```text
//! bounds     as in Clusters, for the boxes of bodies · reach · primitives within reach
//! grid       resolution, eq. (1) · ranges, eq. (3) · shift
//! ```

use super::bounds::{BoundsLaunches, BoundsSteps};
use super::kernels::{BoundsKeep, BoundsReach, GridRanges, GridResolution, GridShift};
use super::layout::{NO_ROOT, Params};
use super::open::Gpu;
use super::pipeline::{Bound, Workgroups};
use super::room::Room;
use super::steps::Steps;
use super::world::World;

/// Slot of the arguments for dispatches over kept primitives, 64 per workgroup.
pub const KEPT: u32 = 0;
/// Slot of the arguments for dispatches over cells, 64 per workgroup.
pub const CELLS: u32 = 1;

/// The kernels with their buffers.
#[derive(Debug)]
pub struct Reaching {
    bounds: BoundsLaunches,
    reach: Bound,
    keep: Bound,
    resolution: Bound,
    ranges: Bound,
    shift: Bound,
}

/// The launches of both stages.
#[derive(Debug, Default)]
pub struct ReachingSteps {
    bounds: BoundsSteps,
    reach: u32,
    resolution: u32,
    shift: u32,
}

impl ReachingSteps {
    /// Plans both stages, with cells as dense as `lambda`.
    pub fn plan(&mut self, world: &World, room: &Room, lambda: f64, steps: &mut Steps) {
        self.bounds.plan(world, steps);
        // Capacities and counts fit 32 bits.
        self.reach = steps.push(Params {
            first: world.forest().top().unwrap_or(NO_ROOT),
            count: world.bodies.len() as u32,
            n_ignored: world.n_ignored(),
            ..Params::default()
        });
        let over_kept = Params {
            capacity: room.capacities().kept as u32,
            lambda: (lambda as f32).clamp(f32::MIN_POSITIVE, f32::MAX).to_bits(),
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
    }
}

impl Reaching {
    /// Binds the kernels.
    pub fn new(gpu: &Gpu, world: &World, room: &Room, steps: &Steps) -> Self {
        let kernels = &gpu.kernels;
        let params = || steps.params();
        let counters = || room.counters.write_to();
        Reaching {
            bounds: BoundsLaunches::new(gpu, world, steps),
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
        }
    }

    /// Clears the tallies, which must be zero before a pass.
    pub fn clear(encoder: &mut wgpu::CommandEncoder, room: &Room) {
        encoder.clear_buffer(room.tallies.buffer(), 0, None);
    }

    /// Stage `bounds`.
    pub fn run_bounds(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        world: &World,
        steps: &ReachingSteps,
    ) {
        self.bounds.run(pass, world, &steps.bounds);
        let groups = Workgroups::Known(world.bodies.len().div_ceil(64));
        self.reach.run(pass, steps.reach, groups);
        let groups = Workgroups::Known(world.forest().n_clusters());
        self.keep.run(pass, 0, groups);
    }

    /// Stage `grid`, up to the ranges and their shift.
    pub fn run_grid(&self, pass: &mut wgpu::ComputePass<'_>, room: &Room, steps: &ReachingSteps) {
        self.resolution
            .run(pass, steps.resolution, Workgroups::Known(1));
        let kept = Workgroups::Indirect(room.arguments.buffer(), KEPT);
        self.ranges.run(pass, 0, kept);
        self.shift.run(pass, steps.shift, Workgroups::Known(1));
    }
}
