//! Stage `bounds`: the boxes of clusters and of the forest above them, for both methods.

use super::kernels::{BoundsClusters, BoundsLevel, BoundsTop};
use super::layout::Params;
use super::open::Gpu;
use super::pipeline::{Bound, Workgroups};
use super::steps::Steps;
use super::world::World;

/// Levels of up to this many nodes are refitted by one workgroup, in one launch with the levels above them.
const NARROW_LEVEL: u32 = 2048;

/// The kernels with their buffers.
#[derive(Debug)]
pub struct BoundsLaunches {
    clusters: Bound,
    level: Bound,
    top: Bound,
}

/// The launches of the stage.
#[derive(Debug, Default)]
pub struct BoundsSteps {
    /// Step and width of each wide level.
    wide: Vec<(u32, u32)>,
    top: Option<u32>,
}

impl BoundsSteps {
    pub fn plan(&mut self, world: &World, steps: &mut Steps) {
        self.wide.clear();
        let levels = &world.forest().levels;
        let narrow_from = levels
            .iter()
            .rposition(|level| level.count > NARROW_LEVEL)
            .map_or(1, |last| last + 1)
            .max(1);
        for level in levels.iter().take(narrow_from).skip(1) {
            let step = steps.push(Params {
                first: level.first,
                count: level.count,
                ..Params::default()
            });
            self.wide.push((step, level.count));
        }
        self.top = (narrow_from < levels.len()).then(|| {
            steps.push(Params {
                first: narrow_from as u32,
                count: (levels.len() - narrow_from) as u32,
                ..Params::default()
            })
        });
    }
}

impl BoundsLaunches {
    pub fn new(gpu: &Gpu, world: &World, steps: &Steps) -> Self {
        let kernels = &gpu.kernels;
        let (clusters, level, top) = match world.is_moving() {
            true => (
                &kernels.bounds_clusters_moving,
                &kernels.bounds_level_moving,
                &kernels.bounds_top_moving,
            ),
            false => (
                &kernels.bounds_clusters,
                &kernels.bounds_level,
                &kernels.bounds_top,
            ),
        };
        let (bodies, nodes) = (|| world.bodies.read(), || world.nodes.write_to());
        BoundsLaunches {
            clusters: clusters.bind(
                gpu,
                &BoundsClusters {
                    clusters: world.clusters.read(),
                    cluster_vertices: world.cluster_vertices.read(),
                    positions: world.positions.read(),
                    bodies: bodies(),
                    nodes: nodes(),
                },
            ),
            level: level.bind(
                gpu,
                &BoundsLevel {
                    bodies: bodies(),
                    nodes: nodes(),
                    params: steps.params(),
                },
            ),
            top: top.bind(
                gpu,
                &BoundsTop {
                    bodies: bodies(),
                    levels: world.levels.read(),
                    nodes: nodes(),
                    params: steps.params(),
                },
            ),
        }
    }

    /// Refits all boxes, if anything has moved.
    pub fn run(&self, pass: &mut wgpu::ComputePass<'_>, world: &World, steps: &BoundsSteps) {
        if !world.is_moved {
            return;
        }
        let n_clusters = Workgroups::Known(world.n_ends() * world.forest().n_clusters());
        self.clusters.run(pass, 0, n_clusters);
        for &(step, count) in &steps.wide {
            let groups = Workgroups::Known(u64::from(count).div_ceil(64));
            self.level.run(pass, step, groups);
        }
        if let Some(step) = steps.top {
            self.top.run(pass, step, Workgroups::Known(1));
        }
    }
}
