//! The participants on the device: a forest of clusters, and positions.
//!
//! All trees lie in one array of nodes, ordered by height over all bodies, so that one launch refits a
//! height of every tree. Three or more bodies stand below a tree of their own; the doors to them
//! are gates:
//!
//! ```text
//! height h+2                    top
//! height h+1          node  …         node          tree over bodies
//! height h        gate 0 … gate k  gate … gate      one a body: filters are checked here
//! …                  |       |
//! height 1         root    root …                   bodies' trees, of unequal heights
//! height 0        clusters of body 0 | of body 1 | …
//! ```
//!
//! Topology is sent once; each frame sends the positions that have moved.

use std::sync::Arc;

use crate::error::Error;
use crate::frame::Frame;
use crate::grouping::GROUP;
use crate::grouping::bounds::{Bounds, round_down, round_up};
use crate::grouping::clusters::Clustering;
use crate::grouping::hierarchy::{Entry, Shape, order};
use crate::scene::{BodyId, Elements, Filter, Positions, Scene};
use crate::stats::Statistics;

use super::buffers::{Storage, count};
use super::device::Gpu;
use super::layout::{
    Body, Cluster, ClusterVertex, Coordinate, Corners, Level, NO_ROOT, Node, NodePair, Order,
};

/// Places carry a flag in bit 31.
const MOST_PRIMITIVES: u64 = 1 << 31;
/// How many keys the boxes of rounded positions are widened: see `boxes.wgsl`.
const SLACK: u32 = 2;
/// Bodies, empty ones included, that need no tree over bodies if at most two are filled.
const FEW_BODIES: usize = 1024;
/// How far bodies may part from their neighbours in the tree over bodies before it is made anew, and
/// how much the clusters' surface may grow against the body's before it is clustered again.
const STALE: f64 = 1.5;
/// Clusters that are looked at to judge how well a body's clusters fit its pose.
const SAMPLES: usize = 64;

/// The clusters of a body, kept while its topology stays and they fit its pose.
#[derive(Debug)]
struct Cached {
    topology_stamp: u64,
    /// No two clusterings of a detector have the same.
    number: u64,
    /// The positions that were judged last.
    judged_stamp: u64,
    /// Surface of the sampled clusters over that of all of them together, at its best so far.
    best_spread: f64,
    clustering: Arc<Clustering>,
}

/// One participant on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Resident {
    id: BodyId,
    /// The clustering that was sent.
    number: u64,
    positions_stamp: u64,
    /// Index of its first vertex in the positions.
    first_vertex: u64,
    n_vertices: u64,
}

/// Everything about the participants that the kernels read.
#[derive(Debug)]
pub struct World {
    caches: Vec<Option<Box<Cached>>>,
    n_clusterings: u64,
    residents: Vec<Resident>,
    /// What the device has of the nodes, without the boxes.
    forest: Forest,
    bodies_sent: Vec<Body>,
    ignored_sent: Vec<NodePair>,
    words: Vec<u32>,
    /// Boxes have to be refitted.
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
    pub fn new() -> Self {
        World {
            caches: Vec::new(),
            n_clusterings: 0,
            residents: Vec::new(),
            forest: Forest::default(),
            bodies_sent: Vec::new(),
            ignored_sent: Vec::new(),
            words: Vec::new(),
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

    /// Brings the device up to the frame; positions of `resident` bodies are there already. Returns
    /// whether kernels have to be bound anew.
    ///
    /// # Errors
    /// More primitives than the device can bind at once.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        frame: &Frame,
        resident: &[BodyId],
        recluster: bool,
        stats: &mut Statistics,
    ) -> Result<bool, Error> {
        if frame.n_primitives() > MOST_PRIMITIVES {
            return Err(Error::TooMany {
                what: "primitives in one query on a GPU",
                given: frame.n_primitives(),
                limit: MOST_PRIMITIVES,
            });
        }
        self.cluster(scene, frame, resident, recluster, stats);
        let mut is_other = false;
        if !self.is_resident(frame) {
            // Half a topology must not pass for a whole one if an upload fails.
            self.residents.clear();
            self.send_topology(gpu, scene, frame)?;
            is_other = true;
        }
        self.send_positions(gpu, scene, frame, resident);
        is_other |= self.send_bodies(gpu, scene, frame, resident)?;
        stats.n_clusters = self.forest.n_clusters();
        Ok(is_other)
    }

    /// Clusters bodies that are new or were re-meshed, and those that have flowed away from their clusters; forgets those that are
    /// gone. Of `resident` bodies the host does not know the pose, so they are not judged.
    fn cluster(
        &mut self,
        scene: &Scene,
        frame: &Frame,
        resident: &[BodyId],
        recluster: bool,
        stats: &mut Statistics,
    ) {
        let n_slots = frame
            .participants
            .last()
            .map_or(0, |last| last.id.index() + 1);
        if self.caches.len() < n_slots {
            self.caches.resize_with(n_slots, || None);
        }
        if self.caches.len() > scene.n_bodies() {
            for (slot, cache) in self.caches.iter_mut().enumerate() {
                if !scene.holds(slot) {
                    *cache = None;
                }
            }
        }
        for (ix, participant) in frame.participants.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = &mut self.caches[participant.id.index()];
            let known = cache
                .as_mut()
                .filter(|cache| cache.topology_stamp == body.topology_stamp());
            if let Some(cache) = known {
                let is_judged = !recluster
                    || cache.judged_stamp == body.positions_stamp()
                    || resident.contains(&participant.id);
                if is_judged || !cache.is_stale(body) {
                    continue;
                }
                stats.n_reclustered += 1;
            }
            stats.n_clustered += 1;
            self.n_clusterings += 1;
            *cache = Some(Box::new(Cached::new(body, self.n_clusterings)));
        }
    }

    fn is_resident(&self, frame: &Frame) -> bool {
        self.residents.len() == frame.participants.len()
            && self.residents.iter().enumerate().all(|(ix, resident)| {
                let cache = self.caches[resident.id.index()].as_ref();
                resident.id == frame.participants[ix].id
                    && cache.is_some_and(|cache| cache.number == resident.number)
            })
    }

    fn send_topology(&mut self, gpu: &Gpu, scene: &Scene, frame: &Frame) -> Result<(), Error> {
        let caches: Vec<(u64, Arc<Clustering>)> = frame
            .participants
            .iter()
            .map(|participant| {
                let cache = self.caches[participant.id.index()].as_ref();
                let cache = cache.expect("just clustered");
                (cache.number, Arc::clone(&cache.clustering))
            })
            .collect();
        let mut residents = Vec::with_capacity(caches.len());
        let mut clusters = Vec::new();
        let mut cluster_vertices = Vec::new();
        let mut corners = Vec::new();
        let mut numbers = Vec::new();
        let mut first_vertex = 0u64;
        self.has_solids = false;
        for (ix, (number, clustering)) in caches.iter().enumerate() {
            let body = frame.body(scene, ix);
            let participant = &frame.participants[ix];
            let n_vertices = count(body.n_vertices());
            let limit = u64::from(u32::MAX) / 3;
            if first_vertex + n_vertices > limit {
                return Err(Error::TooMany {
                    what: "vertices in one query on a GPU",
                    given: first_vertex + n_vertices,
                    limit,
                });
            }
            // Vertices fit 32 bits, as was just checked.
            let first = first_vertex as u32;
            for cluster in 0..clustering.n_clusters() {
                let vertices = clustering.vertices(cluster);
                clusters.push(Cluster {
                    first_place: participant.first + (cluster * GROUP) as u32,
                    first_vertex: cluster_vertices.len() as u32,
                    sizes: clustering.size(cluster) as u32 | (vertices.len() as u32) << 16,
                    body: ix as u32,
                });
                cluster_vertices.extend(vertices.iter().map(|&vertex| ClusterVertex {
                    vertex: first + vertex,
                }));
            }
            match &clustering.corners {
                Elements::Triangles(faces) => {
                    corners.extend(faces.iter().map(|&[a, b, c]| Corners {
                        vertices: [a, b, c, c].map(|corner| first + corner),
                    }));
                }
                Elements::Tetrahedra(tets) => {
                    self.has_solids |= !tets.is_empty();
                    corners.extend(tets.iter().map(|tet| Corners {
                        vertices: tet.map(|corner| first + corner),
                    }));
                }
            }
            numbers.extend(clustering.order.iter().map(|&primitive| Order {
                number: participant.first + primitive,
            }));
            residents.push(Resident {
                id: participant.id,
                number: *number,
                positions_stamp: 0,
                first_vertex,
                n_vertices,
            });
            first_vertex += n_vertices;
        }
        let shapes: Vec<&Shape> = caches
            .iter()
            .map(|(_, clustering)| &clustering.shape)
            .collect();
        self.forest = Forest::new(&shapes, |ix| sample(scene, frame, ix));
        self.clusters.upload(gpu, &clusters)?;
        self.cluster_vertices.upload(gpu, &cluster_vertices)?;
        self.corners.upload(gpu, &corners)?;
        self.order.upload(gpu, &numbers)?;
        self.nodes.upload(gpu, &self.forest.nodes)?;
        self.levels.upload(gpu, &self.forest.levels)?;
        self.positions.resize(gpu, 3 * first_vertex)?;
        self.bodies_sent.clear();
        self.residents = residents;
        Ok(())
    }

    /// Sends the positions of bodies that have moved, neighbours in one piece.
    fn send_positions(&mut self, gpu: &Gpu, scene: &Scene, frame: &Frame, resident: &[BodyId]) {
        let mut ix = 0;
        while ix < self.residents.len() {
            let from = ix;
            let start = self.residents[from].first_vertex;
            while ix < self.residents.len() {
                let stamp = frame.body(scene, ix).positions_stamp();
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
                frame.body(scene, from).positions(),
            ) {
                let words: &[Coordinate] = bytemuck::cast_slice(positions);
                self.positions.write(gpu, 3 * only.first_vertex, words);
                continue;
            }
            self.words.clear();
            for participant in from..ix {
                match frame.body(scene, participant).positions() {
                    Positions::F32(positions) => {
                        let words: &[u32] = bytemuck::cast_slice(positions);
                        self.words.extend_from_slice(words);
                    }
                    Positions::F64(positions) => {
                        // Rounded to nearest; boxes and filter allow for it, see `Body::slack`.
                        let words = positions
                            .as_flattened()
                            .iter()
                            .map(|&x| (x as f32).to_bits());
                        self.words.extend(words);
                    }
                }
            }
            let words: &[Coordinate] = bytemuck::cast_slice(&self.words);
            self.positions.write(gpu, 3 * start, words);
        }
    }

    /// Sends what is said of each body in this frame, if it differs from what the device has.
    fn send_bodies(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        frame: &Frame,
        resident: &[BodyId],
    ) -> Result<bool, Error> {
        if self.forest.reorder(|ix| sample(scene, frame, ix)) {
            self.nodes
                .write(gpu, u64::from(self.forest.first_gate), self.forest.gates());
            self.is_moved = true;
        }
        let words = |bits: u64| [bits as u32, (bits >> 32) as u32];
        let mut bodies = Vec::with_capacity(frame.participants.len());
        for (ix, participant) in frame.participants.iter().enumerate() {
            // Bodies without a category meet nobody.
            let filter = match frame.between() {
                true => frame.filter(ix),
                false => Filter {
                    category: 0,
                    mask: 0,
                },
            };
            let rounded = match frame.body(scene, ix).positions() {
                Positions::F32(_) => false,
                Positions::F64(_) => !resident.contains(&participant.id),
            };
            bodies.push(Body {
                root: self.forest.roots[ix],
                slack: if rounded { SLACK } else { 0 },
                within: u32::from(participant.within),
                unused: 0,
                category: words(filter.category),
                mask: words(filter.mask),
            });
        }
        let mut is_other = false;
        if bodies != self.bodies_sent {
            is_other |= self.bodies.upload(gpu, &bodies)?;
            self.bodies_sent = bodies;
        }
        let ignored: Vec<NodePair> = frame
            .ignored_pairs()
            .map(|(a, b)| NodePair {
                a: a as u32,
                b: b as u32,
            })
            .collect();
        if ignored != self.ignored_sent || self.ignored.bytes() == 0 {
            is_other |= self.ignored.upload(gpu, &ignored)?;
            self.ignored_sent = ignored;
        }
        Ok(is_other)
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
        // The scene's positions are no longer what the device has.
        held.positions_stamp = 0;
        self.is_moved = true;
        let vertex = 3 * size_of::<Coordinate>() as u64;
        let (to, size) = (held.first_vertex * vertex, held.n_vertices * vertex);
        encoder.copy_buffer_to_buffer(buffer, 0, self.positions.buffer(), to, size);
    }

    /// Entries of the list of ignored pairs.
    pub fn n_ignored(&self) -> u32 {
        self.ignored_sent.len() as u32
    }

    /// What a traversal starts from: pairs of nodes, whose boxes need not overlap.
    pub fn seeds(&self, frame: &Frame) -> Vec<NodePair> {
        let forest = &self.forest;
        let root = |ix: usize| forest.roots[ix];
        let mut seeds = Vec::new();
        if let Some(top) = forest.top()
            && frame.between()
        {
            return vec![NodePair { a: top, b: top }];
        }
        if frame.between() {
            let filled: Vec<usize> = (0..frame.participants.len())
                .filter(|&ix| forest.is_filled(ix))
                .collect();
            if let [a, b] = filled[..]
                && frame.meets(a, b)
            {
                seeds.push(NodePair {
                    a: root(a),
                    b: root(b),
                });
            }
        }
        for (ix, participant) in frame.participants.iter().enumerate() {
            if participant.within && forest.is_filled(ix) {
                seeds.push(NodePair {
                    a: root(ix),
                    b: root(ix),
                });
            }
        }
        seeds
    }

    /// The pairs of children of two nodes, whether their boxes overlap or not; `None` for two
    /// clusters. The same steps as `dispatch.wgsl`.
    pub fn expand(&self, frame: &Frame, pair: NodePair, into: &mut Vec<NodePair>) -> bool {
        let nodes = &self.forest.nodes;
        let (a, b) = (&nodes[pair.a as usize], &nodes[pair.b as usize]);
        if a.height() == 0 && b.height() == 0 {
            return false;
        }
        if a.is_gate() && b.is_gate() {
            let (body_a, body_b) = (a.first_child as usize, b.first_child as usize);
            let meets = if body_a == body_b {
                frame.participants[body_a].within
            } else {
                frame.meets(body_a, body_b)
            };
            if meets {
                into.push(NodePair {
                    a: self.forest.roots[body_a],
                    b: self.forest.roots[body_b],
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

/// A point of a body: its first vertex that a primitive names. The tree over bodies is made of these.
fn sample(scene: &Scene, frame: &Frame, ix: usize) -> [f32; 3] {
    let body = frame.body(scene, ix);
    let vertex = body.elements().corners(0)[0];
    body.positions().point(vertex as usize).map(|x| x as f32)
}

impl Cached {
    fn new(body: &crate::scene::Body, number: u64) -> Self {
        let (elements, positions) = (body.elements(), body.positions());
        let clustering = Clustering::new(elements, |primitive| {
            bounds_of(positions, elements.corners(primitive))
        });
        Cached {
            topology_stamp: body.topology_stamp(),
            number,
            judged_stamp: body.positions_stamp(),
            best_spread: spread(&clustering, positions),
            clustering: Arc::new(clustering),
        }
    }

    /// Whether the body has flowed away from its clusters.
    fn is_stale(&mut self, body: &crate::scene::Body) -> bool {
        self.judged_stamp = body.positions_stamp();
        let spread = spread(&self.clustering, body.positions());
        let is_stale = spread > STALE * self.best_spread;
        self.best_spread = self.best_spread.min(spread);
        is_stale
    }
}

/// The surface of evenly spaced clusters over that of the box that holds them: how well the clusters fit
/// the pose at hand. Both ends of the ratio come from the same clusters, in every frame.
fn spread(clustering: &Clustering, positions: &Positions) -> f64 {
    let n = clustering.n_clusters();
    let n_samples = n.min(SAMPLES);
    let mut whole = Bounds::EMPTY;
    let mut sum = 0.0;
    for sample in 0..n_samples {
        let bounds = bounds_of(positions, clustering.vertices(sample * n / n_samples));
        sum += bounds.half_area();
        whole.join(&bounds);
    }
    let whole = whole.half_area();
    if whole > 0.0 && sum.is_finite() {
        sum / whole
    } else {
        1.0
    }
}

fn bounds_of(positions: &Positions, corners: &[u32]) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for &corner in corners {
        let point = positions.point(corner as usize);
        bounds.join(&Bounds {
            min: point.map(round_down),
            max: point.map(round_up),
        });
    }
    bounds
}

/// All trees in one array.
#[derive(Debug, Default)]
pub struct Forest {
    pub nodes: Vec<Node>,
    pub levels: Vec<Level>,
    /// Root of each participant; meaningless for an empty one.
    roots: Vec<u32>,
    n_clusters: u64,
    first_gate: u32,
    n_gates: u32,
    has_top: bool,
    top_shape: Shape,
    best_spread: f64,
    entries: Vec<Entry>,
}

impl Forest {
    fn new(shapes: &[&Shape], sample: impl Fn(usize) -> [f32; 3]) -> Self {
        let mut forest = Forest {
            roots: vec![NO_ROOT; shapes.len()],
            ..Forest::default()
        };
        let n_heights = shapes.iter().map(|shape| shape.n_levels()).max();
        // First node of the body at the height below, and at this one.
        let mut below = vec![0u32; shapes.len()];
        for height in 0..n_heights.unwrap_or(0) {
            let first = forest.nodes.len() as u32;
            let mut next_cluster = 0u32;
            for (ix, shape) in shapes.iter().enumerate() {
                if height >= shape.n_levels() {
                    continue;
                }
                let first_here = forest.nodes.len() as u32;
                for node in 0..shape.n_nodes(height) {
                    forest.nodes.push(if height == 0 {
                        next_cluster += 1;
                        Node::new(next_cluster - 1, 0, 0, false)
                    } else {
                        let children = shape.children(height, node);
                        Node::new(
                            below[ix] + children.start as u32,
                            children.len() as u32,
                            height as u32,
                            false,
                        )
                    });
                }
                below[ix] = first_here;
                if height + 1 == shape.n_levels() {
                    forest.roots[ix] = first_here;
                }
            }
            forest.push_level(first);
        }
        forest.n_clusters = forest.levels.first().map_or(0, |level| level.count.into());
        let filled: Vec<u32> = (0..shapes.len() as u32)
            .filter(|&ix| forest.is_filled(ix as usize))
            .collect();
        // Without a tree kernels walk over all bodies, empty ones too.
        if filled.len() > 2 || (shapes.len() > FEW_BODIES && !filled.is_empty()) {
            forest.has_top = true;
            forest.push_top(&filled);
            forest.reorder(sample);
        }
        forest
    }

    fn push_level(&mut self, first: u32) {
        self.levels.push(Level {
            first,
            count: self.nodes.len() as u32 - first,
        });
    }

    /// Gates and the tree over them.
    fn push_top(&mut self, filled: &[u32]) {
        self.first_gate = self.nodes.len() as u32;
        self.n_gates = filled.len() as u32;
        let gate_height = self.levels.len() as u32;
        let gates = filled
            .iter()
            .map(|&body| Node::new(body, 1, gate_height, true));
        self.nodes.extend(gates);
        self.push_level(self.first_gate);
        self.top_shape = Shape::new(filled.len());
        let mut below = self.first_gate;
        for level in 1..self.top_shape.n_levels() {
            let first = self.nodes.len() as u32;
            for node in 0..self.top_shape.n_nodes(level) {
                let children = self.top_shape.children(level, node);
                self.nodes.push(Node::new(
                    below + children.start as u32,
                    children.len() as u32,
                    gate_height + level as u32,
                    false,
                ));
            }
            below = first;
            self.push_level(first);
        }
    }

    /// The root of the tree over bodies.
    pub fn top(&self) -> Option<u32> {
        self.has_top.then(|| self.nodes.len() as u32 - 1)
    }

    fn is_filled(&self, participant_ix: usize) -> bool {
        self.roots[participant_ix] != NO_ROOT
    }

    pub fn n_clusters(&self) -> u64 {
        self.n_clusters
    }

    fn gates(&self) -> &[Node] {
        let first = self.first_gate as usize;
        &self.nodes[first..first + self.n_gates as usize]
    }

    /// Puts the gates in a new order when bodies have parted from their neighbours. Returns whether.
    fn reorder(&mut self, sample: impl Fn(usize) -> [f32; 3]) -> bool {
        if !self.has_top {
            return false;
        }
        self.entries.clear();
        let first = self.first_gate as usize;
        for gate in first..first + self.n_gates as usize {
            let number = self.nodes[gate].first_child;
            self.entries.push(Entry {
                center: sample(number as usize),
                number,
            });
        }
        let spread = self.spread();
        let is_new = self.best_spread == 0.0;
        if !is_new && spread <= STALE * self.best_spread {
            self.best_spread = self.best_spread.min(spread);
            return false;
        }
        order(&self.top_shape, 1, 1, &mut self.entries);
        for (gate, entry) in self.entries.iter().enumerate() {
            self.nodes[first + gate].first_child = entry.number;
        }
        // Never 0, so that it is known to have been found.
        self.best_spread = self.spread().max(f64::MIN_POSITIVE);
        true
    }

    /// The summed surface of the boxes of neighbouring entries: how well the order fits.
    fn spread(&self) -> f64 {
        let boxes = self.entries.chunks(crate::grouping::hierarchy::FANOUT);
        boxes
            .map(|entries| {
                let mut bounds = Bounds::EMPTY;
                for entry in entries {
                    bounds.join(&Bounds {
                        min: entry.center,
                        max: entry.center,
                    });
                }
                bounds.half_area()
            })
            .filter(|area| area.is_finite())
            .sum()
    }

    /// Rounds that a traversal from these pairs takes.
    pub fn rounds(&self, seeds: &[NodePair]) -> u32 {
        seeds
            .iter()
            .flat_map(|pair| [pair.a, pair.b])
            .map(|node| self.nodes[node as usize].height())
            .max()
            .map_or(0, |height| height.max(1))
    }
}
