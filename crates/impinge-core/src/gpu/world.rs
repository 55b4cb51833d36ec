//! The parts of bodies on the device: a trees of clusters, and positions. One world for frames and
//! for steps.
//!
//! ```text
//! parts       edges of all bodies | vertices | faces | elements as given that are none of these
//! positions   all bodies at the start | all bodies at the end      no end if no step was asked for
//! nodes       boxes at the start      | boxes at the end
//! ```
//!
//! A frame and a step see the same world, each by its own [`View`]: which parts take part, their
//! records, the tree over them. The parts of both are sent together if the bodies are the same, so
//! detection and steps of a body have its faces and its positions once. Parts of one body share its
//! positions, so equal vertex numbers mean the same vertex.
//!
//! All trees lie in one array of nodes, ordered by height over all parts, so that one launch refits
//! one height of every tree. Above three or more parts of a view there is a tree over them, whose
//! leaves are gates, the entrances to the parts:
//!
//! ```text
//! height h+2                    top
//! height h+1          node  …         node          tree over parts
//! height h        gate 0 … gate k  gate … gate      one per part: filters are checked here
//! …                  |       |
//! height 1         root    root …                   trees of parts, of unequal heights
//! height 0        clusters of part 0 | of part 1 | …
//! ```
//!
//! Parts are sent once; each frame sends the positions that have changed. What the queue is given
//! to write runs before all commands of the next submission. So where commands that may not have
//! run yet write positions of a body, the scene's positions go there by a command too, and later
//! questions do not take them for what the device holds: see `uploads`.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::bvh::clusters::Clustering;
use crate::bvh::tree::TreeShape;
use crate::plan::{Plan, QueryPart};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{Number, PartIx};
use crate::search::runner::Job;
use crate::search::stats::Stats;
use crate::workers::Workers;

use super::buffers::{Storage, count};
use super::layout::{
    BODY_SHIFT, Body, Cluster, ClusterVertex, Coordinate, Corners, NO_ROOT, Node, Order,
};
use super::open::GpuContext;
use super::pieces::{Chunk, Loaded};
use super::top_level::Trees;
use super::topology::{DeviceClusters, Most, Weight};
use super::uploads::{Encoded, LastWrite, Resident, VERTEX, fill, positions, stamp};
use super::view::{Motion, SLACK, View};

/// Bit 31 of a slot is a flag.
pub const MOST_ELEMENTS: u64 = 1 << 31;
/// A part of a body on the device.
#[derive(Debug, Clone)]
pub(super) struct HeldPart {
    pub id: BodyId,
    pub clustering: Arc<Clustering>,
}

/// Positions that are on the device already.
#[derive(Debug, Default)]
pub struct ResidentEnds<'a> {
    /// By body: at the start, and at the end.
    pub buffers: [BTreeMap<BodyId, &'a wgpu::Buffer>; 2],
    /// Whether the question is encoded for the caller, so that
    /// `DeviceWorld::encode_positions` follows.
    pub is_encoded: bool,
}

/// The data on parts that the kernels read.
#[derive(Debug)]
pub struct DeviceWorld {
    bodies: Vec<Resident>,
    pub(super) parts: Vec<HeldPart>,
    /// The vertices of all bodies.
    n_vertices: u64,
    n_ends: u64,
    encoded: Encoded,
    /// By how much boxes are widened, the bits of an f32.
    reach: u32,
    /// The nodes on the device, without their boxes.
    pub(super) trees: Trees,
    pub(super) views: [Option<View>; 2],
    /// Whether some part has tetrahedra.
    pub has_solids: bool,
    /// The nodes of all trees, boxes included.
    pub nodes: Storage<Node>,
    /// The clusters of all parts.
    pub clusters: Storage<Cluster>,
    /// The vertices of each cluster, each once.
    pub cluster_vertices: Storage<ClusterVertex>,
    /// The corners of the element at each slot.
    pub corners: Storage<Corners>,
    /// The number of the element at each slot.
    pub order: Storage<Order>,
    /// The coordinates of all bodies, of each end in turn.
    pub positions: Storage<Coordinate>,
}

/// The size of the query_parts of a frame on the device; `None` if 32 bits do not number its
/// vertices, elements or bodies.
pub(crate) fn weigh(
    job: Job<'_>,
    motion: Motion,
    clusterings: &[Arc<Clustering>],
) -> Option<Weight> {
    let query_parts = job.plan.parts.iter().map(|query_part| query_part.id);
    weigh_parts(job.scene, motion, query_parts.zip(clusterings))
}

fn weigh_parts<'a>(
    scene: &Scene,
    motion: Motion,
    parts: impl Iterator<Item = (BodyId, &'a Arc<Clustering>)>,
) -> Option<Weight> {
    let mut weight = Weight::default();
    let mut ids = Vec::new();
    for (id, clustering) in parts {
        ids.push(id);
        weight.n_elements += count(clustering.order.len());
        weight.n_cluster_vertices += count(clustering.vertices.len());
        weight.n_clusters += count(clustering.n_clusters());
        let shape = &clustering.shape;
        let nodes = (0..shape.n_levels()).map(|level| count(shape.n_nodes(level)));
        weight.n_nodes += nodes.sum::<u64>();
        weight.n_bodies += 1;
    }
    if weight.n_bodies > 2 || motion == Motion::Moving {
        // Gates and the tree over them.
        weight.n_nodes += 2 * weight.n_bodies;
    }
    weight.n_nodes *= motion.n_ends();
    ids.sort_unstable();
    ids.dedup();
    let vertices = ids.iter().map(|id| scene.body_in(id.slot()).n_vertices());
    weight.n_vertices = motion.n_ends() * vertices.map(count).sum::<u64>();
    let is_numbered = 3 * weight.n_vertices <= u64::from(u32::MAX)
        && weight.n_elements < MOST_ELEMENTS
        && count(ids.len()) < 1 << (32 - BODY_SHIFT);
    is_numbered.then_some(weight)
}

impl DeviceWorld {
    pub(crate) fn new() -> Self {
        DeviceWorld {
            bodies: Vec::new(),
            parts: Vec::new(),
            n_vertices: 0,
            n_ends: 1,
            encoded: Encoded::default(),
            reach: 0,
            trees: Trees::default(),
            views: [None, None],
            has_solids: false,
            nodes: Storage::plain("nodes"),
            clusters: Storage::plain("clusters"),
            cluster_vertices: Storage::plain("cluster vertices"),
            corners: Storage::plain("corners"),
            order: Storage::plain("order"),
            positions: Storage::plain("positions"),
        }
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        let views = self.views.iter().flatten().map(View::bytes);
        self.nodes.bytes()
            + self.clusters.bytes()
            + self.cluster_vertices.bytes()
            + self.corners.bytes()
            + self.order.bytes()
            + self.positions.bytes()
            + views.sum::<u64>()
    }

    /// What a frame, or a step, sees.
    ///
    /// # Panics
    /// If there was none.
    pub fn view(&self, motion: Motion) -> &View {
        self.views[motion as usize].as_ref().expect("sent before")
    }

    fn view_mut(&mut self, motion: Motion) -> &mut View {
        self.views[motion as usize].as_mut().expect("sent before")
    }

    /// Frees all buffers.
    pub fn forget(&mut self) {
        *self = DeviceWorld::new();
    }

    /// Says that the boxes that a view sees fit the positions, unless commands of the caller's may
    /// still change them.
    pub fn is_refitted(&mut self, motion: Motion) {
        self.view_mut(motion).is_moved = self.encoded.oldest().is_some();
    }

    /// Says that the boxes do not fit the positions.
    pub(super) fn is_moved(&mut self) {
        for view in self.views.iter_mut().flatten() {
            view.is_moved = true;
        }
    }

    /// Says by how much boxes are to be widened, the bits of an f32. Views share nodes, so those
    /// that another question has widened otherwise fit none of them.
    pub(super) fn widen(&mut self, reach: u32) {
        if self.reach != reach {
            self.is_moved();
            self.reach = reach;
        }
    }

    /// How many parts are on the device.
    pub fn n_parts(&self) -> u64 {
        count(self.parts.len())
    }

    /// Sends what has changed since the last frame, or step, which must have a [weight](weigh);
    /// positions of `resident` bodies are on the device already. What was held for the other kind
    /// of question stays if `most` allows.
    ///
    /// # Errors
    /// More than the device can bind at once.
    pub(crate) fn update(
        &mut self,
        gpu: &GpuContext,
        job: Job<'_>,
        (motion, clusterings): (Motion, &[Arc<Clustering>]),
        (resident, most): (&ResidentEnds<'_>, Most),
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Job {
            scene,
            plan,
            workers,
            ..
        } = job;
        if !self.is_seen(job, (motion, clusterings)) {
            let query_parts = plan.parts.iter().zip(clusterings);
            let wanted = query_parts.map(|(query_part, clustering)| HeldPart {
                id: query_part.id,
                clustering: Arc::clone(clustering),
            });
            self.send_parts(gpu, scene, (motion, wanted.collect()), most)?;
        }
        self.send_positions(gpu, (scene, workers), motion, resident);
        self.send_records(gpu, job, motion, resident)?;
        let clusters = clusterings.iter().map(|held| held.n_clusters());
        stats.n_clusters = clusters.map(count).sum();
        Ok(())
    }

    /// Whether a view sees the parts of a frame, or a step, with these clusterings, in their order.
    pub(crate) fn is_seen(
        &self,
        job: Job<'_>,
        (motion, clusterings): (Motion, &[Arc<Clustering>]),
    ) -> bool {
        let query_parts = job.plan.parts.iter().zip(clusterings);
        self.views[motion as usize].as_ref().is_some_and(|view| {
            let parts = view.parts.iter().map(|&part| &self.parts[part as usize]);
            let is_it = |(part, (query_part, clustering)): (&HeldPart, (&QueryPart, _))| {
                part.id == query_part.id && Arc::ptr_eq(&part.clustering, clustering)
            };
            view.parts.len() == clusterings.len() && parts.zip(query_parts).all(is_it)
        })
    }

    /// The parts of the other kind of question, if they are of the same bodies.
    fn of_other(
        &self,
        scene: &Scene,
        motion: Motion,
        wanted: &[HeldPart],
    ) -> Option<Vec<HeldPart>> {
        let view = self.views[motion.other() as usize].as_ref()?;
        let same = |(body, id): (&Resident, BodyId)| {
            let stamp = body.topology_stamp;
            body.id == id && scene.body_in(id.slot()).topology_stamp() == stamp
        };
        let ids = ids(wanted);
        let is_same = ids.len() == self.bodies.len() && self.bodies.iter().zip(ids).all(same);
        let parts = view.parts.iter();
        is_same.then(|| {
            parts
                .map(|&part| self.parts[part as usize].clone())
                .collect()
        })
    }

    /// Sends parts for a kind of question, and with them those for the other kind if they are of
    /// the same bodies and fit.
    fn send_parts(
        &mut self,
        gpu: &GpuContext,
        scene: &Scene,
        (motion, wanted): (Motion, Vec<HeldPart>),
        most: Most,
    ) -> Result<(), Error> {
        let other = self.of_other(scene, motion, &wanted);
        let both = other.map(|other| match motion {
            Motion::Still => [wanted.clone(), other],
            Motion::Moving => [other, wanted.clone()],
        });
        let fits = |both: &[Vec<HeldPart>; 2]| {
            let parts = union(both);
            let parts = parts.iter().map(|part| (part.id, &part.clustering));
            weigh_parts(scene, Motion::Moving, parts).is_some_and(|weight| weight.fits(most))
        };
        let seen = match both.filter(fits) {
            Some(both) => both.map(Some),
            None => match motion {
                Motion::Still => [Some(wanted), None],
                Motion::Moving => [None, Some(wanted)],
            },
        };
        // New buffers: commands that were encoded for the caller may still read the old ones.
        self.forget();
        self.n_ends = match &seen {
            [_, Some(_)] => 2,
            [_, None] => 1,
        };
        let parts = union(&seen.each_ref().map(|seen| seen.clone().unwrap_or_default()));
        let (mut bodies, mut n_vertices) = (Vec::new(), 0);
        for id in ids(&parts) {
            let body = scene.body_in(id.slot());
            bodies.push(Resident {
                id,
                topology_stamp: body.topology_stamp(),
                first_vertex: n_vertices,
                n_vertices: count(body.n_vertices()),
                written: [LastWrite::default(); 2],
            });
            n_vertices += count(body.n_vertices());
        }
        self.bodies = bodies;
        self.n_vertices = n_vertices;
        let mut topology = DeviceClusters::default();
        for (ix, part) in (0u32..).zip(&parts) {
            let body = self.number(part.id).expect("its body was listed");
            // Vertices fit 32 bits, or the frame would weigh nothing.
            let first = self.bodies[body].first_vertex as u32;
            let clusters = 0..part.clustering.n_clusters();
            // Numbers within the part: its record has the first one.
            topology.push(&part.clustering, clusters, Number::new(0), ix, |vertex| {
                first + vertex
            });
        }
        let shapes: Vec<&TreeShape> = parts.iter().map(|part| &part.clustering.shape).collect();
        self.trees = Trees::of_trees(&shapes);
        let sample = |part: u32| sample(scene, parts[part as usize].id);
        let numbers: BTreeMap<_, u32> = parts.iter().map(key).zip(0..).collect();
        let mut views = [None, None];
        for (view, seen) in views.iter_mut().zip(&seen) {
            let Some(seen) = seen else { continue };
            let seen = seen.iter().map(|part| numbers[&key(part)]).collect();
            *view = Some(View::new(gpu, &mut self.trees, seen, parts.len(), sample)?);
        }
        self.send_trees(gpu, &topology)?;
        self.positions.resize(gpu, 3 * self.n_ends * n_vertices)?;
        self.parts = parts;
        // If an upload has failed, half a world does not look complete.
        self.views = views;
        Ok(())
    }

    fn send_trees(&mut self, gpu: &GpuContext, topology: &DeviceClusters) -> Result<(), Error> {
        self.has_solids = topology.has_solids;
        self.clusters.upload(gpu, &topology.clusters)?;
        self.cluster_vertices
            .upload(gpu, &topology.cluster_vertices)?;
        self.corners.upload(gpu, &topology.corners)?;
        self.order.upload(gpu, &topology.numbers)?;
        let nodes = &self.trees.nodes;
        match self.n_ends {
            1 => self.nodes.upload(gpu, nodes),
            _ => self.nodes.upload(gpu, &[&nodes[..], &nodes[..]].concat()),
        }
    }

    /// Sends a piece of the frame instead of all of it.
    ///
    /// # Errors
    /// The piece is larger than the device can bind at once.
    pub(crate) fn send_piece<'a>(
        &mut self,
        gpu: &GpuContext,
        scene: &Scene,
        plan: &Plan,
        chunks: &[&Chunk],
        clustering: impl Fn(PartIx) -> &'a Clustering,
    ) -> Result<(), Error> {
        (self.parts, self.bodies, self.n_ends) = (Vec::new(), Vec::new(), 1);
        let view = self.views[Motion::Still as usize].take();
        self.views[Motion::Moving as usize] = None;
        let loaded = Loaded::new(scene, plan, chunks, clustering);
        self.trees = Trees::of_trees(&Vec::from_iter(&loaded.shapes));
        self.send_trees(gpu, &loaded.topology)?;
        let words: &[Coordinate] = bytemuck::cast_slice(&loaded.words);
        self.positions.upload(gpu, words)?;
        let mut view = view.unwrap_or_default();
        view.top = None;
        view.parts.clear();
        view.levels = self.trees.levels(None);
        view.table.upload(gpu, &view.levels)?;
        let records = loaded.is_rounded.iter().map(|&is_rounded| Body {
            root: NO_ROOT,
            slack: if is_rounded { SLACK } else { 0 },
            ..Body::default()
        });
        view.send(gpu, records.collect(), Vec::new())?;
        view.is_moved = true;
        self.views[Motion::Still as usize] = Some(view);
        Ok(())
    }

    /// The number of a body whose positions are on the device.
    pub(super) fn number(&self, id: BodyId) -> Option<usize> {
        self.bodies.binary_search_by_key(&id, |body| body.id).ok()
    }

    /// Sends the positions of bodies that have moved, at one end or at both; runs of consecutive
    /// bodies in one write, which all threads fill. Those that have to be encoded are left to
    /// [`encode_positions`](DeviceWorld::encode_positions).
    fn send_positions(
        &mut self,
        gpu: &GpuContext,
        (scene, workers): (&Scene, &Workers),
        motion: Motion,
        resident: &ResidentEnds<'_>,
    ) {
        let oldest = self.encoded.oldest();
        let mut has_moved = false;
        for (end, buffers) in (0..motion.n_ends()).zip(&resident.buffers) {
            let is_new = |body: &Resident| {
                let written = body.written[end as usize];
                let is_held =
                    written.encoding.is_none() && written.stamp == stamp(scene, body, end);
                let is_encoded = buffers.contains_key(&body.id)
                    || (resident.is_encoded && written.may_be_overwritten(oldest));
                !is_held && !is_encoded
            };
            for run in self.bodies.chunk_by_mut(|a, b| is_new(a) == is_new(b)) {
                if !is_new(&run[0]) {
                    continue;
                }
                has_moved = true;
                let at = end * self.n_vertices + run[0].first_vertex;
                let len = run[run.len() - 1].vertices().end - run[0].first_vertex;
                self.positions.write_with(gpu, (3 * at, 3 * len), |to| {
                    fill(to, run, |body| positions(scene, body, end), workers)
                });
                for body in run {
                    let stamp = stamp(scene, body, end);
                    body.written[end as usize].by_queue(stamp, oldest);
                }
            }
        }
        if has_moved {
            self.is_moved();
        }
    }

    /// Begins an encoding for the caller: encodes the copies of positions from buffers on the
    /// device, of the bodies that take part, and of the scene's positions where commands that may
    /// not have run yet write others.
    pub(crate) fn encode_positions(
        &mut self,
        gpu: &GpuContext,
        (scene, workers): (&Scene, &Workers),
        motion: Motion,
        resident: &ResidentEnds<'_>,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let number = self.encoded.begin(encoder);
        let mut has_moved = false;
        for (end, buffers) in (0..self.n_ends).zip(&resident.buffers) {
            for (&id, buffer) in buffers {
                let Some(ix) = self.number(id) else { continue };
                let body = &mut self.bodies[ix];
                body.written[end as usize].by_encoding(0, number);
                has_moved = true;
                let to = VERTEX * (end * self.n_vertices + body.first_vertex);
                let size = VERTEX * body.n_vertices;
                if size > 0 {
                    encoder.copy_buffer_to_buffer(buffer, 0, self.positions.buffer(), to, size);
                }
            }
        }
        for (end, buffers) in (0..motion.n_ends()).zip(&resident.buffers) {
            for body in &mut self.bodies {
                let written = body.written[end as usize];
                let Some(last) = written.encoding else {
                    continue;
                };
                if buffers.contains_key(&body.id) {
                    continue;
                }
                has_moved = true;
                let stamp = stamp(scene, body, end);
                // Unless the commands that write the same have been dropped.
                if written.is_encoded && written.stamp == stamp && self.encoded.may_run(last) {
                    continue;
                }
                let at = end * self.n_vertices + body.first_vertex;
                let len = body.n_vertices;
                let run = std::slice::from_ref(body);
                self.positions
                    .encode_with(gpu, (3 * at, 3 * len), encoder, |to| {
                        fill(to, run, |body| positions(scene, body, end), workers)
                    });
                body.written[end as usize].by_encoding(stamp, number);
            }
        }
        if has_moved {
            self.is_moved();
        }
    }

    /// Bodies whose positions are on the device, in their order, and how many vertices each has.
    pub fn bodies(&self) -> impl Iterator<Item = (BodyId, u64)> {
        self.bodies.iter().map(|body| (body.id, body.n_vertices))
    }

    /// Where the positions of a body are on the device, if they are those of the pose with this
    /// stamp: the buffer and the first byte.
    pub fn positions_of(&self, body: BodyId, stamp: u64) -> Option<(&wgpu::Buffer, u64)> {
        let held = &self.bodies[self.number(body)?];
        let is_there = held.written[0].stamp == stamp;
        is_there.then(|| (self.positions.buffer(), held.first_vertex * VERTEX))
    }
}

/// The parts of a step, then those of a frame that are none of them.
fn union([still, moving]: &[Vec<HeldPart>; 2]) -> Vec<HeldPart> {
    let mut parts = moving.clone();
    if parts.is_empty() {
        return still.clone();
    }
    let mut known: Vec<(BodyId, *const Clustering)> = parts.iter().map(key).collect();
    known.sort_unstable();
    let is_new = |part: &&HeldPart| known.binary_search(&key(part)).is_err();
    parts.extend(still.iter().filter(is_new).cloned());
    parts
}

/// The ids of the bodies of parts, each once, in their order.
fn ids(parts: &[HeldPart]) -> Vec<BodyId> {
    let mut ids: Vec<BodyId> = parts.iter().map(|part| part.id).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

fn key(part: &HeldPart) -> (BodyId, *const Clustering) {
    (part.id, Arc::as_ptr(&part.clustering))
}

/// A point of a body: the first corner of its first element. The tree over parts is built from
/// these points.
pub(super) fn sample(scene: &Scene, id: BodyId) -> [f32; 3] {
    let body = scene.body_in(id.slot());
    let vertex = body.elements().corners(0)[0];
    body.positions().point(vertex as usize).map(|x| x as f32)
}
