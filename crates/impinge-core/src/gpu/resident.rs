//! Frames and steps that stay on the device: positions come from the caller's buffers, pairs go to
//! ours.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::buffers::{Read, Slice, Uniform, Write, count, read};
use super::clusters::GROUP;
use super::engine::Engine;
use super::kernels::Truncate;
use super::layout::{Counter, N_PAIRS_LISTED, N_UNSURE_LISTED, Params, Share, TOUCHES_BY};
use super::pass_buffers::{NextPass, PassCounts};
use super::recording::{Launcher, Recording, Workgroups};
use super::view::Motion;
use super::world::ResidentEnds;
use crate::bvh::clusters::Clustering;
use crate::plan::Plan;
use crate::query::Query;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::{BodyId, new_stamp};
use crate::scene::positions::Positions;
use crate::scene::{Body, Scene};
use crate::search::runner::Job;
use crate::search::stats::Stats;

/// The buffers that hold the pairs of an encoded frame once its commands have run.
///
/// Both lists hold two `u32` per pair: the numbers of its elements, the lower one first.
/// Elements are numbered consecutively, body after body in the order of their ids. Which bodies
/// take part depends on the query, also on its scope: of
/// [`Query::between`](crate::Query::between) only two do, and the first of them is numbered from 0.
/// So the numbers of a body are those of its [part](ResidentPart) in [`parts`](Self::parts):
/// element `i` of the body has the number `first + i`. The order of pairs is not specified.
///
/// If a count is at most the capacity of its list, the list holds all pairs. If it is larger, pairs
/// are missing: the list had no room for all, or the device had none for an earlier stage, which
/// makes both counts larger. Which of its entries are pairs of this frame is then not specified.
/// [`Gpu::grow`](crate::Gpu::grow) makes room for the next frame.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct ResidentPairs {
    /// Pairs that certainly intersect.
    pub pairs: wgpu::Buffer,
    /// Pairs that may or may not intersect, within the rounding error of the device. To be
    /// conservative, count them as pairs.
    pub unsure: wgpu::Buffer,
    /// Holds the two counts as `u32`, each larger than its list if pairs are missing.
    pub counts: wgpu::Buffer,
    /// Byte offset of the number of pairs in `counts`.
    pub n_pairs_offset: u64,
    /// Byte offset of the number of unsure pairs in `counts`.
    pub n_unsure_offset: u64,
    /// The number of pairs that the list has room for.
    pub pairs_capacity: u64,
    /// The number of unsure pairs that the list has room for.
    pub unsure_capacity: u64,
    /// The numbers of the elements of each body that takes part, in their order.
    pub parts: Vec<ResidentPart>,
}

/// The buffers that hold the pairs of an encoded step which may touch, once its commands have run.
///
/// The list has two `u32` per pair: the numbers of its elements, the lower one first. Elements are
/// numbered consecutively: first the edges of all bodies, then their vertices, then their faces,
/// each in the order of the bodies' ids.
///
/// ```text
/// 0            first_vertex            first_face
/// +--------------+-----------------------+--------------+
/// |  all edges   |     all vertices      |  all faces   |
/// +--------------+-----------------------+--------------+
/// ```
///
/// So the two numbers `low < high` of a pair say its kind:
///
/// | kind | `low` | `high` |
/// |---|---|---|
/// | two edges | an edge | below `first_vertex` |
/// | an edge and a vertex | an edge | from `first_vertex` on |
/// | two vertices | a vertex | below `first_face` |
/// | a vertex and a face | a vertex | from `first_face` on |
///
/// Element `i` of a part of a body has the number `first + i` of its [part](ResidentPart). Vertices
/// are numbered as positions are, whether an element uses them or not; edges and faces as
/// [`Body::part`](crate::Body::part) lists them. The order of pairs is not specified.
///
/// If the count is at most the capacity of the list, the list holds all pairs that may touch. If it
/// is larger, pairs are missing: the list had no room for all, or the device had none for an
/// earlier stage. Which of its entries are pairs of this step is then not specified, and all first
/// times are 0, so that nothing moves. [`Gpu::grow`](crate::Gpu::grow) makes room for the next
/// step.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct ResidentStep {
    /// Pairs that may touch. If the list is complete, all others certainly do not.
    pub pairs: wgpu::Buffer,
    /// Holds two `f32` per pair of the list, in the same order, times of the step from 0 to 1.
    /// Until the first one the pair certainly does not touch: so up to the least of them nothing
    /// does. It is 0 for all if the list is incomplete. By the second one it certainly touches,
    /// after the start; 2 if that is not certain.
    pub times: wgpu::Buffer,
    /// Holds the count as a `u32`, larger than the list if pairs are missing, and a time as an
    /// `f32`.
    pub counts: wgpu::Buffer,
    /// Byte offset of the number of pairs in `counts`.
    pub n_pairs_offset: u64,
    /// Byte offset in `counts` of the least time by which some pair certainly touches; 2 if that is
    /// certain of none. The first contact of the step is earlier than this, even if the list is too
    /// small.
    pub touches_by_offset: u64,
    /// The number of pairs that the list has room for.
    pub pairs_capacity: u64,
    /// The number of the first vertex.
    pub first_vertex: u32,
    /// The number of the first face.
    pub first_face: u32,
    /// The numbers of each part of each body that takes part, in their order.
    pub parts: Vec<ResidentPart>,
}

/// The numbers of one part of one body in an encoded frame or step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct ResidentPart {
    /// The body.
    pub body: BodyId,
    /// In a frame [`Part::Given`], the elements of the body. In a step edges, vertices or faces;
    /// tetrahedra have those of their surface.
    pub part: Part,
    /// The number of its first element.
    pub first: u32,
    /// How many elements it has.
    pub len: u32,
}

/// The buffer that holds how far each vertex may move, once the commands of encoded safe distances
/// have run.
///
/// ```text
/// distances   vertices of the first body | of the second | …    unused
///             first                        first
/// ```
///
/// Those of bodies without elements come after all others.
///
/// Good for [`Gpu::encode_truncate`](crate::Gpu::encode_truncate) until the same detector encodes
/// safe distances again, into the same buffer, and for bodies of which topology is the same.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct ResidentSafe {
    /// Holds an `f32` per vertex, which is not below 0: it may move as far, on any path. The buffer
    /// may be longer than all vertices take.
    pub distances: wgpu::Buffer,
    /// Where the vertices of each body that takes part are, in the order of their ids.
    pub bodies: Vec<ResidentVertices>,
    /// What tells them from all others.
    stamp: u64,
}

/// Where the vertices of a body are in a buffer that has one number for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct ResidentVertices {
    /// The body.
    pub body: BodyId,
    /// The number of its first vertex.
    pub first: u32,
    /// How many vertices it has.
    pub len: u32,
    topology_stamp: u64,
}

const COUNTER: u64 = size_of::<Counter>() as u64;
const SHARE: u64 = size_of::<Share>() as u64;

impl Engine {
    /// Encodes all work of a frame as one pass.
    ///
    /// # Errors
    /// Those of [`Gpu::encode`](crate::Gpu::encode).
    pub fn encode(
        &mut self,
        job: Job<'_>,
        positions: &[(BodyId, &wgpu::Buffer)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentPairs, Error> {
        self.gpu.check_lost()?;
        let starts = checked(job.scene, positions, "positions")?;
        self.turn_to(Motion::Still);
        let ids: Vec<BodyId> = positions.iter().map(|&(body, _)| body).collect();
        let clusterings = self.cluster(job, &ids, &mut Stats::default())?;
        let resident = encoded([starts, BTreeMap::new()]);
        self.update(job, &clusterings, &resident, &mut Stats::default())?;
        self.encode_work(job, &resident, encoder)?;
        let pass_buffers = &self.lane.pass_buffers;
        let capacities = pass_buffers.capacities();
        Ok(ResidentPairs {
            pairs: pass_buffers.pairs.buffer().clone(),
            unsure: pass_buffers.unsure.buffer().clone(),
            counts: pass_buffers.counters.buffer().clone(),
            n_pairs_offset: u64::from(N_PAIRS_LISTED) * COUNTER,
            n_unsure_offset: u64::from(N_UNSURE_LISTED) * COUNTER,
            pairs_capacity: capacities.pairs,
            unsure_capacity: capacities.unsure,
            parts: parts(job.plan),
        })
    }

    /// Encodes all work of a step as one pass. `ends`: the buffers of bodies' positions at the
    /// start, and at the end.
    ///
    /// # Errors
    /// Those of [`Gpu::encode_step`](crate::Gpu::encode_step).
    pub fn encode_step(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        [starts, ends]: [&[(BodyId, &wgpu::Buffer)]; 2],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentStep, Error> {
        let Job { scene, plan, .. } = job;
        self.gpu.check_lost()?;
        let starts = checked(scene, starts, "positions")?;
        let mut ends = checked(scene, ends, "end positions")?;
        for (&body, &buffer) in &starts {
            // A body without end positions does not move.
            if scene.body(body)?.end_positions().is_none() {
                ends.entry(body).or_insert(buffer);
            }
        }
        let resident = encoded([starts, ends]);
        self.turn_to(Motion::Moving);
        if !self.is_held(job, clusterings) {
            let bodies = plan.parts.iter().map(|part| part.id);
            let bodies = bodies.filter(|_| plan.keeps_distance());
            let of_elements = SHARE * n_vertices(scene, bodies.collect());
            let of = (job, clusterings);
            return Err(self.not_held("the step at once", of, of_elements));
        }
        self.update(job, clusterings, &resident, &mut Stats::default())?;
        self.ask_kept(scene, plan)?;
        self.encode_work(job, &resident, encoder)?;
        let pass_buffers = &self.lane.pass_buffers;
        let of_kinds = |kinds: &[Part]| {
            let parts = plan.parts.iter();
            let numbers = parts.filter(|part| kinds.contains(&part.part));
            numbers.map(|part| part.n_elements).sum()
        };
        Ok(ResidentStep {
            pairs: pass_buffers.unsure.buffer().clone(),
            times: pass_buffers.times.buffer().clone(),
            touches_by_offset: u64::from(TOUCHES_BY) * COUNTER,
            counts: pass_buffers.counters.buffer().clone(),
            n_pairs_offset: u64::from(N_UNSURE_LISTED) * COUNTER,
            pairs_capacity: pass_buffers.capacities().unsure,
            first_vertex: of_kinds(&[Part::Edges]),
            first_face: of_kinds(&[Part::Edges, Part::Vertices]),
            parts: parts(plan),
        })
    }

    /// Encodes how far vertices may move as one pass: at most `most`, and not at all those of
    /// fixed bodies.
    ///
    /// # Errors
    /// Those of [`Gpu::encode_safe_distances`](crate::Gpu::encode_safe_distances).
    pub fn encode_safe(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        positions: &[(BodyId, &wgpu::Buffer)],
        (most, query): (f64, &Query),
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentSafe, Error> {
        self.gpu.check_lost()?;
        let positions = checked(job.scene, positions, "positions")?;
        self.turn_to(Motion::Moving);
        if !self.is_held(job, clusterings) {
            let of_elements = 3 * SHARE * n_vertices(job.scene, query.bodies_of(job.scene));
            let of = (job, clusterings);
            return Err(self.not_held("the bodies at once", of, of_elements));
        }
        let resident = encoded([positions.clone(), positions]);
        self.update(job, clusterings, &resident, &mut Stats::default())?;
        let held = self.with_bare(job.scene, query)?;
        self.ask_safe(job.scene, &held, most, |body| {
            match query.fixed.contains(&body) {
                true => 0.0,
                false => most,
            }
        })?;
        let (mut bodies, mut n) = (Vec::with_capacity(held.len()), 0);
        for (body, len) in held {
            bodies.push(ResidentVertices {
                body,
                // Vertices fit 32 bits, or their limits would not have been sent.
                first: n as u32,
                len: len as u32,
                topology_stamp: job.scene.body(body)?.topology_stamp(),
            });
            n += len;
        }
        bodies.sort_unstable_by_key(|vertices| vertices.body);
        let shares = &mut self.lane.pass_buffers.shares;
        shares.resize(&self.gpu, n)?;
        // Those before are overwritten.
        self.safe_stamp = new_stamp();
        self.encode_work(job, &resident, encoder)?;
        Ok(ResidentSafe {
            distances: self.lane.pass_buffers.shares.buffer().clone(),
            bodies,
            stamp: self.safe_stamp,
        })
    }

    /// The bodies of the world, then those without elements that a query is about: nothing is near
    /// their vertices. Each with how many vertices it has.
    fn with_bare(&self, scene: &Scene, query: &Query) -> Result<Vec<(BodyId, u64)>, Error> {
        let mut bodies = Vec::from_iter(self.world.bodies());
        for body in query.bodies_of(scene) {
            if self.world.number(body).is_none() {
                bodies.push((body, count(scene.body(body)?.n_vertices())));
            }
        }
        Ok(bodies)
    }

    /// Encodes how vertices move towards wished positions, which become those that they reach.
    ///
    /// # Errors
    /// Those of [`Gpu::encode_truncate`](crate::Gpu::encode_truncate).
    pub fn encode_truncate(
        &mut self,
        scene: &Scene,
        safe: &ResidentSafe,
        [starts, ends]: [&[(BodyId, &wgpu::Buffer)]; 2],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), Error> {
        self.gpu.check_lost()?;
        if safe.stamp != self.safe_stamp {
            return Err(Error::Gpu {
                what: "these safe distances are not the last ones that were encoded by this \
                       detector: encode them again"
                    .to_owned(),
            });
        }
        let starts = by_body(starts, "positions")?;
        let ends = by_body(ends, "end positions")?;
        let held = safe.bodies.iter();
        let held: BTreeMap<_, _> = held.map(|vertices| (vertices.body, vertices)).collect();
        refuse_shared(&held, &starts, &ends)?;
        let mut recording = Recording::default();
        recording.stage("truncate");
        for (&body, &end) in &ends {
            let refused = |why: &str| Error::Gpu {
                what: format!("body {body}: {why}"),
            };
            let vertices = held.get(&body);
            let vertices = vertices.ok_or_else(|| refused("it has no safe distances"))?;
            if scene.body(body)?.topology_stamp() != vertices.topology_stamp {
                return Err(refused(
                    "it was re-meshed, or its edges were set, after its safe distances were \
                     encoded: encode them again",
                ));
            }
            let start = starts.get(&body);
            let &start = start.ok_or_else(|| refused("it has end positions alone"))?;
            if start == end {
                return Err(refused(
                    "its end positions are in the buffer of its positions",
                ));
            }
            let n_vertices = u64::from(vertices.len);
            if n_vertices == 0 {
                continue;
            }
            let most = self.gpu.max_binding();
            let of_caller = |label, buffer| positions_in(body, buffer, label, n_vertices, most);
            let shares = Slice {
                label: "safe distances",
                buffer: safe.distances.clone(),
                bytes: safe.distances.size(),
            };
            let bindings = Truncate {
                shares: Read::of_caller(shares),
                starts: Read::of_caller(of_caller("positions", start)?),
                ends: Write::of_caller(of_caller("end positions", end)?),
                params: Uniform(Params {
                    first: vertices.first,
                    count: vertices.len,
                    ..Params::default()
                }),
            };
            let groups = Workgroups::Known(n_vertices.div_ceil(u64::from(GROUP)));
            recording.launch(&self.gpu.kernels.truncate, &bindings, groups);
        }
        if !self.truncations.has_sent(&recording) {
            // Those before may not have been submitted: they keep their parameters.
            self.truncations = Launcher::default();
        }
        self.truncations
            .encode(&self.gpu, &recording, None, encoder)
    }

    /// Encodes all work of what was sent.
    fn encode_work(
        &mut self,
        job: Job<'_>,
        resident: &ResidentEnds<'_>,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), Error> {
        let Job { scene, plan, .. } = job;
        let of = (scene, job.workers);
        self.world
            .encode_positions(&self.gpu, of, self.lane.motion, resident, encoder);
        self.send_rules(plan)?;
        let cells = self.cells_wanted(plan);
        let capacities = self.first_capacities(cells)?;
        let work = self.whole(plan);
        self.lane.is_encoded = true;
        let recording = self.record(plan, work.as_ref(), capacities, cells)?;
        let launcher = &mut self.lane.launcher;
        launcher.encode(&self.gpu, &recording, None, encoder)
    }

    /// The positions of a body on the device, see [`Gpu::positions`](crate::Gpu::positions).
    pub fn positions_of(&self, id: BodyId, body: &Body) -> Option<(&wgpu::Buffer, u64)> {
        match body.positions() {
            Positions::F32(_) => self.world.positions_of(id, body.positions_stamp()),
            Positions::F64(_) => None,
        }
    }

    /// Reads the counters of the encoded frame and step, and grows the buffers that were too small.
    /// Returns whether none was.
    ///
    /// # Errors
    /// Those of [`Gpu::grow`](crate::Gpu::grow).
    pub async fn make_room(&mut self) -> Result<bool, Error> {
        self.gpu().check_lost()?;
        let mut is_complete = true;
        for _ in 0..2 {
            is_complete &= self.make_own_buffers().await?;
            std::mem::swap(&mut self.lane, &mut self.other);
        }
        Ok(is_complete)
    }

    async fn make_own_buffers(&mut self) -> Result<bool, Error> {
        if !self.lane.is_encoded {
            return Ok(true);
        }
        let capacities = self.lane.pass_buffers.capacities();
        let counters = read(&self.gpu, &self.lane.pass_buffers.counters.all()).await?;
        let counts = PassCounts::new(&bytemuck::pod_collect_to_vec::<u8, Counter>(&counters));
        match counts.judge(self.gpu(), capacities, self.budget_for_buffers()) {
            NextPass::Complete => Ok(true),
            NextPass::Grow(larger) => {
                self.grow_to(larger);
                Ok(false)
            }
            NextPass::Split => {
                let larger = counts.larger(self.gpu(), capacities);
                Err(self.too_small("the plan at once", larger))
            }
        }
    }
}

/// Positions in buffers of the caller's, of a question that is encoded.
fn encoded(buffers: [BTreeMap<BodyId, &wgpu::Buffer>; 2]) -> ResidentEnds<'_> {
    ResidentEnds {
        buffers,
        is_encoded: true,
    }
}

/// How many vertices some bodies have together, each once.
fn n_vertices(scene: &Scene, mut bodies: Vec<BodyId>) -> u64 {
    bodies.sort_unstable();
    bodies.dedup();
    let own = |id: BodyId| count(scene.body_in(id.slot()).n_vertices());
    bodies.into_iter().map(own).sum()
}

/// Buffers by their bodies. Refuses a body that has two.
fn by_body<'a>(
    buffers: &[(BodyId, &'a wgpu::Buffer)],
    what: &str,
) -> Result<BTreeMap<BodyId, &'a wgpu::Buffer>, Error> {
    let mut held = BTreeMap::new();
    for &(body, buffer) in buffers {
        if held.insert(body, buffer).is_some() {
            return Err(Error::Gpu {
                what: format!("body {body}: its {what} are given twice"),
            });
        }
    }
    Ok(held)
}

/// Refuses end positions in a buffer that holds what another body reads or writes. Bodies without
/// vertices do neither.
fn refuse_shared(
    held: &BTreeMap<BodyId, &ResidentVertices>,
    starts: &BTreeMap<BodyId, &wgpu::Buffer>,
    ends: &BTreeMap<BodyId, &wgpu::Buffer>,
) -> Result<(), Error> {
    let is_empty = |body: &BodyId| held.get(body).is_some_and(|vertices| vertices.len == 0);
    let all = [("end positions", ends), ("positions", starts)];
    let mut all: Vec<(&wgpu::Buffer, BodyId, &str)> = all
        .into_iter()
        .flat_map(|(what, buffers)| {
            buffers
                .iter()
                .map(move |(&body, &buffer)| (buffer, body, what))
        })
        .collect();
    // Stable: of each buffer, end positions come first.
    all.sort_by_key(|of| of.0);
    for same in all.chunk_by(|a, b| a.0 == b.0) {
        let mut same = same.iter().filter(|(_, body, _)| !is_empty(body));
        let Some((_, body, "end positions")) = same.next() else {
            continue;
        };
        if let Some((_, other, what)) = same.find(|(_, other, _)| other != body) {
            return Err(Error::Gpu {
                what: format!(
                    "body {body}: its end positions are in the buffer of the {what} of body {other}"
                ),
            });
        }
    }
    Ok(())
}

/// Buffers by their bodies. Refuses those that do not hold a body's positions, or cannot be copied
/// from.
fn checked<'a>(
    scene: &Scene,
    buffers: &[(BodyId, &'a wgpu::Buffer)],
    what: &str,
) -> Result<BTreeMap<BodyId, &'a wgpu::Buffer>, Error> {
    let copied = (wgpu::BufferUsages::COPY_SRC, "COPY_SRC");
    for &(body, buffer) in buffers {
        let n_vertices = count(scene.body(body)?.n_vertices());
        check_holds(body, buffer, what, n_vertices, copied)?;
    }
    by_body(buffers, what)
}

/// Refuses a buffer without room for positions, or without a usage.
fn check_holds(
    body: BodyId,
    buffer: &wgpu::Buffer,
    what: &str,
    n_vertices: u64,
    (usage, name): (wgpu::BufferUsages, &str),
) -> Result<(), Error> {
    let needed = 12 * n_vertices;
    if buffer.size() < needed {
        return Err(Error::Gpu {
            what: format!(
                "body {body}: its {what} take {needed} bytes, the buffer has {}",
                buffer.size()
            ),
        });
    }
    if !buffer.usage().contains(usage) {
        return Err(Error::Gpu {
            what: format!("body {body}: the buffer of its {what} lacks the usage {name}"),
        });
    }
    Ok(())
}

/// The positions in a buffer that the caller gave, of which the device binds so many bytes at most.
fn positions_in(
    body: BodyId,
    buffer: &wgpu::Buffer,
    label: &'static str,
    n_vertices: u64,
    most: u64,
) -> Result<Slice, Error> {
    let storage = (wgpu::BufferUsages::STORAGE, "STORAGE");
    check_holds(body, buffer, label, n_vertices, storage)?;
    let bytes = 12 * n_vertices;
    if bytes > most {
        return Err(Error::Gpu {
            what: format!(
                "body {body}: its {label} take {bytes} bytes, and the device binds at most {most}"
            ),
        });
    }
    Ok(Slice {
        label,
        buffer: buffer.clone(),
        bytes,
    })
}

/// The numbers of all parts.
fn parts(plan: &Plan) -> Vec<ResidentPart> {
    let parts = plan.parts.iter().map(|part| ResidentPart {
        body: part.id,
        part: part.part,
        first: part.first.raw(),
        len: part.n_elements,
    });
    parts.collect()
}
