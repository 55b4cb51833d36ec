//! The layers of a step on the device: the vertices, edges and faces of each body, with positions and boxes at both ends.
//!
//! ```text
//! positions   all bodies at the start | all bodies at the end
//! nodes       boxes at the start      | boxes at the end
//! ```
//!
//! Layers of one body share its positions, so equal vertex ids mean the same vertex.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{MOST_PRIMITIVES, SLACK, World, put_words, sample, words};
use crate::elements::Part;
use crate::error::Error;
use crate::gpu::buffers::count;
use crate::gpu::forest::Forest;
use crate::gpu::layout::{
    BARE, BODY_SHIFT, Body, Coordinate, EDGES, FACES, NodePair, OWN_LAYERS, POINTS, VERTICES,
};
use crate::gpu::open::Gpu;
use crate::gpu::topology::{DeviceClusters, Weight};
use crate::grouping::clusters::Clustering;
use crate::grouping::hierarchy::TreeShape;
use crate::ids::BodyId;
use crate::plan::{Layer, Plan as Frame};
use crate::positions::Positions;
use crate::run::Job;
use crate::scene::{self, Filter, Scene};
use crate::stats::Statistics;

/// What the device holds of a step.
#[derive(Debug, Default)]
pub(super) struct Layers {
    /// The clusters of each layer.
    clusterings: Vec<Arc<Clustering>>,
    /// The bodies that layers belong to, in the order of their ids.
    bodies: Vec<Moving>,
    /// The vertices of all bodies.
    n_vertices: u64,
}

/// A body that takes part.
#[derive(Debug, Clone, Copy)]
struct Moving {
    id: BodyId,
    /// The stamp of the step whose positions were sent.
    step_stamp: u64,
    /// Index of its first vertex among those of one end.
    first_vertex: u64,
}

/// Positions that are on the device already, by body: at the start, and at the end.
#[derive(Debug, Default)]
pub(in crate::gpu) struct ResidentEnds<'a>(pub [BTreeMap<BodyId, &'a wgpu::Buffer>; 2]);

impl ResidentEnds<'_> {
    /// Whether the device has the positions of a body at both ends.
    fn has_both(&self, id: BodyId) -> bool {
        self.0.iter().all(|end| end.contains_key(&id))
    }

    /// Whether the host has rounded the positions of a body at an end.
    fn are_rounded(&self, id: BodyId, body: &scene::Body) -> bool {
        [Some(body.positions()), body.end_positions()]
            .into_iter()
            .zip(&self.0)
            .any(|(positions, end)| {
                matches!(positions, Some(Positions::F64(_))) && !end.contains_key(&id)
            })
    }
}

impl Layers {
    fn number(&self, id: BodyId) -> Option<usize> {
        self.bodies.binary_search_by_key(&id, |body| body.id).ok()
    }
}

/// The ids of all bodies of a frame, each once, in their order.
fn ids(frame: &Frame) -> Vec<BodyId> {
    let mut ids: Vec<BodyId> = frame.layers.iter().map(|layer| layer.id).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// The size of a step on the device; `None` if 32 bits do not number its vertices or layers.
pub(in crate::gpu) fn weigh(job: Job<'_>, clusterings: &[Arc<Clustering>]) -> Option<Weight> {
    let Job { scene, frame, .. } = job;
    let mut weight = Weight::default();
    let ids = ids(frame);
    for &id in &ids {
        weight.n_vertices += 2 * count(scene.body_in(id.slot()).n_vertices());
    }
    for clustering in clusterings {
        weight.n_primitives += count(clustering.order.len());
        weight.n_cluster_vertices += count(clustering.vertices.len());
        weight.n_clusters += count(clustering.n_clusters());
        let shape = &clustering.shape;
        let nodes = (0..shape.n_levels()).map(|level| count(shape.n_nodes(level)));
        weight.n_nodes += 2 * nodes.sum::<u64>();
        weight.n_bodies += 1;
    }
    // Gates and the tree over them.
    weight.n_nodes += 4 * weight.n_bodies;
    let is_numbered = 3 * weight.n_vertices <= u64::from(u32::MAX)
        && weight.n_primitives < MOST_PRIMITIVES
        && count(ids.len()) < 1 << (32 - BODY_SHIFT);
    is_numbered.then_some(weight)
}

impl World {
    /// Whether the device holds layers of a step, at both ends.
    pub fn is_moving(&self) -> bool {
        self.layers.is_some()
    }

    /// How many boxes each node has, and how many positions each vertex.
    pub fn n_ends(&self) -> u64 {
        1 + u64::from(self.is_moving())
    }

    /// Sends what has changed since the last step, which must have a [weight](weigh), except positions that are on the device.
    ///
    /// # Errors
    /// More than the device can bind at once.
    pub(in crate::gpu) fn update_moving(
        &mut self,
        gpu: &Gpu,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        resident: &ResidentEnds<'_>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job { scene, frame, .. } = job;
        let is_held = self.layers.as_ref().is_some_and(|held| {
            held.clusterings.len() == clusterings.len()
                && held
                    .clusterings
                    .iter()
                    .zip(clusterings)
                    .all(|(a, b)| Arc::ptr_eq(a, b))
        });
        if !is_held {
            // If an upload fails, half a topology must not look complete.
            self.layers = Some(Layers::default());
            let layers = self.send_layers(gpu, scene, frame, clusterings)?;
            self.layers = Some(layers);
        }
        self.send_ends(gpu, scene, resident);
        self.send_layer_records(gpu, scene, frame, resident)?;
        stats.n_clusters = self.forest.n_clusters();
        Ok(())
    }

    fn send_layers(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        frame: &Frame,
        clusterings: &[Arc<Clustering>],
    ) -> Result<Layers, Error> {
        let mut layers = Layers {
            clusterings: clusterings.to_vec(),
            ..Layers::default()
        };
        for id in ids(frame) {
            layers.bodies.push(Moving {
                id,
                step_stamp: 0,
                first_vertex: layers.n_vertices,
            });
            layers.n_vertices += count(scene.body_in(id.slot()).n_vertices());
        }
        let mut topology = DeviceClusters::default();
        for ((ix, layer), clustering) in frame.numbered_layers().zip(clusterings) {
            let body = layers.number(layer.id).expect("its body was listed");
            // Vertices fit 32 bits, or the frame would weigh nothing.
            let first = layers.bodies[body].first_vertex as u32;
            let clusters = 0..clustering.n_clusters();
            topology.push(clustering, clusters, layer.first, ix.raw(), |vertex| {
                first + vertex
            });
        }
        let shapes: Vec<&TreeShape> = clusterings.iter().map(|held| &held.shape).collect();
        self.forest = Forest::new(&shapes, |ix| sample(scene, frame, ix));
        self.send_trees(gpu, &topology)?;
        let both = [&self.forest.nodes[..], &self.forest.nodes[..]].concat();
        self.nodes.upload(gpu, &both)?;
        self.positions.resize(gpu, 6 * layers.n_vertices)?;
        self.bodies_sent.clear();
        Ok(layers)
    }

    /// Sends both ends of bodies that have moved, unless the device has both; runs of consecutive bodies in one write per end.
    fn send_ends(&mut self, gpu: &Gpu, scene: &Scene, resident: &ResidentEnds<'_>) {
        let Some(layers) = &mut self.layers else {
            return;
        };
        let n_vertices = layers.n_vertices;
        let is_new = |body: &Moving| {
            body.step_stamp != scene.body_in(body.id.slot()).step_stamp()
                && !resident.has_both(body.id)
        };
        for run in layers.bodies.chunk_by_mut(|a, b| is_new(a) == is_new(b)) {
            if !is_new(&run[0]) {
                continue;
            }
            self.is_moved = true;
            let first = run[0].first_vertex;
            for end in 0..2 {
                self.words.clear();
                for moving in &*run {
                    let body = scene.body_in(moving.id.slot());
                    let start = body.positions();
                    let positions = match end {
                        0 => start,
                        _ => body.end_positions().unwrap_or(start),
                    };
                    put_words(positions, &mut self.words);
                }
                let words: &[Coordinate] = bytemuck::cast_slice(&self.words);
                self.positions
                    .write(gpu, 3 * (end * n_vertices + first), words);
            }
            for moving in run {
                moving.step_stamp = scene.body_in(moving.id.slot()).step_stamp();
            }
        }
    }

    /// Encodes the copies of positions from buffers on the device, of the bodies that take part.
    pub(in crate::gpu) fn copy_ends(
        &mut self,
        resident: &ResidentEnds<'_>,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let Some(layers) = &mut self.layers else {
            return;
        };
        let bytes = 3 * size_of::<Coordinate>() as u64;
        let all = layers.n_vertices;
        let firsts = layers.bodies.iter().map(|body| body.first_vertex);
        let ends: Vec<u64> = firsts.skip(1).chain([all]).collect();
        for (end, buffers) in (0..).zip(&resident.0) {
            for (&id, buffer) in buffers {
                let Some(ix) = layers.number(id) else {
                    continue;
                };
                let moving = &mut layers.bodies[ix];
                // The device no longer has the scene's positions.
                moving.step_stamp = 0;
                self.is_moved = true;
                let n_vertices = ends[ix] - moving.first_vertex;
                let (to, size) = (
                    bytes * (end * all + moving.first_vertex),
                    bytes * n_vertices,
                );
                encoder.copy_buffer_to_buffer(buffer, 0, self.positions.buffer(), to, size);
            }
        }
    }

    /// Sends the records of all layers and the pairs of bodies that are ignored, if they have changed.
    fn send_layer_records(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        frame: &Frame,
        resident: &ResidentEnds<'_>,
    ) -> Result<(), Error> {
        if self.forest.reorder(|ix| sample(scene, frame, ix)) {
            let first = u64::from(self.forest.first_gate);
            self.nodes.write(gpu, first, self.forest.gates());
            self.is_moved = true;
        }
        let Some(layers) = &self.layers else {
            return Ok(());
        };
        let number = |id: BodyId| layers.number(id).map(|number| number as u32);
        let records = frame.numbered_layers().map(|(ix, layer)| {
            // Bodies without a category meet no other body.
            let filter = match frame.meets_bodies() {
                true => frame.filter(ix),
                false => Filter {
                    category: 0,
                    mask: 0,
                },
            };
            let is_rounded = resident.are_rounded(layer.id, frame.body(scene, ix));
            Body {
                root: self.forest.root(ix),
                slack: if is_rounded { SLACK } else { 0 },
                within: u32::from(frame.test(ix, ix).is_some()),
                layer: flags(layer) | number(layer.id).unwrap_or_default() << BODY_SHIFT,
                category: words(filter.category),
                mask: words(filter.mask),
            }
        });
        let records = records.collect();
        let ignored = frame.ignored_bodies();
        let ignored = ignored.filter_map(|(a, b)| {
            Some(NodePair {
                a: number(a)?,
                b: number(b)?,
            })
        });
        let ignored = ignored.collect();
        self.send_records(gpu, records, ignored)
    }
}

/// What `meets_layers.wgsl` needs to know of a layer besides its body.
fn flags(layer: &Layer) -> u32 {
    let part = match layer.part {
        Part::Edges => EDGES,
        Part::Vertices => VERTICES,
        Part::Faces | Part::Given => FACES,
    };
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    part | flag(layer.is_bare, BARE)
        | flag(layer.is_points, POINTS)
        | flag(layer.within, OWN_LAYERS)
}
