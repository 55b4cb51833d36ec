//! Frames that are too large for the device, answered piece by piece.
//!
//! The clusters of all parts, body after body, are cut into chunks of which two fit on the device.
//! The pieces are every chunk by itself, and every two chunks whose boxes meet. Each piece is a
//! separate query, for which its topology and positions are sent.
//!
//! ```text
//! clusters  | body 0 . . . . . | body 1 . | body 2 . . . . . . . . |      chunks    0  1  2
//! runs      | 0:0 . . | 1:0 .  . 1:1 . | 1:2 . . | 2:0 . . . . .   |         0      x  x  x
//! chunks    |    0    |         1      .         |        2        |         1         x  x
//!                                                                            2            x
//! ```
//!
//! Two runs of one body count as one body on the device, with one numbering of their vertices: so
//! elements share a vertex there if and only if they do in the whole body. The host decides which
//! runs meet, so the device has no tree over bodies.
//!
//! Cost: quadratic in the number of chunks, but chunks are compact and most of their boxes do
//! not meet. Invariant: every two clusters lie in one pair of runs of one piece.

use std::ops::Range;

use super::buffers::count;
use super::topology::{DeviceClusters, Most, Weight, narrowed};
use crate::boxes;
use crate::bvh::bounds::Aabb;
use crate::bvh::clusters::Clustering;
use crate::bvh::for_each;
use crate::bvh::tree::TreeShape;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::index::{ClusterIx, PartIx};
use crate::scene::positions::Positions;
use crate::search::runner::Job;

/// Consecutive clusters of one part.
#[derive(Debug)]
pub struct ClusterRun {
    part: PartIx,
    clusters: Range<usize>,
    bounds: Aabb,
}

/// Consecutive runs, at most one per part.
#[derive(Debug)]
pub struct Chunk {
    pub runs: Vec<ClusterRun>,
    bounds: Aabb,
}

/// Cuts the clusters of a frame into chunks that weigh at most `most`, but have at least one
/// cluster.
///
/// # Errors
/// Threads that do not start.
pub fn cut<'a>(
    job: Job<'_>,
    most: Most,
    clustering: impl Fn(PartIx) -> &'a Clustering + Sync,
) -> Result<Vec<Chunk>, Error> {
    let Job {
        scene,
        plan,
        workers,
        ..
    } = job;
    let mut chunks: Vec<Chunk> = Vec::new();
    let mut weight = Weight::default();
    for part in plan.part_ixs() {
        let clustering = clustering(part);
        for cluster in clustering.clusters() {
            let (n, n_vertices) = (clustering.size(cluster), clustering.vertices(cluster).len());
            weight.add_cluster(count(n), count(n_vertices));
            if chunks.is_empty() || !weight.fits(most) {
                weight = Weight::default();
                weight.add_cluster(count(n), count(n_vertices));
                chunks.push(Chunk {
                    runs: Vec::new(),
                    bounds: Aabb::EMPTY,
                });
            }
            let runs = &mut chunks.last_mut().expect("just pushed").runs;
            match runs.last_mut() {
                Some(run) if run.part == part => run.clusters.end = cluster.index() + 1,
                _ => runs.push(ClusterRun {
                    part,
                    clusters: cluster.index()..cluster.index() + 1,
                    bounds: Aabb::EMPTY,
                }),
            }
        }
    }
    let find_boxes = |chunk: &mut Chunk| {
        for run in &mut chunk.runs {
            let clustering = clustering(run.part);
            let positions = plan.body(scene, run.part).positions();
            for cluster in ClusterIx::each(run.clusters.clone()) {
                let bounds = boxes::of_vertices(positions, clustering.vertices(cluster));
                run.bounds.join(&bounds);
            }
            chunk.bounds.join(&run.bounds);
        }
    };
    let n_elements = plan.n_elements() as usize;
    workers.install(n_elements, || {
        for_each(chunks.iter_mut().collect(), find_boxes);
    })?;
    Ok(chunks)
}

/// The pairs of runs of a piece that may hold pairs of elements, lower number first: runs of the
/// first chunk come before those of the second. For a single chunk, the pairs within it.
///
/// Two elements can only meet if the boxes of their runs do. Cost: a sweep along x.
pub fn meeting(plan: &Plan, chunks: &[&Chunk]) -> Vec<[u32; 2]> {
    let mut pairs = Vec::new();
    if let [a, b] = chunks
        && !a.bounds.overlaps(&b.bounds)
    {
        return pairs;
    }
    let numbered = |chunk_ix: usize| {
        let before = chunks[..chunk_ix].iter().map(|chunk| chunk.runs.len());
        let first = before.sum::<usize>();
        let runs = chunks[chunk_ix].runs.iter().enumerate();
        runs.map(move |(ix, run)| (chunk_ix, (first + ix) as u32, run))
    };
    let mut runs: Vec<(usize, u32, &ClusterRun)> = (0..chunks.len()).flat_map(numbered).collect();
    runs.sort_by(|a, b| a.2.bounds.min[0].total_cmp(&b.2.bounds.min[0]));
    for (ix, &(chunk_a, a, run_a)) in runs.iter().enumerate() {
        if chunks.len() == 1 && plan.part(run_a.part).within {
            pairs.push([a, a]);
        }
        for &(chunk_b, b, run_b) in &runs[ix + 1..] {
            if run_b.bounds.min[0] > run_a.bounds.max[0] {
                break;
            }
            let is_asked = chunks.len() == 1 || chunk_a != chunk_b;
            if is_asked && run_a.bounds.overlaps(&run_b.bounds) && meets(plan, run_a, run_b) {
                pairs.push([a.min(b), a.max(b)]);
            }
        }
    }
    pairs
}

fn meets(plan: &Plan, a: &ClusterRun, b: &ClusterRun) -> bool {
    if a.part == b.part {
        plan.part(a.part).within
    } else {
        plan.test(a.part, b.part).is_some()
    }
}

/// The data of a piece as it is sent to the device.
#[derive(Debug, Default)]
pub struct Loaded {
    pub topology: DeviceClusters,
    /// The trees of the runs.
    pub shapes: Vec<TreeShape>,
    /// For each body on the device, whether its positions were rounded.
    pub is_rounded: Vec<bool>,
    /// The coordinates of all named vertices, as bits.
    pub words: Vec<u32>,
}

impl Loaded {
    /// Runs of one part become one body, in the order of the chunks.
    pub fn new<'a>(
        scene: &Scene,
        plan: &Plan,
        chunks: &[&Chunk],
        clustering: impl Fn(PartIx) -> &'a Clustering,
    ) -> Self {
        let mut loaded = Loaded::default();
        let runs: Vec<&ClusterRun> = chunks.iter().flat_map(|chunk| &chunk.runs).collect();
        for runs in runs.chunk_by(|a, b| a.part == b.part) {
            let part = runs[0].part;
            loaded.push(scene, plan, part, runs, clustering(part));
        }
        loaded
    }

    fn push(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        part: PartIx,
        runs: &[&ClusterRun],
        clustering: &Clustering,
    ) {
        let positions = plan.body(scene, part).positions();
        // Where each vertex of the body is on the device.
        let mut on_device = vec![u32::MAX; positions.len()];
        for run in runs {
            for cluster in ClusterIx::each(run.clusters.clone()) {
                for &vertex in clustering.vertices(cluster) {
                    on_device[vertex as usize] = 0;
                }
            }
        }
        let mut next = (self.words.len() / 3) as u32;
        for (vertex, on_device) in on_device.iter_mut().enumerate() {
            if *on_device == u32::MAX {
                continue;
            }
            *on_device = next;
            next += 1;
            match positions {
                Positions::F32(positions) => self.words.extend(positions[vertex].map(f32::to_bits)),
                Positions::F64(positions) => {
                    self.words.extend(positions[vertex].iter().map(narrowed))
                }
            }
        }
        let body = self.is_rounded.len() as u32;
        self.is_rounded.push(matches!(positions, Positions::F64(_)));
        let first = plan.part(part).first;
        for run in runs {
            self.topology
                .push(clustering, run.clusters.clone(), first, body, |vertex| {
                    on_device[vertex as usize]
                });
            self.shapes.push(TreeShape::new(run.clusters.len()));
        }
    }
}
