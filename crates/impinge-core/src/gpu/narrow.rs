//! Stage `narrow`: the filter over all candidates, for both methods and for steps.

use super::kernels::{Narrow, NarrowMoving, NarrowSearch, Prepare};
use super::layout::{N_CANDIDATES, N_PAIRS, Params, ROUNDS, SEEK_ALL, SEEK_ANY, SEEK_EARLIEST};
use super::open::Gpu;
use super::pipeline::{Bound, Workgroups};
use super::room::Room;
use super::steps::Steps;
use super::world::World;
use crate::sink::Goal;

/// Candidates per workgroup.
const GROUP: u32 = 64;
/// The slot of this stage's arguments, and that of a search.
const SLOT: u32 = ROUNDS + 1;
const SLOT_OF_SEARCH: u32 = ROUNDS + 2;

/// The kernels with their buffers.
#[derive(Debug)]
pub struct Settling {
    prepare: Bound,
    narrow: Bound,
    /// In a step: the search of pairs that are left.
    search: Option<Bound>,
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

fn of_candidates(room: &Room) -> Params {
    Params {
        counter: N_CANDIDATES,
        per_group: GROUP,
        // Capacities fit 32 bits.
        capacity: room.capacities().candidates as u32,
        slot: SLOT,
        ..Params::default()
    }
}

impl Settling {
    pub fn new(gpu: &Gpu, world: &World, room: &Room, steps: &Steps) -> Self {
        if world.is_moving() {
            return Settling::of_step(gpu, world, room, steps);
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
            search: None,
        }
    }

    fn of_step(gpu: &Gpu, world: &World, room: &Room, steps: &Steps) -> Self {
        let narrow = NarrowMoving {
            candidates: room.candidates.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            pairs: room.pairs.write_to(),
            counters: room.counters.write_to(),
        };
        let search = NarrowSearch {
            pairs: room.pairs.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            order: world.order.read(),
            unsure: room.unsure.write_to(),
            times: room.times.write_to(),
            counters: room.counters.write_to(),
            params: steps.params(),
        };
        Settling {
            prepare: prepare(gpu, room, steps),
            narrow: gpu.kernels.narrow_moving.bind(gpu, &narrow),
            search: Some(gpu.kernels.narrow_search.bind(gpu, &search)),
        }
    }

    /// Plans the stage and returns its step.
    pub fn plan(steps: &mut Steps, room: &Room) -> u32 {
        steps.push(of_candidates(room))
    }

    /// Plans the stage for a step, and returns the first of its two dispatches. `sought`: which contacts the host seeks; none if
    /// the results stay on the device, where pairs are named by global numbers.
    pub(super) fn plan_step(steps: &mut Steps, room: &Room, sought: Option<Goal>) -> u32 {
        let first = steps.push(of_candidates(room));
        steps.push(Params {
            counter: N_PAIRS,
            // Capacities fit 32 bits.
            capacity: room.capacities().pairs as u32,
            slot: SLOT_OF_SEARCH,
            by_number: u32::from(sought.is_none()),
            sought: match sought {
                Some(Goal::Earliest) => SEEK_EARLIEST,
                Some(Goal::Any) => SEEK_ANY,
                _ => SEEK_ALL,
            },
            ..of_candidates(room)
        });
        first
    }

    pub fn run(&self, pass: &mut wgpu::ComputePass<'_>, room: &Room, step: u32) {
        self.prepare.run(pass, step, Workgroups::Known(1));
        let groups = Workgroups::Indirect(room.arguments.buffer(), SLOT);
        self.narrow.run(pass, step, groups);
        if let Some(search) = &self.search {
            self.prepare.run(pass, step + 1, Workgroups::Known(1));
            let groups = Workgroups::Indirect(room.arguments.buffer(), SLOT_OF_SEARCH);
            search.run(pass, step + 1, groups);
        }
    }
}
