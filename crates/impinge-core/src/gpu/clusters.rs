//! The method `Clusters`: its launches, in order. Steps have the same, with kernels for boxes at both ends.
//!
//! ```text
//! bounds     clusters · wide levels, one launch each · all narrow levels in one
//! dispatch   round 0 · (prepare · round r) for r = 1 …
//! pairing    prepare · pairing
//! narrow     prepare · narrow
//! ```

use super::bounds::{BoundsLaunches, BoundsSteps};
use super::kernels::{Dispatch, Pairing};
use super::layout::{N_ITEMS, Params, ROUNDS};
use super::narrow::{Settling, prepare};
use super::open::Gpu;
use super::pipeline::{Bound, Workgroups};
use super::room::Room;
use super::steps::{Stages, Steps};
use super::world::World;
use crate::error::Error;
use crate::sink::Goal;

/// The stages on the device, in order, by their timing labels.
pub(crate) const STAGES: &[&str] = &["bounds", "dispatch", "pairing", "narrow"];

/// Kernels with their buffers; bound again when a buffer is replaced.
#[derive(Debug)]
struct Launches {
    bounds: BoundsLaunches,
    prepare: Bound,
    /// From queue a to b, and from b to a.
    dispatch: [Bound; 2],
    pairing: Bound,
    settling: Settling,
}

/// All launches of a pass.
#[derive(Debug)]
pub(crate) struct TreePlan {
    steps: Steps,
    launches: Option<Launches>,
    bounds: BoundsSteps,
    /// The step of the first round.
    rounds: u32,
    n_rounds: u32,
    /// The step that prepares pairing. The steps that prepare rounds 1, 2, … follow it.
    prepare_pairing: u32,
    narrow: u32,
}

/// What a pass is told.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Told {
    /// The rounds of the traversal.
    pub n_rounds: u32,
    /// Whether pairs that share a vertex are resolved.
    pub resolve: bool,
    /// Which contacts of a step the host seeks; none if results stay on the device.
    pub sought: Option<Goal>,
}

impl TreePlan {
    pub fn new() -> Self {
        TreePlan {
            steps: Steps::new(),
            launches: None,
            bounds: BoundsSteps::default(),
            rounds: 0,
            n_rounds: 0,
            prepare_pairing: 0,
            narrow: 0,
        }
    }

    /// Drops its kernel bindings: the buffers have changed.
    pub fn unbind(&mut self) {
        self.launches = None;
    }

    /// Plans a pass.
    ///
    /// # Errors
    /// As [`Steps::send`].
    pub fn make(&mut self, gpu: &Gpu, world: &World, room: &Room, told: Told) -> Result<(), Error> {
        let Told { n_rounds, .. } = told;
        let steps = &mut self.steps;
        steps.clear();
        self.bounds.plan(world, steps);
        self.n_rounds = n_rounds;
        self.rounds = steps.push(Params {
            n_ignored: world.n_ignored(),
            resolve: u32::from(told.resolve),
            ..Params::default()
        });
        for round in 1..n_rounds {
            steps.push(Params {
                first: round,
                n_ignored: world.n_ignored(),
                ..Params::default()
            });
        }
        // Capacities fit 32 bits.
        let capacities = room.capacities();
        let prepare = |counter: u32, capacity: u64, slot: u32| Params {
            counter,
            per_group: 1,
            capacity: capacity as u32,
            slot,
            ..Params::default()
        };
        self.prepare_pairing = steps.push(prepare(N_ITEMS, capacities.items, ROUNDS));
        for round in 1..n_rounds {
            steps.push(prepare(round, capacities.queue, round));
        }
        self.narrow = match world.is_moving() {
            true => Settling::plan_step(steps, room, told.sought),
            false => Settling::plan(steps, room),
        };
        if steps.send(gpu)? || self.launches.is_none() {
            self.launches = Some(Launches::new(gpu, world, room, &self.steps));
        }
        Ok(())
    }

    /// Encodes all stages.
    pub fn encode(&self, stages: &mut Stages<'_>, world: &World, room: &Room, n_seeds: u64) {
        let launches = self.launches.as_ref().expect("made before it is encoded");
        let arguments = room.arguments.buffer();
        stages.stage(|pass| launches.bounds.run(pass, world, &self.bounds));
        stages.stage(|pass| {
            for round in 0..self.n_rounds {
                let groups = if round == 0 {
                    Workgroups::Known(n_seeds)
                } else {
                    let step = self.prepare_pairing + round;
                    launches.prepare.run(pass, step, Workgroups::Known(1));
                    Workgroups::Indirect(arguments, round)
                };
                launches.dispatch[(round % 2) as usize].run(pass, self.rounds + round, groups);
            }
        });
        stages.stage(|pass| {
            let step = self.prepare_pairing;
            launches.prepare.run(pass, step, Workgroups::Known(1));
            let groups = Workgroups::Indirect(arguments, ROUNDS);
            launches.pairing.run(pass, self.rounds, groups);
        });
        stages.stage(|pass| launches.settling.run(pass, room, self.narrow));
    }
}

impl Launches {
    fn new(gpu: &Gpu, world: &World, room: &Room, steps: &Steps) -> Self {
        let kernels = &gpu.kernels;
        let (dispatch_kernel, pairing) = match world.is_moving() {
            true => (&kernels.dispatch_moving, &kernels.pairing_moving),
            false => (&kernels.dispatch, &kernels.pairing),
        };
        let dispatch = |from: usize, to: usize| {
            let bindings = Dispatch {
                nodes: world.nodes.read(),
                bodies: world.bodies.read(),
                ignored: world.ignored.read(),
                queue: room.queues[from].read(),
                next_queue: room.queues[to].write_to(),
                items: room.items.write_to(),
                counters: room.counters.write_to(),
                params: steps.params(),
            };
            dispatch_kernel.bind(gpu, &bindings)
        };
        Launches {
            bounds: BoundsLaunches::new(gpu, world, steps),
            prepare: prepare(gpu, room, steps),
            dispatch: [dispatch(0, 1), dispatch(1, 0)],
            pairing: pairing.bind(
                gpu,
                &Pairing {
                    nodes: world.nodes.read(),
                    clusters: world.clusters.read(),
                    bodies: world.bodies.read(),
                    corners: world.corners.read(),
                    positions: world.positions.read(),
                    items: room.items.read(),
                    candidates: room.candidates.write_to(),
                    counters: room.counters.write_to(),
                    params: steps.params(),
                },
            ),
            settling: Settling::new(gpu, world, room, steps),
        }
    }
}
