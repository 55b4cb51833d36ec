//! The layers on the device: a forest of clusters, and positions.
//!
//! All trees lie in one array of nodes, ordered by height over all bodies, so that one launch refits one
//! height of every tree. Above three or more bodies there is a tree over bodies, whose leaves are
//! gates, the entrances to the bodies:
//!
//! ```text
//! height h+2                    top
//! height h+1          node  …         node          tree over bodies
//! height h        gate 0 … gate k  gate … gate      one per body: filters are checked here
//! …                  |       |
//! height 1         root    root …                   bodies' trees, of unequal heights
//! height 0        clusters of body 0 | of body 1 | …
//! ```
//!
//! Topology is sent once; each frame sends the positions that have changed. For steps, `moving` sends layers of bodies instead of
//! bodies, and boxes and positions at both ends.

mod moving;

pub(super) use moving::{ResidentEnds, weigh as weigh_moving};

use std::sync::Arc;

use crate::error::Error;
use crate::grouping::clusters::Clustering;
use crate::grouping::hierarchy::TreeShape;
use crate::ids::BodyId;
use crate::index::LayerIx;
use crate::plan::Plan as Frame;
use crate::positions::Positions;
use crate::run::Job;
use crate::scene::{Filter, Scene};
use crate::stats::Statistics;

use super::buffers::{Storage, count};
use super::clusterings::Clusterings;
use super::forest::Forest;
use super::layout::{
    Body, Cluster, ClusterVertex, Coordinate, Corners, Level, NO_ROOT, Node, NodePair, Order,
};
use super::open::Gpu;
use super::pieces::{Chunk, Loaded};
use super::topology::{DeviceClusters, Weight, narrowed};

/// Bit 31 of a place is a flag.
pub const MOST_PRIMITIVES: u64 = 1 << 31;
/// By how many keys the boxes of rounded positions are widened: see `boxes.wgsl`.
const SLACK: u32 = 2;
/// One layer on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Resident {
    id: BodyId,
    /// The number of the clustering that was sent.
    number: u64,
    positions_stamp: u64,
    /// Index of its first vertex in the positions.
    first_vertex: u64,
    n_vertices: u64,
}

/// The data on layers that the kernels read.
#[derive(Debug)]
pub struct World {
    pub clusterings: Clusterings,
    residents: Vec<Resident>,
    /// The nodes on the device, without their boxes.
    forest: Forest,
    bodies_sent: Vec<Body>,
    ignored_sent: Vec<NodePair>,
    words: Vec<u32>,
    /// The layers of a step, if the device holds those.
    layers: Option<moving::Layers>,
    /// Whether boxes have to be refitted.
    pub is_moved: bool,
    pub has_solids: bool,
    pub nodes: Storage<Node>,
    pub bodies: Storage<Body>,
    pub clusters: Storage<Cluster>,
    pub cluster_vertices: Storage<ClusterVertex>,
    pub corners: Storage<Corners>,
    pub order: Storage<Order>,
    pub positions: Storage<Coordinate>,
    pub levels: Storage<Level>,
    pub ignored: Storage<NodePair>,
}

impl World {
    pub(crate) fn new() -> Self {
        World {
            clusterings: Clusterings::default(),
            residents: Vec::new(),
            forest: Forest::default(),
            bodies_sent: Vec::new(),
            ignored_sent: Vec::new(),
            words: Vec::new(),
            layers: None,
            is_moved: false,
            has_solids: false,
            nodes: Storage::plain("nodes"),
            bodies: Storage::plain("bodies"),
            clusters: Storage::plain("clusters"),
            cluster_vertices: Storage::plain("cluster vertices"),
            corners: Storage::plain("corners"),
            order: Storage::plain("order"),
            positions: Storage::plain("positions"),
            levels: Storage::plain("levels"),
            ignored: Storage::plain("ignored"),
        }
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.nodes.bytes()
            + self.bodies.bytes()
            + self.clusters.bytes()
            + self.cluster_vertices.bytes()
            + self.corners.bytes()
            + self.order.bytes()
            + self.positions.bytes()
            + self.levels.bytes()
            + self.ignored.bytes()
    }

    pub fn forest(&self) -> &Forest {
        &self.forest
    }

    /// Sends what has changed since the last frame; positions of `resident` bodies are on the device already.
    ///
    /// # Errors
    /// More primitives than the device can bind at once.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        job: Job<'_>,
        resident: &[BodyId],
        recluster: bool,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job { scene, frame, .. } = job;
        if frame.n_primitives() > MOST_PRIMITIVES {
            return Err(Error::TooMany {
                what: "primitives in one query on a GPU",
                given: frame.n_primitives(),
                limit: MOST_PRIMITIVES,
            });
        }
        self.clusterings.update(job, resident, recluster, stats)?;
        if !self.is_resident(frame) {
            // If an upload fails, half a topology must not look complete.
            self.residents.clear();
            self.send_topology(gpu, scene, frame)?;
        }
        self.send_positions(gpu, scene, frame, resident);
        self.send_bodies(gpu, scene, frame, resident)?;
        stats.n_clusters = self.forest.n_clusters();
        Ok(())
    }

    fn is_resident(&self, frame: &Frame) -> bool {
        self.residents.len() == frame.layers.len()
            && frame
                .layer_ixs()
                .zip(&self.residents)
                .all(|(ix, resident)| {
                    let cache = self.clusterings.of(resident.id);
                    resident.id == frame.layer(ix).id
                        && cache.is_some_and(|cache| cache.number == resident.number)
                })
    }

    fn send_topology(&mut self, gpu: &Gpu, scene: &Scene, frame: &Frame) -> Result<(), Error> {
        let caches: Vec<(u64, Arc<Clustering>)> = frame
            .layers
            .iter()
            .map(|layer| {
                let cache = self.clusterings.of(layer.id);
                let cache = cache.expect("just clustered");
                (cache.number, Arc::clone(&cache.clustering))
            })
            .collect();
        let mut residents = Vec::with_capacity(caches.len());
        let mut topology = DeviceClusters::default();
        let mut first_vertex = 0u64;
        for ((ix, layer), (number, clustering)) in frame.numbered_layers().zip(&caches) {
            let n_vertices = count(frame.body(scene, ix).n_vertices());
            let limit = u64::from(u32::MAX) / 3;
            if first_vertex + n_vertices > limit {
                return Err(Error::TooMany {
                    what: "vertices in one query on a GPU",
                    given: first_vertex + n_vertices,
                    limit,
                });
            }
            // Vertices fit 32 bits: just checked.
            let first = first_vertex as u32;
            let clusters = 0..clustering.n_clusters();
            topology.push(clustering, clusters, layer.first, ix.raw(), |vertex| {
                first + vertex
            });
            residents.push(Resident {
                id: layer.id,
                number: *number,
                positions_stamp: 0,
                first_vertex,
                n_vertices,
            });
            first_vertex += n_vertices;
        }
        let shapes: Vec<&TreeShape> = caches
            .iter()
            .map(|(_, clustering)| &clustering.shape)
            .collect();
        self.forest = Forest::new(&shapes, |ix| sample(scene, frame, ix));
        self.send_trees(gpu, &topology)?;
        self.positions.resize(gpu, 3 * first_vertex)?;
        self.bodies_sent.clear();
        self.residents = residents;
        Ok(())
    }

    fn send_trees(&mut self, gpu: &Gpu, topology: &DeviceClusters) -> Result<(), Error> {
        self.has_solids = topology.has_solids;
        self.clusters.upload(gpu, &topology.clusters)?;
        self.cluster_vertices
            .upload(gpu, &topology.cluster_vertices)?;
        self.corners.upload(gpu, &topology.corners)?;
        self.order.upload(gpu, &topology.numbers)?;
        self.nodes.upload(gpu, &self.forest.nodes)?;
        self.levels.upload(gpu, &self.forest.levels)?;
        Ok(())
    }

    /// Sends a piece of the frame instead of all of it.
    ///
    /// # Errors
    /// The piece is larger than the device can bind at once.
    pub fn send_piece(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        frame: &Frame,
        chunks: &[&Chunk],
    ) -> Result<(), Error> {
        self.residents.clear();
        let loaded = Loaded::new(scene, frame, chunks, |layer| self.clustering(frame, layer));
        self.forest = Forest::of_trees(&Vec::from_iter(&loaded.shapes));
        self.send_trees(gpu, &loaded.topology)?;
        let words: &[Coordinate] = bytemuck::cast_slice(&loaded.words);
        self.positions.upload(gpu, words)?;
        let slacks = loaded.is_rounded.iter().map(|&is_rounded| Body {
            root: NO_ROOT,
            slack: if is_rounded { SLACK } else { 0 },
            ..Body::default()
        });
        self.bodies.upload(gpu, &Vec::from_iter(slacks))?;
        self.bodies_sent.clear();
        self.ignored.upload(gpu, &[])?;
        self.ignored_sent.clear();
        self.is_moved = true;
        Ok(())
    }

    /// Frees all buffers. The clusterings stay.
    pub fn forget_buffers(&mut self) {
        *self = World {
            clusterings: std::mem::take(&mut self.clusterings),
            ..World::new()
        };
    }

    /// The clustering of a layer, which must be known.
    pub(crate) fn clustering(&self, frame: &Frame, layer: LayerIx) -> &Clustering {
        let id = frame.layer(layer).id;
        let cache = self.clusterings.of(id);
        &cache.expect("just clustered").clustering
    }

    /// The size of a whole frame on the device.
    pub fn weigh(&self, scene: &Scene, frame: &Frame) -> Weight {
        let mut weight = Weight::default();
        for ix in frame.layer_ixs() {
            let clustering = self.clustering(frame, ix);
            weight.n_primitives += count(clustering.order.len());
            weight.n_vertices += count(frame.body(scene, ix).n_vertices());
            weight.n_cluster_vertices += count(clustering.vertices.len());
            weight.n_clusters += count(clustering.n_clusters());
            let shape = &clustering.shape;
            let nodes = (0..shape.n_levels()).map(|level| count(shape.n_nodes(level)));
            weight.n_nodes += nodes.sum::<u64>();
            weight.n_bodies += 1;
        }
        if weight.n_bodies > 2 {
            // Gates and the tree over them.
            weight.n_nodes += 2 * weight.n_bodies;
        }
        weight
    }

    /// Sends the positions of bodies that have moved; runs of consecutive bodies in one write.
    fn send_positions(&mut self, gpu: &Gpu, scene: &Scene, frame: &Frame, resident: &[BodyId]) {
        let mut ix = 0;
        while ix < self.residents.len() {
            let from = ix;
            let start = self.residents[from].first_vertex;
            while ix < self.residents.len() {
                let layer = LayerIx::from_usize(ix);
                let stamp = frame.body(scene, layer).positions_stamp();
                let is_there = self.residents[ix].positions_stamp == stamp
                    || resident.contains(&self.residents[ix].id);
                if is_there {
                    break;
                }
                self.residents[ix].positions_stamp = stamp;
                ix += 1;
            }
            if ix == from {
                ix += 1;
                continue;
            }
            self.is_moved = true;
            if let ([only], Positions::F32(positions)) = (
                &self.residents[from..ix],
                frame.body(scene, LayerIx::from_usize(from)).positions(),
            ) {
                let words: &[Coordinate] = bytemuck::cast_slice(positions);
                self.positions.write(gpu, 3 * only.first_vertex, words);
                continue;
            }
            self.words.clear();
            for layer in (from..ix).map(LayerIx::from_usize) {
                put_words(frame.body(scene, layer).positions(), &mut self.words);
            }
            let words: &[Coordinate] = bytemuck::cast_slice(&self.words);
            self.positions.write(gpu, 3 * start, words);
        }
    }

    /// Sends the records of all bodies and the list of ignored pairs, if they differ from those on the device.
    fn send_bodies(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        frame: &Frame,
        resident: &[BodyId],
    ) -> Result<(), Error> {
        if self.forest.reorder(|ix| sample(scene, frame, ix)) {
            self.nodes
                .write(gpu, u64::from(self.forest.first_gate), self.forest.gates());
            self.is_moved = true;
        }
        let mut bodies = Vec::with_capacity(frame.layers.len());
        for (ix, layer) in frame.numbered_layers() {
            // Bodies without a category meet no other body.
            let filter = match frame.between() {
                true => frame.filter(ix),
                false => Filter {
                    category: 0,
                    mask: 0,
                },
            };
            let rounded = match frame.body(scene, ix).positions() {
                Positions::F32(_) => false,
                Positions::F64(_) => !resident.contains(&layer.id),
            };
            bodies.push(Body {
                root: self.forest.root(ix),
                slack: if rounded { SLACK } else { 0 },
                within: u32::from(layer.within),
                layer: 0,
                category: words(filter.category),
                mask: words(filter.mask),
            });
        }
        let ignored = frame.ignored_pairs().map(|(a, b)| NodePair {
            a: a.raw(),
            b: b.raw(),
        });
        let ignored = ignored.collect();
        self.send_records(gpu, bodies, ignored)
    }

    /// Sends records and ignored pairs that differ from those on the device.
    fn send_records(
        &mut self,
        gpu: &Gpu,
        bodies: Vec<Body>,
        ignored: Vec<NodePair>,
    ) -> Result<(), Error> {
        if bodies != self.bodies_sent {
            self.bodies.upload(gpu, &bodies)?;
            self.bodies_sent = bodies;
        }
        if ignored != self.ignored_sent || self.ignored.bytes() == 0 {
            self.ignored.upload(gpu, &ignored)?;
            self.ignored_sent = ignored;
        }
        Ok(())
    }

    /// Encodes the copy of a body's positions from a buffer on the device, if it takes part.
    pub fn copy_positions(
        &mut self,
        body: BodyId,
        buffer: &wgpu::Buffer,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let held = self.residents.iter_mut().find(|held| held.id == body);
        let Some(held) = held.filter(|held| held.n_vertices > 0) else {
            return;
        };
        // The device no longer has the scene's positions.
        held.positions_stamp = 0;
        self.is_moved = true;
        let vertex = 3 * size_of::<Coordinate>() as u64;
        let (to, size) = (held.first_vertex * vertex, held.n_vertices * vertex);
        encoder.copy_buffer_to_buffer(buffer, 0, self.positions.buffer(), to, size);
    }

    /// Where the positions of a body are on the device, if they are those of the pose with this stamp: the buffer and the
    /// first byte.
    pub fn positions_of(&self, body: BodyId, stamp: u64) -> Option<(&wgpu::Buffer, u64)> {
        let is_there = |held: &&Resident| held.id == body && held.positions_stamp == stamp;
        let held = self.residents.iter().find(is_there)?;
        let vertex = 3 * size_of::<Coordinate>() as u64;
        Some((self.positions.buffer(), held.first_vertex * vertex))
    }

    /// The length of the list of ignored pairs.
    pub fn n_ignored(&self) -> u32 {
        self.ignored_sent.len() as u32
    }

    /// The seeds of a traversal: pairs of nodes, whose boxes need not overlap.
    pub fn seeds(&self, frame: &Frame) -> Vec<NodePair> {
        let forest = &self.forest;
        let root = |layer: LayerIx| forest.root(layer);
        let mut seeds = Vec::new();
        if let Some(top) = forest.top()
            && frame.between()
        {
            return vec![NodePair { a: top, b: top }];
        }
        if frame.between() {
            let filled = frame.layer_ixs().filter(|&ix| forest.is_filled(ix));
            let filled: Vec<LayerIx> = filled.collect();
            if let [a, b] = filled[..]
                && frame.test(a, b).is_some()
            {
                seeds.push(NodePair {
                    a: root(a),
                    b: root(b),
                });
            }
        }
        for (ix, layer) in frame.numbered_layers() {
            let is_asked = layer.within && frame.test(ix, ix).is_some();
            if is_asked && forest.is_filled(ix) {
                seeds.push(NodePair {
                    a: root(ix),
                    b: root(ix),
                });
            }
        }
        seeds
    }

    /// The seeds of a piece, from pairs of its runs by their numbers.
    pub fn seeds_of_runs(&self, pairs: &[[u32; 2]]) -> Vec<NodePair> {
        let root = |run: u32| self.forest.roots[run as usize];
        let seed = |&[a, b]: &[u32; 2]| NodePair {
            a: root(a),
            b: root(b),
        };
        pairs.iter().map(seed).collect()
    }

    /// Appends the pairs of children of two nodes, whether their boxes overlap or not. Returns false, and appends
    /// nothing, for two clusters. The same steps as `dispatch.wgsl`.
    pub fn expand(&self, frame: &Frame, pair: NodePair, into: &mut Vec<NodePair>) -> bool {
        let nodes = &self.forest.nodes;
        let (a, b) = (&nodes[pair.a as usize], &nodes[pair.b as usize]);
        if a.height() == 0 && b.height() == 0 {
            return false;
        }
        if a.is_gate() && b.is_gate() {
            let [layer_a, layer_b] = [a, b].map(|gate| LayerIx::new(gate.first_child));
            if frame.test(layer_a, layer_b).is_some() {
                into.push(NodePair {
                    a: self.forest.root(layer_a),
                    b: self.forest.root(layer_b),
                });
            }
            return true;
        }
        let children = |node: &Node| node.first_child..node.first_child + node.n_children();
        if pair.a == pair.b {
            for i in children(a) {
                into.extend((i..children(a).end).map(|j| NodePair { a: i, b: j }));
            }
        } else if a.height() > b.height() {
            into.extend(children(a).map(|i| NodePair { a: i, b: pair.b }));
        } else if b.height() > a.height() {
            into.extend(children(b).map(|j| NodePair { a: pair.a, b: j }));
        } else {
            for i in children(a) {
                into.extend(children(b).map(|j| NodePair { a: i, b: j }));
            }
        }
        true
    }
}

/// The low and the high word.
fn words(bits: u64) -> [u32; 2] {
    [bits as u32, (bits >> 32) as u32]
}

/// Appends the coordinates as the device has them.
fn put_words(positions: &Positions, words: &mut Vec<u32>) {
    match positions {
        Positions::F32(positions) => words.extend_from_slice(bytemuck::cast_slice(positions)),
        Positions::F64(positions) => words.extend(positions.as_flattened().iter().map(narrowed)),
    }
}

/// A point of a body: the first corner of its first primitive. The tree over bodies is built from these points.
fn sample(scene: &Scene, frame: &Frame, layer: LayerIx) -> [f32; 3] {
    let body = frame.body(scene, layer);
    let vertex = body.elements().corners(0)[0];
    body.positions().point(vertex as usize).map(|x| x as f32)
}
