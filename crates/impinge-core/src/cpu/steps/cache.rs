//! The cache of a layer: its clusters, and their boxes at the start and at the end of a step.

use std::sync::Arc;

use crate::clusterings::{Asked, Clustered, Clusterings, Fit, Store, spread};
use crate::cpu::bounds::TreeBounds;
use crate::cpu::dispatch::Tree;
use crate::cpu::simd::{Isa, Simd, dispatch};
use crate::error::Error;
use crate::grouping::bounds::{Bounds, BoundsArray, RawBoundsArray};
use crate::grouping::clusters::Clustering;
use crate::hull::{Hull, Pose};
use crate::index::{ClusterIx, LayerIx};
use crate::run::Job;
use crate::scene::Body;
use crate::settings::Settings;
use crate::stats::Statistics;

/// Clusters per task.
const CLUSTERS: usize = 128;

/// By slot of the body, then by part: vertices, edges and faces.
pub(super) type Caches = Store<LayerCache, 3>;

/// The data kept per layer from step to step.
#[derive(Debug)]
pub(super) struct LayerCache {
    /// The stamp of the topology that was clustered.
    pub topology_stamp: u64,
    /// The stamp of the step that the boxes belong to, and their pose.
    of: Option<(u64, Pose)>,
    pub clustering: Arc<Clustering>,
    /// Boxes that hold the start and the end.
    bounds: TreeBounds,
    /// The clusters' boxes at the start, and at the end.
    ends: [BoundsArray; 2],
    /// How well the clusters have fitted the layer.
    fit: Fit,
}

impl LayerCache {
    /// What is kept beside the clusters of a part of a body; no boxes yet.
    pub fn new(body: &Body, clustering: Arc<Clustering>) -> Self {
        let mut bounds = TreeBounds::default();
        bounds.resize(&clustering.shape);
        let mut ends = [BoundsArray::default(), BoundsArray::default()];
        for end in &mut ends {
            end.resize(clustering.n_clusters());
        }
        LayerCache {
            topology_stamp: body.topology_stamp(),
            of: None,
            clustering,
            bounds,
            ends,
            fit: Fit::UNKNOWN,
        }
    }

    #[inline(always)]
    pub fn tree(&self) -> Tree<'_> {
        Tree {
            shape: &self.clustering.shape,
            bounds: &self.bounds,
        }
    }

    /// The boxes of a cluster at the start and at the end.
    #[inline(always)]
    pub fn ends(&self, cluster: ClusterIx) -> [Bounds; 2] {
        self.ends.each_ref().map(|end| end.at(cluster.index()))
    }

    /// Bytes held beside the clusters.
    pub fn bytes(&self) -> usize {
        let ends: usize = self.ends.iter().map(BoundsArray::bytes).sum();
        size_of::<LayerCache>() + self.bounds.bytes() + ends
    }

    /// How well the clusters fit the current pose: the clusters' summed surface divided by the layer's.
    fn spread(&self) -> f64 {
        let clusters = 0..self.clustering.n_clusters();
        let surface: f64 = clusters.map(|ix| self.ends[0].at(ix).half_area()).sum();
        spread(surface, &self.bounds.root())
    }
}

impl Clustered for LayerCache {
    fn topology_stamp(&self) -> u64 {
        self.topology_stamp
    }

    fn clustering(&self) -> &Arc<Clustering> {
        &self.clustering
    }
}

/// Some clusters of a layer.
#[derive(Debug, Clone, Copy)]
struct Task {
    layer: LayerIx,
    first: usize,
    end: usize,
    /// Where boxes are written.
    leaves: RawBoundsArray,
    ends: [RawBoundsArray; 2],
}

/// Computes the boxes of all layers that have moved, or whose boxes were made for another [`Pose`]; layers that have flowed
/// away from their clusters are clustered again.
pub(super) fn refit<S: Send>(
    isa: Isa,
    job: Job<'_>,
    settings: &Settings,
    pose: Pose,
    (clusterings, caches): (&Clusterings, &mut Caches),
    scratches: &mut [S],
    stats: &mut Statistics,
) -> Result<(), Error> {
    find_boxes(isa, job, settings, pose, caches, scratches);
    let Job {
        scene,
        frame,
        workers,
        ..
    } = job;
    let mut is_stale = false;
    for (ix, layer) in frame.numbered_layers() {
        let body = frame.body(scene, ix);
        let cache = caches.at_mut(layer);
        let pose = frame.pose(pose, ix);
        if cache.of == Some((body.step_stamp(), pose)) {
            continue;
        }
        cache.bounds.refit_above(0, &cache.clustering.shape);
        cache.of = Some((body.step_stamp(), pose));
        let spread = cache.spread();
        let (asked, fit) = (Asked::new(layer.id, body, layer.part), &mut cache.fit);
        let mut known = clusterings.lock();
        if let Some(clustering) = known.renew_if_stale(asked, (fit, spread), workers, stats)? {
            *cache = LayerCache::new(body, clustering);
            is_stale = true;
        }
    }
    if is_stale {
        // New clusters have the best spread so far, so this recursion ends.
        let clustered = (clusterings, caches);
        refit(isa, job, settings, pose, clustered, scratches, stats)?;
    }
    Ok(())
}

fn find_boxes<S: Send>(
    isa: Isa,
    job: Job<'_>,
    settings: &Settings,
    pose: Pose,
    caches: &mut Caches,
    scratches: &mut [S],
) {
    let Job {
        scene,
        frame,
        workers,
        ..
    } = job;
    let mut tasks = Vec::new();
    for (ix, layer) in frame.numbered_layers() {
        let body = frame.body(scene, ix);
        let cache = caches.at_mut(layer);
        if cache.of == Some((body.step_stamp(), frame.pose(pose, ix))) {
            continue;
        }
        cache.of = None;
        let LayerCache {
            clustering,
            bounds,
            ends: [start, end],
            ..
        } = cache;
        let Some(leaves) = bounds.levels.first_mut() else {
            continue;
        };
        let n = clustering.n_clusters();
        let task = Task {
            layer: ix,
            first: 0,
            end: 0,
            leaves: leaves.raw(),
            ends: [start.raw(), end.raw()],
        };
        let n_each = workers.task(CLUSTERS);
        tasks.extend((0..n).step_by(n_each).map(|first| Task {
            first,
            end: n.min(first + n_each),
            ..task
        }));
    }
    let parallel = frame.n_primitives() >= settings.tuning.step_bounds_parallel_from;
    let n_workers = if parallel { workers.n() } else { 1 };
    let caches = &*caches;
    workers.for_each(&mut scratches[..n_workers], tasks.len(), |_, ix| {
        let task = tasks[ix];
        let layer = frame.layer(task.layer);
        let clustering = &caches.at(layer).clustering;
        let body = frame.body(scene, task.layer);
        let hull = Hull::new(body, frame.pose(pose, task.layer));
        dispatch!(isa, find, (
            clustering: &Clustering = clustering,
            hull: Hull<'_> = hull,
            task: Task = task,
        ));
    });
}

#[inline(always)]
fn find<S: Simd>(simd: S, clustering: &Clustering, hull: Hull<'_>, task: Task) {
    for cluster in task.first..task.end {
        let ends = hull.of_cluster(simd, clustering, ClusterIx::from_usize(cluster));
        let mut both = ends[0];
        both.join(&ends[1]);
        // SAFETY: no two tasks have the same cluster, and no thread reads boxes before all tasks are done.
        unsafe {
            task.leaves.put(cluster, &both);
            task.ends[0].put(cluster, &ends[0]);
            task.ends[1].put(cluster, &ends[1]);
        }
    }
}
