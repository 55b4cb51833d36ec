//! The method `Clusters` as a recording. Steps have the same launches, with kernels for boxes at
//! both ends and with a search.
//!
//! ```text
//! bounds     clusters · wide levels, one launch each · all narrow levels in one
//! traversal   round 0 · (prepare · round r) for r = 1 …
//! pairing    prepare · pairing
//! narrow     prepare · narrow;    in a step: · prepare · search, or names
//!            before it, if elements are left out: · leave_out
//!            if the lists stay on the device: · lists_end
//! ```

use super::buffers::Uniform;
use super::kernels::{
    BoundsClusters, BoundsLevel, BoundsTop, LeaveOut, ListsEnd, Narrow, NarrowKeep, NarrowMoving,
    NarrowNames, NarrowSafe, NarrowSearch, Pairing, Prepare, SafeEnd, Traversal,
};
use super::layout::{
    N_CANDIDATES, N_ITEMS, N_PAIRS, Params, ROUNDS, SEEK_ALL, SEEK_ANY, SEEK_EARLIEST,
};
use super::recording::{Recorder, Workgroups};
use super::view::{Asks, Motion, StepTest};
use crate::query::goal::Goal;

/// Levels of up to this many nodes are refitted by one workgroup, in one launch with the levels
/// above them.
const NARROW_LEVEL: u32 = 2048;
/// Candidates per workgroup.
pub(super) const GROUP: u32 = 64;
/// The slots of the arguments of pairing, of narrow, and of a search. Those below are the rounds'.
const PAIRING: u32 = ROUNDS;
const NARROW: u32 = ROUNDS + 1;
const SEARCH: u32 = ROUNDS + 2;

/// What a pass is told.
#[derive(Debug, Clone, Copy)]
pub(super) struct ClusterPass {
    pub n_seeds: u64,
    /// The rounds of the traversal.
    pub n_rounds: u32,
    /// Whether pairs that share a vertex are resolved.
    pub resolve: bool,
    /// What is asked of elements that may move.
    pub asks: Asks,
    /// In a step: the kinds of pairs, as `Params::kinds` has them.
    pub kinds: u32,
    /// In a step: which contacts the host seeks; none if results stay on the device.
    pub sought: Option<Goal>,
}

/// The workgroups over elements that a counter counts, for a later launch.
#[derive(Debug, Clone, Copy)]
pub struct Counted {
    /// Which counter, as numbered in `layout`.
    pub counter: u32,
    /// Elements per workgroup.
    pub per_group: u32,
    /// The most elements.
    pub capacity: u64,
    /// Where the arguments are put.
    pub slot: u32,
}

impl Recorder<'_> {
    /// All stages.
    pub(super) fn clusters(&mut self, of_pass: ClusterPass) {
        self.bounds_widened(of_pass.asks.reach);
        self.traversal(of_pass);
        self.recording.stage("pairing");
        self.pairing(of_pass);
        self.recording.stage("narrow");
        match (self.motion, of_pass.asks.test) {
            (Motion::Still, _) => self.narrow(),
            (Motion::Moving, StepTest::Touch) => self.narrow_step(of_pass.sought),
            (Motion::Moving, StepTest::Keep) => self.narrow_keep(of_pass.sought.is_none()),
            (Motion::Moving, StepTest::Safe) => self.narrow_safe(),
        }
    }

    /// Stage `bounds`: the boxes of clusters and of the trees above them, if anything has moved.
    pub fn bounds(&mut self) {
        self.bounds_widened(0);
    }

    fn bounds_widened(&mut self, reach: u32) {
        self.recording.stage("bounds");
        let (gpu, world, view) = (self.gpu, self.world, self.view);
        if !view.is_moved {
            return;
        }
        let kernels = &gpu.kernels;
        let (clusters, level, top) = match self.motion {
            Motion::Moving => (
                &kernels.bounds_clusters_moving,
                &kernels.bounds_level_moving,
                &kernels.bounds_top_moving,
            ),
            Motion::Still => (
                &kernels.bounds_clusters,
                &kernels.bounds_level,
                &kernels.bounds_top,
            ),
        };
        let levels = &view.levels;
        let leaves = levels.first().copied().unwrap_or_default();
        let bindings = BoundsClusters {
            clusters: world.clusters.read(),
            cluster_vertices: world.cluster_vertices.read(),
            positions: world.positions.read(),
            bodies: view.bodies.read(),
            nodes: world.nodes.write_to(),
            params: Uniform(Params {
                first: leaves.first,
                count: leaves.count,
                reach,
                ..Params::default()
            }),
        };
        let groups = Workgroups::Known(self.motion.n_ends() * u64::from(leaves.count));
        self.recording.launch(clusters, &bindings, groups);
        let is_wide = levels.iter().rposition(|level| level.count > NARROW_LEVEL);
        let narrow_from = is_wide.map_or(1, |last| last + 1).max(1);
        for wide in levels.iter().take(narrow_from).skip(1) {
            let bindings = BoundsLevel {
                bodies: view.bodies.read(),
                nodes: world.nodes.write_to(),
                params: Uniform(Params {
                    first: wide.first,
                    count: wide.count,
                    ..Params::default()
                }),
            };
            let groups = Workgroups::Known(u64::from(wide.count).div_ceil(64));
            self.recording.launch(level, &bindings, groups);
        }
        if narrow_from < levels.len() {
            let bindings = BoundsTop {
                bodies: view.bodies.read(),
                levels: view.table.read(),
                nodes: world.nodes.write_to(),
                params: Uniform(Params {
                    first: narrow_from as u32,
                    count: (levels.len() - narrow_from) as u32,
                    ..Params::default()
                }),
            };
            self.recording.launch(top, &bindings, Workgroups::Known(1));
        }
    }

    /// Stage `traversal`: tree against tree, a round per level.
    fn traversal(&mut self, of_pass: ClusterPass) {
        self.recording.stage("traversal");
        let (gpu, world, view, pass_buffers) = (self.gpu, self.world, self.view, self.pass_buffers);
        let kernel = match self.motion {
            Motion::Moving => &gpu.kernels.traversal_moving,
            Motion::Still => &gpu.kernels.traversal,
        };
        for round in 0..of_pass.n_rounds {
            let groups = match round {
                0 => Workgroups::Known(of_pass.n_seeds),
                _ => self.counted(Counted {
                    counter: round,
                    per_group: 1,
                    capacity: pass_buffers.capacities().queue,
                    slot: round,
                }),
            };
            // From queue a to b, and from b to a.
            let from = (round % 2) as usize;
            let bindings = Traversal {
                nodes: world.nodes.read(),
                bodies: view.bodies.read(),
                ignored: view.ignored.read(),
                queue: pass_buffers.queues[from].read(),
                next_queue: pass_buffers.queues[1 - from].write_to(),
                items: pass_buffers.items.write_to(),
                counters: pass_buffers.counters.write_to(),
                params: Uniform(Params {
                    first: round,
                    n_ignored: view.n_ignored(),
                    kinds: of_pass.kinds,
                    ..Params::default()
                }),
            };
            self.recording.launch(kernel, &bindings, groups);
        }
    }

    /// Work items to candidates.
    fn pairing(&mut self, of_pass: ClusterPass) {
        let (gpu, world, view, pass_buffers) = (self.gpu, self.world, self.view, self.pass_buffers);
        let groups = self.counted_items();
        let kernel = match self.motion {
            Motion::Moving => &gpu.kernels.pairing_moving,
            Motion::Still => &gpu.kernels.pairing,
        };
        let bindings = Pairing {
            nodes: world.nodes.read(),
            clusters: world.clusters.read(),
            bodies: view.bodies.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            items: pass_buffers.items.read(),
            candidates: pass_buffers.candidates.write_to(),
            counters: pass_buffers.counters.write_to(),
            params: Uniform(Params {
                resolve: u32::from(of_pass.resolve),
                reach: of_pass.asks.reach,
                ..Params::default()
            }),
        };
        self.recording.launch(kernel, &bindings, groups);
    }

    /// Launches `prepare`, which writes the number of workgroups of a later launch. Returns it.
    pub fn counted(&mut self, counted: Counted) -> Workgroups {
        let bindings = Prepare {
            counters: self.pass_buffers.counters.write_to(),
            arguments: self.pass_buffers.arguments.write_to(),
            params: Uniform(Params {
                counter: counted.counter,
                per_group: counted.per_group,
                // Capacities fit 32 bits.
                capacity: counted.capacity as u32,
                slot: counted.slot,
                ..Params::default()
            }),
        };
        let prepare = &self.gpu.kernels.prepare;
        self.recording
            .launch(prepare, &bindings, Workgroups::Known(1));
        self.indirect(counted.slot)
    }

    /// The workgroups of stage `pairing`, one per work item.
    pub fn counted_items(&mut self) -> Workgroups {
        self.counted(Counted {
            counter: N_ITEMS,
            per_group: 1,
            capacity: self.pass_buffers.capacities().items,
            slot: PAIRING,
        })
    }

    /// The workgroups of stage `narrow`. Those candidates that the question leaves out are marked.
    fn counted_candidates(&mut self) -> Workgroups {
        let groups = self.counted(Counted {
            counter: N_CANDIDATES,
            per_group: GROUP,
            capacity: self.pass_buffers.capacities().candidates,
            slot: NARROW,
        });
        if self.leaves_out {
            let (world, pass_buffers) = (self.world, self.pass_buffers);
            let bindings = LeaveOut {
                candidates: pass_buffers.candidates.write_to(),
                corners: world.corners.read(),
                order: world.order.read(),
                rules: pass_buffers.rules.read(),
                counters: pass_buffers.counters.write_to(),
                bodies: self.view.bodies.read(),
            };
            let leave_out = &self.gpu.kernels.leave_out;
            self.recording.launch(leave_out, &bindings, groups.clone());
        }
        groups
    }

    /// Stage `narrow`: the filter over all candidates.
    pub fn narrow(&mut self) {
        let (gpu, world, view, pass_buffers) = (self.gpu, self.world, self.view, self.pass_buffers);
        let groups = self.counted_candidates();
        // Scenes without tetrahedra use a kernel without the code for solids, and the registers it
        // needs.
        let kernel = match world.has_solids {
            true => &gpu.kernels.narrow_solids,
            false => &gpu.kernels.narrow,
        };
        let bindings = Narrow {
            candidates: pass_buffers.candidates.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            order: world.order.read(),
            pairs: pass_buffers.pairs.write_to(),
            unsure: pass_buffers.unsure.write_to(),
            counters: pass_buffers.counters.write_to(),
            bodies: view.bodies.read(),
        };
        self.recording.launch(kernel, &bindings, groups);
    }

    /// Stage `narrow` of a step: the filter over all candidates, and a search of the pairs that it
    /// leaves. `sought`: which contacts the host seeks; none if the results stay on the device,
    /// where pairs are named by global numbers.
    fn narrow_step(&mut self, sought: Option<Goal>) {
        let (gpu, world, view, pass_buffers) = (self.gpu, self.world, self.view, self.pass_buffers);
        let groups = self.counted_candidates();
        let bindings = NarrowMoving {
            candidates: pass_buffers.candidates.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            pairs: pass_buffers.pairs.write_to(),
            counters: pass_buffers.counters.write_to(),
        };
        self.recording
            .launch(&gpu.kernels.narrow_moving, &bindings, groups);
        let groups = self.counted_pairs();
        let bindings = NarrowSearch {
            pairs: pass_buffers.pairs.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            order: world.order.read(),
            unsure: pass_buffers.unsure.write_to(),
            times: pass_buffers.times.write_to(),
            counters: pass_buffers.counters.write_to(),
            params: Uniform(Params {
                by_number: u32::from(sought.is_none()),
                sought: match sought {
                    Some(Goal::Earliest) => SEEK_EARLIEST,
                    Some(Goal::Any) => SEEK_ANY,
                    _ => SEEK_ALL,
                },
                ..Params::default()
            }),
            bodies: view.bodies.read(),
        };
        self.recording
            .launch(&gpu.kernels.narrow_search, &bindings, groups);
    }

    /// The workgroups of a kernel over all pairs that stage `narrow` has left.
    fn counted_pairs(&mut self) -> Workgroups {
        self.counted(Counted {
            counter: N_PAIRS,
            per_group: GROUP,
            capacity: self.pass_buffers.capacities().pairs,
            slot: SEARCH,
        })
    }

    /// Stage `narrow` of a step whose elements keep a distance, in which times are found at once.
    /// `by_number`: whether pairs are named by global numbers.
    fn narrow_keep(&mut self, by_number: bool) {
        let (gpu, world, view, pass_buffers) = (self.gpu, self.world, self.view, self.pass_buffers);
        let groups = self.counted_candidates();
        let bindings = NarrowKeep {
            candidates: pass_buffers.candidates.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            thickness: pass_buffers.thickness.read(),
            pairs: pass_buffers.pairs.write_to(),
            times: pass_buffers.times.write_to(),
            counters: pass_buffers.counters.write_to(),
        };
        self.recording
            .launch(&gpu.kernels.narrow_keep, &bindings, groups);
        let groups = self.counted_pairs();
        let bindings = NarrowNames {
            pairs: pass_buffers.pairs.read(),
            order: world.order.read(),
            unsure: pass_buffers.unsure.write_to(),
            counters: pass_buffers.counters.write_to(),
            params: Uniform(Params {
                by_number: u32::from(by_number),
                ..Params::default()
            }),
            bodies: view.bodies.read(),
        };
        self.recording
            .launch(&gpu.kernels.narrow_names, &bindings, groups);
    }

    /// Stage `narrow` of safe distances.
    fn narrow_safe(&mut self) {
        let (gpu, world, pass_buffers) = (self.gpu, self.world, self.pass_buffers);
        let groups = self.counted_candidates();
        let bindings = NarrowSafe {
            candidates: pass_buffers.candidates.read(),
            corners: world.corners.read(),
            positions: world.positions.read(),
            limits: pass_buffers.limits.read(),
            thickness: pass_buffers.thickness.read(),
            shares: pass_buffers.shares.write_to(),
            counters: pass_buffers.counters.write_to(),
        };
        self.recording
            .launch(&gpu.kernels.narrow_safe, &bindings, groups);
        let bindings = SafeEnd {
            counters: pass_buffers.counters.write_to(),
            shares: pass_buffers.shares.write_to(),
            params: Uniform(self.rooms()),
        };
        let groups = pass_buffers.shares.len().div_ceil(u64::from(GROUP));
        let groups = Workgroups::Known(groups);
        self.recording
            .launch(&gpu.kernels.safe_end, &bindings, groups);
    }

    /// The end of stage `narrow` where the lists stay on the device: their numbers, which say
    /// whether they are complete.
    pub fn lists_end(&mut self) {
        let pass_buffers = self.pass_buffers;
        let bindings = ListsEnd {
            counters: pass_buffers.counters.write_to(),
            times: pass_buffers.times.write_to(),
            params: Uniform(self.rooms()),
        };
        // Frames have no times: one workgroup writes the numbers.
        let groups = match self.motion {
            Motion::Moving => pass_buffers.times.len().div_ceil(u64::from(GROUP)),
            Motion::Still => 1,
        };
        self.recording.launch(
            &self.gpu.kernels.lists_end,
            &bindings,
            Workgroups::Known(groups),
        );
    }

    /// The room of all buffers, for the last kernel.
    fn rooms(&self) -> Params {
        let capacities = self.pass_buffers.capacities();
        // Capacities fit 32 bits.
        Params {
            capacity: capacities.candidates as u32,
            queue_room: capacities.queue as u32,
            items_room: capacities.items as u32,
            kept_room: capacities.kept as u32,
            entries_room: capacities.entries as u32,
            pairs_room: capacities.pairs as u32,
            searched_room: match self.motion {
                Motion::Moving => capacities.pairs as u32,
                Motion::Still => 0,
            },
            ..Params::default()
        }
    }
}
