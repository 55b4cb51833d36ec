//! The launches of a pass, in order, and what each is told.
//!
//! ```text
//! bounds     clusters · wide levels, one launch each · all narrow levels in one
//! dispatch   round 0 · (prepare · round r) for r = 1 …
//! pairing    prepare · pairing
//! narrow     prepare · narrow
//! ```

use super::buffers::Storage;
use super::device::Gpu;
use super::kernels::{BoundsClusters, BoundsLevel, BoundsTop, Dispatch, Narrow, Pairing, Prepare};
use super::layout::{N_CANDIDATES, N_ITEMS, Params, ROUNDS, Step};
use super::pipeline::{Bound, Groups};
use super::room::Room;
use super::world::World;
use crate::error::Error;

/// Levels up to this wide are refitted by one workgroup, in one launch with those above them.
const NARROW_LEVEL: u32 = 2048;
/// Candidates a workgroup settles.
const NARROW_GROUP: u32 = 64;

/// The four stages on the device, in order: the names of their times.
pub(crate) const STAGES: [&str; 4] = ["bounds", "dispatch", "pairing", "narrow"];

/// Kernels with their buffers; made anew when a buffer is.
#[derive(Debug)]
pub(crate) struct Launches {
    bounds_clusters: Bound,
    bounds_level: Bound,
    bounds_top: Bound,
    prepare: Bound,
    /// From queue a to b, and from b to a.
    dispatch: [Bound; 2],
    pairing: Bound,
    narrow: Bound,
    has_solids: bool,
}

impl Launches {
    pub fn new(gpu: &Gpu, world: &World, room: &Room, plan: &Plan) -> Self {
        let kernels = &gpu.kernels;
        let params = || plan.steps_sent.params();
        let dispatch = |from: usize, to: usize| {
            let bindings = Dispatch {
                nodes: world.nodes.read(),
                bodies: world.bodies.read(),
                ignored: world.ignored.read(),
                queue: room.queues[from].read(),
                next_queue: room.queues[to].write_to(),
                items: room.items.write_to(),
                counters: room.counters.write_to(),
                params: params(),
            };
            kernels.dispatch.bind(gpu, &bindings)
        };
        let narrow = if world.has_solids {
            &kernels.narrow_solids
        } else {
            &kernels.narrow
        };
        Launches {
            bounds_clusters: kernels.bounds_clusters.bind(
                gpu,
                &BoundsClusters {
                    clusters: world.clusters.read(),
                    cluster_vertices: world.cluster_vertices.read(),
                    positions: world.positions.read(),
                    bodies: world.bodies.read(),
                    nodes: world.nodes.write_to(),
                },
            ),
            bounds_level: kernels.bounds_level.bind(
                gpu,
                &BoundsLevel {
                    bodies: world.bodies.read(),
                    nodes: world.nodes.write_to(),
                    params: params(),
                },
            ),
            bounds_top: kernels.bounds_top.bind(
                gpu,
                &BoundsTop {
                    bodies: world.bodies.read(),
                    levels: world.levels.read(),
                    nodes: world.nodes.write_to(),
                    params: params(),
                },
            ),
            prepare: kernels.prepare.bind(
                gpu,
                &Prepare {
                    counters: room.counters.write_to(),
                    arguments: room.arguments.write_to(),
                    params: params(),
                },
            ),
            dispatch: [dispatch(0, 1), dispatch(1, 0)],
            pairing: kernels.pairing.bind(
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
                    params: params(),
                },
            ),
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
            has_solids: world.has_solids,
        }
    }

    /// Whether these are the right kernels for what is in the world.
    pub fn fit(&self, world: &World) -> bool {
        self.has_solids == world.has_solids
    }
}

/// The steps' parameters as they lie on the device.
#[derive(Debug)]
pub(crate) struct Plan {
    steps: Vec<Step>,
    sent: Vec<Step>,
    steps_sent: Storage<Step>,
    /// Step and width of each wide level.
    wide: Vec<(u32, u32)>,
    top: Option<u32>,
    /// First step of the rounds.
    rounds: u32,
    n_rounds: u32,
    /// First step of the arguments of rounds 1, 2, …, pairing and narrow.
    prepares: u32,
}

impl Plan {
    pub fn new() -> Self {
        Plan {
            steps: Vec::new(),
            sent: Vec::new(),
            steps_sent: Storage::new("steps", wgpu::BufferUsages::UNIFORM),
            wide: Vec::new(),
            top: None,
            rounds: 0,
            n_rounds: 0,
            prepares: 0,
        }
    }

    /// Plans a pass. Returns whether the buffer of parameters is a new one.
    ///
    /// # Errors
    /// As [`Storage::resize`].
    pub fn make(
        &mut self,
        gpu: &Gpu,
        world: &World,
        room: &Room,
        n_rounds: u32,
        resolve: bool,
    ) -> Result<bool, Error> {
        self.steps.clear();
        self.wide.clear();
        let levels = &world.forest().levels;
        let narrow_from = levels
            .iter()
            .rposition(|level| level.count > NARROW_LEVEL)
            .map_or(1, |last| last + 1)
            .max(1);
        let mut push = |params: Params| {
            self.steps.push(params.into());
            self.steps.len() as u32 - 1
        };
        for level in levels.iter().take(narrow_from).skip(1) {
            let step = push(Params {
                first: level.first,
                count: level.count,
                ..Params::default()
            });
            self.wide.push((step, level.count));
        }
        self.top = (narrow_from < levels.len()).then(|| {
            push(Params {
                first: narrow_from as u32,
                count: (levels.len() - narrow_from) as u32,
                ..Params::default()
            })
        });
        self.n_rounds = n_rounds;
        self.rounds = push(Params {
            n_ignored: world.n_ignored(),
            resolve: u32::from(resolve),
            ..Params::default()
        });
        for round in 1..n_rounds {
            push(Params {
                first: round,
                n_ignored: world.n_ignored(),
                ..Params::default()
            });
        }
        let capacities = room.capacities();
        // Capacities are at most what 32 bits can number.
        let prepare = |counter: u32, per_group: u32, capacity: u64, slot: u32| Params {
            counter,
            per_group,
            capacity: capacity as u32,
            slot,
            ..Params::default()
        };
        let [pairing, narrow] = [ROUNDS, ROUNDS + 1];
        self.prepares = push(prepare(N_ITEMS, 1, capacities.items, pairing));
        let candidates = capacities.candidates;
        push(prepare(N_CANDIDATES, NARROW_GROUP, candidates, narrow));
        for round in 1..n_rounds {
            push(prepare(round, 1, capacities.queue, round));
        }
        let mut grew = false;
        if self.steps != self.sent || self.steps_sent.bytes() == 0 {
            grew = self.steps_sent.upload(gpu, &self.steps)?;
            self.sent.clone_from(&self.steps);
        }
        Ok(grew)
    }

    /// Encodes all stages, each in a pass of its own so that it can be timed.
    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        launches: &Launches,
        world: &World,
        room: &Room,
        n_seeds: u64,
        times: Option<&wgpu::QuerySet>,
    ) {
        let mut stage = |ix: u32, encode: &dyn Fn(&mut wgpu::ComputePass<'_>)| {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(STAGES[ix as usize]),
                timestamp_writes: times.map(|query_set| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(2 * ix),
                    end_of_pass_write_index: Some(2 * ix + 1),
                }),
            });
            encode(&mut pass);
        };
        let arguments = room.arguments.buffer();
        stage(0, &|pass| {
            if !world.is_moved {
                return;
            }
            let n_clusters = world.forest().n_clusters();
            launches
                .bounds_clusters
                .run(pass, 0, Groups::Known(n_clusters));
            for &(step, count) in &self.wide {
                let groups = Groups::Known(u64::from(count).div_ceil(64));
                launches.bounds_level.run(pass, step, groups);
            }
            if let Some(step) = self.top {
                launches.bounds_top.run(pass, step, Groups::Known(1));
            }
        });
        stage(1, &|pass| {
            for round in 0..self.n_rounds {
                let groups = if round == 0 {
                    Groups::Known(n_seeds)
                } else {
                    let prepare = self.prepares + 1 + round;
                    launches.prepare.run(pass, prepare, Groups::Known(1));
                    Groups::Indirect(arguments, round)
                };
                launches.dispatch[(round % 2) as usize].run(pass, self.rounds + round, groups);
            }
        });
        stage(2, &|pass| {
            launches.prepare.run(pass, self.prepares, Groups::Known(1));
            let groups = Groups::Indirect(arguments, ROUNDS);
            launches.pairing.run(pass, self.rounds, groups);
        });
        stage(3, &|pass| {
            let prepare = self.prepares + 1;
            launches.prepare.run(pass, prepare, Groups::Known(1));
            let groups = Groups::Indirect(arguments, ROUNDS + 1);
            launches.narrow.run(pass, 0, groups);
        });
    }
}
