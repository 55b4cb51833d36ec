//! What one backend keeps beside the clusterings: by slot of the body, made anew with them.

use std::sync::Arc;

use super::bytes_held::BytesHeld;
use super::{BodyPart, Clusterings};
use crate::bvh::clusters::Clustering;
use crate::plan::QueryPart;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::{Body, Scene};
use crate::search::runner::Job;
use crate::search::stats::Stats;
use crate::search::work::Work;

/// What a backend keeps of a body, or of a part of it: boxes, and whatever else belongs to a
/// clustering.
pub(crate) trait Clustered: Send {
    /// The stamp of the topology that was clustered.
    fn topology_stamp(&self) -> u64;

    /// What it belongs to.
    fn clustering(&self) -> &Arc<Clustering>;

    /// Bytes held, without those of the clustering.
    fn bytes(&self) -> usize;
}

/// What is kept, by slot of the body: one per body, or one per part (vertices, edges, faces).
#[derive(Debug)]
pub(crate) struct Store<T, const PARTS: usize = 1> {
    slots: Vec<[Option<Box<T>>; PARTS]>,
    bytes_held: BytesHeld,
    /// The arrangement of the scene whose removed bodies were dropped last.
    seen: u64,
}

impl<T, const PARTS: usize> Default for Store<T, PARTS> {
    fn default() -> Self {
        Store {
            slots: Vec::new(),
            bytes_held: BytesHeld::default(),
            seen: 0,
        }
    }
}

impl<T, const PARTS: usize> Store<T, PARTS> {
    /// Where a part is among those of its body.
    #[inline(always)]
    pub fn ix(part: Part) -> usize {
        let ix = match part {
            Part::Vertices => 0,
            Part::Edges => 1,
            Part::Faces | Part::Given => 2,
        };
        ix.min(PARTS - 1)
    }

    /// What is kept of a part of the frame that was last [updated](Store::update).
    ///
    /// # Panics
    /// If the part is of another frame.
    #[inline(always)]
    pub fn at(&self, part: &QueryPart) -> &T {
        self.slots[part.id.index()][Self::ix(part.part)]
            .as_deref()
            .expect("every part was clustered")
    }

    /// The same, to be changed.
    #[inline(always)]
    pub fn at_mut(&mut self, part: &QueryPart) -> &mut T {
        self.slots[part.id.index()][Self::ix(part.part)]
            .as_deref_mut()
            .expect("every part was clustered")
    }

    /// What is kept of bodies as a whole, each with its slot, in the order of slots.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (usize, &mut T)> {
        let parts = self.slots.iter_mut().enumerate();
        parts.filter_map(|(slot, parts)| {
            let kept = parts[Self::ix(Part::Given)].as_deref_mut()?;
            Some((slot, kept))
        })
    }
}

impl<T: Clustered, const PARTS: usize> Store<T, PARTS> {
    /// Drops what belongs to bodies that are gone or were re-meshed.
    pub fn forget_outdated(&mut self, scene: &Scene) {
        for (slot, parts) in self.slots.iter_mut().enumerate() {
            let body = scene.holds(slot).then(|| scene.body_in(slot as u32));
            let stamp = body.map(Body::topology_stamp);
            for kept in parts {
                let outdated = kept.take_if(|kept| Some(kept.topology_stamp()) != stamp);
                if outdated.is_some() {
                    self.bytes_held.touch(slot);
                }
            }
        }
    }

    /// Bytes held, without those of the clusterings.
    pub fn bytes(&self) -> usize {
        self.bytes_held.total(|slot| bytes_of(&self.slots[slot]))
    }

    /// Brings the store up to a frame: drops what belongs to bodies that are gone, and makes what
    /// is missing, or belongs to another clustering than the one that is shared now. `local_faces`:
    /// whether clusterings are to have them.
    ///
    /// # Errors
    /// Cancellation; threads that do not start.
    pub fn update(
        &mut self,
        job: Job<'_>,
        (clusterings, local_faces): (&Clusterings, bool),
        stats: &mut Stats,
        make: impl Fn(&Body, &Arc<Clustering>) -> T,
    ) -> Result<(), Error> {
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        // Parts come part after part: the last one need not be of the last body.
        let slots = plan.parts.iter().map(|part| part.id.index() + 1);
        let n_slots = slots.max().unwrap_or(0);
        if self.slots.len() < n_slots {
            self.slots.resize_with(n_slots, || [const { None }; PARTS]);
        }
        if self.slots.len() > scene.n_bodies() && self.seen != scene.arrangement() {
            self.seen = scene.arrangement();
            for (slot, parts) in self.slots.iter_mut().enumerate() {
                if !scene.holds(slot) && parts.iter().any(Option::is_some) {
                    *parts = [const { None }; PARTS];
                    self.bytes_held.touch(slot);
                }
            }
        }
        self.bytes_held.settle(|slot| bytes_of(&self.slots[slot]));
        let mut known = clusterings.open(scene);
        for (ix, part) in plan.numbered_parts() {
            self.bytes_held.touch(part.id.index());
            let body = plan.body(scene, ix);
            let body_part = BodyPart::new(part.id, body, part.part).with_local_faces(local_faces);
            let kept = &mut self.slots[part.id.index()][Self::ix(part.part)];
            let own = kept.as_deref();
            let own = own.filter(|own| own.topology_stamp() == body.topology_stamp());
            let own = own.map(Clustered::clustering);
            let clustering = match known.find(body_part, own) {
                Some(clustering) => clustering,
                None => {
                    control.step(ix.raw().into(), plan.parts.len() as u64)?;
                    known.make(body_part, Work { workers, control }, stats)?
                }
            };
            if own.is_none_or(|own| !Arc::ptr_eq(own, clustering)) {
                body_part.complete(clustering, workers)?;
                *kept = Some(Box::new(make(body, clustering)));
            }
            stats.n_clusters += clustering.n_clusters() as u64;
        }
        Ok(())
    }
}

fn bytes_of<T: Clustered, const PARTS: usize>(parts: &[Option<Box<T>>; PARTS]) -> usize {
    let parts = parts.iter().flatten();
    parts.map(|kept| kept.bytes()).sum()
}
