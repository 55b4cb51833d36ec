//! Stage `narrow`: the filter over all candidates, for both methods and for steps.

use super::kernels::{Narrow, NarrowMoving, Prepare};
use super::layout::{N_CANDIDATES, Params, ROUNDS};
use super::open::Gpu;
use super::pipeline::{Bound, Workgroups};
use super::room::Room;
use super::steps::Steps;
use super::world::World;

/// Candidates per workgroup.
const GROUP: u32 = 64;
/// The slot of this stage's arguments.
const SLOT: u32 = ROUNDS + 1;

/// The kernels with their buffers.
#[derive(Debug)]
pub struct Settling {
    prepare: Bound,
    narrow: Bound,
}

/// Binds `prepare`, for any stage.
pub fn prepare(gpu: &Gpu, room: &Room, steps: &Steps) -> Bound {
    gpu.kernels.prepare.bind(
        gpu,
        &Prepare {
            counters: room.counters.write_to(),
            arguments: room.arguments.write_to(),
            params: steps.params(),
        },
    )
}

impl Settling {
    pub fn new(gpu: &Gpu, world: &World, room: &Room, steps: &Steps) -> Self {
        if world.is_moving() {
            return Settling {
                prepare: prepare(gpu, room, steps),
                narrow: gpu.kernels.narrow_moving.bind(
                    gpu,
                    &NarrowMoving {
                        candidates: room.candidates.read(),
                        corners: world.corners.read(),
                        positions: world.positions.read(),
                        order: world.order.read(),
                        unsure: room.unsure.write_to(),
                        counters: room.counters.write_to(),
                        params: steps.params(),
                    },
                ),
            };
        }
        // Scenes without tetrahedra use a kernel without the code for solids, and the registers it needs.
        let narrow = match world.has_solids {
            true => &gpu.kernels.narrow_solids,
            false => &gpu.kernels.narrow,
        };
        Settling {
            prepare: prepare(gpu, room, steps),
            narrow: narrow.bind(
                gpu,
                &Narrow {
                    candidates: room.candidates.read(),
                    corners: world.corners.read(),
                    positions: world.positions.read(),
                    order: world.order.read(),
                    pairs: room.pairs.write_to(),
                    unsure: room.unsure.write_to(),
                    counters: room.counters.write_to(),
                },
            ),
        }
    }

    /// Plans the stage and returns its step. `by_number`: the pairs of a step are named by global numbers.
    pub fn plan(steps: &mut Steps, room: &Room, by_number: bool) -> u32 {
        steps.push(Params {
            counter: N_CANDIDATES,
            per_group: GROUP,
            // Capacities fit 32 bits.
            capacity: room.capacities().candidates as u32,
            slot: SLOT,
            by_number: u32::from(by_number),
            ..Params::default()
        })
    }

    pub fn run(&self, pass: &mut wgpu::ComputePass<'_>, room: &Room, step: u32) {
        self.prepare.run(pass, step, Workgroups::Known(1));
        let groups = Workgroups::Indirect(room.arguments.buffer(), SLOT);
        self.narrow.run(pass, step, groups);
    }
}
