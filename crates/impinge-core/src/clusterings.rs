//! The life of what a backend keeps of each body: made for a body that is new or was re-meshed, made anew for one that
//! has flowed away from its clusters, and dropped with its body.
//!
//! Both backends and the steps keep their caches in a [`Store`] and ask a [`Fit`] whether clusters still fit. When
//! they ask differs: the CPU after it has found all boxes of a frame, the GPU before it sends clusters to the device.

use crate::clock::Instant;
use crate::elements::Part;
use crate::error::Error;
use crate::grouping::bounds::Bounds;
#[cfg(feature = "gpu")]
use crate::grouping::clusters::Clustering;
#[cfg(feature = "gpu")]
use crate::hull;
#[cfg(feature = "gpu")]
use crate::ids::BodyId;
#[cfg(feature = "gpu")]
use crate::index::ClusterIx;
use crate::plan::Layer;
#[cfg(feature = "gpu")]
use crate::positions::Positions;
use crate::run::Job;
use crate::scene::{Body, Scene};
use crate::stats::Statistics;
use crate::tuning::Tuning;
use crate::workers::Workers;

/// What a backend keeps of a body, or of a part of it.
pub(crate) trait Clustered: Send {
    /// The stamp of the topology that was clustered.
    fn topology_stamp(&self) -> u64;

    /// How many clusters there are.
    fn n_clusters(&self) -> usize;
}

/// What is kept, by slot of the body: one per body, or one per part (vertices, edges, faces).
#[derive(Debug)]
pub(crate) struct Store<T, const PARTS: usize = 1> {
    slots: Vec<[Option<Box<T>>; PARTS]>,
}

impl<T, const PARTS: usize> Default for Store<T, PARTS> {
    fn default() -> Self {
        Store { slots: Vec::new() }
    }
}

impl<T, const PARTS: usize> Store<T, PARTS> {
    /// Where a part is among those of its body.
    #[inline(always)]
    fn ix(part: Part) -> usize {
        let ix = match part {
            Part::Vertices => 0,
            Part::Edges => 1,
            Part::Faces | Part::Given => 2,
        };
        ix.min(PARTS - 1)
    }

    /// What is kept of a body as a whole, if anything is.
    #[cfg(feature = "gpu")]
    pub fn of(&self, id: BodyId) -> Option<&T> {
        self.slots.get(id.index())?[Self::ix(Part::Given)].as_deref()
    }

    /// What is kept of a layer of the frame that was last [updated](Store::update).
    ///
    /// # Panics
    /// If the layer is of another frame.
    #[inline(always)]
    pub fn at(&self, layer: &Layer) -> &T {
        self.slots[layer.id.index()][Self::ix(layer.part)]
            .as_deref()
            .expect("every layer was clustered")
    }

    /// The same, to be changed.
    #[inline(always)]
    pub fn at_mut(&mut self, layer: &Layer) -> &mut T {
        self.slots[layer.id.index()][Self::ix(layer.part)]
            .as_deref_mut()
            .expect("every layer was clustered")
    }

    /// All that is kept.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.slots.iter().flatten().filter_map(Option::as_deref)
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
                if kept.as_ref().map(|kept| kept.topology_stamp()) != stamp {
                    *kept = None;
                }
            }
        }
    }

    /// Brings the store up to a frame: drops what belongs to bodies that are gone, and makes what is missing, of
    /// another topology, or stale.
    ///
    /// # Errors
    /// Cancellation; threads that do not start.
    pub fn update(
        &mut self,
        job: Job<'_>,
        stats: &mut Statistics,
        mut is_stale: impl FnMut(&mut T, &Layer, &Body) -> bool,
        mut make: impl FnMut(&Body, &Layer) -> T + Send,
    ) -> Result<(), Error> {
        let Job {
            scene,
            frame,
            workers,
            control,
        } = job;
        // Layers come part after part: the last one need not be of the last body.
        let slots = frame.layers.iter().map(|layer| layer.id.index() + 1);
        let n_slots = slots.max().unwrap_or(0);
        if self.slots.len() < n_slots {
            self.slots.resize_with(n_slots, || [const { None }; PARTS]);
        }
        if self.slots.len() > scene.n_bodies() {
            for (slot, parts) in self.slots.iter_mut().enumerate() {
                if !scene.holds(slot) {
                    *parts = [const { None }; PARTS];
                }
            }
        }
        for (ix, layer) in frame.numbered_layers() {
            let body = frame.body(scene, ix);
            let kept = &mut self.slots[layer.id.index()][Self::ix(layer.part)];
            let known = kept.as_mut();
            let known = known.filter(|kept| kept.topology_stamp() == body.topology_stamp());
            let was_known = known.is_some();
            if known.is_none_or(|kept| is_stale(kept, layer, body)) {
                control.step(ix.raw().into(), frame.layers.len() as u64)?;
                let n_elements = body.part(layer.part).len();
                let made = workers.install(n_elements, || make(body, layer))?;
                *kept = Some(Box::new(made));
                stats.n_clustered += 1;
                stats.n_reclustered += u64::from(was_known);
            }
            stats.n_clusters += kept.as_ref().map_or(0, |kept| kept.n_clusters() as u64);
        }
        Ok(())
    }
}

/// Makes anew what is stale, and books it.
///
/// # Errors
/// Threads that do not start.
pub(crate) fn make_anew<T: Send>(
    workers: &Workers,
    n_elements: usize,
    stats: &mut Statistics,
    make: impl FnOnce() -> T + Send,
) -> Result<T, Error> {
    let start = Instant::now();
    let made = workers.install(n_elements, make)?;
    stats.n_clustered += 1;
    stats.n_reclustered += 1;
    stats.add_ms("clustering", start.elapsed().as_secs_f64() * 1e3);
    Ok(made)
}

/// How well clusters have fitted their body at best.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    best_spread: f64,
}

impl Default for Fit {
    fn default() -> Self {
        Fit::UNKNOWN
    }
}

impl Fit {
    /// Of clusters that were not looked at yet.
    pub const UNKNOWN: Fit = Fit {
        best_spread: f64::INFINITY,
    };

    /// Takes note of the spread in the pose at hand.
    pub fn note(&mut self, spread: f64) {
        self.best_spread = self.best_spread.min(spread);
    }

    /// Takes note of the spread in the pose at hand; whether the body has flowed away from its clusters.
    pub fn is_stale(&mut self, spread: f64, tuning: &Tuning) -> bool {
        let is_stale = spread > tuning.stale_from * self.best_spread;
        self.note(spread);
        is_stale
    }
}

/// The number of clusters sampled to judge how well all of them fit.
#[cfg(feature = "gpu")]
const SAMPLES: usize = 64;

/// The [`spread`] of evenly spaced clusters. The same clusters are sampled every time.
#[cfg(feature = "gpu")]
pub(crate) fn sampled_spread(clustering: &Clustering, positions: &Positions) -> f64 {
    let n = clustering.n_clusters();
    let n_samples = n.min(SAMPLES);
    let mut whole = Bounds::EMPTY;
    let mut sum = 0.0;
    for sample in 0..n_samples {
        let cluster = ClusterIx::from_usize(sample * n / n_samples);
        let bounds = hull::of_vertices(positions, clustering.vertices(cluster));
        sum += bounds.half_area();
        whole.join(&bounds);
    }
    spread(sum, &whole)
}

/// The clusters' summed surface over that of the whole: how well they fit the pose at hand. Both are halves.
pub(crate) fn spread(surface: f64, whole: &Bounds) -> f64 {
    let whole = whole.half_area();
    if whole > 0.0 && whole.is_finite() && surface.is_finite() {
        surface / whole
    } else {
        1.0
    }
}
