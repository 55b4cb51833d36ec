//! The clusterings of a detector: one per body and part, whoever asks.
//!
//! ```text
//!                        Clusterings: by slot of the body, then by part
//!                       /            |            |            \
//!   intersections (CPU)      steps, near pairs      distance      a device
//!   boxes, culled clusters   boxes at both ends     boxes         buffers
//! ```
//!
//! Each of these holds its clusterings by `Arc`, and beside them what else it needs. When it begins
//! a question it asks for the clusterings that are shared now: they are made for a body that is new
//! or was re-meshed, and dropped with their body. What more a question needs of a clustering (which
//! elements share vertices, the rings of vertices, local faces) is found when it is first needed,
//! within the clustering.
//!
//! A body that has flowed away from its clusters is clustered again, for all:
//! [`renew_if_stale`](Clusterings::renew_if_stale) decides that. Whoever has boxes judges by them,
//! after finding all of a frame; for a device, which computes boxes itself, a sample of the
//! clusters is judged before.
//!
//! No answer depends on the pose in which a body was clustered. So questions of several scenes may
//! take turns.

mod bytes_held;
mod fit;
mod store;
#[cfg(test)]
mod tests;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::boxes;
use crate::bvh::clusters::Clustering;
use crate::query::progress::{CancelToken, Control};
use crate::query::settings::{Recluster, Settings};
use crate::scene::elements::{Elements, Part};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::ElementIx;
use crate::scene::{Body, Scene};
#[cfg(feature = "gpu")]
use crate::search::runner::Job;
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::workers::Workers;
use crate::workers::clock::Instant;
use crate::workers::tuning::Tuning;

use bytes_held::BytesHeld;
#[cfg(feature = "gpu")]
use fit::sampled_spread;
pub(crate) use fit::{Fit, spread};
pub(crate) use store::{Clustered, Store};

/// A part of a body whose clusters are asked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyPart<'a> {
    id: BodyId,
    body: &'a Body,
    part: Part,
    /// Whether the asker needs [local faces](Clustering::local_faces).
    local_faces: bool,
}

/// The clusterings of a detector. Clones share them.
#[derive(Debug, Clone)]
pub(crate) struct Clusterings(Arc<Mutex<Entries>>);

/// The clusterings that are known, by slot of the body.
#[derive(Debug)]
pub(crate) struct Entries {
    slots: Vec<BodyClusterings>,
    bytes_held: BytesHeld,
    /// The arrangement of the scene of which the outdated were dropped last.
    seen: u64,
    recluster: Recluster,
    tuning: Tuning,
}

/// The clusterings of one body.
#[derive(Debug, Default)]
struct BodyClusterings {
    /// The stamp of the topology that was clustered; 0 for none.
    topology_stamp: u64,
    parts: [Option<Arc<Clustering>>; PARTS],
    /// For devices.
    #[cfg(feature = "gpu")]
    samples: [Sampled; PARTS],
}

impl BodyClusterings {
    fn bytes(&self) -> usize {
        let parts = self.parts.iter().flatten();
        parts.map(|clustering| clustering.bytes()).sum()
    }
}

/// How well a sample of the clusters has fitted, and the stamp of the positions that were judged
/// last.
#[cfg(feature = "gpu")]
#[derive(Debug, Default, Clone, Copy)]
struct Sampled {
    stamp: u64,
    fit: Fit,
}

/// The elements as given, and those derived from them: vertices, edges, faces.
const PARTS: usize = 4;

impl<'a> BodyPart<'a> {
    pub fn new(id: BodyId, body: &'a Body, part: Part) -> Self {
        BodyPart {
            id,
            body,
            part: body.canonical(part),
            local_faces: false,
        }
    }

    /// The same, with [local faces](Clustering::local_faces) if they are needed.
    pub fn with_local_faces(self, local_faces: bool) -> Self {
        BodyPart {
            local_faces,
            ..self
        }
    }

    fn ix(&self) -> usize {
        match self.part {
            Part::Given => 0,
            Part::Vertices => 1,
            Part::Edges => 2,
            Part::Faces => 3,
        }
    }

    /// Clusters the part in the body's current pose. Nobody else does that.
    fn cluster(&self, control: &Control) -> Result<Clustering, Error> {
        let (elements, positions) = (self.body.part(self.part), self.body.positions());
        let centers = boxes::centers(elements, positions);
        let go_on = || !control.token().is_some_and(CancelToken::is_cancelled);
        let clustering = Clustering::new(elements, centers, self.local_faces, &go_on);
        let mut clustering = clustering.ok_or(Error::Cancelled)?;
        if let (Part::Vertices, Elements::Points(vertices)) = (self.part, &clustering.corners) {
            // Vertices are numbered as positions are.
            clustering.order = vertices.iter().map(|&[ix]| ElementIx::new(ix)).collect();
        }
        Ok(clustering)
    }

    /// Adds what is needed besides to a clustering that was made for somebody else.
    ///
    /// # Errors
    /// Threads that do not start.
    fn complete(&self, clustering: &Clustering, workers: &Workers) -> Result<(), Error> {
        if self.local_faces && !clustering.knows_local_faces() {
            let n = clustering.order.len();
            workers.install(n, || clustering.find_local_faces())?;
        }
        Ok(())
    }
}

impl Clusterings {
    /// None is known yet.
    pub fn new(settings: &Settings) -> Self {
        Clusterings(Arc::new(Mutex::new(Entries {
            slots: Vec::new(),
            bytes_held: BytesHeld::default(),
            seen: 0,
            recluster: settings.recluster,
            tuning: settings.tuning,
        })))
    }

    /// What is known; whoever else asks waits.
    pub fn lock(&self) -> MutexGuard<'_, Entries> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The same, for a question about a scene: if that has fewer bodies than were known, what is
    /// outdated is dropped.
    pub fn open(&self, scene: &Scene) -> MutexGuard<'_, Entries> {
        let mut known = self.lock();
        known.settle();
        if known.slots.len() > scene.n_bodies() && known.seen != scene.arrangement() {
            known.forget_outdated(scene);
            known.seen = scene.arrangement();
        }
        known
    }

    /// The clusters of a part of a body. `own` are those of its present topology that the asker
    /// has, if any.
    ///
    /// # Errors
    /// Threads that do not start; cancellation.
    pub fn of(
        &self,
        body_part: BodyPart<'_>,
        own: Option<&Arc<Clustering>>,
        work: Work<'_>,
        stats: &mut Stats,
    ) -> Result<Arc<Clustering>, Error> {
        let mut known = self.lock();
        let clustering = match known.find(body_part, own) {
            Some(clustering) => clustering,
            None => known.make(body_part, work, stats)?,
        };
        Ok(Arc::clone(clustering))
    }

    /// The clusters of all parts of a frame, for a device, which computes boxes itself. Whether a
    /// body has flowed away from its clusters is judged by a sample of them, if `judges` says so:
    /// the host does not know the pose of all bodies.
    ///
    /// # Errors
    /// Threads that do not start; cancellation.
    #[cfg(feature = "gpu")]
    pub fn of_frame(
        &self,
        job: Job<'_>,
        judges: impl Fn(BodyId) -> bool,
        stats: &mut Stats,
    ) -> Result<Vec<Arc<Clustering>>, Error> {
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        let work = Work { workers, control };
        let mut known = self.open(scene);
        let mut all = Vec::with_capacity(plan.parts.len());
        for (ix, part) in plan.numbered_parts() {
            let body = plan.body(scene, ix);
            let body_part = BodyPart::new(part.id, body, part.part);
            let found = known.find(body_part, None).cloned();
            let is_new = found.is_none();
            let mut clustering = match found {
                Some(clustering) => clustering,
                None => {
                    control.step(ix.raw().into(), plan.parts.len() as u64)?;
                    Arc::clone(known.make(body_part, work, stats)?)
                }
            };
            let of_body = &known.slots[part.id.index()];
            let mut sampled = of_body.samples[body_part.ix()];
            let stamp = body.positions_stamp();
            if is_new || (sampled.stamp != stamp && judges(part.id)) {
                sampled.stamp = stamp;
                let spread = sampled_spread(&clustering, body.positions());
                if known.is_stale(&mut sampled.fit, spread) {
                    clustering = Arc::clone(known.renew(body_part, work, stats)?);
                    sampled.fit = Fit::UNKNOWN;
                    let spread = sampled_spread(&clustering, body.positions());
                    sampled.fit.note(spread);
                }
                known.slots[part.id.index()].samples[body_part.ix()] = sampled;
            }
            all.push(clustering);
        }
        Ok(all)
    }

    /// Whether a body's elements, as given, are clustered.
    pub fn has(&self, id: BodyId, body: &Body) -> bool {
        let body_part = BodyPart::new(id, body, Part::Given);
        self.lock().find(body_part, None).is_some()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let known = self.lock();
        let of_clusterings = known.bytes_held.total(|slot| known.slots[slot].bytes());
        size_of_val(&known.slots[..]) + of_clusterings
    }
}

impl Entries {
    /// Drops what belongs to bodies that are gone or were re-meshed.
    pub fn forget_outdated(&mut self, scene: &Scene) {
        for (slot, of_body) in self.slots.iter_mut().enumerate() {
            let body = scene.holds(slot).then(|| scene.body_in(slot as u32));
            if of_body.topology_stamp != body.map_or(0, Body::topology_stamp) {
                *of_body = BodyClusterings::default();
                self.bytes_held.touch(slot);
            }
        }
    }

    /// The questions so far are over.
    fn settle(&mut self) {
        self.bytes_held.settle(|slot| self.slots[slot].bytes());
    }

    /// The clusters of a part of a body. Those that only the asker has are shared from now on:
    /// questions of several scenes may have taken turns.
    pub fn find(
        &mut self,
        body_part: BodyPart<'_>,
        own: Option<&Arc<Clustering>>,
    ) -> Option<&Arc<Clustering>> {
        let stamp = body_part.body.topology_stamp();
        let known = self.slots.get(body_part.id.index());
        let is_known = known.is_some_and(|of_body| {
            of_body.topology_stamp == stamp && of_body.parts[body_part.ix()].is_some()
        });
        if !is_known && let Some(own) = own {
            self.put(body_part, Arc::clone(own));
        }
        let of_body = self.slots.get(body_part.id.index())?;
        self.bytes_held.touch(body_part.id.index());
        let part = of_body.parts[body_part.ix()].as_ref();
        part.filter(|_| of_body.topology_stamp == stamp)
    }

    /// Clusters a part of a body, and books it.
    ///
    /// # Errors
    /// Threads that do not start; cancellation.
    pub fn make(
        &mut self,
        body_part: BodyPart<'_>,
        work: Work<'_>,
        stats: &mut Stats,
    ) -> Result<&Arc<Clustering>, Error> {
        let n_elements = body_part.body.part(body_part.part).len();
        let Work { workers, control } = work;
        let clustering = workers.install(n_elements, || body_part.cluster(control))??;
        stats.n_clustered += 1;
        Ok(self.put(body_part, Arc::new(clustering)))
    }

    fn put(&mut self, body_part: BodyPart<'_>, clustering: Arc<Clustering>) -> &Arc<Clustering> {
        let (slot, stamp) = (body_part.id.index(), body_part.body.topology_stamp());
        if self.slots.len() <= slot {
            self.slots.resize_with(slot + 1, BodyClusterings::default);
        }
        self.bytes_held.touch(slot);
        let of_body = &mut self.slots[slot];
        if of_body.topology_stamp != stamp {
            *of_body = BodyClusterings {
                topology_stamp: stamp,
                ..BodyClusterings::default()
            };
        }
        #[cfg(feature = "gpu")]
        {
            of_body.samples[body_part.ix()] = Sampled::default();
        }
        of_body.parts[body_part.ix()].insert(clustering)
    }

    /// Clusters a part anew, for all who share it, if it has flowed away from its clusters, and
    /// books that. `spread` says how well they fit the pose at hand, `fit` how well they have
    /// fitted at best.
    ///
    /// # Errors
    /// Threads that do not start; cancellation.
    pub fn renew_if_stale(
        &mut self,
        body_part: BodyPart<'_>,
        (fit, spread): (&mut Fit, f64),
        work: Work<'_>,
        stats: &mut Stats,
    ) -> Result<Option<Arc<Clustering>>, Error> {
        if !self.is_stale(fit, spread) {
            return Ok(None);
        }
        let start = Instant::now();
        let clustering = Arc::clone(self.renew(body_part, work, stats)?);
        stats.add_ms("clustering", start.elapsed().as_secs_f64() * 1e3);
        Ok(Some(clustering))
    }

    /// Whether a body has flowed so far away from its clusters that it is to be clustered anew.
    fn is_stale(&self, fit: &mut Fit, spread: f64) -> bool {
        fit.is_stale(spread, &self.tuning) && self.recluster == Recluster::Auto
    }

    fn renew(
        &mut self,
        body_part: BodyPart<'_>,
        work: Work<'_>,
        stats: &mut Stats,
    ) -> Result<&Arc<Clustering>, Error> {
        stats.n_reclustered += 1;
        self.make(body_part, work, stats)
    }
}
